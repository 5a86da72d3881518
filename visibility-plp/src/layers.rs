//! How the list of a cell is kept: in layers of objects of like size, the largest first, as differences between ascending indices, mostly of one
//! byte each.
//!
//! A list is the least index in it, and then for each layer its size (a byte), how many it holds, the first as a difference from the least, and
//! the others as differences each from the one before. Numbers are in seven bits a byte.

use alloc::vec::Vec;
use visibility_core::{ObjectId, Scene};

/// Fewer objects than this are no layer of their own, which costs about as much as to look at so many.
const FEW: usize = 16;

/// The class of an area: each holds areas up to four times its least. Greater areas have greater classes; NaN the greatest.
fn class_of(area: f32) -> u8 {
    // The sign bit is clear, and the exponent without its lowest bit is left.
    if area.is_nan() { 0x7f } else { (area.max(0.0).to_bits() >> 24) as u8 }
}

/// An area in the middle of a class.
pub(crate) fn area_of(class: u8) -> f32 {
    f32::from_bits(u32::from(class) << 24 | 1 << 23)
}

/// The class of an object: that of the area of its triangles, or of its box if it has none.
pub(crate) fn class_of_object(scene: &Scene, id: ObjectId) -> u8 {
    let triangles = scene.triangles(id).unwrap_or(&[]);
    let mut area = 0.0;
    for [a, b, c] in triangles {
        area += (b - a).cross(c - a).length() * 0.5;
    }
    if triangles.is_empty()
        && let Ok(bounds) = scene.bounds(id)
    {
        let size = bounds.max - bounds.min;
        area = 2.0 * (size.x * size.y + size.y * size.z + size.z * size.x);
    }
    class_of(area)
}

/// Adds the list of a cell. Classes are by index of the object.
pub(crate) fn push_list(bytes: &mut Vec<u8>, objects: &mut [u32], classes: &[u8]) {
    let Some(&least) = objects.iter().min() else { return };
    let class = |object: u32| classes.get(object as usize).copied().unwrap_or(0);
    objects.sort_unstable_by_key(|&object| (u8::MAX - class(object), object));
    push_number(bytes, least);
    let mut rest = objects;
    while !rest.is_empty() {
        let (layer, smaller) = rest.split_at_mut(layer_length(rest, class));
        rest = smaller;
        let area: f32 = layer.iter().map(|&object| area_of(class(object))).sum();
        bytes.push(class_of(area / layer.len() as f32));
        push_number(bytes, layer.len() as u32);
        layer.sort_unstable();
        let mut last = least;
        for &mut object in layer {
            push_number(bytes, object - last);
            last = object;
        }
    }
}

/// How many of the objects of a cell, the largest first, its first layer takes: those of a class, and of more where they are few.
fn layer_length(objects: &[u32], class: impl Fn(u32) -> u8) -> usize {
    let mut length = 0;
    for of_class in objects.chunk_by(|&a, &b| class(a) == class(b)) {
        if length >= FEW {
            break;
        }
        length += of_class.len();
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
    pub(crate) left: u32,
    last: u32,
    /// Its numbers, and all after it.
    bytes: &'a [u8],
}

impl Layer<'_> {
    /// The index of its next object. To be called as often as it has objects left; anything after that.
    #[inline]
    pub(crate) fn take(&mut self) -> u32 {
        let number = take_number(&mut self.bytes).unwrap_or(0);
        self.last = self.last.wrapping_add(number);
        self.last
    }
}

/// The list of a cell, from one of its layers on.
#[derive(Clone, Debug, Default)]
pub(crate) struct Layers<'a> {
    least: u32,
    bytes: &'a [u8],
}

impl<'a> Layers<'a> {
    /// All of a list.
    #[inline]
    pub(crate) fn new(list: &'a [u8]) -> Self {
        let mut bytes = list;
        let least = take_number(&mut bytes).unwrap_or(0);
        Self { least, bytes }
    }

    /// How many bytes are left.
    pub(crate) fn len(&self) -> usize {
        self.bytes.len()
    }

    /// Goes on with so many bytes left.
    pub(crate) fn with_left(self, len: usize) -> Self {
        let passed = self.bytes.len().saturating_sub(len);
        Self { bytes: &self.bytes[passed..], ..self }
    }

    /// The next layer's class, without taking it.
    #[inline]
    pub(crate) fn class(&self) -> Option<u8> {
        self.bytes.first().copied()
    }

    /// The next layer. What it holds is to be taken, and [`pass`](Self::pass) told, before the one after it.
    #[inline]
    pub(crate) fn next(&self) -> Option<Layer<'a>> {
        let (_, mut bytes) = self.bytes.split_first()?;
        let left = take_number(&mut bytes)?;
        Some(Layer { left, last: self.least, bytes })
    }

    /// Goes on after a layer of which all was taken.
    #[inline]
    pub(crate) fn pass(&mut self, layer: &Layer<'a>) {
        self.bytes = layer.bytes;
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
}
