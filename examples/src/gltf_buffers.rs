//! Buffers of a glTF document, with typed reading that trusts no number in the document.
//!
//! A buffer is the binary chunk of a GLB, a base64 `data:` URI, or a file below the folder of the document;
//! other files and URIs are never opened. An accessor is checked against the bytes that are present before
//! memory is reserved, so its memory never exceeds the order of the file's size.

use crate::error::SourceError;
use glam::Vec3;
use gltf::accessor::{Accessor, DataType, Dimensions};
use gltf::buffer::Source;
use std::io::Read;
use std::path::{Component, Path, PathBuf};

/// Bytes of every buffer of a document, by buffer index, with the document's path for error messages.
pub(crate) struct Buffers<'a> {
    bytes: Vec<Vec<u8>>,
    path: &'a Path,
}

impl<'a> Buffers<'a> {
    /// Loads the buffers of a document. `chunk` is the binary chunk of a GLB, `None` for a glTF file; `path`
    /// is the path of the document, to which URIs are relative. Returns an error when a buffer is missing,
    /// not permitted or shorter than the document claims.
    pub(crate) fn load(
        document: &gltf::Document,
        chunk: Option<Vec<u8>>,
        path: &'a Path,
    ) -> Result<Self, SourceError> {
        let mut chunk = chunk;
        let mut bytes = Vec::new();
        for buffer in document.buffers() {
            let place = format!("buffer {}", buffer.index());
            let wrong = |problem: String| SourceError::content(path, &place, problem);
            let data = match buffer.source() {
                Source::Bin => chunk.take().ok_or_else(|| wrong("there is no binary chunk for it".into()))?,
                Source::Uri(uri) => match uri.strip_prefix("data:") {
                    Some(rest) => data_uri(rest).map_err(wrong)?,
                    None => file_below(path, uri, buffer.length()).map_err(wrong)?,
                },
            };
            if data.len() < buffer.length() {
                return Err(wrong(format!(
                    "{} bytes are claimed, {} are there",
                    buffer.length(),
                    data.len()
                )));
            }
            bytes.push(data);
        }
        Ok(Self { bytes, path })
    }

    /// Reads the vertex positions of an accessor, in mesh space. Returns an error unless the elements are
    /// vectors of three f32 within the accessor's buffer view. NaN and infinities are kept.
    pub(crate) fn positions(&self, accessor: &Accessor<'_>) -> Result<Vec<Vec3>, SourceError> {
        if (accessor.data_type(), accessor.dimensions()) != (DataType::F32, Dimensions::Vec3) {
            return Err(self.wrong(accessor, "positions must be vectors of 3 f32"));
        }
        let number = |b: &[u8]| f32::from_le_bytes([b[0], b[1], b[2], b[3]]);
        let point = |b: &[u8]| Vec3::new(number(b), number(&b[4..]), number(&b[8..]));
        Ok(self.elements(accessor)?.map(point).collect())
    }

    /// Reads the vertex indices of an accessor. Returns an error unless the elements are unsigned scalars of
    /// 8, 16 or 32 bits within the accessor's buffer view.
    pub(crate) fn indices(&self, accessor: &Accessor<'_>) -> Result<Vec<u32>, SourceError> {
        let index: fn(&[u8]) -> u32 = match (accessor.data_type(), accessor.dimensions()) {
            (DataType::U8, Dimensions::Scalar) => |b| u32::from(b[0]),
            (DataType::U16, Dimensions::Scalar) => |b| u32::from(u16::from_le_bytes([b[0], b[1]])),
            (DataType::U32, Dimensions::Scalar) => |b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]),
            _ => return Err(self.wrong(accessor, "indices must be unsigned whole numbers")),
        };
        Ok(self.elements(accessor)?.map(index).collect())
    }

    /// Makes the error for a problem of an accessor, which the error names by its index.
    fn wrong(&self, accessor: &Accessor<'_>, problem: impl Into<String>) -> SourceError {
        let place = format!("accessor {}", accessor.index());
        SourceError::content(self.path, place, problem)
    }

    /// Returns the bytes of each element of an accessor; every slice has the length of one element. Returns
    /// an error for sparse accessors, accessors beyond their buffer view or buffer, and strides shorter than
    /// an element.
    fn elements(&self, accessor: &Accessor<'_>) -> Result<impl ExactSizeIterator<Item = &[u8]>, SourceError> {
        if accessor.sparse().is_some() {
            return Err(self.wrong(accessor, "sparse accessors are not read"));
        }
        let view = accessor.view().ok_or_else(|| self.wrong(accessor, "it has no buffer view"))?;
        let too_far = || self.wrong(accessor, "it reaches beyond its buffer view");

        let buffer: &[u8] = self.bytes.get(view.buffer().index()).map_or(&[], |b| b);
        let view_bytes = view
            .offset()
            .checked_add(view.length())
            .and_then(|end| buffer.get(view.offset()..end))
            .ok_or_else(|| {
                let place = format!("buffer view {}", view.index());
                SourceError::content(self.path, place, "it reaches beyond its buffer")
            })?;

        let size = accessor.size();
        let stride = view.stride().unwrap_or(size);
        // Overlapping elements could make the result larger than the file.
        if stride < size {
            return Err(self.wrong(accessor, "its stride is shorter than an element"));
        }
        let count = accessor.count();
        let span = match count.checked_sub(1) {
            None => 0,
            Some(last) => {
                last.checked_mul(stride).and_then(|start| start.checked_add(size)).ok_or_else(too_far)?
            }
        };
        let bytes = accessor
            .offset()
            .checked_add(span)
            .and_then(|end| view_bytes.get(accessor.offset()..end))
            .ok_or_else(too_far)?;
        // The last element need not be padded to the stride, so the last chunk may be shorter than the
        // stride.
        Ok(bytes.chunks(stride).map(move |chunk| &chunk[..size]))
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
/// error unless the file, with symbolic links resolved, is a regular file below the folder of `document`.
fn file_below(document: &Path, uri: &str, length: usize) -> Result<Vec<u8>, String> {
    let relative = percent_decoded(uri)?;
    let refused = |why: &str| format!("the file `{uri}` is not opened: {why}");
    // A colon would be part of a scheme (`file:`, `https:`) or a drive.
    if relative.as_os_str().to_string_lossy().contains(':') {
        return Err(refused("only relative paths and data URIs are read"));
    }
    let inside = relative.components().all(|part| matches!(part, Component::Normal(_) | Component::CurDir));
    if !inside {
        return Err(refused("it is not below the document's folder"));
    }
    let folder = match document.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    let unreadable = |cause: std::io::Error| format!("cannot read the file `{uri}`: {cause}");
    let folder = folder.canonicalize().map_err(unreadable)?;
    // `canonicalize` follows symbolic links, so the target must be checked as well.
    let file = folder.join(relative).canonicalize().map_err(unreadable)?;
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
            assert_eq!(base64(text).expect(text), bytes);
        }
        assert!(base64("TWFuT").is_err());
        assert!(base64("TW!u").is_err());
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
        let here = file_below(document, "li%62.rs", 3).expect("a file of this crate");
        assert_eq!(here, b"//!");
    }
}
