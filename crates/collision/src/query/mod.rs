//! Clearances between bodies.

use nalgebra::Isometry3;

use crate::{Capsule, Contact, Solid};

/// Where the last query against a mesh ended: makes the next one, nearby, cheaper. Never changes the answer.
#[derive(Clone, Copy, Debug, Default)]
pub struct MeshHint {
    _triangle: Option<u32>,
}

/// Clearance between two capsules.
#[must_use]
pub fn capsule_capsule(_a: &Capsule, _b: &Capsule) -> Contact {
    todo!()
}
/// Clearance between a capsule and a solid.
#[must_use]
pub fn capsule_solid(_capsule: &Capsule, _solid: &Solid) -> Contact {
    todo!()
}
/// [`capsule_solid`], faster for queries that follow one another against a mesh.
#[must_use]
pub fn capsule_solid_hinted(_capsule: &Capsule, _solid: &Solid, _hint: &mut MeshHint) -> Contact {
    todo!()
}
/// Clearance between a capsule and a solid placed by `pose`.
#[must_use]
pub fn capsule_solid_posed(_capsule: &Capsule, _solid: &Solid, _pose: &Isometry3<f64>) -> Contact {
    todo!()
}
/// Clearance between two solids.
#[must_use]
pub fn solid_solid(
    _a: &Solid,
    _pose_a: &Isometry3<f64>,
    _b: &Solid,
    _pose_b: &Isometry3<f64>,
) -> Contact {
    todo!()
}
/// A cheap lower bound on the clearance of [`capsule_solid`].
#[must_use]
pub fn clearance_lower_bound(_capsule: &Capsule, _solid: &Solid) -> f64 {
    todo!()
}
