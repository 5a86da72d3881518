//! Map of a scene's solid surfaces in columns, which tells where a person can stand.
//!
//! The scene is cut into square columns. Each column has a list of solid spans (height ranges), made from
//! triangles clipped to the column, as in the heightfields of navigation meshes (Mikko Mononen, "Recast").

use crate::SourceObject;
use glam::{DVec2, DVec3, Vec3};

/// Side of a column in metres.
pub(super) const COLUMN: f64 = 0.25;
/// Greatest gap in metres between two spans of a column that are merged into one.
const TOUCH: f32 = 0.02;
/// Greatest thickness of a door leaf with its frame, then least and greatest height of a door, in metres.
const DOOR: [f32; 3] = [0.6, 1.5, 3.5];
/// Greatest side of a map, in metres.
const REACH: f64 = 256.0;
/// Number of spans above which a map is narrowed.
const MANY_SPANS: usize = 1 << 21;
/// Number of columns above which a map is narrowed: those to which triangles were clipped, summed over all
/// triangles since the map was last narrowed.
const MANY_CLIPS: usize = 1 << 23;

/// Axes of a scene: two on the ground, and one up.
#[derive(Clone, Copy, Debug)]
pub(super) struct GroundAxes {
    /// Indices of the two axes on the ground, then of the up axis.
    axes: [usize; 3],
    /// Whether up is the negative direction of the up axis.
    is_down: bool,
}

impl GroundAxes {
    /// Returns the axes for an up direction, rounded to the nearest coordinate axis.
    pub(super) fn new(up: Vec3) -> Self {
        let axis = up.abs().max_position();
        Self { axes: [(axis + 1) % 3, (axis + 2) % 3, axis], is_down: up[axis] < 0.0 }
    }

    /// Returns a point as its position (x, y) on the ground and its height.
    pub(super) fn flat(&self, p: DVec3) -> DVec3 {
        let [a, b, up] = self.axes.map(|axis| p[axis]);
        DVec3::new(a, b, if self.is_down { -up } else { up })
    }

    /// Returns the point with a position (x, y) on the ground and a height. Inverse of [`flat`](Self::flat).
    pub(super) fn point(&self, flat: DVec3) -> DVec3 {
        let mut p = DVec3::ZERO;
        let [a, b, up] = self.axes;
        (p[a], p[b], p[up]) = (flat.x, flat.y, if self.is_down { -flat.z } else { flat.z });
        p
    }

    /// Returns two opposite corners of a box as its minimum and maximum corner, each as a position on the
    /// ground and a height.
    pub(super) fn sorted(&self, low: DVec3, high: DVec3) -> (DVec3, DVec3) {
        let (a, b) = (self.flat(low), self.flat(high));
        (a.min(b), a.max(b))
    }
}

/// Range of heights in which a column is solid, in metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Span {
    /// Least height.
    pub low: f32,
    /// Greatest height.
    pub high: f32,
    /// Whether one can stand on the span: its highest triangle slopes less than 60 degrees and is drawn from
    /// above.
    pub is_floor: bool,
    /// Whether the span's lowest triangle faces up and is drawn only from above. If all spans above a point
    /// are such, the point is inside something solid.
    pub is_back: bool,
}

/// Solid spans of a scene's columns, relative to the scene's origin.
pub(super) struct FloorMap {
    /// Axes of the scene.
    pub axes: GroundAxes,
    /// Minimum and maximum corner of the scene on the ground, in metres.
    scene: [DVec2; 2],
    /// Centre of the map on the ground, in metres.
    around: DVec2,
    /// Greatest side of the map, in metres.
    reach: f64,
    /// Minimum corner of the map on the ground, in metres.
    pub corner: DVec2,
    /// Number of columns along each ground axis.
    pub counts: [usize; 2],
    /// For each column, its spans in ascending order. They do not touch.
    spans: Vec<Vec<Span>>,
    /// Total number of spans.
    span_count: usize,
    /// Number of columns to which triangles were clipped, summed over all triangles since the map was last
    /// narrowed.
    clip_count: usize,
}

impl FloorMap {
    /// Creates an empty map of a scene with corners `low` and `high` on the ground. A scene larger than
    /// [`REACH`] is only mapped around the point `around`.
    pub(super) fn new(axes: GroundAxes, low: DVec2, high: DVec2, around: DVec2) -> Self {
        Self::within(axes, [low, high], around, REACH)
    }

    /// Creates the map as [`new`](Self::new) does, with sides of at most `reach` metres.
    fn within(axes: GroundAxes, scene: [DVec2; 2], around: DVec2, reach: f64) -> Self {
        let [low, high] = scene;
        let start = (around - reach * 0.5).min(high - reach).max(low);
        let end = (start + reach).min(high);
        // Columns begin at whole multiples of their side, so a wall at such a place fills one column instead
        // of two.
        let corner = (start / COLUMN).floor() * COLUMN;
        let counts = ((end - corner) / COLUMN).ceil().max(DVec2::ONE);
        let counts = [counts.x as usize, counts.y as usize];
        let spans = vec![Vec::new(); counts[0] * counts[1]];
        Self { axes, scene, around, reach, corner, counts, spans, span_count: 0, clip_count: 0 }
    }

    /// Halves the map's reach and drops the columns outside.
    fn narrow(&mut self) {
        let mut inner = Self::within(self.axes, self.scene, self.around, self.reach * 0.5);
        let first = ((inner.corner - self.corner) / COLUMN).round();
        let [first_column, first_row] = [first.x as usize, first.y as usize];
        for (row, spans) in inner.spans.chunks_mut(inner.counts[0]).enumerate() {
            let at = (first_row + row) * self.counts[0] + first_column;
            spans.swap_with_slice(&mut self.spans[at..at + inner.counts[0]]);
        }
        inner.span_count = inner.spans.iter().map(Vec::len).sum();
        *self = inner;
    }

    /// Returns the spans of a column, in ascending order.
    pub(super) fn spans(&self, column: usize) -> &[Span] {
        &self.spans[column]
    }

    /// Adds the triangles of an object, unless it is a door or moves. A map with too many spans or clips is
    /// narrowed, which bounds time and memory, for instance if a wrong unit makes a house a thousand times
    /// too large.
    pub(super) fn add(&mut self, object: &SourceObject) {
        if object.motion.is_some() || is_door(&self.axes, object) {
            return;
        }
        let triangles = object.triangles.iter();
        for triangle in triangles.filter(|triangle| triangle.iter().all(|p| p.is_finite())) {
            self.add_triangle(triangle.map(|p| self.axes.flat(p.as_dvec3())), object.one_sided);
            if self.span_count > MANY_SPANS || self.clip_count > MANY_CLIPS {
                self.narrow();
            }
        }
    }

    /// Adds level ground at a height, over the whole map.
    pub(super) fn add_ground(&mut self, height: f64) {
        for column in 0..self.spans.len() {
            let (low, high) = (height as f32, height as f32);
            self.insert(column, Span { low, high, is_floor: true, is_back: false });
        }
    }

    /// Adds a triangle whose corners are given as positions on the ground and heights.
    fn add_triangle(&mut self, corners: [DVec3; 3], one_sided: bool) {
        let [a, b, c] = corners;
        let normal = (b - a).cross(c - a);
        let is_level = |upwards: f64| upwards > 0.5 * normal.length();
        let is_floor = is_level(if one_sided { normal.z } else { normal.z.abs() });
        let is_back = one_sided && is_level(normal.z);
        let place = |axis: usize, value: f64| (value - self.corner[axis]) / COLUMN;
        // First and last column of the map that a polygon meets along an axis, and whether it lies in a
        // single column.
        let columns = |axis: usize, polygon: &[DVec3]| -> Option<([usize; 2], bool)> {
            let ends = polygon.iter().map(|p| place(axis, p[axis]));
            let (low, high) = ends.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(x), b.max(x)));
            let last = self.counts[axis] as f64 - 1.0;
            // A wall in the plane between two columns belongs to the upper one.
            let is_within = low <= last + 1.0 && high >= 0.0;
            let ends = [low, high].map(|end| end.floor().clamp(0.0, last) as usize);
            is_within.then_some((ends, low.floor() == high.floor()))
        };
        let Some(([first_row, last_row], is_in_row)) = columns(1, &corners) else { return };
        let height = |polygon: &[DVec3]| {
            let heights = polygon.iter().map(|p| p.z as f32);
            heights.fold((f32::INFINITY, f32::NEG_INFINITY), |(a, b), z| (a.min(z), b.max(z)))
        };
        if is_in_row && let Some(([first, _], true)) = columns(0, &corners) {
            // Shortcut for a triangle within one column, as are most triangles of a fine mesh: nothing is
            // clipped.
            let (low, high) = height(&corners);
            return self.insert(first_row * self.counts[0] + first, Span { low, high, is_floor, is_back });
        }
        let mut found = Vec::new();
        for row in first_row..=last_row {
            let strip = if is_in_row { corners.to_vec() } else { self.clipped(&corners, 1, row) };
            let Some(([first, last], is_in_column)) = columns(0, &strip) else { continue };
            self.clip_count += last - first + 1;
            for column in first..=last {
                let part = if is_in_column { strip.clone() } else { self.clipped(&strip, 0, column) };
                let (low, high) = height(&part);
                if low <= high {
                    found.push((row * self.counts[0] + column, Span { low, high, is_floor, is_back }));
                }
            }
        }
        found.into_iter().for_each(|(column, span)| self.insert(column, span));
    }

    /// Returns the part of a convex polygon inside the columns with index `number` along an axis.
    fn clipped(&self, polygon: &[DVec3], axis: usize, number: usize) -> Vec<DVec3> {
        let low = self.corner[axis] + number as f64 * COLUMN;
        let above = half(polygon, |p| p[axis] - low);
        half(&above, |p| low + COLUMN - p[axis])
    }

    /// Adds a span to a column, and merges it with the spans that it touches.
    fn insert(&mut self, column: usize, mut span: Span) {
        let spans = &mut self.spans[column];
        let first = spans.partition_point(|other| other.high + TOUCH < span.low);
        let mut last = first;
        while let Some(other) = spans.get(last).filter(|other| other.low <= span.high + TOUCH) {
            // Whether the merged span is a floor depends on the higher upper surface; on either surface if
            // both are equally high.
            let difference = other.high - span.high;
            span.is_floor = match difference {
                _ if difference.abs() <= TOUCH => span.is_floor || other.is_floor,
                _ if difference > 0.0 => other.is_floor,
                _ => span.is_floor,
            };
            span.is_back = match other.low - span.low {
                difference if difference.abs() <= TOUCH => span.is_back && other.is_back,
                difference if difference < 0.0 => other.is_back,
                _ => span.is_back,
            };
            (span.low, span.high) = (span.low.min(other.low), span.high.max(other.high));
            last += 1;
        }
        spans.splice(first..last, [span]);
        self.span_count = self.span_count + 1 - (last - first);
    }
}

/// Clips a convex polygon to the points where the linear function `side` is not negative.
fn half(polygon: &[DVec3], side: impl Fn(DVec3) -> f64) -> Vec<DVec3> {
    let mut kept = Vec::with_capacity(polygon.len() + 1);
    for (index, &to) in polygon.iter().enumerate() {
        let from = polygon[(index + polygon.len() - 1) % polygon.len()];
        let (a, b) = (side(from), side(to));
        if (a < 0.0) != (b < 0.0) {
            kept.push(from + (to - from) * (a / (a - b)));
        }
        if b >= 0.0 {
            kept.push(to);
        }
    }
    kept
}

/// Returns whether an object is a door, by its hint or by its name and shape.
fn is_door(axes: &GroundAxes, object: &SourceObject) -> bool {
    if object.door {
        return true;
    }
    if !object.name.to_string().to_lowercase().contains("door") {
        return false;
    }
    object.bounds().is_some_and(|(low, high)| {
        let (low, high) = axes.sorted(low.as_dvec3(), high.as_dvec3());
        let size = (high - low).as_vec3();
        size.x.min(size.y) <= DOOR[0] && (DOOR[1]..=DOOR[2]).contains(&size.z)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns a map of `count` slightly tilted plates of 300 by 315 m, one above another.
    fn plates(count: usize, around: DVec2, reach: f64) -> FloorMap {
        let (low, high) = (DVec2::splat(-150.0), DVec2::splat(150.0));
        let mut map = FloorMap::within(GroundAxes::new(Vec3::Z), [low, high], around, reach);
        for plate in 0..count {
            let corner = |x, y| Vec3::new(x, y, 4.0 * plate as f32 + 0.01 * x);
            let [a, b] = [corner(-150.1, -157.3), corner(150.1, -157.3)];
            let [c, d] = [corner(150.1, 157.3), corner(-150.1, 157.3)];
            map.add(&SourceObject::new("plate", vec![[a, b, c], [a, c, d]]));
        }
        map
    }

    #[test]
    fn a_map_of_many_spans_is_narrowed() {
        for around in [DVec2::ZERO, DVec2::new(140.0, -30.0)] {
            let map = plates(3, around, REACH);
            let small = plates(3, around, REACH * 0.5);
            assert!(map.span_count <= MANY_SPANS, "{} spans around {around}", map.span_count);
            assert_eq!((map.corner, map.counts), (small.corner, small.counts), "columns around {around}");
            assert!(
                map.spans == small.spans,
                "the spans around {around} are those of a map of half the reach"
            );
            assert_eq!(map.span_count, small.span_count, "number of spans around {around}");
        }
        let mut few = plates(1, DVec2::ZERO, REACH);
        assert_eq!(few.counts, [1024; 2], "columns of a map of one plate");
        // Triangles whose spans merge are counted as well.
        let plate =
            [Vec3::new(-150.0, -150.0, 0.0), Vec3::new(150.0, -150.0, 0.0), Vec3::new(0.0, 150.0, 0.0)];
        (few.span_count, few.clip_count) = (0, MANY_CLIPS - 9);
        few.add(&SourceObject::new("plate", vec![plate]));
        assert_eq!((few.counts, few.clip_count), ([512; 2], 0), "a map narrowed after many clips");
    }
}
