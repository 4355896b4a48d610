//! The few operations on slices that every method of this crate needs.

/// Σ aᵢ bᵢ.
pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// ‖a‖₂.
pub(crate) fn norm(a: &[f64]) -> f64 {
    dot(a, a).sqrt()
}

/// ‖a‖∞.
pub(crate) fn largest(a: &[f64]) -> f64 {
    a.iter().fold(0.0_f64, |size, v| size.max(v.abs()))
}

/// `to` += `factor` · `from`.
#[inline(always)]
pub(crate) fn axpy(factor: f64, from: &[f64], to: &mut [f64]) {
    for (t, f) in to.iter_mut().zip(from) {
        *t += factor * f;
    }
}

/// Makes a vector `length` entries of `value`, in the memory that it has.
pub(crate) fn refill(vector: &mut Vec<f64>, length: usize, value: f64) {
    vector.clear();
    vector.resize(length, value);
}
