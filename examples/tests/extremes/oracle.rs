//! Visibility oracle by rays in f64, with bounds on its own rounding: a point counts as visible only if
//! rounding leaves no doubt.

use visibility_core::glam::{DVec2, DVec3, Vec3};
use visibility_core::{Accuracy, View, pvs::Viewcell, view::Eye};
use visibility_examples::source::{SourceCells, clearance};
use visibility_examples::walkthrough::World;
use visibility_portals::SceneCells;
use visibility_testing::Random;

/// Number of random points tried on each object.
const POINTS: usize = 6;

/// Searches for a point of an object that is certainly visible despite rounding: an unobstructed segment runs
/// to it from the eye, inside the view. `None` if no random point is.
///
/// For an exact culler, which may miss narrow gaps (one that promises exactness misses at most a
/// ten-millionth of half the picture), a disc around the point must be visible, too. The segment must be one
/// that `rooms` do not allow a culler to miss. `object` is an index; `rays` is increased by the number of
/// segments in view. The point is relative to the scene's origin.
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
        let [a, b, c] = triangles.view().get(which).unwrap().map(|p| p.as_dvec3());
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
                        (index, number) != (object, which) && from.may_meet(&triangle)
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

/// Searches for a segment from a viewcell to an object that is certainly unobstructed despite rounding.
/// `None` if no random segment is, or the viewcell has no finite point. `object` is an index; `rays` is
/// increased by the number of segments tried. The ends of the segment are relative to the scene's origin.
pub(crate) fn sight_from_cell(
    world: &World,
    cell: &Viewcell,
    object: usize,
    rng: &mut Random,
    rays: &mut usize,
) -> Option<[DVec3; 2]> {
    let source = &world.source;
    let triangles = &source.objects[object].triangles;
    if triangles.is_empty() || !cell.min.cmple(cell.max).all() {
        return None;
    }
    (0..POINTS).find_map(|_| {
        // Viewpoints are often at corners, on edges and on faces, from where most is visible.
        let part = DVec3::from_array([0, 1, 2].map(|_| {
            let within = rng.unit();
            rng.pick(&[0.0, 1.0, within])
        }));
        let eye = (cell.min * (1.0 - part) + cell.max * part).clamp(cell.min, cell.max);
        let is_inside = cell.planes.iter().all(|plane| {
            let size = plane.normal.abs().dot(eye.abs()) + plane.offset.abs();
            // A plane that cannot be normalized cuts nothing off.
            plane.signed_distance(eye) > ROUNDING * size || plane.normalized().is_none()
        });
        let which = rng.below(triangles.len());
        let corners = triangles.view().get(which).unwrap().map(|p| p.as_dvec3());
        let (u, v) = (rng.unit(), rng.unit());
        let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
        let segment = Segment {
            from: eye - world.origin(),
            to: corners[0] * (1.0 - u - v) + corners[1] * u + corners[2] * v,
        };
        if !(is_inside && segment.from.is_finite() && segment.to.is_finite()) {
            return None;
        }
        *rays += 1;
        let is_blocked = source.objects.iter().enumerate().any(|(index, other)| {
            let all = other.triangles.iter().enumerate();
            all.into_iter()
                .any(|(number, triangle)| (index, number) != (object, which) && segment.may_meet(&triangle))
        });
        (!is_blocked).then_some([segment.from, segment.to])
    })
}

/// Radius in NDC of the disc that must be visible for exact cullers: twice the width that they may miss.
pub(crate) const NARROWEST: f64 = 2e-7;

/// Relative error bound of a sum of a few products, with a large margin over the few ulps that such a sum can
/// lose.
const ROUNDING: f64 = 1e-11;

/// Returns eight points of the triangle `a`, `b`, `c` on a circle in the picture around one of its points.
/// The point has the weights `u` of `b` and `v` of `c`, and `radius` is in NDC. `None` unless all eight
/// points are on the triangle.
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
    // Derivatives of the NDC position by the two weights.
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

/// Tests whether a point is inside all clip planes by more than the rounding error. The point is relative to
/// `origin`.
fn surely_in_view(view: &View, origin: DVec3, point: DVec3) -> bool {
    view.planes(origin).as_slice().iter().all(|plane| {
        let (n, d) = (plane.plane.normal, plane.plane.offset);
        let size = n.abs().dot(point.abs()) + d.abs();
        n.dot(point) + d > ROUNDING * size + plane.error
    })
}

/// Returns the segment to a point from the near end of its view ray, where the ray has surely left the view;
/// surfaces in front of the near plane hide nothing. In a parallel view the ray runs against the view
/// direction. `None` if the segment is not finite. Coordinates are relative to `origin`.
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

/// Segments that a portal culler may miss without being wrong: those from an eye outside all rooms but within
/// a tolerance of one, and, for baked sets, those that pass a portal edge within the clearance. The default
/// allows none.
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
            tolerance: 4.0 * SceneCells::usual_tolerance(&cells.viewcells),
            edges: if baked { edges.collect() } else { Vec::new() },
            clearance: clearance(&cells.viewcells),
        }
    }

    /// Tests whether a culler may miss the segment, which is relative to `origin`. False only if the culler
    /// certainly may not.
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
    /// Tests whether the segment passes through a triangle. True only if it certainly does.
    pub(crate) fn surely_meets(&self, [a, b, c]: [DVec3; 3]) -> bool {
        let edges = [(a, b), (b, c), (c, a)].map(|(a, b)| side(self.from, self.to, a, b));
        let ends = [self.from, self.to].map(|p| side(a, b, c, p));
        edges[0].is_some()
            && edges.iter().all(|edge| *edge == edges[0])
            && matches!(ends, [Some(one), Some(other)] if one != other)
    }

    /// Returns the least distance of two segments, up to rounding. NaN if a coordinate is NaN.
    fn distance(&self, other: &Self) -> f64 {
        let (u, v, w) = (self.to - self.from, other.to - other.from, self.from - other.from);
        let [uu, uv, vv, uw, vw] = [u.dot(u), u.dot(v), v.dot(v), u.dot(w), v.dot(w)];
        // The nearest point on this line, then the point of the other line nearest to it, then back again,
        // each clamped to its segment.
        let within = |x: f64| if x.is_nan() { 0.0 } else { x.clamp(0.0, 1.0) };
        let on_this = within((uv * vw - vv * uw) / (uu * vv - uv * uv));
        let on_other = within((vw + uv * on_this) / vv);
        let on_this = within((uv * on_other - uw) / uu);
        (w + u * on_this - v * on_other).length()
    }

    /// Tests whether the segment may meet a triangle. False only if it certainly does not; a triangle with a
    /// non-finite vertex may meet any segment.
    fn may_meet(&self, triangle: &[Vec3; 3]) -> bool {
        let corners = triangle.map(|p| p.as_dvec3());
        if corners.iter().any(|p| !p.is_finite()) {
            // An engine may draw anything for a non-finite triangle, so it may block the segment.
            return true;
        }
        // The triangle is certainly outside of one face of the segment's box.
        let (low, high) = (self.from.min(self.to), self.from.max(self.to));
        if (0..3).any(|i| corners.iter().all(|p| p[i] < low[i]) || corners.iter().all(|p| p[i] > high[i])) {
            return false;
        }
        // The segment's line certainly passes two edges on different sides.
        let signs = [(0, 1), (1, 2), (2, 0)].map(|(i, j)| side(self.from, self.to, corners[i], corners[j]));
        if signs.contains(&Some(1)) && signs.contains(&Some(-1)) {
            return false;
        }
        // Both ends of the segment are certainly on one side of the triangle's plane.
        let [a, b, c] = corners;
        let ends = [self.from, self.to].map(|p| side(a, b, c, p));
        !(ends == [Some(1); 2] || ends == [Some(-1); 2])
    }
}

/// Returns the sign, 1 or -1, of the volume of the tetrahedron of four points. `None` where rounding might
/// determine the sign.
fn side(a: DVec3, b: DVec3, c: DVec3, d: DVec3) -> Option<i32> {
    let (u, v, w) = (b - a, c - a, d - a);
    let magnitude = a.abs();
    // Each difference carries the rounding error of its operands.
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
