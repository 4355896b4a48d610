//! The equilibrium manifold of a structure, in two formulations.

mod affine;
mod directions;
mod nodes;

pub use directions::{DirectionsManifold, EquationCounts};
pub use nodes::NodesManifold;

use nalgebra::{Point3, Vector3};
use tensegra_atlas::{ImplicitManifold, SparseRow};

use crate::{
    configuration::Configuration,
    structure::{ForceLaw, Interval, Structure},
};

/// An equilibrium manifold: an implicit manifold whose points are static
/// configurations of a structure.
pub trait EquilibriumManifold: ImplicitManifold {
    /// The structure.
    fn structure(&self) -> &Structure;

    /// Writes the position of every node at the coordinates x.
    fn positions(&self, x: &[f64], positions: &mut [Point3<f64>]);

    /// How far nodes move at most from the coordinates `a` to `b`.
    fn displacement(&self, a: &[f64], b: &[f64]) -> f64 {
        let nodes = self.structure().nodes.len();
        let [from, to] = [a, b].map(|x| {
            let mut positions = vec![Point3::origin(); nodes];
            self.positions(x, &mut positions);
            positions
        });
        let squares = from.iter().zip(&to).map(|(a, b)| (b - a).norm_squared());
        squares.fold(0.0, f64::max).sqrt()
    }

    /// Adds to `row` the gradient with respect to x of a function of node
    /// positions, given its gradients with respect to some positions.
    fn pull_back(&self, x: &[f64], gradients: &[(usize, Vector3<f64>)], row: &mut SparseRow);

    /// The value of an element's quantity at the coordinates x; `None` where the
    /// element has no such quantity.
    fn quantity(&self, quantity: ElementQuantity, x: &[f64]) -> Option<f64>;

    /// Writes the force of every element, 0 where it carries none, and its length.
    fn forces_and_lengths(&self, x: &[f64], values: &mut Vec<[f64; 2]>) {
        values.clear();
        values.extend((0..self.structure().elements.len()).map(|e| {
            let quantity = |quantity| self.quantity(quantity, x).unwrap_or(0.0);
            [
                quantity(ElementQuantity::Force(e)),
                quantity(ElementQuantity::Length(e)),
            ]
        }));
    }

    /// Adds the gradient of an element's quantity to `row`; nothing where the
    /// quantity is constant or the element has none such.
    fn quantity_gradient(&self, quantity: ElementQuantity, x: &[f64], row: &mut SparseRow);

    /// The physical configuration at the coordinates x.
    fn configuration(&self, x: &[f64]) -> Configuration;

    /// The coordinates of a physical configuration; close to the manifold if
    /// the configuration is close to equilibrium.
    fn coordinates(&self, configuration: &Configuration) -> Vec<f64>;
}

/// A quantity of one element, by the element's index.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ElementQuantity {
    /// Length l.
    Length(usize),
    /// Rest length r of an element with a linear law.
    Rest(usize),
    /// Force f of an element that carries one, tension positive.
    Force(usize),
}

impl ElementQuantity {
    /// The element.
    pub fn element(self) -> usize {
        match self {
            Self::Length(e) | Self::Rest(e) | Self::Force(e) => e,
        }
    }

    /// What is measured: "length", "rest length" or "force".
    pub fn noun(self) -> &'static str {
        match self {
            Self::Length(_) => "length",
            Self::Rest(_) => "rest length",
            Self::Force(_) => "force",
        }
    }

    /// Its value in a configuration, where the element has it.
    pub fn value(self, configuration: &Configuration) -> Option<f64> {
        match self {
            Self::Length(e) => configuration.lengths.get(e).copied(),
            Self::Rest(e) => configuration.rest_lengths.get(e).copied().flatten(),
            Self::Force(e) => configuration.forces.get(e).copied().flatten(),
        }
    }

    /// Its range in a structure, where the element has it.
    pub fn range(self, structure: &Structure) -> Option<Interval> {
        let element = structure.elements.get(self.element())?;
        match self {
            Self::Length(_) => Some(element.length),
            Self::Rest(_) => element.rest(),
            Self::Force(_) => element.carries_force().then_some(element.force),
        }
    }

    /// What the motor of an element sets: the rest length of an elastic one, the
    /// length of an inextensible one. `None` for an element without a motor.
    pub fn actuated(structure: &Structure, element: usize) -> Option<Self> {
        let declared = structure.elements.get(element)?;
        match declared.law {
            ForceLaw::Linear { .. } => declared.is_actuated().then_some(Self::Rest(element)),
            ForceLaw::Free | ForceLaw::None => {
                (!declared.has_constant_length()).then_some(Self::Length(element))
            }
        }
    }
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
    /// Parts of the structure are connected by no element.
    #[error("no chain of elements leads from node {first} to node {node}: connect or remove it")]
    Disconnected {
        /// Node 0.
        first: String,
        /// A node that is not connected to it.
        node: String,
    },
    /// A coupling names an element that lacks what it couples.
    #[error("element {element} has no {quantity} to couple: drop it from the coupling")]
    NothingToCouple {
        /// The element.
        element: String,
        /// What is coupled.
        quantity: &'static str,
    },
    /// The ranges of quantities that depend on each other exclude each other.
    #[error(
        "no {quantity} suits the ranges of all that is coupled to it: at least {least}, at most \
         {most}"
    )]
    NoAdmissibleValue {
        /// The quantity.
        quantity: String,
        /// The greatest lower end.
        least: f64,
        /// The least upper end.
        most: f64,
    },
    /// The conditions determine a quantity outside of its range.
    #[error("the {quantity} can only be {value}, outside of its range [{lo}, {hi}]")]
    OutOfRange {
        /// The quantity.
        quantity: String,
        /// Its value.
        value: f64,
        /// Lower end of its range.
        lo: f64,
        /// Upper end of its range.
        hi: f64,
    },
}
