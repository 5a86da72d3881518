//! Joining coplanar triangles into convex polygons.

use super::*;
use std::format;
use visibility_core::glam::Affine3A;
use visibility_core::{Object, OccluderMesh};
use visibility_testing::Random;

fn prepared(triangles: impl IntoIterator<Item = [Vec3; 3]>) -> SceneTriangles {
    let triangles: Vec<[Vec3; 3]> = triangles.into_iter().collect();
    prepared_in(Aabb::from_points(triangles.as_flattened().iter().copied()), triangles)
}

fn prepared_in(bounds: Aabb, triangles: Vec<[Vec3; 3]>) -> SceneTriangles {
    let mut scene = Scene::new();
    let id = scene.insert(Object { occluder: true, ..Object::new(bounds) });
    scene.set_triangles(id, triangles).unwrap();
    SceneTriangles::new(&scene)
}

/// Two slivers that share their longest side are joined if both are exactly in the plane x = y + z. They are
/// not joined if the second is off this plane, even if it is in the inexact plane that `f64` computes for the
/// first.
#[test]
fn slivers_in_one_plane_are_one_piece() {
    let mut random = Random(7);
    let (mut merged, mut off) = (0, 0);
    for round in 0..500 {
        // Multiples of 2^-52 near the origin, and of 2^-20 elsewhere, so that sums are exact in `f32`.
        let mut int = |r: i32, unit: i32| f64::from(random.between(-r, r)) * 2f64.powi(unit);
        let (near, half) = ([int(1 << 22, -52), int(1 << 22, -52)], [int(1 << 21, -20), int(1 << 21, -20)]);
        let across = [int(4, -20), int(4, -20)];
        if half[0] * across[1] == half[1] * across[0] {
            continue;
        }
        let beside = |s: f64| [0, 1].map(|k| half[k] + s * across[k]);
        let corners = [near, half.map(|x| 2.0 * x), beside(1.0), beside(-1.0)];
        let [a, b, c, d] = corners.map(|[y, z]| DVec3::new(y + z, y, z));
        let single = |t: [DVec3; 3]| t.map(DVec3::as_vec3);
        let all = single([a, b, c]).into_iter().chain([d.as_vec3()]);
        assert!(all.zip([a, b, c, d]).all(|(x, y)| x.as_dvec3() == y), "{round}");
        merged += usize::from(prepared([single([a, b, c]), single([b, a, d])]).pieces.len() == 1);
        // A point near a, on the other side of the edge a-b than c.
        let inexact = (c - b).cross(a - b).normalize();
        let mut e = (a - DVec3::new(across[0] + across[1], across[0], across[1]) * 1e-3).as_vec3();
        e.x = (b.x - ((e.y as f64 - b.y) * inexact.y + (e.z as f64 - b.z) * inexact.z) / inexact.x) as f32;
        let height = (f64::from(e.x) - f64::from(e.y) - f64::from(e.z)) / 3f64.sqrt();
        let apart = prepared([single([b, c, a]), [a.as_vec3(), e, b.as_vec3()]]);
        if height.abs() > 4.0 * apart.position_error(0.0) {
            off += 1;
            assert_eq!(apart.pieces.len(), 2, "{round}: {height} m off the plane");
        }
    }
    assert!(merged > 450 && off > 250, "{merged} {off}");
}

/// Joined polygons are convex: all corners are on the inner side of each edge, or on the edge. The triangles
/// all lie in one plane. Most share an edge with the triangle before them; some are slivers, and some are
/// folded back over that triangle.
#[test]
fn pieces_are_convex() {
    let mut random = Random(9);
    let mut joined = 0;
    for _ in 0..2000 {
        let mut all: Vec<[Vec3; 3]> = Vec::new();
        for _ in 0..8 {
            let mut point = || Vec3::new(random.between(-3, 3) as f32, random.between(-3, 3) as f32, 1.0);
            let (a, b, c) = (point(), point(), point());
            let side = all.last().map(|t| [t[random.below(3)], t[random.below(3)]]);
            // Two neighbours have their common side in opposite directions, also if one is folded back over
            // the other.
            let t = side.map_or([a, b, c], |[x, y]| if x == y { [a, b, c] } else { [y, x, c] });
            all.push(t);
        }
        let scene = prepared(all);
        for piece in scene.pieces.iter().filter(|piece| piece.triangles.len() > 1) {
            joined += usize::from(piece.triangles.len() > 2);
            let n = piece.positions.len();
            for (k, &x) in piece.positions.iter().enumerate() {
                let along = piece.positions[(k + 1) % n] - x;
                let normal = unit_normal(&scene.corners(piece.triangles[0])).unwrap();
                let least =
                    piece.positions.iter().map(|y| along.cross(*y - x).dot(normal)).fold(f64::MAX, f64::min);
                assert!(least >= -1e-9, "{:?}", piece.positions);
            }
        }
    }
    assert!(joined > 10, "{joined}");
}

/// Triangles of an object: a strip of a few squares in a plane x = const or y = const, at whole metres, so
/// that objects share vertices and edges.
fn strip(random: &mut Random) -> Vec<[Vec3; 3]> {
    let (along, across) = if random.one_in(2) { (Vec3::Y, Vec3::Z) } else { (Vec3::X, Vec3::Z) };
    let from = Vec3::from_array(core::array::from_fn(|_| random.between(0, 4) as f32));
    let squares = (0..1 + random.below(3)).flat_map(|k| {
        let a = from + along * k as f32;
        let [b, c, d] = [a + along, a + along + across, a + across];
        [[a, b, c], [a, c, d]]
    });
    squares.collect()
}

/// Gives an object other triangles, and bounds around them.
fn reshape(scene: &mut Scene, id: ObjectId, triangles: Vec<[Vec3; 3]>) {
    scene.set_bounds(id, Aabb::from_points(triangles.as_flattened().iter().copied())).unwrap();
    scene.set_triangles(id, triangles).unwrap();
}

/// Returns each triangle that objects have now, as its object and its position in the object, with its index.
fn present(all: &SceneTriangles) -> std::collections::BTreeMap<(usize, u32), u32> {
    let objects = all.objects.iter().filter(|object| !object.is_removed);
    objects.flat_map(|o| (o.first..o.end).map(|t| ((o.id.index(), t - o.first), t))).collect()
}

/// Triangles that follow the changes of a scene are, but for their indices, those of the present scene.
#[test]
fn synchronised_triangles_are_those_of_the_scene() {
    let mut random = Random(21);
    let mut greatest = (0, 0, 0, 0);
    for round in 0..6 {
        let mut scene = Scene::new();
        let insert = |scene: &mut Scene, random: &mut Random| {
            let triangles = strip(random);
            let bounds = Aabb::from_points(triangles.as_flattened().iter().copied());
            let object =
                Object { occluder: !random.one_in(5), one_sided: random.one_in(5), ..Object::new(bounds) };
            let id = scene.insert(object);
            scene.set_triangles(id, triangles).unwrap();
        };
        (0..40).for_each(|_| insert(&mut scene, &mut random));
        let mut all = SceneTriangles::new(&scene);
        for step in 0..200 {
            let ids: Vec<ObjectId> = scene.ids().collect();
            let id = random.pick(&ids);
            match random.below(6) {
                0 | 1 if ids.len() > 20 => scene.remove(id).unwrap(),
                2 => reshape(&mut scene, id, strip(&mut random)),
                3 => scene.set_occluder(id, !scene.object(id).unwrap().occluder).unwrap(),
                4 => scene.set_one_sided(id, !scene.object(id).unwrap().one_sided).unwrap(),
                _ if ids.len() < 60 => insert(&mut scene, &mut random),
                _ => {}
            }
            if random.one_in(3) {
                continue;
            }
            all.sync(&scene);
            let what = format!("round {round}, step {step}");
            let fresh = SceneTriangles::new(&scene);
            assert!(all.is_current(&scene) && all.len() == fresh.len(), "{what}: {} triangles", all.len());
            assert_eq!(all.occluder_count(), fresh.occluder_count(), "{what}: occluding triangles");
            let pair = (present(&all), present(&fresh));
            assert!(pair.0.keys().eq(pair.1.keys()), "{what}: the same triangles");
            let named = |of: &SceneTriangles, list: &[u32]| {
                let key = |&t: &u32| {
                    (of.objects[of.object_of(t)].id.index(), t - of.objects[of.object_of(t)].first)
                };
                let mut keys: Vec<(usize, u32)> = list.iter().map(key).collect();
                keys.sort_unstable();
                keys
            };
            let mut numbers = std::collections::BTreeMap::new();
            for (&t, &f) in pair.0.values().zip(pair.1.values()) {
                assert_eq!(all.corners(t), fresh.corners(f), "{what}: corners of {t}");
                assert_eq!(
                    (all.front(t), all.area(t)),
                    (fresh.front(f), fresh.area(f)),
                    "{what}: front of {t}"
                );
                assert_eq!(all.occludes(t), fresh.occludes(f), "{what}: whether {t} occludes");
                for k in 0..3 {
                    let [at, at_fresh] = [
                        named(&all, all.triangles_at(all.edges(t)[k])),
                        named(&fresh, fresh.triangles_at(fresh.edges(f)[k])),
                    ];
                    assert_eq!(at, at_fresh, "{what}: triangles at edge {k} of {t}");
                    let known = numbers.entry(fresh.vertices(f)[k]).or_insert(all.vertices(t)[k]);
                    assert_eq!(*known, all.vertices(t)[k], "{what}: vertex {k} of {t}");
                    assert!((all.edges(t)[k] as usize) < all.edge_count(), "{what}: edge {k} of {t}");
                }
                if all.occludes(t) {
                    let piece = all.piece(all.piece_of(t));
                    let one = |&u: &u32| all.occludes(u) && all.piece_of(u) == all.piece_of(t);
                    assert!(
                        piece.triangles.contains(&t) && piece.triangles.iter().all(one),
                        "{what}: piece of {t}"
                    );
                } else {
                    assert_eq!(all.piece_of(t), u32::MAX, "{what}: piece of {t}");
                }
            }
            let distinct: std::collections::BTreeSet<u32> = numbers.values().copied().collect();
            assert_eq!(distinct.len(), numbers.len(), "{what}: different vertices have different numbers");
            for _ in 0..20 {
                let mut point = || DVec3::from_array(core::array::from_fn(|_| random.fine_range(-1.0, 8.0)));
                let (p, q) = (point(), point());
                let (mut hits, mut hits_fresh) = (vec![], vec![]);
                let unsure = all.tree.crossed(p, q, u32::MAX, 1000, &mut hits);
                assert_eq!(
                    unsure,
                    fresh.tree.crossed(p, q, u32::MAX, 1000, &mut hits_fresh),
                    "{what}: {p} {q}"
                );
                assert_eq!(named(&all, &hits), named(&fresh, &hits_fresh), "{what}: crossed from {p} to {q}");
                let [near, near_fresh] = [&all, &fresh].map(|of| of.tree.nearest(p, q - p).map(|hit| hit.0));
                assert_eq!(near, near_fresh, "{what}: nearest from {p} towards {q}");
            }
            let sizes = (all.index_limit(), all.edge_count(), all.pieces.len(), all.objects.len());
            greatest = (
                greatest.0.max(sizes.0),
                greatest.1.max(sizes.1),
                greatest.2.max(sizes.2),
                greatest.3.max(sizes.3),
            );
        }
    }
    // 60 objects of at most 6 triangles each. Room that is outgrown, for 2 and then 4 triangles, stays
    // unused.
    let (triangles, edges, pieces, objects) = greatest;
    assert!(triangles <= 60 * 14 && edges <= 60 * 30 && pieces <= 60 * 6 && objects <= 61, "{greatest:?}");
}

/// Many moved objects are taken into the first tree, and a mover's memory is used again.
#[test]
fn many_changes_build_the_first_tree_anew() {
    let mut random = Random(5);
    let mut scene = Scene::new();
    let mut ids = Vec::new();
    for _ in 0..400 {
        let triangles = strip(&mut random);
        let bounds = Aabb::from_points(triangles.as_flattened().iter().copied());
        let id = scene.insert(Object { occluder: true, ..Object::new(bounds) });
        scene.set_triangles(id, triangles).unwrap();
        ids.push(id);
    }
    let mut all = SceneTriangles::new(&scene);
    let (mut rebuilt, mut limits) = (0, Vec::new());
    for step in 0..1200 {
        let id = ids[step % ids.len()];
        let shift = Vec3::from_array(core::array::from_fn(|_| random.range(-1.0, 1.0) as f32));
        let moved: Vec<_> = scene.triangles(id).unwrap().iter().map(|t| t.map(|v| v + shift)).collect();
        reshape(&mut scene, id, moved);
        all.sync(&scene);
        rebuilt += usize::from(all.welding.as_ref().is_some_and(|welding| welding.is_merged()));
        limits.push((all.index_limit(), all.edge_count(), all.pieces.len()));
    }
    assert!((1..100).contains(&rebuilt), "{rebuilt} times the tree was built anew");
    assert_eq!(limits[0].0, limits[1199].0, "indices of triangles are used again");
    let [before, after] = [limits[799], limits[1199]];
    assert!(after.1 <= before.1 + before.1 / 8 && after.2 <= before.2 + 50, "{before:?} {after:?}");
    let fresh = SceneTriangles::new(&scene);
    let mut hits = vec![];
    for round in 0..500 {
        let mut point = || DVec3::from_array(core::array::from_fn(|_| random.fine_range(-3.0, 10.0)));
        let (p, q) = (point(), point());
        let counts = [&all, &fresh].map(|of| {
            let unsure = of.tree.crossed(p, q, u32::MAX, 1000, &mut hits);
            (unsure, hits.len())
        });
        assert_eq!(counts[0], counts[1], "{round}: triangles crossed from {p} to {q}");
    }
}

/// The room of an object that grows by a triangle at a time is in proportion to its size.
#[test]
fn growing_objects_take_room_in_proportion() {
    let triangle = |k: u32| [Vec3::X, Vec3::Y, Vec3::ZERO].map(|v| v + Vec3::Z * k as f32);
    let mut scene = Scene::new();
    let bounds = Aabb::new(Vec3::ZERO, Vec3::new(1.0, 1.0, 300.0));
    let id = scene.insert(Object { occluder: true, ..Object::new(bounds) });
    let mut all = SceneTriangles::new(&scene);
    for count in 1..300 {
        scene.set_triangles(id, (0..count).map(triangle).collect::<Vec<_>>()).unwrap();
        assert!(all.sync(&scene), "{count} triangles: a change");
        assert_eq!((all.len(), all.occluder_count()), (count as usize, count as usize), "{count} triangles");
        assert!(all.index_limit() <= 4 * count as usize, "{count} triangles: {} indices", all.index_limit());
    }
}

/// Triangles at one edge, of one object or of an object each, that all move: the steps for twice as many are
/// about twice as many.
#[test]
fn steps_grow_as_the_triangles_at_an_edge_do() {
    let page = |k: usize, y: f32| [Vec3::ZERO, Vec3::Z, Vec3::new(1.0 + k as f32, y, 0.0)];
    for of_one_object in [true, false] {
        let steps = [100, 200, 400].map(|count| {
            let mut scene = Scene::new();
            let mut groups: Vec<Vec<usize>> = (0..count).map(|k| vec![k]).collect();
            if of_one_object {
                groups = vec![groups.concat()];
            }
            let triangles = |group: &[usize], y| group.iter().map(|&k| page(k, y)).collect::<Vec<_>>();
            let ids: Vec<ObjectId> = groups
                .iter()
                .map(|group| {
                    let triangles = triangles(group, 1.0);
                    let bounds = Aabb::from_points(triangles.as_flattened().iter().copied());
                    let id = scene.insert(Object { occluder: true, ..Object::new(bounds) });
                    scene.set_triangles(id, triangles).unwrap();
                    id
                })
                .collect();
            let mut all = SceneTriangles::new(&scene);
            let mut steps = 0;
            for y in [2.0, 3.0] {
                for (group, &id) in groups.iter().zip(&ids) {
                    reshape(&mut scene, id, triangles(group, y));
                }
                steps = visibility_testing::steps_of(|| assert!(all.sync(&scene), "{count} triangles move"));
                let shared = all.edges(all.objects[0].first)[0];
                assert_eq!(all.triangles_at(shared).len(), count, "triangles at the edge that all share");
            }
            steps as f64
        });
        std::println!("steps, triangles of one object {of_one_object}: {steps:?}");
        assert!(
            steps[1] < 2.6 * steps[0] && steps[2] < 2.6 * steps[1],
            "of one object: {of_one_object}, {steps:?}"
        );
    }
}

/// The box of an object without triangles holds its occluder mesh, which may reach out of the given bounds by
/// rounding.
#[test]
fn boxes_of_targets_hold_their_occluder_meshes() {
    let mut scene = Scene::new();
    let given = Aabb::from_arrays([0.0; 3], [1.0; 3]);
    let id = scene.insert(Object { occluder: true, ..Object::new(given) });
    let mut all = SceneTriangles::new(&scene);
    let reach = Aabb::from_arrays([0.0; 3], [1.0, 1.000_001, 1.0]);
    let mesh = scene.add_mesh(OccluderMesh::cuboid(&reach).unwrap());
    scene.set_mesh(id, mesh, Affine3A::IDENTITY).unwrap();
    assert_eq!(scene.bounds(id).unwrap().max, reach.max, "the bounds are enlarged");
    all.sync(&scene);
    for (all, when) in [(all, "later"), (SceneTriangles::new(&scene), "from the start")] {
        assert_eq!(all.objects[0].max, reach.max.as_dvec3(), "a mesh that was there {when}");
    }
}

/// A coordinate of a corner, or of the bounds of an object without triangles, that is NaN, infinite or beyond
/// the limit leaves the object open. One at the limit does not. Bounds count without triangles alone.
#[test]
fn objects_with_coordinates_beyond_the_limit_are_open() {
    let limit = LIMIT as f32;
    let least = limit.next_up();
    for value in [0.0, limit, -limit, least, -least, f32::INFINITY, f32::NEG_INFINITY, f32::NAN] {
        let expected = value.abs() > limit || value.is_nan();
        for at in 0..9 {
            let mut corners = [Vec3::ZERO, Vec3::X, Vec3::Y];
            corners[at / 3][at % 3] = value;
            // Bounds that hold the corners, and are finite unless a corner is infinite.
            let most = f32::MAX * if value.is_infinite() { f32::INFINITY } else { 1.0 };
            let all = prepared_in(Aabb::from_arrays([-most; 3], [most; 3]), vec![corners]);
            assert_eq!(all.objects[0].is_open, expected, "coordinate {at} of the triangle: {value}");
            assert_eq!(all.len(), usize::from(!expected), "coordinate {at}, {value}: triangles");
        }
        for axis in 0..3 {
            let mut bounds = Aabb::from_arrays([0.0; 3], [0.0; 3]);
            (if value < 0.0 { &mut bounds.min } else { &mut bounds.max })[axis] = value;
            assert_eq!(prepared_in(bounds, vec![]).objects[0].is_open, expected, "bounds {bounds:?}");
        }
    }
    let large = Aabb::from_arrays([0.0; 3], [least; 3]);
    assert!(
        !prepared_in(large, vec![[Vec3::ZERO, Vec3::X, Vec3::Y]]).objects[0].is_open,
        "its triangle is small"
    );
    let inverted = Aabb::from_arrays([1.0; 3], [0.0; 3]);
    assert!(prepared_in(inverted, vec![]).objects[0].is_open, "inverted bounds");
}

/// A triangle occludes if its object is an occluder on some layer and it has an area. Objects that occlude
/// are counted on their layers.
#[test]
fn triangles_with_area_of_occluders_on_layers_occlude() {
    for case in 0..8 {
        let [occluder, has_layers, has_area] = [1, 2, 4].map(|bit| case & bit != 0);
        let triangle = [Vec3::ZERO, Vec3::X, if has_area { Vec3::Y } else { Vec3::X * 2.0 }];
        let mut scene = Scene::new();
        let layers = if has_layers { 6 } else { 0 };
        let id = scene.insert(Object { occluder, layers, ..Object::new(Aabb::from_points(triangle)) });
        scene.set_triangles(id, [triangle]).unwrap();
        let all = SceneTriangles::new(&scene);
        let expected = occluder && has_layers && has_area;
        let what = format!("occluder {occluder}, layers {has_layers}, area {has_area}");
        assert_eq!((all.len(), all.occluder_count()), (1, usize::from(expected)), "{what}");
        assert_eq!(all.layers.get(&6).copied(), expected.then_some(1), "{what}: objects on the layers");
    }
}

/// One-sided triangles show to viewpoints in front of them alone, not to those in their plane.
#[test]
fn one_sided_triangles_show_to_their_fronts() {
    let triangle = [Vec3::ZERO, Vec3::X, Vec3::Y];
    for one_sided in [false, true] {
        let mut scene = Scene::new();
        let id = scene.insert(Object { one_sided, ..Object::new(Aabb::from_points(triangle)) });
        scene.set_triangles(id, [triangle]).unwrap();
        let all = SceneTriangles::new(&scene);
        for (z, is_before) in [(1.0, true), (1e-3, true), (0.0, false), (-1e-3, false), (-1.0, false)] {
            let shows = all.shows(0, DVec3::new(3.0, 2.0, z));
            assert_eq!(shows, is_before || !one_sided, "one-sided {one_sided}, from a height of {z}");
        }
    }
}

/// The box of a target is that of its triangles, and the greatest coordinate of all counts for the error of
/// positions, as does a greater one that is given.
#[test]
fn boxes_and_errors_are_those_of_all_corners() {
    let mut random = Random(6);
    for round in 0..200 {
        let triangles: Vec<[Vec3; 3]> = (0..3).map(|_| [(); 3].map(|()| random.vec3(-9.0, 9.0))).collect();
        let all = prepared(triangles.clone());
        let corners = triangles.as_flattened();
        let around = Aabb::from_points(corners.iter().copied());
        let found = [all.objects[0].min, all.objects[0].max];
        assert_eq!(found, [around.min.as_dvec3(), around.max.as_dvec3()], "{round}: box");
        let most = corners.iter().map(|p| p.abs().max_element()).fold(0.0, f32::max);
        for (given, greatest) in [(0.0, f64::from(most)), (100.0, 100.0)] {
            let error = all.position_error(given);
            assert_eq!(error, greatest * 2f64.powi(-46), "{round}: error of positions with {given}");
        }
    }
}

/// Edges have one number exactly where they join the same vertices, and vertices where they are in one place.
#[test]
fn edges_are_pairs_of_vertices() {
    let mut random = Random(8);
    for round in 0..50 {
        let mut point = || Vec3::from_array([(); 3].map(|()| random.between(0, 1) as f32));
        let all = prepared((0..12).map(|_| [point(), point(), point()]).collect::<Vec<_>>());
        let sides: Vec<(u32, usize)> = (0..12).flat_map(|t| [0, 1, 2].map(|k| (t, k))).collect();
        let at = |(t, k): (u32, usize)| all.corners(t)[k % 3];
        for &(t, k) in &sides {
            for &(u, m) in &sides {
                let is_one = all.vertices(t)[k] == all.vertices(u)[m];
                assert_eq!(is_one, at((t, k)) == at((u, m)), "{round}: corners {k} of {t} and {m} of {u}");
                let ends = [at((t, k)), at((t, k + 1))];
                let others = [at((u, m)), at((u, m + 1))];
                let is_same = ends == others || ends == [others[1], others[0]];
                assert_eq!(all.edges(t)[k] == all.edges(u)[m], is_same, "{round}: {ends:?} and {others:?}");
            }
            let occluding: Vec<u32> =
                (0..12).filter(|&u| all.occludes(u) && all.edges(u).contains(&all.edges(t)[k])).collect();
            let mut listed = all.triangles_at(all.edges(t)[k]).to_vec();
            listed.sort_unstable();
            listed.dedup();
            assert_eq!(listed, occluding, "{round}: triangles at edge {k} of {t}");
        }
    }
}

/// The log holds 1,024 changes, or a quarter as many as there are objects, and forgets whole calls.
#[test]
fn the_log_holds_as_many_changes_as_it_says() {
    let change = super::log::Change { place: 0, was: [DVec3::ZERO; 2] };
    for (objects, size, kept) in [(0, 1, 1024), (4096, 1, 1024), (8000, 1, 2000), (0, 3, 341), (0, 2000, 0)] {
        let mut log = Log::default();
        for _ in 0..3000 {
            let before = log.stamp;
            log.push(vec![change; size], objects);
            assert!(log.stamp != before, "each call has a state of its own");
        }
        assert_eq!(log.entries.len(), kept, "{objects} objects, {size} changes in each call");
    }
}

/// An object is the same after a change that touches neither its id, its being open, its box, nor any of its
/// triangles, and another one after each change that does.
#[test]
fn changes_that_visibility_depends_on_are_changes() {
    let [a, b, c, d] = [[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0]].map(|[y, z]| Vec3::new(1.0, y, z));
    let halves = vec![[a, b, c], [a, c, d]];
    let others = vec![[a, b, d], [b, c, d]];
    let (one, bounds) = (vec![halves[0]], Aabb::from_points([a, b, c, d]));
    type Corners = [Vec3; 3];
    type Case<'a> = (&'a str, &'a [Corners], &'a [Corners], fn(&mut Scene, ObjectId), bool);
    let cases: [Case<'_>; 9] = [
        ("nothing", &halves, &halves, |_, _| {}, false),
        ("other layers", &halves, &halves, |scene, id| scene.set_layers(id, 2).unwrap(), false),
        ("other corners in the same box", &halves, &others, |_, _| {}, true),
        ("fewer triangles in the same box", &halves, &one, |_, _| {}, true),
        ("more triangles in the same box", &one, &halves, |_, _| {}, true),
        ("no occluder", &halves, &halves, |scene, id| scene.set_occluder(id, false).unwrap(), true),
        (
            "never culled, with triangles",
            &one,
            &one,
            |scene, id| scene.set_never_cull(id, true).unwrap(),
            true,
        ),
        (
            "never culled, without triangles",
            &[],
            &[],
            |scene, id| scene.set_never_cull(id, true).unwrap(),
            true,
        ),
        (
            "another box, without triangles",
            &[],
            &[],
            |scene, id| scene.set_bounds(id, Aabb::from_arrays([0.0; 3], [2.0; 3])).unwrap(),
            true,
        ),
    ];
    for (case, was, now, act, expected) in cases {
        let mut scene = Scene::new();
        let id = scene.insert(Object { occluder: true, ..Object::new(bounds) });
        scene.set_triangles(id, was.to_vec()).unwrap();
        let mut all = SceneTriangles::new(&scene);
        let before = all.stamp();
        scene.set_triangles(id, now.to_vec()).unwrap();
        act(&mut scene, id);
        assert_eq!(all.sync(&scene), expected, "{case}");
        assert_eq!(all.stamp() != before, expected, "{case}: state");
    }
    // An equal object in place of a removed one.
    let mut scene = Scene::new();
    let object = Object { occluder: true, ..Object::new(bounds) };
    let id = scene.insert(object);
    let mut all = SceneTriangles::new(&scene);
    scene.remove(id).unwrap();
    let other = scene.insert(object);
    assert_eq!(id.index(), other.index(), "the index of the removed object");
    assert!(all.sync(&scene), "an equal object with another id");
    assert_eq!(all.objects[0].id, other, "the object of the verdict");
}

/// A polygon is newer than the states before the one in which it was made, and no newer than that one.
#[test]
fn pieces_are_newer_than_states_before_them() {
    let triangle = [Vec3::ZERO, Vec3::X, Vec3::Y];
    let mut scene = Scene::new();
    let id = scene.insert(Object { occluder: true, ..Object::new(Aabb::from_points(triangle)) });
    scene.set_triangles(id, [triangle]).unwrap();
    let mut all = SceneTriangles::new(&scene);
    let first = all.serial();
    assert!(!all.is_piece_newer(all.piece_of(0), first), "a polygon of the first state");
    assert!(all.is_piece_newer(7, first), "a polygon that is not there");
    reshape(&mut scene, id, vec![triangle.map(|x| x * 2.0)]);
    assert!(all.sync(&scene), "the triangle grows");
    let piece = all.piece_of(all.objects[0].first);
    let found = [first, all.serial()].map(|serial| all.is_piece_newer(piece, serial));
    assert_eq!(found, [true, false], "a polygon of the second state, against both");
}

/// Polygons are joined from neighbours of one kind alone, one-sided or not, and have 8 corners at most.
#[test]
fn pieces_have_one_kind_of_triangles_and_eight_corners() {
    let [a, b, c, d] = [[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0]].map(|[y, z]| Vec3::new(1.0, y, z));
    for case in 0..4 {
        let mut scene = Scene::new();
        for (triangle, one_sided) in [([a, b, c], case & 1 != 0), ([a, c, d], case & 2 != 0)] {
            let bounds = Aabb::from_points(triangle);
            let id = scene.insert(Object { occluder: true, one_sided, ..Object::new(bounds) });
            scene.set_triangles(id, [triangle]).unwrap();
        }
        let expected = if case == 0 || case == 3 { 1 } else { 2 };
        assert_eq!(SceneTriangles::new(&scene).pieces.len(), expected, "one-sided ones in case {case}");
    }
    // A fan from a corner of a convex polygon.
    let at = |k: u8| Vec3::new(1.0, f32::from(k), f32::from(k).powi(2));
    let all = prepared((1..20).map(|k| [at(0), at(k), at(k + 1)]));
    let most = all.pieces.iter().map(|piece| piece.ring.len()).max();
    assert_eq!(most, Some(8), "greatest number of corners");
}
