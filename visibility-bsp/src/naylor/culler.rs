//! The culler: a walk of the scene's tree, front to back, into the tree of the picture.

use super::beams::{Beams, Visibility, Witness};
use super::screen_projection::{ProjectedPolygon, ScreenProjection};
use crate::scene_tree::{SceneTree, StaleObjects};
use crate::tree::{Fragment, Fragments, Order, Subtree, Walk};
use alloc::vec::Vec;
use core::borrow::Borrow;
use visibility_core::{Accuracy, CullStats, Culler, ObjectId, Scene, View, VisibleSet};

/// Hides exactly those objects of which no part of a triangle is seen: what is left is the visible set.
///
/// Triangles have two faces. Those of objects that are flagged as occluders hide what is behind them; the
/// others are only seen. Of triangles in one plane none hides another. Objects without triangles, with broken
/// ones, or that have changed since the [tree](SceneTree::sync) was brought up to date, are visible.
///
/// # Tolerance
/// What is narrower than a ten-millionth of half the picture, an 8000th of a pixel of 2560, may be missed,
/// such as gaps and faces seen edge on; but not an object before the near plane whose whole box is no wider:
/// that one is reported. Where the coordinates of the scene are so large that single precision of the picture
/// is not to be had, nothing is hidden.
///
/// # Cost
/// Follows what is seen: about a microsecond for each fragment that is visible or on the boundary of what is;
/// memory likewise.
///
/// ```
/// use visibility_bsp::{NaylorCuller, SceneTree};
/// use visibility_core::{glam::{DVec3, Vec3}, Aabb, Object, Pipeline, Pose, Scene, View, VisibleSet};
/// let mut scene = Scene::new();
/// let [near, far] = [(2.0, 3.0), (4.0, 5.0)].map(|(x, r): (f32, f32)| {
///     let bounds = Aabb::from_arrays([x, -r, -r], [x, r, r]);
///     let id = scene.insert(Object { occluder: true, ..Object::new(bounds) });
///     let triangle = [[0.0, 1.0], [-1.0, -1.0], [1.0, -1.0]].map(|[y, z]| Vec3::new(x, y * r, z * r));
///     scene.set_triangles(id, [triangle]).unwrap();
///     id
/// });
/// let mut pipeline = Pipeline::new().with(NaylorCuller::new(std::sync::Arc::new(SceneTree::new(&scene)?)));
/// let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
/// let view = View::perspective(pose, 1.5, 1.0, 0.1, f64::INFINITY)?;
/// let mut visible = VisibleSet::new();
/// pipeline.cull(&scene, &view, &mut visible);
/// assert!(visible.contains(&scene, near) && !visible.contains(&scene, far));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct NaylorCuller<S> {
    shared: S,
    stale: StaleObjects,
    order: Order,
    beams: Beams,
    image: ProjectedPolygon,
    /// By object index: the state of the object in this frame.
    parts: Vec<Part>,
    /// By index: the object that was seen in the last frame, and where it was seen first.
    witnesses: Vec<Option<(ObjectId, Witness)>>,
}

/// State of an object in a frame.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Part {
    /// None of its fragments has been reached.
    Unknown,
    /// Not in the set, or not in the tree as it is in the scene: its fragments are skipped.
    None,
    /// No part of it was surely seen so far.
    Hidden { occluder: bool, glimpsed: bool },
    /// A part of it was seen.
    Seen { occluder: bool },
}

impl<S: Borrow<SceneTree>> NaylorCuller<S> {
    /// For one view.
    pub fn new(shared: S) -> Self {
        Self {
            shared,
            stale: StaleObjects::default(),
            order: Order::new(),
            beams: Beams::default(),
            image: ProjectedPolygon::default(),
            parts: Vec::new(),
            witnesses: Vec::new(),
        }
    }

    /// Where an object was seen in the last frame, before all of its other parts; `None` if it was hidden, or
    /// is visible only because nothing is known of it.
    pub fn witness(&self, id: ObjectId) -> Option<Witness> {
        let (seen, witness) = self.witnesses.get(id.index()).copied().flatten()?;
        (seen == id).then_some(witness)
    }

    /// The tree, to replace it, or to bring it up to date if it is this culler's own.
    pub fn shared_mut(&mut self) -> &mut S {
        &mut self.shared
    }
}

impl<S: Borrow<SceneTree>> Culler for NaylorCuller<S> {
    fn name(&self) -> &str {
        "naylor"
    }

    fn accuracy(&self) -> Accuracy {
        Accuracy::Exact
    }

    fn cull(&mut self, scene: &Scene, view: &View, visible: &mut VisibleSet) -> CullStats {
        let Self { shared, stale, order, beams, image, parts, witnesses } = self;
        let shared = (*shared).borrow();
        witnesses.clear();
        let Some(projection) = ScreenProjection::new(view, scene, &shared.tree().bounds()) else {
            return visible.retain(scene, |_, _| true);
        };
        stale.begin(shared, scene);
        parts.clear();
        parts.resize(scene.index_limit(), Part::Unknown);
        witnesses.resize(scene.index_limit(), None);
        beams.begin(projection.error());
        let mut frame = Frame {
            shared,
            scene,
            view,
            visible,
            stale,
            projection,
            beams,
            image,
            parts,
            witnesses,
            stats: CullStats::default(),
        };
        shared.tree().walk(view.eye(scene.origin()), order, &mut frame);
        let Frame { mut stats, projection, .. } = frame;
        let kept = visible.retain(scene, |id, bounds| match parts[id.index()] {
            Part::Seen { .. } => true,
            // Of other objects, what is glimpsed are faces that are seen edge on.
            Part::Hidden { glimpsed, .. } => projection.is_narrow(bounds).unwrap_or(glimpsed),
            _ => !stale.is_known(shared, id) || projection.is_narrow(bounds) == Some(true),
        });
        stats.visible = kept.visible;
        stats
    }
}

struct Frame<'a> {
    shared: &'a SceneTree,
    scene: &'a Scene,
    view: &'a View,
    visible: &'a VisibleSet,
    stale: &'a StaleObjects,
    projection: ScreenProjection,
    beams: &'a mut Beams,
    image: &'a mut ProjectedPolygon,
    parts: &'a mut [Part],
    witnesses: &'a mut [Option<(ObjectId, Witness)>],
    stats: CullStats,
}

impl Frame<'_> {
    fn part(&mut self, owner: u32) -> Part {
        let Some(&part) = self.parts.get(owner as usize) else { return Part::None };
        if part != Part::Unknown {
            return part;
        }
        let object = self.shared.object(owner).and_then(|id| Some((id, self.scene.object(id).ok()?)));
        let part = match object {
            Some((id, object))
                if self.stale.is_current(owner)
                    && object.layers & self.view.layers() != 0
                    && self.visible.contains(self.scene, id) =>
            {
                Part::Hidden { occluder: object.occluder, glimpsed: false }
            }
            _ => Part::None,
        };
        self.parts[owner as usize] = part;
        part
    }

    /// Draws a fragment, as far as it matters: to see whether it is seen, or for what it hides.
    fn draw(&mut self, fragment: &Fragment<'_>, hides: bool) {
        let part = self.part(fragment.owner());
        let occluder = match part {
            Part::Unknown | Part::None => return,
            Part::Seen { occluder: false } => return,
            Part::Seen { .. } if !hides => return,
            Part::Seen { occluder } | Part::Hidden { occluder, .. } => occluder,
        };
        if !self.projection.draw(fragment.vertices(), self.image) {
            return;
        }
        self.stats.tests += 1;
        let polygon = self.image.polygon();
        let visibility = if hides && occluder {
            self.beams.add(polygon, self.image.error())
        } else {
            self.beams.look(polygon)
        };
        let Part::Hidden { glimpsed, .. } = part else { return };
        let owner = fragment.owner() as usize;
        self.parts[owner] = if visibility == Visibility::Seen {
            self.witnesses[owner] = self.shared.object(owner as u32).map(|id| (id, self.beams.witness()));
            Part::Seen { occluder }
        } else {
            Part::Hidden { occluder, glimpsed: glimpsed || visibility == Visibility::Glimpsed }
        };
    }
}

impl Walk for Frame<'_> {
    fn enter(&mut self, subtree: &Subtree, _: u32) -> Option<u32> {
        if self.beams.is_closed() {
            return None;
        }
        self.stats.nodes += 1;
        if let Some(owner) = subtree.owner()
            && matches!(self.part(owner), Part::None | Part::Seen { occluder: false })
        {
            return None;
        }
        let is_seen = self.projection.draw_box(subtree.bounds(), self.image)
            && matches!(self.beams.look(self.image.polygon()), Visibility::Seen | Visibility::Glimpsed);
        is_seen.then_some(0)
    }

    fn visit(&mut self, fragments: Fragments<'_>, _: u32) {
        // Of two in one plane none hides the other: all are looked at before any hides.
        if fragments.clone().nth(1).is_some() {
            for fragment in fragments.clone() {
                self.draw(&fragment, false);
            }
        }
        for fragment in fragments {
            self.draw(&fragment, true);
        }
    }
}
