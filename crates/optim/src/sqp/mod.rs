//! Sequential quadratic programming for small and for large problems.

use crate::kkt::KktResiduals;
use crate::options::options;

options! {
    /// Options of [`SparseSqp`](crate::SparseSqp) and [`DenseSqp`](crate::DenseSqp).
    pub struct SqpOptions {
        /// Most iterations: points at which derivatives are evaluated. Default 100.
        max_iterations / with_max_iterations: usize = 100,
            "be at least one" if |v| v >= 1;
        /// Largest violation of a constraint or bound at a converged point, in the units of the
        /// constraint. Default 1e-8.
        feasibility_tolerance / with_feasibility_tolerance: f64 = 1e-8,
            "be positive and finite" if |v| v > 0.0 && v.is_finite();
        /// Largest stationarity residual ‖∇f + Jᵀλ + z‖∞ at a converged point, relative to the largest
        /// of the terms that cancel in it (∇f and λᵢ∇cᵢ, the latter up to a hundred times ∇f) and to
        /// a hundredth of ∇f at the start. Default 1e-6.
        optimality_tolerance / with_optimality_tolerance: f64 = 1e-6,
            "be positive and finite" if |v| v > 0.0 && v.is_finite();
        /// Half width Δ of the first trust region |dⱼ| ≤ Δ·scaleⱼ. Default 1.
        initial_radius / with_initial_radius: f64 = 1.0,
            "be positive and finite" if |v| v > 0.0 && v.is_finite();
        /// Largest half width of the trust region. Default 1e10.
        max_radius / with_max_radius: f64 = 1e10,
            "be positive" if |v| v > 0.0;
        /// First weight ν of the violation in the exact penalty f + ν Σ violation, relative to
        /// the scale of the objective; it is raised when needed. Default 10.
        initial_penalty / with_initial_penalty: f64 = 10.0,
            "be positive and finite" if |v| v > 0.0 && v.is_finite();
    }
}

/// What a run of an SQP solver ended with.
#[derive(Debug, Clone, PartialEq)]
pub struct SqpReport {
    /// Why the run ended.
    pub status: SqpStatus,
    /// f at the final point.
    pub objective: f64,
    /// Optimality and feasibility of the final point, measured afresh from the problem's
    /// functions and the solver's multipliers.
    pub residuals: KktResiduals,
    /// Number of points at which derivatives were evaluated.
    pub iterations: usize,
    /// Number of evaluations and subproblems.
    pub evaluations: Evaluations,
}

impl SqpReport {
    /// Whether the final point meets both tolerances.
    #[must_use]
    pub fn is_converged(&self) -> bool {
        self.status == SqpStatus::Converged
    }
}

/// Why an SQP run ended.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum SqpStatus {
    /// A point that meets the feasibility and the optimality tolerance.
    Converged,
    /// A stationary point of the constraint violation that is not feasible: near it, no step
    /// reduces the sum of violations. The constraints that cannot be met together are listed,
    /// the most violated first.
    Infeasible(Vec<UnmetConstraint>),
    /// The iteration limit was reached before convergence.
    IterationLimit,
    /// No further progress could be made although the tolerances are not met.
    NumericalTrouble(NumericalTrouble),
}

/// A constraint that cannot be met together with the others.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct UnmetConstraint {
    /// Index of the constraint in the problem.
    pub constraint: usize,
    /// How far its value is from the range allowed: positive above the upper bound, negative
    /// below the lower bound.
    pub violation: f64,
}

impl UnmetConstraint {
    /// The constraints violated by more than the tolerance, the most violated first.
    pub(crate) fn list(values: &[f64], lower: &[f64], upper: &[f64], tolerance: f64) -> Vec<Self> {
        let mut unmet: Vec<Self> = values
            .iter()
            .zip(lower.iter().zip(upper))
            .enumerate()
            .filter_map(|(constraint, (value, (lower, upper)))| {
                let violation = (value - upper).max(0.0) + (value - lower).min(0.0);
                (violation.abs() > tolerance).then_some(Self {
                    constraint,
                    violation,
                })
            })
            .collect();
        unmet.sort_by(|a, b| b.violation.abs().total_cmp(&a.violation.abs()));
        unmet
    }
}

/// What stopped a run short of its tolerances.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum NumericalTrouble {
    /// The trust region shrank to the rounding error of x: derivatives that do not belong to
    /// their function, a function with a kink, or tolerances tighter than rounding permits.
    StepTooSmall,
    /// The quadratic subproblem could not be solved, even after regularisation.
    Subproblem,
    /// A derivative was NaN or infinite at a point where the functions are finite.
    NotFinite,
    /// The objective fell below −1e12 at a feasible point: it has no minimum.
    Unbounded,
}

/// How often a solver evaluated what.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Evaluations {
    /// Evaluations of the objective and constraints.
    pub functions: usize,
    /// Evaluations of the gradient and Jacobian.
    pub derivatives: usize,
    /// Evaluations of the Hessian.
    pub hessians: usize,
    /// Quadratic subproblems solved.
    pub subproblems: usize,
}

mod dense;
mod engine;
mod model;
mod sparse;
pub use dense::DenseSqp;
pub use sparse::SparseSqp;
