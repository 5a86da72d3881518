//! Maps from files, and bakes of them on several threads.

use std::path::Path;
use std::time::Instant;
use visibility_core::bake::{Bake, Progress};
use visibility_core::cells::CellGraph;
use visibility_portals::{CellBaker, Outcome, Settings, prt};

/// A map, by the name of its file.
pub struct Map {
    /// The name, without directories and extension.
    pub name: String,
    /// Its cells and portals.
    pub graph: CellGraph,
}

/// Reads a `.prt` file.
///
/// # Errors
/// What the file system says, or what is wrong with the file and on which line.
pub fn read(path: &Path) -> Result<Map, String> {
    let bytes = std::fs::read(path).map_err(|error| format!("cannot read {}: {error}", path.display()))?;
    // Anything but the numbers is passed over or refused by the reader, which then knows the line.
    let file = prt::read(&String::from_utf8_lossy(&bytes))
        .map_err(|error| format!("{}: {error}", path.display()))?;
    let name = path.file_stem().unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
    Ok(Map { name, graph: file.graph })
}

/// A finished bake and what it took.
pub struct Baked {
    /// Which cells see which.
    pub outcome: Outcome,
    /// Seconds on the clock, without reading and writing files.
    pub seconds: f64,
}

/// Bakes on a number of threads (0: as many as there are), telling of every round.
///
/// # Errors
/// A map too large or too coarse to bake, or no threads to be had.
pub fn bake(
    graph: &CellGraph,
    settings: Settings,
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
