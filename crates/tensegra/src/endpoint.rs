//! Start and goal: completing what a file states and refining it onto the
//! equilibrium manifold.

use nalgebra::{DMatrix, DVector};
use tensegra_atlas::{ManifoldError, project};
use tensegra_model::{Configuration, Element, Endpoint, EquilibriumManifold, ForceLaw, Structure};

/// Refinement moves no node farther than this fraction of the structure's size.
const FARTHEST: f64 = 1e-2;
/// Residual of a refined configuration.
const TOLERANCE: f64 = 1e-12;
const MAX_ITERATIONS: usize = 50;

/// Why a start or goal is refused.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum EndpointError {
    /// The problem does not state it.
    #[error(
        "the problem states no {which}: add it, as node coordinates or as a row of a .links file, or \
         have it found: {which} = {{ formfind = {{}} }}"
    )]
    Missing {
        /// "start" or "goal".
        which: &'static str,
    },
    /// It cannot be put in equilibrium.
    #[error("the {which} cannot be put in equilibrium nearby: {error}")]
    NoEquilibrium {
        /// "start" or "goal".
        which: &'static str,
        /// What the refinement says.
        error: ManifoldError,
    },
    /// Equilibrium is too far from what the file states.
    #[error(
        "the {which} is not in equilibrium as stated: the nearest equilibrium moves {node} by \
         {distance:.3e}, more than {allowed:.1e}"
    )]
    TooFar {
        /// "start" or "goal".
        which: &'static str,
        /// The node that moves the most.
        node: String,
        /// How far it moves.
        distance: f64,
        /// How far it may.
        allowed: f64,
    },
}

/// The physical configuration that an endpoint states. Forces that it leaves
/// open are estimated: from rest lengths where stated, else as the self-stress
/// at the stated positions with tension in cables and compression in struts.
pub fn complete(structure: &Structure, endpoint: &Endpoint) -> Configuration {
    let positions = endpoint.positions.clone();
    let lengths: Vec<f64> = structure
        .elements
        .iter()
        .map(|element| {
            let [a, b] = element.nodes;
            (positions[b] - positions[a]).norm()
        })
        .collect();
    let mut forces: Vec<Option<f64>> = structure
        .elements
        .iter()
        .enumerate()
        .map(|(e, element)| match element.law {
            ForceLaw::None => None,
            ForceLaw::Linear { stiffness, rest } if rest.is_constant() => {
                Some(stiffness * (lengths[e] - rest.lo))
            }
            ForceLaw::Linear { stiffness, .. } => endpoint.forces[e]
                .or_else(|| endpoint.rest_lengths[e].map(|r| stiffness * (lengths[e] - r))),
            ForceLaw::Free => endpoint.forces[e],
        })
        .collect();
    estimate_forces(structure, &positions, &lengths, &mut forces);
    let rest_lengths = structure
        .elements
        .iter()
        .enumerate()
        .map(|(e, element)| match element.law {
            ForceLaw::Linear { stiffness, rest } => Some(if rest.is_constant() {
                rest.lo
            } else {
                lengths[e] - forces[e].unwrap_or(0.0) / stiffness
            }),
            _ => None,
        })
        .collect();
    Configuration {
        positions,
        lengths,
        rest_lengths,
        forces,
    }
}

/// Fills in the forces that are not known: the smallest ones that balance the
/// known, plus the self-stress nearest to one with the right signs, scaled to
/// the pretension.
fn estimate_forces(
    structure: &Structure,
    positions: &[nalgebra::Point3<f64>],
    lengths: &[f64],
    forces: &mut [Option<f64>],
) {
    let unknown: Vec<usize> = (0..forces.len())
        .filter(|&e| structure.elements[e].carries_force() && forces[e].is_none())
        .collect();
    if unknown.is_empty() {
        return;
    }
    let mut matrix = DMatrix::<f64>::zeros(3 * positions.len(), unknown.len());
    let mut load = DVector::<f64>::zeros(3 * positions.len());
    for (i, node) in structure.nodes.iter().enumerate() {
        if node.balanced {
            load.fixed_rows_mut::<3>(3 * i).copy_from(&-node.load);
        }
    }
    for (e, element) in structure.elements.iter().enumerate() {
        let [a, b] = element.nodes;
        let direction = (positions[b] - positions[a]) / lengths[e].max(f64::MIN_POSITIVE);
        for (node, sign) in [(a, 1.0), (b, -1.0)] {
            if !structure.nodes[node].balanced {
                continue;
            }
            if let Some(column) = unknown.iter().position(|&u| u == e) {
                let mut block = matrix.fixed_view_mut::<3, 1>(3 * node, column);
                block += sign * direction;
            } else if let Some(force) = forces[e] {
                let mut block = load.fixed_rows_mut::<3>(3 * node);
                block -= sign * force * direction;
            }
        }
    }
    // The normal matrix is small; its eigenvectors with eigenvalue zero are the
    // states of self-stress.
    let eigen = (matrix.transpose() * &matrix).symmetric_eigen();
    let rhs = matrix.transpose() * load;
    let largest = eigen.eigenvalues.amax();
    let wanted = DVector::from_iterator(
        unknown.len(),
        unknown
            .iter()
            .map(|&e| preferred_sign(&structure.elements[e])),
    );
    let mut particular = DVector::zeros(unknown.len());
    let mut stress = DVector::zeros(unknown.len());
    for (i, &value) in eigen.eigenvalues.iter().enumerate() {
        let vector = eigen.eigenvectors.column(i);
        if value > 1e-8 * largest {
            particular += vector * (vector.dot(&rhs) / value);
        } else {
            stress += vector * vector.dot(&wanted);
        }
    }
    let known: f64 = forces.iter().flatten().map(|f| f * f).sum();
    let norm = structure
        .pretension
        .map_or(0.0, |p| (p * p - known).max(0.0))
        .sqrt();
    let scale = (norm.powi(2) - particular.norm_squared()).max(0.0).sqrt();
    if stress.norm() > 1e-9 {
        particular += stress.normalize() * scale;
    }
    for (&e, &force) in unknown.iter().zip(particular.iter()) {
        forces[e] = Some(force);
    }
}

/// −1 for elements that can only be compressed, +1 for those in tension.
fn preferred_sign(element: &Element) -> f64 {
    if element.force.hi <= 0.0 {
        -1.0
    } else if element.force.lo >= 0.0 {
        1.0
    } else {
        0.0
    }
}

/// Coordinates of a start or goal on the manifold.
///
/// # Errors
/// [`EndpointError`] when there is no equilibrium near what is stated.
pub fn refine(
    manifold: &dyn EquilibriumManifold,
    which: &'static str,
    stated: &Configuration,
    size: f64,
) -> Result<Vec<f64>, EndpointError> {
    let mut x = manifold.coordinates(stated);
    project(manifold, &mut x, TOLERANCE, MAX_ITERATIONS)
        .map_err(|error| EndpointError::NoEquilibrium { which, error })?;
    let refined = manifold.configuration(&x);
    let moved = stated
        .positions
        .iter()
        .zip(&refined.positions)
        .map(|(a, b)| (a - b).norm())
        .enumerate()
        .max_by(|a, b| a.1.total_cmp(&b.1));
    match moved {
        Some((node, distance)) if distance > FARTHEST * size => Err(EndpointError::TooFar {
            which,
            node: manifold.structure().nodes[node].name.clone(),
            distance,
            allowed: FARTHEST * size,
        }),
        _ => Ok(x),
    }
}
