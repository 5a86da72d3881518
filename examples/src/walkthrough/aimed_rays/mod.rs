//! Check of the cullers by rays aimed where cullers err: 1e-7 to 1 pixel beside the edges and corners of
//! triangles and of the level's polygons. An item buffer only samples pixel centres.

mod surfaces;

use super::{Trial, World};
use crate::level_occluders;
use glam::DVec3;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;
use surfaces::{Camera, Met, Surfaces};
use visibility_core::View;
use visibility_core::view::{Depth, Eye};
use visibility_occluders::LevelSettings;
use visibility_testing::Random;

/// Results of aimed rays, over all frames.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct AimedRays {
    /// Number of rays cast.
    pub rays: u64,
    /// Number of rays that certainly met an object inside the picture, in front of all others.
    pub met: u64,
    /// For each trial, in order, the objects that a ray certainly met and the trial did not report, as
    /// (frame, object index). Sorted, each once.
    pub hidden: Vec<Vec<(usize, u32)>>,
}

/// Caster of rays for one frame.
struct Frame<'a> {
    camera: Camera,
    surfaces: &'a Surfaces,
    /// Angular size of a pixel, as a tangent.
    pixel: f64,
    met: Met,
    /// Index of the frame.
    frame: usize,
    trials: &'a [Trial],
    found: AimedRays,
}

/// Casts about `rays` rays, divided evenly over the frames, on all cores, and collects the objects that rays
/// meet and trials did not report. A ray meets an object if it certainly, despite rounding, passes through
/// one of its triangles beyond the near plane, before the triangles of any other opaque object.
///
/// Half of the rays are aimed at objects that a trial hid. They pass beside the sides of the triangle that
/// blocks the straight line to a point of the object. The other rays are aimed beside sides and corners of
/// triangles in the picture, and of polygons of the level. Frames with parallel views are left out.
pub fn cast(world: &World, trials: &[Trial], rays: u64) -> AimedRays {
    let surfaces = Surfaces::new(world);
    let level = level_occluders::make(world, LevelSettings::default()).unwrap_or_default();
    let edges: Vec<[DVec3; 2]> =
        level.edges().iter().map(|edge| edge.map(|end| level.vertices()[end as usize].as_dvec3())).collect();
    let next = AtomicUsize::new(0);
    let share = rays.div_ceil(world.views.len().max(1) as u64);
    let worker = || {
        let mut found = AimedRays { hidden: vec![Vec::new(); trials.len()], ..AimedRays::default() };
        loop {
            let frame = next.fetch_add(1, Ordering::Relaxed);
            let Some(view) = world.views.get(frame) else { return found };
            let Some(camera) = camera(view, world.origin()) else { continue };
            let row = camera.clip_from_eye.row(1).truncate().length();
            let pixel = 2.0 / (row * f64::from(world.size.1));
            let met = Met::default();
            let mut frame = Frame { camera, surfaces: &surfaces, pixel, met, frame, trials, found };
            frame.cast(&edges, share);
            found = frame.found;
        }
    };
    let workers = thread::available_parallelism().map_or(1, usize::from);
    let results: Vec<_> = thread::scope(|scope| {
        let running: Vec<_> = (0..workers).map(|_| scope.spawn(worker)).collect();
        running.into_iter().map(|handle| handle.join().expect("a worker panicked")).collect()
    });
    let mut found = AimedRays { hidden: vec![Vec::new(); trials.len()], ..AimedRays::default() };
    for result in results {
        found.rays += result.rays;
        found.met += result.met;
        for (all, own) in found.hidden.iter_mut().zip(result.hidden) {
            all.extend(own);
        }
    }
    for hidden in &mut found.hidden {
        hidden.sort_unstable();
        hidden.dedup();
    }
    found
}

/// Returns the camera of a perspective view, for points relative to `origin`. `None` for a parallel view.
fn camera(view: &View, origin: DVec3) -> Option<Camera> {
    let Eye::Point(eye) = view.eye(origin) else { return None };
    let near = match view.depth() {
        Depth::NegativeOneToOne | Depth::NegativeOneToOneInfinite => [1.0, 1.0],
        Depth::ZeroToOne | Depth::ZeroToOneInfinite => [1.0, 0.0],
        Depth::Reversed | Depth::ReversedInfinite => [-1.0, 1.0],
    };
    Some(Camera { eye, clip_from_eye: view.clip_from(origin + eye), near })
}

impl Frame<'_> {
    /// Casts rays until their number reaches `share`. `edges` are the edges of the level's polygons.
    fn cast(&mut self, edges: &[[DVec3; 2]], share: u64) {
        let mut random = Random(self.frame as u64 + 1);
        let eye = self.camera.eye;
        let shows = |camera: &Camera, p: DVec3| camera.certainly_shows(p - eye);
        let edges: Vec<_> =
            edges.iter().copied().filter(|edge| edge.iter().any(|&p| shows(&self.camera, p))).collect();
        let surfaces = self.surfaces.all();
        let is_hidden = |object: &u32| {
            self.trials.iter().any(|trial| trial.reported[self.frame].binary_search(object).is_err())
        };
        let in_picture = |&at: &usize| surfaces[at].corners.iter().any(|p| shows(&self.camera, p.as_dvec3()));
        // Indices of the triangles in the picture, and of those that belong to objects hidden by a trial.
        let shown: Vec<usize> = (0..surfaces.len()).filter(in_picture).collect();
        let hidden: Vec<usize> =
            shown.iter().copied().filter(|&at| is_hidden(&surfaces[at].object)).collect();
        let end = self.found.rays + share;
        while self.found.rays < end {
            let kind = random.below(4);
            if kind < 2 && !hidden.is_empty() {
                self.aim_before(random.pick(&hidden), &mut random);
            } else if kind == 2 && !edges.is_empty() {
                let [a, b] = random.pick(&edges);
                self.aim_beside([a - eye, b - eye], random.fine_unit(), &mut random);
            } else if let Some(&at) = (!shown.is_empty()).then(|| &shown[random.below(shown.len())]) {
                // Aims beside the sides of the nearest triangle on the line to a triangle's middle.
                let middle = surfaces[at].corners.iter().map(|p| p.as_dvec3()).sum::<DVec3>() / 3.0;
                self.shoot(middle - eye);
                let first = self.met.first.unwrap_or(at as u32);
                let sides = self.sides(first);
                for side in sides {
                    self.aim_beside(side, random.fine_unit(), &mut random);
                }
            } else {
                self.found.rays += 1;
            }
        }
    }

    /// Returns the sides of a triangle, relative to the eye.
    fn sides(&self, at: u32) -> [[DVec3; 2]; 3] {
        let [a, b, c] = self.surfaces.all()[at as usize].corners.map(|p| p.as_dvec3() - self.camera.eye);
        [[a, b], [b, c], [c, a]]
    }

    /// Aims at a random point of triangle `at`. If another triangle blocks the line, aims beside the nearest
    /// of its sides instead, and repeats this while the new ray is blocked.
    fn aim_before(&mut self, at: usize, random: &mut Random) {
        let surface = self.surfaces.all()[at];
        let [a, b, c] = surface.corners.map(|p| p.as_dvec3() - self.camera.eye);
        let (mut s, mut t) = (random.fine_unit(), random.fine_unit());
        if s + t > 1.0 {
            (s, t) = (1.0 - s, 1.0 - t);
        }
        let mut along = a + (b - a) * s + (c - a) * t;
        for _ in 0..4 {
            self.shoot(along);
            let Some(first) = self.met.first else { return };
            if self.surfaces.all()[first as usize].object == surface.object {
                return;
            }
            let sides = self.sides(first);
            for [p, q] in sides {
                // Point of the side that is nearest to the ray.
                let across = along.cross(p.cross(q));
                let (from, to) = (p.dot(across), q.dot(across));
                let share = if from == to { 0.5 } else { (from / (from - to)).clamp(0.0, 1.0) };
                self.aim_beside([p, q], share, random);
            }
            let [p, q] = random.pick(&sides);
            along = self.beside([p, q], random.fine_unit(), random);
        }
    }

    /// Casts one ray on each side of an edge, at a fraction `share` of its length, and one ray near one of
    /// its ends. The edge is relative to the eye.
    fn aim_beside(&mut self, edge: [DVec3; 2], share: f64, random: &mut Random) {
        let at = self.beside(edge, share, random);
        self.shoot(at);
        let [p, q] = edge;
        let other = self.beside([q, p], 1.0 - share, random);
        self.shoot(other);
        let around = self.beside([p, p + random.direction() * p.length()], 0.0, random);
        self.shoot(around);
    }

    /// Returns a point 1e-7 to 1 pixel to the left of an edge, as seen from the eye, at a fraction `share` of
    /// its length.
    fn beside(&self, [p, q]: [DVec3; 2], share: f64, random: &mut Random) -> DVec3 {
        let at = p + (q - p) * share;
        let away = 10f64.powf(random.fine_range(-7.0, 0.0)) * self.pixel * at.length();
        at + at.cross(q - p).normalize_or_zero() * away
    }

    /// Casts a ray in direction `along`, and records for each trial the objects met that it did not report.
    fn shoot(&mut self, along: DVec3) {
        self.found.rays += 1;
        if !along.is_finite() || along == DVec3::ZERO {
            self.met.first = None;
            return;
        }
        self.surfaces.meet(&self.camera, along, &mut self.met);
        self.found.met += u64::from(!self.met.objects.is_empty());
        for object in &self.met.objects {
            for (trial, hidden) in self.trials.iter().zip(&mut self.found.hidden) {
                let missed = (self.frame, *object);
                if trial.reported[self.frame].binary_search(object).is_err() && !hidden.contains(&missed) {
                    hidden.push(missed);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{CameraKey, SceneSource, SourceObject, Walk};
    use glam::Vec3;
    use visibility_core::Accuracy;

    /// Returns a rectangle at `x` metres ahead with the given ranges of y and z. Its front faces the eye.
    fn plate(x: f32, y: [f32; 2], z: [f32; 2]) -> Vec<[Vec3; 3]> {
        let [a, b, c, d] =
            [[y[1], z[0]], [y[0], z[0]], [y[0], z[1]], [y[1], z[1]]].map(|[y, z]| Vec3::new(x, y, z));
        vec![[a, b, c], [a, c, d]]
    }

    /// Returns the indices of the objects that rays from the origin along x meet.
    fn met(objects: Vec<SourceObject>) -> Vec<u32> {
        let mut source = SceneSource::new("plates", Vec3::Z, 0.5);
        source.objects = objects;
        let keys = vec![CameraKey { eye: DVec3::ZERO, target: DVec3::X }];
        source.walks = vec![Walk { name: "ahead".into(), fov_y_degrees: 60.0, up: Vec3::Z, keys }];
        let world = World::new(source, (64, 36), None).unwrap();
        let (name, accuracy, reported) = ("none".to_owned(), Accuracy::Approximate, vec![Vec::new()]);
        let trial = Trial { name, accuracy, reported, micros: Vec::new(), frame_micros: Vec::new() };
        let found = cast(&world, &[trial], 20_000);
        assert!(found.rays >= 20_000 && found.met <= found.rays, "{found:?}");
        found.hidden[0].iter().map(|&(_, object)| object).collect()
    }

    #[test]
    fn rays_meet_what_shows_through_a_slot_of_a_ten_thousandth_of_a_pixel() {
        let object = |triangles| SourceObject::new("plate", triangles);
        let (all, behind) = ([-9.0, 9.0], plate(6.0, [-1.0, 1.0], [-1.0, 1.0]));
        for (slot, seen) in [(0.0, vec![0, 1]), (1e-5, vec![0, 1, 2])] {
            let walls = [plate(3.0, [-9.0, 0.0], all), plate(3.0, [slot, 9.0], all)].map(object);
            let [left, right] = walls;
            assert_eq!(met(vec![left, right, object(behind.clone())]), seen, "slot of {slot} m");
        }
        // A plate between the eye and the near plane is not drawn: rays pass it.
        let close = object(plate(0.25, all, all));
        assert_eq!(met(vec![close, object(behind.clone())]), [1], "a plate before the near plane is not met");
        // Glass is visible and does not occlude; a one-sided plate seen from behind does not occlude either.
        let glass = SourceObject { see_through: true, opaque: false, ..object(plate(3.0, all, all)) };
        assert_eq!(met(vec![glass, object(behind.clone())]), [0, 1], "glass is met, and the plate behind");
        let turned = plate(3.0, all, all).into_iter().map(|[a, b, c]| [a, c, b]).collect();
        for (triangles, seen) in [(turned, vec![1]), (plate(3.0, all, all), vec![0])] {
            let wall = SourceObject { one_sided: true, ..object(triangles) };
            assert_eq!(
                met(vec![wall, object(behind.clone())]),
                seen,
                "a one-sided plate: the one behind is met, or it"
            );
        }
        // Two plates lie in the same place: for neither plate is it certain that rays meet it first.
        assert!(
            met(vec![object(behind.clone()), object(behind)]).is_empty(),
            "of two plates in one place neither is met"
        );
    }
}
