//! The occlusion tree as an occlusion map: which polygons are inserted, and in which order.

use super::nodes::{Nodes, Worth};
use super::screen_density::ScreenDensity;
use crate::clip_projection::ClipProjection;
use crate::lazy_queue::Candidate;
use crate::occluders::{OccluderTriangle, triangles_of};
use crate::shadow::{OccluderPolygon, Shadows, plane_of};
use alloc::collections::BinaryHeap;
use alloc::vec::Vec;
use core::ops::Range;
use visibility_core::glam::{Affine3A, DVec3};
use visibility_core::view::{Eye, ViewPlanes};
use visibility_core::{Aabb, Accuracy, OccluderMesh, OcclusionMap, View, occlusion::Occlusion};

/// A polygon that has been added to the map and takes effect at the next flush.
#[derive(Clone, Debug)]
pub(super) struct QueuedPolygon {
    /// Range of the polygon's vertices in `OcclusionTree::vertices`.
    vertices: Range<usize>,
    /// Unit normal of the polygon's front, the side from which the vertices run counter-clockwise.
    normal: DVec3,
    /// Least and greatest coordinate of the polygon's surface along `normal`, in metres from
    /// `Scene::origin`, rounded outwards.
    extent_along_normal: [f64; 2],
    /// Bound on the error of each coordinate of the vertices, in metres, from placing them in the scene.
    placing_error: f64,
    /// Whether the polygon also hides for eyes behind its front; if false, only for eyes in front.
    two_sided: bool,
}

/// Greatest extent of two triangles along their common normal at which they count as one flat quadrilateral,
/// as a fraction of the quadrilateral's longer diagonal.
const FLAT: f64 = 1e-6;

/// Gain at or below which a polygon is not inserted, in steradians or objects as [`Worth`] measures it.
const MIN_GAIN: f32 = 1e-6;

/// A shadow taken from the queue, its gain computed again, is inserted at once if its gain is at least this
/// fraction of the greatest gain still in the queue.
const NEARLY: f32 = 0.7;

/// An occlusion map in object space, exact up to rounding and independent of the image resolution.
///
/// Of the added polygons, those with the greatest gain (the part of the image, or the number of objects in
/// it, that the polygon newly puts in shadow) are used, up to 64 per frame unless set otherwise. The tree
/// works best with few large convex polygons, as [`OcclusionTreeCuller`](crate::OcclusionTreeCuller) supplies
/// them. Meshes, as [`OcclusionCuller`](visibility_core::OcclusionCuller) supplies them, are added face by
/// face.
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
    /// Projection of the present frame's view.
    projection: ClipProjection,
    /// Clip planes of the frame's view, in metres relative to `Scene::origin`.
    clip_planes: ViewPlanes,
    /// Tree of the planes through the eye that bound the inserted shadows.
    pub(super) nodes: Nodes,
    /// Shadows cast in the present frame, whether inserted or not.
    shadows: Shadows,
    /// Number of polygons that may still be inserted in the present frame, of the maximum `most`.
    left: usize,
    /// Maximum number of polygons inserted per frame.
    pub(super) most: usize,
    /// Vertices of the queued polygons, in metres relative to `Scene::origin`.
    pub(super) vertices: Vec<DVec3>,
    /// Polygons that take effect at the next flush.
    pub(super) queue: Vec<QueuedPolygon>,
    /// True if polygons were queued before the beginning of their frame, so that the next `begin` keeps the
    /// queue. False if the queued polygons are for the present frame, so that the next `begin` drops them.
    pub(super) is_queued_ahead: bool,
    /// Scratch: queue of shadows, greatest gain first.
    heap: BinaryHeap<Candidate>,
    /// Scratch: triangles of the mesh being added.
    triangles: Vec<OccluderTriangle>,
    /// Number of objects in each part of the image. If known, shadows are chosen by the number of objects
    /// that they may hide; if `None`, by solid angle.
    pub(super) density: Option<ScreenDensity>,
}

impl Default for OcclusionTree {
    fn default() -> Self {
        Self::new()
    }
}

impl OcclusionTree {
    /// Creates an empty tree, which hides nothing and uses up to 64 polygons per frame.
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
            queue: Vec::new(),
            is_queued_ahead: false,
            heap: BinaryHeap::new(),
            triangles: Vec::new(),
            density: None,
        }
    }

    /// Sets the maximum number of polygons inserted per frame, from the next frame on. With 0, no box inside
    /// the image is hidden.
    #[must_use]
    pub fn with_polygons(self, most: usize) -> Self {
        Self { most, ..self }
    }

    /// Returns the number of planes through the eye in the tree, including the four sides of the image.
    pub fn len(&self) -> usize {
        self.nodes.nodes.len()
    }

    /// Tests whether no polygon has been inserted in the present frame, so that only boxes outside the image
    /// are hidden. False once one is inserted.
    pub fn is_empty(&self) -> bool {
        self.nodes.planes.is_empty()
    }

    /// Tests whether the eye may be in the box around an occluder, which `transform` takes to metres relative
    /// to `Scene::origin`. False for parallel views. The answer only chooses which polygons are added, so
    /// rounding does no harm.
    fn may_surround_eye(&self, occluder: &OccluderMesh, transform: &Affine3A) -> bool {
        let Eye::Point(eye) = self.projection.eye else { return false };
        let (center, half) = (occluder.bounds().center(), occluder.bounds().half_extent());
        let m = &transform.matrix3;
        let reach = m.x_axis.abs() * half.x + m.y_axis.abs() * half.y + m.z_axis.abs() * half.z;
        let away = eye.as_vec3a() - transform.transform_point3a(center.into());
        away.abs().cmple(reach).all()
    }

    /// Queues a polygon, which takes effect at the next flush. Queued during a frame, it is for that frame;
    /// if [`is_queued_ahead`](Self::is_queued_ahead) is set, it is for the frame that begins next.
    pub(super) fn enqueue(&mut self, occluder_polygon: &OccluderPolygon<'_>) {
        let first = self.vertices.len();
        self.vertices.extend_from_slice(occluder_polygon.vertices);
        let vertices = first..self.vertices.len();
        let &OccluderPolygon { normal, extent_along_normal, placing_error, two_sided, .. } = occluder_polygon;
        self.queue.push(QueuedPolygon { vertices, normal, extent_along_normal, placing_error, two_sided });
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
        if !core::mem::take(&mut self.is_queued_ahead) {
            self.queue.clear();
            self.vertices.clear();
        }
    }

    fn add(&mut self, occluder: &OccluderMesh, transform: &Affine3A) {
        if !occluder.is_inside(&self.clip_planes, transform) {
            return;
        }
        let mut triangles = core::mem::take(&mut self.triangles);
        triangles.clear();
        // The backs of a closed mesh hide nothing that its fronts do not, unless the eye is in the mesh.
        let closed = occluder.is_closed() && !self.may_surround_eye(occluder, transform);
        let placing_error = triangles_of(occluder, transform, 0, closed, &mut triangles);
        let mut i = 0;
        while i < triangles.len() {
            // Two consecutive triangles often form a quadrilateral face.
            let [a, b, c] = triangles[i].corners;
            let face = triangles.get(i + 1).and_then(|next| quad(&triangles[i], next));
            let two_sided = triangles[i].two_sided;
            i += if face.is_some() { 2 } else { 1 };
            let (quad, triangle) = (face.unwrap_or_default(), [a, b, c]);
            let vertices: &[DVec3] = if face.is_some() { &quad } else { &triangle };
            if let Some((normal, extent_along_normal, _)) = plane_of(vertices, &[], placing_error) {
                self.enqueue(&OccluderPolygon {
                    vertices,
                    normal,
                    extent_along_normal,
                    placing_error,
                    two_sided,
                });
            }
        }
        self.triangles = triangles;
    }

    fn flush(&mut self) {
        let worth = self.density.as_ref().map_or(Worth::Angle, Worth::Density);
        self.heap.clear();
        for queued in &self.queue {
            let occluder_polygon = OccluderPolygon {
                vertices: &self.vertices[queued.vertices.clone()],
                normal: queued.normal,
                extent_along_normal: queued.extent_along_normal,
                placing_error: queued.placing_error,
                two_sided: queued.two_sided,
            };
            if self.shadows.cast(&self.projection, &occluder_polygon) {
                let number = self.shadows.list.len() as u32 - 1;
                let corners = &self.shadows.corners[self.shadows.list[number as usize].corners.clone()];
                let gain = f64::from(worth.of(&self.projection, corners));
                self.heap.push(Candidate { gain, tie_break: 0.0, number, evaluated_at: u32::MAX });
            }
        }
        self.queue.clear();
        self.vertices.clear();
        // Greatest gain first. The gain of a shadow only shrinks as others are inserted. So if a gain,
        // computed again, is still about the greatest, it need not be compared with the rest.
        while let Some(candidate) = self.heap.pop() {
            if self.left == 0 {
                break;
            }
            let number = candidate.number as usize;
            let gain = self.nodes.descend(&self.projection, &self.shadows, number, worth);
            if !(gain > MIN_GAIN) {
                continue;
            }
            let added = self.nodes.planes.len() as u32;
            if candidate.evaluated_at == added
                || self.heap.peek().is_none_or(|next| NEARLY * next.gain as f32 <= gain)
            {
                self.nodes.add(&self.projection, &self.shadows, number);
                self.left -= 1;
            } else {
                self.heap.push(Candidate { gain: gain.into(), evaluated_at: added, ..candidate });
            }
        }
        self.heap.clear();
    }

    fn test(&self, bounds: &Aabb) -> Occlusion {
        self.nodes.test(&self.projection, bounds)
    }
}

/// Returns the convex quadrilateral that two triangles form, in boundary order. `None` if they share no edge
/// in opposite directions, or the quadrilateral is not flat to 1e-6 of its longer diagonal or not strictly
/// convex.
fn quad(one: &OccluderTriangle, two: &OccluderTriangle) -> Option<[DVec3; 4]> {
    let (p, q) = (one.corners, two.corners);
    for i in 0..3 {
        for j in 0..3 {
            let (a, b) = (p[i], p[(i + 1) % 3]);
            if q[j] == b && q[(j + 1) % 3] == a {
                let quad = [b, p[(i + 2) % 3], a, q[(j + 2) % 3]];
                let (normal, extent_along_normal, _) = plane_of(&quad, &[], 0.0)?;
                let size = quad[0].distance(quad[2]).max(quad[1].distance(quad[3]));
                let convex = (0..4).all(|k| {
                    let (a, b, c) = (quad[k], quad[(k + 1) % 4], quad[(k + 2) % 4]);
                    normal.dot((b - a).cross(c - b)) > 0.0
                });
                return (convex && extent_along_normal[1] - extent_along_normal[0] <= FLAT * size)
                    .then_some(quad);
            }
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::clip_projection::U;
    use visibility_core::Pose;
    use visibility_core::glam::Vec3;

    /// A triangle 10^6 m from the origin of its mesh is moved to before the eye, where its corners are known
    /// to some 10^-9 m.
    #[test]
    fn shadows_have_the_errors_of_placing_their_meshes() {
        let far = 1e6;
        let corners = [[-1.0, -1.0], [1.0, -1.0], [0.0, 1.0]].map(|[y, z]| Vec3::new(far, y, z));
        let mesh = OccluderMesh::from_triangles(&[corners]).unwrap().with_two_sided(true);
        let transform = Affine3A::from_translation(Vec3::new(3.0 - far, 0.5, 0.25));
        let error = triangles_of(&mesh, &transform, 0, false, &mut Vec::new());
        let mut tree = OcclusionTree::new();
        let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
        tree.begin(&View::perspective(pose, 1.5, 1.5, 0.1, 100.0).unwrap(), DVec3::ZERO);
        tree.add(&mesh, &transform);
        for queued in &tree.queue {
            let [low, high] = queued.extent_along_normal;
            let ends = tree.vertices[queued.vertices.clone()].iter().map(|v| queued.normal.dot(*v));
            assert!(
                ends.into_iter().all(|at| low < at - 1.9 * error && at + 1.9 * error < high),
                "{queued:?}"
            );
        }
        tree.flush();
        assert_eq!(tree.shadows.list.len(), 1, "a shadow");
        for edge in &tree.shadows.edges {
            for (end, direction) in edge.ends.iter().zip(edge.directions) {
                let expected = tree.projection.direction(*end, error).unwrap().error;
                assert_eq!(direction.error, expected, "error of the direction of {end}");
                assert!(expected > 1e5 * U, "{expected} is more than rounding in the projection");
            }
        }
    }

    #[test]
    fn two_triangles_are_one_face_if_they_share_an_edge_in_one_plane() {
        let triangle = |corners: [[f64; 3]; 3]| OccluderTriangle {
            corners: corners.map(DVec3::from_array),
            source: 0,
            two_sided: false,
        };
        let [a, b, c, d] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
        let first = triangle([a, b, c]);
        assert!(quad(&first, &triangle([a, c, d])).is_some(), "a square");
        for (other, name) in [
            ([a, d, [-1.0, 0.0, 0.0]], "one corner in common"),
            ([c, [2.0, 2.0, 0.0], d], "another corner in common"),
            ([a, c, [0.0, 1.0, 1e-3]], "a bent edge"),
            ([a, c, [1.5, 5.0, 0.0]], "a dent"),
        ] {
            assert!(quad(&first, &triangle(other)).is_none(), "{name}");
        }
    }
}
