//! Random scenes in which an object is visible from a viewcell through slots, each with an unobstructed
//! segment.
//!
//! All coordinates are multiples of 2^-15 m below 512 m: exact in `f32`, and 24-bit integers here. Whether
//! the segment misses every triangle is decided by products of three differences, which are exact in `i128`.

use crate::Random;
use visibility_core::glam::{Affine3A, DVec3, Vec3};
use visibility_core::pvs::Viewcell;
use visibility_core::{Aabb, Object, ObjectId, OccluderMesh, RegionCuller, Scene, VisibleSet};

/// Number of coordinate units per metre.
const PER_METRE: f64 = 32_768.0;

/// Greatest magnitude of a coordinate, which fits in the 24 bits of an `f32`.
const FARTHEST: i64 = 1 << 24;

pub(crate) type Point = [i64; 3];

/// Scene of screens with slots between a viewcell and a target.
pub struct SlotScene {
    /// Scene of the screens, the target, and objects that do not occlude.
    pub scene: Scene,
    /// The viewcell, a box.
    pub cell: Viewcell,
    /// Object behind the screens.
    pub target: ObjectId,
    /// Segment through all slots, from a point of the viewcell to a point of the target's box.
    pub segment: [DVec3; 2],
    /// Widths of the slots in metres, nearest screen first. Negative if the panels of a screen overlap.
    pub slots: Vec<f64>,
    /// Whether the segment certainly misses every triangle, so that the target is visible.
    pub is_seen: bool,
}

/// Result of a search for visible objects that a culler hides.
#[derive(Debug, Default)]
pub struct SlotSearch {
    /// Number of scenes with a visible target.
    pub seen: usize,
    /// Number of scenes with a closed screen.
    pub closed: usize,
    /// Number of scenes with a closed screen whose target was hidden.
    pub hidden: usize,
    /// Numbers of the scenes with a visible target that was hidden.
    pub wrong: Vec<usize>,
}

/// Returns the exact sign of the volume of a tetrahedron.
pub(crate) fn orientation(a: Point, b: Point, c: Point, d: Point) -> i128 {
    let [u, v, w] = [b, c, d].map(|p| [0, 1, 2].map(|i| i128::from(p[i] - a[i])));
    let cross = [v[1] * w[2] - v[2] * w[1], v[2] * w[0] - v[0] * w[2], v[0] * w[1] - v[1] * w[0]];
    (u[0] * cross[0] + u[1] * cross[1] + u[2] * cross[2]).signum()
}

/// Returns whether a segment misses a closed triangle. Always false for a segment in the triangle's plane,
/// even one that misses it.
fn misses([p, q]: [Point; 2], [a, b, c]: [Point; 3]) -> bool {
    if orientation(a, b, c, p) * orientation(a, b, c, q) > 0 {
        return true;
    }
    let sides = [orientation(p, q, a, b), orientation(p, q, b, c), orientation(p, q, c, a)];
    sides.contains(&1) && sides.contains(&-1)
}

/// Map from construction coordinates (two across the line of sight, then one along it) to scene coordinates.
struct Frame {
    /// For each construction coordinate, its axis in the scene (0 to 2) and its sign (1 or -1).
    axes: [(usize, i64); 3],
    offset: Point,
}

impl Frame {
    fn to_scene(&self, p: Point) -> Point {
        let mut scene = self.offset;
        for (at, (axis, sign)) in p.into_iter().zip(self.axes) {
            scene[axis] += at * sign;
        }
        scene.map(|at| at.clamp(-FARTHEST, FARTHEST))
    }

    /// Returns whether the map mirrors.
    fn is_mirrored(&self) -> bool {
        let [(a, p), (b, q), (_, r)] = self.axes;
        ((b + 3 - a) % 3 == 1) == (p * q * r < 0)
    }

    /// Returns the box in the scene between two opposite corners in construction coordinates.
    fn bounds(&self, p: Point, q: Point) -> [Point; 2] {
        let (p, q) = (self.to_scene(p), self.to_scene(q));
        [[0, 1, 2].map(|i| p[i].min(q[i])), [0, 1, 2].map(|i| p[i].max(q[i]))]
    }
}

fn metres(p: Point) -> DVec3 {
    DVec3::from_array(p.map(|at| at as f64 / PER_METRE))
}

fn vec3(p: Point) -> Vec3 {
    metres(p).as_vec3()
}

fn aabb([min, max]: [Point; 2]) -> Aabb {
    Aabb::new(vec3(min), vec3(max))
}

/// Returns a random length from `least` to `most` metres, in coordinate units, with a uniformly distributed
/// logarithm.
fn length(rng: &mut Random, least: f64, most: f64) -> i64 {
    ((least * (most / least).powf(rng.unit()) * PER_METRE) as i64).max(1)
}

/// Returns a random coordinate from `low` to `high`, often one of these two.
fn within(rng: &mut Random, [low, high]: [i64; 2]) -> i64 {
    match rng.below(4) {
        0 => low,
        1 => high,
        _ => low + (rng.fine_unit() * (high - low) as f64) as i64,
    }
}

impl SlotScene {
    /// Makes a scene: a viewcell of 0.05 to 20 m, one to three screens of panels with slots of 0.1 mm to 0.3
    /// m between them, along one axis or crossed, and a target at 1 to 300 m. One scene in eight is closed:
    /// the panels of its screens overlap.
    pub fn random(rng: &mut Random) -> Self {
        let axis = rng.below(3);
        let [mut second, mut third] = [(axis + 1) % 3, (axis + 2) % 3];
        if rng.one_in(2) {
            (second, third) = (third, second);
        }
        let axes = [second, third, axis].map(|axis| (axis, if rng.one_in(2) { 1 } else { -1 }));
        let offset = [0; 3].map(|_| (rng.range(-40.0, 40.0) * PER_METRE) as i64);
        let frame = Frame { axes, offset };

        // The viewcell ends at depth 0. Its middle is on the axis.
        let common = length(rng, 0.05, 20.0);
        let is_cube = rng.one_in(2);
        let size = [0; 3].map(|_| if is_cube { common } else { length(rng, 0.05, 20.0) });
        let cell = [[-size[0] / 2, size[0] / 2], [-size[1] / 2, size[1] / 2], [-size[2], 0]];
        let distance = length(rng, 1.0, 300.0);
        let half = [0; 3].map(|_| length(rng, 0.02, 2.0));
        let slope = rng.pick(&[0.0, 0.1, 0.5, 1.5]);
        let aside = [0; 2].map(|_| (rng.range(-slope, slope) * distance as f64) as i64);
        let target = [
            [aside[0] - half[0], aside[0] + half[0]],
            [aside[1] - half[1], aside[1] + half[1]],
            [distance, distance + half[2]],
        ];
        let eye = cell.map(|range| within(rng, range));
        let seen = target.map(|range| within(rng, range));
        let is_closed = rng.one_in(8);

        let placed = |ranges: [[i64; 2]; 3]| frame.bounds(ranges.map(|r| r[0]), ranges.map(|r| r[1]));
        let [min, max] = placed(cell).map(metres);
        let mut scene = Scene::new();
        let mut this = Self {
            target: scene.insert(aabb(placed(target))),
            scene,
            cell: Viewcell::from_box(min, max),
            segment: [frame.to_scene(eye), frame.to_scene(seen)].map(metres),
            slots: Vec::new(),
            is_seen: !is_closed,
        };

        // Panels extend to the sides of the hull of viewcell and target, or beyond.
        let beyond = rng.pick(&[1, PER_METRE as i64, 10 * PER_METRE as i64]);
        let ends: [[i64; 2]; 2] = [0, 1].map(|lat| {
            [cell[lat][0].min(target[lat][0]) - beyond, cell[lat][1].max(target[lat][1]) + beyond]
        });
        let count = 1 + rng.below(3);
        let (first, is_crossed) = (rng.below(2), rng.one_in(2));
        let gap = distance / count as i64;
        for screen in 0..count {
            let lat = if is_crossed { (first + screen) % 2 } else { first };
            let start = gap * screen as i64 + 1 + (rng.unit() * 0.6 * gap as f64) as i64;
            // Both panels are at one depth, or one is behind the other, like a wall and a slab.
            let step = if rng.one_in(2) { 0 } else { length(rng, 0.001, 1.0).min(gap / 8) };
            let width = length(rng, 1e-4, 0.3);
            let part = rng.unit();
            this.slots.push(width as f64 / PER_METRE * if is_closed { -1.0 } else { 1.0 });
            let [is_plate, in_order] = [rng.one_in(2), rng.one_in(2)];
            // The edges along the slot are tilted: one end is farther into the slot than the other. So a
            // panel's bounds extend beyond its occluding part by less than a pixel, as with the far edges of
            // thick panels.
            let skews = [0; 2].map(|_| if rng.one_in(3) { 0 } else { length(rng, 1e-4, 0.3) });
            let is_high_end = rng.one_in(2);
            for side in [0, 1] {
                let near = start + if (side == 0) == in_order { 0 } else { step };
                let thickness = if is_plate { 0 } else { length(rng, 0.001, 1.0).min(gap / 8) };
                // Positions of the segment at both faces of the panel.
                let at = [near, near + thickness].map(|z| {
                    let along = (z - eye[2]) as f64 / (seen[2] - eye[2]) as f64;
                    eye[lat] + ((seen[lat] - eye[lat]) as f64 * along).round() as i64
                });
                let away = ((if side == 0 { part } else { 1.0 - part }) * width as f64) as i64 + 1;
                let away = if is_closed { -away } else { away };
                let range = if side == 0 {
                    [ends[lat][0], at[0].min(at[1]) - away]
                } else {
                    [at[0].max(at[1]) + away, ends[lat][1]]
                };
                if range[0] >= range[1] {
                    continue;
                }
                let mut low = [ends[0][0], ends[1][0], near];
                let mut high = [ends[0][1], ends[1][1], near + thickness];
                (low[lat], high[lat]) = (range[0], range[1]);
                // The edge keeps its distance from the segment at the point where the segment passes.
                let along = (near - eye[2]) as f64 / (seen[2] - eye[2]) as f64;
                let other = 1 - lat;
                let here = eye[other] as f64 + (seen[other] - eye[other]) as f64 * along;
                let (from, to) = (here - ends[other][0] as f64, ends[other][1] as f64 - here);
                let skew = skews[side];
                let back = skew as f64 * if is_high_end { from / to } else { to / from };
                let mut shift = [skew, -(back.ceil().min(FARTHEST as f64) as i64)];
                if is_high_end {
                    shift.swap(0, 1);
                }
                let shift = shift.map(|by| if side == 0 { by } else { -by });
                let corners = core::array::from_fn(|i| {
                    let mut corner =
                        core::array::from_fn(|axis| if i >> axis & 1 == 0 { low[axis] } else { high[axis] });
                    if i >> lat & 1 == 1 - side {
                        corner[lat] += shift[i >> other & 1];
                    }
                    frame.to_scene(corner)
                });
                this.add_panel(rng, &frame, corners, thickness == 0);
            }
        }
        // Objects that do not occlude, in front of and behind the screens, enlarge the windows of projection
        // planes.
        for _ in 0..rng.below(4) {
            let reach = (0.4 * distance as f64) as i64;
            let at = [0, 1].map(|_| within(rng, [-reach, reach]));
            let z = within(rng, [1, 2 * distance]);
            let half = length(rng, 0.02, 2.0);
            let corners = [-half, half].map(|half| [at[0] + half, at[1] + half, z + half.abs()]);
            this.scene.insert(aabb(frame.bounds(corners[0], corners[1])));
        }
        this
    }

    /// Adds a panel with eight corners, as two triangles or as a closed hexahedron. If the segment meets the
    /// panel, `is_seen` becomes false.
    fn add_panel(&mut self, rng: &mut Random, frame: &Frame, corners: [Point; 8], is_plate: bool) {
        // Corners are numbered along the axes of the frame, which may be left-handed.
        let is_mirrored = frame.is_mirrored();
        let turned = |[a, b, c]: [usize; 3]| if is_mirrored { [a, c, b] } else { [a, b, c] };
        let sides = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        let sides = if is_plate { &sides[..1] } else { &sides[..] };
        let halves = sides.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]);
        let triangles: Vec<[Point; 3]> = halves.map(|t| turned(t).map(|i| corners[i])).collect();
        let segment = self.segment.map(|p| p.to_array().map(|at| (at * PER_METRE) as i64));
        self.is_seen &= triangles.iter().all(|&triangle| misses(segment, triangle));
        let placed: Vec<_> = triangles.iter().map(|t| t.map(vec3)).collect();
        // Construction gives no triangle without area, but clamping to 512 m may.
        let Ok(mesh) = OccluderMesh::from_triangles(&placed) else { return };
        let mesh = mesh.with_two_sided(is_plate || rng.one_in(2));
        let id = self.scene.insert(Object { occluder: true, ..Object::new(*mesh.bounds()) });
        self.scene.set_triangles(id, placed).expect("the object has just been inserted");
        let mesh = self.scene.add_mesh(mesh);
        self.scene.set_mesh(id, mesh, Affine3A::IDENTITY).expect("the object has just been inserted");
    }

    /// Runs a culler on the first `trials` scenes of a seed.
    pub fn search(culler: &mut dyn RegionCuller, seed: u64, trials: usize) -> SlotSearch {
        let mut search = SlotSearch::default();
        for number in 0..trials {
            let world = Self::numbered(seed, number);
            let mut visible = VisibleSet::new();
            culler.cull(&world.scene, &world.cell, &mut visible);
            let is_hidden = !visible.contains(&world.scene, world.target);
            if world.slots[0] < 0.0 {
                search.closed += 1;
                search.hidden += usize::from(is_hidden);
            } else if world.is_seen {
                search.seen += 1;
                if is_hidden {
                    search.wrong.push(number);
                }
            }
        }
        search
    }

    /// Returns the scene of a seed with a given number, without making the scenes before it.
    pub fn numbered(seed: u64, number: usize) -> Self {
        let start = Random(seed).bits() ^ Random(number as u64).bits();
        Self::random(&mut Random(start))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn segments_that_touch_or_cross_a_triangle_do_not_miss_it() {
        let triangle = [[0, 0, 0], [8, 0, 0], [0, 8, 0]];
        for x in -1..=9i64 {
            for y in -1..=9i64 {
                let is_in = x >= 0 && y >= 0 && x + y <= 8;
                // Segments straight through in both directions, up to the plane, short of the plane, and
                // oblique.
                assert_eq!(misses([[x, y, -1], [x, y, 1]], triangle), !is_in, "{x} {y}");
                assert_eq!(misses([[x, y, 1], [x, y, -1]], triangle), !is_in, "{x} {y}");
                assert_eq!(misses([[x, y, 1], [x, y, 0]], triangle), !is_in, "{x} {y}");
                assert!(misses([[x, y, 2], [x, y, 1]], triangle), "{x} {y}: a segment above the triangle");
                assert_eq!(misses([[x - 3, y + 5, -1], [x + 3, y - 5, 1]], triangle), !is_in, "{x} {y}");
            }
        }
        // A segment within the plane counts as not missing.
        assert!(!misses([[20, 20, 0], [30, 20, 0]], triangle), "a segment in the triangle's plane");
    }

    #[test]
    fn most_scenes_are_seen_through_and_some_are_closed() {
        let scenes: Vec<_> = (0..800).map(|number| SlotScene::numbered(1, number)).collect();
        let closed = scenes.iter().filter(|scene| scene.slots[0] < 0.0).count();
        let seen = scenes.iter().filter(|scene| scene.is_seen).count();
        assert!((60..140).contains(&closed) && seen > 600, "{closed} closed, {seen} seen");
        for scene in &scenes {
            let [eye, end] = scene.segment;
            let bounds = scene.scene.bounds(scene.target).unwrap();
            assert!(
                scene.cell.min.cmple(eye).all() && eye.cmple(scene.cell.max).all(),
                "the segment begins at {eye} in the viewcell"
            );
            assert!(
                bounds.min.as_dvec3().cmple(end).all() && end.cmple(bounds.max.as_dvec3()).all(),
                "the segment ends at {end} in the target"
            );
        }
    }
}
