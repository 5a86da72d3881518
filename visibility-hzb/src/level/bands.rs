//! Drawing a level on several threads: each draws bands of the buffer.
//!
//! The clusters that may be seen are found once. A band is a fixed range of rows of tiles, and is drawn as if
//! the buffer had no other rows, into tiles of its own, which are then copied to the buffer. A cluster that
//! is hidden in a band is not drawn there, so bands may hold less than the buffer drawn as a whole, in
//! pixels that are hidden to all that is worth drawing.

use super::draw::{Candidate, LevelScratch};
use super::frame::LevelFrame;
use super::prepared::PreparedLevel;
use crate::buffer::tiles::Tiles;
use crate::coverage::Coverage;
use crate::lanes::greatest;
use crate::simd::Kernels;
use alloc::vec::Vec;
use visibility_core::jobs::{Jobs, for_each_part};
use visibility_core::simd::Simd;

/// Number of bands. More bands would share the work among more threads, but what lies in several bands is set
/// up in each (measured with all bands on one thread: two bands take 1.2 times, four 1.3 times as long as the
/// buffer as a whole).
const BANDS: usize = 2;

/// The raster of a level, with its memory from frame to frame.
#[derive(Clone, Debug, Default)]
pub(crate) struct LevelRaster {
    /// Clusters that may be seen, nearest first.
    candidates: Vec<Candidate>,
    scratch: LevelScratch,
    /// Empty before the first frame on several threads, then [`BANDS`] elements.
    bands: Vec<Band>,
}

/// A band of the buffer.
#[derive(Clone, Debug)]
struct Band {
    scratch: LevelScratch,
    /// A buffer of which only the rows of the band are used.
    tiles: Tiles,
    /// Upper bound on the depth keys of what was drawn.
    nearest: f32,
}

impl LevelRaster {
    /// Draws a level into `tiles`, which are empty. Returns an upper bound on the depth keys of what was
    /// drawn.
    pub(crate) fn draw(
        &mut self,
        simd: Simd,
        level: &PreparedLevel,
        frame: &LevelFrame,
        coverage: Coverage,
        tiles: &mut Tiles,
    ) -> f32 {
        simd.find_candidates(level, frame, &mut self.candidates);
        simd.draw_candidates(level, frame, coverage, &self.candidates, &mut self.scratch, tiles)
    }

    /// Draws a level like [`draw`](Self::draw), in bands on the threads of a job system.
    pub(crate) fn draw_on(
        &mut self,
        jobs: &dyn Jobs,
        simd: Simd,
        level: &PreparedLevel,
        frame: &LevelFrame,
        coverage: Coverage,
        tiles: &mut Tiles,
    ) -> f32 {
        simd.find_candidates(level, frame, &mut self.candidates);
        let empty = || Band {
            scratch: LevelScratch::default(),
            tiles: Tiles::new_like(tiles),
            nearest: f32::NEG_INFINITY,
        };
        self.bands.resize_with(BANDS, empty);
        let Some(bands) = self.bands.first_chunk_mut::<BANDS>() else { return f32::NEG_INFINITY };
        let candidates = &self.candidates;
        let mut ends = [0; BANDS];
        for i in 0..BANDS {
            ends[i] = tiles.rows * (i + 1) / BANDS;
        }
        let mut band = bands.iter_mut();
        let parts = tiles.split_rows(ends).map(|rows| (rows, band.next()));
        for_each_part(jobs, parts, |(mut rows, band)| {
            let Some(band) = band else { return };
            band.tiles.clear();
            let frame = frame.of_rows(rows.range());
            let (scratch, tiles) = (&mut band.scratch, &mut band.tiles);
            band.nearest = simd.draw_candidates(level, &frame, coverage, candidates, scratch, tiles);
            rows.copy(tiles);
        });
        tiles.take_depth_planes(bands.each_ref().map(|band| &band.tiles));
        bands.iter().fold(f32::NEG_INFINITY, |nearest, band| greatest(band.nearest, nearest))
    }
}
