//! Solids.

use nalgebra::{Isometry3, Point3, Vector3};

use crate::{Aabb, Capsule, MeshError, ShapeError};

/// An immutable body in its own frame: an obstacle, or a shape attached to a moving frame.
#[derive(Clone, Debug)]
pub struct Solid {
    aabb: Aabb,
}

impl Solid {
    /// A ball.
    pub fn sphere(_center: Point3<f64>, _radius: f64) -> Result<Self, ShapeError> {
        todo!()
    }
    /// A capsule.
    pub fn capsule(_capsule: Capsule) -> Result<Self, ShapeError> {
        todo!()
    }
    /// An axis-aligned box.
    pub fn cuboid(_min: Point3<f64>, _max: Point3<f64>) -> Result<Self, ShapeError> {
        todo!()
    }
    /// A box centred at the origin of `pose`, with its edges along the axes of `pose`.
    pub fn oriented_box(
        _pose: &Isometry3<f64>,
        _half_extents: Vector3<f64>,
    ) -> Result<Self, ShapeError> {
        todo!()
    }
    /// A cylinder with flat ends.
    pub fn cylinder(_p: Point3<f64>, _q: Point3<f64>, _radius: f64) -> Result<Self, ShapeError> {
        todo!()
    }
    /// Everything behind a plane.
    pub fn half_space(_point: Point3<f64>, _outward: Vector3<f64>) -> Result<Self, ShapeError> {
        todo!()
    }
    /// A triangle extruded by `height` along `(p1 - p0) × (p2 - p0)`.
    pub fn triangular_prism(
        _p0: Point3<f64>,
        _p1: Point3<f64>,
        _p2: Point3<f64>,
        _height: f64,
    ) -> Result<Self, ShapeError> {
        todo!()
    }
    /// The convex hull of some points.
    pub fn convex_hull(_points: &[Point3<f64>]) -> Result<Self, ShapeError> {
        todo!()
    }
    /// The body inside a closed surface.
    pub fn mesh<F: AsRef<[usize]>>(
        _vertices: &[Point3<f64>],
        _faces: &[F],
    ) -> Result<Self, MeshError> {
        todo!()
    }
    /// The smallest axis-aligned box that holds the body; infinite for a half-space.
    #[must_use]
    pub fn aabb(&self) -> Aabb {
        self.aabb
    }
    /// A cheap lower bound on the distance from a point to the body (zero or less inside).
    #[must_use]
    pub fn distance_bound(&self, _point: &Point3<f64>) -> f64 {
        todo!()
    }
}
