//! Rays in `f64` with bounds on their own rounding: a point counts as seen only if that is beyond doubt.

use visibility_core::glam::{DVec2, DVec3, Vec3};
use visibility_core::{Accuracy, View, pvs::Viewcell, view::Eye};
use visibility_examples::source::{SourceCells, clearance, tolerance};
use visibility_examples::walkthrough::World;
use visibility_testing::Random;

/// Points tried on each object.
const POINTS: usize = 6;

/// A random point of an object to which an unobstructed segment runs from the eye, inside the view, beyond
/// any doubt of rounding. For exact cullers, which may miss what is narrower than they say (of the one that
/// there is, a ten-millionth of half the picture), the same must be true of a disc about the point. The
/// segment is one that the rooms let pass. `rays` counts the segments that were in view.
pub(crate) fn seen_point(
    world: &World,
    view: &View,
    object: usize,
    accuracy: Accuracy,
    rooms: &Rooms,
    rng: &mut Random,
    rays: &mut usize,
) -> Option<DVec3> {
    let (source, origin) = (&world.source, world.origin());
    let triangles = &source.objects[object].triangles;
    if triangles.is_empty() {
        return None;
    }
    for _ in 0..POINTS {
        let which = rng.below(triangles.len());
        let [a, b, c] = triangles[which].map(|p| p.as_dvec3());
        let (mut u, mut v) = (rng.unit(), rng.unit());
        if u + v > 1.0 {
            (u, v) = (1.0 - u, 1.0 - v);
        }
        let point = a * (1.0 - u - v) + b * u + c * v;
        if !point.is_finite() || !surely_in_view(view, origin, point) {
            continue;
        }
        *rays += 1;
        let is_blocked = |point: DVec3| {
            sight_line(view, origin, point).is_none_or(|from| {
                if rooms.may_hide(&from, origin) {
                    return true;
                }
                source.objects.iter().enumerate().any(|(index, other)| {
                    (other.triangles.iter().enumerate()).any(|(number, triangle)| {
                        (index, number) != (object, which) && from.may_meet(triangle)
                    })
                })
            })
        };
        if is_blocked(point) {
            continue;
        }
        if accuracy == Accuracy::Exact {
            let around = disc(view, origin, [a, b, c], [u, v], NARROWEST);
            if around.is_none_or(|points| points.into_iter().any(is_blocked)) {
                continue;
            }
        }
        return Some(point);
    }
    None
}

/// The radius of that disc, in halves of the picture.
pub(crate) const NARROWEST: f64 = 2e-7;

/// Relative error of a sum of a few products, with much to spare.
const ROUNDING: f64 = 1e-11;

/// Points of a triangle around one of it, given by two of its weights, at a distance from it in the picture;
/// `None` unless all of them are on the triangle.
fn disc(
    view: &View,
    origin: DVec3,
    [a, b, c]: [DVec3; 3],
    [u, v]: [f64; 2],
    radius: f64,
) -> Option<[DVec3; 8]> {
    let place = |u: f64, v: f64| a * (1.0 - u - v) + b * u + c * v;
    let clip = view.clip_from(origin);
    let at = clip * place(u, v).extend(1.0);
    // How the place in the picture changes with the two weights.
    let [along, across] = [b - a, c - a].map(|side| {
        let d = clip * side.extend(0.0);
        (d.truncate().truncate() * at.w - at.truncate().truncate() * d.w) / (at.w * at.w)
    });
    let area = along.perp_dot(across);
    let mut points = [DVec3::ZERO; 8];
    for (point, number) in points.iter_mut().zip(0u8..) {
        let step = DVec2::from_angle(f64::from(number) * std::f64::consts::FRAC_PI_4) * radius;
        let (u, v) = (u + step.perp_dot(across) / area, v + along.perp_dot(step) / area);
        if !(u >= 0.0 && v >= 0.0 && u + v <= 1.0) {
            return None;
        }
        *point = place(u, v);
    }
    Some(points)
}

/// Inside all clip planes by more than rounding.
fn surely_in_view(view: &View, origin: DVec3, point: DVec3) -> bool {
    view.planes(origin).as_slice().iter().all(|plane| {
        let (n, d) = (plane.plane.normal, plane.plane.offset);
        let size = n.abs().dot(point.abs()) + d.abs();
        n.dot(point) + d > ROUNDING * size + plane.error
    })
}

/// From the point towards the eye, or against parallel lines of sight, until it has surely left the view:
/// what lies before the near plane hides nothing.
pub(crate) fn sight_line(view: &View, origin: DVec3, point: DVec3) -> Option<Segment> {
    let (to_eye, size, most) = match view.eye(origin) {
        Eye::Point(eye) => (eye - point, eye.abs() + point.abs(), 1.0),
        Eye::Direction(direction) => (-direction, direction.abs(), f64::INFINITY),
    };
    let steps = view.planes(origin).as_slice().iter().fold(most, |steps, plane| {
        let (n, d) = (plane.plane.normal, plane.plane.offset);
        let height = n.dot(point) + d + ROUNDING * (n.abs().dot(point.abs()) + d.abs()) + plane.error;
        let fall = -n.dot(to_eye) - ROUNDING * n.abs().dot(size);
        if fall > 0.0 { steps.min(height / fall * (1.0 + ROUNDING)) } else { steps }
    });
    let from = point + to_eye * steps;
    from.is_finite().then_some(Segment { from, to: point })
}

/// What cullers that look through portals are allowed: not to know a room's outside from its inside within a
/// tolerance; and, where sets are baked, not to count lines that pass an edge of a portal too closely.
#[derive(Default)]
pub(crate) struct Rooms {
    rooms: Vec<Viewcell>,
    tolerance: f64,
    edges: Vec<Segment>,
    clearance: f64,
}

impl Rooms {
    pub(crate) fn new(cells: &SourceCells, baked: bool) -> Self {
        let polygons = cells.graph.portals().iter().map(|portal| portal.polygon().vertices());
        let edge = |v: &[DVec3], i: usize| Segment { from: v[i], to: v[(i + 1) % v.len()] };
        let edges = polygons.flat_map(|v| (0..v.len()).map(move |i| edge(v, i)));
        Self {
            rooms: cells.viewcells.cells().to_vec(),
            tolerance: 4.0 * tolerance(&cells.viewcells),
            edges: if baked { edges.collect() } else { Vec::new() },
            clearance: clearance(&cells.viewcells),
        }
    }

    /// Whether a culler may not know of the segment, which is relative to the origin; false only if that is
    /// certain.
    fn may_hide(&self, segment: &Segment, origin: DVec3) -> bool {
        let segment = Segment { from: segment.from + origin, to: segment.to + origin };
        let size = segment.from.abs().max(segment.to.abs()).max_element();
        let start = segment.from;
        let is_close = |room: &Viewcell| {
            start.distance(start.clamp(room.min, room.max)) <= self.tolerance + 3e-14 * size
        };
        let begins_outside = !self.rooms.iter().any(|room| room.contains(start));
        begins_outside && self.rooms.iter().any(is_close)
            || self.edges.iter().any(|edge| {
                let distance = segment.distance(edge) - ROUNDING * size;
                distance <= self.clearance * 1.001 || distance.is_nan()
            })
    }
}

pub(crate) struct Segment {
    from: DVec3,
    to: DVec3,
}

impl Segment {
    /// Whether the segment passes through the triangle; true only if that is certain.
    pub(crate) fn surely_meets(&self, [a, b, c]: [DVec3; 3]) -> bool {
        let edges = [(a, b), (b, c), (c, a)].map(|(a, b)| side(self.from, self.to, a, b));
        let ends = [self.from, self.to].map(|p| side(a, b, c, p));
        edges[0].is_some()
            && edges.iter().all(|edge| *edge == edges[0])
            && matches!(ends, [Some(one), Some(other)] if one != other)
    }

    /// The least distance of two segments.
    fn distance(&self, other: &Self) -> f64 {
        let (u, v, w) = (self.to - self.from, other.to - other.from, self.from - other.from);
        let [uu, uv, vv, uw, vw] = [u.dot(u), u.dot(v), v.dot(v), u.dot(w), v.dot(w)];
        // The nearest point on this one to the other's line, then on the other, then back again, each kept
        // between the ends.
        let within = |x: f64| if x.is_nan() { 0.0 } else { x.clamp(0.0, 1.0) };
        let on_this = within((uv * vw - vv * uw) / (uu * vv - uv * uv));
        let on_other = within((vw + uv * on_this) / vv);
        let on_this = within((uv * on_other - uw) / uu);
        (w + u * on_this - v * on_other).length()
    }

    /// Whether the segment may meet the triangle; false only if that is certain.
    fn may_meet(&self, triangle: &[Vec3; 3]) -> bool {
        let corners = triangle.map(|p| p.as_dvec3());
        if corners.iter().any(|p| !p.is_finite()) {
            // It blocks nothing that could be computed, but what an engine draws of it is anyone's guess.
            return true;
        }
        // Beyond one of the six sides of the segment's box.
        let (low, high) = (self.from.min(self.to), self.from.max(self.to));
        if (0..3).any(|i| corners.iter().all(|p| p[i] < low[i]) || corners.iter().all(|p| p[i] > high[i])) {
            return false;
        }
        // The segment's line passes the edges on different sides.
        let signs = [(0, 1), (1, 2), (2, 0)].map(|(i, j)| side(self.from, self.to, corners[i], corners[j]));
        if signs.contains(&Some(1)) && signs.contains(&Some(-1)) {
            return false;
        }
        // Both ends are on one side of the triangle's plane.
        let [a, b, c] = corners;
        let ends = [self.from, self.to].map(|p| side(a, b, c, p));
        !(ends == [Some(1); 2] || ends == [Some(-1); 2])
    }
}

/// The sign of the volume of four points; `None` where rounding might have made it.
fn side(a: DVec3, b: DVec3, c: DVec3, d: DVec3) -> Option<i32> {
    let (u, v, w) = (b - a, c - a, d - a);
    let magnitude = a.abs();
    // The differences carry an error of a rounding of their operands.
    let (su, sv, sw) = (b.abs() + magnitude, c.abs() + magnitude, d.abs() + magnitude);
    let volume = u.dot(v.cross(w));
    let terms =
        |x: DVec3, y: DVec3| DVec3::new(x.y * y.z + x.z * y.y, x.z * y.x + x.x * y.z, x.x * y.y + x.y * y.x);
    let size = su.dot(terms(sv, sw));
    (size.is_finite() && size > 1e-290 && volume.abs() > ROUNDING * size).then_some(if volume > 0.0 {
        1
    } else {
        -1
    })
}
