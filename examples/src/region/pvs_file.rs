//! Files of visible sets with their viewcells, written by the program `region` and read by `walkthrough`.
//!
//! The header of [`binary_format`](visibility_core::binary_format) with the number of objects as its
//! fingerprint, the number of viewcells (`u32`), the corners of each (six times the bits of an `f64`), then
//! the bytes of a [`Pvs`] of object indices.

use super::output::Judged;
use std::path::Path;
use visibility_core::Scene;
use visibility_core::binary_format::{Format, Reader, Writer};
use visibility_core::glam::DVec3;
use visibility_core::pvs::{Pvs, PvsTargets, ScenePvs, Viewcell, Viewcells};

const FORMAT: Format = Format { magic: *b"VISIREGI", version: 1 };

/// Writes the objects that the first method reports from each viewcell.
///
/// # Errors
///
/// Returns a message if the sets are too large to be stored, or the file cannot be written.
pub fn write(path: &Path, objects: usize, results: &[Judged]) -> Result<(), String> {
    let rows: Vec<Vec<u32>> = results
        .iter()
        .map(|judged| judged.trials.first().map_or_else(Vec::new, |trial| trial.reported.clone()))
        .collect();
    let pvs = Pvs::new(PvsTargets::Objects, objects, &rows, |_| None).map_err(|error| error.to_string())?;
    let mut file = Writer::new(FORMAT, 0, objects as u64);
    file.u32(results.len() as u32);
    for Judged { cell, .. } in results {
        file.u64s(cell.min.to_array().into_iter().chain(cell.max.to_array()).map(f64::to_bits));
    }
    file.u32(pvs.as_bytes().len() as u32);
    file.bytes(pvs.as_bytes());
    std::fs::write(path, file.finish()).map_err(|error| format!("cannot write {}: {error}", path.display()))
}

/// Reads a file of visible sets for a scene whose objects have the indices of the file.
///
/// # Errors
///
/// Returns a message if the file cannot be read, is damaged, or belongs to a scene with another number of
/// objects.
pub fn read(path: &Path, scene: &Scene) -> Result<ScenePvs, String> {
    let named = |error: String| format!("{}: {error}", path.display());
    let bytes = std::fs::read(path).map_err(|error| named(error.to_string()))?;
    parse(&bytes, scene).map_err(named)
}

fn parse(bytes: &[u8], scene: &Scene) -> Result<ScenePvs, String> {
    let text = |error: visibility_core::binary_format::FormatError| error.to_string();
    let mut file = Reader::new(bytes, FORMAT).map_err(text)?;
    file.expect(0, scene.index_limit() as u64).map_err(text)?;
    let count = file.u32().map_err(text)?;
    let mut cells = Vec::new();
    for _ in 0..count {
        let corners: Vec<f64> = file.u64s(6).map_err(text)?.into_iter().map(f64::from_bits).collect();
        cells.push(Viewcell::from_box(DVec3::from_slice(&corners[..3]), DVec3::from_slice(&corners[3..])));
    }
    let length = file.u32().map_err(text)? as usize;
    let pvs = file.bytes(length).map_err(text)?.to_vec();
    file.end().map_err(text)?;
    let pvs = Pvs::from_bytes(pvs).map_err(|error| error.to_string())?;
    if pvs.viewcell_count() != cells.len() {
        return Err("the numbers of viewcells and of visible sets differ".to_owned());
    }
    let pairs: Vec<_> = scene.ids().map(|id| (id, id.index() as u32)).collect();
    Ok(ScenePvs::new(scene, pvs, Viewcells::new(cells), pairs))
}

#[cfg(test)]
mod tests {
    use super::*;
    use visibility_core::Aabb;

    #[test]
    fn a_file_is_read_for_its_scene_alone_and_damage_is_found() {
        let mut scene = Scene::new();
        scene.insert_batch((0..5).map(|i| Aabb::from_arrays([i as f32; 3], [i as f32 + 1.0; 3])));
        let cell = Viewcell::from_box(DVec3::ZERO, DVec3::ONE);
        let results = [Judged { cell, sampled: vec![false; 5], trials: Vec::new() }];
        let path = std::env::temp_dir().join(format!("visibility-pvs-{}", std::process::id()));
        write(&path, 5, &results).expect("a small file");
        let bytes = std::fs::read(&path).expect("just written");
        assert!(read(&path, &scene).is_ok());
        std::fs::remove_file(&path).expect("just read");
        for at in 0..bytes.len() {
            assert!(parse(&bytes[..at], &scene).is_err());
            let mut damaged = bytes.clone();
            damaged[at] ^= 4;
            assert!(parse(&damaged, &scene).is_err(), "byte {at}");
        }
        scene.insert(Aabb::from_arrays([0.0; 3], [1.0; 3]));
        assert!(parse(&bytes, &scene).is_err());
    }
}
