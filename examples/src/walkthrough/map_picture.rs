//! Map of the scene from above: objects culled, visible, reported without being visible, and hidden although
//! visible.

use super::canvas::{Canvas, Color};
use super::judge::Judgement;
use super::palette::{HIDDEN, INK, LOST, PAPER, REPORTED, VIEW, VISIBLE};
use super::{Trial, World};
use glam::{DAffine3, DMat3, DVec3, Vec3};
use visibility_core::{Aabb, OccluderMesh, Pose, View, scene::SharedTriangles, view::Window};
use visibility_measure::{ItemBuffer, MeasureError, NONE};

const WALK: Color = [120, 120, 200];

/// Longer side of the map, in pixels.
const SIDE: f64 = 1200.0;
/// Least width of the map in pixels, which the captions below it need.
const CAPTION: u32 = 960;
/// Least width in pixels of the legend below a picture from the eye, which most titles need.
const TITLE: u32 = 480;
/// Margin around the map as a fraction of the longer side, so that walks outside the scene are shown.
const MARGIN: f64 = 0.04;
/// Fraction of the map's area above which an object counts as ground and is drawn pale.
const GROUND: f64 = 0.05;
/// Number of triangles above which instances of meshes are drawn as their boxes, which takes less time.
const MOST_TRIANGLES: usize = 1 << 20;
/// Height of the legend below the map, in pixels.
const LEGEND: u32 = 64;

/// Frame, trial and marked object that a map shows.
#[derive(Clone, Copy)]
pub struct Shown {
    /// Index of the frame in the world's views.
    pub frame: usize,
    /// Index of the trial in the list of trials.
    pub trial: usize,
    /// Index of an object that gets a ring around it, or `None`.
    pub marked: Option<u32>,
}

/// Meaning of the colors.
const MEANINGS: [(Color, &str); 6] = [
    (VISIBLE, "visible"),
    (REPORTED, "reported, not visible"),
    (HIDDEN, "culled"),
    (LOST, "visible, but culled"),
    (VIEW, "eye and frustum"),
    (WALK, "walk"),
];

/// Draws the map of one frame of a trial, with the legend below it.
///
/// # Errors
///
/// Returns [`MeasureError`] when the item buffer cannot draw the map.
pub fn draw(
    world: &World,
    trials: &[Trial],
    judgement: &Judgement,
    shown: Shown,
) -> Result<Canvas, MeasureError> {
    let map = draw_map(world, trials, judgement, shown)?;
    let mut legend = Canvas::new(map.width, LEGEND, PAPER);
    let [name, counts] = title(world, trials, judgement, shown);
    legend.text(10, 8, &format!("{name}: {counts}"), INK);
    legend.legend(10, 28, &MEANINGS, INK);
    Ok(map.above(&legend, PAPER))
}

/// Draws a picture from the eye with the legend below it, and beside both the map of its frame at half its
/// size.
///
/// # Errors
///
/// Returns [`MeasureError`] when the item buffer cannot draw the map.
pub fn draw_beside(
    eye: &Canvas,
    world: &World,
    trials: &[Trial],
    judgement: &Judgement,
    shown: Shown,
) -> Result<Canvas, MeasureError> {
    let map = draw_map(world, trials, judgement, shown)?.halved();
    let mut legend = Canvas::new(eye.width.max(TITLE), 130, PAPER);
    for (line, y) in title(world, trials, judgement, shown).iter().zip([10, 28]) {
        legend.text(10, y, line, INK);
    }
    for (place, entry) in (0..).zip(MEANINGS) {
        legend.legend(10 + place % 2 * 210, 52 + place / 2 * 24, &[entry], INK);
    }
    Ok(eye.above(&legend, PAPER).beside(&map, PAPER))
}

/// Draws the map of one frame of a trial, without a legend. Returns an error when the item buffer cannot draw
/// the map.
fn draw_map(
    world: &World,
    trials: &[Trial],
    judgement: &Judgement,
    shown: Shown,
) -> Result<Canvas, MeasureError> {
    let Shown { frame, trial: index, marked } = shown;
    let trial = &trials[index];
    let map = Map::new(world);
    let mut canvas = Canvas::new(map.width, map.height, PAPER);
    let exact = &judgement.exact[frame];
    let lost = &judgement.verdicts[index].hidden[frame];
    let reported = &trial.reported[frame];
    let color = |object: u32| {
        if lost.binary_search(&object).is_ok() {
            LOST
        } else if reported.binary_search(&object).is_err() {
            HIDDEN
        } else if exact.binary_search(&object).is_ok() {
            VISIBLE
        } else {
            REPORTED
        }
    };
    map.paint(&mut canvas, world, |_, _| true, color)?;

    let poses: Vec<_> = world.poses.iter().filter(|(_, walk)| *walk == world.poses[frame].1).collect();
    for pair in poses.windows(2) {
        canvas.line(map.place(pair[0].0.eye), map.place(pair[1].0.eye), WALK);
    }
    let pose = &world.poses[frame].0;
    let fov_y = f64::from(world.source.walks[world.poses[frame].1].fov_y_degrees).to_radians();
    let half_width = (fov_y * 0.5).tan() * f64::from(world.size.0) / f64::from(world.size.1);
    let far = map.extent * 2.0;
    for side in [-1.0, 1.0] {
        let edge = pose.eye + (pose.forward + pose.right * (side * half_width)) * far;
        canvas.line(map.place(pose.eye), map.place(edge), VIEW);
    }
    canvas.disc(map.place(pose.eye), 6.0, false, VIEW);
    for (object, color) in lost.iter().map(|&object| (object, LOST)).chain(marked.map(|object| (object, INK)))
    {
        if let Some((low, high)) =
            world.source.objects.get(object as usize).and_then(|object| object.bounds())
        {
            let middle = ((low + high) * 0.5).as_dvec3() + world.origin();
            canvas.disc(map.place(middle), 14.0, true, color);
        }
    }
    Ok(canvas)
}

/// Returns what a map shows: scene, frame and culler, and the numbers of objects.
fn title(world: &World, trials: &[Trial], judgement: &Judgement, shown: Shown) -> [String; 2] {
    let Shown { frame, trial, .. } = shown;
    let Trial { name, accuracy, reported, .. } = &trials[trial];
    let [exact, reported, lost] =
        [&judgement.exact[frame], &reported[frame], &judgement.verdicts[trial].hidden[frame]].map(Vec::len);
    [
        format!("{} from above, frame {frame}, culler {name} ({accuracy})", world.source.name),
        format!("{} objects, {exact} visible, {reported} reported, {lost} lost", world.scene.len()),
    ]
}

/// Mapping from world space to pixels of the map, which is a parallel projection along the up axis.
pub(crate) struct Map {
    center: DVec3,
    /// World axes that point right, up the picture (`ahead`), and towards the viewer (`up`).
    pub(crate) right: DVec3,
    pub(crate) ahead: DVec3,
    pub(crate) up: DVec3,
    pixels_per_metre: f64,
    pub(crate) width: u32,
    pub(crate) height: u32,
    /// Length of the diagonal of the area shown, in metres.
    extent: f64,
}

impl Map {
    /// Creates the map of the whole scene and all camera positions.
    fn new(world: &World) -> Self {
        let (low, high) = world.source.bounds().unwrap_or((Vec3::ZERO, Vec3::ONE));
        let [mut low, mut high] = [low, high].map(|corner| corner.as_dvec3() + world.origin());
        for (pose, _) in &world.poses {
            (low, high) = (low.min(pose.eye), high.max(pose.eye));
        }
        Self::of(world, low, high)
    }

    /// Creates the map of the box between two corners in world space, with a margin.
    pub(crate) fn of(world: &World, low: DVec3, high: DVec3) -> Self {
        let up = world.source.up.as_dvec3();
        let right = if up.x.abs() > 0.5 { DVec3::Y } else { DVec3::X };
        let ahead = up.cross(right);
        let size = high - low;
        let across = right.abs().dot(size).max(1e-3);
        let along = ahead.abs().dot(size).max(1e-3);
        let pixels_per_metre = SIDE * (1.0 - 2.0 * MARGIN) / across.max(along);
        // Even a long and narrow scene gets a strip at least 200 pixels wide.
        let pixels =
            |metres: f64| (metres * pixels_per_metre + SIDE * 2.0 * MARGIN).clamp(200.0, SIDE) as u32;
        Self {
            center: (low + high) * 0.5,
            right,
            ahead,
            up,
            pixels_per_metre,
            width: pixels(across).max(CAPTION),
            height: pixels(along),
            extent: (across * across + along * along).sqrt(),
        }
    }

    /// Returns the position on the map of a point in world space: pixels from the upper left corner, x to the
    /// right and y down.
    pub(crate) fn place(&self, p: DVec3) -> [f64; 2] {
        let offset = (p - self.center) * self.pixels_per_metre;
        [
            f64::from(self.width) * 0.5 + offset.dot(self.right),
            f64::from(self.height) * 0.5 - offset.dot(self.ahead),
        ]
    }

    /// Paints the footprints of the objects for which `shown` is true, smaller footprints over larger ones: a
    /// chair is painted over its floor, although a roof is above both. `shown` receives the index of the
    /// object and the area of its bounds as a fraction of the map's area; `color` receives the index. Returns
    /// an error when the item buffer cannot draw the objects.
    ///
    /// An item buffer draws the flattened objects from above, each at a height equal to its rank by size.
    pub(crate) fn paint(
        &self,
        canvas: &mut Canvas,
        world: &World,
        shown: impl Fn(u32, f64) -> bool,
        color: impl Fn(u32) -> Color,
    ) -> Result<(), MeasureError> {
        let objects = &world.source.objects;
        let area = |object: &crate::SourceObject| {
            let (low, high) = object.bounds().unwrap_or_default();
            let size = (high - low).as_dvec3();
            size.dot(self.right.abs()) * size.dot(self.ahead.abs())
        };
        let mut order: Vec<(f64, u32)> = objects.iter().map(area).zip(0..).collect();
        order.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        let whole = f64::from(self.width) * f64::from(self.height) / self.pixels_per_metre.powi(2);
        order.retain(|&(area, object)| shown(object, area / whole));
        let areas: Vec<f64> = order.iter().map(|&(area, _)| area).collect();
        let all: usize = order.iter().map(|&(_, object)| objects[object as usize].triangles.len()).sum();
        let onto = |axis: DVec3| DMat3::from_cols(axis * axis.x, axis * axis.y, axis * axis.z);
        let onto_map = onto(self.right) + onto(self.ahead);
        let unit = Aabb::new(Vec3::ZERO, Vec3::ONE).corners();
        let cuboid = SharedTriangles::from(OccluderMesh::CUBOID.map(|t| t.map(|i| unit[i as usize])));
        let flat: Vec<(u32, SharedTriangles)> = (1..)
            .zip(&order)
            .map(|(rank, &(_, object))| {
                let translation = onto_map * (world.origin() - self.center) + self.up * f64::from(rank);
                let flatten = DAffine3 { matrix3: onto_map, translation };
                let triangles = &objects[object as usize].triangles;
                let flat = match triangles.view().mesh().1 {
                    Some(_) if all > MOST_TRIANGLES => {
                        let Aabb { min, max } = triangles.bounds();
                        let scale = DMat3::from_diagonal((max - min).as_dvec3());
                        cuboid.placed(flatten * DAffine3 { matrix3: scale, translation: min.as_dvec3() })
                    }
                    Some(transform) => triangles.placed(flatten * transform),
                    None => triangles
                        .iter()
                        .map(|triangle| triangle.map(|p| flatten.transform_point3(p.as_dvec3()).as_vec3()))
                        .collect::<Vec<_>>()
                        .into(),
                };
                (object, flat)
            })
            .collect();
        let top = self.up * (objects.len() as f64 + 2.0);
        let pose = Pose { eye: top, right: self.right, up: self.ahead, forward: -self.up };
        let half = |pixels: u32| f64::from(pixels) * 0.5 / self.pixels_per_metre;
        let window = Window::centered(half(self.width), half(self.height));
        let Ok(view) = View::orthographic(pose, window, 0.0, objects.len() as f64 + 3.0) else {
            return Ok(());
        };
        let mut buffer = ItemBuffer::new(self.width, self.height)?;
        buffer.draw(
            &view,
            DVec3::ZERO,
            flat.iter().map(|(object, triangles)| (*object, triangles.view())),
        )?;
        // Darkens pixels at the border between two objects, to separate neighbours of one color.
        let object_at = |x: u32, y: u32| {
            (buffer.items()[(y * self.width + x) as usize] != NONE).then(|| buffer.object_at(x, y)).flatten()
        };
        for y in 0..self.height {
            for x in 0..self.width {
                let Some(place) = object_at(x, y) else { continue };
                let object = order[place].1;
                let rim = [(x.saturating_sub(1), y), (x, y.saturating_sub(1))]
                    .into_iter()
                    .any(|(x, y)| object_at(x, y) != Some(place));
                let color = color(object);
                // Ground is pale, so that the objects on it stand out.
                let color =
                    if areas[place] > GROUND * whole { color.map(|level| level / 2 + 127) } else { color };
                let color = if rim { color.map(|level| level / 5 * 4) } else { color };
                canvas.set(x.into(), y.into(), color);
            }
        }
        Ok(())
    }
}
