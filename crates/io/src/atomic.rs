//! Writing files so that nobody ever sees half of one.
//!
//! The bytes go to a temporary file in the folder of the destination, which is
//! then renamed: on one file system a rename replaces the old file at once, so
//! that a reader finds either the old contents or the new, and a run that is
//! stopped leaves the old ones.

use std::{
    io::{self, Write},
    path::{Path, PathBuf},
};

/// Why a file was not written. Nothing is left behind in any of these cases.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum WriteError {
    /// The folder of the file does not exist and cannot be created.
    #[error(
        "cannot create the folder `{}`: {reason}; choose another folder for the output",
        folder.display()
    )]
    Folder {
        /// The folder.
        folder: PathBuf,
        /// What the system says.
        reason: io::Error,
    },
    /// The folder exists, but a file cannot be written in it.
    #[error(
        "cannot write `{}`: {reason}; check that its folder is writable and that the disk has room",
        file.display()
    )]
    File {
        /// The file.
        file: PathBuf,
        /// What the system says.
        reason: io::Error,
    },
    /// A folder stands where the file should go.
    #[error("cannot write `{}`: it is a folder; give the name of a file", file.display())]
    IsFolder {
        /// The file that was asked for.
        file: PathBuf,
    },
}

/// Writes `bytes` to `file` as a whole or not at all, creating its folder where
/// that is missing and replacing a file that exists.
///
/// # Errors
/// [`WriteError`] when the folder cannot be created or written to.
///
/// # Examples
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let folder = tempfile::tempdir()?;
/// let file = folder.path().join("out/notes.txt");
/// tensegra_io::write_atomic(&file, b"k = 3\n")?;
/// assert_eq!(std::fs::read(&file)?, b"k = 3\n");
/// # Ok(())
/// # }
/// ```
pub fn write_atomic(file: &Path, bytes: &[u8]) -> Result<(), WriteError> {
    if file.is_dir() || file.file_name().is_none() {
        return Err(WriteError::IsFolder {
            file: file.to_path_buf(),
        });
    }
    let folder = match file.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    std::fs::create_dir_all(folder).map_err(|reason| WriteError::Folder {
        folder: folder.to_path_buf(),
        reason,
    })?;
    replace(file, folder, bytes).map_err(|reason| WriteError::File {
        file: file.to_path_buf(),
        reason,
    })
}

fn replace(file: &Path, folder: &Path, bytes: &[u8]) -> io::Result<()> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(".tensegra-").suffix(".part");
    // A temporary file is private by default; a result is as readable as any
    // other file of its owner, so the process's own mask decides.
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    let mut temporary = builder.tempfile_in(folder)?;
    temporary.write_all(bytes)?;
    temporary.as_file().sync_data()?;
    temporary.persist(file).map_err(|failure| failure.error)?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let mut names: Vec<_> = std::fs::read_dir(folder)
            .unwrap()
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        names
    }

    #[test]
    fn replaces_what_is_there_and_leaves_no_temporary_file() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("a.json");
        write_atomic(&file, b"old and longer").unwrap();
        write_atomic(&file, b"new").unwrap();
        assert_eq!(std::fs::read(&file).unwrap(), b"new");
        assert_eq!(names(folder.path()), ["a.json"]);
    }

    #[test]
    fn a_file_in_place_of_the_folder_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let blocker = folder.path().join("out");
        std::fs::write(&blocker, b"kept").unwrap();
        let failure = write_atomic(&blocker.join("a.json"), b"x").unwrap_err();
        assert!(matches!(failure, WriteError::Folder { .. }), "{failure}");
        assert!(failure.to_string().contains("out"), "{failure}");
        assert_eq!(std::fs::read(&blocker).unwrap(), b"kept");
        assert_eq!(names(folder.path()), ["out"]);
    }

    #[test]
    fn a_folder_in_place_of_the_file_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let failure = write_atomic(folder.path(), b"x").unwrap_err();
        assert!(matches!(failure, WriteError::IsFolder { .. }), "{failure}");
        assert_eq!(names(folder.path()), [""; 0]);
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_folder_that_takes_no_files_is_refused() {
        // Not even the superuser may create files below /proc.
        let failure = write_atomic(Path::new("/proc/self/a.json"), b"x").unwrap_err();
        assert!(matches!(failure, WriteError::File { .. }), "{failure}");
    }

    #[cfg(unix)]
    #[test]
    fn the_file_is_readable_like_any_other() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().unwrap();
        let [ours, usual] = ["ours", "usual"].map(|name| folder.path().join(name));
        write_atomic(&ours, b"x").unwrap();
        std::fs::write(&usual, b"x").unwrap();
        let mode = |file: &Path| std::fs::metadata(file).unwrap().permissions().mode();
        assert_eq!(mode(&ours), mode(&usual));
    }
}
