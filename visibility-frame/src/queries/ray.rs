//! Rays against bounds: the first hit and all hits (the slab test of Kay and Kajiya, "Ray Tracing Complex
//! Scenes", 1986; margins for rounding after Ize, "Robust BVH Ray Traversal", 2013).

use super::region::mask_of;
use super::{SceneQuery, take_least};
use alloc::vec::Vec;
use core::{cmp::Ordering, fmt};
use visibility_core::ObjectId;
use visibility_core::glam::Vec3;
use visibility_core::scene::{Boxes64, FAN_OUT, lanes};
use visibility_core::walk::{BoxHierarchy, Child, SceneHierarchy};

/// A ray or segment, in metres relative to the scene's origin, prepared for tests of 64 boxes.
///
/// ```
/// use visibility_core::glam::Vec3;
/// use visibility_frame::queries::{Ray, RayError};
/// assert!(Ray::new(Vec3::ZERO, Vec3::new(0.0, 2.0, 0.0), 10.0).is_ok());
/// assert_eq!(Ray::new(Vec3::ZERO, Vec3::ZERO, 10.0).unwrap_err(), RayError::Direction);
/// ```
///
/// # Rounding
/// The direction is divided by its component of greatest magnitude, in `f64`, to `d` with `|d| <= 1` on each
/// axis. At the parameter `t` the ray enters a slab of the box by its near side, `t = (near - o) / d`, and
/// leaves it by its far side. With `u = 2^-24`, three roundings of `u` meet in a computed `t`: of the
/// difference, of the inverse of `d`, of the product. `enter` uses the inverse times `1 - 8u` and `exit` that
/// times `1 + 8u`, so `enter` is never later and `exit` never earlier than in exact arithmetic: no hit is
/// missed. In detail:
///
/// - 2^-125 is taken from the difference for `enter` and added to it for `exit`, since differences, and
///   coordinates, below 2^-126 may be flushed to zero.
/// - An inverse beyond the range of `f32` is replaced by the greatest finite number for `enter` and by
///   infinity for `exit`.
/// - On an axis with `d = 0` coordinates are compared, which is exact. At least one axis has `|d| = 1`.
/// - The product of 0 and infinity is NaN, which bounds nothing, since comparisons with NaN are false.
/// - `enter` overflows only if `t >= 2^128 (1 - u)`. For a box that is hit, `exit` then overflows too, since
///   its margin is on the other side.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Ray {
    origin: [f32; 3],
    /// Sign of the direction on each axis: 1, 0 or -1.
    sign: [f32; 3],
    /// Lower bound of `1 / |d|` on each axis, `f32::MAX` for `d = 0`; [`Ray`] defines `d`, the scaled
    /// direction.
    low: [f32; 3],
    /// Upper bound of `1 / |d|` on each axis, infinite for `d = 0`.
    high: [f32; 3],
    /// Upper bound of the parameter `t` at which the ray ends: its points are `origin + t d`.
    end: f32,
    /// Length of `d`: metres per unit of `t`, between 1 and the square root of 3.
    length: f64,
}

/// Relative margin for the rounding of inverses and lengths, eight times the unit round-off of `f32`.
const MARGIN: f64 = 4.0 * f32::EPSILON as f64;

/// Absolute margin of differences of coordinates, 2^-125.
const ABSOLUTE_MARGIN: f32 = 2.0 * f32::MIN_POSITIVE;

impl Ray {
    /// Makes the ray from `origin`, relative to the scene's origin, along `direction`, of any finite length
    /// but zero, up to `max_distance` metres from `origin`. An infinite `max_distance` is allowed; 0 tests
    /// the origin alone.
    ///
    /// # Errors
    /// [`RayError`] if `origin` or `direction` is not finite, `direction` is zero, or `max_distance` is
    /// negative or NaN.
    pub fn new(origin: Vec3, direction: Vec3, max_distance: f32) -> Result<Self, RayError> {
        if !origin.is_finite() {
            return Err(RayError::Origin);
        }
        let greatest = direction.as_dvec3().abs().max_element();
        if !(direction.is_finite() && greatest > 0.0) {
            return Err(RayError::Direction);
        }
        if max_distance.is_nan() || max_distance < 0.0 {
            return Err(RayError::MaxDistance { max_distance });
        }
        let d = direction.as_dvec3() / greatest;
        let length = d.length();
        let inverse = d.to_array().map(|d| 1.0 / d.abs());
        Ok(Self {
            origin: origin.to_array(),
            sign: direction.to_array().map(|d| if d == 0.0 { 0.0 } else { d.signum() }),
            low: inverse.map(|inverse| ((inverse * (1.0 - MARGIN)) as f32).min(f32::MAX)),
            high: inverse.map(|inverse| (inverse * (1.0 + MARGIN)) as f32),
            end: (f64::from(max_distance) / length * (1.0 + MARGIN)) as f32 + ABSOLUTE_MARGIN,
            length,
        })
    }

    /// Writes the parameter at which the ray enters each box to `enter`: never more than the exact one, at
    /// least 0, and 0 for a box around the ray's origin. Returns the mask of the lanes whose box the ray may
    /// hit; bit i stands for lane i, and the parameters of other lanes are meaningless.
    #[inline(always)]
    pub(super) fn hits(&self, boxes: &Boxes64, enter: &mut [f32; FAN_OUT]) -> u64 {
        let mut exit = [self.end; FAN_OUT];
        *enter = [0.0; FAN_OUT];
        for axis in 0..3 {
            let (min, max) = (&boxes.coordinates()[axis], &boxes.coordinates()[axis + 3]);
            if self.sign[axis] == 0.0 {
                let o = self.origin[axis];
                for i in 0..FAN_OUT {
                    exit[i] = if (min[i] > o) | (max[i] < o) { -1.0 } else { exit[i] };
                }
                continue;
            }
            let (near, far) = if self.sign[axis] < 0.0 { (max, min) } else { (min, max) };
            let (o, sign, low, high) = (self.origin[axis], self.sign[axis], self.low[axis], self.high[axis]);
            for i in 0..FAN_OUT {
                let first = ((near[i] - o) * sign - ABSOLUTE_MARGIN) * low;
                let last = ((far[i] - o) * sign + ABSOLUTE_MARGIN) * high;
                enter[i] = if first > enter[i] { first } else { enter[i] };
                exit[i] = if last < exit[i] { last } else { exit[i] };
            }
        }
        mask_of(|i| enter[i] <= exit[i])
    }

    /// Returns the distance in metres from the ray's origin to the point at `parameter`, as computed by
    /// [`hits`](Self::hits). The margin that `hits` has subtracted from the parameter also covers the
    /// rounding here.
    fn distance(&self, parameter: f32) -> f32 {
        (f64::from(parameter) * self.length) as f32
    }
}

/// An object whose bounds a ray hits. Hits are ordered by distance, hits at equal distances by id.
///
/// ```
/// use visibility_core::{glam::Vec3, Aabb, Scene};
/// use visibility_frame::queries::{Ray, SceneQuery};
/// let mut scene = Scene::new();
/// let wall = scene.insert(Aabb::from_arrays([3.0, -1.0, -1.0], [4.0, 1.0, 1.0]));
/// let mut hits = Vec::new();
/// SceneQuery::new(&scene).all_hits(&Ray::new(Vec3::ZERO, Vec3::X, 9.0)?, &mut hits);
/// assert_eq!(hits[0].id, wall);
/// assert!((2.99..=3.0).contains(&hits[0].distance));
/// # Ok::<(), visibility_frame::queries::RayError>(())
/// ```
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct RayHit {
    /// Object that the ray hits.
    pub id: ObjectId,
    /// Distance in metres from the ray's origin to the point where the ray enters the object's bounds,
    /// rounded down by at most 2^-20 of itself. 0 if the origin is in the bounds, and for improper bounds.
    pub distance: f32,
}

impl Ord for RayHit {
    fn cmp(&self, other: &Self) -> Ordering {
        self.distance.total_cmp(&other.distance).then(self.id.cmp(&other.id))
    }
}

impl PartialOrd for RayHit {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for RayHit {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for RayHit {}

/// Best hit so far: parameter `t` of the ray, and object. `None` before the first hit.
type Best = Option<(f32, ObjectId)>;

impl SceneQuery<'_> {
    /// Returns the first object along `ray` whose bounds the ray hits, or `None` if it hits none. Among
    /// objects at equal computed distances, the one with the least id is returned. Nodes are opened nearest
    /// first, and nodes behind the first hit are not opened.
    ///
    /// An object with improper bounds is hit at distance 0. To pick triangles, go through
    /// [`all_hits`](Self::all_hits) and stop at the first object that is farther than the nearest triangle
    /// hit so far.
    pub fn first_hit(&self, ray: &Ray) -> Option<RayHit> {
        let mut best = None;
        let mut enter = [0.0; FAN_OUT];
        self.for_each_unculled(|boxes, ids, mask, improper| {
            let hit = mask & (improper | ray.hits(boxes, &mut enter));
            for lane in lanes(hit) {
                let at = if improper >> lane & 1 != 0 { 0.0 } else { enter[lane] };
                improve(&mut best, at, ids[lane]);
            }
        });
        self.first_below(None, ray, &mut best);
        best.map(|(at, id)| RayHit { id, distance: ray.distance(at) })
    }

    fn first_below(&self, node: Option<usize>, ray: &Ray, best: &mut Best) {
        SceneHierarchy.for_each_block(self.scene, node, |block| {
            let mut enter = [0.0; FAN_OUT];
            let mut hit = block.occupied() & ray.hits(block.boxes(), &mut enter);
            if let Some((leaf, ids)) = block.leaf() {
                for lane in lanes(hit & self.scene.lanes_on_layers(leaf, self.layers)) {
                    improve(best, enter[lane], ids[lane]);
                }
                return;
            }
            while let Some(lane) = take_least(&enter, &mut hit) {
                if best.is_some_and(|(at, _)| enter[lane] > at) {
                    return;
                }
                if let Child::Node(child) = block.child(lane) {
                    self.first_below(Some(child), ray, best);
                }
            }
        });
    }

    /// Replaces the content of `hits` with all objects whose bounds `ray` hits, nearest first, objects at
    /// equal distances by ascending id. Sorting takes `n log n` time for n hits.
    pub fn all_hits(&self, ray: &Ray, hits: &mut Vec<RayHit>) {
        hits.clear();
        let mut enter = [0.0; FAN_OUT];
        self.for_each_unculled(|boxes, ids, mask, improper| {
            let hit = mask & (improper | ray.hits(boxes, &mut enter));
            hits.extend(lanes(hit).map(|lane| {
                let distance = if improper >> lane & 1 != 0 { 0.0 } else { ray.distance(enter[lane]) };
                RayHit { id: ids[lane], distance }
            }));
        });
        self.hits_below(None, ray, hits);
        hits.sort_unstable();
    }

    fn hits_below(&self, node: Option<usize>, ray: &Ray, hits: &mut Vec<RayHit>) {
        SceneHierarchy.for_each_block(self.scene, node, |block| {
            let mut enter = [0.0; FAN_OUT];
            let hit = block.occupied() & ray.hits(block.boxes(), &mut enter);
            if let Some((leaf, ids)) = block.leaf() {
                let hit = hit & self.scene.lanes_on_layers(leaf, self.layers);
                let hit_at = |lane| RayHit { id: ids[lane], distance: ray.distance(enter[lane]) };
                hits.extend(lanes(hit).map(hit_at));
                return;
            }
            for lane in lanes(hit) {
                if let Child::Node(child) = block.child(lane) {
                    self.hits_below(Some(child), ray, hits);
                }
            }
        });
    }
}

fn improve(best: &mut Best, at: f32, id: ObjectId) {
    if best.is_none_or(|best| (at, id) < best) {
        *best = Some((at, id));
    }
}

/// The reason why a ray is refused.
///
/// ```
/// use visibility_core::glam::Vec3;
/// use visibility_frame::queries::Ray;
/// let error = Ray::new(Vec3::ZERO, Vec3::X, -1.0).unwrap_err();
/// assert_eq!(error.to_string(), "the greatest distance of a ray cannot be -1");
/// ```
#[derive(Clone, Copy, PartialEq, Debug)]
#[non_exhaustive]
pub enum RayError {
    /// The origin is NaN or infinite.
    Origin,
    /// The direction is zero, NaN or infinite.
    Direction,
    /// The greatest distance is negative or NaN.
    MaxDistance {
        /// The refused distance, in metres.
        max_distance: f32,
    },
}

impl fmt::Display for RayError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Origin => write!(f, "the origin of a ray is not finite"),
            Self::Direction => write!(f, "the direction of a ray is not finite or has no length"),
            Self::MaxDistance { max_distance } => {
                write!(f, "the greatest distance of a ray cannot be {max_distance}")
            }
        }
    }
}

impl core::error::Error for RayError {}
