//! The occlusion seam: something that occluders are added to and boxes are tested against, and the one driver
//! that uses it.
//!
//! A z-pyramid, an opacity map, an occlusion tree, a set of shadow frusta and a graphics card's own queries
//! have this much in common (Cohen-Or, Chrysanthou, Silva and Durand, "A Survey of Visibility for Walkthrough
//! Applications", 2003, sections 5 and 6). Each implements [`OcclusionMap`]; [`OcclusionCuller`] chooses
//! occluders, walks the hierarchy and prunes.

mod culler;
mod inside_planes;
mod mesh;
mod mesh_build;
mod parts;
mod prepare;
mod queries;
mod selection;

pub use culler::OcclusionCuller;
pub use mesh::{Edge, MeshError, OccluderMesh};
pub use prepare::{Preparation, prepare};
pub use queries::{HardwareQueries, LateAnswers, QueryDevice};
pub use selection::Selection;

use crate::scene::{Boxes64, lanes};
use crate::{Aabb, Accuracy, View};
use glam::{Affine3A, DVec3};

/// What a map says of a box.
///
/// ```
/// use visibility_core::occlusion::Occlusion;
/// assert!(Occlusion::Hidden < Occlusion::Partial);
/// ```
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Hash)]
pub enum Occlusion {
    /// No point of the box can be seen: all of it lies strictly behind occluders.
    Hidden,
    /// Some of it may be seen: what it contains is worth testing by itself.
    Partial,
    /// Nothing in the map can hide any part of it: what it contains need not be tested.
    Visible,
}

/// What a map says of 64 boxes; a lane in neither mask is [`Occlusion::Partial`].
///
/// ```
/// use visibility_core::occlusion::Occlusion64;
/// let answer = Occlusion64 { hidden: 0b01, visible: 0b10 };
/// assert_eq!(answer.hidden & answer.visible, 0);
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Occlusion64 {
    /// The lanes that are [`Occlusion::Hidden`].
    pub hidden: u64,
    /// The lanes that are [`Occlusion::Visible`].
    pub visible: u64,
}

/// Something that occluders are added to and boxes are tested against.
///
/// A frame calls [`begin`](Self::begin), then [`add`](Self::add) any number of times and
/// [`flush`](Self::flush), after which [`test`](Self::test) takes into account what was added; more may be
/// added and flushed later in the frame.
///
/// ```
/// use visibility_core::{
///     glam::{Affine3A, DVec3}, occlusion::Occlusion, Aabb, Accuracy, OccluderMesh, OcclusionMap,
///     View,
/// };
/// /// A map that knows nothing, and so hides nothing.
/// struct Blank;
/// impl OcclusionMap for Blank {
///     fn name(&self) -> &str { "blank" }
///     fn accuracy(&self) -> Accuracy { Accuracy::Conservative }
///     fn begin(&mut self, _: &View, _: DVec3) {}
///     fn add(&mut self, _: &OccluderMesh, _: &Affine3A) {}
///     fn flush(&mut self) {}
///     fn test(&self, _: &Aabb) -> Occlusion { Occlusion::Partial }
/// }
/// ```
pub trait OcclusionMap {
    /// A short name, for tables and explanations.
    fn name(&self) -> &str;

    /// What its answers promise of the boxes that they hide.
    fn accuracy(&self) -> Accuracy;

    /// Empties the map for a frame. What is added and tested from here on is relative to `origin`, that of
    /// the scene.
    fn begin(&mut self, view: &View, origin: DVec3);

    /// Adds an occluder, placed by `transform` in scene coordinates. A transform that mirrors turns the order
    /// of corners round; the front stays the front.
    ///
    /// A map is responsible for its view's [clip planes](View::with_clip_planes), which the clip matrix does
    /// not contain: an occluder that is not [inside](OccluderMesh::is_inside) all of them is left out, since
    /// what they cut away is not drawn.
    fn add(&mut self, occluder: &OccluderMesh, transform: &Affine3A);

    /// What adding an occluder costs at most, in triangles: what a [budget](OcclusionCuller::with_budget) is
    /// spent on. A map that draws some meshes otherwise than triangle by triangle says so here.
    fn cost(&self, occluder: &OccluderMesh) -> usize {
        occluder.triangles().len()
    }

    /// Makes what was added so far count.
    fn flush(&mut self);

    /// What the map says of a box. One that reaches the eye or the near plane is at least
    /// [`Occlusion::Partial`], so that what lies inside it is looked at; an improper one is
    /// [`Occlusion::Visible`].
    fn test(&self, bounds: &Aabb) -> Occlusion;

    /// What the map says of those of 64 boxes that are set in `candidates`; other lanes are in neither mask.
    fn test_64(&self, boxes: &Boxes64, candidates: u64) -> Occlusion64 {
        let mut answer = Occlusion64::default();
        for lane in lanes(candidates) {
            match self.test(&boxes.get(lane)) {
                Occlusion::Hidden => answer.hidden |= 1 << lane,
                Occlusion::Visible => answer.visible |= 1 << lane,
                Occlusion::Partial => {}
            }
        }
        answer
    }

    /// Forgets what it remembers of earlier frames. The driver asks for it before the first frame of another
    /// scene.
    fn reset(&mut self) {}
}
