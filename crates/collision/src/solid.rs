//! Immutable bodies.

use std::sync::Arc;

use nalgebra::{Isometry3, Point3, Vector3};

use crate::frame::Frame;
use crate::mesh::Mesh;
use crate::polyhedron::{Plane, Polyhedron};
use crate::{Aabb, Capsule, MeshError, ShapeError, error};

/// An immutable body in its own frame: an obstacle, or a shape attached to a moving frame.
///
/// Every constructor checks its numbers, so that the queries cannot fail. Lengths are in the caller's unit. Cloning
/// is cheap: large bodies are shared.
///
/// ```
/// use nalgebra::Point3;
/// use tensegra_collision::{Capsule, Solid, capsule_solid};
///
/// let table = Solid::cuboid(Point3::new(-1.0, -1.0, -0.1), Point3::new(1.0, 1.0, 0.0))?;
/// let bar = Capsule::new(Point3::new(0.0, 0.0, 0.5), Point3::new(0.0, 0.0, 2.0), 0.1)?;
/// assert!((capsule_solid(&bar, &table).clearance - 0.4).abs() < 1e-15);
/// # Ok::<(), tensegra_collision::ShapeError>(())
/// ```
#[derive(Clone, Debug)]
pub struct Solid {
    pub(crate) shape: Shape,
    aabb: Aabb,
    /// A ball around the body, for culling.
    center: Point3<f64>,
    reach: f64,
}

#[derive(Clone, Debug)]
pub(crate) enum Shape {
    Sphere {
        center: Point3<f64>,
        radius: f64,
    },
    Capsule(Capsule),
    Cuboid {
        center: Point3<f64>,
        half: Vector3<f64>,
    },
    OrientedBox {
        frame: Frame,
        half: Vector3<f64>,
    },
    /// Around the third axis of its frame.
    Cylinder {
        frame: Frame,
        radius: f64,
        half: f64,
    },
    HalfSpace(Plane),
    Polyhedron(Arc<Polyhedron>),
    Mesh(Arc<Mesh>),
}

impl Solid {
    /// A ball. Radius zero is a point.
    ///
    /// # Errors
    /// [`ShapeError::NotFinite`], [`ShapeError::Radius`].
    pub fn sphere(center: Point3<f64>, radius: f64) -> Result<Self, ShapeError> {
        error::finite_point("sphere", "centre", &center)?;
        error::radius("sphere", radius, true)?;
        Ok(Self::new(Shape::Sphere { center, radius }))
    }

    /// A capsule, such as a rod with rounded ends.
    ///
    /// # Errors
    /// As [`Capsule::new`].
    pub fn capsule(a: Point3<f64>, b: Point3<f64>, radius: f64) -> Result<Self, ShapeError> {
        let capsule = Capsule::new(a, b, radius)?;
        Ok(Self::new(Shape::Capsule(capsule)))
    }

    /// A box with its edges along the axes, between the corners of smallest and of largest coordinates.
    ///
    /// # Errors
    /// [`ShapeError::NotFinite`], [`ShapeError::EmptyBox`].
    pub fn cuboid(min: Point3<f64>, max: Point3<f64>) -> Result<Self, ShapeError> {
        error::finite_point("box", "corner of smallest coordinates", &min)?;
        error::finite_point("box", "corner of largest coordinates", &max)?;
        for (i, axis) in ['x', 'y', 'z'].into_iter().enumerate() {
            if min[i] >= max[i] {
                return Err(ShapeError::EmptyBox {
                    axis,
                    min: min[i],
                    max: max[i],
                });
            }
        }
        let aabb = Aabb { min, max };
        Ok(Self::new(Shape::Cuboid {
            center: aabb.center(),
            half: aabb.half_extents(),
        }))
    }

    /// A box centred at the origin of `pose`, with its edges along the axes of `pose` and the given half lengths.
    ///
    /// # Errors
    /// [`ShapeError::NotFinite`], [`ShapeError::NotPositive`].
    pub fn oriented_box(
        pose: &Isometry3<f64>,
        half_extents: Vector3<f64>,
    ) -> Result<Self, ShapeError> {
        error::finite_vector("box", "position", &pose.translation.vector)?;
        error::finite_vector("box", "orientation", &pose.rotation.imag())?;
        error::finite_vector("box", "half length", &half_extents)?;
        if let Some(&value) = half_extents.iter().find(|h| **h <= 0.0) {
            return Err(ShapeError::NotPositive {
                shape: "box",
                what: "half length",
                value,
            });
        }
        Ok(Self::new(Shape::OrientedBox {
            frame: Frame::of_pose(pose),
            half: half_extents,
        }))
    }

    /// A cylinder with flat ends, centred at `p` and `q`.
    ///
    /// # Errors
    /// [`ShapeError::NotFinite`], [`ShapeError::Radius`] (it must be positive), [`ShapeError::NoDirection`].
    pub fn cylinder(p: Point3<f64>, q: Point3<f64>, radius: f64) -> Result<Self, ShapeError> {
        error::finite_point("cylinder", "first end", &p)?;
        error::finite_point("cylinder", "second end", &q)?;
        error::radius("cylinder", radius, false)?;
        let axis = direction("cylinder", "axis", &(q - p))?;
        Ok(Self::new(Shape::Cylinder {
            frame: Frame::of_axes(nalgebra::center(&p, &q), &axis, &Vector3::zeros()),
            radius,
            half: 0.5 * (q - p).norm(),
        }))
    }

    /// Everything behind the plane through `point`; `outward` (of any length) points away from the body.
    ///
    /// # Errors
    /// [`ShapeError::NotFinite`], [`ShapeError::NoDirection`].
    pub fn half_space(point: Point3<f64>, outward: Vector3<f64>) -> Result<Self, ShapeError> {
        error::finite_point("half-space", "point", &point)?;
        error::finite_vector("half-space", "normal", &outward)?;
        let normal = direction("half-space", "normal", &outward)?;
        Ok(Self::new(Shape::HalfSpace(Plane {
            normal,
            offset: normal.dot(&point.coords),
        })))
    }

    /// A triangle extruded by `height` along `(p1 - p0) × (p2 - p0)`.
    ///
    /// # Errors
    /// [`ShapeError::NotFinite`], [`ShapeError::NotPositive`] for the height, [`ShapeError::Flat`] for corners on
    /// one line.
    pub fn triangular_prism(
        p0: Point3<f64>,
        p1: Point3<f64>,
        p2: Point3<f64>,
        height: f64,
    ) -> Result<Self, ShapeError> {
        const SHAPE: &str = "triangular prism";
        for (what, p) in [
            ("first corner", p0),
            ("second corner", p1),
            ("third corner", p2),
        ] {
            error::finite_point(SHAPE, what, &p)?;
        }
        if !height.is_finite() {
            return Err(ShapeError::NotFinite {
                shape: SHAPE,
                what: "height",
                value: height,
            });
        }
        if height <= 0.0 {
            return Err(ShapeError::NotPositive {
                shape: SHAPE,
                what: "height",
                value: height,
            });
        }
        let up = (p1 - p0)
            .cross(&(p2 - p0))
            .try_normalize(0.0)
            .ok_or(ShapeError::Flat { shape: SHAPE })?
            * height;
        let hull = Polyhedron::hull(SHAPE, &[p0, p1, p2, p0 + up, p1 + up, p2 + up])?;
        Ok(Self::new(Shape::Polyhedron(Arc::new(hull))))
    }

    /// The convex hull of some points.
    ///
    /// Queries cost time in proportion to its faces and edges; it is meant for tens of them.
    ///
    /// # Errors
    /// [`ShapeError::NotFinite`], [`ShapeError::TooFewPoints`], [`ShapeError::Flat`].
    pub fn convex_hull(points: &[Point3<f64>]) -> Result<Self, ShapeError> {
        let hull = Polyhedron::hull("convex hull", points)?;
        Ok(Self::new(Shape::Polyhedron(Arc::new(hull))))
    }

    /// The body inside a closed surface, which need not be convex (a box with a hole through it). Faces are lists of
    /// corners, counted from zero.
    ///
    /// Vertices with equal coordinates are joined, faces with more than three corners split into triangles, faces
    /// listed twice taken once. A part of the surface whose faces run the same way round keeps its orientation (a
    /// cavity is a part that is turned inside out); else it is made consistent. The whole is turned outward. That the
    /// surface does not cross itself is not checked.
    ///
    /// # Errors
    /// [`MeshError`]: what is wrong with which vertex, face or edge.
    pub fn mesh<F: AsRef<[usize]>>(
        vertices: &[Point3<f64>],
        faces: &[F],
    ) -> Result<Self, MeshError> {
        Ok(Self::new(Shape::Mesh(Arc::new(Mesh::new(
            vertices, faces,
        )?))))
    }

    fn new(shape: Shape) -> Self {
        let everywhere = Aabb {
            min: Point3::from(Vector3::repeat(f64::NEG_INFINITY)),
            max: Point3::from(Vector3::repeat(f64::INFINITY)),
        };
        let around = |center: &Point3<f64>, reach: Vector3<f64>| Aabb {
            min: center - reach,
            max: center + reach,
        };
        let of_points = |points: &[Point3<f64>]| {
            let aabb = Aabb::of_points(points).unwrap_or(everywhere);
            let center = aabb.center();
            let reach = points
                .iter()
                .map(|p| (p - center).norm())
                .fold(0.0, f64::max);
            (aabb, center, reach)
        };
        let (aabb, center, reach) = match &shape {
            Shape::Sphere { center, radius } => {
                (around(center, Vector3::repeat(*radius)), *center, *radius)
            }
            Shape::Capsule(c) => (c.aabb(), c.point(0.5), 0.5 * c.axis().norm() + c.radius),
            Shape::Cuboid { center, half } => (around(center, *half), *center, half.norm()),
            Shape::OrientedBox { frame, half } => {
                let reach = frame.axes.abs() * half;
                (around(&frame.origin, reach), frame.origin, half.norm())
            }
            Shape::Cylinder {
                frame,
                radius,
                half,
            } => {
                let axis = frame.axes.column(2);
                let reach = axis.map(|z| half * z.abs() + radius * (1.0 - z * z).max(0.0).sqrt());
                (
                    around(&frame.origin, reach),
                    frame.origin,
                    half.hypot(*radius),
                )
            }
            Shape::HalfSpace(plane) => (
                everywhere,
                Point3::from(plane.normal * plane.offset),
                f64::INFINITY,
            ),
            Shape::Polyhedron(body) => of_points(&body.vertices),
            Shape::Mesh(mesh) => of_points(&mesh.vertices),
        };
        Self {
            shape,
            aabb,
            center,
            reach,
        }
    }

    /// The smallest axis-aligned box that holds the body; infinite for a half-space.
    #[inline]
    #[must_use]
    pub fn aabb(&self) -> Aabb {
        self.aabb
    }

    /// Centre and radius of a ball that holds the body; the radius is infinite for a half-space.
    #[inline]
    #[must_use]
    pub fn bounding_sphere(&self) -> (Point3<f64>, f64) {
        (self.center, self.reach)
    }

    /// A cheap lower bound on the signed distance from a point to the body, at most its true value.
    ///
    /// Exact for balls, capsules and half-spaces, and for axis-aligned boxes; else from the bounding box and ball.
    #[inline]
    #[must_use]
    pub fn distance_bound(&self, point: &Point3<f64>) -> f64 {
        let at = Capsule {
            a: *point,
            b: *point,
            radius: 0.0,
        };
        crate::clearance_lower_bound(&at, self)
    }

    /// How far the body reaches in the direction of the unit vector `n`: the greatest `n · x` over its points.
    /// Infinite for a half-space, save along its own normal.
    pub(crate) fn extent(&self, n: &Vector3<f64>) -> f64 {
        let farthest = |points: &[Point3<f64>]| {
            points
                .iter()
                .map(|p| n.dot(&p.coords))
                .fold(f64::NEG_INFINITY, f64::max)
        };
        match &self.shape {
            Shape::Sphere { center, radius } => n.dot(&center.coords) + radius,
            Shape::Capsule(c) => n.dot(&c.a.coords).max(n.dot(&c.b.coords)) + c.radius,
            Shape::Cuboid { center, half } => n.dot(&center.coords) + n.abs().dot(half),
            Shape::OrientedBox { frame, half } => {
                n.dot(&frame.origin.coords) + frame.local_vector(n).abs().dot(half)
            }
            Shape::Cylinder {
                frame,
                radius,
                half,
            } => {
                let local = frame.local_vector(n);
                n.dot(&frame.origin.coords) + half * local.z.abs() + radius * local.xy().norm()
            }
            Shape::HalfSpace(plane) if *n == plane.normal => plane.offset,
            Shape::HalfSpace(_) => f64::INFINITY,
            Shape::Polyhedron(body) => farthest(&body.vertices),
            Shape::Mesh(mesh) => farthest(&mesh.vertices),
        }
    }
}

fn direction(
    shape: &'static str,
    what: &'static str,
    v: &Vector3<f64>,
) -> Result<Vector3<f64>, ShapeError> {
    v.try_normalize(f64::MIN_POSITIVE.sqrt())
        .ok_or(ShapeError::NoDirection { shape, what })
}
