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
    Feature, PARALLEL_SINE_SQUARED, closest_points_point_triangle, closest_points_segment_segment,
    projects_inside,
};
use crate::query::{AxisWitness, TOUCHING};

/// The depth found is less than the greatest by at most this, relative to the length of the segment …
const DEPTH_TOLERANCE: f64 = 1e-9;
/// … unless this many points do not suffice.
const DEPTH_POINTS: usize = 64;
/// What rounding may move a projected point out of its triangle, as twice an area relative to the squared size.
const SLIVER: f64 = 1e-14;

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

/// Appends the closest points of both ends of the segment with faces, and of the segment with edges, that are nearer
/// than `reach` and look at it with their outer side: what is close in all directions, not only in the nearest.
pub(crate) fn axis_mesh_around(
    a: &Point3<f64>,
    b: &Point3<f64>,
    mesh: &Mesh,
    reach: f64,
    found: &mut Vec<AxisWitness>,
) {
    let slack = SLIVER * mesh.size * mesh.size;
    let (low, high) = (a.inf(b), a.sup(b));
    mesh.tree.visit(
        reach,
        |node| {
            let apart = (node.min - high).sup(&(low - node.max));
            apart.sup(&nalgebra::Vector3::zeros()).norm()
        },
        |range, limit| {
            for index in range {
                let triangle = &mesh.triangles[index];
                for (s, end) in [(0.0, a), (1.0, b)] {
                    let height = triangle.height(end);
                    if height > 0.0
                        && height < reach
                        && projects_inside(end, &triangle.corners, &triangle.normal, slack)
                    {
                        found.push(AxisWitness {
                            distance: height,
                            normal: triangle.normal,
                            s,
                            unique: true,
                        });
                    }
                }
                for k in (0..3u8).filter(|k| triangle.edges >> k & 1 == 1) {
                    let p = &triangle.corners[usize::from(k)];
                    let q = &triangle.corners[(usize::from(k) + 1) % 3];
                    let pair = closest_points_segment_segment(a, b, p, q);
                    let distance = pair.distance_squared().sqrt();
                    let outward = mesh.pseudonormal(&SurfacePoint {
                        triangle: index,
                        feature: Feature::of_edge(k, pair.t),
                        point: pair.on_b,
                    });
                    let apart = pair.on_a - pair.on_b;
                    if distance < reach
                        && distance > TOUCHING * mesh.size
                        && apart.dot(&outward) > 0.0
                    {
                        found.push(AxisWitness {
                            distance,
                            normal: apart / distance,
                            s: pair.s,
                            unique: pair.unique,
                        });
                    }
                }
            }
            limit
        },
    );
}

/// The closest pair so far.
struct Search<'a> {
    a: &'a Point3<f64>,
    b: &'a Point3<f64>,
    length_squared: f64,
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
            length_squared: (b - a).norm_squared(),
            slack: SLIVER * mesh.size * mesh.size,
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
        // Along the face, rounding decides which end is lower, and neighbours in the same plane may disagree.
        let level = (ha - hb).powi(2) <= PARALLEL_SINE_SQUARED * self.length_squared;
        if !level || self.length_squared == 0.0 {
            if self.try_face(index, triangle, s, height) {
                return;
            }
        } else {
            let first = self.try_face(index, triangle, 0.0, ha);
            let last = self.try_face(index, triangle, 1.0, hb);
            if first || last {
                self.unique = false;
            }
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
                    feature: Feature::of_edge(k, pair.t),
                    point: pair.on_b,
                };
            }
        }
    }

    /// Whether the point at `s`, at this height over a triangle, is over its inside and closest so far.
    #[inline(always)]
    fn try_face(&mut self, index: usize, triangle: &Triangle, s: f64, height: f64) -> bool {
        let point = self.a + (self.b - self.a) * s;
        let closer = height * height < self.squared
            && projects_inside(&point, &triangle.corners, &triangle.normal, self.slack);
        if closer {
            self.squared = height * height;
            self.s = s;
            self.unique = true;
            self.at = SurfacePoint {
                triangle: index,
                feature: Feature::Face,
                point: point - triangle.normal * height,
            };
        }
        closer
    }
}

/// A point of the segment and where it stands to the surface.
#[derive(Clone, Copy)]
struct Probe {
    s: f64,
    signed: SignedDistance,
}

/// The point of the segment of least signed distance; `touch` is the parameter of a point on the surface, or of any
/// point of a segment that lies inside.
#[cold]
fn deepest(a: &Point3<f64>, b: &Point3<f64>, mesh: &Mesh, touch: f64) -> AxisWitness {
    let axis = b - a;
    let length = axis.norm();
    let probe = |s: f64| Probe {
        s,
        signed: mesh.signed_distance(&(a + axis * s)),
    };
    let mut best = probe(touch);
    let mut points = DEPTH_POINTS;
    let mut left = probe(0.0);
    while left.s < 1.0 && points > 0 {
        points -= 1;
        // Between two crossings the segment is inside or outside as a whole.
        let right = probe(next_crossing(a, b, mesh, left.s));
        let middle = probe(0.5 * (left.s + right.s));
        if middle.signed.distance < 0.0 {
            for end in [left, right, middle] {
                if end.signed.distance < best.signed.distance {
                    best = end;
                }
            }
            // Intervals still to be searched: every step takes one and leaves at most two.
            let mut open = [(left, middle); DEPTH_POINTS + 2];
            open[1] = (middle, right);
            let mut count = 2;
            while count > 0 && points > 0 {
                points -= 1;
                count -= 1;
                let (left, right) = open[count];
                let known = best.signed.distance;
                let Some(s) = promising(a, b, mesh, &left, &right, known, length) else {
                    continue;
                };
                let between = probe(s);
                if between.signed.distance < known {
                    best = between;
                }
                open[count] = (left, between);
                open[count + 1] = (between, right);
                count += 2;
            }
        }
        left = right;
    }
    // Deepest half-way between two walls, the gradient jumps and is not across the segment.
    let along = best.signed.gradient.dot(&axis).abs();
    AxisWitness {
        distance: best.signed.distance,
        normal: best.signed.gradient,
        s: best.s,
        unique: best.s == 0.0 || best.s == 1.0 || along <= 1e-3 * length,
    }
}

/// The least parameter after `after` at which the segment crosses the surface, or 1.
fn next_crossing(a: &Point3<f64>, b: &Point3<f64>, mesh: &Mesh, after: f64) -> f64 {
    let axis = b - a;
    let inverse = axis.map(f64::recip);
    let slack = SLIVER * mesh.size * mesh.size;
    let after = after + 1e-12;
    mesh.tree.visit(
        1.0,
        |node| {
            let (mut enters, mut leaves) = (after, 1f64);
            for k in 0..3 {
                let (p, q) = (
                    (node.min[k] - a[k]) * inverse[k],
                    (node.max[k] - a[k]) * inverse[k],
                );
                // Not a number where the segment runs in the plane of a face; `max` and `min` then ignore it.
                enters = enters.max(p.min(q));
                leaves = leaves.min(p.max(q));
            }
            // A box may be flat: leave room for rounding.
            if enters <= leaves + 1e-12 {
                enters
            } else {
                f64::INFINITY
            }
        },
        |range, limit| {
            mesh.triangles[range].iter().fold(limit, |limit, triangle| {
                let (ha, hb) = (triangle.height(a), triangle.height(b));
                let s = ha / (ha - hb);
                let crosses = ha * hb <= 0.0 && s > after && s < limit;
                if crosses
                    && projects_inside(&(a + axis * s), &triangle.corners, &triangle.normal, slack)
                {
                    s
                } else {
                    limit
                }
            })
        },
    )
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
