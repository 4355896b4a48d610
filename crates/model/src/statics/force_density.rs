//! Force densities q = t / l, with which equilibrium is linear in positions.

use nalgebra::DMatrix;

use crate::{configuration::Configuration, structure::Structure};

/// The force density of every element of a configuration, 0 where it carries no
/// force or has no length; force per length.
pub fn force_densities(configuration: &Configuration) -> Vec<f64> {
    let forces = configuration.forces.iter().zip(&configuration.lengths);
    forces
        .map(|(force, length)| match force {
            Some(force) if *length > 0.0 => force / length,
            _ => 0.0,
        })
        .collect()
}

/// The force-density matrix D, nodes by nodes: D x, D y, D z are the loads that
/// hold the nodes in equilibrium (Schek 1974). D = Cᵀ diag(q) C with the incidence
/// matrix C; a weighted Laplacian, the weights being of both signs.
///
/// # Panics
/// If there is not one force density for each element.
///
/// # Examples
/// ```
/// use tensegra_model::{StructureBuilder, statics::force_density_matrix};
/// let structure = StructureBuilder::planar()
///     .cable("left", ["a", "b"], 0.0..=9.0, 1.0, 1.0)
///     .cable("right", ["b", "c"], 0.0..=9.0, 1.0, 1.0)
///     .build()?;
/// let matrix = force_density_matrix(&structure, &[2.0, 3.0]);
/// assert_eq!(matrix.row(1).iter().copied().collect::<Vec<_>>(), [-2.0, 5.0, -3.0]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn force_density_matrix(structure: &Structure, densities: &[f64]) -> DMatrix<f64> {
    assert_eq!(densities.len(), structure.elements.len(), "one an element");
    let n = structure.nodes.len();
    let mut matrix = DMatrix::zeros(n, n);
    for (element, &density) in structure.elements.iter().zip(densities) {
        let [a, b] = element.nodes;
        matrix[(a, a)] += density;
        matrix[(b, b)] += density;
        matrix[(a, b)] -= density;
        matrix[(b, a)] -= density;
    }
    matrix
}
