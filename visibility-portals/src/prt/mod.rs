//! Portal files of map compilers: `.prt`, in the forms `PRT1`, `PRT2` and `PRT1-AM`.
//!
//! The formats are those of the compilers of the Quake family, which write convex cells and the portals
//! between them as text:
//! - line 1, the form; then counts, a line each: `PRT1`: cells, portals; `PRT2`: leaves, cells, portals;
//!   `PRT1-AM`: cells, portals, leaves;
//! - a line for each portal, `n c0 c1 (x y z) (x y z) ...`: a convex polygon of `n` vertices between the
//!   cells `c0` and `c1`, whose right-hand normal points into `c1`;
//! - `PRT2`: then a line for each cell with the numbers of its leaves and a closing -1; `PRT1-AM`: then a
//!   line for each leaf with its cell.
//!
//! Coordinates are taken unchanged, in the unit of the map.

use alloc::format;
use alloc::string::{String, ToString};
use alloc::vec::Vec;
use core::fmt;
use visibility_core::glam::DVec3;
use visibility_core::{
    cells::{CellGraph, CellGraphError, CellId, PortalId},
    geometry::{ConvexPolygon, PolygonError},
};

/// Maximum number of vertices of a portal in a file, as in the compilers that write these files.
pub const MAX_VERTICES: usize = 64;

/// The number of cells that a file announces may exceed the length of the file in bytes by at most this
/// number, and so may the number of leaves. This bounds the memory that a small file can claim. Cells and
/// leaves that no later line names are possible: cells without portals, and leaves in no cell.
const UNNAMED: usize = 1 << 16;

/// Content of a portal file: cells, portals and leaves.
#[derive(Clone, PartialEq, Debug)]
pub struct PortalFile {
    /// The graph of cells and portals, in the unit of the map.
    pub graph: CellGraph,
    /// Cell of each leaf, by leaf index; leaves are a finer division of the map. `None` for a leaf that the
    /// file puts in no cell. Empty for `PRT1`, where leaves are cells. For `PRT2` the list ends with the
    /// last leaf that is in a cell.
    pub cell_of_leaf: Vec<Option<CellId>>,
}

/// Why a portal file cannot be read. Line numbers count from 1.
#[derive(Clone, PartialEq, Debug)]
#[non_exhaustive]
pub enum PrtError {
    /// A line of the file does not have the form that the format demands, for instance because a number is
    /// missing, or follows all announced lines.
    Line {
        /// Number of the line, from 1.
        line: usize,
        /// Description of the problem with the line, in English.
        problem: String,
    },
    /// The vertices of a portal do not form a convex polygon.
    Polygon {
        /// Number of the portal's line, from 1.
        line: usize,
        /// Index of the portal, in the order of the file.
        portal: PortalId,
        /// Why the vertices do not form a polygon.
        error: PolygonError,
    },
    /// The file ends before all announced lines were read.
    Length {
        /// Number of lines of the file.
        lines: usize,
        /// Description of the line that is missing, in English.
        expected: &'static str,
    },
    /// The cells and portals do not form a graph, for instance because a portal leads to an unknown cell.
    Graph {
        /// Number of the portal's line, from 1. The last line of the header if the error concerns no single
        /// portal.
        line: usize,
        /// Why the cells and portals do not form a graph.
        error: CellGraphError,
    },
}

impl fmt::Display for PrtError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Line { line, problem } => write!(f, "line {line}: {problem}"),
            Self::Polygon { line, portal, error } => write!(f, "line {line}, portal {}: {error}", portal.0),
            Self::Graph { line, error } => write!(f, "line {line}: {error}"),
            Self::Length { lines, expected } => {
                write!(f, "the file ends after line {lines}, where {expected} should follow")
            }
        }
    }
}

impl core::error::Error for PrtError {
    fn source(&self) -> Option<&(dyn core::error::Error + 'static)> {
        match self {
            Self::Polygon { error, .. } => Some(error),
            Self::Graph { error, .. } => Some(error),
            Self::Line { .. } | Self::Length { .. } => None,
        }
    }
}

/// Reads a portal file in any of the three forms. Empty lines are skipped. Time and memory are proportional
/// to the length of the text plus the number of cells that the file's header announces, at most
/// [`CellGraph::LIMIT`]. Other announced counts cost nothing before their lines are read.
///
/// # Errors
/// [`PrtError`], with the number of the line.
///
/// ```
/// let file = visibility_portals::prt::read("PRT1\n2\n1\n4 0 1 (0 0 0) (0 1 0) (0 1 1) (0 0 1)\n")?;
/// assert_eq!(file.graph.cell_count(), 2);
/// let error = visibility_portals::prt::read("PRT1\n2\n1\n4 0 1 (0 0 0) (0 1 0)\n").unwrap_err();
/// assert_eq!(error.to_string(), "line 4: vertex 3 of 4 is missing");
/// # Ok::<(), visibility_portals::prt::PrtError>(())
/// ```
pub fn read(text: &str) -> Result<PortalFile, PrtError> {
    let mut lines = Lines { rest: text.lines(), number: 0 };
    let form = lines.next("a line PRT1, PRT2 or PRT1-AM")?.trim();
    // The order of the counts differs by form.
    let (leaves, cells, portals) = match form {
        "PRT1" => {
            let cells = lines.count("the number of cells")?;
            (0, cells, lines.count("the number of portals")?)
        }
        "PRT2" => {
            let leaves = lines.count("the number of leaves")?;
            let cells = lines.count("the number of cells")?;
            (leaves, cells, lines.count("the number of portals")?)
        }
        "PRT1-AM" => {
            let cells = lines.count("the number of cells")?;
            let portals = lines.count("the number of portals")?;
            (lines.count("the number of leaves")?, cells, portals)
        }
        _ => return Err(lines.error("this is not a portal file: PRT1, PRT2 or PRT1-AM should stand here")),
    };
    let header = lines.number;
    for (count, what) in [(cells, "cells"), (leaves, "leaves")] {
        if count > text.len().saturating_add(UNNAMED) {
            return Err(lines.error(&format!("{count} {what} are too many")));
        }
    }
    let (mut all, mut numbers) = (Vec::new(), Vec::new());
    for id in 0..portals as u32 {
        let line = lines.next("the line of a portal")?;
        all.push(portal(line, lines.number, PortalId(id))?);
        numbers.push(lines.number);
    }
    // The graph is made before the leaves are read, so that it refuses excessive counts before an array is
    // sized by them.
    let graph = CellGraph::new(cells, all).map_err(|error| {
        let portal = match error {
            CellGraphError::UnknownCell { portal, .. }
            | CellGraphError::SameCell { portal, .. }
            | CellGraphError::NoPlane { portal } => Some(portal.index()),
            _ => None,
        };
        let line = portal.and_then(|portal| numbers.get(portal)).copied().unwrap_or(header);
        PrtError::Graph { line, error }
    })?;
    // PRT2 has a line of leaves for each cell, PRT1-AM a line with the cell for each leaf.
    let mut cell_of_leaf = Vec::new();
    if form == "PRT2" {
        for cell in 0..cells as u32 {
            let line = lines.next("the line with the leaves of a cell")?;
            leaves_of_cell(line, CellId(cell), leaves, &mut cell_of_leaf)
                .map_err(|problem| lines.error(problem))?;
        }
    } else {
        for _ in 0..leaves {
            let cell = lines.count("the cell of a leaf")?;
            if cell >= cells {
                return Err(lines.error("there is no such cell"));
            }
            cell_of_leaf.push(Some(CellId(cell as u32)));
        }
    }
    // A count that is too small must not lose portals unnoticed.
    match lines.next("nothing") {
        Ok(_) => Err(lines.error("more lines than the counts announce")),
        Err(_) => Ok(PortalFile { graph, cell_of_leaf }),
    }
}

/// Returns the cells and portals of a graph as text in the form `PRT1`, each coordinate with enough digits to
/// be read back unchanged.
pub fn write(graph: &CellGraph) -> String {
    let mut text = String::new();
    // Writing to a string cannot fail.
    let _ = write_to(graph, &mut text);
    text
}

fn write_to(graph: &CellGraph, out: &mut impl fmt::Write) -> fmt::Result {
    writeln!(out, "PRT1\n{}\n{}", graph.cell_count(), graph.portals().len())?;
    for portal in graph.portals() {
        let [a, b] = portal.cells();
        write!(out, "{} {} {}", portal.polygon().vertices().len(), a.0, b.0)?;
        for v in portal.polygon().vertices() {
            write!(out, " ({} {} {})", v.x, v.y, v.z)?;
        }
        writeln!(out)?;
    }
    Ok(())
}

/// Iterator over the lines that are not empty; `number` is the line number, from 1, of the line returned
/// last.
struct Lines<'a> {
    rest: core::str::Lines<'a>,
    number: usize,
}

impl<'a> Lines<'a> {
    fn next(&mut self, expected: &'static str) -> Result<&'a str, PrtError> {
        loop {
            let Some(line) = self.rest.next() else {
                return Err(PrtError::Length { lines: self.number, expected });
            };
            self.number += 1;
            if !line.trim().is_empty() {
                return Ok(line);
            }
        }
    }

    fn count(&mut self, what: &'static str) -> Result<usize, PrtError> {
        let line = self.next(what)?.trim();
        // Counts are limited to 32 bits.
        match line.parse::<u32>() {
            Ok(count) => Ok(count as usize),
            Err(_) => Err(self.error(&format!("{what} should stand here, not `{}`", short(line)))),
        }
    }

    fn error(&self, problem: &str) -> PrtError {
        PrtError::Line { line: self.number, problem: problem.to_string() }
    }
}

/// Returns at most the first 20 characters of a text, for messages.
fn short(found: &str) -> &str {
    match found.char_indices().nth(20) {
        Some((end, _)) => &found[..end],
        None => found,
    }
}

/// Parses the line of portal `id`; `number` is the line's number, from 1, for errors.
fn portal(line: &str, number: usize, id: PortalId) -> Result<(ConvexPolygon, [CellId; 2]), PrtError> {
    let wrong = |problem: String| PrtError::Line { line: number, problem };
    // Parentheses separate words just like spaces.
    let mut words =
        line.split(|c: char| c.is_whitespace() || c == '(' || c == ')').filter(|word| !word.is_empty());
    let mut integer = |what: &str| -> Result<u32, PrtError> {
        let word = words.next().ok_or_else(|| wrong(format!("{what} is missing")))?;
        word.parse().map_err(|_| wrong(format!("{what} should stand where `{}` does", short(word))))
    };
    let count = integer("the number of vertices")? as usize;
    let cells = [CellId(integer("the first cell")?), CellId(integer("the second cell")?)];
    if count > MAX_VERTICES {
        return Err(wrong(format!("{count} vertices are more than {MAX_VERTICES}")));
    }
    let mut vertices = Vec::with_capacity(count);
    for i in 0..count {
        let mut vertex = [0.0; 3];
        for x in &mut vertex {
            let word = words.next();
            let word = word.ok_or_else(|| wrong(format!("vertex {} of {count} is missing", i + 1)))?;
            *x = word.parse().map_err(|_| {
                wrong(format!("vertex {} of {count}: `{}` is not a number", i + 1, short(word)))
            })?;
        }
        vertices.push(DVec3::from_array(vertex));
    }
    if words.next().is_some() {
        return Err(wrong(format!("more than the {count} vertices that it announces")));
    }
    let polygon = ConvexPolygon::new(vertices);
    Ok((polygon.map_err(|error| PrtError::Polygon { line: number, portal: id, error })?, cells))
}

fn leaves_of_cell(
    line: &str,
    cell: CellId,
    leaves: usize,
    cell_of_leaf: &mut Vec<Option<CellId>>,
) -> Result<(), &'static str> {
    for word in line.split_whitespace() {
        if word == "-1" {
            return Ok(());
        }
        let leaf: usize = word.parse().map_err(|_| "the number of a leaf, or -1, should stand here")?;
        if leaf >= leaves {
            return Err("there is no such leaf");
        }
        // A leaf index sizes an array, so it is limited independently of the length of the text.
        if leaf >= CellGraph::LIMIT {
            return Err("too many leaves");
        }
        if leaf >= cell_of_leaf.len() {
            cell_of_leaf.resize(leaf + 1, None);
        }
        cell_of_leaf[leaf] = Some(cell);
    }
    Err("the closing -1 is missing")
}

#[cfg(test)]
mod tests;
