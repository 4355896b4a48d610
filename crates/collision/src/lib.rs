//! Shapes, clearances with witness points and normals, swept checks.

mod aabb;
mod capsule;
mod contact;
mod error;
mod off;
mod query;
mod solid;
pub mod swept;

pub use aabb::Aabb;
pub use capsule::Capsule;
pub use contact::Contact;
pub use error::{MeshError, ShapeError};
pub use off::{OffError, OffSurface, parse_off};
pub use query::{
    MeshHint, capsule_capsule, capsule_solid, capsule_solid_hinted, capsule_solid_posed,
    clearance_lower_bound, solid_solid,
};
pub use solid::Solid;
