//! Nonlinear least squares: min ½‖r(x)‖², x ∈ ℝⁿ, r(x) ∈ ℝᵐ, to full accuracy.
//!
//! The Levenberg–Marquardt method takes the step d that minimises ‖r + J d‖² + μ‖D d‖². Here
//!
//! - D holds the largest norms that the columns of J have had (J. J. Moré, "The
//!   Levenberg–Marquardt algorithm: implementation and theory", 1978), or the identity;
//! - μ is proportional to ‖r‖ (J.-Y. Fan, Y.-X. Yuan, "On the quadratic convergence of the
//!   Levenberg–Marquardt method without nonsingularity assumption", Computing 74 (2005)), the
//!   factor being adapted to how well the linear model predicts the reduction. So the step becomes
//!   the Gauss–Newton step as r → 0, and convergence is quadratic there even where J is
//!   rank-deficient and solutions are not isolated, as with redundant equations;
//! - the step is found from orthogonal factorisations alone, never from JᵀJ, which would halve the
//!   number of correct digits.
//!
//! m may be less than n: the step is then (in the limit of small μ) the shortest one in the norm
//! ‖D d‖, so that a point near a solution set is projected on it.
//!
//! Cost of an iteration: 2n²(m − n/3) operations for the QR factorisation of J, rows of zeros not
//! counted, and 2n³/3 for each trial value of μ (mostly one).

use crate::error::{OptionError, ProblemError};
use crate::options::options;
use crate::problem::{LeastSquares, check_length};
use crate::vector::{dot, largest, norm, refill};
use nalgebra::DMatrix;

/// The factor of μ shrinks so much after a well-predicted step, and no further than that.
const DAMPING_DECREASE: f64 = 0.1;
const SMALLEST_DAMPING: f64 = 1e-14;
/// It grows by this factor after a failed step.
const DAMPING_INCREASE: f64 = 4.0;
const LARGEST_DAMPING: f64 = 1e30;
/// Least scale of a variable relative to the largest.
const SMALLEST_SCALE: f64 = 1e-4;
/// A step is taken if it achieves this fraction of the predicted reduction.
const ACCEPTED_RATIO: f64 = 1e-4;

/// The norm in which steps are damped.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum StepScaling {
    /// Each variable is measured by how strongly the residuals depend on it: the result does not
    /// depend on the variables' units.
    #[default]
    Jacobian,
    /// The Euclidean norm of x: steps towards a set of solutions are as short as can be.
    None,
}

options! {
    /// Options of [`LevenbergMarquardt`].
    #[derive(Copy)]
    pub struct LeastSquaresOptions {
        /// Most iterations (evaluations of the Jacobian). Default 200.
        max_iterations / with_max_iterations: usize = 200;
        /// Converged when ‖r‖∞ is not above this. Default 0: go on to full accuracy.
        residual_tolerance / with_residual_tolerance: f64 = 0.0,
            "be non-negative" if |v| v >= 0.0;
        /// Converged when the cosine of the angle between r and every column of J is below this.
        /// Default 1e-12.
        orthogonality_tolerance / with_orthogonality_tolerance: f64 = 1e-12,
            "be non-negative" if |v| v >= 0.0;
        /// Converged when a step is below this multiple of the size of x (both measured by D).
        /// Default 1e-15.
        step_tolerance / with_step_tolerance: f64 = 1e-15,
            "be non-negative" if |v| v >= 0.0;
        /// First factor of μ. Default 1e-3.
        initial_damping / with_initial_damping: f64 = 1e-3,
            "be positive and finite" if |v| v > 0.0 && v.is_finite();
        /// The norm in which steps are damped. Default [`StepScaling::Jacobian`].
        scaling / with_scaling: StepScaling = StepScaling::Jacobian;
    }
}

/// What a least-squares solve ended with.
#[derive(Debug, Clone, PartialEq)]
pub struct LeastSquaresReport {
    /// Why it ended.
    pub status: LeastSquaresStatus,
    /// Σ rᵢ² at the final point, evaluated afresh.
    pub sum_of_squares: f64,
    /// ‖r‖∞ at the final point.
    pub largest_residual: f64,
    /// Largest cosine of the angle between r and a column of J at the final point; 0 if r = 0.
    pub orthogonality: f64,
    /// Number of evaluations of the Jacobian.
    pub iterations: usize,
    /// Number of evaluations of the residuals.
    pub residual_evaluations: usize,
}

impl LeastSquaresReport {
    /// Whether one of the tolerances was met.
    #[must_use]
    pub fn is_converged(&self) -> bool {
        matches!(
            self.status,
            LeastSquaresStatus::ResidualSmall
                | LeastSquaresStatus::Stationary
                | LeastSquaresStatus::StepSmall
        )
    }
}

/// Why a least-squares solve ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum LeastSquaresStatus {
    /// ‖r‖∞ met its tolerance.
    ResidualSmall,
    /// r is orthogonal to the columns of J.
    Stationary,
    /// x no longer changes: converged to rounding.
    StepSmall,
    /// The iteration limit was reached.
    IterationLimit,
    /// The Jacobian is not finite, or does not belong to the residuals: no damped step reduces
    /// them.
    NumericalTrouble,
}

/// The Levenberg–Marquardt method, with its memory.
///
/// # Examples
///
/// The point of a circle and a line, given three times over (the third equation is redundant):
///
/// ```
/// use tensegra_optim::nalgebra::DMatrix;
/// use tensegra_optim::{LeastSquares, LeastSquaresOptions, LevenbergMarquardt};
///
/// struct Intersection;
///
/// impl LeastSquares for Intersection {
///     fn num_variables(&self) -> usize { 2 }
///     fn num_residuals(&self) -> usize { 3 }
///     fn residuals(&mut self, x: &[f64], r: &mut [f64]) {
///         r[0] = x[0] * x[0] + x[1] * x[1] - 1.0;
///         r[1] = x[0] - x[1];
///         r[2] = r[0] + r[1];
///     }
///     fn jacobian(&mut self, x: &[f64], jacobian: &mut DMatrix<f64>) {
///         (jacobian[(0, 0)], jacobian[(0, 1)]) = (2.0 * x[0], 2.0 * x[1]);
///         (jacobian[(1, 0)], jacobian[(1, 1)]) = (1.0, -1.0);
///         (jacobian[(2, 0)], jacobian[(2, 1)]) = (2.0 * x[0] + 1.0, 2.0 * x[1] - 1.0);
///     }
/// }
///
/// let mut x = [1.0, 0.2];
/// let mut solver = LevenbergMarquardt::new(LeastSquaresOptions::default())?;
/// let report = solver.solve(&mut Intersection, &mut x)?;
/// assert!(report.is_converged() && report.largest_residual < 1e-15);
/// assert!((x[0] - 0.5_f64.sqrt()).abs() < 1e-15);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone)]
pub struct LevenbergMarquardt {
    options: LeastSquaresOptions,
    jacobian: DMatrix<f64>,
    residuals: Vec<f64>,
    trial_residuals: Vec<f64>,
    trial: Vec<f64>,
    gradient: Vec<f64>,
    scales: Vec<f64>,
    step: Vec<f64>,
    factor: Factorisation,
}

impl LevenbergMarquardt {
    /// A solver with the given options.
    ///
    /// # Errors
    /// An option outside its range.
    pub fn new(options: LeastSquaresOptions) -> Result<Self, OptionError> {
        options.validate()?;
        Ok(Self {
            options,
            jacobian: DMatrix::zeros(0, 0),
            residuals: Vec::new(),
            trial_residuals: Vec::new(),
            trial: Vec::new(),
            gradient: Vec::new(),
            scales: Vec::new(),
            step: Vec::new(),
            factor: Factorisation::default(),
        })
    }

    /// Minimises ½‖r‖² from `x`, which is overwritten by the final point.
    ///
    /// # Errors
    /// A start of the wrong length or where residuals or Jacobian are not finite.
    pub fn solve<P: LeastSquares>(
        &mut self,
        problem: &mut P,
        x: &mut [f64],
    ) -> Result<LeastSquaresReport, ProblemError> {
        let n = problem.num_variables();
        let m = problem.num_residuals();
        check_length("the starting point", n, x.len())?;
        if let Some(index) = x.iter().position(|v| !v.is_finite()) {
            return Err(ProblemError::StartNotFinite {
                index,
                value: x[index],
            });
        }
        self.allocate(m, n);
        problem.residuals(x, &mut self.residuals);
        if let Some(index) = self.residuals.iter().position(|r| !r.is_finite()) {
            return Err(ProblemError::NotFiniteAtStart {
                what: "residual",
                index,
                value: self.residuals[index],
            });
        }
        let (status, iterations, evaluations) = self.run(problem, x)?;

        problem.residuals(x, &mut self.residuals);
        problem.jacobian(x, &mut self.jacobian);
        Ok(LeastSquaresReport {
            status,
            sum_of_squares: dot(&self.residuals, &self.residuals),
            largest_residual: largest(&self.residuals),
            orthogonality: self.orthogonality(),
            iterations,
            residual_evaluations: evaluations + 1,
        })
    }

    fn allocate(&mut self, m: usize, n: usize) {
        if self.jacobian.shape() != (m, n) {
            self.jacobian = DMatrix::zeros(m, n);
        }
        self.jacobian.fill(0.0);
        for (vector, length) in [
            (&mut self.residuals, m),
            (&mut self.trial_residuals, m),
            (&mut self.trial, n),
            (&mut self.gradient, n),
            (&mut self.scales, n),
            (&mut self.step, n),
        ] {
            refill(vector, length, 0.0);
        }
    }

    fn run<P: LeastSquares>(
        &mut self,
        problem: &mut P,
        x: &mut [f64],
    ) -> Result<(LeastSquaresStatus, usize, usize), ProblemError> {
        let options = self.options;
        let first_norm = norm(&self.residuals);
        let mut damping = options.initial_damping;
        let mut increase = DAMPING_INCREASE;
        let mut evaluations = 1;
        for iteration in 0.. {
            if largest(&self.residuals) <= options.residual_tolerance {
                return Ok((LeastSquaresStatus::ResidualSmall, iteration, evaluations));
            }
            if iteration == options.max_iterations {
                return Ok((LeastSquaresStatus::IterationLimit, iteration, evaluations));
            }
            problem.jacobian(x, &mut self.jacobian);
            if let Some(index) = self.jacobian.iter().position(|v| !v.is_finite()) {
                if iteration == 0 {
                    return Err(ProblemError::NotFiniteAtStart {
                        what: "Jacobian of the residuals",
                        index,
                        value: self.jacobian[index],
                    });
                }
                return Ok((LeastSquaresStatus::NumericalTrouble, iteration, evaluations));
            }
            self.update_scales();
            if self.orthogonality() <= options.orthogonality_tolerance {
                return Ok((LeastSquaresStatus::Stationary, iteration + 1, evaluations));
            }
            self.factor
                .factorise(&self.jacobian, &self.scales, &self.residuals);
            let cost = dot(&self.residuals, &self.residuals);
            loop {
                // In the scaled variables Dx the columns of J have about unit length, and the
                // damping is a pure number.
                let mu = damping * (cost.sqrt() / first_norm).min(1.0);
                self.factor.damped_step(mu, &mut self.step);
                let step_size = norm(&self.step);
                let predicted = self.factor.predicted_reduction(mu, &self.step);
                let mut size = 0.0;
                for ((scale, v), d) in self.scales.iter().zip(x.iter()).zip(&mut self.step) {
                    size += (scale * v).powi(2);
                    *d /= scale;
                }
                for ((t, v), d) in self.trial.iter_mut().zip(x.iter()).zip(&self.step) {
                    *t = v + d;
                }
                problem.residuals(&self.trial, &mut self.trial_residuals);
                evaluations += 1;
                let trial_cost = dot(&self.trial_residuals, &self.trial_residuals);
                let ratio = (cost - trial_cost) / predicted;
                let still = step_size <= options.step_tolerance * size.sqrt() || self.trial == x;
                if ratio > ACCEPTED_RATIO || (still && trial_cost <= cost) {
                    x.copy_from_slice(&self.trial);
                    std::mem::swap(&mut self.residuals, &mut self.trial_residuals);
                }
                if still {
                    return Ok((
                        self.verdict_at_rest(cost, first_norm * first_norm),
                        iteration + 1,
                        evaluations,
                    ));
                }
                if ratio > ACCEPTED_RATIO {
                    if ratio > 0.75 {
                        damping = (damping * DAMPING_DECREASE).max(SMALLEST_DAMPING);
                    } else if ratio < 0.25 {
                        damping *= DAMPING_INCREASE;
                    }
                    increase = DAMPING_INCREASE;
                    break;
                }
                // What the model still promises is rounding: x is as good as it gets.
                if predicted <= 4.0 * f64::EPSILON * cost {
                    return Ok((
                        self.verdict_at_rest(cost, first_norm * first_norm),
                        iteration + 1,
                        evaluations,
                    ));
                }
                damping *= increase;
                increase *= 2.0;
                if damping > LARGEST_DAMPING || damping.is_nan() {
                    return Ok((
                        LeastSquaresStatus::NumericalTrouble,
                        iteration + 1,
                        evaluations,
                    ));
                }
            }
        }
        unreachable!("the iteration limit ends the loop")
    }

    /// The status where x no longer changes. At a solution r is nearly orthogonal to J, or next to
    /// nothing; where it is neither, no step along J reduces it, so that J is wrong.
    fn verdict_at_rest(&mut self, cost: f64, first_cost: f64) -> LeastSquaresStatus {
        if self.orthogonality() > 0.5 && cost > 1e-12 * first_cost {
            LeastSquaresStatus::NumericalTrouble
        } else {
            LeastSquaresStatus::StepSmall
        }
    }

    fn update_scales(&mut self) {
        for (scale, column) in self.scales.iter_mut().zip(self.jacobian.column_iter()) {
            match self.options.scaling {
                StepScaling::Jacobian => *scale = scale.max(column.norm()),
                StepScaling::None => *scale = 1.0,
            }
        }
        // A variable that has had next to no effect so far may have more elsewhere: without a floor
        // the damping would let it run away.
        let largest = largest(&self.scales);
        for scale in &mut self.scales {
            *scale = if largest > 0.0 {
                scale.max(SMALLEST_SCALE * largest)
            } else {
                1.0
            };
        }
    }

    /// Largest cosine between r and the columns of J.
    fn orthogonality(&mut self) -> f64 {
        let size = norm(&self.residuals);
        let mut worst = 0.0_f64;
        for column in self.jacobian.column_iter() {
            let length = column.norm();
            if length > 0.0 && size > 0.0 {
                let product: f64 = column.iter().zip(&self.residuals).map(|(a, r)| a * r).sum();
                worst = worst.max((product / length / size).abs());
            }
        }
        worst
    }
}

/// The orthogonal factorisation of J D⁻¹, and of it with the damping below.
#[derive(Debug, Clone, Default)]
struct Factorisation {
    n: usize,
    /// Which rows of J differ from zero.
    counts: Vec<bool>,
    /// Those rows of J D⁻¹ overwritten by R, column-major m × n.
    columns: Vec<f64>,
    m: usize,
    /// Qᵀr.
    rotated: Vec<f64>,
    /// The damped triangle, row-major n × n, and its right-hand side.
    triangle: Vec<f64>,
    right: Vec<f64>,
    /// A row of damping on its way through the triangle.
    row: Vec<f64>,
}

impl Factorisation {
    /// Householder QR of J D⁻¹, applied to r.
    fn factorise(&mut self, jacobian: &DMatrix<f64>, scales: &[f64], residuals: &[f64]) {
        // A row of zeros, such as that of an inequality that is met, has no part in the step.
        self.counts.clear();
        self.counts.resize(jacobian.nrows(), false);
        for column in jacobian.column_iter() {
            for (counts, value) in self.counts.iter_mut().zip(column.iter()) {
                *counts |= *value != 0.0;
            }
        }
        let counts = &self.counts;
        let kept = |(i, value): (usize, &f64)| counts[i].then_some(*value);
        self.columns.clear();
        for (column, scale) in jacobian.column_iter().zip(scales) {
            let column = column.iter().enumerate().filter_map(kept);
            self.columns.extend(column.map(|value| value / scale));
        }
        self.rotated.clear();
        self.rotated
            .extend(residuals.iter().enumerate().filter_map(kept));
        let (m, n) = (self.rotated.len(), jacobian.ncols());
        (self.m, self.n) = (m, n);
        for k in 0..n.min(m) {
            let (before, after) = self.columns.split_at_mut((k + 1) * m);
            let column = &mut before[k * m + k..];
            let length = norm(column);
            if length == 0.0 {
                continue;
            }
            // v = column ± |column| e₁, scaled so that H = I − v vᵀ / v₁.
            let signed = length.copysign(column[0]);
            for value in column.iter_mut() {
                *value /= signed;
            }
            column[0] += 1.0;
            let head = column[0];
            for other in after
                .chunks_exact_mut(m)
                .map(|other| &mut other[k..])
                .chain(std::iter::once(&mut self.rotated[k..]))
            {
                let factor = -dot(column, other) / head;
                for (o, c) in other.iter_mut().zip(column.iter()) {
                    *o += factor * c;
                }
            }
            column[0] = -signed;
        }
    }

    /// The minimiser d of ‖r + J D⁻¹ d‖² + μ‖d‖²: the rows √μ·I are rotated into the triangle one
    /// after the other.
    fn damped_step(&mut self, mu: f64, step: &mut [f64]) {
        let n = self.n;
        refill(&mut self.triangle, n * n, 0.0);
        refill(&mut self.right, n, 0.0);
        for i in 0..n.min(self.m) {
            for j in i..n {
                self.triangle[i * n + j] = self.columns[j * self.m + i];
            }
            self.right[i] = -self.rotated[i];
        }
        let root = mu.sqrt();
        refill(&mut self.row, n, 0.0);
        for k in 0..n {
            self.row[k..].fill(0.0);
            self.row[k] = root;
            let mut right = 0.0;
            for i in k..n {
                let (a, b) = (self.triangle[i * n + i], self.row[i]);
                if b == 0.0 {
                    continue;
                }
                let length = a.hypot(b);
                let (c, s) = (a / length, b / length);
                let pivot_row = &mut self.triangle[i * n + i..(i + 1) * n];
                for (t, r) in pivot_row.iter_mut().zip(&mut self.row[i..]) {
                    let (old, new) = (*t, *r);
                    *t = c * old + s * new;
                    *r = c * new - s * old;
                }
                let old = self.right[i];
                self.right[i] = c * old + s * right;
                right = c * right - s * old;
            }
        }
        for i in (0..n).rev() {
            let row = &self.triangle[i * n..(i + 1) * n];
            let rest = self.right[i] - dot(&row[i + 1..], &step[i + 1..]);
            // The pivot is at least √μ; a μ that underflows leaves the variable where it is.
            step[i] = if row[i] == 0.0 { 0.0 } else { rest / row[i] };
        }
    }

    /// ‖r‖² − ‖r + J D⁻¹ d‖² = ‖J D⁻¹ d‖² + 2μ‖d‖² for the damped step d.
    fn predicted_reduction(&self, mu: f64, step: &[f64]) -> f64 {
        let mut sum = 2.0 * mu * dot(step, step);
        for i in 0..self.n.min(self.m) {
            let product: f64 = (i..self.n)
                .map(|j| self.columns[j * self.m + i] * step[j])
                .sum();
            sum += product * product;
        }
        sum
    }
}
