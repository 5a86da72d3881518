//! Binary form of tessellations: arrays as they are in memory, behind the header of the [binary
//! format](visibility_core::binary_format), so that loading copies and checks the arrays and computes
//! nothing.
//!
//! The kind in the header is 0 for octrees and 1 for tetrahedra. The fingerprint is a hash of the scene. The
//! body is arrays of 32-bit numbers, each preceded by its length.

use crate::content::Content;
use crate::delaunay::{DelaunayTessellation, FINE_STEPS, NONE};
use crate::grid::{Grid, STEPS, morton};
use crate::index_lists::{IndexLists, are_list_starts};
use crate::octree::{Fineness, OctreeTessellation, decode_neighbour, leaf_position};

use alloc::vec::Vec;
use visibility_core::Scene;
use visibility_core::binary_format::{Fingerprint, Format, FormatError, Reader, Writer};
use visibility_core::glam::DVec3;

/// Magic bytes and version of the binary form; a change of the layout raises the version.
const FORMAT: Format = Format { magic: *b"plpcells", version: 5 };

/// Returns a hash of the indices, bounds and triangles of all objects of a scene.
fn fingerprint(scene: &Scene) -> u64 {
    let mut hash = Fingerprint::new().with(scene.index_limit() as u32);
    for id in scene.ids() {
        hash = hash.with(id.index() as u32);
        if let Ok(bounds) = scene.bounds(id) {
            let numbers = [bounds.min, bounds.max];
            hash = numbers.iter().flat_map(|p| p.to_array()).map(f32::to_bits).fold(hash, Fingerprint::with);
        }
        let triangles = scene.triangles(id).unwrap_or_default();
        let numbers = triangles.iter().flatten().flat_map(|p| p.to_array()).map(f32::to_bits);
        hash = numbers.fold(hash.with(triangles.len() as u32), Fingerprint::with);
    }
    hash.value()
}

/// Starts the binary form of a tessellation of a kind (0 octree, 1 tetrahedra) for a scene, and writes its
/// grid (minimum corner and step) and fineness. The result is in memory.
fn begin(kind: u32, scene: &Scene, grid: &Grid, fineness: Fineness) -> Writer {
    let mut writer = Writer::new(FORMAT, kind, fingerprint(scene));
    writer.u64s([grid.min.x, grid.min.y, grid.min.z, grid.step].map(f64::to_bits));
    writer.u32s([fineness.vertices as u32, fineness.halvings]);
    writer
}

/// Writes the length of an array as a 32-bit number, then the array.
fn write_array(writer: &mut Writer, words: impl ExactSizeIterator<Item = u32>) {
    writer.u32(words.len() as u32);
    writer.u32s(words);
}

/// Writes the content of all cells: the offsets of the cells' lists, the shares of rays that their objects
/// stop, the bit of each object that is in all cells that it meets, and the lists themselves.
fn write_content(writer: &mut Writer, content: &Content) {
    write_array(writer, content.starts.iter().copied());
    write_array(writer, content.cover.iter().map(|cover| u32::from_le_bytes(*cover)));
    writer.u32(content.held.words().len() as u32 * 2);
    writer.u64s(content.held.words().iter().copied());
    writer.u32(content.lists.len() as u32);
    writer.bytes(&content.lists);
}

/// Opens the binary form `bytes` and checks its header. `Err` if the bytes are damaged, or the format,
/// version, kind or the scene's fingerprint differs.
fn open<'a>(bytes: &'a [u8], kind: u32, scene: &Scene) -> Result<Reader<'a>, FormatError> {
    let reader = Reader::new(bytes, FORMAT)?;
    reader.expect(kind, fingerprint(scene))?;
    Ok(reader)
}

/// Reads an array written by [`write_array`]. `Err` if the bytes end early.
fn read_array(reader: &mut Reader) -> Result<Vec<u32>, FormatError> {
    let count = reader.u32()? as usize;
    reader.u32s(count)
}

/// Reads an array of groups of four numbers. `Err` if the array's length is no multiple of four or the bytes
/// end early.
fn read_fours(reader: &mut Reader) -> Result<Vec<[u32; 4]>, FormatError> {
    let words = read_array(reader)?;
    if words.len() % 4 != 0 {
        return Err(reader.content_error("an array of fours has another length"));
    }
    Ok(words.chunks_exact(4).map(|w| [w[0], w[1], w[2], w[3]]).collect())
}

/// Reads the grid and fineness written by [`begin`]. `Err` for a grid that is not finite or whose step is not
/// positive.
fn read_grid(reader: &mut Reader) -> Result<(Grid, Fineness), FormatError> {
    let mut numbers = [0.0; 4];
    for number in &mut numbers {
        *number = f64::from_bits(reader.u64()?);
    }
    let [x, y, z, step] = numbers;
    if !numbers.iter().all(|number| number.is_finite()) || step <= 0.0 {
        return Err(reader.content_error("the grid is not finite"));
    }
    let fineness = Fineness { vertices: reader.u32()? as usize, halvings: reader.u32()? };
    Ok((Grid { min: DVec3::new(x, y, z), step }, fineness))
}

/// Reads the content of `cells` cells written by [`write_content`], up to the end of the bytes. `Err` if the
/// arrays contradict each other, `cells` or the scene.
fn read_content(reader: &mut Reader, scene: &Scene, cells: usize) -> Result<Content, FormatError> {
    let starts = read_array(reader)?;
    let cover: Vec<[u8; 4]> = read_array(reader)?.into_iter().map(u32::to_le_bytes).collect();
    let halves = read_array(reader)?;
    let held = halves.chunks(2).map(|pair| u64::from(pair[0]) | u64::from(*pair.last().unwrap_or(&0)) << 32);
    let length = reader.u32()? as usize;
    let lists = reader.bytes(length)?.to_vec();
    reader.end()?;
    if cover.len() != cells {
        return Err(reader.content_error("there are more or fewer lists than cells"));
    }
    Content::from_arrays(scene, starts, cover, lists, held.collect::<Vec<u64>>().into())
        .map_err(|problem| reader.content_error(problem))
}

/// Tests whether an encoded neighbour (see `octree::encode_neighbour`) of leaf `cell` names an existing leaf
/// that begins or ends in the plane of the encoded face. `leaf_positions` holds the voxel index of each
/// leaf's minimum corner and its side in steps. Does not test whether the two leaves overlap within the
/// plane.
fn touches(leaf_positions: &[[u16; 4]], cell: usize, encoded: u32) -> bool {
    let (other, axis, upwards) = decode_neighbour(encoded);
    let Some(other) = leaf_positions.get(other as usize).filter(|_| axis < 3) else { return false };
    let (below, above) =
        if upwards { (&leaf_positions[cell], other) } else { (other, &leaf_positions[cell]) };
    below[axis] + below[3] == above[axis]
}

impl OctreeTessellation {
    /// Encodes the tessellation for [`from_bytes`](Self::from_bytes). `scene` must be the scene of the last
    /// build or sync. Objects that changed since then are stored as [strays](Content::strays), which count as
    /// visible. For another scene, or if the scene's change log no longer reaches back to the last sync, all
    /// objects are stored as strays.
    pub fn to_bytes(&self, scene: &Scene) -> Vec<u8> {
        let mut writer = begin(0, scene, &self.grid, self.fineness);
        write_array(&mut writer, self.codes.iter().copied());
        write_array(&mut writer, self.leaf_positions.iter().map(|position| position[3].into()));
        write_array(&mut writer, self.neighbours.starts.iter().copied());
        write_array(&mut writer, self.neighbours.items.iter().copied());
        write_array(&mut writer, self.boundary.iter().copied());
        write_content(&mut writer, &self.content.synced(scene));
        writer.finish()
    }

    /// Decodes bytes written by [`to_bytes`](Self::to_bytes). `scene` must have the same object ids, bounds
    /// and triangles as the stored scene.
    ///
    /// Cost: proportional to the number of bytes and the size of the scene, all of which are checked.
    ///
    /// # Errors
    /// [`FormatError`] if the bytes are damaged, have another format, version or kind of tessellation, or
    /// if the scene differs from the stored scene.
    pub fn from_bytes(bytes: &[u8], scene: &Scene) -> Result<Self, FormatError> {
        let mut reader = open(bytes, 0, scene)?;
        let (grid, fineness) = read_grid(&mut reader)?;
        let (codes, sides) = (read_array(&mut reader)?, read_array(&mut reader)?);
        let neighbours = IndexLists { starts: read_array(&mut reader)?, items: read_array(&mut reader)? };
        let boundary = read_array(&mut reader)?;
        let cells = codes.len();
        // Leaves in Morton order fill the cube if each begins where the previous leaf ends.
        let mut next = 0u64;
        let mut leaf_positions = Vec::with_capacity(cells);
        for (&code, &side) in codes.iter().zip(&sides) {
            if !side.is_power_of_two() || side > STEPS || u64::from(code) != next {
                return Err(reader.content_error("the leaves do not fill the cube"));
            }
            leaf_positions.push(leaf_position(code, side));
            next += u64::from(side).pow(3);
        }
        if sides.len() != cells || next != u64::from(morton([STEPS - 1; 3])) + 1 {
            return Err(reader.content_error("the leaves do not fill the cube"));
        }
        let fits = are_list_starts(&neighbours.starts, cells, neighbours.items.len())
            && boundary.iter().all(|&cell| (cell as usize) < cells)
            && (0..cells).all(|cell| {
                neighbours.get(cell).iter().all(|&encoded| touches(&leaf_positions, cell, encoded))
            });
        if !fits {
            return Err(reader.content_error("the neighbours do not fit the leaves"));
        }
        let content = read_content(&mut reader, scene, cells)?;
        Ok(Self { grid, fineness, codes, leaf_positions, neighbours, boundary, content })
    }
}

impl DelaunayTessellation {
    /// Encodes the tessellation for [`from_bytes`](Self::from_bytes). `scene` must be the scene of the last
    /// build or sync. Objects that changed since then are stored as [strays](Content::strays), which count as
    /// visible. For another scene, or if the scene's change log no longer reaches back to the last sync, all
    /// objects are stored as strays.
    pub fn to_bytes(&self, scene: &Scene) -> Vec<u8> {
        let mut writer = begin(1, scene, &self.grid, self.fineness);
        write_array(&mut writer, self.points.as_flattened().iter().map(|&x| x as u32));
        write_array(&mut writer, self.cells.as_flattened().iter().copied());
        write_array(&mut writer, self.neighbours.as_flattened().iter().copied());
        write_array(&mut writer, self.boundary.iter().copied());
        write_content(&mut writer, &self.content.synced(scene));
        writer.finish()
    }

    /// Decodes bytes written by [`to_bytes`](Self::to_bytes). `scene` must have the same object ids, bounds
    /// and triangles as the stored scene.
    ///
    /// Cost: proportional to the number of bytes and the size of the scene, all of which are checked.
    ///
    /// # Errors
    /// [`FormatError`] if the bytes are damaged, have another format, version or kind of tessellation, or
    /// if the scene differs from the stored scene.
    pub fn from_bytes(bytes: &[u8], scene: &Scene) -> Result<Self, FormatError> {
        let mut reader = open(bytes, 1, scene)?;
        let (grid, fineness) = read_grid(&mut reader)?;
        let points = read_array(&mut reader)?;
        let (cells, neighbours) = (read_fours(&mut reader)?, read_fours(&mut reader)?);
        let boundary = read_array(&mut reader)?;
        if points.len() % 3 != 0 || points.iter().any(|&x| x > FINE_STEPS as u32) {
            return Err(reader.content_error("a point lies outside the cube"));
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
            return Err(reader.content_error("the tetrahedra name points or neighbours that are not there"));
        }
        let content = read_content(&mut reader, scene, count)?;
        Ok(Self { grid, fineness, points, cells, neighbours, boundary, content })
    }
}
