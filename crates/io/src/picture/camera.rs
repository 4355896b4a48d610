//! Parallel projection of space onto a page.

use nalgebra::{Matrix3, Point3, Vector3};

/// From where a scene or a plot in space is seen, always in parallel
/// projection, so that equal lengths along one direction look equal.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum View {
    /// From above: x to the right, y upwards.
    Plan,
    /// From the direction at `azimuth` degrees from x towards y and `elevation`
    /// degrees above the plane of x and y; z upwards.
    Axonometric {
        /// Degrees from x towards y.
        azimuth: f64,
        /// Degrees above the plane of x and y, cut to −89 … 89.
        elevation: f64,
    },
}

impl View {
    /// The usual oblique view.
    pub const fn oblique() -> Self {
        Self::Axonometric {
            azimuth: -60.0,
            elevation: 22.0,
        }
    }

    /// The plan for planar structures, the oblique view for others.
    pub const fn for_dimension(dimension: usize) -> Self {
        match dimension {
            2 => Self::Plan,
            _ => Self::oblique(),
        }
    }

    pub(crate) fn camera(self) -> Camera {
        match self {
            Self::Plan => Camera {
                rows: Matrix3::identity(),
            },
            Self::Axonometric { azimuth, elevation } => {
                let (sin_a, cos_a) = azimuth.to_radians().sin_cos();
                let (sin_e, cos_e) = elevation.clamp(-89.0, 89.0).to_radians().sin_cos();
                let right = Vector3::new(-sin_a, cos_a, 0.0);
                let toward = Vector3::new(cos_e * cos_a, cos_e * sin_a, sin_e);
                let up = toward.cross(&right);
                Camera {
                    rows: Matrix3::from_rows(&[
                        right.transpose(),
                        up.transpose(),
                        toward.transpose(),
                    ]),
                }
            }
        }
    }
}

/// A rotation of space to what is seen: right, up, and towards the viewer.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Camera {
    rows: Matrix3<f64>,
}

impl Camera {
    pub(crate) fn see(&self, point: &Point3<f64>) -> Point3<f64> {
        Point3::from(self.rows * point.coords)
    }

    /// The direction towards the viewer, in the world.
    pub(crate) fn toward(&self) -> Vector3<f64> {
        self.rows.row(2).transpose()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn views_are_rotations() {
        for view in [View::Plan, View::oblique()] {
            let rows = view.camera().rows;
            assert!((rows * rows.transpose() - Matrix3::identity()).norm() < 1e-12);
            assert!((rows.determinant() - 1.0).abs() < 1e-12);
        }
        let above = View::oblique().camera().see(&Point3::new(0.0, 0.0, 1.0));
        assert!(above.x.abs() < 1e-12 && above.y > 0.0 && above.z > 0.0);
    }
}
