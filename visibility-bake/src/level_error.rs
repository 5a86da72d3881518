//! Errors in writing and reading the content of a level.

use std::fmt;
use std::io::ErrorKind;
use std::path::PathBuf;

/// Reasons why a level in a file cannot be written or read, or why the limit of memory does not suffice.
#[derive(Clone, PartialEq, Eq, Debug)]
#[non_exhaustive]
pub enum LevelError {
    /// The file cannot be written or read.
    File {
        /// Path of the scratch file.
        path: PathBuf,
        /// Kind of the error that the system reports.
        kind: ErrorKind,
    },
    /// The content of an object in the scratch file differs from the content that was written.
    Content {
        /// Path of the scratch file.
        path: PathBuf,
        /// Index of the object whose content has changed.
        object: u32,
        /// Offset in bytes of the object's content in the file.
        offset: u64,
    },
    /// A step of the bake is estimated to need more memory at one time than the limit allows.
    Memory {
        /// The limit in bytes.
        limit: u64,
        /// Least limit in bytes with which the failed step could have continued.
        needed: u64,
    },
    /// The origin of the level is not finite.
    Origin,
    /// There are more objects, or more triangles of one object, than 32 bits can count.
    TooMany,
}

impl fmt::Display for LevelError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::File { path, kind } => write!(f, "{}: {kind}", path.display()),
            Self::Content { path, object, offset } => {
                write!(f, "{}: object {object}, at byte {offset}, is damaged", path.display())
            }
            Self::Memory { limit, needed } => {
                let mib = |bytes: u64| bytes.div_ceil(1 << 20);
                write!(f, "{} MiB of memory are too few: at least {} are needed", mib(*limit), mib(*needed))
            }
            Self::Origin => write!(f, "the origin of the level is not finite"),
            Self::TooMany => write!(f, "there are more objects than 32 bits count"),
        }
    }
}

impl std::error::Error for LevelError {}
