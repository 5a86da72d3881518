//! Objects of a cell, bucketed by facing direction, size and openness, so that a budget takes the best buckets first.
//!
//! The list of a cell is a byte string. First the least object index in the cell. Then one block for each axis side that
//! objects face: a byte of side and lean, the number of bytes that follow in the block, and its layers, best first. A
//! layer is one byte of area class, one byte of openness class, the number of bytes that follow in it, and the objects in
//! ascending order: the first as a difference from the least index in the cell, each other one as a difference from the
//! one before. Numbers take seven bits a byte, the lowest bits first.

use crate::facing::Toward;
use crate::surface_class::{ANY_SIDE, LEAN_STEPS, Lean, SurfaceClass, UNKNOWN_LEAN};
use alloc::vec::Vec;

/// Fewer objects than this are no layer of their own, which costs about as much as to look at so many. Smaller layers find more at small
/// budgets.
const FEW: usize = 12;

/// Fewer objects than this that face one side are put with those that face others.
const FEW_ON_SIDE: usize = 8;

/// Adds the list of a cell to `bytes`. `classes` is indexed by object index; an object beyond its end has the default
/// class. Sorts `objects`. Returns the number of sides. Adds nothing for a cell without objects.
pub(crate) fn push_list(bytes: &mut Vec<u8>, objects: &mut [u32], classes: &[(SurfaceClass, Lean)]) -> usize {
    let Some(&least) = objects.iter().min() else { return 0 };
    let known = |object: u32| {
        classes.get(object as usize).copied().unwrap_or((SurfaceClass::default(), UNKNOWN_LEAN))
    };
    let class = |object: u32| known(object).0;
    push_number(bytes, least);
    // Sides of few objects are no sides of their own.
    let mut counts = [0usize; 256];
    for &object in &*objects {
        counts[usize::from(class(object).side)] += 1;
    }
    let side = |object: u32| {
        let facing = class(object).side;
        if counts[usize::from(facing)] < FEW_ON_SIDE { ANY_SIDE } else { facing }
    };
    objects.sort_unstable_by_key(|&object| (side(object), u32::MAX - class(object).rank(), object));
    let (mut of_side, mut of_layer, mut side_count) = (Vec::new(), Vec::new(), 0);
    for mut rest in objects.chunk_by_mut(|&a, &b| side(a) == side(b)) {
        let facing = side(rest[0]);
        let lean = rest.iter().map(|&object| known(object).1).max();
        bytes.push(facing | if facing < ANY_SIDE { lean.unwrap_or(UNKNOWN_LEAN) } else { UNKNOWN_LEAN } << 4);
        of_side.clear();
        side_count += 1;
        while !rest.is_empty() {
            let (layer, others) = rest.split_at_mut(layer_length(rest, |object| class(object).rank()));
            rest = others;
            of_layer.clear();
            let mean = SurfaceClass::mean(layer.iter().map(|&object| class(object)));
            layer.sort_unstable();
            let mut last = least;
            for &mut object in layer {
                push_number(&mut of_layer, object - last);
                last = object;
            }
            of_side.extend_from_slice(&[mean.area, mean.openness]);
            push_number(&mut of_side, of_layer.len() as u32);
            of_side.extend_from_slice(&of_layer);
        }
        push_number(bytes, of_side.len() as u32);
        bytes.extend_from_slice(&of_side);
    }
    side_count
}

/// Ranks that differ by less than this go together.
const ALIKE: u32 = 4;

/// How many of the objects of one side of a cell, the highest in rank first, its first layer takes: those of like rank, and more where they
/// are few.
fn layer_length(objects: &[u32], rank: impl Fn(u32) -> u32) -> usize {
    let mut length = 0;
    while length < objects.len() && length < FEW {
        let least = rank(objects[length]).saturating_sub(ALIKE);
        length += objects[length..].partition_point(|&object| rank(object) > least);
    }
    if objects.len() - length < FEW { objects.len() } else { length }
}

/// Seven bits a byte, the lowest first; the highest bit of a byte says that more follow.
fn push_number(bytes: &mut Vec<u8>, mut number: u32) {
    while number >= 0x80 {
        bytes.push(number as u8 | 0x80);
        number >>= 7;
    }
    bytes.push(number as u8);
}

/// Takes a number off the front; none if the bytes end before it does.
#[inline]
fn take_number(bytes: &mut &[u8]) -> Option<u32> {
    let (&first, rest) = bytes.split_first()?;
    *bytes = rest;
    if first & 0x80 == 0 {
        return Some(first.into());
    }
    let (mut number, mut shift) = (u32::from(first & 0x7f), 7);
    loop {
        let (&next, rest) = bytes.split_first()?;
        *bytes = rest;
        number |= u32::from(next & 0x7f).wrapping_shl(shift);
        shift += 7;
        if next & 0x80 == 0 || shift >= 35 {
            return Some(number);
        }
    }
}

/// One layer of a cell, or what is left of it.
#[derive(Clone, Debug, Default)]
pub(crate) struct Layer<'a> {
    pub(crate) class: SurfaceClass,
    last: u32,
    /// The numbers of its objects.
    bytes: &'a [u8],
}

impl Layer<'_> {
    /// No fewer than the objects in it.
    #[inline]
    pub(crate) fn most(&self) -> usize {
        self.bytes.len()
    }
}

impl Iterator for Layer<'_> {
    type Item = u32;

    /// The index of its next object.
    #[inline]
    fn next(&mut self) -> Option<u32> {
        self.last = self.last.wrapping_add(take_number(&mut self.bytes)?);
        Some(self.last)
    }
}

/// The layers of one side of a cell, or those that are left.
#[derive(Clone, Debug, Default)]
pub(crate) struct Layers<'a> {
    pub(crate) facing: u8,
    lean: Lean,
    least: u32,
    bytes: &'a [u8],
}

impl<'a> Layers<'a> {
    /// Whether all of it turns its back to the eye, surely.
    #[inline]
    pub(crate) fn is_back(&self, toward: &Toward) -> bool {
        self.facing < ANY_SIDE
            && self.lean < UNKNOWN_LEAN
            && toward.is_behind(self.facing, f32::from(self.lean) / LEAN_STEPS)
    }

    /// How many bytes are left.
    #[inline]
    pub(crate) fn len(&self) -> usize {
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
        Some(Layer { class: SurfaceClass { area, side: self.facing, openness }, last: self.least, bytes })
    }
}

/// The list of a cell, from one of its sides on.
#[derive(Clone, Debug, Default)]
pub(crate) struct Sides<'a> {
    least: u32,
    bytes: &'a [u8],
}

impl<'a> Sides<'a> {
    /// All of a list.
    #[inline]
    pub(crate) fn new(list: &'a [u8]) -> Self {
        let mut bytes = list;
        let least = take_number(&mut bytes).unwrap_or(0);
        Self { least, bytes }
    }

    /// How many bytes are left.
    #[inline]
    pub(crate) fn len(&self) -> usize {
        self.bytes.len()
    }

    /// Those layers of the side at hand that lie so many bytes before the end of the list.
    #[inline]
    pub(crate) fn layers(&self, facing: u8, from: usize, to: usize) -> Layers<'a> {
        let place = |left: usize| self.bytes.len().saturating_sub(left);
        let bytes = self.bytes.get(place(from)..place(to)).unwrap_or(&[]);
        Layers { facing, lean: UNKNOWN_LEAN, least: self.least, bytes }
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
        Some(Layers { facing: head & 7, lean: head >> 4, least: self.least, bytes })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::content::Content;
    use crate::whole::Random;
    use visibility_core::{Aabb, Eye, Object, Scene};

    /// Slopes and walls in a box, and eyes around it: a side that turns its back has nothing in it that does not.
    #[test]
    fn sides_that_turn_their_backs_do_so_as_a_whole() {
        let mut random = Random(71);
        let (mut behind, mut before) = (0, 0);
        for round in 0..60 {
            let mut scene = Scene::new();
            let slope = f64::from(round % 10) * 0.1;
            for _ in 0..150 {
                // Facing along an axis, or leaning from it by less than the slope.
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
                let toward = Toward::new(Eye::Point(eye), &cell);
                for mut layers in content.sides(0) {
                    if !layers.is_back(&toward) {
                        before += 1;
                        continue;
                    }
                    behind += 1;
                    for object in layers.by_ref().flatten() {
                        let [a, b, c] =
                            scene.triangles(ids[object as usize]).unwrap()[0].map(|p| p.as_dvec3());
                        let distance: f64 = (b - a).cross(c - a).dot(eye - a);
                        assert!(distance < 0.0, "{a} {b} {c} from {eye}");
                    }
                }
            }
        }
        assert!(behind > 500 && before > 500, "{behind} {before}");
    }
}
