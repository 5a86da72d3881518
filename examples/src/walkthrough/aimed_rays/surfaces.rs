//! First hits of rays on a world's triangles, found in a hierarchy of boxes. A hit that is uncertain because
//! of rounding does not count as a hit, but may block the triangles behind it.
//!
//! To be independent of the cullers that it judges, this module does not use their projection, raster or
//! hierarchy.

use crate::walkthrough::World;
use glam::{DMat4, DVec3, Vec3};

/// Maximum number of triangles of a leaf.
const LEAF: usize = 4;

/// Bound on the rounding error of a determinant of three differences, relative to the sum of the magnitudes
/// of its terms: at most 10 roundings of 2^-53.
const ROUNDING: f64 = 2e-15;

/// Triangle of an object.
#[derive(Clone, Copy, Debug)]
pub(super) struct Surface {
    /// Corners in metres relative to the scene's origin, counter-clockwise as seen from the front.
    pub(super) corners: [Vec3; 3],
    /// Index of the object.
    pub(super) object: u32,
    /// Whether things behind the object are visible through it.
    see_through: bool,
    /// Whether the triangle is drawn only from its front.
    one_sided: bool,
}

/// A node of the hierarchy. Nodes are in depth-first order.
struct Node {
    /// Box around the node's triangles, in metres relative to the scene's origin.
    min: Vec3,
    max: Vec3,
    /// Number of triangles of a leaf, 0 for an inner node.
    count: u32,
    /// Index of a leaf's first triangle, or of an inner node's second child. The first child is the next
    /// node.
    at: u32,
}

/// Triangles of a world with positive area, in a hierarchy of boxes.
pub(super) struct Surfaces {
    surfaces: Vec<Surface>,
    nodes: Vec<Node>,
}

/// Camera of a frame.
#[derive(Clone, Copy)]
pub(super) struct Camera {
    /// Eye in metres relative to the scene's origin.
    pub(super) eye: DVec3,
    /// Clip matrix for points relative to the eye.
    pub(super) clip_from_eye: DMat4,
    /// Factors of clip z and clip w. The weighted sum is positive for points beyond the near plane.
    pub(super) near: [f64; 2],
}

impl Camera {
    /// Returns whether a point is certainly inside the picture and beyond the near plane. The point is
    /// relative to the eye.
    pub(super) fn certainly_shows(&self, p: DVec3) -> bool {
        let clip = self.clip_from_eye * p.extend(1.0);
        let beyond = self.near[0] * clip.z + self.near[1] * clip.w;
        clip.x.abs().max(clip.y.abs()) < clip.w * (1.0 - 1e-9) && beyond > 1e-9 * (clip.z.abs() + clip.w)
    }

    /// Returns whether a point is certainly nearer than the near plane. The point is relative to the eye.
    fn is_before_near(&self, p: DVec3) -> bool {
        let clip = self.clip_from_eye * p.extend(1.0);
        self.near[0] * clip.z + self.near[1] * clip.w < -1e-9 * (clip.z.abs() + clip.w)
    }
}

/// Result of casting a ray, with scratch memory.
#[derive(Default)]
pub(super) struct Met {
    /// Objects that the ray certainly meets inside the picture, before any opaque triangle of another object.
    pub(super) objects: Vec<u32>,
    /// Index of the nearest triangle that may block the ray.
    pub(super) first: Option<u32>,
    /// For each certain hit, its greatest possible distance and the triangle's index.
    hits: Vec<(f64, u32)>,
    /// For each possible hit on an opaque triangle, its least possible distance and the triangle's index.
    blocks: Vec<(f64, u32)>,
    stack: Vec<u32>,
}

/// Certain or uncertain hit of a ray on a triangle. Distances are in lengths of the ray's direction.
struct Hit {
    nearest: f64,
    farthest: f64,
    certain: bool,
}

impl Surfaces {
    /// Builds the hierarchy over the triangles of a world.
    pub(super) fn new(world: &World) -> Self {
        let mut surfaces = Vec::with_capacity(world.source.triangle_count());
        for item in world.items() {
            let has_area =
                |[a, b, c]: &[Vec3; 3]| (*b - *a).as_dvec3().cross((*c - *a).as_dvec3()) != DVec3::ZERO;
            surfaces.extend(item.triangles.iter().filter(|t| has_area(t)).map(|corners| Surface {
                corners,
                object: item.key,
                see_through: item.see_through,
                one_sided: item.one_sided,
            }));
        }
        let mut made = Self { surfaces, nodes: Vec::new() };
        made.divide(0, made.surfaces.len());
        made
    }

    /// Appends the nodes of a half-open range of triangles, split at the median along its longest axis.
    fn divide(&mut self, first: usize, end: usize) {
        let own = &mut self.surfaces[first..end];
        let points = own.iter().flat_map(|surface| surface.corners);
        let (min, max) =
            points.fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), p| (low.min(p), high.max(p)));
        let node = self.nodes.len();
        self.nodes.push(Node { min, max, count: own.len() as u32, at: first as u32 });
        if own.len() <= LEAF {
            return;
        }
        let axis = (max - min).max_position();
        let middle = own.len() / 2;
        let place = |surface: &Surface| surface.corners.iter().map(|p| p[axis]).sum::<f32>();
        own.select_nth_unstable_by(middle, |a, b| place(a).total_cmp(&place(b)));
        self.divide(first, first + middle);
        (self.nodes[node].count, self.nodes[node].at) = (0, self.nodes.len() as u32);
        self.divide(first + middle, end);
    }

    /// Returns all triangles.
    pub(super) fn all(&self) -> &[Surface] {
        &self.surfaces
    }

    /// Finds the triangles that the ray from a camera's eye in direction `along` meets.
    pub(super) fn meet(&self, camera: &Camera, along: DVec3, met: &mut Met) {
        let (eye, over) = (camera.eye, along.recip());
        met.objects.clear();
        met.hits.clear();
        met.blocks.clear();
        met.stack.clear();
        met.stack.push(0);
        // Greatest possible distance of the nearest certain opaque hit.
        let mut limit = f64::INFINITY;
        while let Some(index) = met.stack.pop() {
            let node = &self.nodes[index as usize];
            // The distance of a box that the ray misses is infinite, so it is skipped.
            if node.entry(eye, over) >= limit {
                continue;
            }
            if node.count == 0 {
                let children = [index + 1, node.at];
                let [a, b] = children.map(|child| self.nodes[child as usize].entry(eye, over));
                // The nearer child is pushed last, so it is visited first.
                met.stack.extend(if a <= b { [node.at, index + 1] } else { children });
                continue;
            }
            for at in node.at..node.at + node.count {
                let surface = &self.surfaces[at as usize];
                let Some(hit) = surface.hit(camera, along) else { continue };
                if hit.certain && camera.certainly_shows(along * hit.farthest) {
                    met.hits.push((hit.farthest, at));
                    limit = if surface.see_through { limit } else { limit.min(hit.farthest) };
                }
                if !surface.see_through {
                    met.blocks.push((hit.nearest, at));
                }
            }
        }
        let object = |at: u32| self.surfaces[at as usize].object;
        let first = met.blocks.iter().copied().min_by(|a, b| a.0.total_cmp(&b.0));
        met.first = first.map(|(_, at)| at);
        let (nearest, first_object) = first.map_or((f64::INFINITY, None), |(t, at)| (t, Some(object(at))));
        let others = met.blocks.iter().filter(|block| Some(object(block.1)) != first_object);
        let second = others.map(|block| block.0).fold(f64::INFINITY, f64::min);
        for &(farthest, at) in &met.hits {
            let block = if Some(object(at)) == first_object { second } else { nearest };
            if farthest < block && !met.objects.contains(&object(at)) {
                met.objects.push(object(at));
            }
        }
    }
}

impl Node {
    /// Returns a lower bound on the distance at which a ray meets the node's box. Infinity if it misses.
    /// `over` holds the reciprocals of the direction.
    fn entry(&self, eye: DVec3, over: DVec3) -> f64 {
        let (mut first, mut last) = (0.0f64, f64::INFINITY);
        for axis in 0..3 {
            let [a, b] = [self.min, self.max].map(|p| (f64::from(p[axis]) - eye[axis]) * over[axis]);
            // NaN, which arises for a ray in the plane of a side, leaves the range unchanged.
            first = first.max(a.min(b) * (1.0 - 1e-12));
            last = last.min(a.max(b) * (1.0 + 1e-12));
        }
        if first <= last { first } else { f64::INFINITY }
    }
}

impl Surface {
    /// Returns the hit of the ray from a camera's eye on the triangle. `None` if the ray certainly misses it
    /// beyond the near plane, or meets a one-sided triangle from behind.
    fn hit(&self, camera: &Camera, along: DVec3) -> Option<Hit> {
        let p = self.corners.map(|p| p.as_dvec3() - camera.eye);
        let mut certain = true;
        // The ray passes through the triangle if it is to the left of all three sides, or to the right of all
        // three.
        let (mut left, mut right) = (true, true);
        for side in 0..3 {
            let (a, b) = (p[side], p[(side + 1) % 3]);
            let value = a.cross(b).dot(along);
            let error = ROUNDING * cross_of_magnitudes(a, b).dot(along.abs());
            certain &= value.abs() > error;
            left &= value >= -error;
            right &= value <= error;
        }
        if !(left || right) {
            return None;
        }
        let [a, b, c] = self.corners.map(|p| p.as_dvec3());
        let (u, v) = (b - a, c - a);
        let (normal, size) = (u.cross(v), cross_of_magnitudes(u, v));
        let (slope, height) = (along.dot(normal), p[0].dot(normal));
        let slope_error = ROUNDING * along.abs().dot(size);
        let height_error = ROUNDING * p[0].abs().dot(size);
        if slope.abs() <= 2.0 * slope_error {
            // The ray lies in the triangle's plane, so the hit is somewhere between its nearest and farthest
            // corner.
            let reach = p.map(|p| p.dot(along) / along.length_squared());
            let farthest = reach.into_iter().fold(f64::NEG_INFINITY, f64::max);
            let nearest = reach.into_iter().fold(f64::INFINITY, f64::min);
            return (farthest >= 0.0).then_some(Hit { nearest: nearest.max(0.0), farthest, certain: false });
        }
        // The triangle faces the eye if the ray runs against its normal.
        if self.one_sided && slope > 0.0 {
            return None;
        }
        let distance = height / slope;
        let error = (height_error + distance.abs() * slope_error) / (slope.abs() - slope_error);
        let (nearest, farthest) = (distance - error, distance + error);
        if farthest < 0.0 || camera.is_before_near(along * farthest) {
            return None;
        }
        certain &= camera.certainly_shows(along * nearest);
        Some(Hit { nearest, farthest, certain })
    }
}

/// Returns the sums of the magnitudes of the cross product's terms.
fn cross_of_magnitudes(a: DVec3, b: DVec3) -> DVec3 {
    let (a, b) = (a.abs(), b.abs());
    DVec3::new(a.y * b.z + a.z * b.y, a.z * b.x + a.x * b.z, a.x * b.y + a.y * b.x)
}
