//! Unconstrained minimisation by quasi-Newton methods: min f(x), x ∈ ℝⁿ, f continuously
//! differentiable.
//!
//! Both methods step along d = −H∇f(x) with a line search; H approximates the inverse of the
//! Hessian from the steps s and the changes y of the gradient.
//!
//! - [`Bfgs`] keeps H as a dense matrix: H ← (I − ρ s yᵀ) H (I − ρ y sᵀ) + ρ s sᵀ, ρ = 1/yᵀs.
//!   Cost 4n² an iteration, memory n². Fastest up to some hundred variables.
//! - [`Lbfgs`] keeps the last few pairs (s, y) only and applies H by the two-loop recursion.
//!   Cost 4 n k an iteration with k pairs.
//!
//! Source: J. Nocedal, S. J. Wright, Numerical Optimization, 2nd ed., 2006, algorithms 6.1, 7.4.
//! A pair is used only if yᵀs is positive beyond rounding (Armijo's rule does not ensure it).

use crate::error::{OptionError, ProblemError};
use crate::line_search::{LineSearchOptions, Ray};
use crate::options::options;
use crate::problem::{SmoothFunction, check_length};
use crate::vector::{dot, largest, refill};

/// yᵀs has to exceed this multiple of |y||s| for an update.
const SMALLEST_CURVATURE: f64 = 1e-12;

options! {
    /// Options of [`Bfgs`] and [`Lbfgs`].
    #[derive(Copy)]
    pub struct QuasiNewtonOptions {
        /// Most iterations. Default 1000.
        max_iterations / with_max_iterations: usize = 1000;
        /// The gradient has converged when ‖∇f‖∞ is below this. Default 1e-9.
        gradient_tolerance / with_gradient_tolerance: f64 = 1e-9,
            "be non-negative" if |v| v >= 0.0;
        /// The gradient has also converged when ‖∇f‖∞ is below this multiple of its value at the
        /// start. Default 1e-12.
        relative_gradient_tolerance / with_relative_gradient_tolerance: f64 = 1e-12,
            "be non-negative" if |v| v >= 0.0;
        /// Length, in the norm ‖·‖∞, of the first trial step along the negative gradient; later
        /// steps have a length of their own. Default 1.
        first_step / with_first_step: f64 = 1.0,
            "be positive and finite" if |v| v > 0.0 && v.is_finite();
        /// Number of pairs that [`Lbfgs`] keeps. Default 10.
        memory / with_memory: usize = 10,
            "be at least one" if |v| v >= 1;
        /// The line search.
        line_search / with_line_search: LineSearchOptions = LineSearchOptions::default();
    }
}

/// What a minimisation ended with.
#[derive(Debug, Clone, PartialEq)]
pub struct MinimiseReport {
    /// Why it ended.
    pub status: MinimiseStatus,
    /// f at the final point.
    pub value: f64,
    /// ‖∇f‖∞ at the final point, evaluated afresh.
    pub gradient_norm: f64,
    /// Number of steps.
    pub iterations: usize,
    /// Evaluations of f alone.
    pub value_evaluations: usize,
    /// Evaluations of f and its gradient.
    pub gradient_evaluations: usize,
}

impl MinimiseReport {
    /// Whether the gradient met its tolerance.
    #[must_use]
    pub fn is_converged(&self) -> bool {
        self.status == MinimiseStatus::Converged
    }
}

/// Why a minimisation ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum MinimiseStatus {
    /// The gradient is below its tolerance.
    Converged,
    /// The iteration limit was reached.
    IterationLimit,
    /// No step along the negative gradient decreases f further: the gradient tolerance is tighter
    /// than rounding allows, or the gradient does not belong to f.
    NoDecrease,
    /// f fell below −1e20: it has no minimum.
    Unbounded,
}

/// The BFGS method with a dense inverse Hessian.
///
/// # Examples
///
/// ```
/// use tensegra_optim::{Bfgs, QuasiNewtonOptions, SmoothFunction};
///
/// struct Rosenbrock;
///
/// impl SmoothFunction for Rosenbrock {
///     fn num_variables(&self) -> usize { 2 }
///     fn value(&mut self, x: &[f64]) -> f64 {
///         100.0 * (x[1] - x[0] * x[0]).powi(2) + (1.0 - x[0]).powi(2)
///     }
///     fn value_and_gradient(&mut self, x: &[f64], gradient: &mut [f64]) -> f64 {
///         gradient[1] = 200.0 * (x[1] - x[0] * x[0]);
///         gradient[0] = -2.0 * x[0] * gradient[1] - 2.0 * (1.0 - x[0]);
///         self.value(x)
///     }
/// }
///
/// let mut x = [-1.2, 1.0];
/// let report = Bfgs::new(QuasiNewtonOptions::default())?.minimise(&mut Rosenbrock, &mut x)?;
/// assert!(report.is_converged());
/// assert!((x[0] - 1.0).abs() < 1e-8 && (x[1] - 1.0).abs() < 1e-8);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone)]
pub struct Bfgs {
    options: QuasiNewtonOptions,
    descent: Descent,
    inverse: DenseInverse,
}

impl Bfgs {
    /// A minimiser with the given options.
    ///
    /// # Errors
    /// An option outside its range.
    pub fn new(options: QuasiNewtonOptions) -> Result<Self, OptionError> {
        options.validate()?;
        options.line_search.validate()?;
        Ok(Self {
            options,
            descent: Descent::default(),
            inverse: DenseInverse::default(),
        })
    }

    /// Minimises `function` from `x`, which is overwritten by the final point.
    ///
    /// # Errors
    /// A start of the wrong length or where the function is not finite.
    pub fn minimise<F: SmoothFunction>(
        &mut self,
        function: &mut F,
        x: &mut [f64],
    ) -> Result<MinimiseReport, ProblemError> {
        self.descent
            .run(&self.options, &mut self.inverse, function, x)
    }
}

/// The L-BFGS method, for many variables.
///
/// Used like [`Bfgs`].
#[derive(Debug, Clone)]
pub struct Lbfgs {
    options: QuasiNewtonOptions,
    descent: Descent,
    inverse: LimitedInverse,
}

impl Lbfgs {
    /// A minimiser with the given options.
    ///
    /// # Errors
    /// An option outside its range.
    pub fn new(options: QuasiNewtonOptions) -> Result<Self, OptionError> {
        options.validate()?;
        options.line_search.validate()?;
        Ok(Self {
            options,
            descent: Descent::default(),
            inverse: LimitedInverse::default(),
        })
    }

    /// Minimises `function` from `x`, which is overwritten by the final point.
    ///
    /// # Errors
    /// A start of the wrong length or where the function is not finite.
    pub fn minimise<F: SmoothFunction>(
        &mut self,
        function: &mut F,
        x: &mut [f64],
    ) -> Result<MinimiseReport, ProblemError> {
        self.inverse.capacity = self.options.memory;
        self.descent
            .run(&self.options, &mut self.inverse, function, x)
    }
}

/// An approximation H of the inverse Hessian.
trait InverseHessian {
    /// Forgets all pairs: H = I.
    fn reset(&mut self, n: usize);
    /// Whether no pair has been taken in.
    fn is_identity(&self) -> bool;
    /// Takes in a pair with yᵀs > 0.
    fn update(&mut self, s: &[f64], y: &[f64]);
    /// `direction` = −H · gradient.
    fn apply(&mut self, gradient: &[f64], direction: &mut [f64]);
}

/// The loop that both methods share, with its memory.
#[derive(Debug, Clone, Default)]
struct Descent {
    gradient: Vec<f64>,
    direction: Vec<f64>,
    trial: Vec<f64>,
    trial_gradient: Vec<f64>,
}

impl Descent {
    fn run<F: SmoothFunction>(
        &mut self,
        options: &QuasiNewtonOptions,
        inverse: &mut impl InverseHessian,
        function: &mut F,
        x: &mut [f64],
    ) -> Result<MinimiseReport, ProblemError> {
        let n = function.num_variables();
        check_length("the starting point", n, x.len())?;
        for vector in [
            &mut self.gradient,
            &mut self.direction,
            &mut self.trial,
            &mut self.trial_gradient,
        ] {
            refill(vector, n, 0.0);
        }
        inverse.reset(n);
        let mut evaluations = (0, 1);
        let mut value = function.value_and_gradient(x, &mut self.gradient);
        check_start(x, value, &self.gradient)?;
        let tolerance = options
            .gradient_tolerance
            .max(options.relative_gradient_tolerance * largest(&self.gradient));

        let mut iterations = 0;
        let status = loop {
            let size = largest(&self.gradient);
            if size <= tolerance {
                break MinimiseStatus::Converged;
            }
            if value < -1e20 {
                break MinimiseStatus::Unbounded;
            }
            if iterations == options.max_iterations {
                break MinimiseStatus::IterationLimit;
            }
            inverse.apply(&self.gradient, &mut self.direction);
            let mut slope = dot(&self.gradient, &self.direction);
            if slope.is_nan() || slope >= 0.0 {
                // Rounding has spoilt H.
                inverse.reset(n);
                inverse.apply(&self.gradient, &mut self.direction);
                slope = dot(&self.gradient, &self.direction);
            }
            let first = if inverse.is_identity() {
                options.first_step / size
            } else {
                1.0
            };
            let mut ray = Ray {
                x,
                direction: &self.direction,
                value,
                slope,
                trial: &mut self.trial,
                gradient: &mut self.trial_gradient,
                evaluations: &mut evaluations,
            };
            let Some((step, new_value)) = ray.search(function, first, &options.line_search) else {
                if inverse.is_identity() {
                    break MinimiseStatus::NoDecrease;
                }
                inverse.reset(n);
                continue;
            };
            iterations += 1;
            // From here `direction` is the step s and `gradient` the change y.
            for d in &mut self.direction {
                *d *= step;
            }
            for (old, new) in self.gradient.iter_mut().zip(&self.trial_gradient) {
                *old = new - *old;
            }
            let curvature = dot(&self.direction, &self.gradient);
            let product = (dot(&self.direction, &self.direction)
                * dot(&self.gradient, &self.gradient))
            .sqrt();
            if curvature > SMALLEST_CURVATURE * product {
                inverse.update(&self.direction, &self.gradient);
            }
            let still = x == self.trial;
            x.copy_from_slice(&self.trial);
            std::mem::swap(&mut self.gradient, &mut self.trial_gradient);
            value = new_value;
            if still {
                break if largest(&self.gradient) <= tolerance {
                    MinimiseStatus::Converged
                } else {
                    MinimiseStatus::NoDecrease
                };
            }
        };
        let value = function.value_and_gradient(x, &mut self.gradient);
        Ok(MinimiseReport {
            status,
            value,
            gradient_norm: largest(&self.gradient),
            iterations,
            value_evaluations: evaluations.0,
            gradient_evaluations: evaluations.1 + 1,
        })
    }
}

fn check_start(x: &[f64], value: f64, gradient: &[f64]) -> Result<(), ProblemError> {
    if let Some(index) = x.iter().position(|v| !v.is_finite()) {
        return Err(ProblemError::StartNotFinite {
            index,
            value: x[index],
        });
    }
    if !value.is_finite() {
        return Err(ProblemError::NotFiniteAtStart {
            what: "objective",
            index: 0,
            value,
        });
    }
    match gradient.iter().position(|g| !g.is_finite()) {
        None => Ok(()),
        Some(index) => Err(ProblemError::NotFiniteAtStart {
            what: "objective gradient",
            index,
            value: gradient[index],
        }),
    }
}

/// H as a full symmetric matrix.
#[derive(Debug, Clone, Default)]
struct DenseInverse {
    n: usize,
    pairs: usize,
    /// Row-major, both triangles.
    matrix: Vec<f64>,
    product: Vec<f64>,
}

impl InverseHessian for DenseInverse {
    fn reset(&mut self, n: usize) {
        self.n = n;
        self.pairs = 0;
        refill(&mut self.matrix, n * n, 0.0);
        for i in 0..n {
            self.matrix[i * n + i] = 1.0;
        }
        refill(&mut self.product, n, 0.0);
    }

    fn is_identity(&self) -> bool {
        self.pairs == 0
    }

    fn update(&mut self, s: &[f64], y: &[f64]) {
        let n = self.n;
        let curvature = dot(s, y);
        if self.pairs == 0 {
            // The identity has no scale; the first pair does.
            let scale = curvature / dot(y, y);
            for i in 0..n {
                self.matrix[i * n + i] = scale;
            }
        }
        self.pairs += 1;
        for (p, row) in self.product.iter_mut().zip(self.matrix.chunks_exact(n)) {
            *p = dot(row, y);
        }
        let factor = (1.0 + dot(y, &self.product) / curvature) / curvature;
        for (i, row) in self.matrix.chunks_exact_mut(n).enumerate() {
            let (along, across) = (
                factor * s[i] - self.product[i] / curvature,
                s[i] / curvature,
            );
            for ((h, s), p) in row.iter_mut().zip(s).zip(&self.product) {
                *h += along * s - across * p;
            }
        }
    }

    fn apply(&mut self, gradient: &[f64], direction: &mut [f64]) {
        if self.n == 0 {
            return;
        }
        for (d, row) in direction.iter_mut().zip(self.matrix.chunks_exact(self.n)) {
            *d = -dot(row, gradient);
        }
    }
}

/// H by its last pairs.
#[derive(Debug, Clone, Default)]
struct LimitedInverse {
    capacity: usize,
    /// Pairs in a ring: the oldest is overwritten.
    steps: Vec<Vec<f64>>,
    changes: Vec<Vec<f64>>,
    inverse_curvatures: Vec<f64>,
    coefficients: Vec<f64>,
    newest: usize,
    pairs: usize,
}

impl InverseHessian for LimitedInverse {
    fn reset(&mut self, n: usize) {
        self.pairs = 0;
        self.newest = 0;
        for vectors in [&mut self.steps, &mut self.changes] {
            vectors.resize(self.capacity, Vec::new());
            for vector in vectors {
                refill(vector, n, 0.0);
            }
        }
        self.inverse_curvatures.resize(self.capacity, 0.0);
        self.coefficients.resize(self.capacity, 0.0);
    }

    fn is_identity(&self) -> bool {
        self.pairs == 0
    }

    fn update(&mut self, s: &[f64], y: &[f64]) {
        self.newest = (self.newest + 1) % self.capacity;
        self.steps[self.newest].copy_from_slice(s);
        self.changes[self.newest].copy_from_slice(y);
        self.inverse_curvatures[self.newest] = 1.0 / dot(s, y);
        self.pairs = (self.pairs + 1).min(self.capacity);
    }

    fn apply(&mut self, gradient: &[f64], direction: &mut [f64]) {
        for (d, g) in direction.iter_mut().zip(gradient) {
            *d = -g;
        }
        if self.pairs == 0 {
            return;
        }
        let index = |age: usize| (self.newest + self.capacity - age) % self.capacity;
        for age in 0..self.pairs {
            let k = index(age);
            let coefficient = self.inverse_curvatures[k] * dot(&self.steps[k], direction);
            self.coefficients[k] = coefficient;
            for (d, y) in direction.iter_mut().zip(&self.changes[k]) {
                *d -= coefficient * y;
            }
        }
        let y = &self.changes[self.newest];
        let scale = 1.0 / (self.inverse_curvatures[self.newest] * dot(y, y));
        for d in direction.iter_mut() {
            *d *= scale;
        }
        for age in (0..self.pairs).rev() {
            let k = index(age);
            let correction = self.coefficients[k]
                - self.inverse_curvatures[k] * dot(&self.changes[k], direction);
            for (d, s) in direction.iter_mut().zip(&self.steps[k]) {
                *d += correction * s;
            }
        }
    }
}
