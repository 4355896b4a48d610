//! Step lengths along a descent direction.
//!
//! With φ(α) = f(x + α d) and φ'(0) < 0, a step length α satisfies
//!
//! ```text
//! Armijo's rule            φ(α) ≤ φ(0) + c₁ α φ'(0)
//! the strong Wolfe rules   the same, and |φ'(α)| ≤ c₂ |φ'(0)|
//! ```
//!
//! Source: J. Nocedal, S. J. Wright, Numerical Optimization, 2nd ed., 2006, section 3.1 and
//! algorithms 3.5 and 3.6, with cubic interpolation. Near a minimum the differences of φ drown in
//! rounding; the first rule is therefore relaxed by a few units in the last place of φ(0), which
//! lets the slopes decide.
//!
//! Cost: Armijo's rule one value a trial and one gradient in the end; the Wolfe rules a value and a
//! gradient a trial, mostly one or two trials.

use crate::options::options;
use crate::problem::SmoothFunction;
use crate::vector::dot;

/// Relaxation of the decrease in units of rounding of φ(0).
const ROUNDING: f64 = 8.0 * f64::EPSILON;
/// Growth of the step while looking for an interval that holds a good one.
const EXPANSION: f64 = 4.0;

/// Which conditions a step length has to meet.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum LineSearch {
    /// Backtracking to sufficient decrease: cheap trials, no control of the slope.
    Armijo,
    /// Sufficient decrease and a small slope, which keeps quasi-Newton updates positive definite.
    #[default]
    StrongWolfe,
}

options! {
    /// Options of the line searches.
    #[derive(Copy)]
    pub struct LineSearchOptions {
        /// Which conditions to meet. Default [`LineSearch::StrongWolfe`].
        rule / with_rule: LineSearch = LineSearch::StrongWolfe;
        /// The fraction c₁ of the decrease that the slope promises. Default 1e-4.
        sufficient_decrease / with_sufficient_decrease: f64 = 1e-4,
            "lie between 0 and 1/2" if |v| v > 0.0 && v < 0.5;
        /// The fraction c₂ of the slope that may remain. Default 0.9, for quasi-Newton steps.
        curvature / with_curvature: f64 = 0.9,
            "lie between 0 and 1" if |v| v > 0.0 && v < 1.0;
        /// Most trials. Default 40.
        max_trials / with_max_trials: usize = 40,
            "be at least one" if |v| v >= 1;
    }
}

/// A step along a direction, with what is needed at both ends.
pub(crate) struct Ray<'a> {
    pub x: &'a [f64],
    pub direction: &'a [f64],
    /// φ(0).
    pub value: f64,
    /// φ'(0) < 0.
    pub slope: f64,
    /// Receives x + α d.
    pub trial: &'a mut [f64],
    /// Receives the gradient there.
    pub gradient: &'a mut [f64],
    /// Evaluations of the value and of value and gradient.
    pub evaluations: &'a mut (usize, usize),
}

/// A point on the ray.
#[derive(Debug, Clone, Copy)]
struct Sample {
    step: f64,
    value: f64,
    slope: f64,
}

impl Ray<'_> {
    /// Finds a step length, trying `first` before others. On success `trial` and `gradient` belong
    /// to the step returned, with the value there.
    pub fn search<F: SmoothFunction>(
        &mut self,
        function: &mut F,
        first: f64,
        options: &LineSearchOptions,
    ) -> Option<(f64, f64)> {
        match options.rule {
            LineSearch::Armijo => self.backtrack(function, first, options),
            LineSearch::StrongWolfe => self.bracket(function, first, options),
        }
    }

    fn place(&mut self, step: f64) {
        for ((t, x), d) in self.trial.iter_mut().zip(self.x).zip(self.direction) {
            *t = x + step * d;
        }
    }

    fn sample<F: SmoothFunction>(&mut self, function: &mut F, step: f64) -> Sample {
        self.place(step);
        self.evaluations.1 += 1;
        let value = function.value_and_gradient(self.trial, self.gradient);
        let slope = dot(self.gradient, self.direction);
        if value.is_finite() && slope.is_finite() {
            Sample { step, value, slope }
        } else {
            // Outside the domain of f: as high as can be.
            Sample {
                step,
                value: f64::INFINITY,
                slope: f64::INFINITY,
            }
        }
    }

    fn decreases_enough(&self, step: f64, value: f64, options: &LineSearchOptions) -> bool {
        value
            <= self.value
                + options.sufficient_decrease * step * self.slope
                + ROUNDING * self.value.abs()
    }

    fn backtrack<F: SmoothFunction>(
        &mut self,
        function: &mut F,
        first: f64,
        options: &LineSearchOptions,
    ) -> Option<(f64, f64)> {
        let mut step = first;
        for _ in 0..options.max_trials {
            self.place(step);
            self.evaluations.0 += 1;
            let value = function.value(self.trial);
            if value.is_finite() && self.decreases_enough(step, value, options) {
                self.evaluations.1 += 1;
                let value = function.value_and_gradient(self.trial, self.gradient);
                return self
                    .gradient
                    .iter()
                    .all(|g| g.is_finite())
                    .then_some((step, value));
            }
            // The minimum of the parabola through φ(0), φ'(0) and φ(α), within reason.
            let parabola = -self.slope * step / (2.0 * (value - self.value - self.slope * step));
            let factor = if parabola.is_finite() {
                parabola.clamp(0.1, 0.5)
            } else {
                0.1
            };
            step *= factor;
        }
        None
    }

    /// Walks outward until an interval holds a step that meets both rules, then narrows it.
    fn bracket<F: SmoothFunction>(
        &mut self,
        function: &mut F,
        first: f64,
        options: &LineSearchOptions,
    ) -> Option<(f64, f64)> {
        let origin = Sample {
            step: 0.0,
            value: self.value,
            slope: self.slope,
        };
        let mut previous = origin;
        let mut step = first;
        for trial in 0..options.max_trials {
            let current = self.sample(function, step);
            let left = options.max_trials - trial;
            if !self.decreases_enough(step, current.value, options)
                || (trial > 0 && current.value >= previous.value)
            {
                return self.narrow(function, previous, current, left, options);
            }
            if current.slope.abs() <= -options.curvature * self.slope {
                return Some((step, current.value));
            }
            if current.slope >= 0.0 {
                return self.narrow(function, current, previous, left, options);
            }
            previous = current;
            step *= EXPANSION;
        }
        // Still descending steeply: f seems to have no minimum along the ray, but it has decreased.
        Some((previous.step, self.sample(function, previous.step).value))
    }

    /// Narrows the interval between `low`, the best step so far that decreases enough, and `high`
    /// such that φ' at `low` points to `high`.
    fn narrow<F: SmoothFunction>(
        &mut self,
        function: &mut F,
        mut low: Sample,
        mut high: Sample,
        trials: usize,
        options: &LineSearchOptions,
    ) -> Option<(f64, f64)> {
        for _ in 0..trials {
            let width = high.step - low.step;
            let step = low.step + width * interpolate(low, high).clamp(0.1, 0.9);
            let current = self.sample(function, step);
            if !self.decreases_enough(step, current.value, options) || current.value > low.value {
                high = current;
            } else {
                if current.slope.abs() <= -options.curvature * self.slope {
                    return Some((step, current.value));
                }
                if current.slope * (high.step - low.step) >= 0.0 {
                    high = low;
                }
                low = current;
            }
            if (high.step - low.step).abs() <= f64::EPSILON * high.step.abs() {
                break;
            }
        }
        // The slope rule could not be met; a decrease is still worth having.
        if low.step > 0.0 {
            let last = self.sample(function, low.step);
            return Some((low.step, last.value));
        }
        None
    }
}

/// The fraction of the interval at which the cubic through both ends has its minimum.
fn interpolate(low: Sample, high: Sample) -> f64 {
    let width = high.step - low.step;
    if !high.value.is_finite() {
        return 0.1;
    }
    let (slope_low, slope_high) = (low.slope * width, high.slope * width);
    let theta = 3.0 * (low.value - high.value) + slope_low + slope_high;
    let discriminant = theta * theta - slope_low * slope_high;
    let root = discriminant.max(0.0).sqrt();
    let fraction = 1.0 - (slope_high + root - theta) / (slope_high - slope_low + 2.0 * root);
    if fraction.is_finite() { fraction } else { 0.5 }
}
