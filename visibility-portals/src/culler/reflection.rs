//! Mirrors: portals into the same scene, seen from behind the glass (Luebke and Georges, 1995).
//!
//! A mirror that is seen gives a view of its own: that of the eye reflected in the plane of the mirror, with
//! this plane as a clip plane. What is seen in the mirror is found by a walk that begins in the mirror's
//! cell, within the window through which the mirror itself is seen. The reflected view draws to the pixels
//! where the mirror is on the screen.

use super::mirror::MirrorId;
use super::portal_stats::{NotCulled, PortalStats};
use super::portal_view::PortalView;
use super::portal_walk::{Narrowing, PortalWalk, SeenMirror};
use super::scene_cells::SceneCells;
use super::seen_objects::Seen;
use super::window_plane::{U, WindowPlane};
use alloc::vec::Vec;
use visibility_core::glam::{DMat4, DVec3};
use visibility_core::{Culler, FrustumCuller, Scene, View, VisibleSet, geometry::Plane, view::ViewError};

/// One mirror that is seen: the view to draw what it shows with, and the objects to draw.
#[derive(Clone, Debug)]
pub struct Reflection {
    mirror: MirrorId,
    parent: Option<usize>,
    depth: u32,
    view: View,
    visible: VisibleSet,
}

impl Reflection {
    /// The mirror.
    pub fn mirror(&self) -> MirrorId {
        self.mirror
    }

    /// Where the mirror is seen in another: the index of that reflection in
    /// [`PortalEye::reflections`](super::portal_eye::PortalEye::reflections). `None` where it is seen
    /// directly.
    pub fn parent(&self) -> Option<usize> {
        self.parent
    }

    /// The number of mirrors that lines of sight meet: 1 where the mirror is seen directly.
    pub fn depth(&self) -> u32 {
        self.depth
    }

    /// The view to draw the reflection with, to the pixels of the mirror. It mirrors space, so triangles wind
    /// the other way. Its clip plane cuts away what is behind the mirror, and takes the place of the clip
    /// planes of the eye's own view.
    pub fn view(&self) -> &View {
        &self.view
    }

    /// The objects to draw. Conservative.
    pub fn visible(&self) -> &VisibleSet {
        &self.visible
    }
}

/// Reflections of the last frame, and memory for more.
#[derive(Clone, Debug)]
pub(super) struct Reflections {
    all: Vec<Reflection>,
    /// How many of `all` are of the last frame.
    count: usize,
    walk: PortalWalk,
    /// Mirrors that were seen: the reflection they were seen in, if any, and the window.
    seen: Vec<(Option<usize>, SeenMirror)>,
    /// The planes of the windows of `seen`.
    sides: Vec<WindowPlane>,
    most: usize,
    deepest: u32,
}

impl Reflections {
    pub(super) fn new() -> Self {
        let (all, seen, sides) = (Vec::new(), Vec::new(), Vec::new());
        Self { all, count: 0, walk: PortalWalk::default(), seen, sides, most: 8, deepest: 2 }
    }

    /// The same limits, and no reflections.
    pub(super) fn anew(&self) -> Self {
        Self { most: self.most, deepest: self.deepest, ..Self::new() }
    }

    pub(super) fn limit(&mut self, most: usize, deepest: u32) {
        (self.most, self.deepest) = (most, deepest);
    }

    pub(super) fn clear(&mut self) {
        self.count = 0;
        self.seen.clear();
        self.sides.clear();
    }

    pub(super) fn as_slice(&self) -> &[Reflection] {
        &self.all[..self.count]
    }

    /// Reflects the view in the mirrors that a walk has met, and again in the mirrors that those show.
    #[expect(clippy::too_many_arguments)]
    pub(super) fn look(
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
        self.take(None, walk);
        let mut next = 0;
        while next < self.seen.len() {
            // All windows through which one mirror is seen in one view, which stand together.
            let (parent, mirror) = (self.seen[next].0, self.seen[next].1.mirror);
            let end = next
                + self.seen[next..].iter().take_while(|(p, m)| (*p, m.mirror) == (parent, mirror)).count();
            let windows = next..end;
            next = end;
            let depth = parent.map_or(1, |parent| self.all[parent].depth + 1);
            if depth > self.deepest || self.count == self.most {
                stats.reflections_left_out += 1;
                continue;
            }
            let parent_view = parent.map_or(*view, |parent| self.all[parent].view);
            let found = &cells.mirrors[mirror as usize];
            let plane = Plane::through(found.vertices[0], found.outline.normal);
            let reflected = reflect(&parent_view, &plane, found.outline.error);
            let parent_lines =
                if parent.is_some() { PortalView::new(&parent_view) } else { Some(eye_view.clone()) };
            let (Ok(view), Some(parent_lines)) = (reflected, parent_lines) else {
                stats.reflections_left_out += 1;
                continue;
            };
            stats.reflections += 1;
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
            if matches!(stats.fallback, Some(NotCulled::NotSynced)) {
                continue;
            }
            let Some(eye_view) = PortalView::new(&view) else { continue };
            self.walk.begin(cells);
            for (_, seen) in &self.seen[windows] {
                let sides = &self.sides[seen.window.sides.start as usize..seen.window.sides.end as usize];
                let sides = sides.iter().map(|side| reflect_side(side, &plane, &parent_lines, &eye_view));
                self.walk.start_within(cells, &eye_view, seen.cell, sides, seen.window.rectangle);
            }
            if self.walk.go(cells, &eye_view, settings.0, settings.1, stats) {
                let seen = Seen { cells, scene, walk: &self.walk, eye_view: &eye_view };
                let (unknown, frame) = known;
                seen.retain(unknown, frame, &mut self.all[place].visible, &mut stats.tests);
            } else {
                self.walk.look_at_all_mirrors(cells, &eye_view);
            }
            let walk = core::mem::take(&mut self.walk);
            self.take(Some(place), &walk);
            self.walk = walk;
        }
    }

    /// Adds the mirrors that a walk has met to `seen`; `parent` is the reflection of that walk.
    fn take(&mut self, parent: Option<usize>, walk: &PortalWalk) {
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

/// A view reflected in a plane. Shows what is before the plane, or behind it by at most `error`.
fn reflect(view: &View, plane: &Plane, error: f64) -> Result<View, ViewError> {
    let n = plane.normal;
    let offset = plane.signed_distance(view.origin());
    let columns = DVec3::AXES.map(|axis| (axis - n * (2.0 * n.dot(axis))).extend(0.0));
    let mirror = DMat4::from_cols(columns[0], columns[1], columns[2], (n * (-2.0 * offset)).extend(1.0));
    let matrix = view.clip_from(view.origin()) * mirror;
    View::from_clip_from_world(matrix, view.depth())?
        .relative_to(view.origin())?
        .with_layers(view.layers())
        .with_clip_planes(&[Plane::new(n, offset + error + 8.0 * U * offset.abs())])
}

/// A window's plane reflected in a mirror, for points relative to the anchor of the reflected view. Where
/// this anchor is not the exact reflection of the other one, the distance is part of the new plane's error;
/// so is the rounding of the normal, `8u`.
fn reflect_side(side: &WindowPlane, plane: &Plane, from: &PortalView, to: &PortalView) -> WindowPlane {
    let n = plane.normal;
    let turned = side.plane.normal - n * (2.0 * n.dot(side.plane.normal));
    let anchor = from.anchor - n * (2.0 * plane.signed_distance(from.anchor));
    let size = from.anchor.abs().max_element() + plane.offset.abs();
    let moved = (anchor - to.anchor).length() + 32.0 * U * size + to.error + from.error;
    WindowPlane {
        plane: Plane::new(turned, side.plane.offset),
        slope: side.slope + 32.0 * U,
        slack: side.slack + (1.0 + side.slope) * moved,
    }
}
