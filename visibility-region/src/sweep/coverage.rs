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

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::vec::Vec;
    use visibility_testing::Random;

    /// Depth of the cut, and of the plane.
    const NEAR: i128 = 16;
    const D: i128 = 64;
    /// Half of the viewcell, a rectangle without depth.
    const HALF: [i128; 2] = [1, 2];
    /// Units of the oracle in a metre, which is a pixel. The slack is two of them.
    const UNITS: i128 = 2048;

    fn direction() -> Direction {
        let half = HALF.map(|half| half as f64);
        let rows = [DVec3::X, DVec3::Y, DVec3::Z];
        Direction { rows, offset: [0.0; 3], half, exact: [None; 2], depth: 0.0, error: 0.0 }
    }

    type Point = [i128; 3];

    fn minus(a: Point, b: Point) -> Point {
        [0, 1, 2].map(|k| a[k] - b[k])
    }

    fn cross(a: Point, b: Point) -> Point {
        [0, 1, 2].map(|k| a[(k + 1) % 3] * b[(k + 2) % 3] - a[(k + 2) % 3] * b[(k + 1) % 3])
    }

    fn dot(a: Point, b: Point) -> i128 {
        (0..3).map(|k| a[k] * b[k]).sum()
    }

    /// Returns whether all rays from the viewcell through a pixel, enlarged by `grow` units on each side,
    /// pass through the inside of a convex polygon of one plane, at depths from [`NEAR`] to [`D`]. For one
    /// viewpoint, the points on the plane with such rays are a convex set, and for one point the viewpoints
    /// are: it is enough to ask the corners. `strictly`: not at one of the two depths.
    fn is_behind(polygon: &[Point], [x, y]: [usize; 2], grow: i128, strictly: bool) -> bool {
        let corners = || (0..4).map(|corner| [corner & 1, corner >> 1]);
        let polygon: Vec<Point> = polygon.iter().map(|p| p.map(|x| x * UNITS)).collect();
        let n = cross(minus(polygon[1], polygon[0]), minus(polygon[2], polygon[0]));
        corners().flat_map(|eye| corners().map(move |at| (eye, at))).all(|(eye, at)| {
            let [v, w] = [0, 1].map(|k| (2 * eye[k] - 1) * HALF[k] * UNITS);
            let eye = [v, w, 0];
            let side = |k: usize, pixel: usize| (pixel as i128 + at[k]) * UNITS + (2 * at[k] - 1) * grow;
            let ray = minus([side(0, x), side(1, y), D * UNITS], eye);
            let sides: Vec<i128> = (0..polygon.len())
                .map(|i| {
                    let (a, b) = (minus(polygon[i], eye), minus(polygon[(i + 1) % polygon.len()], eye));
                    dot(cross(a, b), ray).signum()
                })
                .collect();
            // The ray meets the plane of the polygon at `part / whole` of its way.
            let (part, whole) = (dot(n, minus(polygon[0], eye)), dot(n, ray));
            let (part, whole) = (part * whole.signum(), whole.abs());
            let within = [part * D - whole * NEAR, whole - part];
            sides[0] != 0
                && sides.iter().all(|&side| side == sides[0])
                && within.iter().all(|&by| by > 0 || by == 0 && !strictly)
        })
    }

    /// Draws a convex polygon as a fan of triangles, whose common edges are no part of the contour. Returns
    /// whether any pixel was added.
    fn draw(map: &mut RayMap, maps: &mut PieceMaps, polygon: &[Point], rect: PixelRect) -> bool {
        let window = Window::from_zero(D as f64, [[0.0, SIDE as f64]; 2]);
        let target = Target { direction: &direction(), window: &window, near: NEAR as f64, rect };
        let real: Vec<DVec3> = polygon.iter().map(|p| DVec3::from(p.map(|x| x as f64))).collect();
        let triangles = (2..real.len()).map(|i| ([real[0], real[i - 1], real[i]], None));
        let contour = (0..real.len()).map(|i| ([real[i], real[(i + 1) % real.len()]], None));
        maps.draw(map, &target, triangles, contour)
    }

    /// Polygons that the near depth and the plane cut, or touch with a vertex or an edge, some of them along
    /// an edge between two of their triangles.
    #[test]
    fn pixels_of_polygons_are_those_that_all_rays_show_behind_them() {
        let mut random = Random(1);
        let mut maps = PieceMaps::new();
        let rect = PixelRect { x: [1, 18], y: [2, 17] };
        let (mut covered, mut cut, mut touched, mut drawn) = (0, 0, 0, 0);
        for trial in 0..20_000 {
            // A plane on which many points have the depths of the cut and of the projection plane.
            let slopes = [random.between(-4, 5), random.pick(&[0, 0, 1, -3])].map(i128::from);
            let middle = random.pick(&[NEAR, 32, 48, D]);
            let count = 3 + random.below(3);
            let polygon: Vec<Point> = (0..count)
                .map(|_| {
                    let at = [random.below(8), random.below(8)].map(|x| 4 * x as i128 - 8);
                    [at[0], at[1], middle + slopes[0] * (at[0] - 4) + slopes[1] * (at[1] - 4)]
                })
                .collect();
            // Each vertex is to the left of each edge of the polygon that it is no end of.
            let is_left = |i: usize, k: usize| {
                let [a, b, c] = [i, (i + 1) % count, k].map(|i| polygon[i]);
                k == i
                    || k == (i + 1) % count
                    || (b[0] - a[0]) * (c[1] - a[1]) > (b[1] - a[1]) * (c[0] - a[0])
            };
            let is_convex = (0..count).all(|i| (0..count).all(|k| is_left(i, k)));
            let n = cross(minus(polygon[1], polygon[0]), minus(polygon[2], polygon[0]));
            let faces = [-1, 1].into_iter().flat_map(|x| [-1, 1].map(|y| [x * HALF[0], y * HALF[1], 0]));
            let mut faces = faces.map(|eye| dot(n, minus(polygon[0], eye)).signum());
            let is_deep = polygon.iter().all(|p| p[2] > 4);
            let first = faces.next().unwrap();
            if !is_convex || !is_deep || first == 0 || faces.any(|side| side != first) {
                continue;
            }
            drawn += 1;
            let is_at = |depth: i128| polygon.iter().any(|p| p[2] == depth);
            cut += usize::from(polygon.iter().any(|p| p[2] < NEAR || p[2] > D));
            touched += usize::from(is_at(NEAR) || is_at(D));
            let mut map = RayMap::new();
            let adds = draw(&mut map, &mut maps, &polygon, rect);
            let mut any = false;
            for (x, y) in (0..20).flat_map(|y| (0..20).map(move |x| (x, y))) {
                let is_set = map.get(x, y);
                any |= is_set;
                let is_inside = (rect.x[0]..=rect.x[1]).contains(&x) && (rect.y[0]..=rect.y[1]).contains(&y);
                let must = is_inside && is_behind(&polygon, [x, y], 4, true);
                let may = is_inside && is_behind(&polygon, [x, y], 1, false);
                assert!(is_set || !must, "trial {trial}: {x} {y} is not covered by {polygon:?}");
                assert!(may || !is_set, "trial {trial}: {x} {y} is covered by {polygon:?}");
                covered += usize::from(is_set);
            }
            assert_eq!(adds, any, "trial {trial}: whether {polygon:?} adds pixels");
            assert!(
                !draw(&mut map, &mut maps, &polygon, rect),
                "trial {trial}: it adds none the second time"
            );
        }
        assert!(drawn > 1_000 && covered > 15_000, "{covered} pixels of {drawn} polygons");
        assert!(cut > 300 && touched > 300, "{cut} are cut, {touched} touch");
    }

    /// A triangle covers pixels, and another at its side reaches so far that the precision of positions there
    /// is unknown: nothing is covered.
    #[test]
    fn a_contour_that_is_too_far_away_covers_nothing() {
        let window = Window::from_zero(D as f64, [[0.0, SIDE as f64]; 2]);
        let rect = PixelRect { x: [1, 18], y: [2, 17] };
        let [a, b, c] = [[-90.0, -90.0, 40.0], [-90.0, 90.0, 40.0], [90.0, 0.0, 40.0]].map(DVec3::from);
        let mut maps = PieceMaps::new();
        for (far, is_covered) in [(1e2, true), (1e12, false)] {
            let far = DVec3::new(-far, 0.0, 41.0);
            let (mut map, direction) = (RayMap::new(), direction());
            let target = Target { direction: &direction, window: &window, near: NEAR as f64, rect };
            let triangles = [[a, b, c], [b, a, far]].map(|triangle| (triangle, None));
            let contour = [[b, c], [c, a], [a, far], [far, b]].map(|edge| (edge, None));
            let adds = maps.draw(&mut map, &target, triangles.into_iter(), contour.into_iter());
            assert_eq!([adds, map.any_set()], [is_covered; 2], "a vertex at {far}");
        }
    }
}
