//! The map: occluders in, boxes out.

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
use visibility_core::{
    Aabb, Accuracy, Boxes64, OccluderMesh, Occlusion, Occlusion64, OcclusionMap, Plane, Simd, View,
};

/// Meshes of so few triangles are looked at for whether they are convex as seen: the outline of a house without a floor is found sooner than its
/// triangles are drawn.
const SMALL: usize = 24;

/// So many triangles of convex solids cost as much as one of other meshes, since solids are drawn by their outlines: a box as much as two.
const OUTLINE: usize = 6;

/// The pyramid is brought up to date while occluders arrive once so many of them were found hidden by the tiles alone: then it has cost less
/// than it will save.
const MISSED: usize = 32;

/// A hierarchical z-buffer.
///
/// Its size is its own, whatever the size of the picture that is drawn; it should have the shape of the view. Memory is 4 bytes a
/// pixel and 48 bytes for each convex occluder that a frame draws, kept from frame to frame.
///
/// ```
/// use visibility_core::{glam::{Affine3A, DVec3}, Aabb, Occlusion, OccluderMesh, OcclusionMap, Pose, View};
/// use visibility_hzb::Hzb;
/// let view = View::perspective(Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z), 1.0, 16.0 / 9.0, 0.1, f64::INFINITY)?;
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
    size: [usize; 2],
    coverage: Coverage,
    pub(crate) simd: Simd,
    projection: ScreenProjection,
    pub(crate) projection32: ScreenProjection32,
    faces: FacePlaneSetup,
    pub(crate) tiles: Tiles,
    pyramid: Pyramid,
    convex_scratch: ConvexScratch,
    shape: ScreenShape,
    queue: BoxQueue,
    mesh_scratch: MeshScratch,
    contour_tiles: ContourTiles,
    /// Hidden occluders that the pyramid did not find since it was last brought up to date.
    missed: usize,
    /// Depth keys that nothing in the buffer exceeds.
    pub(crate) nearest: f32,
    /// Planes that cut occluders away, relative to the scene's origin.
    clip_planes: [Plane; visibility_core::MAX_CLIP_PLANES],
    clip_plane_count: usize,
}

impl Default for Hzb {
    /// Of 512 x 288 pixels: enough for small objects, and cheap.
    fn default() -> Self {
        Self::sized(512, 288)
    }
}

impl Hzb {
    /// An empty buffer of so many columns and rows of pixels.
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
            clip_planes: [Plane::new(DVec3::ZERO, 0.0); visibility_core::MAX_CLIP_PLANES],
            clip_plane_count: 0,
        }
    }

    /// The same buffer with another rule of what is covered.
    pub fn with_coverage(self, coverage: Coverage) -> Self {
        Self { coverage, ..self }
    }

    /// The same buffer, using the given instructions: for tests and comparisons.
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

    /// The rule of what is covered.
    pub fn coverage(&self) -> Coverage {
        self.coverage
    }

    /// The least depth key of what covers a pixel: over the distance along the line of sight for perspective views (`1 / w`), clip
    /// depth (negated unless reversed) for parallel ones. Negative infinity where nothing is known to cover it, or outside the buffer.
    pub fn depth_key(&self, column: usize, row: usize) -> f32 {
        if column < self.size[0] && row < self.size[1] {
            self.tiles.pixel_closely(column, row)
        } else {
            f32::NEG_INFINITY
        }
    }

    /// The number of levels of the pyramid: tiles of 8 x 8 pixels, then each half the size of the one before, down to one texel.
    pub fn levels(&self) -> usize {
        self.pyramid.height() + 1
    }

    /// A level of the pyramid as columns, rows and least depth key of each texel, row by row; as of the last
    /// [`flush`](OcclusionMap::flush). `None` beyond the last.
    pub fn level(&self, level: usize) -> Option<(usize, usize, &[f32])> {
        match level {
            0 => {
                let (columns, rows) = (self.tiles.columns, self.tiles.rows);
                Some((columns, rows, &self.tiles.tile_min[..columns * rows]))
            }
            _ => self.pyramid.level(level - 1),
        }
    }

    fn query(&self) -> BoxQuery<'_> {
        let (projection, tiles, pyramid, faces) =
            (&self.projection32, &self.tiles, &self.pyramid, &self.faces);
        BoxQuery { projection, tiles, pyramid, faces, nearest: self.nearest }
    }

    /// Lets a box wait to be drawn.
    fn push_box(&mut self, cuboid: &OccluderMesh, transform: &Affine3A) {
        if self.queue.push(cuboid.bounds(), transform, cuboid.is_two_sided()) {
            self.draw_queue();
        }
    }

    /// Whether the box around an occluder is in view and not hidden yet.
    fn may_be_around(&self, occluder: &OccluderMesh, transform: &Affine3A) -> bool {
        let around = BoxQueue::around(occluder.bounds(), transform);
        let ([x0, y0, z0], [x1, y1, z1]) = (around.min.to_array(), around.max.to_array());
        self.simd.box_may_be_seen(&self.projection32, &self.tiles, [x0, y0, z0, x1, y1, z1])
    }

    fn draw_occluder(&mut self, mesh: &OccluderMesh, transform: &Affine3A) {
        let parts = OccluderTriangles::of(mesh);
        self.draw_mesh(&parts, mesh.bounds(), transform, mesh.is_convex());
    }

    /// Draws the boxes that wait.
    fn draw_queue(&mut self) {
        let count = core::mem::take(&mut self.queue.count);
        if count == 0 {
            return;
        }
        self.simd.project_boxes(&self.projection32, &self.queue.around, &mut self.queue.projected);
        // The pyramid may be behind the tiles, which is safe: what it hides is hidden.
        let mut seen = self.simd.boxes_not_hidden(&self.pyramid, &self.tiles, &self.queue.projected, count);
        while seen != 0 {
            let i = seen.trailing_zeros() as usize % WIDTH;
            seen &= seen - 1;
            if self.simd.may_be_seen(&self.tiles, &self.queue.projected, i) {
                let (bounds, transform) = (self.queue.bounds[i], self.queue.transforms[i]);
                // What is turned is within what was projected, which is looser.
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

    /// Draws a mesh by its outline if that loses nothing, else triangle by triangle.
    fn draw_mesh(&mut self, parts: &OccluderTriangles, bounds: &Aabb, transform: &Affine3A, convex: bool) {
        let Some((object, facing)) = project_object(&self.projection, bounds, transform) else { return };
        let (projection, coverage, convex_scratch) =
            (&self.projection, self.coverage, &mut self.convex_scratch);
        let convex = convex || parts.triangles.len() == 1;
        if convex || parts.triangles.len() <= SMALL {
            match self.simd.convex_shape(
                parts,
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
            parts,
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

    /// Fills the shape.
    fn fill(&mut self) {
        if self.simd.fill_shape(&self.shape, &mut self.tiles) && self.shape.ceiling > self.nearest {
            self.nearest = self.shape.ceiling;
        }
    }

    /// Whether an occluder reaches beyond one of the view's own planes, which would cut it.
    fn is_cut(&self, occluder: &OccluderMesh, transform: &Affine3A) -> bool {
        self.clip_planes[..self.clip_plane_count].iter().any(|plane| {
            occluder.bounds().corners().iter().any(|corner| {
                let p = transform.transform_point3(*corner).as_dvec3();
                // Far above what the transform rounds.
                let margin = 1e-5
                    * (plane.normal.abs().dot(p.abs() + transform.translation.as_dvec3().abs())
                        + plane.offset.abs());
                !(plane.signed_distance(p) > margin)
            })
        })
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
        self.clip_plane_count = view.clip_planes().len();
        let shift = origin - view.origin();
        for (out, plane) in self.clip_planes.iter_mut().zip(view.clip_planes()) {
            *out = Plane::new(plane.normal, plane.offset + plane.normal.dot(shift));
        }
        self.pyramid.clear();
    }

    fn add(&mut self, occluder: &OccluderMesh, transform: &Affine3A) {
        if self.clip_plane_count > 0 && self.is_cut(occluder, transform) {
            return;
        }
        if occluder.is_cuboid() {
            return self.push_box(occluder, transform);
        }
        // Order matters: the queue first. Then the mesh takes its place there, for the sake of the box around it.
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
