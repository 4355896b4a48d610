//! The OFF format for surfaces (Geomview's "Object File Format", ASCII, three dimensions).
//!
//! The word `OFF`; the numbers of vertices, faces and edges; one line for each vertex with its coordinates; one line
//! for each face with the number of its corners, the corners counted from zero, and optionally a colour (up to four
//! numbers), which is read over, as is the number of edges. `COFF` is the same with a colour behind each vertex. A
//! `#` starts a comment. Linear in the length of the text.

use nalgebra::Point3;
use thiserror::Error;

/// A surface as a file gives it: vertices, and faces as lists of corners.
///
/// [`Solid::mesh`](crate::Solid::mesh) makes a body of it if it is closed.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct OffSurface {
    /// Vertices, in the file's unit of length.
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
///
/// ```
/// let text = "OFF
/// 4 4 6           # vertices, faces, edges
/// 0 0 0
/// 1 0 0
/// 0 1 0
/// 0 0 1
/// 3 0 2 1
/// 3 0 1 3  255 0 0
/// 3 1 2 3
/// 3 2 0 3
/// ";
/// let surface = tensegra_collision::parse_off(text)?;
/// assert_eq!(surface.faces[1], [0, 1, 3]);
/// let solid = tensegra_collision::Solid::mesh(&surface.vertices, &surface.faces)?;
///
/// let error = tensegra_collision::parse_off("OFF\n1 0 0\n0 zero 0\n").unwrap_err();
/// assert_eq!((error.line, error.column), (3, 3));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`OffError`] with the place: an unknown header, something that is not a number, a coordinate that is not finite, a
/// corner that is no vertex, a face of fewer than three corners, too few or too many lines.
pub fn parse_off(text: &str) -> Result<OffSurface, OffError> {
    let mut lines = Lines::new(text);
    let mut line = lines.expect("the word OFF")?;
    let header = line.next("the word OFF")?;
    let colours = match header.text {
        "OFF" => false,
        "COFF" => true,
        other => {
            return Err(header.error(format!(
                "the file begins with `{}`; an ASCII surface begins with `OFF` or `COFF`",
                shortened(other)
            )));
        }
    };
    if line.is_empty() {
        line = lines.expect("the numbers of vertices, faces and edges")?;
    }
    let vertex_count = line.count("the number of vertices")?;
    let face_count = line.count("the number of faces")?;
    if !line.is_empty() {
        line.count("the number of edges")?;
    }
    line.end("the three counts")?;

    // Not reserved from the counts, which a broken file may give as billions.
    let mut surface = OffSurface::default();
    for read in 0..vertex_count {
        let mut line = lines.expect(&format!(
            "{vertex_count} vertices as announced, {read} found"
        ))?;
        let mut coordinates = [0.0; 3];
        for (value, name) in coordinates.iter_mut().zip(["x", "y", "z"]) {
            *value = line.number(&format!("coordinate {name} of vertex {read}"))?;
        }
        if colours {
            line.colour()?;
        }
        line.end("the coordinates of a vertex")?;
        surface.vertices.push(Point3::from(coordinates));
    }
    for read in 0..face_count {
        let mut line = lines.expect(&format!("{face_count} faces as announced, {read} found"))?;
        let place = line.next("the number of corners")?;
        let corner_count = place.count("the number of corners")?;
        if corner_count < 3 {
            return Err(place.error(format!(
                "a face of {corner_count} corners; it needs at least three"
            )));
        }
        let mut face = Vec::new();
        for corner in 0..corner_count {
            let place = line.next(&format!("corner {corner} of {corner_count}"))?;
            let vertex = place.count("a vertex, counted from zero")?;
            if vertex >= vertex_count {
                return Err(place.error(format!(
                    "vertex {vertex} does not exist; the {vertex_count} vertices are counted from zero"
                )));
            }
            face.push(vertex);
        }
        line.colour()?;
        line.end("the corners and the colour of a face")?;
        surface.faces.push(face);
    }
    if let Some(mut line) = lines.next() {
        let rest = line.next("nothing")?;
        return Err(rest.error(format!(
            "`{}` after the last of {face_count} faces; the counts at the top and the lines disagree",
            shortened(rest.text)
        )));
    }
    Ok(surface)
}

/// A word and its place.
#[derive(Clone, Copy)]
struct Word<'a> {
    text: &'a str,
    line: usize,
    column: usize,
}

impl Word<'_> {
    fn error(&self, message: String) -> OffError {
        OffError {
            line: self.line,
            column: self.column,
            message,
        }
    }

    fn count(&self, what: &str) -> Result<usize, OffError> {
        self.text.parse().map_err(|_| {
            self.error(format!(
                "`{}` where {what} is expected, a whole number",
                shortened(self.text)
            ))
        })
    }
}

/// The start of a text that may be long, for messages.
fn shortened(text: &str) -> String {
    const LONGEST: usize = 24;
    match text.char_indices().nth(LONGEST) {
        Some((end, _)) => format!("{}…", &text[..end]),
        None => text.to_owned(),
    }
}

/// What is left of a line.
struct Line<'a> {
    rest: &'a str,
    number: usize,
    column: usize,
}

impl<'a> Line<'a> {
    fn skip_space(&mut self) {
        let trimmed = self.rest.trim_start();
        let skipped = &self.rest[..self.rest.len() - trimmed.len()];
        self.column += skipped.chars().count();
        self.rest = trimmed;
    }

    fn is_empty(&self) -> bool {
        self.rest.is_empty()
    }

    fn next(&mut self, what: &str) -> Result<Word<'a>, OffError> {
        if self.is_empty() {
            return Err(OffError {
                line: self.number,
                column: self.column,
                message: format!("the line ends where {what} is expected"),
            });
        }
        let end = self
            .rest
            .find(char::is_whitespace)
            .unwrap_or(self.rest.len());
        let (text, rest) = self.rest.split_at(end);
        let word = Word {
            text,
            line: self.number,
            column: self.column,
        };
        self.column += text.chars().count();
        self.rest = rest;
        self.skip_space();
        Ok(word)
    }

    fn count(&mut self, what: &str) -> Result<usize, OffError> {
        self.next(what)?.count(what)
    }

    fn number(&mut self, what: &str) -> Result<f64, OffError> {
        let word = self.next(what)?;
        match word.text.parse::<f64>() {
            Ok(value) if value.is_finite() => Ok(value),
            _ => Err(word.error(format!(
                "`{}` where {what} is expected, a finite number",
                shortened(word.text)
            ))),
        }
    }

    /// Up to four numbers.
    fn colour(&mut self) -> Result<(), OffError> {
        for _ in 0..4 {
            if !self.is_empty() {
                self.number("a part of a colour")?;
            }
        }
        Ok(())
    }

    fn end(&mut self, after: &str) -> Result<(), OffError> {
        if self.is_empty() {
            return Ok(());
        }
        let word = self.next("nothing")?;
        Err(word.error(format!(
            "`{}` after {after}; the line should end here",
            shortened(word.text)
        )))
    }
}

/// The lines that are not empty, without comments.
struct Lines<'a> {
    lines: std::iter::Enumerate<std::str::Lines<'a>>,
    last: usize,
}

impl<'a> Lines<'a> {
    fn new(text: &'a str) -> Self {
        // Some editors put a byte order mark first.
        let text = text.strip_prefix('\u{feff}').unwrap_or(text);
        Self {
            lines: text.lines().enumerate(),
            last: 0,
        }
    }

    fn next(&mut self) -> Option<Line<'a>> {
        for (index, text) in self.lines.by_ref() {
            self.last = index + 1;
            let mut line = Line {
                rest: text.split('#').next().unwrap_or_default().trim_end(),
                number: index + 1,
                column: 1,
            };
            line.skip_space();
            if !line.is_empty() {
                return Some(line);
            }
        }
        None
    }

    fn expect(&mut self, what: &str) -> Result<Line<'a>, OffError> {
        self.next().ok_or(OffError {
            line: self.last + 1,
            column: 1,
            message: format!("the file ends; expected {what}"),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TETRAHEDRON: &str =
        "OFF\n4 4 6\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 2 1\n3 0 1 3\n3 1 2 3\n3 2 0 3\n";

    #[test]
    fn reads_comments_colours_and_joined_headers() {
        let plain = parse_off(TETRAHEDRON).unwrap();
        let fancy = "\u{feff}# a tetrahedron\n  COFF 4 4 6 # counts\n\n0 0 0 1 0 0 1\n1 0 0 9 9 9\r\n\t0 1 0\n0 0 1 \
                     #last\n3 0 2 1 255 0 0\n3 0 1 3 0.5 0.5 0.5 1\n3 1 2 3 7\n3 2 0 3";
        assert_eq!(parse_off(fancy).unwrap(), plain);
        assert_eq!(plain.vertices.len(), 4);
        assert_eq!(plain.faces[3], [2, 0, 3]);
    }

    #[test]
    fn faces_of_any_number_of_corners() {
        let surface =
            parse_off("OFF\n5 2 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n.5 2e0 0\n5 0 1 2 4 3\n4 0 1 2 3")
                .unwrap();
        assert_eq!(surface.faces, [vec![0, 1, 2, 4, 3], vec![0, 1, 2, 3]]);
    }

    /// Text, line, column, and a part of the message.
    #[test]
    fn errors_say_where_and_what() {
        let cases = [
            ("", 1, 1, "the file ends"),
            ("\n\n# nothing\n", 4, 1, "the file ends"),
            ("ply\n", 1, 1, "begins with `ply`"),
            ("OFF BINARY\n", 1, 5, "number of vertices"),
            ("OFF\n4 x 6\n", 2, 3, "number of faces"),
            ("OFF\n4\n", 2, 2, "line ends"),
            ("OFF\n-1 0 0\n", 2, 1, "whole number"),
            ("OFF\n1 0 0 0\n0 0 0", 2, 7, "should end"),
            (
                "OFF\n2 0 0\n0 0 0\n",
                4,
                1,
                "2 vertices as announced, 1 found",
            ),
            ("OFF\n1 0 0\n0  zero 0\n", 3, 4, "coordinate y of vertex 0"),
            ("OFF\n1 0 0\n0 0 NaN\n", 3, 5, "finite"),
            ("OFF\n1 0 0\n0 0 inf\n", 3, 5, "finite"),
            ("OFF\n1 0 0\n0 0 0 1\n", 3, 7, "should end"),
            ("OFF\n1 1 0\n0 0 0\n2 0 0\n", 4, 1, "at least three"),
            (
                "OFF\n1 1 0\n0 0 0\n3 0 0 1\n",
                4,
                7,
                "vertex 1 does not exist",
            ),
            ("OFF\n1 1 0\n0 0 0\n3 0 0\n", 4, 6, "corner 2 of 3"),
            ("OFF\n1 1 0\n0 0 0\n3 0 0 0 red\n", 4, 9, "colour"),
            (
                "OFF\n1 1 0\n0 0 0\n3 0 0 0 1 2 3 4 5\n",
                4,
                17,
                "should end",
            ),
            ("OFF\n1 1 0\n0 0 0\n", 4, 1, "1 faces as announced, 0 found"),
            (
                "OFF\n1 0 0\n0 0 0\n3 0 0 0\n",
                4,
                1,
                "after the last of 0 faces",
            ),
            (
                "OFF\n99999999999999 1 0\n0 0 0\n",
                4,
                1,
                "99999999999999 vertices",
            ),
            ("OFF\n1 0 0\n0 ä é\n", 3, 3, "`ä`"),
        ];
        for (text, line, column, message) in cases {
            let error = parse_off(text).expect_err(text);
            assert_eq!(
                (error.line, error.column),
                (line, column),
                "{text:?}: {error}"
            );
            assert!(error.message.contains(message), "{text:?}: {error}");
        }
    }
}
