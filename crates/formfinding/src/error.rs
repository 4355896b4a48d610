//! Why there is no form.

use tensegra_model::{BodyError, EquilibriumError};

use crate::frame::Group;

/// Why there is no form.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum FormError {
    /// The structure's own conditions contradict each other.
    #[error(transparent)]
    Structure(#[from] EquilibriumError),
    /// A body has no valid shape.
    #[error(transparent)]
    Body(#[from] BodyError),
    /// A fixed node lies in an obstacle.
    #[error(
        "the obstacle {obstacle} swallows the fixed node {node}: their clearance is {clearance:.6e}, \
         at least {least:.6e} is needed; move one of them, or do not test the pair"
    )]
    Swallowed {
        /// The node.
        node: String,
        /// The obstacle.
        obstacle: String,
        /// Distance of the node from the surface, negative inside.
        clearance: f64,
        /// What is needed.
        least: f64,
    },
    /// No start led to a form that meets everything asked for.
    #[error("{}", unmet_text(.unmet, *.starts))]
    Unmet {
        /// What cannot be met while everything else is, the most violated first.
        unmet: Vec<Unmet>,
        /// Number of starts that were tried.
        starts: usize,
    },
}

/// A constraint that no start met, with the smallest violation found.
#[derive(Clone, Debug, PartialEq)]
pub struct Unmet {
    /// The constraint in words.
    pub constraint: String,
    /// What it is about.
    pub group: Group,
    /// Its violation where the group's violation was the smallest, in the problem's units.
    pub violation: f64,
}

impl Group {
    /// What is wrong when constraints of the group cannot be met, and how to mend it.
    const fn verdict(self) -> (&'static str, &'static str) {
        match self {
            Self::Conditions => (
                "the form asked for cannot be reached",
                "relax these conditions, or widen ranges",
            ),
            Self::Stability => (
                "every equilibrium found is unstable",
                "prestress it more, or lower least_stiffness",
            ),
            Self::Clearance => (
                "every form found is in collision",
                "move obstacles, or lower radii or clearances",
            ),
            Self::Balance => (
                "no admissible forces carry the loads",
                "lower the loads, or widen the ranges of forces and rest lengths",
            ),
            Self::Forces => (
                "the ranges of forces and rest lengths contradict each other",
                "widen one of them",
            ),
            Self::Lengths => (
                "the lengths contradict each other",
                "widen one of their ranges",
            ),
        }
    }
}

/// Most constraints that a message names.
const NAMED: usize = 3;

fn unmet_text(unmet: &[Unmet], starts: usize) -> String {
    let named: Vec<String> = unmet
        .iter()
        .take(NAMED)
        .map(|unmet| format!("{} by {:.4e}", unmet.constraint, unmet.violation))
        .collect();
    let more = match unmet.len().saturating_sub(NAMED) {
        0 => String::new(),
        more => format!(", and {more} more"),
    };
    let starts = if starts == 1 {
        "one start".to_owned()
    } else {
        format!("{starts} starts")
    };
    let list = named.join("; ");
    match unmet.first() {
        None => format!("no form was found from {starts}: try more starts or another seed"),
        Some(first) => {
            let alone = unmet.iter().all(|other| other.group == first.group);
            let (verdict, cure) = if alone {
                first.group.verdict()
            } else {
                (
                    "the constraints cannot be met together",
                    "relax some of them, or try more starts",
                )
            };
            format!(
                "{verdict}: missed, at the smallest violation found from {starts}: {list}{more}; {cure}"
            )
        }
    }
}
