//! Draws the clusters of levels, nearest first.

use super::clip::{ClipScratch, End};
use super::edges::Edges;
use super::fill::FillScratch;
use super::frame::{LevelFrame, MAX_BEND_PX, MAX_ERROR_PX};
use super::open_tiles::{BARELY_NEARER, DepthBound, TileKeys};
use super::prepared::{BoxLanes, NO_EDGE, Polygons, PreparedEdge, PreparedLevel};
use super::seams::Seams;
use super::slab::{depth_plane, faces_eye, far_side, is_beyond_window};
use super::vertices::Vertices;
use crate::Coverage;
use crate::buffer::tile_layout::{Rectangle, SIDE};
use crate::buffer::tiles::Tiles;
use crate::lanes::{WIDTH, bits, greatest, least};
use crate::query::box_projection::project;
use crate::rounding::down;
use crate::simd_dispatch::Kernels;
use alloc::sync::Arc;
use alloc::vec::Vec;
use visibility_core::Aabb;
use visibility_core::glam::DVec3;
use visibility_core::simd::Simd;
use visibility_occluders::OccluderCluster;

/// Work of testing whether a cluster may be seen. The unit of work is the time to draw one triangle, a tenth
/// of a microsecond. This constant and the next three are measured.
pub(super) const CANDIDATE_WORK: f32 = 0.05;

/// Work of choosing the polygons of one cluster that are drawn, in triangles.
const CLUSTER_WORK: f32 = 3.0;

/// Work of setting up one polygon, in triangles.
const POLYGON_WORK: f32 = 5.0;

/// Work of filling one [open tile](super::open_tiles) of a polygon, in triangles.
const TILE_WORK: f32 = 0.25;

/// A cluster that may be seen.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Candidate {
    /// Key of the order of drawing: less is nearer. Inverted bits of the greatest depth key.
    order: u32,
    /// Index of the level.
    level: u32,
    /// Index of the cluster.
    cluster: u32,
    /// Pixels that the box around the cluster may meet; `None` for a box that may reach the eye's plane.
    rectangle: Option<Rectangle>,
    /// Upper bound on the depth keys of the cluster (greater is nearer).
    nearest: f32,
}

impl Candidate {
    /// Returns the key of the order of drawing, nearest first, of the candidate at `index`, which is in the
    /// lower half of the key: equally near candidates are drawn in their own order.
    pub(super) fn sort_key(&self, index: u32) -> u64 {
        u64::from(self.order) << 32 | u64::from(index)
    }
}

/// The clusters of a frame that may be seen.
#[derive(Clone, Copy, Debug)]
pub(super) struct Candidates<'a> {
    pub(super) all: &'a [Candidate],
    /// Their [keys](Candidate::sort_key), in the order of drawing.
    pub(super) order: &'a [u64],
}

/// Scratch memory for drawing a level, kept from frame to frame.
#[derive(Clone, Debug, Default)]
pub(crate) struct LevelScratch {
    vertices: Vertices,
    edges: Edges,
    fill: FillScratch,
    clip: ClipScratch,
    seams: Seams,
    /// For each level the number of edges in levels before it that are in view.
    first_edges: Vec<u32>,
    /// For each polygon of a cluster, the coordinate along its normal of the far side of its slab. The slab
    /// is the layer, across the normal, that holds the polygon's vertices; its far side is the one away from
    /// the eye. NaN for a polygon that is not drawn.
    far_sides: Vec<f64>,
    /// Work spent in this frame, in triangles.
    work: f32,
}

/// Draws clusters of levels into the frames' columns of `tiles`, in the order of `candidates`, until about
/// `work`, in triangles, is spent. `frames` has the view for each level, `None` for a level that is not
/// drawn. Returns an upper bound on the depth keys drawn, and the work spent.
pub(crate) fn draw_candidates(
    simd: Simd,
    levels: &[Arc<PreparedLevel>],
    frames: &[Option<LevelFrame>],
    candidates: Candidates,
    work: f32,
    scratch: &mut LevelScratch,
    tiles: &mut Tiles,
) -> (f32, f32) {
    scratch.first_edges.clear();
    let mut edges = 0;
    for (level, frame) in levels.iter().zip(frames) {
        scratch.first_edges.push(u32::try_from(edges).unwrap_or(NO_EDGE));
        edges += if frame.is_some() { level.edges.len() } else { 0 };
    }
    scratch.seams.begin_frame(edges);
    scratch.work = 0.0;
    let mut nearest = f32::NEG_INFINITY;
    for &key in candidates.order {
        if scratch.work >= work {
            break;
        }
        let Some(candidate) = candidates.all.get(key as u32 as usize) else { continue };
        let index = candidate.level as usize;
        let (Some(level), Some(Some(frame))) = (levels.get(index), frames.get(index)) else { continue };
        if let Some(rectangle) = &candidate.rectangle {
            let Some(rectangle) = rectangle.within_columns(frame.columns) else { continue };
            if !simd.rectangle_may_be_seen(tiles, &rectangle, candidate.nearest / BARELY_NEARER) {
                continue;
            }
        }
        if draw_cluster(simd, level, frame, candidate, scratch, tiles) {
            nearest = greatest(candidate.nearest, nearest);
        }
    }
    (nearest, scratch.work)
}

/// Appends to `candidates` the clusters of a level that may be seen, in no particular order. `index` is the
/// index of the level. Returns the number of clusters tested.
#[inline(always)]
pub(crate) fn find_candidates(
    index: u32,
    level: &PreparedLevel,
    frame: &LevelFrame,
    candidates: &mut Vec<Candidate>,
) -> usize {
    let mut looked_at = 0;
    let count = level.level.clusters().len();
    for (i, boxes) in level.groups.iter().enumerate() {
        let groups = project(&frame.projection32, boxes);
        for lane in 0..WIDTH {
            let first = (i * WIDTH + lane) * WIDTH;
            if groups.outside[lane] || first >= level.clusters.len() {
                continue;
            }
            for block in first..(first + WIDTH).min(level.clusters.len()) {
                looked_at += WIDTH;
                let large = are_large(&level.clusters[block], &level.largest[block], frame);
                if large == 0 {
                    continue;
                }
                let boxes = project(&frame.projection32, &level.clusters[block]);
                for lane in 0..WIDTH.min(count - block * WIDTH) {
                    let rectangle = boxes.known[lane].then(|| boxes.rectangle(lane));
                    let thin = rectangle.is_some_and(|rectangle| rectangle.is_thin());
                    if boxes.outside[lane] || thin || large >> lane & 1 == 0 {
                        continue;
                    }
                    let nearest = if boxes.known[lane] { boxes.nearest[lane] } else { f32::INFINITY };
                    // Maps the bits to ascending order, also for the negative depth keys of parallel views.
                    let ascending = nearest.to_bits() ^ ((nearest.to_bits() as i32 >> 31) as u32 | 1 << 31);
                    let cluster = (block * WIDTH + lane) as u32;
                    candidates.push(Candidate {
                        order: !ascending,
                        level: index,
                        cluster,
                        rectangle,
                        nearest,
                    });
                }
            }
        }
    }
    looked_at
}

/// Returns the mask of the clusters whose largest polygon could cover enough pixels to be drawn if it faced
/// the eye at the nearest point of the cluster's box.
#[inline(always)]
fn are_large(boxes: &BoxLanes, largest: &[f32; WIDTH], frame: &LevelFrame) -> u32 {
    let eye = frame.eye.as_vec3().to_array();
    let mut large = [0; WIDTH];
    for i in 0..WIDTH {
        let mut squared = 0.0;
        for axis in 0..3 {
            let beside = greatest(greatest(boxes[axis][i] - eye[axis], eye[axis] - boxes[axis + 3][i]), 0.0);
            squared += beside * beside;
        }
        let squared = if frame.perspective { squared } else { 1.0 };
        large[i] = u8::from(largest[i] * frame.pixels_per_area >= frame.min_polygon_area * squared);
    }
    bits(&large)
}

/// Draws a cluster. Returns whether it may have covered a pixel.
fn draw_cluster(
    simd: Simd,
    level: &PreparedLevel,
    frame: &LevelFrame,
    candidate: &Candidate,
    scratch: &mut LevelScratch,
    tiles: &mut Tiles,
) -> bool {
    let index = candidate.cluster as usize;
    let Some(cluster) = level.level.clusters().get(index) else { return false };
    if !is_inside_clip_planes(level, frame, cluster) || !simd.begin_cluster(level, frame, index, scratch) {
        return false;
    }
    let mut drawn = false;
    for at in 0..scratch.far_sides.len() {
        if !scratch.far_sides[at].is_nan() {
            drawn |= draw_polygon(simd, level, frame, candidate, at, scratch, tiles);
        }
    }
    drawn
}

/// Chooses the polygons of cluster `index` that are worth drawing, and projects the cluster's vertices.
/// Returns whether there are any.
#[inline(always)]
pub(crate) fn begin_cluster(
    level: &PreparedLevel,
    frame: &LevelFrame,
    index: usize,
    scratch: &mut LevelScratch,
) -> bool {
    let Some(cluster) = level.level.clusters().get(index) else { return false };
    let blocks = level.first_polygons[index] as usize..level.first_polygons[index + 1] as usize;
    let (first, end) = (cluster.polygons[0] as usize, cluster.polygons[1] as usize);
    let mut any = false;
    scratch.work += CLUSTER_WORK;
    scratch.far_sides.clear();
    scratch.far_sides.resize(end - first, f64::NAN);
    for (block, polygons) in level.polygons[blocks].iter().enumerate() {
        let mut chosen = worth_drawing(polygons, frame);
        while chosen != 0 {
            let at = block * WIDTH + chosen.trailing_zeros() as usize % WIDTH;
            chosen &= chosen - 1;
            let Some(polygon) = level.level.polygons().get(first + at) else { continue };
            if let Some(far) = far_side(frame, polygon) {
                scratch.far_sides[at] = far;
                any = true;
            }
        }
    }
    if any {
        let vertices = cluster.vertices[0] as usize..cluster.vertices[1] as usize;
        scratch.vertices.project(&level.level.vertices()[vertices], frame);
    }
    any
}

/// Returns whether all polygons of a cluster lie certainly within the view's clip planes.
fn is_inside_clip_planes(level: &PreparedLevel, frame: &LevelFrame, cluster: &OccluderCluster) -> bool {
    if frame.clip_planes.as_slice().is_empty() {
        return true;
    }
    // The faces of a polygon may lie outside the box around its outline by up to the thickness of its slab,
    // the layer that holds its vertices.
    let Aabb { min, max } = cluster.bounds;
    let sides = [min.as_dvec3() - level.thickness, max.as_dvec3() + level.thickness];
    let side = |corner: usize, axis: usize| sides[corner >> axis & 1][axis];
    (0..8).all(|i| frame.clip_planes.contains(DVec3::new(side(i, 0), side(i, 1), side(i, 2))))
}

/// Returns the mask of the polygons that cover enough pixels to be worth drawing, by an estimate.
#[inline(always)]
fn worth_drawing(polygons: &Polygons, frame: &LevelFrame) -> u32 {
    let eye = frame.eye.as_vec3().to_array();
    let mut chosen = [0; WIDTH];
    for i in 0..WIDTH {
        let (mut facing, mut squared) = (0.0, 0.0);
        for axis in 0..3 {
            let towards = if frame.perspective { eye[axis] - polygons.middle[axis][i] } else { eye[axis] };
            facing += towards * polygons.normal[axis][i];
            squared += towards * towards;
        }
        // A polygon covers `area * facing * pixels_per_area` over the cube of the distance: two powers for
        // the distance, one for the length of `towards` in `facing`. Pixels times the distance are compared,
        // and squared, which neither overflows nor vanishes for distances from 1e-18 to 1e18.
        let pixels = polygons.area[i] * facing * frame.pixels_per_area / squared;
        let radius = polygons.radius[i];
        let close = frame.perspective & (squared <= 4.0 * radius * radius);
        let large = pixels * pixels >= frame.min_polygon_area * frame.min_polygon_area * squared;
        let mut inside = polygons.area[i] > 0.0;
        for side in &frame.sides {
            let mut beyond = side[3] + side[4] * radius;
            for axis in 0..3 {
                beyond += side[axis] * polygons.middle[axis][i];
            }
            inside &= beyond >= 0.0;
        }
        chosen[i] = u8::from((large | close) & inside);
    }
    bits(&chosen)
}

/// Draws polygon `at` of a cluster, and covers the seams (pixels along shared edges) between it and polygons
/// drawn before. Returns whether any pixel may have been covered.
fn draw_polygon(
    simd: Simd,
    level: &PreparedLevel,
    frame: &LevelFrame,
    candidate: &Candidate,
    at: usize,
    scratch: &mut LevelScratch,
    tiles: &mut Tiles,
) -> bool {
    let LevelScratch { vertices, edges, fill: fill_scratch, clip, seams, far_sides, work, .. } = scratch;
    let index = candidate.cluster as usize;
    let Some(cluster) = level.level.clusters().get(index) else { return false };
    let polygon = level.level.polygons().get(cluster.polygons[0] as usize + at);
    let Some(polygon) = polygon else { return false };
    let far = far_sides[at];
    let first = cluster.vertices[0] as usize;
    let outline = polygon.edges[0] as usize..polygon.edges[1] as usize;
    // Whether the vertices of edges that may be cut are moved into the plane at `far`. `None` before the
    // first such edge.
    let mut flattened = None;
    *work += POLYGON_WORK;
    edges.clear();
    clip.edges.clear();
    let first_edge = scratch.first_edges[candidate.level as usize];
    let seams_are_bare = frame.coverage == Coverage::Conservative;
    let (mut most_w, mut nearest_w) = (0.0f32, f32::INFINITY);
    let ([x, y], [least_w, own_most_w]) = (&vertices.places, &vertices.w);
    for (edge, &PreparedEdge { ends, partner }) in (polygon.edges[0]..).zip(&level.edges[outline.clone()]) {
        let [a, b] = ends.map(|vertex| vertex as usize);
        // Both ends were projected with the whole cluster, and are far enough before the eye to be used as
        // they are.
        if vertices.plain[a] && vertices.plain[b] {
            let shared =
                if partner != NO_EDGE && seams_are_bare { first_edge.saturating_add(edge) } else { NO_EDGE };
            edges.push([x[a], y[a]], [x[b], y[b]], shared);
            // End `b` is counted as the beginning of another edge.
            (nearest_w, most_w) = (least(least_w[a], nearest_w), greatest(own_most_w[a], most_w));
            continue;
        }
        // An edge that the near plane or the guard band around the picture may cut is cut in `f64`, from the
        // vertices themselves.
        let flatten = *flattened.get_or_insert_with(|| !is_beyond_window(frame, polygon, far));
        let end = |at: usize| {
            let mut p = level.level.vertices()[first + at].as_dvec3();
            if flatten {
                p -= polygon.normal * (polygon.normal.dot(p) - far);
            }
            let plain = vertices.plain[at].then(|| [x[at], y[at]]);
            End { point: frame.object.at(p.to_array()), plain }
        };
        clip.edges.push([end(a), end(b)]);
    }
    let (mut error, mut least_w) = (f64::from(vertices.error), f64::from(vertices.least_w));
    let (plain, mut most_w) = (clip.edges.is_empty(), f64::from(most_w));
    if !plain {
        let [own_error, own_w, most_own_w] = clip.clip(frame, edges);
        (error, least_w) = (error.max(own_error), least_w.min(own_w));
        most_w = most_w.max(most_own_w);
    }
    // Cheap rejections come before the work on depth planes and tiles.
    simd.finish_edges(edges);
    if plain && !may_be_seen(simd, frame, tiles, edges.bounds, nearest_w) {
        return false;
    }
    // The polygon's vertices lie in a slab around its plane. The polygon must not be drawn if its outline may
    // deviate from that of its faces by more than the slack, or if the projection is too inexact.
    let thickness = polygon.extent[1] - polygon.extent[0];
    let lanes = &level.polygons[level.first_polygons[index] as usize + at / WIDTH];
    let middle = DVec3::from([0, 1, 2].map(|axis| f64::from(lanes.middle[axis][at % WIDTH])));
    let radius = f64::from(lanes.radius[at % WIDTH]);
    let exact = flattened != Some(true) && (polygon.two_sided || faces_eye(frame, polygon, middle, radius));
    let bend = if exact { 0.0 } else { 1.25 * thickness * frame.pixels_per_metre / least_w };
    if !(bend <= MAX_BEND_PX && error <= f64::from(MAX_ERROR_PX)) {
        return false;
    }
    let plane = depth_plane(frame, polygon.normal, middle, radius, far);
    // A face may lie behind its outline by up to the thickness of the polygon's slab, the layer that holds
    // its vertices.
    let floor = if frame.perspective {
        down((1.0 / (most_w + frame.object.error[2] + 2.0 * thickness * frame.w_per_metre)) * (1.0 - 1e-7))
    } else {
        f32::NEG_INFINITY
    };
    // Tiles that are nearer than this polygon everywhere need no coverage.
    let Some(keys) = TileKeys::new(edges, frame, &DepthBound { plane, floor }, tiles) else {
        return false;
    };
    let open = simd.find_open_tiles(&keys, tiles, &mut fill_scratch.open);
    *work += TILE_WORK * open as f32;
    if open == 0 {
        return false;
    }
    let covered = simd.fill(edges, frame.slack, &keys, frame.coverage, fill_scratch, seams, tiles);
    covered | simd.cover_seams(seams, &level.edges[outline], polygon.edges[0], first_edge, tiles)
}

/// Returns whether a polygon may cover pixels that are still empty or farther than the polygon. `bounds`
/// (least column, least row, greatest column, greatest row, in pixels) contain the polygon, and `w` is the
/// least clip coordinate `w` of its points. An estimate suffices, since it decides only what is drawn.
fn may_be_seen(simd: Simd, frame: &LevelFrame, tiles: &Tiles, bounds: [f32; 4], w: f32) -> bool {
    let size = [(tiles.columns * SIDE) as f32, (tiles.rows * SIDE) as f32];
    let range = |axis: usize| {
        let (first, end) = (greatest(bounds[axis], 0.0), least(bounds[axis + 2], size[axis]));
        (end - first >= 1.0).then(|| [first as u32, (end as u32 + 1).min(size[axis] as u32)])
    };
    let (Some(columns), Some(lines)) = (range(0), range(1)) else { return false };
    let Some(rectangle) = (Rectangle { columns, lines }).within_columns(frame.columns) else { return false };
    !frame.perspective || simd.rectangle_may_be_seen(tiles, &rectangle, 1.0 / (BARELY_NEARER * w))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::random;
    use visibility_core::glam::{DMat3, Vec3};
    use visibility_core::view::Window;
    use visibility_core::{Pose, View, geometry::Plane};
    use visibility_occluders::{LevelOccluders, LevelSettings, LevelTriangle};

    /// Width and height of the buffer in pixels.
    const SIZE: [usize; 2] = [64, 32];

    /// Distance in metres of the near plane of the views.
    const NEAR: f64 = 0.1;

    /// Returns a level of triangles.
    fn level(triangles: &[[Vec3; 3]], two_sided: bool) -> Arc<PreparedLevel> {
        let triangles: Vec<_> =
            triangles.iter().map(|&corners| LevelTriangle { corners, two_sided }).collect();
        let settings = LevelSettings::default().with_kept_area(1.0).with_bulge(0.1);
        Arc::new(PreparedLevel::new(
            Arc::new(LevelOccluders::new(&triangles, settings).unwrap()),
            DVec3::ZERO,
        ))
    }

    /// Returns the triangles of a parallelogram between a corner and its two neighbours.
    fn parallelogram([p, s, t]: [DVec3; 3]) -> [[Vec3; 3]; 2] {
        let [a, b, c, d] = [p, p + s, p + s + t, p + t].map(|p| p.as_vec3());
        [[a, b, c], [a, c, d]]
    }

    /// Draws a level and returns the tiles, and an upper bound on the depth keys drawn.
    fn draw(level: &Arc<PreparedLevel>, frame: &LevelFrame) -> (Tiles, f32) {
        let mut all = Vec::new();
        find_candidates(0, level, frame, &mut all);
        let mut order: Vec<u64> = (0..).zip(&all).map(|(index, of)| of.sort_key(index)).collect();
        order.sort_unstable();
        let mut tiles = Tiles::new(SIZE[0], SIZE[1]);
        let (levels, frames) = ([level.clone()], [Some(frame.clone())]);
        let (candidates, mut scratch) = (Candidates { all: &all, order: &order }, LevelScratch::default());
        let (simd, work) = (Simd::best(), f32::INFINITY);
        let (nearest, _) =
            draw_candidates(simd, &levels, &frames, candidates, work, &mut scratch, &mut tiles);
        (tiles, nearest)
    }

    /// Returns the number of covered pixels.
    fn covered(tiles: &Tiles) -> usize {
        let pixels = (0..SIZE[1]).flat_map(|y| (0..SIZE[0]).map(move |x| [x, y]));
        pixels.filter(|&[x, y]| tiles.pixel(x, y) > f32::NEG_INFINITY).count()
    }

    fn frame(view: &View, level: &PreparedLevel, coverage: Coverage) -> LevelFrame {
        LevelFrame::new(view, level, SIZE, SIZE, coverage, 0.0).unwrap()
    }

    /// Returns a view along x from the origin.
    fn ahead() -> View {
        let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
        View::perspective(pose, 1.0, 2.0, NEAR, 900.0).unwrap()
    }

    /// Returns the depth key at which the line of sight through a place on the screen meets a parallelogram,
    /// and whether that is clear of the near plane. `None` if it does not.
    fn hit(frame: &LevelFrame, [p, s, t]: [DVec3; 3], [column, row]: [f64; 2]) -> Option<(f64, bool)> {
        let ([x, y, w, n], near) = (frame.projection.rows, frame.projection.near);
        let [rx, ry, rw, rn, rd] = [x, y, w, n, near].map(|row| DVec3::from(row.linear));
        let lines = [rx - rw * column, ry - rw * row, s.cross(t)];
        let wanted =
            DVec3::new(w.constant * column - x.constant, w.constant * row - y.constant, lines[2].dot(p));
        let at = DMat3::from_cols(lines[0], lines[1], lines[2]).transpose().inverse() * wanted;
        let away = DMat3::from_cols(s, t, lines[2]).inverse() * (at - p);
        let beyond = rd.dot(at) + near.constant;
        let inside = |share: f64| (-1e-6..=1.0 + 1e-6).contains(&share);
        let key = (rn.dot(at) + n.constant) / (rw.dot(at) + w.constant);
        let is_clear = beyond > 4.0 * frame.least_near && rw.dot(at) + w.constant > 4.0 * frame.least_w;
        (inside(away.x) && inside(away.y) && beyond > 0.0).then_some((key, is_clear))
    }

    /// A pixel is covered only if all lines of sight through it, and through what is nearer to it than nearly
    /// the slack, meet the parallelogram that is drawn, at no greater depth key than the pixel has. It is
    /// covered if those within more than the slack do. Many parallelograms reach out of the picture or to the
    /// eye.
    #[test]
    fn pixels_are_covered_where_lines_of_sight_meet_a_polygon() {
        let (mut random, mut counts) = (random(51), [[0; 2]; 2]);
        for trial in 0..600 {
            let mut vector = |size: f64| DVec3::from([0; 3].map(|_| random(-size, size)));
            let reach = [6.0, 40.0][trial % 2];
            let across = vector(reach).as_vec3().as_dvec3();
            let along = vector(reach).as_vec3().as_dvec3();
            let start = (vector(3.0) + DVec3::X * 6.0 - 0.5 * (across + along)).as_vec3().as_dvec3();
            let shape = [start, across, along];
            let turn = vector(0.3);
            let pose = Pose::look_at(DVec3::ZERO, DVec3::X + turn, DVec3::Z);
            let is_parallel = trial % 5 == 0;
            let view = if is_parallel {
                View::orthographic(pose, Window::centered(16.0, 8.0), 0.1, 90.0).unwrap()
            } else {
                View::perspective(pose, 1.0, 2.0, NEAR, 900.0).unwrap()
            };
            let level = level(&parallelogram(shape), true);
            let coverage = if trial % 7 == 0 { Coverage::Sampled } else { Coverage::Conservative };
            let mut frame = frame(&view, &level, coverage);
            let wide = if trial % 3 == 0 {
                frame.slack = 2.0;
                2.0
            } else {
                0.0
            };
            // The centre alone counts for sampled pixels.
            let [inner, outer] = match coverage {
                Coverage::Sampled => [0.0; 2],
                Coverage::Conservative => [0.5 + 0.95 * wide, 0.6 + wide],
            };
            let (tiles, nearest) = draw(&level, &frame);
            let normal = across.cross(along).normalize();
            // Polygons that are seen nearly edge on need not be drawn, nor those that the eye is close to.
            let plane = normal.dot(start).abs();
            let is_plain =
                (is_parallel && normal.dot(pose.forward).abs() > 0.2) || (!is_parallel && plane > 1.0);
            for [x, y] in (0..SIZE[1]).flat_map(|y| (0..SIZE[0]).map(move |x| [x, y])) {
                let key = tiles.pixel(x, y);
                let hits = |by: f64| {
                    [[-1.0, -1.0], [1.0, -1.0], [-1.0, 1.0], [1.0, 1.0], [0.0, 0.0]].map(|[dx, dy]| {
                        hit(&frame, shape, [x as f64 + 0.5 + dx * by, y as f64 + 0.5 + dy * by])
                    })
                };
                let case = || alloc::format!("trial {trial}, pixel {x}, {y} of {shape:?}");
                if key > f32::NEG_INFINITY {
                    let (near, far) = (hits(inner), hits(0.5));
                    assert!(near.iter().all(Option::is_some), "{} is covered", case());
                    let least = far.iter().flatten().fold(f64::INFINITY, |least, hit| least.min(hit.0));
                    let is_behind =
                        coverage == Coverage::Sampled || f64::from(key) <= least + 1e-6 * least.abs();
                    assert!(is_behind && nearest >= key, "{}: {key} of {least}, {nearest}", case());
                    counts[usize::from(is_parallel)][1] += 1;
                } else if is_plain && coverage == Coverage::Conservative {
                    let is_clear = hits(outer).iter().all(|hit| hit.is_some_and(|hit| hit.1));
                    assert!(!is_clear, "{} is bare", case());
                    counts[usize::from(is_parallel)][0] += 1;
                }
            }
        }
        assert!(counts.iter().flatten().all(|&count| count > 4_000), "bare and covered: {counts:?}");
    }

    /// Two walls that share an edge leave no pixel bare along it.
    #[test]
    fn pixels_along_an_edge_of_two_polygons_are_covered() {
        let [low, high] = [DVec3::new(8.0, 0.3, -9.0), DVec3::new(8.0, -0.4, 9.0)];
        let [left, right] = [DVec3::new(-2.0, 9.0, 0.0), DVec3::new(-2.0, -9.0, 0.0)];
        let walls =
            [parallelogram([low, high - low, left]), parallelogram([low, right, high - low])].concat();
        for two_sided in [false, true] {
            for coverage in [Coverage::Conservative, Coverage::Sampled] {
                for turned in [false, true] {
                    let walls: Vec<_> =
                        walls.iter().map(|&[a, b, c]| if turned { [a, c, b] } else { [a, b, c] }).collect();
                    let level = level(&walls, two_sided);
                    let (tiles, _) = draw(&level, &frame(&ahead(), &level, coverage));
                    let is_seen = two_sided || !turned;
                    let expected = if is_seen { SIZE[0] * SIZE[1] } else { 0 };
                    assert_eq!(covered(&tiles), expected, "{coverage:?}, {two_sided}, {turned}");
                }
            }
        }
    }

    /// A wall that fills the picture, of faces that are bent against each other if wanted.
    fn wall(bend: f64) -> Vec<[Vec3; 3]> {
        let [low, high] = [DVec3::new(8.0 - bend, 0.0, -9.0), DVec3::new(8.0 - bend, 0.0, 9.0)];
        let [left, right] = [DVec3::new(bend, 14.0, 0.0), DVec3::new(bend, -14.0, 0.0)];
        let up = high - low;
        [parallelogram([low, up, left]), parallelogram([low, right, up])].concat()
    }

    /// Returns whether any pixel is covered in a frame.
    fn is_drawn(level: &Arc<PreparedLevel>, frame: &LevelFrame) -> bool {
        covered(&draw(level, frame).0) > 0
    }

    /// Outlines whose points may be off by more than a 64th of a pixel are not drawn.
    #[test]
    fn outlines_with_large_errors_are_not_drawn() {
        // The sides of a long wall are beyond the guard band, and its edges are cut.
        let long: Vec<_> = wall(0.0).iter().map(|t| t.map(|p| p * Vec3::new(1.0, 300.0, 300.0))).collect();
        for (case, triangles) in [("plain", wall(0.0)), ("cut", long)] {
            let level = level(&triangles, true);
            let mut frame = frame(&ahead(), &level, Coverage::Conservative);
            let all = SIZE[0] * SIZE[1];
            assert_eq!(covered(&draw(&level, &frame).0), all, "{case}: a wall that fills the picture");
            if case == "cut" {
                // All points of the wall have a `w` of 8, and the bound is a quarter more than the quotient.
                for (error, is_small) in [(0.75, true), (0.85, false)] {
                    frame.object.error[0] = error * 8.0 / 64.0;
                    assert_eq!(is_drawn(&level, &frame), is_small, "an error of {error} 64ths of a pixel");
                }
            }
        }
    }

    /// Bent polygons, of faces that are not in one plane, have outlines that are exact if no face shows its
    /// back, or both sides occlude. Others are not drawn if their outlines may move too far.
    #[test]
    fn bent_outlines_are_drawn_if_they_are_exact() {
        // A wall that faces the eye, and one some centimetres beside it, along which it looks and which
        // reaches behind it: at 8 cm the eye is above the slab, and not certainly above both faces.
        let along = |x: f32| -> Vec<_> {
            wall(0.1).iter().map(|t| t.map(|p| Vec3::new(p.x - 7.9 + x, p.y, p.z))).collect()
        };
        let pose = Pose::look_at(DVec3::ZERO, DVec3::Y, DVec3::Z);
        let narrow = View::perspective(pose, 0.5, 1.0, NEAR, 900.0).unwrap();
        let wide = View::perspective(pose, 2.0, 2.0, NEAR, 900.0).unwrap();
        for (case, triangles, view, exact) in [
            ("from the front", wall(0.1), ahead(), [true, true]),
            ("along it", along(0.08), narrow, [true, false]),
            // Its outline is flattened before it is cut, since it may meet the eye's window.
            ("along it, in a wide view", along(0.15), wide, [false, false]),
        ] {
            for (two_sided, is_exact) in [true, false].into_iter().zip(exact) {
                let level = level(&triangles, two_sided);
                assert_eq!(level.level.polygons().len(), 1, "{case}: faces are one polygon");
                assert!(level.thickness > 0.05, "{case}: {} m thick", level.thickness);
                let mut frame = frame(&view, &level, Coverage::Conservative);
                let pixels = frame.pixels_per_metre;
                for (times, is_small) in [(1e-6, true), (1e6, false)] {
                    frame.pixels_per_metre = pixels * times;
                    let expected = is_small || is_exact;
                    assert_eq!(is_drawn(&level, &frame), expected, "{case}, {two_sided}, {times} times");
                }
            }
        }
    }

    /// How far an outline that is cut may move counts at its nearest point, where it is cut, and not at the
    /// nearest vertex that no cut affects.
    #[test]
    fn bent_outlines_count_where_they_are_cut() {
        // A wall along which the eye looks: vertices at 14 m, others beside and behind the eye. It is cut at
        // a `w` of twice the near plane's distance.
        let along: Vec<_> = wall(0.1).iter().map(|t| t.map(|p| Vec3::new(p.x - 7.75, p.y, p.z))).collect();
        let pose = Pose::look_at(DVec3::ZERO, DVec3::Y, DVec3::Z);
        let view = View::perspective(pose, 2.0, 2.0, NEAR, 900.0).unwrap();
        let level = level(&along, true);
        let mut frame = frame(&view, &level, Coverage::Conservative);
        for (w, expected) in [(1.9 * NEAR, true), (2.1 * NEAR, false), (1.0, false), (13.0, false)] {
            // A point of this `w` moves by just the limit.
            frame.pixels_per_metre = MAX_BEND_PX * w / (1.25 * level.thickness);
            assert_eq!(is_drawn(&level, &frame), expected, "the limit of points with a w of {w}");
        }
    }

    /// Lanes without a polygon, which stand at the origin of the level, are not drawn where the picture shows
    /// it or the eye is there, though each area is large enough.
    #[test]
    fn lanes_without_a_polygon_are_not_drawn() {
        let square = |x: f64| parallelogram([DVec3::new(x, -1.0, -1.0), DVec3::Z * 2.0, DVec3::Y * 2.0]);
        let level = level(&[square(1.0), square(3.0)].concat(), true);
        assert_eq!(level.level.polygons().len(), 2, "polygons of a square each");
        for eye in [-9.0, -0.5, 0.0] {
            let pose = Pose::look_at(DVec3::X * eye, DVec3::X * 9.0, DVec3::Z);
            let view = View::perspective(pose, 1.0, 2.0, NEAR, 900.0).unwrap();
            let frame = frame(&view, &level, Coverage::Conservative);
            let lanes = level.polygons.iter().map(|polygons| worth_drawing(polygons, &frame));
            assert_eq!(lanes.map(u32::count_ones).sum::<u32>(), 2, "lanes chosen by an eye at {eye}");
        }
    }

    /// Each of many clusters is a candidate once, and all are drawn.
    #[test]
    fn clusters_are_candidates_once() {
        let square = |i: usize| {
            let [y, z] = [(i % 9) as f64 - 4.5, (i / 9) as f64 - 2.5];
            parallelogram([DVec3::new(8.0, y, z), DVec3::Z * 0.9, DVec3::Y * 0.9])
        };
        for count in [1, WIDTH - 1, WIDTH, WIDTH + 1, 45] {
            let squares: Vec<_> = (0..count).flat_map(square).collect();
            let triangles: Vec<_> =
                squares.iter().map(|&corners| LevelTriangle { corners, two_sided: true }).collect();
            let settings = LevelSettings::default().with_kept_area(1.0).with_max_cluster_edges(4);
            let level = LevelOccluders::new(&triangles, settings).unwrap();
            let level = Arc::new(PreparedLevel::new(Arc::new(level), DVec3::ZERO));
            assert_eq!(level.level.clusters().len(), count, "clusters of {count} squares");
            let frame = frame(&ahead(), &level, Coverage::Sampled);
            let mut candidates = Vec::new();
            find_candidates(0, &level, &frame, &mut candidates);
            let mut found: Vec<_> = candidates.iter().map(|candidate| candidate.cluster as usize).collect();
            found.sort_unstable();
            assert!(found.iter().copied().eq(0..count), "{count} squares: {found:?}");
            assert!(covered(&draw(&level, &frame).0) > 8 * count, "{count} squares are drawn");
        }
    }

    /// Polygons are drawn only if all of their slab is within the clip planes of a view.
    #[test]
    fn polygons_at_a_clip_plane_are_not_drawn() {
        let wall = parallelogram([DVec3::new(8.0, -9.0, -9.0), DVec3::Y * 18.0, DVec3::Z * 18.0]);
        let mut level = Arc::into_inner(level(&wall, true)).unwrap();
        // The slab reaches a metre beyond the outline on each axis.
        level.thickness = 1.0;
        let level = Arc::new(level);
        for axis in 0..3 {
            for sign in [1.0, -1.0] {
                let normal = DVec3::AXES[axis] * sign;
                // The least coordinate of the slab along the plane's normal.
                let least = if axis > 0 {
                    -10.0
                } else if sign > 0.0 {
                    7.0
                } else {
                    -9.0
                };
                for (beyond, is_drawn) in [(0.01, true), (-0.01, false), (-0.6, false)] {
                    let view = ahead().with_clip_planes(&[Plane::new(normal, beyond - least)]);
                    let (tiles, _) = draw(&level, &frame(&view.unwrap(), &level, Coverage::Conservative));
                    assert_eq!(covered(&tiles) > 0, is_drawn, "{normal}: {beyond} within the plane");
                }
            }
        }
    }
}
