//! The hierarchical z-buffer: occluders are drawn into it, boxes are tested against it.

use crate::buffer::pyramid::Pyramid;
use crate::buffer::tile_layout::SIDE;
use crate::buffer::tiles::Tiles;
use crate::buffer_size::{MAX_SIDE, MIN_SIDE, SizeError};
use crate::coverage::Coverage;
use crate::lanes::WIDTH;
use crate::query::box_face_planes::FacePlaneSetup;
use crate::query::box_projection::ScreenProjection32;
use crate::query::box_query::{BoxQuery, test_box};
use crate::query::box_queue::BoxQueue;
use crate::raster::contour_raster::ContourTiles;
use crate::raster::mesh_raster::MeshScratch;
use crate::setup::convex_shape::ConvexScratch;
use crate::setup::occluder_triangles::OccluderTriangles;
use crate::setup::screen_projection::{ScreenProjection, project_object};
use crate::setup::screen_shape::{ScreenExtent, ScreenShape, ShapeResult};
use crate::simd::Kernels;
use visibility_core::glam::{Affine3A, DVec3};
use visibility_core::view::ViewPlanes;
use visibility_core::{
    Aabb, Accuracy, OccluderMesh, OcclusionMap, View,
    occlusion::{Occlusion, Occlusion64},
    scene::Boxes64,
    simd::Simd,
};

/// Meshes of at most this many triangles are drawn by their outline if they look convex from the eye: to find
/// that out costs less than to draw the triangles.
const SMALL: usize = 24;

/// Triangles of convex parts that cost as much as one triangle of other meshes, since convex parts are drawn
/// by their outlines. A box costs as much as two.
const OUTLINE: usize = 6;

/// Between flushes, the pyramid is updated once this many occluders were found hidden by tiles but not by the
/// pyramid: then the update costs less than it saves.
const MISSED: usize = 32;

/// A hierarchical z-buffer.
///
/// Its size is independent of that of the picture that is drawn; its shape should be that of the view. Until
/// the first [`begin`](OcclusionMap::begin) nothing is hidden. Occluders that a
/// [clip plane](View::with_clip_planes) cuts are not drawn.
///
/// Memory is 4 bytes for each pixel and 48 bytes for each convex occluder that a frame draws, kept from frame
/// to frame. A frame allocates only if it draws more convex occluders, or a larger mesh, than any frame
/// before.
///
/// ```
/// use visibility_core::{
///     glam::{Affine3A, DVec3}, occlusion::Occlusion, Aabb, OccluderMesh, OcclusionMap, Pose,
///     View,
/// };
/// use visibility_hzb::Hzb;
/// let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
/// let view = View::perspective(pose, 1.0, 16.0 / 9.0, 0.1, f64::INFINITY)?;
/// let wall = OccluderMesh::cuboid(&Aabb::from_arrays([5.0, -4.0, -4.0], [5.2, 4.0, 4.0]))?;
/// let mut hzb = Hzb::new(320, 180)?;
/// hzb.begin(&view, DVec3::ZERO);
/// hzb.add(&wall, &Affine3A::IDENTITY);
/// hzb.flush();
/// assert_eq!(hzb.test(&Aabb::from_arrays([8.0, -1.0, -1.0], [9.0, 1.0, 1.0])), Occlusion::Hidden);
/// assert_ne!(hzb.test(&Aabb::from_arrays([3.0, -1.0, -1.0], [4.0, 1.0, 1.0])), Occlusion::Hidden);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct Hzb {
    /// Columns and rows of pixels.
    size: [usize; 2],
    coverage: Coverage,
    pub(crate) simd: Simd,
    projection: ScreenProjection,
    pub(crate) projection32: ScreenProjection32,
    faces: FacePlaneSetup,
    pub(crate) tiles: Tiles,
    pyramid: Pyramid,
    /// Memory for one convex mesh.
    convex_scratch: ConvexScratch,
    /// The shape that was made last.
    shape: ScreenShape,
    /// Boxes that wait to be drawn.
    queue: BoxQueue,
    mesh_scratch: MeshScratch,
    contour_tiles: ContourTiles,
    /// Occluders that tiles hid and the pyramid did not, since its last update.
    missed: usize,
    /// Upper bound on all depth keys in the buffer.
    pub(crate) nearest: f32,
    /// Clip planes of the frame's view, relative to the scene's origin.
    clip_planes: ViewPlanes,
}

impl Default for Hzb {
    /// 512 x 288 pixels: enough for small objects, and cheap.
    fn default() -> Self {
        Self::sized(512, 288)
    }
}

impl Hzb {
    /// An empty buffer of `width` columns and `height` rows of pixels.
    ///
    /// # Errors
    /// [`SizeError`] if a side is not between [`MIN_SIDE`] and [`MAX_SIDE`].
    pub fn new(width: usize, height: usize) -> Result<Self, SizeError> {
        let allowed = MIN_SIDE..=MAX_SIDE;
        if !allowed.contains(&width) || !allowed.contains(&height) {
            return Err(SizeError { width, height });
        }
        Ok(Self::sized(width, height))
    }

    /// As [`new`](Self::new), of a size that is known to be in range.
    fn sized(width: usize, height: usize) -> Self {
        let tiles = Tiles::new(width, height);
        let (pyramid, contour_tiles) = (Pyramid::new(&tiles), ContourTiles::new(&tiles));
        Self {
            size: [width, height],
            coverage: Coverage::Conservative,
            simd: Simd::best(),
            projection: ScreenProjection::EMPTY,
            projection32: ScreenProjection32::default(),
            faces: FacePlaneSetup::default(),
            tiles,
            pyramid,
            convex_scratch: ConvexScratch::default(),
            shape: ScreenShape::EMPTY,
            queue: BoxQueue::EMPTY,
            mesh_scratch: MeshScratch::default(),
            contour_tiles,
            missed: 0,
            nearest: f32::NEG_INFINITY,
            clip_planes: ViewPlanes::NONE,
        }
    }

    /// The same buffer with another rule of when a pixel is covered.
    pub fn with_coverage(self, coverage: Coverage) -> Self {
        Self { coverage, ..self }
    }

    /// The same buffer, using the given instructions. Answers do not depend on them; for tests and
    /// benchmarks.
    pub fn with_simd(self, simd: Simd) -> Self {
        Self { simd, ..self }
    }

    /// Columns of pixels.
    pub fn width(&self) -> usize {
        self.size[0]
    }

    /// Rows of pixels.
    pub fn height(&self) -> usize {
        self.size[1]
    }

    /// The rule of when a pixel is covered.
    pub fn coverage(&self) -> Coverage {
        self.coverage
    }

    /// Lower bound on the depth keys of the occluders that cover a pixel; greater is nearer. Negative
    /// infinity if none is known to cover it, or if the pixel is outside the buffer.
    ///
    /// For perspective views the key is `1 / w`: one over the distance along the viewing direction, for a
    /// clip matrix whose `w` is that distance. The matrix's factor does not matter, up to the power of two
    /// nearest to it. For parallel views the key is clip depth, negated unless depth is reversed.
    pub fn depth_key(&self, column: usize, row: usize) -> f32 {
        if column < self.size[0] && row < self.size[1] {
            self.tiles.pixel_closely(column, row)
        } else {
            f32::NEG_INFINITY
        }
    }

    /// Number of levels of the pyramid: tiles of 8 x 8 pixels, then each half the size of the one before,
    /// down to one texel.
    pub fn levels(&self) -> usize {
        self.pyramid.height() + 1
    }

    /// Columns, rows and texels of a level of the pyramid, row by row, as of the last
    /// [`flush`](OcclusionMap::flush). A texel is the least depth key of its pixels. `None` beyond the last
    /// level.
    pub fn level(&self, level: usize) -> Option<(usize, usize, &[f32])> {
        match level {
            0 => {
                let (columns, rows) = (self.tiles.columns, self.tiles.rows);
                Some((columns, rows, &self.tiles.tile_min[..columns * rows]))
            }
            _ => self.pyramid.level(level - 1),
        }
    }

    /// All that tests read.
    fn query(&self) -> BoxQuery<'_> {
        let (projection, tiles, pyramid, faces) =
            (&self.projection32, &self.tiles, &self.pyramid, &self.faces);
        BoxQuery { projection, tiles, pyramid, faces, nearest: self.nearest }
    }

    /// Queues a box; draws the queue if it is full.
    fn push_box(&mut self, cuboid: &OccluderMesh, transform: &Affine3A) {
        if self.queue.push(cuboid.bounds(), transform, cuboid.is_two_sided()) {
            self.draw_queue();
        }
    }

    /// Whether the box around an occluder may be in view and is not hidden yet.
    fn may_be_around(&self, occluder: &OccluderMesh, transform: &Affine3A) -> bool {
        let around = BoxQueue::around(occluder.bounds(), transform);
        let ([x0, y0, z0], [x1, y1, z1]) = (around.min.to_array(), around.max.to_array());
        self.simd.box_may_be_seen(&self.projection32, &self.tiles, [x0, y0, z0, x1, y1, z1])
    }

    /// Draws an occluder that is no box.
    fn draw_occluder(&mut self, mesh: &OccluderMesh, transform: &Affine3A) {
        self.draw_mesh(&OccluderTriangles::of(mesh), mesh.bounds(), transform, mesh.is_convex());
    }

    /// Draws the boxes that wait, and empties the queue.
    fn draw_queue(&mut self) {
        let count = core::mem::take(&mut self.queue.count);
        if count == 0 {
            return;
        }
        self.simd.project_boxes(&self.projection32, &self.queue.around, &mut self.queue.projected);
        // The pyramid may be older than the tiles, which is safe: what it hides is hidden.
        let mut seen = self.simd.boxes_not_hidden(&self.pyramid, &self.tiles, &self.queue.projected, count);
        while seen != 0 {
            let i = seen.trailing_zeros() as usize % WIDTH;
            seen &= seen - 1;
            if self.simd.may_be_seen(&self.tiles, &self.queue.projected, i) {
                let (bounds, transform) = (self.queue.bounds[i], self.queue.transforms[i]);
                // The bounds in the queue are those of an axis-aligned box around it, looser unless it is not
                // transformed.
                let extent = if transform == Affine3A::IDENTITY {
                    let padded = [self.tiles.columns * SIDE, self.tiles.rows * SIDE];
                    self.queue.projected.extent(i, self.size, padded)
                } else {
                    None
                };
                self.draw_box(&bounds, &transform, extent.as_ref(), self.queue.two_sided[i]);
            } else {
                self.missed += 1;
            }
        }
        if self.missed >= MISSED {
            self.missed = 0;
            self.pyramid.update(&mut self.tiles);
        }
    }

    /// Draws a box. `extent` gives its screen bounds if they are known, and it is before the eye.
    fn draw_box(
        &mut self,
        bounds: &Aabb,
        transform: &Affine3A,
        extent: Option<&ScreenExtent>,
        two_sided: bool,
    ) {
        match self.simd.box_shape(bounds, transform, &self.projection, extent, self.coverage, &mut self.shape)
        {
            ShapeResult::Ready => self.fill(),
            ShapeResult::Nothing => {}
            ShapeResult::TooNear => {
                let corners = bounds.corners();
                self.draw_mesh(&OccluderTriangles::of_box(&corners, two_sided), bounds, transform, true);
            }
        }
    }

    /// Draws a mesh: by its outline if it is convex or looks so, else by all its triangles.
    fn draw_mesh(&mut self, mesh: &OccluderTriangles, bounds: &Aabb, transform: &Affine3A, convex: bool) {
        let Some((object, facing)) = project_object(&self.projection, bounds, transform) else { return };
        let (projection, coverage, convex_scratch) =
            (&self.projection, self.coverage, &mut self.convex_scratch);
        let convex = convex || mesh.triangles.len() == 1;
        if convex || mesh.triangles.len() <= SMALL {
            match self.simd.convex_shape(
                mesh,
                &object,
                projection,
                facing,
                coverage,
                convex,
                convex_scratch,
                &mut self.shape,
            ) {
                ShapeResult::Ready => {
                    self.fill();
                    return;
                }
                ShapeResult::Nothing => return,
                ShapeResult::TooNear => {}
            }
        }
        let (mesh_scratch, contour_tiles, tiles) =
            (&mut self.mesh_scratch, &mut self.contour_tiles, &mut self.tiles);
        let greatest = self.simd.draw_mesh(
            mesh,
            &object,
            projection,
            facing,
            coverage,
            mesh_scratch,
            contour_tiles,
            tiles,
        );
        if greatest > self.nearest {
            self.nearest = greatest;
        }
    }

    /// Fills the shape that was made last into the tiles.
    fn fill(&mut self) {
        if self.simd.fill_shape(&self.shape, &mut self.tiles) && self.shape.ceiling > self.nearest {
            self.nearest = self.shape.ceiling;
        }
    }
}

impl OcclusionMap for Hzb {
    fn name(&self) -> &str {
        "hzb"
    }

    fn accuracy(&self) -> Accuracy {
        match self.coverage {
            Coverage::Conservative => Accuracy::Conservative,
            Coverage::Sampled => Accuracy::Approximate,
        }
    }

    fn begin(&mut self, view: &View, origin: DVec3) {
        let padded = [self.tiles.columns * SIDE, self.tiles.rows * SIDE];
        self.projection = ScreenProjection::new(view, origin, self.size, padded);
        self.projection32 = ScreenProjection32::new(&self.projection);
        self.faces = FacePlaneSetup::new(&self.projection);
        self.tiles.clear();
        self.queue.count = 0;
        self.missed = 0;
        self.nearest = f32::NEG_INFINITY;
        self.clip_planes = view.clip_planes_from(origin);
        self.pyramid.clear();
    }

    fn add(&mut self, occluder: &OccluderMesh, transform: &Affine3A) {
        if !occluder.is_inside(&self.clip_planes, transform) {
            return;
        }
        if occluder.is_cuboid() {
            return self.push_box(occluder, transform);
        }
        // Boxes that came before are drawn first: they may hide this one.
        self.draw_queue();
        if !self.may_be_around(occluder, transform) {
            return;
        }
        if occluder.parts().is_empty() {
            return self.draw_occluder(occluder, transform);
        }
        for part in occluder.parts() {
            if part.is_cuboid() {
                self.push_box(part, transform);
            } else {
                self.draw_queue();
                if self.may_be_around(part, transform) {
                    self.draw_occluder(part, transform);
                }
            }
        }
    }

    fn cost(&self, occluder: &OccluderMesh) -> usize {
        let solid = occluder.solid_triangles();
        occluder.triangles().len() - solid + solid.div_ceil(OUTLINE)
    }

    fn flush(&mut self) {
        self.draw_queue();
        self.pyramid.update(&mut self.tiles);
    }

    fn test(&self, bounds: &Aabb) -> Occlusion {
        let ([x0, y0, z0], [x1, y1, z1]) = (bounds.min.to_array(), bounds.max.to_array());
        let answer = test_box(&self.query(), [x0, y0, z0, x1, y1, z1]);
        match (answer.hidden, answer.visible) {
            (0, 0) => Occlusion::Partial,
            (0, _) => Occlusion::Visible,
            _ => Occlusion::Hidden,
        }
    }

    fn test_64(&self, boxes: &Boxes64, candidates: u64) -> Occlusion64 {
        self.simd.test_boxes(&self.query(), boxes.coordinates(), candidates)
    }
}
