//! The elementary functions that Rust's `core` lacks.

pub(crate) use visibility_core::geometry::sqrt;
