//! Random worlds at the extremes of coordinates, cameras and counts, on which every culler is tried.

use super::maze::Maze;
use glam::{DMat4, DVec3, DVec4, Vec3};
use visibility_core::{Pose, View, view::Window};
use visibility_examples::source::SourceCells;
pub(crate) use visibility_examples::walkthrough::World;
use visibility_examples::{SceneSource, SourceObject};
use visibility_testing::Random;
use visibility_testing::cameras::{DEPTHS, projection};

/// World with a description of what is extreme about it, for messages.
pub(crate) struct Case {
    pub(crate) what: String,
    pub(crate) world: World,
}

/// Makes a random world. Objects are made around the origin with a size of about one, stretched to a random
/// scale, and spoiled.
pub(crate) fn random(rng: &mut Random) -> Case {
    let kind = rng.below(6);
    if kind == 5 { rooms(rng) } else { loose(rng, kind) }
}

/// Makes a world of objects without rooms. `kind` from 0 to 4 selects their shapes.
fn loose(rng: &mut Random, kind: usize) -> Case {
    let mut objects = Vec::new();
    let count = 1 + rng.below(40);
    for number in 0..count {
        let triangles = match kind {
            0 => soup(rng),
            1 => cuboid(rng.vector(4.0), rng.vector(1.5).abs()),
            2 => grid_cube(rng),
            3 => match rng.below(4) {
                0 => crooked_wall(rng),
                1 => ground(rng),
                _ => wall(rng),
            },
            _ => match rng.below(4) {
                0 => soup(rng),
                1 => cuboid(rng.vector(4.0), rng.vector(0.5).abs()),
                2 => grid_cube(rng),
                _ => wall(rng),
            },
        };
        objects.push(SourceObject::new(format!("object {number}"), triangles));
    }
    // Copies of other objects, whose triangles all coincide with the originals.
    for _ in 0..rng.below(4) {
        let copy = objects[rng.below(objects.len())].clone();
        objects.push(copy);
    }
    let mut what = format!("kind {kind}");
    if rng.one_in(4) {
        what += ", each object at its own scale";
        for object in &mut objects {
            let own = power(rng).powf(0.5);
            object.edit_triangles(|all| place(all.as_flattened_mut(), DVec3::splat(own), DVec3::ZERO));
        }
    }
    let (scale, far) = stretch(rng, &mut what);
    for object in &mut objects {
        object.edit_triangles(|all| place(all.as_flattened_mut(), scale, far));
    }
    spoil(rng, &mut objects, &mut what);
    let origin = origin(rng, &mut what);
    let views = (0..4).map(|_| view(rng, &objects, 6.0, scale, origin)).collect();
    Case { what, world: world(objects, None, origin, views) }
}

/// Makes a world of objects in rooms, with the rooms as cells and portals.
pub(crate) fn rooms(rng: &mut Random) -> Case {
    let mut maze = Maze::random(rng);
    let mut what = format!("{} rooms, {} holes", maze.rooms.len(), maze.holes.len());
    let (scale, far) = stretch(rng, &mut what);
    for object in &mut maze.objects {
        object.edit_triangles(|all| place(all.as_flattened_mut(), scale, far));
    }
    maze.rooms.iter_mut().for_each(|corners| place(corners, scale, far));
    maze.holes.iter_mut().for_each(|(corners, _)| place(corners, scale, far));
    spoil(rng, &mut maze.objects[maze.walls..], &mut what);
    let origin = origin(rng, &mut what);
    let views = (0..4).map(|_| view(rng, &maze.objects, 2.0, scale, origin)).collect();
    let cells = maze.cells(origin);
    Case { what, world: world(maze.objects, cells, origin, views) }
}

/// Draws the origin of the world in f64: zero, or up to 1e8 away in each coordinate, as on planets. Appends
/// it to the description `what`.
fn origin(rng: &mut Random, what: &mut String) -> DVec3 {
    let origin = if rng.one_in(3) { rng.vector(1e8) } else { DVec3::ZERO };
    *what += &format!(", origin {origin}");
    origin
}

/// Makes a world of objects relative to `origin`, world-space views, and optionally cells in world space.
pub(crate) fn world(
    objects: Vec<SourceObject>,
    cells: Option<SourceCells>,
    origin: DVec3,
    views: Vec<View>,
) -> World {
    let source = SceneSource { objects, cells, origin, ..SceneSource::new("extremes", Vec3::Z, 0.1) };
    World::with_views(source, views, Vec::new(), (64, 36))
}

/// Triangles of one object, relative to the world's origin.
pub(crate) type Triangles = Vec<[Vec3; 3]>;

/// Makes up to eight triangles around a random centre, some of them degenerate, slivers, coplanar with
/// others, or the reverse of others.
pub(crate) fn soup(rng: &mut Random) -> Triangles {
    let centre = rng.vector(4.0);
    let mut triangles = Triangles::new();
    for _ in 0..1 + rng.below(8) {
        let mut corner = || (centre + rng.vector(1.0)).as_vec3();
        let (a, b, c) = (corner(), corner(), corner());
        triangles.push(match rng.below(8) {
            // Triangles of no area: a point, an edge, three collinear points.
            0 => [a, a, a],
            1 => [a, b, b],
            2 => [a, b, a + (b - a) * 0.5],
            // A sliver.
            3 => [a, b, a + (b - a) * 0.5 + Vec3::splat(1e-6)],
            // Nearly coplanar with the first triangle.
            4 if !triangles.is_empty() => triangles[0].map(|p| p + Vec3::new(0.0, 0.0, 1e-6)),
            // The previous triangle with reversed winding.
            5 if !triangles.is_empty() => {
                let [a, b, c] = triangles[triangles.len() - 1];
                [a, c, b]
            }
            _ => [a, b, c],
        });
    }
    triangles
}

/// Makes the closed surface of an axis-aligned box with half extents `half`, degenerate where one is 0.
pub(crate) fn cuboid(centre: DVec3, half: DVec3) -> Triangles {
    let (low, high) = ((centre - half).as_vec3(), (centre + half).as_vec3());
    let corner = |i: usize| {
        Vec3::new(
            if i & 1 == 0 { low.x } else { high.x },
            if i & 2 == 0 { low.y } else { high.y },
            if i & 4 == 0 { low.z } else { high.z },
        )
    };
    let faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let two = |[a, b, c, d]: [usize; 4]| [[a, b, c], [a, c, d]];
    faces.into_iter().flat_map(two).map(|t| t.map(corner)).collect()
}

/// Makes a unit cube of an integer grid, whose faces, edges and corners coincide with those of neighbours.
fn grid_cube(rng: &mut Random) -> Triangles {
    let mut at = || f64::from(rng.between(-3, 3));
    let centre = DVec3::new(at(), at(), at());
    cuboid(centre, DVec3::splat(0.5))
}

/// Makes a large thin wall in an axis-aligned plane; half of the walls have no thickness.
fn wall(rng: &mut Random) -> Triangles {
    let mut half = DVec3::splat(rng.range(1.0, 6.0));
    half[rng.below(3)] = if rng.one_in(2) { 0.0 } else { 1e-3 };
    cuboid(rng.vector(4.0).round(), half)
}

/// Makes an upright wall along a polyline, of one height or of several. Its surface is not convex.
fn crooked_wall(rng: &mut Random) -> Triangles {
    let mut corner = rng.vector(4.0);
    let mut triangles = Vec::new();
    let mut top = rng.range(0.0, 3.0);
    for _ in 0..1 + rng.below(5) {
        let next = (corner + rng.vector(3.0)).with_z(corner.z);
        if rng.one_in(3) {
            top = rng.range(0.0, 3.0);
        }
        let up = DVec3::Z * top;
        triangles.push([corner, next, next + up].map(DVec3::as_vec3));
        triangles.push([corner, next + up, corner + up].map(DVec3::as_vec3));
        corner = next;
    }
    triangles
}

/// Makes hilly ground of squares, some of which are missing.
fn ground(rng: &mut Random) -> Triangles {
    let (corner, side, count) = (rng.vector(4.0), rng.range(0.2, 2.0), 2 + rng.below(5));
    let steep = rng.range(0.0, 2.0);
    let points: Vec<Vec3> = (0..(count + 1).pow(2))
        .map(|i| {
            let at = DVec3::new((i % (count + 1)) as f64, (i / (count + 1)) as f64, rng.range(0.0, steep));
            (corner + at * side).as_vec3()
        })
        .collect();
    let mut triangles = Vec::new();
    for i in 0..count * count {
        let first = i / count * (count + 1) + i % count;
        let [a, b, c, d] = [first, first + 1, first + count + 2, first + count + 1].map(|i| points[i]);
        if !rng.one_in(30) {
            triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    triangles
}

/// Draws a power of ten from 1e-30 to 1e30.
fn power(rng: &mut Random) -> f64 {
    10f64.powi(rng.between(-30, 30))
}

/// Draws a scale for each axis, and an offset in unscaled coordinates that is added before scaling. Eyes are
/// placed by the same scale. Appends both to the description `what`.
fn stretch(rng: &mut Random, what: &mut String) -> (DVec3, DVec3) {
    let scale = match rng.below(4) {
        0 => DVec3::ONE,
        1 => DVec3::splat(power(rng)),
        // Scales that differ between axes, by factors that keep most volumes within the range of f32.
        2 => DVec3::new(power(rng), power(rng), power(rng)).powf(0.3),
        _ => DVec3::splat(power(rng).powf(0.3)),
    };
    // Far from the origin, coordinates are coarse.
    let far = if rng.one_in(4) { rng.vector(1e4) } else { DVec3::ZERO };
    *what += &format!(", scale {:e} {:e} {:e}, moved by {far}", scale.x, scale.y, scale.z);
    (scale, far)
}

/// Replaces each point by (point + `offset`) * `scale`, per axis, rounded to f32.
fn place(points: &mut [Vec3], scale: DVec3, offset: DVec3) {
    for point in points {
        *point = ((point.as_dvec3() + offset) * scale).as_vec3();
    }
}

/// In a third of the worlds, overwrites a few coordinates by NaN, infinities, zeros, denormals and huge
/// numbers.
fn spoil(rng: &mut Random, objects: &mut [SourceObject], what: &mut String) {
    if !rng.one_in(3) {
        return;
    }
    *what += ", spoiled";
    let bad = [
        f32::NAN,
        f32::INFINITY,
        f32::NEG_INFINITY,
        -0.0,
        0.0,
        1e-42,
        -1e-45,
        f32::MAX,
        f32::MIN,
        1e30,
        1e-30,
    ];
    for _ in 0..1 + rng.below(6) {
        let object = rng.below(objects.len());
        objects[object].edit_triangles(|triangles| {
            let triangle = rng.below(triangles.len());
            triangles[triangle][rng.below(3)][rng.below(3)] = rng.pick(&bad);
        });
    }
}

/// Makes a view from a random eye, often on a vertex, an edge or a plane of an object, or inside one. `reach`
/// is the greatest distance of other eyes from objects, in units of `scale`.
fn view(rng: &mut Random, objects: &[SourceObject], reach: f64, scale: DVec3, origin: DVec3) -> View {
    let mut corners = || {
        let object = &objects[rng.below(objects.len())];
        object.triangles.view().get(rng.below(object.triangles.len())).unwrap().map(|p| p.as_dvec3())
    };
    let (near_one, other) = (corners(), corners());
    let [a, b, c] = near_one;
    let eye = match rng.below(6) {
        0 => a,
        1 => (a + b) / 2.0,
        2 => a + (b - a) * 1.7 + (c - a) * 0.3,
        3 => (a + b + c) / 3.0 + rng.vector(0.5) * scale,
        _ => a + rng.vector(reach) * scale,
    };
    let eye = if eye.is_finite() { eye } else { DVec3::ZERO };
    let towards = if rng.one_in(3) { eye + rng.vector(1.0) * scale } else { other[0] };
    let up = if rng.one_in(4) { rng.vector(1.0) } else { DVec3::Z };
    let pose = Pose::look_at(eye + origin, towards + origin, up);
    let size = scale.max_element();
    let near = size * 10f64.powi(rng.between(-6, 0));
    let far = if rng.one_in(2) { f64::INFINITY } else { near * 10f64.powi(rng.between(1, 9)) };
    let degrees: f64 = rng.pick(&[0.001, 1.0, 30.0, 60.0, 90.0, 120.0, 179.9]);
    let made = match rng.below(4) {
        0 => View::orthographic(
            pose,
            Window { left: -size, right: size, bottom: -size, top: size },
            0.0,
            size * 20.0,
        ),
        1 => by_matrix(rng, &pose, size),
        _ => View::perspective(pose, degrees.to_radians(), rng.pick(&[0.1, 1.0, 1.78]), near, far),
    };
    // Invalid cameras are tested elsewhere, so an ordinary camera replaces one.
    made.unwrap_or_else(|_| {
        View::perspective(Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z), 1.0, 1.0, 0.1, 100.0)
            .expect("an ordinary camera")
    })
}

/// Makes a view of a camera at `pose` from a clip matrix with a random depth convention, with its near plane
/// at `size` / 100. Returns an error when the matrix is no valid view.
fn by_matrix(rng: &mut Random, pose: &Pose, size: f64) -> Result<View, visibility_core::view::ViewError> {
    let depth = rng.pick(&DEPTHS);
    let rotation = DMat4::from_cols(
        DVec4::new(pose.right.x, pose.up.x, pose.forward.x, 0.0),
        DVec4::new(pose.right.y, pose.up.y, pose.forward.y, 0.0),
        DVec4::new(pose.right.z, pose.up.z, pose.forward.z, 0.0),
        DVec4::W,
    );
    let lens = projection(depth, [-1.0, 1.0, -0.6, 0.6], 1.0, 1e4, false);
    let matrix = lens * DMat4::from_scale(DVec3::splat(100.0 / size)) * rotation;
    // The matrix is relative to the eye, so that no precision is lost far from the origin.
    View::from_clip_from_world(matrix.to_cols_array(), depth)?.relative_to(pose.eye)
}

/// Makes a world of `count` objects that are all one point.
pub(crate) fn crowd(count: usize) -> Case {
    let point = |_: usize| SourceObject::new("point", vec![[Vec3::X * 5.0; 3]]);
    case(format!("{count} in one point"), (0..count).map(point).collect())
}

/// Makes a case of a world with these objects and two equal ordinary views from the origin.
fn case(what: String, objects: Vec<SourceObject>) -> Case {
    Case { what, world: world(objects, None, DVec3::ZERO, straight_ahead()) }
}

/// Returns two equal ordinary views along x from the origin.
fn straight_ahead() -> Vec<View> {
    let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
    vec![View::perspective(pose, 1.0, 1.0, 0.1, f64::INFINITY).expect("an ordinary camera"); 2]
}

/// Makes worlds with no object, one object, objects without triangles, and very many coinciding objects.
pub(crate) fn degenerate_counts() -> Vec<Case> {
    let one = SourceObject::new("one", cuboid(DVec3::new(5.0, 0.0, 0.0), DVec3::ONE));
    let empty = SourceObject::new("without triangles", Vec::new());
    vec![
        case("nothing".into(), Vec::new()),
        case("one object".into(), vec![one.clone()]),
        case("an object without triangles".into(), vec![empty.clone(), one.clone(), empty]),
        case("one many times".into(), vec![one; 500]),
        crowd(20_000),
        random(&mut Random(7)),
    ]
}
