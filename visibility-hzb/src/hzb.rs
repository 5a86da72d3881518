//! The hierarchical z-buffer: occluders are drawn into it, and boxes are tested against it.

use crate::buffer::pyramid::Pyramid;
use crate::buffer::tile_layout::SIDE;
use crate::buffer::tiles::Tiles;
use crate::buffer_size::{MAX_SIDE, MIN_SIDE, SizeError};
use crate::coverage::Coverage;
use crate::lanes::WIDTH;
use crate::level::{DrawnObjects, LevelFrame, LevelRaster, PreparedLevel, sides};
use crate::query::BoxQuery;
use crate::query::box_face_planes::FacePlaneSetup;
use crate::query::box_projection::ScreenProjection32;
use crate::query::box_query::test_box;
use crate::query::box_queue::BoxQueue;
use crate::raster::contour_raster::ContourTiles;
use crate::raster::mesh_raster::MeshScratch;
use crate::raster::parallax::Parallax;
use crate::setup::box_join::BoxJoin;
use crate::setup::convex_shape::ConvexScratch;
use crate::setup::occluder_triangles::OccluderTriangles;
use crate::setup::screen_projection::{ScreenProjection, project_object};
use crate::setup::screen_shape::{ScreenExtent, ScreenShape, ShapeResult};
use crate::simd_dispatch::Kernels;
use alloc::sync::Arc;
use alloc::vec::Vec;
use visibility_core::glam::{Affine3A, DVec3};
use visibility_core::jobs::Jobs;
use visibility_core::view::{PictureMargin, ViewPlanes, ViewRegion};
use visibility_core::{
    Aabb, Accuracy, ObjectId, OccluderMesh, OcclusionMap, Scene, View,
    culler::Lack,
    occlusion::{Occlusion, Occlusion64, occluders_with_seams},
    scene::{Boxes64, lanes},
    simd::Simd,
};
use visibility_occluders::LevelOccluders;

/// Maximum number of triangles of a mesh that is tested for looking convex from the eye, in order to be drawn
/// by its outline. Up to this number, the test costs less than drawing the triangles.
const MAX_OUTLINE_TRIANGLES: usize = 24;

/// Divisor in the cost of an occluder: six triangles of convex parts count as one triangle of other meshes,
/// since convex parts are drawn by their outlines. A box with 12 triangles counts as two.
const OUTLINE_COST_DIVISOR: usize = 6;

/// Number of occluders found hidden by the tiles but missed by the older pyramid, after which the pyramid is
/// updated even between flushes. From this number on, the update costs less than it saves.
const MAX_PYRAMID_MISSES: usize = 32;

/// Default of [`Hzb::with_min_polygon_area`], in pixels of the buffer. In all but one of the real levels
/// measured, drawing smaller polygons costs more than the objects that they hide, counted by the default
/// [price](visibility_core::OcclusionCuller::with_price) of an object.
const MIN_POLYGON_AREA: f32 = 128.0;

/// A hierarchical z-buffer: an [`OcclusionMap`] of tiles of 8 x 8 pixels with a pyramid of least depth keys
/// above.
///
/// The size of the buffer is independent of that of the rendered picture; its aspect ratio should be that of
/// the view. Until the first [`begin`](OcclusionMap::begin) the buffer hides nothing. Occluders that a [clip
/// plane](View::with_clip_planes) cuts are not drawn.
///
/// Memory is 32 KiB, 4 bytes for each pixel, and 48 bytes for each convex occluder that a frame draws (at
/// most 240 for a box). [Levels](Self::add_level) take 2 KB each, 15 to 30 bytes for each of their objects,
/// and 4 bytes for each edge of the levels in view; for frames on several threads 6 KB each and 8 bytes for
/// each edge. Memory is kept from frame to frame. A frame allocates only if it draws more convex occluders,
/// or a larger mesh, or has more levels, or levels with more edges in view, than any frame before.
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
    /// Width and height of the buffer in pixels.
    size: [usize; 2],
    /// Rule that decides which pixels an occluder covers.
    coverage: Coverage,
    /// Instruction set of the inner loops.
    pub(crate) simd: Simd,
    /// Projection of the current view in `f64`, for occluders.
    projection: ScreenProjection,
    /// Projection of the current view in `f32`, for tested boxes.
    pub(crate) projection32: ScreenProjection32,
    /// Precomputed terms of the current view, with which the planes of a tested box's faces give bounds on
    /// the box's depth keys.
    faces: FacePlaneSetup,
    /// Covered pixels and depth keys of all tiles.
    pub(crate) tiles: Tiles,
    /// Pyramid of least depth keys (greater is nearer) above the tiles. May be older than `tiles`, which is
    /// conservative.
    pyramid: Pyramid,
    /// Scratch memory for the set-up of one convex mesh.
    convex_scratch: ConvexScratch,
    /// Screen shape of the occluder that was set up last.
    shape: ScreenShape,
    /// Occluder boxes that are not drawn yet.
    queue: BoxQueue,
    /// Boxes of this frame that were in view and not hidden when they were drawn, joined where they share a
    /// face.
    join: BoxJoin,
    /// Scratch memory for the set-up of one mesh that is drawn by its triangles.
    mesh_scratch: MeshScratch,
    /// Scratch memory for the coverage of one mesh that is drawn by its triangles.
    contour_tiles: ContourTiles,
    /// Number of occluders found hidden by `tiles` although the older `pyramid` did not hide them, since the
    /// last update of the pyramid.
    pyramid_misses: usize,
    /// Upper bound on the depth keys (greater is nearer) of all drawn occluders. Negative infinity before
    /// the first.
    pub(crate) nearest: f32,
    /// Clip planes of the current view, relative to the scene's origin, with normals towards the side that
    /// is drawn. An occluder is drawn only if it lies certainly on that side of all clip planes.
    clip_planes: ViewPlanes,
    /// Layers that the current view shows. All before the first view.
    layers: u32,
    /// Occluders of levels, drawn at the beginning of each frame.
    levels: Vec<Arc<PreparedLevel>>,
    /// Objects of `levels`.
    drawn_objects: DrawnObjects,
    /// Least area of a polygon of `levels` that is drawn, in pixels of the buffer.
    min_polygon_area: f32,
    /// View of the current frame for each of `levels`. `None` for a level that cannot be drawn.
    level_frames: Vec<Option<LevelFrame>>,
    /// Scratch memory and bands for drawing `levels`.
    level_raster: LevelRaster,
    /// The ball of eyes that the frame's answers are to hold for. `None` for the eye of its view alone.
    parallax: Option<Parallax>,
    /// Space that the views of a region see outside the picture. `None` for a single view.
    margin: Option<PictureMargin>,
}

impl Default for Hzb {
    /// Creates a buffer of 512 x 288 pixels, which is cheap and fine enough for small objects.
    fn default() -> Self {
        Self::sized(512, 288)
    }
}

impl Hzb {
    /// Creates an empty buffer of `width` by `height` pixels.
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

    /// Creates an empty buffer. The caller guarantees that both sides are between [`MIN_SIDE`] and
    /// [`MAX_SIDE`].
    fn sized(width: usize, height: usize) -> Self {
        let tiles = Tiles::new(width, height);
        let (pyramid, contour_tiles) = (Pyramid::new(&tiles), ContourTiles::new(&tiles));
        Self {
            size: [width, height],
            coverage: Coverage::Conservative,
            simd: Simd::best(),
            projection: ScreenProjection::default(),
            projection32: ScreenProjection32::default(),
            faces: FacePlaneSetup::default(),
            tiles,
            pyramid,
            convex_scratch: ConvexScratch::default(),
            shape: ScreenShape::default(),
            queue: BoxQueue::EMPTY,
            join: BoxJoin::new(),
            mesh_scratch: MeshScratch::default(),
            contour_tiles,
            pyramid_misses: 0,
            nearest: f32::NEG_INFINITY,
            clip_planes: ViewPlanes::NONE,
            layers: u32::MAX,
            levels: Vec::new(),
            drawn_objects: DrawnObjects::default(),
            min_polygon_area: MIN_POLYGON_AREA,
            level_frames: Vec::new(),
            level_raster: LevelRaster::default(),
            parallax: None,
            margin: None,
        }
    }

    /// Sets the rule of which pixels an occluder covers. Call it between frames: pixels that are already
    /// drawn are kept. [`Coverage::Sampled`] makes the map approximate.
    #[must_use]
    pub fn with_coverage(self, coverage: Coverage) -> Self {
        Self { coverage, ..self }
    }

    /// Sets the least area of a polygon of a [level](Self::with_level) that is drawn, in pixels of the
    /// buffer: 128 by default. The area is estimated at the polygon's middle, and close to the eye smaller
    /// polygons may be drawn too. With 32 pixels, most levels report 1 to 8 % fewer objects, and a village
    /// with many small walls a quarter fewer, for 1.02 to 2.3 times the time. A negative number or NaN counts
    /// as 0.
    #[must_use]
    pub fn with_min_polygon_area(self, pixels: f32) -> Self {
        Self { min_polygon_area: pixels.max(0.0), ..self }
    }

    /// Sets the occluders of a level, which are drawn at the beginning of each frame. Their positions are
    /// relative to `origin`, a point of the world, also after the scene's origin has changed. They hide
    /// objects as if the level's triangles were drawn in every frame, so a level must not contain parts that
    /// move or open; those stay [occluders](visibility_core::Object::occluder) of the scene. The occluders of
    /// objects that the level [was made of](LevelOccluders::objects) are not drawn again. A view that shares
    /// no layer with one of the level's [masks](LevelOccluders::layers) leaves the level out, and draws the
    /// occluders of its objects like any others. Replaces all earlier levels; [`add_level`](Self::add_level)
    /// keeps them.
    ///
    /// Preparing takes time in proportion to the level. A frame then takes time for the clusters that are in
    /// view, large enough and not hidden. [`OcclusionMap::begin`] draws them.
    ///
    /// ```
    /// use std::sync::Arc;
    /// use visibility_core::glam::{DVec3, Vec3};
    /// use visibility_core::{Aabb, OcclusionMap, Pose, View, occlusion::Occlusion};
    /// use visibility_hzb::Hzb;
    /// use visibility_occluders::{LevelOccluders, LevelSettings, LevelTriangle};
    /// // A wall of two triangles.
    /// let corners = [[-4.0, -4.0], [4.0, -4.0], [4.0, 4.0], [-4.0, 4.0]];
    /// let [a, b, c, d] = corners.map(|[y, z]| Vec3::new(5.0, y, z));
    /// let wall = [[a, b, c], [a, c, d]].map(|corners| LevelTriangle { corners, two_sided: true });
    /// let level = LevelOccluders::new(&wall, LevelSettings::default())?;
    /// let mut hzb = Hzb::default().with_level(Arc::new(level), DVec3::ZERO);
    /// let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
    /// hzb.begin(&View::perspective(pose, 1.0, 16.0 / 9.0, 0.1, f64::INFINITY)?, DVec3::ZERO);
    /// hzb.flush();
    /// assert_eq!(hzb.test(&Aabb::from_arrays([8.0, -1.0, -1.0], [9.0, 1.0, 1.0])), Occlusion::Hidden);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn with_level(self, level: Arc<LevelOccluders>, origin: DVec3) -> Self {
        let mut with = Self { levels: Vec::new(), drawn_objects: DrawnObjects::default(), ..self };
        with.add_level(Arc::new(PreparedLevel::new(level, origin)));
        with
    }

    /// Adds the occluders of another level, such as a sector of a world that is streamed. From the next
    /// [`begin`](OcclusionMap::begin) on the clusters of all levels are drawn, the nearest first. Each level
    /// is drawn by itself, so pixels along the border between two levels may stay uncovered. Adding the same
    /// level twice changes nothing.
    ///
    /// An engine that streams sectors keeps its [`HzbCuller`](crate::HzbCuller), changes the z-buffer through
    /// `map_mut`, and runs the culler after the cullers of earlier stages
    /// ([`Culler::cull`](visibility_core::Culler::cull)).
    ///
    /// Adding takes some 50 ns for each object of the level. [`PreparedLevel::new`] takes time in proportion
    /// to the sector and may run on any thread, so an engine can prepare one sector per frame, or on another
    /// thread. A frame takes some 40 ns for each level out of view.
    ///
    /// ```
    /// use std::sync::Arc;
    /// use visibility_core::glam::{DVec3, Vec3};
    /// use visibility_hzb::{Hzb, PreparedLevel};
    /// use visibility_occluders::{LevelOccluders, LevelSettings, LevelTriangle};
    /// let corners = [Vec3::ZERO, Vec3::new(8.0, 0.0, 0.0), Vec3::new(8.0, 0.0, 3.0)];
    /// let wall = [LevelTriangle { corners, two_sided: true }];
    /// let sector = Arc::new(LevelOccluders::new(&wall, LevelSettings::default())?);
    /// let place = DVec3::new(1e6, 0.0, 0.0);
    /// let prepared = std::thread::spawn(move || Arc::new(PreparedLevel::new(sector, place)));
    /// let prepared = prepared.join().unwrap();
    /// let mut hzb = Hzb::default();
    /// hzb.add_level(prepared.clone());
    /// // Some frames later, the player has left the sector.
    /// assert!(hzb.remove_level(&prepared));
    /// # Ok::<(), visibility_occluders::LevelOccludersError>(())
    /// ```
    pub fn add_level(&mut self, level: Arc<PreparedLevel>) {
        if !self.levels.iter().any(|own| Arc::ptr_eq(own, &level)) {
            self.drawn_objects.add(&level.level);
            self.levels.push(level);
        }
    }

    /// Removes a level that [`add_level`](Self::add_level) has added, and returns whether the level was
    /// there. From the next [`begin`](OcclusionMap::begin) on, the level hides nothing. Its memory is freed
    /// with the last `Arc`.
    pub fn remove_level(&mut self, level: &Arc<PreparedLevel>) -> bool {
        let Some(index) = self.levels.iter().position(|own| Arc::ptr_eq(own, level)) else { return false };
        self.levels.remove(index);
        self.drawn_objects.remove(&level.level);
        true
    }

    /// Sets the instruction set of the inner loops. Answers do not depend on it. For tests and benchmarks.
    #[must_use]
    pub fn with_simd(self, simd: Simd) -> Self {
        Self { simd, ..self }
    }

    /// Returns the width of the buffer in pixels.
    pub fn width(&self) -> usize {
        self.size[0]
    }

    /// Returns the height of the buffer in pixels.
    pub fn height(&self) -> usize {
        self.size[1]
    }

    /// Returns the rule that decides which pixels an occluder covers.
    pub fn coverage(&self) -> Coverage {
        self.coverage
    }

    /// Returns a lower bound on the depth key (greater is nearer) of the occluders that cover the pixel at
    /// `column` and `row`, counted from the upper left. Negative infinity if the pixel is not covered or
    /// outside the buffer.
    ///
    /// For perspective views the key is `1 / w`, where `w` is the distance along the viewing direction in the
    /// unit of the clip matrix, usually metres. The matrix is first divided by a power of two that depends on
    /// its scale, so that a clip matrix times any positive factor gives a key within a factor of 2 of this.
    /// For parallel views the key is clip depth, negated unless depth is reversed.
    pub fn depth_key(&self, column: usize, row: usize) -> f32 {
        if column < self.size[0] && row < self.size[1] {
            self.tiles.pixel_closely(column, row)
        } else {
            f32::NEG_INFINITY
        }
    }

    /// Returns the number of levels of the pyramid. Level 0 has one texel for each tile of 8 x 8 pixels. Each
    /// further level is half as wide and half as high, rounded up, down to one texel.
    pub fn levels(&self) -> usize {
        self.pyramid.height() + 1
    }

    /// Returns the columns, rows and texels (row by row from the top) of a level of the pyramid, or `None`
    /// beyond the last level. A texel is the least depth key of its pixels: negative infinity if a pixel is
    /// not covered. Levels are complete after [`flush`](OcclusionMap::flush).
    pub fn level(&self, level: usize) -> Option<(usize, usize, &[f32])> {
        match level {
            0 => {
                let (columns, rows) = (self.tiles.columns, self.tiles.rows);
                Some((columns, rows, &self.tiles.tile_min[..columns * rows]))
            }
            _ => self.pyramid.level(level - 1),
        }
    }

    /// Returns references to the parts of this z-buffer that a test of boxes reads: projection, tiles,
    /// pyramid and depth bounds.
    fn query(&self) -> BoxQuery<'_> {
        let (projection, tiles, pyramid, faces) =
            (&self.projection32, &self.tiles, &self.pyramid, &self.faces);
        BoxQuery { projection, tiles, pyramid, faces, nearest: self.nearest }
    }

    /// Queues a box for drawing. `transform` maps the box's own coordinates to the scene. Draws the queue
    /// when it is full.
    fn push_box(&mut self, cuboid: &OccluderMesh, transform: &Affine3A) {
        if self.queue.push(cuboid.bounds(), transform, cuboid.is_two_sided()) {
            self.draw_queue();
        }
    }

    /// Returns whether an occluder may cover pixels that are not covered by nearer occluders yet, judged by
    /// the axis-aligned box around the occluder. `bounds` are in the occluder's own coordinates, which
    /// `transform` maps to the scene. True if undecided.
    fn may_be_around(&self, bounds: &Aabb, transform: &Affine3A) -> bool {
        let around = BoxQueue::around(bounds, transform);
        let ([x0, y0, z0], [x1, y1, z1]) = (around.min.to_array(), around.max.to_array());
        self.simd.box_may_be_seen(&self.projection32, &self.tiles, [x0, y0, z0, x1, y1, z1])
    }

    /// Draws an occluder that is not a box. `transform` maps its own coordinates to the scene.
    fn draw_occluder(&mut self, mesh: &OccluderMesh, transform: &Affine3A) {
        self.draw_mesh(&OccluderTriangles::of(mesh), mesh.bounds(), transform, mesh.is_convex());
    }

    /// Draws the queued boxes that are in view and not hidden by drawn occluders, and empties the queue.
    /// Boxes that share a face, with one another or with boxes drawn before, are drawn as the one box that
    /// they form.
    fn draw_queue(&mut self) {
        let count = core::mem::take(&mut self.queue.count);
        if count == 0 {
            return;
        }
        self.simd.project_boxes(&self.projection32, &self.queue.around, &mut self.queue.projected);
        // A pyramid older than the tiles is conservative: boxes that it hides are hidden.
        let mut seen = self.simd.boxes_not_hidden(&self.pyramid, &self.tiles, &self.queue.projected, count);
        let first_added = self.join.boxes.len();
        let mut numbers = [usize::MAX; WIDTH];
        for i in 0..count {
            // A box that the near plane may cut is not joined. It hides little itself, but its neighbour's
            // side that faces it occludes.
            let queue = &self.queue;
            if seen >> i & 1 != 0 && queue.projected.known[i] && queue.projected.uncut[i] {
                numbers[i] = self.join.add(&queue.bounds[i], &queue.transforms[i], queue.two_sided[i]);
            }
        }
        while seen != 0 {
            let i = seen.trailing_zeros() as usize % WIDTH;
            seen &= seen - 1;
            if self.join.boxes.get(numbers[i]).is_some_and(|joined| joined.is_replaced) {
                continue;
            }
            if self.simd.may_be_seen(&self.tiles, &self.queue.projected, i) {
                let (bounds, transform) = (self.queue.bounds[i], self.queue.transforms[i]);
                // The queue holds the screen bounds of the axis-aligned box around the transformed box. They
                // are tight only for the identity transform.
                let extent = if transform == Affine3A::IDENTITY {
                    let padded = [self.tiles.columns * SIDE, self.tiles.rows * SIDE];
                    self.queue.projected.extent(i, self.size, padded)
                } else {
                    None
                };
                self.draw_box(&bounds, &transform, extent.as_ref(), self.queue.two_sided[i]);
            } else {
                self.pyramid_misses += 1;
            }
        }
        for number in first_added..self.join.boxes.len() {
            let joined = self.join.boxes[number];
            let is_added = numbers[..count].contains(&number);
            if !joined.is_replaced && !is_added && self.may_be_around(&joined.bounds, &joined.transform) {
                self.draw_box(&joined.bounds, &joined.transform, None, joined.two_sided);
            }
        }
        if self.pyramid_misses >= MAX_PYRAMID_MISSES {
            self.pyramid_misses = 0;
            self.pyramid.update(&mut self.tiles);
        }
    }

    /// Draws a box. `bounds` are in the box's own coordinates, which `transform` maps to the scene. `extent`
    /// holds the screen bounds of the box (rounded outwards, so the box lies within) if they are known, which
    /// implies that the whole box is in front of the eye. `two_sided` tells whether the inner sides of its
    /// faces hide too.
    fn draw_box(
        &mut self,
        bounds: &Aabb,
        transform: &Affine3A,
        extent: Option<&ScreenExtent>,
        two_sided: bool,
    ) {
        if self.parallax.is_some() {
            let corners = bounds.corners();
            return self.draw_mesh(&OccluderTriangles::of_box(&corners, two_sided), bounds, transform, true);
        }
        match self.simd.box_shape(bounds, transform, &self.projection, extent, self.coverage, &mut self.shape)
        {
            ShapeResult::Ready => self.fill(),
            ShapeResult::Nothing => {}
            ShapeResult::DrawAsMesh => {
                let corners = bounds.corners();
                self.draw_mesh(&OccluderTriangles::of_box(&corners, two_sided), bounds, transform, true);
            }
        }
    }

    /// Draws a mesh: by its outline if it is `convex` or looks convex from the eye, else by its triangles.
    /// `bounds` contains all vertices, in the mesh's own coordinates, which `transform` maps to the scene.
    fn draw_mesh(&mut self, mesh: &OccluderTriangles, bounds: &Aabb, transform: &Affine3A, convex: bool) {
        let Some((object, facing)) = project_object(&self.projection, bounds, transform) else { return };
        let (projection, coverage, convex_scratch) =
            (&self.projection, self.coverage, &mut self.convex_scratch);
        // Filling a convex outline is cheaper than filling a contour. The test whether a mesh looks convex
        // compares every edge with every vertex, so it pays for few triangles only.
        let convex = convex || mesh.triangles.len() == 1;
        // A shape has no place for the parallax of its outline.
        let has_shape = self.parallax.is_none();
        if has_shape && (convex || mesh.triangles.len() <= MAX_OUTLINE_TRIANGLES) {
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
                ShapeResult::DrawAsMesh => {}
            }
        }
        // Any other mesh is filled by its contour, with the depth keys of its triangles.
        let (mesh_scratch, contour_tiles, tiles) =
            (&mut self.mesh_scratch, &mut self.contour_tiles, &mut self.tiles);
        let greatest = self.simd.draw_mesh(
            mesh,
            &object,
            projection,
            facing,
            coverage,
            self.parallax.as_ref(),
            mesh_scratch,
            contour_tiles,
            tiles,
        );
        if greatest > self.nearest {
            self.nearest = greatest;
        }
    }

    /// Fills the screen shape `self.shape` into the tiles. If a tile may have changed, raises `self.nearest`
    /// to at least the shape's greatest depth key.
    fn fill(&mut self) {
        if self.simd.fill_shape(&self.shape, &mut self.tiles) && self.shape.ceiling > self.nearest {
            self.nearest = self.shape.ceiling;
        }
    }

    /// Empties the buffer for a frame of `view`, and draws the levels, as
    /// [`begin_within`](OcclusionMap::begin_within) does.
    fn begin_frame(&mut self, view: &View, origin: DVec3, work: f32, jobs: Option<&dyn Jobs>) -> f32 {
        let padded = [self.tiles.columns * SIDE, self.tiles.rows * SIDE];
        self.projection = ScreenProjection::new(view, origin, self.size, padded);
        self.projection32 = ScreenProjection32::new(&self.projection);
        self.faces = FacePlaneSetup::new(&self.projection);
        self.tiles.clear();
        self.queue.count = 0;
        self.join.clear();
        self.pyramid_misses = 0;
        self.nearest = f32::NEG_INFINITY;
        self.clip_planes = view.clip_planes_from(origin);
        self.layers = view.layers();
        self.pyramid.clear();
        if work > 0.0 && !self.levels.is_empty() {
            let sides = sides(&self.projection, [0, self.tiles.columns]);
            let frames = self.levels.iter().map(|level| {
                let is_in_view = level.is_on(view.layers()) && level.is_in_view(&sides, origin);
                let frame =
                    || LevelFrame::new(view, level, self.size, padded, self.coverage, self.min_polygon_area);
                is_in_view.then(frame).flatten()
            });
            self.level_frames.clear();
            self.level_frames.extend(frames);
            let (levels, frames) = (&self.levels, &self.level_frames);
            let (raster, tiles) = (&mut self.level_raster, &mut self.tiles);
            let spent;
            (self.nearest, spent) = raster.draw(self.simd, levels, frames, work, jobs, tiles);
            self.pyramid.update(&mut self.tiles);
            return spent;
        }
        0.0
    }

    /// Takes back that boxes are hidden which a view of the frame's region may see outside the picture.
    fn reveal_beside_picture(&self, boxes: &Boxes64, mut answer: Occlusion64) -> Occlusion64 {
        if let Some(margin) = &self.margin {
            for lane in lanes(answer.hidden) {
                answer.hidden &= !(u64::from(margin.may_meet(&boxes.get(lane))) << lane);
            }
        }
        answer
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
        self.begin_within(view, origin, f32::INFINITY, None);
    }

    fn begin_within(&mut self, view: &View, origin: DVec3, work: f32, jobs: Option<&dyn Jobs>) -> f32 {
        (self.parallax, self.margin) = (None, None);
        self.begin_frame(view, origin, work, jobs)
    }

    /// Draws for a ball of eyes: an occluder covers no pixel at which its outline appears from some eye of
    /// the ball (`raster/parallax.rs`). `None` for [`Coverage::Sampled`], and for a buffer with a
    /// [level](Hzb::with_level), whose polygons have no such borders.
    fn begin_region(
        &mut self,
        region: &ViewRegion,
        origin: DVec3,
        work: f32,
        jobs: Option<&dyn Jobs>,
    ) -> Option<f32> {
        if self.coverage != Coverage::Conservative || !self.levels.is_empty() {
            return None;
        }
        let own = self.begin_frame(region.picture(), origin, work, jobs);
        self.parallax = Some(Parallax::new(&self.projection, region.radius()));
        self.margin = Some(region.margin(origin));
        Some(own)
    }

    fn add(&mut self, occluder: &OccluderMesh, transform: &Affine3A) {
        if !occluder.is_inside(&self.clip_planes, transform) {
            return;
        }
        if occluder.is_cuboid() {
            return self.push_box(occluder, transform);
        }
        // Queued boxes are drawn first, since they may hide this occluder.
        self.draw_queue();
        if !self.may_be_around(occluder.bounds(), transform) {
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
                if self.may_be_around(part.bounds(), transform) {
                    self.draw_occluder(part, transform);
                }
            }
        }
    }

    fn cost(&self, occluder: &OccluderMesh) -> usize {
        let solid = occluder.solid_triangles();
        occluder.triangles().len() - solid + solid.div_ceil(OUTLINE_COST_DIVISOR)
    }

    fn has_level(&self) -> bool {
        self.levels.iter().any(|prepared| !prepared.level.polygons().is_empty())
    }

    fn draws(&self, object: ObjectId) -> bool {
        self.drawn_objects.contains(object, self.layers)
    }

    fn flush(&mut self) {
        self.draw_queue();
        self.pyramid.update(&mut self.tiles);
    }

    fn test(&self, bounds: &Aabb) -> Occlusion {
        let ([x0, y0, z0], [x1, y1, z1]) = (bounds.min.to_array(), bounds.max.to_array());
        let answer = test_box(&self.query(), [x0, y0, z0, x1, y1, z1]);
        match (answer.hidden, answer.visible) {
            (1.., _) if self.margin.as_ref().is_some_and(|margin| margin.may_meet(bounds)) => {
                Occlusion::Partial
            }
            (0, 0) => Occlusion::Partial,
            (0, _) => Occlusion::Visible,
            _ => Occlusion::Hidden,
        }
    }

    fn test_64(&self, boxes: &Boxes64, candidates: u64) -> Occlusion64 {
        let answer = self.simd.test_boxes(&self.query(), boxes.coordinates(), candidates);
        self.reveal_beside_picture(boxes, answer)
    }

    fn shared(&self) -> Option<&(dyn OcclusionMap + Sync)> {
        Some(self)
    }

    /// Reports occluders without a usable mesh. If no [level](Hzb::with_level) has polygons, also reports a
    /// scene without occluders, and occluders whose surface a neighbouring occluder continues, since pixels
    /// along their common border stay uncovered.
    fn for_each_lack(&self, scene: &Scene, each: &mut dyn FnMut(Lack)) {
        Lack::of_occluders(scene, each);
        if !self.has_level() {
            Lack::of_no_occluder(scene, each);
            let count = occluders_with_seams(scene);
            if count > 0 {
                each(Lack {
                    what: "occluders with a seam to the next, which a level (with_level) closes",
                    count,
                });
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use visibility_core::glam::Vec3;
    use visibility_core::view::Reach;
    use visibility_core::{Object, Pose};
    use visibility_occluders::{LevelSettings, LevelTriangle};

    fn view() -> View {
        let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
        View::perspective(pose, 1.0, 2.0, 0.1, f64::INFINITY).unwrap()
    }

    /// Returns the number of covered pixels of a buffer.
    fn covered(hzb: &Hzb) -> usize {
        let pixels = (0..hzb.height()).flat_map(|row| (0..hzb.width()).map(move |column| [column, row]));
        pixels.filter(|&[column, row]| hzb.depth_key(column, row) > f32::NEG_INFINITY).count()
    }

    /// Returns a level of a wall that fills the picture, of an object on one layer of a scene.
    fn level(layers: u32) -> Arc<LevelOccluders> {
        let corners = [[-99.0, -99.0], [99.0, -99.0], [99.0, 99.0], [-99.0, 99.0]];
        let [a, b, c, d] = corners.map(|[y, z]| Vec3::new(5.0, y, z));
        let mut scene = Scene::new();
        let bounds = Aabb::from_arrays([5.0, -99.0, -99.0], [5.0, 99.0, 99.0]);
        let id = scene.insert(Object { occluder: true, layers, ..Object::new(bounds) });
        scene.set_triangles(id, [[a, b, c], [a, c, d]]).unwrap();
        Arc::new(LevelOccluders::of_scene(&scene, |_| true, LevelSettings::default()).unwrap())
    }

    #[test]
    fn sides_beyond_the_limits_are_refused() {
        for (side, is_allowed) in
            [(MIN_SIDE - 1, false), (MIN_SIDE, true), (MAX_SIDE, true), (MAX_SIDE + 1, false)]
        {
            assert_eq!(Hzb::new(side, 64).is_ok(), is_allowed, "a width of {side}");
            assert_eq!(Hzb::new(64, side).is_ok(), is_allowed, "a height of {side}");
        }
        for (pixels, area) in [(32.0, 32.0), (-1.0, 0.0), (f32::NAN, 0.0)] {
            let hzb = Hzb::default().with_min_polygon_area(pixels);
            assert_eq!(hzb.min_polygon_area, area, "an area of {pixels}");
        }
    }

    /// Tiles reach beyond the right and the lower side of a picture whose sides are no multiples of eight.
    #[test]
    fn pixels_beyond_the_picture_are_not_covered() {
        let mut hzb = Hzb::new(60, 28).unwrap();
        hzb.begin(&view(), DVec3::ZERO);
        let wall = Aabb::from_arrays([5.0, -99.0, -99.0], [6.0, 99.0, 99.0]);
        hzb.add(&OccluderMesh::cuboid(&wall).unwrap(), &Affine3A::IDENTITY);
        hzb.flush();
        for (column, row, is_covered) in
            [(0, 0, true), (59, 27, true), (60, 5, false), (61, 5, false), (5, 28, false), (5, 29, false)]
        {
            let key = hzb.depth_key(column, row);
            assert_eq!(key > f32::NEG_INFINITY, is_covered, "the pixel at {column}, {row}");
        }
    }

    /// What is nearer than the last occluder that is drawn may be behind an earlier one.
    #[test]
    fn boxes_behind_a_near_wall_are_hidden_after_a_far_wall_is_drawn() {
        let mut hzb = Hzb::new(64, 32).unwrap();
        hzb.begin(&view(), DVec3::ZERO);
        for (x, y) in [(5.0, 0.5), (50.0, -99.0)] {
            let wall = Aabb::from_arrays([x, y, -99.0], [x + 1.0, y + 98.0, 99.0]);
            hzb.add(&OccluderMesh::cuboid(&wall).unwrap(), &Affine3A::IDENTITY);
            hzb.flush();
        }
        let behind = |x: f32, y: f32| hzb.test(&Aabb::from_arrays([x, y, -1.0], [x + 1.0, y + 1.0, 1.0]));
        assert_eq!(behind(10.0, 3.0), Occlusion::Hidden, "behind the near wall, before the far one");
        assert_eq!(behind(80.0, -30.0), Occlusion::Hidden, "behind the far wall");
        assert_ne!(behind(10.0, -3.0), Occlusion::Hidden, "beside the near wall, before the far one");
    }

    /// From a ball of eyes, convex solids and boxes cover less than from one eye: their outlines move.
    #[test]
    fn solids_cover_less_for_a_region() {
        let corners =
            [[5.0, -2.0, -1.0], [5.0, 2.0, -1.0], [5.0, 0.0, 2.0], [7.0, 0.0, 0.0]].map(Vec3::from_array);
        let faces = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]];
        let solid = OccluderMesh::from_indexed(&corners, &faces).unwrap();
        assert!(solid.is_convex() && !solid.is_cuboid(), "a tetrahedron");
        let wall = OccluderMesh::cuboid(&Aabb::from_arrays([5.0, -2.0, -1.0], [6.0, 2.0, 1.0])).unwrap();
        let region = ViewRegion::around(&view(), Reach::new(0.5, 0.0)).unwrap();
        for mesh in [solid, wall] {
            let mut counts = [0; 2];
            for (count, radius) in counts.iter_mut().zip([None, Some(region)]) {
                let mut hzb = Hzb::new(128, 64).unwrap();
                match &radius {
                    Some(region) => assert!(
                        hzb.begin_region(region, DVec3::ZERO, 1.0, None).is_some(),
                        "a conservative buffer without a level draws for a region"
                    ),
                    None => hzb.begin(region.picture(), DVec3::ZERO),
                }
                hzb.add(&mesh, &Affine3A::IDENTITY);
                hzb.flush();
                *count = covered(&hzb);
            }
            assert!(counts[1] > 20 && counts[1] * 5 < counts[0] * 4, "{counts:?} pixels");
        }
    }

    /// Buffers whose answers do not hold for a region draw for none.
    #[test]
    fn sampled_buffers_and_those_with_a_level_draw_for_no_region() {
        let region = ViewRegion::around(&view(), Reach::new(0.5, 0.1)).unwrap();
        let sampled = Hzb::default().with_coverage(Coverage::Sampled);
        let with_level = Hzb::default().with_level(level(u32::MAX), DVec3::ZERO);
        for (what, mut hzb) in [("sampled", sampled), ("with a level", with_level)] {
            assert_eq!(hzb.begin_region(&region, DVec3::ZERO, 1.0, None), None, "{what}");
        }
    }

    /// A level is drawn only in views that show its objects.
    #[test]
    fn levels_are_drawn_on_their_layers() {
        for (layers, is_drawn) in [(0b01, true), (0b11, true), (0b10, false)] {
            let mut hzb = Hzb::new(64, 32).unwrap().with_level(level(0b01), DVec3::ZERO);
            hzb.begin(&view().with_layers(layers), DVec3::ZERO);
            hzb.flush();
            assert_eq!(covered(&hzb), if is_drawn { 64 * 32 } else { 0 }, "a view of layers {layers:b}");
        }
    }

    #[test]
    fn a_scene_without_seams_reports_none() {
        let mut scene = Scene::new();
        let bounds = Aabb::from_arrays([5.0; 3], [6.0; 3]);
        let id = scene.insert(Object { occluder: true, ..Object::new(bounds) });
        let mesh = scene.add_mesh(OccluderMesh::cuboid(&bounds).unwrap());
        scene.set_mesh(id, mesh, Affine3A::IDENTITY).unwrap();
        let mut lacks = Vec::new();
        Hzb::default().for_each_lack(&scene, &mut |lack| lacks.push(lack));
        assert!(lacks.is_empty(), "{lacks:?}");
    }

    /// The triangles of a level need no scene.
    #[test]
    fn levels_out_of_view_cover_nothing() {
        let corners = [Vec3::new(-5.0, -9.0, 9.0), Vec3::new(-5.0, 9.0, 9.0), Vec3::new(-5.0, 0.0, -9.0)];
        let behind = [LevelTriangle { corners, two_sided: true }];
        let behind = Arc::new(LevelOccluders::new(&behind, LevelSettings::default()).unwrap());
        let mut hzb = Hzb::new(64, 32).unwrap().with_level(behind, DVec3::ZERO);
        hzb.begin(&view(), DVec3::ZERO);
        hzb.flush();
        assert_eq!(covered(&hzb), 0, "a wall behind the eye");
    }
}
