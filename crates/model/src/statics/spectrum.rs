//! Whether an equilibrium is stable: the tangent stiffness on the motions that
//! the structure admits, and the geometric stiffness on its mechanisms.

use nalgebra::{DMatrix, Vector3};

use super::{
    Actuation, AdmissibleMotions, EquilibriumMatrix, Freedoms, MatrixAnalysis, StaticsError,
    geometric_stiffness, material_stiffness,
};
use crate::{configuration::Configuration, structure::Structure};

/// A stiffness below this fraction of the largest is none.
const NO_STIFFNESS: f64 = 1e-9;

/// The tangent stiffness on the admissible motions, by its eigenvalues. Positive
/// ones alone mean a strict minimum of the potential energy.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct StiffnessSpectrum {
    /// What the motors do.
    pub actuation: Actuation,
    /// Eigenvalues in ascending order, in force per length; none where nothing
    /// moves.
    pub eigenvalues: Vec<f64>,
    /// The displacement of every node in the softest motion, of norm one; all zero
    /// where nothing moves.
    pub softest: Vec<Vector3<f64>>,
}

impl StiffnessSpectrum {
    /// The spectrum of a configuration in equilibrium. Cost: some 10 n³ for n
    /// freedoms.
    ///
    /// # Errors
    /// [`StaticsError`] when an element has no length or positions are bad.
    pub fn new(
        structure: &Structure,
        configuration: &Configuration,
        actuation: Actuation,
    ) -> Result<Self, StaticsError> {
        let freedoms = Freedoms::new(structure);
        let positions = &configuration.positions;
        let motions = AdmissibleMotions::new(structure, positions, &freedoms, actuation)?;
        let stiffness = material_stiffness(structure, configuration, &freedoms, actuation)?
            + geometric_stiffness(structure, configuration, &freedoms)?;
        let (eigenvalues, vectors) = ascending(motions.reduce(stiffness));
        let softest = match vectors.ncols() {
            0 => vec![Vector3::zeros(); structure.nodes.len()],
            _ => {
                let softest = motions.motion(vectors.column(0).as_slice());
                freedoms.displacements(softest.as_slice())
            }
        };
        Ok(Self {
            actuation,
            eigenvalues,
            softest,
        })
    }

    /// The smallest eigenvalue; none where nothing moves.
    pub fn least(&self) -> Option<f64> {
        self.eigenvalues.first().copied()
    }

    /// Whether every admissible motion meets resistance.
    pub fn is_stable(&self) -> bool {
        self.soft_motions() == 0
    }

    /// How many independent motions meet none.
    pub fn soft_motions(&self) -> usize {
        count_soft(&self.eigenvalues)
    }
}

/// What the prestress does to the mechanisms: the eigenvalues of Mᵀ K_G M, where
/// the columns of M are the mechanisms. All positive: the prestress stabilises
/// them, whatever the stiffness of the elements.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct PrestressStability {
    /// Eigenvalues in ascending order, one for each mechanism, in force per length.
    pub eigenvalues: Vec<f64>,
}

impl PrestressStability {
    /// What the forces of a configuration do to the mechanisms of its structure.
    ///
    /// # Errors
    /// [`StaticsError`] when an element has no length.
    pub fn new(
        structure: &Structure,
        configuration: &Configuration,
        matrix: &EquilibriumMatrix,
        analysis: &MatrixAnalysis,
    ) -> Result<Self, StaticsError> {
        let stiffness = geometric_stiffness(structure, configuration, matrix.freedoms())?;
        let mechanisms = &analysis.mechanisms;
        let (eigenvalues, _) = ascending(mechanisms.transpose() * stiffness * mechanisms);
        Ok(Self { eigenvalues })
    }

    /// Whether the prestress stiffens every mechanism; true where there is none.
    pub fn is_stable(&self) -> bool {
        self.unstable_mechanisms() == 0
    }

    /// How many mechanisms it leaves alone or drives on.
    pub fn unstable_mechanisms(&self) -> usize {
        count_soft(&self.eigenvalues)
    }
}

fn count_soft(ascending: &[f64]) -> usize {
    let largest = ascending
        .iter()
        .fold(0.0_f64, |l, value| l.max(value.abs()));
    let soft = |value: &&f64| !(**value > NO_STIFFNESS * largest);
    ascending.iter().take_while(soft).count()
}

/// Eigenvalues in ascending order, with their vectors.
pub(super) fn ascending(symmetric: DMatrix<f64>) -> (Vec<f64>, DMatrix<f64>) {
    if symmetric.is_empty() {
        return (Vec::new(), symmetric);
    }
    let eigen = symmetric.symmetric_eigen();
    let values = eigen.eigenvalues;
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|&i, &j| values[i].total_cmp(&values[j]));
    let sorted = order.iter().map(|&i| values[i]).collect();
    (sorted, eigen.eigenvectors.select_columns(&order))
}
