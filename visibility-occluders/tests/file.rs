//! Tests of the file of a level's occluders: it holds all of them, it is refused for another version of the
//! level, and forged bytes are either refused or drawn, with memory in proportion to their number.

use visibility_core::glam::Vec3;
use visibility_core::{Aabb, Object, ObjectId, Scene, level_version};
use visibility_occluders::{LevelFileError, LevelOccluders, LevelSettings, LevelTriangle};
use visibility_testing::{NOT_ALWAYS_DRAWN, Random, forge_counts, mend_header};

/// Number of bytes of a file before its layer masks: the header, the report, the hash of the
/// objects, and the number of layer masks.
const FRONT: usize = 40 + 64 + 8 + 4;

/// Returns the occluders of a few rectangles, some of them with a hole where a triangle is missing, in
/// clusters of a few edges.
fn sample(two_sided: bool) -> LevelOccluders {
    let mut random = Random(5);
    let mut triangles = Vec::new();
    for wall in 0..6 {
        let at = |u: usize, v: usize| Vec3::new(wall as f32 * 3.0, u as f32, v as f32);
        for (u, v) in (0..3).flat_map(|u| (0..3).map(move |v| (u, v))) {
            let [a, b, c, d] = [at(u, v), at(u + 1, v), at(u + 1, v + 1), at(u, v + 1)];
            triangles.push(LevelTriangle { corners: [a, b, c], two_sided });
            if !random.one_in(5) {
                triangles.push(LevelTriangle { corners: [a, c, d], two_sided });
            }
        }
    }
    let settings = LevelSettings::default().with_max_cluster_edges(24).with_kept_area(0.9);
    LevelOccluders::new(&triangles, settings).unwrap()
}

#[test]
fn a_file_holds_the_occluders() {
    for level in [sample(true), sample(false).with_version(7), LevelOccluders::default()] {
        let file = level.to_bytes();
        assert_eq!(LevelOccluders::from_bytes(&file, level.version()), Ok(level), "the level from its file");
    }
    assert!(sample(true).clusters().len() > 2, "the sample has {} clusters", sample(true).clusters().len());
}

#[test]
fn a_file_of_another_version_is_refused_with_both() {
    let mut scene = Scene::new();
    let bounds = Aabb::from_arrays([5.0, 0.0, 0.0], [5.0, 4.0, 3.0]);
    let wall = scene.insert(Object { occluder: true, ..Object::new(bounds) });
    scene.set_triangles(wall, [[Vec3::X * 5.0, Vec3::new(5.0, 4.0, 0.0), Vec3::new(5.0, 4.0, 3.0)]]).unwrap();
    let level = LevelOccluders::of_scene(&scene, |_| true, LevelSettings::default()).unwrap();
    let before = level_version(&scene);
    assert_eq!(
        (level.polygons().len(), level.version()),
        (1, Some(before)),
        "polygons of the level, and its version"
    );
    scene.set_triangles(wall, [[Vec3::X * 5.0, Vec3::new(5.0, 4.0, 0.0), Vec3::new(5.0, 4.0, 2.0)]]).unwrap();
    let now = level_version(&scene);
    let refused = LevelOccluders::from_bytes(&level.to_bytes(), Some(now)).unwrap_err();
    assert_eq!(
        refused,
        LevelFileError::OtherVersion { made_from: Some(before), level: now },
        "a level made before the wall was changed"
    );
    let said = refused.to_string();
    assert!(said.contains(&format!("{before:016x}")) && said.contains(&format!("{now:016x}")), "{said}");
    let file = sample(true).to_bytes();
    let refused = LevelOccluders::from_bytes(&file, Some(now)).unwrap_err();
    assert_eq!(
        refused,
        LevelFileError::OtherVersion { made_from: None, level: now },
        "a level of no known version"
    );
    assert!(LevelOccluders::from_bytes(&file, None).is_ok(), "a caller without a version reads any level");
}

/// Returns the problem that is reported for a file with `bytes` written at offset `at`.
fn problem(level: &LevelOccluders, at: usize, bytes: &[u8]) -> String {
    let mut file = level.to_bytes();
    file[at..at + bytes.len()].copy_from_slice(bytes);
    mend_header(&mut file, 0);
    LevelOccluders::from_bytes(&file, None).unwrap_err().to_string()
}

#[test]
fn content_that_cannot_be_drawn_is_refused() {
    let level = sample(true);
    let vertices = FRONT + 4;
    let shapes = vertices + 12 * level.vertices().len() + 4;
    // Offset of the first cluster's numbers: its vertices and polygons, then edges, sides and vertices of the
    // first polygon.
    let numbers = shapes + 56 * level.polygons().len() + 8;
    let [nan, two] = [f64::NAN, 2.0].map(f64::to_le_bytes);
    // The least number that no vertex of the first cluster has.
    let unknown = level.clusters()[0].vertices[1] as u8;
    for (at, bytes, said) in [
        (12, &[2][..], "a structure of kind 2"),
        (vertices, &f32::NAN.to_le_bytes(), "a vertex is not finite"),
        (vertices - 4, &[255], "more is announced than there is"),
        (shapes, &two, "a polygon has no plane"),
        (shapes + 8, &two, "a polygon has no plane"),
        (shapes + 16, &nan, "a polygon has no plane"),
        (shapes + 24, &f64::INFINITY.to_le_bytes(), "a polygon has no plane"),
        (shapes + 24, &f64::NEG_INFINITY.to_le_bytes(), "a polygon has no plane"),
        (shapes + 32, &f64::INFINITY.to_le_bytes(), "a polygon has no plane"),
        (shapes + 32, &(-1e9f64).to_le_bytes(), "a polygon has no plane"),
        (shapes + 40, &(-1.0f64).to_le_bytes(), "a polygon has no plane"),
        (shapes + 40, &nan, "a polygon has no plane"),
        (shapes + 40, &f64::INFINITY.to_le_bytes(), "a polygon has no plane"),
        (shapes + 48, &nan, "a polygon has faces that do not face"),
        (shapes + 48, &0.0f64.to_le_bytes(), "a polygon has faces that do not face"),
        (shapes + 48, &(1.0f64 + 1.1e-9).to_le_bytes(), "a polygon has faces that do not face"),
        (numbers - 8, &[255], "more is announced than there is"),
        (numbers - 8, &[2], "the content goes on after its end"),
        (numbers, &[127], "a cluster has more vertices than there are"),
        (numbers, &[3], "an edge has an unknown vertex"),
        (numbers + 1, &[0], "a cluster has no polygon"),
        (numbers + 2, &[2], "a polygon has fewer than three edges"),
        (numbers + 3, &[2], "a polygon hides neither"),
        (numbers + 4, &[127], "an edge has an unknown vertex"),
        (numbers + 5, &[127], "an edge has an unknown vertex"),
        (numbers + 4, &[unknown], "an edge has an unknown vertex"),
        (numbers + 5, &[unknown], "an edge has an unknown vertex"),
    ] {
        let found = problem(&level, at, bytes);
        assert!(found.contains(said), "byte {at}: {found}, not {said}");
    }
    // An outline whose end is not its beginning.
    let first = level.edges()[0];
    let other = if first[1] == first[0] + 1 { first[0] + 2 } else { first[0] + 1 };
    assert!(
        problem(&level, numbers + 5, &[other as u8]).contains("an outline is not closed"),
        "an outline that ends at {other} instead of its first vertex"
    );
    // An extent that leaves out a vertex of the polygon, by one rounding and by far.
    let polygon = level.polygons()[0];
    let corners = level.edges()[polygon.edges[0] as usize..polygon.edges[1] as usize].as_flattened();
    let along = corners.iter().map(|&v| polygon.normal.dot(level.vertices()[v as usize].as_dvec3()));
    let [least, greatest] =
        [along.clone().fold(f64::INFINITY, f64::min), along.fold(f64::NEG_INFINITY, f64::max)];
    let with_extent = |extent: [f64; 2]| {
        let mut file = level.to_bytes();
        file[shapes + 24..shapes + 40].copy_from_slice(extent.map(f64::to_le_bytes).as_flattened());
        mend_header(&mut file, 0);
        LevelOccluders::from_bytes(&file, None).err().map(|error| error.to_string())
    };
    assert_eq!(with_extent([least, greatest]), None, "the extent of the vertices");
    for extent in
        [[least.next_up(), greatest.next_up()], [least.next_down(), greatest.next_down()], [1e3, 2e3]]
    {
        let found = with_extent(extent).unwrap_or_default();
        assert!(found.contains("a vertex lies outside the extent"), "{extent:?}: {found}");
    }
    // A vertex, or a polygon, that belongs to no cluster.
    for (count, bytes) in [(FRONT, 12), (FRONT + 4, 56)] {
        let mut file = LevelOccluders::default().to_bytes();
        file[count] = 1;
        file.splice(count + 4..count + 4, vec![0; bytes]);
        mend_header(&mut file, 0);
        let found = LevelOccluders::from_bytes(&file, None).unwrap_err().to_string();
        assert!(found.contains("are left that no cluster has"), "{found}");
    }
}

/// Numbers of a polygon at their limits are read: a normal and a cosine that are longer than 1 by rounding,
/// and an area of 0.
#[test]
fn polygons_at_the_limits_are_read() {
    let level = sample(true);
    let shape = FRONT + 4 + 12 * level.vertices().len() + 4;
    let polygon = level.polygons()[0];
    let [low, high] = polygon.extent;
    // The squared length differs from 1 by up to `by`.
    let read = |by: f64, area: f64, min_cosine: f64| {
        let normal = polygon.normal * (1.0 + 0.5 * by);
        let numbers = [normal.x, normal.y, normal.z, low - 1e-6, high + 1e-6, area, min_cosine];
        let mut file = level.to_bytes();
        file[shape..shape + 56].copy_from_slice(numbers.map(f64::to_le_bytes).as_flattened());
        mend_header(&mut file, 0);
        LevelOccluders::from_bytes(&file, None).is_ok()
    };
    for (by, area, min_cosine, is_read) in [
        (0.0, 0.0, 1.0, true),
        (0.9e-9, 1.0, 1.0, true),
        (-0.9e-9, 1.0, 1.0, true),
        (1.1e-9, 1.0, 1.0, false),
        (-1.1e-9, 1.0, 1.0, false),
        (0.0, 1.0, 1.0 + 0.9e-9, true),
        (0.0, 1.0, 1.0 + 1.1e-9, false),
        (0.0, 1.0, f64::MIN_POSITIVE, true),
    ] {
        assert_eq!(read(by, area, min_cosine), is_read, "normal {by:e}, area {area}, cosine {min_cosine}");
    }
}

#[test]
fn forged_bytes_take_no_more_memory_than_their_size_allows() {
    let file = sample(true).to_bytes();
    let (mut read, mut all) = (0, 0);
    forge_counts(&file, 0, 5 * file.len(), |mut file| {
        mend_header(&mut file, 0);
        all += 1;
        read += usize::from(LevelOccluders::from_bytes(&file, None).is_ok());
    });
    // Some forged files are read: areas and report counts may have any value.
    assert!(read > 0 && read < all, "{read} of {all}");
}

/// Objects that are never drawn, or not always, are in no level. An edit that removes an object from the
/// level changes the level's version, and the file holds the layers of all remaining objects.
#[test]
fn a_level_is_made_of_what_is_always_drawn() {
    let mut scene = Scene::new();
    let corners = [Vec3::X * 5.0, Vec3::new(5.0, 4.0, 0.0), Vec3::new(5.0, 4.0, 3.0)];
    let wall = Object { occluder: true, ..Object::new(Aabb::from_points(corners)) };
    let walls = scene.insert_batch([1, 2, 1].map(|layers| Object { layers, ..wall }));
    for &wall in &walls {
        scene.set_triangles(wall, [corners]).unwrap();
    }
    let made = |scene: &Scene| LevelOccluders::of_scene(scene, |_| true, LevelSettings::default()).unwrap();
    let level = made(&scene);
    assert_eq!((level.objects(), level.layers()), (&walls[..], &[1, 2][..]), "all walls, and their layers");
    let file = level.to_bytes();
    let read = LevelOccluders::from_bytes(&file, Some(level_version(&scene))).unwrap();
    assert_eq!(read.with_objects_of(&scene, |_| true), Ok(level), "the level from its file");
    type Edit = fn(&mut Scene, ObjectId);
    let edits: [Edit; 2] =
        [|scene, id| scene.set_layers(id, 0).unwrap(), |scene, id| scene.set_see_through(id, true).unwrap()];
    for (number, edit) in edits.into_iter().chain(NOT_ALWAYS_DRAWN).enumerate() {
        let mut scene = scene.clone();
        edit(&mut scene, walls[1]);
        let level = made(&scene);
        let expected = (&[walls[0], walls[2]][..], &[1][..]);
        assert_eq!((level.objects(), level.layers()), expected, "edit {number}: the second wall is left out");
        let refused = LevelOccluders::from_bytes(&file, level.version());
        assert!(matches!(refused, Err(LevelFileError::OtherVersion { .. })), "edit {number}: {refused:?}");
    }
}

/// A level that was made with a door among its objects is refused once the door does not stand still, and the
/// reverse, though both have one version.
#[test]
fn a_level_of_other_objects_is_refused() {
    let corners = [Vec3::X * 5.0, Vec3::new(5.0, 4.0, 0.0), Vec3::new(5.0, 4.0, 3.0)];
    let mut scene = Scene::new();
    let object = Object { occluder: true, ..Object::new(Aabb::from_points(corners)) };
    let ids = scene.insert_batch([object; 3]);
    ids.iter().for_each(|&id| scene.set_triangles(id, [corners]).unwrap());
    let choices: [&dyn Fn(ObjectId) -> bool; 5] =
        [&|_| true, &|id| id != ids[0], &|id| id != ids[2], &|id| id == ids[1], &|_| false];
    for (made, chosen) in choices.iter().enumerate() {
        let level = LevelOccluders::of_scene(&scene, chosen, LevelSettings::default()).unwrap();
        let read = LevelOccluders::from_bytes(&level.to_bytes(), Some(level_version(&scene))).unwrap();
        for (found, now) in choices.iter().enumerate() {
            let answer = read.clone().with_objects_of(&scene, now);
            let expected = if made == found { Ok(level.clone()) } else { Err(LevelFileError::OtherObjects) };
            assert_eq!(answer, expected, "made of choice {made}, found choice {found}");
        }
    }
    assert!(LevelFileError::OtherObjects.to_string().contains("door"), "the error names a cause");
    let alone = sample(true).with_objects_of(&scene, |_| true).unwrap();
    assert_eq!(alone.objects(), ids, "objects of occluders made of triangles alone");
}
