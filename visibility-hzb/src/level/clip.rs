//! Cutting of outlines: by the near plane, and where they leave the guard band around the picture.

use super::edges::Edges;
use super::frame::LevelFrame;
use super::prepared::NO_EDGE;
use crate::lanes::{greatest, least};
use crate::raster::mesh_raster::project_corner;
use crate::setup::near_clip::cut_edge;
use alloc::vec::Vec;

/// A point in homogeneous screen coordinates: `x` and `y` (pixel coordinates times `w`), `w`, `n` (depth key
/// times `w`), and the distance beyond the near plane.
type Point = [f64; 5];

/// An end of an edge of a flat outline.
#[derive(Clone, Copy, Debug)]
pub(super) struct End {
    /// The point in homogeneous screen coordinates.
    pub(super) point: Point,
    /// Column and row of a plain vertex: a vertex that no cut affects, with the same column and row in all
    /// outlines. `None` for any other vertex, and for an end that a cut has made.
    pub(super) plain: Option<[f32; 2]>,
}

impl End {
    /// Returns whether the end stays when the edge is cut: coordinate `of` (an index into `point`) is above
    /// `limit`. True for a plain vertex, which no cut affects.
    fn stays(&self, of: usize, limit: f64) -> bool {
        self.plain.is_some() || self.point[of] > limit
    }
}

/// Scratch memory for cutting the edges of one outline by one plane after the other.
#[derive(Clone, Debug, Default)]
pub(super) struct ClipScratch {
    /// Edges of the outline before the present cut.
    pub(super) edges: Vec<[End; 2]>,
    /// Edges of the outline after the present cut.
    cut: Vec<[End; 2]>,
}

impl ClipScratch {
    /// Cuts off the parts of a flat outline where value `of` of its points (an index into [`Point`]) is at
    /// most `limit`. All points at which edges are cut lie on one line. To close the outline again, an edge
    /// along that line is added from each of these points to the first one. On the kept side of the line, the
    /// parity of the number of edges to the left of a point stays as it was.
    #[inline(always)]
    fn cut(&mut self, of: usize, limit: f64) {
        self.cut.clear();
        let mut first = None;
        for &[a, b] in &self.edges {
            match (a.stays(of, limit), b.stays(of, limit)) {
                (true, true) => self.cut.push([a, b]),
                (false, false) => {}
                (a_stays, _) => {
                    let point = cut_edge(&a.point, &b.point, of, limit);
                    let cut = End { point, plain: None };
                    self.cut.push([if a_stays { a } else { b }, cut]);
                    match first {
                        None => first = Some(cut),
                        Some(first) => self.cut.push([cut, first]),
                    }
                }
            }
        }
        core::mem::swap(&mut self.edges, &mut self.cut);
    }

    /// Cuts the outline of the flat polygon in `edges` by the near plane and the guard band (the part of the
    /// screen beyond which outlines are cut), and pushes what is left to `out`. Returns an upper bound on the
    /// error of its points in pixels, and the least and the greatest `w` (infinity and 0 if nothing is left).
    #[inline(always)]
    pub(super) fn clip(&mut self, frame: &LevelFrame, out: &mut Edges) -> [f64; 3] {
        self.cut(4, frame.least_near);
        self.cut(2, frame.least_w);
        let (mut error, mut least_w, mut most_w) = (0.0, f64::INFINITY, 0.0);
        for edge in &self.edges {
            let [a, b] = edge.map(|End { point: [x, y, w, n, _], plain }| {
                least_w = if w < least_w { w } else { least_w };
                most_w = if w > most_w { w } else { most_w };
                if let Some(place) = plain {
                    return place.map(f64::from);
                }
                let (corner, own, _) = project_corner([x, y, w, n], &frame.object);
                // The comparison is false for NaN.
                error = if own <= error { error } else { own };
                [corner.x, corner.y]
            });
            push_within(a, b, frame.guard, out);
        }
        [error, least_w, most_w]
    }
}

/// Pushes the part of an edge that is within the guard band: columns and rows of magnitude up to `guard`. A
/// part beyond the left side of the band is replaced by an edge along that side, so that the same rows have
/// an edge to their left. Parts above and below the band are dropped, since they change no pixel. For a part
/// beyond the right side, `out` only records that the outline reaches that side.
///
/// The bound on the error of the outline's points also covers the rounding of columns and rows beyond the
/// guard band. Where an edge passes the left side, the part within the band and the edge along the side end
/// at exactly the same row.
fn push_within(a: [f64; 2], b: [f64; 2], guard: f64, out: &mut Edges) {
    let (a, b) = if a[1] <= b[1] { (a, b) } else { (b, a) };
    // Only edges above or below the band are dropped. A horizontal edge changes no parity, but pixels near it
    // must be marked.
    if b[1] < -guard || a[1] > guard {
        return;
    }
    if a[0] > guard && b[0] > guard {
        return out.reach(guard as f32);
    }
    let at_row = |row: f64| [a[0] + (row - a[1]) * ((b[0] - a[0]) / (b[1] - a[1])), row];
    let top = if a[1] < -guard { at_row(-guard) } else { a };
    let bottom = if b[1] > guard { at_row(guard) } else { b };
    let at_column = |column: f64| {
        let row = top[1] + (column - top[0]) * ((bottom[1] - top[1]) / (bottom[0] - top[0]));
        // Rows are NaN for points too near the eye's plane.
        [column, least(greatest(row, top[1]), bottom[1])]
    };
    let as_f32 = |[x, y]: [f64; 2]| [x as f32, y as f32];
    let (mut p, mut q) = (top, bottom);
    if p[0] < -guard && q[0] < -guard {
        return out.push(as_f32([-guard, p[1]]), as_f32([-guard, q[1]]), NO_EDGE);
    }
    if p[0] > guard && q[0] > guard {
        return out.reach(guard as f32);
    }
    for end in [&mut p, &mut q] {
        if end[0] < -guard {
            let crossing = at_column(-guard);
            out.push(as_f32([-guard, end[1]]), as_f32(crossing), NO_EDGE);
            *end = crossing;
        } else if end[0] > guard {
            *end = at_column(guard);
            out.reach(guard as f32);
        }
    }
    out.push(as_f32(p), as_f32(q), NO_EDGE);
}

#[cfg(test)]
mod tests {
    use super::super::edges::Edges16;
    use super::super::outline_rule::frame;
    use super::*;
    use crate::exact_outline::{Spot, UNITS, centre, coordinate, edges, in_pixels, is_near, meets, winding};
    use crate::random::random;
    use crate::rounding::FloorCeil;
    use alloc::format;

    /// Two edges leave the guard band at the right side and meet beyond it. The rows between them have only
    /// one edge left, at the left, so the outline must record that it reaches the right side.
    #[test]
    fn an_edge_that_passes_the_right_side_says_so() {
        for (b, cut) in [([99.0, 5.0], false), ([101.0, 5.0], true), ([300.0, -40.0], true)] {
            for ends in [[[0.0, 0.0], b], [b, [0.0, 0.0]]] {
                let mut edges = Edges::default();
                push_within(ends[0], ends[1], 100.0, &mut edges);
                assert_eq!(edges.is_cut_at_right(), cut, "the edge {ends:?} is cut");
            }
        }
    }

    /// Points too near the eye's plane have NaN columns and rows. Pushing their edges must not panic; the
    /// error of such a polygon keeps it from being drawn.
    #[test]
    fn edges_to_points_that_are_no_numbers_are_pushed_without_panic() {
        let numbers = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 5.0, -200.0, 200.0];
        for i in 0..numbers.len().pow(4) {
            let [a, b, c, d] = [1, 6, 36, 216].map(|divisor| numbers[i / divisor % 6]);
            push_within([a, b], [c, d], 100.0, &mut Edges::default());
        }
    }

    /// Outlines keep their parity at all points within the guard band, keep their edges there, and say
    /// whether an edge is beyond its right side.
    #[test]
    fn outlines_within_the_band_keep_their_parity_and_edges() {
        let (mut random, mut counts) = (random(51), [0; 3]);
        // No coordinate is that of a side of the band, which is half a unit beyond 100 pixels.
        let guard = 100.0 + 0.5 / UNITS as f64;
        for trial in 0..20_000 {
            let reach = [50.0, 200.0, 2_000.0][random(0.0, 3.0) as usize];
            let polygon: [Spot; 4] =
                core::array::from_fn(|_| [0; 2].map(|_| coordinate(&mut random, -reach, reach)));
            let mut out = Edges::default();
            for (i, [a, b]) in edges(&polygon).enumerate() {
                let [a, b] = if i % 2 == 0 { [a, b] } else { [b, a] };
                push_within(in_pixels(a), in_pixels(b), guard, &mut out);
            }
            out.finish();
            let lanes = || out.drawn.iter().flat_map(|edges| (0..16).map(move |i| (edges, i)));
            let band = 100 * UNITS;
            let is_beyond = |from: i128, rows: i128| {
                edges(&polygon).any(|[a, b]| meets(a, b, [from, -rows], [1_000 * band, rows]))
            };
            let (is_cut, case) = (out.is_cut_at_right(), format!("trial {trial}: {polygon:?}"));
            assert!(is_cut || !is_beyond(band + 1, band), "{case} is beyond the right side");
            assert!(!is_cut || is_beyond(band, band + 1), "{case} is not beyond the right side");
            for _ in 0..20 {
                let pixel = [0; 2].map(|_| random(0.0, 200.0) as usize);
                // The picture of this test begins at the corner of the band.
                let moved = polygon.map(|spot| spot.map(|v| v + band));
                if edges(&moved).any(|edge| is_near(edge, pixel, 0)) {
                    continue;
                }
                let [x, y] = pixel.map(|v| v as f32 - 99.5);
                let is_left = |&(edges, i): &(&Edges16, usize)| {
                    edges.top[i] < y && y <= edges.bottom[i] && edges.column(i, y) < x
                };
                let is_odd = winding(&moved, centre(pixel)) % 2 != 0;
                assert_eq!(lanes().filter(is_left).count() % 2 != 0, is_odd, "{case} at {x}, {y}");
                counts[usize::from(is_odd)] += 1;
            }
            for [a, b] in edges(&polygon).map(|edge| edge.map(in_pixels)) {
                let share = random(0.0, 1.0);
                let [x, y] = [0, 1].map(|axis| (a[axis] + (b[axis] - a[axis]) * share) as f32);
                if x.abs().max(y.abs()) > 99.99 {
                    continue;
                }
                let is_here = |(edges, i): (&Edges16, usize)| {
                    let row = y.clamp(edges.top[i], edges.bottom[i].max(edges.top[i]));
                    let (column, level) = (edges.column(i, row), edges.level[i]);
                    // Along an edge that is nearly horizontal, rounding of the row moves the column.
                    let by = 0.02 + 0.001 * edges.slope[i].abs();
                    (row - y).abs() < 0.02 && column - by <= x && x <= column + level + by
                };
                assert!(lanes().any(is_here), "{case} has no edge at {x}, {y}");
                counts[2] += 1;
            }
        }
        assert!(counts.iter().all(|&count| count > 10_000), "{counts:?} points outside, inside, on edges");
    }

    /// Returns an end of an edge in the plane of `x` and `y`, whose value to cut by is `x`.
    fn end([x, y]: [f64; 2]) -> End {
        End { point: [x, y, 1.0, 1.0, x], plain: None }
    }

    /// A cut keeps all edges on the kept side, closes the outline there, and keeps its parity. Plain vertices
    /// stay wherever they are.
    #[test]
    fn cut_outlines_are_closed_and_keep_their_parity() {
        let (mut random, mut counts) = (random(52), [0; 2]);
        for trial in 0..20_000 {
            // Whole numbers: many vertices are on the line of the cut.
            let polygon: [Spot; 5] =
                core::array::from_fn(|_| [0; 2].map(|_| random(-4.0, 5.0).floor_() as i128 * UNITS));
            let mut scratch = ClipScratch::default();
            scratch.edges.extend(edges(&polygon).map(|edge| edge.map(|spot| end(in_pixels(spot)))));
            scratch.cut(4, 0.0);
            let case = format!("trial {trial}: {polygon:?}");
            let ends = || scratch.edges.iter().flatten().map(|end| end.point);
            assert!(ends().all(|point| point[0] >= -1e-12), "{case}: an end on the side cut off");
            for point in ends() {
                let count = ends().filter(|&other| other == point).count();
                assert!(count % 2 == 0, "{case}: {count} edges end at {point:?}");
            }
            for _ in 0..5 {
                let at = [random(0.0, 5.0), random(-4.0, 5.0)].map(|v| v.floor_() as i128 * UNITS + 77);
                let [x, y] = in_pixels(at);
                let is_right = |&[a, b]: &&[End; 2]| {
                    let ([ax, ay, ..], [bx, by, ..]) = (a.point, b.point);
                    (ay < y) != (by < y) && ax + (y - ay) * (bx - ax) / (by - ay) > x
                };
                if edges(&polygon).any(|[a, b]| meets(a, b, at.map(|v| v - 1), at.map(|v| v + 1))) {
                    continue;
                }
                let is_odd = winding(&polygon, at) % 2 != 0;
                let count = scratch.edges.iter().filter(is_right).count();
                assert_eq!(count % 2 != 0, is_odd, "{case} at {x}, {y}");
                counts[usize::from(is_odd)] += 1;
            }
        }
        assert!(counts.iter().all(|&count| count > 5_000), "{counts:?} points outside and inside");
        let plain = End { plain: Some([0.0; 2]), ..end([-1.0, 0.0]) };
        let mut scratch =
            ClipScratch { edges: [[plain, end([1.0, 0.0])]].to_vec(), ..ClipScratch::default() };
        scratch.cut(4, 0.0);
        let [[kept, _]] = scratch.edges[..] else { panic!("{} edges", scratch.edges.len()) };
        assert_eq!(kept.point, plain.point, "a plain vertex stays");
    }

    /// The error of a clipped outline is the greatest of its vertices, and its range of `w` that of all.
    #[test]
    fn clipped_outlines_have_the_greatest_error() {
        let frame = frame();
        let corners = [[3.0, 3.0, 1.0], [50.0, 20.0, 2.0], [200.0, 90.0, 20.0]];
        let corner = |[x, y, w]: [f64; 3]| End { point: [x, y, w, 1.0, w], plain: None };
        let error = |[x, y, w]: [f64; 3]| project_corner([x, y, w, 1.0], &frame.object).1;
        let greatest = corners.map(error).into_iter().fold(0.0, f64::max);
        assert!(
            corners.iter().filter(|&&corner| error(corner) < 0.9 * greatest).count() == 2,
            "one error is greatest"
        );
        for first in 0..3 {
            let [a, b, c] = [0, 1, 2].map(|i| corner(corners[(first + i) % 3]));
            let mut scratch =
                ClipScratch { edges: [[a, b], [b, c], [c, a]].to_vec(), ..ClipScratch::default() };
            let bounds = scratch.clip(&frame, &mut Edges::default());
            assert_eq!(bounds, [greatest, 1.0, 20.0], "error and range of w, first corner {first}");
        }
    }
}
