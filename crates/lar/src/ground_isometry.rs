//! Isometries of the ground: turns about the vertical, mirror images in vertical planes, shifts.

use nalgebra::{Matrix2, Vector2, Vector3};

/// An isometry of space that maps the ground to itself and keeps heights.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GroundIsometry {
    linear: Matrix2<f64>,
    shift: Vector2<f64>,
}

impl GroundIsometry {
    /// The isometry that maps the segment `from` onto the segment `to` of equal length, with or
    /// without a mirror image. None when the lengths differ by more than `tolerance` or vanish.
    #[must_use]
    pub fn between_segments(
        from: [Vector3<f64>; 2],
        to: [Vector3<f64>; 2],
        mirrored: bool,
        tolerance: f64,
    ) -> Option<Self> {
        let (a, b) = ((from[1] - from[0]).xy(), (to[1] - to[0]).xy());
        let length = a.norm();
        if !(length > tolerance) || !((length - b.norm()).abs() <= tolerance) {
            return None;
        }
        let (a, b) = (a / length, b.normalize());
        // The columns are the images of the unit vectors along and across the segment.
        let across = if mirrored { -1.0 } else { 1.0 };
        let frame = |u: Vector2<f64>, sign: f64| Matrix2::new(u.x, -sign * u.y, u.y, sign * u.x);
        let linear = frame(b, across) * frame(a, 1.0).transpose();
        Some(Self {
            linear,
            shift: to[0].xy() - linear * from[0].xy(),
        })
    }

    /// Image of a point.
    #[must_use]
    pub fn apply(&self, point: &Vector3<f64>) -> Vector3<f64> {
        let image = self.linear * point.xy() + self.shift;
        Vector3::new(image.x, image.y, point.z)
    }

    /// Image of a direction.
    #[must_use]
    pub fn apply_direction(&self, direction: &Vector3<f64>) -> Vector3<f64> {
        let image = self.linear * direction.xy();
        Vector3::new(image.x, image.y, direction.z)
    }

    /// The isometry that undoes this one.
    #[must_use]
    pub fn inverse(&self) -> Self {
        let linear = self.linear.transpose();
        Self {
            linear,
            shift: -(linear * self.shift),
        }
    }

    /// Whether this is a mirror image (possibly with a shift along the mirror).
    #[must_use]
    pub fn is_mirrored(&self) -> bool {
        self.linear.determinant() < 0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn segments_are_mapped_and_distances_kept() {
        let v = |x, y| Vector3::new(x, y, 0.0);
        let from = [v(0.0, 0.0), v(2.0, 0.0)];
        let to = [v(1.0, 1.0), v(1.0, 3.0)];
        let (p, q) = (Vector3::new(0.3, 0.7, 0.5), Vector3::new(-1.0, 0.2, 0.1));
        for mirrored in [false, true] {
            let map = GroundIsometry::between_segments(from, to, mirrored, 1e-9).unwrap();
            assert_eq!(map.is_mirrored(), mirrored);
            for k in 0..2 {
                assert!((map.apply(&from[k]) - to[k]).norm() < 1e-12);
            }
            let distance = (map.apply(&p) - map.apply(&q)).norm();
            assert!((distance - (p - q).norm()).abs() < 1e-12);
            assert!((map.inverse().apply(&map.apply(&p)) - p).norm() < 1e-12);
            // The left side of the segment goes to the left, or to the right when mirrored.
            let left = map.apply(&v(0.0, 1.0));
            assert_eq!(left.x < 1.0, !mirrored);
        }
        let longer = [v(0.0, 0.0), v(3.0, 0.0)];
        assert!(GroundIsometry::between_segments(from, longer, false, 1e-9).is_none());
    }
}
