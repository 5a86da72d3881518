//! Contenders of the frustum benchmark: this library, a plain loop as in simple engines, and other crates.
//!
//! Each contender holds the boxes and the frustum of every frame in its own types, made in advance, and
//! writes the visible boxes to a buffer that it keeps. Each is used as its documentation recommends, and in
//! the fastest of several ways according to our measurements.

use bvh::aabb::{Bounded, IntersectsAabb};
use bvh::bounding_hierarchy::BHShape;
use nalgebra::Point3;
use parry3d::partitioning::{BvhBuildStrategy, BvhNode, TraversalAction};
use treeculler::BVol;
use visibility_core::{
    Aabb, FrustumCuller, Pipeline, Scene, View, VisibleSet,
    glam::{DVec3, Vec3},
    simd::Simd,
};

/// Implementation of frustum culling that is measured: it holds the boxes and the frustum of every frame.
pub trait Contender {
    /// Returns the contender's name as the tables show it.
    fn name(&self) -> String;

    /// Culls all boxes by the view with the index `frame`. Returns a number that depends on the whole answer,
    /// so that the compiler cannot skip work.
    fn cull(&mut self, frame: usize) -> usize;

    /// Returns the indices of the boxes that the last call of [`cull`](Self::cull) found visible, in any
    /// order. `None` from a contender that does not cull.
    fn visible(&self) -> Option<Vec<u32>>;

    /// Returns true if the contender also culls boxes beyond the bounds of the frustum's corners.
    fn uses_corners(&self) -> bool {
        false
    }
}

/// Makes all contenders for these boxes and views. The first is the plain loop, with which the others are
/// compared.
pub fn all(boxes: &[Aabb], views: &[View]) -> Vec<Box<dyn Contender>> {
    let mut all: Vec<Box<dyn Contender>> = vec![
        Box::new(Plain::<false>::new(boxes, views)),
        Box::new(Plain::<true>::new(boxes, views)),
        Box::new(TreeCuller::<false>::new(boxes, views)),
        Box::new(TreeCuller::<true>::new(boxes, views)),
        Box::new(Parry::new(boxes, views)),
        Box::new(BvhCrate::new(boxes, views)),
        Box::new(ReadAll::new(boxes)),
    ];
    all.extend(ours(boxes, views));
    all
}

/// Makes this library's contenders: one per instruction set, and last the widest instruction set with the
/// visible ids written to a list, as the other crates do.
pub fn ours(boxes: &[Aabb], views: &[View]) -> Vec<Box<dyn Contender>> {
    let each = Simd::available().map(|simd| Ours::new(boxes, views, simd, false));
    let last = Ours::new(boxes, views, Simd::best(), true);
    each.chain([last]).map(|ours| Box::new(ours) as Box<dyn Contender>).collect()
}

/// Plane in f32 for a loop over centres and half extents: unit normal, absolute values of the normal's
/// components, and offset.
#[derive(Clone, Copy, Debug)]
struct Plane {
    normal: Vec3,
    size: Vec3,
    offset: f32,
}

/// Six planes of a frustum, whose normals point inside.
type Planes = [Plane; 6];

/// Returns the six planes of a view in world space, rounded to f32, with their normals pointing inside.
fn planes(view: &View) -> Planes {
    let planes = view.planes(DVec3::ZERO);
    core::array::from_fn(|i| {
        let plane = planes.as_slice()[i].plane;
        let normal = plane.normal.as_vec3();
        Plane { normal, size: normal.abs(), offset: plane.offset as f32 }
    })
}

/// Loop over centres and half extents with glam, as in simple engines. With `EARLY`, the test of a box ends
/// at the first plane that excludes it, which pays if neighbouring boxes have equal answers. Otherwise all
/// six planes are tested without a branch.
struct Plain<const EARLY: bool> {
    boxes: Vec<(Vec3, Vec3)>,
    frames: Vec<Planes>,
    visible: Vec<u32>,
}

impl<const EARLY: bool> Plain<EARLY> {
    fn new(boxes: &[Aabb], views: &[View]) -> Self {
        Self {
            boxes: boxes.iter().map(|b| (b.center(), b.half_extent())).collect(),
            frames: views.iter().map(planes).collect(),
            visible: Vec::with_capacity(boxes.len()),
        }
    }
}

impl<const EARLY: bool> Contender for Plain<EARLY> {
    fn name(&self) -> String {
        let how = if EARLY { "leaving at the first plane" } else { "all planes" };
        format!("glam centre-extent loop, {how}")
    }

    fn cull(&mut self, frame: usize) -> usize {
        let planes = &self.frames[frame];
        self.visible.clear();
        for (index, &(center, half)) in self.boxes.iter().enumerate() {
            let touches = |p: &Plane| p.normal.dot(center) + p.size.dot(half) + p.offset >= 0.0;
            let visible = if EARLY {
                planes.iter().all(touches)
            } else {
                planes.iter().fold(true, |all, p| all & touches(p))
            };
            if visible {
                self.visible.push(index as u32);
            }
        }
        self.visible.len()
    }

    fn visible(&self) -> Option<Vec<u32>> {
        Some(self.visible.clone())
    }
}

/// Contender treeculler, which tests one box at a time. With `COHERENT` it remembers for each box the plane
/// that last excluded it.
struct TreeCuller<const COHERENT: bool> {
    boxes: Vec<treeculler::AABB<f32>>,
    last: Vec<u8>,
    frames: Vec<treeculler::Frustum<f32>>,
    visible: Vec<u32>,
}

impl<const COHERENT: bool> TreeCuller<COHERENT> {
    fn new(boxes: &[Aabb], views: &[View]) -> Self {
        let frustum = |view: &View| {
            let matrix = view.clip_from(DVec3::ZERO).as_mat4().to_cols_array_2d();
            treeculler::Frustum::from_modelview_projection(matrix)
        };
        Self {
            boxes: boxes.iter().map(|b| treeculler::AABB::new(b.min.to_array(), b.max.to_array())).collect(),
            last: vec![0; boxes.len()],
            frames: views.iter().map(frustum).collect(),
            visible: Vec::with_capacity(boxes.len()),
        }
    }
}

impl<const COHERENT: bool> Contender for TreeCuller<COHERENT> {
    fn name(&self) -> String {
        if COHERENT { "treeculler 0.4, coherent" } else { "treeculler 0.4" }.into()
    }

    fn cull(&mut self, frame: usize) -> usize {
        let frustum = &self.frames[frame];
        self.visible.clear();
        if COHERENT {
            for (index, (b, last)) in self.boxes.iter().zip(&mut self.last).enumerate() {
                let (visible, plane) = b.coherent_test_against_frustum(frustum, *last);
                *last = plane;
                if visible {
                    self.visible.push(index as u32);
                }
            }
        } else {
            for (index, b) in self.boxes.iter().enumerate() {
                if b.test_against_frustum(frustum, 0) != u8::MAX {
                    self.visible.push(index as u32);
                }
            }
        }
        self.visible.len()
    }

    fn visible(&self) -> Option<Vec<u32>> {
        Some(self.visible.clone())
    }

    fn uses_corners(&self) -> bool {
        true
    }
}

/// Tests whether a box is at least partly on the inner side of each plane; touching counts as inside. False
/// if a corner is NaN.
#[inline(always)]
fn in_view(planes: &Planes, min: Vec3, max: Vec3) -> bool {
    let (center, half) = ((min + max) * 0.5, (max - min) * 0.5);
    planes.iter().all(|p| p.normal.dot(center) + p.size.dot(half) + p.offset >= 0.0)
}

/// Contender parry3d: its hierarchy from the binned builder, since the PLOC builder takes longer and its
/// hierarchy culls no faster.
struct Parry {
    tree: parry3d::partitioning::Bvh,
    frames: Vec<Planes>,
    visible: Vec<u32>,
}

impl Parry {
    fn new(boxes: &[Aabb], views: &[View]) -> Self {
        let leaves: Vec<_> = boxes.iter().map(parry_aabb).collect();
        Self {
            tree: parry3d::partitioning::Bvh::from_leaves(BvhBuildStrategy::Binned, &leaves),
            frames: views.iter().map(planes).collect(),
            visible: Vec::with_capacity(boxes.len()),
        }
    }
}

/// Converts a box to parry3d's type without rounding.
pub fn parry_aabb(b: &Aabb) -> parry3d::bounding_volume::Aabb {
    parry3d::bounding_volume::Aabb::new(b.min.to_array().into(), b.max.to_array().into())
}

impl Contender for Parry {
    fn name(&self) -> String {
        "parry3d 0.31 Bvh".into()
    }

    fn cull(&mut self, frame: usize) -> usize {
        let Self { tree, frames, visible } = self;
        let planes = &frames[frame];
        visible.clear();
        tree.traverse(|node: &BvhNode| {
            let (min, max) = (node.mins().to_array().into(), node.maxs().to_array().into());
            if !in_view(planes, min, max) {
                return TraversalAction::Prune;
            }
            visible.extend(node.leaf_data());
            TraversalAction::Continue
        });
        visible.len()
    }

    fn visible(&self) -> Option<Vec<u32>> {
        Some(self.visible.clone())
    }
}

/// Box with the index of its object and of its node in the tree, which the `bvh` crate requires.
#[derive(Clone, Debug)]
pub struct Shape {
    bounds: bvh::aabb::Aabb<f32, 3>,
    index: u32,
    node: usize,
}

impl Shape {
    /// Creates the shape of the box `b` whose index among all boxes is `index`.
    pub fn new(b: &Aabb, index: u32) -> Self {
        let corner = |v: Vec3| Point3::from(v.to_array());
        Self { bounds: bvh::aabb::Aabb::with_bounds(corner(b.min), corner(b.max)), index, node: 0 }
    }
}

impl Bounded<f32, 3> for Shape {
    fn aabb(&self) -> bvh::aabb::Aabb<f32, 3> {
        self.bounds
    }
}

impl BHShape<f32, 3> for Shape {
    fn set_bh_node_index(&mut self, node: usize) {
        self.node = node;
    }

    fn bh_node_index(&self) -> usize {
        self.node
    }
}

/// Frustum as a query of the `bvh` crate, which visits nodes whose box no plane excludes.
struct Query(Planes);

impl IntersectsAabb<f32, 3> for Query {
    fn intersects_aabb(&self, b: &bvh::aabb::Aabb<f32, 3>) -> bool {
        in_view(&self.0, Vec3::new(b.min.x, b.min.y, b.min.z), Vec3::new(b.max.x, b.max.y, b.max.z))
    }
}

/// Contender `bvh`: its hierarchy, walked by the iterator that allocates no memory.
struct BvhCrate {
    shapes: Vec<Shape>,
    tree: bvh::bvh::Bvh<f32, 3>,
    frames: Vec<Query>,
    visible: Vec<u32>,
}

impl BvhCrate {
    fn new(boxes: &[Aabb], views: &[View]) -> Self {
        let mut shapes: Vec<_> = (0..).zip(boxes).map(|(index, b)| Shape::new(b, index)).collect();
        Self {
            tree: bvh::bvh::Bvh::build(&mut shapes),
            shapes,
            frames: views.iter().map(|view| Query(planes(view))).collect(),
            visible: Vec::with_capacity(boxes.len()),
        }
    }
}

impl Contender for BvhCrate {
    fn name(&self) -> String {
        "bvh 0.13".into()
    }

    fn cull(&mut self, frame: usize) -> usize {
        let Self { shapes, tree, frames, visible } = self;
        visible.clear();
        visible.extend(tree.traverse_iterator(&frames[frame], shapes).map(|shape| shape.index));
        visible.len()
    }

    fn visible(&self) -> Option<Vec<u32>> {
        Some(self.visible.clone())
    }
}

/// Contender that reads all boxes once and culls nothing: a lower bound on the time of any test of every box,
/// from memory bandwidth.
struct ReadAll {
    numbers: Vec<u32>,
}

impl ReadAll {
    fn new(boxes: &[Aabb]) -> Self {
        let bits = |b: &Aabb| [b.min, b.max].map(|v| v.to_array().map(f32::to_bits));
        Self { numbers: boxes.iter().flat_map(|b| bits(b).concat()).collect() }
    }
}

impl Contender for ReadAll {
    fn name(&self) -> String {
        "reading all boxes once".into()
    }

    fn cull(&mut self, _: usize) -> usize {
        // Integer sums may be reordered, so the compiler can use any number of SIMD lanes.
        self.numbers.iter().fold(0u32, |sum, &x| sum.wrapping_add(x)) as usize
    }

    fn visible(&self) -> Option<Vec<u32>> {
        None
    }
}

/// Contender of this library as a caller uses it: a whole pipeline with a single stage.
struct Ours {
    scene: Scene,
    views: Vec<View>,
    simd: Simd,
    pipeline: Pipeline,
    set: VisibleSet,
    /// Whether `cull` also writes the ids of the visible boxes to `list`, within the measured time.
    listing: bool,
    list: Vec<u32>,
}

impl Ours {
    fn new(boxes: &[Aabb], views: &[View], simd: Simd, listing: bool) -> Self {
        let mut scene = Scene::new();
        scene.insert_batch(boxes.iter().copied());
        Self {
            scene,
            views: views.to_vec(),
            simd,
            pipeline: Pipeline::new().with(FrustumCuller::new().with_simd(simd)),
            set: VisibleSet::new(),
            listing,
            list: Vec::with_capacity(boxes.len()),
        }
    }
}

impl Contender for Ours {
    fn name(&self) -> String {
        let path = format!("{:?}", self.simd);
        let path = path.trim_start_matches("Simd(").trim_end_matches(')').to_string();
        format!("visibility, {path}{}", if self.listing { ", ids listed" } else { "" })
    }

    fn cull(&mut self, frame: usize) -> usize {
        let stats = self.pipeline.cull(&self.scene, &self.views[frame], &mut self.set);
        if self.listing {
            self.list.clear();
            // Internal iteration lets a chain of iterators run as plain loops.
            let list = &mut self.list;
            self.set.iter(&self.scene).for_each(|id| list.push(id.index() as u32));
        }
        stats.visible as usize
    }

    fn visible(&self) -> Option<Vec<u32>> {
        Some(if self.listing {
            self.list.clone()
        } else {
            self.set.iter(&self.scene).map(|id| id.index() as u32).collect()
        })
    }
}
