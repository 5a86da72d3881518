//! A graphics card in software, for occlusion queries: a depth buffer with one sample in the middle of each
//! pixel, and answers that arrive some frames late.
//!
//! Boxes are tested by intersecting them with the ray through each sample. Boxes count as slightly larger
//! than they are, so that an object on the face of its box passes.

use glam::{DMat4, DVec3, DVec4, Vec3};
use visibility_core::occlusion::QueryDevice;
use visibility_core::view::{Eye, ViewPlane};
use visibility_core::{Aabb, View};

/// Number of samples of a query at which the card stops counting.
const MOST_SAMPLES: u32 = 1024;

/// Relative distance by which a box counts as nearer and larger.
const SLACK: f64 = 1e-4;

/// A simulated graphics card with occlusion queries.
#[derive(Debug)]
pub struct SoftwareCard {
    width: usize,
    height: usize,
    /// Reciprocal of the distance along the viewing direction of the nearest surface, by sample, from the
    /// upper left. 0 without a surface.
    depth: Vec<f32>,
    camera: Option<Camera>,
    /// Number of submissions after which answers are delivered.
    latency: u64,
    /// Number of submissions so far.
    submitted: u64,
    /// Queries of the present picture, by number, with their boxes.
    asked: Vec<(u64, Vec<Aabb>)>,
    /// Submission, number and passed samples of each query that is answered and not delivered.
    under_way: Vec<(u64, u64, u32)>,
    /// Number of queries submitted, and number of boxes in these.
    answered: [u64; 2],
}

#[derive(Clone, Copy, Debug)]
struct Camera {
    clip: DMat4,
    from_clip: DMat4,
    eye: DVec3,
    near: ViewPlane,
}

impl SoftwareCard {
    /// Makes a card with a picture of `width` by `height` pixels. Answers are delivered in the `latency`-th
    /// submission after they were asked: with 1, before the next cull, as by an engine that waits.
    pub fn new((width, height): (u32, u32), latency: u64) -> Self {
        let (width, height) = (width as usize, height as usize);
        Self {
            width,
            height,
            depth: vec![0.0; width * height],
            camera: None,
            latency,
            submitted: 0,
            asked: Vec::new(),
            under_way: Vec::new(),
            answered: [0; 2],
        }
    }

    /// Returns the number of queries submitted so far, and the number of boxes in these.
    pub fn answered(&self) -> [u64; 2] {
        self.answered
    }

    /// Begins a picture. Parallel views are drawn empty.
    pub fn begin(&mut self, view: &View, origin: DVec3) {
        self.depth.fill(0.0);
        let clip = view.clip_from(origin);
        // The near plane is the fifth plane.
        self.camera = match (view.eye(origin), view.planes(origin).as_slice().get(4)) {
            (Eye::Point(eye), Some(&near)) => Some(Camera { clip, from_clip: clip.inverse(), eye, near }),
            _ => None,
        };
    }

    /// Draws both faces of triangles, relative to the origin of [`begin`](Self::begin).
    pub fn draw_triangles(&mut self, triangles: impl IntoIterator<Item = [Vec3; 3]>) {
        let Some(camera) = self.camera else { return };
        for triangle in triangles {
            let corners = triangle.map(|p| p.as_dvec3());
            let mut kept = Vec::with_capacity(4);
            for i in 0..3 {
                let (a, b) = (corners[i], corners[(i + 1) % 3]);
                let [da, db] = [a, b].map(|p| camera.near.plane.signed_distance(p));
                if da >= 0.0 {
                    kept.push(a);
                }
                if (da < 0.0) != (db < 0.0) {
                    kept.push(a + (b - a) * (da / (da - db)));
                }
            }
            let points: Vec<DVec3> = kept.iter().map(|&p| self.place(camera.clip * p.extend(1.0))).collect();
            for i in 2..points.len() {
                self.fill([points[0], points[i - 1], points[i]]);
            }
        }
    }

    /// Returns column and row of a point of clip space, in pixels, and the reciprocal of its distance.
    fn place(&self, p: DVec4) -> DVec3 {
        let inverse = 1.0 / p.w;
        let x = (p.x * inverse + 1.0) * 0.5 * self.width as f64;
        let y = (1.0 - p.y * inverse) * 0.5 * self.height as f64;
        DVec3::new(x, y, inverse)
    }

    fn fill(&mut self, [a, b, c]: [DVec3; 3]) {
        let area = (b - a).truncate().perp_dot((c - a).truncate());
        if !area.is_finite() || area == 0.0 {
            return;
        }
        let (b, c, area) = if area < 0.0 { (c, b, -area) } else { (b, c, area) };
        let (low, high) = (a.min(b).min(c), a.max(b).max(c));
        let (columns, rows) = (range(low.x, high.x, self.width), range(low.y, high.y, self.height));
        for row in rows {
            for column in columns.clone() {
                let p = DVec3::new(column as f64 + 0.5, row as f64 + 0.5, 0.0);
                let side = |a: DVec3, b: DVec3| (b - a).truncate().perp_dot((p - a).truncate());
                let [u, v, w] = [side(b, c), side(c, a), side(a, b)];
                if u > 0.0 && v > 0.0 && w > 0.0 {
                    let depth = ((u * a.z + v * b.z + w * c.z) / area) as f32;
                    let kept = &mut self.depth[row * self.width + column];
                    *kept = kept.max(depth);
                }
            }
        }
    }

    /// Answers the queries of the picture. To be called once the frame's objects are drawn.
    pub fn submit(&mut self) {
        self.submitted += 1;
        let asked = std::mem::take(&mut self.asked);
        for (query, boxes) in asked {
            let mut samples = 0;
            for bounds in &boxes {
                samples += self.samples(bounds);
                if samples >= MOST_SAMPLES {
                    break;
                }
            }
            self.answered[0] += 1;
            self.answered[1] += boxes.len() as u64;
            self.under_way.push((self.submitted, query, samples));
        }
    }

    /// Returns the number of samples of a box that pass the depth test, at most about `MOST_SAMPLES`.
    fn samples(&self, bounds: &Aabb) -> u32 {
        let Some(camera) = self.camera else { return 0 };
        let (min, max) = (bounds.min.as_dvec3(), bounds.max.as_dvec3());
        let slack = SLACK * (min - camera.eye).abs().max((max - camera.eye).abs());
        let (min, max) = (min - slack, max + slack);
        let mut low = DVec3::INFINITY;
        let mut high = DVec3::NEG_INFINITY;
        for corner in 0..8 {
            let pick = |axis: usize| if corner >> axis & 1 == 0 { min[axis] } else { max[axis] };
            let p = camera.clip * DVec4::new(pick(0), pick(1), pick(2), 1.0);
            if p.w <= 0.0 {
                return MOST_SAMPLES;
            }
            let p = self.place(p);
            (low, high) = (low.min(p), high.max(p));
        }
        let (columns, rows) = (range(low.x, high.x, self.width), range(low.y, high.y, self.height));
        let mut samples = 0;
        for row in rows {
            for column in columns.clone() {
                let x = (column as f64 + 0.5) / self.width as f64 * 2.0 - 1.0;
                let y = 1.0 - (row as f64 + 0.5) / self.height as f64 * 2.0;
                let p = camera.from_clip * DVec4::new(x, y, 0.5, 1.0);
                let along = p.truncate() / p.w - camera.eye;
                let (a, b) = ((min - camera.eye) / along, (max - camera.eye) / along);
                let (enter, leave) = (a.min(b).max_element(), a.max(b).min_element());
                if enter > leave || enter.is_nan() {
                    continue;
                }
                let w = (camera.clip * (camera.eye + along * enter).extend(1.0)).w;
                if (1.0 / w) as f32 >= self.depth[row * self.width + column] {
                    samples += 1;
                    if samples >= MOST_SAMPLES {
                        return samples;
                    }
                }
            }
        }
        samples
    }
}

/// Returns the samples whose middles may lie in a range of pixels.
fn range(low: f64, high: f64, size: usize) -> std::ops::Range<usize> {
    // Casts saturate.
    ((low - 0.5).floor().max(0.0) as usize)..((high + 0.5).ceil().max(0.0) as usize).min(size)
}

impl QueryDevice for SoftwareCard {
    fn ask(&mut self, query: u64, boxes: &[Aabb]) {
        self.asked.push((query, boxes.to_vec()));
    }

    fn answers(&mut self, each: &mut dyn FnMut(u64, u32)) {
        let due = (self.submitted + 1).saturating_sub(self.latency);
        self.under_way.retain(|&(asked, query, samples)| {
            if asked <= due {
                each(query, samples);
            }
            asked > due
        });
    }
}
