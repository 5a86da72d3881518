//! Decoder of buffer views that are compressed by `EXT_meshopt_compression` or `KHR_meshopt_compression`, as
//! the program gltfpack writes them: vertex attributes, triangle lists and index sequences.
//!
//! The format is that of the extensions' specifications ("Appendix A: Bitstream"). Output grows by blocks of
//! at most 8192 bytes as they are decoded, which never have more than [`GREATEST_RATIO`] times the size of
//! their input. A count that would need more is refused before memory is taken for it.

use serde_json::Value;

/// Parameters of a compressed buffer view.
#[derive(Clone, PartialEq, Eq, Hash)]
pub(super) struct Compressed {
    /// Index of the buffer that has the compressed bytes.
    pub buffer: usize,
    /// Offset in that buffer of the first compressed byte.
    pub offset: usize,
    /// Number of compressed bytes.
    pub length: usize,
    stride: usize,
    count: usize,
    mode: Mode,
    filter: Filter,
}

/// Greatest ratio of a view's size to that of its compressed bytes. Version 1 of the attribute codec has a
/// block of 256 constant elements of four bytes in a single byte. Version 0 has at most 64 bytes in one, and
/// the codecs of indices have at most 12.
const GREATEST_RATIO: usize = 1024;

#[derive(Clone, Copy, PartialEq, Eq, Hash)]
enum Mode {
    Attributes,
    Triangles,
    Indices,
}

/// Transformation of decoded attributes, as named by the extension.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
enum Filter {
    None,
    Quaternion,
    Exponential,
    /// Filter of directions or colours, which is skipped since it affects no positions.
    Other,
}

impl Compressed {
    /// Reads the extension of a buffer view. The error is a message for a person.
    pub(super) fn new(extension: &Value) -> Result<Self, String> {
        let number = |key: &str, default: Option<usize>| {
            let value = extension.get(key);
            let read = value.map_or(default, |value| value.as_u64().and_then(|n| usize::try_from(n).ok()));
            read.ok_or_else(|| format!("its meshopt compression has no usable `{key}`"))
        };
        let text = |key: &str| extension.get(key).and_then(Value::as_str);
        let mode = match text("mode") {
            Some("ATTRIBUTES") => Mode::Attributes,
            Some("TRIANGLES") => Mode::Triangles,
            Some("INDICES") => Mode::Indices,
            _ => return Err("its meshopt compression has no known `mode`".into()),
        };
        let filter = match text("filter") {
            None | Some("NONE") => Filter::None,
            Some("QUATERNION") => Filter::Quaternion,
            Some("EXPONENTIAL") => Filter::Exponential,
            Some(_) => Filter::Other,
        };
        let stride = number("byteStride", None)?;
        let fits = match (mode, filter) {
            (Mode::Attributes, Filter::Quaternion) => stride == 8,
            (Mode::Attributes, _) => stride % 4 == 0 && (4..=256).contains(&stride),
            _ => (stride == 2 || stride == 4) && filter == Filter::None,
        };
        if !fits {
            return Err(format!("its meshopt compression has elements of {stride} bytes"));
        }
        let (buffer, offset) = (number("buffer", None)?, number("byteOffset", Some(0))?);
        let (length, count) = (number("byteLength", None)?, number("count", None)?);
        let view = Self { buffer, offset, length, stride, count, mode, filter };
        if view.size() / GREATEST_RATIO > length {
            return Err(format!("its meshopt compression has {count} elements, which is too many"));
        }
        Ok(view)
    }

    /// Returns the number of bytes of the decoded view.
    pub(super) fn size(&self) -> usize {
        self.count.saturating_mul(self.stride)
    }

    /// Decodes the view from its compressed bytes. The result has [`size`](Self::size) bytes. The error is a
    /// message for a person.
    pub(super) fn decode(&self, bytes: &[u8]) -> Result<Vec<u8>, String> {
        let damaged = || "its meshopt compression is damaged".to_owned();
        let mut decoded = match self.mode {
            Mode::Attributes => attributes(bytes, self.count, self.stride),
            Mode::Triangles => triangles(bytes, self.count).map(|indices| self.packed(&indices)),
            Mode::Indices => sequence(bytes, self.count).map(|indices| self.packed(&indices)),
        }
        .ok_or_else(damaged)?;
        match self.filter {
            Filter::None => {}
            Filter::Quaternion => decoded.as_chunks_mut().0.iter_mut().for_each(quaternion),
            Filter::Exponential => decoded.as_chunks_mut().0.iter_mut().for_each(exponential),
            Filter::Other => return Err("the filter of its meshopt compression is not read".into()),
        }
        Ok(decoded)
    }

    /// Returns the bytes of indices, as 16 or 32 bits each according to the view's stride.
    fn packed(&self, indices: &[u32]) -> Vec<u8> {
        indices.iter().flat_map(|index| index.to_le_bytes().into_iter().take(self.stride)).collect()
    }
}

/// Bytes that are still to be decoded.
struct Input<'a>(&'a [u8]);

impl<'a> Input<'a> {
    /// Returns the next `count` bytes. `None` if fewer are left.
    fn take(&mut self, count: usize) -> Option<&'a [u8]> {
        let (taken, rest) = self.0.split_at_checked(count)?;
        self.0 = rest;
        Some(taken)
    }

    fn byte(&mut self) -> Option<u8> {
        self.take(1).map(|byte| byte[0])
    }

    /// Reads a variable-length integer: seven bits per byte, least significant first, at most five bytes.
    /// `None` if it is cut off or longer.
    fn number(&mut self) -> Option<u32> {
        let mut number = 0;
        for shift in [0, 7, 14, 21, 28] {
            let byte = self.byte()?;
            number |= u32::from(byte & 127) << shift;
            if byte < 128 {
                break;
            }
        }
        Some(number)
    }

    /// Reads an index that is stored as its difference from `last` in zigzag form. `None` if the bytes end.
    fn index(&mut self, last: u32) -> Option<u32> {
        let number = self.number()?;
        Some(last.wrapping_add(number >> 1 ^ (number & 1).wrapping_neg()))
    }
}

/// Number of values in a group, which shares two bits of a header.
const GROUP: usize = 16;

/// Decodes `count` elements of `stride` bytes. `None` if the bytes are damaged.
fn attributes(bytes: &[u8], count: usize, stride: usize) -> Option<Vec<u8>> {
    let mut input = Input(bytes);
    let is_first_version = match input.byte()? {
        0xA0 => true,
        0xA1 => false,
        _ => return None,
    };
    // The stream ends with the element before the first one and, in version 1, one control byte for every
    // four bytes of an element, padded in front.
    let (least, channels) = if is_first_version { (32, 0) } else { (24, stride / 4) };
    let end = input.0.len().checked_sub((stride + channels).max(least))?;
    let (before, channels) = input.0[input.0.len() - stride - channels..].split_at(stride);
    let mut before = before.to_vec();
    input.0 = &input.0[..end];
    let most = ((8192 / stride) & !(GROUP - 1)).min(256);
    let mut decoded = Vec::with_capacity(count * stride);
    let mut left = count;
    while left > 0 {
        let elements = left.min(most);
        left -= elements;
        let start = decoded.len();
        decoded.resize(start + elements * stride, 0);
        let controls = if is_first_version { &[][..] } else { input.take(stride / 4)? };
        for byte in 0..stride {
            let control = controls.get(byte / 4).map(|control| control >> (byte % 4 * 2) & 3);
            let bytes = decoded[start + byte..].iter_mut().step_by(stride);
            differences(&mut input, control, elements, bytes)?;
        }
        let elements = decoded[start..].chunks_exact_mut(stride);
        for element in elements {
            for (at, four) in element.as_chunks_mut::<4>().0.iter_mut().enumerate() {
                let last: &mut [u8; 4] = (&mut before[4 * at..4 * at + 4]).try_into().ok()?;
                *last = sum(*last, *four, channels.get(at).copied().unwrap_or(0));
                *four = *last;
            }
        }
    }
    input.0.is_empty().then_some(decoded)
}

/// Decodes the differences of one byte of `count` elements. `control` selects their encoding in version 1;
/// `None` in version 0.
fn differences<'a>(
    input: &mut Input<'_>,
    control: Option<u8>,
    count: usize,
    mut bytes: impl Iterator<Item = &'a mut u8>,
) -> Option<()> {
    let widths = match control {
        None => [0, 2, 4, 8],
        Some(0) => [0, 1, 2, 4],
        Some(1) => [1, 2, 4, 8],
        Some(2) => return Some(()),
        Some(_) => {
            bytes.zip(input.take(count)?).for_each(|(byte, &literal)| *byte = literal);
            return Some(());
        }
    };
    let groups = count.div_ceil(GROUP);
    let header = input.take(groups.div_ceil(4))?;
    for group in 0..groups {
        let width = widths[usize::from(header[group / 4] >> (group % 4 * 2) & 3)];
        bytes.by_ref().zip(group_of_bytes(input, width)?).for_each(|(byte, value)| *byte = value);
    }
    Some(())
}

/// Decodes a group of sixteen values of `bits` bits each: 0, 1, 2, 4 or 8. With 1 to 4 bits, the greatest
/// value stands for the next of the full bytes that follow the group.
fn group_of_bytes(input: &mut Input<'_>, bits: usize) -> Option<[u8; GROUP]> {
    let mut values = [0; GROUP];
    match bits {
        0 => return Some(values),
        8 => return input.take(GROUP)?.try_into().ok(),
        _ => {}
    }
    let packed = input.take(GROUP * bits / 8)?;
    let greatest = (1 << bits) - 1;
    for (i, value) in values.iter_mut().enumerate() {
        let at = i * bits;
        // Single bits are stored from the lowest bit of a byte up, wider values from the highest bit down.
        let shift = if bits == 1 { at % 8 } else { 8 - bits - at % 8 };
        let small = packed[at / 8] >> shift & greatest;
        *value = if small == greatest { input.byte()? } else { small };
    }
    Some(values)
}

/// Returns four bytes of an element: the same bytes of the element before plus their difference. `channel`
/// selects how to add: four bytes, two 16-bit numbers, or the exclusive-or of one 32-bit number with rotated
/// bits.
fn sum(before: [u8; 4], difference: [u8; 4], channel: u8) -> [u8; 4] {
    match channel & 3 {
        0 => std::array::from_fn(|i| {
            let d = difference[i];
            before[i].wrapping_add(d >> 1 ^ (d & 1).wrapping_neg())
        }),
        1 => {
            let pair = |four: [u8; 4]| [[four[0], four[1]], [four[2], four[3]]].map(u16::from_le_bytes);
            let (last, by) = (pair(before), pair(difference));
            let [a, b] =
                [0, 1].map(|i| last[i].wrapping_add(by[i] >> 1 ^ (by[i] & 1).wrapping_neg()).to_le_bytes());
            [a[0], a[1], b[0], b[1]]
        }
        _ => {
            let turned = u32::from_le_bytes(difference).rotate_right(u32::from(channel >> 4));
            (turned ^ u32::from_le_bytes(before)).to_le_bytes()
        }
    }
}

/// The sixteen most recent items of a decoder, found by age.
struct Recent<T> {
    items: [T; 16],
    next: usize,
}

impl<T: Copy> Recent<T> {
    fn new(item: T) -> Self {
        Self { items: [item; 16], next: 0 }
    }

    /// Adds an item. If it is not `new`, the next item overwrites it.
    fn push(&mut self, item: T, new: bool) {
        self.items[self.next] = item;
        self.next = (self.next + usize::from(new)) % 16;
    }

    /// Returns an item by age: 1 is the most recent.
    fn ago(&self, age: u8) -> T {
        self.items[(self.next + 32 - usize::from(age)) % 16]
    }
}

/// Decodes a triangle list of `count` indices. `None` if the bytes are damaged.
fn triangles(bytes: &[u8], count: usize) -> Option<Vec<u32>> {
    /// Size in bytes of the table of codes at the end of the stream.
    const TABLE: usize = 16;
    let mut input = Input(bytes);
    let header = input.byte()?;
    // In version 1, two of the codes stand for the last explicit index minus or plus 1.
    let known = match header {
        0xE0 => 15,
        0xE1 => 13,
        _ => return None,
    };
    if !count.is_multiple_of(3) {
        return None;
    }
    let codes = input.take(count / 3)?;
    let table;
    (input.0, table) = input.0.split_at_checked(input.0.len().checked_sub(TABLE)?)?;
    let (mut edges, mut vertices) = (Recent::new([u32::MAX; 2]), Recent::new(u32::MAX));
    let (mut next, mut last) = (0u32, 0u32);
    let mut decoded = Vec::with_capacity(count);
    for &code in codes {
        let (high, low) = (code >> 4, code & 15);
        if high < 15 {
            let [a, b] = edges.ago(high + 1);
            let c = if low < known {
                let c = fresh(&mut next, low == 0, vertices.ago(low + 1));
                vertices.push(c, low == 0);
                c
            } else {
                last = match low {
                    15 => input.index(last)?,
                    13 => last.wrapping_sub(1),
                    _ => last.wrapping_add(1),
                };
                vertices.push(last, true);
                last
            };
            decoded.extend([a, b, c]);
            edges.push([c, b], true);
            edges.push([a, c], true);
            continue;
        }
        let is_free = low >= 14;
        let pair = if is_free { input.byte()? } else { table[usize::from(low)] };
        let (second, third) = (pair >> 4, pair & 15);
        // A code with explicit indices and a pair of zeros restarts the count of fresh indices.
        if is_free && pair == 0 {
            next = 0;
        }
        let mut a = fresh(&mut next, low != 15, 0);
        let mut b = fresh(&mut next, second == 0, vertices.ago(second));
        let mut c = fresh(&mut next, third == 0, vertices.ago(third));
        let is_full = |code: u8| is_free && code == 15;
        for (is_full, index) in [(low == 15, &mut a), (is_full(second), &mut b), (is_full(third), &mut c)] {
            if is_full {
                last = input.index(last)?;
                *index = last;
            }
        }
        decoded.extend([a, b, c]);
        vertices.push(a, true);
        vertices.push(b, second == 0 || is_full(second));
        vertices.push(c, third == 0 || is_full(third));
        edges.push([b, a], true);
        edges.push([c, b], true);
        edges.push([a, c], true);
    }
    input.0.is_empty().then_some(decoded)
}

/// Returns the next fresh index (that no triangle has used yet) if `is_new`, and increments `next`. Otherwise
/// returns `otherwise`.
fn fresh(next: &mut u32, is_new: bool, otherwise: u32) -> u32 {
    if !is_new {
        return otherwise;
    }
    let index = *next;
    *next = next.wrapping_add(1);
    index
}

/// Decodes a sequence of `count` indices. `None` if the bytes are damaged.
fn sequence(bytes: &[u8], count: usize) -> Option<Vec<u32>> {
    /// Number of padding bytes at the end of the stream.
    const TAIL: usize = 4;
    let mut input = Input(bytes);
    if !matches!(input.byte()?, 0xD0 | 0xD1) {
        return None;
    }
    input.0 = input.0.get(..input.0.len().checked_sub(TAIL)?)?;
    let mut last = [0u32; 2];
    let mut decoded = Vec::new();
    for _ in 0..count {
        let number = input.number()?;
        let (of, delta) = ((number & 1) as usize, number >> 1);
        last[of] = last[of].wrapping_add(delta >> 1 ^ (delta & 1).wrapping_neg());
        decoded.push(last[of]);
    }
    input.0.is_empty().then_some(decoded)
}

/// Decodes a unit quaternion into four 16-bit components. The element stores three components, and the index
/// and scale of the fourth.
fn quaternion(element: &mut [u8; 8]) {
    let [x, y, z, last] = [0, 2, 4, 6].map(|i| i16::from_le_bytes([element[i], element[i + 1]]));
    let scale = std::f32::consts::FRAC_1_SQRT_2 / f32::from(last | 3);
    let [x, y, z] = [x, y, z].map(|c| f32::from(c) * scale);
    let w = (1.0 - x * x - y * y - z * z).max(0.0).sqrt();
    for (i, component) in [w, x, y, z].into_iter().enumerate() {
        let rounded = (component * 32767.0).round() as i16;
        let at = ((last & 3) as usize + i) % 4 * 2;
        element[at..at + 2].copy_from_slice(&rounded.to_le_bytes());
    }
}

/// Decodes a float that is stored as a 24-bit mantissa and an 8-bit exponent.
fn exponential(element: &mut [u8; 4]) {
    let bits = i32::from_le_bytes(*element);
    let value = f64::from(bits << 8 >> 8) * 2.0f64.powi(bits >> 24);
    *element = (value as f32).to_le_bytes();
}
