//! The closest-point kernels. The distance between convex sets is a convex function, so conditions of optimality prove
//! a pair closest; no sampling is needed.

mod common;

use common::{generator, point, vector};
use nalgebra::{Point3, Vector3};
use rand::RngExt;
use tensegra_collision::{
    Aabb, ClosestPoints, closest_points_point_segment, closest_points_point_triangle,
    closest_points_segment_box, closest_points_segment_segment, closest_points_segment_triangle,
};

/// The derivative of a squared distance along a segment is zero, or points out of its range.
fn optimal(parameter: f64, slope: f64, tolerance: f64) -> bool {
    slope.abs() <= tolerance
        || (parameter == 0.0 && slope > 0.0)
        || (parameter == 1.0 && slope < 0.0)
}

fn check_segments(
    a0: Point3<f64>,
    a1: Point3<f64>,
    b0: Point3<f64>,
    b1: Point3<f64>,
) -> ClosestPoints {
    let pair = closest_points_segment_segment(&a0, &a1, &b0, &b1);
    let scale = [a0, a1, b0, b1]
        .iter()
        .map(|p| p.coords.norm())
        .fold(1.0, f64::max);
    let tolerance = 1e-13 * scale * scale;
    let apart = pair.on_a - pair.on_b;
    assert!((0.0..=1.0).contains(&pair.s) && (0.0..=1.0).contains(&pair.t));
    assert!(
        optimal(pair.s, apart.dot(&(a1 - a0)), tolerance),
        "{pair:?}"
    );
    assert!(
        optimal(pair.t, -apart.dot(&(b1 - b0)), tolerance),
        "{pair:?}"
    );
    assert!((pair.on_a - (a0 + (a1 - a0) * pair.s)).norm() <= 1e-15 * scale);
    assert!((pair.on_b - (b0 + (b1 - b0) * pair.t)).norm() <= 1e-15 * scale);
    pair
}

#[test]
fn random_segments_are_optimal() {
    let mut rng = generator(1);
    for _ in 0..50_000 {
        let [a0, a1, b0, b1] = [0; 4].map(|_| point(&mut rng, 1.0));
        assert!(check_segments(a0, a1, b0, b1).unique);
    }
}

#[test]
fn segments_on_a_coarse_grid_are_optimal() {
    // Every kind of degeneracy: points, parallels, collinear overlaps, crossings, shared ends.
    let mut rng = generator(2);
    for _ in 0..50_000 {
        let [a0, a1, b0, b1] = [0; 4].map(|_| Point3::from(vector(&mut rng, 1.5).map(f64::round)));
        check_segments(a0, a1, b0, b1);
    }
}

#[test]
fn nearly_parallel_segments_keep_their_distance() {
    let mut rng = generator(3);
    for exponent in 1..17 {
        for _ in 0..300 {
            let (a0, along) = (point(&mut rng, 1.0), vector(&mut rng, 1.0));
            let tilt = vector(&mut rng, 1.0) * 10f64.powi(-exponent);
            // The second segment crosses the first at a chosen point, pulled apart by a known distance.
            let (s, t) = (rng.random_range(0.2..0.8), rng.random_range(0.2..0.8));
            let other = along + tilt;
            let apart = along.cross(&other);
            if apart.norm() < 1e-17 {
                continue;
            }
            let gap = 0.3;
            let b0 = a0 + along * s + apart.normalize() * gap - other * t;
            let pair = check_segments(a0, a0 + along, b0, b0 + other);
            // The common perpendicular of the construction is known to 1e-16 / angle only.
            let blur = 1e-15 * along.norm() * other.norm() / apart.norm();
            let error = (pair.distance() - gap).abs();
            if blur < 1e-2 {
                assert!(
                    error < 1e-13 + 10.0 * blur * blur,
                    "1e-{exponent}: {error:e}"
                );
            }
        }
    }
}

#[test]
fn parallel_segments_meet_in_the_middle_of_the_overlap() {
    let x = |x: f64, y: f64| Point3::new(x, y, 0.0);
    let pair = check_segments(x(0.0, 0.0), x(4.0, 0.0), x(1.0, 1.0), x(3.0, 1.0));
    assert_eq!((pair.s, pair.t, pair.unique), (0.5, 0.5, false));
    let pair = check_segments(x(0.0, 0.0), x(4.0, 0.0), x(8.0, 1.0), x(2.0, 1.0));
    assert_eq!((pair.s, pair.unique), (0.75, false));
    assert!((pair.t - 5.0 / 6.0).abs() < 1e-15);
    let pair = check_segments(x(0.0, 0.0), x(1.0, 0.0), x(2.0, 1.0), x(5.0, 1.0));
    assert_eq!((pair.s, pair.t, pair.unique), (1.0, 0.0, true));
    let pair = check_segments(x(0.0, 0.0), x(1.0, 0.0), x(1.0, 1.0), x(5.0, 1.0));
    assert_eq!((pair.s, pair.t, pair.unique), (1.0, 0.0, true));
}

#[test]
fn points_and_segments() {
    let mut rng = generator(4);
    for _ in 0..10_000 {
        let [p, b0, b1] = [0; 3].map(|_| point(&mut rng, 1.0));
        let pair = closest_points_point_segment(&p, &b0, &b1);
        assert!(optimal(pair.t, -(p - pair.on_b).dot(&(b1 - b0)), 1e-14));
        let same = closest_points_point_segment(&p, &b0, &b0);
        assert_eq!((same.t, same.on_b), (0.0, b0));
    }
}

/// A point of a triangle is closest to `p` if no corner is on the near side of the plane across it.
fn closest_in_triangle(p: &Point3<f64>, q: &Point3<f64>, corners: &[Point3<f64>; 3]) -> bool {
    let apart = p - q;
    corners.iter().all(|c| apart.dot(&(c - q)) <= 1e-13)
}

fn in_triangle(q: &Point3<f64>, corners: &[Point3<f64>; 3]) -> bool {
    let pair = closest_points_point_triangle(q, corners);
    pair.distance() <= 1e-13
}

#[test]
fn points_and_triangles() {
    let mut rng = generator(5);
    for round in 0..40_000 {
        let mut corners = [0; 3].map(|_| point(&mut rng, 1.0));
        if round % 4 == 0 {
            corners[2] = corners[0] + (corners[1] - corners[0]) * rng.random_range(-1.0..2.0);
        }
        let p = point(&mut rng, 1.5);
        let pair = closest_points_point_triangle(&p, &corners);
        assert!(
            closest_in_triangle(&p, &pair.on_b, &corners),
            "{corners:?} {p} {pair:?}"
        );
    }
}

#[test]
fn segments_and_triangles() {
    let mut rng = generator(6);
    let mut crossings = 0;
    for round in 0..40_000 {
        let mut corners = [0; 3].map(|_| point(&mut rng, 1.0));
        let (a0, mut a1) = (point(&mut rng, 1.0), point(&mut rng, 1.0));
        match round % 8 {
            0 => corners[2] = nalgebra::center(&corners[0], &corners[1]),
            1 => a1 = a0,
            2 => a1 = a0 + (corners[1] - corners[2]),
            _ => {}
        }
        let pair = closest_points_segment_triangle(&a0, &a1, &corners);
        assert!(in_triangle(&pair.on_b, &corners));
        assert!((pair.on_a - (a0 + (a1 - a0) * pair.s)).norm() < 1e-15);
        let apart = pair.on_a - pair.on_b;
        assert!(closest_in_triangle(&pair.on_a, &pair.on_b, &corners));
        assert!(
            optimal(pair.s, apart.dot(&(a1 - a0)), 1e-13),
            "{corners:?} {a0} {a1} {pair:?}"
        );
        crossings += usize::from(pair.distance() < 1e-14);
    }
    assert!(crossings > 1000, "{crossings}");
}

#[test]
fn segments_and_boxes() {
    let mut rng = generator(7);
    let (mut flat, mut inside) = (0, 0);
    for round in 0..50_000 {
        let half = Vector3::from_fn(|_, _| rng.random_range(0.1..1.0));
        let center = point(&mut rng, 0.5);
        let body = Aabb {
            min: center - half,
            max: center + half,
        };
        let (a0, mut a1) = (point(&mut rng, 2.0), point(&mut rng, 2.0));
        match round % 6 {
            0 => a1.z = a0.z,
            1 => (a1.z, a1.y) = (a0.z, a0.y),
            2 => a1 = a0,
            _ => {}
        }
        let pair = closest_points_segment_box(&a0, &a1, &body);
        assert!((0.0..=1.0).contains(&pair.s));
        let apart = pair.on_a - pair.on_b;
        assert!(optimal(pair.s, apart.dot(&(a1 - a0)), 1e-13), "{pair:?}");
        assert!(body.distance_to_point(&pair.on_b) == 0.0);
        for k in 0..3 {
            // The excess points out of the box, across the face it is on.
            assert!(apart[k] == 0.0 || pair.on_b[k] == body.min[k] || pair.on_b[k] == body.max[k]);
        }
        inside += usize::from(pair.distance() == 0.0);
        flat += usize::from(!pair.unique && pair.distance() > 0.0);
    }
    assert!(flat > 100 && inside > 1000, "{flat} {inside}");
}

#[test]
fn a_segment_along_a_face_touches_in_the_middle() {
    let body = Aabb {
        min: Point3::origin(),
        max: Point3::new(1.0, 1.0, 1.0),
    };
    let pair = closest_points_segment_box(
        &Point3::new(-1.0, 0.5, 2.0),
        &Point3::new(3.0, 0.5, 2.0),
        &body,
    );
    assert_eq!((pair.s, pair.unique), (0.375, false));
    assert_eq!(pair.on_b, Point3::new(0.5, 0.5, 1.0));
}
