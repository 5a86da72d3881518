//! The tree as an occlusion map: which polygons are added, and in which order.

use super::nodes::{Nodes, Worth};
use super::screen_density::ScreenDensity;
use crate::clip_projection::ClipProjection;
use crate::occluders::{OccluderTriangle, triangles_of};
use crate::shadow::{OccluderPolygon, Shadows, plane_of};
use alloc::collections::BinaryHeap;
use alloc::vec::Vec;
use core::cmp::Ordering;
use core::ops::Range;
use visibility_core::glam::{Affine3A, DVec3};
use visibility_core::view::ViewPlanes;
use visibility_core::{Aabb, Accuracy, OccluderMesh, OcclusionMap, View, occlusion::Occlusion};

/// A polygon that has been added and takes effect at the next flush.
#[derive(Clone, Debug)]
pub(super) struct Waiting {
    vertices: Range<usize>,
    normal: DVec3,
    reach: [f64; 2],
    two_sided: bool,
}

/// Polygons that would put less than this solid angle in shadow, in steradians, are left out.
const LEAST_GAIN: f32 = 1e-6;

/// A polygon is added without another comparison if its gain is at least this share of the greatest.
const NEARLY: f32 = 0.7;

/// How much of the picture a shadow would put in shadow that is not yet, with its number.
#[derive(Clone, Copy, Debug)]
struct Gain {
    angle: f32,
    number: u32,
    /// Number of polygons that had been added when `angle` was computed.
    asked: u32,
}

impl PartialEq for Gain {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Gain {}

impl PartialOrd for Gain {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Gain {
    fn cmp(&self, other: &Self) -> Ordering {
        self.angle.total_cmp(&other.angle).then(other.number.cmp(&self.number))
    }
}

/// An occlusion map in object space: exact up to rounding, at any resolution.
///
/// Of what is added, the polygons that cover most of the picture are used, 64 unless set otherwise. It is at
/// its best with few large convex polygons, as [`OcclusionTreeCuller`](crate::OcclusionTreeCuller) gives it;
/// meshes, as [`OcclusionCuller`](visibility_core::OcclusionCuller) gives it, are taken by their faces.
///
/// ```
/// use visibility_bsp::OcclusionTree;
/// use visibility_core::glam::{Affine3A, DVec3};
/// use visibility_core::{occlusion::Occlusion, Aabb, OccluderMesh, OcclusionMap, Pose, View};
/// let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
/// let view = View::perspective(pose, 1.0, 1.5, 0.1, f64::INFINITY)?;
/// let mut tree = OcclusionTree::new();
/// tree.begin(&view, DVec3::ZERO);
/// // Two slabs that meet in the middle: neither alone hides what is behind both.
/// for y in [-3.0, 0.0] {
///     let slab = Aabb::from_arrays([4.0, y, -3.0], [4.5, y + 3.0, 3.0]);
///     tree.add(&OccluderMesh::cuboid(&slab)?, &Affine3A::IDENTITY);
/// }
/// tree.flush();
/// assert_eq!(tree.test(&Aabb::from_arrays([8.0, -1.0, -1.0], [9.0, 1.0, 1.0])), Occlusion::Hidden);
/// assert_eq!(tree.test(&Aabb::from_arrays([2.0, -1.0, -1.0], [3.0, 1.0, 1.0])), Occlusion::Visible);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct OcclusionTree {
    projection: ClipProjection,
    /// Clip planes of the frame\'s view, relative to the scene\'s origin.
    clip_planes: ViewPlanes,
    pub(super) nodes: Nodes,
    shadows: Shadows,
    /// Number of polygons that may still be used this frame, and the maximum per frame.
    left: usize,
    pub(super) most: usize,
    pub(super) vertices: Vec<DVec3>,
    pub(super) waiting: Vec<Waiting>,
    heap: BinaryHeap<Gain>,
    pieces: Vec<OccluderTriangle>,
    /// Density of objects in the picture, where it is known: shadows are chosen by what they may fall on.
    pub(super) density: Option<ScreenDensity>,
}

impl Default for OcclusionTree {
    fn default() -> Self {
        Self::new()
    }
}

impl OcclusionTree {
    /// An empty tree, for 64 polygons a frame.
    pub fn new() -> Self {
        let mut nodes = Nodes::default();
        nodes.clear();
        Self {
            projection: ClipProjection::BLIND,
            clip_planes: ViewPlanes::NONE,
            nodes,
            shadows: Shadows::default(),
            left: 0,
            most: 64,
            vertices: Vec::new(),
            waiting: Vec::new(),
            heap: BinaryHeap::new(),
            pieces: Vec::new(),
            density: None,
        }
    }

    /// Sets the maximum number of polygons used a frame, 0 for none; any number is allowed.
    pub fn with_polygons(self, most: usize) -> Self {
        Self { most, ..self }
    }

    /// Number of planes through the eye in the tree, the four sides of the picture included.
    pub fn len(&self) -> usize {
        self.nodes.nodes.len()
    }

    /// Whether no polygon is in use this frame.
    pub fn is_empty(&self) -> bool {
        self.nodes.planes.is_empty()
    }

    /// Adds a polygon for the next flush. It is kept if a frame begins in between.
    pub(super) fn wait(&mut self, occluder_polygon: &OccluderPolygon<'_>) {
        let first = self.vertices.len();
        self.vertices.extend_from_slice(occluder_polygon.vertices);
        let vertices = first..self.vertices.len();
        let (normal, reach, two_sided) =
            (occluder_polygon.normal, occluder_polygon.reach, occluder_polygon.two_sided);
        self.waiting.push(Waiting { vertices, normal, reach, two_sided });
    }
}

impl OcclusionMap for OcclusionTree {
    fn name(&self) -> &str {
        "occlusion-tree"
    }

    fn accuracy(&self) -> Accuracy {
        Accuracy::Conservative
    }

    fn begin(&mut self, view: &View, origin: DVec3) {
        self.projection = ClipProjection::new(view, origin);
        self.clip_planes = view.clip_planes_from(origin);
        self.nodes.clear();
        self.shadows.clear();
        self.left = self.most;
    }

    fn add(&mut self, occluder: &OccluderMesh, transform: &Affine3A) {
        if !occluder.is_inside(&self.clip_planes, transform) {
            return;
        }
        let mut pieces = core::mem::take(&mut self.pieces);
        pieces.clear();
        triangles_of(occluder, transform, 0, occluder.is_closed(), &mut pieces);
        let mut i = 0;
        while i < pieces.len() {
            // Two triangles after one another often are a face.
            let [a, b, c] = pieces[i].corners;
            let face = pieces.get(i + 1).and_then(|next| quad(&pieces[i], next));
            let two_sided = pieces[i].two_sided;
            i += if face.is_some() { 2 } else { 1 };
            let (quad, triangle) = (face.unwrap_or_default(), [a, b, c]);
            let vertices: &[DVec3] = if face.is_some() { &quad } else { &triangle };
            if let Some((normal, reach, _)) = plane_of(vertices) {
                self.wait(&OccluderPolygon { vertices, normal, reach, two_sided });
            }
        }
        self.pieces = pieces;
    }

    fn flush(&mut self) {
        let worth = self.density.as_ref().map_or(Worth::Angle, Worth::Density);
        self.heap.clear();
        for waiting in &self.waiting {
            let occluder_polygon = OccluderPolygon {
                vertices: &self.vertices[waiting.vertices.clone()],
                normal: waiting.normal,
                reach: waiting.reach,
                two_sided: waiting.two_sided,
            };
            if self.shadows.cast(&self.projection, &occluder_polygon) {
                let number = self.shadows.list.len() as u32 - 1;
                let corners = &self.shadows.corners[self.shadows.list[number as usize].corners.clone()];
                let angle = worth.of(&self.projection, corners);
                self.heap.push(Gain { angle, number, asked: u32::MAX });
            }
        }
        self.waiting.clear();
        self.vertices.clear();
        // The largest first. What one adds only shrinks as others are added, so that one whose gain, asked
        // again, still is about the greatest need not be compared with the rest.
        while let Some(Gain { number, asked, .. }) = self.heap.pop() {
            if self.left == 0 {
                break;
            }
            let angle = self.nodes.reach(&self.projection, &self.shadows, number as usize, worth);
            if !(angle > LEAST_GAIN) {
                continue;
            }
            let added = self.nodes.planes.len() as u32;
            if asked == added || self.heap.peek().is_none_or(|next| NEARLY * next.angle <= angle) {
                self.nodes.add(&self.projection, &self.shadows, number as usize);
                self.left -= 1;
            } else {
                self.heap.push(Gain { angle, number, asked: added });
            }
        }
        self.heap.clear();
    }

    fn test(&self, bounds: &Aabb) -> Occlusion {
        self.nodes.test(&self.projection, bounds)
    }
}

/// Two triangles as one flat convex quadrilateral, if they share an edge.
fn quad(one: &OccluderTriangle, two: &OccluderTriangle) -> Option<[DVec3; 4]> {
    let (p, q) = (one.corners, two.corners);
    for i in 0..3 {
        for j in 0..3 {
            let (a, b) = (p[i], p[(i + 1) % 3]);
            if q[j] == b && q[(j + 1) % 3] == a {
                let quad = [b, p[(i + 2) % 3], a, q[(j + 2) % 3]];
                let (normal, reach, _) = plane_of(&quad)?;
                let size = quad[0].distance(quad[2]).max(quad[1].distance(quad[3]));
                let convex = (0..4).all(|k| {
                    let (a, b, c) = (quad[k], quad[(k + 1) % 4], quad[(k + 2) % 4]);
                    normal.dot((b - a).cross(c - b)) > 0.0
                });
                return (convex && reach[1] - reach[0] <= 1e-6 * size).then_some(quad);
            }
        }
    }
    None
}
