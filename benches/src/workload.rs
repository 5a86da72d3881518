//! Boxes and cameras of the benchmarks: small boxes evenly distributed in a cube, seen by a camera that turns
//! a little each frame.
//!
//! An even distribution is the hard case for frustum culling: there is no empty space to skip, and every
//! plane intersects many boxes. The camera turns because with a still view the branch predictor would learn a
//! short traversal by heart, which never happens in a game.

use glam::{Affine3A, DMat4, DVec3, Vec3};
use visibility_core::{Aabb, Object, OccluderMesh, Pose, Scene, View, view::Depth};

/// Half the side of the cube that the boxes fill, in metres.
pub const REACH: f32 = 500.0;

/// Number of frames in one swing of the camera, after which the views repeat.
pub const FRAMES: usize = 16;

/// Random number generator: [`visibility_core::random`], which makes equal boxes on every machine. The field
/// is the state; every seed is permitted.
#[derive(Clone, Debug)]
pub struct Random(pub u64);

impl Random {
    /// Draws 64 random bits.
    pub fn bits(&mut self) -> u64 {
        let mut random = visibility_core::random::Random(self.0);
        let bits = random.bits();
        self.0 = random.0;
        bits
    }

    /// Draws a number in [low, high), up to rounding.
    pub fn within(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * (self.bits() >> 40) as f32 / (1u64 << 24) as f32
    }

    /// Draws a point with each coordinate in [low, high), up to rounding.
    pub fn point(&mut self, low: f32, high: f32) -> Vec3 {
        Vec3::new(self.within(low, high), self.within(low, high), self.within(low, high))
    }

    /// Draws `count` different numbers below `limit`, in random order. `count` must not exceed `limit`.
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

/// Order in which the boxes are given to the contenders.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Order {
    /// Random order, in which neighbours in memory are far apart in space.
    Random,
    /// Order along a space-filling curve, which helps the branch prediction of loops over all boxes.
    Sorted,
}

impl Order {
    /// Both orders, random first.
    pub const ALL: [Self; 2] = [Self::Random, Self::Sorted];

    /// Returns the order's name as tables show it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Random => "random",
            Self::Sorted => "sorted",
        }
    }
}

/// Makes `count` boxes with sides of 0.5 to 3 m, with their centres in a cube of a kilometre.
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

/// Returns the Morton code of a point on a grid of 1024 cells per side of the cube.
fn morton(point: Vec3) -> u64 {
    let cell = ((point + REACH) / (2.0 * REACH) * 1024.0).to_array().map(|x| x as u64);
    (0..10).fold(0, |place, bit| {
        (0..3).fold(place, |place, axis| place | (cell[axis] >> bit & 1) << (3 * bit + axis))
    })
}

/// Share of the boxes that is inside the camera's frustum.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Share {
    /// About 11 %: the far plane lies beyond the cube.
    Eleven,
    /// About 1 %: a draw distance of 233 m.
    One,
}

impl Share {
    /// Both shares, the larger first.
    pub const ALL: [Self; 2] = [Self::Eleven, Self::One];

    /// Returns the share's name as tables show it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Eleven => "11 %",
            Self::One => "1 %",
        }
    }

    /// Returns the distance of the far plane, in metres.
    fn far(self) -> f64 {
        match self {
            Self::Eleven => 2000.0,
            Self::One => 233.0,
        }
    }
}

/// Makes the [`FRAMES`] views of one swing of a camera near the centre of the cube: it turns by 10 degrees to
/// either side and returns to its start. The vertical field of view is 60 degrees and the aspect ratio 16:9.
/// All six planes are finite and the clip space is that of OpenGL, because treeculler supports only such
/// views.
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

/// Returns the clip matrix of the camera, in OpenGL's convention, with its near plane at 0.1 m and its far
/// plane at `far` metres.
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

/// Builds a town of 2,500 houses, all of them occluders, with 20,000 small objects among them, and a view
/// from one of its streets.
pub fn town() -> (Scene, View) {
    let mut random = Random(3);
    let mut scene = Scene::new();
    for i in 0..2500 {
        let (x, y) = ((i % 50) as f32 * 30.0 - 750.0, (i / 50) as f32 * 30.0 - 750.0);
        let house =
            Aabb::from_arrays([x + 5.0, y + 5.0, 0.0], [x + 25.0, y + 25.0, random.within(8.0, 60.0)]);
        let id = scene.insert(Object { occluder: true, ..Object::new(house) });
        let mesh = scene.add_mesh(OccluderMesh::cuboid(&house).expect("a box"));
        scene.set_mesh(id, mesh, Affine3A::IDENTITY).expect("it was just inserted");
    }
    for _ in 0..20_000 {
        let p =
            Vec3::new(random.within(-750.0, 750.0), random.within(-750.0, 750.0), random.within(0.0, 3.0));
        scene.insert(Aabb::new(p - 0.5, p + 0.5));
    }
    scene.rebuild();
    let pose = Pose::look_at(DVec3::new(0.0, 0.0, 1.7), DVec3::new(100.0, 40.0, 5.0), DVec3::Z);
    let view = View::perspective(pose, 1.0, 16.0 / 9.0, 0.1, f64::INFINITY).expect("a camera by the book");
    (scene, view)
}
