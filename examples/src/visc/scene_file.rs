//! VISC files: occluder triangles, occludee boxes and views in one file.
//!
//! All numbers are little endian: u32 magic; u32 number of triangles, 9 f32 each; u32 number of boxes, 6 f32
//! each; u32 number of views. A view has u32 width and height, 16 f32 of a column-major clip-from-world
//! matrix in OpenGL's convention, and 3 f32 of the eye. Every 12 triangles are the surface of one box.

use crate::error::SourceError;
use crate::ordinary_file;
use glam::Vec3;
use std::path::Path;
use visibility_core::{Aabb, View, scene::Triangle, view::Depth};

/// Magic number with which a VISC file begins: the letters VISC, read as a little-endian number.
pub const MAGIC: u32 = 0x4353_4956;

/// Contents of a VISC file, in world space.
#[derive(Clone, Debug, PartialEq)]
pub struct Visc {
    /// Triangles of all occluders, twelve to an occluder.
    pub triangles: Vec<Triangle>,
    /// Occludee boxes to be tested for visibility.
    pub boxes: Vec<Aabb>,
    /// Views, each with the width and height in pixels of its picture.
    pub views: Vec<(View, [u32; 2])>,
}

/// Reads occluders, boxes and views from a VISC file.
///
/// # Errors
///
/// Returns [`SourceError::Io`] when the file cannot be read, and the errors of [`parse`].
pub fn load(path: &Path) -> Result<Visc, SourceError> {
    parse(&ordinary_file::read(path).map_err(|cause| SourceError::io(path, cause))?, path)
}

/// Reader of little-endian numbers from the front of `bytes`, which shrinks with each number read.
pub(super) struct Reader<'a> {
    pub(super) bytes: &'a [u8],
    pub(super) path: &'a Path,
}

impl Reader<'_> {
    /// Reads a u32. `what` names the number in the error when fewer than four bytes remain.
    pub(super) fn u32(&mut self, what: &'static str) -> Result<u32, SourceError> {
        let Some((head, rest)) = self.bytes.split_first_chunk::<4>() else {
            return Err(SourceError::content(self.path, what, "the file ends before it"));
        };
        self.bytes = rest;
        Ok(u32::from_le_bytes(*head))
    }

    /// Reads the number of items of `bytes` bytes each. Returns an error when the rest of the file is too
    /// short for that many items.
    fn count(&mut self, what: &'static str, bytes: usize) -> Result<usize, SourceError> {
        let count = self.u32(what)? as usize;
        if count.checked_mul(bytes).is_none_or(|need| need > self.bytes.len()) {
            return Err(SourceError::content(self.path, what, format!("the file is too short for {count}")));
        }
        Ok(count)
    }

    fn floats<const N: usize>(&mut self, what: &'static str) -> Result<[f32; N], SourceError> {
        let mut out = [0.0; N];
        for value in &mut out {
            *value = f32::from_bits(self.u32(what)?);
        }
        Ok(out)
    }
}

/// Reads the bytes of a VISC file; `path` appears in error messages only.
///
/// # Errors
///
/// Returns [`SourceError::Content`] when the magic number is wrong, the file is too short for its counts, or
/// a matrix cannot be a view. Bytes after the last view are ignored.
pub fn parse(bytes: &[u8], path: &Path) -> Result<Visc, SourceError> {
    let mut reader = Reader { bytes, path };
    if reader.u32("magic")? != MAGIC {
        return Err(SourceError::content(path, "magic", "this is not a VISC file"));
    }
    let count = reader.count("triangles", 36)?;
    let mut triangles = Vec::with_capacity(count);
    for _ in 0..count {
        let v: [f32; 9] = reader.floats("triangles")?;
        triangles.push([0, 3, 6].map(|i| Vec3::new(v[i], v[i + 1], v[i + 2])));
    }
    let count = reader.count("boxes", 24)?;
    let mut boxes = Vec::with_capacity(count);
    for _ in 0..count {
        let [a, b, c, d, e, f] = reader.floats("boxes")?;
        boxes.push(Aabb::from_arrays([a, b, c], [d, e, f]));
    }
    let count = reader.count("views", 84)?;
    let mut views = Vec::with_capacity(count);
    for _ in 0..count {
        let size = [reader.u32("views")?, reader.u32("views")?];
        let matrix: [f32; 16] = reader.floats("views")?;
        let _eye: [f32; 3] = reader.floats("views")?;
        let view = View::from_clip_from_world(matrix, Depth::NegativeOneToOne)
            .map_err(|error| SourceError::content(path, "views", error.to_string()))?;
        views.push((view, size));
    }
    Ok(Visc { triangles, boxes, views })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn short_and_foreign_files_are_refused() {
        let path = Path::new("some.visc");
        assert!(parse(&[], path).is_err(), "an empty file");
        assert!(parse(&[0; 64], path).is_err(), "a file of zeros");
        let mut claims = MAGIC.to_le_bytes().to_vec();
        claims.extend(u32::MAX.to_le_bytes());
        assert!(parse(&claims, path).is_err(), "a file that claims more than it holds");
    }
}
