//! Comparison of conservative prioritized-layered projection with testing every cell front to back, as in
//! table 1 of its paper (Klosowski and Silva, "Efficient Conservative Visibility Culling Using the
//! Prioritized-Layered Projection Algorithm", 2001, section 5).

use crate::walkthrough::World;
use std::sync::Arc;
use visibility_core::{
    Culler, FrustumCuller, ObjectId, OcclusionMap, Scene, View, VisibleSet, geometry::Containment,
    occlusion::Occlusion, view::Eye,
};
use visibility_hzb::Hzb;
use visibility_plp::{Budget, ConservativePlpCuller, OctreeTessellation, Tessellation};

/// Work of one method per frame, averaged over the frames.
#[derive(Clone, Debug, Default)]
pub struct Effort {
    /// Name of the method, as the table shows it.
    pub name: String,
    /// Mean number per frame of triangles of the objects that the method reports.
    pub triangles: f64,
    /// Mean number per frame of cells tested against the occlusion map.
    pub tests: f64,
    /// Mean number per frame of cells tested and found not hidden.
    pub visible: f64,
}

/// Measures the method that visits every cell in the view frustum front to back, by the distance of the
/// cell's centre. A cell is tested against the map of everything drawn before, and its occluders are drawn
/// unless it is hidden (Meissner, Bartz, Huttner, Muller and Einighammer, "Generation of Subdivision
/// Hierarchies for Efficient Occlusion Culling of Large Polygonal Models", 1999, with the test of the HP fx
/// graphics cards). Cells that are not entirely beyond the near plane are not tested and count as visible.
pub fn front_to_back(world: &World, cells: &OctreeTessellation, map: &mut Hzb) -> Effort {
    let mut sum = Effort { name: "front to back".to_owned(), ..Effort::default() };
    let mut candidates = VisibleSet::new();
    for view in &world.views {
        candidates.fill(&world.scene, view);
        FrustumCuller::new().cull(&world.scene, view, &mut candidates);
        let (origin, planes) = (world.origin(), view.planes(world.origin()));
        map.begin(view, origin);
        map.flush();
        let near = planes.as_slice().get(4).map(|near| near.plane);
        let mut order: Vec<(f64, u32)> = (0..cells.content().cell_count() as u32)
            .filter(|&cell| {
                let bounds = cells.cell_bounds(cell);
                planes.as_slice().iter().all(|p| p.plane.classify_aabb(&bounds) != Containment::Outside)
            })
            .map(|cell| (distance(view, origin, cells.center(cell)), cell))
            .collect();
        order.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let mut taken = vec![false; world.scene.index_limit()];
        for (_, cell) in order {
            let bounds = cells.cell_bounds(cell);
            if near.is_none_or(|near| near.classify_aabb(&bounds) == Containment::Inside) {
                sum.tests += 1.0;
                if map.test(&bounds) == Occlusion::Hidden {
                    continue;
                }
                sum.visible += 1.0;
            }
            for object in cells.content().primitives(cell) {
                let Some(id) = world.scene.id_at(object as usize) else { continue };
                if !std::mem::replace(&mut taken[object as usize], true)
                    && candidates.contains(&world.scene, id)
                {
                    sum.triangles += cost(&world.scene, id);
                    if let Some((mesh, ref transform)) = world.scene.occluder(id) {
                        map.add(mesh, transform);
                    }
                }
            }
            map.flush();
        }
    }
    per_frame(sum, world)
}

/// Measures conservative prioritized-layered projection on all frames of a world. `budget` limits the
/// triangles that are projected in a frame before the first test against `map`.
pub fn conservative(world: &World, cells: &Arc<OctreeTessellation>, budget: u64, map: Hzb) -> Effort {
    let mut sum = Effort { name: format!("cPLP, {budget} triangles"), ..Effort::default() };
    let mut culler = ConservativePlpCuller::new(cells.clone(), Budget::Cost(budget), map);
    let mut visible = VisibleSet::new();
    for view in &world.views {
        visible.fill(&world.scene, view);
        FrustumCuller::new().cull(&world.scene, view, &mut visible);
        culler.cull(&world.scene, view, &mut visible);
        sum.triangles += visible.iter(&world.scene).map(|id| cost(&world.scene, id)).sum::<f64>();
        sum.tests += culler.stats().tests as f64;
        sum.visible += culler.stats().visible_cells as f64;
    }
    per_frame(sum, world)
}

/// Measures frustum culling alone on all frames of a world; it makes no tests against a map.
pub fn frustum(world: &World) -> Effort {
    let mut sum = Effort { name: "view frustum".to_owned(), ..Effort::default() };
    let mut visible = VisibleSet::new();
    for view in &world.views {
        visible.fill(&world.scene, view);
        FrustumCuller::new().cull(&world.scene, view, &mut visible);
        sum.triangles += visible.iter(&world.scene).map(|id| cost(&world.scene, id)).sum::<f64>();
    }
    per_frame(sum, world)
}

/// Divides the sums over all frames of a world by the number of its frames.
fn per_frame(sum: Effort, world: &World) -> Effort {
    let frames = world.views.len().max(1) as f64;
    Effort {
        triangles: sum.triangles / frames,
        tests: sum.tests / frames,
        visible: sum.visible / frames,
        ..sum
    }
}

/// Returns the number of triangles of an object, or 0 for an id that is not in the scene.
fn cost(scene: &Scene, id: ObjectId) -> f64 {
    scene.object(id).map_or(0.0, |object| f64::from(object.cost))
}

/// Returns a key that sorts points front to back: the squared distance from the eye, or the distance along
/// parallel view rays.
fn distance(view: &View, origin: glam::DVec3, center: glam::DVec3) -> f64 {
    match view.eye(origin) {
        Eye::Point(eye) => center.distance_squared(eye),
        Eye::Direction(along) => center.dot(along),
    }
}
