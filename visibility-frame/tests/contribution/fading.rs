//! Tests that an object hides others only where it is opaque: opacities are those that `LodSelector` gives,
//! and the expected answers follow from the positions of a wall and a box behind it.

use visibility_core::culler::Lack;
use visibility_core::glam::{Affine3A, DVec3};
use visibility_core::scene::DrawRange;
use visibility_core::{
    Aabb, FrustumCuller, Object, ObjectId, OccluderMesh, OcclusionCuller, Pipeline, Pose, Scene, View,
    VisibleSet,
};
use visibility_frame::lod::{ContributionCuller, LodSelector};
use visibility_testing::PlainMap;

/// A wall whose nearest point is at x = 90, with a draw range, and a box behind it.
struct Street {
    scene: Scene,
    wall: ObjectId,
    behind: ObjectId,
    pipeline: Pipeline,
    lods: LodSelector,
}

impl Street {
    fn new(range: DrawRange) -> Self {
        let mut scene = Scene::new();
        let bounds = Aabb::from_arrays([90.0, -50.0, -50.0], [91.0, 50.0, 50.0]);
        let wall = scene.insert(Object { occluder: true, ..Object::new(bounds) });
        let mesh = scene.add_mesh(OccluderMesh::cuboid(&bounds).unwrap());
        scene.set_mesh(wall, mesh, Affine3A::IDENTITY).unwrap();
        scene.set_draw_range(wall, range).unwrap();
        let behind = scene.insert(Aabb::from_arrays([110.0, -1.0, -1.0], [111.0, 1.0, 1.0]));
        let pipeline = Pipeline::new()
            .with(FrustumCuller::new())
            .with(ContributionCuller::new(1080.0, 0.0))
            .with(OcclusionCuller::new(PlainMap::new(64, 64)));
        Self { scene, wall, behind, pipeline, lods: LodSelector::new(1080.0) }
    }

    /// Draws a frame from a distance to the wall in metres. Returns the opacity of the wall, 0 if it is not
    /// drawn, and whether the box behind it is drawn.
    fn frame(&mut self, distance: f64) -> (f32, bool) {
        let pose = Pose::look_at(DVec3::X * (90.0 - distance), DVec3::X * 90.0, DVec3::Z);
        let view = View::perspective(pose, 1.0, 1.0, 0.1, f64::INFINITY).unwrap();
        let mut visible = VisibleSet::new();
        self.pipeline.cull(&self.scene, &view, &mut visible);
        self.lods.select(&self.scene, &view, &visible, 0.1, |_| &[]);
        let opacity = self.lods.lod(self.wall).map_or(0.0, |lod| lod.opacity);
        (opacity, visible.contains(&self.scene, self.behind))
    }

    fn lacks(&self) -> Vec<Lack> {
        let mut lacks = Vec::new();
        self.pipeline.for_each_lack(&self.scene, |_, lack| lacks.push(lack));
        lacks
    }
}

#[test]
fn a_wall_that_fades_hides_nothing_at_any_distance() {
    let mut street = Street::new(DrawRange { end: 100.0, margin: 20.0, ..DrawRange::ALWAYS });
    // The last distances are beyond the end, within the hysteresis.
    for (distance, opacity) in
        [(10.0, 1.0), (79.0, 1.0), (90.0, 0.5), (100.0, 0.0), (102.0, 0.0), (104.9, 0.0)]
    {
        assert_eq!(street.frame(distance), (opacity, true), "{distance} m from a wall that fades out");
    }
    let fading = Lack { what: "occluders that fade by their draw range, and hide nothing", count: 1 };
    assert!(street.lacks().contains(&fading), "{:?}", street.lacks());
    let mut street = Street::new(DrawRange { begin: 50.0, margin: 20.0, ..DrawRange::ALWAYS });
    for (distance, opacity) in [(60.0, 0.5), (80.0, 1.0), (50.0, 0.0), (48.0, 0.0)] {
        assert_eq!(street.frame(distance), (opacity, true), "{distance} m from a wall that fades in");
    }
}

#[test]
fn a_wall_without_a_margin_is_opaque_wherever_it_hides() {
    let mut street = Street::new(DrawRange { end: 100.0, ..DrawRange::ALWAYS });
    // Beyond the end the wall stays for the hysteresis, drawn opaque; then it is gone, and hides no more.
    for (distance, opacity) in
        [(10.0, 1.0), (100.0, 1.0), (104.9, 1.0), (105.1, 0.0), (102.0, 0.0), (99.0, 1.0)]
    {
        assert_eq!(
            street.frame(distance),
            (opacity, opacity == 0.0),
            "{distance} m from a wall without a margin"
        );
    }
    assert_eq!(street.lacks(), [], "a wall without a margin");
    // A margin without an end to fade at changes nothing.
    let mut street = Street::new(DrawRange { margin: 20.0, ..DrawRange::ALWAYS });
    assert_eq!(street.frame(90.0), (1.0, false), "a margin alone");
}

#[test]
fn a_child_whose_range_ends_before_its_parent_begins_hides_while_it_is_opaque() {
    for margin in [0.0, 20.0] {
        let mut street = Street::new(DrawRange { end: 100.0, margin, ..DrawRange::ALWAYS });
        // The parent reaches 10 m nearer to the eye, and is drawn from a distance of 200 m on.
        let parent = street.scene.insert(Aabb::from_arrays([80.0, -50.0, -50.0], [91.0, 50.0, 50.0]));
        street.scene.set_draw_range(parent, DrawRange { begin: 200.0, ..DrawRange::ALWAYS }).unwrap();
        street.scene.set_hlod_parent(street.wall, Some(parent)).unwrap();
        for (distance, faded) in [(50.0, 1.0), (100.0, 0.5), (110.0, 0.0), (114.0, 0.0)] {
            let opacity = if margin == 0.0 { 1.0 } else { faded };
            let expected = (opacity, margin > 0.0);
            assert_eq!(street.frame(distance), expected, "a child at {distance} m with a margin of {margin}");
        }
        assert_eq!(street.frame(150.0), (0.0, true), "between child and parent, with a margin of {margin}");
    }
}

#[test]
fn a_range_that_is_set_or_taken_away_counts_from_the_next_frame_on() {
    let mut street = Street::new(DrawRange::ALWAYS);
    let fading = DrawRange { end: 1000.0, margin: 20.0, ..DrawRange::ALWAYS };
    for (frame, range) in [DrawRange::ALWAYS, fading, DrawRange::ALWAYS, fading].into_iter().enumerate() {
        street.scene.set_draw_range(street.wall, range).unwrap();
        assert_eq!(street.frame(90.0), (1.0, range == fading), "frame {frame}");
        street.scene.set_occluder(street.wall, false).unwrap();
        assert_eq!(
            street.lacks().iter().filter(|lack| lack.what.contains("fade")).count(),
            0,
            "frame {frame}"
        );
        street.scene.set_occluder(street.wall, true).unwrap();
        street.scene.rebuild();
        assert_eq!(street.frame(90.0), (1.0, range == fading), "frame {frame}, rebuilt");
    }
}

#[test]
fn a_stage_that_hides_behind_what_a_later_stage_removes_is_named() {
    let occlusion = || OcclusionCuller::new(PlainMap::new(64, 64));
    let mut street = Street::new(DrawRange { end: 100.0, ..DrawRange::ALWAYS });
    assert_eq!(street.lacks(), [], "the stages in order");
    let wrong = || Pipeline::new().with(FrustumCuller::new()).with(occlusion());
    street.pipeline = wrong().with(ContributionCuller::new(1080.0, 0.0));
    assert_eq!(street.frame(110.0), (0.0, false), "the box is hidden behind a wall that is not drawn");
    let named = |street: &Street| {
        let mut names = Vec::new();
        street.pipeline.for_each_lack(&street.scene, |stage, lack| names.push((stage.to_owned(), lack)));
        names
    };
    let what = "occluders that hide others before a later stage may remove them by draw range or size";
    let name = street.pipeline.stages().nth(1).unwrap().0.to_owned();
    assert_eq!(named(&street), [(name, Lack { what, count: 1 })], "the stage that comes too early");
    // Each stage that comes before the last one that removes by distance is named.
    street.pipeline = wrong()
        .with(ContributionCuller::new(1080.0, 0.0))
        .with(occlusion())
        .with(ContributionCuller::new(1080.0, 2.0))
        .with(occlusion());
    assert_eq!(named(&street).len(), 2, "{:?}", named(&street));
    street.scene.set_occluder(street.wall, false).unwrap();
    assert!(street.lacks().iter().all(|lack| lack.what != what), "without occluders: {:?}", street.lacks());
}
