//! What an item buffer found: pixels by object and by triangle.

use alloc::vec::Vec;
use core::ops::Range;

/// How much of one object is seen.
///
/// ```
/// use visibility_core::measure::ObjectPixels;
/// let object = ObjectPixels { key: 7, first_triangle: 20, triangles: 12, visible_triangles: 3, pixels: 950 };
/// assert!(object.is_visible());
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug, Hash)]
pub struct ObjectPixels {
    /// The caller's own number of the object.
    pub key: u32,
    /// Number of its first triangle; triangles are numbered through all objects.
    pub first_triangle: u32,
    /// How many triangles it has.
    pub triangles: u32,
    /// How many of them have a pixel.
    pub visible_triangles: u32,
    /// How many pixels show the object.
    pub pixels: u32,
}

impl ObjectPixels {
    /// Whether any pixel shows the object.
    pub fn is_visible(&self) -> bool {
        self.pixels > 0
    }

    /// The numbers of its triangles.
    pub fn triangle_range(&self) -> Range<u32> {
        self.first_triangle..self.first_triangle + self.triangles
    }
}

/// The visible set V of one view, sampled at the pixels of an [`ItemBuffer`](super::ItemBuffer).
///
/// ```
/// use visibility_core::measure::ItemBuffer;
/// let buffer = ItemBuffer::new(64, 36)?;
/// assert_eq!(buffer.visible().visible_objects(), 0);
/// # Ok::<(), visibility_core::measure::MeasureError>(())
/// ```
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct ExactVisibility {
    pub(super) objects: Vec<ObjectPixels>,
    pub(super) triangle_pixels: Vec<u32>,
    pub(super) visible_objects: u32,
    pub(super) visible_triangles: u32,
    pub(super) covered_pixels: u32,
    pub(super) layers: u64,
}

impl ExactVisibility {
    /// All objects in the order in which they were drawn, visible or not.
    pub fn objects(&self) -> &[ObjectPixels] {
        &self.objects
    }

    /// How many pixels show each triangle, by its number.
    pub fn triangle_pixels(&self) -> &[u32] {
        &self.triangle_pixels
    }

    /// How many objects have a pixel.
    pub fn visible_objects(&self) -> u32 {
        self.visible_objects
    }

    /// How many triangles have a pixel.
    pub fn visible_triangles(&self) -> u32 {
        self.visible_triangles
    }

    /// How many pixels show any object.
    pub fn covered_pixels(&self) -> u32 {
        self.covered_pixels
    }

    /// How many triangles lie behind each other in a covered pixel, on average; zero if none is covered.
    pub fn depth_complexity(&self) -> f64 {
        self.layers as f64 / f64::from(self.covered_pixels.max(1))
    }

    /// The index in [`objects`](Self::objects) of the object that a triangle belongs to; `None` if there is no such
    /// triangle, as for [`NONE`](super::NONE). Logarithmic in the number of objects.
    pub fn object_of(&self, triangle: u32) -> Option<usize> {
        if triangle as usize >= self.triangle_pixels.len() {
            return None;
        }
        // Objects without triangles begin where the next one does; the last that begins here has the triangle.
        self.objects.partition_point(|o| o.first_triangle <= triangle).checked_sub(1)
    }

    pub(super) fn clear(&mut self) {
        self.objects.clear();
        self.triangle_pixels.clear();
        (self.visible_objects, self.visible_triangles, self.covered_pixels) = (0, 0, 0);
        self.layers = 0;
    }

    /// Takes in one more object; its number of triangles must still fit. Returns the number of its first.
    pub(super) fn push(&mut self, key: u32, triangles: usize) -> Option<u32> {
        let first_triangle = self.triangle_pixels.len() as u32;
        let end = end_of_numbers(first_triangle, triangles)?;
        // Objects are numbered by u32 as well, and may be empty.
        u32::try_from(self.objects.len()).ok()?;
        self.triangle_pixels.resize(end as usize, 0);
        let triangles = end - first_triangle;
        self.objects.push(ObjectPixels { key, first_triangle, triangles, visible_triangles: 0, pixels: 0 });
        Some(first_triangle)
    }

    /// Counts the pixels of a finished image.
    pub(super) fn count(&mut self, items: &[u32]) {
        for &item in items {
            if let Some(pixels) = self.triangle_pixels.get_mut(item as usize) {
                *pixels += 1;
            }
        }
        for object in &mut self.objects {
            let range = object.triangle_range();
            for &pixels in &self.triangle_pixels[range.start as usize..range.end as usize] {
                object.pixels += pixels;
                object.visible_triangles += u32::from(pixels > 0);
            }
            self.visible_objects += u32::from(object.pixels > 0);
            self.visible_triangles += object.visible_triangles;
            self.covered_pixels += object.pixels;
        }
    }
}

/// One past the last number of `count` triangles; all numbers must be less than [`NONE`](super::NONE).
fn end_of_numbers(first: u32, count: usize) -> Option<u32> {
    first.checked_add(u32::try_from(count).ok()?).filter(|&end| end < super::NONE)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_run_out_before_none() {
        assert_eq!(end_of_numbers(5, 7), Some(12));
        assert_eq!(end_of_numbers(u32::MAX - 7, 6), Some(u32::MAX - 1));
        assert_eq!(end_of_numbers(u32::MAX - 7, 7), None);
        assert_eq!(end_of_numbers(9, usize::MAX), None);
    }

    #[test]
    fn pixels_are_counted_by_triangle_and_object() {
        let mut exact = ExactVisibility::default();
        let firsts = [(9, 2), (8, 0), (7, 3)].map(|(key, triangles)| exact.push(key, triangles));
        assert_eq!(firsts, [Some(0), Some(2), Some(2)]);
        exact.count(&[1, 1, super::super::NONE, 2, 4, 4]);
        assert_eq!(exact.triangle_pixels(), [0, 2, 1, 0, 2]);
        let seen: Vec<_> = exact.objects().iter().map(|o| (o.key, o.visible_triangles, o.pixels)).collect();
        assert_eq!(seen, [(9, 1, 2), (8, 0, 0), (7, 2, 3)]);
        assert_eq!((exact.visible_objects(), exact.visible_triangles(), exact.covered_pixels()), (2, 3, 5));
        let owners = [0, 1, 2, 4, 5, super::super::NONE].map(|t| exact.object_of(t));
        assert_eq!(owners, [Some(0), Some(0), Some(2), Some(2), None, None]);
    }
}
