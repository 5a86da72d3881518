//! A few lines spread over all directions, and which of them are nearest to a direction of sight.

use crate::kind::{ANYWHERE, SIDES};
use alloc::vec::Vec;
use visibility_core::glam::{Vec2, Vec3};

/// How many lines there are.
pub(crate) const LINES: usize = 16;

/// How many of them are asked about a direction.
const ASKED: usize = 3;

/// Steps along each side of the six faces of a cube, in which directions are looked up.
const STEPS: usize = 8;

/// One of the lines, seen from one of its ends.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Near {
    line: u8,
    /// Whether the direction is rather that of the line than the one against it.
    forth: bool,
    /// How much it counts.
    weight: f32,
}

/// The lines to ask about a direction, nearest first.
pub(crate) type Nearest = [Near; ASKED];

/// The lines nearest to each direction.
#[derive(Clone, Debug)]
pub(crate) struct Compass {
    along: [Vec3; LINES],
    nearest: Vec<Nearest>,
    /// By side of the scene and line, whether that side faces along the line rather than against it.
    faces: [[bool; LINES]; SIDES],
}

/// Cosine and sine of the golden angle.
const GOLDEN: Vec2 = Vec2::new(-0.737_368_9, 0.675_490_3);

/// Unit axes, the last of them along a line: directions spread over half the sphere, none along an axis of the scene.
pub(crate) fn axes(line: usize) -> [Vec3; 3] {
    // Points of a spiral by the golden angle.
    let mut around = Vec2::new(0.8, 0.6);
    for _ in 0..line {
        around = GOLDEN.rotate(around);
    }
    let z = (line as f32 + 0.5) / LINES as f32;
    let along = (around * Vec2::splat(1.0 - z * z).sqrt()).extend(z).normalize();
    let u = along.any_orthonormal_vector();
    [u, along.cross(u), along]
}

/// Where a direction is looked up.
#[inline]
fn place(direction: Vec3) -> usize {
    let axis = direction.abs().max_position();
    // Casts of NaN and of what is out of range are defined.
    let scale = STEPS as f32 * 0.5 / direction[axis].abs();
    let step = |x: f32| ((x * scale + STEPS as f32 * 0.5) as usize).min(STEPS - 1);
    let d = direction.to_array();
    let face = axis * 2 + usize::from(d[axis] < 0.0);
    (face * STEPS + step(d[(axis + 1) % 3])) * STEPS + step(d[(axis + 2) % 3])
}

/// How much what is known along one direction says of another at an angle with that cosine. An eighth power: lines are some 36 degrees apart.
fn closeness(cosine: f32) -> f32 {
    let square = cosine * cosine;
    let fourth = square * square;
    fourth * fourth
}

impl Default for Compass {
    fn default() -> Self {
        Self::new()
    }
}

impl Compass {
    pub(crate) fn new() -> Self {
        let along: [Vec3; LINES] = core::array::from_fn(|line| axes(line)[2]);
        let mut nearest = Vec::with_capacity(6 * STEPS * STEPS);
        for face in 0..6 {
            for i in 0..STEPS * STEPS {
                let middle = |step: usize| (step as f32 + 0.5) * (2.0 / STEPS as f32) - 1.0;
                let mut direction = [0.0; 3];
                direction[face / 2] = if face % 2 == 0 { 1.0 } else { -1.0 };
                direction[(face / 2 + 1) % 3] = middle(i / STEPS);
                direction[(face / 2 + 2) % 3] = middle(i % STEPS);
                let direction = Vec3::from_array(direction).normalize();
                let mut near: Vec<Near> = (0..LINES)
                    .map(|line| {
                        let cosine = along[line].dot(direction);
                        Near { line: line as u8, forth: cosine > 0.0, weight: closeness(cosine) }
                    })
                    .collect();
                near.sort_by(|a, b| b.weight.total_cmp(&a.weight));
                nearest.push([near[0], near[1], near[2]]);
            }
        }
        let faces = core::array::from_fn(|side| {
            // No line runs across an axis.
            along.map(|along| (along[(side / 2).min(2)] > 0.0) != (side % 2 == 1))
        });
        Self { along, nearest, faces }
    }

    /// Bytes held.
    pub(crate) fn memory(&self) -> usize {
        size_of_val(&self.nearest[..])
    }

    /// The lines nearest to a direction.
    #[inline]
    pub(crate) fn near(&self, direction: Vec3) -> &Nearest {
        &self.nearest[place(direction)]
    }

    /// Whether what faces a side faces along a line, rather than against it; none if it may be either.
    #[inline]
    fn faces(&self, side: u8, line: usize) -> Option<bool> {
        (side < ANYWHERE).then(|| self.faces[usize::from(side)][line])
    }

    /// Whether a line, forth or back, leads away before what faces a side, or may do so, rather than behind it.
    #[inline]
    pub(crate) fn is_before(&self, side: u8, line: usize, forth: bool) -> bool {
        self.faces(side, line).is_none_or(|faces| faces == forth)
    }

    /// What is probably along a line before what faces a side, from what is known along others.
    pub(crate) fn guess(&self, side: u8, line: usize, known: &[Option<f32>; LINES]) -> Option<f32> {
        let (mut sum, mut weight) = (0.0, 0.0);
        for (other, known) in known.iter().enumerate() {
            let cosine = self.along[line].dot(self.along[other]);
            // Those with which it forms an obtuse angle are near to its other end.
            let same = self.faces(side, line) == self.faces(side, other);
            let cosine = if side >= ANYWHERE {
                cosine.abs()
            } else if same {
                cosine
            } else {
                -cosine
            };
            if let Some(known) = known {
                let counts = closeness(cosine.max(0.01));
                (sum, weight) = (sum + counts * known, weight + counts);
            }
        }
        (weight > 0.0).then(|| sum / weight)
    }

    /// The mean of values by line for what faces a side, as seen from where some lines lead; `otherwise` where they lead behind it.
    #[inline]
    pub(crate) fn mean(&self, near: &Nearest, side: u8, value: impl Fn(usize) -> f32, otherwise: f32) -> f32 {
        let (mut sum, mut weight) = (0.0, 0.0);
        for near in near {
            let line = usize::from(near.line);
            let counts = if self.is_before(side, line, near.forth) { near.weight } else { 0.0 };
            sum += counts * value(line);
            weight += counts;
        }
        if weight > 0.0 { sum / weight } else { otherwise }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_line_is_near_and_in_sense() {
        let compass = Compass::new();
        for i in 0..500u32 {
            let place = |k: u32| (i.wrapping_mul(k) >> 8 & 0xffff) as f32 / 32768.0 - 1.0;
            let direction =
                Vec3::new(place(2_654_435_761), place(2_246_822_519), place(3_266_489_917)).normalize();
            let [first, ..] = compass.near(direction);
            let along = compass.along[usize::from(first.line)];
            let cosine = if first.forth { along } else { -along }.dot(direction);
            assert!(cosine > 0.75, "{direction}: {cosine}");
        }
    }

    #[test]
    fn what_is_open_to_one_side_is_found_open_from_there_alone() {
        let compass = Compass::new();
        // All that leads upwards is free.
        let free = |line: usize| if compass.along[line].z > 0.5 { 1.0 } else { 0.0 };
        assert!(compass.mean(compass.near(Vec3::Z), 4, free, 0.3) > 0.9);
        assert!(compass.mean(compass.near(Vec3::X), 0, free, 0.3) < 0.4);
        // From behind, nothing is known by line.
        assert_eq!(compass.mean(compass.near(-Vec3::Z), 4, free, 0.3), 0.3);
    }

    #[test]
    fn what_is_not_known_is_guessed_from_lines_near_to_it() {
        let compass = Compass::new();
        for side in 0..=ANYWHERE {
            for line in 0..LINES {
                assert_eq!(compass.guess(side, line, &[None; LINES]), None);
                // Its direction away from the side; what may face either way, along the line or against it.
                let away = |line: usize| {
                    compass.along[line] * if compass.faces(side, line) == Some(false) { -1.0 } else { 1.0 }
                };
                if side < ANYWHERE {
                    let outwards = away(line)[usize::from(side / 2)] * if side % 2 == 0 { 1.0 } else { -1.0 };
                    assert!(outwards > 0.0, "{side} {line}");
                }
                let cosine = |other: usize| {
                    let cosine = away(line).dot(away(other));
                    if side == ANYWHERE { cosine.abs() } else { cosine }
                };
                let mut others: Vec<usize> = (0..LINES).filter(|&other| other != line).collect();
                others.sort_by(|&a, &b| cosine(b).total_cmp(&cosine(a)));
                // Free along the nearest of them, or the farthest, and along no other.
                let guess = |free: usize| {
                    let mut known = [Some(0.0); LINES];
                    (known[line], known[free]) = (None, Some(1.0));
                    compass.guess(side, line, &known).unwrap()
                };
                let (near, far) = (guess(others[0]), guess(others[14]));
                assert!(near > 0.15 && far < 0.02, "{side} {line}: {near} {far}");
            }
        }
    }
}
