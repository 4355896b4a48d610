//! Rigidity equivalence classes: which configurations a minimally rigid robot can reach without
//! passing a singular one.
//!
//! Source: Usevitch et al., equation (18) and theorem 1. A d-simplex (tetrahedron in space,
//! triangle in the plane) that is a complete subgraph keeps the sign of its volume as long as a
//! minimally rigid framework stays infinitesimally rigid: a flat simplex has a redundant member,
//! and a minimally rigid framework has none to spare. The condition is necessary, not sufficient:
//! equal signs do not prove that a path exists. Cost: O(number of simplices).

use nalgebra::Vector3;

use crate::{Dimension, Framework, Graph, Rigidity};

/// Volume of a simplex of `dimension` + 1 nodes, signed by their order; six times the volume in
/// space, (p₄ − p₁)·((p₃ − p₁) × (p₂ − p₁)) as in equation (18), and twice the area in the plane.
fn signed_volume(dimension: Dimension, coordinates: &[f64], simplex: &[usize]) -> f64 {
    let node = |k: usize| dimension.node(coordinates, simplex[k]);
    let side = |k: usize| -> Vector3<f64> { node(k) - node(0) };
    match dimension {
        Dimension::Two => side(2).cross(&side(1)).y,
        Dimension::Three => side(3).dot(&side(2).cross(&side(1))),
    }
}

/// A simplex with its signed volume in a framework.
#[derive(Debug, Clone, PartialEq)]
pub struct OrientedSimplex {
    /// The nodes, in rising order: four in space, three in the plane.
    pub nodes: Vec<usize>,
    /// Six times the signed volume in space (equation (18)), twice the signed area in the plane.
    pub volume: f64,
}

/// All complete simplices of a framework with their signed volumes.
#[must_use]
pub fn oriented_simplices(framework: &Framework) -> Vec<OrientedSimplex> {
    let dimension = framework.dimension();
    simplices(framework.graph(), dimension)
        .into_iter()
        .map(|nodes| OrientedSimplex {
            volume: signed_volume(dimension, framework.coordinates(), &nodes),
            nodes,
        })
        .collect()
}

fn simplices(graph: &Graph, dimension: Dimension) -> Vec<Vec<usize>> {
    graph.cliques(dimension.axes() + 1)
}

/// What signed volumes say about two configurations of one robot.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum Equivalence {
    /// The configurations lie in different rigidity equivalence classes: any continuous path
    /// between them passes a singular configuration, because this simplex turns inside out.
    Separated {
        /// The nodes of the simplex.
        simplex: Vec<usize>,
    },
    /// No simplex separates them. They may still lie in different classes.
    NotSeparated,
    /// The robot is over-constrained (or not rigid), so that a simplex may turn inside out
    /// without loss of rigidity: signed volumes decide nothing.
    NotApplicable,
}

/// Compares the rigidity equivalence classes of two configurations of one graph by theorem 1.
///
/// # Examples
///
/// ```
/// use nalgebra::Point3;
/// use tensegra_lar::{Equivalence, Framework, Graph, rigidity_equivalence};
///
/// let apex = |height| {
///     let points = [[0., 0., 0.], [1., 0., 0.], [0., 1., 0.], [0., 0., height]];
///     Framework::in_space(Graph::complete(4).unwrap(), &points.map(|[x, y, z]| Point3::new(x, y, z)))
/// };
/// let above = apex(1.0)?;
/// assert_eq!(rigidity_equivalence(&above, apex(0.5)?.coordinates()), Equivalence::NotSeparated);
/// let below = apex(-1.0)?;
/// assert!(matches!(
///     rigidity_equivalence(&above, below.coordinates()),
///     Equivalence::Separated { .. }
/// ));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[must_use]
pub fn rigidity_equivalence(framework: &Framework, other: &[f64]) -> Equivalence {
    if !Rigidity::of(framework).is_minimally_rigid() {
        return Equivalence::NotApplicable;
    }
    let dimension = framework.dimension();
    simplices(framework.graph(), dimension)
        .into_iter()
        .find(|simplex| {
            signed_volume(dimension, framework.coordinates(), simplex)
                * signed_volume(dimension, other, simplex)
                < 0.0
        })
        .map_or(Equivalence::NotSeparated, |simplex| {
            Equivalence::Separated { simplex }
        })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn over_constrained_robots_may_turn_inside_out() {
        let points = |x: f64| {
            vec![
                0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.2, 0.2, 1.0, x, x, 0.4,
            ]
        };
        let k5 =
            Framework::new(Graph::complete(5).unwrap(), Dimension::Three, points(0.2)).unwrap();
        assert_eq!(
            rigidity_equivalence(&k5, &points(2.0)),
            Equivalence::NotApplicable
        );
        assert_eq!(oriented_simplices(&k5).len(), 5);
    }

    #[test]
    fn planar_triangles_keep_their_orientation() {
        let rhombus = Graph::new(4, [[0, 1], [1, 2], [2, 3], [3, 0], [0, 2]]).unwrap();
        let open = vec![0.0, 0.0, 1.0, -1.0, 2.0, 0.0, 1.0, 1.0];
        let folded = [0.0, 0.0, 1.0, 0.5, 2.0, 0.0, 1.0, 1.0];
        let rhombus = Framework::new(rhombus, Dimension::Two, open).unwrap();
        assert_eq!(
            rigidity_equivalence(&rhombus, &folded),
            Equivalence::Separated {
                simplex: vec![0, 1, 2]
            }
        );
        let simplices = oriented_simplices(&rhombus);
        assert_eq!(simplices.len(), 2);
        assert!(simplices[0].volume * simplices[1].volume > 0.0);
    }

    #[test]
    fn volume_of_the_unit_corner_has_the_sign_of_equation_18() {
        let corner = vec![0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];
        let tetrahedron =
            Framework::new(Graph::complete(4).unwrap(), Dimension::Three, corner).unwrap();
        // (p4 − p1)·((p3 − p1) × (p2 − p1)) = ẑ·(ŷ × x̂) = −1.
        assert_eq!(oriented_simplices(&tetrahedron)[0].volume, -1.0);
    }
}
