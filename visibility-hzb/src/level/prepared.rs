//! A level prepared for the raster, once: boxes of clusters and sizes of polygons, in lanes.

use crate::lanes::WIDTH;
use crate::rounding::up;
use alloc::sync::Arc;
use alloc::vec::Vec;
use visibility_core::Aabb;
use visibility_core::glam::{DVec3, Vec3};
use visibility_occluders::{LevelOccluders, OccluderCluster, OccluderPolygon};

/// Boxes of up to [`WIDTH`] clusters, or of groups of clusters, one in each lane, relative to the origin of
/// the level, in metres: least x, y, z, greatest x, y, z. Lanes without a box repeat the last box.
pub(crate) type BoxLanes = [[f32; WIDTH]; 6];

/// Up to [`WIDTH`] polygons of one cluster, one in each lane. Positions are relative to the origin of the
/// level. Lanes without a polygon have no area.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Polygons {
    /// Unit normals of the polygons: x, y and z, each by lane.
    pub(crate) normal: [[f32; WIDTH]; 3],
    /// Middles of the boxes around the polygons, in metres: x, y and z, each by lane.
    pub(crate) middle: [[f32; WIDTH]; 3],
    /// Areas of the polygons in square metres.
    pub(crate) area: [f32; WIDTH],
    /// Greatest distance of a vertex of each polygon from its `middle`, in metres.
    pub(crate) radius: [f32; WIDTH],
}

/// The occluders of a level with their position in the world, ready for
/// [`Hzb::add_level`](crate::Hzb::add_level).
///
/// A value can be prepared on any thread, shared by the z-buffers of several views, and kept while the level
/// is not drawn. Memory is about that of the occluders themselves.
#[derive(Clone, Debug)]
pub struct PreparedLevel {
    /// Occluders of the level.
    pub(crate) level: Arc<LevelOccluders>,
    /// Origin in world space that all positions are relative to.
    pub(crate) origin: DVec3,
    /// Middle of the box around all clusters, and distance of the box's corners from it, in metres. The
    /// middle is NaN without clusters.
    pub(crate) ball: (DVec3, f64),
    /// Bounds on the magnitudes of x, y and z relative to `origin`, in metres. They hold for all points of
    /// the balls around polygons: balls about the polygons' middles that contain their vertices.
    pub(crate) reach: DVec3,
    /// Greatest thickness in metres of a polygon's slab, the layer that holds its vertices.
    pub(crate) thickness: f64,
    /// Boxes of clusters, [`WIDTH`] at a time.
    pub(crate) clusters: Vec<BoxLanes>,
    /// Area of the largest polygon of each cluster in square metres, [`WIDTH`] clusters at a time.
    pub(crate) largest: Vec<[f32; WIDTH]>,
    /// Boxes around groups of clusters: each lane has the box around the clusters of [`WIDTH`] elements of
    /// `clusters`.
    pub(crate) groups: Vec<BoxLanes>,
    /// Polygons of all clusters, up to [`WIDTH`] in the lanes of one element. An element has polygons of one
    /// cluster only.
    pub(crate) polygons: Vec<Polygons>,
    /// Index of the first element of `polygons` of each cluster, and one more index at the end.
    pub(crate) first_polygons: Vec<u32>,
    /// Edges of all polygons, in the order in which `level` has them.
    pub(crate) edges: Vec<PreparedEdge>,
}

/// An edge of a polygon.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PreparedEdge {
    /// Both ends, as indices into the cluster's vertices.
    pub(crate) ends: [u32; 2],
    /// Index, among the level's edges, of the same edge of another polygon. [`NO_EDGE`] if there is none.
    pub(crate) partner: u32,
}

/// Index that stands for no edge.
pub(crate) const NO_EDGE: u32 = u32::MAX;

impl PreparedLevel {
    /// Prepares the occluders of a level. Their positions are relative to `origin`, a point of the world,
    /// wherever the scene's origin is later. Takes 100 to 300 ns for each edge.
    pub fn new(level: Arc<LevelOccluders>, origin: DVec3) -> Self {
        let boxes: Vec<Aabb> = level.clusters().iter().map(|cluster| cluster.bounds).collect();
        let clusters = in_lanes(&boxes);
        // The largest polygon of a cluster comes first. Its area decides how early the cluster is drawn.
        let area = |cluster: &OccluderCluster| {
            level.polygons().get(cluster.polygons[0] as usize).map_or(0.0, |largest| largest.area as f32)
        };
        let largest = level.clusters().chunks(WIDTH).map(|clusters| {
            let mut areas = [0.0; WIDTH];
            areas.iter_mut().zip(clusters).for_each(|(out, cluster)| *out = area(cluster));
            areas
        });
        let largest = largest.collect();
        // Boxes around `WIDTH` times `WIDTH` clusters, so that one test rejects many of them.
        let groups: Vec<Aabb> = boxes
            .chunks(WIDTH * WIDTH)
            .map(|boxes| {
                let min = boxes.iter().fold(Vec3::INFINITY, |least, bounds| least.min(bounds.min));
                let max = boxes.iter().fold(Vec3::NEG_INFINITY, |most, bounds| most.max(bounds.max));
                Aabb { min, max }
            })
            .collect();
        let all = groups.iter().map(|bounds| bounds.min).chain(groups.iter().map(|bounds| bounds.max));
        let all = Aabb::from_points(all);
        let ball = (all.center().as_dvec3(), all.half_extent().as_dvec3().length());
        let groups = in_lanes(&groups);
        // Polygons are stored in lanes of `WIDTH`, and each cluster begins a new group of lanes, so that a
        // test of facing and size takes `WIDTH` polygons at once.
        let (mut polygons, mut first_polygons) = (Vec::new(), Vec::new());
        let (mut reach, mut thickness) = (DVec3::ZERO, 0.0f64);
        let none = PreparedEdge { ends: [0; 2], partner: NO_EDGE };
        let mut edges = alloc::vec![none; level.edges().len()];
        for cluster in level.clusters() {
            first_polygons.push(polygons.len() as u32);
            let [first, end] = cluster.polygons.map(|index| index as usize);
            for own in level.polygons()[first..end].chunks(WIDTH) {
                let mut lanes = Polygons {
                    normal: [[0.0; WIDTH]; 3],
                    middle: [[0.0; WIDTH]; 3],
                    area: [0.0; WIDTH],
                    radius: [0.0; WIDTH],
                };
                for (i, polygon) in own.iter().enumerate() {
                    let (middle, radius) = middle_and_radius(&level, polygon);
                    for axis in 0..3 {
                        lanes.normal[axis][i] = polygon.normal[axis] as f32;
                        lanes.middle[axis][i] = middle[axis];
                    }
                    lanes.area[i] = polygon.area as f32;
                    lanes.radius[i] = radius;
                    for edge in polygon.edges[0] as usize..polygon.edges[1] as usize {
                        edges[edge].ends = level.edges()[edge].map(|vertex| vertex - cluster.vertices[0]);
                    }
                    reach = reach.max(middle.abs().as_dvec3() + 2.0 * f64::from(radius));
                    thickness = thickness.max(polygon.extent[1] - polygon.extent[0]);
                }
                polygons.push(lanes);
            }
        }
        first_polygons.push(polygons.len() as u32);
        find_partners(&level, &mut edges);
        // A polygon's vertices lie in its slab, which may reach beyond the ball about its middle by the
        // slab's thickness.
        let reach = reach + thickness;
        Self {
            level,
            origin,
            ball,
            reach,
            thickness,
            clusters,
            largest,
            groups,
            polygons,
            first_polygons,
            edges,
        }
    }
}

/// Returns whether a view that shows `layers` shares a layer with each of `masks`.
pub(super) fn are_all_on(masks: &[u32], layers: u32) -> bool {
    masks.iter().all(|mask| mask & layers != 0)
}

impl PreparedLevel {
    /// Returns whether all objects of the level are drawn in a view that shows `layers`.
    pub(crate) fn is_on(&self, layers: u32) -> bool {
        are_all_on(self.level.layers(), layers)
    }

    /// Returns whether the level may be in a view with the given [sides](super::sides) relative to `origin`.
    /// An estimate suffices: a level that is wrongly left out only hides less.
    pub(crate) fn is_in_view(&self, sides: &[[f64; 5]; 5], origin: DVec3) -> bool {
        let (middle, radius) = self.ball;
        let [x, y, z] = (self.origin - origin + middle).to_array();
        sides.iter().all(|[a, b, c, d, e]| a * x + b * y + c * z + d + e * radius >= 0.0)
    }
}

/// Greatest number of earlier edges with equal ends that an edge is compared with to find its partner. Bounds
/// the time if many polygons have one edge in common.
const MAX_AROUND: usize = 16;

/// Finds for each edge its partner: the same edge of another polygon. The two polygons occlude from the same
/// sides and traverse the edge in opposite directions, so that they face the same way; two-sided polygons may
/// also traverse it in the same direction. If more than two polygons have an edge in common, the two whose
/// normals differ least are partners.
fn find_partners(level: &LevelOccluders, edges: &mut [PreparedEdge]) {
    // For each edge of each polygon: the positions of both ends, the lesser first, then the edge and the
    // polygon.
    let mut sides: Vec<([[u32; 3]; 2], u32, u32)> = Vec::with_capacity(edges.len());
    let place = |edge: u32, end: usize| {
        let vertex = level.edges()[edge as usize][end];
        level.vertices()[vertex as usize].to_array().map(f32::to_bits)
    };
    for (index, polygon) in (0..).zip(level.polygons()) {
        for edge in polygon.edges[0]..polygon.edges[1] {
            let ends = [place(edge, 0), place(edge, 1)];
            sides.push(([ends[0].min(ends[1]), ends[0].max(ends[1])], index, edge));
        }
    }
    sides.sort_unstable();
    let mut pairs: Vec<(f64, u32, u32)> = Vec::new();
    for same in sides.chunk_by(|a, b| a.0 == b.0) {
        pairs.clear();
        for (i, &(_, p, a)) in same.iter().enumerate() {
            for &(_, q, b) in &same[i.saturating_sub(MAX_AROUND)..i] {
                let [of_p, of_q] = [p, q].map(|index| &level.polygons()[index as usize]);
                let turned = place(a, 0) == place(b, 0);
                if p != q && of_p.two_sided == of_q.two_sided && (!turned || of_p.two_sided) {
                    let cosine = of_p.normal.dot(of_q.normal);
                    pairs.push((if turned { -cosine } else { cosine }, a, b));
                }
            }
        }
        pairs.sort_by(|a, b| b.0.total_cmp(&a.0));
        for &(_, a, b) in &pairs {
            let [a, b] = [a, b].map(|edge| edge as usize);
            if edges[a].partner == NO_EDGE && edges[b].partner == NO_EDGE {
                (edges[a].partner, edges[b].partner) = (b as u32, a as u32);
            }
        }
    }
}

/// Returns boxes in lanes of [`WIDTH`]. Lanes beyond the last box repeat that box.
fn in_lanes(boxes: &[Aabb]) -> Vec<BoxLanes> {
    let lanes = |boxes: &[Aabb]| {
        let mut lanes = [[0.0; WIDTH]; 6];
        for i in 0..WIDTH {
            let Some(bounds) = boxes.get(i).or(boxes.last()) else { continue };
            for axis in 0..3 {
                lanes[axis][i] = bounds.min[axis];
                lanes[axis + 3][i] = bounds.max[axis];
            }
        }
        lanes
    };
    boxes.chunks(WIDTH).map(lanes).collect()
}

/// Returns the middle of the box around a polygon's vertices, and the greatest distance of a vertex from it,
/// rounded up. Squares of lengths below 2^-75 underflow in `f32`.
fn middle_and_radius(level: &LevelOccluders, polygon: &OccluderPolygon) -> (Vec3, f32) {
    let [first, end] = polygon.edges.map(|index| index as usize);
    let vertices = || level.edges()[first..end].iter().map(|edge| level.vertices()[edge[0] as usize]);
    let middle = Aabb::from_points(vertices()).center();
    let distance = |vertex: Vec3| up(vertex.as_dvec3().distance(middle.as_dvec3()));
    (middle, vertices().map(distance).fold(0.0, f32::max))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::random;
    use visibility_occluders::{LevelSettings, LevelTriangle};

    /// Returns the two triangles of a quadrilateral, the other way round if `turned`.
    fn quad([a, b, c, d]: [[f32; 3]; 4], turned: bool, two_sided: bool) -> [LevelTriangle; 2] {
        let order = if turned { [[a, c, b], [a, d, c]] } else { [[a, b, c], [a, c, d]] };
        order.map(|corners| LevelTriangle { corners: corners.map(Vec3::from_array), two_sided })
    }

    fn prepared(triangles: &[LevelTriangle]) -> PreparedLevel {
        let settings = LevelSettings::default().with_kept_area(1.0);
        PreparedLevel::new(Arc::new(LevelOccluders::new(triangles, settings).unwrap()), DVec3::ZERO)
    }

    /// Walls that meet in an edge are partners if they face the same way and occlude from the same sides.
    #[test]
    fn partners_face_the_same_way() {
        let floor = [[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [4.0, 4.0, 0.0], [0.0, 4.0, 0.0]];
        let wall = [[4.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 4.0], [4.0, 0.0, 4.0]];
        for (case, (turned, sides, expected)) in [
            (false, [false, false], 2),
            (true, [false, false], 0),
            (false, [true, true], 2),
            (true, [true, true], 2),
            (false, [true, false], 0),
            (true, [false, true], 0),
        ]
        .into_iter()
        .enumerate()
        {
            let level = prepared(&[quad(floor, false, sides[0]), quad(wall, turned, sides[1])].concat());
            assert_eq!(level.level.polygons().len(), 2, "polygons of case {case}");
            let partners = level.edges.iter().filter(|edge| edge.partner != NO_EDGE).count();
            assert_eq!(partners, expected, "edges with a partner in case {case}");
        }
    }

    #[test]
    fn spheres_hold_their_polygons_at_all_scales() {
        for unit in (-120..=60).step_by(15).map(|power| 2f32.powi(power)) {
            let corners = [[1.0, 0.0, 0.0], [0.0, 3.0, 0.0], [0.0, 0.0, 2.0]].map(Vec3::from_array);
            let triangle = LevelTriangle { corners: corners.map(|x| x * unit), two_sided: false };
            let level = prepared(&[triangle]).level.clone();
            let (middle, radius) = middle_and_radius(&level, &level.polygons()[0]);
            let radius = f64::from(radius) / f64::from(unit);
            for vertex in level.vertices() {
                let distance = (vertex.as_dvec3() - middle.as_dvec3()).length() / f64::from(unit);
                assert!(distance <= radius && radius < 2.0, "in units of {unit:e}: {distance}, {radius}");
            }
        }
    }

    /// Partners have each other and the same ends, also where several walls meet. Groups of clusters, the
    /// thickness and the reach hold all polygons.
    #[test]
    fn partners_are_pairs_and_groups_hold_their_clusters() {
        let (mut random, mut partners, mut pairs) = (random(91), 0, 0);
        for trial in 0..20 {
            let mut triangles = Vec::new();
            let mut corner = || [0; 3].map(|_| random(0.0, 3.0) as u32 as f32 * 4.0);
            let fan = [corner(), corner()];
            for i in 0..400 {
                let [a, b, c] =
                    if i % 2 == 0 { [fan[0], fan[1], corner()] } else { [corner(), corner(), corner()] };
                let corners = [a, b, c].map(Vec3::from_array);
                triangles.push(LevelTriangle { corners, two_sided: i % 3 == 0 });
            }
            let Ok(level) = LevelOccluders::new(&triangles, LevelSettings::default().with_kept_area(1.0))
            else {
                continue;
            };
            let level = PreparedLevel::new(Arc::new(level), DVec3::ZERO);
            let place =
                |edge: usize| level.level.edges()[edge].map(|vertex| level.level.vertices()[vertex as usize]);
            for (index, edge) in level.edges.iter().enumerate().filter(|(_, edge)| edge.partner != NO_EDGE) {
                let other = edge.partner as usize;
                assert_eq!(level.edges[other].partner as usize, index, "trial {trial}: partner of {other}");
                let ([a, b], ends) = (place(index), place(other));
                assert!(ends == [a, b] || ends == [b, a], "trial {trial}: ends of {index} and {other}");
                partners += 1;
            }
            pairs += level.level.polygons().len();
            let clusters = level.level.clusters();
            for (i, cluster) in clusters.iter().enumerate() {
                let (group, lane) = (i / (WIDTH * WIDTH) / WIDTH, i / (WIDTH * WIDTH) % WIDTH);
                let bounds = |axis: usize| level.groups[group][axis][lane];
                let is_in = (0..3).all(|axis| {
                    bounds(axis) <= cluster.bounds.min[axis] && cluster.bounds.max[axis] <= bounds(axis + 3)
                });
                assert!(is_in, "trial {trial}: cluster {i}");
            }
            let thickness = level.level.polygons().iter().map(|own| own.extent[1] - own.extent[0]);
            assert_eq!(level.thickness, thickness.fold(0.0, f64::max), "trial {trial}: thickness");
            let reach = level.level.vertices().iter().map(|own| own.as_dvec3().abs());
            assert!(reach.fold(DVec3::ZERO, DVec3::max).cmple(level.reach).all(), "trial {trial}: reach");
        }
        assert!(partners > 500 && pairs > 1_000, "{partners} edges of {pairs} polygons have a partner");
    }
}
