//! Segment and triangle: a crossing, else the lower end over the face, else the nearest edge.
//!
//! The distance of a moving point to the plane is linear along the segment, so an end that projects into the
//! triangle and is the lower of the two is closest; if it does not, the closest pair lies on an edge. About 40 ns.

use nalgebra::{Point3, Vector3};

use super::{
    ClosestPoints, NEEDLE_SINE_SQUARED, PARALLEL_SINE_SQUARED, closest_points_segment_segment,
};

/// The closest points of the segment from `a0` to `a1` (parameter `s`) and a triangle; the two coincide where the
/// segment crosses it.
///
/// A triangle without area (or with an angle below 1e-8) is the union of its edges.
///
/// ```
/// use nalgebra::Point3;
/// use tensegra_collision::closest_points_segment_triangle;
///
/// let corners = [Point3::origin(), Point3::new(1.0, 0.0, 0.0), Point3::new(0.0, 1.0, 0.0)];
/// let pair = closest_points_segment_triangle(
///     &Point3::new(0.2, 0.2, 3.0),
///     &Point3::new(0.2, 0.2, -1.0),
///     &corners,
/// );
/// assert_eq!(pair.s, 0.75);
/// assert_eq!(pair.distance(), 0.0);
/// ```
#[inline]
#[must_use]
pub fn closest_points_segment_triangle(
    a0: &Point3<f64>,
    a1: &Point3<f64>,
    corners: &[Point3<f64>; 3],
) -> ClosestPoints {
    let (ab, ac) = (corners[1] - corners[0], corners[2] - corners[0]);
    let normal = ab.cross(&ac);
    let squared = normal.norm_squared();
    if squared > NEEDLE_SINE_SQUARED * ab.norm_squared() * ac.norm_squared() {
        let axis = a1 - a0;
        let (h0, h1) = (
            normal.dot(&(a0 - corners[0])),
            normal.dot(&(a1 - corners[0])),
        );
        let slope = h1 - h0;
        let parallel = slope * slope <= PARALLEL_SINE_SQUARED * squared * axis.norm_squared();
        let (s, height) = if h0 * h1 <= 0.0 && slope != 0.0 {
            ((-h0 / slope).clamp(0.0, 1.0), 0.0)
        } else if h0.abs() <= h1.abs() {
            (0.0, h0)
        } else {
            (1.0, h1)
        };
        let on_a = a0 + axis * s;
        if projects_inside(&on_a, corners, &normal, 0.0) {
            return ClosestPoints {
                on_a,
                on_b: on_a - normal * (height / squared),
                s,
                t: 0.0,
                unique: !parallel,
            };
        }
    }
    let mut best = closest_points_segment_segment(a0, a1, &corners[0], &corners[1]);
    let mut least = best.distance_squared();
    for (p, q) in [(1, 2), (2, 0)] {
        let pair = closest_points_segment_segment(a0, a1, &corners[p], &corners[q]);
        let squared = pair.distance_squared();
        if squared < least {
            (best, least) = (pair, squared);
        }
    }
    ClosestPoints { t: 0.0, ..best }
}

/// Whether a point projects into a triangle along its normal; `slack` is the negative area (times two, times the
/// length of the normal) that passes for rounding.
#[inline(always)]
pub(crate) fn projects_inside(
    p: &Point3<f64>,
    corners: &[Point3<f64>; 3],
    normal: &Vector3<f64>,
    slack: f64,
) -> bool {
    let [a, b, c] = corners;
    let (pa, pb, pc) = (a - p, b - p, c - p);
    normal.dot(&pa.cross(&pb)) >= -slack
        && normal.dot(&pb.cross(&pc)) >= -slack
        && normal.dot(&pc.cross(&pa)) >= -slack
}
