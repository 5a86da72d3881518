//! Sampling of degrees of visibility: how much of each object shows from eyes drawn evenly in a viewcell.
//!
//! From each eye, six square pictures of item numbers cover all directions. The solid angle in which an eye
//! sees an object is the sum of those of the pixels that show the object. Its degree is that of the greatest
//! such sum over all eyes.

use visibility_core::binary_format::Fingerprint;
use visibility_core::glam::DVec3;
use visibility_core::level_version::level_object;
use visibility_core::pvs::{SampledDegree, Viewcell, importance};
use visibility_core::{Pose, Scene, View};
use visibility_measure::{DrawnObject, ItemBuffer, MeasureError};

/// Columns and rows of each of the six pictures from an eye. The greatest pixel, in the middle, covers
/// `(2 / SIDE)^2 = 2^-14` steradians, the least of the
/// [limits](visibility_core::pvs::SampledDegrees::LIMITS).
const SIDE: u32 = 256;

/// Points that are drawn in the box of a viewcell for each eye before the viewcell is given up. A viewcell
/// that fills a share `s` of its box misses an eye with the probability `(1 - s)^128`: of 32 eyes, one is
/// missed with probability 1/2 if `s` is 3 %, and with probability .05 if it is 4.9 %.
const TRIES: u32 = 128;

/// Near distance of the pictures, as a fraction of the diagonal of the viewcell's box.
const NEAR: f64 = 1e-3;

/// Estimates the degrees in which viewcells see objects. Holds the memory of the pictures, for any number of
/// viewcells in turn: each thread has a sampler of its own.
///
/// ```
/// use visibility_bake::DegreeSampler;
/// use visibility_core::pvs::{SampledDegree, Viewcell};
/// use visibility_core::{Aabb, Scene, glam::{DVec3, Vec3}};
/// let mut scene = Scene::new();
/// let tile = scene.insert(Aabb::from_arrays([5.0, 0.0, 0.0], [5.0, 1.0, 1.0]));
/// let corner = |y: f32, z: f32| Vec3::new(5.0, y, z);
/// scene.set_triangles(tile, [[corner(0.0, 0.0), corner(1.0, 0.0), corner(0.0, 1.0)]])?;
/// let cell = Viewcell::from_box(DVec3::ZERO, DVec3::ONE);
/// // Half a square metre, 4 to 5 metres away: more than .02 steradians.
/// let degrees = DegreeSampler::new(32)?.sample(&scene, &cell, &[0], |_index| false);
/// assert_eq!(degrees, [SampledDegree::Widely]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct DegreeSampler {
    eyes: u32,
    buffer: ItemBuffer,
    /// Solid angle of each pixel in steradians, row by row.
    solid_angles: Vec<f64>,
    /// Solid angle in which the present eye sees each object of the row.
    shown: Vec<f64>,
    /// The greatest of these of all eyes so far.
    most: Vec<f64>,
}

/// The way in which an object of a row is drawn and counted.
#[derive(Clone, Copy, Debug)]
enum Sampled {
    /// The object is drawn, and hides what is behind it.
    Opaque,
    /// The object is drawn, and hides nothing: glass, or a door that may be open.
    SeeThrough,
    /// The object is not drawn, and counts as widely visible: it may move, or its triangles are not known.
    Unknown,
}

impl DegreeSampler {
    /// Makes a sampler of `eyes` eyes in each viewcell; 0 counts as 1.
    ///
    /// # Errors
    /// [`MeasureError`] if memory for the pictures cannot be allocated.
    pub fn new(eyes: u32) -> Result<Self, MeasureError> {
        let centre = |at: u32| f64::from(2 * at + 1) / f64::from(SIDE) - 1.0;
        let area = (2.0 / f64::from(SIDE)).powi(2);
        let solid_angle = |at: u32| {
            let squared = 1.0 + centre(at % SIDE).powi(2) + centre(at / SIDE).powi(2);
            area / (squared * squared.sqrt())
        };
        Ok(Self {
            eyes: eyes.max(1),
            buffer: ItemBuffer::new(SIDE, SIDE)?,
            solid_angles: (0..SIDE * SIDE).map(solid_angle).collect(),
            shown: Vec::new(),
            most: Vec::new(),
        })
    }

    /// Returns the number of eyes in each viewcell.
    pub fn eyes(&self) -> u32 {
        self.eyes
    }

    /// Returns the degree of each object of a viewcell's row, in the order of the row. `row` lists the
    /// indices of all objects that may be visible from the viewcell: only these are drawn, since no other
    /// comes before them. `is_seen` returns whether an object is known to be seen along some line of sight:
    /// its degree is then at least [`Hardly`](SampledDegree::Hardly).
    ///
    /// Objects that are not occluders of a bake are drawn and hide nothing. An object without triangles, or
    /// that is never culled, or whose bounds meet the box of the viewcell, is
    /// [`Widely`](SampledDegree::Widely) visible, and so are all objects of a viewcell in which too few eyes
    /// are found, since it is empty, flat in a plane that cuts it, or not finite. A see-through object counts
    /// in full pixels of the middle of a picture, so that its degree may be too great.
    ///
    /// The answer depends on scene, viewcell, row and number of eyes alone. Takes the time to draw all
    /// objects of the row six times for each eye.
    pub fn sample(
        &mut self,
        scene: &Scene,
        viewcell: &Viewcell,
        row: &[u32],
        is_seen: impl Fn(u32) -> bool,
    ) -> Vec<SampledDegree> {
        let sampled: Vec<Sampled> = row.iter().map(|&index| sampled(scene, index)).collect();
        self.most.clear();
        self.most.resize(row.len(), 0.0);
        for eye in eyes(viewcell, self.eyes) {
            let is_drawn = eye.is_some_and(|eye| self.draw_from(scene, viewcell, eye, row, &sampled));
            if !is_drawn {
                return vec![SampledDegree::Widely; row.len()];
            }
            for (most, &shown) in self.most.iter_mut().zip(&self.shown) {
                *most = most.max(shown);
            }
        }
        let degree = |((&index, sampled), &most): ((&u32, &Sampled), &f64)| match sampled {
            Sampled::Unknown => SampledDegree::Widely,
            _ if meets(scene, viewcell, index) => SampledDegree::Widely,
            _ if is_seen(index) => SampledDegree::of(most).max(SampledDegree::Hardly),
            _ => SampledDegree::of(most),
        };
        row.iter().zip(&sampled).zip(&self.most).map(degree).collect()
    }

    /// Fills `shown` with the solid angles in which an eye sees the objects of a row. Returns false if the
    /// pictures cannot be drawn.
    fn draw_from(
        &mut self,
        scene: &Scene,
        viewcell: &Viewcell,
        eye: DVec3,
        row: &[u32],
        sampled: &[Sampled],
    ) -> bool {
        self.shown.clear();
        self.shown.resize(row.len(), 0.0);
        let near = (NEAR * (viewcell.max - viewcell.min).length()).max(f64::MIN_POSITIVE);
        for axis in 0..3 {
            for direction in [DVec3::AXES[axis], -DVec3::AXES[axis]] {
                let pose = Pose::look_at(eye, eye + direction, DVec3::AXES[(axis + 1) % 3]);
                let right_angle = std::f64::consts::FRAC_PI_2;
                let Ok(view) = View::perspective(pose, right_angle, 1.0, near, f64::INFINITY) else {
                    return false;
                };
                let drawn = (0..).zip(row).zip(sampled).filter_map(|((at, &index), &sampled)| {
                    let see_through = match sampled {
                        Sampled::Opaque => false,
                        Sampled::SeeThrough => true,
                        Sampled::Unknown => return None,
                    };
                    let id = scene.id_at(index as usize)?;
                    let (triangles, (object, _)) = (scene.triangles(id).ok()?, level_object(scene, id)?);
                    Some(DrawnObject { key: at, triangles, see_through, one_sided: object.one_sided })
                });
                if self.buffer.draw(&view, scene.origin(), drawn).is_err() {
                    return false;
                }
                self.count(sampled);
            }
        }
        true
    }

    /// Adds the pixels of the picture to `shown`.
    fn count(&mut self, sampled: &[Sampled]) {
        let drawn = self.buffer.visible();
        let key = |object: usize| drawn.objects().get(object).map(|object| object.key as usize);
        // Runs of pixels mostly show one triangle.
        let (mut last, mut at) = (visibility_measure::NONE, None);
        for (&item, &solid_angle) in self.buffer.items().iter().zip(&self.solid_angles) {
            if item != last {
                (last, at) = (item, drawn.object_of(item).and_then(key));
            }
            if let Some(shown) = at.and_then(|at| self.shown.get_mut(at)) {
                *shown += solid_angle;
            }
        }
        // The pixels of see-through objects, and those that tie, are only counted.
        let greatest = (2.0 / f64::from(SIDE)).powi(2);
        for object in drawn.objects() {
            let is_see_through = matches!(sampled.get(object.key as usize), Some(Sampled::SeeThrough));
            let pixels = object.tied_pixels + if is_see_through { object.pixels } else { 0 };
            if let Some(shown) = self.shown.get_mut(object.key as usize) {
                *shown += greatest * f64::from(pixels);
            }
        }
    }
}

/// Returns whether the bounds of an object meet the box of a viewcell. An eye beside the object then sees as
/// much of it as there is, and random eyes come that near by chance alone: at a distance of `r`, an object
/// with a diagonal of `d` covers no more than the last of the limits, 2^-8 steradians, if `d` is less than
/// about `r / 14`, so that those that see more of a small object fill a small part of the viewcell.
fn meets(scene: &Scene, viewcell: &Viewcell, index: u32) -> bool {
    let id = scene.id_at(index as usize);
    id.is_some_and(|id| importance(scene, id, viewcell.min, viewcell.max) == f64::INFINITY)
}

/// Returns how an object of a row is sampled.
fn sampled(scene: &Scene, index: u32) -> Sampled {
    let object = scene.id_at(index as usize).and_then(|id| Some((id, level_object(scene, id)?.0)));
    match object {
        Some((id, object))
            if !object.is_unculled() && scene.triangles(id).is_ok_and(|all| !all.is_empty()) =>
        {
            if object.occluder && object.layers != 0 { Sampled::Opaque } else { Sampled::SeeThrough }
        }
        _ => Sampled::Unknown,
    }
}

/// Draws points of a viewcell, evenly and independently: points of its box that its planes do not cut off.
/// The numbers follow from the box, so that they do not depend on other viewcells. `None` in place of a point
/// if none is found.
fn eyes(viewcell: &Viewcell, count: u32) -> impl Iterator<Item = Option<DVec3>> {
    let seed = Fingerprint::new().with_dvec3(viewcell.min).with_dvec3(viewcell.max).value();
    let mut state = seed;
    // SplitMix64: Steele, Lea and Flood, "Fast Splittable Pseudorandom Number Generators", 2014.
    let mut random = move || {
        state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut mixed = (state ^ state >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        mixed = (mixed ^ mixed >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((mixed ^ mixed >> 31) >> 11) as f64 / (1u64 << 53) as f64
    };
    (0..count).map(move |_| {
        let mut point =
            || viewcell.min + (viewcell.max - viewcell.min) * DVec3::new(random(), random(), random());
        (0..TRIES).map(|_| point()).find(|&point| viewcell.contains(point))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use visibility_core::geometry::Plane;
    use visibility_core::glam::Vec3;
    use visibility_core::{Aabb, Object};

    #[test]
    fn only_occluders_of_a_bake_hide_what_is_behind_them() {
        let mut scene = Scene::new();
        let bounds = Aabb::from_arrays([5.0; 3], [6.0; 3]);
        let plain = Object { occluder: true, ..Object::new(bounds) };
        let infinite = Aabb::new(Vec3::splat(5.0), Vec3::INFINITY);
        for (object, has_triangles) in [
            (plain, true),
            (Object { occluder: false, ..plain }, true),
            (Object { layers: 0, ..plain }, true),
            (Object { never_cull: true, ..plain }, true),
            (Object { bounds: infinite, ..plain }, true),
            (plain, false),
        ] {
            let id = scene.insert(object);
            if has_triangles {
                scene.set_triangles(id, [[5.0, 5.5, 6.0].map(Vec3::splat)]).unwrap();
            }
        }
        let found: Vec<String> = (0..7).map(|index| format!("{:?}", sampled(&scene, index))).collect();
        let expected = ["Opaque", "SeeThrough", "SeeThrough", "Unknown", "Unknown", "Unknown", "Unknown"];
        assert_eq!(found, expected, "objects, and an unknown index");
    }

    #[test]
    fn eyes_are_in_the_viewcell() {
        assert_eq!([0, 1, 9].map(|eyes| DegreeSampler::new(eyes).unwrap().eyes()), [1, 1, 9], "eyes");
        let whole = Viewcell::from_box(DVec3::ZERO, DVec3::ONE);
        let half = Viewcell { planes: vec![Plane::new(DVec3::X, -0.5)], ..whole.clone() };
        for cell in [whole, half] {
            let all: Vec<Option<DVec3>> = eyes(&cell, 9).collect();
            assert_eq!(all.len(), 9, "eyes of {cell:?}");
            assert!(all.iter().flatten().filter(|&&eye| cell.contains(eye)).count() == 9, "{all:?}");
        }
        let empty = Viewcell::from_box(DVec3::ONE, DVec3::ZERO);
        assert_eq!(eyes(&empty, 2).collect::<Vec<_>>(), [None; 2], "eyes of an empty viewcell");
    }
}
