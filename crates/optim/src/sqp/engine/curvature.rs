//! The Hessian of the subproblem: made convex where second derivatives are known, estimated where
//! they are not.

use super::{Backend, Engine, MAX_SHIFTS, SHIFT_FACTOR, SMALLEST_SHIFT, State, nonzero};
use crate::Hessian;
use crate::vector::{dot, largest};

impl<B: Backend + Default> Engine<B> {
    /// Makes the Hessian of the subproblem positive definite, if possible by terms that do not
    /// change the step; false if nothing helps.
    pub(super) fn convexify(&mut self, kind: Hessian, state: &mut State, augment: bool) -> bool {
        let certain = kind != Hessian::Lagrangian;
        self.model.shift = 0.0;
        self.model.augmentation.clear();
        if self.backend.set_model(&self.model, certain) {
            state.shift = 0.0;
            return true;
        }
        if augment && !certain {
            self.model
                .augment(&self.x, &self.multipliers_hat, &self.lagrangian_gradient);
            if !self.model.augmentation.is_empty() && self.backend.set_model(&self.model, certain) {
                state.shift = 0.0;
                return true;
            }
        }
        let size = self.model.hessian_size();
        let size = if size > 0.0 {
            size
        } else {
            nonzero(largest(&self.model.gradient) / state.radius)
        };
        self.model.shift = (SMALLEST_SHIFT * size).max(state.shift / SHIFT_FACTOR.powi(2));
        for _ in 0..MAX_SHIFTS {
            if self.backend.set_model(&self.model, certain) {
                state.shift = self.model.shift;
                return true;
            }
            self.model.shift *= SHIFT_FACTOR;
        }
        false
    }

    /// Powell's damped BFGS update of the approximate Hessian of the Lagrangian.
    pub(super) fn update_quasi_newton(&mut self, iteration: usize) {
        let k = self.model.num_variables();
        if iteration == 0 {
            // The first step then reaches about as far as the trust region.
            let size = nonzero(largest(&self.model.gradient));
            self.set_hessian_to_multiple_of_identity(size);
            return;
        }
        let mut change = std::mem::take(&mut self.old_lagrangian_gradient);
        for (c, new) in change.iter_mut().zip(&self.lagrangian_gradient) {
            *c = new - *c;
        }
        let step_squared = dot(&self.step, &self.step);
        let mut along = dot(&self.step, &change);
        if iteration == 1 && along > 0.0 {
            self.set_hessian_to_multiple_of_identity(dot(&change, &change) / along);
        }
        self.product.fill(0.0);
        for j in 0..k {
            let (rows, values) = self.model.hessian.row(j);
            for (&i, v) in rows.iter().zip(values) {
                self.product[i] += v * self.step[j];
                if i != j {
                    self.product[j] += v * self.step[i];
                }
            }
        }
        let curvature = dot(&self.step, &self.product);
        if step_squared > 0.0 && curvature > 0.0 {
            if along < 0.2 * curvature {
                let theta = 0.8 * curvature / (curvature - along);
                for (c, p) in change.iter_mut().zip(&self.product) {
                    *c = theta * *c + (1.0 - theta) * p;
                }
                along = dot(&self.step, &change);
            }
            for j in 0..k {
                let range = self.model.hessian.starts[j]..self.model.hessian.starts[j + 1];
                for (i, value) in self.model.hessian.values[range].iter_mut().enumerate() {
                    *value += change[i] * change[j] / along
                        - self.product[i] * self.product[j] / curvature;
                }
            }
        }
        self.old_lagrangian_gradient = change;
    }

    pub(super) fn set_hessian_to_multiple_of_identity(&mut self, factor: f64) {
        self.model.hessian.values.fill(0.0);
        for j in 0..self.model.num_variables() {
            let diagonal = self.model.hessian.starts[j + 1] - 1;
            self.model.hessian.values[diagonal] = factor;
        }
    }
}
