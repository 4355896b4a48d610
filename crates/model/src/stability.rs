//! Stability of equilibria: the smallest eigenvalue of the tangent stiffness on
//! the motions that a structure admits.
//!
//! An element with direction u, length l and force f adds
//! k u uᵀ + (f / l) (I − u uᵀ) to the stiffness of its two nodes, the first term
//! for elements whose force changes with their length (Guest 2006). Admissible
//! motions leave supports where they are, keep the lengths of rigid elements,
//! the distances of nodes glued to one body, and coupled directions of elements;
//! rigid motions of the whole structure do not count. An equilibrium whose
//! stiffness is positive definite on them is a minimum of the energy.
//!
//! What a motor does when its element is stretched decides too; see
//! [`Actuation`].
//!
//! Householder reflections take the constraints on the motions to the first
//! coordinates; the stiffness of the others is the rest of the transformed
//! matrix. Cost for n coordinates and r constraints: 4 n² r operations, and
//! (n − r)³ / 3 for a test by Cholesky's factorisation or about 4 (n − r)³ / 3
//! for the eigenvalues.

use nalgebra::{DMatrix, DVector, Dyn, Matrix3, Point3, SymmetricEigen, Vector3};
use tensegra_atlas::{Obstruction, SparseRow, Validity};

use crate::{
    configuration::{Configuration, Path},
    equilibrium::EquilibriumManifold,
    structure::{Coupling, ForceLaw, Structure},
};

/// A constraint shorter than this, relative to itself, after the reflections of
/// those before follows from them.
const DEPENDENT: f64 = 1e-9;

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

/// The stability of the equilibria of a structure.
#[derive(Clone, Debug)]
pub struct Stability<'a> {
    structure: &'a Structure,
    actuation: Actuation,
}

impl<'a> Stability<'a> {
    /// The stability of a structure whose motors act in the given way.
    pub fn new(structure: &'a Structure, actuation: Actuation) -> Self {
        Self {
            structure,
            actuation,
        }
    }

    /// The smallest eigenvalue of the tangent stiffness on admissible motions;
    /// `None` where there are no such motions, or an element has no length.
    ///
    /// # Units
    /// Force per length.
    pub fn least_stiffness(&self, configuration: &Configuration) -> Option<f64> {
        let stiffness = self.reduced(configuration)?;
        let least = SymmetricEigen::try_new(stiffness, 1e-14, 1000)?
            .eigenvalues
            .min();
        least.is_finite().then_some(least)
    }

    /// Whether all eigenvalues exceed `margin`. Cheaper than the eigenvalues.
    pub fn exceeds(&self, configuration: &Configuration, margin: f64) -> bool {
        let Some(mut stiffness) = self.reduced(configuration) else {
            return true;
        };
        for i in 0..stiffness.nrows() {
            stiffness[(i, i)] -= margin;
        }
        nalgebra::Cholesky::<f64, Dyn>::new(stiffness).is_some()
    }

    /// The smallest eigenvalue along a path, and the index of the configuration
    /// that has it.
    pub fn least_along(&self, path: &Path) -> Option<(usize, f64)> {
        let configurations = path.configurations.iter().enumerate();
        configurations
            .filter_map(|(i, configuration)| Some((i, self.least_stiffness(configuration)?)))
            .min_by(|a, b| a.1.total_cmp(&b.1))
    }

    /// The tangent stiffness in orthonormal coordinates of the admissible
    /// motions; `None` where there are none.
    fn reduced(&self, configuration: &Configuration) -> Option<DMatrix<f64>> {
        let mut stiffness = self.stiffness(configuration)?;
        let n = stiffness.nrows();
        let mut reflections: Vec<DVector<f64>> = Vec::new();
        self.constraints(&configuration.positions, &mut |mut row| {
            let size = row.norm();
            for (j, v) in reflections.iter().enumerate() {
                reflect(v, row.rows_range_mut(j..));
            }
            let j = reflections.len();
            let tail = row.rows_range(j..).norm();
            if j < n && tail > DEPENDENT * size {
                let mut v = row.rows_range(j..).into_owned();
                v[0] += tail.copysign(v[0]);
                v.normalize_mut();
                reflections.push(v);
            }
        });
        let r = reflections.len();
        if r >= n {
            return None;
        }
        for (j, v) in reflections.iter().enumerate() {
            for mut column in stiffness.column_iter_mut() {
                reflect(v, column.rows_range_mut(j..));
            }
            // From the right: the same to the rows.
            let mut right = stiffness.columns_range_mut(j..);
            let image = &right * v * 2.0;
            right.ger(-1.0, &image, v, 1.0);
        }
        let rest = stiffness.view_range(r.., r..);
        Some((rest + rest.transpose()) * 0.5)
    }

    /// The tangent stiffness of all coordinates.
    fn stiffness(&self, configuration: &Configuration) -> Option<DMatrix<f64>> {
        let structure = self.structure;
        let d = structure.dimension;
        let n = d * structure.nodes.len();
        let mut matrix = DMatrix::zeros(n, n);
        for (e, element) in structure.elements.iter().enumerate() {
            let Some(force) = configuration.forces[e] else {
                continue;
            };
            let [a, b] = element.nodes;
            let vector = configuration.positions[b] - configuration.positions[a];
            let length = vector.norm();
            if length.is_nan() || length == 0.0 {
                return None;
            }
            let along = vector * vector.transpose() / (length * length);
            let held = self.actuation == Actuation::Length || !element.is_actuated();
            let elastic = match element.law {
                ForceLaw::Linear { stiffness, .. } if held => stiffness,
                _ => 0.0,
            };
            let block = along * elastic + (Matrix3::identity() - along) * (force / length);
            let block = block.view((0, 0), (d, d));
            for (row, column, sign) in [(a, a, 1.0), (b, b, 1.0), (a, b, -1.0), (b, a, -1.0)] {
                let mut place = matrix.view_mut((d * row, d * column), (d, d));
                place += sign * block;
            }
        }
        Some(matrix)
    }

    /// Whether no motion changes the length of an element.
    fn is_rigid(&self, element: usize) -> bool {
        let element = &self.structure.elements[element];
        element.has_constant_length()
            || (element.law == ForceLaw::Free && self.actuation == Actuation::Length)
    }

    /// Passes the constraints on motions on, each as a vector of all coordinates.
    fn constraints(&self, positions: &[Point3<f64>], pass: &mut dyn FnMut(DVector<f64>)) {
        let structure = self.structure;
        let d = structure.dimension;
        let n = d * structure.nodes.len();
        for (node, _) in structure.nodes.iter().enumerate().filter(|n| !n.1.balanced) {
            for axis in 0..d {
                let mut row = DVector::zeros(n);
                row[d * node + axis] = 1.0;
                pass(row);
            }
        }
        // The rate of what has the gradients g and −g at two nodes.
        let pair = |row: &mut DVector<f64>, [a, b]: [usize; 2], g: Vector3<f64>| {
            for axis in 0..d {
                row[d * b + axis] += g[axis];
                row[d * a + axis] -= g[axis];
            }
        };
        let unit = |[a, b]: [usize; 2]| {
            let vector = positions[b] - positions[a];
            (vector.norm(), vector.normalize())
        };
        let rigid = (0..structure.elements.len()).filter(|&e| self.is_rigid(e));
        let glued = structure.attachments.iter().flat_map(|attachment| {
            let [a, b, c] = attachment.anchors.map(|anchor| anchor.node);
            [[a, b], [b, c], [c, a]]
        });
        for nodes in rigid.map(|e| structure.elements[e].nodes).chain(glued) {
            let mut row = DVector::zeros(n);
            pair(&mut row, nodes, unit(nodes).1);
            pass(row);
        }
        for coupling in &structure.couplings {
            let Coupling::Orientation {
                reference,
                followers,
            } = coupling
            else {
                continue;
            };
            for (follower, rotation) in followers {
                for axis in 0..d {
                    // The rate of a component of u(reference) − R u(follower).
                    let along = Vector3::ith(axis, 1.0);
                    let mut row = DVector::zeros(n);
                    for (element, along) in [
                        (*reference, along),
                        (*follower, -(rotation.inverse() * along)),
                    ] {
                        let nodes = structure.elements[element].nodes;
                        let (length, u) = unit(nodes);
                        pair(&mut row, nodes, (along - u * u.dot(&along)) / length);
                    }
                    pass(row);
                }
            }
        }
        self.rigid_motions(positions, pass);
    }

    /// Passes on the rigid motions that leave the supports where they are.
    fn rigid_motions(&self, positions: &[Point3<f64>], pass: &mut dyn FnMut(DVector<f64>)) {
        let structure = self.structure;
        let d = structure.dimension;
        let supports: Vec<usize> = (0..structure.nodes.len())
            .filter(|&node| !structure.nodes[node].balanced)
            .collect();
        let motion = |shift: Vector3<f64>, turn: Vector3<f64>, center: &Point3<f64>| {
            let velocity = |node: usize| shift + turn.cross(&(positions[node] - center));
            DVector::from_iterator(
                d * positions.len(),
                (0..positions.len()).flat_map(|node| {
                    let velocity = velocity(node);
                    (0..d).map(move |axis| velocity[axis])
                }),
            )
        };
        let Some(&first) = supports.first() else {
            let center = nalgebra::center(&positions[0], &positions[positions.len() - 1]);
            for axis in 0..d {
                pass(motion(Vector3::ith(axis, 1.0), Vector3::zeros(), &center));
            }
            for axis in if d == 2 { 2..3 } else { 0..3 } {
                pass(motion(Vector3::zeros(), Vector3::ith(axis, 1.0), &center));
            }
            return;
        };
        // Turns about the first support, as far as the others allow.
        let center = positions[first];
        let arms: Vec<Vector3<f64>> = supports.iter().map(|&s| positions[s] - center).collect();
        let longest =
            arms.iter().copied().fold(
                Vector3::zeros(),
                |a, b| {
                    if b.norm() > a.norm() { b } else { a }
                },
            );
        let reach = longest.norm();
        if reach == 0.0 {
            for axis in if d == 2 { 2..3 } else { 0..3 } {
                pass(motion(Vector3::zeros(), Vector3::ith(axis, 1.0), &center));
            }
        } else if d == 3
            && arms
                .iter()
                .all(|arm| arm.cross(&longest).norm() <= DEPENDENT * reach * reach)
        {
            pass(motion(Vector3::zeros(), longest / reach, &center));
        }
    }
}

/// x ← x − 2 v vᵀ x.
fn reflect(v: &DVector<f64>, mut x: nalgebra::DVectorViewMut<'_, f64>) {
    let along = 2.0 * v.dot(&x);
    x.axpy(-along, v, 1.0);
}

/// A validity test that also demands stability, at the end and in the middle of
/// each step.
#[derive(Clone, Debug)]
pub struct Stable<'a, M: ?Sized, V> {
    manifold: &'a M,
    stability: Stability<'a>,
    margin: Option<f64>,
    inner: V,
}

impl<'a, M: EquilibriumManifold + ?Sized, V: Validity> Stable<'a, M, V> {
    /// What `inner` accepts and all of whose stiffnesses exceed `margin` (force
    /// per length); without a margin all that `inner` accepts.
    pub fn new(manifold: &'a M, actuation: Actuation, margin: Option<f64>, inner: V) -> Self {
        Self {
            manifold,
            stability: Stability::new(manifold.structure(), actuation),
            margin,
            inner,
        }
    }

    /// The validity test inside.
    pub fn inner(&self) -> &V {
        &self.inner
    }

    /// The smallest stiffness of the equilibrium x and the margin demanded, where
    /// it does not exceed it.
    pub fn shortfall(&self, x: &[f64]) -> Option<(f64, f64)> {
        let configuration = self.manifold.configuration(x);
        let margin = self.margin?;
        if self.stability.exceeds(&configuration, margin) {
            return None;
        }
        let stiffness = self.stability.least_stiffness(&configuration);
        Some((stiffness.unwrap_or(f64::NAN), margin))
    }

    /// At the end of a step and in its middle.
    fn is_stable_step(&self, x: &[f64], between: &mut dyn FnMut(f64, &mut [f64]) -> bool) -> bool {
        if self.margin.is_none() {
            return true;
        }
        let mut middle = vec![0.0; x.len()];
        self.is_stable(x) && between(0.5, &mut middle) && self.is_stable(&middle)
    }

    fn is_stable(&self, x: &[f64]) -> bool {
        self.margin.is_none_or(|margin| {
            self.stability
                .exceeds(&self.manifold.configuration(x), margin)
        })
    }
}

impl<M: EquilibriumManifold + ?Sized, V: Validity> Validity for Stable<'_, M, V> {
    type Memory = V::Memory;

    fn memory(&self) -> Self::Memory {
        self.inner.memory()
    }

    fn enter(&self, x: &[f64], memory: &mut Self::Memory) {
        self.inner.enter(x, memory);
    }

    fn step(
        &self,
        from: &Self::Memory,
        x: &[f64],
        to: &mut Self::Memory,
        between: &mut dyn FnMut(f64, &mut [f64]) -> bool,
        violated: &mut Vec<usize>,
    ) -> Result<(), Obstruction> {
        self.inner.step(from, x, to, between, violated)?;
        if self.is_stable_step(x, between) {
            Ok(())
        } else {
            Err(Obstruction::Blocked)
        }
    }

    fn robust_step(
        &self,
        from: &Self::Memory,
        x: &[f64],
        to: &mut Self::Memory,
        between: &mut dyn FnMut(f64, &mut [f64]) -> bool,
    ) -> bool {
        self.inner.robust_step(from, x, to, between) && self.is_stable_step(x, between)
    }

    fn contact(&self, contact: usize, x: &[f64], row: &mut SparseRow) -> Option<f64> {
        self.inner.contact(contact, x, row)
    }

    fn displacement(&self, a: &[f64], b: &[f64]) -> f64 {
        self.inner.displacement(a, b)
    }

    fn is_valid(&self, x: &[f64]) -> bool {
        self.inner.is_valid(x) && self.is_stable(x)
    }
}
