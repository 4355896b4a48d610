//! Polygons into triangles, by clipping ears (Meisters, "Polygons have ears", 1975), without triangles of no area:
//! corners in the middle of a straight edge stay corners, so that neighbouring faces still share whole edges.
//! Quadratic in the number of corners for ordinary polygons.

use nalgebra::{Point2, Point3, Vector3};

/// Splits the polygon with the given corners, listed in order, into triangles of the same orientation; the triangles
/// refer to positions in `corners`. `None` if the polygon has no area or crosses itself.
pub(crate) fn triangulate(corners: &[Point3<f64>]) -> Option<Vec<[usize; 3]>> {
    // Newell's normal: exact for a plane polygon, an average for one that is not.
    let first = corners.first()?;
    let normal: Vector3<f64> = (1..corners.len() - 1)
        .map(|i| (corners[i] - first).cross(&(corners[i + 1] - first)))
        .sum();
    let size = corners
        .iter()
        .map(|p| (p - first).norm())
        .fold(0.0, f64::max);
    let normal = normal.try_normalize(1e-14 * size * size)?;
    let x = crate::query::across(&normal, &(corners[1] - first));
    let y = normal.cross(&x);
    let flat: Vec<Point2<f64>> = corners
        .iter()
        .map(|p| Point2::new((p - first).dot(&x), (p - first).dot(&y)))
        .collect();
    let turn = |a: usize, b: usize, c: usize| {
        let (u, v) = (flat[b] - flat[a], flat[c] - flat[a]);
        u.x * v.y - u.y * v.x
    };
    let tolerance = 1e-14 * size * size;
    let mut rest: Vec<usize> = (0..corners.len()).collect();
    let mut triangles = Vec::with_capacity(corners.len() - 2);
    while rest.len() > 2 {
        let count = rest.len();
        let ear = (0..count).find(|&i| {
            let [a, b, c] = [
                rest[(i + count - 1) % count],
                rest[i],
                rest[(i + 1) % count],
            ];
            turn(a, b, c) > tolerance
                && rest.iter().all(|&p| {
                    [a, b, c].contains(&p)
                        || turn(a, b, p) < -tolerance
                        || turn(b, c, p) < -tolerance
                        || turn(c, a, p) < -tolerance
                })
        })?;
        triangles.push([
            rest[(ear + count - 1) % count],
            rest[ear],
            rest[(ear + 1) % count],
        ]);
        rest.remove(ear);
    }
    Some(triangles)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn area(corners: &[Point3<f64>], triangles: &[[usize; 3]]) -> f64 {
        triangles
            .iter()
            .map(|t| {
                let [a, b, c] = t.map(|i| corners[i]);
                let area = 0.5 * (b - a).cross(&(c - a)).z;
                assert!(area > 0.0, "triangle {t:?} is turned over or flat");
                area
            })
            .sum()
    }

    fn in_plane(corners: &[(f64, f64)]) -> Vec<Point3<f64>> {
        corners
            .iter()
            .map(|&(x, y)| Point3::new(x, y, 0.0))
            .collect()
    }

    #[test]
    fn a_comb_keeps_its_area() {
        let comb = in_plane(&[
            (0.0, 0.0),
            (5.0, 0.0),
            (5.0, 3.0),
            (4.0, 3.0),
            (4.0, 1.0),
            (3.0, 1.0),
            (3.0, 3.0),
            (2.0, 3.0),
            (2.0, 1.0),
            (1.0, 1.0),
            (1.0, 3.0),
            (0.0, 3.0),
        ]);
        let triangles = triangulate(&comb).unwrap();
        assert_eq!(triangles.len(), comb.len() - 2);
        assert!((area(&comb, &triangles) - 11.0).abs() < 1e-12);
    }

    #[test]
    fn corners_on_straight_edges_stay() {
        let square = in_plane(&[
            (0.0, 0.0),
            (1.0, 0.0),
            (2.0, 0.0),
            (2.0, 2.0),
            (1.0, 2.0),
            (0.0, 2.0),
        ]);
        let triangles = triangulate(&square).unwrap();
        assert_eq!(triangles.len(), 4);
        assert!((area(&square, &triangles) - 4.0).abs() < 1e-12);
    }

    #[test]
    fn no_area_and_crossings_are_refused() {
        assert!(triangulate(&in_plane(&[(0.0, 0.0), (1.0, 1.0), (2.0, 2.0)])).is_none());
        let bow_tie = in_plane(&[(0.0, 0.0), (1.0, 1.0), (1.0, 0.0), (0.0, 1.0)]);
        assert!(triangulate(&bow_tie).is_none());
    }
}
