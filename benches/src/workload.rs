//! Boxes and cameras: small boxes spread evenly through a cube, seen by a camera that turns a little each
//! frame.
//!
//! An even spread is the hard case for frustum culling: no empty space to skip, and every plane cuts the
//! crowd. The camera turns, because on a still view a processor learns the branches of a short walk by heart,
//! which no game would see.

use glam::{DMat4, DVec3, Vec3};
use visibility_core::{Aabb, View, view::Depth};

/// Half the side of the cube that the boxes fill, in metres.
pub const REACH: f32 = 500.0;

/// Frames of one turn of the camera.
pub const FRAMES: usize = 16;

/// SplitMix64 (Steele, Lea and Flood, "Fast Splittable Pseudorandom Number Generators", 2014): the same boxes
/// on every machine.
#[derive(Clone, Debug)]
pub struct Random(pub u64);

impl Random {
    /// 64 random bits.
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ self.0 >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ z >> 31
    }

    /// A number from `low` to `high`.
    pub fn within(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * (self.bits() >> 40) as f32 / (1u64 << 24) as f32
    }

    /// A point whose coordinates are each from `low` to `high`.
    pub fn point(&mut self, low: f32, high: f32) -> Vec3 {
        Vec3::new(self.within(low, high), self.within(low, high), self.within(low, high))
    }

    /// `count` different numbers below `limit`, in random order.
    pub fn choose(&mut self, count: usize, limit: usize) -> Vec<u32> {
        let mut all: Vec<u32> = (0..limit as u32).collect();
        for i in 0..count {
            let other = i + (self.bits() % (limit - i) as u64) as usize;
            all.swap(i, other);
        }
        all.truncate(count);
        all
    }
}

/// The order in which the boxes are given to the contenders.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Order {
    /// As they come.
    Random,
    /// Along a space-filling curve: what those who loop over all boxes can do to please the branch predictor.
    Sorted,
}

impl Order {
    /// Both.
    pub const ALL: [Self; 2] = [Self::Random, Self::Sorted];

    /// A word for tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Random => "random",
            Self::Sorted => "sorted",
        }
    }
}

/// `count` boxes of 0.5 to 3 m in a cube of a kilometre.
pub fn boxes(count: usize, order: Order) -> Vec<Aabb> {
    let mut random = Random(1);
    let mut boxes: Vec<Aabb> = (0..count)
        .map(|_| {
            let (center, half) = (random.point(-REACH, REACH), random.point(0.25, 1.5));
            Aabb::new(center - half, center + half)
        })
        .collect();
    if order == Order::Sorted {
        boxes.sort_by_key(|b| morton(b.center()));
    }
    boxes
}

/// The place of a point on the Morton curve through the cube.
fn morton(point: Vec3) -> u64 {
    let cell = ((point + REACH) / (2.0 * REACH) * 1024.0).to_array().map(|x| x as u64);
    (0..10).fold(0, |place, bit| {
        (0..3).fold(place, |place, axis| place | (cell[axis] >> bit & 1) << (3 * bit + axis))
    })
}

/// How much of the cube the camera sees.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Share {
    /// Some 11 %: the far plane lies beyond the cube.
    Eleven,
    /// Some 1 %: a draw distance of 233 m.
    One,
}

impl Share {
    /// Both.
    pub const ALL: [Self; 2] = [Self::Eleven, Self::One];

    /// A word for tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Eleven => "11 %",
            Self::One => "1 %",
        }
    }

    fn far(self) -> f64 {
        match self {
            Self::Eleven => 2000.0,
            Self::One => 233.0,
        }
    }
}

/// A camera in the middle of the cube, 60 degrees high and 16:9 wide, swinging by 10 degrees to either side;
/// it is back where it began after [`FRAMES`] frames. All six planes are finite and the clip space is that of
/// OpenGL, because treeculler knows no other.
pub fn views(share: Share) -> Vec<View> {
    let view = |frame: usize| {
        let phase = core::f64::consts::TAU * frame as f64 / FRAMES as f64;
        let yaw = 0.6 + 10f64.to_radians() * phase.sin();
        let eye = DVec3::new(11.0, -7.0, 3.0);
        let forward = DVec3::new(yaw.cos(), yaw.sin(), 0.2);
        View::from_clip_from_world(clip_from_world(eye, forward, share.far()), Depth::NegativeOneToOne)
    };
    (0..FRAMES).map(|frame| view(frame).expect("a camera by the book")).collect()
}

fn clip_from_world(eye: DVec3, forward: DVec3, far: f64) -> DMat4 {
    let near = 0.1;
    let z = -forward.normalize();
    let x = DVec3::Z.cross(z).normalize();
    let y = z.cross(x);
    let view = DMat4::from_cols(x.extend(0.0), y.extend(0.0), z.extend(0.0), eye.extend(1.0)).inverse();
    let height = 1.0 / 30f64.to_radians().tan();
    let depth = 1.0 / (near - far);
    let projection = DMat4::from_cols_array_2d(&[
        [height * 9.0 / 16.0, 0.0, 0.0, 0.0],
        [0.0, height, 0.0, 0.0],
        [0.0, 0.0, (near + far) * depth, -1.0],
        [0.0, 0.0, 2.0 * near * far * depth, 0.0],
    ]);
    projection * view
}
