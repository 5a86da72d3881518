//! The exact culler: a front-to-back walk of the scene's tree that inserts polygons into the beam tree.

use super::beams::{Beams, Glimpse, Visibility, VisiblePoint};
use super::screen_projection::{Extent, ProjectedPolygon, ScreenProjection};
use crate::scene_tree::{SceneTree, StaleObjects};
use crate::tree::{Fragment, Fragments, Subtree, TraversalStack, TreeVisitor};
use alloc::vec::Vec;
use core::borrow::Borrow;
use visibility_core::geometry::Plane;
use visibility_core::view::Eye;
use visibility_core::{Accuracy, CullStats, Culler, ObjectId, Scene, View, VisibleSet};

/// Removes every object of which no triangle part is visible, so that exactly the visible objects remain,
/// within the tolerance below.
///
/// Triangles of [one-sided](visibility_core::Object::one_sided) objects are seen from their front only, and
/// hide only from there; all other triangles are seen from both sides. The triangles of objects flagged as
/// occluders hide what lies behind them; the triangles of other objects are visible but hide nothing.
/// Triangles in one plane do not hide each other. An object counts as visible if it has no triangles, has a
/// triangle that is not finite or has no area, or has changed since the last [`sync`](SceneTree::sync) of the
/// tree.
///
/// # Tolerance
/// A gap or a visible part of a triangle narrower than 1e-7 of half the image (1/8000 of a pixel at 2560
/// pixels across) may be missed, such as a face seen edge on. In gaps, the image is divided further at lines
/// of polygons and of an 8 by 8 grid, and each part counts alone. Triangles of an object that are all so
/// narrow count by what they show together. An object wholly beyond the near plane whose whole box is that
/// narrow is reported visible. Where coordinates that the tree holds, or held lately, are so large that image
/// positions are not known to 1e-8 of half the image, every object stays visible. Triangles nearer to each
/// other than the [margin](crate::BspTree#robustness) of the tree's planes may hide each other in the wrong
/// order.
///
/// # Cost
/// About a microsecond per fragment that is visible or on the boundary of a visible region. Memory grows with
/// the number of such fragments.
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
    /// The tree of the scene's triangles, usually shared by the cullers of several views.
    shared: S,
    /// Objects that have changed since the tree was last synchronized with the scene; they stay visible and
    /// hide nothing.
    stale: StaleObjects,
    /// Stack of the walk through the BSP tree, kept between frames to avoid allocation.
    stack: TraversalStack,
    /// Memory of a frame, kept between frames to avoid allocation.
    scratch: Scratch,
}

/// Memory of the culler's walk, kept between frames: scratch memory, and `witnesses`, the visible points that
/// the last frame found.
#[derive(Clone, Debug, Default)]
struct Scratch {
    /// Beam tree of the present frame: the image area that nearer polygons cover.
    beams: Beams,
    /// The polygon projected last, with its scratch memory.
    image: ProjectedPolygon,
    /// Visibility state in the present frame, by object index.
    states: Vec<ObjectState>,
    /// What narrow fragments have shown of objects that are not surely seen.
    glimpses: Vec<Glimpse>,
    /// By object index: the object seen in the last frame and the position of its first visible part. `None`
    /// for an object that was hidden or not tested.
    witnesses: Vec<Option<(ObjectId, VisiblePoint)>>,
}

/// Visibility of an object in the present frame, as far as the walk has determined it.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum ObjectState {
    /// The walk has reached no fragment of the object.
    Unknown,
    /// The object is not in the incoming visible set, is on no layer of the view, or its triangles in the
    /// tree are missing or out of date. Its fragments are skipped.
    None,
    /// No fragment has been surely seen so far. `glimpse`: index in `Scratch::glimpses` of what fragments too
    /// narrow to be certain have shown in uncovered image area; `None` if none has.
    Hidden { surface: Surface, glimpse: Option<u32> },
    /// A fragment has been seen. Further fragments matter only if the object is an occluder.
    Seen { surface: Surface },
}

/// Sides from which an object is drawn and hides.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
struct Surface {
    /// True if the object hides others, false if it hides nothing.
    occluder: bool,
    /// True if fragments that turn their back to the eye are not drawn.
    one_sided: bool,
}

impl<S: Borrow<SceneTree>> NaylorCuller<S> {
    /// Creates the culler of one view. `shared` is the tree itself or a shared pointer to it.
    pub fn new(shared: S) -> Self {
        Self {
            shared,
            stale: StaleObjects::default(),
            stack: TraversalStack::new(),
            scratch: Scratch::default(),
        }
    }

    /// Returns the position in the image at which an object was first found visible in the last frame. `None`
    /// if the object was hidden, was visible only because its triangles are unknown or stale, or if the last
    /// frame culled nothing.
    pub fn witness(&self, id: ObjectId) -> Option<VisiblePoint> {
        let (seen, witness) = self.scratch.witnesses.get(id.index()).copied().flatten()?;
        (seen == id).then_some(witness)
    }

    /// Returns a mutable reference to the tree, or to the pointer to it, that [`new`](Self::new) was given.
    /// Assign through it to use another tree. If this culler owns the tree, call [`sync`](SceneTree::sync) on
    /// it. The change takes effect in the next frame.
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

    fn hides_behind_objects(&self) -> bool {
        true
    }

    fn cull(&mut self, scene: &Scene, view: &View, visible: &mut VisibleSet) -> CullStats {
        let Self { shared, stale, stack, scratch } = self;
        let shared = (*shared).borrow();
        scratch.witnesses.clear();
        let (bounds, magnitude) = (shared.tree().bounds(), shared.tree().magnitude());
        let Some(projection) = ScreenProjection::new(view, scene, &bounds, magnitude) else {
            return visible.retain(scene, |_, _| true);
        };
        stale.begin(shared, scene);
        scratch.glimpses.clear();
        scratch.states.clear();
        scratch.states.resize(scene.index_limit(), ObjectState::Unknown);
        scratch.witnesses.resize(scene.index_limit(), None);
        scratch.beams.begin(projection.error());
        let stats = CullStats::default();
        let eye = view.eye(scene.origin());
        let mut frame = Frame { shared, scene, view, eye, visible, stale, projection, scratch, stats };
        shared.tree().walk(eye, stack, &mut frame);
        let Frame { mut stats, projection, .. } = frame;
        let kept = visible.retain(scene, |id, bounds| match scratch.states[id.index()] {
            ObjectState::Seen { .. } => true,
            // A glimpsed part of a wide object is a face seen edge on, which does not count as visible.
            // `glimpse` decides only for a box that reaches in front of the near plane, whose width in the
            // image is unknown.
            ObjectState::Hidden { glimpse, .. } => projection.is_narrow(bounds).unwrap_or(glimpse.is_some()),
            _ => !stale.is_known(shared, id) || projection.is_narrow(bounds) == Some(true),
        });
        stats.visible = kept.visible;
        stats
    }
}

/// Inputs and state of one frame's walk through the BSP tree.
struct Frame<'a> {
    shared: &'a SceneTree,
    scene: &'a Scene,
    view: &'a View,
    /// Eye of the view, relative to the scene's origin.
    eye: Eye,
    visible: &'a VisibleSet,
    stale: &'a StaleObjects,
    projection: ScreenProjection,
    scratch: &'a mut Scratch,
    stats: CullStats,
}

impl Frame<'_> {
    /// Returns the state of the object with index `owner`, determined on the first call of a frame.
    /// `ObjectState::None` for an index beyond the scene's.
    fn state(&mut self, owner: u32) -> ObjectState {
        let Some(&state) = self.scratch.states.get(owner as usize) else { return ObjectState::None };
        if state != ObjectState::Unknown {
            return state;
        }
        let object = self.shared.object(owner).and_then(|id| Some((id, self.scene.object(id).ok()?)));
        let state = match object {
            Some((id, object))
                if self.stale.is_current(owner)
                    && object.layers & self.view.layers() != 0
                    && self.visible.contains(self.scene, id) =>
            {
                let is_known = !object.one_sided
                    || self.scene.triangles(id).is_ok_and(|triangles| triangles.has_certain_fronts());
                let occluder = self.scene.can_occlude(id) && is_known;
                let surface = Surface { occluder, one_sided: object.one_sided && is_known };
                ObjectState::Hidden { surface, glimpse: None }
            }
            _ => ObjectState::None,
        };
        self.scratch.states[owner as usize] = state;
        state
    }

    /// Projects a fragment, tests the fragment against the beam tree and updates the [`ObjectState`] of the
    /// object it belongs to. If `hides` is true and the object is an occluder, the fragment also covers image
    /// area. A fragment that can change neither the object's state nor the covered area is skipped.
    fn draw(&mut self, fragment: &Fragment<'_>, hides: bool) {
        let state = self.state(fragment.owner());
        let surface = match state {
            ObjectState::Unknown | ObjectState::None => return,
            ObjectState::Seen { surface } if !(hides && surface.occluder) => return,
            ObjectState::Seen { surface } | ObjectState::Hidden { surface, .. } => surface,
        };
        // Where rounding decides the side, the fragment's image is far narrower than the tolerance.
        if surface.one_sided && !is_front(&fragment.plane(), self.eye) {
            return;
        }
        let Scratch { beams, image, states, glimpses, witnesses } = &mut *self.scratch;
        if !self.projection.draw(fragment.vertices(), Extent::Greatest, image) {
            return;
        }
        self.stats.tests += 1;
        let covers = hides && surface.occluder;
        let visibility = if covers && image.is_whole {
            beams.test_and_cover(&image.polygon, image.error)
        } else {
            beams.test(&image.polygon)
        };
        // What is seen of it before it covers anything.
        let seen = (beams.witness, beams.glimpse);
        if covers && !image.is_whole && self.projection.draw(fragment.vertices(), Extent::Least, image) {
            beams.test_and_cover(&image.polygon, image.error);
            (beams.witness, beams.glimpse) = seen;
        }
        let ObjectState::Hidden { mut glimpse, .. } = state else { return };
        let owner = fragment.owner() as usize;
        let is_wide = visibility == Visibility::Glimpsed && {
            // A fragment among others in its plane counts twice, which only shows more.
            let index = *glimpse.get_or_insert(glimpses.len() as u32) as usize;
            if index == glimpses.len() {
                glimpses.push(Glimpse::default());
            }
            glimpses[index].add(&beams.glimpse);
            glimpses[index].is_wide()
        };
        states[owner] = if visibility == Visibility::Seen || is_wide {
            witnesses[owner] = self.shared.object(owner as u32).map(|id| (id, beams.witness));
            ObjectState::Seen { surface }
        } else {
            ObjectState::Hidden { surface, glimpse }
        };
    }
}

/// Tests whether the eye is on the front side of a plane, the side that the plane's normal points to. False
/// on the plane.
fn is_front(plane: &Plane, eye: Eye) -> bool {
    match eye {
        Eye::Point(eye) => plane.signed_distance(eye) > 0.0,
        Eye::Direction(forward) => plane.normal.dot(forward) < 0.0,
    }
}

impl TreeVisitor for Frame<'_> {
    fn enter(&mut self, subtree: &Subtree, _: u32) -> Option<u32> {
        if self.scratch.beams.is_closed() {
            return None;
        }
        self.stats.nodes += 1;
        if let Some(owner) = subtree.owner()
            && matches!(
                self.state(owner),
                ObjectState::None | ObjectState::Seen { surface: Surface { occluder: false, .. } }
            )
        {
            return None;
        }
        let Scratch { beams, image, .. } = &mut *self.scratch;
        let is_seen = self.projection.draw_box(subtree.bounds(), image)
            && matches!(beams.test(&image.polygon), Visibility::Seen | Visibility::Glimpsed);
        is_seen.then_some(0)
    }

    fn visit(&mut self, fragments: Fragments<'_>, _: u32) {
        // Coplanar fragments do not hide each other, so all are tested before any of them covers image area.
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

#[cfg(test)]
mod tests {
    use super::*;
    use std::vec::Vec;
    use visibility_core::glam::{DAffine3, DVec3, Vec3};
    use visibility_core::scene::{SharedTriangles, Triangle};
    use visibility_core::{Aabb, Object, Pose};

    /// A view from the origin along the x axis.
    fn view() -> View {
        let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
        View::perspective(pose, 1.2, 1.0, 0.1, f64::INFINITY).unwrap()
    }

    /// Returns a triangle across the x axis, counter-clockwise as seen from the origin.
    fn across(x: f32, size: f32) -> Triangle {
        [[2.0, -1.0], [-2.0, -1.0], [0.0, 2.0]].map(|[y, z]| Vec3::new(x, y * size, z * size))
    }

    fn insert(scene: &mut Scene, triangles: impl Into<SharedTriangles>, object: Object) -> ObjectId {
        let triangles = triangles.into();
        let id = scene.insert(Object { bounds: triangles.bounds(), ..object });
        scene.set_triangles(id, triangles).unwrap();
        id
    }

    const OBJECT: Object = Object::new(Aabb::EMPTY);
    const OCCLUDER: Object = Object { occluder: true, ..OBJECT };

    /// Returns which of some objects remain of all objects in a view of all layers.
    fn seen<const N: usize>(scene: &Scene, view: &View, ids: [ObjectId; N]) -> [bool; N] {
        let mut culler = NaylorCuller::new(SceneTree::new(scene).unwrap());
        let mut visible = VisibleSet::new();
        visible.fill(scene, &self::view());
        culler.cull(scene, view, &mut visible);
        for id in ids {
            assert!(
                culler.witness(id).is_none() || visible.contains(scene, id),
                "a witness of what is hidden"
            );
        }
        ids.map(|id| visible.contains(scene, id))
    }

    #[test]
    fn faces_in_one_plane_do_not_hide_each_other() {
        let mut scene = Scene::new();
        let faces = [3.0, 1.0, 2.0].map(|size| insert(&mut scene, [across(4.0, size)], OCCLUDER));
        let behind = insert(&mut scene, [across(5.0, 1.0)], OCCLUDER);
        let [a, b, c] = faces;
        assert_eq!(
            seen(&scene, &view(), [a, b, c, behind]),
            [true, true, true, false],
            "three faces in a plane"
        );
    }

    #[test]
    fn what_is_no_occluder_hides_nothing() {
        let mut scene = Scene::new();
        let glass = insert(&mut scene, [across(4.0, 3.0)], OBJECT);
        let behind = insert(&mut scene, [across(5.0, 1.0)], OBJECT);
        assert_eq!(seen(&scene, &view(), [glass, behind]), [true; 2], "behind glass");
        insert(&mut scene, [across(4.5, 3.0)], OCCLUDER);
        assert_eq!(seen(&scene, &view(), [glass, behind]), [true, false], "behind a wall behind glass");
    }

    /// Of an occluder that the near plane cuts, what is certainly beyond that plane hides; of one in the
    /// plane, nothing is.
    #[test]
    fn what_the_near_plane_cuts_hides_by_what_is_beyond_it() {
        let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
        let view = View::perspective(pose, 1.2, 1.0, 0.125, f64::INFINITY).unwrap();
        let floor =
            |x: [f32; 2], z: f32| [[[x[0], -9.0, z], [x[1], 0.0, z], [x[0], 9.0, z]].map(Vec3::from_array)];
        for (object, is_hidden) in [(OBJECT, false), (OCCLUDER, true)] {
            let mut scene = Scene::new();
            let pane = insert(&mut scene, [across(0.125, 3.0)], object);
            let behind = insert(&mut scene, [across(5.0, 1.0)], OBJECT);
            assert_eq!(seen(&scene, &view, [pane, behind]), [true; 2], "behind a pane in the near plane");

            let mut scene = Scene::new();
            let ground = insert(&mut scene, floor([-9.0, 90.0], -0.5), object);
            let below = insert(&mut scene, floor([3.0, 5.0], -1.0), OBJECT);
            let found = seen(&scene, &view, [ground, below]);
            assert_eq!(found, [true, !is_hidden], "below ground that the near plane cuts, of {object:?}");
        }
    }

    /// Lines of the tree have the error of the projection, and those of a polygon the error of its corners.
    #[test]
    fn lines_have_the_errors_of_what_is_projected() {
        let mut scene = Scene::new();
        insert(&mut scene, [across(4.0, 0.25)], OCCLUDER);
        let tree = SceneTree::new(&scene).unwrap();
        let projection = {
            let tree = tree.tree();
            ScreenProjection::new(&view(), &scene, &tree.bounds(), tree.magnitude()).unwrap()
        };
        let mut culler = NaylorCuller::new(tree);
        let mut visible = VisibleSet::new();
        visible.fill(&scene, &view());
        culler.cull(&scene, &view(), &mut visible);
        let (grid, polygon) = culler.scratch.beams.margins();
        assert!(
            grid.iter().all(|&margin| margin == 4.0 * projection.error()),
            "margins of the grid: {grid:?}"
        );
        // The error at 4 m is a 40th of that at the near plane.
        let error = culler.scratch.image.error;
        assert!((projection.error() / error / 40.0 - 1.0).abs() < 0.01, "{error} of {}", projection.error());
        let corners = &culler.scratch.image.polygon;
        assert_eq!((polygon.len(), corners.len()), (3, 3), "lines and corners of a triangle");
        for (i, margin) in polygon.iter().enumerate() {
            let (p, q) = (corners[i], corners[(i + 1) % 3]);
            let wanted = 4.0 * error * (1.0 + 5.8 / (q.x - p.x).hypot(q.y - p.y));
            assert!((margin / wanted - 1.0).abs() < 1e-9, "margin of edge {i}: {margin} of {wanted}");
        }
    }

    /// Lines of a polygon that the near plane cuts have the error of the corners that are left.
    #[test]
    fn lines_of_what_the_near_plane_cuts_have_its_errors() {
        let mut scene = Scene::new();
        let strip = [[-1.0, -0.2], [4.0, 0.0], [-1.0, 0.2]].map(|[x, y]| Vec3::new(x, y, -0.5));
        insert(&mut scene, [strip], OCCLUDER);
        let mut culler = NaylorCuller::new(SceneTree::new(&scene).unwrap());
        let mut visible = VisibleSet::new();
        visible.fill(&scene, &view());
        culler.cull(&scene, &view(), &mut visible);
        let (_, found) = culler.scratch.beams.margins();
        let image = &culler.scratch.image;
        assert!(!image.is_whole && found.len() >= 3, "{found:?} of {image:?}");
        for (i, margin) in found.iter().enumerate() {
            let (p, q) = (image.polygon[i], image.polygon[(i + 1) % image.polygon.len()]);
            let wanted = 4.0 * image.error * (1.0 + 5.8 / (q.x - p.x).hypot(q.y - p.y));
            assert!((margin / wanted - 1.0).abs() < 1e-9, "margin of edge {i}: {margin} of {wanted}");
        }
    }

    #[test]
    fn what_is_on_no_layer_of_the_view_hides_nothing() {
        let mut scene = Scene::new();
        let wall = insert(&mut scene, [across(4.0, 3.0)], Object { layers: 1, ..OCCLUDER });
        let behind = insert(&mut scene, [across(5.0, 1.0)], OBJECT);
        // The set has objects of all layers.
        for (layers, is) in [(1, false), (2, true), (3, false)] {
            let view = view().with_layers(layers);
            assert_eq!(seen(&scene, &view, [behind]), [is], "behind a wall, on layers {layers}");
        }
        assert_eq!(seen(&scene, &view(), [wall]), [true], "the wall");
    }

    /// A transform that flattens leaves open which side the front is on: the object is seen from both, and
    /// hides nothing.
    #[test]
    fn an_object_whose_fronts_are_uncertain_is_seen_from_both_sides() {
        let shared = SharedTriangles::from([across(0.0, 3.0)]);
        for one_sided in [false, true] {
            for (scale, turn, expected) in [
                (1.0, 0.0, [true, false]),
                (1.0, core::f64::consts::PI, if one_sided { [false, true] } else { [true, false] }),
                (0.0, 0.0, if one_sided { [true, true] } else { [true, false] }),
                (0.0, core::f64::consts::PI, if one_sided { [true, true] } else { [true, false] }),
            ] {
                let mut scene = Scene::new();
                let placed = DAffine3::from_translation(DVec3::X * 4.0)
                    * DAffine3::from_rotation_z(turn)
                    * DAffine3::from_scale(DVec3::new(scale, 1.0, 1.0));
                let face = insert(&mut scene, shared.placed(placed), Object { one_sided, ..OCCLUDER });
                let behind = insert(&mut scene, [across(5.0, 0.5)], OBJECT);
                let found = seen(&scene, &view(), [face, behind]);
                assert_eq!(found, expected, "one-sided: {one_sided}, scaled by {scale}, turned by {turn}");
            }
        }
    }

    /// An object whose box is so narrow that its faces may be missed is reported, hidden or not; so is one
    /// without faces, and one that is seen edge on.
    #[test]
    fn needles_are_visible_and_edges_are_not() {
        let needle = |x: f32, width: f32| {
            [[-0.5, 0.0], [0.5, 0.0], [0.5, 1.0]].map(|[y, t]| Vec3::new(x, y, width * t))
        };
        for wall in [false, true] {
            let mut scene = Scene::new();
            if wall {
                insert(&mut scene, [across(4.0, 3.0)], OCCLUDER);
            }
            let [thin, thick] = [5e-8, 1e-5].map(|width| insert(&mut scene, [needle(5.0, width)], OBJECT));
            // A face that is seen edge on, and one of no triangles at all.
            let edge = insert(&mut scene, [[Vec3::X * 5.0, Vec3::X * 6.0, Vec3::new(6.0, 1.0, 0.0)]], OBJECT);
            let empty = scene.insert(Aabb::from_arrays([5.0, 0.0, 0.0], [6.0, 0.5, 0.5]));
            let found = seen(&scene, &view(), [thin, thick, edge, empty]);
            assert_eq!(
                found,
                [true, !wall, true, true],
                "a needle, a strip, an edge and no face; wall: {wall}"
            );
        }
    }

    /// Behind a wall that covers the image, no fragment is looked at: a needle is reported all the same.
    #[test]
    fn needles_behind_a_covered_image_are_visible() {
        let mut scene = Scene::new();
        insert(&mut scene, [across(4.0, 9.0)], OCCLUDER);
        // The first strip divides the others from the wall.
        let [first, second, thin] = [(5.0, 1e-5), (6.0, 1e-5), (7.0, 5e-8)].map(|(x, width)| {
            let needle = [[-0.5, 0.0], [0.5, 0.0], [0.5, width]].map(|[y, z]| Vec3::new(x, y, z));
            insert(&mut scene, [needle], OBJECT)
        });
        let found = seen(&scene, &view(), [first, second, thin]);
        assert_eq!(found, [false, false, true], "two strips and a needle");
    }

    /// A strip of triangles each of which is narrower than the tolerance, all together are wider than that.
    #[test]
    fn narrow_triangles_are_seen_by_what_they_show_together() {
        for (count, is) in [(1, false), (40, true)] {
            for wall in [false, true] {
                let mut scene = Scene::new();
                // Each is 2e-8 wide in the image. The box of the object is not narrow, since a last triangle
                // reaches up.
                let triangles: Vec<Triangle> = (0..count)
                    .map(|i| {
                        let z = |k: i32| 2e-7 * (i + k) as f32;
                        [[-0.5, z(0)], [0.5, z(0)], [0.5, z(1)]].map(|[y, z]| Vec3::new(8.0, y, z))
                    })
                    .chain([[Vec3::new(8.0, 0.0, 0.0), Vec3::new(8.0, 1e-7, 0.0), Vec3::new(8.0, 0.0, 0.5)]])
                    .collect();
                let id = insert(&mut scene, triangles, OBJECT);
                if wall {
                    insert(&mut scene, [across(4.0, 3.0)], OCCLUDER);
                }
                let found = seen(&scene, &view(), [id]);
                assert_eq!(found, [is && !wall], "{count} triangles, wall: {wall}");
            }
        }
    }
}
