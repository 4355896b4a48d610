//! Rigid alignment of one set of points with another.

use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};

/// The rigid motion that brings `points` as near to `targets` as can be, in the
/// sense of least squares over pairs (W. Kabsch, *Acta Crystallographica* A32,
/// 1976). With `planar`, rotations are about z alone. Cost: linear in the points.
///
/// # Examples
/// ```
/// use nalgebra::{Isometry3, Point3, Vector3};
/// use tensegra_formfinding::alignment;
///
/// let points = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 3.0]];
/// let points = points.map(Point3::from);
/// let motion = Isometry3::new(Vector3::new(1.0, 2.0, 3.0), Vector3::new(0.3, -0.2, 2.0));
/// let moved = points.map(|point| motion * point);
/// let found = alignment(&points, &moved, false);
/// assert!((found * points[3] - moved[3]).norm() < 1e-12);
/// ```
pub fn alignment(points: &[Point3<f64>], targets: &[Point3<f64>], planar: bool) -> Isometry3<f64> {
    let count = points.len().min(targets.len()).max(1) as f64;
    let mean = |points: &[Point3<f64>]| {
        points
            .iter()
            .map(|point| point.coords)
            .sum::<Vector3<f64>>()
            / count
    };
    let (from, to) = (mean(points), mean(targets));
    let covariance: Matrix3<f64> = points
        .iter()
        .zip(targets)
        .map(|(point, target)| (target.coords - to) * (point.coords - from).transpose())
        .sum();
    let rotation = if planar {
        let sine = covariance[(1, 0)] - covariance[(0, 1)];
        let cosine = covariance[(0, 0)] + covariance[(1, 1)];
        Rotation3::from_axis_angle(&Vector3::z_axis(), sine.atan2(cosine))
    } else {
        nearest_rotation(covariance)
    };
    let shift = Translation3::from(to - rotation * from);
    Isometry3::from_parts(shift, UnitQuaternion::from_rotation_matrix(&rotation))
}

/// The rotation R for which the trace of Rᵀ C is largest.
fn nearest_rotation(covariance: Matrix3<f64>) -> Rotation3<f64> {
    let svd = covariance.svd(true, true);
    let (Some(u), Some(v_t)) = (svd.u, svd.v_t) else {
        return Rotation3::identity();
    };
    // A reflection would fit better: turn the direction that matters least.
    let least = svd.singular_values.imin();
    let mut sign = Vector3::repeat(1.0);
    sign[least] = (u.determinant() * v_t.determinant()).signum();
    Rotation3::from_matrix_unchecked(u * Matrix3::from_diagonal(&sign) * v_t)
}
