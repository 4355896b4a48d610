//! The capsule: every point within a radius of a segment.

use nalgebra::{Isometry3, Point3, Vector3};

use crate::{Aabb, ShapeError, error};

/// All points within `radius` of the segment from `a` to `b`.
///
/// Struts, bars, cables and springs are capsules. With `a == b` it is a sphere, with `radius == 0.0` a bare
/// segment. Coordinates and radius are in the caller's unit of length.
///
/// The fields are public because a planner rewrites them at every configuration; the queries expect finite
/// numbers and a radius that is not negative, which [`Capsule::new`] checks.
///
/// ```
/// use nalgebra::Point3;
/// use tensegra_collision::Capsule;
///
/// let strut = Capsule::new(Point3::origin(), Point3::new(0.0, 0.0, 2.0), 0.1)?;
/// assert_eq!(strut.point(0.25), Point3::new(0.0, 0.0, 0.5));
/// assert!(Capsule::new(Point3::origin(), Point3::origin(), -0.1).is_err());
/// # Ok::<(), tensegra_collision::ShapeError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Capsule {
    /// First end of the axis.
    pub a: Point3<f64>,
    /// Second end of the axis.
    pub b: Point3<f64>,
    /// Radius around the axis.
    pub radius: f64,
}

impl Capsule {
    /// A capsule with its numbers checked.
    ///
    /// # Errors
    /// [`ShapeError::NotFinite`] for a NaN or infinite coordinate, [`ShapeError::Radius`] for a radius that is
    /// negative or not finite.
    pub fn new(a: Point3<f64>, b: Point3<f64>, radius: f64) -> Result<Self, ShapeError> {
        error::finite_point("capsule", "first end", &a)?;
        error::finite_point("capsule", "second end", &b)?;
        error::radius("capsule", radius, true)?;
        Ok(Self { a, b, radius })
    }

    /// The point `a + s (b - a)` of the axis.
    #[inline]
    #[must_use]
    pub fn point(&self, s: f64) -> Point3<f64> {
        self.a + (self.b - self.a) * s
    }

    /// The vector from `a` to `b`.
    #[inline]
    #[must_use]
    pub fn axis(&self) -> Vector3<f64> {
        self.b - self.a
    }

    /// The smallest axis-aligned box that holds the capsule.
    #[inline]
    #[must_use]
    pub fn aabb(&self) -> Aabb {
        let margin = Vector3::repeat(self.radius);
        Aabb {
            min: self.a.inf(&self.b) - margin,
            max: self.a.sup(&self.b) + margin,
        }
    }

    /// The capsule moved by a rigid motion.
    #[inline]
    #[must_use]
    pub fn transformed(&self, motion: &Isometry3<f64>) -> Self {
        Self {
            a: motion * self.a,
            b: motion * self.b,
            radius: self.radius,
        }
    }
}
