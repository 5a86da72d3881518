//! Comparison of a culler's answer with an item buffer.

use crate::sampled_visibility::SampledVisibility;
use alloc::vec::Vec;

/// Differences between a culler's answer and an item buffer, for one view.
///
/// The item buffer samples visibility at pixel centres: the false hidden counts are lower bounds, the false
/// visible counts upper bounds. See the [crate documentation](crate).
///
/// ```
/// use visibility_core::{glam::{DVec3, Vec3}, Pose, View};
/// use visibility_measure::{Comparison, ItemBuffer};
/// let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
/// let view = View::perspective(pose, 1.0, 1.0, 0.1, f64::INFINITY)?;
/// let triangle = [[Vec3::new(3.0, -9.0, -9.0), Vec3::new(3.0, 9.0, -9.0), Vec3::new(3.0, 0.0, 9.0)]];
/// let mut buffer = ItemBuffer::new(64, 64)?;
/// buffer.draw(&view, DVec3::ZERO, [(4, &triangle[..])])?;
/// let mut comparison = Comparison::default();
/// buffer.visible().compare(|_, _| true, &mut comparison);
/// assert!(comparison.is_exact());
/// buffer.visible().compare(|_, _| false, &mut comparison);
/// assert_eq!(comparison.false_hidden_triangles, 1);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, PartialEq, Eq, Debug, Default)]
#[non_exhaustive]
pub struct Comparison {
    /// Number of objects that the culler reported.
    pub reported_objects: u32,
    /// Number of triangles of the reported objects: the triangles that would be drawn.
    pub reported_triangles: u32,
    /// Number of visible objects that the culler did not report, which vanish for the user. A pixel that
    /// shows several objects in a tie counts only if none of them was reported, and then as an error on the
    /// object that the image shows.
    pub false_hidden_objects: u32,
    /// Number of triangles of false hidden objects with at least one pixel.
    pub false_hidden_triangles: u32,
    /// Number of unreported objects that are visible only in ties with reported objects. Not counted as
    /// errors. See [ties](crate#ties).
    pub tied_hidden_objects: u32,
    /// Number of pixels that show a false hidden object. If the reported objects alone were drawn, exactly
    /// these pixels would differ. A pixel that shows several, one through another, counts for each. At most
    /// `u32::MAX`, also if there are more.
    ///
    /// The count needs no second drawing: a pixel changes only if the triangle that it shows, the nearest
    /// one, is not drawn.
    pub wrong_pixels: u32,
    /// Number of pixels in which the shown object was not reported, but an object that ties with it was. Not
    /// counted as errors.
    pub tied_pixels: u32,
    /// Number of reported objects that no pixel shows, and that do not tie in depth with the shown object of
    /// any pixel.
    pub false_visible_objects: u32,
    /// Number of triangles of reported objects that no pixel shows, including those of partly visible
    /// objects.
    pub false_visible_triangles: u32,
    /// Keys of the false hidden objects, in the order in which the objects were drawn.
    pub false_hidden_keys: Vec<u32>,
}

impl Comparison {
    /// Tests whether the culler reported all visible objects and no others, as far as pixels and ties can
    /// tell. Counts of triangles are ignored, since cullers report objects.
    pub fn is_exact(&self) -> bool {
        self.false_hidden_objects == 0 && self.false_visible_objects == 0
    }
}

/// Verdict on a culler's answer about one object.
#[derive(Clone, Copy, PartialEq)]
enum Answer {
    /// The culler reported the object.
    Reported,
    /// The culler did not report the object, though a pixel shows it: an error.
    FalseHidden,
    /// The culler did not report the object, and this is no error. The object shows in no pixel, or only in
    /// ties: in each of them another object was reported or is the one that counts as false hidden.
    Hidden,
}

impl SampledVisibility {
    /// Replaces `out` by the comparison with a culler's answer. `reported(index, key)` returns whether the
    /// culler reported an object. It is called once for each object, in the order drawn, with the object's
    /// index and key. Takes time proportional to the number of objects and of tied pixels. Allocates one byte
    /// per object.
    pub fn compare(&self, mut reported: impl FnMut(usize, u32) -> bool, out: &mut Comparison) {
        let mut keys = core::mem::take(&mut out.false_hidden_keys);
        keys.clear();
        *out = Comparison::default();
        let judged = self.objects().iter().enumerate().map(|(index, object)| {
            if reported(index, object.key) {
                Answer::Reported
            } else if object.pixels > 0 {
                Answer::FalseHidden
            } else {
                Answer::Hidden
            }
        });
        let mut answers: Vec<Answer> = judged.collect();
        // Pixels at which several objects are equally near: the culler may report any one of them.
        for mut tie in self.ties() {
            let reported = tie.clone().any(|object| answers[object] == Answer::Reported);
            let Some(shown) = tie.next() else { continue };
            if !reported {
                answers[shown] = Answer::FalseHidden;
                out.wrong_pixels += 1;
            } else if answers[shown] != Answer::Reported {
                out.tied_pixels += 1;
            }
        }
        for (object, &answer) in self.objects().iter().zip(&answers) {
            match answer {
                Answer::Reported => {
                    out.reported_objects += 1;
                    out.reported_triangles += object.triangles;
                    out.false_visible_objects += u32::from(!object.is_visible());
                    out.false_visible_triangles += object.triangles - object.visible_triangles;
                }
                Answer::FalseHidden => {
                    out.false_hidden_objects += 1;
                    out.false_hidden_triangles += object.visible_triangles;
                    out.wrong_pixels = out.wrong_pixels.saturating_add(object.pixels);
                    keys.push(object.key);
                }
                Answer::Hidden => out.tied_hidden_objects += u32::from(object.is_visible()),
            }
        }
        out.false_hidden_keys = keys;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::raster::{Image, NONE, VeilPixels};

    #[test]
    fn errors_are_counted_both_ways() {
        let mut sampled = SampledVisibility::default();
        for (key, triangles) in [(10, 4), (11, 2), (12, 3), (13, 1)] {
            sampled.push(key, triangles);
        }
        // Objects 10, 11, 12 and 13 have the triangles 0..4, 4..6, 6..9 and 9. The image shows 1, 2 and 1
        // triangles of the first three.
        let mut image = Image::new(7, 1).unwrap();
        image.items = [0, 0, 4, 5, 5, 8, NONE].into();
        sampled.count(&image);
        let mut comparison =
            Comparison { false_hidden_keys: [1, 2, 3].into(), wrong_pixels: 9, ..Default::default() };
        sampled.compare(|_, key| [10, 13].contains(&key), &mut comparison);
        let expected = Comparison {
            reported_objects: 2,
            reported_triangles: 5,
            false_hidden_objects: 2,
            false_hidden_triangles: 3,
            tied_hidden_objects: 0,
            wrong_pixels: 4,
            tied_pixels: 0,
            false_visible_objects: 1,
            false_visible_triangles: 3 + 1,
            false_hidden_keys: [11, 12].into(),
        };
        assert_eq!(comparison, expected, "errors of a report of objects 10 and 13");
        sampled.compare(|index, _| index < 3, &mut comparison);
        assert!(
            comparison.is_exact() && comparison.false_hidden_keys.is_empty(),
            "a report of all visible objects is exact"
        );
        assert_eq!(comparison.false_visible_triangles, 9 - 4, "triangles reported of which no pixel shows");
        sampled.compare(|_, _| true, &mut comparison);
        assert!(
            comparison.false_hidden_objects == 0 && !comparison.is_exact(),
            "a report of everything hides nothing, and is not exact"
        );
    }

    #[test]
    fn more_wrong_pixels_than_the_count_holds_are_the_greatest_count() {
        let mut sampled = SampledVisibility::default();
        for key in 0..2 {
            sampled.push(key, 1);
            let found = VeilPixels { pixels: u32::MAX - 1, tied: 0, newly_covered: 0 };
            sampled.add_see_through(key as usize, found);
        }
        let mut comparison = Comparison::default();
        sampled.compare(|_, _| false, &mut comparison);
        assert_eq!(comparison.wrong_pixels, u32::MAX, "twice as many pixels as an image has");
    }
}
