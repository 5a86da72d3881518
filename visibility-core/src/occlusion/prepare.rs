//! Making occluders from the triangles of opaque objects.

use super::OccluderMesh;
use crate::Scene;
use crate::scene::{MeshId, Triangle};
use alloc::vec::Vec;
use hashbrown::HashMap;

/// Settings of [`prepare`]: which triangles are dropped from an occluder because they cost more than they
/// occlude, and whether the occluder is two-sided.
///
/// ```
/// use visibility_core::occlusion::{prepare, Preparation};
/// let triangles: &[visibility_core::scene::Triangle] = &[];
/// assert!(prepare(triangles, &Preparation::default()).is_none());
/// ```
#[derive(Clone, Copy, PartialEq, Debug)]
#[must_use]
pub struct Preparation {
    pub(crate) sliver: f32,
    pub(crate) min_area: f32,
    pub(crate) two_sided: bool,
}

impl Default for Preparation {
    fn default() -> Self {
        Self { sliver: 1e-3, min_area: 0.0, two_sided: false }
    }
}

impl Preparation {
    /// Sets the threshold for slivers, 1e-3 by default. A triangle is dropped if its height over its longest
    /// side is at most `sliver` times that side's length, since it would cover no whole pixel. 0 keeps all
    /// triangles with an area.
    pub fn with_sliver(self, sliver: f32) -> Self {
        Self { sliver, ..self }
    }

    /// Sets the least area of a kept triangle, as a fraction of the area of the largest triangle. 0 by
    /// default.
    pub fn with_min_area(self, min_area: f32) -> Self {
        Self { min_area, ..self }
    }

    /// Sets whether back faces occlude too, for models whose triangles do not all face outwards. Objects that
    /// are drawn [one-sided](crate::Object::one_sided) get one-sided meshes nevertheless. False by default.
    pub fn with_two_sided(self, two_sided: bool) -> Self {
        Self { two_sided, ..self }
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
                && double_area >= f64::from(preparation.min_area) * largest
        })
        .copied()
        .collect();
    OccluderMesh::from_triangles(&kept).ok().map(|mesh| mesh.with_two_sided(preparation.two_sided))
}

impl Scene {
    /// Makes an occluder mesh for every object that is flagged as an occluder, has triangles and has no mesh
    /// yet. Returns the number of objects that got one.
    ///
    /// Meant for loading time. A mesh lasts as long as the triangles that it was made from: moving the
    /// object, or replacing its [triangles](Scene::set_triangles), removes the mesh. The next call makes a
    /// mesh from the triangles that the object then has.
    ///
    /// Objects share one mesh, placed by the transform of their triangles, if the triangles are
    /// [placed](crate::scene::SharedTriangles::placed) instances and the objects have no [local
    /// bounds](Scene::set_local_bounds). An object gets a mesh of its own if the transform of its triangles
    /// is kept in `f64`, or if the placed mesh would reach out of the object's bounds.
    pub fn prepare_occluders(&mut self, preparation: &Preparation) -> usize {
        let ids: Vec<_> = self.ids().collect();
        let mut shared: HashMap<(usize, bool), Option<MeshId>> = HashMap::new();
        let mut made = 0;
        for id in ids {
            let Some(object) = self.object(id).ok().filter(|object| object.occluder) else { continue };
            let (false, Some(triangles)) = (self.has_mesh(id), self.shared_triangles(id).cloned()) else {
                continue;
            };
            let sides = preparation.with_two_sided(preparation.two_sided && !object.one_sided);
            // Instances of one mesh share the prepared mesh. The key is the address of the triangles and
            // whether they are one-sided.
            let placed = triangles.rounded_transform().filter(|_| self.local_bounds(id).is_none());
            if let Some(transform) = placed {
                let key = (triangles.mesh_address(), sides.two_sided);
                let known = shared.get(&key).copied();
                let mesh = known.unwrap_or_else(|| {
                    let mesh = prepare(triangles.view().mesh().0, &sides);
                    mesh.map(|mesh| self.add_mesh(mesh))
                });
                shared.insert(key, mesh);
                let Some(mesh) = mesh else { continue };
                if self.is_mesh_inside(id, mesh, &transform) {
                    self.set_prepared_mesh(id, mesh, true);
                    made += 1;
                    continue;
                }
            }
            if !sides.two_sided && !triangles.view().has_certain_fronts() {
                continue;
            }
            // No shared mesh fits: the object gets one of its own, in world coordinates.
            let own = match triangles.view().mesh() {
                (triangles, None) => prepare(triangles, &sides),
                _ => prepare(&triangles.view().to_vec(), &sides),
            };
            if let Some(mesh) = own {
                let mesh = self.add_mesh(mesh);
                self.set_prepared_mesh(id, mesh, false);
                let _ = self.remove_mesh(mesh);
                made += 1;
            }
        }
        // A removed mesh is freed together with the last object that uses it.
        for mesh in shared.into_values().flatten() {
            let _ = self.remove_mesh(mesh);
        }
        made
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    fn count(triangles: &[Triangle], preparation: Preparation) -> usize {
        prepare(triangles, &preparation).map_or(0, |mesh| mesh.triangles().len())
    }

    /// Returns the right triangle of height `height` over a side of 1 m, with its corners turned by `turn`.
    fn flat(height: f32, turn: usize) -> Triangle {
        let mut t = [Vec3::ZERO, Vec3::X, Vec3::new(0.5, height, 0.0)];
        t.rotate_left(turn);
        t
    }

    #[test]
    fn slivers_are_left_out() {
        let sliver = Preparation::default().with_sliver(0.125);
        for turn in 0..3 {
            assert_eq!(count(&[flat(0.125, turn)], sliver), 0, "a sliver at the threshold, turned by {turn}");
            assert_eq!(count(&[flat(0.1251, turn)], sliver), 1, "above the threshold, turned by {turn}");
        }
        let all = Preparation::default().with_sliver(0.0);
        assert_eq!(count(&[flat(1e-30, 0)], all), 1, "all triangles with an area");
        assert_eq!(count(&[flat(0.0, 0)], all), 0, "a triangle without an area");
        let infinite = [Vec3::ZERO, Vec3::X, Vec3::Y * f32::INFINITY];
        assert_eq!(count(&[infinite, flat(1.0, 0)], all), 1, "a triangle that is not finite");
    }

    #[test]
    fn small_triangles_are_left_out() {
        let two = [flat(1.0, 0), flat(0.25, 1)];
        for (share, kept) in [(0.0, 2), (0.25, 2), (0.26, 1), (1.0, 1)] {
            let preparation = Preparation::default().with_min_area(share);
            assert_eq!(count(&two, preparation), kept, "triangles of at least {share} of the largest");
        }
    }
}
