//! VSCN scene files: objects as counted lists of world-space triangles.
//!
//! All numbers are little endian: `u32` magic 0x4E435356 ("VSCN"), `u32` number of objects, then for each
//! object the `u32` number of triangles and nine `f32` per triangle. Counts are checked against the remaining
//! bytes before memory is reserved, so the memory of a scene is proportional to the size of the file.

use crate::error::SourceError;
use crate::source::SceneSource;
use glam::Vec3;
use std::path::Path;

/// First four bytes of a VSCN file: the letters VSCN, read as a little-endian number.
const MAGIC: u32 = 0x4E43_5356;
/// Size of a triangle in the file, in bytes.
const TRIANGLE_BYTES: usize = 36;
/// Size of a count in the file, in bytes.
const COUNT_BYTES: usize = 4;

/// Reads the triangles of a VSCN file, one list per object. `path` appears in error messages only. Vertices
/// are kept unchanged, NaN and infinities included.
///
/// # Errors
///
/// Returns [`SourceError::Content`] with the byte offset when the magic number is wrong, a count exceeds the
/// rest of the file, or bytes follow the last object.
pub fn parse(bytes: &[u8], path: &Path) -> Result<Vec<Vec<[Vec3; 3]>>, SourceError> {
    let mut reader = Reader { bytes, at: 0, path };
    let magic = reader.count("the magic number")?;
    if magic != MAGIC {
        return Err(reader.wrong(0, format!("the magic number is {magic:#010x}, not {MAGIC:#010x}")));
    }
    let place = reader.at;
    let objects = reader.count("the number of objects")? as usize;
    let room = reader.left() / COUNT_BYTES;
    if objects > room {
        return Err(reader.wrong(
            place,
            format!("{objects} objects are claimed, but the rest of the file holds at most {room}"),
        ));
    }
    // No capacity is reserved: a list takes more memory than the four bytes that a false count needs per
    // object.
    let mut scene = Vec::new();
    for index in 0..objects {
        scene.push(reader.object(index)?);
    }
    match reader.left() {
        0 => Ok(scene),
        extra => Err(reader
            .wrong(reader.at, format!("{extra} bytes follow the last object, where the file should end"))),
    }
}

/// Returns the bytes of a VSCN file with the scene's triangles. Names, walks and the other facts belong into
/// the JSON beside the file.
///
/// Returns `None` when the number of objects, or of triangles of an object, does not fit into 32 bits.
pub fn write(scene: &SceneSource) -> Option<Vec<u8>> {
    let size = 8 + scene.objects.len() * COUNT_BYTES + scene.triangle_count() * TRIANGLE_BYTES;
    let mut bytes = Vec::with_capacity(size);
    bytes.extend(MAGIC.to_le_bytes());
    bytes.extend(u32::try_from(scene.objects.len()).ok()?.to_le_bytes());
    for object in &scene.objects {
        bytes.extend(u32::try_from(object.triangles.len()).ok()?.to_le_bytes());
        let coordinates = object.triangles.iter().flatten().flat_map(Vec3::to_array);
        bytes.extend(coordinates.flat_map(f32::to_le_bytes));
    }
    Some(bytes)
}

/// Reader of a VSCN file; `at` is the offset of the next byte.
struct Reader<'a> {
    bytes: &'a [u8],
    at: usize,
    path: &'a Path,
}

impl<'a> Reader<'a> {
    /// Returns the number of bytes that are not read yet.
    fn left(&self) -> usize {
        self.bytes.len() - self.at
    }

    /// Makes the error for a problem at a byte offset of the file.
    fn wrong(&self, offset: usize, problem: String) -> SourceError {
        SourceError::content(self.path, format!("byte {offset}"), problem)
    }

    /// Reads a u32. `what` names the number in the error when fewer than four bytes remain.
    fn count(&mut self, what: &str) -> Result<u32, SourceError> {
        let Some((head, _)) = self.bytes[self.at..].split_first_chunk() else {
            let left = self.left();
            return Err(
                self.wrong(self.at, format!("the file is cut short: {what} needs 4 bytes, {left} are left"))
            );
        };
        self.at += COUNT_BYTES;
        Ok(u32::from_le_bytes(*head))
    }

    /// Reads one object's triangles. Returns an error when their count exceeds the rest of the file.
    fn object(&mut self, index: usize) -> Result<Vec<[Vec3; 3]>, SourceError> {
        let place = self.at;
        let triangles = self.count(&format!("the number of triangles of object {index}"))? as usize;
        let room = self.left() / TRIANGLE_BYTES;
        if triangles > room {
            return Err(self.wrong(
                place,
                format!(
                    "object {index} claims {triangles} triangles, but the rest of the file holds at most {room}"
                ),
            ));
        }
        let size = triangles * TRIANGLE_BYTES;
        let data = &self.bytes[self.at..self.at + size];
        self.at += size;
        Ok(data.chunks_exact(TRIANGLE_BYTES).map(triangle).collect())
    }
}

/// Decodes a triangle from its 36 bytes: three vertices of three little-endian f32 each.
fn triangle(bytes: &[u8]) -> [Vec3; 3] {
    let mut numbers = bytes.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]]));
    let mut next = || numbers.next().unwrap_or_default();
    [(); 3].map(|()| Vec3::new(next(), next(), next()))
}
