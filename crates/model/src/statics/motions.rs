//! The motions that a structure admits: those that keep every constant length,
//! attachment and coupled orientation, and that are orthogonal to the neutral motions
//! of the whole.
//!
//! Householder reflections take the constraints to the first coordinates; the motions
//! admitted are the others. Cost for n freedoms and r constraints: 2 n r² operations
//! for the reflections, 4 n² r to reduce a matrix.

use nalgebra::{DMatrix, DVector, DVectorViewMut, Point3, Vector3};

use super::{Actuation, Freedoms, StaticsError, equilibrium::check_positions};
use crate::structure::{Coupling, ForceLaw, Structure};

/// A constraint that is shorter than this, relative to itself, after the reflections of
/// those before follows from them.
const DEPENDENT: f64 = 1e-9;

/// What a constraint on motions keeps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kept {
    /// The distance of two nodes.
    Distance([usize; 2]),
    /// Coupled directions of two elements.
    Direction,
}

/// An orthonormal basis Z of the motions that a structure admits, kept in factored form.
#[derive(Clone, Debug)]
pub struct AdmissibleMotions {
    freedoms: usize,
    /// Unit vectors v: reflection j is I − 2 v vᵀ on the coordinates from j on.
    reflections: Vec<DVector<f64>>,
}

impl AdmissibleMotions {
    /// The motions that a structure admits at some positions. Motors that hold lengths
    /// keep that of an inextensible element, which is then a constraint.
    ///
    /// # Errors
    /// [`StaticsError`] when positions are not finite or not one for each node.
    pub fn new(
        structure: &Structure,
        positions: &[Point3<f64>],
        freedoms: &Freedoms,
        actuation: Actuation,
    ) -> Result<Self, StaticsError> {
        check_positions(structure, positions)?;
        let neutral = freedoms.neutral_motions(structure, positions);
        Ok(Self::without(
            structure, positions, freedoms, actuation, &neutral,
        ))
    }

    /// The motions that keep all constraints and are orthogonal to the columns of
    /// `excluded`.
    pub(super) fn without(
        structure: &Structure,
        positions: &[Point3<f64>],
        freedoms: &Freedoms,
        actuation: Actuation,
        excluded: &DMatrix<f64>,
    ) -> Self {
        let mut motions = Self {
            freedoms: freedoms.len(),
            reflections: Vec::new(),
        };
        for column in excluded.column_iter() {
            motions.exclude(column.into_owned());
        }
        constraints(structure, positions, freedoms, actuation, |_, row| {
            motions.exclude(row);
        });
        motions
    }

    /// Takes a direction out, unless it is out already.
    fn exclude(&mut self, mut row: DVector<f64>) {
        let size = row.norm();
        for (j, v) in self.reflections.iter().enumerate() {
            reflect(v, row.rows_range_mut(j..));
        }
        let j = self.reflections.len();
        if j == self.freedoms {
            return;
        }
        let tail = row.rows_range(j..).norm();
        if tail > DEPENDENT * size {
            let mut v = row.rows_range(j..).into_owned();
            v[0] += tail.copysign(v[0]);
            v.normalize_mut();
            self.reflections.push(v);
        }
    }

    /// Number of independent motions.
    pub fn count(&self) -> usize {
        self.freedoms - self.reflections.len()
    }

    /// Zᵀ K Z, symmetric, for a symmetric matrix K over the freedoms.
    pub fn reduce(&self, mut matrix: DMatrix<f64>) -> DMatrix<f64> {
        for (j, v) in self.reflections.iter().enumerate() {
            for mut column in matrix.column_iter_mut() {
                reflect(v, column.rows_range_mut(j..));
            }
            // From the right: the same to the rows.
            let mut right = matrix.columns_range_mut(j..);
            let image = &right * v * 2.0;
            right.ger(-1.0, &image, v, 1.0);
        }
        let r = self.reflections.len();
        let rest = matrix.view_range(r.., r..);
        (rest + rest.transpose()) * 0.5
    }

    /// Z y: the motion of the freedoms with the coordinates y.
    ///
    /// # Panics
    /// If there is not one coordinate for each motion.
    pub fn motion(&self, coordinates: &[f64]) -> DVector<f64> {
        assert_eq!(coordinates.len(), self.count(), "one coordinate a motion");
        let mut motion = DVector::zeros(self.freedoms);
        motion
            .rows_range_mut(self.reflections.len()..)
            .copy_from_slice(coordinates);
        for (j, v) in self.reflections.iter().enumerate().rev() {
            reflect(v, motion.rows_range_mut(j..));
        }
        motion
    }

    /// Z, a column for each motion.
    pub fn basis(&self) -> DMatrix<f64> {
        let count = self.count();
        let mut basis = DMatrix::zeros(self.freedoms, count);
        let mut unit = vec![0.0; count];
        for j in 0..count {
            unit[j] = 1.0;
            basis.set_column(j, &self.motion(&unit));
            unit[j] = 0.0;
        }
        basis
    }
}

/// x ← x − 2 v vᵀ x.
fn reflect(v: &DVector<f64>, mut x: DVectorViewMut<'_, f64>) {
    let along = 2.0 * v.dot(&x);
    x.axpy(-along, v, 1.0);
}

/// Passes on what every constraint keeps, with its gradient by the freedoms, of norm one.
/// Constraints on nodes that no force reaches do not count: these follow the others.
pub(super) fn constraints(
    structure: &Structure,
    positions: &[Point3<f64>],
    freedoms: &Freedoms,
    actuation: Actuation,
    mut pass: impl FnMut(Kept, DVector<f64>),
) {
    let mut constrain = |kept, terms: &[([usize; 2], Vector3<f64>)]| {
        let nodes = || terms.iter().flat_map(|(nodes, _)| nodes);
        if !nodes().all(|&node| freedoms.is_loaded(node)) {
            return;
        }
        let mut row = DVector::zeros(freedoms.len());
        for (nodes, direction) in terms {
            freedoms.add_relative(row.as_mut_slice(), *nodes, *direction, 1.0);
        }
        if row.normalize_mut() > 0.0 {
            pass(kept, row);
        }
    };
    let unit = |[a, b]: [usize; 2]| (positions[b] - positions[a]).try_normalize(0.0);
    let rigid = structure.elements.iter().filter(|element| {
        let held = actuation == Actuation::Length && element.law == ForceLaw::Free;
        element.has_constant_length() || held
    });
    let glued = structure.attachments.iter().flat_map(|attachment| {
        let [a, b, c] = attachment.anchors.map(|anchor| anchor.node);
        [[a, b], [b, c], [c, a]]
    });
    for nodes in rigid.map(|element| element.nodes).chain(glued) {
        if let Some(u) = unit(nodes) {
            constrain(Kept::Distance(nodes), &[(nodes, u)]);
        }
    }
    for coupling in &structure.couplings {
        let Coupling::Orientation {
            reference,
            followers,
        } = coupling
        else {
            continue;
        };
        // The rate of the direction u of an element along w is w⊥ · (v_b − v_a) / l.
        let rate = |element: usize, along: Vector3<f64>| {
            let nodes @ [a, b] = structure.elements[element].nodes;
            let length = (positions[b] - positions[a]).norm();
            unit(nodes).map(|u| (nodes, (along - u * u.dot(&along)) / length))
        };
        for (follower, rotation) in followers {
            for axis in 0..structure.dimension {
                let along = Vector3::ith(axis, 1.0);
                let terms = (
                    rate(*reference, along),
                    rate(*follower, -(rotation.inverse() * along)),
                );
                if let (Some(first), Some(second)) = terms {
                    constrain(Kept::Direction, &[first, second]);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::StructureBuilder;

    #[test]
    fn motions_are_orthonormal_and_keep_what_is_to_be_kept() {
        let structure = StructureBuilder::spatial()
            .strut("s", ["a", "b"], 1.0)
            .cable("c1", ["a", "c"], 0.0..=9.0, 1.0, 1.0)
            .cable("c2", ["b", "c"], 0.0..=9.0, 1.0, 1.0)
            .build()
            .unwrap();
        let positions = [[0.0, 0.0, 0.0], [0.6, 0.8, 0.0], [0.1, 0.7, 0.9]].map(Point3::from);
        let freedoms = Freedoms::new(&structure);
        let motions =
            AdmissibleMotions::new(&structure, &positions, &freedoms, Actuation::Length).unwrap();
        // Nine coordinates, six rigid motions, one length.
        assert_eq!(motions.count(), 2);
        let basis = motions.basis();
        assert!((basis.tr_mul(&basis) - DMatrix::identity(2, 2)).norm() < 1e-14);
        let rigid = freedoms.rigid_motions(&positions);
        assert!((rigid.tr_mul(&basis)).norm() < 1e-14);
        constraints(
            &structure,
            &positions,
            &freedoms,
            Actuation::Length,
            |kept, row| {
                assert_eq!(kept, Kept::Distance([0, 1]));
                assert!(basis.tr_mul(&row).norm() < 1e-14);
            },
        );
        let matrix = DMatrix::from_fn(9, 9, |i, j| 1.0 / (1.0 + (i + j) as f64));
        let reduced = basis.tr_mul(&matrix) * &basis;
        assert!((motions.reduce(matrix) - reduced).norm() < 1e-14);
    }
}
