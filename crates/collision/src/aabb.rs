//! Axis-aligned boxes, for culling.

use nalgebra::{Point3, Vector3};

/// An axis-aligned box; unbounded shapes have infinite corners.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aabb {
    /// Smallest coordinates.
    pub min: Point3<f64>,
    /// Largest coordinates.
    pub max: Point3<f64>,
}

impl Aabb {
    /// The smallest box around some points, or `None` without points.
    #[must_use]
    pub fn of_points<'a>(points: impl IntoIterator<Item = &'a Point3<f64>>) -> Option<Self> {
        let mut points = points.into_iter();
        let first = *points.next()?;
        Some(points.fold(
            Self {
                min: first,
                max: first,
            },
            |b, p| Self {
                min: b.min.inf(p),
                max: b.max.sup(p),
            },
        ))
    }

    /// Centre of the box.
    #[inline]
    #[must_use]
    pub fn center(&self) -> Point3<f64> {
        nalgebra::center(&self.min, &self.max)
    }

    /// Half of the edge lengths.
    #[inline]
    #[must_use]
    pub fn half_extents(&self) -> Vector3<f64> {
        (self.max - self.min) * 0.5
    }

    /// The box grown by `margin` on every side.
    #[inline]
    #[must_use]
    pub fn loosened(&self, margin: f64) -> Self {
        Self {
            min: self.min - Vector3::repeat(margin),
            max: self.max + Vector3::repeat(margin),
        }
    }

    /// The smallest box that holds both.
    #[inline]
    #[must_use]
    pub fn merged(&self, other: &Self) -> Self {
        Self {
            min: self.min.inf(&other.min),
            max: self.max.sup(&other.max),
        }
    }

    /// Whether the boxes share a point.
    #[inline]
    #[must_use]
    pub fn intersects(&self, other: &Self) -> bool {
        (0..3).all(|i| self.min[i] <= other.max[i] && other.min[i] <= self.max[i])
    }

    /// Distance between two boxes, zero where they overlap.
    #[inline]
    #[must_use]
    pub fn distance(&self, other: &Self) -> f64 {
        let mut squared = 0.0;
        for i in 0..3 {
            let gap = (other.min[i] - self.max[i])
                .max(self.min[i] - other.max[i])
                .max(0.0);
            squared += gap * gap;
        }
        squared.sqrt()
    }

    /// Distance from a point to the box, zero inside.
    #[inline]
    #[must_use]
    pub fn distance_to_point(&self, point: &Point3<f64>) -> f64 {
        self.distance(&Self {
            min: *point,
            max: *point,
        })
    }
}
