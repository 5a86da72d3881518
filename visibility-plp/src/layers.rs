//! Encoding of a cell's object list. Objects are bucketed by facing direction, size and openness, so that a
//! budget takes the best buckets first.
//!
//! The list of a cell is a byte string. It starts with the least object index in the cell. One block follows
//! for each axis side (one of the six directions along the axes, or none) that objects of the cell face. A
//! block has one byte of side (low three bits) and lean (high four bits; a bound on how far normals lean from
//! the axis), the number of bytes that follow in the block, and the side's layers in order of falling mean
//! area times openness. A layer has one byte of area class, one byte of openness class, the number of bytes
//! that follow in the layer, and its objects in ascending order. The first object is stored as the difference
//! from the least index in the cell, each later object as the difference from its predecessor. An empty cell
//! has an empty list.
//!
//! Numbers take [seven bits per byte](push_number).

use crate::normal_bins::BoxFromEye;
use crate::surface_class::{ANY_SIDE, LEAN_AT_45_DEGREES, MaxLean, SurfaceClass, UNKNOWN_LEAN};
use alloc::vec::Vec;
use visibility_core::binary_format::{push_number, take_number};

/// Minimum number of objects in a layer (group of similar objects of a cell that face one axis side). Fewer
/// only if no more objects face that side. Visiting a layer costs about as much as testing 12 objects;
/// smaller layers find more visible objects at small budgets.
const MIN_LAYER: usize = 12;

/// Minimum number of objects of a cell that face one axis side (plus or minus x, y or z) for a block of their
/// own. Where fewer face a side, they are stored among the objects of [`ANY_SIDE`].
const MIN_ON_SIDE: usize = 8;

/// Appends the encoded list of one cell to `bytes` and returns the number of axis sides (plus or minus x, y
/// or z, or [`ANY_SIDE`]) in the list. `objects` are the object indices of the cell in any order; they are
/// reordered. `classes` holds the surface class and lean of each object, indexed by object index; an index
/// beyond its end counts as the default class with unknown lean. Appends nothing and returns 0 for a cell
/// without objects.
pub(crate) fn push_list(
    bytes: &mut Vec<u8>,
    objects: &mut [u32],
    classes: &[(SurfaceClass, MaxLean)],
) -> usize {
    let Some(&least) = objects.iter().min() else { return 0 };
    let known = |object: u32| {
        classes.get(object as usize).copied().unwrap_or((SurfaceClass::default(), UNKNOWN_LEAN))
    };
    let class = |object: u32| known(object).0;
    push_number(least, bytes);
    // Sides with few objects are put into one list of any side, since each list costs bytes and a test in
    // every frame.
    let mut counts = [0usize; 256];
    for &object in &*objects {
        counts[usize::from(class(object).side)] += 1;
    }
    let side_of = |object: u32| {
        let side = class(object).side;
        if counts[usize::from(side)] < MIN_ON_SIDE { ANY_SIDE } else { side }
    };
    objects.sort_unstable_by_key(|&object| (side_of(object), u32::MAX - class(object).rank(), object));
    let (mut block, mut of_layer, mut block_count) = (Vec::new(), Vec::new(), 0);
    for mut rest in objects.chunk_by_mut(|&a, &b| side_of(a) == side_of(b)) {
        let side = side_of(rest[0]);
        let lean = rest.iter().map(|&object| known(object).1).max();
        let lean = if side < ANY_SIDE { lean.unwrap_or(UNKNOWN_LEAN) } else { UNKNOWN_LEAN };
        bytes.push(side | lean << 4);
        block.clear();
        block_count += 1;
        // Layers of about equal rank, best first. Indices within a layer are ascending and stored as
        // differences.
        while !rest.is_empty() {
            let (layer, others) = rest.split_at_mut(layer_length(rest, |object| class(object).rank()));
            rest = others;
            of_layer.clear();
            let mean = SurfaceClass::mean(layer.iter().map(|&object| class(object)));
            layer.sort_unstable();
            let mut last = least;
            for &mut object in layer {
                push_number(object - last, &mut of_layer);
                last = object;
            }
            block.extend_from_slice(&[mean.area, mean.openness]);
            push_number(of_layer.len() as u32, &mut block);
            block.extend_from_slice(&of_layer);
        }
        push_number(block.len() as u32, bytes);
        bytes.extend_from_slice(&block);
    }
    block_count
}

/// Limit, exclusive, on the difference of [`SurfaceClass::rank`] between objects that share a layer (group of
/// similar objects): four ranks are a factor of four in area times openness.
const RANK_STEP: u32 = 4;

/// Returns the number of objects in the first layer (group of similar objects) of `objects`, which are the
/// remaining objects of one axis side of a cell in order of falling rank. A layer takes objects whose ranks
/// differ by less than [`RANK_STEP`], further ranks until it has [`MIN_LAYER`] objects, and all objects if
/// fewer than [`MIN_LAYER`] would remain.
fn layer_length(objects: &[u32], rank: impl Fn(u32) -> u32) -> usize {
    let mut length = 0;
    while length < objects.len() && length < MIN_LAYER {
        let least = rank(objects[length]).saturating_sub(RANK_STEP);
        length += objects[length..].partition_point(|&object| rank(object) > least);
    }
    if objects.len() - length < MIN_LAYER { objects.len() } else { length }
}

/// Iterator over the object indices of one layer (group of similar objects of a cell), in ascending order.
#[derive(Clone, Debug, Default)]
pub(crate) struct Layer<'a> {
    /// Means over the layer's objects: class of their mean area in square metres, mean class of their
    /// openness (mean free distance in front of a surface), and the axis side that they face.
    pub(crate) class: SurfaceClass,
    /// Object index returned last. Before the first object, the least object index in the cell.
    last: u32,
    /// Encoded differences between successive indices of the objects not returned yet.
    bytes: &'a [u8],
}

impl Iterator for Layer<'_> {
    type Item = u32;

    #[inline]
    fn next(&mut self) -> Option<u32> {
        self.last = self.last.wrapping_add(take_number(&mut self.bytes)?);
        Some(self.last)
    }
}

/// Iterator over the layers (groups of similar objects) of one axis side of a cell, in order of falling mean
/// area times openness. An axis side is one of the directions ±x, ±y and ±z that objects are grouped by.
#[derive(Clone, Debug, Default)]
pub(crate) struct Layers<'a> {
    /// Axis side that the objects face, 0 to 5 (twice the axis, plus one towards negative coordinates), or
    /// [`ANY_SIDE`] for objects without a single normal.
    pub(crate) side: u8,
    /// Upper bound on how far the normals of the side's objects lean from its axis, in units of
    /// 1 / [`LEAN_AT_45_DEGREES`]; [`UNKNOWN_LEAN`] for no bound.
    lean: MaxLean,
    /// Least object index in the cell, from which each layer's differences start.
    least: u32,
    /// Encoded layers not returned yet.
    bytes: &'a [u8],
}

impl<'a> Layers<'a> {
    /// Tests whether all triangles of the side's objects certainly face away from the eye. `cell` is the box,
    /// relative to the eye, of the cell that holds the objects. False if undecided or the lean is unknown.
    #[inline]
    pub(crate) fn is_back(&self, cell: &BoxFromEye) -> bool {
        // Objects of any side have no known lean.
        self.lean < UNKNOWN_LEAN && cell.is_behind(self.side, f32::from(self.lean) / LEAN_AT_45_DEGREES)
    }

    /// Returns the number of bytes of the layers not returned yet.
    #[inline]
    pub(crate) fn byte_count(&self) -> usize {
        self.bytes.len()
    }
}

impl<'a> Iterator for Layers<'a> {
    type Item = Layer<'a>;

    #[inline]
    fn next(&mut self) -> Option<Layer<'a>> {
        let (&[area, openness], mut bytes) = self.bytes.split_first_chunk()?;
        let length = take_number(&mut bytes)?;
        let (bytes, rest) = bytes.split_at_checked(length as usize)?;
        self.bytes = rest;
        Some(Layer { class: SurfaceClass { area, side: self.side, openness }, last: self.least, bytes })
    }
}

/// Iterator over the axis sides (plus or minus x, y or z, or [`ANY_SIDE`]) in a cell's encoded list. Each
/// item iterates over the layers of objects that face that side.
#[derive(Clone, Debug, Default)]
pub(crate) struct Sides<'a> {
    /// Least object index in the cell, from which each layer's differences start.
    least: u32,
    /// Encoded bytes of the sides not returned yet.
    bytes: &'a [u8],
}

impl<'a> Sides<'a> {
    /// Starts at the first axis side (group of objects that face ±x, ±y or ±z, or no single side) of a
    /// cell's encoded list. An empty list has no sides.
    #[inline]
    pub(crate) fn new(list: &'a [u8]) -> Self {
        let mut bytes = list;
        let least = take_number(&mut bytes).unwrap_or(0);
        Self { least, bytes }
    }

    /// Returns the number of encoded bytes of the axis sides (groups of objects that face ±x, ±y or ±z, or
    /// no single side) not returned yet.
    #[inline]
    pub(crate) fn byte_count(&self) -> usize {
        self.bytes.len()
    }

    /// Returns the layers (groups of similar objects) in one byte range of the cell's list. `from` and `to`
    /// are the range's start and end (exclusive), counted in bytes before the list's end. `side` is the axis
    /// side that the objects face; the lean of the result is unknown. No layers if the range does not fit the
    /// list. Call this before taking any side from the iterator.
    #[inline]
    pub(crate) fn layers(&self, side: u8, from: usize, to: usize) -> Layers<'a> {
        let place = |left: usize| self.bytes.len().saturating_sub(left);
        let bytes = self.bytes.get(place(from)..place(to)).unwrap_or(&[]);
        Layers { side, lean: UNKNOWN_LEAN, least: self.least, bytes }
    }
}

impl<'a> Iterator for Sides<'a> {
    type Item = Layers<'a>;

    #[inline]
    fn next(&mut self) -> Option<Layers<'a>> {
        let (&head, mut bytes) = self.bytes.split_first()?;
        let length = take_number(&mut bytes)?;
        let (bytes, rest) = bytes.split_at_checked(length as usize)?;
        self.bytes = rest;
        Some(Layers { side: head & 7, lean: head >> 4, least: self.least, bytes })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::content::Content;
    use crate::test_exact::{Random, RandomExact};
    use visibility_core::{Aabb, Object, Scene, glam::DVec3, view::Eye};

    /// A layer ends where ranks are four below the first, but not before twelve objects, and not so that
    /// fewer than twelve are left.
    #[test]
    fn layers_are_as_long_as_their_ranks_say() {
        let length = |ranks: &[u32]| {
            let objects: Vec<u32> = (0..ranks.len() as u32).collect();
            layer_length(&objects, |object| ranks[object as usize])
        };
        let of = |parts: &[(u32, usize)]| {
            let ranks = parts.iter().flat_map(|&(rank, count)| core::iter::repeat_n(rank, count));
            length(&ranks.collect::<Vec<_>>())
        };
        assert_eq!(of(&[(9, 12), (5, 12)]), 12, "four ranks apart, twelve on either side");
        assert_eq!(of(&[(9, 12), (6, 3), (5, 12)]), 15, "three ranks apart are together");
        assert_eq!(of(&[(9, 12), (5, 11)]), 23, "fewer than twelve stay with the others");
        assert_eq!(of(&[(9, 11), (5, 12), (1, 12)]), 23, "fewer than twelve take the next ranks");
        assert_eq!(of(&[(9, 12), (5, 12), (1, 12)]), 12, "twelve are enough");
        assert_eq!(of(&[]), 0, "no object");
    }

    /// Eight objects that face a side have a block of that side with a bound on their lean. Seven are among
    /// those of any side, of which nothing is known.
    #[test]
    fn few_objects_of_a_side_are_among_those_of_any_side() {
        let class = |side| (SurfaceClass { area: 100, side, openness: 31 }, 3);
        for count in [7, 8] {
            let classes: Vec<_> = (0..20).map(|i| class(if i < count { 2 } else { 5 })).collect();
            let (mut bytes, mut objects) = (Vec::new(), (0..20).collect::<Vec<u32>>());
            let blocks = push_list(&mut bytes, &mut objects, &classes);
            let sides: Vec<_> = Sides::new(&bytes).map(|layers| (layers.side, layers.lean)).collect();
            let few = if count < 8 { (ANY_SIDE, UNKNOWN_LEAN) } else { (2, 3) };
            assert!(blocks == 2 && sides.contains(&few) && sides.contains(&(5, 3)), "{count}: {sides:?}");
        }
    }

    /// Objects with a side but no known lean, as slivers are, count as fronts from everywhere.
    #[test]
    fn sides_of_unknown_lean_are_no_backs() {
        let cell = BoxFromEye::new(Eye::Point(DVec3::X * 1e6), 0.0, &Aabb::from_arrays([-1.0; 3], [1.0; 3]));
        let layers = |lean| Layers { side: 1, lean, ..Layers::default() };
        assert!(layers(UNKNOWN_LEAN - 1).is_back(&cell), "a known lean");
        assert!(!layers(UNKNOWN_LEAN).is_back(&cell), "an unknown lean");
    }

    /// Scenes of sloped triangles in a box and eyes around the box: if `is_back` is true for a side, each
    /// triangle of the side faces away from the eye.
    #[test]
    fn sides_that_turn_their_backs_do_so_as_a_whole() {
        let mut random = Random(71);
        let (mut behind, mut before) = (0, 0);
        for round in 0..60 {
            let mut scene = Scene::new();
            let slope = f64::from(round % 10) * 0.1;
            for _ in 0..150 {
                // Normals along an axis, or leaning from the axis by less than the slope.
                let mut normal = random.direction() * slope * 0.7;
                let axis = random.whole(3).unsigned_abs() as usize % 3;
                normal[axis] = if random.float() < 0.0 { 1.0 } else { -1.0 };
                let (u, v) = normal.normalize().any_orthonormal_pair();
                let q = random.direction() * random.float();
                let t = [q, q + u * 0.3, q + v * 0.3].map(|p| p.as_vec3());
                let id = scene.insert(Object::new(Aabb::from_points(t)));
                scene.set_triangles(id, [t]).unwrap();
            }
            let pairs: Vec<_> = scene.ids().map(|id| (0, id.index() as u32)).collect();
            let content = Content::new(&scene, &pairs, alloc::vec![[0; 4]]);
            let ids: Vec<_> = scene.ids().collect();
            let cell = Aabb::from_arrays([-1.5; 3], [1.5; 3]);
            for _ in 0..20 {
                let eye = random.direction() * (2.0 + 6.0 * random.float().abs());
                let toward = BoxFromEye::new(Eye::Point(eye), 0.0, &cell);
                for mut layers in content.sides(0) {
                    if !layers.is_back(&toward) {
                        before += 1;
                        continue;
                    }
                    behind += 1;
                    for object in layers.by_ref().flatten() {
                        let [a, b, c] = scene
                            .triangles(ids[object as usize])
                            .unwrap()
                            .get(0)
                            .unwrap()
                            .map(|p| p.as_dvec3());
                        let distance: f64 = (b - a).cross(c - a).dot(eye - a);
                        assert!(distance < 0.0, "{a} {b} {c} from {eye}");
                    }
                }
            }
        }
        assert!(behind > 500 && before > 500, "{behind} {before}");
    }
}
