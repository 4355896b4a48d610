//! Segment and convex polyhedron, with depth; exact in both.
//!
//! One pass over the faces gives the best separating face plane and the part of the segment behind all planes. If an
//! end of the segment stands over a face that separates, that is the distance; else the nearest edge is, among those
//! of faces that the segment can see. If a part lies behind all planes, the separating-axis theorem over faces and
//! over cross products with edges (those on the silhouette, where the polyhedron's extent is known) gives the
//! shortest translation out. Cost linear in faces and edges: 50 to 150 ns for a triangular prism.

use nalgebra::{Point3, Vector3};

use super::{AxisWitness, TOUCHING, deepest_along};
use crate::closest::closest_points_segment_segment;
use crate::polyhedron::Polyhedron;

/// The segment from `a` to `b` against a polyhedron.
#[inline]
pub(crate) fn axis_polyhedron(a: &Point3<f64>, b: &Point3<f64>, body: &Polyhedron) -> AxisWitness {
    let size = body.size;
    let mut gap = f64::NEG_INFINITY;
    let mut second = f64::NEG_INFINITY;
    let mut face = 0;
    let mut visible = 0u128;
    let (mut enters, mut leaves) = (0f64, 1f64);
    for (index, plane) in body.planes.iter().enumerate() {
        let (ha, hb) = (plane.height(a), plane.height(b));
        let low = ha.min(hb);
        if low > gap {
            second = gap;
            (gap, face) = (low, index);
        } else {
            second = second.max(low);
        }
        if ha.max(hb) > 0.0 {
            visible |= 1 << index.min(127);
            if low > 0.0 {
                leaves = -1.0;
            } else if ha > hb {
                enters = enters.max(ha / (ha - hb));
            } else {
                leaves = leaves.min(ha / (ha - hb));
            }
        }
    }
    let normal = body.planes[face].normal;
    let (s, unique) = deepest_along(&normal, &(b - a), (b - a).norm_squared());
    let over_face = AxisWitness {
        distance: gap,
        normal,
        s,
        unique,
    };
    if enters <= leaves {
        return depth(a, b, body, over_face, second);
    }
    if gap > 0.0 {
        let foot = a + (b - a) * s - normal * gap;
        if body
            .planes
            .iter()
            .all(|p| p.height(&foot) <= TOUCHING * size)
        {
            return over_face;
        }
    }
    let mut least = f64::INFINITY;
    let mut best = None;
    for edge in &body.edges {
        let seen = edge.faces.iter().any(|&f| visible >> f.min(127) & 1 == 1);
        if seen {
            let pair = closest_points_segment_segment(a, b, &edge.from, &edge.to);
            let squared = pair.distance_squared();
            if squared < least {
                least = squared;
                best = Some(pair);
            }
        }
    }
    match best {
        Some(pair) if least > TOUCHING * TOUCHING * size * size => {
            let distance = least.sqrt();
            AxisWitness {
                distance,
                normal: (pair.on_a - pair.on_b) * (1.0 / distance),
                s: pair.s,
                unique: pair.unique,
            }
        }
        _ => depth(a, b, body, over_face, second),
    }
}

/// The segment reaches into the polyhedron; `over_face` is the best face, `second` the gap of the next.
fn depth(
    a: &Point3<f64>,
    b: &Point3<f64>,
    body: &Polyhedron,
    over_face: AxisWitness,
    mut second: f64,
) -> AxisWitness {
    let axis = b - a;
    let mut best = over_face;
    let mut silhouette = None;
    for edge in &body.edges {
        let along = edge.to - edge.from;
        let mut normal: Vector3<f64> = axis.cross(&along);
        let length = normal.norm();
        if length <= 1e-9 * axis.norm() * along.norm() {
            continue;
        }
        normal /= length;
        // The polyhedron ends at this edge in the directions between the normals of its two faces.
        let [n0, n1] = edge.faces.map(|f| body.planes[f as usize].normal);
        let (p, q) = (normal.dot(&n0), normal.dot(&n1));
        let (alpha, beta) = (p - edge.cosine * q, q - edge.cosine * p);
        if alpha * beta < 0.0 {
            continue;
        }
        if alpha + beta < 0.0 {
            normal = -normal;
        }
        let gap = normal
            .dot(&(a - edge.from))
            .min(normal.dot(&(b - edge.from)));
        second = second.max(best.distance.min(gap));
        if gap > best.distance {
            best = AxisWitness {
                distance: gap,
                normal,
                s: 0.0,
                unique: true,
            };
            silhouette = Some(edge);
        }
    }
    if let Some(edge) = silhouette {
        best.s = closest_points_segment_segment(a, b, &edge.from, &edge.to).s;
    }
    best.unique &= best.distance - second > 1e-9 * body.size;
    best
}
