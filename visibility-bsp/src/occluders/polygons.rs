//! The occluder polygons of a scene, stored in spatially compact blocks.

use super::blocks::{BLOCK, bounds_of, halve};
use super::mesh_triangles::{is_closed, triangles_of};
use super::outline::Outline;
use super::work::step;
use super::{patches, rectangles, sections};
use crate::shadow::{OccluderPolygon, mean_of, plane_of};
use alloc::collections::BTreeMap;
use alloc::vec::Vec;
use visibility_core::glam::DVec3;
use visibility_core::{
    ObjectId, Scene,
    scene::{Changes, SceneCursor},
    stamp::Stamp,
};

/// A convex occluder polygon of a scene, in metres relative to `Scene::origin`.
#[derive(Clone, Debug)]
pub(super) struct Polygon {
    /// Index of the first vertex in `Occluders::vertices`.
    pub(super) first: u32,
    /// Number of vertices of the outline; 0 once the polygon is dropped.
    pub(super) count: u32,
    /// Number of the surface's vertices inside the outline, which follow those of the outline.
    pub(super) inner: u32,
    /// Index of the first source object in `Occluders::sources`.
    pub(super) first_source: u32,
    /// Number of source objects in `Occluders::sources`.
    pub(super) sources: u32,
    /// Index in `Occluders::solids` of the first box that contains the polygon, if it is a section (a
    /// rectangle inside closed boxes).
    pub(super) first_solid: u32,
    /// Number of boxes that contain the polygon; 0 if the polygon lies on a surface.
    pub(super) solids: u32,
    /// Unit normal of the front, the side from which the vertices run counter-clockwise.
    pub(super) normal: DVec3,
    /// Least and greatest coordinate of the surface along `normal`, in metres from `Scene::origin`, rounded
    /// outwards.
    pub(super) extent_along_normal: [f64; 2],
    /// Bound on the error of each coordinate of the vertices, in metres, from placing them in the scene.
    pub(super) placing_error: f64,
    /// Area of the polygon in square metres.
    pub(super) area: f64,
    /// Mean of the polygon's vertices, in metres relative to `Scene::origin`.
    pub(super) center: DVec3,
    /// Greatest distance of a vertex from `center`, in metres.
    pub(super) radius: f64,
    /// Whether the polygon hides for all eyes behind its front. If false, it hides for eyes in front, and for
    /// eyes in the box `shell`.
    pub(super) two_sided: bool,
    /// Index in `Occluders::shells`, or [`NO_SHELL`]. A polygon whose only object is a convex two-sided solid
    /// has the box around that solid. For an eye in the box, the polygon also hides from behind. For other
    /// eyes this is not needed: the faces of the solid that look towards the eye hide all that the other
    /// faces hide.
    pub(super) shell: u32,
}

/// Value of `Polygon::shell` for a polygon without such a box.
pub(super) const NO_SHELL: u32 = u32::MAX;

/// A run of polygons that are near each other in space and of similar area, with a bounding sphere.
#[derive(Clone, Debug)]
pub(super) struct Block {
    /// Centre of the bounding sphere, in metres relative to `Scene::origin`.
    pub(super) center: DVec3,
    /// Radius of the bounding sphere in metres.
    pub(super) radius: f64,
    /// Area of the largest polygon of the run, in square metres.
    pub(super) area: f64,
    /// Index of the run's first polygon in `Occluders::polygons`.
    pub(super) first: u32,
    /// Number of polygons in the run.
    pub(super) count: u32,
}

/// Large convex occluder polygons of a scene, each with the objects that it is made of.
///
/// Made when a scene is loaded, and shared by the cullers of all views. An occluder that is moved, removed,
/// put on another layer or no longer flagged as an occluder stops hiding at once, even without a call of
/// [`sync`](Self::sync). After `sync` it hides from its new position.
///
/// Rounding by the transforms of meshes is allowed for, except between vertices that are placed at the same
/// point to the last bit, and between axis-aligned sides that are placed at the same coordinate: they count
/// as one, so that the surfaces of two objects meet there.
///
/// # Cost
/// About 200 bytes per polygon, and about 16 for each object of each polygon: of a floor of 10,000 tiles that
/// are joined into one rectangle, the rectangle has 10,000 objects. Making polygons of `n` triangles takes
/// `O(n log n)` steps, some microseconds per triangle, however the triangles lie. To keep this bound, joining
/// stops at limits, and polygons may be smaller than they could be. Connected rectangles of one plane are
/// joined only if their sides make a grid of at most 16,384 cells, and into at most 64 rectangles. At most
/// 256 boxes are cut together by a common plane.
///
/// ```
/// use visibility_bsp::Occluders;
/// use visibility_core::{glam::Vec3, occlusion::Preparation, Aabb, Object, Scene};
/// let mut scene = Scene::new();
/// // Two slabs of a wall, side by side, become one wall.
/// for y in [0.0, 4.0] {
///     let bounds = Aabb::from_arrays([5.0, y, 0.0], [5.5, y + 4.0, 3.0]);
///     let id = scene.insert(Object { occluder: true, ..Object::new(bounds) });
///     let corners = bounds.corners();
///     let triangles: Vec<_> =
///         visibility_core::OccluderMesh::CUBOID.iter().map(|t| t.map(|i| corners[i as usize])).collect();
///     scene.set_triangles(id, triangles)?;
/// }
/// scene.prepare_occluders(&Preparation::default());
/// let occluders = Occluders::new(&scene);
/// # Ok::<(), visibility_core::scene::SceneError>(())
/// ```
#[derive(Clone, Debug)]
pub struct Occluders {
    /// All polygons by index; a dropped polygon stays with a vertex count of 0.
    pub(super) polygons: Vec<Polygon>,
    /// Runs of `polygons` that are near each other, with bounding spheres.
    pub(super) blocks: Vec<Block>,
    /// Vertices of all polygons, each polygon's outline before the vertices inside it, in metres relative to
    /// `Scene::origin`.
    pub(super) vertices: Vec<DVec3>,
    /// Objects that the polygons were made from; each polygon has a range.
    pub(super) sources: Vec<ObjectId>,
    /// Minimum and maximum corners of the boxes that contain sections, in metres relative to
    /// `Scene::origin`.
    pub(super) solids: Vec<[DVec3; 2]>,
    /// Minimum and maximum corners of the boxes around convex two-sided solids, in metres relative to
    /// `Scene::origin`.
    pub(super) shells: Vec<[DVec3; 2]>,
    /// By object index: indices of the polygons made from the object, dropped ones left out.
    pub(super) of_object: BTreeMap<u32, Vec<u32>>,
    /// The scene, and the revision of the scene, that the polygons represent.
    pub(super) cursor: SceneCursor,
    /// Identifies this set of polygons and their indices. Replaced by every change.
    pub(super) stamp: Stamp,
}

impl Default for Occluders {
    /// Creates an empty set that belongs to no scene.
    fn default() -> Self {
        Self {
            polygons: Vec::new(),
            blocks: Vec::new(),
            vertices: Vec::new(),
            sources: Vec::new(),
            solids: Vec::new(),
            shells: Vec::new(),
            of_object: BTreeMap::new(),
            cursor: SceneCursor::START,
            stamp: Stamp::new(),
        }
    }
}

impl Occluders {
    /// Makes polygons of the meshes of all present occluders of a scene, joined across objects. Takes some
    /// microseconds per triangle.
    pub fn new(scene: &Scene) -> Self {
        let ids: Vec<ObjectId> = scene.ids().filter(|&id| scene.occluder(id).is_some()).collect();
        let mut occluders = Self { cursor: SceneCursor::at(scene), ..Self::default() };
        occluders.add_from(scene, &ids);
        occluders
    }

    /// Updates the polygons to the scene's present revision. Polygons of changed objects are dropped and made
    /// anew, one object at a time. They are smaller than those of [`new`](Self::new), which also joins across
    /// objects. Takes time in proportion to the changed objects, plus some nanoseconds per polygon. For
    /// another scene than before, or once most polygons are dropped ones, everything is made anew as by
    /// `new`.
    pub fn sync(&mut self, scene: &Scene) {
        let Changes::Objects(changes) = self.cursor.follow(scene) else {
            *self = Self::new(scene);
            return;
        };
        // The scene lists an object once for each of its changes.
        let mut changed = changes.to_vec();
        changed.sort_unstable();
        changed.dedup();
        if changed.is_empty() {
            return;
        }
        self.stamp = Stamp::new();
        // An object that shared a polygon with a changed object loses that polygon too, so its own part is
        // made again.
        let mut affected = changed.clone();
        for id in &changed {
            for &polygon in self.of_object.get(&(id.index() as u32)).into_iter().flatten() {
                let polygon = &mut self.polygons[polygon as usize];
                // Another of the changed objects has shared the polygon.
                if polygon.count == 0 {
                    continue;
                }
                let first = polygon.first_source as usize;
                let sources = &self.sources[first..first + polygon.sources as usize];
                affected.extend(sources.iter().inspect(|_| step()));
                polygon.count = 0;
            }
        }
        affected.sort_unstable();
        affected.dedup();
        for id in &affected {
            let Some(of_object) = self.of_object.get_mut(&(id.index() as u32)) else { continue };
            of_object.retain(|&number| {
                let polygon = &mut self.polygons[number as usize];
                if polygon.sources == 1 {
                    polygon.count = 0;
                }
                polygon.count > 0
            });
        }
        let dropped = self.polygons.iter().filter(|polygon| polygon.count == 0).count();
        if dropped > 64 && dropped * 2 > self.polygons.len() {
            // More dropped polygons than present ones: a rebuild costs as much as the changes that led here.
            *self = Self::new(scene);
            return;
        }
        for &id in affected.iter().filter(|&&id| scene.occluder(id).is_some()) {
            self.add_from(scene, &[id]);
        }
    }

    /// Returns the number of polygons, dropped ones excluded. Visits all polygons.
    pub fn len(&self) -> usize {
        self.polygons.iter().filter(|polygon| polygon.count > 0).count()
    }

    /// Tests whether there are no polygons; dropped polygons do not count. Visits all polygons.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Returns the greatest radius of a polygon in metres, measured from the mean of its vertices; 0 without
    /// polygons.
    #[cfg(feature = "papers")]
    pub(crate) fn largest_radius(&self) -> f64 {
        self.polygons.iter().filter(|p| p.count > 0).map(|p| p.radius).fold(0.0, f64::max)
    }

    /// Returns the vertices of each polygon in metres relative to `Scene::origin`, counter-clockwise as seen
    /// from the polygon's front.
    pub fn polygons(&self) -> impl Iterator<Item = &[DVec3]> {
        self.polygons.iter().filter(|p| p.count > 0).map(|p| self.vertices_of(p))
    }

    /// Returns the vertices of a polygon in metres relative to `Scene::origin`, counter-clockwise as seen
    /// from its front; none for a dropped one.
    fn vertices_of(&self, polygon: &Polygon) -> &[DVec3] {
        &self.vertices[polygon.first as usize..(polygon.first + polygon.count) as usize]
    }

    /// Returns the vertices of the surface of the polygon with index `polygon`, those inside its outline too,
    /// as the minimum and maximum corners, in metres relative to `Scene::origin`, of the boxes that surely
    /// hold the placed vertices.
    pub(crate) fn surface_of(&self, polygon: u32) -> impl Iterator<Item = [DVec3; 2]> {
        let p = &self.polygons[polygon as usize];
        let vertices = &self.vertices[p.first as usize..(p.first + p.count + p.inner) as usize];
        vertices.iter().map(|&v| [v - p.placing_error, v + p.placing_error])
    }

    /// Returns the objects that the polygon with index `polygon` was made from. The polygon may hide only
    /// while all of them are drawn and unchanged.
    pub(crate) fn sources_of(&self, polygon: u32) -> &[ObjectId] {
        let polygon = &self.polygons[polygon as usize];
        &self.sources[polygon.first_source as usize..(polygon.first_source + polygon.sources) as usize]
    }

    /// Returns the closed boxes that contain the section with polygon index `polygon`, as minimum and maximum
    /// corners in metres relative to `Scene::origin`. A section hides only for eyes outside all of these
    /// boxes. Empty for a polygon on the surface of an occluder, which is no section.
    pub(crate) fn solids_of(&self, polygon: u32) -> &[[DVec3; 2]] {
        let polygon = &self.polygons[polygon as usize];
        &self.solids[polygon.first_solid as usize..(polygon.first_solid + polygon.solids) as usize]
    }

    /// Returns the mean of a polygon's vertices in metres relative to `Scene::origin`, and the greatest
    /// distance of a vertex from it in metres.
    pub(crate) fn bounding_sphere(&self, polygon: u32) -> (DVec3, f64) {
        let p = &self.polygons[polygon as usize];
        (p.center, p.radius)
    }

    /// Returns the polygon with index `polygon` in the form that shadows are cast from. It counts as
    /// two-sided even if it hides from behind only for eyes in a box around its object. A dropped polygon has
    /// no vertices.
    pub(crate) fn occluder_polygon(&self, polygon: u32) -> OccluderPolygon<'_> {
        let p = &self.polygons[polygon as usize];
        OccluderPolygon {
            vertices: self.vertices_of(p),
            normal: p.normal,
            extent_along_normal: p.extent_along_normal,
            placing_error: p.placing_error,
            two_sided: p.two_sided || p.shell != NO_SHELL,
        }
    }

    /// Returns the polygon as [`occluder_polygon`](Self::occluder_polygon) does, but two-sided only if it
    /// hides from behind for all eyes.
    pub(crate) fn outside_polygon(&self, polygon: u32) -> OccluderPolygon<'_> {
        let two_sided = self.polygons[polygon as usize].two_sided;
        OccluderPolygon { two_sided, ..self.occluder_polygon(polygon) }
    }

    /// Tests whether a polygon may hide for an eye behind its front: whether it is two-sided, or has a
    /// `shell`, a box, that contains `eye`. `eye` is in metres relative to `Scene::origin`, and `None` for
    /// parallel views, which are in no box.
    pub(super) fn hides_behind(&self, polygon: &Polygon, eye: Option<DVec3>) -> bool {
        let holds =
            |&[min, max]: &[DVec3; 2]| eye.is_some_and(|eye| eye.cmpge(min).all() && eye.cmple(max).all());
        polygon.two_sided || self.shells.get(polygon.shell as usize).is_some_and(holds)
    }

    /// Appends polygons made from the occluder meshes of the objects `ids`. Polygons are joined across these
    /// objects, but not with polygons made earlier.
    fn add_from(&mut self, scene: &Scene, ids: &[ObjectId]) {
        let mut triangles = Vec::new();
        // For each source, the index in `shells` of the box around its object; `NO_SHELL` without one.
        let mut shell_of = Vec::with_capacity(ids.len());
        // By source: bound on the error of each coordinate of its placed vertices, in metres.
        let mut placing_errors = alloc::vec![0.0; ids.len()];
        for (source, &id) in (0..).zip(ids) {
            let mut shell = NO_SHELL;
            if let Some((mesh, ref transform)) = scene.occluder(id) {
                let (closed, first) = (is_closed(mesh.triangles()), triangles.len());
                placing_errors[source as usize] =
                    triangles_of(mesh, transform, source, closed, &mut triangles);
                if mesh.is_convex() && mesh.is_two_sided() && first < triangles.len() {
                    let (min, max) = bounds_of(triangles[first..].iter().flat_map(|t| t.corners));
                    shell = self.shells.len() as u32;
                    self.shells.push([min, max]);
                }
            }
            shell_of.push(shell);
        }
        // Axis-aligned rectangles are joined first, since they give the largest walls. Boxes made of
        // rectangles get sections, which are rectangles inside solids. All other triangles are joined as
        // patches.
        let levels = rectangles::take_rectangles(&mut triangles);
        let mut outlines = rectangles::join(&levels);
        let solids = sections::solids(&levels);
        outlines.extend(sections::sections(&solids));
        sections::drop_covered(&mut outlines);
        outlines.extend(patches::join(&triangles));
        let middle = |outline: &Outline| mean_of(outline.vertices.iter().copied());
        let centers: Vec<DVec3> = outlines.iter().map(middle).collect();
        // Polygons of similar area share blocks, so that a block of small ones is skipped as soon as it is
        // not near.
        let error_of = |sources: &[u32]| -> f64 {
            sources.iter().map(|&source| placing_errors[source as usize]).fold(0.0, f64::max)
        };
        let plane = |o: &Outline| plane_of(&o.vertices, &o.inner, error_of(&o.sources));
        let planes: Vec<_> = outlines.iter().map(plane).collect();
        let class = |number: u32| planes[number as usize].map_or(0, |(.., area)| area.to_bits() >> 53);
        let mut order: Vec<u32> =
            (0..outlines.len() as u32).filter(|&i| planes[i as usize].is_some()).collect();
        order.sort_by_key(|&number| class(number));
        for alike in order.chunk_by_mut(|&a, &b| class(a) == class(b)) {
            halve(alike, &centers);
        }
        // A polygon of a convex two-sided solid also hides for eyes behind it that are inside the box around
        // this solid, its shell.
        let (start, mut classes) = (self.polygons.len(), Vec::with_capacity(order.len()));
        for &number in &order {
            let outline = &outlines[number as usize];
            let Some((normal, extent_along_normal, area)) = planes[number as usize] else { continue };
            classes.push(class(number));
            let center = centers[number as usize];
            let radius = outline.vertices.iter().map(|v| v.distance(center)).fold(0.0, f64::max);
            let number = self.polygons.len() as u32;
            let shell = match outline.sources[..] {
                [only] if !outline.two_sided => shell_of[only as usize],
                _ => NO_SHELL,
            };
            self.polygons.push(Polygon {
                first: self.vertices.len() as u32,
                count: outline.vertices.len() as u32,
                inner: outline.inner.len() as u32,
                first_source: self.sources.len() as u32,
                sources: outline.sources.len() as u32,
                first_solid: self.solids.len() as u32,
                solids: outline.solids.len() as u32,
                normal,
                extent_along_normal,
                placing_error: error_of(&outline.sources),
                area,
                center,
                radius,
                two_sided: outline.two_sided,
                shell,
            });
            self.vertices.extend_from_slice(&outline.vertices);
            self.vertices.extend_from_slice(&outline.inner);
            let solids = outline.solids.iter().map(|&solid| &solids[solid as usize]);
            self.solids.extend(solids.map(|solid| {
                let error = placing_errors[solid.source as usize];
                [solid.min - error, solid.max + error]
            }));
            for &source in &outline.sources {
                let id = ids[source as usize];
                self.sources.push(id);
                self.of_object.entry(id.index() as u32).or_default().push(number);
            }
        }
        // Blocks of polygons of one class of area. The bounding sphere and the largest area of a block give a
        // bound on the solid angles of all its polygons.
        let mut first = start;
        let blocks = classes.chunk_by(|a, b| a == b).flat_map(|alike| alike.chunks(BLOCK)).map(<[u64]>::len);
        for count in blocks {
            let block = &self.polygons[first..first + count];
            let center = mean_of(block.iter().map(|polygon| polygon.center));
            let radius = block.iter().map(|p| p.center.distance(center) + p.radius).fold(0.0, f64::max);
            let area = block.iter().map(|p| p.area).fold(0.0, f64::max);
            self.blocks.push(Block { center, radius, area, first: first as u32, count: block.len() as u32 });
            first += count;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use visibility_core::glam::Vec3;
    use visibility_core::{Aabb, Object, OccluderMesh};

    /// Adds an occluder with a mesh of boxes far from the mesh's origin, which a transform moves back.
    /// Returns the error of placing the mesh.
    fn place(scene: &mut Scene, boxes: &[Aabb], two_sided: bool) -> f64 {
        let far = Vec3::new(1e6, 0.0, 0.0);
        let triangles: Vec<_> = boxes
            .iter()
            .flat_map(|bounds| {
                let corners = bounds.corners();
                OccluderMesh::CUBOID.map(|t| t.map(|i| corners[i as usize] + far))
            })
            .collect();
        let mesh = OccluderMesh::from_triangles(&triangles).unwrap().with_two_sided(two_sided);
        let transform = visibility_core::glam::Affine3A::from_translation(-far);
        let id =
            scene.insert(Object { occluder: true, ..Object::new(Aabb::from_arrays([-9.0; 3], [9.0; 3])) });
        let added = scene.add_mesh(mesh.clone());
        scene.set_mesh(id, added, transform).unwrap();
        triangles_of(&mesh, &transform, 0, true, &mut Vec::new())
    }

    const BOX: [[f32; 3]; 2] = [[-1.0; 3], [1.0, 2.0, 3.0]];

    #[test]
    fn polygons_have_the_error_of_placing_their_meshes() {
        let mut scene = Scene::new();
        let error = place(&mut scene, &[Aabb::from_arrays(BOX[0], BOX[1])], false);
        let occluders = Occluders::new(&scene);
        assert!(!occluders.is_empty() && error > 0.0, "{} polygons, error of {error}", occluders.len());
        for number in 0..occluders.len() as u32 {
            let polygon = occluders.occluder_polygon(number);
            assert_eq!(polygon.placing_error, error, "error of polygon {number}");
            let along = polygon.vertices.iter().map(|v| polygon.normal.dot(*v));
            let [low, high] = polygon.extent_along_normal;
            assert!(
                along.into_iter().all(|at| low <= at - 1.9 * error && at + 1.9 * error <= high),
                "{number}"
            );
            for ([min, max], v) in occluders.surface_of(number).zip(polygon.vertices) {
                assert_eq!((min, max), (*v - error, *v + error), "box around a vertex of polygon {number}");
            }
        }
    }

    #[test]
    fn boxes_of_sections_are_widened_by_the_error_of_placing_them() {
        // A plane in which the second box begins cuts both.
        let boxes = [([0.0, 0.0, 0.0], [1.0, 4.0, 3.0]), ([0.5, 4.0, 0.0], [1.5, 8.0, 3.0])];
        let boxes = boxes.map(|(min, max)| Aabb::from_arrays(min, max));
        let mut scene = Scene::new();
        let errors = boxes.map(|bounds| place(&mut scene, &[bounds], false));
        let occluders = Occluders::new(&scene);
        let solids: Vec<_> =
            (0..occluders.len() as u32).flat_map(|number| occluders.solids_of(number)).collect();
        assert!(!solids.is_empty(), "a section");
        for [min, max] in solids {
            let is = |(bounds, error): (&Aabb, f64)| {
                *min == bounds.min.as_dvec3() - error && *max == bounds.max.as_dvec3() + error
            };
            assert!(boxes.iter().zip(errors).any(is), "{min} to {max}, errors {errors:?}");
        }
    }

    #[test]
    fn a_convex_two_sided_solid_hides_from_behind_for_eyes_in_its_box_alone() {
        let [one, other] = [BOX, [[3.0; 3], [4.0; 3]]].map(|[min, max]| Aabb::from_arrays(min, max));
        for (boxes, two_sided, is) in [
            (&[one][..], true, true),
            (&[one], false, false),
            (&[one, other], true, false),
            (&[one, other], false, false),
        ] {
            let mut scene = Scene::new();
            place(&mut scene, boxes, two_sided);
            let occluders = Occluders::new(&scene);
            assert!(occluders.len() > 5, "faces: {}", occluders.len());
            for number in 0..occluders.len() as u32 {
                assert_eq!(
                    occluders.occluder_polygon(number).two_sided,
                    is,
                    "{} boxes, {two_sided}",
                    boxes.len()
                );
                assert!(!occluders.outside_polygon(number).two_sided, "{} boxes, {two_sided}", boxes.len());
                let polygon = &occluders.polygons[number as usize];
                let hides = |eye| occluders.hides_behind(polygon, eye);
                assert_eq!(hides(Some(DVec3::ZERO)), is, "from within: {} boxes, {two_sided}", boxes.len());
                for eye in [None, Some(DVec3::new(0.0, 0.0, 3.5)), Some(DVec3::new(0.0, -1.5, 0.0))] {
                    assert!(!hides(eye), "from {eye:?}: {} boxes, {two_sided}", boxes.len());
                }
            }
        }
        let mut scene = Scene::new();
        let triangle = [Vec3::ZERO, Vec3::X, Vec3::Y];
        let mesh = OccluderMesh::from_triangles(&[triangle]).unwrap().with_two_sided(true);
        let id =
            scene.insert(Object { occluder: true, ..Object::new(Aabb::from_arrays([-9.0; 3], [9.0; 3])) });
        let mesh = scene.add_mesh(mesh);
        scene.set_mesh(id, mesh, visibility_core::glam::Affine3A::IDENTITY).unwrap();
        let occluders = Occluders::new(&scene);
        assert!(occluders.outside_polygon(0).two_sided, "a two-sided triangle");
        assert!(occluders.occluder_polygon(0).two_sided, "a two-sided triangle, from within too");
        assert!(occluders.hides_behind(&occluders.polygons[0], None), "a two-sided triangle from anywhere");
    }

    /// Inserts a tetrahedron as an occluder, of which no two faces are joined.
    fn insert_tetrahedron(scene: &mut Scene, at: f32, size: f32) -> ObjectId {
        let corner = |x: f32, y: f32, z: f32| Vec3::new(at + size * x, size * y, size * z);
        let [a, b, c, d] = [
            corner(0.0, 0.0, 0.0),
            corner(1.0, 0.25, 0.5),
            corner(0.25, 1.0, 0.125),
            corner(0.5, 0.125, 1.0),
        ];
        let triangles = [[a, c, b], [a, b, d], [b, c, d], [c, a, d]];
        let bounds = Aabb::from_points(triangles.as_flattened().iter().copied());
        let id = scene.insert(Object { occluder: true, ..Object::new(bounds) });
        scene.set_triangles(id, triangles).unwrap();
        scene.prepare_occluders(&visibility_core::occlusion::Preparation::default());
        id
    }

    #[test]
    fn dropped_polygons_do_not_count() {
        let mut scene = Scene::new();
        let large = insert_tetrahedron(&mut scene, 0.0, 8.0);
        let small = insert_tetrahedron(&mut scene, 20.0, 1.0);
        let mut occluders = Occluders::new(&scene);
        let check = |occluders: &Occluders, wanted: &[ObjectId], all| {
            assert_eq!(occluders.polygons.len(), all, "polygons, dropped ones too");
            assert_eq!(
                (occluders.len(), occluders.is_empty()),
                (4 * wanted.len(), wanted.is_empty()),
                "polygons"
            );
            assert_eq!(occluders.polygons().count(), 4 * wanted.len(), "polygons one by one");
            assert!(occluders.polygons().all(|vertices| vertices.len() == 3), "triangles alone");
            let numbers: Vec<&u32> = occluders.of_object.values().flatten().collect();
            assert_eq!(numbers.len(), 4 * wanted.len(), "polygons by object");
            for id in wanted {
                let own = &occluders.of_object[&(id.index() as u32)];
                assert!(own.iter().all(|&number| occluders.sources_of(number) == [*id]), "polygons of {id}");
            }
        };
        check(&occluders, &[large, small], 8);
        scene.set_layers(small, 3).unwrap();
        occluders.sync(&scene);
        check(&occluders, &[large, small], 12);
        scene.set_occluder(large, false).unwrap();
        occluders.sync(&scene);
        check(&occluders, &[small], 12);
        #[cfg(feature = "papers")]
        assert!(occluders.largest_radius() < 1.5, "radius of the small one: {}", occluders.largest_radius());
        scene.remove(small).unwrap();
        occluders.sync(&scene);
        check(&occluders, &[], 12);
        #[cfg(feature = "papers")]
        assert_eq!(occluders.largest_radius(), 0.0, "radius without polygons");
    }

    /// All polygons are made anew once more than 64 are dropped ones, and these are more than the others.
    #[test]
    fn polygons_are_made_anew_once_most_are_dropped() {
        for (others, last) in [(0, 16), (1, 16), (17, 17), (18, 18)] {
            let mut scene = Scene::new();
            for number in 0..others {
                insert_tetrahedron(&mut scene, 10.0 * number as f32, 1.0);
            }
            let id = insert_tetrahedron(&mut scene, -10.0, 1.0);
            let mut occluders = Occluders::new(&scene);
            for change in 1..=last + 1 {
                scene.set_layers(id, change).unwrap();
                occluders.sync(&scene);
                let kept = if change <= last { change as usize } else { 0 };
                let expected = 4 * (others + 1 + kept);
                assert_eq!(occluders.polygons.len(), expected, "{others} others, after {change} changes");
                assert_eq!(occluders.len(), 4 * (others + 1), "{others} others, after {change} changes");
            }
        }
    }
}
