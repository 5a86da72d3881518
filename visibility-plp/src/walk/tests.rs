//! Tests of a walk through a single flat cell.

use super::{Budget, FrameContext, PlpSettings, Walk};
use crate::cell_frustum::CellFrustum;
use crate::content::Content;
use crate::tessellation::{Face, Tessellation};
use alloc::vec::Vec;
use visibility_core::glam::{DVec3, Vec3};
use visibility_core::{Aabb, Object, Pose, Scene, View, VisibleSet};

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

/// Triangles in one plane, with their backs to an eye whose error is a metre: they are kept while the eye may
/// be in front of them, though bins of normals and sides of the cell are asked before the triangles are.
#[test]
fn backs_are_kept_within_the_error_of_the_eye() {
    let mut scene = Scene::new();
    for i in 0..12u8 {
        let corner = Vec3::new(f32::from(i % 4) * 0.1, f32::from(i / 4) * 0.1, 0.0);
        let t = [corner, corner + Vec3::X * 0.1, corner + Vec3::Y * 0.1];
        let id = scene.insert(Object::new(Aabb::from_points(t)));
        scene.set_triangles(id, [t]).unwrap();
    }
    let pairs: Vec<_> = (0..12).map(|object| (0, object)).collect();
    let content = Content::new(&scene, &pairs, alloc::vec![[0; 4]]);
    let cell = Sheet { content, bounds: Aabb::from_arrays([0.0; 3], [0.5, 0.5, 0.0]) };
    for (below, expected) in [(0.9, 12), (1.1, 0)] {
        let eye = DVec3::new(0.2, 0.2, -below);
        let view = View::perspective(Pose::look_at(eye, eye + DVec3::Z, DVec3::X), 2.0, 1.0, 0.01, 9.0);
        let view = view.unwrap();
        let mut frustum = CellFrustum::new(&view, DVec3::ZERO, &cell.bounds);
        frustum.eye_error = 1.0;
        let mut visible = VisibleSet::new();
        visible.fill(&scene, &view);
        let settings = PlpSettings { one_sided: true, ..PlpSettings::new(Budget::Objects(usize::MAX)) };
        let frame = FrameContext { tessellation: &cell, scene: &scene, visible: &visible, frustum, settings };
        let (mut walk, keep) = (Walk::default(), &mut |_, _| true);
        assert!(walk.begin(&frame, keep), "the cell is of this scene");
        while let Some(cell) = walk.next() {
            walk.step(&frame, cell, keep);
        }
        walk.emit(&frame, 0.0, keep);
        assert_eq!(walk.order.len(), expected, "objects kept from {below} m behind them");
    }
}
