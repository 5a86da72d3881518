//! A sweep of the tiles around a viewcell from near to far, which opens only tiles that are not hidden.
//!
//! First the nearest objects are swept together with the bounds of all tiles farther away, which do not
//! occlude. Hidden objects and tiles are dropped. The remaining tiles are opened: the next sweep tests their
//! objects and the tiles below, by their bounds. In it, the nearest of the objects tested before occlude as
//! well, twice as many as in the sweep before. This is repeated until all remaining tiles are opened. An
//! object that a hidden object would occlude is also hidden behind other objects, so that nothing is lost by
//! dropping hidden ones. The cost depends on how much is visible, not on the size of the level.
//!
//! A group of viewcells is swept from the box around it. Such a box may see much more than its viewcells do,
//! for example if it extends across walls. If the occluders exceed a limit of weight, both halves of the
//! group are swept instead, and an object is left if one of these sweeps leaves it.
//!
//! Only the opened tiles affect which objects are left. If all of them are unchanged, so is the result:
//! [`Trace::replay`].

use crate::cell_groups;
use crate::level_error::LevelError;
use crate::tile_tree::{Tile, TileTree};
use crate::tiled_scene::TiledScene;
use std::collections::HashMap;
use visibility_core::binary_format::{FormatError, Reader, Writer};
use visibility_core::glam::DVec3;
use visibility_core::pvs::Viewcell;
use visibility_core::{Aabb, Object, ObjectId, Scene, VisibleSet};
use visibility_region::ExtendedProjectionCuller;

/// Greatest ratio of a tile's extent to its distance at which the first sweep tests the tile as a whole. A
/// tile with a greater ratio is replaced by its objects and the tiles below it, if there are tiles below.
/// Each further sweep halves this limit.
const COARSEST: f64 = 0.1;

/// The sweeps end once no tile is waiting and the waiting objects have at most this weight together
/// (triangles plus 4 per object). These objects count as visible.
const FEW: u64 = 4096;

/// A tile that a sweep has opened.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) struct Opened {
    /// Position, in the list of opened tiles, of the tile above. The root has its own position.
    parent: u32,
    /// Index of the tile among the children of the tile above, or [`WHOLE`].
    child: u32,
    /// Hash of the data that opening the tile reveals: its objects, and the bounds of the tiles below.
    hash: u64,
}

/// Record of a sweep: the tiles that it opened, and the objects that it did not hide.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub(crate) struct Trace {
    /// Opened tiles in the order of opening, the root first. If all tiles were swept at once, a single entry
    /// that stands for the whole tree, with the child index [`WHOLE`].
    opened: Vec<Opened>,
    /// Objects not found hidden, ascending. Each is `[tile, object]`: the position of the object's tile in
    /// `opened`, and the position of the object in the tile's own list. If all tiles were swept at once, the
    /// first number is 0, and the second is the position of the object in [`TileTree::order`]. The pair is
    /// called the *place* of the object.
    left: Vec<[u32; 2]>,
}

/// Value of [`Opened::child`] for an entry that stands for the whole tree. Its [`Opened::hash`] is the hash
/// of the tree.
const WHOLE: u32 = u32::MAX;

/// A candidate in a sweep from near to far: a tile that is not opened yet, or an object that does not occlude
/// yet.
#[derive(Clone, Copy)]
struct Waiting {
    what: What,
    bounds: Aabb,
    distance: f64,
}

#[derive(Clone, Copy)]
enum What {
    /// A tile: its number, the position in the list of opened tiles of the tile above, and its index among
    /// that tile's children.
    Tile { tile: u32, parent: u32, child: u32 },
    /// An object: its place as in [`Trace::left`], and its number.
    Object { place: [u32; 2], number: u32 },
}

/// Returns the objects that a sweep leaves, by ascending index. Once `stop` returns true, no further objects
/// are found hidden.
pub(crate) fn swept(
    sweep: &mut ExtendedProjectionCuller,
    scene: &Scene,
    cell: &Viewcell,
    stop: &dyn Fn() -> bool,
) -> Vec<ObjectId> {
    let mut visible = VisibleSet::new();
    sweep.cull_until(scene, cell, &mut visible, stop);
    ids_of(&visible, scene)
}

/// Returns the objects of a set by ascending index.
pub(crate) fn ids_of(visible: &VisibleSet, scene: &Scene) -> Vec<ObjectId> {
    let mut ids: Vec<ObjectId> = visible.iter(scene).collect();
    ids.sort_unstable_by_key(|id| id.index());
    ids
}

/// Returns the distance in metres between a box, relative to `origin`, and a viewcell in world space. 0 if
/// the two touch, or if the distance is infinite or NaN, as for an empty viewcell.
fn distance(bounds: &Aabb, cell: &Viewcell, origin: DVec3) -> f64 {
    let (min, max) = (cell.min - origin, cell.max - origin);
    let gap = (bounds.min.as_dvec3() - max).max(min - bounds.max.as_dvec3()).max(DVec3::ZERO).length();
    if gap.is_nan() || gap == f64::INFINITY { 0.0 } else { gap }
}

/// Sweeps the level from the box around the viewcells with the numbers `members`: from near to far, tile by
/// tile, with the culler `sweep`, or all tiles at once with the culler `whole`, which is created if it is
/// `None`. Once `stop` returns true, no further objects are found hidden, and all objects of unopened tiles
/// count as not hidden.
///
/// Without `stop`, a group whose sweep has too many occluders is halved, and both halves are swept. With
/// `stop`, it is not halved, since all results for the group would be lost if the time ended before the last
/// part is swept. If the memory suffices, all tiles are then swept at once: sweeps from near to far save time
/// only where most tiles are hidden early.
pub(crate) fn sweep_near_to_far(
    level: &TiledScene<'_>,
    all: &[Viewcell],
    members: &[u32],
    sweep: &mut ExtendedProjectionCuller,
    whole: &mut Option<ExtendedProjectionCuller>,
    stop: Option<&dyn Fn() -> bool>,
) -> Result<Trace, LevelError> {
    let is_divided = stop.is_none();
    let stop = stop.unwrap_or(&|| false);
    if level.tree.tiles[0].children.is_empty() || !is_divided && level.may_be_copied() {
        let prepared = level.whole()?;
        let cell = cell_groups::bounds(all, members);
        let ids = swept(whole.get_or_insert_with(|| prepared.sweep.clone()), &prepared.scene, &cell, stop);
        return Ok(Trace::of_whole(&level.tree, ids.iter().map(|id| id.index() as u32)));
    }
    let (mut trace, mut places) = (Trace::default(), HashMap::new());
    let mut parts = vec![members.to_vec()];
    while let Some(part) = parts.pop() {
        let cell = &cell_groups::bounds(all, &part);
        let most = if is_divided && part.len() > 1 { level.most_weight } else { u64::MAX };
        let (occluding, waiting) = Default::default();
        let mut around =
            Around { level, cell, trace: &mut trace, places: &mut places, occluding, waiting, stop };
        if around.sweep_all(sweep, most)? {
            let left = around.left();
            trace.left.extend(left);
        } else {
            parts.extend(cell_groups::halves(all, part));
        }
    }
    trace.left.sort_unstable();
    trace.left.dedup();
    Ok(trace)
}

/// State of a sweep from near to far: the tiles and objects around the viewcells of a group or of a part of
/// it.
struct Around<'a> {
    level: &'a TiledScene<'a>,
    cell: &'a Viewcell,
    /// Record of the opened tiles, shared by the sweeps from all parts of the group.
    trace: &'a mut Trace,
    /// For each opened tile, by its number, its position in the record.
    places: &'a mut HashMap<u32, u32>,
    /// The [place](Trace::left) and the number of each object that occludes and is not found hidden.
    occluding: Vec<([u32; 2], u32)>,
    /// Tiles and objects that are not found hidden and do not occlude yet.
    waiting: Vec<Waiting>,
    /// Returns true once no further objects are to be found hidden.
    stop: &'a dyn Fn() -> bool,
}

impl Around<'_> {
    /// Sweeps until all tiles that are not hidden are opened. Returns false, without a result, if the weight
    /// of the occluders (triangles plus 4 per object) exceeds `most`.
    fn sweep_all(&mut self, sweep: &mut ExtendedProjectionCuller, most: u64) -> Result<bool, LevelError> {
        self.open(What::Tile { tile: 0, parent: 0, child: 0 });
        let (mut portion, mut coarsest) = (self.level.first_weight, COARSEST);
        self.open_large(coarsest);
        self.open_nearest(portion, |tile| tile.weight);
        loop {
            if (self.stop)() {
                self.open_nearest(u64::MAX, |_| 0);
                if self.waiting_weight().is_some() {
                    return Ok(true);
                }
                continue;
            }
            self.load(portion);
            if self.occluding_weight() > most {
                return Ok(false);
            }
            self.sweep(sweep)?;
            (portion, coarsest) = (portion.saturating_mul(2), coarsest / 2.0);
            self.open_nearest(portion, |tile| tile.own.len() as u64);
            self.open_large(coarsest);
            if self.waiting_weight().is_some_and(|weight| weight <= FEW) {
                return Ok(true);
            }
        }
    }

    /// Returns the [places](Trace::left) of all objects that are not hidden.
    fn left(self) -> Vec<[u32; 2]> {
        let waiting = self.waiting.iter().filter_map(|waiting| match waiting.what {
            What::Object { place, .. } => Some(place),
            What::Tile { .. } => None,
        });
        self.occluding.iter().map(|&(place, _)| place).chain(waiting).collect()
    }

    /// Opens a tile: adds it to the record, and its objects and the tiles directly below it to `waiting`.
    fn open(&mut self, what: What) {
        let What::Tile { tile, parent, child } = what else { return };
        let tree = &self.level.tree;
        let opened = &mut self.trace.opened;
        let number = *self.places.entry(tile).or_insert_with(|| {
            opened.push(Opened { parent, child, hash: tree.tiles[tile as usize].hash });
            opened.len() as u32 - 1
        });
        let waiting = |what, bounds| Waiting {
            what,
            bounds,
            distance: distance(&bounds, self.cell, self.level.origin),
        };
        let objects = (0..).zip(tree.own(tile)).map(|(place, &at)| {
            let what = What::Object { place: [number, place], number: at };
            waiting(what, self.level.objects[at as usize].bounds)
        });
        self.waiting.extend(objects);
        let below = (0..).zip(tree.tiles[tile as usize].children.clone()).map(|(child, tile)| {
            waiting(What::Tile { tile, parent: number, child }, tree.tiles[tile as usize].bounds)
        });
        self.waiting.extend(below);
    }

    /// Opens all waiting tiles that have tiles below and a ratio of extent to distance above `coarsest`.
    fn open_large(&mut self, coarsest: f64) {
        let mut at = 0;
        while let Some(&waiting) = self.waiting.get(at) {
            let extent = (waiting.bounds.max.as_dvec3() - waiting.bounds.min.as_dvec3()).max_element();
            if self.has_tiles(&waiting) == Some(true) && extent > coarsest * waiting.distance {
                self.waiting.swap_remove(at);
                self.open(waiting.what);
            } else {
                at += 1;
            }
        }
    }

    /// Returns whether a waiting tile has tiles below. `None` for a waiting object.
    fn has_tiles(&self, waiting: &Waiting) -> Option<bool> {
        match waiting.what {
            What::Tile { tile, .. } => Some(!self.level.tree.tiles[tile as usize].children.is_empty()),
            What::Object { .. } => None,
        }
    }

    /// Turns the nearest waiting objects into occluders, until the weight of the new occluders (triangles
    /// plus 4 per object) is at least `portion`.
    fn load(&mut self, portion: u64) {
        self.waiting.sort_by(|a, b| a.distance.total_cmp(&b.distance));
        let mut weight = 0;
        self.waiting.retain(|waiting| match waiting.what {
            What::Object { place, number } if weight < portion => {
                weight += self.level.objects[number as usize].weight();
                self.occluding.push((place, number));
                false
            }
            _ => true,
        });
    }

    /// Removes the tiles and objects that a sweep with the present occluders finds hidden.
    fn sweep(&mut self, sweep: &mut ExtendedProjectionCuller) -> Result<(), LevelError> {
        let numbers: Vec<u32> = self.occluding.iter().map(|&(_, number)| number).collect();
        let boxes = self.waiting.iter().map(|waiting| match waiting.what {
            What::Object { number, .. } => {
                Object { occluder: false, ..self.level.objects[number as usize].enlarged_object() }
            }
            What::Tile { .. } => Object::new(waiting.bounds),
        });
        let ids =
            self.level.with_scene(&numbers, boxes, |scene| swept(sweep, scene, self.cell, self.stop))?;
        let mut is_left = vec![false; numbers.len() + self.waiting.len()];
        ids.iter().for_each(|id| is_left[id.index()] = true);
        let mut is_left = is_left.into_iter();
        self.occluding.retain(|_| is_left.next().unwrap_or(true));
        self.waiting.retain(|_| is_left.next().unwrap_or(true));
        Ok(())
    }

    /// Opens waiting tiles, nearest first, until the sum of `measure` (a size of one tile) over the opened
    /// tiles is at least `enough`, or no tile is waiting.
    fn open_nearest(&mut self, enough: u64, measure: fn(&Tile) -> u64) {
        let is_tile = |waiting: &Waiting| matches!(waiting.what, What::Tile { .. });
        let (mut tiles, objects): (Vec<Waiting>, Vec<Waiting>) = self.waiting.drain(..).partition(is_tile);
        tiles.sort_by(|a, b| a.distance.total_cmp(&b.distance));
        self.waiting = objects;
        let mut sum = 0;
        for waiting in tiles {
            match waiting.what {
                What::Tile { tile, .. } if sum < enough => {
                    sum += measure(&self.level.tree.tiles[tile as usize]);
                    self.open(waiting.what);
                }
                _ => self.waiting.push(waiting),
            }
        }
    }

    /// Returns the sum of the [weights](crate::object_facts::ObjectFacts::weight) of the present occluders.
    fn occluding_weight(&self) -> u64 {
        self.occluding.iter().map(|&(_, number)| self.level.objects[number as usize].weight()).sum()
    }

    /// Returns the sum of the [weights](crate::object_facts::ObjectFacts::weight) of the waiting objects.
    /// `None` if a tile is waiting too.
    fn waiting_weight(&self) -> Option<u64> {
        let weight = |waiting: &Waiting| match waiting.what {
            What::Object { number, .. } => Some(self.level.objects[number as usize].weight()),
            What::Tile { .. } => None,
        };
        self.waiting.iter().map(weight).sum()
    }
}

impl Trace {
    /// Returns the trace for a group that is not swept: it leaves all objects.
    pub(crate) fn of_all(tree: &TileTree) -> Self {
        Self::of_whole(tree, 0..tree.order.len() as u32)
    }

    /// Returns the trace of a sweep of all tiles at once. `left` are the positions in [`TileTree::order`] of
    /// the objects that it did not hide.
    fn of_whole(tree: &TileTree, left: impl IntoIterator<Item = u32>) -> Self {
        let opened = vec![Opened { parent: 0, child: WHOLE, hash: tree.hash }];
        Self { opened, left: left.into_iter().map(|place| [0, place]).collect() }
    }

    /// Returns the numbers of the objects left, tile by tile in the order of opening. `None` if an opened
    /// tile has changed since the trace was recorded.
    pub(crate) fn replay(&self, tree: &TileTree) -> Option<Vec<u32>> {
        if let [Opened { child: WHOLE, hash, .. }] = self.opened[..] {
            // Forged bytes may list an object twice, with different first numbers.
            let number =
                |&[first, place]: &[u32; 2]| tree.order.get(place as usize).copied().filter(|_| first == 0);
            return self.left.iter().map(number).collect::<Option<_>>().filter(|_| hash == tree.hash);
        }
        let mut tiles: Vec<u32> = Vec::with_capacity(self.opened.len());
        let mut is_opened = vec![false; tree.tiles.len()];
        for (at, opened) in self.opened.iter().enumerate() {
            let tile = if at == 0 {
                0
            } else {
                let parent = *tiles.get(opened.parent as usize)?;
                tree.tiles[parent as usize].children.clone().nth(opened.child as usize)?
            };
            // Forged bytes may open a tile twice, which would list its objects twice.
            let is_again = std::mem::replace(&mut is_opened[tile as usize], true);
            if is_again || tree.tiles[tile as usize].hash != opened.hash {
                return None;
            }
            tiles.push(tile);
        }
        let number =
            |&[opened, place]: &[u32; 2]| tree.own(*tiles.get(opened as usize)?).get(place as usize).copied();
        self.left.iter().map(number).collect()
    }

    pub(crate) fn save(&self, to: &mut Writer) {
        to.u32(self.opened.len() as u32);
        for opened in &self.opened {
            to.u32s([opened.parent, opened.child]);
            to.u64(opened.hash);
        }
        to.u32(self.left.len() as u32);
        to.u32s(self.left.iter().flatten().copied());
    }

    /// Reads a trace that [`save`](Self::save) has written.
    pub(crate) fn load(from: &mut Reader<'_>) -> Result<Self, FormatError> {
        let mut trace = Self::default();
        for _ in 0..from.u32()? {
            trace.opened.push(Opened { parent: from.u32()?, child: from.u32()?, hash: from.u64()? });
        }
        let count = from.u32()? as usize;
        trace.left =
            from.u32s(count.saturating_mul(2))?.chunks_exact(2).map(|pair| [pair[0], pair[1]]).collect();
        if !trace.left.is_sorted_by(|a, b| a < b) {
            return Err(from.content_error("objects of a group are out of order"));
        }
        Ok(trace)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{BakeCache, SandwichBaker, SandwichSettings};
    use std::collections::HashSet;
    use std::sync::Arc;
    use std::time::Duration;
    use visibility_core::bake::Bake;
    use visibility_core::pvs::Viewcells;
    use visibility_testing::{Random, is_clear};

    /// Makes a town 240 m wide: blocks of houses with yards, some towers, small objects in streets and yards,
    /// a sign that is never culled, and a cloud without finite bounds.
    fn town(random: &mut Random) -> Scene {
        let mut scene = Scene::new();
        let mut add = |min: [f32; 3], max: [f32; 3], occluder: bool| {
            let bounds = Aabb::from_arrays(min, max);
            let id = scene.insert(Object { occluder, cost: 12, ..Object::new(bounds) });
            let corners = bounds.corners();
            let sides = visibility_core::OccluderMesh::CUBOID.map(|t| t.map(|i| corners[i as usize]));
            scene.set_triangles(id, sides).unwrap();
            id
        };
        let mut number = |low: f64, high: f64| (low + (high - low) * random.unit()) as f32;
        for (x, y) in
            (0..12).flat_map(|i| (0..12).map(move |j| (i as f32 * 20.0 - 120.0, j as f32 * 20.0 - 120.0)))
        {
            for (a, b, wide, deep) in
                [(0.0, 0.0, 14.0, 3.0), (0.0, 11.0, 14.0, 3.0), (0.0, 3.0, 3.0, 8.0), (11.0, 3.0, 3.0, 8.0)]
            {
                let tower = number(0.0, 1.0) < 0.04;
                let high = if tower { number(20.0, 60.0) } else { number(5.0, 9.0) };
                add([x + a, y + b, 0.0], [x + a + wide, y + b + deep, high], true);
            }
            for _ in 0..4 {
                let (a, b) = (x + number(0.0, 19.0), y + number(0.0, 19.0));
                add([a, b, 0.0], [a + 0.9, b + 0.9, number(0.5, 12.0)], false);
            }
        }
        let sign = add([80.0, 80.0, 1.0], [81.0, 81.0, 2.0], false);
        let cloud = add([0.0; 3], [f32::INFINITY; 3], false);
        scene.set_never_cull(sign, true).unwrap();
        assert!(scene.contains(cloud), "the cloud is in the scene");
        scene.prepare_occluders(&Default::default());
        scene
    }

    /// Returns a level in small tiles, of which only a few occlude in the first sweep.
    fn in_small_tiles(scene: &Scene) -> TiledScene<'_> {
        let mut level = TiledScene::new(scene);
        (level.tree, level.first_weight) = (TileTree::with_leaves(&level.objects, 0, 200), 400);
        level
    }

    fn sweep_of(level: &TiledScene<'_>, cell: &Viewcell) -> Trace {
        sweep_of_all(level, std::slice::from_ref(cell))
    }

    fn sweep_of_all(level: &TiledScene<'_>, cells: &[Viewcell]) -> Trace {
        let members: Vec<u32> = (0..cells.len() as u32).collect();
        sweep_near_to_far(level, cells, &members, &mut ExtendedProjectionCuller::new(), &mut None, None)
            .unwrap()
    }

    const EYES: [[f64; 3]; 3] = [[-3.5, -3.5, 1.0], [37.0, 64.0, 1.0], [-110.0, -110.0, 1.0]];

    fn cell_at(eye: [f64; 3]) -> Viewcell {
        Viewcell::from_box(DVec3::from_array(eye), DVec3::from_array(eye) + DVec3::ONE)
    }

    #[test]
    fn no_object_that_a_ray_reaches_is_lost_and_few_tiles_are_opened() {
        let mut random = Random(77);
        let scene = town(&mut random);
        let level = in_small_tiles(&scene);
        let mut clear = 0;
        for cell in EYES.map(cell_at) {
            let trace = sweep_of(&level, &cell);
            let left = trace.replay(&level.tree).unwrap();
            assert!(left.len() * 3 < scene.len(), "{} of {} left", left.len(), scene.len());
            let opened: usize = trace.opened.len();
            assert!(opened * 4 < level.tree.tiles.len() * 3, "{opened} of {}", level.tree.tiles.len());
            let mut is_left = vec![false; scene.len()];
            left.iter().for_each(|&at| is_left[at as usize] = true);
            assert!(is_left[scene.len() - 2] && is_left[scene.len() - 1], "never culled");
            for id in scene.ids().filter(|id| !is_left[id.index()]) {
                let bounds = scene.bounds(id).unwrap();
                let mut between =
                    |a: DVec3, b: DVec3| a + (b - a) * DVec3::from_array([(); 3].map(|()| random.unit()));
                for _ in 0..60 {
                    let from = between(cell.min, cell.max);
                    let to = between(bounds.min.as_dvec3(), bounds.max.as_dvec3());
                    assert!(!is_clear(&scene, from, to, id.index()), "{id} is seen from {from} at {to}");
                }
            }
            let seen = |id: &ObjectId| {
                let bounds = scene.bounds(*id).unwrap();
                bounds.is_finite()
                    && is_clear(&scene, cell.min + DVec3::splat(0.5), bounds.center().as_dvec3(), id.index())
            };
            clear += scene.ids().filter(seen).count();
        }
        assert!(clear > 30, "{clear} are seen: the rays can find what is lost");
    }

    #[test]
    fn a_group_that_sees_too_much_is_divided() {
        let scene = town(&mut Random(80));
        let mut level = in_small_tiles(&scene);
        let cells = EYES.map(cell_at);
        let tree = level.tree.clone();
        let objects = |trace: &Trace| {
            let mut objects = trace.replay(&tree).unwrap();
            objects.sort_unstable();
            objects
        };
        let whole = sweep_of_all(&level, &cells);
        let mut apart: Vec<u32> = cells.iter().flat_map(|cell| objects(&sweep_of(&level, cell))).collect();
        apart.sort_unstable();
        apart.dedup();
        assert!(apart.len() * 4 < objects(&whole).len() * 3, "{}", apart.len());
        // One viewcell is far from the others, so the box around all of them contains the whole town.
        let weight: u64 = level.objects.iter().map(|object| object.weight()).sum();
        for (most, expected) in [(weight, &objects(&whole)), (weight / 4, &apart)] {
            level.most_weight = most;
            assert!(objects(&sweep_of_all(&level, &cells)) == *expected, "{most}");
        }
        // Tiles that were opened before the group was divided are in the trace too, and each tile is there
        // once.
        let trace = sweep_of_all(&level, &cells);
        let mut tiles: Vec<[u32; 2]> =
            trace.opened[1..].iter().map(|opened| [opened.parent, opened.child]).collect();
        tiles.sort_unstable();
        assert!(tiles.windows(2).all(|pair| pair[0] != pair[1]), "a tile is opened twice: {tiles:?}");
        let hashes = |trace: &Trace| trace.opened.iter().map(|opened| opened.hash).collect::<HashSet<u64>>();
        let by_cell: HashSet<u64> = cells.iter().flat_map(|cell| hashes(&sweep_of(&level, cell))).collect();
        assert!(
            by_cell.is_subset(&hashes(&trace)) && by_cell.len() < hashes(&trace).len(),
            "tiles opened by each viewcell are opened by the group, with more"
        );
        let alone = sweep_of_all(&level, &cells[..1]);
        assert_eq!(alone, sweep_of(&level, &cells[0]), "one viewcell is swept whatever it sees");
    }

    #[test]
    fn a_sweep_that_is_stopped_hides_no_more_than_a_whole_one() {
        let scene = town(&mut Random(81));
        let mut level = in_small_tiles(&scene);
        level.tree = TileTree::with_leaves(&level.objects, 0, 10);
        let cell = cell_at(EYES[0]);
        let left_after = |asked: usize| {
            let left_to_ask = std::cell::Cell::new(asked);
            let stop = || left_to_ask.replace(left_to_ask.get().saturating_sub(1)) == 0;
            let sweep = &mut ExtendedProjectionCuller::new();
            let cells = std::slice::from_ref(&cell);
            let trace = sweep_near_to_far(&level, cells, &[0], sweep, &mut None, Some(&stop)).unwrap();
            let left = trace.replay(&level.tree).unwrap().into_iter().collect::<HashSet<u32>>();
            assert_eq!(left.len(), trace.left.len(), "asked {asked} times: an object is left twice");
            left
        };
        let whole = left_after(usize::MAX);
        let mut between = 0;
        assert_eq!(left_after(0).len(), scene.len(), "a sweep that is stopped at once leaves all");
        for asked in (1..400).step_by(9) {
            let left = left_after(asked);
            assert!(left.is_superset(&whole), "stopped at plane {asked}");
            between += usize::from(left.len() > whole.len() && left.len() < scene.len());
        }
        assert!(between > 5, "{between} sweeps have hidden a part");
    }

    #[test]
    fn what_changes_elsewhere_changes_nothing_and_is_noticed_where_it_was_looked() {
        let mut random = Random(78);
        let mut scene = town(&mut random);
        let [a, b, c] = EYES.map(cell_at);
        let near = |cell: &Viewcell| Viewcell::from_box(cell.min + DVec3::X, cell.max + DVec3::X);
        let cells = [vec![a.clone()], vec![b], vec![c], vec![near(&a), a]];
        fn level_of(scene: &Scene) -> TiledScene<'_> {
            let mut level = in_small_tiles(scene);
            level.most_weight = 600;
            level
        }
        let traces = cells.each_ref().map(|cells| sweep_of_all(&level_of(&scene), cells));
        let (mut same, mut other) = (0, 0);
        for _ in 0..60 {
            let id = scene.id_at(random.below(scene.len() - 2)).unwrap();
            let (bounds, triangles) = (scene.bounds(id).unwrap(), scene.triangles(id).unwrap().to_vec());
            let by = visibility_core::glam::Vec3::new(0.3, -0.2, 0.1);
            scene.set_bounds(id, Aabb::new(bounds.min + by, bounds.max + by)).unwrap();
            scene.set_triangles(id, triangles.iter().map(|t| t.map(|p| p + by)).collect::<Vec<_>>()).unwrap();
            scene.prepare_occluders(&Default::default());
            let level = level_of(&scene);
            for (cells, trace) in cells.iter().zip(&traces) {
                match trace.replay(&level.tree) {
                    Some(_) => {
                        same += 1;
                        assert!(sweep_of_all(&level, cells) == *trace, "{id} was looked at");
                    }
                    None => {
                        other += 1;
                        assert!(sweep_of_all(&level, cells) != *trace, "{id} is in no tile that was opened");
                    }
                }
            }
            scene.set_bounds(id, bounds).unwrap();
            scene.set_triangles(id, triangles).unwrap();
            scene.prepare_occluders(&Default::default());
        }
        assert!(same > 50 && other > 20, "{same} the same, {other} not");
    }

    /// With a limit of time, groups are swept at once and undivided, and may leave other objects than without
    /// a limit.
    #[test]
    fn what_a_bake_with_a_limit_caches_answers_no_whole_bake() {
        let scene = town(&mut Random(80));
        let cells = EYES.iter().flat_map(|eye| [0.0, 4.0].map(|y| cell_at([eye[0], eye[1] + y, eye[2]])));
        let (cells, mut level) = (Viewcells::new(cells), in_small_tiles(&scene));
        level.most_weight = 300;
        let level = Arc::new(level);
        let settings = SandwichSettings::default().with_gap(1.0).with_rays(1);
        let baker = || SandwichBaker::of_level(level.clone(), &cells, settings);
        let whole = Bake::new(baker()).run();
        let limited = Bake::new(baker().with_time(Duration::from_secs(1))).run();
        assert!(
            limited.cache != BakeCache::default() && limited.cache != whole.cache,
            "the cache of a bake with a limit is of its own"
        );
        assert_eq!(limited.reused, 0, "no viewcell is reused without a cache");
        let after = Bake::new(baker().with_cache(limited.cache.clone())).run();
        assert!(
            after.cells == whole.cells && after.cache == whole.cache,
            "a whole bake after one with a limit has the result of one without"
        );
        // Another bake with a limit of time uses all cached results.
        let again = Bake::new(baker().with_time(Duration::from_secs(1)).with_cache(limited.cache)).run();
        assert!(
            again.cells == limited.cells && again.reused == cells.cells().len(),
            "another bake with a limit reuses all"
        );
    }

    #[test]
    fn traces_are_read_as_written_and_forged_ones_replay_to_nothing() {
        let scene = town(&mut Random(79));
        let level = in_small_tiles(&scene);
        let trace = sweep_of(&level, &cell_at(EYES[0]));
        let format = visibility_core::binary_format::Format { magic: *b"EXAMPLE.", version: 1 };
        let mut to = Writer::new(format, 0, 0);
        trace.save(&mut to);
        let bytes = to.finish();
        let mut from = Reader::new(&bytes, format).unwrap();
        assert_eq!(Trace::load(&mut from).as_ref(), Ok(&trace), "the trace as written");
        assert!(from.end().is_ok(), "all of the trace is read");
        let forgeries: [fn(&mut Trace); 8] = [
            |trace| trace.opened[3].hash ^= 1,
            |trace| trace.opened[3].parent = u32::MAX,
            |trace| trace.opened[3].child = 1 << 31,
            |trace| trace.opened[3].child = u32::MAX,
            |trace| trace.opened.push(trace.opened[3]),
            |trace| trace.left[5][0] = u32::MAX,
            |trace| trace.left[5][1] = u32::MAX,
            |trace| trace.opened.clear(),
        ];
        for (number, forge) in forgeries.iter().enumerate() {
            let mut forged = trace.clone();
            forge(&mut forged);
            assert_eq!(forged.replay(&level.tree), None, "forgery {number}");
        }
        let whole = Trace::of_all(&level.tree);
        assert_eq!(
            whole.replay(&level.tree).as_ref(),
            Some(&level.tree.order),
            "a whole trace replays to all objects"
        );
        let forgeries: [fn(&mut Trace); 3] = [
            |trace| trace.opened[0].hash ^= 1,
            |trace| trace.left.push([0, u32::MAX]),
            |trace| trace.left.push([1, 0]),
        ];
        for (number, forge) in forgeries.iter().enumerate() {
            let mut forged = whole.clone();
            forge(&mut forged);
            assert_eq!(forged.replay(&level.tree), None, "forgery {number} of a whole sweep");
        }
    }

    /// Distances of a box of 1 m from viewcells beside it, and from those that have none.
    #[test]
    fn distances_are_between_the_nearest_points() {
        let (bounds, origin) = (Aabb::from_arrays([0.0; 3], [1.0; 3]), DVec3::splat(10.0));
        let cell = |min: [f64; 3], max: [f64; 3]| {
            let [min, max] = [min, max].map(|p| origin + DVec3::from_array(p));
            Viewcell::from_box(min, max)
        };
        for (min, max, expected) in [
            ([0.25; 3], [0.5; 3], 0.0),
            ([1.0; 3], [2.0; 3], 0.0),
            ([3.0, 0.0, 0.0], [4.0, 1.0, 1.0], 2.0),
            ([-4.0, 0.0, 0.0], [-2.0, 1.0, 1.0], 2.0),
            ([4.0, -6.0, 0.0], [9.0, -4.0, 1.0], 5.0),
            ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3], 0.0),
            ([f64::NAN; 3], [f64::NAN; 3], 0.0),
        ] {
            assert_eq!(distance(&bounds, &cell(min, max), origin), expected, "{min:?} to {max:?}");
        }
    }
}
