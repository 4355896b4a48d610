//! Householder QR with column pivoting of a transposed Jacobian.
//!
//! Jᵀ Π = Q R reveals which rows of J are independent (the first ones chosen),
//! gives an orthonormal basis of the tangent space (the last columns of Q), and
//! its triangle R solves for the smallest correction onto the manifold. Cost:
//! 2 m r² − ⅔ r³ floating-point operations for m variables and rank r.

use crate::manifold::SparsityPattern;

/// Values that the innermost loops over padded vectors take at once.
pub(crate) const LANES: usize = 4;
pub(crate) type Lanes = [f64; LANES];

/// Runs small dense loops with the widest vectors that the processor has; what they call
/// must be inlined. The order of operations, and so the result, does not depend on it.
#[inline(always)]
pub(crate) fn vectorised<R>(work: impl FnOnce() -> R) -> R {
    pulp::Arch::new().dispatch(work)
}

/// Inner product; several accumulators, so that it is vectorised.
#[inline(always)]
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
#[inline(always)]
pub(crate) fn axpy(alpha: f64, x: &[f64], y: &mut [f64]) {
    for (y, x) in y.iter_mut().zip(x) {
        *y += alpha * x;
    }
}

/// Number of whole [`LANES`] that hold a vector.
#[inline(always)]
pub(crate) fn blocks(length: usize) -> usize {
    length.div_ceil(LANES)
}

/// Inner product of padded vectors.
#[inline(always)]
pub(crate) fn padded_dot(a: &[Lanes], b: &[Lanes]) -> f64 {
    let mut sums = [0.0; LANES];
    for (a, b) in a.iter().zip(b) {
        for i in 0..LANES {
            sums[i] += a[i] * b[i];
        }
    }
    (sums[0] + sums[2]) + (sums[1] + sums[3])
}

/// y ← y + α x for padded vectors.
#[inline(always)]
pub(crate) fn padded_axpy(alpha: f64, x: &[Lanes], y: &mut [Lanes]) {
    for (y, x) in y.iter_mut().zip(x) {
        for i in 0..LANES {
            y[i] += alpha * x[i];
        }
    }
}

/// [`vectorised`] loops over rows of some [`Lanes`]; where they are few, the compiler knows
/// how many.
#[inline(always)]
pub(crate) fn vectorised_rows<R>(width: usize, work: impl FnOnce(usize) -> R) -> R {
    vectorised(
        #[inline(always)]
        || match width {
            1 => work(1),
            2 => work(2),
            3 => work(3),
            4 => work(4),
            width => work(width),
        },
    )
}

/// Rows of at most this many blocks are combined whole.
const SMALL: usize = 4;

/// The blocks of a triangle's row i that are not zero, if they are to be told apart.
#[inline(always)]
fn filled(width: usize, i: usize) -> usize {
    if width <= SMALL { width } else { blocks(i + 1) }
}

/// The factorisation, with its memory: filled again for every chart.
///
/// Matrices are stored row by row, one row for each variable: a reflector then
/// combines whole rows, and rows where it vanishes, as most do while the Jacobian's
/// sparsity lasts, are passed over. Rows are padded to whole [`LANES`].
#[derive(Clone, Debug, Default)]
pub(crate) struct PivotedQr {
    /// Number of rows of Jᵀ: variables.
    m: usize,
    /// Number of columns of Jᵀ: equations.
    n: usize,
    /// R in the first rows; what is left of Jᵀ below. Left of the diagonal is nothing of
    /// meaning.
    a: Vec<Lanes>,
    reflectors: Vec<Reflector>,
    /// Entries of all reflectors, except the leading ones.
    entries: Vec<(u32, f64)>,
    /// Squared norms of what is left of each column.
    norms: Vec<f64>,
    /// The rows of J in the order in which they were chosen.
    permutation: Vec<usize>,
    /// Number of reflectors applied.
    rank: usize,
    /// |R₀₀|, and the largest norm of a column left over.
    first_pivot: f64,
    rest_norm: f64,
    /// One row of scratch, two triangles, and a matrix of one row for each variable.
    combined: Vec<Lanes>,
    inverse: Vec<Lanes>,
    gram: Vec<Lanes>,
    by_variable: Vec<Lanes>,
}

/// I − τ v vᵀ with v = 1 at its own row, and the entries in a range of all entries.
#[derive(Clone, Debug)]
struct Reflector {
    tau: f64,
    entries: std::ops::Range<usize>,
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
        (self.m, self.n) = (m, n);
        let width = blocks(n);
        self.a.clear();
        self.a.resize(m * width, [0.0; LANES]);
        let a = self.a.as_flattened_mut();
        self.norms.clear();
        self.permutation.clear();
        self.permutation.extend(0..n);
        self.reflectors.clear();
        self.entries.clear();
        for i in 0..n {
            let mut square = 0.0;
            for (&c, &v) in pattern.row(i).iter().zip(&values[pattern.row_range(i)]) {
                a[c * LANES * width + i] = v;
                square += v * v;
            }
            self.norms.push(square);
        }
        let limit = max_rank.min(m).min(n);
        vectorised_rows(
            width,
            #[inline(always)]
            |width| self.eliminate(width, limit, tolerance),
        )
    }

    /// Applies reflectors to what [`Self::factorise`] has laid out.
    #[inline(always)]
    fn eliminate(&mut self, width: usize, limit: usize, tolerance: f64) -> usize {
        let n = self.n;
        self.first_pivot = 0.0;
        let mut j = 0;
        while j < limit {
            let p = (j + 1..n).fold(j, |best, c| {
                if self.norms[c] > self.norms[best] {
                    c
                } else {
                    best
                }
            });
            // The downdated norms lose digits: take the pivot's anew.
            let norm = self.norm_of_column(width, p, j);
            if norm.is_nan() || norm <= tolerance * self.first_pivot || norm == 0.0 {
                break;
            }
            if p != j {
                for row in self.a.as_flattened_mut().chunks_exact_mut(LANES * width) {
                    row.swap(j, p);
                }
                self.norms.swap(j, p);
                self.permutation.swap(j, p);
            }
            self.reflect(width, j, norm);
            if j == 0 {
                self.first_pivot = norm;
            }
            j += 1;
        }
        self.rank = j;
        self.rest_norm = (j..n)
            .map(|c| self.norm_of_column(width, c, j))
            .fold(0.0, f64::max);
        j
    }

    /// Norm of what is left of column c from row j on.
    #[inline(always)]
    fn norm_of_column(&self, width: usize, c: usize, j: usize) -> f64 {
        let rows = self.a.chunks_exact(width).skip(j);
        let column = rows.map(|row| row[c / LANES][c % LANES]);
        column.map(|v| v * v).sum::<f64>().sqrt()
    }

    /// Eliminates column j below its diagonal and applies the reflector to the
    /// columns right of it.
    #[inline(always)]
    fn reflect(&mut self, width: usize, j: usize, norm: f64) {
        let (head, below) = self.a.split_at_mut((j + 1) * width);
        // What is taken along on the left of the diagonal has no meaning any more.
        let first_block = if width <= SMALL { 0 } else { j / LANES };
        let diagonal = j - LANES * first_block;
        let row = &mut head[j * width..][..width][first_block..];
        let alpha = row.as_flattened()[diagonal];
        let beta = if alpha >= 0.0 { -norm } else { norm };
        let tau = (beta - alpha) / beta;
        let scale = 1.0 / (alpha - beta);
        let first = self.entries.len();
        // w = τ vᵀ A, then A ← A − v w.
        self.combined.resize(width, [0.0; LANES]);
        let w = &mut self.combined[..width][first_block..];
        w.copy_from_slice(row);
        for (i, other) in below.chunks_exact(width).enumerate() {
            let entry = other.as_flattened()[j];
            if entry != 0.0 {
                let v = entry * scale;
                self.entries.push(((j + 1 + i) as u32, v));
                padded_axpy(v, &other[first_block..], w);
            }
        }
        w.as_flattened_mut().iter_mut().for_each(|w| *w *= tau);
        padded_axpy(-1.0, w, row);
        row.as_flattened_mut()[diagonal] = beta;
        for &(i, v) in &self.entries[first..] {
            let other = &mut below[(i as usize - j - 1) * width..][..width];
            padded_axpy(-v, w, &mut other[first_block..]);
        }
        let row = &row.as_flattened()[diagonal + 1..];
        for (norm, r) in self.norms[j + 1..].iter_mut().zip(row) {
            *norm = (*norm - *r * *r).max(0.0);
        }
        self.reflectors.push(Reflector {
            tau,
            entries: first..self.entries.len(),
        });
    }

    /// Largest norm of a column left over, relative to the first pivot.
    pub(crate) fn rest_ratio(&self) -> f64 {
        self.rest_norm / self.first_pivot
    }

    /// The independent rows of the Jacobian, in the order of the pivots.
    pub(crate) fn independent_rows(&self) -> &[usize] {
        &self.permutation[..self.rank]
    }

    /// Writes the pseudo-inverse of the independent rows J_r: for [`LANES`] variables
    /// after the other their values in one of the r columns after the other, both padded
    /// with zeros to whole [`LANES`]. It is J_rᵀ (RᵀR)⁻¹, the transposed rows being
    /// sparse, and need not be exact to the last digit: projections only iterate with it.
    /// Cost: ⅔ r³ and r multiplications for each entry of J_r.
    pub(crate) fn write_pseudo_inverse(
        &mut self,
        pattern: &SparsityPattern,
        values: &[f64],
        pseudo_inverse: &mut Vec<Lanes>,
    ) {
        vectorised_rows(
            blocks(self.rank),
            #[inline(always)]
            |width| self.pseudo_inverse(width, pattern, values, pseudo_inverse),
        );
    }

    #[inline(always)]
    fn pseudo_inverse(
        &mut self,
        width: usize,
        pattern: &SparsityPattern,
        values: &[f64],
        pseudo_inverse: &mut Vec<Lanes>,
    ) {
        self.invert_gram(width);
        let product = &mut self.by_variable;
        product.clear();
        product.resize(self.m * width, [0.0; LANES]);
        let gram = self.gram.chunks_exact(width.max(1));
        for (&equation, row) in self.permutation.iter().zip(gram) {
            let entries = pattern.row(equation).iter();
            for (&i, &v) in entries.zip(&values[pattern.row_range(equation)]) {
                padded_axpy(v, row, &mut product[i * width..][..width]);
            }
        }
        pseudo_inverse.clear();
        pseudo_inverse.resize(blocks(self.m) * width * LANES, [0.0; LANES]);
        let panels = pseudo_inverse.chunks_exact_mut((width * LANES).max(1));
        let rows = product.chunks((LANES * width).max(1));
        for (panel, rows) in panels.zip(rows) {
            for (i, row) in rows.chunks_exact(width).enumerate() {
                for (column, v) in panel.iter_mut().zip(row.as_flattened()) {
                    column[i] = *v;
                }
            }
        }
    }

    /// (RᵀR)⁻¹ of the r independent rows, padded, into `gram`.
    #[inline(always)]
    fn invert_gram(&mut self, width: usize) {
        let (n, r) = (blocks(self.n), self.rank);
        // L = R⁻ᵀ, row by row.
        let inverse = &mut self.inverse;
        inverse.clear();
        inverse.resize(r * width, [0.0; LANES]);
        for k in 0..r {
            let (before, row) = inverse.split_at_mut(k * width);
            let row = &mut row[..width];
            for (l, other) in before.chunks_exact(width).enumerate() {
                let entry = self.a[l * n + k / LANES][k % LANES];
                if entry != 0.0 {
                    let filled = filled(width, l);
                    padded_axpy(-entry, &other[..filled], &mut row[..filled]);
                }
            }
            let scale = 1.0 / self.a[k * n + k / LANES][k % LANES];
            row.as_flattened_mut()[..k]
                .iter_mut()
                .for_each(|x| *x *= scale);
            row[k / LANES][k % LANES] = scale;
        }
        // LᵀL, its lower triangle first.
        let gram = &mut self.gram;
        gram.clear();
        gram.resize(r * width, [0.0; LANES]);
        for row in inverse.chunks_exact(width.max(1)) {
            for (i, sum) in gram.chunks_exact_mut(width).enumerate() {
                let entry = row[i / LANES][i % LANES];
                if entry != 0.0 {
                    let filled = filled(width, i);
                    padded_axpy(entry, &row[..filled], &mut sum[..filled]);
                }
            }
        }
        for i in 0..r {
            for j in i + 1..r {
                gram[i * width + j / LANES][j % LANES] = gram[j * width + i / LANES][i % LANES];
            }
        }
    }

    /// Writes the last m − rank columns of Q, m values each: an orthonormal basis of the
    /// null space of J.
    pub(crate) fn write_null_basis(&mut self, basis: &mut Vec<f64>) {
        vectorised_rows(
            blocks(self.m - self.rank),
            #[inline(always)]
            |width| self.null_basis(width, basis),
        );
    }

    #[inline(always)]
    fn null_basis(&mut self, width: usize, basis: &mut Vec<f64>) {
        let (m, r) = (self.m, self.rank);
        let k = m - r;
        let rows = &mut self.by_variable;
        rows.clear();
        rows.resize(m * width, [0.0; LANES]);
        for j in 0..k {
            rows[(r + j) * width + j / LANES][j % LANES] = 1.0;
        }
        self.combined.resize(width, [0.0; LANES]);
        let w = &mut self.combined[..width];
        for (j, reflector) in self.reflectors.iter().enumerate().rev() {
            let entries = &self.entries[reflector.entries.clone()];
            w.copy_from_slice(&rows[j * width..][..width]);
            for &(i, v) in entries {
                padded_axpy(v, &rows[i as usize * width..][..width], w);
            }
            w.as_flattened_mut()
                .iter_mut()
                .for_each(|w| *w *= reflector.tau);
            padded_axpy(-1.0, w, &mut rows[j * width..][..width]);
            for &(i, v) in entries {
                padded_axpy(-v, w, &mut rows[i as usize * width..][..width]);
            }
        }
        basis.clear();
        for j in 0..k {
            let column = rows.iter().skip(j / LANES).step_by(width);
            basis.extend(column.map(|v| v[j % LANES]));
        }
    }

    /// x ← Q x.
    fn apply_q(&self, x: &mut [f64]) {
        for (j, reflector) in self.reflectors.iter().enumerate().rev() {
            let entries = &self.entries[reflector.entries.clone()];
            let sum = entries
                .iter()
                .fold(x[j], |sum, &(i, v)| sum + v * x[i as usize]);
            let w = reflector.tau * sum;
            x[j] -= w;
            for &(i, v) in entries {
                x[i as usize] -= v * w;
            }
        }
    }

    /// The smallest step dx that solves J_r dx = f on the independent rows r,
    /// f being given on all rows.
    pub(crate) fn smallest_step(&self, f: &[f64], dx: &mut [f64]) {
        let r = self.rank;
        dx.fill(0.0);
        for (dx, &row) in dx.iter_mut().zip(&self.permutation[..r]) {
            *dx = f[row];
        }
        for j in 0..r {
            let row = &self.a[j * blocks(self.n)..].as_flattened()[..r];
            let (head, tail) = dx[..r].split_at_mut(j + 1);
            head[j] /= row[j];
            axpy(-head[j], &row[j + 1..], tail);
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
        let vector = |j: usize| &basis[4 * j..4 * j + 4];
        for row in values.chunks(4) {
            for j in 0..2 {
                assert!(dot(row, vector(j)).abs() < 1e-14);
            }
        }
        assert!(dot(vector(0), vector(1)).abs() < 1e-14);
        let mut inverse = Vec::new();
        qr.write_pseudo_inverse(&pattern, &values, &mut inverse);
        for (a, &row) in qr.independent_rows().iter().enumerate() {
            for b in 0..2 {
                let column = inverse[b];
                let product = dot(&values[4 * row..4 * row + 4], &column);
                assert!((product - f64::from(u8::from(a == b))).abs() < 1e-13);
                assert!(dot(vector(0), &column).abs() < 1e-13);
            }
        }
        let f = [1.0, -2.0, -1.0];
        let mut dx = [0.0; 4];
        qr.smallest_step(&f, &mut dx);
        for (row, f) in values.chunks(4).zip(f) {
            assert!((dot(row, &dx) - f).abs() < 1e-14);
        }
        assert!(dot(vector(0), &dx).abs() < 1e-14 && dot(vector(1), &dx).abs() < 1e-14);
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
