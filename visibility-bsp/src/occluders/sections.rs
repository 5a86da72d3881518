//! Sections of solids: rectangles inside closed boxes, which hide like walls although no face is there. The
//! inside of opaque solids was first used as an occluder by Schaufler, Dorsey, Decoret and Sillion,
//! "Conservative Volumetric Visibility with Occluder Fusion", 2000.
//!
//! # Why it is sound
//! A view ray that begins outside a closed box and meets a point of the box has met a face of the box before,
//! or at that point. So a rectangle whose every point is in some box of a set hides everything behind it, for
//! every eye outside all boxes of the set. `Selector` ensures that the eye is outside and that the near plane
//! does not cut away such a face. Boxes may abut or overlap, and their faces need not lie in one plane. For
//! example, one plane cuts a façade of walls, of the edges of the floors between them and of the ends of
//! other walls, and the section has no slits.
//!
//! # Which sections are made
//! Axis-aligned boxes are found as six rectangles of one object. Of all planes across an axis, those through
//! the near sides of boxes cut the largest sets of boxes at once, since no further box is cut until the next
//! one begins. Of the boxes that a plane cuts, only those that touch a box beginning there are considered.
//! Sections that are little larger than the rectangles made of their boxes' faces are left out. Faces covered
//! by a section close to them are dropped, so that one polygon replaces several.

use super::blocks::{BLOCK, bounds_of, halve};
use super::cover::join_group;
use super::outline::Outline;
use super::overlaps::{Rectangle, groups};
use super::rectangles::{Level, Levels, corners, from_ordered, ordered};
use super::work;
use alloc::collections::{BTreeMap, BTreeSet};
use alloc::vec::Vec;
use visibility_core::glam::DVec3;

/// A closed axis-aligned box of one object, in metres relative to `Scene::origin`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct SolidBox {
    /// Minimum corner, in metres relative to `Scene::origin`.
    pub(crate) min: DVec3,
    /// Maximum corner, in metres relative to `Scene::origin`.
    pub(crate) max: DVec3,
    /// Index of the box's object in the list given to `Occluders::add_from`.
    pub(super) source: u32,
}

/// Minimum area of a section (a rectangle inside closed boxes), as a multiple of the area of the largest
/// rectangle to which faces of these boxes in one plane can be joined. Smaller sections are left out.
const GAIN: f64 = 1.25;
/// Maximum distance between a section (a rectangle inside closed boxes) and a face that it replaces, as a
/// fraction of the face's shorter side.
const CLOSE: f64 = 0.25;
/// Maximum number of connected boxes in one plane from which sections are made; larger groups get none. If
/// more boxes than that touch the near side of a box, no section begins at that box.
const MAX_BOXES: usize = 256;
/// Maximum number of faces near a section (a rectangle inside closed boxes) that are tested for being covered
/// by it; the others stay.
const MAX_FACES: usize = 4096;

/// Finds the boxes of which all six faces are present as rectangles of one object, facing outwards or both
/// ways.
pub(super) fn solids(levels: &Levels) -> Vec<SolidBox> {
    // All faces, by object, plane and sides; and the faces perpendicular to x, in which the opposite faces of
    // boxes are looked for.
    let mut faces: BTreeSet<(u32, Level, [u64; 4])> = BTreeSet::new();
    let mut pairs: Vec<(u32, [u64; 4], u64, u8)> = Vec::new();
    for (&(axis, at, facing), rectangles) in levels {
        for r in rectangles {
            let sides = [r.low[0], r.low[1], r.high[0], r.high[1]].map(ordered);
            for side in (0..2).filter(|&side| facing == side || facing == 2) {
                faces.insert((r.source, (axis, at, side), sides));
            }
            if axis == 0 {
                pairs.push((r.source, sides, at, facing));
            }
        }
    }
    pairs.sort_unstable();
    let mut solids = Vec::new();
    for alike in pairs.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
        // By face perpendicular to x: x as ordered bits of the first face at or after it that looks along +x,
        // which may be the far side of a box. `u64::MAX`, which no finite coordinate has, if there is none.
        let mut far_sides = alloc::vec![u64::MAX; alike.len()];
        let mut next_far = u64::MAX;
        for (&(_, _, x1, far), side) in alike.iter().zip(&mut far_sides).rev() {
            next_far = if far == 0 { next_far } else { x1 };
            *side = next_far;
        }
        for &(source, sides, x0, near) in alike {
            // Where boxes abut, the far side of one has the same coordinate as the near side of the next.
            let next = alike.partition_point(|&(_, _, x1, _)| x1 <= x0);
            let Some(&x1) = far_sides.get(next).filter(|&&x1| near != 1 && x1 != u64::MAX) else { continue };
            let [y0, z0, y1, z1] = sides;
            let has = |axis, at, facing, sides| faces.contains(&(source, (axis, at, facing), sides));
            let closed = [(y0, 0), (y1, 1)].iter().all(|&(y, facing)| has(1, y, facing, [z0, x0, z1, x1]))
                && [(z0, 0), (z1, 1)].iter().all(|&(z, facing)| has(2, z, facing, [x0, y0, x1, y1]));
            if closed {
                let at = |p: [u64; 3]| DVec3::from_array(p.map(from_ordered));
                solids.push(SolidBox { min: at([x0, y0, z0]), max: at([x1, y1, z1]), source });
            }
        }
    }
    solids
}

/// Returns the coordinates of a point along the two axes that follow `axis` cyclically, such as (y, z) for
/// axis 0.
fn flat(v: DVec3, axis: usize) -> [f64; 2] {
    [v[(axis + 1) % 3], v[(axis + 2) % 3]]
}

/// A hierarchy of boxes for finding those that overlap or touch a given box.
struct Near {
    /// Indices into `boxes`, ordered so that consecutive runs of [`BLOCK`] are compact in space.
    order: Vec<u32>,
    /// Minimum and maximum corner of each box, in metres relative to `Scene::origin`.
    boxes: Vec<(DVec3, DVec3)>,
    /// By level from the bottom: bounds (minimum, maximum, in metres relative to `Scene::origin`) of each
    /// run of [`BLOCK`] entries of the level below. The lowest level bounds runs of `order`.
    levels: Vec<Vec<(DVec3, DVec3)>>,
}

impl Near {
    /// Builds the hierarchy over boxes given as (minimum corner, maximum corner), in metres relative to
    /// `Scene::origin`.
    fn new(boxes: Vec<(DVec3, DVec3)>) -> Self {
        let centers: Vec<DVec3> = boxes.iter().map(|(min, max)| *min * 0.5 + *max * 0.5).collect();
        let mut order: Vec<u32> = (0..boxes.len() as u32).collect();
        halve(&mut order, &centers);
        let mut levels = Vec::new();
        let mut level: Vec<(DVec3, DVec3)> = order.iter().map(|&i| boxes[i as usize]).collect();
        while level.len() > BLOCK {
            let around = |run: &[(DVec3, DVec3)]| bounds_of(run.iter().flat_map(|b| [b.0, b.1]));
            level = level.chunks(BLOCK).map(around).collect();
            levels.push(level.clone());
        }
        Self { order, boxes, levels }
    }

    /// Calls `each` with the indices of up to `most` boxes that overlap or touch the box from `min` to `max`.
    /// Returns true if there are no more such boxes, false if some were left out.
    fn touching(&self, min: DVec3, max: DVec3, most: usize, mut each: impl FnMut(u32)) -> bool {
        let mut left = most;
        let touches = |b: &(DVec3, DVec3)| b.0.cmple(max).all() && b.1.cmpge(min).all();
        // Stack of (level, block number), beginning with the blocks of the highest level.
        let last = self.levels.len();
        let all = self.levels.last().map_or(self.order.len(), Vec::len);
        let mut open: Vec<(usize, usize)> = (0..all).map(|block| (last, block)).collect();
        while let Some((level, block)) = open.pop() {
            let Some(below) = level.checked_sub(1) else {
                let number = self.order[block];
                work::step();
                if touches(&self.boxes[number as usize]) {
                    if left == 0 {
                        return false;
                    }
                    left -= 1;
                    each(number);
                }
                continue;
            };
            if touches(&self.levels[below][block]) {
                let count = below.checked_sub(1).map_or(self.order.len(), |below| self.levels[below].len());
                open.extend((block * BLOCK..((block + 1) * BLOCK).min(count)).map(|block| (below, block)));
            }
        }
        true
    }
}

/// Returns the sections of the given boxes: two-sided rectangles inside sets of boxes that abut or overlap.
/// Only sections that are larger by [`GAIN`] than the faces of their boxes are returned.
pub(super) fn sections(solids: &[SolidBox]) -> Vec<Outline> {
    let near = Near::new(solids.iter().map(|solid| (solid.min, solid.max)).collect());
    let mut outlines = Vec::new();
    for axis in 0..3 {
        // A section lies in a plane in which a box begins and into which another box reaches: the boxes
        // together hide whatever is behind the section.
        let mut planes: BTreeMap<u64, Vec<u32>> = BTreeMap::new();
        for (number, solid) in (0..).zip(solids) {
            planes.entry(ordered(solid.min[axis])).or_default().push(number);
        }
        for (&at, beginning) in &planes {
            let at = from_ordered(at);
            let (mut cut, mut deeper) = (Vec::new(), false);
            for &number in beginning {
                let SolidBox { min, mut max, .. } = solids[number as usize];
                max[axis] = at;
                let start = cut.len();
                // The list includes the box itself, which touches itself.
                if !near.touching(min, max, MAX_BOXES, |other| cut.push(other)) {
                    cut.truncate(start);
                }
                deeper |= cut[start..].iter().any(|&other| solids[other as usize].min[axis] < at);
            }
            if !deeper {
                continue;
            }
            cut.sort_unstable();
            cut.dedup();
            // The cuts of the boxes in this plane are joined to rectangles, as faces of walls are.
            let rectangle = |&number: &u32| {
                let SolidBox { min, max, .. } = solids[number as usize];
                Rectangle { low: flat(min, axis), high: flat(max, axis), source: number }
            };
            let rectangles: Vec<Rectangle> = cut.iter().map(rectangle).collect();
            for group in groups(&rectangles) {
                if !(2..=MAX_BOXES).contains(&group.len()) {
                    continue;
                }
                join_group(&group, |low, high, boxes| {
                    if !is_gain(solids, axis, low, high, &boxes) {
                        return;
                    }
                    let mut sources: Vec<u32> =
                        boxes.iter().map(|&number| solids[number as usize].source).collect();
                    sources.sort_unstable();
                    sources.dedup();
                    let vertices = corners(axis, at, low, high, false);
                    let inner = Vec::new();
                    outlines.push(Outline { vertices, inner, sources, solids: boxes, two_sided: true });
                });
            }
        }
    }
    outlines
}

/// Tests whether a section is large enough to be kept: whether its area is more than [`GAIN`] times that of
/// the largest rectangle to which faces of its boxes in one plane, cut to the section, can be joined. `low`
/// and `high` are the section's corners along the two axes after `axis`, and `boxes` are indices into
/// `solids`.
fn is_gain(solids: &[SolidBox], axis: usize, low: [f64; 2], high: [f64; 2], boxes: &[u32]) -> bool {
    let area = |low: [f64; 2], high: [f64; 2]| (high[0] - low[0]) * (high[1] - low[1]);
    let mut level: Vec<(u64, u32)> = Vec::new();
    let mut largest = 0.0f64;
    for side in 0..2 {
        level.clear();
        level.extend(boxes.iter().map(|&number| {
            let solid = &solids[number as usize];
            (ordered(if side == 0 { solid.min[axis] } else { solid.max[axis] }), number)
        }));
        level.sort_unstable();
        for one in level.chunk_by(|a, b| a.0 == b.0) {
            let parts: Vec<Rectangle> = one
                .iter()
                .map(|&(_, number)| {
                    let (min, max) =
                        (flat(solids[number as usize].min, axis), flat(solids[number as usize].max, axis));
                    let (low, high) =
                        ([0, 1].map(|i| min[i].max(low[i])), [0, 1].map(|i| max[i].min(high[i])));
                    Rectangle { low, high, source: number }
                })
                .collect();
            for group in groups(&parts) {
                join_group(&group, |low, high, _| largest = largest.max(area(low, high)));
            }
        }
    }
    area(low, high) > GAIN * largest
}

/// Removes each face or section (rectangle inside closed boxes) that another section close to it covers, if
/// every object that it is made of is also an object of that section.
pub(super) fn drop_covered(outlines: &mut Vec<Outline>) {
    let around = |outline: &Outline| bounds_of(outline.vertices.iter().copied());
    let boxes: Vec<(DVec3, DVec3)> = outlines.iter().map(around).collect();
    let axis_of = |(min, max): &(DVec3, DVec3)| (0..3).find(|&axis| min[axis] == max[axis]);
    let near = Near::new(boxes.clone());
    let mut kept = alloc::vec![true; outlines.len()];
    for (number, section) in outlines.iter().enumerate() {
        let (min, max) = boxes[number];
        let Some(axis) = axis_of(&boxes[number]).filter(|_| !section.solids.is_empty()) else { continue };
        let size = |min: DVec3, max: DVec3| {
            let [x, y] = flat(max - min, axis);
            x.min(y)
        };
        let (mut low, mut high) = (min, max);
        low[axis] -= CLOSE * size(min, max);
        high[axis] += CLOSE * size(min, max);
        near.touching(low, high, MAX_FACES, |other| {
            let (from, to) = boxes[other as usize];
            let (mut within_min, mut within_max) = (min, max);
            (within_min[axis], within_max[axis]) = (from[axis], to[axis]);
            let covered = other as usize != number
                && axis_of(&(from, to)) == Some(axis)
                && within_min.cmple(from).all()
                && within_max.cmpge(to).all()
                && (from[axis] - min[axis]).abs() <= CLOSE * size(from, to)
                && outlines[other as usize]
                    .sources
                    .iter()
                    .all(|source| section.sources.binary_search(source).is_ok());
            // Of two equal sections, the first is kept.
            let alike = !outlines[other as usize].solids.is_empty() && within_min == from && within_max == to;
            if covered && !(alike && number > other as usize) {
                kept[other as usize] = false;
            }
        });
    }
    let mut kept = kept.iter();
    outlines.retain(|_| kept.next().copied().unwrap_or(true));
}

#[cfg(test)]
mod tests {
    use super::super::outline::OccluderTriangle;
    use super::super::rectangles::take_rectangles;
    use super::*;
    use visibility_core::OccluderMesh;
    use visibility_testing::Random;

    /// Triangles of a box, two for each of six faces.
    fn faces([min, max]: [DVec3; 2]) -> Vec<OccluderTriangle> {
        let corner = |i: u32| {
            DVec3::from_array([0, 1, 2].map(|axis| if i >> axis & 1 != 0 { max } else { min }[axis]))
        };
        let triangle = |t: [u32; 3]| OccluderTriangle { corners: t.map(corner), source: 0, two_sided: false };
        OccluderMesh::CUBOID.map(triangle).into()
    }

    #[test]
    fn boxes_are_solid_if_all_faces_are_there_and_look_outwards() {
        let count = |mut triangles: Vec<OccluderTriangle>| solids(&take_rectangles(&mut triangles)).len();
        let unit = [DVec3::ZERO, DVec3::new(1.0, 2.0, 3.0)];
        assert_eq!(count(faces(unit)), 1, "a box");
        let mut two_sided = faces(unit);
        two_sided.iter_mut().for_each(|triangle| triangle.two_sided = true);
        assert_eq!(count(two_sided), 1, "a two-sided box");
        let abutting = unit.map(|p| p + DVec3::X);
        assert_eq!(count([faces(unit), faces(abutting)].concat()), 2, "two boxes, one beside the other");
        for axis in 0..3 {
            for end in unit {
                let is_face = |t: &OccluderTriangle| t.corners.iter().all(|p| p[axis] == end[axis]);
                let mut open = faces(unit);
                open.retain(|triangle| !is_face(triangle));
                assert_eq!(
                    (open.len(), count(open)),
                    (10, 0),
                    "a box without the face at {end} across axis {axis}"
                );
                let mut turned = faces(unit);
                turned.iter_mut().filter(|t| is_face(t)).for_each(|t| t.corners.reverse());
                assert_eq!(count(turned), 0, "a box whose face at {end} across axis {axis} looks inwards");
            }
        }
    }

    #[test]
    fn boxes_that_touch_are_found_and_no_others() {
        let mut random = Random(18);
        let whole = |random: &mut Random, most| {
            DVec3::from_array(core::array::from_fn(|_| random.below(most) as f64))
        };
        for count in [1, 5, 32, 33, 2000] {
            let boxes: Vec<(DVec3, DVec3)> = (0..count)
                .map(|_| {
                    let min = whole(&mut random, 20);
                    (min, min + whole(&mut random, 3))
                })
                .collect();
            let near = Near::new(boxes.clone());
            for _ in 0..200 {
                let min = whole(&mut random, 20);
                let max = min + whole(&mut random, 4);
                let mut found = Vec::new();
                assert!(near.touching(min, max, count, |number| found.push(number)), "all of {count} boxes");
                found.sort_unstable();
                let touches =
                    |b: &(DVec3, DVec3)| (0..3).all(|axis| b.0[axis] <= max[axis] && b.1[axis] >= min[axis]);
                let expected: Vec<u32> =
                    (0..).zip(&boxes).filter(|(_, b)| touches(b)).map(|(i, _)| i).collect();
                assert_eq!(found, expected, "{count} boxes, from {min} to {max}");
            }
        }
    }
}
