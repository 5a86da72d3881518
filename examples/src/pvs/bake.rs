//! Cell-to-cell bakes of maps from files, on several threads.

use crate::ordinary_file;
use std::path::Path;
use std::time::Instant;
use visibility_core::bake::{Bake, Progress};
use visibility_core::cells::CellGraph;
use visibility_portals::{BakerSettings, CellBaker, Outcome, prt};

/// Depth of chains of portals of a preview, see [`visibility_portals::BakerSettings::with_depth`]. Depth 0
/// takes half to two thirds of the time on maps of games, and shows 1.2 to 2.1 times as many cells.
pub const QUICK_DEPTH: u32 = 1;

/// Map of cells and portals with its name.
pub struct Map {
    /// Name of the file, without directories and extension.
    pub name: String,
    /// Cells and portals of the map, in the map's units.
    pub graph: CellGraph,
}

/// Reads a `.prt` file.
///
/// # Errors
///
/// Returns a message with the path: the error of the file system, or the line of the file and what is wrong
/// there.
pub fn read(path: &Path) -> Result<Map, String> {
    let bytes =
        ordinary_file::read(path).map_err(|error| format!("cannot read {}: {error}", path.display()))?;
    // Bytes that are not UTF-8 become replacement characters. The reader ignores these or reports an error
    // with the line.
    let file = prt::read(&String::from_utf8_lossy(&bytes))
        .map_err(|error| format!("{}: {error}", path.display()))?;
    let name = path.file_stem().unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
    Ok(Map { name, graph: file.graph })
}

/// Finished bake with its duration.
pub struct Baked {
    /// Cell-to-cell visibility matrix, with statistics of the bake.
    pub outcome: Outcome,
    /// Wall-clock time of the bake in seconds, without reading and writing files.
    pub seconds: f64,
}

/// Bakes the cell-to-cell visibility on `threads` threads (0: as many as the machine has). `progress` is
/// called after every round.
///
/// # Errors
///
/// Returns a message when the map is too large or its coordinates too coarse to bake, or when threads cannot
/// be created.
pub fn bake(
    graph: &CellGraph,
    settings: BakerSettings,
    threads: usize,
    mut progress: impl FnMut(Progress) + Send,
) -> Result<Baked, String> {
    let pool =
        rayon::ThreadPoolBuilder::new().num_threads(threads).build().map_err(|error| error.to_string())?;
    let start = Instant::now();
    let outcome = pool.install(|| -> Result<Outcome, String> {
        let mut bake = Bake::new(CellBaker::new(graph, settings).map_err(|error| error.to_string())?);
        while let Some(now) = bake.advance() {
            progress(now);
        }
        Ok(bake.finish())
    })?;
    Ok(Baked { outcome, seconds: start.elapsed().as_secs_f64() })
}
