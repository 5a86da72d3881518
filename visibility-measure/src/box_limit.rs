//! The box limit of a view: the objects that a culler must report if it knows all surfaces, but tests each
//! object only by its box.
//!
//! A culler that tests boxes and never hides what can be seen must report an object as soon as a pixel could
//! show a point of its box. The box is solid here: the object may be anywhere in it. The *box limit* is the
//! number of these objects. No such culler reports fewer, apart from objects between pixel centres. The
//! number of reported objects divided by the box limit tells how far a culler is from the best of its kind.
//!
//! A pixel is *free* for a box if the ray through the pixel's centre meets the part of the box within the
//! view, at a point at least as near as the surface that the item buffer shows there. Equally near, up to the
//! tolerance of [ties](crate#ties), also counts as free, since an object flush with a wall may be seen. The
//! ray is intersected with the box as with the planes of the view (Kay and Kajiya, "Ray Tracing Complex
//! Scenes", 1986), so that near plane, far plane and clip planes bound a solid box as they bound the view.
//! The eye may be inside the box.

use crate::ItemBuffer;
use crate::clip::ImageProjection;
use crate::raster::{Corner, EDGE_TIE, Image, first_center, least_tied_key};
use visibility_core::glam::{DMat3, DVec2, DVec3};
use visibility_core::{Aabb, ObjectId, Scene, View};

impl ItemBuffer {
    /// Returns the objects of the *box limit* for the view and the surfaces of the last [`draw`](Self::draw):
    /// the objects that a culler must report if it knows these surfaces, but tests each object only by its
    /// box. Before the call, draw only opaque objects, since others hide nothing.
    ///
    /// An object belongs to the limit if it shares a layer with the view and one of three conditions holds:
    /// `is_seen` returns true; or no culler may hide it, since it is flagged as never culled or its box is
    /// inverted, NaN or infinite; or a pixel is free for its box, that is, the ray through the pixel's centre
    /// meets the box within the view, not behind the surface drawn there. A point of the box that is exactly
    /// as near as the surface is not behind it. A box out of view, or too small to meet a ray through a pixel
    /// centre, has no free pixel. A ray that passes within a millionth of a column and row of the box's
    /// outline does not count as meeting the box.
    ///
    /// `is_seen` returns whether an object is known to be visible; such an object costs no test. A test
    /// visits the pixels within the screen bounds of the box until one is free. It casts a ray only if the
    /// nearest corner of the box is nearer than the surface drawn in the pixel. For a box with corners in
    /// front of and behind the eye, the screen bounds are the whole image. Before the first draw, and after a
    /// failed one, the limit is empty.
    ///
    /// ```
    /// use visibility_core::{glam::{DVec3, Vec3}, Aabb, Pose, Scene, View};
    /// use visibility_measure::ItemBuffer;
    /// let wall = [[Vec3::new(5.0, -9.0, -9.0), Vec3::new(5.0, 9.0, -9.0), Vec3::new(5.0, 0.0, 9.0)]];
    /// let mut scene = Scene::new();
    /// let [_behind, before] = [8.0, 3.0].map(|x| {
    ///     scene.insert(Aabb::from_arrays([x, -0.5, -0.5], [x + 1.0, 0.5, 0.5]))
    /// });
    /// let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
    /// let view = View::perspective(pose, 1.0, 16.0 / 9.0, 0.1, f64::INFINITY)?;
    /// let mut buffer = ItemBuffer::new(320, 180)?;
    /// buffer.draw(&view, scene.origin(), [(0, &wall[..])])?;
    /// assert!(buffer.box_limit(&scene, |_| false).eq([before]));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn box_limit<'a>(
        &'a self,
        scene: &'a Scene,
        mut is_seen: impl FnMut(ObjectId) -> bool + 'a,
    ) -> impl Iterator<Item = ObjectId> + 'a {
        let drawn = self.view.as_ref().map(|view| (view.layers(), FreePixels::new(view, scene, &self.image)));
        scene.ids().filter(move |&id| {
            let Some((layers, pixels)) = &drawn else { return false };
            let (Ok(object), Ok(bounds)) = (scene.object(id), scene.bounds(id)) else { return false };
            let mut is_reported = || object.never_cull || !bounds.is_finite() || is_seen(id);
            object.layers & layers != 0 && (is_reported() || pixels.any(&bounds))
        })
    }
}

/// Search of an image for a pixel that is free for a box.
struct FreePixels<'a> {
    /// Picture of the opaque surfaces.
    image: &'a Image,
    /// Mapping of points relative to the scene's origin to the image.
    projection: ImageProjection,
    /// Inverse of the 3x3 matrix that takes a direction in space to clip x, y and w (perspective) or x, y and
    /// z (parallel).
    inverse: DMat3,
    /// Start of all rays, in metres relative to the scene's origin: the eye (perspective), or a point of the
    /// ray through the middle of the image (parallel).
    start: DVec3,
}

impl<'a> FreePixels<'a> {
    /// Prepares the search for boxes of a scene, in an image drawn from the view.
    fn new(view: &View, scene: &Scene, image: &'a Image) -> Self {
        let projection = ImageProjection::new(view, scene.origin(), image);
        let clip = projection.clip_from_local;
        let rows = [clip.row(0), clip.row(1), clip.row(if projection.parallel { 2 } else { 3 })];
        let inverse =
            DMat3::from_cols_array_2d(&rows.map(|row| row.truncate().to_array())).transpose().inverse();
        let start = inverse * -DVec3::from_array(rows.map(|row| row.w));
        Self { image, projection, inverse, start }
    }

    /// Returns the ray through a point of the image, given as column and row: the ray's start point, and its
    /// movement per unit of the ray's parameter. The parameter is clip w (perspective) or clip z (parallel).
    fn ray(&self, column: f64, row: f64) -> (DVec3, DVec3) {
        let half_size = self.projection.half_size;
        let ndc = DVec2::new(column / half_size.x - 1.0, 1.0 - row / half_size.y);
        if self.projection.parallel {
            let w = self.projection.clip_from_local.w_axis.w;
            (self.start + self.inverse * (ndc * w).extend(0.0), self.inverse.z_axis)
        } else {
            (self.start, self.inverse * ndc.extend(1.0))
        }
    }

    /// Returns the depth key of the nearest point that a box within the view and the ray through a point of
    /// the image have in common. `None` if they do not meet. Touching counts as meeting.
    fn nearest_key(&self, bounds: &Aabb, column: f64, row: f64) -> Option<f64> {
        let ImageProjection { clip_from_local, near, far, depth_key, parallel, clip_planes, .. } =
            &self.projection;
        let (start, direction) = self.ray(column, row);
        let (least, greatest) = (bounds.min.as_dvec3(), bounds.max.as_dvec3());
        // Clip z and w along the ray: value at parameter 0, and change per unit of the parameter.
        let (z, w) = if *parallel {
            ((0.0, 1.0), (clip_from_local.w_axis.w, 0.0))
        } else {
            let row = clip_from_local.row(2);
            ((row.truncate().dot(start) + row.w, row.truncate().dot(direction)), (0.0, 1.0))
        };
        let mut range = (f64::NEG_INFINITY, f64::INFINITY);
        // For a box without thickness, both sides are cut at bit-identical parameters.
        for axis in 0..3 {
            cut(&mut range, start[axis] - least[axis], direction[axis]);
            cut(&mut range, greatest[axis] - start[axis], -direction[axis]);
        }
        for plane in [near, far] {
            cut(&mut range, plane.x * z.0 + plane.y * w.0, plane.x * z.1 + plane.y * w.1);
        }
        for plane in clip_planes {
            cut(&mut range, plane.signed_distance(start), plane.normal.dot(direction));
        }
        if range.0 > range.1 {
            return None;
        }
        // In parallel views with reversed depth, the greatest z is the nearest.
        Some(match (parallel, depth_key.x < 0.0) {
            (false, _) => 1.0 / range.0,
            (true, true) => depth_key.x * range.0 / w.0,
            (true, false) => depth_key.x * range.1 / w.0,
        })
    }

    /// Tests whether any pixel is free for a finite box.
    fn any(&self, bounds: &Aabb) -> bool {
        let (image, projection) = (self.image, &self.projection);
        let clip = bounds.corners().map(|p| projection.clip_from_local * p.as_dvec3().extend(1.0));
        if clip.iter().fold(u32::MAX, |all, &v| all & projection.outside(v)) != 0 {
            return false;
        }
        let (mut columns, mut rows) = (0..image.width, 0..image.height);
        let mut nearest = f64::INFINITY;
        if clip.iter().all(|v| v.w > 0.0) {
            let corners = clip.map(|v| projection.corner(v));
            let ends = |of: fn(&Corner) -> f64, limit| {
                let (a, b) = corners
                    .iter()
                    .map(of)
                    .fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)));
                first_center(a, limit)..first_center(b, limit)
            };
            columns = ends(|corner| corner.x, image.width);
            rows = ends(|corner| corner.y, image.height);
            nearest = corners.iter().fold(f64::NEG_INFINITY, |nearest, corner| nearest.max(corner.depth_key));
        }
        rows.into_iter().any(|row| {
            columns.clone().any(|column| {
                let surface = image.depth_keys[row * image.width + column];
                let least = least_tied_key(surface, image.least_difference);
                nearest >= least && self.is_free(bounds, column as f64 + 0.5, row as f64 + 0.5, least)
            })
        })
    }

    /// Tests whether the ray through the pixel centre (`x`, `y`), in columns and rows, meets a box at a depth
    /// key of at least `least`. False if the outline of the box in the image is within [`EDGE_TIE`] of the
    /// centre.
    fn is_free(&self, bounds: &Aabb, x: f64, y: f64, least: f64) -> bool {
        let meets = |dx: f64, dy: f64| self.nearest_key(bounds, x + dx, y + dy).is_some();
        // The box's outline is convex, so if all four points around the centre are inside, the outline does
        // not pass between them.
        let tie = EDGE_TIE;
        self.nearest_key(bounds, x, y).is_some_and(|key| key >= least)
            && meets(-tie, -tie)
            && meets(-tie, tie)
            && meets(tie, -tie)
            && meets(tie, tie)
    }
}

/// Shortens a range of ray parameters `t`, from least to greatest, to the part where `constant + slope * t`
/// is not negative. If there is no such part, or a value is NaN, the range becomes empty: its first end is
/// greater than its second.
fn cut(range: &mut (f64, f64), constant: f64, slope: f64) {
    let end = -constant / slope;
    if slope == 0.0 || end.is_nan() {
        if slope != 0.0 || constant.is_nan() || constant < 0.0 {
            *range = (f64::INFINITY, f64::NEG_INFINITY);
        }
    } else if slope > 0.0 {
        range.0 = range.0.max(end);
    } else {
        range.1 = range.1.min(end);
    }
}
