//! Two solids, both placed by a pose.
//!
//! Balls and capsules go the way of [`super::capsule_solid`], other convex bodies to [`super::convex_convex`]. A mesh
//! is its triangles: those whose boxes come near, and vertices of the other body tested for being inside.

use nalgebra::{Isometry3, Point3, Vector3};

use super::convex_convex::overlap;
use super::{PairWitness, TOUCHING, capsule_solid_posed, convex_convex};
use crate::convex::{Convex, Kind, Rank};
use crate::frame::Frame;
use crate::mesh::{Mesh, box_of};
use crate::polyhedron::Plane;
use crate::solid::Shape;
use crate::{Aabb, Capsule, Contact, Solid, closest_points_segment_triangle};

/// Clearance between two solids, A placed by `pose_a` and B by `pose_b`.
///
/// Apart, the clearance is their distance (to 1e-7 of it where both are neither ball, capsule nor half-space). The
/// depth of overlap is
///
/// - for two convex bodies the shortest translation that separates them; with a cylinder and another flat-faced
///   body it may be overstated, never understated;
/// - with a mesh, the greater of two depths, neither more than the true one: how far a single triangle is inside the
///   other body, and how deep a vertex of one body (eight points of each rim of a cylinder) lies below the surface
///   of the mesh. It is negative exactly where the bodies overlap, and continuous;
/// - for two half-spaces infinite, unless their planes face each other.
///
/// Where [`Contact::clearance`] is infinite, the witness points are points of the two planes.
///
/// ```
/// use nalgebra::{Isometry3, Point3, Translation3};
/// use tensegra_collision::{Solid, solid_solid};
///
/// let unit = Solid::cuboid(Point3::origin(), Point3::new(1.0, 1.0, 1.0))?;
/// let apart = Isometry3::translation(0.0, 0.0, 1.25);
/// let inside = Isometry3::translation(0.0, 0.5, 0.75);
/// let at_origin = Isometry3::identity();
/// assert!((solid_solid(&unit, &apart, &unit, &at_origin).clearance - 0.25).abs() < 1e-12);
/// assert!((solid_solid(&unit, &inside, &unit, &at_origin).clearance + 0.25).abs() < 1e-12);
/// # Ok::<(), tensegra_collision::ShapeError>(())
/// ```
#[must_use]
pub fn solid_solid(
    a: &Solid,
    pose_a: &Isometry3<f64>,
    b: &Solid,
    pose_b: &Isometry3<f64>,
) -> Contact {
    let placed_a = match place(a, pose_a) {
        Ok(placed) => placed,
        Err(capsule) => return capsule_solid_posed(&capsule, b, pose_b),
    };
    let placed_b = match place(b, pose_b) {
        Ok(placed) => placed,
        Err(capsule) => return capsule_solid_posed(&capsule, a, pose_a).flipped(),
    };
    let witness = match (&placed_a, &placed_b) {
        (Placed::Plane(a), Placed::Plane(b)) => half_spaces(a, b),
        (body, Placed::Plane(plane)) => over_plane(body, plane),
        (Placed::Plane(plane), body) => over_plane(body, plane).flipped(),
        (Placed::Convex(a), Placed::Convex(b)) => convex_convex(a, b),
        (Placed::Mesh(a, frame), Placed::Convex(b)) => mesh_convex(a, frame, b),
        (Placed::Convex(a), Placed::Mesh(b, frame)) => mesh_convex(b, frame, a).flipped(),
        (Placed::Mesh(a, frame_a), Placed::Mesh(b, frame_b)) => mesh_mesh(a, frame_a, b, frame_b),
    };
    Contact {
        clearance: witness.clearance,
        normal: witness.normal,
        on_a: witness.on_a,
        on_b: witness.on_b,
        s: 0.0,
        t: 0.0,
        unique: witness.unique,
    }
}

/// A body in its place; a mesh with the place of its own frame.
enum Placed<'a> {
    Plane(Plane),
    Convex(Convex<'a>),
    Mesh(&'a Mesh, Frame),
}

/// The body in its place, or the capsule that it is.
fn place<'a>(solid: &'a Solid, pose: &Isometry3<f64>) -> Result<Placed<'a>, Capsule> {
    let frame = Frame::of_pose(pose);
    let convex = |frame, kind| Ok(Placed::Convex(Convex { frame, kind }));
    match &solid.shape {
        Shape::Sphere { center, radius } => Err(Capsule {
            a: pose * center,
            b: pose * center,
            radius: *radius,
        }),
        Shape::Capsule(capsule) => Err(capsule.transformed(pose)),
        Shape::HalfSpace(plane) => {
            let normal = pose * plane.normal;
            let point = pose * Point3::from(plane.normal * plane.offset);
            Ok(Placed::Plane(Plane {
                normal,
                offset: normal.dot(&point.coords),
            }))
        }
        Shape::Cuboid { center, half } => {
            let frame = Frame {
                origin: pose * center,
                ..frame
            };
            convex(frame, Kind::Box { half: *half })
        }
        Shape::OrientedBox { frame: inner, half } => {
            convex(frame.compose(inner), Kind::Box { half: *half })
        }
        Shape::Cylinder {
            frame: inner,
            radius,
            half,
        } => {
            let (radius, half) = (*radius, *half);
            convex(frame.compose(inner), Kind::Cylinder { radius, half })
        }
        Shape::Polyhedron(body) => convex(frame, Kind::Polyhedron(body)),
        Shape::Mesh(mesh) => Ok(Placed::Mesh(mesh, frame.compose(&mesh.frame))),
    }
}

fn half_spaces(a: &Plane, b: &Plane) -> PairWitness {
    let facing = (a.normal + b.normal).norm() <= 1e-12;
    let clearance = if facing {
        -a.offset - b.offset
    } else {
        f64::NEG_INFINITY
    };
    let on_a = Point3::from(a.normal * a.offset);
    PairWitness {
        clearance,
        normal: b.normal,
        on_a,
        on_b: if facing {
            on_a - b.normal * clearance
        } else {
            Point3::from(b.normal * b.offset)
        },
        unique: false,
    }
}

/// A bounded body over a half-space.
fn over_plane(body: &Placed, plane: &Plane) -> PairWitness {
    let (point, unique) = match body {
        Placed::Convex(body) => {
            let lowest = body.extreme(&-plane.normal);
            (lowest.point, matches!(lowest.rank, Rank::Corner))
        }
        Placed::Mesh(mesh, frame) => {
            // The solid's vertices are kept in its own frame, one step above that of the mesh.
            let pose = frame.compose(&mesh.frame.inverse());
            let down = -pose.local_vector(&plane.normal);
            let height = |p: &Point3<f64>| down.dot(&p.coords);
            let mut lowest = mesh.vertices[0];
            for p in &mesh.vertices {
                if height(p) > height(&lowest) {
                    lowest = *p;
                }
            }
            let level = height(&lowest) - 1e-9 * mesh.size;
            let near = mesh.vertices.iter().filter(|p| height(p) >= level).count();
            (pose.world_point(&lowest.coords), near == 1)
        }
        Placed::Plane(other) => return half_spaces(other, plane),
    };
    let clearance = plane.height(&point);
    PairWitness {
        clearance,
        normal: plane.normal,
        on_a: point,
        on_b: point - plane.normal * clearance,
        unique,
    }
}

/// A bound for the boxes of a tree: those that overlap must always be searched, for the deepest overlap.
fn apart_or_overlapping(node: &Aabb, other: &Aabb) -> f64 {
    let apart = node.distance(other);
    if apart > 0.0 {
        apart
    } else {
        f64::NEG_INFINITY
    }
}

/// A mesh (A) and a convex body (B).
fn mesh_convex(mesh: &Mesh, frame: &Frame, body: &Convex) -> PairWitness {
    let local = Convex {
        frame: frame.inverse().compose(&body.frame),
        kind: body.kind,
    };
    let extent = |k: usize, sign: f64| {
        let mut n = Vector3::zeros();
        n[k] = sign;
        sign * local.extent(&n)
    };
    let bounds = Aabb {
        min: Point3::from([0, 1, 2].map(|k| extent(k, -1.0))),
        max: Point3::from([0, 1, 2].map(|k| extent(k, 1.0))),
    };
    let mut best = PairWitness::farthest();
    mesh.tree.visit(
        f64::INFINITY,
        |node| apart_or_overlapping(node, &bounds),
        |range, _| {
            for triangle in &mesh.triangles[range] {
                if apart_or_overlapping(&box_of(&triangle.corners), &bounds) < best.clearance {
                    let triangle = Convex {
                        frame: Frame::identity(),
                        kind: Kind::Triangle(&triangle.corners),
                    };
                    best.keep_closer(convex_convex(&triangle, &local));
                }
            }
            best.clearance
        },
    );
    let mut vertices = VerticesBelow::new(mesh, best.clearance > 0.0);
    local.for_each_vertex(|p| vertices.visit(&p));
    if let Some(deepest) = vertices.deepest {
        best.keep_closer(deepest.flipped());
    }
    best.placed(frame)
}

/// Two meshes.
fn mesh_mesh(a: &Mesh, frame_a: &Frame, b: &Mesh, frame_b: &Frame) -> PairWitness {
    let b_in_a = frame_a.inverse().compose(frame_b);
    let mut best = PairWitness::farthest();
    for theirs in &b.triangles {
        let theirs = theirs.corners.map(|p| b_in_a.world_point(&p.coords));
        let bounds = box_of(&theirs);
        a.tree.visit(
            best.clearance,
            |node| apart_or_overlapping(node, &bounds),
            |range, _| {
                for ours in &a.triangles[range] {
                    if apart_or_overlapping(&box_of(&ours.corners), &bounds) < best.clearance {
                        best.keep_closer(triangles(&ours.corners, &theirs));
                    }
                }
                best.clearance
            },
        );
    }
    let apart = best.clearance > 0.0;
    let mut vertices = VerticesBelow::new(a, apart);
    for p in &b.vertices {
        let p = b.frame.local_point(p);
        vertices.visit(&b_in_a.world_point(&p));
    }
    if let Some(deepest) = vertices.deepest {
        best.keep_closer(deepest.flipped());
    }
    let mut vertices = VerticesBelow::new(b, apart);
    for p in &a.vertices {
        let p = Point3::from(a.frame.local_point(p));
        vertices.visit(&Point3::from(b_in_a.local_point(&p)));
    }
    if let Some(deepest) = vertices.deepest {
        best.keep_closer(deepest.placed(&b_in_a));
    }
    best.placed(frame_a)
}

/// Two triangles: the closest points lie on a side of one of them, or they cross.
fn triangles(a: &[Point3<f64>; 3], b: &[Point3<f64>; 3]) -> PairWitness {
    let mut best = PairWitness::farthest();
    let mut consider = |on_a: Point3<f64>, on_b: Point3<f64>, unique: bool| {
        let apart = on_a - on_b;
        let clearance = apart.norm();
        if clearance < best.clearance {
            best = PairWitness {
                clearance,
                normal: apart / clearance,
                on_a,
                on_b,
                unique,
            };
        }
    };
    for k in 0..3 {
        let pair = closest_points_segment_triangle(&a[k], &a[(k + 1) % 3], b);
        consider(pair.on_a, pair.on_b, pair.unique);
        let pair = closest_points_segment_triangle(&b[k], &b[(k + 1) % 3], a);
        consider(pair.on_b, pair.on_a, pair.unique);
    }
    let body = |corners| Convex {
        frame: Frame::identity(),
        kind: Kind::Triangle(corners),
    };
    let (a, b) = (body(a), body(b));
    if best.clearance > TOUCHING * (a.size() + b.size()) {
        best
    } else {
        overlap(&a, &b, None)
    }
}

/// The deepest of some vertices (A) below the surface of a mesh (B), in the frame of the mesh.
///
/// Where the surfaces are apart, the first vertex decides: outside, all others are.
struct VerticesBelow<'a> {
    mesh: &'a Mesh,
    first_decides: bool,
    done: bool,
    deepest: Option<PairWitness>,
}

impl<'a> VerticesBelow<'a> {
    fn new(mesh: &'a Mesh, first_decides: bool) -> Self {
        Self {
            mesh,
            first_decides,
            done: false,
            deepest: None,
        }
    }

    fn visit(&mut self, p: &Point3<f64>) {
        if self.done {
            return;
        }
        let outside = self.mesh.tree.bounds().distance_to_point(p) > 0.0;
        let signed = (!outside).then(|| self.mesh.signed_distance(p));
        match signed {
            Some(signed) if signed.distance < 0.0 => {
                let witness = PairWitness {
                    clearance: signed.distance,
                    normal: signed.gradient,
                    on_a: *p,
                    on_b: p - signed.gradient * signed.distance,
                    unique: true,
                };
                match &mut self.deepest {
                    Some(deepest) => deepest.keep_closer(witness),
                    none => *none = Some(witness),
                }
                self.first_decides = false;
            }
            _ => self.done = self.first_decides,
        }
    }
}
