//! The binary format of stored files: a header of 40 bytes with magic, version, length and checksum, then the
//! content.
//!
//! PVS, baked sets, occluders of levels and interrupted bakes are stored in this format. All numbers are
//! little-endian. Byte ranges are half-open:
//!
//! | bytes | content |
//! |---|---|
//! | 0 to 8 | magic: eight ASCII letters that name the format |
//! | 8 to 12 | version of the format |
//! | 12 to 16 | kind: which structure of that format |
//! | 16 to 24 | fingerprint: a hash of the input of the structure, or a number that the format defines |
//! | 24 to 32 | length of header and content together, in bytes |
//! | 32 to 40 | checksum: FNV-1a, in 64 bits, of all other bytes |
//! | 40 on | content |
//!
//! The checksum detects accidental damage. It does not protect against forgery: code that reads the content
//! must check each number.
//!
//! ```
//! use visibility_core::binary_format::{FormatError, Format, Reader, Writer};
//! const FORMAT: Format = Format { magic: *b"EXAMPLE.", version: 1 };
//! let mut writer = Writer::new(FORMAT, 0, 77);
//! writer.u32(2);
//! writer.u32s([5, 6]);
//! let stored = writer.finish();
//!
//! let mut reader = Reader::new(&stored, FORMAT)?;
//! reader.expect(0, 77)?;
//! let count = reader.u32()? as usize;
//! assert_eq!(reader.u32s(count)?, [5, 6]);
//! assert_eq!(reader.expect(0, 78), Err(FormatError::Fingerprint));
//! # Ok::<(), FormatError>(())
//! ```

use alloc::vec::Vec;
use core::fmt;
use glam::{DVec3, Vec3};

/// Size of the header, in bytes: the offset of the content.
pub const HEADER_LENGTH: usize = 40;

/// Magic and version, which identify a stored format.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Format {
    /// The first eight bytes of every file of this format.
    pub magic: [u8; 8],
    /// The only version of the format that can be read.
    pub version: u32,
}

/// The reason why stored bytes were refused.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[non_exhaustive]
pub enum FormatError {
    /// The bytes do not begin with the magic of the format, or are fewer than eight.
    Magic {
        /// Magic of the format that the reader was asked for.
        expected: [u8; 8],
    },
    /// The header has another version of the format.
    Version {
        /// Version of the format in the header.
        found: u32,
        /// The only version that can be read.
        expected: u32,
    },
    /// The header has another kind: the file holds another structure of the same format.
    Kind {
        /// Kind in the header: which structure of the format the file holds.
        found: u32,
        /// The kind requested by the caller.
        expected: u32,
    },
    /// The fingerprint in the header differs from the requested one: the structure was made from another
    /// input, or from an earlier state of the input.
    Fingerprint,
    /// The number of bytes differs from the length in the header, or is less than a header.
    Length {
        /// Number of bytes that the reader was given, header included.
        found: u64,
        /// Length in bytes, header included, according to the header; [`HEADER_LENGTH`] if the bytes are
        /// fewer than a header.
        expected: u64,
    },
    /// The checksum in the header does not match the bytes: they were damaged.
    Checksum,
    /// The content is inconsistent although the checksum matches: the bytes were forged, or written by faulty
    /// code.
    Content {
        /// Offset in bytes from the start of the file (header included) up to which the content had been
        /// read when the problem was found.
        offset: usize,
        /// Description of the inconsistency, in English.
        problem: &'static str,
    },
}

impl fmt::Display for FormatError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Magic { expected } => {
                write!(f, "the bytes do not begin with \"{}\"", expected.escape_ascii())
            }
            Self::Version { found, expected } => {
                let then = if found < expected { "bake again" } else { "it is of a later release" };
                write!(f, "version {found} of the format, where only version {expected} is known: {then}")
            }
            Self::Kind { found, expected } => {
                write!(f, "a structure of kind {found}, where one of kind {expected} is expected")
            }
            Self::Fingerprint => write!(f, "it was made from something else, or from an earlier state of it"),
            Self::Length { found, expected } => write!(f, "{found} bytes, where {expected} are expected"),
            Self::Checksum => write!(f, "the checksum is wrong: the bytes were damaged"),
            Self::Content { offset, problem } => write!(f, "at byte {offset}: {problem}"),
        }
    }
}

impl core::error::Error for FormatError {}

/// An FNV-1a hash (Fowler, Noll and Vo) of a sequence of 32-bit numbers, in 64 bits. Identifies the input
/// that a structure was made from. Not cryptographic.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Fingerprint(u64);

impl Fingerprint {
    /// Returns the hash of an empty sequence.
    #[expect(clippy::new_without_default, reason = "a hash is begun, not defaulted to")]
    pub const fn new() -> Self {
        Self(0xcbf2_9ce4_8422_2325)
    }

    /// Returns the hash of the sequence with `number` appended.
    #[must_use]
    pub const fn with(self, number: u32) -> Self {
        Self((self.0 ^ number as u64).wrapping_mul(0x0100_0000_01b3))
    }

    /// Returns the hash of the sequence with the lower and then the upper 32 bits of `number` appended.
    #[must_use]
    pub const fn with_u64(self, number: u64) -> Self {
        self.with(number as u32).with((number >> 32) as u32)
    }

    /// Returns the hash of the sequence with the bits of x, y and z appended.
    #[must_use]
    pub fn with_vec3(self, p: Vec3) -> Self {
        p.to_array().iter().fold(self, |hash, x| hash.with(x.to_bits()))
    }

    /// Returns the hash of the sequence with the bits of x, y and z appended, as
    /// [`with_u64`](Self::with_u64) does.
    #[must_use]
    pub fn with_dvec3(self, p: DVec3) -> Self {
        p.to_array().iter().fold(self, |hash, x| hash.with_u64(x.to_bits()))
    }

    /// Returns the hash as a number, for [`Writer::new`] and [`Reader::expect`].
    pub const fn value(self) -> u64 {
        self.0
    }
}

/// Returns the checksum of a whole file: the hash of all its bytes except bytes `32..40`, the checksum field.
/// Panics if `bytes` is shorter than [`HEADER_LENGTH`].
fn checksum(bytes: &[u8]) -> u64 {
    let all = bytes[..32].iter().chain(&bytes[HEADER_LENGTH..]);
    all.fold(Fingerprint::new(), |hash, &byte| hash.with(byte.into())).value()
}

/// Appends a number with seven bits a byte, least significant first; the top bit is set on all bytes but the
/// last. For lists of small numbers.
///
/// ```
/// use visibility_core::binary_format::{push_number, take_number};
/// let mut bytes = Vec::new();
/// push_number(300, &mut bytes);
/// push_number(7, &mut bytes);
/// assert_eq!(bytes, [0xac, 2, 7]);
/// let mut rest = &bytes[..];
/// assert_eq!([(); 3].map(|()| take_number(&mut rest)), [Some(300), Some(7), None]);
/// ```
pub fn push_number(mut number: u32, to: &mut Vec<u8>) {
    while number >= 0x80 {
        to.push(number as u8 | 0x80);
        number >>= 7;
    }
    to.push(number as u8);
}

/// Reads a number that [`push_number`] has written at the front of `bytes`, and advances `bytes` past it.
/// `None`, with `bytes` unspecified, if the bytes end within the number, if it exceeds 32 bits, or if it is
/// not written in its fewest bytes.
#[inline]
pub fn take_number(bytes: &mut &[u8]) -> Option<u32> {
    let (&first, rest) = bytes.split_first()?;
    *bytes = rest;
    if first & 0x80 == 0 {
        return Some(first.into());
    }
    let mut number = u32::from(first & 0x7f);
    for shift in [7, 14, 21, 28] {
        let (&next, rest) = bytes.split_first()?;
        *bytes = rest;
        number |= u32::from(next & 0x7f) << shift;
        if next & 0x80 == 0 {
            return (next != 0 && (shift < 28 || next < 0x10)).then_some(number);
        }
    }
    None
}

/// Writes a file of this format to memory, number by number.
#[derive(Clone, Debug)]
pub struct Writer {
    bytes: Vec<u8>,
}

impl Writer {
    /// Starts a file with empty content. The format defines the meaning of `kind` and `fingerprint`.
    pub fn new(format: Format, kind: u32, fingerprint: u64) -> Self {
        let mut writer = Self { bytes: format.magic.to_vec() };
        writer.u32s([format.version, kind]);
        writer.u64(fingerprint);
        // Length and checksum are filled in by `finish`.
        writer.bytes.resize(HEADER_LENGTH, 0);
        writer
    }

    /// Appends a 32-bit number to the content.
    pub fn u32(&mut self, number: u32) {
        self.bytes.extend_from_slice(&number.to_le_bytes());
    }

    /// Appends a 64-bit number to the content.
    pub fn u64(&mut self, number: u64) {
        self.bytes.extend_from_slice(&number.to_le_bytes());
    }

    /// Appends 32-bit numbers to the content, without their count.
    pub fn u32s(&mut self, numbers: impl IntoIterator<Item = u32>) {
        self.bytes.extend(numbers.into_iter().flat_map(u32::to_le_bytes));
    }

    /// Appends 64-bit numbers to the content, without their count.
    pub fn u64s(&mut self, numbers: impl IntoIterator<Item = u64>) {
        self.bytes.extend(numbers.into_iter().flat_map(u64::to_le_bytes));
    }

    /// Appends bytes to the content, without their count.
    pub fn bytes(&mut self, bytes: &[u8]) {
        self.bytes.extend_from_slice(bytes);
    }

    /// Fills in length and checksum and returns the bytes of the file.
    pub fn finish(mut self) -> Vec<u8> {
        let length = self.bytes.len() as u64;
        self.bytes[24..32].copy_from_slice(&length.to_le_bytes());
        let sum = checksum(&self.bytes);
        self.bytes[32..HEADER_LENGTH].copy_from_slice(&sum.to_le_bytes());
        self.bytes
    }
}

/// Reads the content of a file from its first byte to its last. Compares a count of numbers to read with the
/// bytes left before it allocates memory for them, so that a forged count cannot exhaust memory.
#[derive(Clone, Debug)]
pub struct Reader<'a> {
    all: &'a [u8],
    offset: usize,
    kind: u32,
    fingerprint: u64,
}

impl<'a> Reader<'a> {
    /// Checks magic, version, length and checksum, and starts reading at the first byte of the content. Time
    /// is linear in the number of bytes. Kind and fingerprint are checked by [`expect`](Self::expect).
    ///
    /// # Errors
    /// In this order: [`FormatError::Magic`], [`FormatError::Length`] if there are fewer than
    /// [`HEADER_LENGTH`] bytes, [`FormatError::Version`], [`FormatError::Length`] if the header announces
    /// another length, [`FormatError::Checksum`].
    pub fn new(bytes: &'a [u8], format: Format) -> Result<Self, FormatError> {
        if !bytes.starts_with(&format.magic) {
            return Err(FormatError::Magic { expected: format.magic });
        }
        let length = |expected| FormatError::Length { found: bytes.len() as u64, expected };
        if bytes.len() < HEADER_LENGTH {
            return Err(length(HEADER_LENGTH as u64));
        }
        let mut reader = Self { all: bytes, offset: 8, kind: 0, fingerprint: 0 };
        let version = reader.u32()?;
        if version != format.version {
            return Err(FormatError::Version { found: version, expected: format.version });
        }
        (reader.kind, reader.fingerprint) = (reader.u32()?, reader.u64()?);
        let (expected, sum) = (reader.u64()?, reader.u64()?);
        if expected != bytes.len() as u64 {
            return Err(length(expected));
        }
        if checksum(bytes) != sum {
            return Err(FormatError::Checksum);
        }
        Ok(reader)
    }

    /// Returns the kind in the header, which tells the structures of one format apart.
    pub fn kind(&self) -> u32 {
        self.kind
    }

    /// Returns the fingerprint in the header, which the writer gave to [`Writer::new`].
    pub fn fingerprint(&self) -> u64 {
        self.fingerprint
    }

    /// Checks that the header has the given kind and fingerprint.
    ///
    /// # Errors
    /// [`FormatError::Kind`] if the kind differs, otherwise [`FormatError::Fingerprint`] if the
    /// fingerprint differs.
    pub fn expect(&self, kind: u32, fingerprint: u64) -> Result<(), FormatError> {
        if self.kind != kind {
            return Err(FormatError::Kind { found: self.kind, expected: kind });
        }
        if self.fingerprint != fingerprint {
            return Err(FormatError::Fingerprint);
        }
        Ok(())
    }

    /// Returns a [`FormatError::Content`] with the present read position and a description of the problem,
    /// for content that the caller finds inconsistent.
    pub fn content_error(&self, problem: &'static str) -> FormatError {
        FormatError::Content { offset: self.offset, problem }
    }

    /// Reads the next `count` bytes of the content.
    ///
    /// # Errors
    /// [`FormatError::Content`] if fewer than `count` bytes are left; then none is read.
    pub fn bytes(&mut self, count: usize) -> Result<&'a [u8], FormatError> {
        let rest = &self.all[self.offset..];
        let taken = rest.get(..count).ok_or_else(|| self.content_error("more is announced than there is"))?;
        self.offset += count;
        Ok(taken)
    }

    /// Reads the next 32-bit number of the content.
    ///
    /// # Errors
    /// [`FormatError::Content`] if fewer than four bytes are left; then none is read.
    pub fn u32(&mut self) -> Result<u32, FormatError> {
        Ok(self.bytes(4)?.iter().rev().fold(0, |number, &byte| number << 8 | u32::from(byte)))
    }

    /// Reads the next 64-bit number of the content.
    ///
    /// # Errors
    /// [`FormatError::Content`] if fewer than eight bytes are left; then the read position is unspecified.
    pub fn u64(&mut self) -> Result<u64, FormatError> {
        let [low, high] = [self.u32()?, self.u32()?];
        Ok(u64::from(low) | u64::from(high) << 32)
    }

    /// Reads the next `count` 32-bit numbers of the content.
    ///
    /// # Errors
    /// [`FormatError::Content`] if fewer than `count` are left; then none is read.
    pub fn u32s(&mut self, count: usize) -> Result<Vec<u32>, FormatError> {
        let bytes = self.bytes(count.saturating_mul(4))?;
        Ok(bytes.chunks_exact(4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect())
    }

    /// Reads the next `count` 64-bit numbers of the content.
    ///
    /// # Errors
    /// [`FormatError::Content`] if fewer than `count` are left; then none is read.
    pub fn u64s(&mut self, count: usize) -> Result<Vec<u64>, FormatError> {
        let bytes = self.bytes(count.saturating_mul(8))?;
        Ok(bytes.chunks_exact(8).map(|b| b.iter().rev().fold(0, |w, &b| w << 8 | u64::from(b))).collect())
    }

    /// Checks that all of the content was read.
    ///
    /// # Errors
    /// [`FormatError::Content`] if bytes are left.
    pub fn end(&self) -> Result<(), FormatError> {
        if self.offset < self.all.len() {
            Err(self.content_error("the content goes on after its end"))
        } else {
            Ok(())
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::string::ToString;

    const FORMAT: Format = Format { magic: *b"EXAMPLE.", version: 3 };

    fn sample() -> Vec<u8> {
        let mut writer = Writer::new(FORMAT, 5, 1 << 40);
        writer.bytes(b"abc");
        writer.u64s([u64::MAX, 1 << 33]);
        writer.finish()
    }

    #[test]
    fn every_damaged_missing_or_added_byte_is_noticed() {
        let good = sample();
        assert!(Reader::new(&good, FORMAT).is_ok(), "undamaged bytes are read");
        for i in 0..good.len() {
            let mut bytes = good.clone();
            bytes[i] ^= 1;
            assert!(Reader::new(&bytes, FORMAT).is_err(), "byte {i}");
            assert!(Reader::new(&good[..i], FORMAT).is_err(), "{i} bytes");
        }
        let empty = Writer::new(FORMAT, 5, 0).finish();
        assert!(Reader::new(&empty, FORMAT).is_ok_and(|reader| reader.end().is_ok()), "a header alone");
        let longer = [&good[..], &[0]].concat();
        assert_eq!(
            Reader::new(&longer, FORMAT).unwrap_err(),
            FormatError::Length { found: longer.len() as u64, expected: good.len() as u64 },
            "one byte too many is told apart from damage"
        );
    }

    #[test]
    fn numbers_have_one_form() {
        let mut bytes = Vec::new();
        let numbers = (0..32).flat_map(|bit| [(1u32 << bit) - 1, 1 << bit, u32::MAX >> bit]);
        for number in numbers.clone() {
            push_number(number, &mut bytes);
        }
        let mut rest = &bytes[..];
        for number in numbers {
            assert_eq!(
                take_number(&mut rest),
                Some(number),
                "numbers are read in the order in which they were written"
            );
        }
        assert!(rest.is_empty(), "{} bytes are left after all numbers were read", rest.len());
        let wrong: [&[u8]; 8] = [
            &[],
            &[0x80],
            &[0x80, 0],
            &[0xff, 0x80, 0],
            &[0xff, 0xff, 0xff, 0xff],
            &[0xff, 0xff, 0xff, 0xff, 0x10],
            &[0xff, 0xff, 0xff, 0xff, 0x8f, 0],
            &[0x80, 0x80, 0x80, 0x80, 0],
        ];
        for mut bytes in wrong {
            assert_eq!(take_number(&mut bytes), None, "{bytes:?}");
        }
        assert_eq!(
            take_number(&mut &[0xff, 0xff, 0xff, 0xff, 0xf][..]),
            Some(u32::MAX),
            "the largest number, in its longest form"
        );
    }

    #[test]
    fn errors_say_what_is_wrong_and_where() {
        let good = sample();
        let of = |magic, version| Reader::new(&good, Format { magic, version }).unwrap_err().to_string();
        assert_eq!(
            of(*b"EXAMPLES", 3),
            "the bytes do not begin with \"EXAMPLES\"",
            "the magic that was expected"
        );
        assert_eq!(
            of(FORMAT.magic, 4),
            "version 3 of the format, where only version 4 is known: bake again",
            "an older version is to be baked again"
        );
        let later = "version 3 of the format, where only version 2 is known: it is of a later release";
        assert_eq!(of(FORMAT.magic, 2), later, "a newer version is of a later release");
        let mut reader = Reader::new(&good, FORMAT).unwrap();
        assert_eq!(
            reader.expect(5, 1 << 40),
            Ok(()),
            "the kind and fingerprint that the bytes were written with"
        );
        assert_eq!(
            reader.expect(6, 0),
            Err(FormatError::Kind { found: 5, expected: 6 }),
            "another kind is refused before the fingerprint is looked at"
        );
        assert_eq!(
            reader.expect(5, 0),
            Err(FormatError::Fingerprint),
            "another fingerprint of the same kind"
        );
        assert_eq!(reader.bytes(3).unwrap(), b"abc", "the bytes that were written first");
        assert_eq!(
            reader.end().unwrap_err().to_string(),
            "at byte 43: the content goes on after its end",
            "the end is asked for while numbers are left"
        );
        assert_eq!(reader.u64s(2).unwrap(), [u64::MAX, 1 << 33], "the numbers that were written last");
        assert_eq!(reader.end(), Ok(()), "all content has been read");
        let short = FormatError::Content { offset: 59, problem: "more is announced than there is" };
        for count in [1, usize::MAX / 4, usize::MAX] {
            assert_eq!(
                reader.u32s(count),
                Err(short),
                "{count} numbers after the last one: refused before memory is taken"
            );
            assert_eq!(
                reader.u64s(count),
                Err(short),
                "{count} numbers after the last one: refused before memory is taken"
            );
        }
    }
}
