//! The support polygon of a robot: its sides, whether the centre of mass is above it, and the
//! rigid roll over one of its sides.
//!
//! In space the support is a triangle of three nodes and the robot rolls over an edge; in the
//! plane it is a segment of two nodes and the robot rolls over one of them. Source: Usevitch et
//! al., section II.C. Cost: O(n) for a roll.

use nalgebra::{Rotation3, Unit, Vector3};
use thiserror::Error;

use crate::{Dimension, Robot};

/// Nodes closer than this to the axis of a roll do not move in it.
const AXIS_TOLERANCE: f64 = 1e-9;

/// The nodes that carry a robot: three in space, two in the plane.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Support {
    nodes: Vec<usize>,
}

/// Nodes that cannot carry a robot.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum SupportError {
    /// Not as many nodes as the space has axes.
    #[error("a support has {needed} nodes, found {found}")]
    Count {
        /// Number of nodes needed.
        needed: usize,
        /// Number of nodes found.
        found: usize,
    },
    /// A node that does not exist or is listed twice.
    #[error("node {node} cannot be a support node: list different nodes of the robot")]
    BadNode {
        /// The node.
        node: usize,
    },
    /// A support node is not on the ground.
    #[error(
        "support node {node} is at height {height}: support nodes stand on the ground, at height 0"
    )]
    NotOnGround {
        /// The node.
        node: usize,
        /// Its height.
        height: f64,
    },
    /// The support nodes lie on a line (or coincide).
    #[error("support nodes {nodes:?} enclose no area")]
    Degenerate {
        /// The nodes.
        nodes: Vec<usize>,
    },
    /// The centre of mass is not above the support polygon.
    #[error(
        "the centre of mass is {outside} outside the side opposite support node {opposite}: the robot would tip over"
    )]
    Unbalanced {
        /// The support node opposite the side.
        opposite: usize,
        /// Distance outside.
        outside: f64,
    },
}

/// The line of a side of a support polygon on the ground.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SideLine {
    /// A point of the line.
    pub origin: Vector3<f64>,
    /// Unit vector along the line, the axis of a roll: a positive turn carries what is above the
    /// support outward.
    pub axis: Vector3<f64>,
    /// Horizontal unit vector away from the support.
    pub outward: Vector3<f64>,
}

impl SideLine {
    /// Signed distance of a point outside the side, seen from above; negative inside.
    #[must_use]
    pub fn outside(&self, point: &Vector3<f64>) -> f64 {
        (point - self.origin).dot(&self.outward)
    }

    /// Angle about the axis at which a point is seen: 0 on the ground outside, π/2 above the
    /// side, π on the ground inside.
    fn elevation(&self, point: &Vector3<f64>) -> f64 {
        point.z.max(0.0).atan2(self.outside(point))
    }

    /// Distance from the axis.
    fn radius(&self, point: &Vector3<f64>) -> f64 {
        self.outside(point).hypot(point.z)
    }
}

/// A rigid roll over one side of the support.
#[derive(Debug, Clone, PartialEq)]
pub struct Roll {
    /// Index of the side rolled over.
    pub side: usize,
    /// The node that lifts off.
    pub lifted: usize,
    /// The node that comes down.
    pub landed: usize,
    /// Angle turned, in radians.
    pub angle: f64,
    /// Support after the roll.
    pub support: Support,
}

impl Support {
    /// A support of the given nodes.
    ///
    /// # Errors
    /// The wrong number of nodes for the dimension, or a node that is repeated or does not exist.
    pub fn new(robot: &Robot, nodes: &[usize]) -> Result<Self, SupportError> {
        let needed = robot.dimension().axes();
        if nodes.len() != needed {
            return Err(SupportError::Count {
                needed,
                found: nodes.len(),
            });
        }
        for (index, &node) in nodes.iter().enumerate() {
            if node >= robot.graph().num_nodes() || nodes[..index].contains(&node) {
                return Err(SupportError::BadNode { node });
            }
        }
        Ok(Self {
            nodes: nodes.to_vec(),
        })
    }

    /// The nodes.
    #[must_use]
    pub fn nodes(&self) -> &[usize] {
        &self.nodes
    }

    /// Whether a node belongs to the support.
    #[must_use]
    pub fn contains(&self, node: usize) -> bool {
        self.nodes.contains(&node)
    }

    /// Number of sides.
    #[must_use]
    pub fn num_sides(&self) -> usize {
        self.nodes.len()
    }

    /// The nodes of side `side`, the one opposite the node `nodes()[side]`: two in space, one in
    /// the plane.
    #[must_use]
    pub fn side_nodes(&self, side: usize) -> Vec<usize> {
        self.nodes
            .iter()
            .enumerate()
            .filter(|&(k, _)| k != side)
            .map(|(_, &node)| node)
            .collect()
    }

    /// Index of the side between the given nodes, if there is one.
    #[must_use]
    pub fn side_between(&self, nodes: &[usize]) -> Option<usize> {
        let opposite = self.nodes.iter().position(|node| !nodes.contains(node))?;
        let others = self.side_nodes(opposite);
        (others.len() == nodes.len() && others.iter().all(|node| nodes.contains(node)))
            .then_some(opposite)
    }

    /// The line of a side at `coordinates`.
    #[must_use]
    pub fn side_line(&self, dimension: Dimension, coordinates: &[f64], side: usize) -> SideLine {
        let count = self.nodes.len();
        let origin = dimension.node(coordinates, self.nodes[(side + 1) % count]);
        let opposite = dimension.node(coordinates, self.nodes[side]);
        let mut axis = match dimension {
            Dimension::Two => Vector3::y(),
            Dimension::Three => {
                let other = dimension.node(coordinates, self.nodes[(side + 2) % count]);
                let along = other - origin;
                Vector3::new(along.x, along.y, 0.0).normalize()
            }
        };
        // A turn about the axis carries ẑ towards axis × ẑ.
        let mut outward = axis.cross(&Vector3::z());
        if (opposite - origin).dot(&outward) > 0.0 {
            axis = -axis;
            outward = -outward;
        }
        SideLine {
            origin,
            axis,
            outward,
        }
    }

    /// The side that the point is farthest outside of (or least far inside of), with the signed
    /// distance outside.
    #[must_use]
    pub fn outermost_side(
        &self,
        dimension: Dimension,
        coordinates: &[f64],
        point: &Vector3<f64>,
    ) -> (usize, f64) {
        (0..self.num_sides())
            .map(|side| {
                (
                    side,
                    self.side_line(dimension, coordinates, side).outside(point),
                )
            })
            .fold((0, f64::NEG_INFINITY), |best, entry| {
                if entry.1 > best.1 { entry } else { best }
            })
    }

    /// Checks that the support nodes stand on the ground, enclose an area and carry the centre of
    /// mass, each within `tolerance`.
    ///
    /// # Errors
    /// The first requirement that is not met.
    pub fn validate(
        &self,
        robot: &Robot,
        coordinates: &[f64],
        tolerance: f64,
    ) -> Result<(), SupportError> {
        let dimension = robot.dimension();
        for &node in &self.nodes {
            let height = dimension.height(coordinates, node);
            if !(height.abs() <= tolerance) {
                return Err(SupportError::NotOnGround { node, height });
            }
        }
        let node = |k: usize| dimension.node(coordinates, self.nodes[k]);
        let extent = match dimension {
            Dimension::Two => (node(1) - node(0)).norm(),
            Dimension::Three => {
                let (a, b) = (node(1) - node(0), node(2) - node(0));
                a.cross(&b).norm() / a.norm().max(b.norm()).max(f64::MIN_POSITIVE)
            }
        };
        if !(extent > 1e-6) {
            return Err(SupportError::Degenerate {
                nodes: self.nodes.clone(),
            });
        }
        let centre = robot.centre_of_mass(coordinates);
        let (side, outside) = self.outermost_side(dimension, coordinates, &centre);
        if outside > tolerance {
            return Err(SupportError::Unbalanced {
                opposite: self.nodes[side],
                outside,
            });
        }
        Ok(())
    }

    /// Turns the robot rigidly over a side until the next node meets the ground. `coordinates`
    /// are overwritten. None when no node lies on the outer side, so that nothing stops the roll
    /// before the robot lies upside down.
    pub fn roll(&self, robot: &Robot, coordinates: &mut [f64], side: usize) -> Option<Roll> {
        let dimension = robot.dimension();
        let line = self.side_line(dimension, coordinates, side);
        let pivots = self.side_nodes(side);
        let moving = |node: &usize| *node != self.nodes[side] && !pivots.contains(node);
        let (angle, landed) = (0..robot.graph().num_nodes())
            .filter(moving)
            .map(|node| (dimension.node(coordinates, node), node))
            .filter(|(point, _)| line.radius(point) > AXIS_TOLERANCE)
            .map(|(point, node)| (line.elevation(&point), node))
            .min_by(|a, b| a.0.total_cmp(&b.0))?;
        // The lifted node is at angle π: beyond it, the robot would come to stand on it again.
        if angle >= std::f64::consts::PI - 1e-9 {
            return None;
        }
        turn(robot, coordinates, &line, angle, &pivots);
        let mut position = dimension.node(coordinates, landed);
        position.z = 0.0;
        dimension.set_node(coordinates, landed, &position);
        let mut support = self.clone();
        support.nodes[side] = landed;
        Some(Roll {
            side,
            lifted: self.nodes[side],
            landed,
            angle,
            support,
        })
    }
}

/// Turns every node but `pivots` about the line of a side by `angle`, outward when positive.
pub(crate) fn turn(
    robot: &Robot,
    coordinates: &mut [f64],
    line: &SideLine,
    angle: f64,
    pivots: &[usize],
) {
    let rotation = Rotation3::from_axis_angle(&Unit::new_unchecked(line.axis), angle);
    let dimension = robot.dimension();
    for node in (0..robot.graph().num_nodes()).filter(|node| !pivots.contains(node)) {
        let point = dimension.node(coordinates, node);
        let turned = line.origin + rotation * (point - line.origin);
        dimension.set_node(coordinates, node, &turned);
    }
}

/// Angle by which a node turns about a side until it meets the ground outside.
pub(crate) fn landing_angle(
    robot: &Robot,
    coordinates: &[f64],
    line: &SideLine,
    node: usize,
) -> f64 {
    line.elevation(&robot.dimension().node(coordinates, node))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Graph, Limits};

    fn tetrahedron() -> (Robot, Vec<f64>, Support) {
        let robot = Robot::new(
            Graph::complete(4).unwrap(),
            Dimension::Three,
            Limits::default(),
        )
        .unwrap();
        let (third, h) = (3.0_f64.sqrt() / 6.0, (2.0_f64 / 3.0).sqrt());
        let x = vec![
            -3.0 * third,
            0.0,
            0.0,
            0.0,
            -0.5,
            0.0,
            0.0,
            0.5,
            0.0,
            -third,
            0.0,
            h,
        ];
        let support = Support::new(&robot, &[0, 1, 2]).unwrap();
        (robot, x, support)
    }

    #[test]
    fn a_regular_tetrahedron_rolls_onto_its_next_face() {
        let (robot, mut x, support) = tetrahedron();
        let before = robot.lengths(&x);
        let roll = support.roll(&robot, &mut x, 0).unwrap();
        assert_eq!((roll.lifted, roll.landed), (0, 3));
        assert_eq!(roll.support.nodes(), [3, 1, 2]);
        let dihedral = (1.0_f64 / 3.0).acos();
        assert!((roll.angle - (std::f64::consts::PI - dihedral)).abs() < 1e-12);
        for (a, b) in before.iter().zip(robot.lengths(&x)) {
            assert!((a - b).abs() < 1e-12);
        }
        let landed = robot.dimension().node(&x, 3);
        assert!((landed - Vector3::new(3.0_f64.sqrt() / 2.0, 0.0, 0.0)).norm() < 1e-12);
        roll.support.validate(&robot, &x, 1e-9).unwrap();
    }

    #[test]
    fn sides_and_distances() {
        let (robot, x, support) = tetrahedron();
        assert_eq!(support.side_between(&[2, 1]), Some(0));
        assert_eq!(support.side_between(&[2, 3]), None);
        let line = support.side_line(robot.dimension(), &x, 0);
        assert!((line.outward - Vector3::x()).norm() < 1e-15);
        let centre = robot.centre_of_mass(&x);
        let (_, outside) = support.outermost_side(robot.dimension(), &x, &centre);
        assert!((outside + 3.0_f64.sqrt() / 6.0).abs() < 1e-12);
    }

    #[test]
    fn a_planar_robot_rolls_over_a_node() {
        let graph = Graph::new(4, [[0, 1], [1, 2], [2, 3], [3, 0], [1, 3]]).unwrap();
        let robot = Robot::new(graph, Dimension::Two, Limits::default()).unwrap();
        let mut x = vec![0.0, 0.0, 1.0, 0.0, 1.5, 0.8, 0.5, 0.8];
        let support = Support::new(&robot, &[0, 1]).unwrap();
        let side = support.side_between(&[1]).unwrap();
        assert_eq!(support.nodes()[side], 0);
        let before = robot.lengths(&x);
        let roll = support.roll(&robot, &mut x, side).unwrap();
        assert_eq!(roll.landed, 2);
        assert!((roll.angle - 0.8_f64.atan2(0.5)).abs() < 1e-12);
        for (a, b) in before.iter().zip(robot.lengths(&x)) {
            assert!((a - b).abs() < 1e-12);
        }
        assert_eq!(&x[2..4], &[1.0, 0.0]);
        assert!((x[4] - (1.0 + 0.5_f64.hypot(0.8))).abs() < 1e-12 && x[5] == 0.0);
    }

    #[test]
    fn supports_that_do_not_carry_are_refused() {
        let (robot, x, support) = tetrahedron();
        assert!(matches!(
            Support::new(&robot, &[0, 1]),
            Err(SupportError::Count { .. })
        ));
        assert!(matches!(
            Support::new(&robot, &[0, 1, 1]),
            Err(SupportError::BadNode { node: 1 })
        ));
        let lifted: Vec<f64> = x
            .iter()
            .enumerate()
            .map(|(k, v)| v + f64::from(k == 5))
            .collect();
        assert!(matches!(
            support.validate(&robot, &lifted, 1e-9),
            Err(SupportError::NotOnGround { node: 1, .. })
        ));
        let mut leaning = x.clone();
        leaning[9] = 8.0;
        assert!(matches!(
            support.validate(&robot, &leaning, 1e-9),
            Err(SupportError::Unbalanced { opposite: 0, .. })
        ));
    }
}
