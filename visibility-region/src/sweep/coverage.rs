//! Extended projections of occluders: the pixels of a plane through which no ray from the viewcell passes
//! unblocked.
//!
//! After Durand, Drettakis, Thollot and Puech, "Conservative Visibility Preprocessing Using Extended
//! Projections", 2000, sections 3.2 and 3.3, with a rule for coverage that also holds for concave, open and
//! thin meshes:
//!
//! The *chain* of a mesh consists of its triangles that face the whole viewcell, cut off at the plane. For a
//! ray from viewpoint v to point p of the plane, count the triangles of the chain that the ray crosses. The
//! count can change with v and p only where the ray crosses a *contour* edge: an edge with one triangle of
//! the chain, or a cut. (Across an edge of two triangles the ray leaves one and enters the other, since both
//! face the viewpoint.) If no viewpoint sees a contour edge in a pixel, the count is the same for all rays
//! through the pixel. If one of these rays certainly crosses a triangle, all do. A pixel is therefore covered
//! if a ray from the middle of the viewcell's front crosses a triangle of the chain in the pixel, and no
//! contour edge, swept over all viewpoints and widened by the bound on rounding, meets the pixel.

use super::direction::Direction;
use super::hull_raster::{Spread, draw_hull};
use super::pixel_block::PixelBlock;
use super::polygon::{Polygon, Sides, cut};
use super::ray_map::{PixelRect, RayMap, SIDE};
use super::window::{FARTHEST_PIXEL, Window};
use alloc::vec::Vec;
use visibility_core::glam::{DVec3, Vec3};

/// Corners of a triangle or ends of an edge in local coordinates. Then the same points relative to the
/// scene's origin, if they are known there without rounding.
pub(super) type Corners<'a, const N: usize> = ([DVec3; N], Option<&'a [Vec3]>);

/// Two maps on which one piece of an occluder is drawn: the inside of its triangles, and its contour.
#[derive(Clone, Debug)]
pub(super) struct PieceMaps {
    inside: PixelBlock,
    contour: PixelBlock,
    sides: Sides,
    /// Scratch memory: what is left of each triangle that is cut, with its flags of [`outside`].
    cut: Vec<(Polygon, [bool; 2])>,
}

/// Data for drawing one occluder on one plane.
pub(super) struct Target<'a> {
    pub(super) direction: &'a Direction,
    pub(super) window: &'a Window,
    /// Depth in metres at which the near ends of the occluder's triangles are cut off.
    pub(super) near: f64,
    /// Pixels that the occluder may cover. No other pixel is drawn.
    pub(super) rect: PixelRect,
}

impl PieceMaps {
    pub(super) fn new() -> Self {
        Self {
            inside: PixelBlock::new(),
            contour: PixelBlock::new(),
            sides: [[0.0; SIDE]; 2],
            cut: Vec::new(),
        }
    }

    /// Adds to `map` the pixels that a piece of an occluder covers. `triangles` are the piece's triangles and
    /// `contour` its boundary edges, neither of them cut yet. Returns whether any pixel was added.
    pub(super) fn draw<'a>(
        &mut self,
        map: &mut RayMap,
        target: &Target<'_>,
        triangles: impl Iterator<Item = Corners<'a, 3>>,
        contour: impl Iterator<Item = Corners<'a, 2>>,
    ) -> bool {
        let Target { window, near, rect, .. } = *target;
        let mut filled = false;
        self.inside.begin(rect);
        self.cut.clear();
        for (triangle, exact) in triangles {
            let is_between = triangle.iter().all(|p| p.z > near && p.z < window.d);
            let polygon = Polygon::cut(triangle, near, window.d);
            if triangle.iter().any(|p| p.z < window.d) && triangle.iter().any(|p| p.z > near) {
                filled |= polygon.fill(&mut self.inside, &mut self.sides, map, window, rect);
            }
            if !is_between && !polygon.points().is_empty() {
                self.cut.push((polygon, outside(window, exact)));
            }
        }
        if !filled || !self.inside.exceeds(map) {
            return false;
        }
        self.contour.begin(rect);
        let Self { contour: block, cut, .. } = self;
        let known = cut.iter().all(|(polygon, outside)| sweep_cuts(block, target, polygon, *outside))
            && contour
                .into_iter()
                .all(|([a, b], exact)| sweep_edge(block, target, a, b, outside(window, exact)));
        known && self.inside.add_without(&self.contour, map)
    }
}

/// Returns, for lateral axes x and y, whether points are on the outer side of the window's rim, see
/// [`Window::is_outside`]. False without exact points.
fn outside(window: &Window, exact: Option<&[Vec3]>) -> [bool; 2] {
    exact.map_or([false; 2], |points| window.is_outside(points))
}

/// Draws on `contour` the edges that arise where a triangle is cut, at the depth of the projection plane and
/// at the near depth of `target`. `polygon` is what is left of the triangle. The triangle's own edges are not
/// drawn. `outside`: for lateral axes x and y, whether the whole triangle is on the outer side of the
/// window's rim, see [`Window::is_outside`]. Returns false if a projected position is too far away for its
/// precision.
fn sweep_cuts(contour: &mut PixelBlock, target: &Target<'_>, polygon: &Polygon, outside: [bool; 2]) -> bool {
    let Target { window, near, .. } = *target;
    let points = polygon.points();
    points.iter().enumerate().all(|(i, &a)| {
        let b = points[(i + 1) % points.len()];
        let cut = (a.z == near && b.z == near) || (a.z == window.d && b.z == window.d);
        !cut || sweep_edge(contour, target, a, b, outside)
    })
}

/// Draws on `contour` the pixels in which any viewpoint of the cell sees a contour edge from `a` to `b`. Only
/// the part of the edge between the near depth of `target` and the projection plane counts. `outside`: for
/// lateral axes x and y, whether the whole edge is on the outer side of the window's rim. Returns false if a
/// projected position is too far away for its precision.
fn sweep_edge(contour: &mut PixelBlock, target: &Target<'_>, a: DVec3, b: DVec3, outside: [bool; 2]) -> bool {
    let Target { direction, window, near, rect } = *target;
    let (mut a, mut b) = if a.z <= b.z { (a, b) } else { (b, a) };
    if b.z < near || a.z > window.d {
        return true;
    }
    if b.z > window.d {
        b = cut(a, b, window.d);
    }
    if a.z < near {
        a = cut(a, b, near);
    }
    let spread = |p: DVec3| -> Spread {
        let factors = direction.beyond(p.z, window.d);
        [0, 1].map(|lat| {
            let range = window.widened(direction.spread(p[lat], lat, factors), lat);
            if outside[lat] { window.clip_outwards(range, lat) } else { range }
        })
    };
    let (p, q) = (spread(a), spread(b));
    if !p.iter().chain(&q).flatten().all(|x| x.abs() < FARTHEST_PIXEL) {
        return false;
    }
    draw_hull(contour, &p, &q, rect);
    true
}
