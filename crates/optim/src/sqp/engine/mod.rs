//! The iteration that the sparse and the dense solver share: a trust-region SQP method for an
//! exact penalty function.
//!
//! At x the step d minimises the convex model
//!
//! ```text
//! gᵀd + ½ dᵀHd + ν Σᵢ violation of (cᵢ + Jᵢd),   |d| ≤ Δ,  x + d within its bounds
//! ```
//!
//! which always has a solution (Fletcher's Sℓ₁QP: R. Fletcher, Practical Methods of Optimization,
//! 2nd ed., section 14.4). A trial point is judged by the same ℓ₁ penalty of the true functions; a
//! rejected step is first repaired by a second-order correction, which solves again with the
//! constraint values found at the trial point. ν is raised when a larger ν makes the linearised
//! violation markedly smaller (steering: R. H. Byrd, J. Nocedal, R. A. Waltz, "Steering exact
//! penalty methods for nonlinear programming", Optimization Methods and Software 23 (2008)), and
//! when the multipliers demand it. A point is declared infeasible only after a subproblem that
//! minimises the violation alone, with every row elastic, finds nothing to gain.

mod curvature;
mod optimality;
mod trial;

use super::model::{LocalModel, check_finite, check_start};
use super::{Evaluations, NumericalTrouble, SqpOptions, SqpReport, SqpStatus};
use crate::kkt::KktResiduals;
use crate::vector::{dot, largest, refill};
use crate::{Hessian, Nlp, ProblemError};

/// A trial step is accepted if it achieves this fraction of the predicted reduction.
const ACCEPTED_RATIO: f64 = 1e-4;
/// The trust region shrinks below this ratio and grows above the next.
const POOR_RATIO: f64 = 0.25;
const GOOD_RATIO: f64 = 0.75;
/// A relative reduction of the violation below this is none.
const NEGLIGIBLE_REDUCTION: f64 = 1e-3;
/// Most times that ν may be raised tenfold in one iteration.
const MAX_PENALTY_RAISES: usize = 2;
/// The multipliers of constraints that are met at any price may exceed ν by this factor before all
/// constraints are made elastic, which bounds the multipliers by ν. (They are that large where the
/// gradients of active constraints are nearly dependent.)
const TOLERATED_MULTIPLIER: f64 = 1e2;
/// The size of the terms that cancel in the gradient of the Lagrangian counts only up to this
/// multiple of the gradient of the objective, lest huge multipliers pass for a solution.
const LARGEST_TERM: f64 = 100.0;
/// ν may be lowered by up to this factor at once, and so many times in a run.
const PENALTY_REDUCTION: f64 = 10.0;
const MAX_PENALTY_REDUCTIONS: usize = 6;
/// ν is not raised beyond this multiple of its first value.
const LARGEST_PENALTY_FACTOR: f64 = 1e12;
/// First multiple of the identity added to an indefinite Hessian, relative to its largest entry,
/// and the factor between attempts.
const SMALLEST_SHIFT: f64 = 1e-8;
const SHIFT_FACTOR: f64 = 8.0;
const MAX_SHIFTS: usize = 30;
/// The trust region may not be smaller than this, relative to x.
const SMALLEST_RADIUS: f64 = 1e-14;
/// Most accepted steps in a row whose gain is below rounding.
const MAX_IDLE_STEPS: usize = 3;
/// Below this a feasible objective counts as unbounded.
const UNBOUNDED: f64 = -1e12;

/// Which constraints of a subproblem may be violated at a price.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Elastic {
    /// Those that a zero step violates. The others are met.
    Violated,
    /// All.
    All,
}

/// What a subproblem minimises besides the violation.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Aim {
    /// The model of the objective.
    Objective,
    /// Nothing (but a small multiple of ‖d‖², which makes the solution unique).
    Feasibility,
}

/// A convex subproblem over the step d, in scaled units. Gradient, Jacobian and Hessian are those
/// of the model last set.
pub(super) struct Subproblem<'a> {
    /// Bounds on Jd.
    pub row_lower: &'a [f64],
    pub row_upper: &'a [f64],
    /// Bounds on d: trust region and variable bounds together.
    pub lower: &'a [f64],
    pub upper: &'a [f64],
    pub radius: f64,
    /// Price ν of a unit of violation.
    pub penalty: f64,
    pub elastic: Elastic,
    pub aim: Aim,
}

/// A solver of the subproblems.
pub(super) trait Backend: std::fmt::Debug {
    /// Prepares for a problem; `warm` keeps what was learnt from the last.
    fn set_up(&mut self, model: &LocalModel, warm: bool);

    /// Takes the derivatives of the model at a new point. False if H + shift·I is not positive
    /// definite.
    fn set_model(&mut self, model: &LocalModel, certainly_convex: bool) -> bool;

    /// Solves a subproblem into `step` and `multipliers`; false if that failed. The multipliers of
    /// the rows are positive at upper bounds.
    fn solve(
        &mut self,
        model: &LocalModel,
        subproblem: &Subproblem<'_>,
        step: &mut [f64],
        multipliers: &mut [f64],
    ) -> bool;

    /// Solves more precisely from now on; false if it cannot.
    fn refine(&mut self) -> bool;

    /// Number of quadratic programmes solved since `set_up`.
    fn solves(&self) -> usize;
}

/// The memory of the iteration.
#[derive(Debug, Default)]
pub(super) struct Engine<B> {
    pub backend: B,
    model: LocalModel,
    /// Multipliers λ of the rows in the problem's units.
    pub multipliers: Vec<f64>,
    /// The same in scaled units.
    multipliers_hat: Vec<f64>,
    /// Multipliers in scaled units that the last subproblem ended with.
    step_multipliers: Vec<f64>,
    kept_multipliers: Vec<f64>,
    step: Vec<f64>,
    kept_step: Vec<f64>,
    x: Vec<f64>,
    trial: Vec<f64>,
    constraints: Vec<f64>,
    trial_constraints: Vec<f64>,
    row_lower: Vec<f64>,
    row_upper: Vec<f64>,
    step_lower: Vec<f64>,
    step_upper: Vec<f64>,
    lagrangian_gradient: Vec<f64>,
    old_lagrangian_gradient: Vec<f64>,
    product: Vec<f64>,
}

/// How an iteration ended.
enum Progress {
    Accepted,
    Stop(SqpStatus),
}

/// The functions at a trial point.
struct Trial {
    objective: f64,
    /// Reduction of the penalty function; −∞ where a function is not finite.
    reduction: f64,
}

/// What changes from iteration to iteration besides the vectors.
struct State {
    objective: f64,
    radius: f64,
    penalty: f64,
    largest_penalty: f64,
    penalty_reductions: usize,
    /// Scale against which stationarity is measured.
    gradient_size: f64,
    shift: f64,
    elastic: Elastic,
    /// Iterations to wait until the next trial of a larger penalty, and how long the last wait was.
    steering_pause: usize,
    steering_backoff: usize,
    /// Accepted steps in a row whose predicted reduction was below rounding.
    idle_steps: usize,
    evaluations: Evaluations,
}

impl<B: Backend + Default> Engine<B> {
    pub fn solve<P: Nlp>(
        &mut self,
        options: &SqpOptions,
        problem: &mut P,
        x: &mut [f64],
        warm: bool,
    ) -> Result<SqpReport, ProblemError> {
        check_start(problem.num_variables(), x)?;
        self.model.set_up(problem)?;
        for ((value, lower), upper) in x.iter_mut().zip(&self.model.lower).zip(&self.model.upper) {
            *value = value.clamp(*lower, *upper);
        }
        self.allocate(problem.num_variables(), warm);
        self.x.copy_from_slice(x);
        let (status, iterations, state) = self.run(options, problem)?;
        x.copy_from_slice(&self.x);
        Ok(SqpReport {
            status,
            objective: state.objective,
            residuals: KktResiduals::measure(problem, x, &self.multipliers)?,
            iterations,
            evaluations: Evaluations {
                subproblems: self.backend.solves(),
                ..state.evaluations
            },
        })
    }

    fn allocate(&mut self, num_variables: usize, warm: bool) {
        let k = self.model.num_variables();
        let m = self.model.num_rows();
        if !warm || self.multipliers.len() != m {
            refill(&mut self.multipliers, m, 0.0);
        }
        for vector in [&mut self.x, &mut self.trial] {
            refill(vector, num_variables, 0.0);
        }
        for vector in [
            &mut self.multipliers_hat,
            &mut self.step_multipliers,
            &mut self.kept_multipliers,
            &mut self.constraints,
            &mut self.trial_constraints,
            &mut self.row_lower,
            &mut self.row_upper,
        ] {
            refill(vector, m, 0.0);
        }
        for vector in [
            &mut self.step,
            &mut self.kept_step,
            &mut self.step_lower,
            &mut self.step_upper,
            &mut self.lagrangian_gradient,
            &mut self.old_lagrangian_gradient,
            &mut self.product,
        ] {
            refill(vector, k, 0.0);
        }
        self.backend.set_up(&self.model, warm);
    }

    fn run<P: Nlp>(
        &mut self,
        options: &SqpOptions,
        problem: &mut P,
    ) -> Result<(SqpStatus, usize, State), ProblemError> {
        let kind = problem.hessian_kind();
        let mut state = State {
            objective: problem.objective(&self.x),
            radius: options.initial_radius,
            penalty: options.initial_penalty,
            largest_penalty: f64::INFINITY,
            penalty_reductions: MAX_PENALTY_REDUCTIONS,
            gradient_size: 0.0,
            shift: 0.0,
            elastic: Elastic::Violated,
            steering_pause: 0,
            steering_backoff: 1,
            idle_steps: 0,
            evaluations: Evaluations::default(),
        };
        problem.constraints(&self.x, &mut self.constraints);
        state.evaluations.functions += 1;
        check_finite("objective", &[state.objective]).map_err(not_finite_at_start)?;
        check_finite("constraint", &self.constraints).map_err(not_finite_at_start)?;

        let mut iteration = 0;
        loop {
            let linearised = self.model.linearise(problem, &self.x);
            state.evaluations.derivatives += 1;
            match linearised {
                Ok(()) => {}
                Err(bad) if iteration == 0 => return Err(not_finite_at_start(bad)),
                Err(_) => {
                    let trouble = SqpStatus::NumericalTrouble(NumericalTrouble::NotFinite);
                    return Ok((trouble, iteration, state));
                }
            }
            if iteration == 0 {
                self.model.scale_rows();
                for ((scaled, multiplier), scale) in self
                    .multipliers_hat
                    .iter_mut()
                    .zip(&self.multipliers)
                    .zip(&self.model.row_scales)
                {
                    *scaled = multiplier / scale;
                }
                state.gradient_size = self.unscaled_gradient_size();
                let first = options.initial_penalty * nonzero(largest(&self.model.gradient));
                state.penalty = first;
                state.largest_penalty = LARGEST_PENALTY_FACTOR * first;
            }
            self.compute_lagrangian_gradient();
            if kind == Hessian::QuasiNewton {
                self.update_quasi_newton(iteration);
            }
            iteration += 1;
            if self.model.num_variables() == 0 {
                return Ok((self.status_of_fixed_point(options), iteration, state));
            }
            if self.is_converged(options, &state) {
                return Ok((SqpStatus::Converged, iteration, state));
            }
            if state.idle_steps > MAX_IDLE_STEPS {
                let verdict = self.verdict_when_stuck(options, &mut state);
                return Ok((verdict, iteration, state));
            }
            if state.objective < UNBOUNDED
                && self.model.largest_violation(&self.constraints) <= options.feasibility_tolerance
            {
                let trouble = SqpStatus::NumericalTrouble(NumericalTrouble::Unbounded);
                return Ok((trouble, iteration, state));
            }
            if iteration >= options.max_iterations {
                return Ok((SqpStatus::IterationLimit, iteration, state));
            }
            if kind != Hessian::QuasiNewton {
                let evaluated = self
                    .model
                    .evaluate_hessian(problem, &self.x, &self.multipliers);
                state.evaluations.hessians += 1;
                if let Err(bad) = evaluated {
                    if iteration == 1 {
                        return Err(not_finite_at_start(bad));
                    }
                    let trouble = SqpStatus::NumericalTrouble(NumericalTrouble::NotFinite);
                    return Ok((trouble, iteration, state));
                }
            }
            if !self.convexify(kind, &mut state, true) {
                let trouble = SqpStatus::NumericalTrouble(NumericalTrouble::Subproblem);
                return Ok((trouble, iteration, state));
            }
            match self.advance(options, problem, kind, &mut state) {
                Progress::Accepted => {}
                Progress::Stop(status) => return Ok((status, iteration, state)),
            }
        }
    }

    /// Finds a step that reduces the penalty function, and takes it.
    fn advance<P: Nlp>(
        &mut self,
        options: &SqpOptions,
        problem: &mut P,
        kind: Hessian,
        state: &mut State,
    ) -> Progress {
        let violation = self.model.violation(&self.constraints);
        loop {
            let size = 1.0 + largest(&self.x);
            if !self.find_step(options, state, violation) {
                return Progress::Stop(SqpStatus::NumericalTrouble(NumericalTrouble::Subproblem));
            }
            let left = self.linearised_violation();
            let step_size = largest(&self.step);
            if left > 0.0
                && left >= (1.0 - NEGLIGIBLE_REDUCTION) * violation
                && let Some(verdict) = self.judge_infeasibility(options, state, violation)
            {
                return Progress::Stop(verdict);
            }
            let objective_change: f64 =
                dot(&self.model.gradient, &self.step) + self.model.curvature(&self.step);
            let predicted = state.penalty * (violation - left) - objective_change;
            let merit = state.objective + state.penalty * violation;
            let rounding =
                10.0 * f64::EPSILON * (state.objective.abs() + state.penalty * violation);

            if predicted <= 0.0 && !self.model.augmentation.is_empty() {
                // The augmentation expected constraints to be active that are not.
                if self.convexify(kind, state, false) {
                    continue;
                }
            }
            if predicted <= rounding
                && left > 0.0
                && self.model.largest_violation(&self.constraints) > options.feasibility_tolerance
                && state.penalty < state.largest_penalty
            {
                // The violation is too cheap to be worth removing.
                state.penalty *= 10.0;
                continue;
            }
            self.adopt_multipliers();
            if step_size <= 1e-14 * size || predicted <= 0.0 {
                // The model has nothing to offer: x is as good as this arithmetic makes it.
                self.compute_lagrangian_gradient();
                let optimal = step_size < 0.5 * state.radius
                    && step_size <= 1e-14 * size
                    && self.model.largest_violation(&self.constraints)
                        <= options.feasibility_tolerance
                    && self.is_nearly_converged(options, state);
                let converged = optimal || self.is_converged(options, state);
                if !converged && self.backend.refine() {
                    continue;
                }
                let status = if converged {
                    SqpStatus::Converged
                } else {
                    self.verdict_when_stuck(options, state)
                };
                return Progress::Stop(status);
            }

            self.place_trial();
            let mut trial = self.evaluate_trial(problem, state, merit);
            let mut ratio = trial.reduction / predicted;
            if predicted <= rounding && trial.reduction >= -rounding {
                // Both reductions are rounding errors; the model is all there is to go by.
                ratio = 1.0;
                state.idle_steps += 1;
            } else {
                state.idle_steps = 0;
            }
            // A step may have failed through nothing but the curvature of the constraints.
            if ratio < ACCEPTED_RATIO && trial.reduction.is_finite() && self.correct_step(state) {
                let corrected = self.evaluate_trial(problem, state, merit);
                if corrected.reduction / predicted >= ACCEPTED_RATIO {
                    ratio = corrected.reduction / predicted;
                    trial = corrected;
                    self.adopt_multipliers();
                }
            }
            let at_edge = step_size >= 0.99 * state.radius;
            if ratio < POOR_RATIO || ratio.is_nan() {
                let factor = if ratio > ACCEPTED_RATIO { 0.5 } else { 0.25 };
                state.radius = factor * step_size.min(state.radius);
            } else if ratio > GOOD_RATIO && at_edge {
                state.radius = (2.0 * state.radius).min(options.max_radius);
            }
            if ratio >= ACCEPTED_RATIO {
                std::mem::swap(&mut self.x, &mut self.trial);
                std::mem::swap(&mut self.constraints, &mut self.trial_constraints);
                state.objective = trial.objective;
                state.steering_pause = state.steering_pause.saturating_sub(1);
                // The gradient of the Lagrangian at the old point with the new multipliers, for
                // the quasi-Newton update.
                self.compute_lagrangian_gradient();
                std::mem::swap(
                    &mut self.lagrangian_gradient,
                    &mut self.old_lagrangian_gradient,
                );
                return Progress::Accepted;
            }
            if state.radius < SMALLEST_RADIUS * size {
                return Progress::Stop(self.verdict_when_stuck(options, state));
            }
        }
    }

    /// Solves the subproblem at x, raising the penalty where that buys feasibility.
    fn find_step(&mut self, options: &SqpOptions, state: &mut State, violation: f64) -> bool {
        self.set_step_bounds(state.radius);
        self.set_row_bounds();
        if !self.solve_subproblem(state, state.penalty, state.elastic, Aim::Objective) {
            return false;
        }
        if largest(&self.step_multipliers) > TOLERATED_MULTIPLIER * state.penalty
            && !self.solve_subproblem(state, state.penalty, Elastic::All, Aim::Objective)
        {
            return false;
        }
        let mut left = self.linearised_violation();
        let worth_steering = |left: f64| {
            left > 0.1 * violation
                && left > 0.1 * options.feasibility_tolerance
                && state.steering_pause == 0
        };
        if worth_steering(left) {
            let mut penalty = state.penalty;
            let mut gained = false;
            for _ in 0..MAX_PENALTY_RAISES {
                penalty *= 10.0;
                if penalty > state.largest_penalty {
                    break;
                }
                std::mem::swap(&mut self.step, &mut self.kept_step);
                std::mem::swap(&mut self.step_multipliers, &mut self.kept_multipliers);
                let solved = self.solve_subproblem(state, penalty, state.elastic, Aim::Objective);
                let now_left = self.linearised_violation();
                if !solved || now_left > 0.9 * left {
                    std::mem::swap(&mut self.step, &mut self.kept_step);
                    std::mem::swap(&mut self.step_multipliers, &mut self.kept_multipliers);
                    break;
                }
                gained = true;
                left = now_left;
                state.penalty = penalty;
                if !worth_steering(left) {
                    break;
                }
            }
            if gained {
                state.steering_backoff = 1;
            } else {
                state.steering_pause = state.steering_backoff;
                state.steering_backoff = (2 * state.steering_backoff).min(8);
            }
        }
        // Where the linearised constraints can be met the multipliers are those of the problem,
        // and an exact penalty has to exceed them.
        if left <= 1e-9 * (1.0 + violation) {
            let wanted = 2.0 * largest(&self.step_multipliers);
            if state.penalty < 0.6 * wanted {
                state.penalty = wanted.min(state.largest_penalty);
            } else if state.penalty > PENALTY_REDUCTION * wanted && state.penalty_reductions > 0 {
                // A penalty far above need makes steps along curved constraints short.
                state.penalty = wanted.max(state.penalty / PENALTY_REDUCTION);
                state.penalty_reductions -= 1;
            }
        }
        true
    }

    /// Replaces the step, and with it the trial point, by one that also accounts for the constraint
    /// values found at the trial point.
    fn correct_step(&mut self, state: &State) -> bool {
        if self.model.num_rows() == 0 {
            return false;
        }
        for i in 0..self.model.num_rows() {
            let scale = self.model.row_scales[i];
            let linear = self.model.jacobian.row_dot(i, &self.step);
            let value = self.trial_constraints[i];
            self.row_lower[i] = scale * (self.model.row_lower[i] - value) + linear;
            self.row_upper[i] = scale * (self.model.row_upper[i] - value) + linear;
        }
        if !self.solve_subproblem(state, state.penalty, state.elastic, Aim::Objective) {
            return false;
        }
        self.place_trial();
        true
    }

    fn solve_subproblem(
        &mut self,
        state: &State,
        penalty: f64,
        elastic: Elastic,
        aim: Aim,
    ) -> bool {
        let subproblem = Subproblem {
            row_lower: &self.row_lower,
            row_upper: &self.row_upper,
            lower: &self.step_lower,
            upper: &self.step_upper,
            radius: state.radius,
            penalty,
            elastic,
            aim,
        };
        let solved = self.backend.solve(
            &self.model,
            &subproblem,
            &mut self.step,
            &mut self.step_multipliers,
        );
        if solved {
            for ((d, lower), upper) in self
                .step
                .iter_mut()
                .zip(&self.step_lower)
                .zip(&self.step_upper)
            {
                *d = d.clamp(*lower, *upper);
            }
        }
        solved && self.step.iter().all(|d| d.is_finite())
    }
}

fn not_finite_at_start((what, index, value): (&'static str, usize, f64)) -> ProblemError {
    ProblemError::NotFiniteAtStart { what, index, value }
}

/// A magnitude to divide by or to measure with.
fn nonzero(size: f64) -> f64 {
    if size > 0.0 { size } else { 1.0 }
}
