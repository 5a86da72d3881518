//! The file of a level's occluders. `docs/formats.md` of the repository describes the format.

use crate::level::{LevelOccluders, LevelReport, OccluderCluster, OccluderPolygon, hash_of, objects_of};
use alloc::vec::Vec;
use core::fmt;
use visibility_core::binary_format::{Format, FormatError, Reader, Writer, push_number, take_number};
use visibility_core::glam::{DVec3, Vec3};
use visibility_core::{Aabb, ObjectId, Scene};

const FORMAT: Format = Format { magic: *b"VISI-OCC", version: 3 };

/// Kind, in the header, of a file whose fingerprint is the version of the level.
const WITH_VERSION: u32 = 1;
const WITHOUT_VERSION: u32 = 0;

/// Maximum difference of the squared length of a polygon's normal from 1.
const NORMAL_ERROR: f64 = 1e-9;

/// Reason why the occluders of a level cannot be read.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[non_exhaustive]
pub enum LevelFileError {
    /// The bytes are damaged, or are not those of a level's occluders.
    Format(FormatError),
    /// The occluders were made from another version of the level, or the file has no version.
    OtherVersion {
        /// Version of the level that the occluders were made from. `None` if the file has none.
        made_from: Option<u64>,
        /// Version of the level that the caller asked for.
        level: u64,
    },
    /// The occluders were made of other objects than those found: other objects stand still than then.
    OtherObjects,
}

impl fmt::Display for LevelFileError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Format(error) => write!(f, "{error}"),
            Self::OtherVersion { made_from: Some(version), level } => write!(
                f,
                "the occluders were made from version {version:016x} of the level, which is now \
                 {level:016x}: make them again"
            ),
            Self::OtherVersion { made_from: None, level } => write!(
                f,
                "the file does not say from which version of the level the occluders were made; the level \
                 is {level:016x}: make them again"
            ),
            Self::OtherObjects => write!(
                f,
                "the occluders were made while other objects counted as standing still, such as a door: make \
                 them again"
            ),
        }
    }
}

impl core::error::Error for LevelFileError {
    fn source(&self) -> Option<&(dyn core::error::Error + 'static)> {
        match self {
            Self::Format(error) => Some(error),
            _ => None,
        }
    }
}

impl From<FormatError> for LevelFileError {
    fn from(error: FormatError) -> Self {
        Self::Format(error)
    }
}

impl LevelOccluders {
    /// Returns the bytes of a file with these occluders and their [version](Self::version). Takes time in
    /// proportion to the edges.
    ///
    /// ```
    /// use visibility_core::{Aabb, Object, Scene, glam::Vec3, level_version};
    /// use visibility_occluders::{LevelFileError, LevelOccluders, LevelSettings};
    /// let mut scene = Scene::new();
    /// let bounds = Aabb::from_arrays([5.0, 0.0, 0.0], [5.0, 4.0, 3.0]);
    /// let wall = scene.insert(Object { occluder: true, ..Object::new(bounds) });
    /// scene.set_triangles(wall, [[Vec3::X * 5.0, Vec3::new(5.0, 4.0, 0.0), Vec3::new(5.0, 4.0, 3.0)]])?;
    /// let level = LevelOccluders::of_scene(&scene, |_| true, LevelSettings::default())?;
    /// let file = level.to_bytes();
    /// let read = LevelOccluders::from_bytes(&file, Some(level_version(&scene)))?;
    /// assert_eq!(read.clone().with_objects_of(&scene, |_| true)?, level);
    /// // The wall is a door now, which does not stand still.
    /// assert_eq!(read.with_objects_of(&scene, |id| id != wall), Err(LevelFileError::OtherObjects));
    /// // After the wall has become glass, the file is of an earlier version of the level.
    /// scene.set_occluder(wall, false)?;
    /// let refused = LevelOccluders::from_bytes(&file, Some(level_version(&scene)));
    /// assert!(matches!(refused, Err(LevelFileError::OtherVersion { .. })));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn to_bytes(&self) -> Vec<u8> {
        let kind = if self.version().is_some() { WITH_VERSION } else { WITHOUT_VERSION };
        let mut out = Writer::new(FORMAT, kind, self.version().unwrap_or_default());
        let report = self.report();
        out.u64s(counts(report).map(|count| count as u64));
        out.u64(report.area_left_out.to_bits());
        out.u64(self.made_of);
        out.u32(self.layers().len() as u32);
        out.u32s(self.layers().iter().copied());
        out.u32(self.vertices().len() as u32);
        out.u32s(self.vertices().iter().flat_map(|p| p.to_array()).map(f32::to_bits));
        out.u32(self.polygons().len() as u32);
        for OccluderPolygon { normal, extent, area, min_cosine, .. } in self.polygons() {
            let shape = [normal.x, normal.y, normal.z, extent[0], extent[1], *area, *min_cosine];
            out.u64s(shape.map(f64::to_bits));
        }
        let mut numbers = Vec::new();
        for cluster in self.clusters() {
            push_number(cluster.vertices[1] - cluster.vertices[0], &mut numbers);
            push_number(cluster.polygons[1] - cluster.polygons[0], &mut numbers);
            for polygon in &self.polygons()[cluster.polygons[0] as usize..cluster.polygons[1] as usize] {
                let [first, end] = polygon.edges;
                push_number(end - first, &mut numbers);
                numbers.push(u8::from(polygon.two_sided));
                for vertex in self.edges()[first as usize..end as usize].as_flattened() {
                    push_number(vertex - cluster.vertices[0], &mut numbers);
                }
            }
        }
        out.u64(numbers.len() as u64);
        out.bytes(&numbers);
        out.finish()
    }

    /// Reads the file of a level's occluders. `level` is the [version](visibility_core::level_version()) of
    /// the level that they are for: a file from before an edit is refused. With `None` the version is not
    /// checked, at the caller's risk: occluders of another level hide visible objects.
    ///
    /// All numbers are checked, so that any bytes that pass the checks can be drawn without panic. Memory is
    /// at most about four times the number of bytes, and three times that while it reads.
    ///
    /// # Errors
    /// [`LevelFileError::Format`] if the bytes are damaged or are not such a file.
    /// [`LevelFileError::OtherVersion`] if `level` is given and the file has another version or none.
    pub fn from_bytes(bytes: &[u8], level: Option<u64>) -> Result<Self, LevelFileError> {
        let mut reader = Reader::new(bytes, FORMAT)?;
        let made_from = match reader.kind() {
            WITHOUT_VERSION => None,
            WITH_VERSION => Some(reader.fingerprint()),
            found => return Err(FormatError::Kind { found, expected: WITH_VERSION }.into()),
        };
        if let Some(level) = level.filter(|&level| made_from != Some(level)) {
            return Err(LevelFileError::OtherVersion { made_from, level });
        }
        let mut report = LevelReport::default();
        for count in counts_mut(&mut report) {
            *count = usize::try_from(reader.u64()?).unwrap_or(usize::MAX);
        }
        report.area_left_out = f64::from_bits(reader.u64()?);
        let made_of = reader.u64()?;
        // A forged count is refused by `reader`, which has fewer bytes left.
        let mask_count = reader.u32()? as usize;
        let layers = reader.u32s(mask_count)?;
        let vertex_count = reader.u32()? as usize;
        let coordinates = reader.u32s(vertex_count.saturating_mul(3))?;
        let vertices: Vec<Vec3> = coordinates
            .chunks_exact(3)
            .map(|p| Vec3::new(f32::from_bits(p[0]), f32::from_bits(p[1]), f32::from_bits(p[2])))
            .collect();
        if !vertices.iter().all(|vertex| vertex.is_finite()) {
            return Err(reader.content_error("a vertex is not finite").into());
        }
        let polygon_count = reader.u32()? as usize;
        let shapes = reader.u64s(polygon_count.saturating_mul(SHAPE_NUMBERS))?;
        let number_bytes = usize::try_from(reader.u64()?).unwrap_or(usize::MAX);
        let numbers = reader.bytes(number_bytes)?;
        reader.end()?;
        let (edges, polygons, clusters) =
            read_clusters(numbers, &vertices, &shapes).map_err(|problem| reader.content_error(problem))?;
        let (objects, version) = (Vec::new(), made_from);
        Ok(Self { vertices, edges, polygons, clusters, objects, layers, report, version, made_of })
    }

    /// Sets the [objects](Self::objects) whose triangles are in the level, for occluders read from a file:
    /// those that [`of_scene`](Self::of_scene) would take. The version of a level does not depend on which
    /// objects stand still, so their indices are compared with those of the objects that the occluders were
    /// made of. Occluders made of triangles alone get the objects unchecked.
    ///
    /// # Errors
    /// [`LevelFileError::OtherObjects`] if the occluders were made of other objects: a door among them would
    /// hide what is behind it once it is open.
    pub fn with_objects_of(
        self,
        scene: &Scene,
        stands_still: impl FnMut(ObjectId) -> bool,
    ) -> Result<Self, LevelFileError> {
        let objects: Vec<ObjectId> = objects_of(scene, stands_still).map(|(id, _)| id).collect();
        if self.made_of != 0 && self.made_of != hash_of(&objects) {
            return Err(LevelFileError::OtherObjects);
        }
        Ok(Self { objects, ..self })
    }
}

/// Returns the counts of a report in the order of the file.
fn counts(report: &LevelReport) -> [usize; 7] {
    counts_mut(&mut { *report }).map(|count| *count)
}

fn counts_mut(report: &mut LevelReport) -> [&mut usize; 7] {
    let LevelReport {
        triangles,
        faces,
        open_edges,
        t_junctions,
        open_edges_left,
        polygons,
        straightened,
        ..
    } = report;
    [triangles, faces, open_edges, t_junctions, open_edges_left, polygons, straightened]
}

/// Number of numbers that a file has for each polygon: normal, extent, area and least cosine.
const SHAPE_NUMBERS: usize = 7;

/// Edges, polygons and clusters that were read, or the reason why they cannot be.
type Read = Result<(Vec<[u32; 2]>, Vec<OccluderPolygon>, Vec<OccluderCluster>), &'static str>;

/// Reads the polygons and clusters of `vertices` from the last part of a file. `shapes` has
/// [`SHAPE_NUMBERS`] numbers for each polygon: normal, extent, area and least cosine.
fn read_clusters(mut numbers: &[u8], vertices: &[Vec3], shapes: &[u64]) -> Read {
    let (mut edges, mut polygons, mut clusters) = (Vec::new(), Vec::new(), Vec::new());
    let mut shapes = shapes
        .chunks_exact(SHAPE_NUMBERS)
        .map(|shape| [0, 1, 2, 3, 4, 5, 6].map(|i| f64::from_bits(shape[i])));
    // For each vertex of a cluster: the number of edges of a polygon that begin there, less the number that
    // end there.
    let mut balance: Vec<i64> = Vec::new();
    let mut first_vertex = 0;
    while !numbers.is_empty() {
        let mut number = || take_number(&mut numbers).ok_or("a number ends too early or is too large");
        let (vertex_count, polygon_count) = (number()?, number()?);
        // Clusters take consecutive ranges of the vertices.
        let end_vertex = vertices.len() as u32;
        let end_vertex = if vertex_count <= end_vertex - first_vertex {
            first_vertex + vertex_count
        } else {
            return Err("a cluster has more vertices than there are");
        };
        if polygon_count == 0 {
            return Err("a cluster has no polygon");
        }
        balance.clear();
        balance.resize(vertex_count as usize, 0);
        let first_polygon = polygons.len() as u32;
        let mut area = 0.0;
        for _ in 0..polygon_count {
            let [x, y, z, low, high, own_area, min_cosine] =
                shapes.next().ok_or("more polygons than there are normals")?;
            let normal = DVec3::new(x, y, z);
            let flat = low <= high && low.is_finite() && high.is_finite() && own_area.is_finite();
            if !((normal.length_squared() - 1.0).abs() <= NORMAL_ERROR && flat && own_area >= 0.0) {
                return Err("a polygon has no plane or no area");
            }
            if !(0.0 < min_cosine && min_cosine <= 1.0 + NORMAL_ERROR) {
                return Err("a polygon has faces that do not face its front");
            }
            let edge_count = number()?;
            let two_sided = match number()? {
                0 => false,
                1 => true,
                _ => return Err("a polygon hides neither from one side nor from two"),
            };
            if edge_count < 3 {
                return Err("a polygon has fewer than three edges");
            }
            let first = edges.len();
            for _ in 0..edge_count {
                let edge = [number()?, number()?];
                if edge[0] >= vertex_count || edge[1] >= vertex_count {
                    return Err("an edge has an unknown vertex");
                }
                balance[edge[0] as usize] += 1;
                balance[edge[1] as usize] -= 1;
                edges.push(edge.map(|vertex| first_vertex + vertex));
            }
            // At every vertex as many edges must begin as end: then the outline consists of closed loops.
            if edges[first..].as_flattened().iter().any(|&v| balance[(v - first_vertex) as usize] != 0) {
                return Err("an outline is not closed");
            }
            // The extent tells how far away the polygon is, so a wrong one would hide what stands before it.
            // Writers compute the same products, and enlarge their bounds.
            let is_within = |&vertex: &u32| {
                let along = normal.dot(vertices[vertex as usize].as_dvec3());
                low <= along && along <= high
            };
            if !edges[first..].as_flattened().iter().all(is_within) {
                return Err("a vertex lies outside the extent of its polygon");
            }
            let range = [first, edges.len()].map(u32::try_from);
            let [Ok(first), Ok(end)] = range else { return Err("there are too many edges") };
            polygons.push(OccluderPolygon {
                normal,
                extent: [low, high],
                area: own_area,
                min_cosine,
                edges: [first, end],
                two_sided,
            });
            area += own_area;
        }
        clusters.push(OccluderCluster {
            bounds: Aabb::from_points(vertices[first_vertex as usize..end_vertex as usize].iter().copied()),
            polygons: [first_polygon, polygons.len() as u32],
            vertices: [first_vertex, end_vertex],
            area,
        });
        first_vertex = end_vertex;
    }
    if first_vertex as usize != vertices.len() || shapes.next().is_some() {
        return Err("vertices or polygons are left that no cluster has");
    }
    edges.shrink_to_fit();
    polygons.shrink_to_fit();
    clusters.shrink_to_fit();
    Ok((edges, polygons, clusters))
}
