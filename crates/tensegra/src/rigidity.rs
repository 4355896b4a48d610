//! What statics says of a structure at its start, in figures and in plain words.

use nalgebra::Vector3;
use tensegra_formfinding::{Loss, losses};
use tensegra_model::{
    Actuation, Configuration, Structure,
    statics::{
        AdmissibleMotions, EquilibriumMatrix, MatrixAnalysis, PrestressStability, StaticsError,
        StiffnessSpectrum, SuperStability, force_densities, geometric_stiffness, lumped_masses,
        material_stiffness, natural_frequencies,
    },
};

/// Elements tried one by one; beyond as many, the trial takes too long to be part of
/// a description.
const MOST_TRIALS: usize = 120;

/// A structure without an element folds where a node moves by more than this fraction of its size.
const FOLDED: f64 = 0.2;

/// A state of self-stress or the forces of a configuration, as force densities.
pub type Densities = Vec<f64>;

/// Statics of a structure in a configuration.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Rigidity {
    /// Size of the structure, [`Structure::size`].
    pub size: f64,
    /// Rigid motions that the supports leave.
    pub rigid_motions: usize,
    /// Rank of the equilibrium matrix.
    pub rank: usize,
    /// Its smallest singular value that counts and its largest that does not, over
    /// the largest.
    pub rank_gap: [f64; 2],
    /// Orthonormal states of self-stress (forces) of all elements, as force
    /// densities.
    pub self_stress: Vec<Densities>,
    /// Independent infinitesimal mechanisms: the displacement of every node.
    pub mechanisms: Vec<Vec<Vector3<f64>>>,
    /// Force densities of the configuration.
    pub force_densities: Densities,
    /// The tangent stiffness while motors hold rest lengths.
    pub length_controlled: StiffnessSpectrum,
    /// The tangent stiffness while motors hold forces.
    pub force_controlled: StiffnessSpectrum,
    /// The geometric stiffness on the mechanisms.
    pub prestress: PrestressStability,
    /// Whether no other shape exists.
    pub super_stability: SuperStability,
    /// The factor by which all forces could grow in this shape before it buckles;
    /// none where it never does while rest lengths are positive, or is unstable now.
    pub buckling_factor: Option<f64>,
    /// Natural frequencies, in cycles per unit of time; none where no masses are
    /// stated.
    pub frequencies: Option<Vec<f64>>,
    /// The element that can only pull and does so the least, with its force.
    pub loosest: Option<(usize, f64)>,
    /// What becomes of the structure without each element; none where that was not
    /// tried or makes no sense.
    pub losses: Vec<Option<Loss>>,
}

impl Rigidity {
    /// Analyses a configuration in equilibrium. Where no masses are given, those of
    /// the elements count, if they have any.
    ///
    /// # Errors
    /// [`StaticsError`] when an element has no length or positions are bad.
    pub fn new(
        structure: &Structure,
        configuration: &Configuration,
        masses: Option<&[f64]>,
    ) -> Result<Self, StaticsError> {
        let positions = &configuration.positions;
        let matrix = EquilibriumMatrix::new(structure, positions)?;
        let analysis = MatrixAnalysis::new(&matrix, positions);
        let (counts, does_not) = analysis.gap();
        let self_stress = analysis.self_stress.column_iter().map(|stress| {
            let mut densities = vec![0.0; structure.elements.len()];
            for (&e, force) in matrix.elements().iter().zip(stress.iter()) {
                densities[e] = force / configuration.lengths[e];
            }
            densities
        });
        let mechanisms = analysis
            .mechanisms
            .column_iter()
            .map(|motion| matrix.freedoms().displacements(motion.as_slice()));
        let length_controlled =
            StiffnessSpectrum::new(structure, configuration, Actuation::Length)?;
        let own_masses = match masses {
            Some(masses) => Some(masses.to_vec()),
            None => lumped_masses(structure),
        };
        let frequencies = own_masses.map(|masses| {
            natural_frequencies(structure, configuration, &masses, Actuation::Length)
        });
        let losses = if length_controlled.is_stable() && matrix.elements().len() <= MOST_TRIALS {
            losses(structure, configuration)
        } else {
            vec![None; structure.elements.len()]
        };
        let super_stability = SuperStability::new(structure, configuration)?;
        Ok(Self {
            size: structure.size(positions),
            rigid_motions: analysis.rigid_motions.ncols(),
            rank: analysis.rank,
            rank_gap: [counts, does_not],
            self_stress: self_stress.collect(),
            mechanisms: mechanisms.collect(),
            force_densities: force_densities(configuration),
            force_controlled: StiffnessSpectrum::new(structure, configuration, Actuation::Force)?,
            prestress: PrestressStability::new(structure, configuration, &matrix, &analysis)?,
            buckling_factor: if super_stability.is_super_stable() {
                None
            } else {
                buckling_factor(structure, configuration)?
            },
            super_stability,
            frequencies: frequencies.transpose()?,
            loosest: loosest(structure, configuration),
            losses,
            length_controlled,
        })
    }

    /// Elements without which the structure collapses.
    pub fn critical_elements(&self) -> Vec<usize> {
        self.elements(|loss| matches!(loss, Loss::Collapses))
    }

    /// Elements without which the structure folds into quite another shape, in which it is stable
    /// again.
    pub fn folding_elements(&self) -> Vec<usize> {
        let folds = FOLDED * self.size;
        self.elements(
            |loss| matches!(loss, Loss::Holds { displacement, .. } if *displacement > folds),
        )
    }

    /// Elements that the structure can do without: it stays stable, in a shape that is not far.
    pub fn dispensable_elements(&self) -> Vec<usize> {
        let folds = FOLDED * self.size;
        self.elements(
            |loss| matches!(loss, Loss::Holds { displacement, .. } if *displacement <= folds),
        )
    }

    fn elements(&self, which: impl Fn(&Loss) -> bool) -> Vec<usize> {
        let all = self.losses.iter().enumerate();
        all.filter(|(_, loss)| loss.as_ref().is_some_and(&which))
            .map(|(e, _)| e)
            .collect()
    }

    /// Plain words, a sentence each: what is rigid, what is a mechanism, whether
    /// prestress stabilises it, what would make it collapse.
    pub fn in_words(&self, structure: &Structure) -> Vec<String> {
        let mut words = vec![self.mechanisms_in_words(structure), self.stress_in_words()];
        words.extend(self.prestress_in_words());
        words.push(self.stability_in_words(structure));
        words.push(self.super_stability_in_words());
        words.extend(self.collapse_in_words(structure));
        words.extend(self.frequencies_in_words());
        words
    }

    fn mechanisms_in_words(&self, structure: &Structure) -> String {
        match self.mechanisms.as_slice() {
            [] => "Rigid: with elements of constant length nothing moves but the whole.".into(),
            [one] => format!(
                "Not rigid by itself: with elements of constant length it has 1 infinitesimal \
                 mechanism, which moves {}.",
                movers(structure, one)
            ),
            many => format!(
                "Not rigid by itself: with elements of constant length it has {} independent \
                 infinitesimal mechanisms.",
                many.len()
            ),
        }
    }

    fn stress_in_words(&self) -> String {
        match self.self_stress.len() {
            0 => "It cannot be prestressed in this shape.".into(),
            1 => "It can be prestressed in one way, up to scale.".into(),
            s => format!("It can be prestressed in {s} independent ways."),
        }
    }

    fn prestress_in_words(&self) -> Option<String> {
        let all = self.mechanisms.len();
        if all == 0 {
            return None;
        }
        let left = self.prestress.unstable_mechanisms();
        Some(match (left, all) {
            (0, 1) => "Its prestress stiffens the mechanism: prestress-stable.".into(),
            (0, _) => "Its prestress stiffens every mechanism: prestress-stable.".into(),
            (_, 1) => "Its prestress does not stiffen the mechanism.".into(),
            _ => format!("Its prestress leaves {left} of the {all} mechanisms without stiffness."),
        })
    }

    fn stability_in_words(&self, structure: &Structure) -> String {
        let stability = &self.length_controlled;
        let Some(least) = stability.least() else {
            return "Nothing moves: it is stable whatever the motors do.".into();
        };
        let held = if stability.is_stable() {
            format!(
                "Stable while motors hold rest lengths: the least stiffness is {least:.4}, in the \
                 motion of {}",
                movers(structure, &stability.softest)
            )
        } else {
            format!(
                "Not stable while motors hold rest lengths: {} no resistance (stiffness \
                 {least:.3e}), first of all {}",
                count(stability.soft_motions(), "motion meets", "motions meet"),
                movers(structure, &stability.softest)
            )
        };
        if !structure
            .elements
            .iter()
            .any(|element| element.is_actuated())
        {
            return format!("{held}.");
        }
        let forced = &self.force_controlled;
        let forced_least = forced.least().unwrap_or(0.0);
        if forced.is_stable() {
            format!(
                "{held}; stable too while they hold forces (least stiffness {forced_least:.4})."
            )
        } else {
            format!(
                "{held}. While they hold forces {} no resistance: motors have to hold lengths.",
                count(forced.soft_motions(), "motion meets", "motions meet"),
            )
        }
    }

    fn super_stability_in_words(&self) -> String {
        let s = &self.super_stability;
        if s.is_super_stable() {
            return "Super-stable: no other shape, in any dimension, has struts as long and cables \
                    as short; more prestress never makes it buckle."
                .into();
        }
        let mut reasons = Vec::new();
        if !s.is_positive_semidefinite() {
            reasons.push("its force-density matrix has a negative eigenvalue".to_owned());
        }
        if s.nullity != s.required_nullity {
            reasons.push(format!(
                "that matrix has nullity {}, not {}",
                s.nullity, s.required_nullity
            ));
        }
        if s.on_conic {
            reasons.push("the stressed directions lie on a conic at infinity".to_owned());
        }
        format!("Not super-stable: {}.", reasons.join("; "))
    }

    fn collapse_in_words(&self, structure: &Structure) -> Vec<String> {
        let mut words = Vec::new();
        if let Some(factor) = self.buckling_factor {
            words.push(format!(
                "It would buckle with {factor:.3} times its forces in this shape."
            ));
        }
        if let Some((element, force)) = self.loosest {
            let name = &structure.elements[element].name;
            words.push(match force > 0.0 {
                true => format!("The loosest is {name}, with a tension of {force:.4}."),
                false => format!("{name} is slack."),
            });
        }
        let fates = [
            ("it collapses", self.critical_elements()),
            ("it folds into quite another shape", self.folding_elements()),
            (
                "it stays stable, in a shape nearby,",
                self.dispensable_elements(),
            ),
        ];
        let tried: usize = fates.iter().map(|(_, elements)| elements.len()).sum();
        let clauses: Vec<String> = fates
            .iter()
            .filter(|(_, elements)| !elements.is_empty())
            .map(|(fate, elements)| match elements.len() {
                n if n == tried => format!("{fate} without any one of its elements"),
                1 => format!("{fate} without {}", names(structure, elements)),
                _ => format!("{fate} without any one of {}", names(structure, elements)),
            })
            .collect();
        if !clauses.is_empty() {
            words.push(format!(
                "Should an element break or a cable go slack: {}.",
                clauses.join("; ")
            ));
        }
        words
    }

    fn frequencies_in_words(&self) -> Option<String> {
        let frequencies = self.frequencies.as_ref()?;
        let first: Vec<String> = frequencies
            .iter()
            .take(6)
            .map(|f| format!("{f:.4}"))
            .collect();
        let more = if frequencies.len() > 6 { ", …" } else { "" };
        (!first.is_empty()).then(|| {
            format!(
                "Natural frequencies (cycles per unit of time): {}{more}.",
                first.join(", ")
            )
        })
    }
}

/// One of two endings, with the number before it.
fn count(n: usize, one: &str, many: &str) -> String {
    format!("{n} {}", if n == 1 { one } else { many })
}

/// Names of elements in a list.
fn names(structure: &Structure, elements: &[usize]) -> String {
    let names = elements
        .iter()
        .map(|&e| structure.elements[e].name.as_str());
    names.collect::<Vec<_>>().join(", ")
}

/// The nodes that move the most in a motion.
fn movers(structure: &Structure, motion: &[Vector3<f64>]) -> String {
    let largest = motion.iter().map(|v| v.norm()).fold(0.0, f64::max);
    let moving: Vec<&str> = structure
        .nodes
        .iter()
        .zip(motion)
        .filter(|(_, v)| largest > 0.0 && v.norm() > 0.5 * largest)
        .map(|(node, _)| node.name.as_str())
        .collect();
    match moving.len() {
        0 => "nothing".into(),
        n if n == structure.nodes.len() => "all nodes".into(),
        _ => moving.join(", "),
    }
}

/// The element that can only pull and does so the least.
fn loosest(structure: &Structure, configuration: &Configuration) -> Option<(usize, f64)> {
    let forces = configuration.forces.iter().enumerate();
    forces
        .filter(|(e, _)| structure.elements[*e].pulls_only())
        .filter_map(|(e, force)| Some((e, (*force)?)))
        .min_by(|a, b| a.1.total_cmp(&b.1))
}

/// The least factor above one by which forces make K_M + λ K_G singular on the
/// admissible motions.
fn buckling_factor(
    structure: &Structure,
    configuration: &Configuration,
) -> Result<Option<f64>, StaticsError> {
    let freedoms = tensegra_model::statics::Freedoms::new(structure);
    let positions = &configuration.positions;
    let motions = AdmissibleMotions::new(structure, positions, &freedoms, Actuation::Length)?;
    let material = material_stiffness(structure, configuration, &freedoms, Actuation::Length)?;
    let geometric = motions.reduce(geometric_stiffness(structure, configuration, &freedoms)?);
    let now = motions.reduce(material) + &geometric;
    let Some(cholesky) = now.cholesky().filter(|_| !geometric.is_empty()) else {
        return Ok(None);
    };
    // K + μ K_G is singular where −1/μ is an eigenvalue of L⁻¹ K_G L⁻ᵀ, K = L Lᵀ.
    let lower = cholesky.l_dirty();
    let half = lower.solve_lower_triangular(&geometric);
    let whole = half.and_then(|half| lower.solve_lower_triangular(&half.transpose()));
    let least = whole.map_or(0.0, |whole| whole.symmetric_eigenvalues().min());
    Ok((least < -1e-9).then(|| 1.0 - 1.0 / least))
}
