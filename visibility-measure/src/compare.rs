//! Judging what a culler reported.

use crate::exact::ExactVisibility;
use alloc::vec::Vec;

/// In what a culler's answer differs from an item buffer's, for one view.
///
/// By the nature of sampling, what is false hidden here is a lower bound, what is false visible an upper one:
/// see [the module](crate).
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
pub struct Comparison {
    /// Objects that the culler reported.
    pub reported_objects: u32,
    /// Triangles of those objects: what would be drawn.
    pub reported_triangles: u32,
    /// Objects that were not reported and are what a pixel shows: what users see vanish. A pixel that shows
    /// several objects in a tie counts against the one that the image shows, and only if none of them was
    /// reported.
    pub false_hidden_objects: u32,
    /// Triangles of these objects that have a pixel.
    pub false_hidden_triangles: u32,
    /// Objects that were not reported and show only in ties with objects that were: no error that this
    /// buffer could tell. See [ties](crate#ties).
    pub tied_hidden_objects: u32,
    /// Pixels that show a false hidden object: drawing the reported objects alone leaves something else
    /// there, or nothing.
    ///
    /// Nothing need be drawn again to know them: an item is seen in a pixel because it is before all others
    /// there, and stays so whatever else is left out; only leaving out the item itself changes the pixel.
    pub wrong_pixels: u32,
    /// Pixels whose object was not reported, but another one of the same tie was.
    pub tied_pixels: u32,
    /// Reported objects without a pixel, alone or in a tie.
    pub false_visible_objects: u32,
    /// Triangles without a pixel, of reported objects, including those of objects that are partly seen.
    pub false_visible_triangles: u32,
    /// Keys of the false hidden objects, in the order in which they were drawn.
    pub false_hidden_keys: Vec<u32>,
}

impl Comparison {
    /// Whether exactly the objects with pixels were reported. Triangles do not matter: cullers report
    /// objects.
    pub fn is_exact(&self) -> bool {
        self.false_hidden_objects == 0 && self.false_visible_objects == 0
    }

    /// Whether nothing visible was left out, as far as the pixels tell: what a conservative culler owes.
    pub fn is_conservative(&self) -> bool {
        self.false_hidden_objects == 0
    }
}

/// What is to be said of a culler's answer about one object.
#[derive(Clone, Copy, PartialEq)]
enum Answer {
    Reported,
    /// Not reported, though a pixel shows it.
    FalseHidden,
    /// Not reported, and rightly so as far as is known.
    Hidden,
}

impl ExactVisibility {
    /// Compares with a culler's answer: `reported` is asked, once for each object in the order in which they
    /// were drawn, with the object's index and key. Linear in the number of objects and of tied pixels;
    /// allocates a byte an object.
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
                    out.wrong_pixels += object.pixels;
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
    use crate::raster::{Image, NONE};

    #[test]
    fn errors_are_counted_both_ways() {
        let mut exact = ExactVisibility::default();
        for (key, triangles) in [(10, 4), (11, 2), (12, 3), (13, 1)] {
            exact.push(key, triangles);
        }
        // Triangles 0..4, 4..6, 6..9, 9: objects 10, 11 and 12 are seen with 1, 2 and 1 of them.
        exact.count(&Image::new(7, 1, [0, 0, 4, 5, 5, 8, NONE].into(), [1.0; 7].into()));
        let mut comparison =
            Comparison { false_hidden_keys: [1, 2, 3].into(), wrong_pixels: 9, ..Default::default() };
        exact.compare(|_, key| [10, 13].contains(&key), &mut comparison);
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
        assert_eq!(comparison, expected);
        assert!(!comparison.is_conservative());
        exact.compare(|index, _| index < 3, &mut comparison);
        assert!(comparison.is_exact() && comparison.false_hidden_keys.is_empty());
        assert_eq!(comparison.false_visible_triangles, 9 - 4);
        exact.compare(|_, _| true, &mut comparison);
        assert!(comparison.is_conservative() && !comparison.is_exact());
    }
}
