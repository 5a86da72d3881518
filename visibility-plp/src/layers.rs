//! How the list of a cell is kept: in layers of objects that face alike, are of like size and of like exposure, as differences between ascending
//! indices, mostly of one byte each.
//!
//! A list is the least index in it, and then for each side that objects face: the side and how far their normals lean from it, how many bytes
//! follow of it, and in these its layers, that of which most is to be seen first. Of a layer: its areas, its exposure, on the whole and in half
//! a byte for each line of the [compass](crate::compass), how many bytes follow, and in these the first index as a difference from the least in
//! the list, and the others as differences each from the one before. Numbers are in seven bits a byte.

use crate::compass::{Compass, LINES, Nearest};
use crate::exposure::Exposure;
use crate::facing::Toward;
use alloc::vec::Vec;
use visibility_core::glam::DVec3;
use visibility_core::{ObjectId, Scene};

/// Fewer objects than this are no layer of their own, which costs about as much as to look at so many. Smaller layers find more at small
/// budgets.
const FEW: usize = 12;

/// Fewer objects than this that face one side are put with those that face others.
const FEW_ON_SIDE: usize = 8;

/// What the objects of a layer are like.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub(crate) struct Kind {
    /// The class of their areas: each holds areas up to four times its least. Greater areas have greater classes; NaN the greatest.
    area: u8,
    /// Along which axis of the scene they face most, twice, and one more if downwards; or [`ANYWHERE`].
    pub(crate) facing: u8,
    /// How exposed they are: two steps are twice as much, and [`OPEN`] is 1.
    exposure: u8,
}

/// How far normals lean from the axis that they face: no component along another axis is greater than this many [`LEANS`]ths of that along it;
/// or [`ANYHOW`].
pub(crate) type Lean = u8;

/// Steps of leaning as far as any that face a side.
const LEANS: f32 = 14.0;

/// Leaning who knows how.
pub(crate) const ANYHOW: Lean = 15;

/// Sides that can be faced.
pub(crate) const SIDES: usize = 6;

/// Facing no side above all.
pub(crate) const ANYWHERE: u8 = SIDES as u8;

/// The greatest exposure.
const OPEN: u8 = 31;

/// The class of an area.
fn class_of(area: f32) -> u8 {
    // The sign bit is clear, and the exponent without its lowest bit is left.
    if area.is_nan() { 0x7f } else { (area.max(0.0).to_bits() >> 24) as u8 }
}

/// An area in the middle of a class.
fn area_of(class: u8) -> f32 {
    f32::from_bits(u32::from(class) << 24 | 1 << 23)
}

/// How many half octaves an exposure is below 1: by the exponent, and the highest bit of the fraction.
fn below_open(exposure: f32) -> u8 {
    let below = (1.0f32.to_bits() >> 22).saturating_sub(exposure.clamp(0.0, 1.0).to_bits() >> 22);
    below.min(u8::MAX.into()) as u8
}

/// The exposure so many half octaves below 1.
#[inline]
fn open_less(halves: u8) -> f32 {
    f32::from_bits(((1.0f32.to_bits() >> 22) - u32::from(halves)) << 22)
}

impl Kind {
    /// The kind of an object by itself, from its exposure, 0 to 1: by the area of its triangles, or of its box if it has none. And how far it
    /// leans.
    pub(crate) fn of_object(scene: &Scene, id: ObjectId, exposure: f32) -> (Self, Lean) {
        let triangles = scene.triangles(id).unwrap_or(&[]);
        // In single precision, squares of areas come to an end before coordinates do.
        let mut area = 0.0;
        for [a, b, c] in triangles {
            area += (b - a).as_dvec3().cross((c - a).as_dvec3()).length() * 0.5;
        }
        let mut area = area as f32;
        if triangles.is_empty()
            && let Ok(bounds) = scene.bounds(id)
        {
            let size = bounds.max - bounds.min;
            area = 2.0 * (size.x * size.y + size.y * size.z + size.z * size.x);
        }
        let (facing, lean) = match triangles {
            [[a, b, c]] => facing(b.as_dvec3() - a.as_dvec3(), c.as_dvec3() - a.as_dvec3()),
            _ => (ANYWHERE, ANYHOW),
        };
        (Self { area: class_of(area), facing, exposure: OPEN - below_open(exposure).min(OPEN) }, lean)
    }

    /// An area in the middle of its class.
    #[inline]
    pub(crate) fn area(self) -> f32 {
        area_of(self.area)
    }

    /// An exposure in its class.
    #[inline]
    pub(crate) fn exposure(self) -> f32 {
        open_less(OPEN - self.exposure.min(OPEN))
    }

    /// How much there is of it to be seen, in half octaves.
    fn rank(self) -> u32 {
        u32::from(self.area) * 4 + u32::from(self.exposure)
    }

    /// One kind for many.
    fn mean(kinds: impl Iterator<Item = Self> + Clone) -> Self {
        let count = kinds.clone().count().max(1);
        let area: f32 = kinds.clone().map(Self::area).sum();
        let exposure: usize = kinds.clone().map(|kind| usize::from(kind.exposure)).sum();
        let first = kinds.clone().next().map_or(ANYWHERE, |kind| kind.facing);
        let facing = if kinds.clone().all(|kind| kind.facing == first) { first } else { ANYWHERE };
        Self { area: class_of(area / count as f32), facing, exposure: (exposure / count) as u8 }
    }
}

/// The side that a triangle faces most, from two of its edges, and how far its normal leans from it.
fn facing(u: DVec3, v: DVec3) -> (u8, Lean) {
    let normal = u.cross(v);
    let size = normal.abs();
    let axis = size.max_position();
    if size[axis].is_nan() || size[axis] <= 0.0 {
        return (ANYWHERE, ANYHOW);
    }
    let side = axis as u8 * 2 + u8::from(normal[axis] < 0.0);
    let lean = size[(axis + 1) % 3].max(size[(axis + 2) % 3]) / size[axis];
    // The error of the normal is some 1e-15 of the product of lengths, so no more than 1e-8 of what is let through here.
    let known = size[axis] > 1e-7 * u.length() * v.length() && size[axis] < f64::INFINITY;
    let steps = (lean - 1e-7).max(0.0) * f64::from(LEANS);
    // Casts round towards zero.
    (side, if known { steps as u8 + u8::from(steps > f64::from(steps as u8)) } else { ANYHOW })
}

/// What is free before some objects of one side along each line, two lines a byte; where that is not known, as along lines near to it.
fn exposures_along(
    objects: &[u32],
    side: u8,
    mean: Kind,
    exposures: &[Exposure],
    compass: &Compass,
) -> [u8; LINES / 2] {
    let mut known = [None; LINES];
    for (line, known) in known.iter_mut().enumerate() {
        let (mut sum, mut count) = (0.0, 0.0);
        for &object in objects {
            if let Some((free, forth)) =
                exposures.get(object as usize).and_then(|exposure| exposure.along(line))
                && compass.is_before(side, line, forth)
            {
                (sum, count) = (sum + free, count + 1.0);
            }
        }
        *known = (count > 0.0).then(|| sum / count);
    }
    let mut bytes = [0; LINES / 2];
    for line in 0..LINES {
        let free = known[line].or_else(|| compass.guess(side, line, &known)).unwrap_or(mean.exposure());
        bytes[line / 2] |= below_open(free).min(15) << (line % 2 * 4);
    }
    bytes
}

/// Adds the list of a cell. Kinds with leaning, and exposures, are by index of the object.
pub(crate) fn push_list(
    bytes: &mut Vec<u8>,
    objects: &mut [u32],
    kinds: &[(Kind, Lean)],
    exposures: &[Exposure],
    compass: &Compass,
) {
    let Some(&least) = objects.iter().min() else { return };
    let known = |object: u32| kinds.get(object as usize).copied().unwrap_or((Kind::default(), ANYHOW));
    let kind = |object: u32| known(object).0;
    push_number(bytes, least);
    // Sides of few objects are no sides of their own.
    let mut counts = [0usize; 256];
    for &object in &*objects {
        counts[usize::from(kind(object).facing)] += 1;
    }
    let side = |object: u32| {
        let facing = kind(object).facing;
        if counts[usize::from(facing)] < FEW_ON_SIDE { ANYWHERE } else { facing }
    };
    objects.sort_unstable_by_key(|&object| (side(object), u32::MAX - kind(object).rank(), object));
    let (mut of_side, mut of_layer) = (Vec::new(), Vec::new());
    for mut rest in objects.chunk_by_mut(|&a, &b| side(a) == side(b)) {
        let facing = side(rest[0]);
        let lean = rest.iter().map(|&object| known(object).1).max();
        bytes.push(facing | if facing < ANYWHERE { lean.unwrap_or(ANYHOW) } else { ANYHOW } << 4);
        of_side.clear();
        while !rest.is_empty() {
            let (layer, others) = rest.split_at_mut(layer_length(rest, |object| kind(object).rank()));
            rest = others;
            of_layer.clear();
            let mean = Kind::mean(layer.iter().map(|&object| kind(object)));
            let along = exposures_along(layer, facing, mean, exposures, compass);
            layer.sort_unstable();
            let mut last = least;
            for &mut object in layer {
                push_number(&mut of_layer, object - last);
                last = object;
            }
            of_side.extend_from_slice(&[mean.area, mean.exposure]);
            of_side.extend_from_slice(&along);
            push_number(&mut of_side, of_layer.len() as u32);
            of_side.extend_from_slice(&of_layer);
        }
        push_number(bytes, of_side.len() as u32);
        bytes.extend_from_slice(&of_side);
    }
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
    pub(crate) kind: Kind,
    /// What is free before it by line, two lines a byte.
    along: [u8; LINES / 2],
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

    /// What is free before it, from 0 to 1, towards where some lines lead, or on the whole.
    #[inline]
    pub(crate) fn exposure(&self, compass: &Compass, towards: Option<&Nearest>) -> f32 {
        let along = |line: usize| open_less(self.along[line / 2] >> (line % 2 * 4) & 15);
        towards.map_or(self.kind.exposure(), |near| {
            compass.mean(near, self.kind.facing, along, self.kind.exposure())
        })
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
        self.facing < ANYWHERE
            && self.lean < ANYHOW
            && toward.is_behind(self.facing, f32::from(self.lean) / LEANS)
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
        let (&[area, exposure], bytes) = self.bytes.split_first_chunk()?;
        let (&along, mut bytes) = bytes.split_first_chunk()?;
        let length = take_number(&mut bytes)?;
        let (bytes, rest) = bytes.split_at_checked(length as usize)?;
        self.bytes = rest;
        Some(Layer { kind: Kind { area, facing: self.facing, exposure }, along, last: self.least, bytes })
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
        Layers { facing, lean: ANYHOW, least: self.least, bytes }
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

    #[test]
    fn classes_are_in_order_and_hold_their_middle() {
        let areas = [0.0, 1e-45, 1e-30, 0.02, 0.1, 0.3, 1.9, 2.1, 7.9, 8.1, 1e30, f32::MAX, f32::INFINITY];
        assert!(areas.windows(2).all(|pair| class_of(pair[0]) <= class_of(pair[1])));
        for area in areas {
            assert_eq!(class_of(area_of(class_of(area))), class_of(area), "{area}");
        }
        assert!(class_of(2.1) < class_of(8.1) && class_of(f32::NAN) >= class_of(f32::INFINITY));
        assert_eq!(class_of(-1.0), 0);
    }

    #[test]
    fn kinds_tell_sides_and_exposures() {
        let kind = |exposure: f32, t: [[f32; 3]; 3]| {
            let mut scene = Scene::new();
            let t = t.map(visibility_core::glam::Vec3::from_array);
            let id = scene.insert(visibility_core::Aabb::from_points(t));
            scene.set_triangles(id, [t]).unwrap();
            Kind::of_object(&scene, id, exposure).0
        };
        let up = [[0.0; 3], [1.0, 0.0, 0.2], [0.0, 1.0, -0.2]];
        assert_eq!((kind(1.0, up).facing, kind(1.0, [up[0], up[2], up[1]]).facing), (4, 5));
        assert_eq!(kind(1.0, [up[0], up[1], up[1]]).facing, ANYWHERE);
        for exposure in [1.0, 0.7, 0.5, 0.3, 0.02, 1e-4] {
            let told = kind(exposure, up).exposure();
            assert!(told <= exposure && exposure < told * 1.51, "{exposure}: {told}");
        }
        assert!(kind(0.0, up).exposure() < 1e-4 && kind(f32::NAN, up).exposure() == 1.0);
    }

    /// Triangles in a box, facing everywhere, and eyes around it: never behind what faces it.
    #[test]
    fn what_is_behind_a_side_is_behind_its_triangles() {
        let mut state = 5u64;
        let mut random = move || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 40) as f32 / (1 << 23) as f32 - 1.0
        };
        let cell = visibility_core::Aabb::from_arrays([-1.0; 3], [1.0; 3]);
        let (mut behind, mut leaning) = (0, 0);
        for i in 0..20_000 {
            let mut point = || DVec3::new(random().into(), random().into(), random().into());
            let (a, mut b, mut c) = (point(), point(), point());
            if i % 2 == 0 {
                (b.x, c.x) = (a.x, a.x + (c.x - a.x) * 0.3);
            }
            let eye = point() * 8.0;
            let (side, lean) = facing(b - a, c - a);
            let toward = Toward::new(visibility_core::Eye::Point(eye), &cell);
            if lean < ANYHOW && toward.is_behind(side, f32::from(lean) / LEANS) {
                assert!((b - a).cross(c - a).dot(eye - a) < 0.0, "{a} {b} {c} from {eye}: {side} {lean}");
                behind += 1;
                leaning += u32::from(lean > 4);
            }
        }
        assert!(behind > 500 && leaning > 200, "{behind} {leaning}");
    }
}
