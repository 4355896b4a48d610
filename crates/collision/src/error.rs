//! Why a shape is refused.

use nalgebra::{Point3, Vector3};
use thiserror::Error;

/// A shape whose numbers describe no body.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum ShapeError {
    /// A coordinate or a size is NaN or infinite.
    #[error("{shape}: the {what} is {value}; give finite numbers")]
    NotFinite {
        /// Kind of shape.
        shape: &'static str,
        /// Which of its quantities.
        what: &'static str,
        /// The number that was given.
        value: f64,
    },
    /// A radius is negative, or zero where the shape needs thickness, or not finite.
    #[error("{shape}: radius {radius}; give a {} finite number", if *.zero_allowed { "non-negative" } else { "positive" })]
    Radius {
        /// Kind of shape.
        shape: &'static str,
        /// The radius that was given.
        radius: f64,
        /// Whether this shape may have radius zero.
        zero_allowed: bool,
    },
    /// A size that must be positive is not.
    #[error("{shape}: the {what} is {value}; give a positive number")]
    NotPositive {
        /// Kind of shape.
        shape: &'static str,
        /// Which of its sizes.
        what: &'static str,
        /// The number that was given.
        value: f64,
    },
    /// A box without inside.
    #[error(
        "box: along {axis} it reaches from {min} to {max}; the corner of smallest coordinates comes first"
    )]
    EmptyBox {
        /// Name of the axis: x, y or z.
        axis: char,
        /// Smallest coordinate given.
        min: f64,
        /// Largest coordinate given.
        max: f64,
    },
    /// A direction or an axis of length zero.
    #[error("{shape}: the {what} has length zero; give two different points or a non-zero vector")]
    NoDirection {
        /// Kind of shape.
        shape: &'static str,
        /// Which of its directions.
        what: &'static str,
    },
    /// Points that span no volume.
    #[error(
        "{shape}: the points lie in one plane or closer to it than rounding; a body needs volume"
    )]
    Flat {
        /// Kind of shape.
        shape: &'static str,
    },
    /// Too few points for a body.
    #[error("{shape}: {given} points; at least {needed} are needed")]
    TooFewPoints {
        /// Kind of shape.
        shape: &'static str,
        /// Number of points given.
        given: usize,
        /// Least number.
        needed: usize,
    },
}

/// A surface that encloses no body. Vertices and faces are counted from zero.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum MeshError {
    /// Too few vertices or faces to close a surface.
    #[error(
        "mesh: {vertices} vertices and {faces} faces; a closed surface has at least four of both"
    )]
    TooSmall {
        /// Number of vertices.
        vertices: usize,
        /// Number of faces.
        faces: usize,
    },
    /// A coordinate is NaN or infinite.
    #[error("mesh: vertex {vertex} has the coordinate {value}; give finite numbers")]
    NotFinite {
        /// Vertex concerned.
        vertex: usize,
        /// The number that was given.
        value: f64,
    },
    /// A face with fewer than three different corners.
    #[error("mesh: face {face} has fewer than three different corners")]
    FaceTooSmall {
        /// Face concerned.
        face: usize,
    },
    /// A face refers to a vertex that does not exist.
    #[error(
        "mesh: face {face} refers to vertex {index}, but there are {vertices} vertices, counted from zero"
    )]
    NoSuchVertex {
        /// Face concerned.
        face: usize,
        /// Index given.
        index: usize,
        /// Number of vertices.
        vertices: usize,
    },
    /// A face without area, or a polygon that crosses itself.
    #[error("mesh: face {face} has no area or crosses itself; split it into triangles")]
    BadFace {
        /// Face concerned.
        face: usize,
    },
    /// An edge that does not belong to two faces.
    #[error(
        "mesh: the edge between vertices {a} and {b} belongs to {faces} face(s); in a closed surface every edge belongs to two"
    )]
    OpenEdge {
        /// One end.
        a: usize,
        /// Other end.
        b: usize,
        /// Number of faces at the edge.
        faces: usize,
    },
    /// A surface with one side, such as a Klein bottle.
    #[error("mesh: face {face} cannot be oriented like its neighbours; the surface has no inside")]
    NotOrientable {
        /// Face concerned.
        face: usize,
    },
    /// A surface that encloses no volume.
    #[error("mesh: the surface encloses no volume")]
    NoVolume,
}

pub(crate) fn finite_point(
    shape: &'static str,
    what: &'static str,
    p: &Point3<f64>,
) -> Result<(), ShapeError> {
    finite_vector(shape, what, &p.coords)
}

pub(crate) fn finite_vector(
    shape: &'static str,
    what: &'static str,
    v: &Vector3<f64>,
) -> Result<(), ShapeError> {
    match v.iter().find(|x| !x.is_finite()) {
        Some(&value) => Err(ShapeError::NotFinite { shape, what, value }),
        None => Ok(()),
    }
}

pub(crate) fn radius(
    shape: &'static str,
    radius: f64,
    zero_allowed: bool,
) -> Result<(), ShapeError> {
    if radius.is_finite() && (radius > 0.0 || (zero_allowed && radius == 0.0)) {
        Ok(())
    } else {
        Err(ShapeError::Radius {
            shape,
            radius,
            zero_allowed,
        })
    }
}
