//! The item buffer: an image of triangle numbers.

use crate::clip::ImageProjection;
use crate::error::MeasureError;
use crate::raster::Image;
use crate::sampled_visibility::SampledVisibility;
use visibility_core::View;
use visibility_core::glam::{DVec3, Vec3};

/// Maximum number of columns and of rows of an item buffer: 16,384.
pub const MAX_SIDE: u32 = 1 << 14;

/// Image that holds, for each pixel, the number of the triangle seen through the pixel's centre.
///
/// Memory: 12 bytes per pixel, 4 bytes per triangle drawn, and about 40 bytes per pixel for each further
/// object that the pixel shows in a tie. All memory is reused from frame to frame. Drawing costs 10 to 20 ns
/// per triangle and about 1 ns for each pixel of each triangle, hidden or not.
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
    /// Triangle number and depth key of each pixel.
    pub(crate) image: Image,
    /// View of the last frame. `None` before the first frame and after one that failed.
    pub(crate) view: Option<View>,
    /// Pixel counts of the last frame, by object and triangle.
    sampled: SampledVisibility,
}

impl ItemBuffer {
    /// Makes an empty image of `width` columns and `height` rows. Each view fills the whole image. For square
    /// pixels, `width / height` should equal the aspect ratio of the views drawn.
    ///
    /// # Errors
    /// [`MeasureError::Size`] if a side is 0 or above [`MAX_SIDE`], or memory for the pixels cannot be
    /// allocated.
    pub fn new(width: u32, height: u32) -> Result<Self, MeasureError> {
        let error = MeasureError::Size { width, height };
        if !(1..=MAX_SIDE).contains(&width) || !(1..=MAX_SIDE).contains(&height) {
            return Err(error);
        }
        let image = Image::new(width as usize, height as usize).ok_or(error)?;
        Ok(Self { image, view: None, sampled: SampledVisibility::default() })
    }

    /// Draws objects, replacing the previous frame, and counts their pixels.
    ///
    /// Each object is a pair of a key, by which the caller identifies the object, and its triangles in metres
    /// relative to `origin`. `origin` is a point of the world in metres, usually the scene's origin. Objects
    /// are numbered from 0 in the order given, and triangles from 0 through all objects. The caller chooses
    /// which objects to draw: [`View::layers`] is ignored, and every triangle is opaque. A triangle with a
    /// NaN or infinite coordinate, or without area on the screen, covers no pixel.
    ///
    /// # Errors
    /// [`MeasureError::TooMany`] if the number of triangles or objects exceeds 32 bits; the image is then
    /// empty.
    pub fn draw<'a>(
        &mut self,
        view: &View,
        origin: DVec3,
        objects: impl IntoIterator<Item = (u32, &'a [[Vec3; 3]])>,
    ) -> Result<&SampledVisibility, MeasureError> {
        self.clear();
        let projection = ImageProjection::new(view, origin, &self.image);
        self.image.least_difference = projection.least_difference();
        for (object, (key, triangles)) in objects.into_iter().enumerate() {
            let Some(first) = self.sampled.push(key, triangles.len()) else {
                self.clear();
                return Err(MeasureError::TooMany { object });
            };
            self.image.object_start = first;
            for (item, triangle) in (first..).zip(triangles) {
                projection.draw(triangle, item, &mut self.image);
            }
        }
        self.view = Some(*view);
        self.image.drop_hidden_claims();
        self.sampled.count(&self.image);
        Ok(&self.sampled)
    }

    /// Empties the image and the counts; keeps the capacity.
    fn clear(&mut self) {
        self.view = None;
        self.image.clear();
        self.sampled.clear();
    }

    /// Returns the number of columns.
    pub fn width(&self) -> u32 {
        self.image.width as u32
    }

    /// Returns the number of rows.
    pub fn height(&self) -> u32 {
        self.image.height as u32
    }

    /// Returns, for each pixel, the number of the triangle seen through the pixel's centre, or
    /// [`NONE`](crate::NONE) if no triangle is seen. Row by row from the top of the image, each row from the
    /// left. The centre of column `i` is at NDC `x / w = (2 * i + 1) / width - 1`, the centre of row `j` at
    /// `y / w = 1 - (2 * j + 1) / height`. If triangles tie for a pixel, the pixel has the nearest of them by
    /// rounding, or the first drawn among equals.
    pub fn items(&self) -> &[u32] {
        &self.image.items
    }

    /// Returns, for each pixel, the depth key of the triangle seen there, in the order of
    /// [`items`](Self::items). Greater is nearer. For perspective views the key is `1 / w`, the reciprocal
    /// distance along the viewing direction (unless the clip matrix scales `w`). For parallel views the key
    /// is linear in depth. Negative infinity in pixels without a triangle.
    pub fn depth_keys(&self) -> &[f64] {
        &self.image.depth_keys
    }

    /// Returns the object seen in a pixel, as an index into [`SampledVisibility::objects`]. `None` if the
    /// pixel shows no object or lies outside of the image.
    pub fn object_at(&self, column: u32, row: u32) -> Option<usize> {
        if column >= self.width() || row >= self.height() {
            return None;
        }
        self.sampled.object_of(self.image.items[row as usize * self.image.width + column as usize])
    }

    /// Returns the counts of the last [`draw`](Self::draw). Empty before the first.
    pub fn visible(&self) -> &SampledVisibility {
        &self.sampled
    }
}
