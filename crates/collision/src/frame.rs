//! A right-handed frame, as a matrix: moving a point into it costs nine products.

use nalgebra::{Isometry3, Matrix3, Point3, Vector3};

use crate::query::AxisWitness;

#[derive(Clone, Copy, Debug)]
pub(crate) struct Frame {
    pub origin: Point3<f64>,
    /// The columns are the axes.
    pub axes: Matrix3<f64>,
}

impl Frame {
    pub fn identity() -> Self {
        Self {
            origin: Point3::origin(),
            axes: Matrix3::identity(),
        }
    }

    /// A frame given in this one, in the frame that this one is given in.
    pub fn compose(&self, inner: &Self) -> Self {
        Self {
            origin: self.world_point(&inner.origin.coords),
            axes: self.axes * inner.axes,
        }
    }

    pub fn inverse(&self) -> Self {
        Self {
            origin: Point3::from(-self.axes.tr_mul(&self.origin.coords)),
            axes: self.axes.transpose(),
        }
    }

    pub fn of_pose(pose: &Isometry3<f64>) -> Self {
        Self {
            origin: Point3::from(pose.translation.vector),
            axes: pose.rotation.to_rotation_matrix().into_inner(),
        }
    }

    /// A frame whose third axis is `z` and whose first is as near to `x` as that allows.
    pub fn of_axes(origin: Point3<f64>, z: &Vector3<f64>, x: &Vector3<f64>) -> Self {
        let z = z.normalize();
        let x = crate::query::across(&z, x);
        Self {
            origin,
            axes: Matrix3::from_columns(&[x, z.cross(&x), z]),
        }
    }

    #[inline(always)]
    pub fn local_point(&self, p: &Point3<f64>) -> Vector3<f64> {
        self.axes.tr_mul(&(p - self.origin))
    }

    #[inline(always)]
    pub fn local_vector(&self, v: &Vector3<f64>) -> Vector3<f64> {
        self.axes.tr_mul(v)
    }

    #[inline(always)]
    pub fn world_point(&self, p: &Vector3<f64>) -> Point3<f64> {
        self.origin + self.axes * p
    }

    #[inline(always)]
    pub fn world_vector(&self, v: &Vector3<f64>) -> Vector3<f64> {
        self.axes * v
    }

    #[inline(always)]
    pub fn world_witness(&self, local: AxisWitness) -> AxisWitness {
        AxisWitness {
            normal: self.world_vector(&local.normal),
            ..local
        }
    }
}
