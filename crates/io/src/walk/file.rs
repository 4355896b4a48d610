//! Walk files: JSON, described in docs/walk-file.md.

use std::{
    fs, io,
    path::{Path, PathBuf},
};

use serde::{Deserialize, Serialize};
use tensegra_lar::{Walk, WalkFileError};

use crate::{
    atomic::{WriteError, write_atomic},
    json::Layout,
};

/// Why a file was not read as a walk.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum WalkReadError {
    /// The file cannot be opened or read.
    #[error("cannot read `{}`: {reason}", file.display())]
    Unreadable {
        /// The file.
        file: PathBuf,
        /// What the system says.
        reason: io::Error,
    },
    /// The file does not hold a walk.
    #[error("`{}`: {reason}; give a file that `tensegra walk` wrote", file.display())]
    Malformed {
        /// The file.
        file: PathBuf,
        /// What is wrong, with line and column.
        reason: WalkFileError,
    },
}

/// Why a walk was not written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum WalkWriteError {
    /// The walk cannot be written as JSON.
    #[error("the walk cannot be written as JSON: {0}")]
    Json(#[from] serde_json::Error),
    /// The file cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
}

/// Writes a walk, whole or not at all: one configuration to a line.
///
/// # Errors
/// [`WalkWriteError`] when the file cannot be written.
pub fn write_walk_file(file: &Path, walk: &Walk) -> Result<(), WalkWriteError> {
    let mut bytes = Vec::new();
    let mut serializer = serde_json::Serializer::with_formatter(&mut bytes, Layout::default());
    walk.serialize(&mut serializer)?;
    bytes.push(b'\n');
    Ok(write_atomic(file, &bytes)?)
}

/// Reads a walk. Only its form is looked at: [`tensegra_lar::check_walk`] judges it.
///
/// # Errors
/// [`WalkReadError`] with line and column where the file is no walk.
pub fn read_walk_file(file: &Path) -> Result<Walk, WalkReadError> {
    let text = fs::read_to_string(file).map_err(|reason| WalkReadError::Unreadable {
        file: file.to_path_buf(),
        reason,
    })?;
    Walk::from_json(&text).map_err(|reason| WalkReadError::Malformed {
        file: file.to_path_buf(),
        reason,
    })
}

/// The member `format` of a JSON file, which tells path files from walk files; none where the
/// file has no such member or is no JSON.
pub fn read_format(file: &Path) -> Option<String> {
    #[derive(Deserialize)]
    struct Header {
        format: String,
    }
    let text = fs::read(file).ok()?;
    let header: Header = serde_json::from_slice(&text).ok()?;
    Some(header.format)
}
