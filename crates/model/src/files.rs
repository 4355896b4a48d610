//! Opens the files that make up a problem, and refuses what is no such file.

use std::{
    collections::HashMap,
    fs,
    io::{self, Read},
    path::{Path, PathBuf},
};

use tensegra_collision::parse_off;

use crate::{
    diagnostic::{Finding, Findings, Severity, SourceFile, did_you_mean},
    environment::Shape,
};

/// The largest file that is read, in bytes.
const LARGEST: u64 = 16 * 1024 * 1024;

/// Reads a text file, or reports why it cannot be read.
pub(crate) fn read_text(path: &Path, findings: &mut Findings) -> Option<SourceFile> {
    match load(path) {
        Ok(text) => Some(SourceFile::new(path, text)),
        Err(finding) => {
            findings.push(finding);
            None
        }
    }
}

/// Whether there is something at this path.
pub(crate) fn exists(path: &Path) -> bool {
    path.try_exists().unwrap_or(true)
}

pub(crate) fn load(path: &Path) -> Result<String, Finding> {
    let refuse = |message: String| Finding::about_file(path, message);
    let metadata = fs::metadata(path).map_err(|error| match error.kind() {
        io::ErrorKind::NotFound => {
            refuse("there is no such file".to_string()).with_hint(similar_file(path))
        }
        _ => refuse(format!("the file cannot be opened: {error}")),
    })?;
    if metadata.is_dir() {
        return Err(refuse("this is a folder, not a file".to_string())
            .with_hint("name a `.toml` or `.tens` file in it".to_string()));
    }
    if !metadata.is_file() {
        return Err(refuse("this is no ordinary file".to_string()));
    }
    let too_large = |size: u64| {
        refuse(format!(
            "the file is too large: {size} bytes; at most {LARGEST} are read"
        ))
    };
    if metadata.len() > LARGEST {
        return Err(too_large(metadata.len()));
    }
    let unreadable = |error: io::Error| refuse(format!("the file cannot be read: {error}"));
    let mut bytes = Vec::with_capacity(usize::try_from(metadata.len()).unwrap_or(0));
    // One byte more than allowed tells that the file has grown since.
    fs::File::open(path)
        .map_err(unreadable)?
        .take(LARGEST + 1)
        .read_to_end(&mut bytes)
        .map_err(unreadable)?;
    if bytes.len() as u64 > LARGEST {
        return Err(too_large(bytes.len() as u64));
    }
    let binary = |at: usize| {
        refuse(format!(
            "this is not a text file: byte {at} belongs to no text in UTF-8"
        ))
    };
    if let Some(at) = bytes.iter().position(|&byte| byte == 0) {
        return Err(binary(at));
    }
    let text =
        String::from_utf8(bytes).map_err(|error| binary(error.utf8_error().valid_up_to()))?;
    if text.trim().is_empty() {
        return Err(refuse("the file is empty".to_string()));
    }
    Ok(text)
}

/// A file of the same folder whose name is close.
fn similar_file(path: &Path) -> Option<String> {
    // More entries than people look through.
    const LISTED: usize = 1000;
    let name = path.file_name()?.to_str()?;
    let folder = match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    };
    let names: Vec<String> = fs::read_dir(folder)
        .ok()?
        .take(LISTED)
        .filter_map(|entry| entry.ok()?.file_name().into_string().ok())
        .collect();
    did_you_mean(name, names.iter().map(String::as_str))
}

/// Reads meshes of `.off` files, each file once.
#[derive(Debug)]
pub(crate) struct Meshes {
    folder: PathBuf,
    read: HashMap<String, Option<Shape>>,
}

impl Meshes {
    /// Meshes whose files are named relative to the folder of `path`.
    pub(crate) fn beside(path: &Path) -> Self {
        Self::in_folder(path.parent().unwrap_or(Path::new("")))
    }

    /// Meshes whose files are named relative to a folder.
    pub(crate) fn in_folder(folder: &Path) -> Self {
        Self {
            folder: folder.to_path_buf(),
            read: HashMap::new(),
        }
    }

    /// The mesh of a file, or nothing if it has been reported as unreadable.
    pub(crate) fn mesh(&mut self, name: &str, findings: &mut Findings) -> Option<Shape> {
        if let Some(known) = self.read.get(name) {
            return known.clone();
        }
        let shape = read_mesh(&self.folder.join(name), name, findings);
        self.read.insert(name.to_string(), shape.clone());
        shape
    }
}

fn read_mesh(path: &Path, name: &str, findings: &mut Findings) -> Option<Shape> {
    let file = read_text(path, findings)?;
    let surface = match parse_off(file.text()) {
        Ok(surface) => surface,
        Err(error) => {
            let span = token_at(file.text(), error.line, error.column);
            findings.push(Finding::in_text(
                Severity::Error,
                &file,
                span,
                error.message,
            ));
            return None;
        }
    };
    Some(Shape::Mesh {
        file: name.to_string(),
        vertices: surface.vertices,
        faces: distinct_faces(surface.faces),
    })
}

/// The token at a line and column, both counted from one, as a range of bytes.
fn token_at(text: &str, line: usize, column: usize) -> std::ops::Range<usize> {
    let line_start = text
        .split_inclusive('\n')
        .take(line.saturating_sub(1))
        .map(str::len)
        .sum::<usize>();
    let rest = &text[line_start..];
    let start = rest
        .char_indices()
        .nth(column.saturating_sub(1))
        .map_or(rest.len(), |(at, _)| at);
    let length = rest[start..]
        .find(char::is_whitespace)
        .unwrap_or(rest.len() - start);
    line_start + start..line_start + start + length
}

/// Faces, each set of corners once: some programs write both sides of every face,
/// which encloses the body twice.
fn distinct_faces(faces: Vec<Vec<usize>>) -> Vec<Vec<usize>> {
    let mut seen = std::collections::HashSet::new();
    faces
        .into_iter()
        .filter(|face| {
            let mut corners = face.clone();
            corners.sort_unstable();
            seen.insert(corners)
        })
        .collect()
}
