//! A robot: graph, masses and limits; its centre of mass and the margins of a configuration.

use nalgebra::Vector3;
use thiserror::Error;

use crate::constraint::{Constraint, ConstraintFunction};
use crate::framework::member_lengths;
use crate::limits::LimitsError;
use crate::segment::closest_points;
use crate::{Dimension, Framework, FrameworkError, Graph, Limits, RigiditySpectrum};

/// A linear-actuator robot: what stays the same while it moves.
///
/// # Examples
///
/// ```
/// use tensegra_lar::{Dimension, Graph, Limits, Robot};
///
/// let robot = Robot::new(Graph::octahedron(), Dimension::Three, Limits::default())?;
/// assert_eq!(robot.mass_fractions(), [1.0 / 6.0; 6]);
/// # Ok::<(), tensegra_lar::RobotError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Robot {
    graph: Graph,
    dimension: Dimension,
    mass_fractions: Vec<f64>,
    limits: Limits,
}

/// A robot that cannot be.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum RobotError {
    /// A limit outside its range.
    #[error(transparent)]
    Limits(#[from] LimitsError),
    /// A mass is negative, NaN or infinite, or all are zero.
    #[error(
        "node {node} has the mass {mass}: masses must be finite and not negative, and not all zero"
    )]
    Mass {
        /// The node.
        node: usize,
        /// Its mass.
        mass: f64,
    },
    /// The list of masses does not have one entry for each node.
    #[error("{found} masses for {nodes} nodes: give one for each node")]
    MassCount {
        /// Number of nodes.
        nodes: usize,
        /// Number of masses found.
        found: usize,
    },
    /// Too few nodes to stand and have a free one.
    #[error("a robot in dimension {axes} needs more than {axes} nodes, found {nodes}")]
    TooFewNodes {
        /// The dimension.
        axes: usize,
        /// Number of nodes.
        nodes: usize,
    },
}

/// How far one configuration is from each kind of limit: the extreme value of each quantity and
/// where it occurs.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct ConfigurationExtremes {
    /// Shortest member: length and index.
    pub shortest: (f64, usize),
    /// Longest member: length and index.
    pub longest: (f64, usize),
    /// Closest pair of members that share no node: distance and their indices; none for a graph
    /// without such a pair.
    pub closest: Option<(f64, [usize; 2])>,
    /// Sharpest corner: angle in radians and its index in [`Graph::corners`].
    pub sharpest: (f64, usize),
    /// Lowest node: height and index.
    pub lowest: (f64, usize),
    /// Worst-case rigidity index λ/tr(RᵀR).
    pub rigidity: f64,
}

impl Robot {
    /// A robot whose members have equal masses, half of which sits at each end: the mass fraction
    /// of a node is its degree over 2 n_L.
    ///
    /// # Errors
    /// See [`RobotError`].
    pub fn new(graph: Graph, dimension: Dimension, limits: Limits) -> Result<Self, RobotError> {
        limits.validate()?;
        if graph.num_nodes() <= dimension.axes() {
            return Err(RobotError::TooFewNodes {
                axes: dimension.axes(),
                nodes: graph.num_nodes(),
            });
        }
        let total = 2.0 * graph.num_members() as f64;
        let mass_fractions = graph
            .degrees()
            .iter()
            .map(|&degree| degree as f64 / total)
            .collect();
        Ok(Self {
            graph,
            dimension,
            mass_fractions,
            limits,
        })
    }

    /// Sets the mass of each node, in any unit.
    ///
    /// # Errors
    /// A mass that is negative or not finite, or a list of the wrong length.
    pub fn with_masses(mut self, masses: &[f64]) -> Result<Self, RobotError> {
        if masses.len() != self.graph.num_nodes() {
            return Err(RobotError::MassCount {
                nodes: self.graph.num_nodes(),
                found: masses.len(),
            });
        }
        let total: f64 = masses.iter().sum();
        let bad = |mass: &f64| !mass.is_finite() || *mass < 0.0 || total <= 0.0;
        if let Some(node) = masses.iter().position(bad) {
            return Err(RobotError::Mass {
                node,
                mass: masses[node],
            });
        }
        self.mass_fractions = masses.iter().map(|mass| mass / total).collect();
        Ok(self)
    }

    /// The same robot with limits that are known to be within their ranges.
    pub(crate) fn with_limits(mut self, limits: Limits) -> Self {
        self.limits = limits;
        self
    }

    /// The graph.
    #[must_use]
    pub fn graph(&self) -> &Graph {
        &self.graph
    }

    /// The dimension.
    #[must_use]
    pub fn dimension(&self) -> Dimension {
        self.dimension
    }

    /// The part of the mass that sits at each node; the parts add up to 1.
    #[must_use]
    pub fn mass_fractions(&self) -> &[f64] {
        &self.mass_fractions
    }

    /// The limits.
    #[must_use]
    pub fn limits(&self) -> &Limits {
        &self.limits
    }

    /// Number of coordinates of a configuration, d·n.
    #[must_use]
    pub fn num_coordinates(&self) -> usize {
        self.graph.num_nodes() * self.dimension.axes()
    }

    /// The framework of this robot at `coordinates`.
    ///
    /// # Errors
    /// See [`FrameworkError`].
    pub fn framework(&self, coordinates: &[f64]) -> Result<Framework, FrameworkError> {
        Framework::new(self.graph.clone(), self.dimension, coordinates.to_vec())
    }

    /// The centre of mass (equation (21)).
    #[must_use]
    pub fn centre_of_mass(&self, coordinates: &[f64]) -> Vector3<f64> {
        self.mass_fractions
            .iter()
            .enumerate()
            .map(|(node, fraction)| self.dimension.node(coordinates, node) * *fraction)
            .sum()
    }

    /// Length of every member.
    #[must_use]
    pub fn lengths(&self, coordinates: &[f64]) -> Vec<f64> {
        let mut lengths = vec![0.0; self.graph.num_members()];
        self.lengths_into(coordinates, &mut lengths);
        lengths
    }

    /// Length of every member, written into `lengths`.
    pub(crate) fn lengths_into(&self, coordinates: &[f64], lengths: &mut [f64]) {
        member_lengths(&self.graph, self.dimension, coordinates, lengths);
    }

    /// Distance between the axes of two members.
    pub(crate) fn pair_distance(&self, coordinates: &[f64], pair: [usize; 2]) -> f64 {
        let node = |node| self.dimension.node(coordinates, node);
        let ([a, b], [c, d]) = (self.graph.members()[pair[0]], self.graph.members()[pair[1]]);
        closest_points(&node(a), &node(b), &node(c), &node(d)).distance()
    }

    /// The angle of a corner, in radians.
    pub(crate) fn corner_angle(&self, coordinates: &[f64], corner: usize) -> f64 {
        let corner = self.graph.corners()[corner];
        let node = |node| self.dimension.node(coordinates, node);
        let (a, b) = (
            node(corner.ends[0]) - node(corner.node),
            node(corner.ends[1]) - node(corner.node),
        );
        a.cross(&b).norm().atan2(a.dot(&b))
    }

    /// The extreme lengths, distance, angle, height and the rigidity index of a configuration.
    #[must_use]
    pub fn extremes(&self, coordinates: &[f64]) -> ConfigurationExtremes {
        let least = |values: &mut dyn Iterator<Item = f64>| {
            values.zip(0..).fold((f64::INFINITY, 0), |best, entry| {
                if entry.0 < best.0 { entry } else { best }
            })
        };
        let lengths = self.lengths(coordinates);
        let longest = least(&mut lengths.iter().map(|length| -length));
        let pairs = self.graph.disjoint_pairs();
        let closest = least(
            &mut pairs
                .iter()
                .map(|&pair| self.pair_distance(coordinates, pair)),
        );
        let corners = 0..self.graph.corners().len();
        let heights = 0..self.graph.num_nodes();
        ConfigurationExtremes {
            shortest: least(&mut lengths.iter().copied()),
            longest: (-longest.0, longest.1),
            closest: pairs.get(closest.1).map(|&pair| (closest.0, pair)),
            sharpest: least(&mut corners.map(|c| self.corner_angle(coordinates, c))),
            lowest: least(&mut heights.map(|node| self.dimension.height(coordinates, node))),
            rigidity: RigiditySpectrum::at(&self.graph, self.dimension, coordinates).index(),
        }
    }

    /// Constraints on a configuration whose violation exceeds `tolerance`, the worst first, with
    /// the violation: a length, an angle in radians, or a difference of rigidity indices.
    ///
    /// A negative tolerance lists the constraints that are closer than its size to their bound:
    /// those that are active.
    #[must_use]
    pub fn violations(&self, coordinates: &[f64], tolerance: f64) -> Vec<(Constraint, f64)> {
        let limits = &self.limits;
        let mut found = Vec::new();
        let mut report = |constraint: Constraint, violation: f64| {
            // Written so that NaN counts as violated.
            if !(violation <= tolerance) {
                found.push((constraint, violation));
            }
        };
        for function in ConstraintFunction::all(self) {
            match function {
                ConstraintFunction::Length(member) => {
                    let nodes = function.nodes(self);
                    let length = function.value(limits, &nodes.positions(self, coordinates));
                    let member = self.graph.members()[member];
                    report(Constraint::MinLength { member }, limits.min_length - length);
                    report(Constraint::MaxLength { member }, length - limits.max_length);
                }
                ConstraintFunction::Distance(pair) => {
                    let distance = self.pair_distance(coordinates, pair);
                    report(
                        function.describe(self, true),
                        limits.min_distance - distance,
                    );
                }
                ConstraintFunction::Angle(_) => {}
            }
        }
        for (index, corner) in self.graph.corners().iter().enumerate() {
            let angle = self.corner_angle(coordinates, index);
            let constraint = ConstraintFunction::Angle(*corner).describe(self, false);
            report(constraint, limits.min_angle - angle);
        }
        for node in 0..self.graph.num_nodes() {
            report(
                Constraint::Ground { node },
                -self.dimension.height(coordinates, node),
            );
        }
        if let Some(required) = limits.min_rigidity {
            let spectrum = RigiditySpectrum::at(&self.graph, self.dimension, coordinates);
            report(Constraint::Rigidity, required - spectrum.index());
        }
        found.sort_by(|a, b| b.1.total_cmp(&a.1));
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tetrahedron(height: f64) -> (Robot, Vec<f64>) {
        let robot = Robot::new(
            Graph::complete(4).unwrap(),
            Dimension::Three,
            Limits::default(),
        )
        .unwrap();
        (
            robot,
            vec![
                0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.3, 0.3, height,
            ],
        )
    }

    #[test]
    fn extremes_name_the_members_concerned() {
        let (robot, x) = tetrahedron(0.8);
        let extremes = robot.extremes(&x);
        assert_eq!(robot.graph().members()[extremes.longest.1], [1, 2]);
        assert!((extremes.longest.0 - 2.0_f64.sqrt()).abs() < 1e-15);
        assert_eq!(extremes.lowest, (0.0, 0));
        let (distance, pair) = extremes.closest.unwrap();
        assert!((distance - robot.pair_distance(&x, pair)).abs() < 1e-15);
        assert!(robot.violations(&x, 1e-9).is_empty());
    }

    #[test]
    fn violations_are_measured_and_sorted() {
        let (robot, x) = tetrahedron(0.1);
        let violations = robot.violations(&x, 1e-9);
        assert!(violations.windows(2).all(|pair| pair[0].1 >= pair[1].1));
        let short = Constraint::MinLength { member: [0, 3] };
        let found = violations
            .iter()
            .find(|(constraint, _)| *constraint == short)
            .unwrap();
        assert!((found.1 - (0.5 - 0.19_f64.sqrt())).abs() < 1e-12);
        let (robot, x) = tetrahedron(-0.5);
        assert!(
            robot
                .violations(&x, 1e-9)
                .iter()
                .any(|(c, v)| *c == Constraint::Ground { node: 3 } && *v == 0.5)
        );
    }

    #[test]
    fn masses_are_normalised_and_checked() {
        let (robot, x) = tetrahedron(0.8);
        let heavy = robot.clone().with_masses(&[0.0, 0.0, 0.0, 2.0]).unwrap();
        assert_eq!(heavy.centre_of_mass(&x), Vector3::new(0.3, 0.3, 0.8));
        assert!(matches!(
            robot.clone().with_masses(&[1.0, -1.0, 1.0, 1.0]),
            Err(RobotError::Mass { node: 1, .. })
        ));
        assert!(matches!(
            robot.with_masses(&[1.0]),
            Err(RobotError::MassCount { found: 1, .. })
        ));
    }
}
