//! Making occluders from the triangles of opaque objects.

use super::OccluderMesh;
use crate::{Scene, scene::Triangle};
use alloc::vec::Vec;

/// Settings of [`prepare`]: which triangles are dropped from an occluder because they cost more than they
/// occlude, and whether the occluder is two-sided.
///
/// ```
/// use visibility_core::occlusion::{prepare, Preparation};
/// let triangles: &[visibility_core::scene::Triangle] = &[];
/// assert!(prepare(triangles, &Preparation::default()).is_none());
/// ```
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Preparation {
    /// Slivers are dropped, since they cover no whole pixel. A triangle is a sliver if its height over its
    /// longest side is at most this fraction of that side's length. 0 keeps all triangles with an area.
    /// Default 1e-3.
    pub sliver: f32,
    /// Triangles with less than this fraction of the area of the largest triangle are dropped. Default 0.
    pub least_area: f32,
    /// Whether back faces occlude too, for models whose triangles do not all face outwards. Default false.
    pub two_sided: bool,
}

impl Default for Preparation {
    fn default() -> Self {
        Self { sliver: 1e-3, least_area: 0.0, two_sided: false }
    }
}

/// Makes an occluder from triangles, in their coordinates. Triangles that are not finite or that
/// `preparation` excludes are dropped. `None` if no triangle remains, or if too many remain for a mesh.
/// Dropping triangles is conservative: an occluder with holes occludes less.
pub fn prepare(triangles: &[Triangle], preparation: &Preparation) -> Option<OccluderMesh> {
    let measured = |t: &Triangle| {
        let [a, b, c] = t.map(|p| p.as_dvec3());
        let double_area = (b - a).cross(c - a).length();
        let longest = (b - a).length_squared().max((c - b).length_squared()).max((a - c).length_squared());
        (double_area, longest)
    };
    let finite = || triangles.iter().filter(|t| t.iter().all(|p| p.is_finite()));
    let largest = finite().map(|t| measured(t).0).fold(0.0, f64::max);
    let kept: Vec<Triangle> = finite()
        .filter(|t| {
            let (double_area, longest) = measured(t);
            // The height over the longest side is twice the area divided by that side's length.
            double_area > f64::from(preparation.sliver) * longest
                && double_area >= f64::from(preparation.least_area) * largest
        })
        .copied()
        .collect();
    OccluderMesh::from_triangles(&kept).ok().map(|mesh| mesh.with_two_sided(preparation.two_sided))
}

impl Scene {
    /// Makes an occluder mesh for every object that is flagged as an occluder, has triangles and has no mesh
    /// yet. Returns the number of meshes made.
    ///
    /// Meant for loading time. The meshes are in scene coordinates, as the triangles are: moving an object,
    /// or replacing its [triangles](Scene::set_triangles), removes its mesh. The next call makes a mesh from
    /// triangles set since.
    pub fn prepare_occluders(&mut self, preparation: &Preparation) -> usize {
        let ids: Vec<_> = self.ids().collect();
        let mut made = 0;
        for id in ids {
            if !self.object(id).is_ok_and(|object| object.occluder) || self.has_mesh(id) {
                continue;
            }
            let mesh = self.triangles(id).ok().and_then(|triangles| prepare(triangles, preparation));
            if let Some(mesh) = mesh {
                made += usize::from(self.set_prepared_mesh(id, mesh).is_ok());
            }
        }
        made
    }
}
