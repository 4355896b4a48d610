//! Distances by other formulas than those that planning uses.

use nalgebra::{Point2, Vector3};

use crate::Obstacle;

/// Distance between two members: that of the feet of the common perpendicular where both lie on
/// the members, else the least distance of an end from the other member.
pub(super) fn member_distance(first: [Vector3<f64>; 2], second: [Vector3<f64>; 2]) -> f64 {
    let (u, v) = (first[1] - first[0], second[1] - second[0]);
    let normal = u.cross(&v);
    let squared = normal.norm_squared();
    let between = second[0] - first[0];
    if squared > 1e-18 * u.norm_squared() * v.norm_squared() {
        let s = between.cross(&v).dot(&normal) / squared;
        let t = between.cross(&u).dot(&normal) / squared;
        if (0.0..=1.0).contains(&s) && (0.0..=1.0).contains(&t) {
            return between.dot(&normal).abs() / squared.sqrt();
        }
    }
    let to = |p: Vector3<f64>, member: [Vector3<f64>; 2]| {
        let side = member[1] - member[0];
        let along = ((p - member[0]).dot(&side) / side.norm_squared()).clamp(0.0, 1.0);
        (p - member[0] - side * along).norm()
    };
    to(first[0], second)
        .min(to(first[1], second))
        .min(to(second[0], first))
        .min(to(second[1], first))
}

/// Distance between a member and an obstacle seen from above; zero where they overlap.
pub(super) fn outline_distance(obstacle: &Obstacle, a: Vector3<f64>, b: Vector3<f64>) -> f64 {
    let corners: Vec<Vector3<f64>> = obstacle
        .corners()
        .iter()
        .map(|p: &Point2<f64>| Vector3::new(p.x, p.y, 0.0))
        .collect();
    let flat = |v: Vector3<f64>| Vector3::new(v.x, v.y, 0.0);
    let (a, b) = (flat(a), flat(b));
    let sides = (0..corners.len()).map(|k| [corners[k], corners[(k + 1) % corners.len()]]);
    let inside = sides.clone().all(|[c, d]| (d - c).cross(&(a - c)).z >= 0.0);
    if inside {
        return 0.0;
    }
    let crosses = |c: Vector3<f64>, d: Vector3<f64>| {
        let side = |p: Vector3<f64>, q: Vector3<f64>, r: Vector3<f64>| (q - p).cross(&(r - p)).z;
        side(a, b, c) * side(a, b, d) < 0.0 && side(c, d, a) * side(c, d, b) < 0.0
    };
    let mut distance = f64::INFINITY;
    for [c, d] in sides {
        if crosses(c, d) {
            return 0.0;
        }
        let along = |p: Vector3<f64>, q: Vector3<f64>, r: Vector3<f64>| {
            let side = r - q;
            let squared = side.norm_squared().max(f64::MIN_POSITIVE);
            let t = ((p - q).dot(&side) / squared).clamp(0.0, 1.0);
            (p - q - side * t).norm()
        };
        distance = distance.min(along(a, c, d)).min(along(b, c, d));
        distance = distance.min(along(c, a, b)).min(along(d, a, b));
    }
    distance
}
