//! Tests that the stored scenes load with the expected facts. They run if the scenes are found beside the
//! checkout.

use crate::shared_scenes::{scene, stored};
use glam::{DVec3, Vec3};
use visibility_examples::{cars5, description::Description, frames, load, load_walks, vscn};

/// Expected facts: file stem, number of objects, number of triangles, up axis.
const SCENES: [(&str, usize, usize, Vec3); 6] = [
    ("clinic", 2_830, 191_972, Vec3::Y),
    ("clinic_mep", 5_822, 840_327, Vec3::Y),
    ("denhaag", 1_991, 41_183, Vec3::Z),
    ("car", 433, 145_916, Vec3::Y),
    ("alpine1", 1_806, 29_119, Vec3::Y),
    ("oa_dm2", 2_481, 11_917, Vec3::Z),
];

#[test]
#[cfg_attr(not(reference_scenes), ignore = "the reference scenes are not beside the checkout")]
fn stored_scenes_load_with_their_facts() {
    for (name, objects, triangles, up) in SCENES {
        let path = stored(&format!("{name}.vscn"));
        let scene = load(&path).expect(name);
        assert_eq!((scene.name.as_str(), scene.up), (name, up), "name and axis up");
        assert_eq!(scene.objects.len(), objects, "{name}");
        assert_eq!(scene.triangle_count(), triangles, "{name}");
        assert_eq!(scene.walks.len(), 3, "{name}");

        let facts = Description::load(&path.with_extension("json")).expect(name);
        let (low, high) = scene.bounds().expect("a scene");
        for (made, stored) in [(low, facts.bounds_min), (high, facts.bounds_max)] {
            let stored = DVec3::from_array(stored.expect("bounds"));
            assert!(made.as_dvec3().distance(stored) < 2e-3, "{name}: {made} {stored}");
        }
        // Every reference walk has a count for each of its keys.
        for (walk, reference) in scene.walks.iter().zip(&facts.reference) {
            assert_eq!(walk.name, reference.walk, "{name}: the walk of the reference");
            assert_eq!(
                walk.keys.len(),
                reference.objects_in_frustum.len(),
                "{name}: counts of objects in the frustum"
            );
            assert_eq!(walk.keys.len(), reference.objects_visible.len(), "{name}: counts of visible objects");
            assert_eq!(
                walk.keys.len(),
                reference.triangles_visible.len(),
                "{name}: counts of visible triangles"
            );
        }
        let bytes = std::fs::read(&path).expect("it was read before");
        assert_eq!(vscn::write(&scene), Some(bytes), "{name}");
    }
}

#[test]
#[cfg_attr(not(reference_scenes), ignore = "the reference scenes are not beside the checkout")]
fn doors_glass_and_billboards_are_told_apart() {
    let clinic = scene("clinic");
    assert!(clinic.objects[..2586].iter().all(|o| o.opaque), "what is before the glass is opaque");
    assert!(clinic.objects[2586..].iter().all(|o| !o.opaque), "glass is not opaque");
    assert!(
        clinic.objects.iter().all(|o| o.door == o.name.to_string().contains("IfcDoor")),
        "doors are the objects with a door's name"
    );
    assert!(clinic.objects.iter().any(|o| o.door), "there are doors");
    let alpine = scene("alpine1");
    let billboard = |name: &str| name.starts_with("TREEP") || name.starts_with("FOREST");
    assert!(
        alpine.objects.iter().all(|o| o.opaque != billboard(&o.name.to_string())),
        "billboards alone are not opaque"
    );
    assert!(alpine.objects.iter().any(|o| !o.opaque), "there are billboards");
}

#[test]
#[cfg_attr(not(reference_scenes), ignore = "the reference scenes are not beside the checkout")]
fn five_cars_stand_in_a_row() {
    let path = stored("car.vscn");
    let cars = cars5(&path).expect("five cars");
    assert_eq!(cars.objects.len(), 5 * 433, "objects of five cars");
    assert_eq!(cars.triangle_count(), 729_580, "triangles of five cars");
    // The middle car is not moved, and the last car is rotated clockwise as seen from above.
    let one = load(&path).expect("one car");
    assert_eq!(
        cars.objects[2 * 433].triangles,
        one.objects[0].triangles,
        "the middle car is where the one car is"
    );
    let from = one.objects[0].triangles.view().get(0).expect("a triangle")[0];
    let (sin, cos) = (-25_f32).to_radians().sin_cos();
    let expected = Vec3::new(cos * from.x + sin * from.z + 6.4, from.y, cos * from.z - sin * from.x);
    assert!(
        cars.objects[4 * 433].triangles.view().get(0).expect("a triangle")[0].distance(expected) < 1e-5,
        "a corner of the last car is at {expected}"
    );
}

#[test]
#[cfg_attr(not(reference_scenes), ignore = "the reference scenes are not beside the checkout")]
fn walks_load_by_themselves() {
    let path = stored("gen_town16.json");
    let walks = load_walks(&path).expect("walks");
    let keys: usize = walks.iter().map(|walk| walk.keys.len()).sum();
    assert_eq!(frames(&walks, 1000).len(), 1000, "frames of all walks");
    let every_key = frames(&walks, keys);
    let stored = walks.iter().flat_map(|walk| &walk.keys);
    assert!(every_key.iter().zip(stored).all(|(frame, key)| frame.camera == *key), "a frame for each key");
}
