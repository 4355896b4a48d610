//! Numerical optimisation for motion planning: small dense and large sparse problems, solved to the
//! accuracy of the arithmetic, with a report that says what was reached.
//!
//! # Problems and solvers
//!
//! | problem | trait or type | solver | for |
//! |---|---|---|---|
//! | min f(x) | [`SmoothFunction`] | [`Bfgs`] | up to some hundred variables |
//! | | | [`Lbfgs`] | more |
//! | min ½‖r(x)‖², r(x) = 0 | [`LeastSquares`] | [`LevenbergMarquardt`] | dense Jacobians, dependent equations too |
//! | min f(x), l ≤ c(x) ≤ u, x_l ≤ x ≤ x_u | [`Nlp`] | [`DenseSqp`] | up to some 30 variables and 200 constraints |
//! | | | [`SparseSqp`] | more, with sparse derivatives |
//! | | | [`PenaltyMethod`] | a rough solution from a poor start |
//! | c(x) within its bounds, near a given x | [`Nlp`] | [`restore_feasibility`] | polishing |
//! | min ½xᵀHx + gᵀx, l ≤ Ax ≤ u, x_l ≤ x ≤ x_u | [`DenseQp`] | [`DenseQpSolver`] | H positive definite, few variables |
//! | the same over a chain of blocks, with priced rows | [`BlockTridiagonalQp`] | [`BlockTridiagonalQpSolver`] | whole paths: cost linear in the number of points |
//!
//! All functions are of real vectors and deterministic: the same problem and start give the same
//! result, bit by bit.
//!
//! # Reports
//!
//! Bad input (slices of the wrong length, contradictory bounds, functions that are not finite at
//! the start) is an error. How a run ended is not: every solver returns a report with a status
//! (converged, infeasible, a limit, numerical trouble) and measures of optimality and feasibility
//! that are taken afresh from the problem's functions, not from the solver's bookkeeping. For a
//! constrained problem the status `Infeasible` lists the constraints that cannot be met together.
//!
//! # Signs
//!
//! The Lagrangian is f(x) + λᵀc(x) + zᵀx throughout: the multiplier of a constraint is positive at
//! its upper bound and negative at its lower bound.
//!
//! # Memory
//!
//! A solver object keeps its memory between solves; use one for a sequence of similar problems.

mod block_tridiagonal_qp;
mod dense_qp;
mod error;
mod feasibility;
mod kkt;
mod least_squares;
mod line_search;
mod options;
mod penalty;
mod problem;
mod quasi_newton;
mod sqp;
mod vector;

/// The version of nalgebra whose matrices appear in this crate's interface.
pub use nalgebra;

pub use block_tridiagonal_qp::{
    BlockTridiagonalQp, BlockTridiagonalQpError, BlockTridiagonalQpReport,
    BlockTridiagonalQpSolver, BlockTridiagonalQpStatus,
};
pub use dense_qp::{
    ActiveConstraint, DenseQp, DenseQpError, DenseQpReport, DenseQpSolver, QpConstraint, QpStatus,
    Side,
};
pub use error::{BoundKind, OptionError, ProblemError};
pub use feasibility::restore_feasibility;
pub use kkt::KktResiduals;
pub use least_squares::{
    LeastSquaresOptions, LeastSquaresReport, LeastSquaresStatus, LevenbergMarquardt, StepScaling,
};
pub use line_search::{LineSearch, LineSearchOptions};
pub use penalty::{PenaltyMethod, PenaltyMinimiser, PenaltyOptions, PenaltyReport, PenaltyStatus};
pub use problem::{Hessian, LeastSquares, Nlp, SmoothFunction, TripletPattern};
pub use quasi_newton::{Bfgs, Lbfgs, MinimiseReport, MinimiseStatus, QuasiNewtonOptions};
pub use sqp::{
    DenseSqp, Evaluations, NumericalTrouble, SparseSqp, SqpOptions, SqpReport, SqpStatus,
    UnmetConstraint,
};
