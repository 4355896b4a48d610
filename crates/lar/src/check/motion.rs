//! What must hold from one configuration to the next, in a step and in a roll.

use nalgebra::{Rotation3, Unit, Vector3};

use super::{Checker, WalkFaultKind};
use crate::Dimension;

impl Checker<'_> {
    /// The clearance that the walk states, which no sample between configurations may undercut.
    fn stated_clearance(&self) -> f64 {
        self.walk.statistics.certified_clearance.unwrap_or(0.0)
    }

    pub(super) fn check_step(
        &mut self,
        index: usize,
        here: &[Vector3<f64>],
        next: &[Vector3<f64>],
    ) {
        let (before, after) = (
            &self.walk.configurations[index],
            &self.walk.configurations[index + 1],
        );
        let same = before
            .support
            .iter()
            .all(|node| after.support.contains(node));
        if !same {
            self.fault(index, true, WalkFaultKind::SupportChange);
        }
        for &node in &before.support {
            let by = (next[node] - here[node]).norm();
            self.verdict.worst_slide = self.verdict.worst_slide.max(by);
            if !(by <= self.options.tolerance) {
                self.fault(index, true, WalkFaultKind::Slides { node, by });
            }
        }
        for node in 0..here.len() {
            let by = (next[node] - here[node]).norm();
            if !(by <= self.facts.limits.max_move + self.options.tolerance) {
                self.fault(index, true, WalkFaultKind::Jumps { node, by });
            }
        }
        for sample in 1..self.options.samples {
            let time = sample as f64 / self.options.samples as f64;
            let moment: Vec<Vector3<f64>> = here
                .iter()
                .zip(next)
                .map(|(a, b)| a.lerp(b, time))
                .collect();
            self.judge(index, &moment, Some(self.stated_clearance()));
            self.check_balance(index, &moment, true);
        }
    }

    pub(super) fn check_roll(
        &mut self,
        index: usize,
        here: &[Vector3<f64>],
        next: &[Vector3<f64>],
    ) {
        let before = &self.walk.configurations[index].support;
        let after = &self.walk.configurations[index + 1].support;
        let pivots: Vec<usize> = before
            .iter()
            .copied()
            .filter(|node| after.contains(node))
            .collect();
        let landed = after.iter().copied().find(|node| !before.contains(node));
        let lifted = before.iter().copied().find(|node| !after.contains(node));
        let (Some(landed), Some(lifted), true) = (landed, lifted, pivots.len() + 1 == before.len())
        else {
            self.fault(index, true, WalkFaultKind::SupportChange);
            return;
        };
        for &node in &pivots {
            let by = (next[node] - here[node]).norm();
            self.verdict.worst_slide = self.verdict.worst_slide.max(by);
            if !(by <= self.options.tolerance) {
                self.fault(index, true, WalkFaultKind::Slides { node, by });
            }
        }
        let inside = self
            .inside(before, here, &self.centre(here))
            .into_iter()
            .find(|&(opposite, _)| opposite == lifted)
            .map_or(0.0, |(_, inside)| inside);
        if !(inside <= self.options.tolerance) {
            self.fault(index, true, WalkFaultKind::RollsTooEarly { inside });
        }

        // The axis of the turn, oriented so that the landing node comes down.
        let origin = here[pivots[0]];
        let axis = match self.facts.dimension {
            Dimension::Two => Vector3::y(),
            Dimension::Three => {
                let along = here[pivots[1]] - origin;
                Vector3::new(along.x, along.y, 0.0)
            }
        };
        let mut axis = Unit::new_normalize(axis);
        let away = |axis: &Unit<Vector3<f64>>| axis.cross(&Vector3::z());
        if (here[lifted] - origin).dot(&away(&axis)) > 0.0 {
            axis = -axis;
        }
        let out = away(&axis);
        let angle = (here[landed] - origin)
            .z
            .atan2((here[landed] - origin).dot(&out));
        if !(angle >= -self.options.tolerance) {
            self.fault(index, true, WalkFaultKind::SupportChange);
        }
        let turn = |by: f64| {
            let rotation = Rotation3::from_axis_angle(&axis, by);
            move |p: &Vector3<f64>| origin + rotation * (p - origin)
        };
        let back = turn(-angle);
        let shape: Vec<Vector3<f64>> = next.iter().map(&back).collect();
        for sample in 1..self.options.samples {
            let time = sample as f64 / self.options.samples as f64;
            let forward = turn(time * angle);
            let moment: Vec<Vector3<f64>> = here
                .iter()
                .zip(&shape)
                .map(|(a, b)| forward(&a.lerp(b, time)))
                .collect();
            self.judge(index, &moment, Some(self.stated_clearance()));
        }
    }
}
