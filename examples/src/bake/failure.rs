//! Failures of the program `bake`.

use std::fmt;
use visibility_bake::LevelError;

/// Reason why a bake ended without a result.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Failure {
    /// The memory is too small. The message says how much is needed.
    Memory(String),
    /// Any other reason.
    Other(String),
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (Self::Memory(message) | Self::Other(message)) = self;
        f.write_str(message)
    }
}

impl From<String> for Failure {
    fn from(message: String) -> Self {
        Self::Other(message)
    }
}

impl From<LevelError> for Failure {
    fn from(error: LevelError) -> Self {
        match error {
            LevelError::Memory { .. } => Self::Memory(error.to_string()),
            other => Self::Other(other.to_string()),
        }
    }
}
