//! Points of the manifold near a given point, and the dimension there.
//!
//! Gauss–Newton with the smallest step at each iteration: converges
//! quadratically to a point of the manifold near the orthogonal projection. The
//! equations may be redundant. Cost of an iteration: one residual, one Jacobian,
//! one pivoted QR.

use crate::{error::ManifoldError, manifold::ImplicitManifold, qr::PivotedQr};

/// Pivots below this fraction of the first count as zero when the rank is
/// not known.
const RANK_TOLERANCE: f64 = 1e-7;

/// Largest absolute entry and its index.
pub(crate) fn largest(values: &[f64]) -> (usize, f64) {
    values.iter().enumerate().fold((0, 0.0), |best, (i, v)| {
        // A NaN wins, so that it is seen.
        if v.abs() > best.1 || v.is_nan() {
            (i, v.abs())
        } else {
            best
        }
    })
}

/// Projects `x` onto the manifold, in place, to residuals of at most `tolerance`.
///
/// Steps are shortened when they do not reduce the residual, so that starts
/// stated with few digits converge too.
///
/// # Errors
/// [`ManifoldError::NotConverged`] with the residual reached when the point is
/// too far from the manifold, or [`ManifoldError::NotFinite`].
///
/// # Examples
/// ```
/// # use tensegra_atlas::{doc::Sphere, project};
/// let mut x = vec![0.0, 0.6, 0.9];
/// project(&Sphere::new(), &mut x, 1e-12, 20)?;
/// assert!((x.iter().map(|x| x * x).sum::<f64>() - 1.0).abs() < 1e-11);
/// # Ok::<(), tensegra_atlas::ManifoldError>(())
/// ```
pub fn project<M: ImplicitManifold + ?Sized>(
    manifold: &M,
    x: &mut [f64],
    tolerance: f64,
    max_iterations: usize,
) -> Result<(), ManifoldError> {
    if let Some((index, &value)) = x.iter().enumerate().find(|(_, v)| !v.is_finite()) {
        return Err(ManifoldError::NotFinite { index, value });
    }
    let (m, n) = (manifold.ambient_dimension(), manifold.equation_count());
    let pattern = manifold.jacobian_pattern();
    let mut residual = vec![0.0; n];
    let mut values = vec![0.0; pattern.len()];
    let mut dx = vec![0.0; m];
    let mut trial = vec![0.0; m];
    let mut qr = PivotedQr::default();
    manifold.residual(x, &mut residual);
    let norm = |r: &[f64]| r.iter().map(|v| v * v).sum::<f64>().sqrt();
    let mut current = norm(&residual);
    for _ in 0..max_iterations {
        if largest(&residual).1 <= tolerance {
            return Ok(());
        }
        manifold.jacobian(x, &mut values);
        qr.factorise(pattern, &values, m.min(n), RANK_TOLERANCE);
        qr.smallest_step(&residual, &mut dx);
        let mut scale = 1.0;
        loop {
            for ((trial, x), dx) in trial.iter_mut().zip(x.iter()).zip(&dx) {
                *trial = x - scale * dx;
            }
            manifold.residual(&trial, &mut residual);
            let next = norm(&residual);
            if next < current || (next <= tolerance) {
                current = next;
                x.copy_from_slice(&trial);
                break;
            }
            scale *= 0.5;
            if scale < 1e-3 {
                manifold.residual(x, &mut residual);
                let (equation, residual) = largest(&residual);
                return Err(ManifoldError::NotConverged {
                    residual,
                    iterations: max_iterations,
                    equation,
                });
            }
        }
    }
    let (equation, residual) = largest(&residual);
    if residual <= tolerance {
        Ok(())
    } else {
        Err(ManifoldError::NotConverged {
            residual,
            iterations: max_iterations,
            equation,
        })
    }
}

/// The dimension k of the manifold at its point `x`: the number of variables
/// less the rank of the Jacobian.
///
/// The rank is where the pivots of the factorisation fall by the largest
/// factor below 10⁻⁷ of the first.
pub fn dimension<M: ImplicitManifold + ?Sized>(manifold: &M, x: &[f64]) -> usize {
    let pattern = manifold.jacobian_pattern();
    let mut values = vec![0.0; pattern.len()];
    manifold.jacobian(x, &mut values);
    let mut qr = PivotedQr::default();
    let rank = qr.factorise(pattern, &values, usize::MAX, RANK_TOLERANCE);
    manifold.ambient_dimension() - rank
}
