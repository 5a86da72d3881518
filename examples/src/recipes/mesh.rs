//! Triangle meshes of the recipes in f64: cuboids, cylinders, prisms and quadrilaterals, and rigid motions of
//! the meshes.
//!
//! Recipes compute in f64 and round to f32 once, at the end. So each coordinate of a chair on the far side of
//! a large city is wrong by at most half a unit in the last place.

use crate::source::SourceObject;
use glam::{DVec2, DVec3};
use std::f64::consts::{FRAC_PI_2, TAU};

/// Triangle soup under construction, in metres. Solids are wound counter-clockwise as seen from outside.
#[derive(Debug, Clone, Default)]
pub(crate) struct Mesh {
    pub(crate) triangles: Vec<[DVec3; 3]>,
}

/// Triangles of a cuboid, two per face, as indices of its corners and counter-clockwise as seen from outside.
/// Corners 0 to 3 go counter-clockwise around the bottom from the minimum corner, and corners 4 to 7 lie
/// above corners 0 to 3.
const CUBOID_FACES: [[usize; 3]; 12] = [
    [0, 2, 1],
    [0, 3, 2],
    [4, 5, 6],
    [4, 6, 7],
    [0, 1, 5],
    [0, 5, 4],
    [1, 2, 6],
    [1, 6, 5],
    [2, 3, 7],
    [2, 7, 6],
    [3, 0, 4],
    [3, 4, 7],
];

impl Mesh {
    pub(crate) fn new() -> Self {
        Self::default()
    }

    /// Makes a mesh of one axis-aligned cuboid between its minimum and its maximum corner.
    pub(crate) fn from_cuboid(low: [f64; 3], high: [f64; 3]) -> Self {
        let mut mesh = Self::new();
        mesh.cuboid(low, high);
        mesh
    }

    /// Adds the 12 triangles of an axis-aligned cuboid between its minimum and its maximum corner. Swapped
    /// coordinates would turn the faces inside out.
    pub(crate) fn cuboid(&mut self, low: [f64; 3], high: [f64; 3]) {
        let around = [(low[0], low[1]), (high[0], low[1]), (high[0], high[1]), (low[0], high[1])];
        let corner = |i: usize| {
            let (x, y) = around[i % 4];
            DVec3::new(x, y, if i < 4 { low[2] } else { high[2] })
        };
        self.triangles.extend(CUBOID_FACES.map(|face| face.map(corner)));
    }

    /// Adds a closed upright cylinder or cone frustum. A top radius of at most 1e-6 m makes a cone, which has
    /// no top face.
    pub(crate) fn cylinder(&mut self, c: &Cylinder) {
        let bottom = c.ring(c.bottom, c.bottom_radius);
        let top = c.ring(c.top, c.top_radius);
        let pointed = c.top_radius <= 1e-6;
        self.band(&bottom, &top, pointed);
        if !pointed {
            let centre = c.centre.extend(c.top);
            self.triangles.extend(around(c.sides).map(|(i, next)| [centre, top[i], top[next]]));
        }
        let centre = c.centre.extend(c.bottom);
        self.triangles.extend(around(c.sides).map(|(i, next)| [centre, bottom[next], bottom[i]]));
    }

    /// Adds the side wall between two rings of points. Both rings run counter-clockwise as seen from above;
    /// if their lengths differ, the surplus points of the longer ring are ignored. When `pointed`, all points
    /// of `top` are the tip of a cone, and each side is a single triangle instead of two.
    pub(crate) fn band(&mut self, bottom: &[DVec3], top: &[DVec3], pointed: bool) {
        let sides = bottom.len().min(top.len());
        self.triangles.extend(around(sides).map(|(i, next)| [bottom[i], bottom[next], top[next]]));
        if !pointed {
            self.triangles.extend(around(sides).map(|(i, next)| [bottom[i], top[next], top[i]]));
        }
    }

    /// Adds an upright prism over a convex polygon, counter-clockwise as seen from above, between the heights
    /// `bottom` and `top`. The prism has a top face but no bottom face, which would lie on the ground.
    pub(crate) fn prism(&mut self, polygon: &[DVec2], bottom: f64, top: f64) {
        let lower: Vec<_> = polygon.iter().map(|p| p.extend(bottom)).collect();
        let upper: Vec<_> = polygon.iter().map(|p| p.extend(top)).collect();
        self.band(&lower, &upper, false);
        self.triangles.extend((1..upper.len().saturating_sub(1)).map(|i| [upper[0], upper[i], upper[i + 1]]));
    }

    /// Adds a flat or folded quadrilateral as two triangles, split along the diagonal from the first to the
    /// third corner.
    pub(crate) fn quad(&mut self, [a, b, c, d]: [DVec3; 4]) {
        self.triangles.extend([[a, b, c], [a, c, d]]);
    }

    /// Returns the mesh with every vertex multiplied by `factor`. A negative factor would turn solids inside
    /// out.
    pub(crate) fn scaled(mut self, factor: f64) -> Self {
        self.triangles.iter_mut().flatten().for_each(|p| *p *= factor);
        self
    }

    /// Returns the mesh translated by `offset` metres.
    pub(crate) fn moved(mut self, offset: DVec3) -> Self {
        self.triangles.iter_mut().flatten().for_each(|p| *p += offset);
        self
    }

    /// Returns the mesh rotated and translated by `pose`.
    pub(crate) fn placed(mut self, pose: &Pose) -> Self {
        self.triangles.iter_mut().flatten().for_each(|p| *p = pose.apply(*p));
        self
    }

    /// Returns an opaque object of this name, with each coordinate rounded to the nearest f32.
    pub(crate) fn named(self, name: String) -> SourceObject {
        // Allocates anew instead of reusing the mesh's memory, which is twice as large.
        let triangles =
            self.triangles.iter().map(|triangle| triangle.map(|p| p.as_vec3())).collect::<Vec<_>>();
        SourceObject::new(name, triangles)
    }
}

/// Returns the pairs (index, next index) of neighbours around a ring of `sides` points; the last index is
/// followed by 0.
pub(crate) fn around(sides: usize) -> impl Iterator<Item = (usize, usize)> {
    (0..sides).map(move |i| (i, (i + 1) % sides))
}

/// Returns `sides` points at equal angles on the unit circle, counter-clockwise from (1, 0).
pub(crate) fn circle(sides: usize) -> impl Iterator<Item = DVec2> {
    (0..sides).map(move |i| DVec2::from_angle(i as f64 * TAU / sides as f64))
}

/// Upright cylinder or cone frustum: a regular polygon of `sides` corners at the heights `bottom` and `top`
/// with a radius each. All lengths are metres.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Cylinder {
    pub(crate) centre: DVec2,
    pub(crate) bottom: f64,
    pub(crate) top: f64,
    pub(crate) bottom_radius: f64,
    pub(crate) top_radius: f64,
    pub(crate) sides: usize,
}

impl Cylinder {
    /// Returns the polygon at height `z` with circumradius `radius`, counter-clockwise as seen from above.
    fn ring(&self, z: f64, radius: f64) -> Vec<DVec3> {
        circle(self.sides).map(|unit| (self.centre + unit * radius).extend(z)).collect()
    }
}

/// Rigid motion: a rotation about the z axis followed by a translation by `at` metres.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Pose {
    /// Cosine and sine of the counter-clockwise angle of rotation.
    turn: DVec2,
    at: DVec3,
}

impl Pose {
    /// Creates a counter-clockwise rotation by `angle` radians followed by a translation by `at` metres.
    pub(crate) fn turned(angle: f64, at: DVec3) -> Self {
        Self { turn: DVec2::from_angle(angle), at }
    }

    /// Creates a counter-clockwise rotation by `quarters` right angles followed by a translation by `at`
    /// metres.
    pub(crate) fn quarters(quarters: u8, at: DVec3) -> Self {
        Self::turned(f64::from(quarters) * FRAC_PI_2, at)
    }

    /// Returns the point `p` rotated about the z axis and then translated.
    fn apply(&self, p: DVec3) -> DVec3 {
        self.turn.rotate(p.truncate()).extend(p.z) + self.at
    }
}

/// Receiver of a recipe's objects, in the order in which the recipe makes them. It passes each object on and
/// keeps none.
pub(crate) struct Parts<'a> {
    each: &'a mut dyn FnMut(String, Mesh),
    count: usize,
}

impl<'a> Parts<'a> {
    /// Creates a receiver that passes the name and the mesh of each object to `each`.
    pub(crate) fn new(each: &'a mut dyn FnMut(String, Mesh)) -> Self {
        Self { each, count: 0 }
    }

    /// Passes an object with this name and mesh on. Names need not be unique.
    pub(crate) fn add(&mut self, name: impl Into<String>, mesh: Mesh) {
        (self.each)(name.into(), mesh);
        self.count += 1;
    }

    /// Returns the number of objects that were passed on.
    pub(crate) fn count(&self) -> usize {
        self.count
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the signed volume of a closed mesh in cubic metres: positive when its triangles face outwards.
    fn volume(mesh: &Mesh) -> f64 {
        mesh.triangles.iter().map(|[a, b, c]| a.dot(b.cross(*c)) / 6.0).sum()
    }

    #[test]
    fn solids_are_closed_and_face_outwards() {
        let cuboid = Mesh::from_cuboid([1.0, 2.0, 3.0], [2.0, 4.0, 6.0]);
        assert_eq!(cuboid.triangles.len(), 12, "triangles of a cuboid");
        assert!((volume(&cuboid) - 6.0).abs() < 1e-12, "the cuboid's volume is {} m3", volume(&cuboid));

        let mut cone = Mesh::new();
        cone.cylinder(&Cylinder {
            centre: DVec2::new(3.0, -2.0),
            bottom: 1.0,
            top: 4.0,
            bottom_radius: 1.0,
            top_radius: 0.0,
            sides: 4,
        });
        assert_eq!(cone.triangles.len(), 8, "triangles of a cone of four sides");
        assert!((volume(&cone) - 2.0).abs() < 1e-12, "the cone's volume is {} m3", volume(&cone));
    }

    #[test]
    fn a_pose_turns_before_it_moves() {
        let pose = Pose::quarters(1, DVec3::new(10.0, 0.0, 1.0));
        let turned = pose.apply(DVec3::new(2.0, 0.0, 0.0));
        assert!(
            turned.distance(DVec3::new(10.0, 2.0, 1.0)) < 1e-12,
            "the turned and moved point is {turned}"
        );
    }
}
