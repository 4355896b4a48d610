//! Moving a chart along without factorising anew.
//!
//! The pseudo-inverse B of the old centre is still nearly one at a point nearby: the basis Φ is
//! corrected by chord iterations v ← v − B J(x) v, which converge to the null space of J(x), and
//! orthonormalised. Cost of an iteration: k products with the sparse Jacobian and k m r
//! multiplications, where a factorisation takes about 2 m r²; two to four iterations.

use super::{Chart, Workspace, add_columns, padded};
use crate::{
    manifold::{ImplicitManifold, SparsityPattern},
    qr::{LANES, axpy, dot, vectorised},
};

/// J(x) Φ counts as zero below this: the exponential map corrects what is left.
const TANGENT: f64 = 1e-6;
/// Contraction that an iteration must at least achieve.
const CONTRACTION: f64 = 0.3;
const MAX_ITERATIONS: usize = 12;

impl Chart {
    /// Makes `x`, a point of the manifold nearby, the new centre, and keeps the pseudo-inverse.
    /// `false`, and nothing changes, where `x` is too far away for that: build a new chart there.
    ///
    /// In the chart moved, the exponential map goes along the normal space of the centre whose
    /// pseudo-inverse is kept: [`log`](Self::log) inverts it up to terms of second order.
    pub fn recenter<M: ImplicitManifold + ?Sized>(
        &mut self,
        manifold: &M,
        x: &[f64],
        work: &mut Workspace,
    ) -> bool {
        let pattern = manifold.jacobian_pattern();
        work.jacobian.resize(pattern.len(), 0.0);
        manifold.jacobian(x, &mut work.jacobian);
        vectorised(
            #[inline(always)]
            || self.turn(pattern, x, work),
        )
    }

    /// Turns the basis into the null space of the Jacobian in the workspace, that at `x`.
    #[inline(always)]
    fn turn(&mut self, pattern: &SparsityPattern, x: &[f64], work: &mut Workspace) -> bool {
        let (m, k) = (x.len(), self.dimension);
        work.saved.clear();
        work.saved.extend_from_slice(&self.basis);
        // J(x) Φ, the k values of one independent equation after the other.
        work.steps.clear();
        work.steps.resize(self.rows.len() * k, 0.0);
        let mut previous = f64::INFINITY;
        let mut converged = false;
        for _ in 0..MAX_ITERATIONS {
            let mut size = 0.0_f64;
            for (&row, products) in self.rows.iter().zip(work.steps.chunks_exact_mut(k.max(1))) {
                let columns = pattern.row(row as usize);
                let values = &work.jacobian[pattern.row_range(row as usize)];
                for (product, vector) in products.iter_mut().zip(self.basis.chunks_exact(m)) {
                    *product = columns
                        .iter()
                        .zip(values)
                        .map(|(&c, &v)| v * vector[c])
                        .sum();
                    size = size.max(product.abs());
                }
            }
            if size <= TANGENT {
                converged = true;
                break;
            }
            if size.is_nan() || size > CONTRACTION * previous.min(1.0) {
                break;
            }
            previous = size;
            // Four columns at a time: the basis is read and written less often.
            for (columns, products) in self
                .pseudo_inverse
                .chunks_exact(LANES * padded(m))
                .zip(work.steps.chunks((LANES * k).max(1)))
            {
                for (j, vector) in self.basis.chunks_exact_mut(m).enumerate() {
                    let mut f = [0.0; LANES];
                    for (f, products) in f.iter_mut().zip(products.chunks_exact(k)) {
                        *f = -products[j];
                    }
                    add_columns(f, columns, vector);
                }
            }
        }
        if !(converged && self.orthonormalise()) {
            self.basis.copy_from_slice(&work.saved);
            return false;
        }
        for (j, vector) in self.basis.chunks_exact(m).enumerate() {
            for (i, &v) in vector.iter().enumerate() {
                self.basis_by_variable[i * k + j] = v;
            }
        }
        self.center.copy_from_slice(x);
        for (along, vector) in self.center_along.iter_mut().zip(self.basis.chunks_exact(m)) {
            *along = dot(vector, x);
        }
        self.jacobian.copy_from_slice(&work.jacobian);
        true
    }

    /// Gram and Schmidt's method on a basis that is nearly orthonormal; `false` where it is not.
    #[inline(always)]
    fn orthonormalise(&mut self) -> bool {
        let m = self.center.len();
        for j in 0..self.dimension {
            let (before, rest) = self.basis.split_at_mut(j * m);
            let vector = &mut rest[..m];
            for other in before.chunks_exact(m) {
                axpy(-dot(other, vector), other, vector);
            }
            let length = dot(vector, vector).sqrt();
            if !(length > 0.1) {
                return false;
            }
            vector.iter_mut().for_each(|v| *v /= length);
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::doc::Sphere;

    #[test]
    fn a_chart_moved_has_the_tangent_space_of_its_new_centre() {
        let sphere = Sphere::new();
        let mut work = Workspace::default();
        let mut chart = Chart::new(&sphere, &[0.0, 0.0, 1.0], 2, &mut work).unwrap();
        let mut angle = 0.0_f64;
        for _ in 0..8 {
            angle += 0.05;
            let x = [0.6 * angle.sin(), 0.8 * angle.sin(), angle.cos()];
            assert!(chart.recenter(&sphere, &x, &mut work));
            assert_eq!(chart.center(), x);
            for j in 0..2 {
                assert!(dot(chart.tangent(j), &x).abs() < 1e-6);
                assert!((dot(chart.tangent(j), chart.tangent(j)) - 1.0).abs() < 1e-12);
            }
            assert!(dot(chart.tangent(0), chart.tangent(1)).abs() < 1e-12);
        }
        let mut y = [0.0; 3];
        chart
            .exp(&sphere, &[1e-3, -2e-3], &mut y, 1e-13, &mut work)
            .unwrap();
        let mut t = [0.0; 2];
        chart.log(&y, &mut t);
        assert!((t[0] - 1e-3).abs() < 1e-5 && (t[1] + 2e-3).abs() < 1e-5);
    }

    #[test]
    fn too_far_away_nothing_changes() {
        let sphere = Sphere::new();
        let mut work = Workspace::default();
        let mut chart = Chart::new(&sphere, &[0.0, 0.0, 1.0], 2, &mut work).unwrap();
        let before = chart.clone();
        assert!(!chart.recenter(&sphere, &[1.0, 0.0, 0.0], &mut work));
        assert_eq!(chart.center(), before.center());
        assert_eq!(chart.tangent(0), before.tangent(0));
    }
}
