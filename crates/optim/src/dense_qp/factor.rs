//! Dense factorisations and the rotations that update them, row-major.

use super::DenseQpError;
use crate::vector::{axpy, dot};

pub(super) fn norm_squared(a: &[f64]) -> f64 {
    dot(a, a)
}

/// c, s, r with c a + s b = r and c b − s a = 0.
pub(super) fn givens(a: f64, b: f64) -> (f64, f64, f64) {
    if b == 0.0 {
        return (1.0, 0.0, a);
    }
    let r = a.hypot(b).copysign(if a == 0.0 { 1.0 } else { a });
    (a / r, b / r, r)
}

/// Rotates columns k and k + 1 of the row-major n × n matrix.
pub(super) fn rotate_columns(matrix: &mut [f64], n: usize, k: usize, c: f64, s: f64) {
    for row in matrix.chunks_exact_mut(n) {
        let (a, b) = (row[k], row[k + 1]);
        row[k] = c * a + s * b;
        row[k + 1] = c * b - s * a;
    }
}

/// Solves R y = b in place, with the columns of R padded to `stride`.
pub(super) fn solve_upper(triangle: &[f64], stride: usize, b: &mut [f64]) {
    for k in (0..b.len()).rev() {
        b[k] /= triangle[k * stride + k];
        let value = b[k];
        let (above, _) = b.split_at_mut(k);
        axpy(-value, &triangle[k * stride..k * stride + k], above);
    }
}

/// The lower triangular L with LLᵀ = `matrix`, row-major.
pub(super) fn cholesky(matrix: &[f64], factor: &mut [f64], n: usize) -> Result<(), DenseQpError> {
    for i in 0..n {
        for j in 0..=i {
            let (done, row) = factor.split_at_mut(i * n);
            let above = if j < i {
                &done[j * n..j * n + j]
            } else {
                &row[..j]
            };
            let rest = matrix[i * n + j] - dot(&row[..j], above);
            if j < i {
                row[j] = rest / done[j * n + j];
            } else {
                // A pivot that is all cancellation is no better than zero.
                if rest.is_nan() || rest <= 1e-14 * matrix[i * n + i].abs() {
                    return Err(DenseQpError::NotPositiveDefinite {
                        pivot: i,
                        value: rest,
                    });
                }
                row[j] = rest.sqrt();
            }
        }
    }
    Ok(())
}

/// `inverse` = L⁻ᵀ, row-major, from the row-major L.
pub(super) fn invert_transposed(factor: &[f64], inverse: &mut [f64], n: usize) {
    // Column j of L⁻¹ is row j of L⁻ᵀ.
    for j in 0..n {
        let row = &mut inverse[j * n..(j + 1) * n];
        row.fill(0.0);
        row[j] = 1.0 / factor[j * n + j];
        for i in j + 1..n {
            let sum = dot(&factor[i * n + j..i * n + i], &row[j..i]);
            row[i] = -sum / factor[i * n + i];
        }
    }
}
