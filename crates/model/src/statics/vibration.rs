//! Small free vibrations about an equilibrium, with masses lumped at the nodes.

use nalgebra::DMatrix;

use super::{
    Actuation, AdmissibleMotions, Freedoms, StaticsError,
    equilibrium::{check_count, check_positions},
    geometric_stiffness, material_stiffness,
    spectrum::ascending,
};
use crate::{configuration::Configuration, structure::Structure};

/// The mass of every node: its own, and half of the mass of each of its elements
/// (`dynamics`, keyword `mass`); none where no mass is stated at all.
pub fn lumped_masses(structure: &Structure) -> Option<Vec<f64>> {
    let mut masses: Vec<f64> = structure.nodes.iter().map(|node| node.mass).collect();
    for element in &structure.elements {
        let mass = element
            .dynamics
            .iter()
            .find(|(keyword, _)| keyword == "mass")
            .and_then(|(_, values)| values.first());
        if let Some(mass) = mass {
            element
                .nodes
                .iter()
                .for_each(|&node| masses[node] += mass / 2.0);
        }
    }
    masses.iter().any(|mass| *mass > 0.0).then_some(masses)
}

/// Natural frequencies of the admissible motions in ascending order: cycles per
/// unit of time, where K φ = ω² M φ and f = ω / 2π. Rigid motions, which have none,
/// are left out. An unstable motion counts as negative: −f is then the rate of its
/// growth over 2π.
///
/// Cost: some 10 n³ for n freedoms.
///
/// # Units
/// One kilogram, newton and metre give hertz; in general, force = mass · length /
/// time².
///
/// # Errors
/// [`StaticsError`] when an element has no length, positions are bad, masses are
/// not one for each node, or a node that moves has none.
pub fn natural_frequencies(
    structure: &Structure,
    configuration: &Configuration,
    masses: &[f64],
    actuation: Actuation,
) -> Result<Vec<f64>, StaticsError> {
    let positions = &configuration.positions;
    check_positions(structure, positions)?;
    check_count("masses", masses.len(), structure.nodes.len())?;
    let freedoms = Freedoms::new(structure);
    let massless = freedoms.coordinates().iter().find(|[node, _]| {
        let mass = masses[*node];
        !(mass > 0.0 && mass.is_finite())
    });
    if let Some(&[node, _]) = massless {
        let node = structure.nodes[node].name.clone();
        return Err(StaticsError::NoMass { node });
    }
    let weigh = |mut columns: DMatrix<f64>| {
        for (i, [node, _]) in freedoms.coordinates().iter().enumerate() {
            columns.row_mut(i).scale_mut(masses[*node]);
        }
        columns
    };
    // Vibrations are orthogonal to neutral motions in the metric of the masses:
    // neither momentum nor angular momentum changes.
    let neutral = weigh(freedoms.neutral_motions(structure, positions));
    let motions = AdmissibleMotions::without(structure, positions, &freedoms, actuation, &neutral);
    let stiffness = material_stiffness(structure, configuration, &freedoms, actuation)?
        + geometric_stiffness(structure, configuration, &freedoms)?;
    let basis = motions.basis();
    let mass = basis.tr_mul(&weigh(basis.clone()));
    let stiffness = motions.reduce(stiffness);
    // L⁻¹ K L⁻ᵀ with M = L Lᵀ, which is positive definite as all masses are.
    let Some(cholesky) = mass.cholesky() else {
        return Ok(Vec::new());
    };
    let lower = cholesky.l_dirty();
    let half = lower.solve_lower_triangular(&stiffness);
    let whole = half.and_then(|half| lower.solve_lower_triangular(&half.transpose()));
    let (squares, _) = ascending(whole.unwrap_or_default());
    let frequency = |square: f64| square.signum() * square.abs().sqrt() / std::f64::consts::TAU;
    Ok(squares.into_iter().map(frequency).collect())
}
