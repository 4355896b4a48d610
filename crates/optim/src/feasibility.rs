//! The nearby point that meets the constraints, to full accuracy.
//!
//! The violations of a problem's constraints and bounds are taken as residuals,
//!
//! ```text
//! rᵢ = cᵢ(x) − (the value in [lᵢ, uᵢ] nearest to cᵢ(x)),
//! ```
//!
//! and brought to zero by Gauss–Newton steps ([`LevenbergMarquardt`]). Constraints that are met do
//! not take part, redundant equations do no harm, and where there is a set of solutions the steps
//! are the shortest: this is the polish for a point that a penalty method or a simulation has left
//! somewhat off. The objective plays no role.

use crate::error::{BoundKind, ProblemError};
use crate::least_squares::{LeastSquaresReport, LevenbergMarquardt};
use crate::problem::{LeastSquares, Nlp, TripletPattern, check_bounds, check_pattern};
use nalgebra::DMatrix;

/// Moves `x` to a nearby point that meets the constraints and bounds of `problem`, if there is one.
/// If not, the status tells that a least-squares solution was found and the largest residual is the
/// largest violation left.
///
/// Variables with equal bounds are not moved but set to them.
///
/// # Errors
/// A problem that makes no sense, or a start where it is not finite: see [`ProblemError`].
///
/// # Examples
///
/// ```
/// use tensegra_optim::{
///     LeastSquaresOptions, LevenbergMarquardt, Nlp, StepScaling, TripletPattern,
///     restore_feasibility,
/// };
///
/// /// The unit sphere above the plane z = 1/2.
/// struct Cap;
///
/// impl Nlp for Cap {
///     fn num_variables(&self) -> usize { 3 }
///     fn num_constraints(&self) -> usize { 1 }
///     fn variable_bounds(&self, lower: &mut [f64], _: &mut [f64]) { lower[2] = 0.5; }
///     fn constraint_bounds(&self, lower: &mut [f64], upper: &mut [f64]) {
///         (lower[0], upper[0]) = (1.0, 1.0);
///     }
///     fn jacobian_pattern(&self) -> TripletPattern { TripletPattern::dense(1, 3) }
///     fn objective(&mut self, _: &[f64]) -> f64 { 0.0 }
///     fn gradient(&mut self, _: &[f64], gradient: &mut [f64]) { gradient.fill(0.0) }
///     fn constraints(&mut self, x: &[f64], values: &mut [f64]) {
///         values[0] = x.iter().map(|v| v * v).sum();
///     }
///     fn jacobian(&mut self, x: &[f64], values: &mut [f64]) {
///         for (value, x) in values.iter_mut().zip(x) { *value = 2.0 * x; }
///     }
/// }
///
/// let mut x = [0.9, 0.0, 0.45];
/// let options = LeastSquaresOptions::default().with_scaling(StepScaling::None);
/// let mut solver = LevenbergMarquardt::new(options)?;
/// let report = restore_feasibility(&mut Cap, &mut solver, &mut x)?;
/// assert!(report.is_converged() && report.largest_residual < 1e-14);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn restore_feasibility<P: Nlp>(
    problem: &mut P,
    solver: &mut LevenbergMarquardt,
    x: &mut [f64],
) -> Result<LeastSquaresReport, ProblemError> {
    let mut violations = Violations::new(problem)?;
    for ((value, lower), upper) in x.iter_mut().zip(&violations.lower).zip(&violations.upper) {
        if lower == upper {
            *value = *lower;
        }
    }
    solver.solve(&mut violations, x)
}

/// The violations of a problem's constraints, then of its variables' bounds, as residuals.
struct Violations<'a, P> {
    problem: &'a mut P,
    lower: Vec<f64>,
    upper: Vec<f64>,
    row_lower: Vec<f64>,
    row_upper: Vec<f64>,
    pattern: TripletPattern,
    entries: Vec<f64>,
    constraints: Vec<f64>,
}

impl<'a, P: Nlp> Violations<'a, P> {
    fn new(problem: &'a mut P) -> Result<Self, ProblemError> {
        let (n, m) = (problem.num_variables(), problem.num_constraints());
        let pattern = problem.jacobian_pattern();
        check_pattern("Jacobian", &pattern, m, n)?;
        let (mut lower, mut upper) = (vec![f64::NEG_INFINITY; n], vec![f64::INFINITY; n]);
        let (mut row_lower, mut row_upper) = (vec![f64::NEG_INFINITY; m], vec![f64::INFINITY; m]);
        problem.variable_bounds(&mut lower, &mut upper);
        problem.constraint_bounds(&mut row_lower, &mut row_upper);
        check_bounds(BoundKind::Variable, &lower, &upper)?;
        check_bounds(BoundKind::Constraint, &row_lower, &row_upper)?;
        Ok(Self {
            problem,
            lower,
            upper,
            row_lower,
            row_upper,
            entries: vec![0.0; pattern.len()],
            pattern,
            constraints: vec![0.0; m],
        })
    }
}

fn violation(value: f64, lower: f64, upper: f64) -> f64 {
    if value < lower {
        value - lower
    } else if value > upper {
        value - upper
    } else if value.is_nan() {
        value
    } else {
        0.0
    }
}

impl<P: Nlp> LeastSquares for Violations<'_, P> {
    fn num_variables(&self) -> usize {
        self.lower.len()
    }

    fn num_residuals(&self) -> usize {
        self.row_lower.len() + self.lower.len()
    }

    fn residuals(&mut self, x: &[f64], residuals: &mut [f64]) {
        self.problem.constraints(x, &mut self.constraints);
        let rows = self.constraints.iter().zip(&self.row_lower);
        let rows = rows.zip(&self.row_upper);
        let variables = x.iter().zip(&self.lower).zip(&self.upper);
        for (r, ((&value, &lower), &upper)) in residuals.iter_mut().zip(rows.chain(variables)) {
            *r = violation(value, lower, upper);
        }
    }

    fn jacobian(&mut self, x: &[f64], jacobian: &mut DMatrix<f64>) {
        self.problem.constraints(x, &mut self.constraints);
        self.problem.jacobian(x, &mut self.entries);
        jacobian.fill(0.0);
        for ((row, column), entry) in self.pattern.iter().zip(&self.entries) {
            let (lower, upper) = (self.row_lower[row], self.row_upper[row]);
            let value = self.constraints[row];
            let fixed = self.lower[column] == self.upper[column];
            if !fixed && (lower == upper || violation(value, lower, upper) != 0.0) {
                jacobian[(row, column)] += entry;
            }
        }
        let m = self.row_lower.len();
        for (j, &value) in x.iter().enumerate() {
            if violation(value, self.lower[j], self.upper[j]) != 0.0 {
                jacobian[(m + j, j)] = 1.0;
            }
        }
    }
}
