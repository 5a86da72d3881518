//! Which way the polygon of a portal must be wound, as the bodies of its cells decide.
//!
//! A line of sight that passes a portal crosses its plane from the side of one cell to the side of the other.
//! No such line passes a portal that is wound the wrong way, so everything behind it would be hidden. A
//! cell's body that lies on one side of the plane shows which side belongs to that cell: all lines that enter
//! or leave the convex cell through the portal cross the plane there, whatever the other cell looks like.

use super::{CellGraph, CellGraphError, Portal, PortalId};
use crate::geometry::Plane;
use crate::pvs::Viewcell;
use crate::stamp::Stamp;
use alloc::vec::Vec;
use glam::DVec3;

impl CellGraph {
    /// Turns each portal whose polygon is wound the wrong way, so that its normal points from its first cell
    /// into its second. Returns the portals turned, ascending. `bodies[i]` is the body of cell `i` in world
    /// space. Bodies and portals may be misplaced by up to `tolerance` metres. Call this function before
    /// anything is baked from the graph.
    ///
    /// A body that lies on one side of the portal's plane decides how the portal is wound. A body that
    /// reaches across the plane, such as a courtyard around a house, or that is inverted, infinite or NaN,
    /// leaves the decision to the portal's other body. The portal need not touch the bodies, so walls may be
    /// thick; [`validate_bodies`](Self::validate_bodies) checks that portals lie in faces of the bodies. Time
    /// is linear in the numbers of portals and of their bodies' planes.
    ///
    /// # Errors
    /// [`CellGraphError::Bodies`] if there is not one body for each cell. [`CellGraphError::NotBetween`] for
    /// the first portal that neither body decides, or whose bodies lie on the same side of its plane. The
    /// graph then stays as it was.
    ///
    /// ```
    /// use visibility_core::{
    ///     cells::{CellGraph, CellId, PortalId}, geometry::ConvexPolygon, glam::DVec3, pvs::Viewcell,
    /// };
    /// let room = |x: f64| Viewcell::from_box(DVec3::new(x, 0.0, 0.0), DVec3::new(x + 4.0, 4.0, 3.0));
    /// // The door at x = 4 is wound clockwise as seen from the second room.
    /// let corners = [[1.0, 0.0], [1.0, 2.0], [2.0, 2.0], [2.0, 0.0]];
    /// let door = ConvexPolygon::new(corners.map(|[y, z]| DVec3::new(4.0, y, z)))?;
    /// let mut graph = CellGraph::new(2, [(door, [CellId(0), CellId(1)])])?;
    /// assert_eq!(graph.turn_portals(&[room(0.0), room(4.0)], 1e-6)?, [PortalId(0)]);
    /// assert_eq!(graph.portals()[0].plane().normal, DVec3::X);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn turn_portals(
        &mut self,
        bodies: &[Viewcell],
        tolerance: f64,
    ) -> Result<Vec<PortalId>, CellGraphError> {
        if bodies.len() != self.cell_count() {
            return Err(CellGraphError::Bodies { cells: self.cell_count(), bodies: bodies.len() });
        }
        let mut wrong = Vec::new();
        for (portal, id) in self.portals.iter().zip((0..).map(PortalId)) {
            match is_wound_wrong(portal, portal.cells.map(|cell| &bodies[cell.index()]), tolerance) {
                Some(true) => wrong.push(id),
                Some(false) => {}
                None => return Err(CellGraphError::NotBetween { portal: id, cells: portal.cells }),
            }
        }
        for id in &wrong {
            let portal = &mut self.portals[id.index()];
            portal.polygon.reverse();
            portal.plane = portal.polygon.plane().unwrap_or(portal.plane.flipped());
        }
        if !wrong.is_empty() {
            self.stamp = Stamp::new();
        }
        Ok(wrong)
    }
}

/// Returns true if the normal of a portal points from the side of the second body to the side of the first,
/// so that the portal must be turned; false if it points the right way. `None` if the bodies do not decide.
fn is_wound_wrong(portal: &Portal, [first, second]: [&Viewcell; 2], tolerance: f64) -> Option<bool> {
    let Portal { polygon, plane, .. } = portal;
    let vertices = polygon.vertices();
    let anchor = *vertices.first()?;
    let (mut defect, mut radius, mut magnitude) = (0.0f64, 0.0f64, 0.0f64);
    for &v in vertices {
        defect = defect.max(plane.normal.dot(v - anchor).abs());
        radius = radius.max((v - anchor).length());
        magnitude = magnitude.max(v.abs().element_sum());
    }
    // 16 epsilon is 32 roundings of 2^-53: enough for vertices that were rotated and moved in `f64`.
    let error = tolerance + defect + 16.0 * f64::EPSILON * magnitude;
    // Vertices off by `error` change the area vector by at most half the perimeter times `error`. The
    // perimeter of a convex polygon is at most pi times its diameter, and the diameter at most 2 `radius`. So
    // the plane tilts by less than 4 `radius` `error` / area.
    let tilt = 4.0 * radius * error / polygon.area();
    let beyond = |body: &Viewcell, normal: DVec3| {
        let reach = body.min.abs().max(body.max.abs()) + anchor.abs();
        // `2.0 * error` covers a misplaced body as well as a misplaced portal. `noise` covers six roundings
        // of 2^-53 in each of three coordinates.
        let noise = 32.0 * f64::EPSILON * reach.element_sum();
        let excess = greatest(body, normal, anchor) - (2.0 * error + tilt * reach_from(body, anchor) + noise);
        // The excess is NaN for a body that is infinite or NaN: such a body lies on no side.
        if excess.is_nan() { f64::INFINITY } else { excess }
    };
    // Distance in metres by which a body certainly reaches across the plane: `[0]` with the portal as wound,
    // `[1]` with it turned. At most 0 for a body that may lie on its own side.
    let along = [plane.normal, -plane.normal];
    let a = along.map(|n| beyond(first, n));
    let b = along.map(|n| beyond(second, -n));
    // A winding fits if one body lies on its own side of the plane, and the other body at least partly on the
    // opposite side.
    let fits = |i: usize| a[i] <= 0.0 && (b[i] <= 0.0 || b[1 - i] > 0.0) || b[i] <= 0.0 && a[1 - i] > 0.0;
    match [fits(0), fits(1)] {
        [false, false] => None,
        // Both windings fit a sliver, whose plane is hardly known. The better one has the body that reaches
        // least far across the plane.
        [true, true] => Some(a[1].min(b[1]) < a[0].min(b[0])),
        [as_wound, _] => Some(!as_wound),
    }
}

/// Returns an upper bound on `normal . (x - anchor)` for the points `x` of a body: the least bound that
/// follows from the body's box together with at most one of its planes. NaN or infinity for a body that is
/// inverted, infinite or NaN.
fn greatest(body: &Viewcell, normal: DVec3, anchor: DVec3) -> f64 {
    let (min, max) = (body.min - anchor, body.max - anchor);
    if !(body.min.cmple(body.max).all() && min.is_finite() && max.is_finite()) {
        return f64::NAN;
    }
    let of_box = |n: DVec3| (n * min).max(n * max).element_sum();
    let mut least = of_box(normal);
    for plane in body.planes.iter().filter_map(Plane::normalized) {
        let offset = plane.signed_distance(anchor);
        // In the body p . x + offset >= 0, and so n . x <= (n + k p) . x + k offset for each k >= 0. The
        // bound is convex in k and bends where a component vanishes: its least value is at one of these k.
        for k in [1.0].into_iter().chain((-normal / plane.normal).to_array()) {
            if k > 0.0 && k.is_finite() {
                least = least.min(of_box(normal + plane.normal * k) + k * offset);
            }
        }
    }
    least
}

/// Returns an upper bound on the distance of any point of a body from `anchor`, in metres.
fn reach_from(body: &Viewcell, anchor: DVec3) -> f64 {
    (body.min - anchor).abs().max((body.max - anchor).abs()).element_sum()
}
