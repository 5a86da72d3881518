//! How far one sees from the surfaces of a scene: what has something close before it is seldom seen.
//!
//! Lines through the scene, evenly spaced in each of a few directions, are cut by its triangles into free pieces. From an eye somewhere in
//! the scene, a point on a surface is seen along a line if the eye lies in the free piece that begins there; so the mean length of these
//! pieces, over the directions before a surface, tells how likely it is seen from anywhere. Engines under hoods and the inner sides of double
//! walls have little of it, wherever the eye may be (Sbert, "An integral geometry based method for fast form-factor computation", 1993, has
//! such lines).

use crate::compass::{LINES, axes};
use crate::parts::for_each_part;
use alloc::vec::Vec;
use visibility_core::Scene;
use visibility_core::glam::{DVec2, Vec3};

/// Lines along each side of the square that is seen along a direction, at most.
const SIDE: u32 = 2048;

/// How many lines of a direction go through a triangle, on average over all of them, at most.
const THROUGH: f64 = 3.0;

/// Pieces of this share of the scene's radius and all longer ones count alike.
const FAR: f32 = 0.5;

/// Surfaces that lie more along the lines than this are not asked, nor such that are so much more oblique yet that they would count as lines.
const OBLIQUE: f32 = 0.2;
const EDGE_ON: f32 = 1e-3;

/// Next surfaces nearer than this, in distances between lines, pass for the same.
const SAME: f32 = 0.25;

/// How exposed an object is.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Exposure {
    /// From 0 to 1, the mean length of what is free before it, that of its most exposed triangle. 1 for what has no surface, and where
    /// lengths cannot be told.
    pub(crate) mean: f32,
    /// If it is a single triangle, by line what [`code`] says; else 0.
    pub(crate) along: [u8; LINES],
}

/// What is free before a triangle along a line, from 0 to 1, and whether that is in the line's own direction. 0 where nothing is known.
fn code(free: f32, forth: bool) -> u8 {
    ((free * 126.0) as u8).min(126) + 1 + if forth { FORTH } else { 0 }
}

const FORTH: u8 = 0x80;

impl Exposure {
    const OPEN: Self = Self { mean: 1.0, along: [0; LINES] };

    /// What is free before it along a line, from 0 to 1, and whether that is in the line's own direction; none where it is not known.
    pub(crate) fn along(&self, line: usize) -> Option<(f32, bool)> {
        let code = self.along[line];
        (code != 0).then(|| (f32::from((code & !FORTH) - 1) / 126.0, code & FORTH != 0))
    }
}

/// How exposed objects are, by index.
pub(crate) fn exposures(scene: &Scene) -> Vec<Exposure> {
    let mut triangles: Vec<(u32, [Vec3; 3])> = Vec::new();
    for id in scene.ids() {
        for_each_part(scene, id, &mut |part| {
            part.for_each_triangle(|t| triangles.push((id.index() as u32, t.map(|p| p.as_vec3()))));
        });
    }
    let mut exposures = alloc::vec![Exposure::OPEN; scene.index_limit()];
    let corners = || triangles.iter().flat_map(|(_, t)| t);
    let (min, max) = corners().fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(a, b), &p| (a.min(p), b.max(p)));
    let center = min * 0.5 + max * 0.5;
    // Squares of areas are beyond single precision in worlds that are not.
    let radius = (max - center).as_dvec3().length();
    if !(radius > 0.0 && radius < f64::from(f32::MAX)) {
        return exposures;
    }
    let wide = |v: Vec3| v.as_dvec3();
    let area: f64 =
        triangles.iter().map(|(_, [a, b, c])| wide(b - a).cross(wide(c - a)).length() * 0.5).sum();
    let apart = DVec2::splat(area * 0.5 / (THROUGH * triangles.len() as f64)).sqrt().x;
    let spacing = (radius * 2.0 / f64::from(SIDE)).max(apart);
    let side = (radius * 2.0 / spacing) as u32;
    let (radius, spacing) = (radius as f32, spacing as f32);
    if !(radius.is_normal() && spacing.is_normal()) {
        return exposures;
    }
    let mut free = alloc::vec![(0.0f32, 0.0f32); triangles.len()];
    let mut lines = Lines { side: side.min(SIDE) + 2, ..Lines::default() };
    for line in 0..LINES {
        let axes = axes(line);
        // In distances between lines, from a corner of a cube around all.
        let place = |p: Vec3| {
            let p = (p - center) / spacing;
            Vec3::from_array(axes.map(|axis| axis.dot(p))) + lines.side as f32 * 0.5
        };
        let placed: Vec<[Vec3; 3]> = triangles.iter().map(|(_, t)| t.map(place)).collect();
        lines.cut(&placed);
        for ((t, (object, _)), (sum, weight)) in placed.iter().zip(&triangles).zip(&mut free) {
            if let Some(tilt) = Tilt::new(t, OBLIQUE) {
                let length = lines.free(t, &tilt) * spacing;
                let length = (length / (radius * FAR)).min(1.0);
                *sum += tilt.across * length;
                *weight += tilt.across;
                exposures[*object as usize].along[line] = code(length, tilt.up);
            }
        }
    }
    let mut last = u32::MAX;
    for ((object, _), (sum, weight)) in triangles.iter().zip(free) {
        let mine = if weight > 0.0 { sum / weight } else { 0.5 };
        let exposure = &mut exposures[*object as usize];
        if *object == last {
            *exposure = Exposure { mean: exposure.mean.max(mine), along: [0; LINES] };
        } else {
            exposure.mean = mine;
        }
        last = *object;
    }
    exposures
}

/// How a triangle lies to lines along z: depth grows by these along x and y.
struct Tilt {
    x: f32,
    y: f32,
    /// The cosine between its normal and the lines.
    across: f32,
    /// Whether it faces towards greater depth.
    up: bool,
}

impl Tilt {
    /// None for what is more oblique than the given cosine.
    fn new([a, b, c]: &[Vec3; 3], least: f32) -> Option<Self> {
        let normal = (*b - *a).cross(*c - *a);
        let across = normal.z.abs() / normal.length();
        (across > least).then(|| Self {
            x: -normal.x / normal.z,
            y: -normal.y / normal.z,
            across,
            up: normal.z > 0.0,
        })
    }
}

/// Where the lines of one direction meet triangles.
#[derive(Default)]
struct Lines {
    /// Lines along each side of the square.
    side: u32,
    /// Where the depths of each line begin.
    starts: Vec<u32>,
    depths: Vec<f32>,
    /// Line and depth, in the order of triangles.
    met: Vec<(u32, f32)>,
}

impl Lines {
    /// Cuts all lines by triangles.
    fn cut(&mut self, triangles: &[[Vec3; 3]]) {
        self.met.clear();
        for t in triangles {
            if let Some(tilt) = Tilt::new(t, EDGE_ON) {
                self.meet(t, &tilt);
            }
        }
        let count = (self.side * self.side) as usize;
        self.starts.clear();
        self.starts.resize(count + 2, 0);
        for &(line, _) in &self.met {
            self.starts[line as usize + 2] += 1;
        }
        for line in 2..count + 2 {
            self.starts[line] += self.starts[line - 1];
        }
        self.depths.clear();
        self.depths.resize(self.met.len(), 0.0);
        for &(line, depth) in &self.met {
            let place = &mut self.starts[line as usize + 1];
            self.depths[*place as usize] = depth;
            *place += 1;
        }
    }

    /// Writes down the lines that go through a triangle: line (i, j) runs at i + 1/2 and j + 1/2.
    fn meet(&mut self, t: &[Vec3; 3], tilt: &Tilt) {
        let (least, most) = (t[0].min(t[1]).min(t[2]), t[0].max(t[1]).max(t[2]));
        let end = |x: f32| ((x + 0.5) as u32).min(self.side);
        let (x0, x1, y0, y1) = (end(least.x), end(most.x), end(least.y), end(most.y));
        if x0 >= x1 {
            return;
        }
        for j in y0..y1 {
            let y = j as f32 + 0.5;
            let (mut from, mut to) = (f32::INFINITY, f32::NEG_INFINITY);
            for (p, q) in [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])] {
                if (p.y <= y) != (q.y <= y) {
                    let x = p.x + (q.x - p.x) * ((y - p.y) / (q.y - p.y));
                    (from, to) = (from.min(x), to.max(x));
                }
            }
            for i in end(from)..end(to) {
                let depth = t[0].z + tilt.x * (i as f32 + 0.5 - t[0].x) + tilt.y * (y - t[0].y);
                self.met.push((j * self.side + i, depth));
            }
        }
    }

    /// How far it is from a triangle to the next surface before it, along the line nearest to its centre.
    fn free(&self, t: &[Vec3; 3], tilt: &Tilt) -> f32 {
        let center = (t[0] + t[1] + t[2]) / 3.0;
        let place = |x: f32| (x as u32).min(self.side - 1);
        let (i, j) = (place(center.x), place(center.y));
        let depth = center.z + tilt.x * (i as f32 + 0.5 - center.x) + tilt.y * (j as f32 + 0.5 - center.y);
        let line = (j * self.side + i) as usize;
        let mut free = f32::INFINITY;
        for other in &self.depths[self.starts[line] as usize..self.starts[line + 1] as usize] {
            let away = if tilt.up { other - depth } else { depth - other };
            if away > SAME {
                free = free.min(away);
            }
        }
        free
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use visibility_core::glam::Quat;
    use visibility_core::{Aabb, Object, OccluderMesh};

    /// The twelve triangles of a cube, as objects, outwards.
    fn cube(scene: &mut Scene, center: Vec3, half: f32, turn: Quat) {
        let corners = Aabb::new(Vec3::splat(-half), Vec3::splat(half)).corners();
        for triangle in OccluderMesh::CUBOID {
            let t = triangle.map(|corner| center + turn * corners[corner as usize]);
            let id = scene.insert(Object::new(Aabb::from_points(t)));
            scene.set_triangles(id, [t]).unwrap();
        }
    }

    #[test]
    fn what_is_inside_of_something_is_little_exposed_wherever_it_is() {
        for turn in [Quat::IDENTITY, Quat::from_rotation_x(0.7) * Quat::from_rotation_z(1.9)] {
            for center in [Vec3::ZERO, Vec3::new(300.0, -20.0, 7.0)] {
                let mut scene = Scene::new();
                for half in [0.8, 1.0] {
                    cube(&mut scene, center, half, turn);
                }
                cube(&mut scene, center + turn * Vec3::X * 12.0, 1.0, turn);
                let exposures: Vec<f32> = exposures(&scene).iter().map(|exposure| exposure.mean).collect();
                let of = |cube: usize| &exposures[cube * 12..cube * 12 + 12];
                let most_inside = of(0).iter().copied().fold(0.0, f32::max);
                let least_outside = of(1).iter().chain(of(2)).copied().fold(1.0, f32::min);
                assert!(most_inside < 0.15 && least_outside > 0.6, "{most_inside} {least_outside}");
            }
        }
    }

    #[test]
    fn an_object_is_as_exposed_as_the_most_exposed_of_its_triangles() {
        let mut scene = Scene::new();
        cube(&mut scene, Vec3::ZERO, 1.0, Quat::IDENTITY);
        let both = scene.insert(Aabb::from_arrays([-0.9, -0.9, -0.9], [0.9, 0.9, 9.0]));
        let triangle = |z: f32| [Vec3::new(-0.5, -0.5, z), Vec3::new(0.5, -0.5, z), Vec3::new(0.0, 0.5, z)];
        scene.set_triangles(both, [triangle(0.9), triangle(9.0), triangle(0.8)]).unwrap();
        let boxed = scene.insert(Aabb::from_arrays([-0.1; 3], [0.1; 3]));
        let exposures: Vec<f32> = exposures(&scene).iter().map(|exposure| exposure.mean).collect();
        assert!(exposures[both.index()] > 0.9, "{exposures:?}");
        assert!(exposures[boxed.index()] < 0.6, "{exposures:?}");
    }

    #[test]
    fn where_lengths_cannot_be_told_all_is_exposed() {
        assert!(exposures(&Scene::new()).is_empty());
        for size in [0.0, 1e-30, 1e25, f32::MAX, f32::INFINITY, f32::NAN] {
            let mut scene = Scene::new();
            scene.insert(Aabb::from_arrays([-size; 3], [size; 3]));
            scene.insert(Aabb::from_arrays([0.0; 3], [0.0; 3]));
            let id = scene.insert(Aabb::from_arrays([-1.0; 3], [1.0; 3]));
            scene.set_triangles(id, [[Vec3::ZERO, Vec3::X, Vec3::X], [Vec3::NAN; 3]]).unwrap();
            for Exposure { mean, .. } in exposures(&scene) {
                assert!((0.0..=1.0).contains(&mean), "{size}: {mean}");
            }
        }
    }

    #[test]
    fn what_is_free_along_lines_lies_before_a_surface() {
        let mut scene = Scene::new();
        let turn = Quat::from_rotation_x(0.7) * Quat::from_rotation_z(1.9);
        cube(&mut scene, Vec3::ZERO, 1.0, turn);
        // A larger one close before one of its sides.
        let side = turn * Vec3::X;
        cube(&mut scene, side * 5.0, 3.0, turn);
        let exposures = exposures(&scene);
        let mut known = 0;
        for id in scene.ids().take(12) {
            let [a, b, c] = scene.triangles(id).unwrap()[0];
            let out = (b - a).cross(c - a).normalize();
            for line in 0..LINES {
                let Some((free, forth)) = exposures[id.index()].along(line) else { continue };
                let cosine = axes(line)[2].dot(out);
                assert_eq!(forth, cosine > 0.0, "{id}, line {line}: {cosine}");
                if out.dot(side) > 0.9 && cosine.abs() > 0.7 {
                    assert!(free < 0.5, "{id}, line {line}: {free}");
                } else if out.dot(side) < -0.9 {
                    assert_eq!(free, 1.0, "{id}, line {line}");
                }
                known += 1;
            }
        }
        assert!(known > 12 * LINES * 2 / 3, "{known}");
    }
}
