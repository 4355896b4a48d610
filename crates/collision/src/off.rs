//! The OFF format for surfaces.

use nalgebra::Point3;
use thiserror::Error;

/// A surface as a file gives it: vertices, and faces as lists of vertex numbers.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct OffSurface {
    /// Vertices.
    pub vertices: Vec<Point3<f64>>,
    /// Corners of each face, counted from zero.
    pub faces: Vec<Vec<usize>>,
}

/// Where and why a text is not an OFF file.
#[derive(Clone, Debug, Error, PartialEq)]
#[error("line {line}, column {column}: {message}")]
pub struct OffError {
    /// Line, counted from one.
    pub line: usize,
    /// Column in characters, counted from one.
    pub column: usize,
    /// What is wrong and what is expected.
    pub message: String,
}

/// Reads the text of an `.off` file.
pub fn parse_off(_text: &str) -> Result<OffSurface, OffError> {
    todo!()
}
