//! Infinitesimal rigidity of a framework: the rigidity matrix, its rank, mechanisms and redundant
//! members, and the generic rigidity of a graph.
//!
//! Source: Usevitch, Hammond and Schwager, "Locomotion of linear actuator robots through kinematic
//! planning and nonlinear optimization", section II; Asimow and Roth (1978) and Gluck (1975) for
//! the theory. Cost: one singular value decomposition of an n_L × d·n matrix.

use nalgebra::{DMatrix, DVector, SymmetricEigen};
use rand::{Rng, RngExt};

use crate::{Dimension, Framework, Graph};

/// Singular values below this fraction of the largest count as zero.
const RANK_TOLERANCE: f64 = 1e-9;

/// How the rows of a rigidity matrix are scaled.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum RowScaling {
    /// Rows hold pᵢ − pⱼ: the standard rigidity matrix of the mathematical literature. It maps
    /// node velocities to half the rate of change of the squared lengths.
    Standard,
    /// Rows hold the unit vector (pᵢ − pⱼ)/L: the matrix R of equation (3). It maps node
    /// velocities to the rates of change of the lengths.
    UnitLength,
}

/// The rigidity matrix of a framework, n_L × d·n; row k belongs to member k.
///
/// # Examples
///
/// ```
/// use nalgebra::Point2;
/// use tensegra_lar::{Framework, Graph, RowScaling, rigidity_matrix};
///
/// let bar = Framework::in_plane(
///     Graph::complete(2)?,
///     &[Point2::new(0.0, 0.0), Point2::new(2.0, 0.0)],
/// )?;
/// let standard = rigidity_matrix(&bar, RowScaling::Standard);
/// assert_eq!(standard.as_slice(), [-2.0, 0.0, 2.0, 0.0]);
/// let scaled = rigidity_matrix(&bar, RowScaling::UnitLength);
/// assert_eq!(scaled.as_slice(), [-1.0, 0.0, 1.0, 0.0]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[must_use]
pub fn rigidity_matrix(framework: &Framework, scaling: RowScaling) -> DMatrix<f64> {
    let (graph, dimension) = (framework.graph(), framework.dimension());
    let axes = dimension.axes();
    let mut matrix = DMatrix::zeros(graph.num_members(), graph.num_nodes() * axes);
    for (row, &[a, b]) in graph.members().iter().enumerate() {
        let mut difference =
            dimension.node(framework.coordinates(), a) - dimension.node(framework.coordinates(), b);
        if scaling == RowScaling::UnitLength {
            difference /= difference.norm();
        }
        for axis in 0..axes {
            let entry = dimension.component(&difference, axis);
            matrix[(row, a * axes + axis)] = entry;
            matrix[(row, b * axes + axis)] = -entry;
        }
    }
    matrix
}

/// An orthonormal basis of the rigid velocities of a framework (translations and rotations),
/// one column each.
pub(crate) fn rigid_motion_basis(
    dimension: Dimension,
    nodes: usize,
    coordinates: &[f64],
) -> DMatrix<f64> {
    let axes = dimension.axes();
    let mut basis = DMatrix::zeros(nodes * axes, dimension.rigid_motions());
    let mut centre = [0.0; 3];
    for node in 0..nodes {
        for axis in 0..axes {
            centre[axis] += coordinates[node * axes + axis] / nodes as f64;
        }
    }
    let mut column = axes;
    for axis in 0..axes {
        basis
            .column_mut(axis)
            .iter_mut()
            .skip(axis)
            .step_by(axes)
            .for_each(|entry| *entry = 1.0);
        for other in axis + 1..axes {
            for node in 0..nodes {
                basis[(node * axes + axis, column)] =
                    -(coordinates[node * axes + other] - centre[other]);
                basis[(node * axes + other, column)] =
                    coordinates[node * axes + axis] - centre[axis];
            }
            column += 1;
        }
    }
    // Modified Gram–Schmidt; a rotation that moves no node (collinear points) is left zero.
    for column in 0..basis.ncols() {
        for earlier in 0..column {
            let overlap = basis.column(earlier).dot(&basis.column(column));
            let projection = basis.column(earlier) * overlap;
            basis
                .column_mut(column)
                .zip_apply(&projection, |entry, p| *entry -= p);
        }
        let norm = basis.column(column).norm();
        if norm > 1e-12 {
            basis.column_mut(column).unscale_mut(norm);
        } else {
            basis.column_mut(column).fill(0.0);
        }
    }
    basis
}

/// What the rank of the rigidity matrix says about a framework.
///
/// # Examples
///
/// A square without diagonal is a mechanism; one diagonal makes it minimally rigid:
///
/// ```
/// use nalgebra::Point2;
/// use tensegra_lar::{Framework, Graph, Rigidity};
///
/// let corners = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)].map(|(x, y)| Point2::new(x, y));
/// let sides = [[0, 1], [1, 2], [2, 3], [3, 0]];
/// let square = Framework::in_plane(Graph::new(4, sides)?, &corners)?;
/// assert_eq!(Rigidity::of(&square).num_mechanisms(), 1);
///
/// let braced = Graph::new(4, sides.into_iter().chain([[0, 2]]))?;
/// let braced = Framework::in_plane(braced, &corners)?;
/// assert!(Rigidity::of(&braced).is_minimally_rigid());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Rigidity {
    rank: usize,
    max_rank: usize,
    mechanisms: Vec<DVector<f64>>,
    self_stresses: Vec<DVector<f64>>,
    axes: usize,
}

impl Rigidity {
    /// Analyses a framework.
    #[must_use]
    pub fn of(framework: &Framework) -> Self {
        let dimension = framework.dimension();
        let nodes = framework.graph().num_nodes();
        let matrix = rigidity_matrix(framework, RowScaling::UnitLength);
        let rank = numerical_rank(&matrix);
        let max_rank = dimension.max_rank(nodes);

        let flexes = max_rank - rank.min(max_rank);
        let mechanisms = if flexes == 0 {
            Vec::new()
        } else {
            let basis = rigid_motion_basis(dimension, nodes, framework.coordinates());
            let gram = matrix.tr_mul(&matrix) + &basis * basis.transpose();
            smallest_eigenvectors(gram, flexes)
        };
        let stresses = matrix.nrows() - rank;
        let self_stresses = if stresses == 0 {
            Vec::new()
        } else {
            smallest_eigenvectors(&matrix * matrix.transpose(), stresses)
        };
        Self {
            rank,
            max_rank,
            mechanisms,
            self_stresses,
            axes: dimension.axes(),
        }
    }

    /// Rank of the rigidity matrix.
    #[must_use]
    pub fn rank(&self) -> usize {
        self.rank
    }

    /// Largest rank that the rigidity matrix of as many nodes can have, 3n − 6 in space.
    #[must_use]
    pub fn max_rank(&self) -> usize {
        self.max_rank
    }

    /// Whether every velocity that keeps all lengths to first order is a rigid motion.
    #[must_use]
    pub fn is_infinitesimally_rigid(&self) -> bool {
        self.rank == self.max_rank
    }

    /// Whether the framework is infinitesimally rigid and loses this with any of its members.
    #[must_use]
    pub fn is_minimally_rigid(&self) -> bool {
        self.is_infinitesimally_rigid() && self.self_stresses.is_empty()
    }

    /// Number of independent velocities, besides the rigid motions, that keep all lengths.
    #[must_use]
    pub fn num_mechanisms(&self) -> usize {
        self.mechanisms.len()
    }

    /// An orthonormal basis of the velocities, besides the rigid motions, that keep all lengths.
    #[must_use]
    pub fn mechanisms(&self) -> &[DVector<f64>] {
        &self.mechanisms
    }

    /// Number of independent self-stresses, n_L − rank.
    #[must_use]
    pub fn num_self_stresses(&self) -> usize {
        self.self_stresses.len()
    }

    /// Members that may be removed one at a time without loss of rank: those that take part in a
    /// self-stress.
    #[must_use]
    pub fn redundant_members(&self) -> Vec<usize> {
        let members = self.self_stresses.first().map_or(0, DVector::len);
        (0..members)
            .filter(|&member| self.self_stresses.iter().any(|s| s[member].abs() > 1e-7))
            .collect()
    }

    /// Nodes that a mechanism moves, those that it moves most first: where to add members.
    #[must_use]
    pub fn loose_nodes(&self) -> Vec<usize> {
        let nodes = self.mechanisms.first().map_or(0, |m| m.len() / self.axes);
        let mut speeds: Vec<(usize, f64)> = (0..nodes)
            .map(|node| {
                let squares: f64 = self
                    .mechanisms
                    .iter()
                    .map(|m| m.rows(node * self.axes, self.axes).norm_squared())
                    .sum();
                (node, squares.sqrt())
            })
            .filter(|&(_, speed)| speed > 1e-6)
            .collect();
        speeds.sort_by(|a, b| b.1.total_cmp(&a.1));
        speeds.into_iter().map(|(node, _)| node).collect()
    }
}

/// Number of singular values above [`RANK_TOLERANCE`] times the largest.
fn numerical_rank(matrix: &DMatrix<f64>) -> usize {
    let singular = matrix.singular_values();
    let largest = singular.max();
    singular
        .iter()
        .filter(|&&value| value > RANK_TOLERANCE * largest)
        .count()
}

/// Eigenvectors of the `count` smallest eigenvalues of a symmetric matrix.
fn smallest_eigenvectors(matrix: DMatrix<f64>, count: usize) -> Vec<DVector<f64>> {
    let eigen = SymmetricEigen::new(matrix);
    let mut order: Vec<usize> = (0..eigen.eigenvalues.len()).collect();
    order.sort_by(|&a, &b| eigen.eigenvalues[a].total_cmp(&eigen.eigenvalues[b]));
    order[..count]
        .iter()
        .map(|&column| eigen.eigenvectors.column(column).into_owned())
        .collect()
}

/// Whether almost every placement of a graph's nodes is infinitesimally rigid.
///
/// A graph that is infinitesimally rigid somewhere is so almost everywhere (Gluck, 1975), hence
/// the rank at a random placement decides, with probability one; the largest rank of three
/// placements guards against an unlucky one.
#[must_use]
pub fn is_generically_rigid(graph: &Graph, dimension: Dimension, rng: &mut impl Rng) -> bool {
    generic_rank(graph, dimension, rng) == dimension.max_rank(graph.num_nodes())
}

/// Whether a graph is generically rigid and loses this with any of its members: d·n − d (d + 1)/2
/// members, all independent at almost every placement (a Laman graph in the plane).
#[must_use]
pub fn is_generically_minimally_rigid(
    graph: &Graph,
    dimension: Dimension,
    rng: &mut impl Rng,
) -> bool {
    graph.num_members() == dimension.max_rank(graph.num_nodes())
        && is_generically_rigid(graph, dimension, rng)
}

/// Largest rank of the rigidity matrix over three random placements of the nodes.
fn generic_rank(graph: &Graph, dimension: Dimension, rng: &mut impl Rng) -> usize {
    let size = graph.num_nodes() * dimension.axes();
    (0..3)
        .filter_map(|_| {
            let coordinates = (0..size).map(|_| rng.random_range(-1.0..1.0)).collect();
            Framework::new(graph.clone(), dimension, coordinates).ok()
        })
        .map(|framework| numerical_rank(&rigidity_matrix(&framework, RowScaling::UnitLength)))
        .max()
        .unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use nalgebra::{Point3, Rotation3, Vector3};
    use rand::SeedableRng;
    use rand_pcg::Pcg64;

    use super::*;

    fn octahedron() -> Framework {
        let axis = |x, y, z| Point3::new(x, y, z);
        Framework::in_space(
            Graph::octahedron(),
            &[
                axis(1.0, 0.0, 0.0),
                axis(0.0, 1.0, 0.0),
                axis(0.0, 0.0, 1.0),
                axis(-1.0, 0.0, 0.0),
                axis(0.0, -1.0, 0.0),
                axis(0.0, 0.0, -1.0),
            ],
        )
        .unwrap()
    }

    #[test]
    fn the_octahedron_is_minimally_rigid_and_loses_it_with_a_member() {
        let rigidity = Rigidity::of(&octahedron());
        assert_eq!((rigidity.rank(), rigidity.max_rank()), (12, 12));
        assert!(rigidity.is_minimally_rigid());

        let fewer = Graph::new(6, octahedron().graph().members()[1..].iter().copied()).unwrap();
        let fewer =
            Framework::new(fewer, Dimension::Three, octahedron().coordinates().to_vec()).unwrap();
        let rigidity = Rigidity::of(&fewer);
        assert_eq!(rigidity.num_mechanisms(), 1);
        let flex = &rigidity.mechanisms()[0];
        assert!((rigidity_matrix(&fewer, RowScaling::Standard) * flex).norm() < 1e-10);
        assert!(!rigidity.loose_nodes().is_empty());
    }

    #[test]
    fn four_nodes_in_a_plane_lose_one_rank_in_space() {
        let square = [(0.0, 0.0), (1.0, 0.0), (1.1, 1.0), (0.0, 0.9)];
        let points = square.map(|(x, y)| Point3::new(x, y, 0.3 * x - 0.2 * y));
        let flat = Framework::in_space(Graph::complete(4).unwrap(), &points).unwrap();
        let rigidity = Rigidity::of(&flat);
        assert_eq!(rigidity.rank(), 5);
        assert_eq!(rigidity.num_self_stresses(), 1);
        assert_eq!(rigidity.redundant_members(), [0, 1, 2, 3, 4, 5]);
    }

    #[test]
    fn complete_graphs_are_over_constrained() {
        let points = [
            (0.0, 0.0, 0.0),
            (1.0, 0.1, 0.0),
            (0.2, 1.0, 0.1),
            (0.1, 0.2, 1.0),
            (0.4, 0.5, 0.3),
        ];
        let k5 = Framework::in_space(
            Graph::complete(5).unwrap(),
            &points.map(|(x, y, z)| Point3::new(x, y, z)),
        )
        .unwrap();
        let rigidity = Rigidity::of(&k5);
        assert!(rigidity.is_infinitesimally_rigid() && !rigidity.is_minimally_rigid());
        assert_eq!(rigidity.num_self_stresses(), 1);
        assert_eq!(rigidity.redundant_members().len(), 10);
    }

    #[test]
    fn scaled_rows_give_length_rates_and_rigid_motions_give_none() {
        let framework = octahedron();
        let moved = |time: f64| -> Vec<f64> {
            let rotation = Rotation3::new(time * Vector3::new(0.3, -0.2, 0.5));
            (0..6)
                .flat_map(|node| {
                    let p = rotation * framework.position(node);
                    [p.x + time, p.y, p.z - 2.0 * time]
                })
                .collect()
        };
        let step = 1e-6;
        let (ahead, behind) = (moved(step), moved(-step));
        let velocity = DVector::from_iterator(
            18,
            ahead
                .iter()
                .zip(&behind)
                .map(|(a, b)| (a - b) / (2.0 * step)),
        );
        for scaling in [RowScaling::Standard, RowScaling::UnitLength] {
            assert!((rigidity_matrix(&framework, scaling) * &velocity).norm() < 1e-9);
        }
        let basis = rigid_motion_basis(Dimension::Three, 6, framework.coordinates());
        assert!((basis.tr_mul(&basis) - DMatrix::identity(6, 6)).norm() < 1e-12);
        assert!((&basis * basis.tr_mul(&velocity) - &velocity).norm() < 1e-8);
    }

    #[test]
    fn generic_rigidity_of_known_graphs() {
        let mut rng = Pcg64::seed_from_u64(7);
        let k5 = Graph::complete(5).unwrap();
        let octahedron = Graph::octahedron();
        assert!(is_generically_rigid(&k5, Dimension::Three, &mut rng));
        assert!(!is_generically_minimally_rigid(
            &k5,
            Dimension::Three,
            &mut rng
        ));
        assert!(is_generically_minimally_rigid(
            &octahedron,
            Dimension::Three,
            &mut rng
        ));
        // The "double banana": 18 = 3·8 − 6 members, yet the two halves turn about nodes 0 and 1.
        let mut members = Vec::new();
        for banana in [[2, 3, 4], [5, 6, 7]] {
            let [a, b, c] = banana;
            members.extend([[a, b], [b, c], [c, a]]);
            members.extend(banana.iter().flat_map(|&node| [[0, node], [1, node]]));
        }
        let bananas = Graph::new(8, members).unwrap();
        assert_eq!(bananas.num_members(), 18);
        assert!(!is_generically_rigid(&bananas, Dimension::Three, &mut rng));
    }
}
