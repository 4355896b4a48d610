//! The rim of a domain about a vertex of its polytope: where the sphere of the
//! chart's radius lies inside the polytope, there is manifold left to explore.

use crate::{polytope::Polytope, qr::dot};

/// Directions (of length 1) that sample the rim about a vertex that lies outside
/// of `radius`: that of the vertex first, then along the edges that meet in it
/// up to where they enter the sphere, about `angle` apart, and, for k > 2,
/// between these.
pub(super) fn directions(cell: &Polytope, vertex: usize, radius: f64, angle: f64) -> Vec<Vec<f64>> {
    let start = &cell.vertices()[vertex].point;
    let ends: Vec<Vec<f64>> = cell
        .adjacent(vertex)
        .map(|other| end_of_rim(start, &cell.vertices()[other].point, radius))
        .collect();
    let mut rim = vec![unit(start.clone())];
    for end in &ends {
        rim.extend(segment(start, end, angle));
    }
    if cell.dimension() > 2 {
        for (i, a) in ends.iter().enumerate() {
            for b in &ends[i + 1..] {
                rim.extend(segment(a, b, angle));
            }
        }
    }
    rim
}

/// Where an edge from a vertex outside of the sphere enters it; where it does
/// not, its point nearest to the sphere.
fn end_of_rim(from: &[f64], to: &[f64], radius: f64) -> Vec<f64> {
    let d: Vec<f64> = to.iter().zip(from).map(|(b, a)| b - a).collect();
    let (dd, fd) = (dot(&d, &d), dot(from, &d));
    let nearest = (-fd / dd).clamp(0.0, 1.0);
    // |from + λ d|² = radius².
    let discriminant = fd * fd - dd * (dot(from, from) - radius * radius);
    let enters = if discriminant > 0.0 {
        (-fd - discriminant.sqrt()) / dd
    } else {
        nearest
    };
    let share = enters.clamp(0.0, nearest);
    from.iter().zip(&d).map(|(a, d)| a + share * d).collect()
}

/// Directions from that of `a`, excluded, to that of `b`, included, about `angle`
/// apart.
fn segment(a: &[f64], b: &[f64], angle: f64) -> impl Iterator<Item = Vec<f64>> {
    let (u, v) = (unit(a.to_vec()), unit(b.to_vec()));
    let opening = dot(&u, &v).clamp(-1.0, 1.0).acos();
    let steps = (opening / angle).ceil().max(1.0) as usize;
    (1..=steps).map(move |step| {
        let s = step as f64 / steps as f64;
        unit(u.iter().zip(&v).map(|(a, b)| a + s * (b - a)).collect())
    })
}

fn unit(mut v: Vec<f64>) -> Vec<f64> {
    let length = dot(&v, &v).sqrt().max(f64::MIN_POSITIVE);
    v.iter_mut().for_each(|v| *v /= length);
    v
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rim_of_a_square_is_the_arc_up_to_the_middles_of_its_sides() {
        let square = Polytope::cube(2, 1.0);
        let vertex = 3;
        assert_eq!(square.vertices()[vertex].point, [1.0, 1.0]);
        let angles: Vec<f64> = directions(&square, vertex, 1.0, 0.2)
            .iter()
            .map(|d| d[1].atan2(d[0]).to_degrees())
            .collect();
        assert!((angles[0] - 45.0).abs() < 1e-12);
        let has = |angle: f64| angles.iter().any(|a| (a - angle).abs() < 1e-9);
        assert!(has(0.0) && has(90.0));
        assert!(angles.iter().all(|a| (-1e-9..90.0 + 1e-9).contains(a)));
        let mut sorted = angles.clone();
        sorted.sort_by(f64::total_cmp);
        assert!(sorted.windows(2).all(|p| p[1] - p[0] < 13.0));
    }

    #[test]
    fn the_rim_between_the_edges_of_a_cube_is_sampled_too() {
        let cube = Polytope::cube(3, 1.0);
        let rim = directions(&cube, 7, 1.0, 0.3);
        let inner = rim.iter().filter(|d| d.iter().all(|x| *x > 0.3));
        assert!(inner.count() >= 4);
    }
}
