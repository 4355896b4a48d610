//! Branches: steps towards a target, from chart to chart.

use tensegra_atlas::{ImplicitManifold, Obstruction, Validity};

use super::{
    search::Search,
    step::{Step, norm},
};
use crate::tree::squared_distance;

/// A step is halved down to this fraction of δ before its branch stops.
const SHORTEST_STEP: f64 = 0.1;
/// The same where corrections do not settle or the motion is not clear.
const SHORTEST_SLIDE: f64 = 0.4;
/// Each step must lower the squared distance to the target by this multiple of
/// the squared step.
const NEARER: f64 = 0.1;
/// A neighbouring chart takes over when its centre is this much nearer.
const NEARER_CHART: f64 = 0.7;

/// Why a branch stops.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Stop {
    Reached,
    Limit,
    Contact,
    Blocked,
    NoProgress,
    Correction,
    Projection,
    Singular,
}

/// What an extension added.
pub(super) struct Branch {
    pub(super) first: usize,
    pub(super) last: usize,
    pub(super) reached: bool,
}

impl<M: ImplicitManifold + ?Sized, V: Validity> Search<'_, M, V> {
    /// Grows a tree from one of its nodes towards `target`; when `exact`, the
    /// target is a point of the manifold to be reached itself.
    pub(super) fn extend(
        &mut self,
        tree: usize,
        from: usize,
        target: &[f64],
        exact: bool,
    ) -> Branch {
        self.statistics.extensions += 1;
        let planner = self.planner;
        let full_step = self.full_step;
        let mut chart = self.trees[tree].chart(from);
        self.here.x.copy_from_slice(self.trees[tree].point(from));
        self.atlas.chart(chart).log(&self.here.x, &mut self.here.t);
        self.atlas.chart(chart).log(target, &mut self.target_t);
        planner.validity.enter(&self.here.x, &mut self.memory);
        self.rows.clear();
        self.normal_history = 0;
        let mut branch = Branch {
            first: from,
            last: from,
            reached: false,
        };
        let mut fresh = self.here.t.iter().all(|t| t.abs() < 1e-9);
        let mut scale = 1.0;
        let mut added = 0;
        let stop = loop {
            if exact && squared_distance(&self.here.x, target) <= full_step * full_step {
                break self.arrive(chart, target);
            }
            let length = self
                .target_t
                .iter()
                .zip(&self.here.t)
                .map(|(a, b)| (a - b) * (a - b))
                .sum::<f64>()
                .sqrt();
            if length < 0.1 * full_step {
                // Above the same tangent point but elsewhere: another sheet.
                break if exact {
                    Stop::NoProgress
                } else {
                    Stop::Reached
                };
            }
            let step = (scale * full_step).min(length);
            for ((w, a), b) in self.wanted.iter_mut().zip(&self.target_t).zip(&self.here.t) {
                *w = (a - b) * step / length;
            }
            match self.try_step(chart, step, length) {
                Step::Accepted if !self.is_nearer(target, step) => break Stop::NoProgress,
                Step::Accepted => {
                    let center = self.atlas.chart(chart).center();
                    let parent = branch.last;
                    branch.last = self.trees[tree].add(&self.next.x, Some(parent), chart, center);
                    if added == 0 {
                        branch.first = parent;
                    }
                    added += 1;
                    self.remember_normal_change(chart);
                    std::mem::swap(&mut self.here, &mut self.next);
                    std::mem::swap(&mut self.memory, &mut self.next_memory);
                    fresh = false;
                    scale = f64::min(1.0, 2.0 * scale);
                    if let Some(neighbour) = self.atlas.crossed_into(chart, &self.here.t) {
                        let entered = self.atlas.chart(neighbour);
                        entered.log(&self.here.x, &mut self.next.t);
                        if self.atlas.represents(neighbour, &self.here.x, &self.next.t) {
                            self.here.t.copy_from_slice(&self.next.t);
                            entered.log(target, &mut self.target_t);
                            chart = neighbour;
                            self.use_chart(tree, chart);
                        }
                    }
                }
                Step::NeedsChart if !fresh => {
                    if let Some(neighbour) = self.nearer_chart(chart) {
                        chart = neighbour;
                        self.use_chart(tree, chart);
                        self.trees[tree].set_chart(branch.last, chart);
                        std::mem::swap(&mut self.here.t, &mut self.next.t);
                        self.atlas.chart(chart).log(target, &mut self.target_t);
                        continue;
                    }
                    match self
                        .atlas
                        .add(planner.manifold, &self.here.x, &mut self.work)
                    {
                        Ok(new) => {
                            chart = new;
                            self.use_chart(tree, chart);
                            self.trees[tree].set_chart(branch.last, chart);
                            self.here.t.fill(0.0);
                            self.atlas.chart(chart).log(target, &mut self.target_t);
                            fresh = true;
                        }
                        Err(_) => break Stop::Singular,
                    }
                }
                Step::NeedsChart => {
                    scale *= 0.5;
                    if scale < SHORTEST_STEP {
                        break Stop::Projection;
                    }
                }
                Step::Stopped(Stop::Correction | Stop::Blocked) if scale > SHORTEST_SLIDE => {
                    scale *= 0.5;
                }
                Step::Stopped(stop) => break stop,
            }
        };
        if added > 0 {
            self.statistics.productive_extensions += 1;
        }
        self.count(stop);
        branch.reached = stop == Stop::Reached;
        branch
    }

    /// Whether the step came nearer to the target. Seen from different charts
    /// the target lies in different directions: without this test a branch
    /// could go back and forth between them for ever.
    pub(super) fn is_nearer(&self, target: &[f64], step: f64) -> bool {
        squared_distance(&self.next.x, target)
            <= squared_distance(&self.here.x, target) - NEARER * step * step
    }

    /// A neighbour of a chart whose centre lies much nearer to `here`; tangent
    /// coordinates go to `next.t`.
    pub(super) fn nearer_chart(&mut self, chart: usize) -> Option<usize> {
        let mut best = (NEARER_CHART * norm(&self.here.t), None);
        for cut in self.atlas.cuts(chart) {
            let neighbour = self.atlas.chart(cut.neighbour);
            neighbour.log(&self.here.x, &mut self.next.t);
            let length = norm(&self.next.t);
            if length < best.0
                && self
                    .atlas
                    .represents(cut.neighbour, &self.here.x, &self.next.t)
            {
                best = (length, Some(cut.neighbour));
            }
        }
        let neighbour = best.1?;
        self.atlas
            .chart(neighbour)
            .log(&self.here.x, &mut self.next.t);
        Some(neighbour)
    }

    /// Prepares for a branch to go on in another chart.
    pub(super) fn use_chart(&mut self, tree: usize, chart: usize) {
        self.normal_history = 0;
        self.trees[tree].use_chart(chart);
    }

    /// The last step of an exact branch: straight to the target.
    pub(super) fn arrive(&mut self, chart: usize, target: &[f64]) -> Stop {
        self.atlas.chart(chart).log(target, &mut self.next.t);
        self.contacts.clear();
        match self.test(chart, target) {
            Ok(()) => Stop::Reached,
            Err(Obstruction::Contacts) => Stop::Contact,
            Err(Obstruction::Blocked) => Stop::Blocked,
        }
    }

    pub(super) fn count(&mut self, stop: Stop) {
        let stops = &mut self.statistics.stops;
        *match stop {
            Stop::Reached => &mut stops.reached,
            Stop::Limit => &mut stops.limit,
            Stop::Contact => &mut stops.contact,
            Stop::Blocked => &mut stops.blocked,
            Stop::NoProgress => &mut stops.no_progress,
            Stop::Correction => &mut stops.correction,
            Stop::Projection => &mut stops.projection,
            Stop::Singular => &mut stops.singular,
        } += 1;
    }
}
