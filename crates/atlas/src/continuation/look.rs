//! Looking from a centre in a direction: is there a valid way on?

use std::collections::VecDeque;

use super::{
    Border, Continuation, ROUGH,
    border::{border_values, broken_limit, worst},
    front::Front,
    interpolate, settle,
};
use crate::{
    atlas::{ChartDomain, squared_distance},
    chart::{Chart, Workspace},
    manifold::ImplicitManifold,
    validity::{Obstruction, Validity},
};

/// Blocked ways are tried again in steps of this fraction of the stride.
const FINER: f64 = 0.25;

/// Ways around obstacles lead through points at these fractions of the radius, in
/// directions turned by these angles.
const DETOURS: [(f64, f64); 12] = [
    (0.7, 0.4),
    (0.7, 0.8),
    (0.9, 0.15),
    (0.9, 0.3),
    (0.5, 0.2),
    (0.5, 0.5),
    (0.25, 0.4),
    (0.25, 0.8),
    (0.25, 1.5),
    (0.5, 1.0),
    (0.7, 0.15),
    (0.9, 0.07),
];
/// Ways from one of those points to another that are tested at most.
const MOST_TESTS: usize = 200;
/// Where a chart represents the manifold up to less than this fraction of the distance
/// asked for, less does not matter.
const LEAST_REACH: f64 = 1e-3;
/// Bounds of the steps towards the centre, relative to the distance.
const RETREAT: [f64; 2] = [0.3, 0.97];

/// What lies in a direction from a centre.
pub(super) enum Outlook {
    /// A valid point, in `Front::there` and `Front::memory_there`.
    Open,
    /// The component ends before.
    Ends(Border, Sight),
    /// A valid point, in `Front::there`, but something is in the way.
    Blocked(Border),
    /// Valid up to this distance, at which the chart ceases to represent the
    /// manifold.
    Poor(f64),
}

/// How well a chart represents the manifold in a direction.
#[derive(Clone, Copy)]
pub(super) struct Fit {
    /// The distance up to which it does.
    pub(super) reach: f64,
    /// By how much it does not at the distance asked for: −1 where the manifold is
    /// flat, 0 at the border of the domain.
    pub(super) excess: f64,
}

/// What a look that ended at a border saw.
pub(super) struct Sight {
    /// Of length 1.
    pub(super) direction: Vec<f64>,
    /// The point looked at.
    pub(super) point: Vec<f64>,
    /// Values of all bounds and limits there; none where they do not tell why there
    /// is no way on.
    pub(super) values: Vec<f64>,
    /// A contact violated there, with its value.
    pub(super) contact: Option<(usize, f64)>,
    /// As in [`Fit`].
    pub(super) excess: f64,
}

impl Sight {
    /// Of a direction without a way on, for a reason that no value tells.
    pub(super) fn nothing(direction: Vec<f64>) -> Self {
        Self {
            direction,
            point: Vec::new(),
            values: Vec::new(),
            contact: None,
            excess: -1.0,
        }
    }
}

impl<M: ImplicitManifold + ?Sized, V: Validity> Front<'_, M, V> {
    /// What lies at the radius of a chart in a direction (of length 1): roughly first,
    /// since most looks end at a border.
    pub(super) fn look(&mut self, chart: usize, direction: &[f64]) -> Outlook {
        let radius = self.atlas.radius(chart);
        let fit = self.fit(chart, direction, radius);
        let (border, mut sight) = self.see(chart, direction, fit);
        if let Some(border) = border {
            return Outlook::Ends(border, sight);
        }
        if fit.reach < radius {
            return Outlook::Poor(fit.reach);
        }
        let tolerance = self.continuation.options.tolerance;
        let manifold = self.continuation.manifold;
        let here = self.atlas.chart(chart);
        if !settle(here, manifold, &mut sight.point, tolerance, &mut self.work) {
            return Outlook::Poor(0.5 * radius);
        }
        self.there.copy_from_slice(&sight.point);
        let (border, sight) = self.see(chart, direction, fit);
        if let Some(border) = border {
            return Outlook::Ends(border, sight);
        }
        let memory = self.memories[chart].clone();
        let center = self.atlas.chart(chart).center().to_vec();
        match self.go(chart, (&center, &memory), &sight.point) {
            Way::Free => Outlook::Open,
            Way::Ends(border) if self.continuation.validity.is_valid(&sight.point) => {
                Outlook::Blocked(border)
            }
            Way::Ends(border) => Outlook::Ends(border, Sight::nothing(direction.to_vec())),
            Way::Poor => Outlook::Poor(0.5 * radius),
        }
    }

    /// A way around what blocks the straight one from the centre of a chart to the
    /// valid point `there` at the radius in a direction: points that end there, with
    /// what validity remembers of them. The centre sees the first, and each sees the
    /// next.
    pub(super) fn detour(
        &mut self,
        chart: usize,
        direction: &[f64],
    ) -> Option<Vec<(Vec<f64>, V::Memory)>> {
        let target = self.there.clone();
        let center = self.atlas.chart(chart).center().to_vec();
        let start = (center, self.memories[chart].clone());
        let mut unseen = self.stops(chart, direction);
        let mut tests = 0;
        // Ways to what is seen, those of few stops first.
        let mut ways = VecDeque::from([Vec::new()]);
        while let Some(way) = ways.pop_front() {
            let (from, memory) = way.last().unwrap_or(&start);
            let mut i = 0;
            while i < unseen.len() && tests < MOST_TESTS {
                tests += 1;
                if !matches!(self.go(chart, (from, memory), &unseen[i]), Way::Free) {
                    i += 1;
                    continue;
                }
                let (stop, memory) = (unseen.remove(i), self.memory_there.clone());
                let arrives = matches!(self.go(chart, (&stop, &memory), &target), Way::Free);
                let mut way = way.clone();
                way.push((stop, memory));
                if arrives {
                    way.push((target, self.memory_there.clone()));
                    return Some(way);
                }
                ways.push_back(way);
            }
        }
        None
    }

    /// Points through which a detour may lead, within all limits.
    fn stops(&mut self, chart: usize, direction: &[f64]) -> Vec<Vec<f64>> {
        let radius = self.atlas.radius(chart);
        let tolerance = self.continuation.options.tolerance;
        let manifold = self.continuation.manifold;
        let here = self.atlas.chart(chart);
        let mut stops = Vec::new();
        for (reach, turn) in DETOURS {
            for side in sideways(direction, turn) {
                let t: Vec<f64> = side.iter().map(|t| reach * radius * t).collect();
                let mut point = vec![0.0; here.center().len()];
                here.tangent_point(&t, &mut point);
                if settle(here, manifold, &mut point, tolerance, &mut self.work)
                    && broken_limit(manifold, &point).is_none()
                {
                    stops.push(point);
                }
            }
        }
        stops
    }

    /// How far a chart represents the manifold in a direction, at most up to `length`.
    /// `there` becomes the point of the manifold at that distance.
    pub(super) fn fit(&mut self, chart: usize, direction: &[f64], length: f64) -> Fit {
        let Self {
            continuation,
            atlas,
            there,
            work,
            ..
        } = self;
        let domain = &continuation.options.domain;
        let here = atlas.chart(chart);
        fit(
            continuation.manifold,
            domain,
            here,
            direction,
            length,
            there,
            work,
        )
    }

    /// What is seen at `there`, and the bound, limit or contact that is violated, if any.
    fn see(&mut self, chart: usize, direction: &[f64], fit: Fit) -> (Option<Border>, Sight) {
        let (border, mut sight) = self.see_limits(direction, fit);
        let border = border.or_else(|| self.see_contacts(chart, &mut sight));
        (border, sight)
    }

    /// What is seen at `there`, and the bound or limit that is violated, if any.
    pub(super) fn see_limits(&mut self, direction: &[f64], fit: Fit) -> (Option<Border>, Sight) {
        let manifold = self.continuation.manifold;
        let mut sight = Sight::nothing(direction.to_vec());
        border_values(manifold, &self.there, &mut sight.values);
        sight.point.clone_from(&self.there);
        sight.excess = fit.excess;
        (worst(manifold, &sight.values), sight)
    }

    /// A contact that is violated where something was seen.
    pub(super) fn see_contacts(&mut self, chart: usize, sight: &mut Sight) -> Option<Border> {
        sight.contact = self.contact_at(chart, &sight.point);
        sight.contact.map(|(contact, _)| Border::Contact(contact))
    }

    /// A contact violated at x, reached from a chart, and its value.
    fn contact_at(&mut self, chart: usize, x: &[f64]) -> Option<(usize, f64)> {
        // Along a rim it is mostly the same one.
        if let Some(contact) = self.last_contact {
            let value = self.contact_value(contact, x);
            if value < 0.0 {
                return Some((contact, value));
            }
        }
        let (from, there) = (&self.memories[chart], &mut self.memory_there);
        let mut violated = Vec::new();
        // Without points between, only the end is judged.
        let validity = self.continuation.validity;
        let _ = validity.step(from, x, there, &mut |_, _| false, &mut violated);
        let contact = *violated.first()?;
        self.last_contact = Some(contact);
        Some((contact, self.contact_value(contact, x)))
    }

    pub(super) fn contact_value(&mut self, contact: usize, x: &[f64]) -> f64 {
        let (memory, row) = (&mut self.memory_there, &mut self.row);
        row.clear();
        let value = self.continuation.validity.contact(contact, x, memory, row);
        value.unwrap_or(f64::NEG_INFINITY)
    }

    /// Tests the way from a point, of which validity remembers something, to x:
    /// straight in the tangent coordinates of a chart. Where long steps do not show it
    /// to be free, short ones may.
    fn go(&mut self, chart: usize, from: (&[f64], &V::Memory), x: &[f64]) -> Way {
        let stride = self.continuation.options.stride;
        match self.go_in_steps(chart, from, x, stride) {
            Way::Ends(Border::Blocked) => self.go_in_steps(chart, from, x, FINER * stride),
            way => way,
        }
    }

    fn go_in_steps(
        &mut self,
        chart: usize,
        (start, memory): (&[f64], &V::Memory),
        x: &[f64],
        stride: f64,
    ) -> Way {
        self.tests += 1;
        let Continuation {
            manifold, validity, ..
        } = *self.continuation;
        let tolerance = self.continuation.options.tolerance;
        let here = self.atlas.chart(chart);
        let length = squared_distance(start, x).sqrt();
        let steps = (length / stride).ceil().max(1.0) as usize;
        let mut from = vec![0.0; x.len()];
        let mut to = start.to_vec();
        let mut violated = Vec::new();
        let mut values = Vec::new();
        for step in 1..=steps {
            from.copy_from_slice(&to);
            let s = step as f64 / steps as f64;
            if step == steps {
                to.copy_from_slice(x);
            } else {
                interpolate(start, x, s, &mut to);
                if here
                    .retract(manifold, &mut to, tolerance, &mut self.work)
                    .is_err()
                {
                    return Way::Poor;
                }
                border_values(manifold, &to, &mut values);
                if let Some(border) = worst(manifold, &values) {
                    return Way::Ends(border);
                }
            }
            let memory = if step == 1 {
                memory
            } else {
                std::mem::swap(&mut self.memory_before, &mut self.memory_there);
                &self.memory_before
            };
            let work = &mut self.work;
            let mut between = |s: f64, y: &mut [f64]| {
                interpolate(&from, &to, s, y);
                here.retract(manifold, y, tolerance, work).is_ok()
            };
            violated.clear();
            match validity.step(
                memory,
                &to,
                &mut self.memory_there,
                &mut between,
                &mut violated,
            ) {
                Ok(()) => {}
                Err(Obstruction::Contacts) => {
                    let contact = violated.first().copied();
                    return Way::Ends(contact.map_or(Border::Blocked, Border::Contact));
                }
                Err(Obstruction::Blocked) => return Way::Ends(Border::Blocked),
            }
        }
        Way::Free
    }
}

/// How far a chart represents the manifold in a direction (of length 1), at most up to
/// `length`: within ε of its tangent space, and no steeper than its domain says. `there`
/// becomes the point of the manifold at that distance.
pub(super) fn fit<M: ImplicitManifold + ?Sized>(
    manifold: &M,
    domain: &ChartDomain,
    here: &Chart,
    direction: &[f64],
    length: f64,
    there: &mut [f64],
    work: &mut Workspace,
) -> Fit {
    let mut t = vec![0.0; direction.len()];
    let mut fit = Fit {
        reach: length,
        excess: f64::NAN,
    };
    loop {
        let coordinates = t.iter_mut().zip(direction);
        coordinates.for_each(|(t, d)| *t = fit.reach * d);
        let excess = if here.exp(manifold, &t, there, ROUGH, work).is_ok() {
            let square = squared_distance(there, here.center());
            let offset = (square - fit.reach * fit.reach).max(0.0).sqrt();
            let steepness = square.sqrt() / fit.reach - 1.0;
            let steepest = (1.0 / domain.cosine - 1.0).max(f64::EPSILON);
            (offset / domain.error).max(steepness / steepest) - 1.0
        } else {
            3.0
        };
        if fit.excess.is_nan() {
            fit.excess = excess;
        }
        if excess <= 0.0 || fit.reach < LEAST_REACH * length {
            return fit;
        }
        // The offset grows about with the square of the distance.
        let retreat = (1.0 / (1.0 + excess)).sqrt();
        fit.reach *= retreat.clamp(RETREAT[0], RETREAT[1]);
    }
}

/// Directions (of length 1) turned from one by an angle along each axis, both ways.
fn sideways(direction: &[f64], angle: f64) -> Vec<Vec<f64>> {
    let (sin, cos) = angle.sin_cos();
    let mut found = Vec::new();
    for axis in 0..direction.len() {
        let along = direction[axis];
        let out = (1.0 - along * along).sqrt();
        // Along a line there is nowhere to turn, and in the plane one axis will do.
        if out < 0.5 {
            continue;
        }
        for sign in [sin, -sin] {
            let turned = direction.iter().enumerate().map(|(i, d)| {
                let normal = (f64::from(u8::from(i == axis)) - along * d) / out;
                cos * d + sign * normal
            });
            found.push(turned.collect());
        }
        if direction.len() == 2 {
            break;
        }
    }
    found
}

/// The way between two points that are valid themselves.
enum Way {
    Free,
    /// Something is in the way.
    Ends(Border),
    /// The chart does not represent the manifold there.
    Poor,
}
