//! Moving a chart along without factorising anew.
//!
//! The pseudo-inverse B of the old centre is still nearly one at a point nearby: the basis Φ is
//! corrected by chord iterations v ← v − B J(x) v, which converge to the null space of J(x), and
//! orthonormalised. Cost of an iteration: k products with the sparse Jacobian and k m r
//! multiplications, where a factorisation takes about 2 m r²; two to four iterations.

use super::{Chart, Workspace};
use crate::{
    manifold::{ImplicitManifold, SparsityPattern},
    qr::{LANES, axpy, blocks, dot, vectorised},
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
        // J(x) Φ, one tangent vector after the other, padded.
        let height = blocks(self.rows.len());
        work.right.clear();
        work.right.resize(height * k, [0.0; LANES]);
        work.steps
            .resize(blocks(m).max(work.steps.len()), [0.0; LANES]);
        let step = &mut work.steps[..blocks(m)];
        let mut previous = f64::INFINITY;
        let mut converged = false;
        for _ in 0..MAX_ITERATIONS {
            let mut size = 0.0_f64;
            for (a, &row) in self.rows.iter().enumerate() {
                let columns = pattern.row(row as usize);
                let values = &work.jacobian[pattern.row_range(row as usize)];
                for (j, vector) in self.basis.chunks_exact(m).enumerate() {
                    let entries = columns.iter().zip(values);
                    let product: f64 = entries.map(|(&c, &v)| v * vector[c]).sum();
                    work.right[j * height + a / LANES][a % LANES] = -product;
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
            for (j, products) in work.right.chunks_exact(height.max(1)).enumerate() {
                self.times_pseudo_inverse(products, step);
                let vector = &mut self.basis[j * m..(j + 1) * m];
                for (v, s) in vector.iter_mut().zip(step.as_flattened()) {
                    *v += s;
                }
            }
        }
        if !(converged && self.orthonormalise()) {
            self.basis.copy_from_slice(&work.saved);
            return false;
        }
        self.center.copy_from_slice(x);
        for (along, vector) in self.center_along.iter_mut().zip(self.basis.chunks_exact(m)) {
            *along = dot(vector, x);
        }
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
