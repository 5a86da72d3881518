//! The map: occluders in, boxes out.

use crate::canvas::Cells;
use crate::cuboid::{self, Made};
use crate::faces::Faces;
use crate::fill;
use crate::lens::{Lens, Placed};
use crate::mesh::Setup;
use crate::pyramid::Pyramid;
use crate::pyramid::Rectangle;
use crate::query::{Footprints, Lens32, Query, WIDTH, project, test_one};
use crate::queue::Queue;
use crate::shape::{Coverage, Extent, Shape};
use crate::solid::{self, Scratch};
use crate::tiles::{SIDE, Tiles};
use crate::{MAX_SIDE, MIN_SIDE, Simd, SizeError};
use visibility_core::glam::{Affine3A, DVec3};
use visibility_core::{
    Aabb, Accuracy, Boxes64, OccluderMesh, Occlusion, Occlusion64, OcclusionMap, Plane, View,
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
    lens: Lens,
    pub(crate) lens32: Lens32,
    faces: Faces,
    pub(crate) tiles: Tiles,
    pyramid: Pyramid,
    scratch: Scratch,
    shape: Shape,
    queue: Queue,
    setup: Setup,
    cells: Cells,
    /// Hidden occluders that the pyramid did not find since it was last brought up to date.
    missed: usize,
    /// Nearness that nothing in the buffer exceeds.
    pub(crate) nearest: f32,
    /// Planes that cut occluders away, relative to the scene's origin.
    clip: [Plane; visibility_core::MAX_CLIP_PLANES],
    clips: usize,
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
        let (pyramid, cells) = (Pyramid::new(&tiles), Cells::new(&tiles));
        Self {
            size: [width, height],
            coverage: Coverage::Conservative,
            simd: Simd::best(),
            lens: Lens::BLIND,
            lens32: Lens32::default(),
            faces: Faces::default(),
            tiles,
            pyramid,
            scratch: Scratch::default(),
            shape: Shape::EMPTY,
            queue: Queue::EMPTY,
            setup: Setup::default(),
            cells,
            missed: 0,
            nearest: f32::NEG_INFINITY,
            clip: [Plane::new(DVec3::ZERO, 0.0); visibility_core::MAX_CLIP_PLANES],
            clips: 0,
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

    /// The least nearness of what covers a pixel: over the distance along the line of sight for perspective views (`1 / w`), clip
    /// depth (negated unless reversed) for parallel ones. Negative infinity where nothing is known to cover it, or outside the buffer.
    pub fn nearness(&self, column: usize, row: usize) -> f32 {
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

    /// A level of the pyramid as columns, rows and least nearness of each texel, row by row; as of the last
    /// [`flush`](OcclusionMap::flush). `None` beyond the last.
    pub fn level(&self, level: usize) -> Option<(usize, usize, &[f32])> {
        match level {
            0 => {
                let (columns, rows) = (self.tiles.columns, self.tiles.rows);
                Some((columns, rows, &self.tiles.whole[..columns * rows]))
            }
            _ => self.pyramid.level(level - 1),
        }
    }

    fn query(&self) -> Query<'_> {
        let (lens, tiles, pyramid, faces) = (&self.lens32, &self.tiles, &self.pyramid, &self.faces);
        Query { lens, tiles, pyramid, faces, nearest: self.nearest }
    }

    /// Lets a box wait to be drawn.
    fn push_box(&mut self, cuboid: &OccluderMesh, transform: &Affine3A) {
        if self.queue.push(cuboid.bounds(), transform, cuboid.is_two_sided()) {
            self.draw_queue();
        }
    }

    /// Whether the box around an occluder is in view and not hidden yet.
    fn may_be_around(&self, occluder: &OccluderMesh, transform: &Affine3A) -> bool {
        let around = Queue::around(occluder.bounds(), transform);
        let ([x0, y0, z0], [x1, y1, z1]) = (around.min.to_array(), around.max.to_array());
        self.simd.box_seen(&self.lens32, &self.tiles, [x0, y0, z0, x1, y1, z1])
    }

    fn draw_occluder(&mut self, mesh: &OccluderMesh, transform: &Affine3A) {
        let parts = solid::Parts::of(mesh);
        self.draw_mesh(&parts, mesh.bounds(), transform, mesh.is_convex());
    }

    /// Draws the boxes that wait.
    fn draw_queue(&mut self) {
        let count = core::mem::take(&mut self.queue.count);
        if count == 0 {
            return;
        }
        self.simd.footprints(&self.lens32, &self.queue.around, &mut self.queue.footprints);
        // The pyramid may be behind the tiles, which is safe: what it hides is hidden.
        let mut seen =
            self.simd.not_hidden_coarsely(&self.pyramid, &self.tiles, &self.queue.footprints, count);
        while seen != 0 {
            let i = seen.trailing_zeros() as usize % WIDTH;
            seen &= seen - 1;
            if self.simd.may_be_seen(&self.tiles, &self.queue.footprints, i) {
                let (bounds, transform) = (self.queue.bounds[i], self.queue.transforms[i]);
                // What is turned is within what was projected, which is looser.
                let extent = if transform == Affine3A::IDENTITY {
                    let whole = [self.tiles.columns * SIDE, self.tiles.rows * SIDE];
                    self.queue.footprints.extent(i, self.size, whole)
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

    fn draw_box(&mut self, bounds: &Aabb, transform: &Affine3A, extent: Option<&Extent>, two_sided: bool) {
        match self.simd.cuboid(bounds, transform, &self.lens, extent, self.coverage, &mut self.shape) {
            Made::Shape => self.fill(),
            Made::Nothing => {}
            Made::Near => {
                let corners = bounds.corners();
                self.draw_mesh(&solid::Parts::of_box(&corners, two_sided), bounds, transform, true);
            }
        }
    }

    /// Draws a mesh by its outline if that loses nothing, else triangle by triangle.
    fn draw_mesh(&mut self, parts: &solid::Parts, bounds: &Aabb, transform: &Affine3A, convex: bool) {
        let Some((placed, facing)) = place(&self.lens, bounds, transform) else { return };
        let (lens, coverage, scratch) = (&self.lens, self.coverage, &mut self.scratch);
        let convex = convex || parts.triangles.len() == 1;
        if convex || parts.triangles.len() <= SMALL {
            match self.simd.solid(parts, &placed, lens, facing, coverage, convex, scratch, &mut self.shape) {
                Made::Shape => {
                    self.fill();
                    return;
                }
                Made::Nothing => return,
                Made::Near => {}
            }
        }
        let (setup, cells, tiles) = (&mut self.setup, &mut self.cells, &mut self.tiles);
        let greatest = self.simd.mesh(parts, &placed, lens, facing, coverage, setup, cells, tiles);
        if greatest > self.nearest {
            self.nearest = greatest;
        }
    }

    /// Fills the shape.
    fn fill(&mut self) {
        if self.simd.fill(&self.shape, &mut self.tiles) && self.shape.ceiling > self.nearest {
            self.nearest = self.shape.ceiling;
        }
    }

    /// Whether an occluder reaches beyond one of the view's own planes, which would cut it.
    fn is_cut(&self, occluder: &OccluderMesh, transform: &Affine3A) -> bool {
        self.clip[..self.clips].iter().any(|plane| {
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
        let whole = [self.tiles.columns * SIDE, self.tiles.rows * SIDE];
        self.lens = Lens::new(view, origin, self.size, whole);
        self.lens32 = Lens32::new(&self.lens);
        self.faces = Faces::new(&self.lens);
        self.tiles.clear();
        self.queue.count = 0;
        self.missed = 0;
        self.nearest = f32::NEG_INFINITY;
        self.clips = view.clip_planes().len();
        let shift = origin - view.origin();
        for (out, plane) in self.clip.iter_mut().zip(view.clip_planes()) {
            *out = Plane::new(plane.normal, plane.offset + plane.normal.dot(shift));
        }
        self.pyramid.clear();
    }

    fn add(&mut self, occluder: &OccluderMesh, transform: &Affine3A) {
        if self.clips > 0 && self.is_cut(occluder, transform) {
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
        let answer = test_one(&self.query(), [x0, y0, z0, x1, y1, z1]);
        match (answer.hidden, answer.visible) {
            (0, 0) => Occlusion::Partial,
            (0, _) => Occlusion::Visible,
            _ => Occlusion::Hidden,
        }
    }

    fn test_64(&self, boxes: &Boxes64, candidates: u64) -> Occlusion64 {
        self.simd.test(&self.query(), boxes.coordinates(), candidates)
    }
}

/// Whether an occluder's box is in view, not tiny and not hidden yet, as far as its projection tells.
#[inline(always)]
pub(crate) fn may_be_seen<const N: usize>(tiles: &Tiles, seen: &Footprints<N>, i: usize) -> bool {
    let i = i % N;
    let rectangle = Rectangle {
        columns: [seen.sides[0][i] as u32, seen.sides[1][i] as u32],
        lines: [seen.sides[2][i] as u32, seen.sides[3][i] as u32],
    };
    // What is not wider than a pixel, rounded outwards, covers none whole.
    let small =
        rectangle.columns[1] - rectangle.columns[0] <= 1 || rectangle.lines[1] - rectangle.lines[0] <= 1;
    !seen.outside[i] && (!seen.known[i] || (!small && fill::still_seen(tiles, &rectangle, seen.nearest[i])))
}

/// Those of the first so many boxes that are neither out of view nor hidden at first glance.
#[inline(always)]
pub(crate) fn not_hidden_coarsely(
    pyramid: &Pyramid,
    tiles: &Tiles,
    boxes: &Footprints<WIDTH>,
    count: usize,
) -> u32 {
    let mut seen = 0;
    for i in 0..count.min(WIDTH) {
        let hidden = pyramid.hides_coarsely(tiles, &boxes.rectangle(i), boxes.nearest[i]);
        seen |= u32::from(!boxes.outside[i] & !(boxes.known[i] & hidden)) << i;
    }
    seen
}

/// The same, for a box that is not projected yet.
#[inline(always)]
pub(crate) fn box_seen(lens: &Lens32, tiles: &Tiles, sides: [f32; 6]) -> bool {
    let mut boxes = [[0.0; 1]; 6];
    for i in 0..6 {
        boxes[i][0] = sides[i];
    }
    may_be_seen(tiles, &project(lens, &boxes), 0)
}

/// The shape of a box, from its place on.
#[inline(always)]
pub(crate) fn make_box(
    bounds: &Aabb,
    transform: &Affine3A,
    lens: &Lens,
    extent: Option<&Extent>,
    coverage: Coverage,
    shape: &mut Shape,
) -> Made {
    match place(lens, bounds, transform) {
        Some((placed, facing)) => cuboid::make(bounds, &placed, lens, facing, extent, coverage, shape),
        None => Made::Nothing,
    }
}

/// The occluder as the lens sees it, and the sense in which its fronts turn; `None` if nothing can be said of it.
#[inline(always)]
pub(crate) fn place(lens: &Lens, bounds: &Aabb, transform: &Affine3A) -> Option<(Placed, f64)> {
    let reach = bounds.min.abs().max(bounds.max.abs()).to_array().map(f64::from);
    let placed = lens.place(transform, reach);
    let mut finite = lens.facing != 0.0;
    for i in 0..5 {
        // With room for sums of a few.
        finite &= placed.size[i] + placed.error[i] < f64::MAX / 64.0;
    }
    if *transform == Affine3A::IDENTITY {
        return finite.then_some((placed, lens.facing));
    }
    let axes = [transform.matrix3.x_axis, transform.matrix3.y_axis, transform.matrix3.z_axis];
    let [a, b, c] = axes.map(|axis| DVec3::from_array(axis.to_array().map(f64::from)));
    let (volume, most) = (
        a.dot(b.cross(c)),
        a.abs().dot(b.abs().cross(c.abs()).abs() + b.abs().max_element() * c.abs().max_element()),
    );
    // Six products of three factors, each rounded a few times. A flat transform leaves no inside and outside to tell apart.
    let certain = volume.abs() > 32.0 * f64::EPSILON * most;
    (finite && certain).then_some((placed, lens.facing * volume.signum()))
}
