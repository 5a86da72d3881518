//! The raster of levels, and drawing it on several threads, each of which draws bands of the buffer.
//!
//! The clusters that may be seen are found once. A band is a fixed range of tile columns. It is drawn into
//! tiles of its own, as if the buffer had no other columns, and then copied to the buffer. Bands divide
//! columns rather than rows, since more clusters would be in several bands of rows: a floor or a wall of a
//! room is in most rows. A cluster that is hidden in a band is not drawn there, so a pixel of a band may keep
//! a slightly farther depth key than if the buffer were drawn as a whole.

use super::draw::{CANDIDATE_WORK, Candidate, Candidates, LevelScratch, draw_candidates};
use super::frame::LevelFrame;
use super::prepared::PreparedLevel;
use crate::buffer::tiles::Tiles;
use crate::lanes::greatest;
use crate::simd_dispatch::Kernels;
use alloc::sync::Arc;
use alloc::vec::Vec;
use visibility_core::jobs::{Jobs, for_each_part};
use visibility_core::simd::Simd;

/// Number of bands. More bands would share the work among more threads, but a cluster in several bands is set
/// up in each. Measured with all bands on one thread, two bands take 1.05 times as long as the whole buffer,
/// four 1.25 times. Two equal halves share the work better than a division at the clusters' median.
const BANDS: usize = 2;

/// The raster of levels, with its memory from frame to frame.
#[derive(Clone, Debug, Default)]
pub(crate) struct LevelRaster {
    /// Clusters that may be seen, by level and number.
    candidates: Vec<Candidate>,
    /// Order of drawing, nearest first: indices of `candidates` in the lower half of each element, below the
    /// candidate's key. Sorting these takes a fraction of the time of sorting candidates.
    order: Vec<u64>,
    scratch: LevelScratch,
    bands: [Band; BANDS],
    /// Buffers of all bands but the first, which is drawn into the `tiles` given to [`draw`](Self::draw).
    /// Empty before the first frame on several threads.
    tiles: Vec<Tiles>,
}

/// A range of tile columns of the buffer, which one thread draws.
#[derive(Clone, Debug, Default)]
struct Band {
    /// Half-open range of tile columns.
    columns: [usize; 2],
    /// View of each level, limited to the columns of the band. `None` for a level that is not drawn.
    frames: Vec<Option<LevelFrame>>,
    scratch: LevelScratch,
    /// Results of drawing the band: an upper bound on the depth keys of the clusters drawn, and the work
    /// spent, in triangles.
    drawn: (f32, f32),
}

impl LevelRaster {
    /// Draws levels into `tiles`, which must be empty: the nearest clusters of all levels first, until about
    /// `work` is spent, counted in the time that a triangle takes. With a job system, bands of columns are
    /// drawn on its threads, and each band may spend `work`. `frames` has the view for each level, `None` for
    /// a level that is not drawn. Returns an upper bound on the depth keys drawn, and the work spent.
    pub(crate) fn draw(
        &mut self,
        simd: Simd,
        levels: &[Arc<PreparedLevel>],
        frames: &[Option<LevelFrame>],
        work: f32,
        jobs: Option<&dyn Jobs>,
        tiles: &mut Tiles,
    ) -> (f32, f32) {
        let spent = self.find_candidates(simd, levels, frames);
        let (candidates, left) = (Candidates { all: &self.candidates, order: &self.order }, work - spent);
        let (nearest, drawn) = match jobs {
            None => {
                let scratch = &mut self.scratch;
                draw_candidates(simd, levels, frames, candidates, left, scratch, tiles)
            }
            Some(jobs) => {
                // A band is a range of tile columns. The first band is drawn into `tiles` itself, every other
                // band into tiles of its own, so that no two threads write the same memory.
                self.tiles.resize_with(BANDS - 1, || Tiles::new_like(tiles));
                for (i, band) in self.bands.iter_mut().enumerate() {
                    band.columns = [i, i + 1].map(|i| tiles.columns * i / BANDS);
                }
                let (mut first, mut others) = (Some(&mut *tiles), self.tiles.iter_mut());
                let mut own_tiles = || first.take().or_else(|| others.next());
                let parts = self.bands.each_mut().map(|band| (band, own_tiles()));
                for_each_part(jobs, parts, |(band, tiles)| {
                    let Some(tiles) = tiles else { return };
                    tiles.clear();
                    let own = frames.iter().map(|frame| Some(frame.as_ref()?.of_columns(band.columns)));
                    band.frames.clear();
                    band.frames.extend(own);
                    let (own, scratch) = (&band.frames, &mut band.scratch);
                    band.drawn = draw_candidates(simd, levels, own, candidates, left, scratch, tiles);
                });
                // Bands are disjoint, so copying the columns of each gives the same buffer in whatever order
                // the threads finish.
                for (band, own) in self.bands[1..].iter().zip(&self.tiles) {
                    tiles.take_columns(own, band.columns);
                }
                self.bands.iter().fold((f32::NEG_INFINITY, 0.0), |(nearest, work), band| {
                    (greatest(band.drawn.0, nearest), work + band.drawn.1)
                })
            }
        };
        (nearest, spent + drawn)
    }

    /// Replaces the candidates by the clusters of all levels that may be seen, and `order` by their order of
    /// drawing. Returns the work spent.
    fn find_candidates(
        &mut self,
        simd: Simd,
        levels: &[Arc<PreparedLevel>],
        frames: &[Option<LevelFrame>],
    ) -> f32 {
        self.candidates.clear();
        let mut looked_at = 0;
        for (index, (level, frame)) in (0..).zip(levels.iter().zip(frames)) {
            if let Some(frame) = frame {
                looked_at += simd.find_candidates(index, level, frame, &mut self.candidates);
            }
        }
        self.order.clear();
        self.order.extend((0..).zip(&self.candidates).map(|(index, candidate)| candidate.sort_key(index)));
        self.order.sort_unstable();
        CANDIDATE_WORK * looked_at as f32
    }
}
