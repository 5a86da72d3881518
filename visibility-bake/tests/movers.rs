//! Movers within known volumes in baked sets: the volume is an object of the bake, and a mover is drawn where
//! its volume is visible (Fredo Durand, George Drettakis, Joelle Thollot and Claude Puech, "Conservative
//! Visibility Preprocessing using Extended Projections", 2000, section 6.2).

use crate::sandwiches::street;
use std::sync::Arc;
use visibility_bake::{BakedSet, SandwichBaker, SandwichSettings};
use visibility_core::bake::Bake;
use visibility_core::glam::{DVec3, Vec3};
use visibility_core::pvs::PvsCuller;
use visibility_core::random::Random;
use visibility_core::{Aabb, FrustumCuller, Object, ObjectId, Pipeline, Pose, View, VisibleSet};
use visibility_testing::is_clear;

/// Volumes along the street and in the yards behind the houses on both sides, 10 m long each, in which movers
/// of up to 2 m stay.
fn volumes() -> Vec<Aabb> {
    let lanes = [(-2.0, 2.0), (17.0, 24.0), (-24.0, -17.0)];
    let along = |(near, far): (f32, f32)| {
        (0..8).map(move |k| {
            let x = k as f32 * 10.0;
            Aabb::new(Vec3::new(x, near, 0.0), Vec3::new(x + 10.0, far, 2.0))
        })
    };
    lanes.into_iter().flat_map(along).collect()
}

/// Returns random bounds of a mover within a volume.
fn place(random: &mut Random, volume: &Aabb) -> Aabb {
    let mut within =
        |a: Vec3, b: Vec3| a + (b - a) * Vec3::from_array(core::array::from_fn(|_| random.unit() as f32));
    let size = within(Vec3::splat(0.3), Vec3::new(4.0, 2.0, 2.0));
    let min = within(volume.min, volume.max - size);
    Aabb::new(min, (min + size).min(volume.max))
}

#[test]
fn movers_are_drawn_where_their_volume_is_visible() {
    let (mut scene, cells) = street();
    // A volume has no triangles and does not occlude: it is baked as its box.
    let volumes: Vec<(ObjectId, Aabb)> =
        volumes().into_iter().map(|bounds| (scene.insert(Object::new(bounds)), bounds)).collect();
    let settings = SandwichSettings::default().with_gap(0.0).with_rays(4);
    let found = Bake::new(SandwichBaker::new(&scene, &cells, settings)).run();
    let rows: Vec<_> = found.cells.iter().map(|cell| cell.reported()).collect();
    let file = BakedSet::from_rows(&scene, cells.clone(), &rows).unwrap().to_bytes();

    let sets = BakedSet::from_bytes(&file).unwrap().for_scene(&scene).unwrap();
    let mut pipeline = Pipeline::new().with(FrustumCuller::new()).with(PvsCuller::new(Arc::new(sets)));
    let mut visible = VisibleSet::new();
    let mut random = Random(8);
    // The movers are no objects of the bake.
    let movers: Vec<ObjectId> =
        volumes.iter().map(|(_, volume)| scene.insert(place(&mut random, volume))).collect();
    let (mut hidden, mut seen) = (0, 0);
    for frame in 0..400 {
        for (&mover, (_, volume)) in movers.iter().zip(&volumes) {
            scene.set_bounds(mover, place(&mut random, volume)).unwrap();
        }
        let cell = &cells.cells()[random.below(cells.cells().len())];
        let eye = cell.min + (cell.max - cell.min) * random.point();
        let at = scene.bounds(movers[random.below(movers.len())]).unwrap();
        let at = ((at.min + at.max) * 0.5).as_dvec3();
        let pose = Pose::look_at(eye, at, DVec3::Z);
        let view = View::perspective(pose, 1.0, 16.0 / 9.0, 0.01, f64::INFINITY).unwrap();
        pipeline.cull(&scene, &view, &mut visible);
        for (&mover, &(volume, _)) in movers.iter().zip(&volumes) {
            if !visible.contains(&scene, mover) {
                continue;
            }
            let is_drawn = visible.contains(&scene, volume);
            hidden += usize::from(!is_drawn);
            let bounds = scene.bounds(mover).unwrap();
            let (min, max) = (bounds.min.as_dvec3(), bounds.max.as_dvec3());
            let mut point = || min + (max - min) * random.point();
            let is_seen = (0..30).any(|_| is_clear(&scene, eye, point(), mover.index()));
            seen += usize::from(is_seen);
            assert!(
                is_drawn || !is_seen,
                "frame {frame}: {mover} is seen from {eye}, but its volume is hidden"
            );
        }
    }
    assert!(hidden > 500 && seen > 200, "{hidden} times a mover was culled by its volume, {seen} times seen");
}
