//! VSCN scene files: objects as counted lists of world-space triangles.
//!
//! All numbers are little endian: `u32` magic 0x4E435356 ("VSCN"), `u32` number of objects, then for each
//! object the `u32` number of triangles and nine `f32` per triangle. Counts are checked against the remaining
//! bytes before memory is reserved, so the memory of a scene is proportional to the size of the file.

use crate::error::SourceError;
use crate::source::SceneSource;
use glam::Vec3;
use std::io::Read;
use std::path::Path;

/// First four bytes of a VSCN file: the letters VSCN, read as a little-endian number.
const MAGIC: u32 = 0x4E43_5356;
/// Size of a triangle in the file, in bytes.
const TRIANGLE_BYTES: u64 = 36;
/// Size of a count in the file, in bytes.
const COUNT_BYTES: u64 = 4;

/// Reads the triangles of a VSCN file, one list per object. `path` appears in error messages only. Vertices
/// are kept unchanged, NaN and infinities included.
///
/// # Errors
///
/// Returns [`SourceError::Content`] with the byte offset when the magic number is wrong, a count exceeds the
/// rest of the file, or bytes follow the last object.
pub fn parse(bytes: &[u8], path: &Path) -> Result<Vec<Vec<[Vec3; 3]>>, SourceError> {
    // No capacity is reserved for a count that may be false: an object takes four bytes in the file, and its
    // empty list takes more in memory.
    let mut scene = Vec::new();
    read(bytes, bytes.len() as u64, path, &mut |triangles| scene.push(triangles))?;
    Ok(scene)
}

/// Reads a VSCN file of `size` bytes, and passes the triangles of each object to `each` as soon as they are
/// read. Returns the number of objects. `path` appears in error messages only.
///
/// # Errors
///
/// Returns the errors of [`parse`], and [`SourceError::Io`] when the bytes cannot be read. Some objects may
/// have been passed on before.
pub fn read(
    from: impl Read,
    size: u64,
    path: &Path,
    each: &mut dyn FnMut(Vec<[Vec3; 3]>),
) -> Result<usize, SourceError> {
    let mut reader = Reader { from, size, at: 0, path };
    let magic = reader.count("the magic number")?;
    if magic != MAGIC {
        return Err(reader.wrong(0, format!("the magic number is {magic:#010x}, not {MAGIC:#010x}")));
    }
    let place = reader.at;
    let objects = reader.count("the number of objects")?;
    let room = reader.left() / COUNT_BYTES;
    if u64::from(objects) > room {
        return Err(reader.wrong(
            place,
            format!("{objects} objects are claimed, but the rest of the file holds at most {room}"),
        ));
    }
    for index in 0..objects {
        each(reader.object(index)?);
    }
    match reader.left() {
        0 => Ok(objects as usize),
        extra => Err(reader
            .wrong(reader.at, format!("{extra} bytes follow the last object, where the file should end"))),
    }
}

/// Returns the bytes of a VSCN file with the scene's triangles. Names, walks and other facts go into the JSON
/// file beside it.
///
/// Returns `None` when the number of objects, or of triangles of an object, does not fit into 32 bits.
pub fn write(scene: &SceneSource) -> Option<Vec<u8>> {
    let size = 8 + scene.objects.len() as u64 * COUNT_BYTES + scene.triangle_count() as u64 * TRIANGLE_BYTES;
    let mut bytes = Vec::with_capacity(size as usize);
    bytes.extend(MAGIC.to_le_bytes());
    bytes.extend(u32::try_from(scene.objects.len()).ok()?.to_le_bytes());
    for object in &scene.objects {
        bytes.extend(u32::try_from(object.triangles.len()).ok()?.to_le_bytes());
        let coordinates = object.triangles.iter().flatten().flat_map(|p| p.to_array());
        bytes.extend(coordinates.flat_map(f32::to_le_bytes));
    }
    Some(bytes)
}

/// Reader of a VSCN file of `size` bytes; `at` is the offset of the next byte.
struct Reader<'a, R> {
    from: R,
    size: u64,
    at: u64,
    path: &'a Path,
}

impl<R: Read> Reader<'_, R> {
    /// Returns the number of bytes that are not read yet.
    fn left(&self) -> u64 {
        self.size - self.at
    }

    /// Makes the error for a problem at a byte offset of the file.
    fn wrong(&self, offset: u64, problem: String) -> SourceError {
        SourceError::content(self.path, format!("byte {offset}"), problem)
    }

    /// Reads the next `N` bytes. The caller has checked that at least `N` bytes are left.
    fn take<const N: usize>(&mut self) -> Result<[u8; N], SourceError> {
        let mut bytes = [0; N];
        self.from.read_exact(&mut bytes).map_err(|cause| SourceError::io(self.path, cause))?;
        self.at += N as u64;
        Ok(bytes)
    }

    /// Reads a u32. `what` names the number in the error when fewer than four bytes remain.
    fn count(&mut self, what: &str) -> Result<u32, SourceError> {
        let left = self.left();
        if left < COUNT_BYTES {
            return Err(
                self.wrong(self.at, format!("the file is cut short: {what} needs 4 bytes, {left} are left"))
            );
        }
        self.take().map(u32::from_le_bytes)
    }

    /// Reads one object's triangles. Returns an error when their count exceeds the rest of the file.
    fn object(&mut self, index: u32) -> Result<Vec<[Vec3; 3]>, SourceError> {
        let place = self.at;
        let triangles = self.count(&format!("the number of triangles of object {index}"))?;
        let room = self.left() / TRIANGLE_BYTES;
        if u64::from(triangles) > room {
            return Err(self.wrong(
                place,
                format!(
                    "object {index} claims {triangles} triangles, but the rest of the file holds at most {room}"
                ),
            ));
        }
        let mut object = Vec::with_capacity(triangles as usize);
        for _ in 0..triangles {
            object.push(triangle(self.take::<{ TRIANGLE_BYTES as usize }>()?));
        }
        Ok(object)
    }
}

/// Decodes a triangle from its 36 bytes: three vertices of three little-endian f32 each.
fn triangle(bytes: [u8; TRIANGLE_BYTES as usize]) -> [Vec3; 3] {
    let mut numbers = bytes.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]]));
    let mut next = || numbers.next().unwrap_or_default();
    [(); 3].map(|()| Vec3::new(next(), next(), next()))
}
