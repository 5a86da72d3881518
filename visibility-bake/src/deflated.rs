//! Files in the binary format whose content is compressed with DEFLATE (RFC 1951).
//!
//! After the common header come the length of the content before compression in bytes, as `u64`, and the
//! compressed content. `miniz_oxide` compresses to the same bytes on every machine.

use miniz_oxide::deflate::compress_to_vec;
use miniz_oxide::inflate::decompress_to_vec_with_limit;
use visibility_core::binary_format::{Format, FormatError, HEADER_LENGTH, Reader, Writer};

/// Compression level of `miniz_oxide`, from 0 to 10. Level 10 takes disproportionately longer.
const LEVEL: u8 = 9;

/// Returns the bytes of a file of kind 0 with the compressed content of `plain`.
pub(crate) fn deflated(format: Format, fingerprint: u64, plain: Writer) -> Vec<u8> {
    let plain = plain.finish();
    let content = &plain[HEADER_LENGTH..];
    let mut to = Writer::new(format, 0, fingerprint);
    to.u64(content.len() as u64);
    to.bytes(&compress_to_vec(content, LEVEL));
    to.finish()
}

/// Returns the uncompressed bytes, with their header, of a file made by [`deflated`]. They take at most 1,032
/// times as much memory as `bytes`, the greatest ratio of DEFLATE.
///
/// # Errors
/// [`FormatError`] if the header has another format, if the content cannot be decompressed, or if its length
/// is not the announced one.
pub(crate) fn inflated(bytes: &[u8], format: Format) -> Result<Vec<u8>, FormatError> {
    let mut from = Reader::new(bytes, format)?;
    let length = from.u64()?;
    let compressed = from.bytes(bytes.len() - HEADER_LENGTH - 8)?;
    let limit = usize::try_from(length).unwrap_or(usize::MAX);
    let content = decompress_to_vec_with_limit(compressed, limit).ok();
    let content = content.filter(|content| content.len() == limit);
    let content = content.ok_or_else(|| from.content_error("the content cannot be decompressed"))?;
    let mut plain = Writer::new(format, from.kind(), from.fingerprint());
    plain.bytes(&content);
    Ok(plain.finish())
}

#[cfg(test)]
mod tests {
    use super::*;

    const FORMAT: Format = Format { magic: *b"EXAMPLE.", version: 3 };

    #[test]
    fn content_comes_back_and_a_wrong_length_is_refused() {
        let mut plain = Writer::new(FORMAT, 0, 7);
        plain.bytes(&[1; 1 << 20]);
        let file = deflated(FORMAT, 7, plain.clone());
        assert!(file.len() < 4000, "{}", file.len());
        assert_eq!(inflated(&file, FORMAT), Ok(plain.finish()), "the content inflated");
        for length in [0, (1 << 20) - 1, (1 << 20) + 1, u64::MAX] {
            let mut forged = Writer::new(FORMAT, 0, 7);
            forged.u64(length);
            forged.bytes(&file[HEADER_LENGTH + 8..]);
            assert!(inflated(&forged.finish(), FORMAT).is_err(), "{length}");
        }
    }
}
