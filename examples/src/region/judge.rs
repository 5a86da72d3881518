//! What can be seen from a viewcell, by samples: item buffers from many viewpoints, and rays guided to gaps.
//! A lower bound of the truth, so that a conservative method must report all of it.
//!
//! Viewpoints keep a millionth of the viewcell's extent from its sides. The item buffer has a near plane at a
//! micrometre: with one at the near plane of a camera, viewpoints beside a wall would see through the wall.

use super::trial::timed;
use crate::walkthrough::World;
use glam::DVec3;
use visibility_core::pvs::Viewcell;
use visibility_core::{RegionCuller, View, VisibleSet};
use visibility_measure::{DrawnObject, ItemBuffer, MeasureError};
use visibility_region::SamplingCuller;

/// Distance of the near plane from the eye, in metres.
const NEAR: f64 = 1e-6;

/// How much to sample.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Effort {
    /// Number of viewpoints with an item buffer: corners, middle, middles of the sides, then at random.
    pub eyes: usize,
    /// Side of each of the six item buffers of a viewpoint, in pixels.
    pub side: u32,
    /// Number of rays.
    pub rays: usize,
}

/// Samples of viewcells of one world.
pub struct Judge<'a> {
    world: &'a World,
    effort: Effort,
    buffer: ItemBuffer,
    rays: SamplingCuller,
}

impl<'a> Judge<'a> {
    /// Makes a judge.
    ///
    /// # Errors
    ///
    /// Returns [`MeasureError::Size`] for a side that an item buffer cannot have.
    pub fn new(world: &'a World, effort: Effort) -> Result<Self, MeasureError> {
        let buffer = ItemBuffer::new(effort.side, effort.side)?;
        // Another seed than that of the method `rays`, which is judged too.
        let rays = SamplingCuller::new().with_rays(effort.rays).with_seed(0x6a75_6467_6521);
        Ok(Self { world, effort, buffer, rays })
    }

    /// Returns for each object of the source, by its index, whether a sample sees it from a viewcell. Returns
    /// the seconds of processor time that the item buffers took, too.
    ///
    /// # Errors
    ///
    /// Returns the errors of [`cubes`](Self::cubes).
    pub fn sample(&mut self, cell: &Viewcell) -> Result<(Vec<bool>, f64), MeasureError> {
        let mut seen = vec![false; self.world.source.objects.len()];
        let (drawn, seconds) = timed(|| self.cubes(cell, &mut seen));
        drawn?;
        self.rays.cull(&self.world.scene, cell, &mut VisibleSet::new());
        self.rays.sight_lines().iter().for_each(|line| seen[line.id.index()] = true);
        Ok((seen, seconds))
    }

    /// Draws the item buffers, and sets `seen` for the objects of which a pixel shows that no other object
    /// ties for. Objects that are no occluders hide nothing from a viewcell, and are drawn see-through.
    ///
    /// # Errors
    ///
    /// Returns [`MeasureError::TooMany`] if the scene has more triangles than an item buffer counts.
    pub fn cubes(&mut self, cell: &Viewcell, seen: &mut [bool]) -> Result<(), MeasureError> {
        let Self { world, effort, buffer, .. } = self;
        let all: Vec<_> = world
            .items()
            .filter_map(|item| {
                let object = world.scene.object(world.scene.id_at(item.key as usize)?).ok()?;
                let ends = [object.bounds.min, object.bounds.max];
                let corners = ends.map(|corner| corner.as_dvec3() + world.origin());
                Some((DrawnObject { see_through: !object.occluder, ..item }, corners))
            })
            .collect();
        for eye in viewpoints(cell, effort.eyes) {
            let Ok(faces) = View::cube_faces(eye, NEAR, f64::INFINITY) else { continue };
            for (face, view) in faces.iter().enumerate() {
                let is_ahead = |[min, max]: [DVec3; 2]| {
                    let (axis, min, max) = (face / 2, min - eye, max - eye);
                    let depth = if face % 2 == 0 { max[axis] } else { -min[axis] };
                    let beside = |i: usize| min[i].max(-max[i]) > depth;
                    // NaN bounds count as ahead.
                    let apart = depth < 0.0 || beside((axis + 1) % 3) || beside((axis + 2) % 3);
                    !apart
                };
                let drawn = all.iter().filter(|(_, corners)| is_ahead(*corners)).map(|&(item, _)| item);
                for object in buffer.draw(view, world.origin(), drawn)?.objects() {
                    seen[object.key as usize] |= object.pixels > 0;
                }
            }
        }
        Ok(())
    }
}

/// Returns up to `count` viewpoints of a viewcell, slightly within the sides of its box.
pub fn viewpoints(cell: &Viewcell, count: usize) -> Vec<DVec3> {
    let (middle, half) = ((cell.min + cell.max) * 0.5, (cell.max - cell.min) * (0.5 - 1e-6));
    let corner = |i: usize| DVec3::new((i & 1) as f64, (i >> 1 & 1) as f64, (i >> 2) as f64) * 2.0 - 1.0;
    let sides = (0..6).map(|i| DVec3::AXES[i % 3] * if i < 3 { 1.0 } else { -1.0 });
    let mut parts: Vec<DVec3> = (0..8).map(corner).chain([DVec3::ZERO]).chain(sides).collect();
    let mut state = 1u64;
    let mut unit = || {
        // Knuth's linear congruential generator; the upper bits are good.
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as f64 / (1u64 << 31) as f64
    };
    // Planes may cut off most of the box.
    let tries = if cell.planes.is_empty() { count } else { count.saturating_mul(64) };
    while parts.len() < tries {
        let mut part = DVec3::new(unit(), unit(), unit()) * 2.0 - 1.0;
        let side = (unit() * 6.0) as usize;
        if cell.planes.is_empty() {
            part[side % 3] = if side < 3 { 1.0 } else { -1.0 };
        }
        parts.push(part);
    }
    let eyes = parts.into_iter().map(|part| middle + half * part);
    eyes.filter(|&eye| cell.contains(eye)).take(count).collect()
}
