//! The tiles of a scene: an octree of objects whose content is loaded and hashed tile by tile.
//!
//! The tree depends on the objects alone, and an edit changes it only near the edited objects: edges of cells
//! are powers of two and corners are multiples of these, whatever the bounds of the scene. The bounds of a
//! tile are rounded outwards by up to a sixteenth of its edge, so that a house that moves by a metre does not
//! change the distant view of its tile.

use crate::object_facts::ObjectFacts;
use std::ops::Range;
use visibility_core::Aabb;
use visibility_core::binary_format::Fingerprint;
use visibility_core::glam::{DVec3, Vec3};

/// Greatest [weight](ObjectFacts::weight), triangles plus 4 per object, of a tile without children. A tile
/// whose objects all have the same centre may exceed it.
const LEAF: u64 = 128;

/// Greatest weight (triangles plus 4 per object) of a level that is kept as a single tile.
const WHOLE: u64 = 1 << 18;

/// Limit on halving the cells of the tree (cubes with a power of two as edge): a cell is not halved again
/// once its edge is about 2 to this power times smaller than the greatest distance, along an axis, of the
/// centres of its objects from the origin.
const DEPTH: i32 = 40;

/// Bounds of tiles are rounded outwards to multiples of the cell's edge divided by 2 to this power.
const ROUNDING: i32 = 4;

/// Node of the tree: a tile with its own objects, and the tiles below it.
#[derive(Clone, PartialEq, Debug)]
pub(crate) struct Tile {
    /// Bounds of all objects in this tile and below, in level coordinates, except objects that are never
    /// culled.
    pub bounds: Aabb,
    /// Range of the numbers of the tiles directly below. Empty for a leaf.
    pub children: Range<u32>,
    /// Objects of the tile, as a range of [`TileTree::order`].
    pub own: Range<u32>,
    /// Sum of the weights (triangles plus 4) of the tile's objects.
    pub weight: u64,
    /// Hash of the data that opening the tile reveals: its objects in their order, and for each tile directly
    /// below, its bounds and whether it has tiles below.
    pub hash: u64,
}

/// The tiles of a scene, the root first. The root's own objects are those that are never culled and those
/// larger than the cells directly below the root.
#[derive(Clone, PartialEq, Debug)]
pub(crate) struct TileTree {
    pub tiles: Vec<Tile>,
    /// Numbers of the objects, sorted by tile, and ascending within each tile.
    pub order: Vec<u32>,
    /// Hash of the contents of all tiles.
    pub hash: u64,
}

impl TileTree {
    pub(crate) fn new(objects: &[ObjectFacts]) -> Self {
        Self::with_leaves(objects, WHOLE, LEAF)
    }

    /// Builds the tree of a level's objects. `whole` is the greatest weight (triangles plus 4 per object) of
    /// a level that is one tile, `leaf` the greatest weight of a tile without children.
    pub(crate) fn with_leaves(objects: &[ObjectFacts], whole: u64, leaf: u64) -> Self {
        let weight = objects.iter().map(ObjectFacts::weight).sum::<u64>();
        let leaf = if weight <= whole { u64::MAX } else { leaf };
        let all = 0..objects.len() as u32;
        let (unculled, rest): (Vec<u32>, Vec<u32>) = all.partition(|&at| objects[at as usize].is_unculled());
        let center = |at: u32| {
            let bounds = &objects[at as usize].bounds;
            (bounds.min.as_dvec3() + bounds.max.as_dvec3()) * 0.5
        };
        let extent = |at: u32| {
            let bounds = &objects[at as usize].bounds;
            (bounds.max.as_dvec3() - bounds.min.as_dvec3()).max_element()
        };
        let weight = |some: &[u32]| some.iter().map(|&at| objects[at as usize].weight()).sum::<u64>();
        // Cells are cubes whose edge is a power of two, aligned to the origin, so a distant edit does not
        // move them.
        let reach = |some: &[u32]| {
            exponent_above(some.iter().map(|&at| center(at).abs().max_element()).fold(0.0, f64::max))
        };
        let top = reach(&rest);
        let mut tree = Self { tiles: Vec::new(), order: Vec::with_capacity(objects.len()), hash: 0 };
        let mut edges = vec![top + 1];
        tree.tiles.push(Tile::empty());
        // Tiles in the order of their numbers, each with its members and whether all members are its own
        // objects.
        let mut waiting = std::collections::VecDeque::from([(unculled, rest)]);
        let mut number = 0;
        while let Some((mut own, mut members)) = waiting.pop_front() {
            let mut groups = Vec::new();
            // In larger cells, all members on one side of each axis would be in the same cell.
            let reach = reach(&members);
            let mut edge = edges[number].min(reach + 1);
            while !members.is_empty() && groups.is_empty() {
                if weight(&members) <= leaf || edge <= reach - DEPTH {
                    own.append(&mut members);
                    break;
                }
                // Cells are halved until they separate members. Objects larger than a cell stay in the tile
                // itself.
                edge -= 1;
                let size = 2f64.powi(edge);
                let count = own.len();
                own.extend(members.extract_if(.., |&mut at| extent(at) > size));
                let cell = |at: u32| (center(at) / size).floor().to_array().map(|x| x as i64);
                let first = members.first().map(|&at| cell(at));
                let is_one = members.iter().all(|&at| Some(cell(at)) == first);
                if !is_one || own.len() > count && !members.is_empty() {
                    let mut keyed: Vec<([i64; 3], u32)> =
                        members.drain(..).map(|at| (cell(at), at)).collect();
                    keyed.sort_unstable();
                    let chunks = keyed.chunk_by(|a, b| a.0 == b.0);
                    groups.extend(chunks.map(|chunk| chunk.iter().map(|&(_, at)| at).collect::<Vec<u32>>()));
                }
            }
            own.sort_unstable();
            let start = tree.order.len() as u32;
            let tile = &mut tree.tiles[number];
            tile.own = start..start + own.len() as u32;
            tile.weight = weight(&own);
            tree.order.append(&mut own);
            let first = tree.tiles.len() as u32;
            tree.tiles[number].children = first..first + groups.len() as u32;
            // The cell may be smaller than was assumed when the tile was created.
            edges[number] = if groups.is_empty() { edges[number] } else { edge + 1 };
            for group in groups {
                tree.tiles.push(Tile::empty());
                edges.push(edge);
                waiting.push_back((Vec::new(), group));
            }
            number += 1;
        }
        tree.enclose(objects, &edges);
        tree
    }

    /// Computes the bounds and hashes of all tiles, children first.
    fn enclose(&mut self, objects: &[ObjectFacts], edges: &[i32]) {
        for number in (0..self.tiles.len()).rev() {
            let tile = &self.tiles[number];
            let (own, children) = (tile.own.clone(), tile.children.clone());
            let mut bounds = Aabb::new(Vec3::INFINITY, Vec3::NEG_INFINITY);
            let mut hash = Fingerprint::new().with(own.len() as u32).with(children.len() as u32);
            let mut enclose = |inner: &Aabb| {
                bounds = Aabb::new(bounds.min.min(inner.min), bounds.max.max(inner.max));
            };
            for &at in &self.order[own.start as usize..own.end as usize] {
                let object = &objects[at as usize];
                hash = hash.with_u64(object.hash);
                if !object.is_unculled() {
                    enclose(&object.bounds);
                }
            }
            for child in &self.tiles[children.start as usize..children.end as usize] {
                enclose(&child.bounds);
                hash = hash.with(u32::from(child.children.is_empty()));
                for x in [child.bounds.min, child.bounds.max].iter().flat_map(|p| p.to_array()) {
                    hash = hash.with(x.to_bits());
                }
            }
            let step = 2f64.powi(edges[number] - ROUNDING);
            // Rounded coordinates are exact in `f32`: either they were multiples of `step` before, or they
            // have fewer significant bits now.
            let rounded = |p: Vec3, round: fn(DVec3) -> DVec3| (round(p.as_dvec3() / step) * step).as_vec3();
            let tile = &mut self.tiles[number];
            tile.bounds = Aabb::new(rounded(bounds.min, DVec3::floor), rounded(bounds.max, DVec3::ceil));
            tile.hash = hash.value();
        }
        let tiles = self.tiles.iter();
        self.hash = tiles.fold(Fingerprint::new(), |hash, tile| hash.with_u64(tile.hash)).value();
    }

    /// Returns the numbers of the objects of a tile.
    pub(crate) fn own(&self, tile: u32) -> &[u32] {
        let own = &self.tiles[tile as usize].own;
        &self.order[own.start as usize..own.end as usize]
    }
}

impl Tile {
    fn empty() -> Self {
        let bounds = Aabb::new(Vec3::INFINITY, Vec3::NEG_INFINITY);
        Self { bounds, children: 0..0, own: 0..0, weight: 0, hash: 0 }
    }
}

/// Returns the least exponent e with 2^e greater than `number`, which must not be negative.
fn exponent_above(number: f64) -> i32 {
    let mut exponent = -149;
    while exponent < 129 && 2f64.powi(exponent) <= number {
        exponent += 1;
    }
    exponent
}

#[cfg(test)]
mod tests {
    use super::*;
    use visibility_core::Object;
    use visibility_testing::Random;

    fn facts(min: Vec3, max: Vec3, never_cull: bool, hash: u64) -> ObjectFacts {
        let bounds = Aabb::new(min, max);
        let object = Object { never_cull, occluder: true, ..Object::new(bounds) };
        ObjectFacts { hash, triangles: 12, ..ObjectFacts::new(0, &object, Default::default(), None) }
    }

    fn level(random: &mut Random) -> Vec<ObjectFacts> {
        (0..3000)
            .map(|i| {
                let mut number = |low: f64, high: f64| (low + (high - low) * random.unit()) as f32;
                let min = Vec3::new(number(-900.0, 1100.0), number(-700.0, 200.0), number(-1.0, 3.0));
                let size = if i % 100 == 0 { number(50.0, 900.0) } else { number(0.1, 9.0) };
                facts(min, min + Vec3::new(size, size * 0.5, 4.0), i % 500 == 3, i)
            })
            .collect()
    }

    #[test]
    fn every_object_is_in_one_tile_and_in_its_bounds() {
        let mut random = Random(5);
        let mut objects = level(&mut random);
        objects.push(facts(Vec3::NAN, Vec3::NAN, false, 1));
        objects.push(facts(Vec3::splat(3e38), Vec3::splat(3.4e38), false, 1));
        objects.extend((0..40).map(|i| facts(Vec3::splat(7.0), Vec3::splat(7.5), false, i)));
        let tree = TileTree::with_leaves(&objects, 0, 300);
        let mut order = tree.order.clone();
        order.sort_unstable();
        assert!(order.into_iter().eq(0..objects.len() as u32), "each object is in one tile");
        let mut above = vec![0; tree.tiles.len()];
        for (number, tile) in tree.tiles.iter().enumerate() {
            assert!(tree.own(number as u32).is_sorted(), "tile {number}: its own objects ascend");
            tile.children.clone().for_each(|child| above[child as usize] += 1);
            let inside = |inner: &Aabb| {
                tile.bounds.min.cmple(inner.min).all() && inner.max.cmple(tile.bounds.max).all()
            };
            let children = &tree.tiles[tile.children.start as usize..tile.children.end as usize];
            assert!(children.iter().all(|child| inside(&child.bounds)), "tile {number}");
            for &at in tree.own(number as u32) {
                let object = &objects[at as usize];
                assert!(inside(&object.bounds) || object.is_unculled() && number == 0, "object {at}");
            }
        }
        assert!(
            above[1..].iter().all(|&count| count == 1) && above[0] == 0,
            "each tile but the root is the child of one"
        );
        let leaves = tree.tiles.iter().filter(|tile| tile.children.is_empty());
        assert!(leaves.clone().filter(|leaf| leaf.weight > 300).count() == 1, "all in one place");
        assert!((100..1000).contains(&leaves.count()), "{}", tree.tiles.len());
        assert_eq!(
            TileTree::with_leaves(&objects, u64::MAX, 300).tiles.len(),
            1,
            "a tree of few objects is one tile"
        );
        assert_eq!(TileTree::new(&[]).tiles.len(), 1, "a tree of no objects is one tile");
    }

    #[test]
    fn a_change_of_an_object_changes_the_hashes_of_few_tiles() {
        let mut random = Random(6);
        let objects = level(&mut random);
        let before = TileTree::with_leaves(&objects, 0, 300);
        let mut total = 0;
        for _ in 0..50 {
            let at = random.below(objects.len());
            let mut edited = objects.clone();
            edited[at].hash ^= 1 << 40;
            edited[at].bounds.min += Vec3::splat(0.01);
            let after = TileTree::with_leaves(&edited, 0, 300);
            assert_eq!(after.tiles.len(), before.tiles.len(), "object {at}: tiles after its change");
            let changed = after.tiles.iter().zip(&before.tiles).filter(|(a, b)| a.hash != b.hash).count();
            assert!(changed > 0, "object {at}");
            total += changed;
        }
        assert!(total < 75, "{total} tiles for 50 objects");
    }
}
