//! Super-stability: no other configuration in any dimension keeps every strut as
//! long and every cable as short (Connelly 1982).

use nalgebra::{DMatrix, Vector3};

use super::{
    Freedoms, StaticsError, basis::span, force_densities, force_density_matrix, spectrum::ascending,
};
use crate::{configuration::Configuration, structure::Structure};

/// Eigenvalues below this fraction of the largest count as zero.
const ZERO: f64 = 1e-8;

/// The three conditions of super-stability, judged by the force densities of a
/// configuration in equilibrium: the force-density matrix D is positive
/// semidefinite; its null space holds affine images of the structure and nothing
/// else; and no such image keeps the lengths, which is so unless the directions of
/// the stressed elements lie on a conic at infinity.
///
/// With supports, D is that of the other nodes and affine images leave the
/// supports in place. Super-stability holds for every stiffness of the elements and
/// every level of the prestress.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct SuperStability {
    /// Eigenvalues of D in ascending order, in force per length.
    pub eigenvalues: Vec<f64>,
    /// How many of them are zero.
    pub nullity: usize,
    /// How many have to be: d + 1 for a structure without supports that spans its
    /// space of dimension d.
    pub required_nullity: usize,
    /// Whether the directions of the stressed elements lie on a conic at infinity.
    pub on_conic: bool,
}

impl SuperStability {
    /// Judges a configuration. Cost: some 10 N³ for N nodes.
    ///
    /// # Errors
    /// [`StaticsError`] when positions are bad.
    pub fn new(structure: &Structure, configuration: &Configuration) -> Result<Self, StaticsError> {
        let positions = &configuration.positions;
        super::equilibrium::check_positions(structure, positions)?;
        let densities = force_densities(configuration);
        let freedoms = Freedoms::new(structure);
        let loaded = (0..structure.nodes.len()).filter(|&node| freedoms.is_loaded(node));
        let (free, supports): (Vec<usize>, Vec<usize>) =
            loaded.partition(|&node| structure.nodes[node].balanced);
        let whole = force_density_matrix(structure, &densities);
        let matrix = DMatrix::from_fn(free.len(), free.len(), |i, j| whole[(free[i], free[j])]);
        let (eigenvalues, _) = ascending(matrix);
        let largest = eigenvalues
            .iter()
            .fold(0.0_f64, |l, value| l.max(value.abs()));
        let zero = |value: &&f64| value.abs() <= ZERO * largest;
        let nullity = eigenvalues.iter().filter(zero).count();

        let affine = |nodes: &mut dyn Iterator<Item = usize>| {
            let nodes: Vec<usize> = nodes.collect();
            let arms = DMatrix::from_fn(3, nodes.len().saturating_sub(1), |axis, i| {
                positions[nodes[i + 1]][axis] - positions[nodes[0]][axis]
            });
            span(arms, 1e-7)
        };
        // Affine images are as many as the structure, with its supports, has
        // dimensions that the supports do not span; without supports, one more for
        // each translation, which makes the constant functions one more.
        let all = affine(&mut free.iter().chain(&supports).copied());
        let held = affine(&mut supports.iter().copied());
        let required_nullity = match supports.len() {
            0 => all.ncols() + 1,
            _ => all.ncols() - held.ncols(),
        };

        // Quadratic forms Q with uᵀ Q u = 0 for all directions u of stressed
        // elements, and wᵀ Q w' = 0 on what the supports span.
        let strongest = densities.iter().fold(0.0_f64, |l, q| l.max(q.abs()));
        let d = all.ncols();
        let within = |vector: Vector3<f64>| all.transpose() * vector;
        let mut products: Vec<Vec<f64>> = Vec::new();
        let mut enter = |v: &nalgebra::DVector<f64>, w: &nalgebra::DVector<f64>| {
            let pairs = (0..d).flat_map(|i| (i..d).map(move |j| (i, j)));
            products.push(pairs.map(|(i, j)| v[i] * w[j] + v[j] * w[i]).collect());
        };
        for (element, &density) in structure.elements.iter().zip(&densities) {
            let [a, b] = element.nodes;
            if density.abs() > ZERO * strongest {
                let u = within((positions[b] - positions[a]).normalize());
                enter(&u, &u);
            }
        }
        for i in 0..held.ncols() {
            for j in i..held.ncols() {
                let arm = |k: usize| within(held.fixed_view::<3, 1>(0, k).into_owned());
                enter(&arm(i), &arm(j));
            }
        }
        let forms = d * (d + 1) / 2;
        let rows = DMatrix::from_fn(forms, products.len(), |i, j| products[j][i]);
        Ok(Self {
            eigenvalues,
            nullity,
            required_nullity,
            on_conic: span(rows, 1e-7).ncols() < forms,
        })
    }

    /// Whether the force-density matrix has no negative eigenvalue.
    pub fn is_positive_semidefinite(&self) -> bool {
        let largest = self.eigenvalues.last().copied().unwrap_or(0.0);
        let least = self.eigenvalues.first().copied().unwrap_or(0.0);
        least >= -ZERO * largest && largest >= 0.0
    }

    /// Whether all three conditions hold.
    pub fn is_super_stable(&self) -> bool {
        self.is_positive_semidefinite() && self.nullity == self.required_nullity && !self.on_conic
    }
}
