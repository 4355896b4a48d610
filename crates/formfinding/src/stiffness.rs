//! The least tangent stiffness of an equilibrium, and how it changes with the configuration.
//!
//! While rest lengths are held (length-controlled actuation), an equilibrium is stable when the
//! tangent stiffness
//!
//! ```text
//! K = Σ k u uᵀ + q (I − u uᵀ)
//! ```
//!
//! (elements with direction u, stiffness k and force density q; Guest, "The stiffness of
//! prestressed frameworks", 2006) is positive definite on the admissible displacements: those that
//! keep supports, elements of constant length, attachments and coupled orientations, and contain
//! no rigid motion. With an orthonormal basis Z of these the answer is the smallest eigenvalue λ of
//! ZᵀKZ.
//!
//! Its derivative for the eigenvector v is vᵀ dK v + 2 μᵀ dC v, where C v = 0 are the conditions
//! and μ their multipliers, Cᵀμ = λv − K v. The turning of coupled orientations is left out of it.
//!
//! Cost for n coordinates: O(n³).

use nalgebra::{DMatrix, DVector, Point3, SymmetricEigen, Vector3};
use tensegra_model::{Coupling, ForceLaw, Structure};

/// A condition shorter than this after orthogonalisation depends on the others.
const DEPENDENT: f64 = 1e-9;

/// Computes the least stiffness of configurations of one structure.
#[derive(Clone, Debug)]
pub struct LeastStiffness<'a> {
    structure: &'a Structure,
    /// First coordinate of each balanced node.
    coordinate: Vec<Option<usize>>,
    coordinates: usize,
    /// Pairs of nodes whose distance is constant.
    rigid: Vec<[usize; 2]>,
}

/// The least stiffness at a configuration.
#[derive(Clone, Debug)]
pub struct Softest {
    /// The smallest eigenvalue, in force per length.
    pub eigenvalue: f64,
    /// Its mode: the displacement of every node, of norm 1 in total.
    pub mode: Vec<Vector3<f64>>,
    /// Derivatives with respect to the vector of each element, from first to second node.
    pub by_vector: Vec<Vector3<f64>>,
    /// Derivatives with respect to the force density of each element.
    pub by_density: Vec<f64>,
    /// Derivatives with respect to the vectors between other nodes whose distance is constant.
    pub by_tie: Vec<([usize; 2], Vector3<f64>)>,
}

impl<'a> LeastStiffness<'a> {
    /// Prepares for a structure.
    pub fn new(structure: &'a Structure) -> Self {
        let mut coordinates = 0;
        let coordinate = structure
            .nodes
            .iter()
            .map(|node| {
                node.balanced.then(|| {
                    coordinates += structure.dimension;
                    coordinates - structure.dimension
                })
            })
            .collect();
        let elements = structure.elements.iter();
        let mut rigid: Vec<[usize; 2]> = elements
            .filter(|element| element.has_constant_length())
            .map(|element| element.nodes)
            .collect();
        for attachment in &structure.attachments {
            let [a, b, c] = attachment.anchors.map(|anchor| anchor.node);
            rigid.extend([[a, b], [b, c], [c, a]]);
        }
        Self {
            structure,
            coordinate,
            coordinates,
            rigid,
        }
    }

    /// The softest mode at node positions and force densities; `None` where nothing can move, or
    /// an element has no length.
    pub fn at(&self, positions: &[Point3<f64>], densities: &[f64]) -> Option<Softest> {
        let stiffness = self.tangent_stiffness(positions, densities)?;
        let conditions = self.conditions(positions)?;
        let basis = self.admissible(&conditions);
        if basis.is_empty() {
            return None;
        }
        let reduced = basis.transpose() * &stiffness * &basis;
        let eigen = SymmetricEigen::try_new(reduced, f64::EPSILON, 1000)?;
        let (index, &eigenvalue) = eigen
            .eigenvalues
            .iter()
            .enumerate()
            .min_by(|a, b| a.1.total_cmp(b.1))?;
        let vector: DVector<f64> = &basis * eigen.eigenvectors.column(index);
        eigenvalue
            .is_finite()
            .then(|| self.differentiate(positions, densities, &stiffness, eigenvalue, &vector))
    }

    fn tangent_stiffness(
        &self,
        positions: &[Point3<f64>],
        densities: &[f64],
    ) -> Option<DMatrix<f64>> {
        let dimension = self.structure.dimension;
        let mut stiffness = DMatrix::zeros(self.coordinates, self.coordinates);
        for (element, &density) in self.structure.elements.iter().zip(densities) {
            if !element.carries_force() {
                continue;
            }
            let [a, b] = element.nodes;
            let d = positions[b] - positions[a];
            let u = d.try_normalize(0.0)?;
            let excess = match element.law {
                ForceLaw::Linear { stiffness, .. } => stiffness - density,
                ForceLaw::None | ForceLaw::Free => -density,
            };
            for i in 0..dimension {
                for j in 0..dimension {
                    let mut entry = excess * u[i] * u[j];
                    if i == j {
                        entry += density;
                    }
                    let ends = [self.coordinate[a], self.coordinate[b]];
                    for (p, p_sign) in ends.into_iter().zip([1.0, -1.0]) {
                        for (q, q_sign) in ends.into_iter().zip([1.0, -1.0]) {
                            if let (Some(p), Some(q)) = (p, q) {
                                stiffness[(p + i, q + j)] += p_sign * q_sign * entry;
                            }
                        }
                    }
                }
            }
        }
        Some(stiffness)
    }

    /// The rows of C: first one for each pair of nodes at a constant distance (the vector between
    /// them), then orientations and rigid motions.
    fn conditions(&self, positions: &[Point3<f64>]) -> Option<Vec<DVector<f64>>> {
        let dimension = self.structure.dimension;
        let mut rows = Vec::with_capacity(self.rigid.len() + 6);
        let add = |row: &mut DVector<f64>, [a, b]: [usize; 2], rate: Vector3<f64>| {
            for (node, sign) in [(a, -1.0), (b, 1.0)] {
                if let Some(first) = self.coordinate[node] {
                    for axis in 0..dimension {
                        row[first + axis] += sign * rate[axis];
                    }
                }
            }
        };
        for &[a, b] in &self.rigid {
            let mut row = DVector::zeros(self.coordinates);
            add(&mut row, [a, b], positions[b] - positions[a]);
            rows.push(row);
        }
        for coupling in &self.structure.couplings {
            let Coupling::Orientation {
                reference,
                followers,
            } = coupling
            else {
                continue;
            };
            for (follower, rotation) in followers {
                for axis in 0..dimension {
                    let unit = Vector3::from_fn(|i, _| f64::from(u8::from(i == axis)));
                    let mut row = DVector::zeros(self.coordinates);
                    for (element, turn) in [
                        (*reference, unit),
                        (*follower, -(rotation.inverse() * unit)),
                    ] {
                        let [a, b] = self.structure.elements[element].nodes;
                        let d = positions[b] - positions[a];
                        let length = d.norm();
                        let u = d.try_normalize(0.0)?;
                        add(&mut row, [a, b], (turn - u * u.dot(&turn)) / length);
                    }
                    rows.push(row);
                }
            }
        }
        self.rigid_motions(positions, &mut rows);
        Some(rows)
    }

    /// Adds the rigid motions that leave the supports where they are.
    fn rigid_motions(&self, positions: &[Point3<f64>], rows: &mut Vec<DVector<f64>>) {
        let count = positions.len();
        let center = positions.iter().map(|p| p.coords).sum::<Vector3<f64>>() / count as f64;
        let arms: Vec<Vector3<f64>> = positions.iter().map(|p| p.coords - center).collect();
        let reach = arms
            .iter()
            .map(|arm| arm.norm())
            .fold(f64::MIN_POSITIVE, f64::max);
        let planar = self.structure.dimension == 2;
        let modes: &[usize] = if planar {
            &[0, 1, 5]
        } else {
            &[0, 1, 2, 3, 4, 5]
        };
        let velocity = |node: usize, mode: usize| {
            let unit = Vector3::from_fn(|i, _| f64::from(u8::from(i == mode % 3)));
            if mode < 3 {
                unit
            } else {
                unit.cross(&arms[node]) / reach
            }
        };
        let supports: Vec<usize> = (0..count)
            .filter(|&node| self.coordinate[node].is_none())
            .collect();
        // The motion of the supports as a quadratic form on the motions: its null space is free.
        let form = DMatrix::<f64>::from_fn(modes.len(), modes.len(), |i, j| {
            supports
                .iter()
                .map(|&node| velocity(node, modes[i]).dot(&velocity(node, modes[j])))
                .sum::<f64>()
        });
        let eigen = form.symmetric_eigen();
        for (index, &value) in eigen.eigenvalues.iter().enumerate() {
            if value > DEPENDENT {
                continue;
            }
            let mut row = DVector::zeros(self.coordinates);
            for (node, first) in self.coordinate.iter().enumerate() {
                if let Some(first) = first {
                    let motion = modes
                        .iter()
                        .zip(eigen.eigenvectors.column(index).iter())
                        .map(|(&mode, share)| velocity(node, mode) * *share)
                        .sum::<Vector3<f64>>();
                    for axis in 0..self.structure.dimension {
                        row[first + axis] = motion[axis];
                    }
                }
            }
            rows.push(row);
        }
    }

    /// An orthonormal basis of the displacements that meet the conditions.
    fn admissible(&self, conditions: &[DVector<f64>]) -> DMatrix<f64> {
        let n = self.coordinates;
        let mut basis: Vec<DVector<f64>> = Vec::with_capacity(n);
        for row in conditions {
            extend(&mut basis, row.clone(), DEPENDENT);
        }
        let held = basis.len();
        if held == 0 {
            return DMatrix::identity(n, n);
        }
        // The complement from the coordinate axes, the least constrained first.
        let mut remains: Vec<(f64, usize)> = (0..n)
            .map(|i| (basis.iter().map(|row| row[i] * row[i]).sum(), i))
            .collect();
        remains.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        for dependent in [0.1, 1e-4] {
            for &(_, i) in &remains {
                if basis.len() == n {
                    break;
                }
                let mut axis = DVector::zeros(n);
                axis[i] = 1.0;
                extend(&mut basis, axis, dependent);
            }
        }
        if basis.len() == held {
            return DMatrix::zeros(n, 0);
        }
        DMatrix::from_columns(&basis[held..])
    }

    fn differentiate(
        &self,
        positions: &[Point3<f64>],
        densities: &[f64],
        stiffness: &DMatrix<f64>,
        eigenvalue: f64,
        vector: &DVector<f64>,
    ) -> Softest {
        let mode: Vec<Vector3<f64>> = self
            .coordinate
            .iter()
            .map(|first| match first {
                None => Vector3::zeros(),
                Some(first) => Vector3::from_fn(|axis, _| {
                    if axis < self.structure.dimension {
                        vector[first + axis]
                    } else {
                        0.0
                    }
                }),
            })
            .collect();
        let multipliers = self.multipliers(positions, stiffness, eigenvalue, vector);
        let mut by_vector = Vec::with_capacity(densities.len());
        let mut by_density = Vec::with_capacity(densities.len());
        for (element, &density) in self.structure.elements.iter().zip(densities) {
            let [a, b] = element.nodes;
            let d = positions[b] - positions[a];
            let length = d.norm();
            let relative = mode[b] - mode[a];
            let along = relative.dot(&d) / length;
            let excess = match element.law {
                ForceLaw::Linear { stiffness, .. } => stiffness - density,
                ForceLaw::Free => -density,
                ForceLaw::None => 0.0,
            };
            let across = relative - d * (along / length);
            by_vector.push(across * (2.0 * excess * along / length));
            by_density.push(if element.carries_force() {
                across.norm_squared()
            } else {
                0.0
            });
        }
        let by_tie = self
            .rigid
            .iter()
            .zip(multipliers.iter())
            .map(|(&[a, b], &multiplier)| ([a, b], (mode[b] - mode[a]) * (2.0 * multiplier)))
            .collect();
        Softest {
            eigenvalue,
            mode,
            by_vector,
            by_density,
            by_tie,
        }
    }

    /// Multipliers of the constant distances.
    fn multipliers(
        &self,
        positions: &[Point3<f64>],
        stiffness: &DMatrix<f64>,
        eigenvalue: f64,
        vector: &DVector<f64>,
    ) -> DVector<f64> {
        if self.rigid.is_empty() {
            return DVector::zeros(0);
        }
        let Some(rows) = self.conditions(positions) else {
            return DVector::zeros(self.rigid.len());
        };
        let transposed = DMatrix::from_columns(&rows);
        let right = vector * eigenvalue - stiffness * vector;
        let normal = transposed.transpose() * &transposed;
        let cutoff = 1e-12 * normal.norm();
        normal
            .svd(true, true)
            .solve(&(transposed.transpose() * right), cutoff)
            .unwrap_or_else(|_| DVector::zeros(rows.len()))
    }
}

/// Orthonormalises a vector against a basis and adds it, if what is left of it is long enough.
fn extend(basis: &mut Vec<DVector<f64>>, mut vector: DVector<f64>, dependent: f64) {
    let norm = vector.norm();
    if norm == 0.0 {
        return;
    }
    vector /= norm;
    // Twice is enough for orthogonality to rounding.
    for _ in 0..2 {
        for other in basis.iter() {
            let share = other.dot(&vector);
            vector.axpy(-share, other, 1.0);
        }
    }
    let rest = vector.norm();
    if rest > dependent {
        basis.push(vector / rest);
    }
}
