//! Capsule and solid: the axis against the solid, less the radius.

use nalgebra::{Isometry3, Point3, Vector3};

use super::{AxisWitness, across, axis_box, axis_cylinder, axis_polyhedron, capsule_capsule};
use super::{TOUCHING, deepest_along};
use crate::mesh::{axis_mesh, axis_mesh_around};
use crate::solid::Shape;
use crate::{Capsule, Contact, Solid, closest_points_point_segment};

/// Cosine of the angle between normals that are about the same, 18°.
const SAME_DIRECTION: f64 = 0.95;
/// Parameters of about the same place of an axis differ by less.
const SAME_PLACE: f64 = 0.1;

/// Where the last query against a mesh ended. It makes the next query nearby cheaper and never changes the clearance
/// that is found.
///
/// A hint belongs to one pair of capsule and solid; with another it is merely useless.
#[derive(Clone, Copy, Debug, Default)]
pub struct MeshHint {
    triangle: Option<u32>,
}

/// Clearance between a capsule (A) and a solid (B). Never allocates.
///
/// Apart, the clearance is exact: the distance of the axis from the solid less the radius. Where the axis itself
/// enters the solid, the distance of the axis is minus a depth:
///
/// - for all convex solids the shortest translation that brings the axis out, exact;
/// - for meshes the depth of the deepest point of the axis below the surface (to 1e-9 of the length of the axis).
///
/// ```
/// use nalgebra::Point3;
/// use tensegra_collision::{Capsule, Solid, capsule_solid};
///
/// let ball = Solid::sphere(Point3::new(0.0, 0.0, 1.0), 0.5)?;
/// let bar = Capsule::new(Point3::new(-1.0, 0.0, 0.0), Point3::new(3.0, 0.0, 0.0), 0.1)?;
/// let contact = capsule_solid(&bar, &ball);
/// assert!((contact.clearance - 0.4).abs() < 1e-15);
/// assert_eq!(contact.s, 0.25);
/// # Ok::<(), tensegra_collision::ShapeError>(())
/// ```
#[inline]
#[must_use]
pub fn capsule_solid(capsule: &Capsule, solid: &Solid) -> Contact {
    capsule_solid_hinted(capsule, solid, &mut MeshHint::default())
}

/// [`capsule_solid`] with a hint, for queries that follow one another against a mesh.
#[inline]
#[must_use]
pub fn capsule_solid_hinted(capsule: &Capsule, solid: &Solid, hint: &mut MeshHint) -> Contact {
    let Capsule { a, b, .. } = capsule;
    let witness = match &solid.shape {
        Shape::Sphere { center, radius } => axis_sphere(a, b, center, *radius),
        Shape::Capsule(other) => return capsule_capsule(capsule, other),
        Shape::Cuboid { center, half } => axis_box(&(a - center), &(b - a), half),
        Shape::OrientedBox { frame, half } => frame.world_witness(axis_box(
            &frame.local_point(a),
            &frame.local_vector(&(b - a)),
            half,
        )),
        Shape::Cylinder {
            frame,
            radius,
            half,
        } => frame.world_witness(axis_cylinder(
            &frame.local_point(a),
            &frame.local_vector(&(b - a)),
            *radius,
            *half,
        )),
        Shape::HalfSpace(plane) => {
            let (s, unique) = deepest_along(&plane.normal, &(b - a), (b - a).norm_squared());
            AxisWitness {
                distance: plane.height(a).min(plane.height(b)),
                normal: plane.normal,
                s,
                unique,
            }
        }
        Shape::Polyhedron(body) => axis_polyhedron(a, b, body),
        Shape::Mesh(mesh) => {
            let mut triangle = hint.triangle.map_or(usize::MAX, |t| t as usize);
            let witness = axis_mesh(
                &Point3::from(mesh.frame.local_point(a)),
                &Point3::from(mesh.frame.local_point(b)),
                mesh,
                &mut triangle,
            );
            hint.triangle = u32::try_from(triangle).ok();
            mesh.frame.world_witness(witness)
        }
    };
    contact_of(capsule, &witness)
}

fn contact_of(capsule: &Capsule, witness: &AxisWitness) -> Contact {
    let point = capsule.point(witness.s);
    Contact {
        clearance: witness.distance - capsule.radius,
        normal: witness.normal,
        on_a: point - witness.normal * capsule.radius,
        on_b: point - witness.normal * witness.distance,
        s: witness.s,
        t: 0.0,
        unique: witness.unique,
    }
}

/// Appends contacts of a capsule (A) with a mesh (B) in all directions in which it is nearer than `reach`, the nearest
/// first: a peg in a hole has walls all around it. Contacts with about the same place and normal as a nearer one are
/// left out. Nothing is appended for other solids, which are convex.
///
/// Cost: linear in the triangles nearby.
pub fn capsule_solid_around(
    capsule: &Capsule,
    solid: &Solid,
    reach: f64,
    found: &mut Vec<Contact>,
) {
    let Shape::Mesh(mesh) = &solid.shape else {
        return;
    };
    let mut witnesses = Vec::new();
    axis_mesh_around(
        &Point3::from(mesh.frame.local_point(&capsule.a)),
        &Point3::from(mesh.frame.local_point(&capsule.b)),
        mesh,
        reach + capsule.radius,
        &mut witnesses,
    );
    witnesses.sort_by(|v, w| v.distance.total_cmp(&w.distance));
    let first = found.len();
    for witness in witnesses {
        let contact = contact_of(capsule, &mesh.frame.world_witness(witness));
        let is_new = found[first..].iter().all(|other| {
            contact.normal.dot(&other.normal) < SAME_DIRECTION
                || (contact.s - other.s).abs() > SAME_PLACE
        });
        if is_new {
            found.push(contact);
        }
    }
}

/// Clearance between a capsule and a solid placed by `pose`; all results are in the frame of the capsule.
#[inline]
#[must_use]
pub fn capsule_solid_posed(capsule: &Capsule, solid: &Solid, pose: &Isometry3<f64>) -> Contact {
    capsule_solid(&capsule.transformed(&pose.inverse()), solid).transformed(pose)
}

/// A lower bound on the clearance that [`capsule_solid`] finds, from the bounding box and ball of the solid: a few
/// nanoseconds. Exact for balls, capsules and half-spaces.
#[inline]
#[must_use]
pub fn clearance_lower_bound(capsule: &Capsule, solid: &Solid) -> f64 {
    let Capsule { a, b, radius } = capsule;
    let axis_bound = match &solid.shape {
        Shape::HalfSpace(plane) => plane.height(a).min(plane.height(b)),
        Shape::Capsule(other) => return capsule_capsule(capsule, other).clearance,
        _ => {
            let (center, reach) = solid.bounding_sphere();
            let ball = closest_points_point_segment(&center, a, b).distance() - reach;
            let bounds = solid.aabb();
            let (low, high) = (a.inf(b), a.sup(b));
            let gaps = (bounds.min - high).sup(&(low - bounds.max));
            let greatest = gaps.max();
            let apart = if greatest > 0.0 {
                gaps.sup(&Vector3::zeros()).norm()
            } else {
                greatest
            };
            ball.max(apart)
        }
    };
    axis_bound - radius
}

#[inline]
fn axis_sphere(a: &Point3<f64>, b: &Point3<f64>, center: &Point3<f64>, radius: f64) -> AxisWitness {
    let pair = closest_points_point_segment(center, a, b);
    let apart = pair.on_b - center;
    let squared = apart.norm_squared();
    let axis = b - a;
    if squared > TOUCHING * TOUCHING * (radius * radius + axis.norm_squared()) {
        let distance = squared.sqrt();
        AxisWitness {
            distance: distance - radius,
            normal: apart * (1.0 / distance),
            s: pair.t,
            unique: true,
        }
    } else {
        AxisWitness {
            distance: -radius,
            normal: across(&axis, &Vector3::zeros()),
            s: pair.t,
            unique: false,
        }
    }
}
