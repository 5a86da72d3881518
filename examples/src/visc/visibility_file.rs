//! VISB files: which boxes are visible in each view.
//!
//! All numbers are little endian: u32 magic, u32 number of views, u32 number of boxes. Then each view has one
//! bit per box, least significant bit first, in whole bytes; 1 means visible.

use super::scene_file::Reader;
use crate::error::SourceError;
use crate::ordinary_file;
use std::path::Path;

/// Magic number with which a VISB file begins: the letters VISB, read as a little-endian number.
pub const MAGIC: u32 = 0x4253_4956;

/// Answers of a VISB file: for each view, for each box, whether the box is visible.
pub type Visb = Vec<Vec<bool>>;

/// Reads which boxes are visible in each view from a VISB file.
///
/// # Errors
///
/// Returns [`SourceError::Io`] when the file cannot be read, and the errors of [`parse`].
pub fn load(path: &Path) -> Result<Visb, SourceError> {
    parse(&ordinary_file::read(path).map_err(|cause| SourceError::io(path, cause))?, path)
}

/// Reads the bytes of a VISB file; `path` appears in error messages only.
///
/// # Errors
///
/// Returns [`SourceError::Content`] when the magic number is wrong, or the length is not that of the claimed
/// views and boxes.
pub fn parse(bytes: &[u8], path: &Path) -> Result<Visb, SourceError> {
    let mut reader = Reader { bytes, path };
    if reader.u32("magic")? != MAGIC {
        return Err(SourceError::content(path, "magic", "this is not a VISB file"));
    }
    let (views, boxes) = (reader.u32("views")? as usize, reader.u32("boxes")? as usize);
    let row = boxes.div_ceil(8);
    // Views without boxes would take no bytes, so a file could claim any number of them.
    if boxes == 0 && views > 0 || views.checked_mul(row).is_none_or(|need| need != reader.bytes.len()) {
        return Err(SourceError::content(
            path,
            "views",
            format!("{views} views of {boxes} boxes do not fill the file"),
        ));
    }
    let bits = |view: usize| {
        let row = &reader.bytes[view * row..(view + 1) * row];
        (0..boxes).map(|i| row[i / 8] >> (i % 8) & 1 != 0).collect()
    };
    Ok((0..views).map(bits).collect())
}

/// Returns the bytes of a VISB file. All views must have as many boxes as the first view; otherwise the file
/// would be malformed.
pub fn write(answer: &Visb) -> Vec<u8> {
    let boxes = answer.first().map_or(0, Vec::len);
    let mut out = Vec::new();
    for number in [MAGIC, answer.len() as u32, boxes as u32] {
        out.extend(number.to_le_bytes());
    }
    for view in answer {
        let byte =
            |bits: &[bool]| bits.iter().enumerate().fold(0u8, |byte, (i, bit)| byte | u8::from(*bit) << i);
        out.extend(view.chunks(8).map(byte));
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn answers_come_back_as_they_went() {
        let answer: Visb = vec![(0..19).map(|i| i % 3 == 0).collect(), vec![true; 19]];
        let bytes = write(&answer);
        assert_eq!(bytes.len(), 12 + 2 * 3, "bytes of two frames of 19 answers");
        assert_eq!(parse(&bytes, Path::new("some.visb")).unwrap(), answer, "the answers from their bytes");
        assert!(parse(&bytes[..13], Path::new("some.visb")).is_err(), "bytes that are cut off");
    }
}
