//! Choice of occluders and of projection planes.
//!
//! Planes are placed right behind the occluders that individually cover the largest share of the rays to the
//! occludees, and at geometrically growing distances. (Durand, Drettakis, Thollot and Puech, "Conservative
//! Visibility Preprocessing Using Extended Projections", 2000, section 6.1, place one behind each occluder
//! and count pixels.) Planes are chosen one after another, by the largest share that one occluder in front of
//! the plane covers, times the gap between the plane and the nearest one chosen already. The sum of shares
//! would favour planes behind many small occluders, none of which covers a pixel. Shares alone would place
//! nearly all planes behind the nearest occluders, where a plane hides little that the next one does not hide
//! too.

use super::direction::{Direction, LocalBox};
use super::effort::Effort;
use super::occludees::Item;
use super::occluder::{Occluder, Source};
use super::ray_map::SIDE;
use crate::extent::quantile;
use alloc::vec::Vec;
use core::ops::Range;

/// Least ratio of the distances of two planes that are placed right behind occluders. Of planes that are
/// closer, only the farthest is considered.
const APART: f64 = 1.004;

/// Cone of the rays from the viewcell to all occludees of a direction: its slopes and its range of depths.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Cone {
    /// Least and greatest slope of the rays from the middle of the viewcell's back to the occludees:
    /// `slopes[axis][end]`, with `axis` 0 for local x and 1 for local y, and `end` 0 for the least and 1 for
    /// the greatest slope. A slope is in metres along that axis per metre of depth (local z), counted from
    /// the back of the viewcell.
    slopes: [[f64; 2]; 2],
    /// Depth of the first plane, in metres. An occludee that is not behind it counts as visible.
    pub(crate) first: f64,
    /// Greatest depth, in metres, at which an occludee begins. No occludee is behind a more distant plane.
    pub(crate) deepest: f64,
    /// Depth in metres at which the near ends of occluders are cut off.
    pub(crate) near: f64,
}

impl Cone {
    /// Makes the cone of the rays to `items`. `None` if there are no items, or if no plane fits in front of
    /// them.
    pub(crate) fn around(direction: &Direction, items: &[Item]) -> Option<Self> {
        let mut slopes = [[f64::INFINITY, f64::NEG_INFINITY]; 2];
        let mut deepest = 0.0f64;
        for LocalBox { lo, hi } in items.iter().map(|item| &item.bounds) {
            deepest = deepest.max(lo.z);
            for (lat, slopes) in slopes.iter_mut().enumerate() {
                for z in [lo.z, hi.z] {
                    slopes[0] = slopes[0].min(lo[lat] / (z + direction.depth));
                    slopes[1] = slopes[1].max(hi[lat] / (z + direction.depth));
                }
            }
        }
        // The first plane is at a twentieth of the cell's width, which a person passes in a step, but for
        // tiny cells not nearer than the number of planes allows. The median is not affected by one object
        // far away.
        let mut depths: Vec<f64> = items.iter().map(|item| item.bounds.lo.z).collect();
        let usual = quantile(&mut depths, 0.5)?;
        let first = (0.05 * direction.widest()).max(2e-3 * usual).min(0.5 * deepest);
        (first > 0.0).then_some(Self { slopes, first, deepest, near: 0.5 * first })
    }

    /// Returns a wider cone, which also contains the cell's own shape swept along the direction. The wider
    /// cone is convex and contains the cell, so a ray from the cell to a point of the cone, at any depth,
    /// stays in the cone.
    pub(crate) fn opened(&self) -> Self {
        Self { slopes: self.slopes.map(|[low, high]| [low.min(0.0), high.max(0.0)]), ..*self }
    }

    /// Returns the least and greatest coordinate of the cone at depth `z` along lateral axis `lat` (0 or 1),
    /// in metres.
    pub(crate) fn at(&self, direction: &Direction, z: f64, lat: usize) -> [f64; 2] {
        let [low, high] = self.slopes[lat].map(|slope| slope * (z + direction.depth));
        [low - direction.half[lat], high + direction.half[lat]]
    }

    /// Tests whether a box may meet the cone at a depth between `near` and `deepest`.
    pub(crate) fn meets(&self, direction: &Direction, b: &LocalBox) -> bool {
        b.hi.z > self.near
            && b.lo.z < self.deepest
            && (0..2).all(|lat| {
                let ends =
                    [b.lo.z.max(self.near), b.hi.z.min(self.deepest)].map(|z| self.at(direction, z, lat));
                b.lo[lat] <= ends[0][1].max(ends[1][1]) && b.hi[lat] >= ends[0][0].min(ends[1][0])
            })
    }

    /// Estimates the share of the cone's cross-section, from 0 to 1, that an occluder with bounds `b` covers
    /// on a plane right behind it. 0 if it cannot cover a pixel.
    fn share(&self, direction: &Direction, b: &LocalBox) -> f64 {
        let (near, far) = (b.lo.z.max(self.near), b.hi.z.min(self.deepest));
        (0..2)
            .map(|lat| {
                let [low, high] = self.at(direction, far, lat);
                // The part of the width that not all viewpoints of the cell see covered. A thin occluder
                // close to the plane loses less than its bounds suggest, so at most half is subtracted.
                let lost = direction.half[lat] * (far - near) / near;
                // As seen from the middle of the cell's front, the near end appears larger by this ratio.
                let ratio = far / near;
                let (left, right) = (b.lo[lat].min(b.lo[lat] * ratio), b.hi[lat].max(b.hi[lat] * ratio));
                let width = right.min(high) - left.max(low);
                let width = width - lost.min(0.5 * width);
                let share = width / (high - low);
                if share * SIDE as f64 >= 1.0 { share } else { 0.0 }
            })
            .product()
    }

    /// Returns the data of an occluder that is needed to choose planes. `joins`: whether the occluder is a
    /// piece that joins several meshes. `None` if the occluder cannot cover a pixel, or if its coordinates
    /// are too imprecise.
    pub(crate) fn candidate(
        &self,
        direction: &Direction,
        occluder: &Occluder<'_>,
        source: Source,
        joins: bool,
    ) -> Option<Candidate> {
        let LocalBox { lo, hi } = occluder.bounds;
        let share = self.share(direction, &occluder.bounds);
        // A piece of several objects is long, so planes right behind its parts serve better than one behind
        // its end.
        (share > 0.0 && occluder.is_precise(direction)).then_some(Candidate {
            begins: lo.z,
            ends: hi.z,
            share: if joins { 0.0 } else { share },
            joins,
            source,
        })
    }
}

/// Depths of an occluder, and the share of the cone that it covers. Candidates are many and therefore small:
/// the occluder itself is placed again each time it is drawn.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Candidate {
    /// Depth of the occluder's nearest point, in metres.
    pub(crate) begins: f64,
    /// Depth of the occluder's farthest point, in metres.
    pub(crate) ends: f64,
    share: f64,
    pub(crate) source: Source,
    /// Whether the occluder is a piece that joins several meshes.
    pub(crate) joins: bool,
}

#[cfg(test)]
impl Candidate {
    /// Makes the candidate of a mesh's first part.
    pub(crate) fn of_mesh(id: visibility_core::ObjectId, [begins, ends]: [f64; 2]) -> Self {
        Self { begins, ends, share: 1.0, joins: false, source: Source::Part(id, 0) }
    }
}

/// Chooses the distances in metres of the projection planes within `range`, ascending, all less than
/// `cone.deepest`. At most `left.behind` of them, the best of this range, are placed right behind occluders.
/// Their number is subtracted from `left.behind`, which then limits later ranges.
pub(crate) fn distances(
    direction: &Direction,
    cone: &Cone,
    occluders: &[Candidate],
    range: &Range<f64>,
    left: &mut Effort,
) -> Vec<f64> {
    let mut behind: Vec<(f64, f64)> = occluders
        .iter()
        .map(|c| (c.ends + direction.guard(), c.share))
        .filter(|(d, share)| *share > 0.0 && *d > cone.first && *d < cone.deepest && range.contains(d))
        .collect();
    behind.sort_by(|a, b| a.0.total_cmp(&b.0));
    // Of planes that nearly coincide, the last is behind the occluders of all, so it is kept.
    behind.dedup_by(|later, kept| {
        let same = later.0 < kept.0 * APART;
        if same {
            *kept = (later.0, later.1.max(kept.1));
        }
        same
    });
    let mut growth = left.growth;
    while (0..left.growing).fold(cone.first, |d, _| d * growth) < cone.deepest {
        growth *= 1.05;
    }
    let growing = core::iter::successors(Some(cone.first), |d| Some(d * growth)).take(left.growing);
    let mut all: Vec<f64> = growing.clone().filter(|d| *d < cone.deepest && range.contains(d)).collect();
    // Gap between two planes: the ratio of their distances minus 1.
    let gap = |a: f64, b: f64| a.max(b) / a.min(b) - 1.0;
    // Planes behind occluders, each with its distance, its share, and its gap to the nearest chosen plane: 0
    // once the plane itself is chosen.
    let mut open: Vec<(f64, f64, f64)> = behind
        .into_iter()
        .map(|(d, share)| (d, share, growing.clone().fold(f64::INFINITY, |least, g| least.min(gap(d, g)))))
        .collect();
    let value = |&(_, share, gap): &(f64, f64, f64)| share * gap;
    while left.behind > 0 {
        let best = open.iter().max_by(|a, b| value(a).total_cmp(&value(b)));
        let Some(&(chosen, ..)) = best.filter(|best| value(best) > 0.0) else { break };
        all.push(chosen);
        left.behind -= 1;
        for (d, _, least) in &mut open {
            *least = least.min(gap(*d, chosen));
        }
    }
    all.sort_by(f64::total_cmp);
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use visibility_core::glam::DVec3;

    /// Returns the planes chosen for occluders that are given by their greatest depths and their shares.
    fn planes_behind(occluders: impl Iterator<Item = (f64, f64)>) -> Vec<f64> {
        let direction = Direction {
            rows: [DVec3::X, DVec3::Y, DVec3::Z],
            offset: [0.0; 3],
            half: [0.5; 2],
            exact: [None; 2],
            depth: 1.0,
            error: 1e-12,
        };
        let cone = Cone { slopes: [[-1.0, 1.0]; 2], first: 0.1, deepest: 100.0, near: 0.05 };
        let candidate = |(ends, share)| Candidate {
            begins: ends - 0.01,
            ends,
            share,
            source: Source::Piece(0),
            joins: false,
        };
        let occluders: Vec<Candidate> = occluders.map(candidate).collect();
        let mut left = Effort::FULL;
        let planes = distances(&direction, &cone, &occluders, &(0.0..f64::INFINITY), &mut left);
        let Effort { behind, growing, .. } = Effort::FULL;
        assert_eq!((left.behind, planes.len()), (0, behind + growing), "occluders left over, and planes");
        assert!(planes.is_sorted(), "planes in order: {planes:?}");
        planes
    }

    fn is_among(planes: &[f64], at: f64) -> bool {
        planes.iter().any(|d| (d - at).abs() < 1e-6)
    }

    #[test]
    fn planes_do_not_crowd_behind_the_nearest_occluders() {
        let near = (0..100).map(|i| (2.0 + 0.01 * f64::from(i), 0.15));
        let planes = planes_behind(near.chain([(20.0, 0.1), (21.0, 0.1)]));
        assert!(is_among(&planes, 20.0) && is_among(&planes, 21.0), "{planes:?}");
    }

    #[test]
    fn the_largest_occluder_gets_its_plane_among_many_small_ones() {
        let at = |i: i32| 0.2 * 1.006f64.powi(i);
        for large in [500, 703, 905] {
            let occluders = (0..1000).map(|i| (at(i), if i == large { 0.2 } else { 0.01 }));
            let planes = planes_behind(occluders);
            assert!(is_among(&planes, at(large)), "{large}: {planes:?}");
        }
    }

    #[test]
    fn an_opened_cone_contains_the_direction_itself() {
        let slopes = [[0.5, 1.0], [-1.0, -0.5]];
        let opened = Cone { slopes, first: 0.1, deepest: 100.0, near: 0.05 }.opened();
        assert_eq!(opened.slopes, [[0.0, 1.0], [-1.0, 0.0]], "slopes of an opened cone");
        let around = Cone { slopes: [[-1.0, 1.0]; 2], ..opened };
        assert_eq!(around.opened().slopes, around.slopes, "a cone that contains it already");
    }

    /// Occluders whose vertices err by more than the margins of planes and occludees are not drawn, and none
    /// that cannot cover a pixel.
    #[test]
    fn imprecise_and_tiny_occluders_are_no_candidates() {
        use visibility_core::glam::{Affine3A, Vec3};
        use visibility_core::{Aabb, OccluderMesh};
        let rows = [DVec3::X, DVec3::Y, DVec3::Z];
        let (offset, half) = ([0.0; 3], [0.5; 2]);
        let direction = Direction { rows, offset, half, exact: [None; 2], depth: 1.0, error: 1e-12 };
        let cone = Cone { slopes: [[-1.0, 1.0]; 2], first: 0.1, deepest: 100.0, near: 0.05 };
        let is_candidate = |half: f32, times: f64| {
            let bounds = Aabb::new(Vec3::new(-half, -half, 20.0), Vec3::new(half, half, 20.1));
            let mesh = OccluderMesh::cuboid(&bounds).unwrap();
            let mut occluder = Occluder::new(&direction, &mesh, &Affine3A::IDENTITY).unwrap();
            occluder.error = times * direction.error;
            cone.candidate(&direction, &occluder, Source::Piece(0), false).is_some()
        };
        assert!(is_candidate(9.0, 1.0) && is_candidate(9.0, 4.0), "an occluder of 18 metres");
        assert!(!is_candidate(9.0, 4.1), "more than four times the error of the direction");
        assert!(!is_candidate(0.001, 1.0), "an occluder of two millimetres");
    }
}
