//! Householder QR with column pivoting of a transposed Jacobian.
//!
//! Jᵀ Π = Q R reveals which rows of J are independent (the first ones chosen),
//! gives an orthonormal basis of the tangent space (the last columns of Q), and
//! its triangle R solves for the smallest correction onto the manifold. Cost:
//! 2 m r² − ⅔ r³ floating-point operations for m variables and rank r.

use crate::manifold::SparsityPattern;

/// Inner product; several accumulators, so that it is vectorised.
#[inline]
pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0; 8];
    let (a8, b8) = (a.chunks_exact(8), b.chunks_exact(8));
    let rest: f64 = a8
        .remainder()
        .iter()
        .zip(b8.remainder())
        .map(|(x, y)| x * y)
        .sum();
    for (x, y) in a8.zip(b8) {
        for i in 0..8 {
            sums[i] += x[i] * y[i];
        }
    }
    ((sums[0] + sums[4]) + (sums[1] + sums[5])) + ((sums[2] + sums[6]) + (sums[3] + sums[7])) + rest
}

/// y ← y + α x.
#[inline]
pub(crate) fn axpy(alpha: f64, x: &[f64], y: &mut [f64]) {
    for (y, x) in y.iter_mut().zip(x) {
        *y += alpha * x;
    }
}

/// The factorisation, with its memory: filled again for every chart.
#[derive(Clone, Debug, Default)]
pub(crate) struct PivotedQr {
    /// Number of rows of Jᵀ: variables.
    m: usize,
    /// Column-major: R on and above the diagonal, Householder vectors below.
    a: Vec<f64>,
    /// Scale of each reflector I − τ v vᵀ with v[j] = 1.
    tau: Vec<f64>,
    /// Squared norms of what is left of each column.
    norms: Vec<f64>,
    /// The rows of J in the order in which they were chosen.
    permutation: Vec<usize>,
    /// Number of reflectors applied.
    rank: usize,
    /// |R₀₀|, and the largest norm of a column left over.
    first_pivot: f64,
    rest_norm: f64,
}

impl PivotedQr {
    /// Factorises the transpose of the Jacobian with the given values, up to
    /// `max_rank` pivots or until no column is left whose norm exceeds
    /// `tolerance` times the first pivot. Returns the rank reached.
    pub(crate) fn factorise(
        &mut self,
        pattern: &SparsityPattern,
        values: &[f64],
        max_rank: usize,
        tolerance: f64,
    ) -> usize {
        let (m, n) = (pattern.columns(), pattern.rows());
        self.m = m;
        self.a.clear();
        self.a.resize(m * n, 0.0);
        self.norms.clear();
        self.permutation.clear();
        self.permutation.extend(0..n);
        for i in 0..n {
            let column = &mut self.a[i * m..(i + 1) * m];
            for (&c, &v) in pattern.row(i).iter().zip(&values[pattern.row_range(i)]) {
                column[c] = v;
            }
            self.norms.push(dot(column, column));
        }
        self.tau.clear();
        self.first_pivot = 0.0;
        let limit = max_rank.min(m).min(n);
        let mut j = 0;
        while j < limit {
            let p = (j..n)
                .max_by(|&a, &b| self.norms[a].total_cmp(&self.norms[b]))
                .unwrap_or(j);
            // The downdated norms lose digits: take the pivot's anew.
            let norm = {
                let tail = &self.a[p * m + j..(p + 1) * m];
                dot(tail, tail).sqrt()
            };
            if norm.is_nan() || norm <= tolerance * self.first_pivot || norm == 0.0 {
                break;
            }
            if p != j {
                let (left, right) = self.a.split_at_mut(p * m);
                left[j * m..(j + 1) * m].swap_with_slice(&mut right[..m]);
                self.norms.swap(j, p);
                self.permutation.swap(j, p);
            }
            self.reflect(j, norm);
            if j == 0 {
                self.first_pivot = norm;
            }
            j += 1;
        }
        self.rank = j;
        self.rest_norm = (j..n)
            .map(|i| {
                let tail = &self.a[i * m + j..(i + 1) * m];
                dot(tail, tail)
            })
            .fold(0.0, f64::max)
            .sqrt();
        j
    }

    /// Eliminates column j below its diagonal and applies the reflector to the
    /// columns right of it.
    fn reflect(&mut self, j: usize, norm: f64) {
        let m = self.m;
        let (head, tail) = self.a.split_at_mut((j + 1) * m);
        let v = &mut head[j * m + j..];
        let alpha = v[0];
        let beta = if alpha >= 0.0 { -norm } else { norm };
        let tau = (beta - alpha) / beta;
        let scale = 1.0 / (alpha - beta);
        v[0] = beta;
        let v = &mut v[1..];
        for x in v.iter_mut() {
            *x *= scale;
        }
        self.tau.push(tau);
        for (c, column) in tail.chunks_exact_mut(m).enumerate() {
            let column = &mut column[j..];
            let (first, rest) = column.split_at_mut(1);
            let w = tau * (first[0] + dot(v, rest));
            first[0] -= w;
            axpy(-w, v, rest);
            let norm = &mut self.norms[j + 1 + c];
            *norm = (*norm - first[0] * first[0]).max(0.0);
        }
    }

    /// Largest norm of a column left over, relative to the first pivot.
    pub(crate) fn rest_ratio(&self) -> f64 {
        self.rest_norm / self.first_pivot
    }

    /// The independent rows of the Jacobian, in the order of the pivots.
    pub(crate) fn independent_rows(&self) -> &[usize] {
        &self.permutation[..self.rank]
    }

    /// Appends the pseudo-inverse of the independent rows J_r, column by column
    /// in the order of the pivots: J_rᵀ (RᵀR)⁻¹, the transposed rows being
    /// sparse. It need not be exact to the last digit: projections only iterate
    /// with it.
    pub(crate) fn write_pseudo_inverse(
        &self,
        pattern: &SparsityPattern,
        values: &[f64],
        columns: &mut Vec<f64>,
    ) {
        let (m, r) = (self.m, self.rank);
        let mut y = vec![0.0; r];
        let triangle = |j: usize| &self.a[j * m..j * m + j + 1];
        for c in 0..r {
            // y = R⁻¹ R⁻ᵀ e_c; R⁻ᵀ e_c starts at c.
            y.fill(0.0);
            y[c] = 1.0 / triangle(c)[c];
            for j in c + 1..r {
                let column = triangle(j);
                y[j] = -dot(&column[c..j], &y[c..j]) / column[j];
            }
            for j in (0..r).rev() {
                let column = triangle(j);
                y[j] /= column[j];
                let (head, tail) = y.split_at_mut(j);
                axpy(-tail[0], &column[..j], head);
            }
            let start = columns.len();
            columns.resize(start + m, 0.0);
            let column = &mut columns[start..];
            for (&row, &y) in self.permutation[..r].iter().zip(&y) {
                for (&i, &v) in pattern.row(row).iter().zip(&values[pattern.row_range(row)]) {
                    column[i] += v * y;
                }
            }
        }
    }

    /// Appends the last m − rank columns of Q, vector by vector: an orthonormal
    /// basis of the null space of J.
    pub(crate) fn write_null_basis(&self, basis: &mut Vec<f64>) {
        let m = self.m;
        for c in self.rank..m {
            let start = basis.len();
            basis.resize(start + m, 0.0);
            let x = &mut basis[start..];
            x[c] = 1.0;
            self.apply_q(x);
        }
    }

    /// x ← Q x.
    fn apply_q(&self, x: &mut [f64]) {
        let m = self.m;
        for j in (0..self.rank).rev() {
            let v = &self.a[j * m + j + 1..(j + 1) * m];
            let w = self.tau[j] * (x[j] + dot(v, &x[j + 1..]));
            x[j] -= w;
            axpy(-w, v, &mut x[j + 1..]);
        }
    }

    /// The smallest step dx that solves J_r dx = f on the independent rows r,
    /// f being given on all rows.
    pub(crate) fn smallest_step(&self, f: &[f64], dx: &mut [f64]) {
        let m = self.m;
        dx.fill(0.0);
        for j in 0..self.rank {
            let column = &self.a[j * m..j * m + j + 1];
            let sum = dot(&column[..j], &dx[..j]);
            dx[j] = (f[self.permutation[j]] - sum) / column[j];
        }
        self.apply_q(dx);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn dense(rows: &[&[f64]]) -> (SparsityPattern, Vec<f64>) {
        let pattern = SparsityPattern::dense(rows.len(), rows[0].len());
        (pattern, rows.concat())
    }

    #[test]
    fn finds_rank_null_space_and_smallest_step() {
        // Row 2 is the sum of rows 0 and 1.
        let (pattern, values) = dense(&[
            &[1.0, 2.0, 0.0, -1.0],
            &[0.0, 1.0, 3.0, 0.5],
            &[1.0, 3.0, 3.0, -0.5],
        ]);
        let mut qr = PivotedQr::default();
        assert_eq!(qr.factorise(&pattern, &values, 4, 1e-12), 2);
        assert!(qr.rest_ratio() < 1e-14);
        let mut basis = Vec::new();
        qr.write_null_basis(&mut basis);
        assert_eq!(basis.len(), 8);
        for row in values.chunks(4) {
            for vector in basis.chunks(4) {
                assert!(dot(row, vector).abs() < 1e-14);
            }
        }
        assert!(dot(&basis[..4], &basis[4..]).abs() < 1e-14);
        let f = [1.0, -2.0, -1.0];
        let mut dx = [0.0; 4];
        qr.smallest_step(&f, &mut dx);
        for (row, f) in values.chunks(4).zip(f) {
            assert!((dot(row, &dx) - f).abs() < 1e-14);
        }
        for vector in basis.chunks(4) {
            assert!(dot(vector, &dx).abs() < 1e-14);
        }
    }

    #[test]
    fn a_zero_matrix_has_rank_zero() {
        let (pattern, values) = dense(&[&[0.0, 0.0]]);
        assert_eq!(
            PivotedQr::default().factorise(&pattern, &values, 2, 1e-12),
            0
        );
    }
}
