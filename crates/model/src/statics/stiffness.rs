//! The tangent stiffness K = K_M + K_G: how forces on nodes follow small
//! displacements.
//!
//! An element of direction u, length l, stiffness k and force t contributes
//! k u uᵀ to the material stiffness K_M and (t / l) (I − u uᵀ) to the geometric
//! stiffness K_G (Guest 2006, with the modified axial stiffness k − t / l there).
//! Elements of constant length contribute to K_G alone: they are constraints.
//! Cost: linear in elements, plus the size of the matrix.

use nalgebra::{DMatrix, Matrix3, Point3};

use super::{Freedoms, StaticsError, equilibrium::direction};
use crate::{
    configuration::Configuration,
    structure::{Element, Structure},
};

/// What a motor keeps constant when its element is disturbed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Actuation {
    /// What was wound up: the rest length of an elastic element, the length of
    /// an inextensible one. The element resists with its stiffness.
    #[default]
    Length,
    /// The force: the element resists by its tension alone, without stiffness
    /// along its axis.
    Force,
}

/// The stiffness k of an element along its axis; 0 where its motor holds a force, and for
/// elements without a law.
pub(super) fn axial(element: &Element, actuation: Actuation) -> f64 {
    match actuation {
        Actuation::Force if element.is_actuated() => 0.0,
        _ => element.stiffness().unwrap_or(0.0),
    }
}

/// The material stiffness K_M of the freedoms, in force per length. A cable or
/// spring without tension is slack and contributes nothing.
///
/// # Errors
/// [`StaticsError`] when an element that carries a force has no length.
pub fn material_stiffness(
    structure: &Structure,
    configuration: &Configuration,
    freedoms: &Freedoms,
    actuation: Actuation,
) -> Result<DMatrix<f64>, StaticsError> {
    let mut matrix = DMatrix::zeros(freedoms.len(), freedoms.len());
    for (e, element) in structure.elements.iter().enumerate() {
        let stiffness = axial(element, actuation);
        if stiffness == 0.0 || is_slack(structure, configuration, e) {
            continue;
        }
        let u = direction(structure, &configuration.positions, e)?;
        add(
            &mut matrix,
            freedoms,
            element.nodes,
            &(u * u.transpose() * stiffness),
        );
    }
    Ok(matrix)
}

/// The geometric stiffness K_G of the freedoms, in force per length: that of the
/// prestress.
///
/// # Errors
/// [`StaticsError`] when an element that carries a force has no length.
pub fn geometric_stiffness(
    structure: &Structure,
    configuration: &Configuration,
    freedoms: &Freedoms,
) -> Result<DMatrix<f64>, StaticsError> {
    geometric(structure, &configuration.positions, freedoms, |e| {
        configuration.forces[e].unwrap_or(0.0)
    })
}

/// The geometric stiffness of given forces.
pub(super) fn geometric(
    structure: &Structure,
    positions: &[Point3<f64>],
    freedoms: &Freedoms,
    force: impl Fn(usize) -> f64,
) -> Result<DMatrix<f64>, StaticsError> {
    let mut matrix = DMatrix::zeros(freedoms.len(), freedoms.len());
    for (e, element) in structure.elements.iter().enumerate() {
        if !element.carries_force() {
            continue;
        }
        let u = direction(structure, positions, e)?;
        let [a, b] = element.nodes;
        let density = force(e) / (positions[b] - positions[a]).norm();
        let block = (Matrix3::identity() - u * u.transpose()) * density;
        add(&mut matrix, freedoms, element.nodes, &block);
    }
    Ok(matrix)
}

/// The tangent stiffness at force densities, all cables taken as taut.
pub(super) fn tangent(
    structure: &Structure,
    positions: &[Point3<f64>],
    freedoms: &Freedoms,
    actuation: Actuation,
    densities: &[f64],
) -> Result<DMatrix<f64>, StaticsError> {
    let mut matrix = DMatrix::zeros(freedoms.len(), freedoms.len());
    for (e, element) in structure.elements.iter().enumerate() {
        if !element.carries_force() {
            continue;
        }
        let u = direction(structure, positions, e)?;
        let excess = axial(element, actuation) - densities[e];
        let block = u * u.transpose() * excess + Matrix3::identity() * densities[e];
        add(&mut matrix, freedoms, element.nodes, &block);
    }
    Ok(matrix)
}

/// Whether an element that can only pull does not.
fn is_slack(structure: &Structure, configuration: &Configuration, e: usize) -> bool {
    let element = &structure.elements[e];
    element.pulls_only() && configuration.forces[e].is_none_or(|force| force <= 0.0)
}

/// Adds the stiffness `block` between two nodes.
fn add(matrix: &mut DMatrix<f64>, freedoms: &Freedoms, [a, b]: [usize; 2], block: &Matrix3<f64>) {
    for (row, other, sign) in [(a, a, 1.0), (b, b, 1.0), (a, b, -1.0), (b, a, -1.0)] {
        for i in 0..3 {
            let Some(row) = freedoms.index(row, i) else {
                continue;
            };
            for j in 0..3 {
                if let Some(column) = freedoms.index(other, j) {
                    matrix[(row, column)] += sign * block[(i, j)];
                }
            }
        }
    }
}
