//! The penalty method: a constrained problem as a sequence of unconstrained ones.
//!
//! For min f(x) subject to h(x) = 0, g(x) ≥ 0 it minimises, for a growing weight c,
//!
//! ```text
//! f(x) + c Σ hⱼ(x)² + Σ (e^(−c gᵢ(x)) − 1) / c
//! ```
//!
//! by a quasi-Newton method, each stage starting where the last ended. Of an [`Nlp`]'s constraints
//! those with equal bounds are the equalities, every other finite bound of a constraint or variable
//! is an inequality; a variable with equal bounds is set to them and left alone.
//!
//! Source: S. Hernàndez Juan, J. M. Mirats Tur, "A method to generate stable, collision free
//! configurations for tensegrity based robots", IROS 2008, eq. (2). There the exponential overflows
//! where a constraint is badly violated; here it is continued beyond an exponent t̂ by its tangent,
//! e^t̂ (1 + t − t̂), which is convex and continuously differentiable.
//!
//! At a minimum the multipliers are 2c hⱼ and e^(−c gᵢ), so that constraints are met only up to
//! about 1/c: follow with [`restore_feasibility`](crate::restore_feasibility) for equalities to
//! machine precision, or with [`DenseSqp`](crate::DenseSqp) or [`SparseSqp`](crate::SparseSqp) for
//! an optimum of full accuracy.
//!
//! Cost: one value and one Jacobian of the problem for each trial of the line search, and what the
//! quasi-Newton method needs.

use crate::error::{OptionError, ProblemError};
use crate::kkt::KktResiduals;
use crate::options::options;
use crate::problem::{Nlp, SmoothFunction, TripletPattern, check_length, check_pattern};
use crate::quasi_newton::{Bfgs, Lbfgs, MinimiseStatus, QuasiNewtonOptions};
use crate::sqp::UnmetConstraint;

/// Which quasi-Newton method minimises the penalty function.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum PenaltyMinimiser {
    /// [`Bfgs`].
    #[default]
    Bfgs,
    /// [`Lbfgs`].
    Lbfgs,
}

options! {
    /// Options of [`PenaltyMethod`].
    #[derive(Copy)]
    pub struct PenaltyOptions {
        /// First weight c. Default 0.01.
        initial_weight / with_initial_weight: f64 = 0.01,
            "be positive and finite" if |v| v > 0.0 && v.is_finite();
        /// Last weight c. Default 1e4.
        largest_weight / with_largest_weight: f64 = 1e4,
            "be positive and finite" if |v| v > 0.0 && v.is_finite();
        /// Factor by which c grows from stage to stage. Default 10.
        growth / with_growth: f64 = 10.0,
            "be greater than one and finite" if |v| v > 1.0 && v.is_finite();
        /// Exponent beyond which the exponential is continued by its tangent. No multiplier can
        /// exceed e to this power. Default 12.
        largest_exponent / with_largest_exponent: f64 = 12.0,
            "lie between 0 and 500" if |v| v > 0.0 && v <= 500.0;
        /// A violation above this at the end means that the constraints could not be met.
        /// Default 1e-2.
        acceptable_violation / with_acceptable_violation: f64 = 1e-2,
            "be positive and finite" if |v| v > 0.0 && v.is_finite();
        /// The quasi-Newton method.
        minimiser / with_minimiser: PenaltyMinimiser = PenaltyMinimiser::Bfgs;
        /// Its options. The gradient of the penalty function need not be followed down to
        /// rounding: the default stops at 1e-6, or 1e-6 of the gradient at the start of the stage.
        quasi_newton / with_quasi_newton: QuasiNewtonOptions = QuasiNewtonOptions::default()
            .with_gradient_tolerance(1e-6)
            .with_relative_gradient_tolerance(1e-6);
    }
}

/// What the penalty method ended with.
#[derive(Debug, Clone, PartialEq)]
pub struct PenaltyReport {
    /// Why it ended.
    pub status: PenaltyStatus,
    /// f at the final point.
    pub objective: f64,
    /// Optimality and feasibility of the final point with the multipliers that the penalty
    /// function implies, measured afresh.
    pub residuals: KktResiduals,
    /// The last weight c.
    pub weight: f64,
    /// Number of weights.
    pub stages: usize,
    /// Number of quasi-Newton steps of all stages.
    pub iterations: usize,
    /// Evaluations of the problem's functions without derivatives.
    pub value_evaluations: usize,
    /// Evaluations of functions and derivatives.
    pub derivative_evaluations: usize,
}

/// Why the penalty method ended.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum PenaltyStatus {
    /// The last stage found a stationary point of the penalty function, and no constraint is
    /// violated by more than the acceptable violation.
    Converged,
    /// The last stage ended, but these constraints are violated by more than the acceptable
    /// violation (the most violated first).
    Infeasible(Vec<UnmetConstraint>),
    /// The last stage reached the quasi-Newton method's iteration limit.
    IterationLimit,
    /// The penalty function of the last stage has no minimum.
    Unbounded,
}

/// The penalty method, with the multipliers that it ends with.
///
/// # Examples
///
/// The nearest point to (2, 1) of the unit disc:
///
/// ```
/// use tensegra_optim::{Nlp, PenaltyMethod, PenaltyOptions, PenaltyStatus, TripletPattern};
///
/// struct Disc;
///
/// impl Nlp for Disc {
///     fn num_variables(&self) -> usize { 2 }
///     fn num_constraints(&self) -> usize { 1 }
///     fn constraint_bounds(&self, _: &mut [f64], upper: &mut [f64]) { upper[0] = 1.0; }
///     fn jacobian_pattern(&self) -> TripletPattern { TripletPattern::dense(1, 2) }
///     fn objective(&mut self, x: &[f64]) -> f64 {
///         (x[0] - 2.0).powi(2) + (x[1] - 1.0).powi(2)
///     }
///     fn gradient(&mut self, x: &[f64], gradient: &mut [f64]) {
///         (gradient[0], gradient[1]) = (2.0 * (x[0] - 2.0), 2.0 * (x[1] - 1.0));
///     }
///     fn constraints(&mut self, x: &[f64], values: &mut [f64]) {
///         values[0] = x[0] * x[0] + x[1] * x[1];
///     }
///     fn jacobian(&mut self, x: &[f64], values: &mut [f64]) {
///         (values[0], values[1]) = (2.0 * x[0], 2.0 * x[1]);
///     }
/// }
///
/// let mut x = [0.0, 0.0];
/// let mut method = PenaltyMethod::new(PenaltyOptions::default())?;
/// let report = method.solve(&mut Disc, &mut x)?;
/// assert_eq!(report.status, PenaltyStatus::Converged);
/// assert!((x[0] - 2.0 / 5.0_f64.sqrt()).abs() < 1e-4);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone)]
pub struct PenaltyMethod {
    options: PenaltyOptions,
    bfgs: Bfgs,
    lbfgs: Lbfgs,
    multipliers: Vec<f64>,
}

impl PenaltyMethod {
    /// The method with the given options.
    ///
    /// # Errors
    /// An option outside its range.
    pub fn new(options: PenaltyOptions) -> Result<Self, OptionError> {
        options.validate()?;
        Ok(Self {
            options,
            bfgs: Bfgs::new(options.quasi_newton)?,
            lbfgs: Lbfgs::new(options.quasi_newton)?,
            multipliers: Vec::new(),
        })
    }

    /// Solves `problem` from `x`, which is overwritten by the final point.
    ///
    /// # Errors
    /// A problem that makes no sense, or a start where it is not finite: see [`ProblemError`].
    pub fn solve<P: Nlp>(
        &mut self,
        problem: &mut P,
        x: &mut [f64],
    ) -> Result<PenaltyReport, ProblemError> {
        let options = self.options;
        let mut function = PenaltyFunction::new(problem, options.largest_exponent)?;
        check_length("the starting point", function.lower.len(), x.len())?;
        for ((value, lower), upper) in x.iter_mut().zip(&function.lower).zip(&function.upper) {
            if lower == upper {
                *value = *lower;
            }
        }
        let (mut stages, mut iterations) = (0, 0);
        let (mut value_evaluations, mut derivative_evaluations) = (0, 0);
        let mut weight = options.initial_weight.min(options.largest_weight);
        let mut stage_start = x.to_vec();
        let inner = loop {
            function.weight = weight;
            let mut size = f64::INFINITY;
            let report = loop {
                let report = match options.minimiser {
                    PenaltyMinimiser::Bfgs => self.bfgs.minimise(&mut function, x)?,
                    PenaltyMinimiser::Lbfgs => self.lbfgs.minimise(&mut function, x)?,
                };
                iterations += report.iterations;
                value_evaluations += report.value_evaluations;
                derivative_evaluations += report.gradient_evaluations;
                // Far outside the exponentials are so steep that a gradient which is small beside
                // that of the start says nothing: go on from here, while that helps.
                let converged = report.status == MinimiseStatus::Converged
                    && report.gradient_norm <= options.quasi_newton.gradient_tolerance;
                if converged
                    || report.status != MinimiseStatus::Converged
                    || report.gradient_norm >= 0.1 * size
                {
                    break report;
                }
                size = report.gradient_norm;
            };
            stages += 1;
            if weight >= options.largest_weight {
                break report.status;
            }
            weight = (weight * options.growth).min(options.largest_weight);
            if report.status == MinimiseStatus::Unbounded {
                // Too light a penalty for this objective: the next may hold it.
                x.copy_from_slice(&stage_start);
            } else {
                stage_start.copy_from_slice(x);
            }
        };
        // Values, and with them multipliers, at the final point.
        function.value(x);
        function.compute_multipliers(x);
        self.multipliers.clone_from(&function.multipliers);
        let unmet = function.unmet(options.acceptable_violation);
        let violation = function.largest_violation(x);
        let objective = problem.objective(x);
        let status = match inner {
            MinimiseStatus::Unbounded => PenaltyStatus::Unbounded,
            MinimiseStatus::IterationLimit => PenaltyStatus::IterationLimit,
            // That no further decrease is found is how a stage ends when rounding hides it.
            _ if violation > options.acceptable_violation => PenaltyStatus::Infeasible(unmet),
            _ => PenaltyStatus::Converged,
        };
        Ok(PenaltyReport {
            status,
            objective,
            residuals: KktResiduals::measure(problem, x, &self.multipliers)?,
            weight,
            stages,
            iterations,
            value_evaluations,
            derivative_evaluations,
        })
    }

    /// The multipliers λ of the constraints that the penalty function implies at the final point
    /// of the last solve: positive at an upper bound, negative at a lower bound.
    #[must_use]
    pub fn multipliers(&self) -> &[f64] {
        &self.multipliers
    }
}

/// The penalty function of a problem, as a smooth function.
struct PenaltyFunction<'a, P> {
    problem: &'a mut P,
    weight: f64,
    largest_exponent: f64,
    lower: Vec<f64>,
    upper: Vec<f64>,
    row_lower: Vec<f64>,
    row_upper: Vec<f64>,
    pattern: TripletPattern,
    entries: Vec<f64>,
    constraints: Vec<f64>,
    /// Derivatives of the penalty terms with respect to the constraints: their multipliers.
    multipliers: Vec<f64>,
    /// The same with respect to the variables.
    bound_multipliers: Vec<f64>,
}

impl<'a, P: Nlp> PenaltyFunction<'a, P> {
    fn new(problem: &'a mut P, largest_exponent: f64) -> Result<Self, ProblemError> {
        let (n, m) = (problem.num_variables(), problem.num_constraints());
        let pattern = problem.jacobian_pattern();
        check_pattern("Jacobian", &pattern, m, n)?;
        let (mut lower, mut upper) = (vec![f64::NEG_INFINITY; n], vec![f64::INFINITY; n]);
        let (mut row_lower, mut row_upper) = (vec![f64::NEG_INFINITY; m], vec![f64::INFINITY; m]);
        problem.variable_bounds(&mut lower, &mut upper);
        problem.constraint_bounds(&mut row_lower, &mut row_upper);
        crate::problem::check_bounds(crate::BoundKind::Variable, &lower, &upper)?;
        crate::problem::check_bounds(crate::BoundKind::Constraint, &row_lower, &row_upper)?;
        Ok(Self {
            problem,
            weight: 1.0,
            largest_exponent,
            lower,
            upper,
            row_lower,
            row_upper,
            entries: vec![0.0; pattern.len()],
            pattern,
            constraints: vec![0.0; m],
            multipliers: vec![0.0; m],
            bound_multipliers: vec![0.0; n],
        })
    }

    /// The penalty of a value with its bounds, and its derivative.
    fn term(&self, value: f64, lower: f64, upper: f64) -> (f64, f64) {
        if lower == upper {
            let h = value - lower;
            return (self.weight * h * h, 2.0 * self.weight * h);
        }
        let (mut sum, mut derivative) = (0.0, 0.0);
        if lower > f64::NEG_INFINITY {
            let (penalty, slope) = self.exponential(value - lower);
            sum += penalty;
            derivative -= slope;
        }
        if upper < f64::INFINITY {
            let (penalty, slope) = self.exponential(upper - value);
            sum += penalty;
            derivative += slope;
        }
        (sum, derivative)
    }

    /// The same for a variable, which has no penalty if it is fixed.
    fn bound_term(&self, value: f64, lower: f64, upper: f64) -> (f64, f64) {
        if lower == upper {
            (0.0, 0.0)
        } else {
            self.term(value, lower, upper)
        }
    }

    /// (e^(−c g) − 1)/c, and minus its derivative.
    fn exponential(&self, g: f64) -> (f64, f64) {
        let exponent = -self.weight * g;
        if exponent <= self.largest_exponent {
            (exponent.exp_m1() / self.weight, exponent.exp())
        } else {
            let slope = self.largest_exponent.exp();
            let value = slope * (1.0 + exponent - self.largest_exponent) - 1.0;
            (value / self.weight, slope)
        }
    }

    fn penalties(&self, x: &[f64]) -> f64 {
        let rows = self.constraints.iter().zip(&self.row_lower);
        let rows = rows.zip(&self.row_upper);
        let variables = x.iter().zip(&self.lower).zip(&self.upper);
        let of_rows: f64 = rows
            .map(|((&value, &lower), &upper)| self.term(value, lower, upper).0)
            .sum();
        let of_bounds: f64 = variables
            .map(|((&value, &lower), &upper)| self.bound_term(value, lower, upper).0)
            .sum();
        of_rows + of_bounds
    }

    fn compute_multipliers(&mut self, x: &[f64]) {
        for i in 0..self.multipliers.len() {
            let (value, lower, upper) = (self.constraints[i], self.row_lower[i], self.row_upper[i]);
            self.multipliers[i] = self.term(value, lower, upper).1;
        }
        for (j, &value) in x.iter().enumerate() {
            self.bound_multipliers[j] = self.bound_term(value, self.lower[j], self.upper[j]).1;
        }
    }

    /// Largest violation at the point where the constraints were last evaluated.
    fn largest_violation(&self, x: &[f64]) -> f64 {
        let rows = self.constraints.iter().zip(&self.row_lower);
        let rows = rows.zip(&self.row_upper);
        let variables = x.iter().zip(&self.lower).zip(&self.upper);
        rows.chain(variables)
            .fold(0.0_f64, |worst, ((&value, &lower), &upper)| {
                worst.max(lower - value).max(value - upper)
            })
    }

    fn unmet(&self, tolerance: f64) -> Vec<UnmetConstraint> {
        UnmetConstraint::list(
            &self.constraints,
            &self.row_lower,
            &self.row_upper,
            tolerance,
        )
    }
}

impl<P: Nlp> SmoothFunction for PenaltyFunction<'_, P> {
    fn num_variables(&self) -> usize {
        self.lower.len()
    }

    fn value(&mut self, x: &[f64]) -> f64 {
        self.problem.constraints(x, &mut self.constraints);
        self.problem.objective(x) + self.penalties(x)
    }

    fn value_and_gradient(&mut self, x: &[f64], gradient: &mut [f64]) -> f64 {
        let value = self.value(x);
        self.compute_multipliers(x);
        self.problem.gradient(x, gradient);
        self.problem.jacobian(x, &mut self.entries);
        for ((row, column), entry) in self.pattern.iter().zip(&self.entries) {
            gradient[column] += self.multipliers[row] * entry;
        }
        for (j, g) in gradient.iter_mut().enumerate() {
            *g += self.bound_multipliers[j];
            if self.lower[j] == self.upper[j] {
                *g = 0.0;
            }
        }
        value
    }
}
