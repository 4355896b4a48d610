//! Statics of a structure at a configuration: what is rigid, what can be
//! prestressed, and what prestress stabilises.
//!
//! | question | answer | file |
//! |---|---|---|
//! | which coordinates can move | [`Freedoms`] | `freedoms.rs` |
//! | which forces balance | [`EquilibriumMatrix`] A, A t + p = 0 | `equilibrium.rs` |
//! | which self-stresses and mechanisms there are | [`MatrixAnalysis`] | `analysis.rs` |
//! | how forces depend on positions linearly | [`force_density_matrix`] D | `force_density.rs` |
//! | how stiff the structure is | [`material_stiffness`] and [`geometric_stiffness`] | `stiffness.rs` |
//! | which motions it admits | [`AdmissibleMotions`] | `motions.rs` |
//! | whether equilibrium is a minimum of the energy | [`Stability`] | `stability.rs` |
//! | which motions are soft, and what prestress does to mechanisms | [`StiffnessSpectrum`], [`PrestressStability`] | `spectrum.rs` |
//! | whether no other shape exists at all | [`SuperStability`] | `super_stability.rs` |
//! | how it vibrates | [`natural_frequencies`] | `vibration.rs` |
//!
//! # What can move
//! Nodes that no force reaches (their elements are geometry only) take no part.
//! Nodes exempt from balance are supports and do not move. Coordinates that
//! [`Structure::fixed`](crate::Structure::fixed) holds are a gauge, not a support:
//! they may move here, and rigid motions are taken out instead. A planar structure
//! moves in its plane only.
//!
//! # Conventions
//! A force t is positive in tension; its force density is q = t / l. Vectors over
//! elements that carry a force keep the order of the elements; vectors over
//! freedoms keep that of [`Freedoms`].
//!
//! # Sources
//! S. Pellegrino and C. R. Calladine, "Matrix analysis of statically and
//! kinematically indeterminate frameworks", *International Journal of Solids and
//! Structures* 22 (1986): self-stress and mechanisms. H.-J. Schek, "The force
//! density method for form finding and computation of general networks", *Computer
//! Methods in Applied Mechanics and Engineering* 3 (1974). S. D. Guest, "The
//! stiffness of prestressed frameworks: a unifying approach", *International
//! Journal of Solids and Structures* 43 (2006). R. Connelly, "Rigidity and energy",
//! *Inventiones Mathematicae* 66 (1982): super-stability.

mod analysis;
mod basis;
mod equilibrium;
mod force_density;
mod freedoms;
mod motions;
mod spectrum;
mod stability;
mod stiffness;
mod super_stability;
mod vibration;

pub use analysis::{MatrixAnalysis, RANK_TOLERANCE};
pub use equilibrium::EquilibriumMatrix;
pub use force_density::{force_densities, force_density_matrix};
pub use freedoms::Freedoms;
pub use motions::AdmissibleMotions;
pub use spectrum::{PrestressStability, StiffnessSpectrum};
pub use stability::{Softest, Stability};
pub use stiffness::{Actuation, geometric_stiffness, material_stiffness};
pub use super_stability::SuperStability;
pub use vibration::{lumped_masses, natural_frequencies};

/// Why there is nothing to say about the statics of a configuration.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum StaticsError {
    /// An element that carries a force joins two nodes at one point: its force has
    /// no direction.
    #[error("element `{element}` has no length: both its nodes are at one point")]
    NoLength {
        /// The element.
        element: String,
    },
    /// A coordinate is not a number.
    #[error("node `{node}` has a coordinate that is not finite")]
    NotFinite {
        /// The node.
        node: String,
    },
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
    /// A node that moves has no mass.
    #[error(
        "node `{node}` has no mass: give its elements a mass (`dynamics = {{ mass = … }}`), or \
         every node one"
    )]
    NoMass {
        /// The node.
        node: String,
    },
}
