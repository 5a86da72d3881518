//! Reference results for the web module: the native library, without the C interface, on the same scenes.
//!
//! `native answers` prints a line for each scene, pipeline and frame of the scene's walks: the number of
//! visible objects and the FNV-1a hash of their indices, ascending. `native times` prints microseconds per
//! frame. `tests/answers.js` and `tests/times.js` do the same in JavaScript.

use glam::DVec3;
use std::sync::Arc;
use std::time::Instant;
use visibility_core::bake::Bake;
use visibility_core::cells::CellId;
use visibility_core::geometry::ConvexPolygon;
use visibility_core::occlusion::Preparation;
use visibility_core::pvs::{PvsCuller, ScenePvs, Viewcell};
use visibility_core::scene::DrawRange;
use visibility_core::{
    Aabb, Culler, FrustumCuller, Object, ObjectId, Pipeline, Pose, Scene, View, VisibleSet,
};
use visibility_frame::draw_list::DrawList;
use visibility_frame::lod::{ContributionCuller, Lod, LodSelector};
use visibility_hzb::{Hzb, HzbCuller};
use visibility_measure::{Comparison, ItemBuffer};
use visibility_portals::{BakerSettings, CellBaker, PortalCuller, PortalEye, Reflection, SceneCells};
use visibility_region::OnlinePvs;
use visibility_web_scenes::{SceneSource, built_in};

/// Width over height of all pictures.
const ASPECT: f64 = 16.0 / 9.0;
/// Interval of the frames judged by an item buffer of 256 x 144 pixels.
const JUDGED_EVERY: usize = 20;
/// Interval of the keys of walks that are frames of online sets.
const ONLINE_EVERY: usize = 8;
/// Interval of the frames of online sets before which an object stops hiding others.
const OPENED_EVERY: usize = 6;
/// Interval of the cells that have a mirror on their side of least x.
const MIRRORED_EVERY: usize = 3;
/// Sizes in pixels that divide the levels of objects, by index modulo 3. The last have one level.
const LOD_SIZES: [&[f32]; 3] = [&[400.0, 90.0, 30.0], &[150.0], &[]];
/// Height in pixels of the pictures that levels of detail are for, and least size of what is drawn.
const PICTURE_HEIGHT: f64 = 1080.0;
const LEAST_PIXELS: f64 = 4.0;
/// Interval of the objects that fade by their draw range, and this range.
const RANGED_EVERY: usize = 5;
const RANGE: DrawRange = DrawRange { begin: 1.0, end: 60.0, margin: 20.0 };
/// Number of keys of draw lists, which are 4 apart, beyond the levels of one mesh.
const KEYS: usize = 7;
/// Budget of each step of online sets. It does not end a sweep in these scenes.
const STEP_MICROSECONDS: u32 = 100_000;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    match std::env::args().nth(1).as_deref() {
        Some("answers") => ["plpcity:2,2", "office:2,16", "london:12,12"].into_iter().try_for_each(answers),
        Some("times") => times("london:28,28"),
        _ => Err("say `answers` or `times`".into()),
    }
}

/// Fills a scene in the way that an engine does through the C interface.
fn fill(source: &SceneSource) -> Result<Scene, Box<dyn std::error::Error>> {
    let mut scene = Scene::new();
    let ids = scene.insert_batch(source.objects.iter().map(|object| Object {
        cost: object.triangles.len() as u32,
        occluder: true,
        ..Object::new(Aabb::from_points(object.triangles.iter().flatten()))
    }));
    for (id, object) in ids.into_iter().zip(&source.objects) {
        scene.set_triangles(id, object.triangles.clone())?;
    }
    scene.prepare_occluders(&Preparation::default());
    Ok(scene)
}

/// Returns the views at all keys of all walks.
fn views(source: &SceneSource) -> Result<Vec<View>, Box<dyn std::error::Error>> {
    let mut views = Vec::new();
    for walk in &source.walks {
        for key in &walk.keys {
            let pose = Pose::look_at(key.eye, key.target, DVec3::Z);
            let fov_y = f64::from(walk.fov_y_degrees).to_radians();
            views.push(View::perspective(pose, fov_y, ASPECT, f64::from(source.near), f64::INFINITY)?);
        }
    }
    Ok(views)
}

/// Makes the pipelines for a scene, each with its name.
fn pipelines(
    source: &SceneSource,
    scene: &Scene,
) -> Result<Vec<(&'static str, Pipeline)>, Box<dyn std::error::Error>> {
    let frustum = || Pipeline::new().with(FrustumCuller::new());
    let mut pipelines =
        vec![("frustum", frustum()), ("z-buffer", frustum().with(HzbCuller::new(Hzb::default())))];
    if let Some(cells) = &source.cells {
        let cells = cells.with_doorways.as_deref().unwrap_or(cells);
        let tolerance = SceneCells::usual_tolerance(&cells.viewcells);
        let pvs = Bake::new(CellBaker::new(&cells.graph, BakerSettings::default())?).run().matrix;
        let touching = |id| {
            let bounds = scene.bounds(id).unwrap_or(Aabb::EMPTY);
            let [min, max] = [bounds.min, bounds.max].map(|corner| corner.as_dvec3());
            let touches = move |cell: &Viewcell| {
                (cell.min - tolerance).cmple(max).all() && min.cmple(cell.max + tolerance).all()
            };
            let of = (0..).zip(cells.viewcells.cells()).filter(move |(_, cell)| touches(cell));
            of.map(move |(cell, _)| (id, cell))
        };
        let pairs = scene.ids().flat_map(touching);
        let baked = ScenePvs::new(scene, pvs.to_pvs(&cells.graph)?, cells.viewcells.clone(), pairs);
        let cells = SceneCells::new(cells.graph.clone(), cells.viewcells.clone(), tolerance)?;
        pipelines.push(("portals", frustum().with(PortalCuller::new(cells))));
        pipelines.push(("baked", frustum().with(PvsCuller::new(Arc::new(baked)))));
    }
    Ok(pipelines)
}

fn hash(numbers: impl IntoIterator<Item = u32>) -> u32 {
    numbers
        .into_iter()
        .flat_map(u32::to_le_bytes)
        .fold(0x811c_9dc5, |hash, byte| (hash ^ u32::from(byte)).wrapping_mul(0x0100_0193))
}

fn answers(name: &str) -> Result<(), Box<dyn std::error::Error>> {
    let source = built_in(name)?;
    let coordinates = source.objects.iter().flat_map(|object| object.triangles.iter().flatten());
    let bits = coordinates.flat_map(|p| p.to_array()).map(f32::to_bits);
    println!("{name} {} objects, triangles {:08x}", source.objects.len(), hash(bits));
    let (mut scene, views) = (fill(&source)?, views(&source)?);
    let mut judge = ItemBuffer::new(256, 144)?;
    for (label, mut pipeline) in pipelines(&source, &scene)? {
        for (frame, view) in views.iter().enumerate() {
            let mut visible = VisibleSet::new();
            pipeline.cull(&scene, view, &mut visible);
            let line = line(&source, &scene, view, (frame, &mut judge), &mut visible)?;
            println!("{name} {label} {frame} {line}");
        }
    }
    let (mut pipeline, mut online) = (Pipeline::new().with(FrustumCuller::new()), online());
    let walk: Vec<&View> = views.iter().step_by(ONLINE_EVERY).collect();
    for (frame, &view) in walk.iter().enumerate() {
        if frame % OPENED_EVERY == 0 {
            let door = scene.id_at(frame * 7 % scene.len()).ok_or("an object")?;
            scene.set_occluder(door, false)?;
        }
        let ahead: Vec<DVec3> = walk[frame..].iter().take(2).map(|view| view.origin()).collect();
        // A viewcell and its wide box need 12 to 24 steps: some frames come too early.
        for _ in 0..frame * 13 % 40 {
            online.step(&scene, &ahead, STEP_MICROSECONDS);
        }
        let mut visible = VisibleSet::new();
        pipeline.cull(&scene, view, &mut visible);
        online.cull(&scene, view, &mut visible);
        let answer = match online.answer() {
            None => "none",
            Some(_) if online.is_ready() => "viewcell",
            Some(_) => "wide",
        };
        let came = hash(online.came().iter().map(|id| id.index() as u32));
        let line = line(&source, &scene, view, (frame, &mut judge), &mut visible)?;
        println!("{name} online {frame} {answer} {came:08x} {line}");
    }
    mirrored(name, &source, &scene, &views)?;
    drawn(name, &mut scene, &views)
}

/// Prints a line for each frame of reflections, in a scene with cells: how many there are and how many are
/// left out, hashes of their mirrors, parents and depths, of their matrices, and of the objects in them, in
/// their order.
fn mirrored(
    name: &str,
    source: &SceneSource,
    scene: &Scene,
    views: &[View],
) -> Result<(), Box<dyn std::error::Error>> {
    let Some(cells) = &source.cells else { return Ok(()) };
    let cells = cells.with_doorways.as_deref().unwrap_or(cells);
    let boxes = cells.viewcells.cells();
    let tolerance = SceneCells::usual_tolerance(&cells.viewcells);
    let mut own = SceneCells::new(cells.graph.clone(), cells.viewcells.clone(), tolerance)?;
    for (cell, &Viewcell { min, max, .. }) in (0..).zip(boxes).step_by(MIRRORED_EVERY) {
        let corners = [[min.y, min.z], [max.y, min.z], [max.y, max.z], [min.y, max.z]];
        let glass = ConvexPolygon::new(corners.map(|[y, z]| DVec3::new(min.x, y, z)))?;
        own.add_mirror(CellId(cell), &glass)?;
    }
    own.sync(scene);
    let (mut eye, mut visible) = (PortalEye::new(), VisibleSet::new());
    for (frame, view) in views.iter().enumerate() {
        visible.fill(scene, view);
        FrustumCuller::new().cull(scene, view, &mut visible);
        eye.cull(&own, scene, view, &mut visible);
        let all = eye.reflections();
        let parent = |parent: Option<usize>| parent.map_or(u32::MAX, |parent| parent as u32);
        let list = hash(all.iter().flat_map(|one| [one.mirror().0, parent(one.parent()), one.depth()]));
        let numbers = |one: &Reflection| one.view().clip_from(DVec3::ZERO).to_cols_array().map(|x| x as f32);
        let matrices = hash(all.iter().flat_map(numbers).map(f32::to_bits));
        let objects = hash(all.iter().flat_map(|one| one.visible().iter(scene)).map(|id| id.index() as u32));
        let (count, left_out) = (all.len(), eye.stats().reflections_left_out);
        println!("{name} mirrors {frame} {count} {left_out} {list:08x} {matrices:08x} {objects:08x}");
    }
    Ok(())
}

/// Prints a line for each frame of levels of detail and draw lists: how many objects have a level, hashes of
/// the levels, of the fades and of the opacities, and hashes of the groups and instances of the list by mesh
/// and level, and of the instances that fade out.
fn drawn(name: &str, scene: &mut Scene, views: &[View]) -> Result<(), Box<dyn std::error::Error>> {
    for index in (0..scene.len()).step_by(RANGED_EVERY) {
        let id = scene.id_at(index).ok_or("an object")?;
        scene.set_draw_range(id, RANGE)?;
    }
    let contribution = ContributionCuller::new(PICTURE_HEIGHT, LEAST_PIXELS);
    let mut pipeline = Pipeline::new().with(FrustumCuller::new()).with(contribution);
    let (mut visible, mut lods) = (VisibleSet::new(), LodSelector::new(PICTURE_HEIGHT));
    let (mut list, mut fading) = (DrawList::new(), DrawList::new());
    for (frame, view) in views.iter().enumerate() {
        pipeline.cull(scene, view, &mut visible);
        lods.select(scene, view, &visible, 0.05, |id| LOD_SIZES[id.index() % LOD_SIZES.len()]);
        let key = |id: ObjectId, level: u8| (id.index() % KEYS * 4) as u32 + u32::from(level);
        list.group(visible.iter(scene), |id| key(id, lods.lod(id).map_or(0, |lod| lod.level)));
        let in_fade = lods.selected().iter().filter(|(_, lod)| lod.fade < 1.0).map(|&(id, _)| id);
        fading.group(in_fade, |id| key(id, lods.lod(id).map_or(0, |lod| lod.previous)));
        let column = |of: fn(&Lod) -> u32| hash(lods.selected().iter().map(|(_, lod)| of(lod)));
        let [levels, fades, opacities] =
            [|lod: &Lod| lod.level.into(), |lod: &Lod| lod.fade.to_bits(), |lod: &Lod| lod.opacity.to_bits()]
                .map(column);
        let groups = hash(list.groups().iter().flat_map(|group| [group.key, group.first, group.count]));
        let [instances, out] = [&list, &fading].map(|list| hash(list.instances().iter().copied()));
        let count = lods.selected().len();
        println!(
            "{name} drawn {frame} {count} {levels:08x} {fades:08x} {opacities:08x} {groups:08x} {instances:08x} {out:08x}"
        );
    }
    Ok(())
}

/// Returns empty sets with the settings that `tests/answers.js` uses.
fn online() -> OnlinePvs {
    OnlinePvs::new(DVec3::splat(0.8), DVec3::new(4.0, 4.0, 1.2)).unwrap().with_margin(0.25)
}

/// Returns what is printed of a frame: the number of visible objects, the hash of their indices, ascending,
/// and, for some frames, what the judge finds.
fn line(
    source: &SceneSource,
    scene: &Scene,
    view: &View,
    (frame, judge): (usize, &mut ItemBuffer),
    visible: &mut VisibleSet,
) -> Result<String, Box<dyn std::error::Error>> {
    visible.sort_by_index(scene);
    let found = hash(visible.iter(scene).map(|id| id.index() as u32));
    let line = format!("{} {found:08x}", visible.count(scene));
    if frame % JUDGED_EVERY != 0 {
        return Ok(line);
    }
    let drawn = (0..).zip(source.objects.iter().map(|object| object.triangles.view()));
    let mut comparison = Comparison::default();
    let reported = |_, key: u32| scene.id_at(key as usize).is_some_and(|id| visible.contains(scene, id));
    judge.draw(view, scene.origin(), drawn)?.compare(reported, &mut comparison);
    let Comparison { false_hidden_objects, false_visible_objects, wrong_pixels, .. } = comparison;
    Ok(format!("{line} {false_hidden_objects} {false_visible_objects} {wrong_pixels}"))
}

fn times(name: &str) -> Result<(), Box<dyn std::error::Error>> {
    let source = built_in(name)?;
    let (scene, views) = (fill(&source)?, views(&source)?);
    let mut visible = VisibleSet::new();
    for (label, mut pipeline) in pipelines(&source, &scene)? {
        // Takes the least time of many rounds, since other programs use the machine too.
        let mut least = f64::INFINITY;
        let begin = Instant::now();
        while begin.elapsed().as_secs_f64() < 3.0 {
            let start = Instant::now();
            views.iter().for_each(|view| {
                pipeline.cull(&scene, view, &mut visible);
            });
            least = least.min(start.elapsed().as_secs_f64());
        }
        println!("{label} {:.1}", least * 1e6 / views.len() as f64);
    }
    Ok(())
}
