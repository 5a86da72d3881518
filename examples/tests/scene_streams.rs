//! Tests of scenes passed on object by object: equal to whole scenes, with little in memory.

use glam::Vec3;
use std::path::Path;
use visibility_examples::source::{Bounds, SourceObject};
use visibility_examples::{Reading, SceneSource, open, open_by_object, vscn};
use visibility_testing::allocations::{LIVE, PEAK};

/// Writes a VSCN file with names, glass, and an object with non-finite coordinates. Returns its path.
fn file() -> String {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join("streamed.vscn");
    let triangle = [Vec3::X, Vec3::Y, Vec3::new(7.0, f32::INFINITY, f32::NEG_INFINITY)];
    let mut scene = open("london:6,6").unwrap();
    scene.objects.push(SourceObject::new("odd", vec![triangle; 9]));
    let names: Vec<String> = (0..scene.objects.len()).map(|at| format!("part{at}")).collect();
    let facts = format!(r#"{{"object_names": {names:?}, "first_transparent_object": 500}}"#);
    std::fs::write(&path, vscn::write(&scene).unwrap()).unwrap();
    std::fs::write(path.with_extension("json"), facts).unwrap();
    path.display().to_string()
}

#[test]
fn objects_one_by_one_are_those_of_the_whole_and_take_little_memory() {
    let file = file();
    let names = ["plpcity:1,2", "london:8,8", "town:2", "forest:70,84", "office:2,9", &file];
    for name in names {
        let whole = open(name).unwrap();
        let mut expected = whole.objects.iter();
        let mut bounds = Bounds::default();
        let before = LIVE.get();
        PEAK.set(before);
        let rest = open_by_object(name, &Reading::default(), &mut |_, object| {
            let other = expected.next().expect(name);
            assert_eq!(
                (&object.name, object.opaque, object.door),
                (&other.name, other.opaque, other.door),
                "{name}: name and flags of an object"
            );
            let bits = |object: &SourceObject| {
                let points = object.triangles.iter().flatten();
                points.fold(0u64, |hash, p| {
                    p.to_array().iter().fold(hash, |hash, x| hash.wrapping_mul(31) + u64::from(x.to_bits()))
                })
            };
            assert_eq!(
                (object.triangles.len(), bits(&object)),
                (other.triangles.len(), bits(other)),
                "{name}"
            );
            bounds.add(&object);
        });
        let peak = PEAK.get() - before;
        let size = whole.triangle_count() * size_of::<[Vec3; 3]>();
        println!("{name}: {peak} bytes at most for {size} bytes of triangles");
        assert!(peak * 3 < size as isize, "{name}: {peak} bytes at most for {size} bytes of triangles");
        assert_eq!(expected.len(), 0, "{name}");
        assert_eq!(bounds.corners(), whole.bounds(), "{name}");
        assert_eq!(rest.unwrap(), SceneSource { objects: Vec::new(), ..whole }, "{name}");
    }
}
