//! What becomes of a structure that loses an element: a cable goes slack or tears,
//! a strut breaks.

use tensegra_model::{Configuration, Structure};

use crate::{DirectOptions, DirectSolver};

/// Newton iterations after which a structure counts as one that does not settle.
const MAX_ITERATIONS: usize = 200;
/// A structure whose least stiffness falls to this fraction of what it was has, in
/// effect, none.
const COLLAPSED: f64 = 1e-6;

/// What happens without an element.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Loss {
    /// The others find a stable equilibrium.
    Holds {
        /// How far a node moves until then, at most.
        displacement: f64,
        /// Smallest eigenvalue of the tangent stiffness then, in force per length.
        least_stiffness: f64,
    },
    /// The others find no stable equilibrium: the structure collapses or goes limp.
    Collapses,
}

/// What happens without each element in turn, motors holding all rest lengths:
/// direct form-finding from the given configuration, with the element taken out.
/// None for elements that carry no force, and for all where the structure as it is
/// does not settle in a stable equilibrium.
///
/// Cost: a run of direct form-finding for each element.
pub fn losses(structure: &Structure, configuration: &Configuration) -> Vec<Option<Loss>> {
    let count = structure.elements.len();
    let options = DirectOptions {
        max_iterations: MAX_ITERATIONS,
        ..DirectOptions::default()
    };
    let start = &configuration.positions;
    let settle = |solver: &mut DirectSolver<'_>| {
        let form = solver.solve(start, &configuration.rest_lengths).ok()?;
        let least = form.least_stiffness.filter(|_| form.is_stable())?;
        Some((form, least))
    };
    let mut whole = DirectSolver::with_options(structure, options.clone());
    let Some((_, intact)) = settle(&mut whole) else {
        return vec![None; count];
    };
    let without = |element: usize| {
        if !structure.elements[element].carries_force() {
            return None;
        }
        let mut solver = DirectSolver::without(structure, options.clone(), &[element]);
        let Some((form, least_stiffness)) = settle(&mut solver) else {
            return Some(Loss::Collapses);
        };
        if least_stiffness <= COLLAPSED * intact {
            return Some(Loss::Collapses);
        }
        let moved = form.configuration.positions.iter().zip(start);
        Some(Loss::Holds {
            displacement: moved
                .map(|(to, from)| (to - from).norm())
                .fold(0.0, f64::max),
            least_stiffness,
        })
    };
    (0..count).map(without).collect()
}
