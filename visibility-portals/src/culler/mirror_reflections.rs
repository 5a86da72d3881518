//! Mirrors, treated as portals into the reflected scene (Luebke and Georges, 1995).
//!
//! Each mirror that is seen yields a view of its own: the view of the eye reflected in the plane of the
//! mirror, with this plane as a clip plane. The objects visible in the mirror are found by a walk that begins
//! in the mirror's cell, within the reflected window through which the mirror is seen. The reflected view
//! draws to the pixels that the mirror covers on the screen.

use super::hung_mirrors::MirrorId;
use super::outline::Outline;
use super::portal_stats::{NotCulled, PortalStats};
use super::portal_walk::{Narrowing, PortalWalk, SeenMirror};
use super::scene_cells::SceneCells;
use super::view_planes::{Lines, PortalView};
use super::walked_scene::WalkedScene;
use super::window_plane::{U, WindowPlane};
use alloc::vec::Vec;
use visibility_core::glam::{DMat4, DVec3};
use visibility_core::{Culler, FrustumCuller, Scene, View, VisibleSet, geometry::Plane, view::ViewError};

/// One mirror that is seen: the reflected view to draw with, and the objects visible in that view.
#[derive(Clone, Debug)]
pub struct Reflection {
    mirror: MirrorId,
    parent: Option<usize>,
    depth: u32,
    view: View,
    visible: VisibleSet,
}

impl Reflection {
    /// Returns the id of the mirror that is reflected in.
    pub fn mirror(&self) -> MirrorId {
        self.mirror
    }

    /// Returns the index in [`PortalEye::reflections`](super::portal_eye::PortalEye::reflections) of the
    /// reflection in which this mirror is seen. `None` if the eye sees the mirror directly.
    pub fn parent(&self) -> Option<usize> {
        self.parent
    }

    /// Returns the number of mirrors along the lines of sight of this reflection: 1 if the eye sees the
    /// mirror directly, one more than the parent's depth otherwise.
    pub fn depth(&self) -> u32 {
        self.depth
    }

    /// Returns the view to draw the reflection with, to the pixels that the mirror covers. The view mirrors
    /// space, so triangles change their winding. Its only clip plane cuts away what is behind the mirror; the
    /// clip planes of the eye's own view are not carried over.
    pub fn view(&self) -> &View {
        &self.view
    }

    /// Returns the objects to draw in the reflected view, as a [finished](VisibleSet::finish) set, which
    /// survives changes of the scene. Conservative: contains every object visible in the mirror, and
    /// undecided objects, except what
    /// [`cull_reflections`](super::portal_eye::PortalEye::cull_reflections) has removed.
    pub fn visible(&self) -> &VisibleSet {
        &self.visible
    }
}

/// Reflections of the last frame, and retained memory for later frames.
#[derive(Clone, Debug)]
pub(super) struct Reflections {
    all: Vec<Reflection>,
    /// Number of reflections of the last frame: the first entries of `all`.
    count: usize,
    walk: PortalWalk,
    /// Mirrors that were seen, each once for each chain of portals through which it was seen. An entry has
    /// the index in `all` of the reflection in which the mirror was seen (`None` for the eye's own view), and
    /// the mirror with its window (the part of the view that shows it).
    seen: Vec<(Option<usize>, SeenMirror)>,
    /// Planes that bound the windows in `seen`, anchor-relative (relative to the anchor of the view in which
    /// the mirror was seen).
    sides: Vec<WindowPlane>,
    max_count: usize,
    max_depth: u32,
}

impl Reflections {
    pub(super) fn new() -> Self {
        let (all, seen, sides) = (Vec::new(), Vec::new(), Vec::new());
        Self { all, count: 0, walk: PortalWalk::default(), seen, sides, max_count: 8, max_depth: 2 }
    }

    /// Returns an empty `Reflections`, without retained memory, that keeps the limits of `self`: the maximum
    /// number of reflections and of mirrors along a line of sight.
    pub(super) fn cleared(&self) -> Self {
        Self { max_count: self.max_count, max_depth: self.max_depth, ..Self::new() }
    }

    pub(super) fn set_limits(&mut self, max_count: usize, max_depth: u32) {
        (self.max_count, self.max_depth) = (max_count, max_depth);
    }

    /// Forgets the reflections of the last frame. A finished set makes the scene keep what it changes, so no
    /// set stays finished that the next frame might not fill again.
    pub(super) fn clear(&mut self, scene: &Scene) {
        self.all[..self.count].iter_mut().for_each(|one| one.visible.clear(scene));
        self.count = 0;
        self.seen.clear();
        self.sides.clear();
    }

    pub(super) fn as_slice(&self) -> &[Reflection] {
        &self.all[..self.count]
    }

    /// Removes from the set of each reflection of the last frame what `culler` removes in its view.
    pub(super) fn cull(&mut self, scene: &Scene, culler: &mut dyn Culler) {
        for one in &mut self.all[..self.count] {
            culler.cull(scene, &one.view, &mut one.visible);
            one.visible.finish(scene);
        }
    }

    /// Reflects the view in the mirrors that `walk` has met, and again in the mirrors that the reflections
    /// show, until a limit is reached. `known` holds `PortalEye::unknown` (by object index, the last frame in
    /// which the object was out of date) and the current frame number: objects whose entry equals the frame
    /// number stay visible. `settings` holds the narrowing and the maximum number of portals per walk. Adds
    /// to the counters in `stats`.
    #[expect(clippy::too_many_arguments)]
    pub(super) fn reflect_all(
        &mut self,
        cells: &SceneCells,
        scene: &Scene,
        view: &View,
        eye_view: &PortalView,
        walk: &PortalWalk,
        known: (&[u64], u64),
        settings: (Narrowing, u64),
        stats: &mut PortalStats,
    ) {
        self.collect_mirrors(None, walk);
        let mut next = 0;
        while next < self.seen.len() {
            // All windows through which one mirror is seen in one view are adjacent in `seen`.
            let (parent, mirror) = (self.seen[next].0, self.seen[next].1.mirror);
            let end = next
                + self.seen[next..].iter().take_while(|(p, m)| (*p, m.mirror) == (parent, mirror)).count();
            let windows = next..end;
            next = end;
            // The depth of mirrors in mirrors and the number of reflections are limited.
            let depth = parent.map_or(1, |parent| self.all[parent].depth + 1);
            if depth > self.max_depth || self.count == self.max_count {
                stats.reflections_left_out += 1;
                continue;
            }
            let parent_view = parent.map_or(*view, |parent| self.all[parent].view);
            let found = &cells.mirrors[mirror as usize];
            let (plane, error) = mirror_plane(found.vertices[0], &found.outline);
            let reflected = reflect(&parent_view, &plane, error);
            let parent_lines =
                if parent.is_some() { PortalView::new(&parent_view) } else { Some(eye_view.clone()) };
            let (Ok(view), Some(parent_lines)) = (reflected, parent_lines) else {
                stats.reflections_left_out += 1;
                continue;
            };
            stats.reflections += 1;
            // Reflections of earlier frames are overwritten, so that their sets keep their memory.
            let place = self.count;
            self.count += 1;
            if self.all.len() == place {
                let visible = VisibleSet::new();
                self.all.push(Reflection { mirror: MirrorId(mirror), parent, depth, view, visible });
            }
            let one = &mut self.all[place];
            (one.mirror, one.parent, one.depth, one.view) = (MirrorId(mirror), parent, depth, view);
            one.visible.fill(scene, &view);
            FrustumCuller::new().cull(scene, &view, &mut one.visible);
            let Some(eye_view) = PortalView::new(&view) else {
                // Mirrors in this one are not looked for.
                stats.reflections_left_out += 1;
                continue;
            };
            self.walk.begin(cells);
            let is_synced = !matches!(stats.fallback, Some(NotCulled::NotSynced));
            if is_synced {
                // From the mirrored eye, lines of sight begin in the mirror: the walk starts in each window
                // through which the mirror is seen, mirrored as well.
                for (_, seen) in &self.seen[windows] {
                    let sides = &self.sides[seen.window.sides.start as usize..seen.window.sides.end as usize];
                    let sides = sides.iter().map(|side| reflect_side(side, &plane, &parent_lines, &eye_view));
                    self.walk.start_in_window(cells, &eye_view, seen.cell, sides, seen.window.rectangle);
                }
            }
            // A walk that reaches the limit of steps hides nothing, and may have missed mirrors. The doors
            // and objects of cells that are not synced are unknown, so nothing is walked.
            if is_synced && self.walk.run(cells, &eye_view, settings.0, settings.1, stats) {
                let seen = WalkedScene { cells, scene, walk: &self.walk, eye_view: &eye_view };
                let (unknown, frame) = known;
                seen.retain(unknown, frame, &mut self.all[place].visible, &mut stats.tests);
            } else {
                self.walk.try_all_mirrors(cells, &eye_view);
            }
            let walk = core::mem::take(&mut self.walk);
            self.collect_mirrors(Some(place), &walk);
            self.walk = walk;
        }
        self.all[..self.count].iter_mut().for_each(|one| one.visible.finish(scene));
    }

    /// Appends the mirrors that `walk` has met to `seen`, sorted by mirror. `parent` is the index of the
    /// reflection that `walk` belongs to, `None` for the eye's own view.
    fn collect_mirrors(&mut self, parent: Option<usize>, walk: &PortalWalk) {
        let first = self.seen.len();
        for seen in &walk.mirrors {
            let start = self.sides.len() as u32;
            let sides = &seen.window.sides;
            self.sides.extend_from_slice(&walk.sides[sides.start as usize..sides.end as usize]);
            let mut seen = seen.clone();
            seen.window.sides = start..self.sides.len() as u32;
            self.seen.push((parent, seen));
        }
        self.seen[first..].sort_unstable_by_key(|(_, seen)| (seen.mirror, seen.window.sides.start));
    }
}

/// Returns the plane of a mirror, in world space, through its vertex `corner`, and a bound in world units on
/// the distance from that plane to the exact mirror.
fn mirror_plane(corner: DVec3, outline: &Outline) -> (Plane, f64) {
    let plane = Plane::through(corner, outline.normal);
    // The offset rounds as much as the distance of the vertex does.
    (plane, outline.error + plane.error_bound(corner.abs()))
}

/// Returns `view` reflected in `plane` (world space), with a clip plane that keeps points on the side that
/// the plane's normal points to, or behind the plane by at most `error` world units.
///
/// # Errors
/// A [`ViewError`] if the reflected matrix is not a valid view.
fn reflect(view: &View, plane: &Plane, error: f64) -> Result<View, ViewError> {
    let n = plane.normal;
    let offset = plane.signed_distance(view.origin());
    let columns = DVec3::AXES.map(|axis| (axis - n * (2.0 * n.dot(axis))).extend(0.0));
    let mirror = DMat4::from_cols(columns[0], columns[1], columns[2], (n * (-2.0 * offset)).extend(1.0));
    let matrix = view.clip_from(view.origin()) * mirror;
    // Terms of the offset may be far greater than the offset.
    let error = error + plane.error_bound(view.origin().abs());
    View::from_clip_from_world(matrix, view.depth())?
        .relative_to(view.origin())?
        .with_layers(view.layers())
        .with_clip_planes(&[Plane::new(n, offset + error)])
}

/// Reflects the plane `side` of a window in the mirror plane `plane`, which is in world space. `side` is
/// relative to the anchor of the view `from`, the result relative to the anchor of the reflected view `to`.
/// The result's error bounds cover those of `side`, the distance between the anchor of `to` and the exact
/// reflection of the anchor of `from`, the errors of both eyes, and rounding.
fn reflect_side(side: &WindowPlane, plane: &Plane, from: &PortalView, to: &PortalView) -> WindowPlane {
    // The rounding of the normal is `8u` of its length, with `u` the unit round-off 2^-53.
    let n = plane.normal;
    let turned = side.plane.normal - n * (2.0 * n.dot(side.plane.normal));
    let anchor = from.anchor - n * (2.0 * plane.signed_distance(from.anchor));
    let size = from.anchor.abs().max_element() + plane.offset.abs();
    let shift = to.anchor - anchor;
    let rounding = 32.0 * U * size + to.error + from.error;
    let (offset, slack) = match to.lines {
        // The anchors are eyes, and the plane passes through both.
        Lines::FromAnchor => (side.plane.offset, (1.0 + side.slope) * (shift.length() + rounding)),
        // Both views have one anchor, which may be far from its reflection.
        Lines::Along(..) => {
            let offset = side.plane.offset + turned.dot(shift);
            let of_offset = 32.0 * U * (shift.length() + side.plane.offset.abs());
            (offset, (1.0 + side.slope) * (rounding + of_offset) + side.slope * shift.length())
        }
    };
    WindowPlane { plane: Plane::new(turned, offset), slope: side.slope + 32.0 * U, slack: side.slack + slack }
}

#[cfg(test)]
mod tests {
    use super::*;
    use visibility_core::Pose;
    use visibility_core::geometry::DoubleDouble;
    use visibility_testing::Random;

    fn dot(a: DVec3, b: DVec3) -> DoubleDouble {
        let [x, y, z] = [0, 1, 2].map(|axis| DoubleDouble::product(a[axis], b[axis]));
        x.plus(y).plus(z)
    }

    fn view_from(eye: DVec3) -> View {
        let view = View::perspective(Pose::look_at(eye, eye + DVec3::X, DVec3::Z), 1.0, 1.0, 0.1, 100.0);
        view.unwrap()
    }

    fn outline(normal: DVec3, error: f64) -> Outline {
        Outline { normal, error, flaw: error, width: 1.0 }
    }

    /// Sets of reflections that are no longer seen are not finished: the scene would keep what it changes
    /// for them.
    #[test]
    fn sets_of_mirrors_that_are_no_longer_seen_are_not_finished() {
        let mut scene = Scene::new();
        scene.insert(visibility_core::Aabb::from_arrays([1.0; 3], [2.0; 3]));
        let view = view_from(DVec3::ZERO);
        let mut reflections = Reflections::new();
        for number in 0..3 {
            let mut visible = VisibleSet::new();
            visible.fill(&scene, &view);
            visible.finish(&scene);
            let mirror = MirrorId(number);
            reflections.all.push(Reflection { mirror, parent: None, depth: 1, view, visible });
        }
        let finished = |of: &Reflections| of.all.iter().filter(|one| one.visible.is_finished()).count();
        reflections.count = 3;
        assert_eq!((finished(&reflections), reflections.as_slice().len()), (3, 3), "after a frame");
        reflections.clear(&scene);
        assert_eq!((finished(&reflections), reflections.as_slice().len()), (0, 0), "at the next frame");
    }

    /// Vertices of a mirror are not cut away, nor what is within its error, where the terms of a plane's
    /// offset are far greater than the offset: for a corner, or for the origin of a view, far from the origin
    /// of the world and close to the plane. Compared in double-double numbers.
    #[test]
    fn reflections_show_what_is_within_the_error_of_the_mirror() {
        let mut random = Random(1);
        for trial in 0..4_000 {
            let far = random.vector([1.0, 1e6, 1e12][trial % 3]).round();
            let normal = far.cross(random.direction()).try_normalize().unwrap_or(DVec3::X);
            let (corner, origin) = if trial % 2 == 0 { (far, DVec3::ZERO) } else { (DVec3::ZERO, far) };
            let error = [0.0, 0.1][random.below(2)];
            let (plane, bound) = mirror_plane(corner, &outline(normal, error));
            let view = view_from(DVec3::ZERO).relative_to(origin).unwrap();
            let Ok(reflected) = reflect(&view, &plane, bound) else { continue };
            let [clip] = reflected.clip_planes() else { panic!("a reflection has one clip plane") };
            let at = dot(normal, corner).plus(dot(normal, origin).negated());
            let height = at.plus(DoubleDouble::from(clip.offset)).plus(DoubleDouble::from(-error)).hi;
            assert!(height >= -1e-15, "trial {trial}: {height} inside is what is {error} behind the mirror");
            assert!(height <= 1e-2, "trial {trial}: {height} inside is what is {error} behind the mirror");
        }
    }

    /// The plane of a window, reflected, holds the reflections of what it holds, moved by the errors of both
    /// eyes, which are large here. Half of an error would not do.
    #[test]
    fn reflected_planes_hold_reflected_points() {
        let mut random = Random(2);
        for trial in 0..10_000 {
            let (normal, of_side) = (random.direction(), random.direction());
            let [mut slack, mut of_from, mut of_to] = [0.0; 3];
            [&mut slack, &mut of_from, &mut of_to].into_iter().for_each(|error| *error = 0.1 * random.unit());
            let slope = random.range(0.0, 0.2);
            let side = WindowPlane { plane: Plane::new(of_side, random.range(-1.0, 1.0)), slope, slack };
            let plane = Plane::new(normal, random.range(-9.0, 9.0));
            let anchor = random.vector(9.0);
            let reflect = |p: DVec3| p - normal * (2.0 * plane.signed_distance(p));
            let view = |anchor, error| PortalView {
                anchor,
                error,
                ..PortalView::new(&view_from(DVec3::ZERO)).unwrap()
            };
            let (from, to) = (view(anchor, of_from), view(reflect(anchor) + random.vector(0.1), of_to));
            let reflected = reflect_side(&side, &plane, &from, &to);
            // A point at the greatest distance outside of the plane, moved outwards.
            let along = random.vector(9.0);
            let at = along - of_side * (side.plane.signed_distance(along) + 0.0);
            let at = at - of_side * (slack + slope * at.length());
            let moved = reflect(anchor + at) - (reflect(of_side) - reflect(DVec3::ZERO)) * (of_from + of_to);
            let at = moved - to.anchor;
            let (height, margin) = (reflected.plane.signed_distance(at), reflected.margin(at.length()));
            assert!(height >= -margin - 1e-9, "trial {trial}: {height} inside, {reflected:?} of {side:?}");
        }
    }

    /// The plane of a window of a parallel view, reflected, holds the reflections of what it holds, and
    /// nothing further out, though the view's anchor is not reflected.
    #[test]
    fn reflected_planes_of_parallel_views_hold_reflected_points_alone() {
        let mut random = Random(4);
        for trial in 0..10_000 {
            let (normal, of_side) = (random.direction(), random.direction());
            let slope = if trial % 2 == 0 { random.range(0.0, 0.2) } else { 0.0 };
            let slack = random.range(0.0, 0.1);
            let side = WindowPlane { plane: Plane::new(of_side, random.range(-99.0, 99.0)), slope, slack };
            let plane = Plane::new(normal, random.range(-99.0, 99.0));
            let view = |anchor| PortalView {
                anchor,
                error: 0.0,
                lines: Lines::Along(DVec3::X, 0.0),
                ..PortalView::new(&view_from(DVec3::ZERO)).unwrap()
            };
            let (from, to) = (view(random.vector(99.0)), view(random.vector(99.0)));
            let reflected = reflect_side(&side, &plane, &from, &to);
            // A point outside of the plane, by no more than its margin at the distance of the point.
            let along = random.vector(99.0);
            let flat = along - of_side * side.plane.signed_distance(along);
            let at = flat - of_side * (side.margin(flat.length()) / (1.0 + slope));
            let reflect = |p: DVec3| p - normal * (2.0 * plane.signed_distance(p));
            let seen = reflect(from.anchor + at) - to.anchor;
            let (height, margin) = (reflected.plane.signed_distance(seen), reflected.margin(seen.length()));
            assert!(height >= -margin - 1e-9, "trial {trial}: {height} inside, {reflected:?} of {side:?}");
            if slope == 0.0 {
                let height = height + margin;
                assert!(height < 1e-9, "trial {trial}: {height} more, {reflected:?} of {side:?}");
            }
        }
    }

    /// Without other errors, rounding of the reflection moves no point of a plane to its outer side. Compared
    /// in double-double numbers.
    #[test]
    fn reflected_planes_hold_points_in_spite_of_rounding() {
        let mut random = Random(3);
        let eye = |anchor| PortalView { anchor, error: 0.0, ..PortalView::new(&view_from(anchor)).unwrap() };
        for trial in 0..5_000 {
            let (normal, of_side) = (random.direction(), random.direction());
            let side = WindowPlane { plane: Plane::new(of_side, 0.0), slope: 0.0, slack: 0.0 };
            let anchored = eye(DVec3::ZERO);
            let plane = Plane::new(normal, 0.0);
            let turned = reflect_side(&side, &plane, &anchored, &anchored);
            // A point of the plane up to rounding, on its inner side.
            let point = random.fine_vector(1.0);
            let point = point - of_side * of_side.dot(point);
            let point = if dot(of_side, point).hi < 0.0 { -point } else { point };
            // Heights of the reflected point, times the square of the normal's length.
            let (square, twice) = (dot(normal, normal), dot(normal, point).scaled(-2.0));
            let turned_by = dot(turned.plane.normal, normal).times(twice);
            let height = dot(turned.plane.normal, point).times(square).plus(turned_by).hi;
            let margin = turned.slope * point.length();
            assert!(height >= -margin, "trial {trial}: {height} inside, {point} in {turned:?}");
            // The reflection of an anchor far away, in a plane across x.
            let (x, offset) = (1e6 * random.fine_unit(), random.fine_unit());
            let plane = Plane::new(DVec3::X, offset);
            let mirrored = x - 2.0 * (x + offset);
            let (from, to) = (eye(DVec3::new(x, 0.0, 0.0)), eye(DVec3::new(mirrored, 0.0, 0.0)));
            let moved = reflect_side(&side, &plane, &from, &to);
            let exact = DoubleDouble::from(-x).plus(DoubleDouble::from(-2.0 * offset));
            let off = exact.plus(DoubleDouble::from(-mirrored)).hi.abs();
            assert!(moved.slack >= off, "trial {trial}: an anchor is off by {off}, {moved:?}");
            // The offset of a plane far from the anchor of parallel views, moved by the little that the
            // anchor is off its reflection.
            let far = WindowPlane { plane: Plane::new(of_side, 1e6 * random.fine_unit()), ..side };
            let near = DVec3::X * random.fine_unit();
            let parallel = PortalView { lines: Lines::Along(DVec3::X, 0.0), ..eye(near) };
            let moved = reflect_side(&far, &plane, &parallel, &parallel);
            let twice = 2.0 * moved.plane.normal.x;
            let shift = DoubleDouble::product(twice, near.x).plus(DoubleDouble::product(twice, offset));
            let exact = shift.plus(DoubleDouble::from(far.plane.offset));
            let off = exact.plus(DoubleDouble::from(-moved.plane.offset)).hi.abs();
            assert!(moved.slack >= off, "trial {trial}: an offset is off by {off}, {moved:?}");
        }
    }
}
