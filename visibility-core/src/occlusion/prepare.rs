//! Making occluders from what is drawn: an object's own triangles, if it is opaque.

use super::OccluderMesh;
use crate::{Scene, scene::Triangle};
use alloc::vec::Vec;

/// What is left out of an occluder because it would cost more than it hides.
///
/// ```
/// use visibility_core::occlusion::{prepare, Preparation};
/// let triangles: &[visibility_core::scene::Triangle] = &[];
/// assert!(prepare(triangles, &Preparation::default()).is_none());
/// ```
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Preparation {
    /// Triangles whose height over their longest side is less than this share of it are slivers, and left
    /// out: they cover no pixel whole.
    pub sliver: f32,
    /// Triangles with less than this share of the area of the mesh's largest are left out.
    pub least_area: f32,
    /// Whether back faces hide too: for models whose triangles are not turned outwards throughout.
    pub two_sided: bool,
}

impl Default for Preparation {
    fn default() -> Self {
        Self { sliver: 1e-3, least_area: 0.0, two_sided: false }
    }
}

/// An occluder from triangles, or nothing if nothing worth adding remains. Triangles that are not finite are
/// left out. Leaving triangles out is safe: an occluder with holes hides less.
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
            // Height over the longest side is twice the area over that side.
            double_area > f64::from(preparation.sliver) * longest
                && double_area >= f64::from(preparation.least_area) * largest
        })
        .copied()
        .collect();
    OccluderMesh::from_triangles(&kept).ok().map(|mesh| mesh.with_two_sided(preparation.two_sided))
}

impl Scene {
    /// Makes an occluder of every object that is flagged as one, has triangles, and has no mesh yet. For
    /// loading time, and for what does not move: whoever moves such an object gives its mesh the
    /// [transform](Scene::set_mesh) too. Other [triangles](Scene::set_triangles) take the mesh away,
    /// until the next call. Returns how many were made.
    pub fn prepare_occluders(&mut self, preparation: &Preparation) -> usize {
        let ids: Vec<_> = self.ids().collect();
        let mut made = 0;
        for id in ids {
            if !self.object(id).is_ok_and(|object| object.occluder) || self.has_mesh(id) {
                continue;
            }
            let mesh = self.triangles(id).ok().and_then(|triangles| prepare(triangles, preparation));
            if let Some(mesh) = mesh {
                let mesh = self.add_mesh(mesh);
                made += usize::from(self.set_prepared_mesh(id, mesh).is_ok());
            }
        }
        made
    }
}
