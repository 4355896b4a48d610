//! The equilibrium matrix A: forces of elements to forces on nodes.

use nalgebra::{DMatrix, DVector, Point3, Vector3};

use super::{Freedoms, StaticsError};
use crate::structure::Structure;

/// The matrix A with A t + p = 0 in equilibrium, where t are the forces of the
/// elements and p the loads of the freedoms; its transpose maps velocities to the
/// rates at which elements shorten (C = Aᵀ with the sign of Pellegrino and
/// Calladine reversed).
#[derive(Clone, Debug, PartialEq)]
pub struct EquilibriumMatrix {
    freedoms: Freedoms,
    elements: Vec<usize>,
    matrix: DMatrix<f64>,
}

impl EquilibriumMatrix {
    /// The matrix of all elements that carry a force. Cost: linear in its size.
    ///
    /// # Errors
    /// [`StaticsError`] when an element has no length, or positions are not finite
    /// or not one for each node.
    pub fn new(structure: &Structure, positions: &[Point3<f64>]) -> Result<Self, StaticsError> {
        let carrying = |e: &usize| structure.elements[*e].carries_force();
        let elements: Vec<usize> = (0..structure.elements.len()).filter(carrying).collect();
        Self::of(structure, positions, elements)
    }

    /// The matrix of some elements.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub fn of(
        structure: &Structure,
        positions: &[Point3<f64>],
        elements: Vec<usize>,
    ) -> Result<Self, StaticsError> {
        check_positions(structure, positions)?;
        let freedoms = Freedoms::new(structure);
        let mut matrix = DMatrix::zeros(freedoms.len(), elements.len());
        for (mut column, &e) in matrix.column_iter_mut().zip(&elements) {
            let direction = direction(structure, positions, e)?;
            let nodes = structure.elements[e].nodes;
            // Tension pulls the first node towards the second.
            freedoms.add_relative(column.as_mut_slice(), nodes, direction, -1.0);
        }
        Ok(Self {
            freedoms,
            elements,
            matrix,
        })
    }

    /// The coordinates that its rows are about.
    pub fn freedoms(&self) -> &Freedoms {
        &self.freedoms
    }

    /// The elements that its columns are about.
    pub fn elements(&self) -> &[usize] {
        &self.elements
    }

    /// The matrix A, freedoms by elements; dimensionless.
    pub fn matrix(&self) -> &DMatrix<f64> {
        &self.matrix
    }

    /// The loads p of the freedoms.
    pub fn loads(&self, structure: &Structure) -> DVector<f64> {
        let coordinates = self.freedoms.coordinates();
        DVector::from_iterator(
            coordinates.len(),
            coordinates
                .iter()
                .map(|&[node, axis]| structure.nodes[node].load[axis]),
        )
    }
}

/// The unit vector from the first to the second node of an element.
pub(super) fn direction(
    structure: &Structure,
    positions: &[Point3<f64>],
    element: usize,
) -> Result<Vector3<f64>, StaticsError> {
    let [a, b] = structure.elements[element].nodes;
    (positions[b] - positions[a])
        .try_normalize(0.0)
        .ok_or_else(|| StaticsError::NoLength {
            element: structure.elements[element].name.clone(),
        })
}

/// Refuses positions that are not finite or not one for each node.
pub(super) fn check_positions(
    structure: &Structure,
    positions: &[Point3<f64>],
) -> Result<(), StaticsError> {
    check_count("positions", positions.len(), structure.nodes.len())?;
    for (node, position) in structure.nodes.iter().zip(positions) {
        if !position.iter().all(|coordinate| coordinate.is_finite()) {
            let node = node.name.clone();
            return Err(StaticsError::NotFinite { node });
        }
    }
    Ok(())
}

/// Refuses a number of things that is not the one expected.
pub(super) fn check_count(
    what: &'static str,
    given: usize,
    expected: usize,
) -> Result<(), StaticsError> {
    if given == expected {
        return Ok(());
    }
    Err(StaticsError::WrongCount {
        what,
        given,
        expected,
    })
}
