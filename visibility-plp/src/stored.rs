//! The binary form of tessellations: arrays as they are in memory, behind a header with a checksum, so that loading copies and checks but
//! computes nothing.
//!
//! All numbers are little-endian. Header: eight bytes that say what it is, version, kind, then in 64 bits each a hash of the scene, the
//! length and the checksum of all but itself. Then arrays of 32-bit numbers, each after its length.

use crate::content::Content;
use crate::delaunay::{DelaunayTessellation, NONE, SIDE};
use crate::grid::{Grid, STEPS, morton};
use crate::grouped::Grouped;
use crate::octree::linked;
use crate::{Fineness, OctreeTessellation};
use alloc::vec::Vec;
use core::fmt;
use visibility_core::Scene;
use visibility_core::glam::DVec3;

const MAGIC: [u8; 8] = *b"plpcells";
const VERSION: u32 = 4;
const HEADER: usize = 40;

/// Why stored cells are refused.
///
/// ```
/// use visibility_core::Scene;
/// use visibility_plp::{OctreeTessellation, StoreError};
/// let refused = OctreeTessellation::from_bytes(b"GIF89a", &Scene::new());
/// assert_eq!(refused.err(), Some(StoreError::Magic));
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[non_exhaustive]
pub enum StoreError {
    /// The bytes do not begin as those of a tessellation.
    Magic,
    /// Another version of the form.
    Version {
        /// The version found.
        found: u32,
    },
    /// A tessellation of another kind: 0 for octrees, 1 for tetrahedra.
    Kind {
        /// The kind found.
        found: u32,
    },
    /// The bytes are fewer or more than they themselves say.
    Length {
        /// How many bytes there are.
        found: u64,
        /// How many there should be, at least.
        expected: u64,
    },
    /// The bytes are not those that were written.
    Checksum,
    /// It was made of another scene, or of this one when it was different.
    Scene,
    /// The numbers make no sense, although the checksum is right: whoever wrote them was wrong.
    Content {
        /// What is wrong.
        problem: &'static str,
    },
}

impl fmt::Display for StoreError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Magic => write!(f, "this is not a stored tessellation"),
            Self::Version { found } => write!(f, "version {found} of the form is not known here"),
            Self::Kind { found } => {
                write!(f, "this is a tessellation of kind {found}, not of the kind asked for")
            }
            Self::Length { found, expected } => write!(f, "{found} bytes, where {expected} are expected"),
            Self::Checksum => write!(f, "the checksum is wrong: the bytes were damaged"),
            Self::Scene => write!(f, "it was made of another scene, or of an earlier state of this one"),
            Self::Content { problem } => write!(f, "the cells make no sense: {problem}"),
        }
    }
}

impl core::error::Error for StoreError {}

/// Start and factor of the hash of Fowler, Noll and Vo, FNV-1a in 64 bits.
const FNV: (u64, u64) = (0xcbf2_9ce4_8422_2325, 0x0000_0100_0000_01b3);

fn fnv(hash: u64, number: u32) -> u64 {
    (hash ^ u64::from(number)).wrapping_mul(FNV.1)
}

/// A hash of all that cells depend on: objects, their bounds and triangles.
fn fingerprint(scene: &Scene) -> u64 {
    let mut hash = fnv(FNV.0, scene.index_limit() as u32);
    for id in scene.ids() {
        hash = fnv(fnv(hash, id.index() as u32), id.generation());
        if let Ok(bounds) = scene.bounds(id) {
            hash =
                [bounds.min, bounds.max].iter().flat_map(|p| p.to_array()).map(f32::to_bits).fold(hash, fnv);
        }
        let triangles = scene.triangles(id).unwrap_or(&[]);
        let numbers = triangles.iter().flatten().flat_map(|p| p.to_array()).map(f32::to_bits);
        hash = numbers.fold(fnv(hash, triangles.len() as u32), fnv);
    }
    hash
}

fn checksum(bytes: &[u8]) -> u64 {
    let all = bytes[..32].iter().chain(&bytes[HEADER..]);
    all.fold(FNV.0, |hash, &byte| fnv(hash, byte.into()))
}

struct Writer(Vec<u8>);

impl Writer {
    fn new(kind: u32, scene: &Scene, grid: &Grid, fineness: Fineness) -> Self {
        let mut writer = Self(MAGIC.to_vec());
        writer.words([VERSION, kind]);
        writer.0.extend_from_slice(&fingerprint(scene).to_le_bytes());
        writer.0.resize(HEADER, 0);
        for number in [grid.min.x, grid.min.y, grid.min.z, grid.step] {
            writer.0.extend_from_slice(&number.to_le_bytes());
        }
        writer.words([fineness.vertices as u32, fineness.halvings]);
        writer
    }

    fn words(&mut self, words: impl IntoIterator<Item = u32>) {
        self.0.extend(words.into_iter().flat_map(u32::to_le_bytes));
    }

    fn array(&mut self, words: impl ExactSizeIterator<Item = u32>) {
        self.words([words.len() as u32]);
        self.words(words);
    }

    fn content(&mut self, content: &Content) {
        self.array(content.starts.iter().copied());
        self.array(content.cover.iter().map(|cover| u32::from_le_bytes(*cover)));
        let halves: Vec<u32> =
            content.held.iter().flat_map(|&word| [word as u32, (word >> 32) as u32]).collect();
        self.array(halves.into_iter());
        self.words([content.lists.len() as u32]);
        self.0.extend_from_slice(&content.lists);
    }

    fn finish(mut self) -> Vec<u8> {
        let length = self.0.len() as u64;
        self.0[24..32].copy_from_slice(&length.to_le_bytes());
        let sum = checksum(&self.0);
        self.0[32..40].copy_from_slice(&sum.to_le_bytes());
        self.0
    }
}

struct Reader<'a> {
    rest: &'a [u8],
}

const SHORT: StoreError = StoreError::Content { problem: "an array is longer than the bytes" };

impl<'a> Reader<'a> {
    /// Checks the header.
    fn new(bytes: &'a [u8], kind: u32, scene: &Scene) -> Result<Self, StoreError> {
        if !bytes.starts_with(&MAGIC) {
            return Err(StoreError::Magic);
        }
        let found = bytes.len() as u64;
        let mut reader = Self { rest: &bytes[8..] };
        let short = |_| StoreError::Length { found, expected: HEADER as u64 };
        let version = reader.word().map_err(short)?;
        if version != VERSION {
            return Err(StoreError::Version { found: version });
        }
        let found_kind = reader.word().map_err(short)?;
        let made_of = reader.long().map_err(short)?;
        let expected = reader.long().map_err(short)?;
        let sum = reader.long().map_err(short)?;
        if expected != found {
            return Err(StoreError::Length { found, expected });
        }
        if checksum(bytes) != sum {
            return Err(StoreError::Checksum);
        }
        if found_kind != kind {
            return Err(StoreError::Kind { found: found_kind });
        }
        if made_of != fingerprint(scene) {
            return Err(StoreError::Scene);
        }
        Ok(reader)
    }

    fn bytes(&mut self, count: usize) -> Result<&'a [u8], StoreError> {
        let (taken, rest) = self.rest.split_at_checked(count).ok_or(SHORT)?;
        self.rest = rest;
        Ok(taken)
    }

    fn word(&mut self) -> Result<u32, StoreError> {
        let bytes = self.bytes(4)?;
        Ok(u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]))
    }

    fn long(&mut self) -> Result<u64, StoreError> {
        let [low, high] = [self.word()?, self.word()?];
        Ok(u64::from(low) | u64::from(high) << 32)
    }

    fn array(&mut self) -> Result<Vec<u32>, StoreError> {
        let count = self.word()? as usize;
        let bytes = self.bytes(count.checked_mul(4).ok_or(SHORT)?)?;
        Ok(bytes.chunks_exact(4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect())
    }

    fn fours(&mut self) -> Result<Vec<[u32; 4]>, StoreError> {
        let words = self.array()?;
        if words.len() % 4 != 0 {
            return Err(StoreError::Content { problem: "an array of fours has another length" });
        }
        Ok(words.chunks_exact(4).map(|w| [w[0], w[1], w[2], w[3]]).collect())
    }

    fn grid(&mut self) -> Result<(Grid, Fineness), StoreError> {
        let mut numbers = [0.0; 4];
        for number in &mut numbers {
            *number = f64::from_bits(self.long()?);
        }
        let [x, y, z, step] = numbers;
        if !numbers.iter().all(|number| number.is_finite()) || step <= 0.0 {
            return Err(StoreError::Content { problem: "the grid is not finite" });
        }
        let fineness = Fineness { vertices: self.word()? as usize, halvings: self.word()? };
        Ok((Grid { min: DVec3::new(x, y, z), step }, fineness))
    }

    fn content(&mut self, scene: &Scene, cells: usize) -> Result<Content, StoreError> {
        let starts = self.array()?;
        let cover: Vec<[u8; 4]> = self.array()?.into_iter().map(u32::to_le_bytes).collect();
        let halves = self.array()?;
        let held =
            halves.chunks(2).map(|pair| u64::from(pair[0]) | u64::from(*pair.last().unwrap_or(&0)) << 32);
        let length = self.word()? as usize;
        let lists = self.bytes(length)?.to_vec();
        if cover.len() != cells || !self.rest.is_empty() {
            return Err(StoreError::Content { problem: "there are more or fewer lists than cells" });
        }
        Content::from_arrays(scene, starts, cover, lists, held.collect())
            .map_err(|problem| StoreError::Content { problem })
    }
}

/// Whether a leaf touches the one that a link of it names, on the side that it says.
fn touches(blocks: &[[u16; 4]], cell: usize, link: u32) -> bool {
    let (other, axis, upwards) = linked(link);
    let Some(other) = blocks.get(other as usize).filter(|_| axis < 3) else { return false };
    let (below, above) = if upwards { (&blocks[cell], other) } else { (other, &blocks[cell]) };
    below[axis] + below[3] == above[axis]
}

impl OctreeTessellation {
    /// The binary form, for [`from_bytes`](Self::from_bytes). `scene` is the one that it was made of; what has
    /// changed since is stored as [strays](Content::strays).
    pub fn to_bytes(&self, scene: &Scene) -> Vec<u8> {
        let mut writer = Writer::new(0, scene, &self.grid, self.fineness);
        writer.array(self.codes.iter().copied());
        let blocks: Vec<u32> = self.blocks.iter().map(|block| u32::from(block[3])).collect();
        writer.array(blocks.into_iter());
        writer.array(self.links.starts.iter().copied());
        writer.array(self.links.items.iter().copied());
        writer.array(self.boundary.iter().copied());
        writer.content(&self.content.synced(scene));
        writer.finish()
    }

    /// Takes a stored tessellation of a scene. Takes time in proportion to the bytes and the scene, to be sure that they are whole and belong
    /// together.
    ///
    /// # Errors
    /// [`StoreError`], with the reason.
    pub fn from_bytes(bytes: &[u8], scene: &Scene) -> Result<Self, StoreError> {
        let wrong = |problem| StoreError::Content { problem };
        let mut reader = Reader::new(bytes, 0, scene)?;
        let (grid, fineness) = reader.grid()?;
        let (codes, sides) = (reader.array()?, reader.array()?);
        let links = Grouped { starts: reader.array()?, items: reader.array()? };
        let boundary = reader.array()?;
        let cells = codes.len();
        // Leaves in Morton's order, each beginning where the one before ends, fill the cube.
        let mut next = 0u64;
        let mut blocks = Vec::with_capacity(cells);
        for (&code, &side) in codes.iter().zip(&sides) {
            if !side.is_power_of_two() || side > STEPS || u64::from(code) != next {
                return Err(wrong("the leaves do not fill the cube"));
            }
            let [x, y, z] = crate::grid::place_of(code).map(|x| x as u16);
            blocks.push([x, y, z, side as u16]);
            next += u64::from(side).pow(3);
        }
        if sides.len() != cells || next != u64::from(morton([STEPS - 1; 3])) + 1 {
            return Err(wrong("the leaves do not fill the cube"));
        }
        let fits = links.starts.len() == cells + 1
            && links.starts.first() == Some(&0)
            && links.starts.last() == Some(&(links.items.len() as u32))
            && links.starts.windows(2).all(|pair| pair[0] <= pair[1])
            && boundary.iter().all(|&cell| (cell as usize) < cells)
            && (0..cells).all(|cell| links.get(cell).iter().all(|&link| touches(&blocks, cell, link)));
        if !fits {
            return Err(wrong("the neighbours do not fit the leaves"));
        }
        let content = reader.content(scene, cells)?;
        Ok(Self { grid, fineness, codes, blocks, links, boundary, content })
    }
}

impl DelaunayTessellation {
    /// The binary form, for [`from_bytes`](Self::from_bytes). `scene` is the one that it was made of; what has
    /// changed since is stored as [strays](Content::strays).
    pub fn to_bytes(&self, scene: &Scene) -> Vec<u8> {
        let mut writer = Writer::new(1, scene, &self.grid, self.fineness);
        let points: Vec<u32> = self.points.as_flattened().iter().map(|&x| x as u32).collect();
        writer.array(points.into_iter());
        writer.array(self.cells.as_flattened().iter().copied());
        writer.array(self.neighbours.as_flattened().iter().copied());
        writer.array(self.boundary.iter().copied());
        writer.content(&self.content.synced(scene));
        writer.finish()
    }

    /// Takes a stored tessellation of a scene. Takes time in proportion to the bytes and the scene, to be sure that they are whole and belong
    /// together.
    ///
    /// # Errors
    /// [`StoreError`], with the reason.
    pub fn from_bytes(bytes: &[u8], scene: &Scene) -> Result<Self, StoreError> {
        let wrong = |problem| StoreError::Content { problem };
        let mut reader = Reader::new(bytes, 1, scene)?;
        let (grid, fineness) = reader.grid()?;
        let points = reader.array()?;
        let (cells, neighbours) = (reader.fours()?, reader.fours()?);
        let boundary = reader.array()?;
        if points.len() % 3 != 0 || points.iter().any(|&x| x > SIDE as u32) {
            return Err(wrong("a point lies outside the cube"));
        }
        let points: Vec<_> =
            points.chunks_exact(3).map(|p| [p[0] as i32, p[1] as i32, p[2] as i32]).collect();
        let count = cells.len();
        let fits = neighbours.len() == count
            && count > 0
            && cells.as_flattened().iter().all(|&vertex| (vertex as usize) < points.len())
            && neighbours.as_flattened().iter().all(|&cell| cell == NONE || (cell as usize) < count)
            && boundary.iter().all(|&cell| (cell as usize) < count);
        if !fits {
            return Err(wrong("the tetrahedra name points or neighbours that are not there"));
        }
        let content = reader.content(scene, count)?;
        Ok(Self { grid, fineness, points, cells, neighbours, boundary, content })
    }
}
