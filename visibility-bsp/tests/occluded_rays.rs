//! No visible point is hidden: segments from the eye to points of hidden boxes must all be blocked, in random
//! scenes with eyes at degenerate positions.

use crate::common;

use common::{Soup, meets};
use std::sync::Arc;
use visibility_bsp::{
    LargeOccludersCuller, Occluders, OcclusionTree, OcclusionTreeCuller, ShadowFrusta, ShadowFrustaCuller,
};
use visibility_core::glam::{DVec3, Vec3};
use visibility_core::{Aabb, Culler, FrustumCuller, OcclusionCuller, Scene, View, VisibleSet, view::Eye};
use visibility_testing::{Random, judged, told_enough};

/// Counts of the checks made.
#[derive(Default)]
struct Judge {
    /// Number of segments from the eye that were tested.
    rays: usize,
    /// Number of hidden boxes that were tested.
    hidden: usize,
}

impl Judge {
    /// Asserts that random points of a hidden box (metres relative to `Scene::origin`), as far as they are in
    /// view, are blocked by an occluder triangle. `what` names the culler.
    fn check(&mut self, random: &mut Random, soup: &Soup, view: &View, bounds: &Aabb, what: &str) {
        let planes = view.planes(soup.scene.origin());
        self.hidden += 1;
        for i in 0..14 {
            let share = match i {
                0..8 => DVec3::new((i & 1) as f64, (i >> 1 & 1) as f64, (i >> 2 & 1) as f64),
                8..11 => {
                    let mut p = DVec3::new(random.fine_unit(), random.fine_unit(), random.fine_unit());
                    p[i - 8] = p[i - 8].round();
                    p
                }
                _ => DVec3::new(random.fine_unit(), random.fine_unit(), random.fine_unit()),
            };
            let p = bounds.min.as_dvec3() + (bounds.max - bounds.min).as_dvec3() * share;
            // Only points clearly in view count, and occluders block from the near plane on.
            let inside = |p: DVec3| {
                planes.as_slice().iter().map(|q| q.plane.signed_distance(p)).fold(f64::INFINITY, f64::min)
            };
            // Not 0 for a point at the origin either.
            let far = p.length() + f64::from((bounds.max - bounds.min).length());
            if inside(p) < 1e-9 * far {
                continue;
            }
            self.rays += 1;
            let from = match view.eye(soup.scene.origin()) {
                Eye::Point(eye) => eye,
                Eye::Direction(along) => p - along * 200.0 * far,
            };
            let near = planes.as_slice()[4].plane;
            let blocked = soup.solid.iter().any(|t| {
                meets(from, p, t).is_some_and(|t| {
                    (0.0..=1.0 + 1e-9).contains(&t)
                        && near.signed_distance(from + (p - from) * t) >= -1e-9 * far
                })
            });
            assert!(blocked, "{what}: {p} of {bounds:?} is seen from {from} in {view:?}");
        }
    }
}

/// Returns the bounds, in metres relative to `Scene::origin`, of the objects that the frustum culler keeps
/// and `culler` removes.
fn hidden_boxes(scene: &Scene, view: &View, culler: &mut dyn Culler) -> Vec<Aabb> {
    let mut visible = VisibleSet::new();
    visible.fill(scene, view);
    FrustumCuller::new().cull(scene, view, &mut visible);
    let before: Vec<_> = visible.iter(scene).collect();
    culler.cull(scene, view, &mut visible);
    before
        .into_iter()
        .filter(|&id| !visible.contains(scene, id))
        .map(|id| scene.bounds(id).unwrap())
        .collect()
}

/// Creates the cullers under test for a scene, with a name for each.
fn cullers(scene: &Scene) -> Vec<(&'static str, Box<dyn Culler>)> {
    let occluders = Arc::new(Occluders::new(scene));
    let frusta = ShadowFrusta::new(scene, Occluders::new(scene), 32, 24);
    vec![
        ("shadow-frusta", Box::new(ShadowFrustaCuller::new(frusta.into()))),
        ("large-occluders", Box::new(LargeOccludersCuller::new(occluders.clone()).with_polygons(100))),
        ("incoherent", Box::new(LargeOccludersCuller::new(occluders.clone()).without_coherence())),
        ("occlusion-tree", Box::new(OcclusionTreeCuller::new(occluders.clone()))),
        ("occlusion-tree:400", Box::new(OcclusionTreeCuller::new(occluders).with_polygons(400))),
        ("occlusion-tree of meshes", Box::new(OcclusionCuller::new(OcclusionTree::new().with_polygons(300)))),
    ]
}

/// Checks all hidden boxes of several views in `soups` random scenes with `occluders` occluders each. Returns
/// the counts.
fn fuzz(seed: u64, soups: usize, occluders: usize, scale: f32) -> Judge {
    let mut random = Random(seed);
    let mut judge = Judge::default();
    for _ in 0..soups {
        let soup = Soup::new(&mut random, scale, occluders);
        let mut cullers = cullers(&soup.scene);
        for _ in 0..12 {
            let view = soup.view(&mut random, f64::from(scale));
            for (name, culler) in &mut cullers {
                for bounds in hidden_boxes(&soup.scene, &view, &mut **culler) {
                    judge.check(&mut random, &soup, &view, &bounds, name);
                }
            }
        }
    }
    judged(judge.rays as u64);
    judge
}

#[test]
fn hidden_boxes_of_sparse_soups_cannot_be_seen() {
    told_enough(fuzz(1, 16, 40, 1.0).rays > 100_000, "rays shot at hidden boxes of sparse soups");
}

#[test]
fn hidden_boxes_of_dense_soups_cannot_be_seen() {
    told_enough(fuzz(2, 6, 160, 1.0).rays > 150_000, "rays shot at hidden boxes of dense soups");
}

#[test]
fn nor_at_other_magnitudes() {
    for scale in [1e-15, 1e-6, 1e6, 1e15] {
        told_enough(fuzz(3, 2, 60, scale).rays > 5_000, format_args!("{scale}"));
    }
}

/// A wall of two slabs in front of a box, scaled. The margins are wide, so the answer is known at any
/// magnitude.
#[test]
fn clear_cases_are_decided_at_any_magnitude() {
    for exponent in -15..=15 {
        let scale = 10f64.powi(exponent);
        let at = |low: [f64; 3], high: [f64; 3]| {
            Aabb::new((DVec3::from(low) * scale).as_vec3(), (DVec3::from(high) * scale).as_vec3())
        };
        let mut scene = Scene::new();
        let boxes = [
            (true, at([4.0, -3.0, -3.0], [4.5, 0.0, 3.0])),
            (true, at([4.0, 0.0, -3.0], [4.5, 3.0, 3.0])),
            (false, at([8.0, -1.0, -1.0], [9.0, 1.0, 1.0])),
            (false, at([4.5000001, -2.9, -2.9], [4.6, 2.9, 2.9])),
            (false, at([2.0, -1.0, -1.0], [3.0, 1.0, 1.0])),
            (false, at([8.0, 5.0, -1.0], [9.0, 6.5, 1.0])),
        ];
        let ids: Vec<_> = boxes
            .iter()
            .map(|&(occluder, bounds)| {
                let id = scene
                    .insert(visibility_core::Object { occluder, ..visibility_core::Object::new(bounds) });
                scene.set_triangles(id, common::triangles_of(&bounds)).unwrap();
                id
            })
            .collect();
        scene.prepare_occluders(&visibility_core::occlusion::Preparation::default());
        let pose = visibility_core::Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
        let perspective = View::perspective(pose, 2.0, 1.5, 0.1 * scale, f64::INFINITY).unwrap();
        let window = visibility_core::view::Window::centered(20.0 * scale, 20.0 * scale);
        let parallel = View::orthographic(pose, window, 0.1 * scale, 50.0 * scale).unwrap();
        for view in [perspective, parallel] {
            for (name, mut culler) in cullers(&scene) {
                let mut visible = VisibleSet::new();
                visible.fill(&scene, &view);
                culler.cull(&scene, &view, &mut visible);
                let kept: Vec<bool> = ids.iter().map(|&id| visible.contains(&scene, id)).collect();
                // The front faces of the two slabs are joined into one polygon, or the shadows of their
                // meshes fuse.
                assert_eq!(kept, [true, true, false, false, true, true], "{name} at {scale:e}");
            }
        }
    }
}

#[test]
fn hostile_boxes_and_views_do_no_harm() {
    let mut random = Random(7);
    let soup = Soup::new(&mut random, 1.0, 60);
    let mut scene = soup.scene.clone();
    let odd = [f32::NAN, f32::INFINITY, -1e30, 1e30, 0.0, 1e-40];
    for i in 0..40 {
        let pick = |k: usize| odd[(i * 7 + k * 5) % odd.len()];
        let bounds = Aabb::new(Vec3::new(pick(0), pick(1), pick(2)), Vec3::new(pick(3), pick(4), pick(5)));
        let id =
            scene.insert(visibility_core::Object { occluder: true, ..visibility_core::Object::new(bounds) });
        scene.set_triangles(id, common::triangles_of(&bounds)).unwrap();
    }
    scene.prepare_occluders(&Default::default());
    for (_, mut culler) in cullers(&scene) {
        for _ in 0..20 {
            let view = soup.view(&mut random, 1.0);
            let mut visible = VisibleSet::new();
            visible.fill(&scene, &view);
            culler.cull(&scene, &view, &mut visible);
            for id in scene.ids().filter(|&id| !scene.bounds(id).unwrap().is_finite()) {
                assert!(visible.contains(&scene, id), "{}: {id} has no finite bounds", culler.name());
            }
        }
    }
}

/// The near plane cuts off one end of the ridge that two slopes share. A box behind the cut end must stay
/// visible, and one behind the rest be hidden, in both orientations of each slope's triangles.
#[test]
fn two_polygons_hide_nothing_where_the_near_plane_cuts_the_edge_that_they_share() {
    let mut hidden = 0;
    for turned in 0..4 {
        let mut scene = Scene::new();
        let ridge = [Vec3::new(0.0, 4.0, 0.0), Vec3::ZERO];
        for (side, bit) in [(4.0, 1), (-4.0, 2)] {
            let eaves = [Vec3::new(side, 0.0, -1.0), Vec3::new(side, 4.0, -1.0)];
            let [a, b, c, d] = [ridge[0], ridge[1], eaves[0], eaves[1]];
            let mut slope = [[a, b, c], [a, c, d]];
            if turned & bit != 0 {
                slope.iter_mut().for_each(|triangle| triangle.reverse());
            }
            let bounds = Aabb::from_points(slope.into_iter().flatten());
            let id = scene
                .insert(visibility_core::Object { occluder: true, ..visibility_core::Object::new(bounds) });
            scene.set_triangles(id, slope).unwrap();
        }
        scene.prepare_occluders(&visibility_core::occlusion::Preparation::default().with_two_sided(true));
        let small = |y: f32| Aabb::new(Vec3::new(-0.1, y - 0.05, -0.6), Vec3::new(0.1, y + 0.05, -0.5));
        let [behind_what_is_cut, behind] = [3.6, 1.0].map(|y| scene.insert(small(y)));
        // At the far end of the ridge the depth is 1.15, at the eaves there 0.2.
        let along = DVec3::new(0.0, -0.3, -1.0);
        let start = DVec3::ZERO + along.normalize() * (-0.7 / along.length());
        let pose = visibility_core::Pose::look_at(start, start + along, DVec3::X);
        let window = visibility_core::view::Window::centered(20.0, 20.0);
        let view = View::orthographic(pose, window, 0.0, 50.0).unwrap();
        for (name, mut culler) in cullers(&scene) {
            let mut visible = VisibleSet::new();
            visible.fill(&scene, &view);
            culler.cull(&scene, &view, &mut visible);
            assert!(visible.contains(&scene, behind_what_is_cut), "{name}, turned {turned}");
            hidden += usize::from(!visible.contains(&scene, behind));
        }
    }
    assert!(hidden >= 12, "{hidden}: too easy");
}
