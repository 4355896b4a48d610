//! A framework: a graph together with a position of every node.

use nalgebra::{Point2, Point3, Vector3};
use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::Graph;

/// Whether a framework lies in the plane or in space.
///
/// Coordinates are stored node after node in one slice. The last coordinate is the height above
/// the ground. Geometry is done in space for both: a planar node (x, z) is the spatial (x, 0, z).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(into = "usize", try_from = "usize")]
pub enum Dimension {
    /// The plane, d = 2.
    Two,
    /// Space, d = 3.
    Three,
}

impl From<Dimension> for usize {
    fn from(dimension: Dimension) -> Self {
        dimension.axes()
    }
}

impl TryFrom<usize> for Dimension {
    type Error = String;

    fn try_from(axes: usize) -> Result<Self, String> {
        match axes {
            2 => Ok(Self::Two),
            3 => Ok(Self::Three),
            other => Err(format!("the dimension is {other}: it must be 2 or 3")),
        }
    }
}

impl Dimension {
    /// Number of coordinates of a node, d; also the number of nodes that carry a robot.
    #[must_use]
    pub const fn axes(self) -> usize {
        match self {
            Self::Two => 2,
            Self::Three => 3,
        }
    }

    /// Dimension of the group of rigid motions, d (d + 1)/2.
    #[must_use]
    pub const fn rigid_motions(self) -> usize {
        match self {
            Self::Two => 3,
            Self::Three => 6,
        }
    }

    /// Largest rank of the rigidity matrix of `nodes` nodes: d·n − d (d + 1)/2, or all
    /// n (n − 1)/2 distances where n < d.
    #[must_use]
    pub const fn max_rank(self, nodes: usize) -> usize {
        if nodes < self.axes() {
            nodes * nodes.saturating_sub(1) / 2
        } else {
            nodes * self.axes() - self.rigid_motions()
        }
    }

    /// Position of a node.
    #[inline]
    #[must_use]
    pub fn node(self, coordinates: &[f64], node: usize) -> Vector3<f64> {
        match self {
            Self::Two => Vector3::new(coordinates[2 * node], 0.0, coordinates[2 * node + 1]),
            Self::Three => Vector3::new(
                coordinates[3 * node],
                coordinates[3 * node + 1],
                coordinates[3 * node + 2],
            ),
        }
    }

    /// Sets the position of a node.
    #[inline]
    pub fn set_node(self, coordinates: &mut [f64], node: usize, position: &Vector3<f64>) {
        match self {
            Self::Two => {
                coordinates[2 * node] = position.x;
                coordinates[2 * node + 1] = position.z;
            }
            Self::Three => coordinates[3 * node..3 * node + 3].copy_from_slice(position.as_slice()),
        }
    }

    /// Component of a vector along one of the d axes.
    #[inline]
    #[must_use]
    pub fn component(self, vector: &Vector3<f64>, axis: usize) -> f64 {
        match self {
            Self::Two => vector[2 * axis],
            Self::Three => vector[axis],
        }
    }

    /// Height of a node above the ground.
    #[inline]
    #[must_use]
    pub fn height(self, coordinates: &[f64], node: usize) -> f64 {
        coordinates[self.axes() * (node + 1) - 1]
    }
}

/// Length of every member, L (equation (1)), written into `lengths`.
pub(crate) fn member_lengths(
    graph: &Graph,
    dimension: Dimension,
    coordinates: &[f64],
    lengths: &mut [f64],
) {
    for (length, &[a, b]) in lengths.iter_mut().zip(graph.members()) {
        *length = (dimension.node(coordinates, a) - dimension.node(coordinates, b)).norm();
    }
}

/// A graph and a position of each of its nodes.
///
/// # Examples
///
/// ```
/// use nalgebra::Point3;
/// use tensegra_lar::{Framework, Graph};
///
/// let tetrahedron = Framework::in_space(
///     Graph::complete(4)?,
///     &[
///         Point3::new(0.0, 0.0, 0.0),
///         Point3::new(1.0, 0.0, 0.0),
///         Point3::new(0.0, 1.0, 0.0),
///         Point3::new(0.0, 0.0, 1.0),
///     ],
/// )?;
/// assert!((tetrahedron.lengths()[5] - 2.0_f64.sqrt()).abs() < 1e-15);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Framework {
    graph: Graph,
    dimension: Dimension,
    coordinates: Vec<f64>,
}

/// Positions that do not make a framework.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum FrameworkError {
    /// The number of coordinates is not d times the number of nodes.
    #[error(
        "{nodes} nodes in dimension {axes} need {} coordinates, found {found}", .nodes * .axes
    )]
    WrongLength {
        /// Number of nodes of the graph.
        nodes: usize,
        /// Number of coordinates of a node.
        axes: usize,
        /// Number of coordinates found.
        found: usize,
    },
    /// A coordinate is NaN or infinite.
    #[error("coordinate {axis} of node {node} is {value}: give finite numbers")]
    NotFinite {
        /// The node.
        node: usize,
        /// The axis, counted from 0.
        axis: usize,
        /// The value found.
        value: f64,
    },
    /// The ends of a member coincide, so that it has no direction.
    #[error("member {member} between nodes {a} and {b} has length zero: move the nodes apart")]
    ZeroLength {
        /// Index of the member.
        member: usize,
        /// One end.
        a: usize,
        /// The other end.
        b: usize,
    },
}

impl Framework {
    /// A framework from coordinates stored node after node.
    ///
    /// # Errors
    /// See [`FrameworkError`].
    pub fn new(
        graph: Graph,
        dimension: Dimension,
        coordinates: Vec<f64>,
    ) -> Result<Self, FrameworkError> {
        let axes = dimension.axes();
        if coordinates.len() != graph.num_nodes() * axes {
            return Err(FrameworkError::WrongLength {
                nodes: graph.num_nodes(),
                axes,
                found: coordinates.len(),
            });
        }
        if let Some(index) = coordinates.iter().position(|value| !value.is_finite()) {
            return Err(FrameworkError::NotFinite {
                node: index / axes,
                axis: index % axes,
                value: coordinates[index],
            });
        }
        for (member, &[a, b]) in graph.members().iter().enumerate() {
            if dimension.node(&coordinates, a) == dimension.node(&coordinates, b) {
                return Err(FrameworkError::ZeroLength { member, a, b });
            }
        }
        Ok(Self {
            graph,
            dimension,
            coordinates,
        })
    }

    /// A framework in the plane.
    ///
    /// # Errors
    /// See [`FrameworkError`].
    pub fn in_plane(graph: Graph, positions: &[Point2<f64>]) -> Result<Self, FrameworkError> {
        let coordinates = positions.iter().flat_map(|p| [p.x, p.y]).collect();
        Self::new(graph, Dimension::Two, coordinates)
    }

    /// A framework in space.
    ///
    /// # Errors
    /// See [`FrameworkError`].
    pub fn in_space(graph: Graph, positions: &[Point3<f64>]) -> Result<Self, FrameworkError> {
        let coordinates = positions.iter().flat_map(|p| [p.x, p.y, p.z]).collect();
        Self::new(graph, Dimension::Three, coordinates)
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

    /// The coordinates x = (p₁, …, pₙ), node after node.
    #[must_use]
    pub fn coordinates(&self) -> &[f64] {
        &self.coordinates
    }

    /// Position of a node; a planar node (x, z) is given as (x, 0, z).
    #[must_use]
    pub fn position(&self, node: usize) -> Point3<f64> {
        self.dimension.node(&self.coordinates, node).into()
    }

    /// Length of every member, L(x) (equation (1) of Usevitch et al.).
    #[must_use]
    pub fn lengths(&self) -> Vec<f64> {
        let mut lengths = vec![0.0; self.graph.num_members()];
        member_lengths(&self.graph, self.dimension, &self.coordinates, &mut lengths);
        lengths
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn planar_positions_lie_in_the_vertical_plane() {
        let triangle = Framework::in_plane(
            Graph::complete(3).unwrap(),
            &[
                Point2::new(0.0, 0.0),
                Point2::new(3.0, 0.0),
                Point2::new(0.0, 4.0),
            ],
        )
        .unwrap();
        assert_eq!(triangle.lengths(), [3.0, 4.0, 5.0]);
        assert_eq!(triangle.position(2), Point3::new(0.0, 0.0, 4.0));
        assert_eq!(Dimension::Two.height(triangle.coordinates(), 2), 4.0);
    }

    #[test]
    fn bad_positions_are_refused_by_node() {
        let graph = Graph::complete(2).unwrap();
        let error = |coordinates| Framework::new(graph.clone(), Dimension::Two, coordinates);
        assert!(matches!(
            error(vec![0.0; 3]),
            Err(FrameworkError::WrongLength { found: 3, .. })
        ));
        assert!(matches!(
            error(vec![0.0, 0.0, 0.0, f64::NAN]),
            Err(FrameworkError::NotFinite {
                node: 1,
                axis: 1,
                ..
            })
        ));
        assert!(matches!(
            error(vec![1.0, 2.0, 1.0, 2.0]),
            Err(FrameworkError::ZeroLength { member: 0, .. })
        ));
    }
}
