//! The one error of every scene source: which file or recipe, what is wrong with it, and where.
//!
//! A scene file comes from somebody else and may be cut short, mistyped or made to break its reader, so each
//! loader answers with this instead of a panic. The place is a byte offset in binary files and a key path
//! such as `cameras[1].keys[3].eye` in JSON: a person must be able to find the spot with an editor.

use std::fmt;
use std::path::{Path, PathBuf};

/// Why a scene could not be made or read.
#[derive(Debug)]
#[non_exhaustive]
pub enum SourceError {
    /// The file system refused: no such file, no permission, a failing disk.
    Io {
        /// The file asked for.
        file: PathBuf,
        /// What the operating system says.
        cause: std::io::Error,
    },
    /// The file was read, and its content is wrong.
    Content {
        /// The file that is wrong.
        file: PathBuf,
        /// Where in it: a byte offset, a key path, the name of a glTF item.
        place: String,
        /// What is wrong there.
        problem: String,
    },
    /// The extension of a path names no format that is read here.
    UnknownFormat {
        /// The path as given.
        file: PathBuf,
    },
    /// A recipe, or its sizes, cannot be understood or would be too large.
    Recipe {
        /// The recipe as the caller wrote it.
        spec: String,
        /// What is wrong with it.
        problem: String,
    },
}

impl SourceError {
    pub(crate) fn content(file: &Path, place: impl Into<String>, problem: impl Into<String>) -> Self {
        SourceError::Content { file: file.to_path_buf(), place: place.into(), problem: problem.into() }
    }

    pub(crate) fn io(file: &Path, cause: std::io::Error) -> Self {
        SourceError::Io { file: file.to_path_buf(), cause }
    }

    pub(crate) fn recipe(spec: impl Into<String>, problem: impl Into<String>) -> Self {
        SourceError::Recipe { spec: spec.into(), problem: problem.into() }
    }
}

impl fmt::Display for SourceError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            SourceError::Io { file, cause } => {
                write!(f, "cannot read {}: {cause}", file.display())
            }
            SourceError::Content { file, place, problem } => {
                write!(f, "{}: {place}: {problem}", file.display())
            }
            SourceError::UnknownFormat { file } => write!(
                f,
                "{}: the extension names no known scene format (.vscn, .gltf, .glb)",
                file.display()
            ),
            SourceError::Recipe { spec, problem } => write!(f, "recipe `{spec}`: {problem}"),
        }
    }
}

impl std::error::Error for SourceError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            SourceError::Io { cause, .. } => Some(cause),
            _ => None,
        }
    }
}
