//! The physical constraints on one configuration as smooth functions with analytic derivatives.
//!
//! Source: Usevitch et al., section III: lengths (11), distances between members (12), angles
//! (14, with its sign put right: cos θ ≤ cos θ_min) and the worst-case rigidity index (17).
//! Every function is scaled so that its value near the bound is a length, an angle in radians, or
//! a relative excess: tolerances mean the same for all. Cost: constant for each function, except
//! the index (one eigenvalue decomposition).

use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};

use crate::segment::{ClosestPoints, closest_points};
use crate::{Corner, Limits, RigiditySpectrum, Robot};

/// A physical constraint of a robot, named by its members and nodes.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
#[non_exhaustive]
pub enum Constraint {
    /// A member at least as long as its shortest length.
    MinLength {
        /// The ends of the member.
        member: [usize; 2],
    },
    /// A member at most as long as its greatest length.
    MaxLength {
        /// The ends of the member.
        member: [usize; 2],
    },
    /// Two members that share no node, at least a diameter apart.
    Distance {
        /// The ends of the two members.
        members: [[usize; 2]; 2],
    },
    /// The angle between two members at a node.
    Angle {
        /// The shared node.
        node: usize,
        /// The other ends of the members.
        ends: [usize; 2],
    },
    /// A node on or above the ground.
    Ground {
        /// The node.
        node: usize,
    },
    /// The worst-case rigidity index.
    Rigidity,
    /// The centre of mass inside the support polygon.
    Balance,
}

impl std::fmt::Display for Constraint {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::MinLength { member: [a, b] } => write!(f, "shortest length of member {a}-{b}"),
            Self::MaxLength { member: [a, b] } => write!(f, "greatest length of member {a}-{b}"),
            Self::Distance {
                members: [[a, b], [c, d]],
            } => {
                write!(f, "distance between members {a}-{b} and {c}-{d}")
            }
            Self::Angle { node, ends: [a, b] } => {
                write!(f, "angle between members {node}-{a} and {node}-{b}")
            }
            Self::Ground { node } => write!(f, "node {node} above the ground"),
            Self::Rigidity => write!(f, "worst-case rigidity index"),
            Self::Balance => write!(f, "centre of mass inside the support polygon"),
        }
    }
}

/// One constraint function of a single configuration, by index into the graph.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum ConstraintFunction {
    /// L of a member, between its two limits.
    Length(usize),
    /// (D² − d²)/(2d) of a pair of members, at least 0.
    Distance([usize; 2]),
    /// (cos θ − cos θ_min)/sin θ_min of a corner, at most 0.
    Angle(Corner),
}

impl ConstraintFunction {
    /// All functions of a robot: lengths, then distances, then angles.
    pub(crate) fn all(robot: &Robot) -> Vec<Self> {
        let graph = robot.graph();
        (0..graph.num_members())
            .map(Self::Length)
            .chain(
                graph
                    .disjoint_pairs()
                    .iter()
                    .map(|&pair| Self::Distance(pair)),
            )
            .chain(graph.corners().iter().map(|&corner| Self::Angle(corner)))
            .collect()
    }

    /// Lower and upper bound.
    pub(crate) fn bounds(self, limits: &Limits) -> (f64, f64) {
        match self {
            Self::Length(_) => (limits.min_length, limits.max_length),
            Self::Distance(_) => (0.0, f64::INFINITY),
            Self::Angle(_) => (f64::NEG_INFINITY, 0.0),
        }
    }

    /// The nodes whose positions it depends on.
    pub(crate) fn nodes(self, robot: &Robot) -> NodeList {
        let members = robot.graph().members();
        match self {
            Self::Length(member) => {
                let [a, b] = members[member];
                NodeList {
                    nodes: [a, b, 0, 0],
                    count: 2,
                }
            }
            Self::Distance([first, second]) => {
                let ([a, b], [c, d]) = (members[first], members[second]);
                NodeList {
                    nodes: [a, b, c, d],
                    count: 4,
                }
            }
            Self::Angle(Corner { node, ends: [a, b] }) => NodeList {
                nodes: [node, a, b, 0],
                count: 3,
            },
        }
    }

    /// Value at the positions of [`nodes`](Self::nodes).
    pub(crate) fn value(self, limits: &Limits, p: &[Vector3<f64>; 4]) -> f64 {
        match self {
            Self::Length(_) => (p[0] - p[1]).norm(),
            Self::Distance(_) => {
                let least = limits.min_distance;
                let squared = closest(p).separation.norm_squared();
                0.5 * (squared - least * least) / least
            }
            Self::Angle(_) => {
                let (a, b) = (p[1] - p[0], p[2] - p[0]);
                let cosine = a.dot(&b) / (a.norm_squared() * b.norm_squared()).sqrt();
                (cosine - limits.min_angle.cos()) / limits.min_angle.sin()
            }
        }
    }

    /// Gradient with respect to each of [`nodes`](Self::nodes).
    pub(crate) fn gradient(self, limits: &Limits, p: &[Vector3<f64>; 4]) -> [Vector3<f64>; 4] {
        let mut gradient = [Vector3::zeros(); 4];
        match self {
            Self::Length(_) => {
                gradient[0] = (p[0] - p[1]).normalize();
                gradient[1] = -gradient[0];
            }
            Self::Distance(_) => {
                let closest = closest(p);
                for (entry, weight) in gradient.iter_mut().zip(closest.weights()) {
                    *entry = closest.separation * (weight / limits.min_distance);
                }
            }
            Self::Angle(_) => {
                let corner = CornerDerivatives::new(p);
                let scale = 1.0 / limits.min_angle.sin();
                gradient[1] = corner.by_a * scale;
                gradient[2] = corner.by_b * scale;
                gradient[0] = -(gradient[1] + gradient[2]);
            }
        }
        gradient
    }

    /// Hessian as blocks over pairs of [`nodes`](Self::nodes).
    pub(crate) fn hessian(self, limits: &Limits, p: &[Vector3<f64>; 4]) -> [[Matrix3<f64>; 4]; 4] {
        match self {
            Self::Length(_) => {
                let mut blocks = [[Matrix3::zeros(); 4]; 4];
                let edge = p[0] - p[1];
                let length = edge.norm();
                let unit = edge / length;
                let curvature = (Matrix3::identity() - unit * unit.transpose()) / length;
                blocks[0][0] = curvature;
                blocks[1][1] = curvature;
                blocks[0][1] = -curvature;
                blocks[1][0] = -curvature;
                blocks
            }
            Self::Distance(_) => {
                let mut blocks = closest(p).half_squared_hessian(&p[0], &p[1], &p[2], &p[3]);
                for block in blocks.iter_mut().flatten() {
                    *block /= limits.min_distance;
                }
                blocks
            }
            Self::Angle(_) => {
                let mut blocks = [[Matrix3::zeros(); 4]; 4];
                let c = CornerDerivatives::new(p);
                let scale = 1.0 / limits.min_angle.sin();
                let projector = |u: &Vector3<f64>| Matrix3::identity() - u * u.transpose();
                let own = |u: &Vector3<f64>, g: &Vector3<f64>, length: f64| {
                    -(u * g.transpose() + g * u.transpose()) / length
                        - projector(u) * (c.cosine / (length * length))
                };
                let aa = own(&c.a, &c.by_a, c.a_length) * scale;
                let bb = own(&c.b, &c.by_b, c.b_length) * scale;
                let ab = (projector(&c.b) / c.b_length - c.a * c.by_b.transpose())
                    * (scale / c.a_length);
                let ba = ab.transpose();
                blocks[1][1] = aa;
                blocks[2][2] = bb;
                blocks[1][2] = ab;
                blocks[2][1] = ba;
                blocks[0][1] = -(aa + ba);
                blocks[1][0] = blocks[0][1].transpose();
                blocks[0][2] = -(ab + bb);
                blocks[2][0] = blocks[0][2].transpose();
                blocks[0][0] = -(blocks[0][1] + blocks[0][2]);
                blocks
            }
        }
    }

    /// The constraint that is meant, for a value below (`at_lower`) or above its bounds.
    pub(crate) fn describe(self, robot: &Robot, at_lower: bool) -> Constraint {
        let members = robot.graph().members();
        match self {
            Self::Length(member) if at_lower => Constraint::MinLength {
                member: members[member],
            },
            Self::Length(member) => Constraint::MaxLength {
                member: members[member],
            },
            Self::Distance([first, second]) => Constraint::Distance {
                members: [members[first], members[second]],
            },
            Self::Angle(Corner { node, ends }) => Constraint::Angle { node, ends },
        }
    }
}

/// At most four nodes.
#[derive(Debug, Clone, Copy)]
pub(crate) struct NodeList {
    nodes: [usize; 4],
    count: usize,
}

impl NodeList {
    pub(crate) fn as_slice(&self) -> &[usize] {
        &self.nodes[..self.count]
    }

    /// Their positions; entries beyond the last node are zero.
    #[inline]
    pub(crate) fn positions(&self, robot: &Robot, coordinates: &[f64]) -> [Vector3<f64>; 4] {
        let mut positions = [Vector3::zeros(); 4];
        for (position, &node) in positions.iter_mut().zip(self.as_slice()) {
            *position = robot.dimension().node(coordinates, node);
        }
        positions
    }
}

fn closest(p: &[Vector3<f64>; 4]) -> ClosestPoints {
    closest_points(&p[0], &p[1], &p[2], &p[3])
}

/// The cosine of a corner and its gradients with respect to the two sides.
struct CornerDerivatives {
    a: Vector3<f64>,
    b: Vector3<f64>,
    a_length: f64,
    b_length: f64,
    cosine: f64,
    by_a: Vector3<f64>,
    by_b: Vector3<f64>,
}

impl CornerDerivatives {
    fn new(p: &[Vector3<f64>; 4]) -> Self {
        let (a, b) = (p[1] - p[0], p[2] - p[0]);
        let (a_length, b_length) = (a.norm(), b.norm());
        let (a, b) = (a / a_length, b / b_length);
        let cosine = a.dot(&b);
        Self {
            by_a: (b - a * cosine) / a_length,
            by_b: (a - b * cosine) / b_length,
            a,
            b,
            a_length,
            b_length,
            cosine,
        }
    }
}

/// The rigidity constraint √(bound/least) − 1 ≥ 0 on the smooth lower bound of the index; the
/// root because the eigenvalue vanishes quadratically at a singular configuration.
#[derive(Debug)]
pub(crate) struct RigidityFunction {
    spectrum: RigiditySpectrum,
    least: f64,
}

impl RigidityFunction {
    /// The function at `coordinates`, for the least index `least`.
    pub(crate) fn at(robot: &Robot, coordinates: &[f64], least: f64) -> Self {
        let spectrum = RigiditySpectrum::at(robot.graph(), robot.dimension(), coordinates);
        Self { spectrum, least }
    }

    /// Largest factor by which an index exceeds its smooth bound, with `count` eigenvalues.
    pub(crate) fn largest_gap(count: usize) -> f64 {
        RigiditySpectrum::largest_gap(count)
    }

    pub(crate) fn value(&self) -> f64 {
        (self.spectrum.smooth_index() / self.least).sqrt() - 1.0
    }

    /// Gradient with respect to all coordinates.
    pub(crate) fn gradient(&self, robot: &Robot, coordinates: &[f64], gradient: &mut [f64]) {
        self.spectrum
            .smooth_gradient(robot.graph(), coordinates, gradient);
        let bound = self.spectrum.smooth_index();
        if bound > 0.0 {
            let scale = 0.5 / (bound * self.least).sqrt();
            gradient.iter_mut().for_each(|entry| *entry *= scale);
        }
    }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64;

    use super::*;
    use crate::{Dimension, Graph};

    #[test]
    fn gradients_and_hessians_agree_with_differences() {
        let mut rng = Pcg64::seed_from_u64(5);
        let robot = Robot::new(
            Graph::complete(5).unwrap(),
            Dimension::Three,
            Limits::default(),
        );
        let robot = robot.unwrap();
        let limits = robot.limits();
        let step = 1e-5;
        let mut compared = 0;
        for function in ConstraintFunction::all(&robot) {
            let x: Vec<f64> = (0..15).map(|_| rng.random_range(-1.0..1.0)).collect();
            let nodes = function.nodes(&robot);
            let p = nodes.positions(&robot, &x);
            if let ConstraintFunction::Distance(_) = function {
                // Away from the seams between clamped and free parameters.
                let at = closest(&p);
                if [at.s, at.t]
                    .iter()
                    .any(|p| (0.49..0.5).contains(&(p - 0.5).abs()))
                {
                    continue;
                }
            }
            let gradient = function.gradient(limits, &p);
            let hessian = function.hessian(limits, &p);
            for node in 0..nodes.as_slice().len() {
                for axis in 0..3 {
                    let shifted = |by: f64| {
                        let mut moved = p;
                        moved[node][axis] += by;
                        moved
                    };
                    let (ahead, behind) = (shifted(step), shifted(-step));
                    let value = |p| function.value(limits, p);
                    let slope = (value(&ahead) - value(&behind)) / (2.0 * step);
                    assert!((slope - gradient[node][axis]).abs() < 1e-6 * (1.0 + slope.abs()));
                    let (after, before) = (
                        function.gradient(limits, &ahead),
                        function.gradient(limits, &behind),
                    );
                    for other in 0..nodes.as_slice().len() {
                        let column = (after[other] - before[other]) / (2.0 * step);
                        let exact: Vector3<f64> = hessian[other][node].column(axis).into();
                        assert!(
                            (column - exact).norm() < 1e-4 * (1.0 + column.norm()),
                            "{function:?} {node} {axis} {other}: {column} {exact}"
                        );
                        compared += 1;
                    }
                }
            }
        }
        assert!(compared > 500);
    }

    #[test]
    fn the_rigidity_function_has_the_gradient_of_its_value() {
        let mut rng = Pcg64::seed_from_u64(6);
        let robot = Robot::new(Graph::octahedron(), Dimension::Three, Limits::default()).unwrap();
        let x: Vec<f64> = (0..18).map(|_| rng.random_range(-1.0..1.0)).collect();
        let mut gradient = vec![0.0; 18];
        RigidityFunction::at(&robot, &x, 0.0025).gradient(&robot, &x, &mut gradient);
        for coordinate in 0..18 {
            let value = |by: f64| {
                let mut moved = x.clone();
                moved[coordinate] += by;
                RigidityFunction::at(&robot, &moved, 0.0025).value()
            };
            let slope = (value(1e-6) - value(-1e-6)) / 2e-6;
            assert!((slope - gradient[coordinate]).abs() < 1e-5 * (1.0 + slope.abs()));
        }
    }
}
