//! The worst-case rigidity index λ/tr M of a framework and its derivatives, also where the
//! eigenvalue is repeated.
//!
//! M = RᵀR with the standard rigidity matrix R, and λ is the smallest eigenvalue besides those of
//! the rigid motions (λ₇ in space, λ₄ in the plane). The index does not depend on the size of the
//! robot and is at most 1/(3n − 6). Source: equations (16) and (17) of Usevitch et al., after
//! Trinh et al. (2016), with tr M in both places where the printed equation mixes two scalings
//! (tr M = 2 Σ L²: see [`IndexScale`]).
//!
//! Where λ has multiplicity m > 1 it is not differentiable: its one-sided derivative along v is
//! the smallest eigenvalue of the m × m matrix Vᵀ (dM·v) V, with the eigenvectors V of the cluster
//! ([`RigiditySpectrum::directional_derivative`]). Optimisation uses a smooth lower bound instead,
//! the p-norm mean (Σ μᵢ^−p)^(−1/p) over all non-rigid eigenvalues μᵢ = λᵢ/tr M: it is never above
//! the index, within 5 % of it for a double eigenvalue, and its gradient is exact everywhere
//! because a cluster enters it through the trace of that same matrix.
//!
//! Cost: one symmetric eigenvalue decomposition of order d·n, and O(n_L) for each eigenvector.

use nalgebra::{DMatrix, SymmetricEigen, Vector3};

use crate::rigidity::rigid_motion_basis;
use crate::{Dimension, Framework, Graph};

/// The power p of the smooth lower bound.
const POWER: f64 = 16.0;

/// By what the smallest non-rigid eigenvalue is divided.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum IndexScale {
    /// By the trace of RᵀR, which is 2 Σ L²: the index is at most 1/(3n − 6).
    #[default]
    Trace,
    /// By Σ L², as the last form of equation (17) is printed: twice the value.
    SquaredLengths,
}

impl IndexScale {
    /// Turns a threshold in this scale into one in the scale of the trace.
    #[must_use]
    pub fn to_trace(self, threshold: f64) -> f64 {
        match self {
            Self::Trace => threshold,
            Self::SquaredLengths => 0.5 * threshold,
        }
    }
}

/// The non-rigid part of the spectrum of RᵀR, relative to its trace.
///
/// # Examples
///
/// The regular octahedron has a fivefold smallest eigenvalue:
///
/// ```
/// use nalgebra::Point3;
/// use tensegra_lar::{Framework, Graph, RigiditySpectrum};
///
/// let corners = [[1., 0., 0.], [0., 1., 0.], [0., 0., 1.], [-1., 0., 0.], [0., -1., 0.], [0., 0., -1.]];
/// let octahedron =
///     Framework::in_space(Graph::octahedron(), &corners.map(|[x, y, z]| Point3::new(x, y, z)))?;
/// let spectrum = RigiditySpectrum::of(&octahedron);
/// assert!((spectrum.index() - 1.0 / 24.0).abs() < 1e-12);
/// assert_eq!(spectrum.multiplicity(1e-9), 5);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone)]
pub struct RigiditySpectrum {
    dimension: Dimension,
    trace: f64,
    /// Relative eigenvalues μ = λ/tr, rising; only the non-rigid ones.
    values: Vec<f64>,
    /// Their eigenvectors, one column each.
    vectors: DMatrix<f64>,
}

impl RigiditySpectrum {
    /// The spectrum of a framework.
    #[must_use]
    pub fn of(framework: &Framework) -> Self {
        Self::at(
            framework.graph(),
            framework.dimension(),
            framework.coordinates(),
        )
    }

    /// The spectrum of a graph placed at `coordinates`.
    pub(crate) fn at(graph: &Graph, dimension: Dimension, coordinates: &[f64]) -> Self {
        let axes = dimension.axes();
        let size = graph.num_nodes() * axes;
        let mut gram = DMatrix::zeros(size, size);
        let mut trace = 0.0;
        for &[a, b] in graph.members() {
            let edge = dimension.node(coordinates, a) - dimension.node(coordinates, b);
            trace += 2.0 * edge.norm_squared();
            for i in 0..axes {
                for j in 0..axes {
                    let entry = dimension.component(&edge, i) * dimension.component(&edge, j);
                    gram[(a * axes + i, a * axes + j)] += entry;
                    gram[(b * axes + i, b * axes + j)] += entry;
                    gram[(a * axes + i, b * axes + j)] -= entry;
                    gram[(b * axes + i, a * axes + j)] -= entry;
                }
            }
        }
        // Rigid motions are shifted out of the way (no eigenvalue exceeds the trace), so that a
        // mechanism is not mistaken for one of them.
        let basis = rigid_motion_basis(dimension, graph.num_nodes(), coordinates);
        gram.gemm(2.0 * trace, &basis, &basis.transpose(), 1.0);
        let eigen = SymmetricEigen::new(gram);
        let mut order: Vec<usize> = (0..size).collect();
        order.sort_by(|&a, &b| eigen.eigenvalues[a].total_cmp(&eigen.eigenvalues[b]));
        order.truncate(size - dimension.rigid_motions());
        Self {
            dimension,
            trace,
            values: order
                .iter()
                .map(|&k| (eigen.eigenvalues[k] / trace).max(0.0))
                .collect(),
            vectors: DMatrix::from_fn(size, order.len(), |row, column| {
                eigen.eigenvectors[(row, order[column])]
            }),
        }
    }

    /// The worst-case rigidity index λ/tr(RᵀR); zero for a framework that is not infinitesimally
    /// rigid.
    #[must_use]
    pub fn index(&self) -> f64 {
        self.values.first().copied().unwrap_or(0.0)
    }

    /// All non-rigid eigenvalues divided by the trace, rising; they add up to 1.
    #[must_use]
    pub fn relative_eigenvalues(&self) -> &[f64] {
        &self.values
    }

    /// Number of eigenvalues within `relative_gap` (a fraction of the index) of the smallest.
    #[must_use]
    pub fn multiplicity(&self, relative_gap: f64) -> usize {
        let limit = self.index() * (1.0 + relative_gap);
        self.values
            .iter()
            .take_while(|&&value| value <= limit)
            .count()
    }

    /// The one-sided derivative of the index along the node velocity `direction`, for a smallest
    /// eigenvalue of the given `multiplicity` (see [`multiplicity`](Self::multiplicity)).
    ///
    /// `framework` must be the one that the spectrum was computed from.
    #[must_use]
    pub fn directional_derivative(
        &self,
        framework: &Framework,
        direction: &[f64],
        multiplicity: usize,
    ) -> f64 {
        let block = self.block_derivative(framework, direction, multiplicity);
        block.symmetric_eigenvalues().min()
    }

    /// The m × m matrix Vᵀ dM V/tr − μ (d tr/tr) I of a cluster of m equal eigenvalues along
    /// the node velocity `direction`: its eigenvalues are the derivatives of the m eigenvalues
    /// into which the cluster splits. The index stays above w, to first order, when
    /// diag(μ) + this block ⪰ w I.
    #[must_use]
    pub fn block_derivative(
        &self,
        framework: &Framework,
        direction: &[f64],
        multiplicity: usize,
    ) -> DMatrix<f64> {
        let size = multiplicity.clamp(1, self.values.len());
        let mut block = DMatrix::zeros(size, size);
        let mut trace_rate = 0.0;
        for &[a, b] in framework.graph().members() {
            let x = framework.coordinates();
            let edge = self.dimension.node(x, a) - self.dimension.node(x, b);
            let rate = self.dimension.node(direction, a) - self.dimension.node(direction, b);
            trace_rate += 4.0 * edge.dot(&rate);
            for row in 0..size {
                let q = self.relative_mode(row, a, b);
                for column in 0..size {
                    let r = self.relative_mode(column, a, b);
                    block[(row, column)] +=
                        edge.dot(&q) * rate.dot(&r) + edge.dot(&r) * rate.dot(&q);
                }
            }
        }
        block /= self.trace;
        for k in 0..size {
            block[(k, k)] -= self.values[k] * trace_rate / self.trace;
        }
        block
    }

    /// Difference of an eigenvector's entries at two nodes.
    fn relative_mode(&self, mode: usize, a: usize, b: usize) -> Vector3<f64> {
        let column = self.vectors.column(mode);
        // A column of a dense matrix is contiguous.
        let entries = column.as_slice();
        self.dimension.node(entries, a) - self.dimension.node(entries, b)
    }

    /// Largest factor by which the index exceeds its smooth bound, with `count` eigenvalues.
    pub(crate) fn largest_gap(count: usize) -> f64 {
        (count as f64).powf(1.0 / POWER)
    }

    /// The smooth lower bound (Σ μᵢ^−p)^(−1/p) of the index.
    #[must_use]
    pub fn smooth_index(&self) -> f64 {
        let smallest = self.index();
        if smallest <= 0.0 {
            return 0.0;
        }
        let sum: f64 = self
            .values
            .iter()
            .map(|value| (smallest / value).powf(POWER))
            .sum();
        smallest * sum.powf(-1.0 / POWER)
    }

    /// Gradient of [`smooth_index`](Self::smooth_index) with respect to the coordinates, written
    /// into `gradient` (length d·n). Zero for a framework that is not infinitesimally rigid,
    /// where the bound has no gradient.
    pub fn smooth_gradient(&self, graph: &Graph, coordinates: &[f64], gradient: &mut [f64]) {
        gradient.fill(0.0);
        let bound = self.smooth_index();
        if bound <= 0.0 {
            return;
        }
        let mut trace_weight = 0.0;
        let axes = self.dimension.axes();
        for (mode, value) in self.values.iter().enumerate() {
            let weight = (bound / value).powf(POWER + 1.0);
            if weight < 1e-14 {
                break;
            }
            trace_weight += weight * value;
            for &[a, b] in graph.members() {
                let edge =
                    self.dimension.node(coordinates, a) - self.dimension.node(coordinates, b);
                let q = self.relative_mode(mode, a, b);
                let slope = q * (2.0 * weight * edge.dot(&q) / self.trace);
                for axis in 0..axes {
                    let entry = self.dimension.component(&slope, axis);
                    gradient[a * axes + axis] += entry;
                    gradient[b * axes + axis] -= entry;
                }
            }
        }
        for &[a, b] in graph.members() {
            let edge = self.dimension.node(coordinates, a) - self.dimension.node(coordinates, b);
            let slope = edge * (4.0 * trace_weight / self.trace);
            for axis in 0..axes {
                let entry = self.dimension.component(&slope, axis);
                gradient[a * axes + axis] -= entry;
                gradient[b * axes + axis] += entry;
            }
        }
    }
}

/// The worst-case rigidity index of a framework in the given scale.
#[must_use]
pub fn worst_case_rigidity_index(framework: &Framework, scale: IndexScale) -> f64 {
    let index = RigiditySpectrum::of(framework).index();
    match scale {
        IndexScale::Trace => index,
        IndexScale::SquaredLengths => 2.0 * index,
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Point3, Rotation3};
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64;

    use super::*;

    fn displaced(framework: &Framework, direction: &[f64], step: f64) -> Framework {
        let coordinates = framework
            .coordinates()
            .iter()
            .zip(direction)
            .map(|(x, v)| x + step * v)
            .collect();
        Framework::new(
            framework.graph().clone(),
            framework.dimension(),
            coordinates,
        )
        .unwrap()
    }

    fn random(graph: &Graph, dimension: Dimension, rng: &mut Pcg64) -> Framework {
        let size = graph.num_nodes() * dimension.axes();
        let coordinates = (0..size).map(|_| rng.random_range(-1.0..1.0)).collect();
        Framework::new(graph.clone(), dimension, coordinates).unwrap()
    }

    /// The unit tetrahedron with a fifth node at its centroid: the K5 of the literature.
    fn k5() -> Framework {
        let (h, third) = ((2.0_f64 / 3.0).sqrt(), 3.0_f64.sqrt() / 6.0);
        let points = [
            [-3.0 * third, 0.0, 0.0],
            [0.0, -0.5, 0.0],
            [0.0, 0.5, 0.0],
            [-third, 0.0, h / 4.0],
            [-third, 0.0, h],
        ];
        Framework::in_space(
            Graph::complete(5).unwrap(),
            &points.map(|[x, y, z]| Point3::new(x, y, z)),
        )
        .unwrap()
    }

    #[test]
    fn values_of_the_k5_start() {
        let spectrum = RigiditySpectrum::of(&k5());
        assert!((spectrum.index() - 0.0356).abs() < 5e-5);
        assert_eq!(spectrum.multiplicity(1e-6), 3);
        assert!((spectrum.index() * spectrum.trace - 0.5339).abs() < 5e-5);
        let sum: f64 = spectrum.relative_eigenvalues().iter().sum();
        assert!((sum - 1.0).abs() < 1e-12);
        let printed = worst_case_rigidity_index(&k5(), IndexScale::SquaredLengths);
        assert!((printed - 2.0 * spectrum.index()).abs() < 1e-15);
        assert_eq!(IndexScale::SquaredLengths.to_trace(0.005), 0.0025);
    }

    #[test]
    fn the_index_is_invariant_under_similarities() {
        let mut rng = Pcg64::seed_from_u64(1);
        let framework = random(&Graph::octahedron(), Dimension::Three, &mut rng);
        let rotation = Rotation3::from_euler_angles(0.3, -1.0, 2.0);
        let coordinates = (0..6)
            .flat_map(|node| {
                let p = 7.0 * (rotation * framework.position(node));
                [p.x + 5.0, p.y, p.z - 3.0]
            })
            .collect();
        let moved =
            Framework::new(framework.graph().clone(), Dimension::Three, coordinates).unwrap();
        let (a, b) = (
            RigiditySpectrum::of(&framework),
            RigiditySpectrum::of(&moved),
        );
        assert!((a.index() - b.index()).abs() < 1e-12);
        assert!((a.smooth_index() - b.smooth_index()).abs() < 1e-12);
    }

    #[test]
    fn one_sided_derivatives_at_repeated_eigenvalues_agree_with_differences() {
        let mut rng = Pcg64::seed_from_u64(2);
        let corners = [
            [1., 0., 0.],
            [0., 1., 0.],
            [0., 0., 1.],
            [-1., 0., 0.],
            [0., -1., 0.],
            [0., 0., -1.],
        ];
        let octahedron = Framework::in_space(
            Graph::octahedron(),
            &corners.map(|[x, y, z]| Point3::new(x, y, z)),
        )
        .unwrap();
        for (framework, multiplicity) in [(k5(), 3), (octahedron, 5)] {
            let spectrum = RigiditySpectrum::of(&framework);
            for _ in 0..5 {
                let size = framework.coordinates().len();
                let direction: Vec<f64> = (0..size).map(|_| rng.random_range(-1.0..1.0)).collect();
                let slope = spectrum.directional_derivative(&framework, &direction, multiplicity);
                let step = 1e-6;
                let ahead = RigiditySpectrum::of(&displaced(&framework, &direction, step));
                let difference = (ahead.index() - spectrum.index()) / step;
                assert!((slope - difference).abs() < 1e-5, "{slope} {difference}");
            }
        }
    }

    #[test]
    fn the_smooth_bound_is_below_the_index_and_its_gradient_is_exact() {
        let mut rng = Pcg64::seed_from_u64(3);
        let planar = Graph::new(4, [[0, 1], [1, 2], [2, 3], [3, 0], [0, 2]]).unwrap();
        let samples = [
            k5(),
            random(&Graph::octahedron(), Dimension::Three, &mut rng),
            random(&planar, Dimension::Two, &mut rng),
        ];
        for framework in samples {
            let spectrum = RigiditySpectrum::of(&framework);
            assert!(spectrum.smooth_index() <= spectrum.index());
            assert!(spectrum.smooth_index() >= 0.8 * spectrum.index());
            let size = framework.coordinates().len();
            let mut gradient = vec![0.0; size];
            spectrum.smooth_gradient(framework.graph(), framework.coordinates(), &mut gradient);
            for coordinate in 0..size {
                let mut direction = vec![0.0; size];
                direction[coordinate] = 1.0;
                let value = |step| {
                    RigiditySpectrum::of(&displaced(&framework, &direction, step)).smooth_index()
                };
                let difference = (value(1e-6) - value(-1e-6)) / 2e-6;
                assert!((gradient[coordinate] - difference).abs() < 1e-7);
            }
        }
    }

    #[test]
    fn a_mechanism_has_index_zero() {
        let square = Graph::new(4, [[0, 1], [1, 2], [2, 3], [3, 0]]).unwrap();
        let coordinates = vec![0.0, 0.0, 1.0, 0.0, 1.0, 1.0, 0.0, 1.0];
        let square = Framework::new(square, Dimension::Two, coordinates).unwrap();
        assert!(worst_case_rigidity_index(&square, IndexScale::Trace) < 1e-12);
    }
}
