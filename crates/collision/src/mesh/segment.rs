//! Segment and closed surface, with depth.
//!
//! Outside: the exact distance. Where the segment touches the surface or lies inside: the least signed distance over
//! its points, that is, minus the depth of its deepest point below the surface. It is found by branch and bound: the
//! depth of a point is at most its distance from any triangle, a distance from a triangle is convex along the
//! segment, and no depth changes faster than the point moves.
//!
//! Cost: near the surface of a few hundred triangles about a microsecond outside, some ten point queries inside.

use nalgebra::Point3;

use super::{Mesh, SignedDistance, SurfacePoint, Triangle};
use crate::closest::{
    Feature, closest_points_point_triangle, closest_points_segment_segment, projects_inside,
};
use crate::query::{AxisWitness, TOUCHING};

/// The depth found is less than the greatest by at most this, relative to the length of the segment …
const DEPTH_TOLERANCE: f64 = 1e-9;
/// … unless this many points do not suffice.
const DEPTH_POINTS: usize = 64;

/// The segment from `a` to `b`, in the frame of the mesh. `hint` is a triangle to begin with; it receives the one
/// found.
pub(crate) fn axis_mesh(
    a: &Point3<f64>,
    b: &Point3<f64>,
    mesh: &Mesh,
    hint: &mut usize,
) -> AxisWitness {
    let mut search = Search::new(a, b, mesh);
    if let Some(triangle) = mesh.triangles.get(*hint) {
        search.test(*hint, triangle);
    }
    let (low, high) = (a.inf(b), a.sup(b));
    let limit = search.squared;
    mesh.tree.visit(
        limit,
        |node| {
            let apart = (node.min - high)
                .sup(&(low - node.max))
                .sup(&nalgebra::Vector3::zeros());
            apart.norm_squared()
        },
        |range, _| {
            for index in range {
                search.test(index, &mesh.triangles[index]);
            }
            search.squared
        },
    );
    *hint = search.at.triangle;
    let Search {
        s,
        squared,
        at,
        unique,
        ..
    } = search;
    let point = a + (b - a) * s;
    let reach = TOUCHING * mesh.size;
    if squared > reach * reach {
        let signed = mesh.signed(&point, &at, squared);
        if signed.distance > 0.0 {
            return AxisWitness {
                distance: signed.distance,
                normal: signed.gradient,
                s,
                unique,
            };
        }
    }
    deepest(a, b, mesh, s)
}

/// The closest pair so far.
struct Search<'a> {
    a: &'a Point3<f64>,
    b: &'a Point3<f64>,
    /// What rounding may move a projected point out of its triangle, as twice an area.
    slack: f64,
    squared: f64,
    s: f64,
    at: SurfacePoint,
    unique: bool,
}

impl<'a> Search<'a> {
    fn new(a: &'a Point3<f64>, b: &'a Point3<f64>, mesh: &Mesh) -> Self {
        Self {
            a,
            b,
            slack: 1e-14 * mesh.size * mesh.size,
            squared: f64::INFINITY,
            s: 0.0,
            at: SurfacePoint {
                triangle: 0,
                feature: Feature::Face,
                point: *a,
            },
            unique: true,
        }
    }

    /// As [`crate::closest_points_segment_triangle`], with the least squared distance so far as a bound.
    #[inline(always)]
    fn test(&mut self, index: usize, triangle: &Triangle) {
        let (ha, hb) = (triangle.height(self.a), triangle.height(self.b));
        let (s, height) = if ha * hb <= 0.0 && ha != hb {
            (ha / (ha - hb), 0.0)
        } else if ha.abs() <= hb.abs() {
            (0.0, ha)
        } else {
            (1.0, hb)
        };
        if height * height >= self.squared {
            return;
        }
        let point = self.a + (self.b - self.a) * s;
        if projects_inside(&point, &triangle.corners, &triangle.normal, self.slack) {
            self.squared = height * height;
            self.s = s;
            self.at = SurfacePoint {
                triangle: index,
                feature: Feature::Face,
                point: point - triangle.normal * height,
            };
            self.unique = (ha - hb).abs() > 1e-7 * (self.b - self.a).norm() || self.a == self.b;
            return;
        }
        for k in 0..3u8 {
            if triangle.edges >> k & 1 == 0 {
                continue;
            }
            let (p, q) = (
                &triangle.corners[usize::from(k)],
                &triangle.corners[(usize::from(k) + 1) % 3],
            );
            let pair = closest_points_segment_segment(self.a, self.b, p, q);
            let squared = pair.distance_squared();
            if squared < self.squared {
                self.squared = squared;
                self.s = pair.s;
                self.unique = pair.unique;
                self.at = SurfacePoint {
                    triangle: index,
                    feature: if pair.t == 0.0 {
                        Feature::Corner(k)
                    } else if pair.t == 1.0 {
                        Feature::Corner((k + 1) % 3)
                    } else {
                        Feature::Edge(k)
                    },
                    point: pair.on_b,
                };
            }
        }
    }
}

/// A point of the segment and where it stands to the surface.
#[derive(Clone, Copy)]
struct Probe {
    s: f64,
    signed: SignedDistance,
}

/// The point of the segment of least signed distance; `touch` is the parameter of a point on the surface.
#[cold]
fn deepest(a: &Point3<f64>, b: &Point3<f64>, mesh: &Mesh, touch: f64) -> AxisWitness {
    let axis = b - a;
    let length = axis.norm();
    let probe = |s: f64| Probe {
        s,
        signed: mesh.signed_distance(&(a + axis * s)),
    };
    let mut best = probe(touch);
    let mut kink = false;
    if length > 0.0 {
        let (first, middle, last) = (probe(0.0), best, probe(1.0));
        for end in [first, last] {
            if end.signed.distance < best.signed.distance {
                best = end;
            }
        }
        // Intervals still to be searched: every step takes one and leaves at most two.
        let mut open = [(middle, last); DEPTH_POINTS + 2];
        open[1] = (first, middle);
        let mut count = 2;
        for _ in 0..DEPTH_POINTS {
            if count == 0 {
                break;
            }
            count -= 1;
            let (left, right) = open[count];
            let Some(s) = promising(a, b, mesh, &left, &right, best.signed.distance, length) else {
                continue;
            };
            let between = probe(s);
            if between.signed.distance < best.signed.distance {
                best = between;
                // Deepest between two walls, the gradient jumps and is not across the segment.
                kink = between.signed.gradient.dot(&axis).abs() > 1e-6 * length;
            }
            open[count] = (left, between);
            open[count + 1] = (between, right);
            count += 2;
        }
    }
    AxisWitness {
        distance: best.signed.distance,
        normal: best.signed.gradient,
        s: best.s,
        unique: !kink,
    }
}

/// Where between two probes a point may be deeper than `best` (a signed distance), or `None` if none can.
fn promising(
    a: &Point3<f64>,
    b: &Point3<f64>,
    mesh: &Mesh,
    left: &Probe,
    right: &Probe,
    best: f64,
    length: f64,
) -> Option<f64> {
    let width = (right.s - left.s) * length;
    let enough = -best + DEPTH_TOLERANCE * length;
    let lipschitz = 0.5 * (width - left.signed.distance - right.signed.distance);
    if lipschitz <= enough || width <= DEPTH_TOLERANCE * length {
        return None;
    }
    let axis = b - a;
    let from = |probe: &Probe, s: f64| {
        let corners = &mesh.triangles[probe.signed.triangle].corners;
        closest_points_point_triangle(&(a + axis * s), corners).distance()
    };
    // Distances from the triangle next to either end, at both ends.
    let (l0, l1) = (from(left, left.s), from(left, right.s));
    let (r0, r1) = (from(right, left.s), from(right, right.s));
    if l0.max(l1) <= enough || r0.max(r1) <= enough {
        return None;
    }
    // Where the straight lines through these values cross, which is exact for two flat walls.
    let (at_left, at_right) = (r0 - l0, l1 - r1);
    let share = if at_left > 0.0 && at_right > 0.0 {
        (at_left / (at_left + at_right)).clamp(0.05, 0.95)
    } else {
        0.5
    };
    Some(left.s + share * (right.s - left.s))
}
