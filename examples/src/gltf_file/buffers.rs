//! Buffers of a glTF document, with typed reading that checks every number of the document.
//!
//! A buffer is the binary chunk of a GLB, a base64 `data:` URI, or a file below the folder of the document;
//! other files and URIs are never opened. A file is read once, however many buffers name it.
//!
//! Before memory is reserved for an accessor, it is checked against the bytes that are present. A compressed
//! view is decoded when an accessor first needs it, and once, however many views have the same compressed
//! bytes. All decoded views together have at most as many compressed bytes as the buffers have. So the memory
//! is at most proportional to the size of the files, or to 1,024 times that size if they are compressed.

use super::meshopt::Compressed;
use crate::error::SourceError;
use crate::ordinary_file;
use base64::Engine;
use base64::alphabet::STANDARD;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};
use glam::Vec3;
use gltf::accessor::sparse::IndexType;
use gltf::accessor::{Accessor, DataType, Dimensions};
use gltf::buffer::{Source, View};
use std::borrow::Cow;
use std::cell::{Cell, OnceCell};
use std::collections::HashMap;
use std::io::Read;
use std::path::{Component, Path, PathBuf};
use std::rc::Rc;

/// Buffers of a document, with the document's path for error messages.
pub(super) struct Buffers<'a> {
    /// Bytes of each buffer, or the reason why it cannot be read. A missing buffer is only an error when it
    /// is needed.
    bytes: Vec<Result<Rc<Cow<'a, [u8]>>, String>>,
    /// Compression of each buffer view, or what is wrong with it. `None` for a view that is not compressed.
    compressed: Vec<Option<Result<Rc<CompressedView>, String>>>,
    /// Number of compressed bytes that may still be decoded: at first the size of all buffers.
    left_to_decode: Cell<usize>,
    /// Number of bytes that decoded views may still have: at first [`MOST_DECODED`].
    left_decoded: Cell<usize>,
    /// Number of accessor elements read so far, at most [`MOST_READ`].
    read: Cell<usize>,
    path: &'a Path,
}

/// Compressed buffer view. Views with the same parameters share it.
struct CompressedView {
    parameters: Compressed,
    /// Decoded bytes, or the reason why they cannot be decoded. Unset until an accessor needs them.
    decoded: OnceCell<Result<Vec<u8>, String>>,
}

/// Maximum number of bytes of all decoded views: 64 bytes for each of 2^25 vertices.
const MOST_DECODED: usize = 1 << 31;

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
        let (mut chunk, mut files, mut size) = (chunk, HashMap::new(), 0);
        // Buffers that name the same file share its bytes, as many as the longest of them claims.
        let longest = document.buffers().map(|buffer| buffer.length()).max().unwrap_or_default();
        let mut load = |source: Source<'_>| -> Result<_, String> {
            let (file, bytes) = match source {
                Source::Bin => (None, Cow::Borrowed(chunk.take().ok_or("there is no binary chunk for it")?)),
                Source::Uri(uri) => match uri.strip_prefix("data:") {
                    Some(rest) => (None, Cow::Owned(data_uri(rest)?)),
                    None => {
                        let file = file_below(path, uri)?;
                        if let Some(known) = files.get(&file) {
                            return Ok(Rc::clone(known));
                        }
                        let bytes = first_bytes(&file, longest).map_err(|cause| unreadable(uri, &cause))?;
                        (Some(file), Cow::Owned(bytes))
                    }
                },
            };
            size += bytes.len();
            let bytes = Rc::new(bytes);
            files.extend(file.map(|file| (file, bytes.clone())));
            Ok(bytes)
        };
        let bytes = document.buffers().map(|buffer| {
            let bytes = load(buffer.source())?;
            if bytes.len() < buffer.length() {
                return Err(format!("{} bytes are claimed, {} are there", buffer.length(), bytes.len()));
            }
            Ok(bytes)
        });
        let bytes: Vec<Result<Rc<_>, String>> = bytes.collect();
        // For each buffer, the first buffer with the same bytes, so that views of two names of one file are
        // found to be the same.
        let mut firsts = HashMap::new();
        let first = |(index, bytes): (usize, &Result<Rc<_>, _>)| match bytes {
            Ok(bytes) => *firsts.entry(Rc::as_ptr(bytes)).or_insert(index),
            Err(_) => index,
        };
        let first: Vec<usize> = bytes.iter().enumerate().map(first).collect();
        let mut views = HashMap::new();
        let compressed = document.views().map(|view| {
            let extensions = ["EXT_meshopt_compression", "KHR_meshopt_compression"];
            let extension = extensions.iter().find_map(|name| view.extension_value(name))?;
            Some(Compressed::new(extension).map(|mut parameters| {
                parameters.buffer = first.get(parameters.buffer).copied().unwrap_or(parameters.buffer);
                let new = || CompressedView { parameters: parameters.clone(), decoded: OnceCell::new() };
                Rc::clone(views.entry(parameters.clone()).or_insert_with(|| Rc::new(new())))
            }))
        });
        let compressed = compressed.collect();
        let (left_to_decode, left_decoded) = (Cell::new(size), Cell::new(MOST_DECODED));
        Self { bytes, compressed, left_to_decode, left_decoded, read: Cell::new(0), path }
    }

    /// Returns the bytes of a compressed view, which are decoded when they are first asked for. The error is
    /// a message for a person.
    fn decoded<'s>(&'s self, view: &'s CompressedView) -> Result<&'s [u8], &'s str> {
        let decode = || -> Result<_, String> {
            let Compressed { buffer, offset, length, .. } = view.parameters;
            let buffer = self.bytes.get(buffer).ok_or("it is compressed in no buffer")?;
            let buffer = buffer.as_ref().map_err(Clone::clone)?;
            let bytes = offset.checked_add(length).and_then(|end| buffer.get(offset..end));
            let bytes = bytes.ok_or("its compressed bytes reach beyond their buffer")?;
            let left = self.left_to_decode.get().checked_sub(length);
            self.left_to_decode
                .set(left.ok_or("with it, more compressed bytes would be decoded than the buffers have")?);
            let left = self.left_decoded.get().checked_sub(view.parameters.size());
            self.left_decoded.set(left.ok_or_else(|| {
                format!("with it, more than {MOST_DECODED} bytes of compressed views would be decoded")
            })?);
            view.parameters.decode(bytes)
        };
        view.decoded.get_or_init(decode).as_deref().map_err(String::as_str)
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
    /// 8, 16 or 32 bits within the accessor's buffer view, and for the greatest number of these bits: it
    /// begins another strip for a renderer, and glTF does not allow it.
    pub(super) fn indices(&self, accessor: &Accessor<'_>) -> Result<Vec<u32>, SourceError> {
        let (index, greatest): (fn(&[u8]) -> u32, u32) = match (accessor.data_type(), accessor.dimensions()) {
            (DataType::U8, Dimensions::Scalar) => (|b| b[0].into(), u8::MAX.into()),
            (DataType::U16, Dimensions::Scalar) => {
                (|b| u16::from_le_bytes([b[0], b[1]]).into(), u16::MAX.into())
            }
            (DataType::U32, Dimensions::Scalar) => {
                (|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]), u32::MAX)
            }
            _ => return Err(self.wrong(accessor, "indices must be unsigned whole numbers")),
        };
        let indices: Vec<u32> = self.elements(accessor, MOST_ZEROS)?.iter().map(index).collect();
        if indices.contains(&greatest) {
            return Err(self.wrong(accessor, format!("index {greatest} is reserved, and no vertex")));
        }
        Ok(indices)
    }

    /// Makes an error that names the accessor by its index, with a description of the problem.
    pub(super) fn wrong(&self, accessor: &Accessor<'_>, problem: impl Into<String>) -> SourceError {
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
        let view_bytes = match self.compressed.get(view.index()) {
            Some(Some(compressed)) => {
                let compressed = compressed.as_ref().map_err(|problem| of_view(problem))?;
                self.decoded(compressed).map_err(of_view)?
            }
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
    let config = GeneralPurposeConfig::new().with_decode_padding_mode(DecodePaddingMode::Indifferent);
    let engine = GeneralPurpose::new(&STANDARD, config.with_decode_allow_trailing_bits(true));
    engine.decode(text).map_err(|error| format!("the data is not base64: {error}"))
}

/// Returns the path, without symbolic links, of the file that a relative URI names. Returns a message as the
/// error unless it is below the folder of `document`.
fn file_below(document: &Path, uri: &str) -> Result<PathBuf, String> {
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
    let folder = folder.canonicalize().map_err(|cause| unreadable(uri, &cause))?;
    // `canonicalize` follows symbolic links, so the target must be checked as well.
    let file = folder.join(below).canonicalize().map_err(|cause| unreadable(uri, &cause))?;
    if !file.starts_with(&folder) {
        return Err(refused("it leads out of the document's folder"));
    }
    Ok(file)
}

/// Reads at most the first `length` bytes of a file.
fn first_bytes(file: &Path, length: usize) -> std::io::Result<Vec<u8>> {
    let open = ordinary_file::open(file)?;
    let length = open.metadata()?.len().min(length as u64);
    let mut bytes = Vec::new();
    bytes.try_reserve_exact(length as usize)?;
    open.take(length).read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// Returns a message that says why the file that a URI names cannot be read.
fn unreadable(uri: &str, cause: &std::io::Error) -> String {
    format!("cannot read the file `{uri}`: {cause}")
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
        let document = gltf::Document::from_json_without_validation(gltf::json::Root::default());
        let buffers = Buffers::load(&document, None, Path::new("test.gltf"));
        let charge = |count| buffers.charge(count, String::new);
        assert!(charge(MOST_READ - 1).is_ok(), "nearly all that may be read");
        buffers.uncharged(|| {
            assert!(charge(MOST_READ).is_ok() && charge(1).is_err(), "as much again, and no more");
        });
        assert!(charge(1).is_ok() && charge(1).is_err(), "one is left");
    }

    #[test]
    fn only_files_below_the_folder_are_opened() {
        let first_three = |uri| {
            let file = file_below(Path::new("src/scene.gltf"), uri)?;
            first_bytes(&file, 3).map_err(|cause| unreadable(uri, &cause))
        };
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
            assert!(first_three(uri).is_err(), "{uri}");
        }
        let around = first_three("no%20folder/./../lib.rs").expect("dots that stay in the folder");
        assert_eq!(around, b"//!", "the first bytes of a file whose path has dots");
        let here = first_three("li%62.rs").expect("a file of this crate");
        assert_eq!(here, b"//!", "the first bytes of a file whose name is escaped");
    }
}
