//! Point and triangle, by the Voronoi regions of its corners and edges (Ericson, "Real-Time Collision Detection",
//! 2005, section 5.1.5), with the region reported. About 10 ns.

use nalgebra::Point3;

use super::{ClosestPoints, closest_points_point_segment};

/// The part of a triangle on which a closest point lies. Edge `i` runs from corner `i` to corner `i + 1` modulo 3.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Feature {
    Corner(u8),
    Edge(u8),
    Face,
}

/// The point of the triangle that is closest to `point`.
///
/// A triangle without area is the union of its edges.
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
    let ap = p - a;
    let (d1, d2) = (ab.dot(&ap), ac.dot(&ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return (*a, Feature::Corner(0));
    }
    let bp = p - b;
    let (d3, d4) = (ab.dot(&bp), ac.dot(&bp));
    if d3 >= 0.0 && d4 <= d3 {
        return (*b, Feature::Corner(1));
    }
    let cp = p - c;
    let (d5, d6) = (ab.dot(&cp), ac.dot(&cp));
    if d6 >= 0.0 && d5 <= d6 {
        return (*c, Feature::Corner(2));
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        return (a + ab * (d1 / (d1 - d3)), Feature::Edge(0));
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 - d3 >= 0.0 && d5 - d6 >= 0.0 {
        let w = (d4 - d3) / ((d4 - d3) + (d5 - d6));
        return (b + (c - b) * w, Feature::Edge(1));
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return (a + ac * (d2 / (d2 - d6)), Feature::Edge(2));
    }
    let sum = va + vb + vc;
    if sum > 0.0 {
        (a + ab * (vb / sum) + ac * (vc / sum), Feature::Face)
    } else {
        closest_edge(p, corners)
    }
}

/// Triangles without area, where rounding may leave no region above.
#[cold]
fn closest_edge(p: &Point3<f64>, corners: &[Point3<f64>; 3]) -> (Point3<f64>, Feature) {
    let mut best = (corners[0], Feature::Corner(0));
    let mut least = f64::INFINITY;
    for i in 0..3u8 {
        let pair = closest_points_point_segment(
            p,
            &corners[usize::from(i)],
            &corners[(usize::from(i) + 1) % 3],
        );
        if pair.distance_squared() < least {
            least = pair.distance_squared();
            best = (pair.on_b, Feature::Edge(i));
        }
    }
    best
}
