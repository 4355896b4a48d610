//! One step of a branch, slid along limits and contacts.

use tensegra_atlas::{ImplicitManifold, Obstruction, Validity};

use super::{ROUNDING, branch::Stop, search::Search};
use crate::{slide::Constraint, tree::squared_distance};

/// A sliding step is worth taking when at least this fraction of the wanted
/// step is left.
const LEAST_STEP: f64 = 0.3;
/// Corrections of a sliding step.
const CORRECTIONS: usize = 3;

/// What became of a step.
pub(super) enum Step {
    /// The point and its tangent coordinates are in `next`.
    Accepted,
    /// The chart does not represent the manifold well enough there.
    NeedsChart,
    Stopped(Stop),
}

impl<M: ImplicitManifold + ?Sized, V: Validity> Search<'_, M, V> {
    /// Validity of the step from `here` to x.
    pub(super) fn test(&mut self, chart: usize, x: &[f64]) -> Result<(), Obstruction> {
        self.statistics.validity_tests += 1;
        let Self {
            planner,
            atlas,
            here,
            memory,
            next_memory,
            contacts,
            work,
            ..
        } = self;
        let (options, manifold) = (&planner.options, planner.manifold);
        let chart = atlas.chart(chart);
        planner.validity.tree_step(
            memory,
            x,
            next_memory,
            &mut |s, y| {
                interpolate(s, &here.x, x, y);
                chart.retract(manifold, y, options.tolerance, work).is_ok()
            },
            contacts,
        )
    }

    /// One step of `wanted`, slid along whatever is in the way, into `next`.
    pub(super) fn try_step(&mut self, chart: usize, step: f64, length: f64) -> Step {
        let planner = self.planner;
        let options = &planner.options;
        self.refresh_rows(chart, step);
        let mut slid = !self.rows.is_empty();
        for correction in 0..=CORRECTIONS {
            std::mem::swap(&mut self.step, &mut self.step_before);
            self.step.copy_from_slice(&self.wanted);
            if slid {
                self.rows.solve(&mut self.step);
                let size = norm(&self.step);
                if size < LEAST_STEP * step {
                    return Step::Stopped(self.obstacle());
                }
                let longest = 1.5 * step;
                if size > longest {
                    self.step.iter_mut().for_each(|s| *s *= longest / size);
                }
            }
            for ((t, a), b) in self.next.t.iter_mut().zip(&self.here.t).zip(&self.step) {
                *t = a + b;
            }
            if slid {
                let left = self
                    .target_t
                    .iter()
                    .zip(&self.next.t)
                    .map(|(a, b)| (a - b) * (a - b))
                    .sum::<f64>()
                    .sqrt();
                if length - left < 0.5 * LEAST_STEP * step {
                    return Step::Stopped(Stop::NoProgress);
                }
            }
            if correction == 0 {
                self.predict(chart);
            } else {
                self.move_next(chart);
            }
            let here = self.atlas.chart(chart);
            if here
                .retract(
                    planner.manifold,
                    &mut self.next.x,
                    options.tolerance,
                    &mut self.work,
                )
                .is_err()
                || !self.atlas.represents(chart, &self.next.x, &self.next.t)
                || norm(&self.step)
                    < options.domain.cosine * squared_distance(&self.next.x, &self.here.x).sqrt()
            {
                return Step::NeedsChart;
            }
            self.violated.clear();
            self.find_violated_limits(ROUNDING);
            if self.violated.is_empty() {
                self.contacts.clear();
                let x = std::mem::take(&mut self.next.x);
                let outcome = self.test(chart, &x);
                self.next.x = x;
                match outcome {
                    Ok(()) => {
                        self.statistics.sliding_steps += usize::from(slid);
                        return Step::Accepted;
                    }
                    Err(Obstruction::Blocked) => return Step::Stopped(Stop::Blocked),
                    Err(Obstruction::Contacts) => self
                        .violated
                        .extend(self.contacts.iter().map(|&i| Constraint::Contact(i))),
                }
            }
            if !options.slide {
                let contact = matches!(self.violated[0], Constraint::Contact(_));
                return Step::Stopped(if contact { Stop::Contact } else { Stop::Limit });
            }
            slid = true;
            planner.manifold.jacobian(&self.next.x, &mut self.jacobian);
            for i in 0..self.violated.len() {
                let constraint = self.violated[i];
                let Some(value) = self.linearise(chart, constraint, true) else {
                    return Step::Stopped(Stop::Contact);
                };
                let margin = self.margin(constraint);
                let moved: f64 = self
                    .tangent_gradient
                    .iter()
                    .zip(&self.step)
                    .map(|(a, b)| a * b)
                    .sum();
                self.rows
                    .set(constraint, &self.tangent_gradient, margin - value + moved);
            }
        }
        Step::Stopped(Stop::Correction)
    }

    /// Starting point of the first projection of a step: the tangent step plus
    /// the expected change of the normal offset, extrapolated from the steps before.
    fn predict(&mut self, chart: usize) {
        self.next.x.copy_from_slice(&self.here.x);
        let chart = self.atlas.chart(chart);
        for (j, &s) in self.step.iter().enumerate() {
            axpy(s, chart.tangent(j), &mut self.next.x);
        }
        if self.normal_history == 0 {
            return;
        }
        let square: f64 = self.last_step.iter().map(|s| s * s).sum();
        let along: f64 = self
            .step
            .iter()
            .zip(&self.last_step)
            .map(|(a, b)| a * b)
            .sum();
        let ratio = along / square;
        if !(0.5..=2.0).contains(&ratio) {
            return;
        }
        // Offsets grow with the square of the way: a parabola through the last steps.
        let [newest, before] = &self.normal_changes;
        axpy(ratio, newest, &mut self.next.x);
        if self.normal_history > 1 {
            let curved = 0.5 * ratio * (1.0 + ratio);
            axpy(curved, newest, &mut self.next.x);
            axpy(-curved, before, &mut self.next.x);
        }
    }

    /// Starting point of the projections after a correction of the step.
    fn move_next(&mut self, chart: usize) {
        let chart = self.atlas.chart(chart);
        for (j, (&s, &b)) in self.step.iter().zip(&self.step_before).enumerate() {
            axpy(s - b, chart.tangent(j), &mut self.next.x);
        }
    }

    /// Records how the normal offset changed from `here` to `next`.
    pub(super) fn remember_normal_change(&mut self, chart: usize) {
        self.normal_changes.swap(0, 1);
        let newest = &mut self.normal_changes[0];
        for ((d, a), b) in newest.iter_mut().zip(&self.next.x).zip(&self.here.x) {
            *d = a - b;
        }
        let chart = self.atlas.chart(chart);
        for (j, &s) in self.step.iter().enumerate() {
            axpy(-s, chart.tangent(j), newest);
        }
        self.last_step.copy_from_slice(&self.step);
        self.normal_history = (self.normal_history + 1).min(2);
    }

    /// Bounds and limits violated at `next` by more than a tolerance.
    pub(super) fn find_violated_limits(&mut self, tolerance: f64) {
        let manifold = self.planner.manifold;
        let bounds = manifold.lower_bounds().iter().zip(manifold.upper_bounds());
        for (i, (&x, (&lo, &hi))) in self.next.x.iter().zip(bounds).enumerate() {
            if x < lo - tolerance {
                self.violated.push(Constraint::Lower(i));
            } else if x > hi + tolerance {
                self.violated.push(Constraint::Upper(i));
            }
        }
        manifold.limits(&self.next.x, &mut self.limits);
        for (i, &value) in self.limits.iter().enumerate() {
            if value < -tolerance {
                self.violated.push(Constraint::Limit(i));
            }
        }
    }

    pub(super) fn margin(&self, constraint: Constraint) -> f64 {
        match constraint {
            Constraint::Contact(_) => self.planner.options.contact_margin,
            _ => self.planner.options.limit_margin,
        }
    }

    /// Value of a constraint at `next` (or `here`), with its gradient in tangent
    /// coordinates.
    pub(super) fn linearise(
        &mut self,
        chart: usize,
        constraint: Constraint,
        at_next: bool,
    ) -> Option<f64> {
        let planner = self.planner;
        let (x, memory) = if at_next {
            (&self.next.x, &mut self.next_memory)
        } else {
            (&self.here.x, &mut self.memory)
        };
        self.gradient.clear();
        let value = match constraint {
            Constraint::Lower(i) => {
                self.gradient.add(i, 1.0);
                x[i] - planner.manifold.lower_bounds()[i]
            }
            Constraint::Upper(i) => {
                self.gradient.add(i, -1.0);
                planner.manifold.upper_bounds()[i] - x[i]
            }
            Constraint::Limit(i) => {
                planner.manifold.limit_gradient(i, x, &mut self.gradient);
                planner.manifold.limit(i, x)
            }
            Constraint::Contact(i) => planner.validity.contact(i, x, memory, &mut self.gradient)?,
        };
        self.atlas.chart(chart).pull_back(
            planner.manifold.jacobian_pattern(),
            &self.jacobian,
            &self.gradient,
            &mut self.dense,
            &mut self.tangent_gradient,
        );
        Some(value)
    }

    /// Linearises the constraints of the step before at `here` and drops those
    /// that this step cannot reach.
    pub(super) fn refresh_rows(&mut self, chart: usize, step: f64) {
        if self.rows.is_empty() {
            return;
        }
        self.planner
            .manifold
            .jacobian(&self.here.x, &mut self.jacobian);
        let mut i = 0;
        while i < self.rows.constraints.len() {
            let constraint = self.rows.constraints[i];
            let offset = self
                .linearise(chart, constraint, false)
                .map(|value| self.margin(constraint) - value);
            match offset {
                Some(offset) if offset > -step * norm(&self.tangent_gradient) => {
                    self.rows.set(constraint, &self.tangent_gradient, offset);
                    i += 1;
                }
                _ => self.rows.remove(i),
            }
        }
    }

    /// Whether limits or contacts left no way on.
    pub(super) fn obstacle(&self) -> Stop {
        let contact = |c: &Constraint| matches!(c, Constraint::Contact(_));
        if self.rows.constraints.iter().any(contact) {
            Stop::Contact
        } else {
            Stop::Limit
        }
    }
}

pub(super) fn norm(v: &[f64]) -> f64 {
    v.iter().map(|v| v * v).sum::<f64>().sqrt()
}

/// y ← y + α x.
fn axpy(alpha: f64, x: &[f64], y: &mut [f64]) {
    for (y, x) in y.iter_mut().zip(x) {
        *y += alpha * x;
    }
}

/// y = a + s (b − a).
pub(super) fn interpolate(s: f64, a: &[f64], b: &[f64], y: &mut [f64]) {
    for ((y, a), b) in y.iter_mut().zip(a).zip(b) {
        *y = a + s * (b - a);
    }
}
