//! The rim of a domain about a corner of its polytope: where the sphere of the
//! chart's radius lies inside the polytope, there may be manifold left to explore.
//!
//! # Narrow openings
//! The rim is searched by bisection: an arc between two directions is given up once
//! the values of limits at its ends, taken for linear in between but for a slack,
//! leave no room for a valid point. So one limit that is violated by far rules out
//! a wide arc at once, while the tip of a component, where one limit recedes as
//! another one advances, is looked at ever more closely.
//!
//! The inner edges of the polytope are searched in the same way, for valid points
//! where the manifold has left the chart.

use std::ops::ControlFlow;

use super::{
    Border,
    border::border_values,
    front::Front,
    look::{Outlook, Sight},
};
use crate::{atlas::squared_distance, manifold::ImplicitManifold, qr::dot, validity::Validity};

/// Arcs wider than this are halved in any case.
const WIDEST: f64 = 0.25;
/// Arcs narrower than this are given up.
const NARROWEST: f64 = 1e-3;
/// Between what is blocked and what is violated, arcs are narrower than elsewhere by
/// this factor.
const FINER: f64 = 0.125;
/// An arc is divided no nearer to its ends than this fraction.
const INNER: f64 = 0.15;
/// Bound of second derivatives along an arc, relative to how much values differ from
/// those at the centre; that of a second harmonic is 4.
const BEND: f64 = 8.0;
/// Absolute slack of values, that of points looked at roughly.
const ROUGH_VALUE: f64 = 1e-4;
/// Edges are searched from corners where the manifold is farther from the chart than
/// this, relative to what is allowed.
const NEARLY: f64 = -0.3;

/// Where an edge from a vertex outside of the sphere enters it; where it does
/// not, its point nearest to the sphere.
fn end_of_rim(from: &[f64], to: &[f64], radius: f64) -> Vec<f64> {
    let d: Vec<f64> = to.iter().zip(from).map(|(b, a)| b - a).collect();
    let (dd, fd) = (dot(&d, &d), dot(from, &d));
    let nearest = (-fd / dd).clamp(0.0, 1.0);
    // |from + λ d|² = radius².
    let discriminant = fd * fd - dd * (dot(from, from) - radius * radius);
    let enters = if discriminant > 0.0 {
        (-fd - discriminant.sqrt()) / dd
    } else {
        nearest
    };
    let share = enters.clamp(0.0, nearest);
    from.iter().zip(&d).map(|(a, d)| a + share * d).collect()
}

/// The direction at a share of the chord from a to b.
fn direction_between(a: &[f64], b: &[f64], share: f64) -> Vec<f64> {
    unit(a.iter().zip(b).map(|(a, b)| a + share * (b - a)).collect())
}

fn unit(mut v: Vec<f64>) -> Vec<f64> {
    let length = dot(&v, &v).sqrt().max(f64::MIN_POSITIVE);
    v.iter_mut().for_each(|v| *v /= length);
    v
}

/// Which part of the border of a domain is searched, and for what.
#[derive(Clone, Copy, PartialEq)]
enum Part {
    /// The rim, for a way on.
    Rim,
    /// An edge of the polytope within the radius, for places that the chart does not
    /// represent.
    Edge,
}

impl<M: ImplicitManifold + ?Sized, V: Validity> Front<'_, M, V> {
    /// Looks about a corner of a chart's cell: along the rim for a way on, and along
    /// the edges within the radius for places that the chart does not represent.
    /// Breaks when a chart is added or has shrunk; otherwise tells, for a corner
    /// outside of the radius, why there is no way on.
    pub(super) fn look_around(
        &mut self,
        chart: usize,
        vertex: usize,
        reason: &mut Option<Border>,
    ) -> ControlFlow<()> {
        let cell = self.atlas.cell(chart);
        let corner = &cell.vertices()[vertex];
        let exterior = self.atlas.is_exterior(chart, corner);
        let radius = self.atlas.radius(chart);
        let direction = unit(corner.point.clone());
        // Where each edge enters the radius, and where its inner part ends.
        let edges: Vec<[Vec<f64>; 2]> = cell
            .adjacent(vertex)
            .map(|other| {
                let other = &cell.vertices()[other];
                let end = if self.atlas.is_exterior(chart, other) {
                    end_of_rim(&other.point, &corner.point, radius)
                } else {
                    other.point.clone()
                };
                [end_of_rim(&corner.point, &other.point, radius), end].map(unit)
            })
            .collect();
        let mut at_center = Vec::new();
        let center = self.atlas.chart(chart).center().to_vec();
        border_values(self.continuation.manifold, &center, &mut at_center);
        let mut search = Search {
            front: self,
            chart,
            center,
            at_center,
            reason,
        };
        if !exterior {
            let seen = search.attempt(direction, Part::Edge)?;
            return edges
                .into_iter()
                .try_for_each(|[_, end]| search.edge(&seen, end));
        }
        let middle = search.attempt(direction, Part::Rim)?;
        let mut entries = Vec::with_capacity(edges.len());
        for [entry, end] in edges {
            entries.push((search.attempt(entry, Part::Rim)?, end));
        }
        for (i, (entry, _)) in entries.iter().enumerate() {
            search.arc(&middle, entry, Part::Rim)?;
            // In the plane the arcs from the corner are the whole rim.
            if entries.len() > 2 {
                for (other, _) in &entries[i + 1..] {
                    search.arc(entry, other, Part::Rim)?;
                }
            }
        }
        entries
            .into_iter()
            .try_for_each(|(entry, end)| search.edge(&entry, end))
    }
}

/// A search about a corner of a cell.
struct Search<'s, 'p, M: ?Sized, V: Validity> {
    front: &'s mut Front<'p, M, V>,
    chart: usize,
    center: Vec<f64>,
    /// Values of bounds and limits there.
    at_center: Vec<f64>,
    /// Why there is no way on.
    reason: &'s mut Option<Border>,
}

impl<M: ImplicitManifold + ?Sized, V: Validity> Search<'_, '_, M, V> {
    /// Looks along an edge within the radius, from where something was seen to a
    /// direction.
    fn edge(&mut self, from: &Sight, end: Vec<f64>) -> ControlFlow<()> {
        if from.excess < NEARLY || !self.front.can_shrink(self.chart) {
            return ControlFlow::Continue(());
        }
        let end = self.attempt(end, Part::Edge)?;
        self.arc(from, &end, Part::Edge)
    }

    /// Looks between two directions, and where there is room left between those and
    /// the one looked at, again.
    fn arc(&mut self, a: &Sight, b: &Sight, part: Part) -> ControlFlow<()> {
        let Some(share) = self.promising(a, b, part) else {
            return ControlFlow::Continue(());
        };
        let between = self.attempt(direction_between(&a.direction, &b.direction, share), part)?;
        self.arc(a, &between, part)?;
        self.arc(&between, b, part)
    }

    /// Where on the arc between two directions what is searched for may lie, as a share
    /// of it; `None` where there is no room.
    fn promising(&mut self, a: &Sight, b: &Sight, part: Part) -> Option<f64> {
        let square = squared_distance(&a.direction, &b.direction);
        let width = square.sqrt();
        if width < NARROWEST {
            return None;
        }
        if width > WIDEST {
            return Some(0.5);
        }
        let rim_angle = self.front.continuation.options.rim_angle;
        match [a, b].map(|sight| sight.values.is_empty()) {
            [false, false] => {}
            [true, true] => return (width > rim_angle).then_some(0.5),
            _ => return (width > FINER * rim_angle).then_some(0.5),
        }
        let bulge = BEND * square / 8.0;
        let mut lines = Vec::new();
        let mut unknown = false;
        let mut add = |ends: [f64; 2], center: f64| {
            let scale = (ends[0] - center).abs().max((ends[1] - center).abs());
            let raised = ends.map(|value| value + bulge * scale + ROUGH_VALUE);
            if raised.iter().all(|value| value.is_finite()) {
                // What is not violated at either end says nothing.
                if raised[0].min(raised[1]) < 0.0 {
                    lines.push(raised);
                }
            } else if ends.iter().any(|value| !(*value >= 0.0)) {
                // Violated in a way that has no measure.
                unknown = true;
            }
        };
        for ((&a, &b), &center) in a.values.iter().zip(&b.values).zip(&self.at_center) {
            add([a, b], center);
        }
        if part == Part::Edge {
            add([a.excess, b.excess], -1.0);
        }
        let front = &mut *self.front;
        for (contact, _) in a.contact.into_iter().chain(b.contact) {
            let ends = [a, b].map(|sight| match sight.contact {
                Some((same, value)) if same == contact => value,
                _ => front.contact_value(contact, &sight.point),
            });
            add(ends, front.contact_value(contact, &self.center));
        }
        if unknown && width <= FINER * rim_angle {
            return None;
        }
        let (share, value) = highest(&lines);
        (value >= 0.0).then_some(share.clamp(INNER, 1.0 - INNER))
    }

    /// Looks in a direction. Adds a chart if there is a way on; shrinks the chart
    /// if it does not represent the manifold there. Otherwise tells what was seen.
    fn attempt(&mut self, direction: Vec<f64>, part: Part) -> ControlFlow<(), Sight> {
        let (front, chart) = (&mut *self.front, self.chart);
        if part == Part::Edge {
            let reach = front.atlas.cell(chart).reach(&direction);
            let length = reach.min(front.atlas.radius(chart));
            let fit = front.fit(chart, &direction, length);
            let (border, mut sight) = front.see_limits(&direction, fit);
            if fit.reach < length
                && border.is_none()
                && front.see_contacts(chart, &mut sight).is_none()
                && front.shrink(chart, fit.reach)
            {
                return ControlFlow::Break(());
            }
            return ControlFlow::Continue(sight);
        }
        let (border, sight) = match front.look(chart, &direction) {
            Outlook::Open => {
                let center = front.there.clone();
                let memory = front.memory_there.clone();
                if front.add(&center, Some(chart), memory).is_ok() {
                    return ControlFlow::Break(());
                }
                (Border::Singular, Sight::nothing(direction))
            }
            Outlook::Ends(border, sight) => (border, sight),
            Outlook::Blocked(border) => {
                if let Some(way) = front.detour(chart, &direction)
                    && front.add_along(chart, way)
                {
                    return ControlFlow::Break(());
                }
                (border, Sight::nothing(direction))
            }
            Outlook::Poor(reach) => {
                if front.shrink(chart, reach) {
                    return ControlFlow::Break(());
                }
                (Border::Curvature, Sight::nothing(direction))
            }
        };
        self.reason.get_or_insert(border);
        ControlFlow::Continue(sight)
    }
}

/// Where the least of several linear functions on [0, 1] is greatest, and how great.
/// Each is given by its values at the ends.
fn highest(lines: &[[f64; 2]]) -> (f64, f64) {
    const HALVINGS: usize = 12;
    let least = |s: f64| {
        lines
            .iter()
            .map(|[a, b]| (a + s * (b - a), b - a))
            .min_by(|a, b| a.0.total_cmp(&b.0))
            .unwrap_or((f64::INFINITY, 0.0))
    };
    let [mut low, mut high] = [0.0, 1.0];
    let mut best = (0.5, f64::NEG_INFINITY);
    for _ in 0..HALVINGS {
        let s = 0.5 * (low + high);
        let (value, slope) = least(s);
        if value > best.1 {
            best = (s, value);
        }
        if slope > 0.0 {
            low = s;
        } else {
            high = s;
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_edge_enters_the_sphere_where_it_is_as_far_away() {
        let end = end_of_rim(&[1.0, 2.0], &[1.0, -2.0], 2.0);
        assert!(end[0] == 1.0 && (end[1] - 3.0_f64.sqrt()).abs() < 1e-12);
        let passes = end_of_rim(&[3.0, 2.0], &[3.0, -2.0], 2.0);
        assert_eq!(passes, [3.0, 0.0]);
    }

    #[test]
    fn the_highest_point_of_a_roof_is_its_ridge() {
        let (s, value) = highest(&[[-1.0, 3.0], [1.0, -1.0], [5.0, 5.0]]);
        assert!((s - 1.0 / 3.0).abs() < 1e-3 && (value - 1.0 / 3.0).abs() < 1e-3);
        let (_, value) = highest(&[[-1.0, -0.5], [0.5, -2.0]]);
        assert!(value < -0.5);
    }
}
