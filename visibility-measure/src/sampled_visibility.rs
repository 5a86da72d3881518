//! Counts of an item buffer: visible pixels by object and by triangle.

use crate::raster::{Image, NONE, VeilPixels};
use alloc::vec::Vec;

/// Visible pixels and triangles of one object.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Hash)]
#[non_exhaustive]
pub struct ObjectPixels {
    /// Key by which the caller identifies the object.
    pub key: u32,
    /// Number of the object's first triangle. Triangles are numbered from 0 through all objects.
    pub first_triangle: u32,
    /// Number of the object's triangles.
    pub triangles: u32,
    /// Number of the object's triangles that at least one pixel of the image shows.
    pub visible_triangles: u32,
    /// Number of pixels that show this object and do not tie with another object. A see-through object shows
    /// in each pixel in which it is in front of the opaque triangle, together with other objects that show
    /// there.
    pub pixels: u32,
    /// Number of pixels for which this object ties with other objects (only rounding decides which of them
    /// the image shows): see [ties](crate#ties).
    pub tied_pixels: u32,
}

impl ObjectPixels {
    /// Tests whether any pixel shows the object, or shows another object at an equal depth within the tie
    /// tolerance (see [ties](crate#ties)).
    pub fn is_visible(&self) -> bool {
        self.pixels > 0 || self.tied_pixels > 0
    }
}

/// Visible set V of one view, sampled at the pixels of an [`ItemBuffer`](crate::ItemBuffer).
///
/// ```
/// use visibility_measure::ItemBuffer;
/// let buffer = ItemBuffer::new(64, 36)?;
/// assert_eq!(buffer.visible().visible_objects(), 0);
/// # Ok::<(), visibility_measure::MeasureError>(())
/// ```
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct SampledVisibility {
    /// Counts of each object, in the order drawn.
    objects: Vec<ObjectPixels>,
    /// Numbers of the visible triangles, ascending, each with the number of pixels that show it.
    triangle_pixels: Vec<(u32, u32)>,
    /// Number of triangles of all objects.
    triangles: u32,
    /// Objects of the tied pixels, sorted by pixel. Objects tie for a pixel if only rounding decides which
    /// of them the image shows. Within a pixel, the object that the image shows comes first.
    ties: Vec<Tie>,
    /// Number of objects that at least one pixel shows, or that tie in depth with its shown object.
    visible_objects: u32,
    /// Number of triangles with at least one pixel of the image.
    visible_triangles: u32,
    /// Number of pixels that show a triangle.
    covered_pixels: u32,
    /// Number of pixels for which several objects tie, that is, only rounding decides which of them the
    /// image shows.
    tied_pixels: u32,
    /// Sum over all pixels of the number of triangles drawn that cover the pixel.
    layers: u64,
}

/// Object of a tied pixel, in which only rounding decides which of several objects the image shows.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
struct Tie {
    /// Index of the pixel, row by row.
    pixel: u32,
    /// False for the object that the image shows in the pixel, true for the other objects of the tie.
    is_challenger: bool,
    /// Index of the object, in the order drawn.
    object: u32,
}

impl SampledVisibility {
    /// Returns the counts of all objects in the order drawn, visible or not. Empty before the first frame.
    pub fn objects(&self) -> &[ObjectPixels] {
        &self.objects
    }

    /// Returns the number of each visible triangle and the number of pixels that show it, by ascending
    /// triangle number. A tied pixel counts for the one triangle that the image shows.
    pub fn triangle_pixels(&self) -> &[(u32, u32)] {
        &self.triangle_pixels
    }

    /// Returns the number of objects that at least one pixel shows, or that tie with its shown object.
    pub fn visible_objects(&self) -> u32 {
        self.visible_objects
    }

    /// Returns the number of triangles that at least one pixel of the image shows.
    pub fn visible_triangles(&self) -> u32 {
        self.visible_triangles
    }

    /// Returns the number of pixels that show any object.
    pub fn covered_pixels(&self) -> u32 {
        self.covered_pixels
    }

    /// Returns the number of pixels for which several objects tie, that is, only rounding decides which of
    /// them the image shows: see [ties](crate#ties).
    pub fn tied_pixels(&self) -> u32 {
        self.tied_pixels
    }

    /// Returns, for each tied pixel, the indices of the objects that tie for it: only rounding decides which
    /// of them the image shows. The first is the object that the image shows there.
    pub(crate) fn ties(&self) -> impl Iterator<Item = impl Iterator<Item = usize> + Clone> {
        self.ties.chunk_by(|a, b| a.pixel == b.pixel).map(|tie| tie.iter().map(|one| one.object as usize))
    }

    /// Returns the mean number of triangles that cover a covered pixel, visible or hidden. Zero if no pixel
    /// is covered.
    pub(crate) fn depth_complexity(&self) -> f64 {
        self.layers as f64 / f64::from(self.covered_pixels.max(1))
    }

    /// Returns the object to which a triangle number belongs, as an index into [`objects`](Self::objects).
    /// `None` for an unknown triangle, such as [`NONE`](crate::NONE). O(log n) in the number of objects.
    pub fn object_of(&self, triangle: u32) -> Option<usize> {
        if triangle >= self.triangles {
            return None;
        }
        // Objects without triangles begin at the same number as the next object, so the last object that
        // begins here has the triangle.
        self.objects.partition_point(|o| o.first_triangle <= triangle).checked_sub(1)
    }

    /// Removes all objects and zeroes the counts; keeps the capacity.
    pub(crate) fn clear(&mut self) {
        self.objects.clear();
        self.triangle_pixels.clear();
        self.ties.clear();
        (self.triangles, self.visible_objects, self.visible_triangles) = (0, 0, 0);
        (self.covered_pixels, self.tied_pixels, self.layers) = (0, 0, 0);
    }

    /// Appends an object with the given key and number of triangles. Returns the number of its first
    /// triangle. `None`, with nothing changed, if the triangles or objects no longer fit into 32-bit numbers.
    pub(crate) fn push(&mut self, key: u32, triangles: usize) -> Option<u32> {
        let first_triangle = self.triangles;
        let end = end_of_numbers(first_triangle, triangles)?;
        // Objects are numbered by u32 as well, and may have no triangles.
        u32::try_from(self.objects.len()).ok()?;
        self.triangles = end;
        let triangles = end - first_triangle;
        self.objects.push(ObjectPixels {
            key,
            first_triangle,
            triangles,
            visible_triangles: 0,
            pixels: 0,
            tied_pixels: 0,
        });
        Some(first_triangle)
    }

    /// Counts the pixels of a finished image by triangle and object. [`Image::drop_hidden_claims`] must have
    /// been called.
    pub(crate) fn count(&mut self, image: &Image) {
        self.layers = image.layers;
        let runs = image.items.chunk_by(|a, b| a == b).filter(|run| run[0] != NONE);
        self.triangle_pixels.extend(runs.map(|run| (run[0], run.len() as u32)));
        self.triangle_pixels.sort_unstable();
        self.triangle_pixels.dedup_by(|next, kept| {
            let is_same = next.0 == kept.0;
            kept.1 += if is_same { next.1 } else { 0 };
            is_same
        });
        let mut shown = self.triangle_pixels.iter().peekable();
        for object in &mut self.objects {
            let end = object.first_triangle + object.triangles;
            while let Some((_, pixels)) = shown.next_if(|(triangle, _)| *triangle < end) {
                object.pixels += pixels;
                object.visible_triangles += 1;
            }
            self.visible_triangles += object.visible_triangles;
            self.covered_pixels += object.pixels;
        }
        self.count_ties(image);
        self.visible_objects = self.objects.iter().map(|object| u32::from(object.is_visible())).sum();
    }

    /// Adds the pixel counts `found` of the see-through object with the index `object`. Called after
    /// [`count`](Self::count), and after [`add_triangle_pixels`](Self::add_triangle_pixels) for its
    /// triangles.
    pub(crate) fn add_see_through(&mut self, object: usize, found: VeilPixels) {
        let entry = &mut self.objects[object];
        (entry.pixels, entry.tied_pixels) = (found.pixels, found.tied);
        self.visible_triangles += entry.visible_triangles;
        self.covered_pixels += found.newly_covered;
        self.visible_objects += u32::from(entry.is_visible());
    }

    /// Finishes the see-through objects. `layers` is the sum over all pixels of the number of triangles that
    /// cover the pixel.
    pub(crate) fn end_see_through(&mut self, layers: u64) {
        self.layers = layers;
        self.triangle_pixels.sort_unstable();
    }

    /// Adds the number of pixels that show a triangle of the see-through object with the index `object`.
    pub(crate) fn add_triangle_pixels(&mut self, object: usize, triangle: u32, pixels: u32) {
        if pixels > 0 {
            self.objects[object].visible_triangles += 1;
            self.triangle_pixels.push((triangle, pixels));
        }
    }

    /// Derives `ties` from the image's claims (triangles that tie for a pixel). A tied pixel is removed from
    /// the pixels of the object that the image shows there, and counted as a tied pixel of every object of
    /// the tie.
    fn count_ties(&mut self, image: &Image) {
        let mut ties = core::mem::take(&mut self.ties);
        for claim in &image.claims {
            let holder = self.object_of(image.items[claim.pixel as usize]);
            let challenger = self.object_of(claim.item);
            // Triangles of one object do not tie.
            if let (Some(holder), Some(challenger)) = (holder, challenger)
                && holder != challenger
            {
                for (object, is_challenger) in [(holder, false), (challenger, true)] {
                    ties.push(Tie { pixel: claim.pixel, is_challenger, object: object as u32 });
                }
            }
        }
        ties.sort_unstable();
        ties.dedup();
        for tie in &ties {
            let object = &mut self.objects[tie.object as usize];
            object.tied_pixels += 1;
            if !tie.is_challenger {
                object.pixels -= 1;
                self.tied_pixels += 1;
            }
        }
        self.ties = ties;
    }
}

/// Returns one past the last of `count` triangle numbers that begin with `first`. `None` if a number would
/// reach [`NONE`].
fn end_of_numbers(first: u32, count: usize) -> Option<u32> {
    first.checked_add(u32::try_from(count).ok()?).filter(|&end| end < NONE)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_run_out_before_none() {
        assert_eq!(end_of_numbers(5, 7), Some(12), "numbers from 5");
        assert_eq!(end_of_numbers(u32::MAX - 7, 6), Some(u32::MAX - 1), "numbers up to the last");
        assert_eq!(end_of_numbers(u32::MAX - 7, 7), None, "numbers that reach `NONE`");
        assert_eq!(end_of_numbers(9, usize::MAX), None, "numbers that overflow");
    }

    #[test]
    fn pixels_are_counted_by_triangle_and_object() {
        let mut sampled = SampledVisibility::default();
        let firsts = [(9, 2), (8, 0), (7, 3)].map(|(key, triangles)| sampled.push(key, triangles));
        assert_eq!(firsts, [Some(0), Some(2), Some(2)], "first triangles of the objects");
        let mut image = Image::new(6, 1).unwrap();
        image.items = [1, 1, NONE, 2, 4, 4].into();
        sampled.count(&image);
        assert_eq!(sampled.triangle_pixels(), [(1, 2), (2, 1), (4, 2)], "pixels by triangle");
        let seen: Vec<_> = sampled.objects().iter().map(|o| (o.key, o.visible_triangles, o.pixels)).collect();
        assert_eq!(seen, [(9, 1, 2), (8, 0, 0), (7, 2, 3)], "key, visible triangles and pixels by object");
        assert_eq!(
            (sampled.visible_objects(), sampled.visible_triangles(), sampled.covered_pixels()),
            (2, 3, 5),
            "visible objects and triangles, and covered pixels"
        );
        let owners = [0, 1, 2, 4, 5, NONE].map(|t| sampled.object_of(t));
        assert_eq!(owners, [Some(0), Some(0), Some(2), Some(2), None, None], "objects by triangle");
    }
}
