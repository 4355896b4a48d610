//! What constraints and trust region leave to a step, and what the step does.

use super::{Backend, Engine, State, Trial};
use crate::Nlp;

impl<B: Backend + Default> Engine<B> {
    /// What the linearised constraints at x leave to Jd.
    pub(super) fn set_row_bounds(&mut self) {
        for i in 0..self.model.num_rows() {
            let scale = self.model.row_scales[i];
            self.row_lower[i] = scale * (self.model.row_lower[i] - self.constraints[i]);
            self.row_upper[i] = scale * (self.model.row_upper[i] - self.constraints[i]);
        }
    }

    /// The box that the trust region and the variables' bounds leave to the step.
    pub(super) fn set_step_bounds(&mut self, radius: f64) {
        for (k, &j) in self.model.free.iter().enumerate() {
            let scale = self.model.scales[k];
            let below = (self.model.lower[j] - self.x[j]) / scale;
            let above = (self.model.upper[j] - self.x[j]) / scale;
            self.step_lower[k] = below.max(-radius).min(0.0);
            self.step_upper[k] = above.min(radius).max(0.0);
        }
    }

    /// trial = x + step, within the bounds of the variables.
    pub(super) fn place_trial(&mut self) {
        self.trial.copy_from_slice(&self.x);
        for (k, &j) in self.model.free.iter().enumerate() {
            let value = self.x[j] + self.model.scales[k] * self.step[k];
            self.trial[j] = value.clamp(self.model.lower[j], self.model.upper[j]);
        }
    }

    /// Evaluates the functions at the trial point.
    pub(super) fn evaluate_trial<P: Nlp>(
        &mut self,
        problem: &mut P,
        state: &mut State,
        merit: f64,
    ) -> Trial {
        state.evaluations.functions += 1;
        let objective = problem.objective(&self.trial);
        problem.constraints(&self.trial, &mut self.trial_constraints);
        let finite = objective.is_finite() && self.trial_constraints.iter().all(|c| c.is_finite());
        let reduction = if finite {
            let violation = self.model.violation(&self.trial_constraints);
            merit - objective - state.penalty * violation
        } else {
            f64::NEG_INFINITY
        };
        Trial {
            objective,
            reduction,
        }
    }

    /// Violation of the linearised constraints by the step.
    pub(super) fn linearised_violation(&self) -> f64 {
        let mut sum = 0.0;
        for i in 0..self.model.num_rows() {
            let value = self.model.jacobian.row_dot(i, &self.step);
            let outside = (self.row_lower[i] - value).max(value - self.row_upper[i]);
            // What the subproblem's solver leaves of a constraint that it met is rounding.
            if outside > 1e-12 {
                sum += outside;
            }
        }
        sum
    }
}
