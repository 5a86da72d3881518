//! Tests of shadow views with occlusion from the light. A caster culler for the camera's view, then a frustum
//! culler and an occlusion culler for the light's view leave enough casters for every shadow in view. The
//! oracle shoots segments from points in view to the light.

use visibility_core::glam::{Affine3A, DVec3};
use visibility_core::view::Window;
use visibility_core::{
    Aabb, Culler, FrustumCuller, Object, ObjectId, OccluderMesh, OcclusionCuller, Pose, Scene, View,
    VisibleSet,
};
use visibility_frame::casters::{CasterCuller, Light};
use visibility_testing::{PlainMap, Random, judged, told_enough};

/// Layer of the objects that cast shadows.
const CASTERS: u32 = 1;
/// Layer of the objects that cast no shadows, though they hide objects behind them from a camera.
const OTHERS: u32 = 2;

/// Returns whether the segment from `p` to `p + ray` meets the box, enlarged by `by` metres on each side.
fn hits(bounds: &Aabb, by: f64, p: DVec3, ray: DVec3) -> bool {
    let (mut enter, mut leave) = (0.0f64, 1.0f64);
    for axis in 0..3 {
        let a = (f64::from(bounds.min[axis]) - by - p[axis]) / ray[axis];
        let b = (f64::from(bounds.max[axis]) + by - p[axis]) / ray[axis];
        (enter, leave) = (enter.max(a.min(b)), leave.min(a.max(b)));
    }
    enter <= leave
}

/// Returns a scene of boxes of many sizes, walls among them: all are occluders, and a quarter cast no
/// shadows.
fn town(rng: &mut Random) -> (Scene, Vec<(ObjectId, Aabb)>) {
    let (mut scene, mut casters) = (Scene::new(), Vec::new());
    for i in 0..400 {
        let min = rng.vector(25.0).as_vec3();
        let size = match i % 8 {
            0 => rng.vector(14.0).abs() + DVec3::splat(3.0),
            _ => rng.vector(2.0).abs() + DVec3::splat(0.1),
        };
        let bounds = Aabb::new(min, min + size.as_vec3());
        let layers = if i % 4 == 1 || i % 16 == 0 { OTHERS } else { CASTERS };
        let id = scene.insert(Object { layers, occluder: true, ..Object::new(bounds) });
        let mesh = scene.add_mesh(OccluderMesh::cuboid(&bounds).unwrap());
        scene.set_mesh(id, mesh, Affine3A::IDENTITY).unwrap();
        if layers == CASTERS {
            casters.push((id, bounds));
        }
    }
    (scene, casters)
}

#[test]
fn what_is_left_throws_every_shadow_of_all_casters() {
    let mut rng = Random(1);
    let mut occlusion = OcclusionCuller::new(PlainMap::new(64, 64));
    let mut set = VisibleSet::new();
    let (mut shadows, mut hidden, mut kept_casters) = (0, 0, 0);
    for round in 0..48 {
        let (scene, casters) = town(&mut rng);
        let eye = rng.vector(20.0);
        let camera =
            View::perspective(Pose::look_at(eye, eye + rng.vector(1.0), DVec3::Z), 1.2, 1.0, 0.1, 60.0);
        let camera = camera.unwrap();
        // The light's own view looks from the light, and has all casters beyond its near plane.
        let toward = rng.vector(1.0).normalize();
        let place = toward * 80.0;
        let (light, view) = if round % 2 == 0 {
            let pose = Pose::look_at(place, DVec3::ZERO, toward.any_orthogonal_vector());
            let view = View::orthographic(pose, Window::centered(50.0, 50.0), 1.0, 200.0);
            (Light::Directional { toward_light: toward }, view)
        } else {
            let pose = Pose::look_at(place, DVec3::ZERO, toward.any_orthogonal_vector());
            let light = Light::Point { position: place, range: f64::INFINITY };
            (light, View::perspective(pose, 1.3, 1.0, 1.0, f64::INFINITY))
        };
        let view = view.unwrap().with_layers(CASTERS);

        let price = [24, 1, u32::MAX][round % 3];
        occlusion = occlusion.with_price(price);
        set.fill(&scene, &view);
        CasterCuller::new(light).unwrap().cull(&scene, &camera, &mut set);
        FrustumCuller::new().cull(&scene, &view, &mut set);
        let before = set.count(&scene);
        occlusion.cull(&scene, &view, &mut set);
        hidden += before - set.count(&scene);
        kept_casters += set.count(&scene);

        let planes = camera.planes(DVec3::ZERO);
        let of_light = view.planes(DVec3::ZERO);
        let (mut rays, mut tries) = (0, 0);
        while rays < 1500 && tries < 200_000 {
            tries += 1;
            let p = rng.vector(40.0);
            if !planes.contains(p) || !of_light.contains(p) {
                continue;
            }
            rays += 1;
            let ray = if round % 2 == 0 { toward * 300.0 } else { place - p };
            if let Some(blocker) = casters.iter().find(|(_, bounds)| hits(bounds, -1e-9, p, ray)) {
                let mut kept = casters.iter().filter(|(id, _)| set.contains(&scene, *id));
                assert!(
                    kept.any(|(_, bounds)| hits(bounds, 1e-6, p, ray)),
                    "{p} lost the shadow of {blocker:?} from {light:?}, price {price}"
                );
                shadows += 1;
            }
        }
    }
    judged(shadows as u64);
    told_enough(
        shadows > 10_000 && hidden > 600,
        format_args!("{shadows} shadows, {hidden} hidden, {kept_casters} kept"),
    );
}
