//! The graph of a linear-actuator robot: nodes joined by members.
//!
//! Pairs of members that could collide and pairs that meet at an angle are enumerated once, when
//! the graph is built. Cost: O(m²) for m members.

use thiserror::Error;

/// More members than this would make pairs of members too many to watch. Files with more are
/// refused.
pub(crate) const MOST_MEMBERS: usize = 2000;

/// Which nodes are joined by members (linear actuators).
///
/// # Examples
///
/// ```
/// use tensegra_lar::Graph;
///
/// let octahedron = Graph::octahedron();
/// assert_eq!(octahedron.num_members(), 12);
/// assert_eq!(octahedron.disjoint_pairs().len(), 30);
/// assert_eq!(octahedron.corners().len(), 36);
/// ```
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Graph {
    nodes: usize,
    members: Vec<[usize; 2]>,
    degrees: Vec<usize>,
    disjoint_pairs: Vec<[usize; 2]>,
    corners: Vec<Corner>,
}

/// Two members that meet at a node and so enclose an angle.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Corner {
    /// The shared node.
    pub node: usize,
    /// The other ends of the two members, smaller index first.
    pub ends: [usize; 2],
}

/// A list of members that is not the graph of a robot.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum GraphError {
    /// A member ends at a node that does not exist.
    #[error("member {member} joins nodes {a} and {b}, but the nodes are numbered 0 to {last}")]
    NodeOutOfRange {
        /// Index of the member.
        member: usize,
        /// One end.
        a: usize,
        /// The other end.
        b: usize,
        /// The largest node index.
        last: usize,
    },
    /// A member joins a node to itself.
    #[error("member {member} joins node {node} to itself: a member needs two different ends")]
    Loop {
        /// Index of the member.
        member: usize,
        /// The node.
        node: usize,
    },
    /// Two members join the same nodes.
    #[error("members {first} and {second} both join nodes {a} and {b}: remove one of them")]
    Duplicate {
        /// Index of the first member.
        first: usize,
        /// Index of the second member.
        second: usize,
        /// One end.
        a: usize,
        /// The other end.
        b: usize,
    },
    /// A node without any member.
    #[error("node {node} has no member: join it to the others or remove it")]
    FreeNode {
        /// The node.
        node: usize,
    },
    /// Fewer than two nodes.
    #[error("a graph needs at least two nodes, found {found}")]
    TooSmall {
        /// Number of nodes found.
        found: usize,
    },
}

impl Graph {
    /// The graph with `nodes` nodes and the given members.
    ///
    /// # Errors
    /// See [`GraphError`]: loops, double members, free nodes and indices out of range are refused.
    pub fn new(
        nodes: usize,
        members: impl IntoIterator<Item = [usize; 2]>,
    ) -> Result<Self, GraphError> {
        if nodes < 2 {
            return Err(GraphError::TooSmall { found: nodes });
        }
        let members: Vec<[usize; 2]> = members.into_iter().collect();
        let mut degrees = vec![0; nodes];
        for (member, &[a, b]) in members.iter().enumerate() {
            if a >= nodes || b >= nodes {
                let last = nodes - 1;
                return Err(GraphError::NodeOutOfRange { member, a, b, last });
            }
            if a == b {
                return Err(GraphError::Loop { member, node: a });
            }
            let same = |other: &[usize; 2]| *other == [a, b] || *other == [b, a];
            if let Some(first) = members[..member].iter().position(same) {
                let second = member;
                return Err(GraphError::Duplicate {
                    first,
                    second,
                    a,
                    b,
                });
            }
            degrees[a] += 1;
            degrees[b] += 1;
        }
        if let Some(node) = degrees.iter().position(|&degree| degree == 0) {
            return Err(GraphError::FreeNode { node });
        }

        let mut disjoint_pairs = Vec::new();
        let mut corners = Vec::new();
        for (first, &[a, b]) in members.iter().enumerate() {
            for (offset, &[c, d]) in members[first + 1..].iter().enumerate() {
                let corner = |node, p: usize, q: usize| Corner {
                    node,
                    ends: [p.min(q), p.max(q)],
                };
                if a == c {
                    corners.push(corner(a, b, d));
                } else if a == d {
                    corners.push(corner(a, b, c));
                } else if b == c {
                    corners.push(corner(b, a, d));
                } else if b == d {
                    corners.push(corner(b, a, c));
                } else {
                    disjoint_pairs.push([first, first + 1 + offset]);
                }
            }
        }
        Ok(Self {
            nodes,
            members,
            degrees,
            disjoint_pairs,
            corners,
        })
    }

    /// The complete graph on `nodes` nodes; `complete(5)` is the K5 of the literature.
    ///
    /// # Errors
    /// Fewer than two nodes.
    pub fn complete(nodes: usize) -> Result<Self, GraphError> {
        Self::new(
            nodes,
            (0..nodes).flat_map(|a| (a + 1..nodes).map(move |b| [a, b])),
        )
    }

    /// The octahedron: six nodes, each joined to all but its antipode; the antipodes are
    /// (0, 3), (1, 4) and (2, 5).
    #[must_use]
    pub fn octahedron() -> Self {
        let members =
            (0..6).flat_map(|a| (a + 1..6).filter(move |b| b - a != 3).map(move |b| [a, b]));
        Self::new(6, members).expect("the octahedron has no loops, double members or free nodes")
    }

    /// Number of nodes n.
    #[must_use]
    pub fn num_nodes(&self) -> usize {
        self.nodes
    }

    /// Number of members n_L.
    #[must_use]
    pub fn num_members(&self) -> usize {
        self.members.len()
    }

    /// The two ends of each member.
    #[must_use]
    pub fn members(&self) -> &[[usize; 2]] {
        &self.members
    }

    /// Number of members at each node (the degree g of the node).
    #[must_use]
    pub fn degrees(&self) -> &[usize] {
        &self.degrees
    }

    /// Index of the member between two nodes, if there is one.
    #[must_use]
    pub fn member_between(&self, a: usize, b: usize) -> Option<usize> {
        self.members
            .iter()
            .position(|&[p, q]| [p, q] == [a, b] || [q, p] == [a, b])
    }

    /// Pairs of members that share no node, smaller index first: those that could collide.
    ///
    /// There are (n_L² − n_L)/2 − Σ (gᵢ² − gᵢ)/2 of them (equation (13) of Usevitch et al.).
    #[must_use]
    pub fn disjoint_pairs(&self) -> &[[usize; 2]] {
        &self.disjoint_pairs
    }

    /// Pairs of members that share a node.
    ///
    /// There are −n_L + ½ Σ gᵢ² of them (equation (15) of Usevitch et al.).
    #[must_use]
    pub fn corners(&self) -> &[Corner] {
        &self.corners
    }

    /// All sets of `size` nodes that are joined completely (cliques), each in rising order:
    /// triangles for 3, tetrahedra (3-simplices) for 4.
    #[must_use]
    pub fn cliques(&self, size: usize) -> Vec<Vec<usize>> {
        let mut cliques: Vec<Vec<usize>> = (0..self.nodes).map(|node| vec![node]).collect();
        if size == 0 {
            return Vec::new();
        }
        for _ in 1..size {
            cliques = cliques
                .iter()
                .flat_map(|clique| {
                    let last = clique[clique.len() - 1];
                    (last + 1..self.nodes)
                        .filter(|&node| {
                            clique
                                .iter()
                                .all(|&other| self.member_between(other, node).is_some())
                        })
                        .map(|node| {
                            let mut larger = clique.clone();
                            larger.push(node);
                            larger
                        })
                })
                .collect();
        }
        cliques
    }

    /// Whether renaming node i to `images[i]` maps members onto members (a graph automorphism).
    #[must_use]
    pub fn is_automorphism(&self, images: &[usize]) -> bool {
        let mut seen = vec![false; self.nodes];
        images.len() == self.nodes
            && images
                .iter()
                .all(|&image| image < self.nodes && !std::mem::replace(&mut seen[image], true))
            && self
                .members
                .iter()
                .all(|&[a, b]| self.member_between(images[a], images[b]).is_some())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Equations (13) and (15), counted from the degrees.
    fn counts(graph: &Graph) -> (usize, usize) {
        let members = graph.num_members();
        let squares: usize = graph.degrees().iter().map(|g| g * g).sum();
        let meeting: usize = graph.degrees().iter().map(|g| (g * g - g) / 2).sum();
        (
            (members * members - members) / 2 - meeting,
            squares / 2 - members,
        )
    }

    #[test]
    fn pairs_and_corners_agree_with_the_counting_formulas() {
        for (graph, pairs, corners) in [
            (Graph::complete(5).unwrap(), 15, 30),
            (Graph::octahedron(), 30, 36),
            (Graph::complete(4).unwrap(), 3, 12),
        ] {
            assert_eq!(graph.disjoint_pairs().len(), pairs);
            assert_eq!(graph.corners().len(), corners);
            assert_eq!(counts(&graph), (pairs, corners));
        }
    }

    #[test]
    fn lists_that_are_no_robot_are_refused_by_name() {
        assert_eq!(
            Graph::new(3, [[0, 1], [1, 3]]),
            Err(GraphError::NodeOutOfRange {
                member: 1,
                a: 1,
                b: 3,
                last: 2
            })
        );
        assert_eq!(
            Graph::new(3, [[0, 1], [2, 2]]),
            Err(GraphError::Loop { member: 1, node: 2 })
        );
        assert_eq!(
            Graph::new(3, [[0, 1], [1, 2], [1, 0]]),
            Err(GraphError::Duplicate {
                first: 0,
                second: 2,
                a: 1,
                b: 0
            })
        );
        assert_eq!(
            Graph::new(4, [[0, 1], [1, 2], [2, 0]]),
            Err(GraphError::FreeNode { node: 3 })
        );
        assert_eq!(Graph::new(1, []), Err(GraphError::TooSmall { found: 1 }));
    }

    #[test]
    fn cliques_of_k5_and_the_octahedron() {
        let k5 = Graph::complete(5).unwrap();
        assert_eq!(k5.cliques(3).len(), 10);
        assert_eq!(k5.cliques(4).len(), 5);
        assert_eq!(Graph::octahedron().cliques(3).len(), 8);
        assert!(Graph::octahedron().cliques(4).is_empty());
    }

    #[test]
    fn automorphisms_keep_members() {
        let octahedron = Graph::octahedron();
        assert!(octahedron.is_automorphism(&[1, 2, 3, 4, 5, 0]));
        assert!(!octahedron.is_automorphism(&[1, 0, 2, 3, 4, 5]));
        assert!(!octahedron.is_automorphism(&[0, 0, 2, 3, 4, 5]));
    }
}
