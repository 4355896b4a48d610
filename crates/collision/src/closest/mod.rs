//! Closest points of points, segments, triangles and boxes: the kernels below every query.

mod point_segment;
mod point_triangle;
mod segment_box;
mod segment_segment;
mod segment_triangle;

use nalgebra::Point3;

pub use point_segment::closest_points_point_segment;
pub use point_triangle::closest_points_point_triangle;
pub(crate) use point_triangle::{Feature, point_triangle};
pub use segment_box::closest_points_segment_box;
pub(crate) use segment_box::segment_box_parameter;
pub use segment_segment::closest_points_segment_segment;
pub use segment_triangle::closest_points_segment_triangle;
pub(crate) use segment_triangle::projects_inside;

/// A pair of closest points of two shapes A and B.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClosestPoints {
    /// The point of A.
    pub on_a: Point3<f64>,
    /// The point of B.
    pub on_b: Point3<f64>,
    /// Where A is a segment, the parameter of `on_a` in `[0, 1]`, else 0.
    pub s: f64,
    /// Where B is a segment, the parameter of `on_b` in `[0, 1]`, else 0.
    pub t: f64,
    /// False where several pairs are equally close because the shapes run parallel (angle below 1e-7).
    pub unique: bool,
}

impl ClosestPoints {
    /// Square of the distance between the two points.
    #[inline]
    #[must_use]
    pub fn distance_squared(&self) -> f64 {
        (self.on_a - self.on_b).norm_squared()
    }

    /// Distance between the two points.
    #[inline]
    #[must_use]
    pub fn distance(&self) -> f64 {
        self.distance_squared().sqrt()
    }
}

/// Shapes whose directions differ by an angle whose squared sine is below this count as parallel for the flag
/// `unique`. The distance itself is computed as if they were not.
pub(crate) const PARALLEL_SINE_SQUARED: f64 = 1e-14;

/// Triangles whose sides enclose an angle with a squared sine below this have no normal worth using.
pub(crate) const NEEDLE_SINE_SQUARED: f64 = 1e-16;
