//! Stability of equilibria: the smallest eigenvalue of the tangent stiffness on the
//! motions that a structure admits, and how it changes with the configuration.
//!
//! An equilibrium whose tangent stiffness is positive definite on these motions is a
//! strict minimum of the potential energy.
//!
//! Cost for n freedoms and r constraints: 4 n² r operations, and (n − r)³ / 3 for a test
//! by Cholesky's factorisation or about 4 (n − r)³ / 3 for the eigenvalues.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn, Point3, SymmetricEigen, Vector3};

use super::{
    Actuation, AdmissibleMotions, Freedoms, StaticsError, geometric_stiffness, material_stiffness,
    motions::{Kept, constraints},
    stiffness::tangent,
};
use crate::{
    configuration::{Configuration, Path},
    structure::Structure,
};

/// The stability of the equilibria of one structure.
///
/// # Examples
/// ```
/// use nalgebra::Point3;
/// use tensegra_model::{Actuation, Configuration, Stability, StructureBuilder};
///
/// // A node between two taut cables of stiffness 3 with tension 1: along them both cables
/// // resist, across them their tension does.
/// let structure = StructureBuilder::planar()
///     .cable("left", ["a", "b"], 0.0..=9.0, 3.0, 0.0..=2.0)
///     .cable("right", ["b", "c"], 0.0..=9.0, 3.0, 0.0..=2.0)
///     .support("a")
///     .support("c")
///     .build()?;
/// let configuration = Configuration {
///     positions: [0.0, 1.0, 2.0].map(|x| Point3::new(x, 0.0, 0.0)).to_vec(),
///     lengths: vec![1.0; 2],
///     rest_lengths: vec![Some(2.0 / 3.0); 2],
///     forces: vec![Some(1.0); 2],
/// };
/// let stability = Stability::new(&structure, Actuation::Length);
/// assert!((stability.least_stiffness(&configuration).unwrap() - 2.0).abs() < 1e-12);
/// assert!(stability.exceeds(&configuration, 1.9) && !stability.exceeds(&configuration, 2.1));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct Stability<'a> {
    structure: &'a Structure,
    actuation: Actuation,
    freedoms: Freedoms,
}

/// The softest motion of a configuration, and how its stiffness changes.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Softest {
    /// The smallest eigenvalue, in force per length.
    pub eigenvalue: f64,
    /// Its motion: the displacement of every node, of norm one in total.
    pub motion: Vec<Vector3<f64>>,
    /// Derivatives by the vector of each element, from its first to its second node.
    pub by_vector: Vec<Vector3<f64>>,
    /// Derivatives by the force density of each element.
    pub by_density: Vec<f64>,
    /// Derivatives by the vectors between nodes whose distance is constant.
    pub by_tie: Vec<([usize; 2], Vector3<f64>)>,
}

impl<'a> Stability<'a> {
    /// The stability of a structure whose motors act in the given way.
    pub fn new(structure: &'a Structure, actuation: Actuation) -> Self {
        Self {
            structure,
            actuation,
            freedoms: Freedoms::new(structure),
        }
    }

    /// The smallest eigenvalue of the tangent stiffness on admissible motions;
    /// `None` where there are no such motions, or an element has no length.
    ///
    /// # Units
    /// Force per length.
    pub fn least_stiffness(&self, configuration: &Configuration) -> Option<f64> {
        let stiffness = self.reduced(configuration).ok()?;
        if stiffness.is_empty() {
            return None;
        }
        let least = SymmetricEigen::try_new(stiffness, 1e-14, 1000)?
            .eigenvalues
            .min();
        least.is_finite().then_some(least)
    }

    /// Whether all eigenvalues exceed `margin`. Cheaper than the eigenvalues.
    pub fn exceeds(&self, configuration: &Configuration, margin: f64) -> bool {
        let Ok(mut stiffness) = self.reduced(configuration) else {
            return true;
        };
        for i in 0..stiffness.nrows() {
            stiffness[(i, i)] -= margin;
        }
        stiffness.is_empty() || Cholesky::<f64, Dyn>::new(stiffness).is_some()
    }

    /// The smallest eigenvalue along a path, and the index of the configuration
    /// that has it.
    pub fn least_along(&self, path: &Path) -> Option<(usize, f64)> {
        let configurations = path.configurations.iter().enumerate();
        configurations
            .filter_map(|(i, configuration)| Some((i, self.least_stiffness(configuration)?)))
            .min_by(|a, b| a.1.total_cmp(&b.1))
    }

    /// The tangent stiffness on the admissible motions.
    fn reduced(&self, configuration: &Configuration) -> Result<DMatrix<f64>, StaticsError> {
        let Self {
            structure,
            actuation,
            freedoms,
        } = self;
        let positions = &configuration.positions;
        let motions = AdmissibleMotions::new(structure, positions, freedoms, *actuation)?;
        let stiffness = material_stiffness(structure, configuration, freedoms, *actuation)?
            + geometric_stiffness(structure, configuration, freedoms)?;
        Ok(motions.reduce(stiffness))
    }

    /// The softest motion at node positions and force densities, with the derivatives of its
    /// stiffness; `None` where nothing can move, or an element has no length. Cables count as
    /// taut whatever their force, so that a search may pass through slack ones.
    ///
    /// With the eigenvector v they are vᵀ dK v + 2 μᵀ dC v, where C v = 0 are the constraints and
    /// μ their multipliers, Cᵀ μ = λ v − K v. The turning of coupled orientations and of neutral
    /// motions is left out of it.
    pub fn softest(&self, positions: &[Point3<f64>], densities: &[f64]) -> Option<Softest> {
        let Self {
            structure,
            actuation,
            freedoms,
        } = self;
        let motions = AdmissibleMotions::new(structure, positions, freedoms, *actuation).ok()?;
        if motions.count() == 0 {
            return None;
        }
        let stiffness = tangent(structure, positions, freedoms, *actuation, densities).ok()?;
        let reduced = motions.reduce(stiffness.clone());
        let eigen = SymmetricEigen::try_new(reduced, f64::EPSILON, 1000)?;
        let (index, eigenvalue) = eigen.eigenvalues.argmin();
        if !eigenvalue.is_finite() {
            return None;
        }
        let vector = motions.motion(eigen.eigenvectors.column(index).as_slice());
        let motion = freedoms.displacements(vector.as_slice());
        let (mut by_vector, mut by_density) = (Vec::new(), Vec::new());
        for (element, &density) in structure.elements.iter().zip(densities) {
            let [a, b] = element.nodes;
            let d = positions[b] - positions[a];
            let length = d.norm();
            let relative = motion[b] - motion[a];
            let along = relative.dot(&d) / length;
            let across = relative - d * (along / length);
            let (excess, by) = match element.carries_force() {
                true => {
                    let stiffness = super::stiffness::axial(element, *actuation);
                    (stiffness - density, across.norm_squared())
                }
                false => (0.0, 0.0),
            };
            by_vector.push(across * (2.0 * excess * along / length));
            by_density.push(by);
        }
        let residual = &vector * eigenvalue - stiffness * &vector;
        let by_tie = self.ties(positions, &motion, &residual);
        Some(Softest {
            eigenvalue,
            motion,
            by_vector,
            by_density,
            by_tie,
        })
    }

    /// The derivatives 2 μ (v_b − v_a) by the vectors d of constant distances, with the
    /// multipliers μ of d · (v_b − v_a) = 0 that give `residual`.
    fn ties(
        &self,
        positions: &[Point3<f64>],
        motion: &[Vector3<f64>],
        residual: &DVector<f64>,
    ) -> Vec<([usize; 2], Vector3<f64>)> {
        let (mut kept, mut rows) = (Vec::new(), Vec::new());
        let (structure, freedoms) = (self.structure, &self.freedoms);
        constraints(
            structure,
            positions,
            freedoms,
            self.actuation,
            |what, row| {
                kept.push(what);
                rows.push(row);
            },
        );
        if !kept.iter().any(|kept| matches!(kept, Kept::Distance(_))) {
            return Vec::new();
        }
        let neutral = freedoms.neutral_motions(structure, positions);
        rows.extend(neutral.column_iter().map(|column| column.into_owned()));
        let transposed = DMatrix::from_columns(&rows);
        let normal = transposed.tr_mul(&transposed);
        let cutoff = 1e-12 * normal.norm();
        let right = transposed.tr_mul(residual);
        let Ok(multipliers) = normal.svd(true, true).solve(&right, cutoff) else {
            return Vec::new();
        };
        let ties = kept.iter().zip(multipliers.iter());
        ties.filter_map(|(kept, multiplier)| {
            let &Kept::Distance([a, b]) = kept else {
                return None;
            };
            // The constraint is d · (v_b − v_a) over the norm of its gradient.
            let mut row = vec![0.0; freedoms.len()];
            let d = positions[b] - positions[a];
            freedoms.add_relative(&mut row, [a, b], d, 1.0);
            let size = row.iter().map(|x| x * x).sum::<f64>().sqrt();
            Some(([a, b], (motion[b] - motion[a]) * (2.0 * multiplier / size)))
        })
        .collect()
    }
}
