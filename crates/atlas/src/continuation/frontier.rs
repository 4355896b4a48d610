//! The rim of a domain about a vertex of its polytope: where the sphere of the
//! chart's radius lies inside the polytope, there is manifold left to explore.

use crate::{polytope::Polytope, qr::dot};

/// The rim about a vertex that lies outside of the radius, as directions of
/// length 1.
pub(super) struct Rim {
    /// Direction of the vertex.
    pub(super) vertex: Vec<f64>,
    /// From there, excluded, along each edge up to where it enters the sphere.
    pub(super) arms: Vec<Vec<Vec<f64>>>,
    /// For k > 2, between the ends of the arms.
    pub(super) between: Vec<Vec<Vec<f64>>>,
}

/// Samples the rim about a vertex that lies outside of `radius`, about `angle`
/// apart.
pub(super) fn rim(cell: &Polytope, vertex: usize, radius: f64, angle: f64) -> Rim {
    let start = &cell.vertices()[vertex].point;
    let ends: Vec<Vec<f64>> = cell
        .adjacent(vertex)
        .map(|other| end_of_rim(start, &cell.vertices()[other].point, radius))
        .collect();
    let mut between = Vec::new();
    if cell.dimension() > 2 {
        for (i, a) in ends.iter().enumerate() {
            between.extend(ends[i + 1..].iter().map(|b| segment(a, b, angle)));
        }
    }
    Rim {
        vertex: unit(start.clone()),
        arms: ends.iter().map(|end| segment(start, end, angle)).collect(),
        between,
    }
}

/// The direction halfway between two.
pub(super) fn middle(a: &[f64], b: &[f64]) -> Vec<f64> {
    unit(a.iter().zip(b).map(|(a, b)| 0.5 * (a + b)).collect())
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
fn segment(a: &[f64], b: &[f64], angle: f64) -> Vec<Vec<f64>> {
    let (u, v) = (unit(a.to_vec()), unit(b.to_vec()));
    let opening = dot(&u, &v).clamp(-1.0, 1.0).acos();
    let steps = (opening / angle).ceil().max(1.0) as usize;
    let at = |step: usize| {
        let s = step as f64 / steps as f64;
        unit(u.iter().zip(&v).map(|(a, b)| a + s * (b - a)).collect())
    };
    (1..=steps).map(at).collect()
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
        let rim = rim(&square, vertex, 1.0, 0.2);
        let angles: Vec<f64> = std::iter::once(&rim.vertex)
            .chain(rim.arms.iter().flatten())
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
        let rim = rim(&cube, 7, 1.0, 0.3);
        let whole = rim.arms.iter().chain(&rim.between).flatten();
        let inner = whole.filter(|d| d.iter().all(|x| *x > 0.3));
        assert_eq!((rim.arms.len(), rim.between.len()), (3, 3));
        assert!(inner.count() >= 3);
    }
}
