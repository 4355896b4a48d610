//! Shapes, clearances with witness points and normals, swept checks.

mod aabb;
mod capsule;
mod closest;
mod contact;
mod convex;
mod error;
mod frame;
mod mesh;
mod off;
mod polyhedron;
mod query;
mod solid;
pub mod swept;
mod weld;

pub use aabb::Aabb;
pub use capsule::Capsule;
pub use closest::{
    ClosestPoints, closest_points_point_segment, closest_points_point_triangle,
    closest_points_segment_box, closest_points_segment_segment, closest_points_segment_triangle,
};
pub use contact::Contact;
pub use error::{MeshError, ShapeError};
pub use off::{OffError, OffSurface, parse_off};
pub use query::{
    MeshHint, capsule_capsule, capsule_capsule_lower_bound, capsule_solid, capsule_solid_around,
    capsule_solid_hinted, capsule_solid_posed, clearance_lower_bound, solid_solid,
};
pub use solid::Solid;
