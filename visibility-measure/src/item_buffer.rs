//! The item buffer: an image of triangle numbers.

use crate::clip::ImageProjection;
use crate::error::MeasureError;
use crate::raster::{Image, NONE};
use crate::sampled_visibility::SampledVisibility;
use alloc::vec::Vec;
use visibility_core::glam::DVec3;
use visibility_core::scene::{Triangle, Triangles};
use visibility_core::{ObjectId, Scene, View};

/// Maximum number of columns and of rows of an item buffer: 16,384.
pub const MAX_SIDE: u32 = 1 << 14;

/// Object to draw, with its drawing options. Made from a pair of a key and triangles, it is opaque and drawn
/// from both sides.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct DrawnObject<'a> {
    /// Key by which the caller identifies the object.
    pub key: u32,
    /// Triangles in metres relative to the `origin` given to [`ItemBuffer::draw`], counter-clockwise as seen
    /// from their front.
    pub triangles: Triangles<'a>,
    /// If true, things behind the object show through it: the object is visible, and hides nothing.
    pub see_through: bool,
    /// If true, triangles are drawn only from their front: from behind they are invisible, and hide nothing.
    pub one_sided: bool,
}

impl<'a> From<(u32, Triangles<'a>)> for DrawnObject<'a> {
    fn from((key, triangles): (u32, Triangles<'a>)) -> Self {
        Self { key, triangles, see_through: false, one_sided: false }
    }
}

impl<'a> From<(u32, &'a [Triangle])> for DrawnObject<'a> {
    fn from((key, triangles): (u32, &'a [Triangle])) -> Self {
        Self::from((key, Triangles::from(triangles)))
    }
}

impl<'a> DrawnObject<'a> {
    /// Returns an object of a scene with its triangles, key and drawing options, for a view. Its key is the
    /// object's index. `None` if the scene has no such object, or the object is on none of the view's layers.
    pub fn of_scene(scene: &'a Scene, id: ObjectId, view: &View) -> Option<Self> {
        let (object, triangles) = (scene.object(id).ok()?, scene.triangles(id).ok()?);
        // An object whose fronts are uncertain is seen from both sides, and hides nothing.
        let is_unknown = object.one_sided && !triangles.has_certain_fronts();
        let (see_through, one_sided) = (object.see_through || is_unknown, object.one_sided && !is_unknown);
        let key = id.index() as u32;
        (object.layers & view.layers() != 0).then_some(Self { key, triangles, see_through, one_sided })
    }
}

/// Image that holds, for each pixel, the number of the triangle seen through the pixel's centre.
///
/// Memory: 12 bytes per pixel, 24 bytes per object, 8 bytes per visible triangle, about 40 bytes per pixel
/// for each additional object in a tie, and 24 bytes per pixel once a see-through object was drawn. All
/// memory is reused from frame to frame. Drawing costs 10 to 20 ns per triangle and about 1 ns for each pixel
/// of each triangle, hidden or not. Objects whose [bounds are known](Triangles::known_bounds) and contain no
/// pixel centre cost about 50 ns each.
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
    /// Each object is a [`DrawnObject`], or a pair of a key, by which the caller identifies the object, and
    /// its triangles in metres relative to `origin`. `origin` is a point of the world in metres, usually the
    /// scene's origin. Objects are numbered from 0 in the order given, and triangles from 0 through all
    /// objects. The caller chooses which objects to draw: [`View::layers`] is ignored. A triangle with a NaN
    /// or infinite coordinate, or without area on the screen, covers no pixel.
    ///
    /// See-through objects are drawn after all others. The list of see-through objects is allocated anew in
    /// each call.
    ///
    /// # Errors
    /// [`MeasureError::TooMany`] if the number of triangles or objects exceeds 32 bits; the image is then
    /// empty.
    pub fn draw<'a>(
        &mut self,
        view: &View,
        origin: DVec3,
        objects: impl IntoIterator<Item: Into<DrawnObject<'a>>>,
    ) -> Result<&SampledVisibility, MeasureError> {
        self.clear();
        let projection = ImageProjection::new(view, origin, &self.image);
        self.image.least_difference = projection.least_difference();
        let is_drawn =
            |of: &DrawnObject<'_>, triangle: &Triangle| !of.one_sided || projection.sees_front(triangle);
        let mut see_through = Vec::new();
        for (object, drawn) in objects.into_iter().enumerate() {
            let drawn = drawn.into();
            let Some(first) = self.sampled.push(drawn.key, drawn.triangles.len()) else {
                self.clear();
                return Err(MeasureError::TooMany { object });
            };
            if drawn.see_through {
                see_through.push((object, first, drawn));
                continue;
            }
            self.image.object_start = first;
            if !projection.may_show(drawn.triangles, &self.image) {
                continue;
            }
            for (item, triangle) in (first..).zip(drawn.triangles) {
                if is_drawn(&drawn, &triangle) {
                    projection.draw(&triangle, item, &mut self.image);
                }
            }
        }
        self.view = Some(*view);
        self.image.drop_hidden_claims();
        self.sampled.count(&self.image);
        // Each see-through object is tested against the opaque image by itself, and does not change the
        // image.
        if !see_through.is_empty() {
            self.image.begin_see_through();
        }
        for (object, first, drawn) in see_through {
            self.image.next_see_through(object as u32);
            if !projection.may_show(drawn.triangles, &self.image) {
                continue;
            }
            for (item, triangle) in (first..).zip(drawn.triangles) {
                if is_drawn(&drawn, &triangle) {
                    projection.draw(&triangle, item, &mut self.image);
                    self.sampled.add_triangle_pixels(object, item, self.image.take_triangle_pixels());
                }
            }
            let found = self.image.next_see_through(u32::MAX);
            self.sampled.add_see_through(object, found);
        }
        self.sampled.end_see_through(self.image.layers);
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

    /// Returns, for each pixel, the number of the opaque triangle seen through the pixel's centre, or
    /// [`NONE`](crate::NONE) if no opaque triangle is seen. Row by row from the top of the image, each row
    /// from the left. The centre of column `i` is at NDC `x / w = (2 * i + 1) / width - 1`, the centre of row
    /// `j` at `y / w = 1 - (2 * j + 1) / height`. If triangles tie for a pixel, the pixel has the nearest of
    /// them by rounding, or the first drawn among equals.
    pub fn items(&self) -> &[u32] {
        &self.image.items
    }

    /// Returns the number of the nearest see-through triangle in front of the opaque surface of a pixel.
    /// [`NONE`](crate::NONE) if none certainly shows, or the pixel is outside of the image.
    pub fn see_through_item(&self, column: u32, row: u32) -> u32 {
        if column >= self.width() || row >= self.height() {
            return NONE;
        }
        self.image.veil(row as usize * self.image.width + column as usize)
    }

    /// Returns, for each pixel, the depth key of the opaque triangle seen there, in the order of
    /// [`items`](Self::items). Greater is nearer. For perspective views the key is `1 / w`, the reciprocal
    /// distance along the viewing direction (unless the clip matrix scales `w`). For parallel views the key
    /// is linear in depth. Negative infinity in pixels without a triangle.
    pub fn depth_keys(&self) -> &[f64] {
        &self.image.depth_keys
    }

    /// Returns the opaque object seen in a pixel, as an index into [`SampledVisibility::objects`]. `None` if
    /// the pixel shows no opaque object or lies outside of the image.
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
