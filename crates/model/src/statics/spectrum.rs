//! Whether an equilibrium is stable: the tangent stiffness on the motions that
//! the structure admits, and the geometric stiffness on its mechanisms.

use nalgebra::{DMatrix, Point3, Vector3};

use super::{
    EquilibriumMatrix, Freedoms, MatrixAnalysis, StaticsError,
    basis::{complement, span},
    geometric_stiffness, material_stiffness,
};
use crate::{
    configuration::Configuration,
    stability::Actuation,
    structure::{Coupling, Structure},
};

/// Constraints of which less than this fraction is new depend on the others.
const DEPENDENT: f64 = 1e-9;
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
        let motions = admissible_motions(structure, &configuration.positions, &freedoms)?;
        let stiffness = material_stiffness(structure, configuration, &freedoms, actuation)?
            + geometric_stiffness(structure, configuration, &freedoms)?;
        let reduced = motions.transpose() * stiffness * &motions;
        let (eigenvalues, vectors) = ascending(reduced);
        let softest = match vectors.ncols() {
            0 => vec![Vector3::zeros(); structure.nodes.len()],
            _ => freedoms.displacements((&motions * vectors.column(0)).as_slice()),
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

/// An orthonormal basis of the motions of the freedoms that keep every constant
/// length, attachment and coupled orientation, and that are orthogonal to the
/// neutral motions of the whole: a column each. Cost: some 3 n³ for n freedoms.
///
/// # Errors
/// [`StaticsError`] when positions are not finite or not one for each node.
pub fn admissible_motions(
    structure: &Structure,
    positions: &[Point3<f64>],
    freedoms: &Freedoms,
) -> Result<DMatrix<f64>, StaticsError> {
    super::equilibrium::check_positions(structure, positions)?;
    let neutral = freedoms.neutral_motions(structure, positions);
    Ok(motions_without(structure, positions, freedoms, &neutral))
}

/// The motions that keep all constraints and are orthogonal to `excluded`.
pub(super) fn motions_without(
    structure: &Structure,
    positions: &[Point3<f64>],
    freedoms: &Freedoms,
    excluded: &DMatrix<f64>,
) -> DMatrix<f64> {
    let mut rows: Vec<Vec<f64>> = excluded
        .column_iter()
        .map(|column| column.iter().copied().collect())
        .collect();
    let mut constrain = |terms: &[([usize; 2], Vector3<f64>)]| {
        // Nodes that no force reaches follow the others.
        if terms
            .iter()
            .any(|(nodes, _)| !nodes.iter().all(|&node| freedoms.is_loaded(node)))
        {
            return;
        }
        let mut row = vec![0.0; freedoms.len()];
        for (nodes, direction) in terms {
            freedoms.add_relative(&mut row, *nodes, *direction, 1.0);
        }
        let norm = row.iter().map(|x| x * x).sum::<f64>().sqrt();
        if norm > 0.0 {
            row.iter_mut().for_each(|x| *x /= norm);
            rows.push(row);
        }
    };
    let unit = |[a, b]: [usize; 2]| (positions[b] - positions[a]).try_normalize(0.0);
    for element in &structure.elements {
        if let (true, Some(u)) = (element.has_constant_length(), unit(element.nodes)) {
            constrain(&[(element.nodes, u)]);
        }
    }
    for attachment in &structure.attachments {
        let [a, b, c] = attachment.anchors.map(|anchor| anchor.node);
        for nodes in [[a, b], [b, c], [c, a]] {
            if let Some(u) = unit(nodes) {
                constrain(&[(nodes, u)]);
            }
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
                    constrain(&[first, second]);
                }
            }
        }
    }
    let columns = DMatrix::from_fn(freedoms.len(), rows.len(), |i, j| rows[j][i]);
    complement(&span(columns, DEPENDENT))
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
