//! States of self-stress and mechanisms, from the equilibrium matrix alone.

use nalgebra::DMatrix;

use super::{
    EquilibriumMatrix,
    basis::{complement, span},
};
use nalgebra::Point3;

/// Singular values of the equilibrium matrix below this fraction of the largest
/// count as zero, unless stated otherwise: well above rounding, well below what a
/// structure shows that is not about to become singular.
pub const RANK_TOLERANCE: f64 = 1e-8;

/// What the equilibrium matrix of e elements and n freedoms, of rank r, says of a
/// structure whose elements are taken as rigid: s = e − r states of self-stress,
/// and m = n − r − (rigid motions) infinitesimal mechanisms.
///
/// # Examples
/// A square with both diagonals can be prestressed in one way and is rigid:
/// ```
/// use nalgebra::Point3;
/// use tensegra_model::{StructureBuilder, statics::{EquilibriumMatrix, MatrixAnalysis}};
///
/// let structure = StructureBuilder::planar()
///     .bar("north", ["c", "d"], 1.0)
///     .bar("south", ["a", "b"], 1.0)
///     .bar("west", ["a", "d"], 1.0)
///     .bar("east", ["b", "c"], 1.0)
///     .bar("up", ["a", "c"], 2f64.sqrt())
///     .bar("down", ["d", "b"], 2f64.sqrt())
///     .build()?;
/// let corner = |name: &str| match name {
///     "a" => Point3::new(0.0, 0.0, 0.0),
///     "b" => Point3::new(1.0, 0.0, 0.0),
///     "c" => Point3::new(1.0, 1.0, 0.0),
///     _ => Point3::new(0.0, 1.0, 0.0),
/// };
/// let positions: Vec<_> = structure.nodes.iter().map(|node| corner(&node.name)).collect();
/// let matrix = EquilibriumMatrix::new(&structure, &positions)?;
/// let analysis = MatrixAnalysis::new(&matrix, &positions);
/// assert_eq!((analysis.rank, analysis.self_stress.ncols(), analysis.mechanisms.ncols()), (5, 1, 0));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct MatrixAnalysis {
    /// Rank r of the equilibrium matrix.
    pub rank: usize,
    /// Its singular values, descending.
    pub singular_values: Vec<f64>,
    /// Orthonormal states of self-stress (forces): a column each, over the
    /// elements of the matrix.
    pub self_stress: DMatrix<f64>,
    /// Orthonormal infinitesimal mechanisms, free of rigid motions: a column each,
    /// over the freedoms.
    pub mechanisms: DMatrix<f64>,
    /// Orthonormal rigid motions that the supports leave: a column each, over the
    /// freedoms.
    pub rigid_motions: DMatrix<f64>,
}

impl MatrixAnalysis {
    /// Analyses the equilibrium matrix at the positions that it was made for.
    /// Cost: a singular value decomposition, some 10 n e min(n, e).
    pub fn new(matrix: &EquilibriumMatrix, positions: &[Point3<f64>]) -> Self {
        Self::with_tolerance(matrix, positions, RANK_TOLERANCE)
    }

    /// The same, where singular values below `tolerance` times the largest count as
    /// zero: for positions that are known to so many digits only.
    pub fn with_tolerance(
        matrix: &EquilibriumMatrix,
        positions: &[Point3<f64>],
        tolerance: f64,
    ) -> Self {
        let rigid_motions = matrix.freedoms().rigid_motions(positions);
        let (n, e) = matrix.matrix().shape();
        if n == 0 || e == 0 {
            let mechanisms = complement(&rigid_motions);
            return Self {
                rank: 0,
                singular_values: Vec::new(),
                self_stress: DMatrix::identity(e, e),
                mechanisms,
                rigid_motions,
            };
        }
        let (singular_values, right) = decompose(matrix.matrix());
        let largest = singular_values.first().copied().unwrap_or(0.0);
        let rank = singular_values
            .iter()
            .take_while(|&&value| value > tolerance * largest)
            .count();
        let self_stress = complement(&right.columns(0, rank).into_owned());
        // What forces can balance, and rigid motions; these are orthogonal, but
        // for rounding.
        let mut others = DMatrix::zeros(n, rank + rigid_motions.ncols());
        for (i, value) in singular_values[..rank].iter().enumerate() {
            // Not the left singular vectors, which lose digits where values repeat, as they
            // do in symmetric structures.
            let balanced = matrix.matrix() * right.column(i) / *value;
            others.set_column(i, &balanced);
        }
        others
            .columns_mut(rank, rigid_motions.ncols())
            .copy_from(&rigid_motions);
        let mechanisms = complement(&span(others, 1e-6));
        Self {
            rank,
            singular_values,
            self_stress,
            mechanisms,
            rigid_motions,
        }
    }

    /// The smallest singular value that counts and the largest that does not, as
    /// fractions of the largest: how clear-cut the rank is.
    pub fn gap(&self) -> (f64, f64) {
        let largest = self.singular_values.first().copied().unwrap_or(1.0);
        let relative = |index: Option<usize>| {
            let value = index.and_then(|i| self.singular_values.get(i));
            value.map_or(0.0, |value| value / largest)
        };
        (
            relative(self.rank.checked_sub(1)),
            relative(Some(self.rank)),
        )
    }
}

/// Singular values in descending order, right singular vectors; thin.
fn decompose(matrix: &DMatrix<f64>) -> (Vec<f64>, DMatrix<f64>) {
    let svd = matrix.clone().svd(false, true);
    let values = svd.singular_values;
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|&i, &j| values[j].total_cmp(&values[i]));
    // They are there because they were asked for.
    let right = svd
        .v_t
        .unwrap_or_default()
        .transpose()
        .select_columns(&order);
    (order.iter().map(|&i| values[i]).collect(), right)
}
