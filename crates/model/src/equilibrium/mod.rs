//! The equilibrium manifold of a structure, in two formulations.

mod affine;
mod nodes;

pub use nodes::NodesManifold;

use nalgebra::{Point3, Vector3};
use tensegra_atlas::{ImplicitManifold, SparseRow};

use crate::{configuration::Configuration, structure::Structure};

/// An equilibrium manifold: an implicit manifold whose points are static
/// configurations of a structure.
pub trait EquilibriumManifold: ImplicitManifold {
    /// The structure.
    fn structure(&self) -> &Structure;

    /// Writes the position of every node at the coordinates x.
    fn positions(&self, x: &[f64], positions: &mut [Point3<f64>]);

    /// Adds to `row` the gradient with respect to x of a function of node
    /// positions, given its gradients with respect to some positions.
    fn pull_back(&self, x: &[f64], gradients: &[(usize, Vector3<f64>)], row: &mut SparseRow);

    /// The physical configuration at the coordinates x.
    fn configuration(&self, x: &[f64]) -> Configuration;

    /// The coordinates of a physical configuration; close to the manifold if
    /// the configuration is close to equilibrium.
    fn coordinates(&self, configuration: &Configuration) -> Vec<f64>;
}

/// Why a structure has no equilibrium manifold.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum EquilibriumError {
    /// Linear conditions contradict each other.
    #[error("{what} contradict the conditions before by {by:.3e}: drop or correct one of them")]
    Contradiction {
        /// The condition.
        what: String,
        /// By how much.
        by: f64,
    },
}
