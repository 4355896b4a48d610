//! Numerical optimisation: quasi-Newton methods, penalty method, least squares, sparse SQP.

mod dense_qp;
mod error;
mod kkt;
mod options;
mod problem;
mod sqp;

pub use dense_qp::{
    ActiveConstraint, DenseQp, DenseQpError, DenseQpReport, DenseQpSolver, QpConstraint, QpStatus,
    Side,
};
pub use error::{BoundKind, OptionError, ProblemError};
pub use kkt::KktResiduals;
pub use problem::{Hessian, LeastSquares, Nlp, SmoothFunction, TripletPattern};
pub use sqp::{
    DenseSqp, Evaluations, NumericalTrouble, SparseSqp, SqpOptions, SqpReport, SqpStatus,
    UnmetConstraint,
};
