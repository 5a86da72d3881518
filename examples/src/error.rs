//! Error type of every scene source: the file or recipe, the position in it, and the problem.
//!
//! A scene file may be truncated, mistyped or made to break its reader, so each loader returns this error
//! instead of panicking. The position is a byte offset in binary files and a key path such as
//! `cameras[1].keys[3].eye` in JSON, so that a person can find the spot with an editor.

use crate::other_formats::way_to_gltf;
use std::fmt;
use std::path::{Path, PathBuf};

/// Reason why a scene could not be made or read.
#[derive(Debug)]
#[non_exhaustive]
pub enum SourceError {
    /// Error of the file system, such as a missing file, a missing permission or a failing disk.
    Io {
        /// Path of the file that could not be opened or read.
        file: PathBuf,
        /// Error that the operating system reported.
        cause: std::io::Error,
    },
    /// Invalid content of a file that could be read.
    Content {
        /// Path of the file whose content is invalid.
        file: PathBuf,
        /// Position of the problem in the file: a byte offset, a key path, or the name of a glTF item.
        place: String,
        /// Description of the problem, for a person.
        problem: String,
    },
    /// Path whose extension names no supported scene format.
    UnknownFormat {
        /// Path of the scene file, as the caller gave it.
        file: PathBuf,
    },
    /// Recipe or sizes of a recipe that cannot be understood or would make too large a scene.
    Recipe {
        /// Recipe with its sizes, as the caller wrote it, such as `plpcity:3,3`.
        spec: String,
        /// Description of the problem, for a person.
        problem: String,
    },
}

impl SourceError {
    /// Makes a [`SourceError::Content`] of a file; `place` is the position of the problem in the file.
    pub(crate) fn content(file: &Path, place: impl Into<String>, problem: impl Into<String>) -> Self {
        SourceError::Content { file: file.to_path_buf(), place: place.into(), problem: problem.into() }
    }

    /// Makes a [`SourceError::Io`] of a file that could not be read.
    pub(crate) fn io(file: &Path, cause: std::io::Error) -> Self {
        SourceError::Io { file: file.to_path_buf(), cause }
    }

    /// Makes a [`SourceError::Recipe`] for a recipe with its sizes as the caller wrote it.
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
            SourceError::UnknownFormat { file } => {
                let why = way_to_gltf(file);
                let why = why.as_deref().unwrap_or("the extension names no known scene format");
                write!(f, "{}: scenes are .gltf, .glb or .vscn files; {why}", file.display())
            }
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
