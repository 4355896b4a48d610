//! Point and triangle: over its face, or else next to one of its edges. About 20 ns.

use nalgebra::Point3;

use super::{ClosestPoints, NEEDLE_SINE_SQUARED, closest_points_point_segment, projects_inside};

/// The part of a triangle on which a closest point lies. Edge `i` runs from corner `i` to corner `i + 1` modulo 3.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Feature {
    Corner(u8),
    Edge(u8),
    Face,
}

impl Feature {
    /// What lies at parameter `t` of edge `k`.
    #[inline]
    pub fn of_edge(k: u8, t: f64) -> Self {
        if t == 0.0 {
            Self::Corner(k)
        } else if t == 1.0 {
            Self::Corner((k + 1) % 3)
        } else {
            Self::Edge(k)
        }
    }
}

/// The point of the triangle that is closest to `point`.
///
/// A triangle without area (or with an angle below 1e-8) is the union of its edges.
///
/// ```
/// use nalgebra::Point3;
/// use tensegra_collision::closest_points_point_triangle;
///
/// let corners = [Point3::origin(), Point3::new(1.0, 0.0, 0.0), Point3::new(0.0, 1.0, 0.0)];
/// let pair = closest_points_point_triangle(&Point3::new(0.2, 0.2, 3.0), &corners);
/// assert_eq!(pair.distance(), 3.0);
/// ```
#[inline]
#[must_use]
pub fn closest_points_point_triangle(
    point: &Point3<f64>,
    corners: &[Point3<f64>; 3],
) -> ClosestPoints {
    let (on_b, _) = point_triangle(point, corners);
    ClosestPoints {
        on_a: *point,
        on_b,
        s: 0.0,
        t: 0.0,
        unique: true,
    }
}

#[inline]
pub(crate) fn point_triangle(
    p: &Point3<f64>,
    corners: &[Point3<f64>; 3],
) -> (Point3<f64>, Feature) {
    let [a, b, c] = corners;
    let (ab, ac) = (b - a, c - a);
    let normal = ab.cross(&ac);
    let squared = normal.norm_squared();
    if squared > NEEDLE_SINE_SQUARED * ab.norm_squared() * ac.norm_squared()
        && projects_inside(p, corners, &normal, 0.0)
    {
        let height = normal.dot(&(p - a)) / squared;
        return (p - normal * height, Feature::Face);
    }
    let mut best = (*a, Feature::Corner(0));
    let mut least = f64::INFINITY;
    for k in 0..3u8 {
        let (from, to) = (usize::from(k), (usize::from(k) + 1) % 3);
        let pair = closest_points_point_segment(p, &corners[from], &corners[to]);
        let squared = pair.distance_squared();
        if squared < least {
            least = squared;
            best = (pair.on_b, Feature::of_edge(k, pair.t));
        }
    }
    best
}
