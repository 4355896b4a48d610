//! What must hold at one moment of a walk, at a configuration or between two.

use nalgebra::{DMatrix, Vector3};

use super::distance::{member_distance, outline_distance};
use super::{Checker, WalkFaultKind};
use crate::{Constraint, Dimension};

/// Keeps the largest value seen.
fn raise(largest: &mut Option<f64>, value: f64) {
    *largest = Some(largest.map_or(value, |known| known.max(value)));
}

/// Keeps the least value seen.
fn lower(least: &mut Option<f64>, value: f64) {
    *least = Some(least.map_or(value, |known| known.min(value)));
}

impl Checker<'_> {
    pub(super) fn centre(&self, positions: &[Vector3<f64>]) -> Vector3<f64> {
        let mut centre = Vector3::zeros();
        for (position, fraction) in positions.iter().zip(&self.facts.mass_fractions) {
            centre += position * *fraction;
        }
        centre
    }

    /// Signed distance of a point inside each side of the support, with the support node
    /// opposite: barycentric coordinates times heights.
    pub(super) fn inside(
        &self,
        support: &[usize],
        positions: &[Vector3<f64>],
        point: &Vector3<f64>,
    ) -> Vec<(usize, f64)> {
        let flat = |v: &Vector3<f64>| Vector3::new(v.x, v.y, 0.0);
        let p: Vec<Vector3<f64>> = support.iter().map(|&node| flat(&positions[node])).collect();
        let point = flat(point);
        match self.facts.dimension {
            Dimension::Two => {
                let towards = (p[1].x - p[0].x).signum();
                vec![
                    (support[0], towards * (p[1].x - point.x)),
                    (support[1], towards * (point.x - p[0].x)),
                ]
            }
            Dimension::Three => (0..3)
                .map(|k| {
                    let (a, b) = (p[(k + 1) % 3], p[(k + 2) % 3]);
                    let area = |q: &Vector3<f64>| (b - a).cross(&(q - a)).z;
                    (
                        support[k],
                        area(&point) * area(&p[k]).signum() / (b - a).norm(),
                    )
                })
                .collect(),
        }
    }

    pub(super) fn check_configuration(&mut self, index: usize, positions: &[Vector3<f64>]) {
        let configuration = &self.walk.configurations[index];
        let (facts, tolerance) = (self.facts, self.options.tolerance);
        for (member, &[a, b]) in facts.edges.iter().enumerate() {
            let actual = (positions[a] - positions[b]).norm();
            let stated = configuration.lengths[member];
            if !((stated - actual).abs() <= tolerance) {
                let kind = WalkFaultKind::WrongLength {
                    member,
                    stated,
                    actual,
                };
                self.fault(index, false, kind);
            }
        }
        self.judge(index, positions, None);
        for &node in &configuration.support {
            let height = positions[node].z;
            if !(height.abs() <= tolerance) {
                self.fault(index, false, WalkFaultKind::Slides { node, by: height });
            }
        }
        // A configuration between two rolls is left as soon as it is reached.
        let passing =
            index > 0 && self.walk.rolls.contains(&(index - 1)) && self.walk.rolls.contains(&index);
        if !passing {
            self.check_balance(index, positions, false);
        }
        if let Some(required) = facts.limits.min_rigidity {
            self.violation(
                index,
                false,
                Constraint::Rigidity,
                required - self.index(positions),
            );
        }
    }

    /// Reports a violation at a configuration beyond the tolerance.
    fn violation(&mut self, index: usize, between: bool, constraint: Constraint, violation: f64) {
        raise(&mut self.verdict.worst_violation, violation);
        if !(violation <= self.options.tolerance) {
            let kind = WalkFaultKind::Violated {
                constraint,
                violation,
            };
            self.fault(index, between, kind);
        }
    }

    pub(super) fn check_balance(
        &mut self,
        index: usize,
        positions: &[Vector3<f64>],
        between: bool,
    ) {
        let support = &self.walk.configurations[index].support;
        let inside = self.inside(support, positions, &self.centre(positions));
        let least = inside.iter().map(|(_, d)| *d).fold(f64::INFINITY, f64::min);
        if between {
            if !(least >= -self.options.tolerance) {
                let kind = WalkFaultKind::Violated {
                    constraint: Constraint::Balance,
                    violation: -least,
                };
                self.fault(index, true, kind);
            }
        } else {
            self.violation(index, false, Constraint::Balance, -least);
        }
    }

    /// Lengths, angles, distances, heights and obstacles at one moment. Between configurations
    /// lengths and angles may miss their limits by a fraction, and members keep the clearance
    /// `stated` by the walk; at configurations they keep all limits.
    pub(super) fn judge(&mut self, index: usize, positions: &[Vector3<f64>], stated: Option<f64>) {
        let facts = self.facts;
        let limits = &facts.limits;
        let between = stated.is_some();
        let slack = if between { self.options.between } else { 0.0 };
        self.verdict.samples += 1;
        let report = |checker: &mut Self, constraint: Constraint, violation: f64, slack: f64| {
            if between {
                if !(violation <= slack + checker.options.tolerance) {
                    let kind = WalkFaultKind::Violated {
                        constraint,
                        violation,
                    };
                    checker.fault(index, true, kind);
                }
            } else {
                checker.violation(index, false, constraint, violation);
            }
        };
        for &member in &facts.edges {
            let [a, b] = member;
            let length = (positions[a] - positions[b]).norm();
            let short = limits.min_length - length;
            report(
                self,
                Constraint::MinLength { member },
                short,
                slack * limits.min_length,
            );
            let long = length - limits.max_length;
            report(
                self,
                Constraint::MaxLength { member },
                long,
                slack * limits.max_length,
            );
        }
        for (first, &[a, b]) in facts.edges.iter().enumerate() {
            for (second, &[c, d]) in facts.edges.iter().enumerate().skip(first + 1) {
                let shared = if a == c || a == d {
                    Some((a, b, if a == c { d } else { c }))
                } else if b == c || b == d {
                    Some((b, a, if b == c { d } else { c }))
                } else {
                    None
                };
                if let Some((apex, p, q)) = shared {
                    let (u, v) = (
                        positions[p] - positions[apex],
                        positions[q] - positions[apex],
                    );
                    let (u, v) = (u.normalize(), v.normalize());
                    // The half angle by the sum and difference of unit vectors is exact for all
                    // angles.
                    let angle = 2.0 * (u - v).norm().atan2((u + v).norm());
                    let constraint = Constraint::Angle {
                        node: apex,
                        ends: [p.min(q), p.max(q)],
                    };
                    let slack = slack * limits.min_angle;
                    report(self, constraint, limits.min_angle - angle, slack);
                    continue;
                }
                let distance =
                    member_distance([positions[a], positions[b]], [positions[c], positions[d]]);
                lower(&mut self.verdict.least_distance, distance);
                match stated {
                    None => {
                        let constraint = Constraint::Distance {
                            members: [[a, b], [c, d]],
                        };
                        report(self, constraint, limits.min_distance - distance, 0.0);
                    }
                    Some(stated) => {
                        if !(distance >= stated - 1e-9) {
                            let members = [first, second];
                            let kind = WalkFaultKind::Clearance {
                                members,
                                distance,
                                stated,
                            };
                            self.fault(index, true, kind);
                        }
                    }
                }
            }
        }
        for (node, position) in positions.iter().enumerate() {
            lower(&mut self.verdict.least_height, position.z);
            report(self, Constraint::Ground { node }, -position.z, 0.0);
        }
        for (obstacle, outline) in facts.obstacles.iter().enumerate() {
            let distance = facts
                .edges
                .iter()
                .map(|&[a, b]| outline_distance(outline, positions[a], positions[b]))
                .fold(f64::INFINITY, f64::min);
            if !(distance >= facts.obstacle_clearance - self.options.tolerance) {
                self.fault(
                    index,
                    between,
                    WalkFaultKind::Obstacle { obstacle, distance },
                );
            }
        }
    }

    /// The worst-case rigidity index from the singular values of the rigidity matrix.
    fn index(&self, positions: &[Vector3<f64>]) -> f64 {
        let facts = self.facts;
        let axes = facts.dimension.axes();
        let component = |v: &Vector3<f64>, axis: usize| match facts.dimension {
            Dimension::Two => v[2 * axis],
            Dimension::Three => v[axis],
        };
        let matrix = DMatrix::from_fn(facts.edges.len(), facts.nodes * axes, |row, column| {
            let [a, b] = facts.edges[row];
            let (node, axis) = (column / axes, column % axes);
            let edge = positions[a] - positions[b];
            if node == a {
                component(&edge, axis)
            } else if node == b {
                -component(&edge, axis)
            } else {
                0.0
            }
        });
        let mut squares: Vec<f64> = matrix.singular_values().iter().map(|s| s * s).collect();
        squares.sort_by(|a, b| b.total_cmp(a));
        let total: f64 = squares.iter().sum();
        // Of d·n eigenvalues the rigid motions take the last d (d + 1)/2.
        let rank = facts.nodes * axes - axes * (axes + 1) / 2;
        squares
            .get(rank.wrapping_sub(1))
            .map_or(0.0, |smallest| smallest / total)
    }
}
