//! Occluders that surround the eye (corners, courtyards, rooms, boxes), and an oracle in integer arithmetic
//! for the points that they hide.
//!
//! All coordinates are multiples of 1/64 m below 64 m, so that a determinant of three differences is exact in
//! `i64`. The oracle shares no code with projections, clipping and rasters.

use crate::Random;
use visibility_core::glam::{Affine3A, DVec3, Vec3};
use visibility_core::{
    Aabb, Culler, FrustumCuller, Object, ObjectId, OccluderMesh, Pipeline, Pose, Scene, View, VisibleSet,
    scene::Triangle,
};

/// Number of the oracle's integer units per metre.
const UNIT: f64 = 64.0;

/// Occluder with room for an eye inside its bounds.
pub struct Enclosure {
    /// Name for messages.
    pub name: &'static str,
    /// Triangles in metres relative to the scene's origin.
    pub triangles: Vec<Triangle>,
    /// Whether backs occlude.
    pub two_sided: bool,
    /// Region of possible eyes, in metres, boundary excluded. No triangle is in it.
    pub eyes: Aabb,
}

/// Numbers of objects, summed over all views of an enclosure.
#[derive(Clone, Copy, Default, PartialEq, Eq, Debug)]
pub struct Counts {
    /// Number of objects in view whose sampled points are all behind a triangle.
    pub blocked: usize,
    /// Number of `blocked` objects that the culler has kept.
    pub kept: usize,
    /// Number of `kept` objects more than 1 m outside the bounds of the enclosure.
    pub kept_far: usize,
    /// Number of objects in view with a visible sampled point.
    pub seen: usize,
}

/// Returns the rectangle with corners `a`, `b`, `c`, `d` as two triangles, counter-clockwise from the front.
fn quad([a, b, c, d]: [[f32; 3]; 4]) -> [Triangle; 2] {
    let [a, b, c, d] = [a, b, c, d].map(Vec3::from);
    [[a, b, c], [a, c, d]]
}

/// Returns an upright wall from `from` to `to` (x and y in metres) between two heights. Its front is on the
/// left when walking from `from` to `to`.
fn wall(from: [f32; 2], to: [f32; 2], low: f32, high: f32) -> [Triangle; 2] {
    let ([ax, ay], [bx, by]) = (from, to);
    quad([[bx, by, low], [ax, ay, low], [ax, ay, high], [bx, by, high]])
}

/// Returns a level rectangle at a height, whose front is seen from above (`up` true) or from below (false).
fn slab(min: [f32; 2], max: [f32; 2], z: f32, up: bool) -> [Triangle; 2] {
    let mut around = [[min[0], min[1], z], [max[0], min[1], z], [max[0], max[1], z], [min[0], max[1], z]];
    if !up {
        around.reverse();
    }
    quad(around)
}

/// Returns the walls along a path. Their fronts are on the left when walking along the path.
fn walls(path: &[[f32; 2]], low: f32, high: f32) -> Vec<Triangle> {
    path.windows(2).flat_map(|ends| wall(ends[0], ends[1], low, high)).collect()
}

/// Returns all enclosures. One-sided enclosures have their fronts towards the eyes.
pub fn enclosures() -> Vec<Enclosure> {
    let all = |name, triangles: Vec<Triangle>, two_sided, eyes: [[f32; 3]; 2]| Enclosure {
        name,
        triangles,
        two_sided,
        eyes: Aabb::from_arrays(eyes[0], eyes[1]),
    };
    let mut made = Vec::new();
    let around = |r: f32| [[-r, -r], [r, -r], [r, r], [-r, r], [-r, -r]];
    let l = walls(&[[2.0, -20.0], [2.0, 2.0], [-20.0, 2.0]], -20.0, 20.0);
    let u = walls(&[[-12.0, -8.0], [6.0, -8.0], [6.0, 8.0], [-12.0, 8.0]], -12.0, 12.0);
    for two_sided in [false, true] {
        made.push(all("L", l.clone(), two_sided, [[-18.0, -18.0, -18.0], [2.0, 2.0, 18.0]]));
        made.push(all("U", u.clone(), two_sided, [[-10.0, -8.0, -10.0], [6.0, 8.0, 10.0]]));
    }
    // A room with a doorway in its wall at y = 3. Its quadrilaterals share whole edges.
    let mut room = walls(&[[-4.0, 3.0], [-4.0, -3.0], [4.0, -3.0], [4.0, 3.0]], 0.0, 2.0);
    room.extend(walls(&[[-4.0, 3.0], [-4.0, -3.0], [4.0, -3.0], [4.0, 3.0], [1.0, 3.0]], 2.0, 3.0));
    room.extend(walls(&[[4.0, 3.0], [1.0, 3.0]], 0.0, 2.0));
    room.extend(walls(&[[0.0, 3.0], [-4.0, 3.0]], 0.0, 3.0));
    room.extend(wall([1.0, 3.0], [0.0, 3.0], 2.0, 3.0));
    room.extend(slab([-4.0, -3.0], [4.0, 3.0], 0.0, true));
    room.extend(slab([-4.0, -3.0], [4.0, 3.0], 3.0, false));
    made.push(all("room", room.clone(), false, [[-4.0, -3.0, 0.0], [4.0, 3.0, 3.0]]));
    made.push(all("room", room, true, [[-4.0, -3.0, 0.0], [4.0, 3.0, 3.0]]));
    // A closed block around a courtyard.
    let mut block = walls(&around(6.0), -8.0, 8.0);
    let outside: Vec<_> = around(9.0).into_iter().rev().collect();
    block.extend(walls(&outside, -8.0, 8.0));
    for (z, up) in [(-8.0, false), (8.0, true)] {
        for i in 0..4 {
            let ([a, b], [c, d]) =
                ([around(9.0)[i], around(9.0)[i + 1]], [around(6.0)[i + 1], around(6.0)[i]]);
            let mut ring = [a, b, c, d].map(|[x, y]| [x, y, z]);
            if !up {
                ring.reverse();
            }
            block.extend(quad(ring));
        }
    }
    made.push(all("courtyard", block, false, [[-6.0, -6.0, -7.0], [6.0, 6.0, 7.0]]));
    // A closed box.
    let corners = Aabb::from_arrays([-3.0, -2.0, -2.0], [5.0, 2.0, 1.0]).corners();
    let cube = OccluderMesh::CUBOID.map(|t| t.map(|i| corners[i as usize])).to_vec();
    made.push(all("box", cube, true, [[-3.0, -2.0, -2.0], [5.0, 2.0, 1.0]]));
    // A closed tent, which is convex but not a box.
    let p = |x: f32, y: f32, z: f32| Vec3::new(x, y, z);
    let t =
        [p(-4.0, -4.0, -1.0), p(4.0, -4.0, -1.0), p(4.0, 4.0, -1.0), p(-4.0, 4.0, -1.0), p(0.0, 0.0, 4.0)];
    let tent =
        [[0, 2, 1], [0, 3, 2], [0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]].map(|f| f.map(|i: usize| t[i]));
    made.push(all("tent", tent.to_vec(), true, [[-2.0, -2.0, -1.0], [2.0, 2.0, 1.0]]));
    made
}

/// Converts a point from metres to integer units of 1/64 m.
fn whole(p: DVec3) -> [i64; 3] {
    (p * UNIT).to_array().map(|x| x as i64)
}

/// Returns six times the volume of the tetrahedron of `eye` and three points: negative if the points run
/// counter-clockwise as seen from the eye.
fn volume(eye: [i64; 3], [a, b, c]: [[i64; 3]; 3]) -> i64 {
    let [a, b, c] = [a, b, c].map(|p| [p[0] - eye[0], p[1] - eye[1], p[2] - eye[2]]);
    (a[1] * b[2] - a[2] * b[1]) * c[0]
        + (a[2] * b[0] - a[0] * b[2]) * c[1]
        + (a[0] * b[1] - a[1] * b[0]) * c[2]
}

/// Tests whether a triangle hides `p` from `eye`: the segment meets the triangle, edges included, before it
/// reaches `p`.
fn hides([a, b, c]: [[i64; 3]; 3], two_sided: bool, eye: [i64; 3], p: [i64; 3]) -> bool {
    let facing = volume(eye, [a, b, c]);
    let sides = [volume(eye, [a, b, p]), volume(eye, [b, c, p]), volume(eye, [c, a, p])];
    let beyond = volume(p, [a, b, c]);
    match facing.signum() {
        -1 => beyond > 0 && sides.iter().all(|&side| side <= 0),
        1 => two_sided && beyond < 0 && sides.iter().all(|&side| side >= 0),
        _ => false,
    }
}

/// Returns a random multiple of 1/64 m between two bounds.
fn coordinate(random: &mut Random, low: f32, high: f32) -> f32 {
    random.between((low * UNIT as f32) as i32, (high * UNIT as f32) as i32) as f32 / UNIT as f32
}

impl Enclosure {
    /// Returns a scene with the enclosure as its only occluder and 400 small objects around it, and the ids
    /// of these objects. The mesh of the enclosure is in units of `unit` metres, with its axes exchanged if
    /// `turned`; its transform undoes both.
    fn scene(&self, random: &mut Random, unit: f32, turned: bool) -> (Scene, Vec<ObjectId>) {
        let mut scene = Scene::new();
        let into = |p: Vec3| if turned { Vec3::new(p.y, p.z, p.x) } else { p } / unit;
        let mesh: Vec<Triangle> = self.triangles.iter().map(|t| t.map(into)).collect();
        let mesh = OccluderMesh::from_triangles(&mesh).unwrap().with_two_sided(self.two_sided);
        let columns = if turned { [Vec3::Y, Vec3::Z, Vec3::X] } else { [Vec3::X, Vec3::Y, Vec3::Z] };
        let [x, y, z] = columns.map(|axis| axis * unit);
        let transform = Affine3A::from_cols(x.into(), y.into(), z.into(), Vec3::ZERO.into());
        let bounds = Aabb::from_points(self.triangles.iter().flatten().copied());
        let id = scene.insert(Object { occluder: true, ..Object::new(bounds) });
        let mesh = scene.add_mesh(mesh);
        scene.set_mesh(id, mesh, transform).unwrap();
        let mut objects = Vec::new();
        while objects.len() < 400 {
            // Half of the objects are close to the enclosure, the others at any distance.
            let reach =
                if objects.len() % 2 == 0 { bounds } else { Aabb::from_arrays([-40.0; 3], [40.0; 3]) };
            let min = Vec3::from_array(core::array::from_fn(|axis| {
                coordinate(random, reach.min[axis] - 2.0, reach.max[axis] + 1.0)
            }));
            let object = Aabb::new(min, min + coordinate(random, 0.125, 0.75));
            let meets = |t: &Triangle| {
                let t = Aabb::from_points(t.iter().copied());
                !(t.min.cmpgt(object.max + 0.125) | t.max.cmplt(object.min - 0.125)).any()
            };
            if !self.triangles.iter().any(meets) {
                objects.push(scene.insert(object));
            }
        }
        scene.rebuild();
        (scene, objects)
    }

    /// Returns a random eye inside the enclosure, on some axes as near as 1/32 m to the boundary of the
    /// region.
    fn eye(&self, random: &mut Random) -> DVec3 {
        let gap = 1.0 / 32.0;
        DVec3::from_array(core::array::from_fn(|axis| {
            let (low, high) = (self.eyes.min[axis] + gap, self.eyes.max[axis] - gap);
            let drawn = [low, high, coordinate(random, low, high), coordinate(random, low, high)];
            f64::from(random.pick(&drawn))
        }))
    }

    /// Culls from `views` random eyes inside the enclosure with the culler from `make`, and counts the kept
    /// objects. Panics if the culler hides an object with a visible sampled point.
    pub fn count(
        &self,
        seed: u64,
        views: usize,
        make: &dyn Fn(&Scene) -> Box<dyn Culler + Send + Sync>,
    ) -> Counts {
        let mut random = Random(seed);
        let mut counts = Counts::default();
        let around = Aabb::from_points(self.triangles.iter().flatten().copied());
        let triangles: Vec<_> = self.triangles.iter().map(|t| t.map(|p| whole(p.as_dvec3()))).collect();
        for (unit, turned) in [(1.0, false), (1.0 / 1024.0, true), (64.0, false)] {
            let (scene, objects) = self.scene(&mut random, unit, turned);
            let mut pipeline = Pipeline::new().with(FrustumCuller::new());
            pipeline.push(make(&scene));
            for _ in 0..views.div_ceil(3) {
                let eye = self.eye(&mut random);
                let pose = Pose::look_at(eye, eye + random.direction(), random.direction());
                let view = View::perspective(pose, random.range(0.5, 1.8), 1.5, 1.0 / 256.0, 200.0).unwrap();
                let (mut visible, mut in_view) = (VisibleSet::new(), VisibleSet::new());
                Pipeline::new().with(FrustumCuller::new()).cull(&scene, &view, &mut in_view);
                pipeline.cull(&scene, &view, &mut visible);
                let planes = view.planes(scene.origin());
                for &id in objects.iter().filter(|&&id| in_view.contains(&scene, id)) {
                    let bounds = scene.bounds(id).unwrap();
                    let within = || {
                        Vec3::from_array(core::array::from_fn(|axis| {
                            coordinate(&mut random, bounds.min[axis], bounds.max[axis])
                        }))
                    };
                    let mut points = bounds.corners().to_vec();
                    points.extend(core::iter::repeat_with(within).take(8));
                    let is_free = |p: DVec3| {
                        let hides = |t| hides(t, self.two_sided, whole(eye), whole(p));
                        !triangles.iter().any(|&t| hides(t))
                    };
                    let mut free = points.iter().map(|p| p.as_dvec3()).filter(|&p| is_free(p)).peekable();
                    let kept = visible.contains(&scene, id);
                    if free.peek().is_none() {
                        counts.blocked += 1;
                        counts.kept += usize::from(kept);
                        let apart = bounds.min.cmpgt(around.max + 1.0) | bounds.max.cmplt(around.min - 1.0);
                        counts.kept_far += usize::from(kept && apart.any());
                        continue;
                    }
                    let is_in = |p: &DVec3| {
                        planes.as_slice().iter().all(|side| side.plane.signed_distance(*p) > 1e-6)
                    };
                    if let Some(p) = free.find(is_in) {
                        counts.seen += 1;
                        assert!(kept, "{}: {p} of {bounds:?} is seen from {eye}, {view:?}", self.name);
                    }
                }
            }
        }
        counts
    }
}

/// Culls in the first `count` enclosures. Of the objects whose sampled points are all blocked, the culler may
/// keep at most the share `most`, and at most the share `most_far` may be kept more than 1 m outside the
/// enclosure. Panics otherwise.
pub fn assert_most_hidden(
    make: &dyn Fn(&Scene) -> Box<dyn Culler + Send + Sync>,
    count: usize,
    [most, most_far]: [f64; 2],
) {
    for (enclosure, seed) in enclosures().iter().zip(0..).take(count) {
        let counts = enclosure.count(seed, 90, make);
        println!("{}, two-sided {}: {counts:?}", enclosure.name, enclosure.two_sided);
        assert!(counts.blocked > 500, "{}: too few are blocked: {counts:?}", enclosure.name);
        let of_blocked = |share: f64| share * counts.blocked as f64;
        assert!(counts.kept as f64 <= of_blocked(most), "{}: too many are kept: {counts:?}", enclosure.name);
        let far = counts.kept_far as f64;
        assert!(far <= of_blocked(most_far), "{}: too many are kept far off: {counts:?}", enclosure.name);
    }
}
