//! Whether a point solves the problem, or shows that it has no solution.

use super::{Aim, Backend, Elastic, Engine, LARGEST_TERM, NEGLIGIBLE_REDUCTION, State, nonzero};
use crate::sqp::{NumericalTrouble, SqpOptions, SqpStatus, UnmetConstraint};

impl<B: Backend + Default> Engine<B> {
    /// The status if all variables are fixed.
    pub(super) fn status_of_fixed_point(&self, options: &SqpOptions) -> SqpStatus {
        let unmet = self.unmet(options);
        if unmet.is_empty() {
            SqpStatus::Converged
        } else {
            SqpStatus::Infeasible(unmet)
        }
    }

    /// The constraints that x does not meet.
    pub(super) fn unmet(&self, options: &SqpOptions) -> Vec<UnmetConstraint> {
        UnmetConstraint::list(
            &self.constraints,
            &self.model.row_lower,
            &self.model.row_upper,
            options.feasibility_tolerance,
        )
    }

    /// Whether x is a stationary point of the violation; None if the violation can be reduced.
    pub(super) fn judge_infeasibility(
        &mut self,
        options: &SqpOptions,
        state: &mut State,
        violation: f64,
    ) -> Option<SqpStatus> {
        // Violations near the tolerance are a matter of precision, not of infeasibility.
        let worst = self.model.largest_violation(&self.constraints);
        if worst <= 100.0 * options.feasibility_tolerance {
            return None;
        }
        std::mem::swap(&mut self.step, &mut self.kept_step);
        std::mem::swap(&mut self.step_multipliers, &mut self.kept_multipliers);
        let radius = state.radius;
        state.radius = radius.max(options.initial_radius);
        self.set_step_bounds(state.radius);
        let solved = self.solve_subproblem(state, 1.0, Elastic::All, Aim::Feasibility);
        let left = self.linearised_violation();
        state.radius = radius;
        self.set_step_bounds(radius);
        let infeasible = solved && left >= (1.0 - NEGLIGIBLE_REDUCTION) * violation;
        if infeasible {
            // The multipliers of the feasibility problem are the certificate.
            self.adopt_multipliers();
        } else {
            // Holding on to the constraints that are met keeps the others violated: let go.
            state.elastic = Elastic::All;
        }
        std::mem::swap(&mut self.step, &mut self.kept_step);
        std::mem::swap(&mut self.step_multipliers, &mut self.kept_multipliers);
        infeasible.then(|| SqpStatus::Infeasible(self.unmet(options)))
    }

    /// The status of a run that cannot go on from x.
    pub(super) fn verdict_when_stuck(
        &mut self,
        options: &SqpOptions,
        state: &mut State,
    ) -> SqpStatus {
        let violation = self.model.violation(&self.constraints);
        self.set_row_bounds();
        self.judge_infeasibility(options, state, violation)
            .unwrap_or(SqpStatus::NumericalTrouble(NumericalTrouble::StepTooSmall))
    }

    /// Takes over the multipliers of the last subproblem.
    pub(super) fn adopt_multipliers(&mut self) {
        self.multipliers_hat.copy_from_slice(&self.step_multipliers);
        for ((multiplier, scaled), scale) in self
            .multipliers
            .iter_mut()
            .zip(&self.multipliers_hat)
            .zip(&self.model.row_scales)
        {
            *multiplier = scaled * scale;
        }
    }

    /// The scaled gradient of the Lagrangian, g + Jᵀλ, at the linearisation.
    pub(super) fn compute_lagrangian_gradient(&mut self) {
        self.lagrangian_gradient
            .copy_from_slice(&self.model.gradient);
        self.model
            .jacobian
            .add_transposed_product(&self.multipliers_hat, &mut self.lagrangian_gradient);
    }

    /// Size of the gradient of the objective, in the units of the variables.
    pub(super) fn unscaled_gradient_size(&self) -> f64 {
        let unscaled = self.model.gradient.iter().zip(&self.model.scales);
        unscaled.fold(0.0_f64, |size, (g, scale)| size.max((g / scale).abs()))
    }

    /// Whether a step that vanishes can be believed: with a Hessian that is far too large it
    /// vanishes anywhere.
    pub(super) fn is_nearly_converged(&self, options: &SqpOptions, state: &State) -> bool {
        let mut loose = options.clone();
        loose.optimality_tolerance = loose.optimality_tolerance.max(1e-2);
        // Where the objective is constant there is nothing to be stationary.
        self.unscaled_gradient_size() == 0.0 || self.is_converged(&loose, state)
    }

    /// Whether x and the multipliers adopted meet the tolerances. The gradient of the Lagrangian
    /// has to be that of x and these multipliers.
    pub(super) fn is_converged(&self, options: &SqpOptions, state: &State) -> bool {
        if self.model.largest_violation(&self.constraints) > options.feasibility_tolerance {
            return false;
        }
        let size = (1e-2 * state.gradient_size).max(self.unscaled_gradient_size());
        let mut stationarity = 0.0_f64;
        for (k, &j) in self.model.free.iter().enumerate() {
            let residual = self.lagrangian_gradient[k] / self.model.scales[k];
            let near = 1e-8 * (1.0 + self.x[j].abs());
            let held = (residual > 0.0 && self.x[j] <= self.model.lower[j] + near)
                || (residual < 0.0 && self.x[j] >= self.model.upper[j] - near);
            if !held {
                stationarity = stationarity.max(residual.abs());
            }
        }
        // The multipliers count towards the size of the terms that cancel.
        let mut terms = size;
        for (i, &multiplier) in self.multipliers_hat.iter().enumerate() {
            if multiplier != 0.0 {
                let (columns, values) = self.model.jacobian.row(i);
                for (&k, v) in columns.iter().zip(values) {
                    terms = terms.max((multiplier * v / self.model.scales[k]).abs());
                }
            }
        }
        let size = terms.min(LARGEST_TERM * nonzero(size));
        if stationarity > options.optimality_tolerance * size {
            return false;
        }
        // Rows are scaled to unit gradients, so that a row's distance from its bound is a length
        // like those of the variables, and a multiplier is a gradient.
        self.multipliers_hat
            .iter()
            .enumerate()
            .all(|(i, &multiplier)| {
                let bound = if multiplier > 0.0 {
                    self.model.row_upper[i]
                } else {
                    self.model.row_lower[i]
                };
                let distance = self.model.row_scales[i] * (bound - self.constraints[i]).abs();
                multiplier == 0.0
                    || multiplier.abs() * distance.min(1.0) <= options.optimality_tolerance * size
            })
    }
}
