//! Selection of the occluders of a frame: nearest first, as long as drawing them pays.
//!
//! A priority queue holds nodes and occluders by distance, so that boxes are visited front to back (Greene,
//! Kass and Miller, "Hierarchical Z-Buffer Visibility", 1993). Each box is tested against the occluders drawn
//! so far: a hidden node yields no occluders, and a hidden occluder is not drawn. The search therefore visits
//! what is seen, however many occluders the frustum holds.
//!
//! Drawing has a price. An occluder that covers a share `s` of the view hides about `s * n` of the `n`
//! objects behind it, if these are spread evenly over the view. It is drawn if its cost in triangles is at
//! most `price * s * n`. The share is the area facing the eye over the squared distance (Coorg and Teller,
//! "Real-Time Occlusion Culling for Models with Large Occluders", 1997). This formula underestimates an
//! occluder near the eye, such as the walls of the room or courtyard around it, so a nearby mesh that it
//! rejects is estimated triangle by triangle. All work is also paid from a [`Budget`]. Each object found
//! hidden raises the budget by the price; in a bird's-eye view, where nothing is hidden, the search ends
//! after the initial credit.

use super::budget::Budget;
use super::{OccluderMesh, Occlusion, OcclusionMap};
use crate::scene::lanes;
use crate::walk::{BoxHierarchy, Child, IsOfScene, Walk};
use crate::{
    Aabb, ObjectId, View, geometry,
    view::{Eye, ViewPlanes},
};
use alloc::collections::BinaryHeap;
use core::cmp::{Ordering, Reverse};
use glam::{Affine3A, DVec3, DVec4, Vec3};

/// Number of occluders added between two flushes. A larger number draws more occluders that others already
/// hide; a smaller one flushes the map too often (measured with the z-buffer).
const BATCH: u32 = 8;

/// Number of occluders in a frame after which each further one costs [`LATER_WORK`] in addition. Frames of
/// typical levels draw some hundreds.
const MANY_OCCLUDERS: u64 = 1024;

/// Extra work in triangles of each occluder after the first [`MANY_OCCLUDERS`] of a frame: among thousands of
/// small occluders, such as voxels, finding, testing and choosing one takes a microsecond (measured). This
/// work counts against the limit of the frame, not against the credit of the search.
const LATER_WORK: f32 = 8.0;

/// Number of objects assumed in a leaf that the search has not opened: a full leaf.
const OBJECTS_PER_LEAF: u32 = 64;

/// Least number of objects that an occluder is taken to have behind it, so that a scene of few objects is
/// culled as tightly as a large one (measured).
pub(super) const MIN_BEHIND: f32 = 256.0;

/// Greatest distance of the eye from the middle of a mesh at which the eye is near the mesh, in radii of the
/// mesh (`r`: half the diagonal of its bounds). If a near mesh is not worth its cost by the share of the view
/// estimated from its middle, the share is estimated again triangle by triangle. Seen along a wall of length
/// `2 r`, at `2 r` from its middle, the near end is half as far away as the middle. At greater distances, the
/// two estimates differ by at most a factor of about 2.
const NEAR_RADII: f32 = 2.0;

/// Number of triangles whose solid angles can be estimated in the time of drawing one triangle.
const ESTIMATED_PER_DRAWN: f32 = 4.0;

/// Greatest number of triangles of a mesh whose solid angles are computed for an estimate. Of a larger mesh,
/// only every second, third or n-th triangle is used and stands for those between.
const MAX_ESTIMATED: usize = 2048;

/// A node or an occluder that waits in the queue of [`OccluderSearch`].
#[derive(Clone, Copy, Debug)]
pub(super) struct Waiting {
    /// Distance of `bounds` from the eye, as [`distance_key`] measures it. The queue has the least first.
    distance_key: f32,
    /// Number of flushes that the frame had made when `bounds` was last tested.
    tested: u32,
    child: Child,
    /// Estimated number of objects below a node; 1 for an object.
    objects: f32,
    bounds: Aabb,
}

impl Ord for Waiting {
    /// Compares by distance, then nodes before objects, then by number, so that the order is total and the
    /// same on every machine.
    fn cmp(&self, other: &Self) -> Ordering {
        let number = |waiting: &Self| match waiting.child {
            Child::Node(node) => (0, node),
            Child::Object(id) => (1, id.index()),
        };
        let by_number = || number(self).cmp(&number(other));
        self.distance_key.total_cmp(&other.distance_key).then_with(by_number)
    }
}

impl PartialOrd for Waiting {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Waiting {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Waiting {}

/// Nodes and occluders to be visited, nearest first. Kept between frames for its memory only.
pub(super) type Queue = BinaryHeap<Reverse<Waiting>>;

/// The search for the occluders of one frame.
pub(super) struct OccluderSearch<'a, M> {
    map: &'a mut M,
    eye: Eye,
    /// Row `w` of the clip matrix, for points relative to the scene's origin: negative behind the eye of a
    /// perspective view.
    depth_row: DVec4,
    clip_planes: ViewPlanes,
    queue: &'a mut Queue,
    /// Budget of the frame's work. The walk after the search uses what the search leaves.
    budget: Budget,
    /// Share of the view that one square metre covers, facing the eye at a distance of one metre; in a
    /// parallel view at any distance. May be NaN or infinite for a degenerate view.
    share_per_area: f32,
    /// Whether all objects left in the set had been tested before the first occluder was added.
    is_tested: bool,
    /// Number of objects that may lie behind the occluders to come: all objects not found hidden so far. A
    /// leaf that the search has not opened counts as [`OBJECTS_PER_LEAF`].
    undecided: f32,
    /// Number of flushes in this frame.
    flushes: u32,
    /// Number of occluders added since the last flush.
    unflushed: u32,
}

impl<'a, M: OcclusionMap> OccluderSearch<'a, M> {
    /// Prepares a search for a map on which [`OcclusionMap::begin`] has been called with the same `view` and
    /// `origin`. Without credit in the budget the search adds no occluder. `is_tested` tells whether all
    /// objects left in the set have been tested against what the map holds.
    pub(super) fn new(
        map: &'a mut M,
        queue: &'a mut Queue,
        view: &View,
        origin: DVec3,
        budget: Budget,
        is_tested: bool,
    ) -> Self {
        let eye = view.eye(origin);
        Self {
            map,
            clip_planes: view.clip_planes_from(origin),
            depth_row: view.clip_from(origin).row(3),
            queue,
            budget,
            share_per_area: share_per_area(view, &eye, origin),
            eye,
            is_tested,
            undecided: 0.0,
            flushes: 0,
            unflushed: 0,
        }
    }

    /// Adds the occluders of the frame to the map and flushes it. In the scene's own hierarchy, also drops
    /// the objects and nodes that it finds hidden on the way. Returns the rest of the budget, and whether all
    /// objects left in the set have been tested against everything in the map.
    pub(super) fn run<H: BoxHierarchy>(mut self, walk: &mut Walk<H>) -> (Budget, bool) {
        self.queue.clear();
        let begins = self.budget.has_credit();
        if begins {
            // The map may have begun the frame with occluders of its own: make them take effect.
            self.flush();
            self.open(walk, None);
        }
        while self.budget.has_credit()
            && let Some(Reverse(next)) = self.queue.pop()
        {
            self.undecided -= next.objects;
            if self.has_become_hidden(walk, &next) {
                self.budget.earn(next.objects);
                continue;
            }
            match next.child {
                Child::Node(node) => self.open(walk, Some(node)),
                Child::Object(id) => self.consider(walk, id),
            }
        }
        self.map.flush();
        let tests_all = H::IS_OF_SCENE && walk.is_current() && self.map.answers_at_once();
        let is_all_tested =
            walk.stats.occluders == 0 && (self.is_tested || begins && tests_all && self.queue.is_empty());
        // The walk after the search counts the objects left in the set.
        walk.stats.visible = 0;
        (self.budget, is_all_tested)
    }

    /// Returns whether the box of an entry is hidden now. False without a test if the map has not been
    /// flushed since the box was last tested.
    fn has_become_hidden<H: BoxHierarchy>(&mut self, walk: &mut Walk<H>, next: &Waiting) -> bool {
        if next.tested == self.flushes {
            return false;
        }
        self.budget.spend(1.0);
        walk.stats.tests += 1;
        self.map.test_mut(&next.bounds) == Occlusion::Hidden
    }

    /// Tests the children of a node (`None`: the top of the hierarchy) and queues the nodes and occluders
    /// that are not hidden.
    fn open<H: BoxHierarchy>(&mut self, walk: &mut Walk<H>, node: Option<usize>) {
        if self.unflushed > 0 {
            self.flush();
        }
        walk.visit(node, |walk, block, candidates| {
            // Children hidden by the occluders drawn so far are dropped with all below them. A map with
            // delayed answers, as from a graphics card, cannot tell yet.
            let hidden = if self.map.answers_at_once() && !self.is_tested {
                self.budget.spend_tests(candidates.count_ones());
                walk.stats.tests += u64::from(candidates.count_ones());
                self.map.test_64_mut(block.boxes(), candidates).hidden
            } else {
                0
            };
            let (objects, found) = (block.objects(candidates), candidates & !hidden);
            // An occluder whose object the map draws by itself, as a part of a level, is not added.
            let mut occluders = found & objects & block.occluders();
            for lane in lanes(occluders) {
                if let Child::Object(id) = block.child(lane) {
                    occluders &= !(u64::from(self.map.draws(id)) << lane);
                }
            }
            if let Some((_, ids)) = block.leaf() {
                walk.scene().fetch_occluders(ids, occluders);
            }
            // Objects found hidden add to the budget. Objects not found hidden yet add to `undecided`.
            self.budget.earn((hidden & objects).count_ones() as f32);
            self.undecided += (found & objects).count_ones() as f32;
            for lane in lanes(hidden & !objects) {
                self.budget.earn(objects_of(walk, block.child(lane)));
            }
            for lane in lanes(found & !objects | occluders) {
                let (child, bounds) = (block.child(lane), block.boxes().get(lane));
                let objects = objects_of(walk, child);
                if let Child::Node(_) = child {
                    self.undecided += objects;
                }
                let distance_key = distance_key(&self.eye, &bounds);
                let tested = self.flushes;
                self.queue.push(Reverse(Waiting { distance_key, tested, child, objects, bounds }));
            }
            // Hidden nodes are dropped here only in the scene's own hierarchy. In another hierarchy, dropping
            // a node means listing all objects below it, which the walk after the search does once.
            if H::IS_OF_SCENE { found } else { candidates }
        });
    }

    /// Adds the occluder of an object that is not hidden, if the object has one and it is worth its cost.
    fn consider<H: BoxHierarchy>(&mut self, walk: &mut Walk<H>, id: ObjectId) {
        self.budget.spend(1.0);
        let occluder =
            if H::IS_OF_SCENE { walk.scene().mesh_of_occluder(id) } else { walk.scene().occluder(id) };
        let Some((mesh, ref transform)) = occluder else { return };
        let cost = self.map.cost(mesh) as f32;
        let worth = self.budget.worth(self.undecided.max(MIN_BEHIND));
        let behind = self.budget.worth(self.undecided);
        // In a degenerate view a share may be NaN; `min` turns it into 1, the whole view.
        let share = |angle: f32| (angle * self.share_per_area).min(1.0);
        let pays = |budget: &Budget, share: f32| cost <= worth * share && budget.can_pay(cost, share, behind);
        let is_worth_it = pays(&self.budget, share(solid_angle(mesh, transform, &self.eye)))
            || pays(&self.budget, 1.0) && is_near(mesh, transform, &self.eye) && {
                let estimated = mesh.triangles().len().min(MAX_ESTIMATED);
                self.budget.spend(estimated as f32 / ESTIMATED_PER_DRAWN);
                let angle = solid_angle_by_triangles(mesh, transform, &self.eye, self.depth_row);
                pays(&self.budget, share(angle))
            };
        if is_worth_it && mesh.is_inside(&self.clip_planes, transform) {
            self.budget.pay(cost);
            walk.stats.occluders += 1;
            if walk.stats.occluders > MANY_OCCLUDERS {
                self.budget.lower_limit(LATER_WORK);
            }
            self.map.add(mesh, transform);
            self.unflushed += 1;
            if self.unflushed == BATCH {
                self.flush();
            }
        }
    }

    /// Flushes the map, so that tests take the occluders added so far into account. Does nothing for a map
    /// that does not [answer at once](OcclusionMap::answers_at_once).
    fn flush(&mut self) {
        if self.map.answers_at_once() {
            self.map.flush();
            self.flushes += 1;
            self.unflushed = 0;
        }
    }
}

/// Returns the share of the view that one square metre covers in the middle of the view, facing the eye at a
/// distance of one metre; for a parallel view at any distance.
///
/// Normalized device coordinates `x / w` and `y / w` grow by `|X| / |W|` and `|Y| / |W|` for each metre
/// across, at a distance of one metre, where `X`, `Y` and `W` are the linear parts of the rows of the clip
/// matrix. In a parallel view, `w` is constant and takes the place of `|W|`. The view is 2 units wide and 2
/// units high in these coordinates, so the share is `|X| |Y| / (4 |W|^2)`.
fn share_per_area(view: &View, eye: &Eye, origin: DVec3) -> f32 {
    let clip = view.clip_from(origin);
    let [x, y, w] = [0, 1, 3].map(|row| clip.row(row));
    let w_squared = match eye {
        Eye::Point(_) => w.truncate().length_squared(),
        Eye::Direction(_) => w.w * w.w,
    };
    (x.truncate().length() * y.truncate().length() / (4.0 * w_squared)) as f32
}

/// Returns an estimate of the solid angle in steradians that a mesh covers, as seen from the eye. For a
/// parallel view, returns an estimate of the mesh's projected area in square metres instead. 0 if `transform`
/// is degenerate.
///
/// The estimate is made from the middle of the mesh. It is up to 1.7 times too large where parts of the mesh
/// face away from the axes or cover each other, and useless for an eye [near](is_near) the mesh.
fn solid_angle(mesh: &OccluderMesh, transform: &Affine3A, eye: &Eye) -> f32 {
    let center = transform.transform_point3(mesh.bounds().center());
    let (direction, distance_squared) = match eye {
        Eye::Point(eye) => {
            let d = eye.as_vec3() - center;
            // The squared distance counts as at least that of the mesh's radius: the formula holds for
            // occluders that are small from the eye.
            let size = radius_squared(mesh, transform).max(f32::MIN_POSITIVE);
            (d.normalize_or_zero(), d.length_squared().max(size))
        }
        Eye::Direction(along) => (-along.as_vec3(), 1.0),
    };
    // Projected areas are stored for the untransformed mesh, so the direction is taken into mesh coordinates
    // and the resulting area is scaled.
    let inverse = transform.matrix3.inverse();
    let scale = transform.matrix3.determinant().abs();
    let turned: Vec3 = (inverse * glam::Vec3A::from(direction)).into();
    let area = mesh.area_towards(turned) * scale;
    if area.is_finite() { area / distance_squared } else { 0.0 }
}

/// Returns the square of half the diagonal of a mesh's bounds under a transform, in square metres of the
/// scene. Exact unless the transform shears.
fn radius_squared(mesh: &OccluderMesh, transform: &Affine3A) -> f32 {
    let (half, axes) = (mesh.bounds().half_extent(), &transform.matrix3);
    let scale =
        Vec3::new(axes.x_axis.length_squared(), axes.y_axis.length_squared(), axes.z_axis.length_squared());
    (half * half).dot(scale)
}

/// Tests whether the eye is in or near the bounds of a mesh: within [`NEAR_RADII`]. The middle of the mesh
/// then says little about what the mesh covers. False for parallel views and for NaN.
fn is_near(mesh: &OccluderMesh, transform: &Affine3A, eye: &Eye) -> bool {
    let Eye::Point(eye) = eye else { return false };
    let center = transform.transform_point3(mesh.bounds().center());
    let limit = NEAR_RADII * NEAR_RADII * radius_squared(mesh, transform);
    eye.as_vec3().distance_squared(center) <= limit
}

/// Returns the sum of the solid angles in steradians of the occluding triangles of a mesh, as seen from the
/// eye of a perspective view. A one-sided mesh occludes by the triangles that show their fronts; a two-sided
/// mesh counts by its fronts or by its backs, whichever sum is greater. Triangles wholly behind the eye,
/// where `depth_row` is negative at all corners, do not count. Overlapping triangles are counted repeatedly.
/// 0 for a parallel view.
fn solid_angle_by_triangles(mesh: &OccluderMesh, transform: &Affine3A, eye: &Eye, depth_row: DVec4) -> f32 {
    let Eye::Point(eye) = eye else { return 0.0 };
    let mirrored = transform.matrix3.determinant() < 0.0;
    let (mut fronts, mut backs) = (0.0, 0.0);
    let stride = mesh.triangles().len().div_ceil(MAX_ESTIMATED).max(1);
    for t in mesh.triangles().iter().step_by(stride) {
        let corners = t.map(|i| transform.transform_point3(mesh.positions()[i as usize]).as_dvec3());
        if corners.iter().all(|p| depth_row.dot(p.extend(1.0)) < 0.0) {
            continue;
        }
        let [a, b, c] = corners.map(|p| p - *eye);
        let angle = geometry::solid_angle([a, b, c].map(DVec3::normalize_or_zero));
        // The eye is in front if the corners run counter-clockwise: their determinant is then negative.
        let front = (a.dot(b.cross(c)) < 0.0) != mirrored;
        *(if front { &mut fronts } else { &mut backs }) += angle;
    }
    (if mesh.is_two_sided() { f64::max(fronts, backs) } else { fronts }) as f32 * stride as f32
}

/// Returns an estimate of the number of objects below a child that the walk has not visited.
pub(super) fn objects_of<H: BoxHierarchy>(walk: &Walk<H>, child: Child) -> f32 {
    match child {
        Child::Node(node) => (walk.leaves_below(node) * OBJECTS_PER_LEAF) as f32,
        Child::Object(_) => 1.0,
    }
}

/// Returns a number that grows with the distance of a box from the eye: the squared distance of its nearest
/// point, in square metres; for a parallel view the coordinate of the nearest point along the view direction,
/// in metres. Not rounded conservatively, since only the order of draws depends on it.
fn distance_key(eye: &Eye, bounds: &Aabb) -> f32 {
    match eye {
        Eye::Point(eye) => {
            let eye = eye.as_vec3();
            eye.clamp(bounds.min, bounds.max.max(bounds.min)).distance_squared(eye)
        }
        Eye::Direction(along) => {
            let along = along.as_vec3();
            let nearest = Vec3::select(along.cmpge(Vec3::ZERO), bounds.min, bounds.max);
            nearest.dot(along)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::view::{Depth, Pose};
    use glam::{DMat4, Mat3A};

    fn cube(half: f32) -> OccluderMesh {
        OccluderMesh::cuboid(&Aabb::from_arrays([-half; 3], [half; 3])).unwrap()
    }

    fn eye(x: f64) -> Eye {
        Eye::Point(DVec3::new(x, 0.0, 0.0))
    }

    /// Row `w` of a view that looks along x from `x`.
    fn ahead(x: f64) -> DVec4 {
        DVec4::new(1.0, 0.0, 0.0, -x)
    }

    #[test]
    fn boxes_are_visited_by_the_distance_of_their_nearest_point() {
        let bounds = Aabb::from_arrays([1.0, -1.0, -1.0], [3.0, 1.0, 1.0]);
        assert_eq!(
            [2.0, 1.0, 0.0, 5.0].map(|x| distance_key(&eye(x), &bounds)),
            [0.0, 0.0, 1.0, 4.0],
            "eyes"
        );
        let along = |v: DVec3| distance_key(&Eye::Direction(v), &bounds);
        assert_eq!(
            [along(DVec3::X), along(DVec3::NEG_X), along(DVec3::Y)],
            [1.0, -3.0, -1.0],
            "parallel views"
        );
        let at = |distance_key: f32, child: Child| Waiting {
            distance_key,
            tested: 0,
            child,
            objects: 1.0,
            bounds,
        };
        let object = Child::Object(ObjectId { index: 1, generation: 0 });
        let order =
            [at(1.0, Child::Node(7)), at(2.0, Child::Node(3)), at(2.0, Child::Node(4)), at(2.0, object)];
        assert!(order.is_sorted(), "by distance, then nodes before objects, then by number");
        assert!(
            order[0] != order[1] && order[1] == at(2.0, Child::Node(3)),
            "equal entries are of one child"
        );
    }

    #[test]
    fn views_of_90_degrees_show_four_square_metres_at_one_metre() {
        let pose = Pose::look_at(DVec3::ONE, DVec3::ZERO, DVec3::Z);
        let view = View::perspective(pose, 90f64.to_radians(), 1.0, 0.1, 100.0).unwrap();
        let share = share_per_area(&view, &view.eye(DVec3::ZERO), DVec3::ZERO);
        assert!((share - 0.25).abs() < 1e-6, "a square metre covers {share} of the view");
        let matrix = DMat4::from_scale(DVec3::new(0.5, 0.25, 0.1));
        let view = View::from_clip_from_world(matrix, Depth::ZeroToOne).unwrap();
        let share = share_per_area(&view, &view.eye(DVec3::ZERO), DVec3::ZERO);
        assert!((share - 1.0 / 32.0).abs() < 1e-6, "a square metre covers {share} of 4 m by 8 m");
    }

    #[test]
    fn far_meshes_cover_their_area_by_the_squared_distance() {
        let (mesh, scaled) = (cube(1.0), Affine3A::from_scale(Vec3::new(1.0, 2.0, 3.0)));
        let near_enough = |found: f32, exact: f32| (found - exact).abs() <= 0.01 * exact;
        let found = solid_angle(&mesh, &Affine3A::IDENTITY, &eye(100.0));
        assert!(near_enough(found, 4e-4), "4 m^2 at 100 m: {found}");
        let found = solid_angle(&mesh, &scaled, &eye(100.0));
        assert!(near_enough(found, 24e-4), "24 m^2 at 100 m: {found}");
        let found = solid_angle(&mesh, &scaled, &Eye::Direction(DVec3::Y));
        assert!(near_enough(found, 12.0), "12 m^2 along y: {found}");
        let inside = solid_angle(&mesh, &Affine3A::IDENTITY, &eye(0.1));
        assert!(near_enough(inside, 4.0 / 3.0), "the distance counts as the radius at least: {inside}");
        let flat = Affine3A { matrix3: Mat3A::ZERO, ..Affine3A::IDENTITY };
        assert_eq!(solid_angle(&mesh, &flat, &eye(9.0)), 0.0, "a degenerate transform");
        assert_eq!(radius_squared(&mesh, &scaled), 14.0, "the square of half the diagonal");
    }

    #[test]
    fn an_eye_within_two_radii_is_near() {
        let (mesh, radius) = (cube(1.0), 3f64.sqrt());
        let near = |x: f64| is_near(&mesh, &Affine3A::IDENTITY, &eye(x));
        assert!(near(0.0) && near(1.99 * radius) && !near(2.01 * radius), "two radii");
        assert!(!is_near(&mesh, &Affine3A::IDENTITY, &Eye::Direction(DVec3::X)), "a parallel view");
        assert!(!is_near(&mesh, &Affine3A::IDENTITY, &eye(f64::NAN)), "an eye that is NaN");
    }

    #[test]
    fn triangles_before_the_eye_that_show_their_fronts_count() {
        let (mesh, four_pi) = (cube(1.0), 4.0 * core::f32::consts::PI);
        let mirrored = Affine3A::from_scale(Vec3::new(1.0, 1.0, -1.0));
        let angle = |mesh: &OccluderMesh, transform: &Affine3A, x: f64, row: DVec4| {
            solid_angle_by_triangles(mesh, transform, &eye(x), row)
        };
        // A face of a cube covers a sixth of all directions of its middle; at 3 m, the face is 2 m away.
        let face = angle(&mesh, &Affine3A::IDENTITY, -3.0, ahead(-3.0));
        let exact = 4.0 * (1.0 / (2.0 * 6f64.sqrt())).atan() as f32;
        assert!((face - exact).abs() < 0.05 * exact, "a face of 2 m at 2 m: {face}, not {exact}");
        let again = angle(&mesh, &mirrored, -3.0, ahead(-3.0));
        assert!((again - face).abs() < 1e-3, "a mirrored cube shows its fronts: {again}");
        assert_eq!(angle(&mesh, &Affine3A::IDENTITY, 0.0, ahead(0.0)), 0.0, "backs from within");
        let two_sided = mesh.clone().with_two_sided(true);
        let around = angle(&two_sided, &Affine3A::IDENTITY, 0.0, ahead(0.0));
        assert!(around > 0.75 * four_pi && around < 0.9 * four_pi, "all but the face behind: {around}");
        assert_eq!(angle(&mesh, &Affine3A::IDENTITY, 3.0, ahead(3.0)), 0.0, "a cube behind the eye");
        let parallel = Eye::Direction(DVec3::X);
        let none = solid_angle_by_triangles(&mesh, &Affine3A::IDENTITY, &parallel, ahead(0.0));
        assert_eq!(none, 0.0, "a parallel view");
    }
}
