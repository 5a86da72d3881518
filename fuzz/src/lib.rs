//! The fuzz targets. Each is a function from bytes to whether a reader accepted them, or what was made of
//! them, and panics where a promise is broken. Programs of `fuzz_targets` run one in libFuzzer, `mutate` in a
//! loop of its own.

pub mod baked_sets;
pub mod bakes;
pub mod culling;
pub mod level_occluders;
#[path = "../../examples/tests/extremes/oracle.rs"]
#[allow(dead_code)] // No target uses all functions.
mod oracle;
pub mod plans;
pub mod prt;
pub mod pvs;
pub mod regions;
pub mod sandwich_bakes;
pub mod scene_files;
pub mod seeds;

use visibility_core::glam::Vec3;
use visibility_examples::{SceneSource, SourceObject};

/// Repairs the length and the checksum in the header that baked sets and interrupted bakes share. No fuzzed
/// input has both right by chance, so the code behind the checksum would never be reached. Fewer than 40
/// bytes, the size of a header, are left unchanged.
pub fn mend(bytes: &mut [u8]) {
    if bytes.len() < 40 {
        return;
    }
    let length = bytes.len() as u64;
    bytes[24..32].copy_from_slice(&length.to_le_bytes());
    let all = bytes[..32].iter().chain(&bytes[40..]);
    let sum = all.fold(0xcbf2_9ce4_8422_2325_u64, |hash, &byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
    });
    bytes[32..40].copy_from_slice(&sum.to_le_bytes());
}

/// Applies a list of changes of 8 bytes each to `bytes`. The first byte of a change chooses its kind:
/// overwrite several bytes, overwrite one byte, copy a part to another place, remove a part, or cut off the
/// end. Two bytes are the offset, taken modulo the length.
pub fn change(bytes: &mut Vec<u8>, changes: &[u8]) {
    for change in changes.as_chunks::<8>().0 {
        let &[what, low, high, a, b, c, d, length] = change;
        let offset = |low, high, end: usize| usize::from(u16::from_le_bytes([low, high])) % (end + 1);
        let start = offset(low, high, bytes.len());
        let part = start..bytes.len().min(start + 1 + usize::from(length));
        match what % 5 {
            0 => {
                let end = bytes.len().min(start + 4);
                bytes[start..end].copy_from_slice(&[a, b, c, d][..end - start]);
            }
            1 => bytes[start..].iter_mut().take(1).for_each(|byte| *byte = a),
            2 => {
                let (to, part) = (offset(a, b, bytes.len()), bytes[part].to_vec());
                bytes.splice(to..to, part);
            }
            3 => drop(bytes.drain(part)),
            _ => bytes.truncate(start),
        }
    }
}

/// Reader of numbers from the front of a slice of bytes.
pub struct Bytes<'a>(&'a [u8]);

impl<'a> Bytes<'a> {
    /// Creates a reader at the first byte.
    pub fn new(bytes: &'a [u8]) -> Self {
        Self(bytes)
    }

    /// Returns the next byte without reading it; `None` at the end of the bytes.
    pub fn peek(&self) -> Option<u8> {
        self.0.first().copied()
    }

    /// Reads the next byte; `None` at the end of the bytes.
    pub fn byte(&mut self) -> Option<u8> {
        let (&first, rest) = self.0.split_first()?;
        self.0 = rest;
        Some(first)
    }

    /// Reads a number: for most first bytes a small number, so that some scenes have objects in view,
    /// otherwise arbitrary bits. `None` at the end.
    pub fn number(&mut self) -> Option<f32> {
        Some(match self.byte()? {
            0 => f32::from_le_bytes([self.byte()?, self.byte()?, self.byte()?, self.byte()?]),
            small => (f32::from(small) - 128.0) / 16.0,
        })
    }

    /// Reads N numbers one after another; `None` if the bytes end before the last number.
    pub fn numbers<const N: usize>(&mut self) -> Option<[f32; N]> {
        let mut numbers = [0.0; N];
        for number in &mut numbers {
            *number = self.number()?;
        }
        Some(numbers)
    }

    /// Reads triangles of nine numbers each until the bytes end, as a scene of objects. A byte before a
    /// triangle starts a new object if it is a multiple of 4.
    pub fn scene(&mut self) -> SceneSource {
        let (mut objects, mut triangles) = (Vec::new(), Vec::new());
        while let Some(triangle) = self.numbers::<9>() {
            let corner = |i: usize| Vec3::new(triangle[i], triangle[i + 1], triangle[i + 2]);
            if self.peek().is_some_and(|byte| byte % 4 == 0) {
                objects.push(SourceObject::new("object", std::mem::take(&mut triangles)));
            }
            triangles.push([corner(0), corner(3), corner(6)]);
        }
        objects.push(SourceObject::new("last", triangles));
        SceneSource { objects, ..SceneSource::new("fuzz", Vec3::Z, 0.1) }
    }
}
