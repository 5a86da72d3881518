//! The horizon as an occlusion map for core's driver.

use super::column_query::QueryEye;
use super::columns::Columns;
use super::extract::{Shape, Solid, Solids};
use super::frame::{Frame, UpAxis};
use super::occluders::solids_of_mesh;
use super::outline::Post;
use alloc::vec::Vec;
use visibility_core::glam::{Affine3A, DVec3};
use visibility_core::occlusion::{Occlusion, Occlusion64};
use visibility_core::scene::Boxes64;
use visibility_core::view::ViewPlanes;
use visibility_core::{Aabb, Accuracy, OccluderMesh, OcclusionMap, View};

/// Default number of columns of each face: 1,440 around, a quarter of a degree each. Twice as many report
/// less than a tenth fewer objects in cities and take half as long again (measured).
const DEFAULT_COLUMNS: usize = 360;

/// Largest number of columns of a face.
const MAX_COLUMNS: usize = 1 << 14;

/// Occlusion map for scenes of upright solids. For each of about a thousand directions on the plan, it stores
/// up to which height, and from which distance on, everything is hidden.
///
/// Suits cities, walls and trunks. Convex meshes and convex parts of meshes with at most 32 vertices occlude;
/// those with more hide nothing. Of other meshes, prisms without a floor and upright walls occlude, as in
/// [`HorizonOccluders`](super::HorizonOccluders). Conservative. In a parallel view nothing is hidden.
///
/// [`OcclusionCuller`](visibility_core::OcclusionCuller) can use the map over any hierarchy, and chooses
/// occluders by their cost. [`HorizonCuller`](super::HorizonCuller) uses the scene's own hierarchy and
/// prepared occluders, and is faster.
///
/// # Cost
/// Drawing an occluder takes about 0.8 us, testing a box about 40 ns. A convex mesh that is no box takes 2 us
/// with 8 vertices and 24 us with 32, since each vertex is compared with each face;
/// [`HorizonOccluders`](super::HorizonOccluders) do that once. Memory: about 40 bytes for each column of the
/// four faces.
///
/// ```
/// use visibility_2d::horizon::{Horizon, UpAxis};
/// use visibility_core::{FrustumCuller, OcclusionCuller, Pipeline};
/// let map = Horizon::new(UpAxis::Z);
/// let pipeline = Pipeline::new().with(FrustumCuller::new()).with(OcclusionCuller::new(map));
/// # let _ = pipeline;
/// ```
#[derive(Clone, Debug)]
pub struct Horizon {
    up: UpAxis,
    pub(crate) frame: Frame,
    pub(crate) eye: QueryEye,
    pub(crate) columns: Columns,
    clip_planes: ViewPlanes,
    scratch: Solids,
    /// Scratch: posts of those panels of a wall that are beyond the near plane.
    panels: Vec<Post>,
}

impl Horizon {
    /// Makes a horizon for scenes in which `up` points up, with 360 columns in each of its four faces.
    pub fn new(up: UpAxis) -> Self {
        Self {
            up,
            frame: Frame::BLIND,
            eye: QueryEye::BLIND,
            columns: Columns::new(DEFAULT_COLUMNS),
            clip_planes: ViewPlanes::NONE,
            scratch: Solids::default(),
            panels: Vec::new(),
        }
    }

    /// Sets the number of columns of each of the four faces, clamped to 1 to 16,384. More columns hide more,
    /// and take proportionally more time.
    #[must_use]
    pub fn with_columns(mut self, per_face: usize) -> Self {
        self.columns = Columns::new(per_face.clamp(1, MAX_COLUMNS));
        // The new columns belong to no frame, so nothing is hidden.
        (self.frame, self.eye) = (Frame::BLIND, QueryEye::BLIND);
        self
    }

    /// Returns the axis that points up.
    pub fn up(&self) -> UpAxis {
        self.up
    }

    /// Sets the axis that points up. If it changes, nothing is hidden until the next frame begins.
    pub(crate) fn set_up(&mut self, up: UpAxis) {
        if up != self.up {
            (self.frame, self.eye) = (Frame::BLIND, QueryEye::BLIND);
        }
        self.up = up;
    }

    /// Returns whether nothing can be hidden: before the first frame, and in frames whose eye is undecided.
    pub(crate) fn is_blind(&self) -> bool {
        !self.frame.error.is_finite()
    }

    /// Adds a solid. Does nothing if the near plane may cut it, or if the eye may be below its open bottom.
    pub(crate) fn add_solid(&mut self, solid: &Solid, posts: &[Post]) {
        let frame = &self.frame;
        let doubt = 2.0 * (frame.error + solid.error);
        // Lines of sight begin outside of a solid if all its vertices are beyond the near plane. Posts may be
        // inside of the solid, as far from the vertices as `moved`.
        let radius = solid.error + solid.moved;
        let is_beyond_near = |post: &Post| {
            let is_beyond = |height| frame.is_beyond_near([post.x, post.y, height], radius);
            is_beyond(post.low) && (post.high == post.low || is_beyond(post.high))
        };
        match solid.shape {
            Shape::Convex => {
                // The sum rounds to no less than the eye's height if it is no less exactly.
                if frame.eye[2] > solid.open_below + doubt && posts.iter().all(is_beyond_near) {
                    self.columns.draw_solid(frame, posts, solid.error);
                }
            }
            Shape::Wall { two_sided } => {
                self.panels.clear();
                for panel in posts.chunks_exact(2) {
                    if panel.iter().all(is_beyond_near) {
                        self.panels.extend_from_slice(panel);
                    }
                }
                self.columns.draw_wall(frame, &self.panels, solid.error, two_sided);
            }
        }
    }

    /// Returns whether `mesh`, placed by `transform`, is certainly inside all clip planes of the view.
    pub(crate) fn is_inside_clip_planes(&self, mesh: &OccluderMesh, transform: &Affine3A) -> bool {
        mesh.is_inside(&self.clip_planes, transform)
    }

    /// Returns whether the view has clip planes.
    pub(crate) fn has_clip_planes(&self) -> bool {
        !self.clip_planes.as_slice().is_empty()
    }
}

impl OcclusionMap for Horizon {
    fn name(&self) -> &str {
        "horizon"
    }

    fn accuracy(&self) -> Accuracy {
        Accuracy::Conservative
    }

    fn begin(&mut self, view: &View, origin: DVec3) {
        self.frame = Frame::new(view, origin, self.up);
        self.eye = QueryEye::new(&self.frame);
        self.clip_planes = view.clip_planes_from(origin);
        self.columns.begin(&self.frame);
    }

    fn add(&mut self, occluder: &OccluderMesh, transform: &Affine3A) {
        if self.is_blind() || !self.is_inside_clip_planes(occluder, transform) {
            return;
        }
        let mut scratch = core::mem::take(&mut self.scratch);
        solids_of_mesh(&mut scratch, occluder, transform, self.up);
        for solid in &scratch.solids {
            self.add_solid(solid, scratch.posts(solid));
        }
        self.scratch = scratch;
    }

    fn flush(&mut self) {}

    fn test(&self, bounds: &Aabb) -> Occlusion {
        if !bounds.is_proper() {
            return Occlusion::Visible;
        }
        if self.columns.hides_box(&self.eye, self.up.rows(), bounds) {
            Occlusion::Hidden
        } else {
            Occlusion::Partial
        }
    }

    fn test_64(&self, boxes: &Boxes64, candidates: u64) -> Occlusion64 {
        Occlusion64 {
            hidden: self.columns.hidden_64(&self.eye, self.up.rows(), boxes, candidates),
            visible: 0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use visibility_core::Pose;
    use visibility_core::glam::Vec3;

    /// A horizon of an eye at a height of 2 m that looks along x, with the near plane at 1 m.
    fn horizon() -> Horizon {
        let eye = DVec3::new(0.0, 0.0, 2.0);
        let pose = Pose::look_at(eye, eye + DVec3::X, DVec3::Z);
        let view = View::perspective(pose, 1.0, 1.0, 1.0, 1e4).unwrap();
        let mut horizon = Horizon::new(UpAxis::Z);
        horizon.begin(&view, DVec3::ZERO);
        horizon
    }

    /// Whether a box far behind is hidden.
    fn hides(horizon: &Horizon) -> bool {
        let bounds = Aabb::new(Vec3::new(500.0, -0.1, 2.0), Vec3::new(500.2, 0.1, 2.1));
        horizon.test(&bounds) == Occlusion::Hidden
    }

    fn solid(shape: Shape, error: f64, open_below: f64) -> Solid {
        Solid { shape, first: 0, count: 4, error, moved: 0.0, open_below, face: 1.0 }
    }

    /// Posts of a wall, or of a solid, whose near side is `x` metres away.
    fn posts(x: f64, [low, high]: [f64; 2]) -> [Post; 4] {
        [[x, -5.0], [x, 5.0], [x + 4.0, 5.0], [x + 4.0, -5.0]].map(|[x, y]| Post { x, y, low, high })
    }

    /// A solid that is open at the bottom hides if the eye is certainly above the bottom: by twice the error
    /// of the eye and that of the solid.
    #[test]
    fn open_solids_hide_from_eyes_above_their_bottom() {
        for (eye, own) in [(0.0, 0.0), (0.05, 0.0), (0.0, 0.05), (0.05, 0.05)] {
            for (below, is_hidden) in
                [(0.0, false), (1.9 * (eye + own), false), (0.01 + 2.1 * (eye + own), true)]
            {
                let mut horizon = horizon();
                horizon.frame.error = eye;
                horizon.add_solid(&solid(Shape::Convex, own, 2.0 - below), &posts(50.0, [-50.0, 90.0]));
                assert_eq!(hides(&horizon), is_hidden, "{below} below the eye, errors {eye} and {own}");
            }
        }
    }

    /// Solids that the near plane may cut hide nothing, nor do panels of walls: at either end of a post, and
    /// as near as their error.
    #[test]
    fn what_the_near_plane_may_cut_hides_nothing() {
        for shape in [Shape::Convex, Shape::Wall { two_sided: true }] {
            for (x, error, is_hidden) in [
                (0.9, 0.0, false),
                (1.1, 0.0, true),
                (1.019, 0.01, false),
                (1.01, 0.015, false),
                (1.04, 0.01, true),
            ] {
                let mut horizon = horizon();
                let post = |x: f64, y: f64| Post { x, y, low: -50.0, high: 90.0 };
                // A panel from a post near by, and two more behind it.
                let four = [post(x, -5.0), post(x + 99.0, 99.0), post(x + 99.0, -99.0), post(x + 99.0, 99.0)];
                let posts = if shape == Shape::Convex { &four[..] } else { &four[..2] };
                horizon.add_solid(&solid(shape, error, f64::NEG_INFINITY), posts);
                assert_eq!(hides(&horizon), is_hidden, "{shape:?} at {x}, off by {error}");
            }
        }
    }

    /// A solid whose posts are inside of it hides nothing if its vertices may be before the near plane,
    /// though its posts are beyond.
    #[test]
    fn what_the_near_plane_may_cut_before_its_posts_hides_nothing() {
        for (error, moved, is_hidden) in [
            (0.0, 0.0, true),
            (0.0, 0.49, true),
            (0.0, 0.51, false),
            (0.01, 0.48, true),
            (0.01, 0.495, false),
        ] {
            let mut horizon = horizon();
            let solid = Solid { moved, ..solid(Shape::Convex, error, f64::NEG_INFINITY) };
            horizon.add_solid(&solid, &posts(2.0, [-50.0, 90.0]));
            assert_eq!(hides(&horizon), is_hidden, "posts off by {error}, and inside by {moved}");
        }
    }

    /// A view that looks down has a near plane that the upper ends of posts meet first, and one that looks up
    /// the lower ones.
    #[test]
    fn both_ends_of_a_post_are_beyond_the_near_plane() {
        for (down, ends) in [(-1.0, [[0.0, 3.0], [0.0, 30.0]]), (1.0, [[1.0, 4.0], [-26.0, 4.0]])] {
            for ([low, high], is_hidden) in ends.into_iter().zip([true, false]) {
                let eye = DVec3::new(0.0, 0.0, 2.0);
                let pose = Pose::look_at(eye, eye + DVec3::new(1.0, 0.0, down), DVec3::Z);
                let view = View::perspective(pose, 2.0, 1.0, 1.0, 1e4).unwrap();
                let mut horizon = Horizon::new(UpAxis::Z);
                horizon.begin(&view, DVec3::ZERO);
                let four = posts(10.0, [low, high]);
                horizon.add_solid(&solid(Shape::Convex, 0.0, f64::NEG_INFINITY), &four);
                assert_eq!(hides(&horizon), is_hidden, "posts from {low} to {high}, a view along {down}");
            }
        }
    }

    #[test]
    fn a_blind_horizon_is_given_nothing() {
        let bounds = Aabb::new(Vec3::new(50.0, -9.0, 0.0), Vec3::new(51.0, 9.0, 90.0));
        let mesh = OccluderMesh::cuboid(&bounds).unwrap();
        let mut seeing = horizon();
        assert!(!seeing.is_blind(), "a perspective view");
        seeing.add(&mesh, &Affine3A::IDENTITY);
        assert!(hides(&seeing), "a tower");
        let mut blind = horizon();
        blind.frame.error = f64::INFINITY;
        assert!(blind.is_blind(), "an eye that may be anywhere");
        blind.add(&mesh, &Affine3A::IDENTITY);
        assert!(!hides(&blind), "a tower, to an eye that may be anywhere");
    }

    /// What a solid or a wall hides is lower by the error of its posts.
    #[test]
    fn errors_of_posts_lower_what_they_hide() {
        for shape in [Shape::Convex, Shape::Wall { two_sided: true }] {
            for (error, slope, is_hidden) in
                [(0.0, 0.139_5, true), (0.05, 0.139_5, false), (0.05, 0.12, true)]
            {
                let mut horizon = horizon();
                let four = posts(50.0, [-50.0, 9.0]);
                let posts = if shape == Shape::Convex { &four[..] } else { &four[..2] };
                horizon.add_solid(&solid(shape, error, f64::NEG_INFINITY), posts);
                let top = 2.0 + 500.0 * slope;
                let bounds = Aabb::new(Vec3::new(500.0, -0.1, 2.0), Vec3::new(500.2, 0.1, top));
                let found = horizon.test(&bounds) == Occlusion::Hidden;
                assert_eq!(
                    found, is_hidden,
                    "{shape:?} of slope 0.14, off by {error}; a box of slope {slope}"
                );
            }
        }
    }

    #[test]
    fn what_a_clip_plane_cuts_hides_nothing() {
        use visibility_core::geometry::Plane;
        let bounds = Aabb::new(Vec3::new(50.0, -9.0, 0.0), Vec3::new(51.0, 9.0, 90.0));
        let mesh = OccluderMesh::cuboid(&bounds).unwrap();
        let eye = DVec3::new(0.0, 0.0, 2.0);
        let pose = Pose::look_at(eye, eye + DVec3::X, DVec3::Z);
        let view = View::perspective(pose, 1.0, 1.0, 1.0, 1e4).unwrap();
        for (from, is_hidden) in [(49.5, true), (50.5, false), (52.0, false)] {
            let view = view.with_clip_planes(&[Plane::new(DVec3::X, -from)]).unwrap();
            let mut horizon = Horizon::new(UpAxis::Z);
            horizon.begin(&view, DVec3::ZERO);
            horizon.add(&mesh, &Affine3A::IDENTITY);
            assert_eq!(hides(&horizon), is_hidden, "a tower at 50 m, cut away up to {from} m");
        }
    }
}
