//! Second derivatives of the Lagrangian at one point of the path.
//!
//! On the manifold a tangent step t bends into the normal space by
//! −½ B ∇²F[Φ t, Φ t]. Where a force w, the gradient of the energy less the
//! forces of active inequalities, has multipliers y = Bᵀ w, this adds
//! −Φᵀ (Σ yⱼ ∇²Fⱼ) Φ to the Hessian in tangent coordinates. The products ∇²F φ are
//! differences of the Jacobian along the tangent vectors, exact where the
//! equations are quadratic. Cost: k + 1 Jacobians, k² m and m r multiplications.

use nalgebra::{DMatrix, SymmetricEigen};
use tensegra_atlas::{Chart, ImplicitManifold};

/// Step of the differences.
const STEP: f64 = 1e-4;

/// Memory for [`Curvature::at`].
#[derive(Clone, Debug, Default)]
pub(super) struct Curvature {
    multipliers: Vec<f64>,
    jacobians: [Vec<f64>; 2],
    moved: Vec<f64>,
    change: Vec<f64>,
}

impl Curvature {
    /// Writes the k × k matrix −Φᵀ (Σ yⱼ ∇²Fⱼ) Φ of the force `w` at the centre
    /// of a chart.
    pub(super) fn at<M: ImplicitManifold + ?Sized>(
        &mut self,
        manifold: &M,
        chart: &Chart,
        w: &[f64],
        matrix: &mut [f64],
    ) {
        let (x, k) = (chart.center(), chart.dimension());
        let pattern = manifold.jacobian_pattern();
        self.multipliers.resize(manifold.equation_count(), 0.0);
        chart.multipliers(w, &mut self.multipliers);
        let [after, before] = &mut self.jacobians;
        after.resize(pattern.len(), 0.0);
        before.resize(pattern.len(), 0.0);
        manifold.jacobian(x, before);
        self.moved.resize(x.len(), 0.0);
        for j in 0..k {
            for ((y, x), v) in self.moved.iter_mut().zip(x).zip(chart.tangent(j)) {
                *y = x + STEP * v;
            }
            manifold.jacobian(&self.moved, after);
            self.change.clear();
            self.change.resize(x.len(), 0.0);
            for (row, &y) in self.multipliers.iter().enumerate().filter(|m| *m.1 != 0.0) {
                let range = pattern.row_range(row);
                let entries = after[range.clone()].iter().zip(&before[range]);
                for (&column, (a, b)) in pattern.row(row).iter().zip(entries) {
                    self.change[column] -= y * (a - b);
                }
            }
            for i in 0..k {
                matrix[i * k + j] = super::relax::dot(chart.tangent(i), &self.change) / STEP;
            }
        }
        for i in 0..k {
            for j in 0..i {
                let mean = 0.5 * (matrix[i * k + j] + matrix[j * k + i]);
                matrix[i * k + j] = mean;
                matrix[j * k + i] = mean;
            }
        }
    }
}

/// Splits a symmetric k × k matrix off its negative part, the sum of λ v vᵀ over the
/// negative eigenvalues λ, which is written to `negative`.
pub(super) fn negative_part(matrix: &[f64], k: usize, negative: &mut [f64]) {
    negative.fill(0.0);
    let eigen = SymmetricEigen::new(DMatrix::from_row_slice(k, k, matrix));
    for (value, v) in eigen
        .eigenvalues
        .iter()
        .zip(eigen.eigenvectors.column_iter())
    {
        if *value < 0.0 {
            for i in 0..k {
                for j in 0..k {
                    negative[i * k + j] += value * v[i] * v[j];
                }
            }
        }
    }
}
