//! Dividing a mesh into clusters of triangles with similar normals.
//!
//! Clustered backface culling (Johannsen and Carter, "Clustered backface culling", 1998) needs clusters with
//! similar normals that are also close together. The mesh is bisected recursively. Each split minimizes the
//! scatter of the two halves: the sum of squared distances from their means, in normals and in positions,
//! where the size of the mesh counts as much as one radian. A split sorts the triangles by normal or by
//! position along one of a few fixed directions. No split leaves fewer than [`MIN_CLUSTER`] triangles on a
//! side, so only meshes of less than 64 triangles have a smaller cluster.

use super::NormalCone;
use alloc::vec::Vec;
use core::fmt;
use core::ops::Range;
use visibility_core::glam::{DVec3, Vec3};
use visibility_core::{Aabb, scene::Triangle};

/// Greatest number of triangles in a cluster.
pub const MAX_CLUSTER: usize = 128;
/// Least number of triangles in a cluster, unless the whole mesh has fewer.
pub const MIN_CLUSTER: usize = 64;

/// A cluster of triangles of a mesh, to be drawn or culled together.
///
/// ```
/// use visibility_frame::backface::cluster_mesh;
/// use visibility_core::glam::Vec3;
/// let clusters = cluster_mesh(&[Vec3::ZERO, Vec3::X, Vec3::Y], &[[0, 1, 2]])?;
/// assert_eq!(clusters[0].triangles, [0]);
/// assert_eq!(clusters[0].bounds.max, Vec3::new(1.0, 1.0, 0.0));
/// # Ok::<(), visibility_frame::backface::ClusterError>(())
/// ```
#[derive(Clone, PartialEq, Debug)]
pub struct Cluster {
    /// Indices of the cluster's triangles in the mesh, ascending.
    pub triangles: Vec<u32>,
    /// Bounding box of the triangles' corners, in mesh coordinates. Improper if a corner is NaN.
    pub bounds: Aabb,
    /// Normal cone of the cluster, in mesh coordinates: contains only eyes that certainly see nothing but
    /// back faces of the cluster's triangles. [`NormalCone::OPEN`], which contains no eye, if no such eye is
    /// known.
    pub cone: NormalCone,
}

/// The reason why a mesh cannot be divided into clusters.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[non_exhaustive]
pub enum ClusterError {
    /// A triangle has a vertex index that is not below the number of positions.
    Index {
        /// Index of the first triangle with a vertex index out of range.
        triangle: usize,
        /// The vertex index out of range: not below the number of positions.
        vertex: u32,
    },
    /// The mesh has more triangles than `u32` can number.
    TooManyTriangles,
}

impl fmt::Display for ClusterError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Index { triangle, vertex } => {
                write!(f, "triangle {triangle} names vertex {vertex}, which does not exist")
            }
            Self::TooManyTriangles => write!(f, "the mesh has more triangles than 32 bits can number"),
        }
    }
}

impl core::error::Error for ClusterError {}

/// Divides an indexed mesh into clusters of 64 to 128 triangles with similar normals, each with its bounding
/// box and its normal cone. Every triangle is in exactly one cluster. A mesh of fewer than 64 triangles is
/// one cluster, and an empty mesh has none. Clusters of similar normals are adjacent in the list. The result
/// is the same on every machine.
///
/// Cost: some 5 microseconds a triangle.
///
/// # Errors
/// [`ClusterError::Index`] for the first triangle with a bad vertex index,
/// [`ClusterError::TooManyTriangles`] for 2^32 triangles or more.
///
/// ```
/// use visibility_frame::backface::{cluster_mesh, Facing};
/// use visibility_core::{glam::{DVec3, Vec3}, view::Eye};
/// // A floor of ten by ten squares.
/// let positions: Vec<Vec3> = (0..121).map(|i| Vec3::new((i % 11) as f32, (i / 11) as f32, 0.0)).collect();
/// let corner = |i: u32| i / 10 * 11 + i % 10;
/// let indices: Vec<[u32; 3]> = (0..100)
///     .map(corner)
///     .flat_map(|i| [[i, i + 1, i + 12], [i, i + 12, i + 11]])
///     .collect();
/// let clusters = cluster_mesh(&positions, &indices)?;
/// assert_eq!(clusters.len(), 2);
/// let below = Eye::Point(DVec3::new(20.0, 5.0, -0.1));
/// assert!(clusters.iter().all(|cluster| cluster.cone.facing(&below) == Facing::Back));
/// # Ok::<(), visibility_frame::backface::ClusterError>(())
/// ```
pub fn cluster_mesh(positions: &[Vec3], indices: &[[u32; 3]]) -> Result<Vec<Cluster>, ClusterError> {
    let count = u32::try_from(indices.len()).map_err(|_| ClusterError::TooManyTriangles)?;
    let mut triangles: Vec<Triangle> = Vec::with_capacity(indices.len());
    for (triangle, corners) in indices.iter().enumerate() {
        let mut found = [Vec3::ZERO; 3];
        for (place, &vertex) in found.iter_mut().zip(corners) {
            *place = *positions.get(vertex as usize).ok_or(ClusterError::Index { triangle, vertex })?;
        }
        triangles.push(found);
    }
    let points = traits(&triangles);
    let mut order: Vec<u32> = (0..count).collect();
    let mut clusters = Vec::new();
    let mut pending = alloc::vec![0..indices.len()];
    let mut scratch = Scratch::default();
    while let Some(range) = pending.pop() {
        if range.len() > MAX_CLUSTER {
            let middle = range.start + scratch.split(&points, &mut order[range.clone()]);
            // Pushed in this order, the first half is taken from the stack next.
            pending.push(middle..range.end);
            pending.push(range.start..middle);
        } else if !range.is_empty() {
            clusters.push(cluster(&triangles, &mut order[range]));
        }
    }
    Ok(clusters)
}

fn cluster(triangles: &[Triangle], members: &mut [u32]) -> Cluster {
    members.sort_unstable();
    let of = || members.iter().map(|&i| &triangles[i as usize]);
    Cluster {
        triangles: members.to_vec(),
        bounds: Aabb::from_points(of().flatten().copied()),
        cone: NormalCone::from_triangles(of()),
    }
}

/// Returns, for each triangle, the two vectors by which triangles are compared: its unit normal, and its
/// centre relative to the mesh's minimum corner in units of the mesh's greatest extent. A vector that is not
/// finite, and the normal of a triangle without area, is zero.
fn traits(triangles: &[Triangle]) -> Vec<[DVec3; 2]> {
    let corners = || triangles.iter().flatten().map(|p| p.as_dvec3()).filter(|p| p.is_finite());
    let (low, high) =
        corners().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), p| (low.min(p), high.max(p)));
    let size = (high - low).max_element();
    let scale = if size > 0.0 && size.is_finite() { 1.0 / size } else { 0.0 };
    triangles
        .iter()
        .map(|t| {
            let [a, b, c] = t.map(|p| p.as_dvec3());
            let center = ((a - low) + (b - low) + (c - low)) * (scale / 3.0);
            let normal = (b - a).cross(c - a).normalize_or_zero();
            [normal, center].map(|v| if v.is_finite() { v } else { DVec3::ZERO })
        })
        .collect()
}

/// Weight of squared distances between positions, relative to those between unit normals.
const PLACE: f64 = 1.0;

/// Directions along which triangles are sorted to find a split, not all of unit length: the three axes, used
/// for normals and positions, then the six face diagonals, used for normals only.
const DIRECTIONS: [DVec3; 9] = [
    DVec3::X,
    DVec3::Y,
    DVec3::Z,
    DVec3::new(1.0, 1.0, 0.0),
    DVec3::new(1.0, -1.0, 0.0),
    DVec3::new(0.0, 1.0, 1.0),
    DVec3::new(0.0, 1.0, -1.0),
    DVec3::new(1.0, 0.0, 1.0),
    DVec3::new(-1.0, 0.0, 1.0),
];

#[derive(Default)]
struct Scratch {
    keyed: Vec<(f64, u32)>,
    scatter: Vec<f64>,
}

impl Scratch {
    /// Reorders `members` (triangle indices) into two halves with the least total scatter (see
    /// [`Sums::scatter`]) and returns the size of the first half. Each half gets at least [`MIN_CLUSTER`] and
    /// at least an eighth of the members. Requires at least 128 members. `points` holds the normal and
    /// position of each triangle of the mesh.
    fn split(&mut self, points: &[[DVec3; 2]], members: &mut [u32]) -> usize {
        let count = members.len();
        // Each half has at least an eighth of the triangles, which keeps the depth of the recursion
        // logarithmic.
        let least = MIN_CLUSTER.max(count / 8);
        let range = least..count - least + 1;
        let normals = DIRECTIONS.iter().map(|&d| (0, d));
        let places = DIRECTIONS[..3].iter().map(|&d| (1, d));
        let mut best = (f64::INFINITY, range.start, 0, DVec3::X);
        for (which, direction) in normals.chain(places) {
            self.sort(points, members, which, direction);
            let (scatter, at) = self.sweep(points, range.clone());
            if scatter < best.0 {
                best = (scatter, at, which, direction);
            }
        }
        let (_, at, which, direction) = best;
        self.sort(points, members, which, direction);
        for (member, &(_, index)) in members.iter_mut().zip(&self.keyed) {
            *member = index;
        }
        at
    }

    fn sort(&mut self, points: &[[DVec3; 2]], members: &[u32], which: usize, direction: DVec3) {
        self.keyed.clear();
        self.keyed.extend(members.iter().map(|&i| (points[i as usize][which].dot(direction), i)));
        self.keyed.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    }

    /// Finds the best split of the triangles sorted in `Scratch::keyed` into a first and a second half.
    /// Returns the least sum found of the scatters (see [`Sums::scatter`]) of the two halves, and the number
    /// of triangles in the first half. Only splits with that number in the half-open `range` are considered.
    /// `points` holds the normal and position of each triangle of the mesh.
    fn sweep(&mut self, points: &[[DVec3; 2]], range: Range<usize>) -> (f64, usize) {
        self.scatter.clear();
        let mut sums = Sums::default();
        for &(_, index) in &self.keyed {
            self.scatter.push(sums.scatter());
            sums.add(&points[index as usize]);
        }
        let mut sums = Sums::default();
        let mut best = (f64::INFINITY, range.start);
        for (at, &(_, index)) in self.keyed.iter().enumerate().rev() {
            sums.add(&points[index as usize]);
            let scatter = sums.scatter() + self.scatter[at];
            if range.contains(&at) && scatter < best.0 {
                best = (scatter, at);
            }
        }
        best
    }
}

/// Running sums over the unit normals and positions of triangles: count, sums of the vectors, weighted sum of
/// the squared lengths.
#[derive(Default)]
struct Sums {
    count: f64,
    normal: DVec3,
    place: DVec3,
    squares: f64,
}

impl Sums {
    fn add(&mut self, [normal, place]: &[DVec3; 2]) {
        self.count += 1.0;
        self.normal += *normal;
        self.place += *place;
        self.squares += normal.length_squared() + PLACE * place.length_squared();
    }

    /// Returns the sum of squared distances of the triangles from their mean, in unit normals and in
    /// positions weighted by [`PLACE`]. 0 without triangles.
    fn scatter(&self) -> f64 {
        if self.count == 0.0 {
            return 0.0;
        }
        self.squares - (self.normal.length_squared() + PLACE * self.place.length_squared()) / self.count
    }
}
