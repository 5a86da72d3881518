//! The image of triangle numbers.

use crate::clip::ImageProjection;
use crate::error::MeasureError;
use crate::exact::ExactVisibility;
use crate::raster::{Image, NONE};
use alloc::vec::Vec;
use visibility_core::View;
use visibility_core::glam::{DVec3, Vec3};

/// The most columns or rows of an item buffer.
pub const MAX_SIDE: u32 = 1 << 14;

/// An image that holds, per pixel, the number of the triangle seen there.
///
/// Takes 12 bytes a pixel, 4 bytes a triangle drawn, and some 40 bytes a pixel for each further object that
/// it shows in a tie; all of it is reused from frame to frame. Drawing costs 10 to 20 ns a triangle and about
/// 1 ns for each pixel of each triangle, hidden or not.
///
/// ```
/// use visibility_core::{glam::{DVec3, Vec3}, Pose, View};
/// use visibility_measure::{ItemBuffer, NONE};
/// let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
/// let view = View::perspective(pose, 1.0, 2.0, 0.1, f64::INFINITY)?;
/// // Right of the line of sight, which runs along x, is -y.
/// let triangle = [[Vec3::new(3.0, -9.0, -9.0), Vec3::new(3.0, -9.0, 9.0), Vec3::new(3.0, 0.0, 0.0)]];
/// let mut buffer = ItemBuffer::new(80, 40)?;
/// buffer.draw(&view, DVec3::ZERO, [(1000, &triangle[..])])?;
/// assert_eq!(buffer.items()[20 * 80 + 70], 0);
/// assert_eq!(buffer.items()[20 * 80 + 10], NONE);
/// assert_eq!(buffer.object_at(70, 20).map(|i| buffer.visible().objects()[i].key), Some(1000));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct ItemBuffer {
    image: Image,
    exact: ExactVisibility,
}

impl ItemBuffer {
    /// An empty image of `width` columns and `height` rows. For square pixels their ratio should be the
    /// aspect of the views drawn, but need not be: each view fills the image.
    ///
    /// # Errors
    /// [`MeasureError::Size`].
    pub fn new(width: u32, height: u32) -> Result<Self, MeasureError> {
        let error = MeasureError::Size { width, height };
        if !(1..=MAX_SIDE).contains(&width) || !(1..=MAX_SIDE).contains(&height) {
            return Err(error);
        }
        let (width, height) = (width as usize, height as usize);
        let (mut items, mut nearness) = (Vec::new(), Vec::new());
        items.try_reserve_exact(width * height).map_err(|_| error)?;
        nearness.try_reserve_exact(width * height).map_err(|_| error)?;
        items.resize(width * height, NONE);
        nearness.resize(width * height, f64::NEG_INFINITY);
        Ok(Self { image: Image::new(width, height, items, nearness), exact: ExactVisibility::default() })
    }

    /// Draws objects and counts their pixels, forgetting the frame before.
    ///
    /// Objects are pairs of a key, with which the caller knows them, and triangles relative to `origin`, in
    /// metres: the scene's origin, a point of the world. They are numbered in the order in which they come,
    /// and so are their triangles, through all objects. Which objects to draw is the caller's choice:
    /// [`View::layers`] is not looked at, and nothing is transparent. A triangle with a coordinate that is
    /// NaN or infinite, or without area on the screen, covers no pixel.
    ///
    /// # Errors
    /// [`MeasureError::TooMany`]; the image is empty then.
    pub fn draw<'a>(
        &mut self,
        view: &View,
        origin: DVec3,
        objects: impl IntoIterator<Item = (u32, &'a [[Vec3; 3]])>,
    ) -> Result<&ExactVisibility, MeasureError> {
        self.clear();
        let projection = ImageProjection::new(view, origin, &self.image);
        self.image.least_difference = projection.least_difference();
        for (object, (key, triangles)) in objects.into_iter().enumerate() {
            let Some(first) = self.exact.push(key, triangles.len()) else {
                self.clear();
                return Err(MeasureError::TooMany { object });
            };
            self.image.object_start = first;
            for (item, triangle) in (first..).zip(triangles) {
                projection.draw(triangle, item, &mut self.image);
            }
        }
        self.image.settle_claims();
        self.exact.count(&self.image);
        Ok(&self.exact)
    }

    fn clear(&mut self) {
        self.image.items.fill(NONE);
        self.image.nearness.fill(f64::NEG_INFINITY);
        self.image.layers = 0;
        self.image.claims.clear();
        self.exact.clear();
    }

    /// Columns of the image.
    pub fn width(&self) -> u32 {
        self.image.width as u32
    }

    /// Rows of the image.
    pub fn height(&self) -> u32 {
        self.image.height as u32
    }

    /// Per pixel the number of the triangle seen through its centre, or [`NONE`]; row by row from the top of
    /// the picture, each from the left. The centre of column `i` is at clip-space
    /// `x / w = (2 * i + 1) / width - 1`, that of row `j` at `y / w = 1 - (2 * j + 1) / height`. Of triangles
    /// that tie for a pixel, the nearest by rounding has it, or the first drawn.
    pub fn items(&self) -> &[u32] {
        &self.image.items
    }

    /// Per pixel how near the triangle is that is seen there, in the order of [`items`](Self::items): over
    /// the distance along the line of sight for perspective views (`1 / w`), linear in depth for parallel
    /// ones; negative infinity where there is none.
    pub fn nearness(&self) -> &[f64] {
        &self.image.nearness
    }

    /// The index, in [`ExactVisibility::objects`], of the object seen in a pixel; `None` where there is none
    /// or outside the image.
    pub fn object_at(&self, column: u32, row: u32) -> Option<usize> {
        if column >= self.width() || row >= self.height() {
            return None;
        }
        self.exact.object_of(self.image.items[row as usize * self.image.width + column as usize])
    }

    /// What was found by the last [`draw`](Self::draw).
    pub fn visible(&self) -> &ExactVisibility {
        &self.exact
    }
}
