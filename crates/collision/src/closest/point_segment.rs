//! Point and segment: projection on the line, clamped. A few nanoseconds.

use nalgebra::Point3;

use super::ClosestPoints;

/// The point of the segment from `b0` to `b1` that is closest to `point`; `t` is its parameter.
///
/// A segment of length zero is a point.
///
/// ```
/// use nalgebra::Point3;
/// use tensegra_collision::closest_points_point_segment;
///
/// let pair = closest_points_point_segment(
///     &Point3::new(1.0, 1.0, 0.0),
///     &Point3::origin(),
///     &Point3::new(4.0, 0.0, 0.0),
/// );
/// assert_eq!(pair.t, 0.25);
/// assert_eq!(pair.distance(), 1.0);
/// ```
#[inline]
#[must_use]
pub fn closest_points_point_segment(
    point: &Point3<f64>,
    b0: &Point3<f64>,
    b1: &Point3<f64>,
) -> ClosestPoints {
    let axis = b1 - b0;
    let squared = axis.norm_squared();
    let t = if squared > 0.0 {
        ((point - b0).dot(&axis) / squared).clamp(0.0, 1.0)
    } else {
        0.0
    };
    ClosestPoints {
        on_a: *point,
        on_b: b0 + axis * t,
        s: 0.0,
        t,
        unique: true,
    }
}
