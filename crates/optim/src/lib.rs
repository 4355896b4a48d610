//! Numerical optimisation: quasi-Newton methods, penalty method, least squares, sparse SQP.

mod error;
mod kkt;
mod options;
mod problem;
mod sqp;

pub use error::{BoundKind, OptionError, ProblemError};
pub use kkt::KktResiduals;
pub use problem::{Hessian, LeastSquares, Nlp, SmoothFunction, TripletPattern};
pub use sqp::{
    DenseSqp, Evaluations, NumericalTrouble, SparseSqp, SqpOptions, SqpReport, SqpStatus,
    UnmetConstraint,
};
