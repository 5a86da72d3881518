//! Tests of a walk through a single flat cell.

use super::state::CellState;
use super::{Budget, FrameContext, PlpSettings, Projected, Walk};
use crate::cell_frustum::CellFrustum;
use crate::content::Content;
use crate::tessellation::{Face, Tessellation};
use alloc::vec::Vec;
use visibility_core::glam::{DAffine3, DVec3, Vec3};
use visibility_core::scene::SharedTriangles;
use visibility_core::{Aabb, Object, ObjectId, Pose, Scene, View, VisibleSet};

/// One cell without thickness, which holds all objects.
struct Sheet {
    content: Content,
    bounds: Aabb,
}

impl Tessellation for Sheet {
    fn content(&self) -> &Content {
        &self.content
    }
    fn bounds(&self) -> Aabb {
        self.bounds
    }
    fn locate(&self, _: DVec3) -> Option<u32> {
        None
    }
    fn cell_bounds(&self, _: u32) -> Aabb {
        self.bounds
    }
    fn center(&self, _: u32) -> DVec3 {
        self.bounds.center().as_dvec3()
    }
    fn projected_area(&self, _: u32, _: DVec3) -> f64 {
        1.0
    }
    fn for_each_face(&self, _: u32, _: &dyn Fn(u32) -> bool, _: &mut dyn FnMut(&Face)) {}
    fn contains(&self, _: u32, _: DVec3) -> bool {
        false
    }
    fn boundary(&self) -> &[u32] {
        &[0]
    }
}

/// Returns a cell of 12 triangles in one plane that face along z, of objects that cost 5 each. `thickness`
/// scales the mesh along z.
fn sheet(scene: &mut Scene, thickness: f64) -> Sheet {
    for i in 0..12u8 {
        let corner = Vec3::new(f32::from(i % 4) * 0.1, f32::from(i / 4) * 0.1, 0.0);
        let t = [corner, corner + Vec3::X * 0.1, corner + Vec3::Y * 0.1];
        let id = scene.insert(Object { cost: 5, ..Object::new(Aabb::from_points(t)) });
        let placed = DAffine3::from_scale(DVec3::new(1.0, 1.0, thickness));
        scene.set_triangles(id, SharedTriangles::from([t]).placed(placed)).unwrap();
    }
    let pairs: Vec<_> = (0..12).map(|object| (0, object)).collect();
    let content = Content::new(scene, &pairs, alloc::vec![[0; 4]]);
    Sheet { content, bounds: Aabb::from_arrays([0.0; 3], [0.5, 0.5, 0.0]) }
}

/// Returns how many objects a walk keeps, of those that `keep` agrees to, from an eye `below` metres behind
/// the triangles, whose error is a metre.
fn kept(
    below: f64,
    scene: &Scene,
    cell: &Sheet,
    settings: PlpSettings,
    mut keep: impl FnMut(ObjectId, f32) -> bool,
) -> usize {
    let eye = DVec3::new(0.2, 0.2, -below);
    let pose = Pose::look_at(eye, eye + DVec3::Z, DVec3::X);
    let view = View::perspective(pose, 2.0, 1.0, 0.01, 9.0).unwrap();
    let mut frustum = CellFrustum::new(&view, DVec3::ZERO, &cell.bounds);
    frustum.eye_error = 1.0;
    let mut visible = VisibleSet::new();
    visible.fill(scene, &view);
    let frame = FrameContext { tessellation: cell, scene, visible: &visible, frustum, settings };
    let mut walk = Walk::default();
    assert!(walk.begin(&frame, &mut keep), "the cell is of this scene");
    while let Some(cell) = walk.next() {
        if walk.step(&frame, cell, &mut keep) == Projected::OutOfBudget {
            return walk.order.len();
        }
    }
    walk.emit(&frame, 0.0, &mut keep);
    walk.order.len()
}

/// Returns how many objects a walk keeps that is one-sided and without a budget, as [`kept`] does.
fn kept_from(below: f64, scene: &Scene, cell: &Sheet) -> usize {
    let settings = PlpSettings { one_sided: true, ..PlpSettings::new(Budget::Objects(usize::MAX)) };
    kept(below, scene, cell, settings, |_, _| true)
}

/// An eye that is off by more than half of the near distance, or infinitely far away, may be in another cell:
/// nothing is known of what it sees.
#[test]
fn walks_do_not_begin_in_the_cell_of_an_uncertain_eye() {
    let mut scene = Scene::new();
    let cell = sheet(&mut scene, 1.0);
    let begins = |away: f64| {
        let eye = DVec3::new(0.2, 0.2, -away);
        let pose = Pose::look_at(eye, eye + DVec3::Z * away, DVec3::X);
        let view = View::perspective(pose, 2.0, 1.0, 0.01, f64::INFINITY).unwrap();
        let frustum = CellFrustum::new(&view, DVec3::ZERO, &cell.bounds);
        let error = frustum.eye_error;
        let mut visible = VisibleSet::new();
        visible.fill(&scene, &view);
        let settings = PlpSettings::new(Budget::Objects(usize::MAX));
        let frame = FrameContext { tessellation: &cell, scene: &scene, visible: &visible, frustum, settings };
        (Walk::default().begin(&frame, &mut |_, _| true), error)
    };
    let found = [1.0, 1e11, 1e15, 1e200].map(begins);
    assert_eq!(found.map(|(begins, _)| begins), [true, true, false, false], "{found:?}");
}

/// Backs are kept while the eye may be in front of them, though bins of normals and sides of the cell are
/// asked before the triangles are.
#[test]
fn backs_are_kept_within_the_error_of_the_eye() {
    let mut scene = Scene::new();
    let cell = sheet(&mut scene, 1.0);
    assert_eq!([0.9, 1.1].map(|below| kept_from(below, &scene, &cell)), [12, 0], "objects kept");
}

/// A transform that flattens leaves open which side is the front: no side is a back.
#[test]
fn sides_of_flattened_triangles_are_no_backs() {
    let mut scene = Scene::new();
    let cell = sheet(&mut scene, 0.0);
    assert_eq!([0.9, 1.1].map(|below| kept_from(below, &scene, &cell)), [12, 12], "objects kept");
}

/// An object that has changed before and after the cells were brought up to date is kept once.
#[test]
fn objects_that_change_twice_are_kept_once() {
    let mut scene = Scene::new();
    let mut cell = sheet(&mut scene, 1.0);
    let id = scene.id_at(5).unwrap();
    for size in [0.7, 0.8] {
        cell.content.sync(&scene);
        scene.set_bounds(id, Aabb::from_arrays([0.0; 3], [size, size, 0.0])).unwrap();
    }
    assert_eq!(kept_from(1.1, &scene, &cell), 1, "objects kept");
}

/// The budget is spent to its end, and objects beyond it are not kept: none of a budget of 0, one of any cost
/// of a budget by cost.
#[test]
fn budgets_are_spent_to_their_end() {
    let mut scene = Scene::new();
    let cell = sheet(&mut scene, 1.0);
    let kept = |budget: Budget, agrees: usize| {
        let mut asked = 0;
        kept(1.1, &scene, &cell, PlpSettings::new(budget), |_, _| {
            asked += 1;
            asked <= agrees
        })
    };
    let objects = [0, 1, 3, 12, 99].map(|count| kept(Budget::Objects(count), 99));
    assert_eq!(objects, [0, 1, 3, 12, 12], "by number, of triangles that are seen from behind");
    let costs = [0, 3, 5, 9, 10, 12].map(|cost| kept(Budget::Cost(cost), 99));
    assert_eq!(costs, [0, 1, 1, 1, 2, 2], "by cost, of objects that cost 5");
    assert_eq!([0, 4].map(|agrees| kept(Budget::Objects(12), agrees)), [0, 4], "as many as are agreed to");
}

/// An object that has the index of one that was removed is kept, although the log names both.
#[test]
fn an_object_in_the_place_of_one_that_was_removed_is_kept() {
    let mut scene = Scene::new();
    let cell = sheet(&mut scene, 1.0);
    let removed = scene.id_at(5).unwrap();
    scene.remove(removed).unwrap();
    let id = scene.insert(Aabb::from_arrays([0.0; 3], [0.5, 0.5, 0.0]));
    assert_eq!(id.index(), removed.index(), "the index is used again");
    assert_eq!(kept_from(1.1, &scene, &cell), 1, "objects kept");
}

/// A cell of the front is done once its neighbours are in the front and no objects are left.
#[test]
fn cells_with_something_left_to_do_come_out_of_the_front() {
    for (is_closed, end_side, expected) in
        [(false, 0, Some(0)), (false, 1, Some(0)), (true, 1, Some(0)), (true, 0, None)]
    {
        let mut walk = Walk::default();
        walk.cells.push(CellState { end_side, ..CellState::UNKNOWN });
        walk.closed.reset(1);
        if is_closed {
            walk.closed.insert(0);
        }
        walk.front.reserve(1);
        walk.front.push(0.5, 0);
        assert_eq!(walk.next(), expected, "neighbours in the front: {is_closed}, sides left: {end_side}");
    }
}
