//! Buffers of a glTF document, with typed reading that checks every number of the document.
//!
//! A buffer is the binary chunk of a GLB, a base64 `data:` URI, or a file below the folder of the document;
//! other files and URIs are never opened. Before memory is reserved for an accessor, it is checked against
//! the bytes that are present. So its memory is at most proportional to the size of the file, or to 64 times
//! that size if the file is compressed.

use super::meshopt::Compressed;
use crate::error::SourceError;
use glam::Vec3;
use gltf::accessor::sparse::IndexType;
use gltf::accessor::{Accessor, DataType, Dimensions};
use gltf::buffer::{Source, View};
use std::borrow::Cow;
use std::cell::Cell;
use std::io::Read;
use std::path::{Component, Path, PathBuf};

/// Buffers of a document, with the document's path for error messages.
pub(super) struct Buffers<'a> {
    /// Bytes of each buffer, or the reason why it cannot be read. A missing buffer is only an error when it
    /// is needed.
    bytes: Vec<Result<Cow<'a, [u8]>, String>>,
    /// Decompressed bytes of each buffer view, or the reason why they cannot be decoded. `None` for a view
    /// that is not compressed.
    decoded: Vec<Option<Result<Vec<u8>, String>>>,
    /// Number of accessor elements read so far, at most [`MOST_READ`].
    read: Cell<usize>,
    path: &'a Path,
}

/// Maximum number of accessor elements read in total. A thousand nodes may each read the same million
/// vertices, or copy them a million times, so the file's size does not bound the work.
const MOST_READ: usize = 1 << 27;

/// Maximum number of elements of an accessor without a buffer view, unless as many positions are in memory.
/// Its elements are zero and take no bytes of the file.
const MOST_ZEROS: usize = 1 << 20;

impl<'a> Buffers<'a> {
    /// Loads the buffers of a document. `chunk` is the binary chunk of a GLB, `None` for a glTF file; `path`
    /// is the path of the document, to which URIs are relative. A buffer that is missing, not permitted or
    /// shorter than the document claims is an error once it is read.
    pub(super) fn load(document: &gltf::Document, chunk: Option<&'a [u8]>, path: &'a Path) -> Self {
        let mut chunk = chunk;
        let bytes: Vec<_> = document
            .buffers()
            .map(|buffer| {
                let data = match buffer.source() {
                    Source::Bin => Cow::Borrowed(chunk.take().ok_or("there is no binary chunk for it")?),
                    Source::Uri(uri) => Cow::Owned(match uri.strip_prefix("data:") {
                        Some(rest) => data_uri(rest)?,
                        None => file_below(path, uri, buffer.length())?,
                    }),
                };
                if data.len() < buffer.length() {
                    return Err(format!("{} bytes are claimed, {} are there", buffer.length(), data.len()));
                }
                Ok(data)
            })
            .collect();
        let decode = |view: gltf::buffer::View<'_>| {
            let extensions = ["EXT_meshopt_compression", "KHR_meshopt_compression"];
            let extension = extensions.iter().find_map(|name| view.extension_value(name))?;
            Some(Compressed::new(extension).and_then(|compressed| {
                let buffer = bytes.get(compressed.buffer).ok_or("it is compressed in no buffer")?;
                let buffer = buffer.as_ref().map_err(Clone::clone)?;
                let end = compressed.offset.checked_add(compressed.length);
                let bytes = end.and_then(|end| buffer.get(compressed.offset..end));
                compressed.decode(bytes.ok_or("its compressed bytes reach beyond their buffer")?)
            }))
        };
        let decoded = document.views().map(decode).collect();
        Self { bytes, decoded, read: Cell::new(0), path }
    }

    /// Adds `count` elements to the number read. Returns an error that names `place` if the total exceeds
    /// [`MOST_READ`].
    pub(super) fn charge(&self, count: usize, place: impl FnOnce() -> String) -> Result<(), SourceError> {
        self.read.set(self.read.get().saturating_add(count));
        if self.read.get() <= MOST_READ {
            return Ok(());
        }
        let problem =
            format!("with it, more than {MOST_READ} vertices, indices and the like would have to be read");
        Err(SourceError::content(self.path, place(), problem))
    }

    /// Returns the result of `read`, whose elements do not add to the number read. `read` alone may read as
    /// many as all other reading.
    pub(super) fn uncharged<T>(&self, read: impl FnOnce() -> T) -> T {
        let before = self.read.replace(0);
        let result = read();
        self.read.set(before);
        result
    }

    /// Reads the displacements of a morph target like [`positions`](Self::positions). Only call this with as
    /// many positions in memory: an accessor without a buffer view may have any number of displacements.
    pub(super) fn displacements(&self, accessor: &Accessor<'_>) -> Result<Vec<Vec3>, SourceError> {
        let vectors = self.vectors_or_zeros::<3>(accessor, accessor.count())?;
        Ok(vectors.into_iter().map(Vec3::from_array).collect())
    }

    /// Reads the vertex positions of an accessor, in mesh space. Returns an error unless the elements are
    /// vectors of three numbers within the accessor's buffer view. NaN and infinities are kept.
    pub(super) fn positions(&self, accessor: &Accessor<'_>) -> Result<Vec<Vec3>, SourceError> {
        Ok(self.vectors::<3>(accessor)?.into_iter().map(Vec3::from_array).collect())
    }

    /// Reads the elements of an accessor as vectors of `N` numbers. Normalized integers become fractions as
    /// in the glTF specification. Returns an error unless the elements have `N` components and are within the
    /// accessor's buffer view. NaN and infinities are kept.
    pub(super) fn vectors<const N: usize>(
        &self,
        accessor: &Accessor<'_>,
    ) -> Result<Vec<[f32; N]>, SourceError> {
        self.vectors_or_zeros(accessor, MOST_ZEROS)
    }

    /// Reads vectors like [`vectors`](Self::vectors), at most `most_zeros` from an accessor without a buffer
    /// view.
    fn vectors_or_zeros<const N: usize>(
        &self,
        accessor: &Accessor<'_>,
        most_zeros: usize,
    ) -> Result<Vec<[f32; N]>, SourceError> {
        if accessor.dimensions().multiplicity() != N {
            return Err(self.wrong(accessor, format!("it must have vectors of {N} numbers")));
        }
        let component = component(accessor.data_type(), accessor.normalized());
        let size = accessor.data_type().size();
        let vector = |bytes: &[u8]| std::array::from_fn(|i| component(&bytes[i * size..]));
        Ok(self.elements(accessor, most_zeros)?.iter().map(vector).collect())
    }

    /// Reads the vertex indices of an accessor. Returns an error unless the elements are unsigned scalars of
    /// 8, 16 or 32 bits within the accessor's buffer view.
    pub(super) fn indices(&self, accessor: &Accessor<'_>) -> Result<Vec<u32>, SourceError> {
        let index: fn(&[u8]) -> u32 = match (accessor.data_type(), accessor.dimensions()) {
            (DataType::U8, Dimensions::Scalar) => |b| u32::from(b[0]),
            (DataType::U16, Dimensions::Scalar) => |b| u32::from(u16::from_le_bytes([b[0], b[1]])),
            (DataType::U32, Dimensions::Scalar) => |b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]),
            _ => return Err(self.wrong(accessor, "indices must be unsigned whole numbers")),
        };
        Ok(self.elements(accessor, MOST_ZEROS)?.iter().map(index).collect())
    }

    /// Makes an error that names the accessor by its index, with a description of the problem.
    fn wrong(&self, accessor: &Accessor<'_>, problem: impl Into<String>) -> SourceError {
        let place = format!("accessor {}", accessor.index());
        SourceError::content(self.path, place, problem)
    }

    /// Returns the elements of an accessor. Returns an error for accessors beyond their buffer view or
    /// buffer, strides shorter than an element, sparse elements beyond the accessor, and more than
    /// `most_zeros` elements without a buffer view.
    fn elements(&self, accessor: &Accessor<'_>, most_zeros: usize) -> Result<Elements<'_>, SourceError> {
        let (size, count) = (accessor.size(), accessor.count());
        let base = match accessor.view() {
            Some(view) => self.within(accessor, &view, accessor.offset(), size, count)?,
            None if count > most_zeros => {
                let problem = format!("it has {count} elements without a buffer view");
                return Err(self.wrong(accessor, problem));
            }
            None => Elements { bytes: Cow::Owned(vec![0; size * count]), size, stride: size },
        };
        self.charge(count, || format!("accessor {}", accessor.index()))?;
        let Some(sparse) = accessor.sparse() else { return Ok(base) };
        let (indices, values) = (sparse.indices(), sparse.values());
        let index_size = match indices.index_type() {
            IndexType::U8 => 1,
            IndexType::U16 => 2,
            IndexType::U32 => 4,
        };
        let places = self.within(accessor, &indices.view(), indices.offset(), index_size, sparse.count())?;
        let values = self.within(accessor, &values.view(), values.offset(), size, sparse.count())?;
        let mut bytes = base.iter().collect::<Vec<_>>().concat();
        for (place, value) in places.iter().zip(values.iter()) {
            let index = place.iter().rev().fold(0, |index, &byte| index << 8 | usize::from(byte));
            let at = bytes.get_mut(index.saturating_mul(size)..).and_then(|bytes| bytes.get_mut(..size));
            let Some(at) = at else {
                let problem = format!("sparse element {index} is beyond its {count} elements");
                return Err(self.wrong(accessor, problem));
            };
            at.copy_from_slice(value);
        }
        Ok(Elements { bytes: Cow::Owned(bytes), size, stride: size })
    }

    /// Returns `count` elements of `size` bytes, from a byte offset in a buffer view. Returns an error for
    /// elements beyond the view or its buffer, and for strides shorter than an element.
    fn within(
        &self,
        accessor: &Accessor<'_>,
        view: &View<'_>,
        offset: usize,
        size: usize,
        count: usize,
    ) -> Result<Elements<'_>, SourceError> {
        let too_far = || self.wrong(accessor, "it reaches beyond its buffer view");
        let of_view =
            |problem: &str| SourceError::content(self.path, format!("buffer view {}", view.index()), problem);
        let view_bytes = match self.decoded.get(view.index()) {
            Some(Some(decoded)) => decoded.as_deref().map_err(|problem| of_view(problem))?,
            _ => {
                let buffer: &[u8] = match self.bytes.get(view.buffer().index()) {
                    Some(Ok(bytes)) => bytes,
                    Some(Err(problem)) => {
                        let place = format!("buffer {}", view.buffer().index());
                        return Err(SourceError::content(self.path, place, problem));
                    }
                    None => &[],
                };
                let end = view.offset().checked_add(view.length());
                end.and_then(|end| buffer.get(view.offset()..end))
                    .ok_or_else(|| of_view("it reaches beyond its buffer"))?
            }
        };
        let stride = view.stride().unwrap_or(size);
        // Overlapping elements could make the result larger than the file.
        if stride < size {
            return Err(self.wrong(accessor, "its stride is shorter than an element"));
        }
        let span = match count.checked_sub(1) {
            None => 0,
            Some(last) => {
                last.checked_mul(stride).and_then(|start| start.checked_add(size)).ok_or_else(too_far)?
            }
        };
        let end = offset.checked_add(span);
        let bytes = end.and_then(|end| view_bytes.get(offset..end)).ok_or_else(too_far)?;
        Ok(Elements { bytes: Cow::Borrowed(bytes), size, stride })
    }
}

/// Raw bytes of an accessor's elements.
struct Elements<'a> {
    bytes: Cow<'a, [u8]>,
    /// Size of an element in bytes.
    size: usize,
    /// Bytes from the start of an element to that of the next, at least `size`.
    stride: usize,
}

impl Elements<'_> {
    /// Returns the bytes of each element; every slice has the length of one element. The last element need
    /// not be padded to the stride, so the last chunk may be shorter than the stride.
    fn iter(&self) -> impl Iterator<Item = &[u8]> {
        self.bytes.chunks(self.stride).map(|chunk| &chunk[..self.size])
    }
}

/// Returns the function that converts the component at the start of a byte slice to a float. An integer is
/// divided by the greatest number of its type if `normalized`.
fn component(data: DataType, normalized: bool) -> fn(&[u8]) -> f32 {
    match (data, normalized) {
        (DataType::F32, _) => |b| f32::from_le_bytes([b[0], b[1], b[2], b[3]]),
        (DataType::I8, true) => |b| (f32::from(b[0] as i8) / 127.0).max(-1.0),
        (DataType::I8, false) => |b| f32::from(b[0] as i8),
        (DataType::U8, true) => |b| f32::from(b[0]) / 255.0,
        (DataType::U8, false) => |b| f32::from(b[0]),
        (DataType::I16, true) => |b| (f32::from(i16::from_le_bytes([b[0], b[1]])) / 32767.0).max(-1.0),
        (DataType::I16, false) => |b| f32::from(i16::from_le_bytes([b[0], b[1]])),
        (DataType::U16, true) => |b| f32::from(u16::from_le_bytes([b[0], b[1]])) / 65535.0,
        (DataType::U16, false) => |b| f32::from(u16::from_le_bytes([b[0], b[1]])),
        (DataType::U32, true) => {
            |b| (f64::from(u32::from_le_bytes([b[0], b[1], b[2], b[3]])) / f64::from(u32::MAX)) as f32
        }
        (DataType::U32, false) => |b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]) as f32,
    }
}

/// Decodes a `data:` URI in base64. `rest` is the URI without its scheme. The error is a message for a
/// person.
fn data_uri(rest: &str) -> Result<Vec<u8>, String> {
    let (kind, data) = rest.split_once(',').ok_or("the data URI has no comma before its data")?;
    if !kind.ends_with(";base64") {
        return Err("the data URI is not in base64".into());
    }
    base64(data)
}

/// Decodes base64 text with or without `=` padding. The error is a message for a person.
fn base64(text: &str) -> Result<Vec<u8>, String> {
    let digits = text.trim_end_matches('=').as_bytes();
    let mut bytes = Vec::with_capacity(digits.len() / 4 * 3 + 2);
    for group in digits.chunks(4) {
        if group.len() == 1 {
            return Err("the base64 data ends within a byte".into());
        }
        let mut bits = 0_u32;
        for i in 0..4 {
            let value = group.get(i).map_or(Ok(0), |&digit| sextet(digit))?;
            bits = bits << 6 | value;
        }
        // Four digits give three bytes; a shorter last group gives one byte less than its number of digits.
        bytes.extend_from_slice(&bits.to_be_bytes()[1..group.len()]);
    }
    Ok(bytes)
}

/// Returns the value, 0 to 63, of a base64 digit, or a message for any other byte.
fn sextet(digit: u8) -> Result<u32, String> {
    let value = match digit {
        b'A'..=b'Z' => digit - b'A',
        b'a'..=b'z' => digit - b'a' + 26,
        b'0'..=b'9' => digit - b'0' + 52,
        b'+' => 62,
        b'/' => 63,
        _ => return Err(format!("the byte {digit:#04x} is not base64")),
    };
    Ok(u32::from(value))
}

/// Reads at most the first `length` bytes of the file that a relative URI names. Returns a message as the
/// error unless the path, after following symbolic links, is a regular file below the folder of `document`.
fn file_below(document: &Path, uri: &str, length: usize) -> Result<Vec<u8>, String> {
    let relative = percent_decoded(uri)?;
    let refused = |why: &str| format!("the file `{uri}` is not opened: {why}");
    // A colon would be part of a scheme (`file:`, `https:`) or a drive.
    if relative.as_os_str().to_string_lossy().contains(':') {
        return Err(refused("only relative paths and data URIs are read"));
    }
    let outside = || refused("it is not below the document's folder");
    let mut below = PathBuf::new();
    for part in relative.components() {
        match part {
            Component::Normal(part) => below.push(part),
            Component::CurDir => {}
            // `a/..` leads back to where it was. A path that leads above the folder is refused.
            Component::ParentDir if below.pop() => {}
            _ => return Err(outside()),
        }
    }
    let folder = match document.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    let unreadable = |cause: std::io::Error| format!("cannot read the file `{uri}`: {cause}");
    let folder = folder.canonicalize().map_err(unreadable)?;
    // `canonicalize` follows symbolic links, so the target must be checked as well.
    let file = folder.join(below).canonicalize().map_err(unreadable)?;
    if !file.starts_with(&folder) {
        return Err(refused("it leads out of the document's folder"));
    }
    if !file.is_file() {
        return Err(refused("it is no ordinary file"));
    }
    let mut bytes = Vec::new();
    std::fs::File::open(&file)
        .and_then(|open| open.take(length as u64).read_to_end(&mut bytes))
        .map_err(unreadable)?;
    Ok(bytes)
}

/// Decodes the %-escapes of a URI into a path. Returns a message as the error when an escape is malformed, or
/// the result is empty, not UTF-8 or contains a NUL.
fn percent_decoded(uri: &str) -> Result<PathBuf, String> {
    let mut bytes = Vec::with_capacity(uri.len());
    let mut rest = uri.as_bytes();
    while let Some((&first, after)) = rest.split_first() {
        rest = after;
        if first != b'%' {
            bytes.push(first);
            continue;
        }
        let code = after
            .get(..2)
            .and_then(|digits| std::str::from_utf8(digits).ok())
            .filter(|digits| digits.bytes().all(|digit| digit.is_ascii_hexdigit()))
            .and_then(|digits| u8::from_str_radix(digits, 16).ok())
            .ok_or_else(|| format!("the URI `{uri}` has a % without two hexadecimal digits"))?;
        bytes.push(code);
        rest = &after[2..];
    }
    let text = String::from_utf8(bytes).map_err(|_| format!("the URI `{uri}` is not UTF-8"))?;
    if text.contains('\0') || text.is_empty() {
        return Err(format!("the URI `{uri}` names no file"));
    }
    Ok(PathBuf::from(text))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_is_decoded() {
        let good: [(&str, &[u8]); 5] =
            [("", b""), ("TQ==", b"M"), ("TWE=", b"Ma"), ("TWFu", b"Man"), ("+/+/", &[0xfb, 0xff, 0xbf])];
        for (text, bytes) in good {
            assert_eq!(base64(text).expect(text), bytes, "{text} decoded");
        }
        assert!(base64("TWFuT").is_err(), "five digits");
        assert!(base64("TW!u").is_err(), "a digit that is none");
    }

    #[test]
    fn what_is_read_only_to_look_is_not_counted() {
        let (bytes, decoded, path) = (Vec::new(), Vec::new(), Path::new("test.gltf"));
        let buffers = Buffers { bytes, decoded, read: Cell::new(0), path };
        let charge = |count| buffers.charge(count, String::new);
        assert!(charge(MOST_READ - 1).is_ok(), "nearly all that may be read");
        buffers.uncharged(|| {
            assert!(charge(MOST_READ).is_ok() && charge(1).is_err(), "as much again, and no more");
        });
        assert!(charge(1).is_ok() && charge(1).is_err(), "one is left");
    }

    #[test]
    fn only_files_below_the_folder_are_opened() {
        let document = Path::new("src/scene.gltf");
        for uri in [
            "../Cargo.toml",
            "/etc/passwd",
            "a/../../Cargo.toml",
            "%2e%2e/Cargo.toml",
            "file:///etc/passwd",
            "https://example.org/a.bin",
            "%zz",
            "",
            "recipes",
        ] {
            assert!(file_below(document, uri, 10).is_err(), "{uri}");
        }
        let around =
            file_below(document, "no%20folder/./../lib.rs", 3).expect("dots that stay in the folder");
        assert_eq!(around, b"//!", "the first bytes of a file whose path has dots");
        let here = file_below(document, "li%62.rs", 3).expect("a file of this crate");
        assert_eq!(here, b"//!", "the first bytes of a file whose name is escaped");
    }
}
