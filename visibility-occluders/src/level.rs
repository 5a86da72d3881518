//! The occluders of a level: settings, construction, and their polygons and clusters.

use crate::clusters::{Item, divide};
use crate::faces::{Faces, LevelTriangle, open_sides};
use crate::outlines::{OutlineEdge, outline, straighten};
use crate::pieces::divide_regions;
use crate::regions::{Region, Regions};
use crate::t_junctions::insert_t_junctions;
use alloc::vec::Vec;
use core::fmt;
use visibility_core::binary_format::Fingerprint;
use visibility_core::glam::{DVec3, Vec3};
use visibility_core::level_version::{level_object, level_version};
use visibility_core::{Aabb, Object, ObjectId, Scene};

/// Settings by which the occluders of a level are made.
#[derive(Clone, Copy, PartialEq, Debug)]
#[must_use]
pub struct LevelSettings {
    pub(crate) flatness: f64,
    pub(crate) bulge: f64,
    pub(crate) kept_area: f64,
    pub(crate) max_cluster_edges: usize,
}

impl Default for LevelSettings {
    fn default() -> Self {
        Self { flatness: 4.0 * f64::from(f32::EPSILON), bulge: 0.03, kept_area: 0.98, max_cluster_edges: 96 }
    }
}

impl LevelSettings {
    /// Sets the greatest distance of a polygon's vertices from its plane, as a fraction of the greatest
    /// coordinate. 4.8e-7 by default, some roundings of a coordinate to `f32`. Greater values give fewer
    /// polygons, but each polygon counts as farther away by the distance of its vertices from its plane. A
    /// negative number or NaN counts as 0.
    pub fn with_flatness(self, flatness: f64) -> Self {
        Self { flatness: flatness.max(0.0), ..self }
    }

    /// Sets the greatest distance of a polygon's vertices from the plane of its first face, as a fraction of
    /// the square root of the polygon's area. Applies where it exceeds the [flatness](Self::with_flatness).
    /// 0.03 by default, which gives terrain and curved walls a half to a third of the polygons that 0 gives.
    /// Greater values give fewer polygons. Each polygon counts as farther away by the distance of its
    /// vertices from its plane, and hides nothing from an eye within that distance. A negative number or NaN
    /// counts as 0.
    pub fn with_bulge(self, bulge: f64) -> Self {
        Self { bulge: bulge.max(0.0), ..self }
    }

    /// Sets the least share of the area of all polygons that is kept, from 0 to 1. The smallest polygons are
    /// left out. 0.98 by default, since most polygons are so small that together they have only some
    /// hundredths of the area.
    pub fn with_kept_area(self, share: f64) -> Self {
        Self { kept_area: share.clamp(0.0, 1.0), ..self }
    }

    /// Sets the maximum number of edges of a cluster of more than one polygon. 96 by default. A polygon of
    /// several faces is divided if it has more edges than that, not counting vertices in the middle of
    /// straight lines. The setting hardly changes the number of hidden objects, and it changes the time of a
    /// frame by a few per cent.
    pub fn with_max_cluster_edges(self, edges: usize) -> Self {
        Self { max_cluster_edges: edges, ..self }
    }
}

/// A polygon of a level, of any form: concave, with holes, or in several parts; flat, or nearly so. Its edges
/// are edges of the level, which need not lie in one plane.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct OccluderPolygon {
    /// Unit normal of the front.
    pub normal: DVec3,
    /// Bounds on `normal . p` over all points `p` of the polygon's faces, least and greatest, in metres.
    /// Roundings of that product in `f64` are included.
    pub extent: [f64; 2],
    /// Sum of the areas of the polygon's faces in square metres.
    pub area: f64,
    /// Least cosine of the angle between `normal` and the normal of any of the polygon's faces, each normal
    /// taken to point to the polygon's front side. Above 0.
    pub min_cosine: f64,
    /// Range of the polygon's edges in [`LevelOccluders::edges`], half-open.
    pub edges: [u32; 2],
    /// True if the polygon occludes from both sides, false if from its front only.
    pub two_sided: bool,
}

/// Polygons that lie close together.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct OccluderCluster {
    /// Box around the cluster's polygons in metres relative to `Scene::origin`.
    pub bounds: Aabb,
    /// Range of the cluster's polygons in [`LevelOccluders::polygons`], half-open, greatest area first.
    pub polygons: [u32; 2],
    /// Range of the cluster's vertices in [`LevelOccluders::vertices`], half-open. No other cluster uses
    /// them.
    pub vertices: [u32; 2],
    /// Sum of the areas of the polygons in square metres.
    pub area: f64,
}

/// Counts of triangles, edges and polygons at the steps of making the occluders of a level.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
#[non_exhaustive]
pub struct LevelReport {
    /// Number of triangles given.
    pub triangles: usize,
    /// Number of triangles left after removing triangles without area and repeated triangles.
    pub faces: usize,
    /// Number of open edges (edges of only one face) after welding.
    pub open_edges: usize,
    /// Number of vertices inserted into edges on which they lie.
    pub t_junctions: usize,
    /// Number of edges into which no vertex was inserted, although some may lie on them, since 16 vertices
    /// for each side of a face, or as many as 32-bit indices allow, were inserted into other edges, or since
    /// the search for vertices took 256 tests of boxes and vertices for each side of a face, about ten times
    /// as many as ordinary levels take. 0 for occluders read from a file.
    pub edges_not_split: usize,
    /// Number of open edges (edges of only one face) after T-junctions were resolved.
    pub open_edges_left: usize,
    /// Number of polygons found.
    pub polygons: usize,
    /// Number of vertices of outlines removed from the middle of straight lines.
    pub straightened: usize,
    /// Area of the polygons left out, in square metres.
    pub area_left_out: f64,
}

/// Reason why the occluders of a level cannot be made.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[non_exhaustive]
pub enum LevelOccludersError {
    /// More triangles were given than 32-bit indices of corners allow.
    TooManyTriangles {
        /// Number of triangles given.
        triangles: usize,
    },
}

impl fmt::Display for LevelOccludersError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::TooManyTriangles { triangles } => {
                write!(
                    f,
                    "{triangles} triangles are more than {MAX_TRIANGLES}, which indices of 32 bits allow"
                )
            }
        }
    }
}

impl core::error::Error for LevelOccludersError {}

/// Maximum number of triangles. T-junctions add corners, so a quarter of the range of indices is left for
/// them.
const MAX_TRIANGLES: usize = (u32::MAX / 4) as usize;

/// The occluders of a level: polygons made of its opaque, static triangles, in clusters.
///
/// Take a line that meets no edge of a polygon's outline. If the outline winds round the line, the line
/// passes through a triangle of the level, within the polygon's [extent] along the normal. So polygons hide
/// nothing that the triangles do not hide. If, besides, the line comes from the front of all the polygon's
/// faces, the winding number is positive.
///
/// [extent]: OccluderPolygon::extent
///
/// ```
/// use visibility_core::glam::Vec3;
/// use visibility_occluders::{LevelOccluders, LevelSettings, LevelTriangle};
/// // A wall of two rectangles of different width, which meet in a T-junction.
/// let quad = |[y0, y1]: [f32; 2], [z0, z1]: [f32; 2]| {
///     let [a, b, c, d] = [[y0, z0], [y1, z0], [y1, z1], [y0, z1]].map(|[y, z]| Vec3::new(5.0, y, z));
///     [[a, b, c], [a, c, d]].map(|corners| LevelTriangle { corners, two_sided: true })
/// };
/// let high = quad([0.0, 2.0], [0.0, 3.0]);
/// let low = [quad([2.0, 4.0], [0.0, 1.0]), quad([2.0, 4.0], [1.0, 3.0])].concat();
/// let level = LevelOccluders::new(&[&high[..], &low].concat(), LevelSettings::default())?;
/// assert_eq!((level.polygons().len(), level.edges().len()), (1, 4));
/// # Ok::<(), visibility_occluders::LevelOccludersError>(())
/// ```
#[derive(Clone, PartialEq, Debug, Default)]
pub struct LevelOccluders {
    pub(crate) vertices: Vec<Vec3>,
    pub(crate) edges: Vec<OutlineEdge>,
    pub(crate) polygons: Vec<OccluderPolygon>,
    pub(crate) clusters: Vec<OccluderCluster>,
    pub(crate) objects: Vec<ObjectId>,
    pub(crate) layers: Vec<u32>,
    pub(crate) report: LevelReport,
    /// Version of the level that the occluders were made from. `None` if it is unknown.
    pub(crate) version: Option<u64>,
    /// [Hash](hash_of) of the indices of the objects whose triangles are in the level. 0 if it was made from
    /// triangles alone.
    pub(crate) made_of: u64,
}

impl LevelOccluders {
    /// Makes the occluders of a level from its triangles. The order of the triangles matters only where
    /// alternatives are equally good. Takes some microseconds a triangle, and 200 bytes a triangle while it
    /// works. The search for T-junctions ends early where very many vertices lie near long edges, see
    /// [`LevelReport::edges_not_split`].
    ///
    /// # Errors
    /// [`LevelOccludersError::TooManyTriangles`] for more than 1,073,741,823 triangles.
    pub fn new(triangles: &[LevelTriangle], settings: LevelSettings) -> Result<Self, LevelOccludersError> {
        if triangles.len() > MAX_TRIANGLES {
            return Err(LevelOccludersError::TooManyTriangles { triangles: triangles.len() });
        }
        // Vertices are welded and T-junctions closed, so that faces beside each other share edges.
        let mut faces = Faces::weld(triangles);
        let mut report =
            LevelReport { triangles: triangles.len(), faces: faces.faces.len(), ..LevelReport::default() };
        let sides = faces.sides();
        report.open_edges = open_sides(&sides).count();
        [report.t_junctions, report.edges_not_split] = insert_t_junctions(&mut faces, &sides);
        let sides = faces.sides();
        report.open_edges_left = open_sides(&sides).count();
        let magnitude = faces.vertices.iter().fold(Vec3::ZERO, |most, v| most.max(v.abs()));
        let flatness = settings.flatness * f64::from(magnitude.max_element());
        // Nearly flat regions of faces become polygons. The smallest are left out, since drawing them costs
        // more than they hide.
        let mut regions = Regions::find(&faces, &sides, flatness, settings.bulge);
        divide_regions(&mut regions, &faces, settings.max_cluster_edges);
        report.polygons = regions.regions.len();
        let mut kept: Vec<&Region> = regions.regions.iter().collect();
        report.area_left_out = leave_out_smallest(&mut kept, settings.kept_area);
        let mut outlines: Vec<_> = kept.iter().map(|region| outline(&faces, &regions, region)).collect();
        report.straightened = straighten(&faces.vertices, &mut outlines);
        let mut level = Self { report, ..Self::default() };
        // Clusters: polygons near each other, halved by their middles until each has few enough edges.
        let middle = |outline: &Vec<OutlineEdge>| {
            let points = || outline.iter().map(|edge| faces.at(edge[0]));
            (points().fold(DVec3::INFINITY, DVec3::min) + points().fold(DVec3::NEG_INFINITY, DVec3::max))
                * 0.5
        };
        let mut items: Vec<Item> = (0..)
            .zip(&outlines)
            .filter(|(_, outline)| !outline.is_empty())
            .map(|(polygon, outline)| Item { polygon, middle: middle(outline), edges: outline.len() })
            .collect();
        let mut ranges = Vec::new();
        divide(&mut items, settings.max_cluster_edges, 0, &mut |range| ranges.push(range));
        for [first, end] in ranges {
            // Regions are sorted by area, so polygons of lesser index are larger.
            items[first..end].sort_unstable_by_key(|item| item.polygon);
            let polygons = items[first..end].iter().map(|item| item.polygon as usize);
            let own = polygons.map(|i| (kept[i], &outlines[i][..]));
            level.push_cluster(&faces, own, magnitude.as_dvec3());
        }
        Ok(level)
    }

    /// Makes the occluders of a scene's level, from the triangles ([`Scene::set_triangles`]) of objects that
    /// are flagged as occluders, are [always drawn](Scene::is_always_drawn), can be
    /// [culled](Object::is_unculled), are on a layer, are not see-through and for which `stands_still`
    /// returns true. Triangles of [one-sided](visibility_core::Object::one_sided) objects occlude from their
    /// front alone. Positions are relative to [`Scene::origin`]. The occluders have the
    /// [version](level_version()) of the scene.
    ///
    /// # Errors
    /// The errors of [`new`](Self::new).
    pub fn of_scene(
        scene: &Scene,
        stands_still: impl FnMut(ObjectId) -> bool,
        settings: LevelSettings,
    ) -> Result<Self, LevelOccludersError> {
        let (mut triangles, mut objects, mut layers) = (Vec::new(), Vec::new(), Vec::new());
        for (id, object) in objects_of(scene, stands_still) {
            let own = scene.triangles(id).unwrap_or_default();
            triangles
                .extend(own.iter().map(|corners| LevelTriangle { corners, two_sided: !object.one_sided }));
            objects.push(id);
            layers.push(object.layers);
        }
        layers.sort_unstable();
        layers.dedup();
        let made = Self::new(&triangles, settings)?.with_version(level_version(scene));
        Ok(Self { made_of: hash_of(&objects), objects, layers, ..made })
    }

    /// Appends a cluster of regions, each given with its outline. `magnitude` bounds the magnitudes of the x,
    /// y and z of all vertices.
    fn push_cluster<'a>(
        &mut self,
        faces: &Faces,
        regions: impl Iterator<Item = (&'a Region, &'a [OutlineEdge])> + Clone,
        magnitude: DVec3,
    ) {
        let mut used: Vec<u32> =
            regions.clone().flat_map(|(_, outline)| outline).flatten().copied().collect();
        used.sort_unstable();
        used.dedup();
        let first_vertex = self.vertices.len() as u32;
        self.vertices.extend(used.iter().map(|&vertex| faces.vertices[vertex as usize]));
        let local = |vertex: u32| used.binary_search(&vertex).map_or(0, |at| first_vertex + at as u32);
        let first_polygon = self.polygons.len() as u32;
        let mut area = 0.0;
        for (region, outline) in regions {
            let first = self.edges.len() as u32;
            self.edges.extend(outline.iter().map(|edge| edge.map(local)));
            // A product of three terms is wrong by at most 3 u of the sum of the terms' magnitudes.
            let rounding = 2.0 * f64::EPSILON * region.normal.abs().dot(magnitude);
            self.polygons.push(OccluderPolygon {
                normal: region.normal,
                extent: [region.extent[0] - rounding, region.extent[1] + rounding],
                area: region.area,
                min_cosine: region.min_cosine,
                edges: [first, self.edges.len() as u32],
                two_sided: region.two_sided,
            });
            area += region.area;
        }
        self.clusters.push(OccluderCluster {
            bounds: Aabb::from_points(self.vertices[first_vertex as usize..].iter().copied()),
            polygons: [first_polygon, self.polygons.len() as u32],
            vertices: [first_vertex, self.vertices.len() as u32],
            area,
        });
    }

    /// Returns the positions of the outlines' vertices in metres relative to `Scene::origin`, cluster by
    /// cluster.
    pub fn vertices(&self) -> &[Vec3] {
        &self.vertices
    }

    /// Returns the edges of all outlines as start and end, indices into [`vertices`](Self::vertices). The
    /// polygon lies to the left of the edge, seen from the polygon's front.
    pub fn edges(&self) -> &[[u32; 2]] {
        &self.edges
    }

    /// Returns the polygons of all clusters.
    pub fn polygons(&self) -> &[OccluderPolygon] {
        &self.polygons
    }

    /// Returns the clusters: groups of polygons that are drawn together.
    pub fn clusters(&self) -> &[OccluderCluster] {
        &self.clusters
    }

    /// Returns the objects whose triangles are in the level: those that it was [made of](Self::of_scene), or
    /// [set](Self::with_objects_of). Empty if neither was called.
    pub fn objects(&self) -> &[ObjectId] {
        &self.objects
    }

    /// Returns the [layer masks](visibility_core::Object::layers) of the objects that the level was [made
    /// of](Self::of_scene), each mask once, none of them 0. A level is used only in views that share a layer
    /// with every mask, since any other view does not draw some of its objects. Empty for occluders made of
    /// triangles alone, which hide in every view.
    pub fn layers(&self) -> &[u32] {
        &self.layers
    }

    /// Sets the [version](Self::version) of the level that the occluders were made from, for occluders that
    /// were not made from a scene.
    #[must_use]
    pub fn with_version(self, version: u64) -> Self {
        Self { version: Some(version), ..self }
    }

    /// Returns the version of the level that the occluders were made from: [`level_version`](level_version())
    /// of the scene, or the number given to [`with_version`](Self::with_version). `None` if there is neither.
    pub fn version(&self) -> Option<u64> {
        self.version
    }

    /// Returns the counts of triangles, edges and polygons at the steps by which the occluders were made.
    pub fn report(&self) -> &LevelReport {
        &self.report
    }
}

/// Returns a hash of the indices of a level's objects. Never 0, which stands for unknown objects.
pub(crate) fn hash_of(objects: &[ObjectId]) -> u64 {
    let with = |hash: Fingerprint, id: &ObjectId| hash.with(id.index() as u32);
    objects.iter().fold(Fingerprint::new(), with).value().max(1)
}

/// Iterates over the objects of a scene whose triangles are in its level.
pub(crate) fn objects_of(
    scene: &Scene,
    mut stands_still: impl FnMut(ObjectId) -> bool,
) -> impl Iterator<Item = (ObjectId, Object)> {
    scene.ids().filter_map(move |id| {
        let (object, _) = level_object(scene, id)?;
        let hides = object.occluder && !object.see_through && object.layers != 0;
        (hides && stands_still(id)).then_some((id, object))
    })
}

/// Sorts regions by area, greatest first, and removes regions from the end as long as the remaining ones have
/// at least the fraction `share` of the total area. Returns the area removed.
fn leave_out_smallest(regions: &mut Vec<&Region>, share: f64) -> f64 {
    regions.sort_by(|a, b| b.area.total_cmp(&a.area));
    let all: f64 = regions.iter().map(|region| region.area).sum();
    let mut kept = 0.0;
    let count = regions.iter().take_while(|region| {
        let more = kept < share * all;
        kept += if more { region.area } else { 0.0 };
        more
    });
    let count = count.count();
    regions.truncate(count);
    (all - kept).max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::regions::Member;
    use visibility_testing::{Random, sign_of_sum};

    #[test]
    fn settings_are_kept_unless_they_are_negative() {
        let settings = LevelSettings::default();
        // Four times 2^-23.
        assert_eq!(settings.flatness, 4.76837158203125e-7, "the flatness by default");
        for (given, kept) in [(0.5, 0.5), (-0.5, 0.0), (f64::NAN, 0.0)] {
            assert_eq!(settings.with_flatness(given).flatness, kept, "a flatness of {given}");
            assert_eq!(settings.with_bulge(given).bulge, kept, "a bulge of {given}");
        }
    }

    /// No vertex of a polygon's faces is beyond its extent, exactly, though rounding moves the coordinate of
    /// each along the normal. Here one product outweighs the others and is just above a power of two, where
    /// roundings are as large as they can be beside the number.
    #[test]
    fn extents_hold_the_vertices_exactly() {
        let (mut random, mut beyond) = (Random(4), 0);
        for round in 0..20_000 {
            let power = f64::from(random.between(-9, 9)).exp2();
            let mut corner = || {
                let x = (power * random.range(1.0, 1.02)) as f32;
                Vec3::new(x, random.unit() as f32 * 1e-6 * x, random.unit() as f32 * 1e-6 * x)
            };
            let corners = [corner(), corner(), corner()];
            let faces = Faces::weld(&[LevelTriangle { corners, two_sided: true }]);
            let normal = DVec3::new(1.0, random.range(0.0, 1e-3), random.range(0.0, 1e-3)).normalize();
            let members = [0, 1];
            let (extent, area, min_cosine) = ([0.0; 2], 0.0, 1.0);
            let mut region = Region { members, normal, extent, area, min_cosine, two_sided: true };
            region.measure(&faces, &[Member { face: 0, turned: false }]);
            let mut level = LevelOccluders::default();
            let most = corners.iter().fold(Vec3::ZERO, |most, p| most.max(p.abs()));
            level.push_cluster(&faces, [(&region, &[[0, 1]][..])].into_iter(), most.as_dvec3());
            let [low, high] = level.polygons[0].extent;
            for p in corners.map(|p| p.as_dvec3()) {
                let sign =
                    |to: f64| sign_of_sum([(normal.x, p.x), (normal.y, p.y), (normal.z, p.z), (-1.0, to)]);
                assert!(sign(low) >= 0 && sign(high) <= 0, "round {round}: {p} is beyond {low} to {high}");
                let [low, high] = region.extent;
                beyond += usize::from(sign(low) < 0 || sign(high) > 0);
            }
        }
        assert!(beyond > 10_000, "{beyond} vertices are beyond the extent without a margin");
    }

    /// Flatness is a share of the greatest coordinate of all triangles.
    #[test]
    fn flatness_grows_with_the_greatest_coordinate() {
        let [a, b, c, d] =
            [[0.0; 3], [4.0, 0.0, 0.0], [2.0, 4.0, 0.0], [2.0, -3.0, 0.3]].map(Vec3::from_array);
        let far = [Vec3::X * 90.0, Vec3::X * 100.0, Vec3::new(95.0, 1.0, 1.0)];
        let triangles = [[a, b, c], [b, a, d], far].map(|corners| LevelTriangle { corners, two_sided: true });
        for (flatness, expected) in [(0.004, 2), (0.002, 3)] {
            let settings = LevelSettings::default().with_flatness(flatness).with_bulge(0.0);
            let level = LevelOccluders::new(&triangles, settings.with_kept_area(1.0)).unwrap();
            assert_eq!(level.report.polygons, expected, "polygons with a flatness of {flatness}");
        }
    }

    #[test]
    fn levels_are_made_of_drawn_occluders_that_stand_still() {
        let mut scene = Scene::new();
        let bounds = Aabb::new(Vec3::ZERO, Vec3::ONE);
        let hiding = Object { occluder: true, ..Object::new(bounds) };
        let all = [
            hiding,
            hiding,
            Object { occluder: false, ..hiding },
            Object { see_through: true, ..hiding },
            Object { layers: 0, ..hiding },
        ];
        let ids = all.map(|object| {
            let id = scene.insert(object);
            scene.set_triangles(id, [[Vec3::ZERO, Vec3::X, Vec3::Y]]).unwrap();
            id
        });
        let of = |moving: Option<ObjectId>| {
            let level = LevelOccluders::of_scene(&scene, |id| Some(id) != moving, LevelSettings::default());
            level.unwrap().objects
        };
        assert_eq!(of(None), ids[..2], "objects that hide");
        assert_eq!(of(Some(ids[0])), ids[1..2], "objects that stand still");
        let hashes = [&ids[..1], &ids[1..2], &ids[..2]].map(hash_of);
        assert!(hashes[0] > 1 && hashes[0] != hashes[1] && hashes[1] != hashes[2], "hashes {hashes:?}");
    }

    /// The largest regions are kept until they have their share of the area, and no more.
    #[test]
    fn the_largest_regions_have_the_area_asked_for() {
        let region = |area: f64| Region {
            members: [0; 2],
            normal: DVec3::X,
            extent: [0.0; 2],
            area,
            min_cosine: 1.0,
            two_sided: true,
        };
        let all = [2.0, 4.0, 1.0, 1.0].map(region);
        for (share, kept, left_out) in
            [(0.0, 0, 8.0), (0.5, 1, 4.0), (0.75, 2, 2.0), (0.8, 3, 1.0), (1.0, 4, 0.0)]
        {
            let mut regions: Vec<&Region> = all.iter().collect();
            let area = leave_out_smallest(&mut regions, share);
            assert_eq!((regions.len(), area), (kept, left_out), "kept and left out with a share of {share}");
            assert!(regions.is_sorted_by(|a, b| a.area >= b.area), "regions with a share of {share}");
        }
    }
}
