//! The force-density method: shapes from force densities q = t / l, by linear
//! algebra alone (H.-J. Schek, *Computer Methods in Applied Mechanics and
//! Engineering* 3, 1974).
//!
//! With supports, D x = p on the other nodes gives the shape at once. Without, the
//! coordinates are in the null space of D, and the shape is known up to an affine
//! map; a symmetric structure has its symmetric shape among these, the one whose
//! nodes spread alike in all directions.
//!
//! Cost: a factorisation or eigenvalue decomposition of nodes by nodes.

use nalgebra::{DMatrix, DVector, Point3};
use tensegra_model::{Structure, statics::force_density_matrix};

/// Eigenvalues below this fraction of the largest count as zero.
const ZERO: f64 = 1e-9;

/// Why force densities have no shape.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ForceDensityError {
    /// There is not one value for each of what is there.
    #[error("{given} {what} are given, but there are {expected}")]
    WrongCount {
        /// What is counted.
        what: &'static str,
        /// How many are given.
        given: usize,
        /// How many there are.
        expected: usize,
    },
    /// The force densities leave nodes without a place.
    #[error("the force densities determine no place for `{node}`: their matrix is singular")]
    Singular {
        /// A node whose place is open.
        node: String,
    },
    /// The null space has another dimension than a shape needs.
    #[error(
        "the force densities have a null space of dimension {nullity} and a shape needs {needed}: \
         the next eigenvalue is {eigenvalue:.3e} of the largest"
    )]
    Nullity {
        /// Its dimension.
        nullity: usize,
        /// What a shape needs.
        needed: usize,
        /// The first eigenvalue beyond it, or the first needed that is not zero,
        /// relative to the largest.
        eigenvalue: f64,
    },
    /// The other elements do not hold the group together.
    #[error(
        "without the group the force densities must be positive enough to hold all nodes together, \
         and some element of the group must be able to part them"
    )]
    NoCriticalDensity,
}

/// The positions at which force densities, one for each element, carry the loads:
/// supports, and what no force reaches, are where `positions` has them.
///
/// # Errors
/// [`ForceDensityError`] where the densities do not determine them.
///
/// # Examples
/// ```
/// use nalgebra::Point3;
/// use tensegra_formfinding::force_density_positions;
/// use tensegra_model::StructureBuilder;
///
/// let structure = StructureBuilder::planar()
///     .cable("left", ["a", "b"], 0.0..=9.0, 1.0, 0.0)
///     .cable("right", ["b", "c"], 0.0..=9.0, 1.0, 0.0)
///     .support("a")
///     .support("c")
///     .load("b", [0.0, -1.0, 0.0])
///     .build()?;
/// let given = [0.0, 0.0, 4.0].map(|x| Point3::new(x, 0.0, 0.0));
/// let found = force_density_positions(&structure, &[1.0, 3.0], &given)?;
/// assert!((found[1] - Point3::new(3.0, -0.25, 0.0)).norm() < 1e-14);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn force_density_positions(
    structure: &Structure,
    densities: &[f64],
    positions: &[Point3<f64>],
) -> Result<Vec<Point3<f64>>, ForceDensityError> {
    check(structure, densities)?;
    if positions.len() != structure.nodes.len() {
        return Err(ForceDensityError::WrongCount {
            what: "positions",
            given: positions.len(),
            expected: structure.nodes.len(),
        });
    }
    let whole = force_density_matrix(structure, densities);
    let (free, held): (Vec<usize>, Vec<usize>) = (0..structure.nodes.len())
        .partition(|&node| structure.nodes[node].balanced && whole[(node, node)] != 0.0);
    let matrix = DMatrix::from_fn(free.len(), free.len(), |i, j| whole[(free[i], free[j])]);
    let mut found = positions.to_vec();
    let Some(&first) = free.first() else {
        return Ok(found);
    };
    let lu = matrix.full_piv_lu();
    let pivots: Vec<f64> = (0..free.len()).map(|i| lu.u()[(i, i)].abs()).collect();
    let largest = pivots.iter().copied().fold(0.0, f64::max);
    let singular = || ForceDensityError::Singular {
        node: structure.nodes[first].name.clone(),
    };
    if pivots.iter().any(|&pivot| !(pivot > ZERO * largest)) {
        return Err(singular());
    }
    for axis in 0..structure.dimension {
        let right = DVector::from_fn(free.len(), |i, _| {
            let pulls = held
                .iter()
                .map(|&node| whole[(free[i], node)] * positions[node][axis]);
            structure.nodes[free[i]].load[axis] - pulls.sum::<f64>()
        });
        let solution = lu.solve(&right).ok_or_else(singular)?;
        for (&node, &value) in free.iter().zip(solution.iter()) {
            found[node][axis] = value;
        }
    }
    Ok(found)
}

/// The shape of a structure without supports in which force densities, one for
/// each element, are a self-stress: centred, and spread alike in all directions
/// with a sum of squares of one along each. Every affine image will do as well.
///
/// # Errors
/// [`ForceDensityError::Nullity`] where the null space of D is not that of a shape
/// of the structure's dimension d: d + 1.
pub fn free_standing_shape(
    structure: &Structure,
    densities: &[f64],
) -> Result<Vec<Point3<f64>>, ForceDensityError> {
    check(structure, densities)?;
    let eigen = force_density_matrix(structure, densities).symmetric_eigen();
    let size = |i: usize| eigen.eigenvalues[i].abs();
    let mut order: Vec<usize> = (0..structure.nodes.len()).collect();
    order.sort_by(|&i, &j| size(i).total_cmp(&size(j)));
    let largest = order.last().map_or(0.0, |&i| size(i));
    let nullity = order
        .iter()
        .take_while(|&&i| size(i) <= ZERO * largest)
        .count();
    let needed = structure.dimension + 1;
    if nullity != needed {
        let next = order.get(nullity.min(needed));
        return Err(ForceDensityError::Nullity {
            nullity,
            needed,
            eigenvalue: next.map_or(0.0, |&i| size(i) / largest),
        });
    }
    // The null space holds the constant vector; coordinates are orthogonal to it.
    let n = structure.nodes.len();
    let mut columns = DMatrix::zeros(n, needed + 1);
    columns.column_mut(0).fill(1.0);
    for (j, &i) in order[..needed].iter().enumerate() {
        columns
            .column_mut(j + 1)
            .copy_from(&eigen.eigenvectors.column(i));
    }
    let mut coordinates: Vec<DVector<f64>> = Vec::new();
    for column in columns.column_iter() {
        let mut rest = column.normalize();
        for _ in 0..2 {
            for done in &coordinates {
                let share = done.dot(&rest);
                rest.axpy(-share, done, 1.0);
            }
        }
        // One of the vectors of the null space adds nothing to the others.
        if rest.norm() > 1e-6 && coordinates.len() < needed {
            coordinates.push(rest.normalize());
        }
    }
    let at =
        |node: usize, axis: usize| coordinates.get(axis + 1).map_or(0.0, |column| column[node]);
    Ok((0..n)
        .map(|node| {
            Point3::new(
                at(node, 0),
                at(node, 1),
                if needed > 3 { at(node, 2) } else { 0.0 },
            )
        })
        .collect())
}

/// The force density, the same for every element of `group`, at which the
/// force-density matrix of a structure without supports becomes singular beyond
/// translations: those of the others given, it is the greatest compression that
/// leaves the matrix positive semidefinite. What `densities` has for the group does
/// not count.
///
/// With D = D₀ + q D₁ it is q = −1 / μ, μ being the largest eigenvalue of
/// D₁ v = μ D₀ v: no iteration is needed.
///
/// # Errors
/// [`ForceDensityError::NoCriticalDensity`] where D₀ is not positive definite but
/// for translations.
///
/// # Examples
/// The diagonals of a square of cables push with the density with which its sides
/// pull:
/// ```
/// use tensegra_formfinding::critical_force_density;
/// use tensegra_model::StructureBuilder;
///
/// let mut builder = StructureBuilder::planar();
/// for (name, nodes) in [("c1", ["a", "b"]), ("c2", ["b", "c"]), ("c3", ["c", "d"]), ("c4", ["d", "a"])] {
///     builder = builder.cable(name, nodes, 0.0..=9.0, 1.0, 0.0..=1.0);
/// }
/// let structure = builder
///     .strut("s1", ["a", "c"], 1.0)
///     .strut("s2", ["b", "d"], 1.0)
///     .build()?;
/// let q = critical_force_density(&structure, &[1.0, 1.0, 1.0, 1.0, 0.0, 0.0], &[4, 5])?;
/// assert!((q + 1.0).abs() < 1e-14);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn critical_force_density(
    structure: &Structure,
    densities: &[f64],
    group: &[usize],
) -> Result<f64, ForceDensityError> {
    check(structure, densities)?;
    let mut others = densities.to_vec();
    let mut own = vec![0.0; densities.len()];
    for &e in group {
        let (Some(other), Some(own)) = (others.get_mut(e), own.get_mut(e)) else {
            return Err(ForceDensityError::WrongCount {
                what: "elements of the group",
                given: e + 1,
                expected: densities.len(),
            });
        };
        (*other, *own) = (0.0, 1.0);
    }
    let n = structure.nodes.len();
    let mut base = force_density_matrix(structure, &others);
    // Translations are made stiff: they are in the null space of both.
    base.add_scalar_mut(base.diagonal().amax() / n as f64);
    let cholesky = base
        .cholesky()
        .ok_or(ForceDensityError::NoCriticalDensity)?;
    let lower = cholesky.l_dirty();
    let half = lower.solve_lower_triangular(&force_density_matrix(structure, &own));
    let whole = half
        .and_then(|half| lower.solve_lower_triangular(&half.transpose()))
        .ok_or(ForceDensityError::NoCriticalDensity)?;
    let largest = whole.symmetric_eigenvalues().max();
    if !(largest > 0.0) {
        return Err(ForceDensityError::NoCriticalDensity);
    }
    Ok(-1.0 / largest)
}

fn check(structure: &Structure, densities: &[f64]) -> Result<(), ForceDensityError> {
    let (given, expected) = (densities.len(), structure.elements.len());
    if given == expected {
        return Ok(());
    }
    Err(ForceDensityError::WrongCount {
        what: "force densities",
        given,
        expected,
    })
}
