//! How much the hierarchical z-buffer leaves visible beyond what its own box test reports on an ideal map: the depth of all occluders at
//! 2560 x 1440, from the item buffer, each pixel of the map as far as its farthest part.
#![allow(missing_docs)]

use std::path::Path;
use std::sync::Arc;
use visibility_core::glam::{Affine3A, DMat4, DVec3, Vec3};
use visibility_core::measure::ItemBuffer;
use visibility_core::{
    Aabb, Accuracy, Culler, FrustumCuller, OccluderMesh, Occlusion, OcclusionCuller, OcclusionMap, View,
    VisibleSet,
};
use visibility_examples::walkthrough::World;
use visibility_examples::{SceneSource, built_in, cars5, load};
use visibility_hzb::Hzb;

const FINE: [usize; 2] = [2560, 1440];

/// What is always looked at.
const QUICK: [(&str, f64); 3] = [("london", 1.1), ("town", 1.1), ("office", 1.1)];

type Occluders = Arc<Vec<Vec<[Vec3; 3]>>>;

/// The ideal map of a view; perspective only.
struct Ideal {
    occluders: Occluders,
    buffer: ItemBuffer,
    size: [usize; 2],
    nearness: Vec<f64>,
    matrix: DMat4,
}

impl Ideal {
    fn new(occluders: Occluders, size: [usize; 2]) -> Self {
        let buffer = ItemBuffer::new(FINE[0] as u32, FINE[1] as u32).unwrap();
        Self { occluders, buffer, size, nearness: Vec::new(), matrix: DMat4::IDENTITY }
    }
}

impl OcclusionMap for Ideal {
    fn name(&self) -> &str {
        "ideal"
    }
    fn accuracy(&self) -> Accuracy {
        Accuracy::Approximate
    }
    fn begin(&mut self, view: &View, origin: DVec3) {
        let items = self.occluders.iter().map(|triangles| (0, triangles.as_slice()));
        self.buffer.draw(view, origin, items).unwrap();
        self.matrix = view.clip_from(origin);
        self.nearness = vec![f64::INFINITY; self.size[0] * self.size[1]];
        for (i, &nearness) in self.buffer.nearness().iter().enumerate() {
            let (x, y) = (i % FINE[0] * self.size[0] / FINE[0], i / FINE[0] * self.size[1] / FINE[1]);
            let least = &mut self.nearness[y * self.size[0] + x];
            *least = least.min(nearness);
        }
    }
    fn add(&mut self, _: &OccluderMesh, _: &Affine3A) {}
    fn flush(&mut self) {}
    fn test(&self, bounds: &Aabb) -> Occlusion {
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        let mut nearest: f64 = 0.0;
        for corner in bounds.corners() {
            let p = self.matrix * corner.as_dvec3().extend(1.0);
            if p.w <= 0.0 {
                return Occlusion::Partial;
            }
            let at = [(p.x / p.w + 1.0) * 0.5, (1.0 - p.y / p.w) * 0.5];
            for axis in 0..2 {
                low[axis] = low[axis].min(at[axis] * self.size[axis] as f64);
                high[axis] = high[axis].max(at[axis] * self.size[axis] as f64);
            }
            nearest = nearest.max(1.0 / p.w);
        }
        let range = |axis: usize| {
            let first = low[axis].max(0.0) as usize;
            first..(high[axis].max(0.0) as usize + 1).min(self.size[axis])
        };
        let hides = |x: usize, y: usize| self.nearness[y * self.size[0] + x] > nearest;
        if range(1).all(|y| range(0).all(|x| hides(x, y))) { Occlusion::Hidden } else { Occlusion::Partial }
    }
}

fn count(culler: &mut dyn Culler, world: &World) -> usize {
    let mut visible = VisibleSet::new();
    let mut frustum = FrustumCuller::new();
    let mut sum = 0;
    for view in &world.views {
        visible.fill(&world.scene, view);
        frustum.cull(&world.scene, view, &mut visible);
        culler.cull(&world.scene, view, &mut visible);
        sum += visible.iter(&world.scene).count();
    }
    sum
}

/// Checks a scene at some frames; `limits` are the greatest ratios that are put up with, for each of the sizes.
fn check(source: SceneSource, frames: usize, limits: &[f64]) {
    let world = World::new(source, (FINE[0] as u32, FINE[1] as u32), Some(frames)).unwrap();
    let opaque = world.source.objects.iter().filter(|object| object.opaque);
    let occluders: Occluders = Arc::new(opaque.map(|object| object.triangles.clone()).collect());
    for (size, &limit) in [[320, 180], [640, 360]].into_iter().zip(limits) {
        let ideal = count(&mut OcclusionCuller::new(Ideal::new(occluders.clone(), size)), &world);
        let all = OcclusionCuller::new(Hzb::new(size[0], size[1]).unwrap().with_fusion(true));
        let [all, budget] =
            [10_000_000, 8192].map(|budget| count(&mut all.clone().with_budget(budget), &world));
        let ratio = |found: usize| found as f64 / ideal as f64;
        println!(
            "{} {}x{}: ideal {ideal}, all occluders {:.3}, 8192 triangles of them {:.3}",
            world.source.name,
            size[0],
            size[1],
            ratio(all),
            ratio(budget)
        );
        assert!(ratio(all) <= limit, "{} at {size:?}: {all} against {ideal}", world.source.name);
    }
}

#[test]
fn little_more_is_visible_than_on_an_ideal_map() {
    for (name, limit) in QUICK {
        check(built_in(name).unwrap(), 2, &[limit]);
    }
}

#[test]
#[ignore = "takes minutes; prints what it measures"]
fn little_more_is_visible_than_on_an_ideal_map_in_built_in_scenes() {
    let scenes = [
        ("london", [1.05, 1.05]),
        ("plpcity", [1.25, 1.25]),
        ("town", [1.05, 1.05]),
        ("forest", [1.05, 1.05]),
        ("office", [1.1, 1.1]),
    ];
    for (name, limits) in scenes {
        check(built_in(name).unwrap(), 6, &limits);
    }
}

#[test]
#[ignore = "takes minutes; prints what it measures"]
fn little_more_is_visible_than_on_an_ideal_map_in_reference_scenes() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/scenes");
    if !folder.is_dir() {
        println!("skipped: the reference scenes are not at {}", folder.display());
        return;
    }
    for (name, limits) in [("denhaag", [1.1, 1.1]), ("alpine1", [1.15, 1.15]), ("oa_dm2", [1.1, 1.1])] {
        check(load(&folder.join(format!("{name}.vscn"))).unwrap(), 6, &limits);
    }
    let mut clinic = load(&folder.join("clinic.vscn")).unwrap();
    clinic.objects.extend(load(&folder.join("clinic_mep.vscn")).unwrap().objects);
    check(clinic, 6, &[1.1, 1.05]);
    check(cars5(&folder.join("car.vscn")).unwrap(), 6, &[1.25, 1.2]);
}
