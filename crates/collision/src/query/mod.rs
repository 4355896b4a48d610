//! Clearances between bodies.

mod axis_box;
mod axis_cylinder;
mod axis_polyhedron;
mod capsule_capsule;
mod capsule_solid;
mod convex_convex;
mod solid_solid;

use nalgebra::{Point3, Vector3};

pub(crate) use axis_box::axis_box;
pub(crate) use axis_cylinder::axis_cylinder;
pub(crate) use axis_polyhedron::axis_polyhedron;
pub(crate) use capsule_capsule::across;
pub use capsule_capsule::{capsule_capsule, capsule_capsule_lower_bound};
pub use capsule_solid::{
    MeshHint, capsule_solid, capsule_solid_around, capsule_solid_hinted, capsule_solid_posed,
    clearance_lower_bound,
};
pub(crate) use convex_convex::convex_convex;
pub use solid_solid::solid_solid;

use crate::closest::PARALLEL_SINE_SQUARED;
use crate::frame::Frame;

/// Bodies closer than this, relative to their size, count as touching: the difference of their closest points is
/// then rounding, and no direction.
pub(crate) const TOUCHING: f64 = 1e-12;

/// Where the axis of a capsule stands to a solid: `axis(s)` less `distance` along `normal` is on its surface.
#[derive(Clone, Copy, Debug)]
pub(crate) struct AxisWitness {
    pub distance: f64,
    pub normal: Vector3<f64>,
    pub s: f64,
    pub unique: bool,
}

/// The parameter at which a segment is deepest against `normal`, and whether there is only one. A segment across the
/// normal is equally deep everywhere; its middle is taken.
#[inline]
pub(crate) fn deepest_along(
    normal: &Vector3<f64>,
    axis: &Vector3<f64>,
    squared_length: f64,
) -> (f64, bool) {
    let falls = normal.dot(axis);
    let s = if falls * falls <= LEVEL_SINE_SQUARED * squared_length {
        0.5
    } else if falls > 0.0 {
        0.0
    } else {
        1.0
    };
    let unique = falls * falls > PARALLEL_SINE_SQUARED * squared_length || squared_length == 0.0;
    (s, unique)
}

/// Up to this squared sine the two ends of a segment are at the same height but for rounding.
const LEVEL_SINE_SQUARED: f64 = 1e-28;

/// A [`crate::Contact`] of two solids.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PairWitness {
    pub clearance: f64,
    pub normal: Vector3<f64>,
    pub on_a: Point3<f64>,
    pub on_b: Point3<f64>,
    pub unique: bool,
}

impl PairWitness {
    /// To start a search for the closest.
    pub fn farthest() -> Self {
        Self {
            clearance: f64::INFINITY,
            normal: Vector3::z(),
            on_a: Point3::origin(),
            on_b: Point3::origin(),
            unique: true,
        }
    }

    pub fn keep_closer(&mut self, other: Self) {
        if other.clearance < self.clearance {
            *self = other;
        }
    }

    pub fn flipped(self) -> Self {
        Self {
            normal: -self.normal,
            on_a: self.on_b,
            on_b: self.on_a,
            ..self
        }
    }

    /// From the frame into the one it is given in.
    pub fn placed(self, frame: &Frame) -> Self {
        Self {
            normal: frame.world_vector(&self.normal),
            on_a: frame.world_point(&self.on_a.coords),
            on_b: frame.world_point(&self.on_b.coords),
            ..self
        }
    }
}
