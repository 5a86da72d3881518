//! Sampled visibility from a viewcell: item buffers from many viewpoints, and rays guided to gaps. The result
//! is a lower bound of the truth, so a conservative method must report all of it.
//!
//! Samples are lines of sight in rounded arithmetic. If a method leaves out a sampled object, exact
//! arithmetic decides: the method is wrong if a line to the object misses all occluders. A method with a
//! clearance only promises lines that keep six times the clearance from all occluders, so only such lines
//! count against it.
//!
//! Viewpoints keep a millionth of the viewcell's extent from its sides. The near plane of the item buffer is
//! at a micrometre, because with the near plane of a camera, viewpoints beside a wall would see through the
//! wall.

use super::timing::timed;
use crate::SourceObject;
use crate::walkthrough::World;
use glam::{DVec3, Vec3};
use std::collections::BTreeMap;
use visibility_core::pvs::Viewcell;
use visibility_core::{ObjectId, RegionCuller, View, VisibleSet};
use visibility_measure::{DrawnObject, ItemBuffer, MeasureError};
use visibility_region::SamplingCuller;
use visibility_testing::{distance, orientation_sign};

/// Distance of the near plane from the eye, in metres.
const NEAR: f64 = 1e-6;

/// Number of samples.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Effort {
    /// Number of viewpoints with an item buffer. The first are corners, middle and middles of the sides; the
    /// others are random.
    pub eyes: usize,
    /// Side in pixels of the six item buffers around a viewpoint.
    pub side: u32,
    /// Number of rays per viewcell.
    pub rays: usize,
}

/// Verdict of exact arithmetic on sampled objects that a method left out. Objects in neither list were only
/// visible by rounding.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct LeftOut {
    /// Indices of objects with a line of sight that the method should have found, ascending.
    pub false_hidden: Vec<u32>,
    /// Indices of objects that are only seen along lines that come within six times the clearance of an
    /// occluder, as far as samples show, ascending.
    pub narrow: Vec<u32>,
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
        // A seed other than that of the method `rays`, which is judged too.
        let rays = SamplingCuller::new().with_rays(effort.rays).with_seed(0x6a75_6467_6521);
        Ok(Self { world, effort, buffer, rays })
    }

    /// Returns for each object of the source, by its index, whether a sample sees it from a viewcell, and the
    /// processor time in seconds of the item buffers.
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

    /// Draws the item buffers, and sets `seen` for each object that has a pixel in which no other object is
    /// equally near. Objects that do not occlude are drawn see-through.
    ///
    /// # Errors
    ///
    /// Returns [`MeasureError::TooMany`] if the scene has more triangles than an item buffer counts.
    pub fn cubes(&mut self, cell: &Viewcell, seen: &mut [bool]) -> Result<(), MeasureError> {
        self.draw(cell, &mut |_, _, buffer| {
            buffer
                .visible()
                .objects()
                .iter()
                .for_each(|object| seen[object.key as usize] |= object.pixels > 0);
        })
    }

    /// Decides which of the sampled objects that a method left out are false hidden. `clearance` is the
    /// method's, in metres. `lines` are lines of sight of methods in world space, with the indices of the
    /// objects that they reach. The rays of the last call of [`sample`](Self::sample), which must be for the
    /// same viewcell, are tried too, and then pixels of item buffers.
    ///
    /// # Errors
    ///
    /// Returns the errors of [`cubes`](Self::cubes).
    pub fn decide(
        &mut self,
        cell: &Viewcell,
        left_out: &[u32],
        clearance: f64,
        lines: &[(u32, [DVec3; 2])],
    ) -> Result<LeftOut, MeasureError> {
        let mut open: Vec<u32> = left_out.to_vec();
        let mut found = LeftOut::default();
        let rays =
            self.rays.sight_lines().iter().map(|line| (line.id.index() as u32, [line.eye, line.point]));
        let tried: Vec<_> = lines.iter().copied().chain(rays).collect();
        let (origin, world) = (self.world.origin(), self.world);
        let mut decide = |open: &mut Vec<u32>, object: u32, [from, to]: [DVec3; 2]| {
            let Ok(place) = open.binary_search(&object) else { return };
            let is_line = |keep| has_line_of_sight(world, object, [from - origin, to - origin], keep);
            if is_line(6.0 * clearance) {
                open.remove(place);
                found.false_hidden.push(object);
            } else if clearance > 0.0 && !found.narrow.contains(&object) && is_line(0.0) {
                found.narrow.push(object);
            }
        };
        tried.into_iter().for_each(|(object, line)| decide(&mut open, object, line));
        if !open.is_empty() {
            let pixels = self.pixel_lines(cell, &open)?;
            pixels.into_iter().for_each(|(object, line)| decide(&mut open, object, line));
        }
        found.narrow.retain(|object| open.binary_search(object).is_ok());
        found.false_hidden.sort_unstable();
        found.narrow.sort_unstable();
        Ok(found)
    }

    /// Returns lines of sight in world space through pixels that show the wanted objects: at most 16 for each
    /// object and item buffer.
    fn pixel_lines(
        &mut self,
        cell: &Viewcell,
        objects: &[u32],
    ) -> Result<Vec<(u32, [DVec3; 2])>, MeasureError> {
        const MOST: usize = 16;
        let mut lines = Vec::new();
        self.draw(cell, &mut |eye, view, buffer| {
            let (side, drawn) = (buffer.width() as usize, buffer.visible());
            let key = |triangle: u32| Some(drawn.objects()[drawn.object_of(triangle)?].key);
            let mut pixels: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
            for (pixel, &opaque) in buffer.items().iter().enumerate() {
                let pane = buffer.see_through_item((pixel % side) as u32, (pixel / side) as u32);
                for key in [opaque, pane].into_iter().filter_map(key) {
                    if objects.binary_search(&key).is_ok() {
                        pixels.entry(key).or_default().push(pixel);
                    }
                }
            }
            let world_from_clip = view.clip_from(eye).inverse();
            for (key, pixels) in pixels {
                for &pixel in pixels.iter().step_by(pixels.len().div_ceil(MOST)) {
                    let ndc = |at: usize| (2.0 * at as f64 + 1.0) / side as f64 - 1.0;
                    let point = DVec3::new(ndc(pixel % side), -ndc(pixel / side), view.depth().at_near());
                    lines.push((key, [eye, eye + world_from_clip.project_point3(point)]));
                }
            }
        })?;
        Ok(lines)
    }

    /// Draws the item buffers of all viewpoints, and passes each buffer on with its viewpoint and view.
    fn draw(
        &mut self,
        cell: &Viewcell,
        each: &mut dyn FnMut(DVec3, &View, &ItemBuffer),
    ) -> Result<(), MeasureError> {
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
                    // Objects with NaN bounds are kept: they count as in front of the viewpoint.
                    let apart = depth < 0.0 || beside((axis + 1) % 3) || beside((axis + 2) % 3);
                    !apart
                };
                let drawn = all.iter().filter(|(_, corners)| is_ahead(*corners)).map(|&(item, _)| item);
                buffer.draw(view, world.origin(), drawn)?;
                each(eye, view, buffer);
            }
        }
        Ok(())
    }
}

/// Tests, relative to the scene's origin, whether a segment from the viewpoint `from` towards `through`
/// reaches the object: it meets a triangle of the object, and up to a millionth of its length before this
/// point it keeps more than `keep` metres from all occluders. With `keep` 0 it must miss all occluders in
/// exact arithmetic.
fn has_line_of_sight(world: &World, object: u32, [from, through]: [DVec3; 2], keep: f64) -> bool {
    let target = &world.source.objects[object as usize];
    if from == through {
        // The object touches the viewpoint, so it is visible.
        return true;
    }
    let direction = through - from;
    let hits = target.triangles.iter().filter_map(|t| hit(from, direction, &t));
    let to = from + direction * (hits.fold(f64::INFINITY, f64::min) * (1.0 - 1e-6));
    // Exact arithmetic needs coordinates of 24 bits, so the ends of the segment are first rounded to f32.
    let [from, to] = [from, to].map(|end| end.as_vec3().as_dvec3());
    if !to.is_finite() {
        return false;
    }
    let (low, high) = (from.min(to) - keep, from.max(to) + keep);
    let is_near = |min: DVec3, max: DVec3| low.cmple(max).all() && min.cmple(high).all();
    let is_blocked = |id: ObjectId, of: &SourceObject| {
        world.scene.bounds(id).is_ok_and(|b| is_near(b.min.as_dvec3(), b.max.as_dvec3()))
            && of.triangles.iter().any(|t| {
                let corners = t.map(Vec3::as_dvec3);
                let (min, max) = (corners[0].min(corners[1]), corners[0].max(corners[1]));
                is_near(min.min(corners[2]), max.max(corners[2]))
                    && !(of.one_sided && orientation_sign(corners[0], corners[1], corners[2], from) <= 0)
                    && if keep > 0.0 { distance(from, to, &t) <= keep } else { touches(from, to, corners) }
            })
    };
    !world.source.objects.iter().enumerate().any(|(index, of)| {
        let id = world.scene.id_at(index).filter(|_| index != object as usize);
        id.is_some_and(|id| world.scene.object(id).is_ok_and(|o| o.occluder) && is_blocked(id, of))
    })
}

/// Returns the distance at which a ray meets a triangle, in lengths of `direction` (Moeller and Trumbore,
/// "Fast, Minimum Storage Ray/Triangle Intersection", 1997). `None` if the ray misses the triangle or starts
/// behind it.
fn hit(from: DVec3, direction: DVec3, triangle: &[Vec3; 3]) -> Option<f64> {
    let [a, b, c] = triangle.map(Vec3::as_dvec3);
    let (across, offset) = (direction.cross(c - a), from - a);
    let scale = 1.0 / (b - a).dot(across);
    let turned = offset.cross(b - a);
    let (u, v, t) = (offset.dot(across) * scale, direction.dot(turned) * scale, (c - a).dot(turned) * scale);
    (u >= -1e-9 && v >= -1e-9 && u + v <= 1.0 + 1e-9 && t > 0.0).then_some(t)
}

/// Tests in exact arithmetic whether a segment touches a triangle. True if it lies in the triangle's plane.
fn touches(from: DVec3, to: DVec3, [a, b, c]: [DVec3; 3]) -> bool {
    if orientation_sign(a, b, c, from) * orientation_sign(a, b, c, to) > 0 {
        return false;
    }
    let turns = [[a, b], [b, c], [c, a]].map(|[p, q]| orientation_sign(from, to, p, q));
    turns.iter().all(|&turn| turn >= 0) || turns.iter().all(|&turn| turn <= 0)
}

/// Returns up to `count` viewpoints inside a viewcell, slightly away from the sides of its box.
pub fn viewpoints(cell: &Viewcell, count: usize) -> Vec<DVec3> {
    let (middle, half) = ((cell.min + cell.max) * 0.5, (cell.max - cell.min) * (0.5 - 1e-6));
    let corner = |i: usize| DVec3::new((i & 1) as f64, (i >> 1 & 1) as f64, (i >> 2) as f64) * 2.0 - 1.0;
    let sides = (0..6).map(|i| DVec3::AXES[i % 3] * if i < 3 { 1.0 } else { -1.0 });
    let mut parts: Vec<DVec3> = (0..8).map(corner).chain([DVec3::ZERO]).chain(sides).collect();
    let mut state = 1u64;
    let mut unit = || {
        // Knuth's linear congruential generator. Only the upper bits are used, since the lower ones are less
        // random.
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as f64 / (1u64 << 31) as f64
    };
    // Makes more random points if the viewcell has planes, since these may cut off most of the box.
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
