//! The convex solids of a scene's occluders, with their meshes.
//!
//! Buildings are often modelled without a bottom. If closing the one hole of a mesh makes it a convex solid,
//! the mesh occludes like the solid for every viewpoint strictly behind the planes of the hole: a line of
//! sight enters a convex solid once, and from there not through the hole.

use crate::blocker::{Blocker, dents};
use alloc::vec::Vec;
use visibility_core::bits::Bits;
use visibility_core::glam::DVec3;
use visibility_core::scene::{Changes, SceneCursor, Triangle};
use visibility_core::{ObjectId, OccluderMesh, Scene, VisibleSet};

/// Greatest number of triangles that a mesh may have for its hole to be closed.
const OPEN: usize = 64;

/// A convex solid that is an occluder's mesh or a part of it.
#[derive(Clone, Debug)]
pub(crate) struct Solid {
    pub(crate) id: ObjectId,
    /// The solid in coordinates of the occluder's mesh, closed and convex.
    #[cfg(feature = "papers")]
    pub(crate) mesh: OccluderMesh,
    /// The solid in scene coordinates. Its `caps` are triangles that close the hole of an open mesh.
    pub(crate) blocker: Blocker,
    /// Least corner of the solid's bounds in scene coordinates, widened by the error of vertices.
    pub(crate) min: DVec3,
    /// Greatest corner of the solid's bounds in scene coordinates, widened by the error of vertices.
    pub(crate) max: DVec3,
}

#[cfg(feature = "papers")]
impl Solid {
    /// Returns whether the box from `min` to `max` and the bounds of the solid meet or touch.
    pub(crate) fn meets(&self, min: DVec3, max: DVec3) -> bool {
        self.min.cmple(max).all() && min.cmple(self.max).all()
    }
}

/// The solids of one scene.
#[derive(Clone, Debug)]
pub(crate) struct Solids {
    cursor: SceneCursor,
    /// Indices of the objects that were occluders when `list` was made.
    occluders: Bits,
    pub(crate) list: Vec<Solid>,
}

impl Solids {
    pub(crate) const fn new() -> Self {
        Self { cursor: SceneCursor::START, occluders: Bits::EMPTY, list: Vec::new() }
    }

    /// Finds the solids again if occluders of the scene have changed. Returns whether any has.
    pub(crate) fn sync(&mut self, scene: &Scene) -> bool {
        if !occluders_changed(&mut self.cursor, scene, &self.occluders) {
            return false;
        }
        self.list.clear();
        self.occluders.reset(scene.index_limit());
        for id in scene.ids() {
            let Some((mesh, ref transform)) = scene.occluder(id) else { continue };
            self.occluders.insert(id.index());
            for piece in pieces(mesh) {
                let closed;
                let (solid, caps) = if piece.is_convex() {
                    (piece, &[][..])
                } else {
                    let Some(found) = close(piece) else { continue };
                    closed = found;
                    (&closed.0, &closed.1[..])
                };
                let blocker = Blocker::solid(solid, transform, caps);
                let around = [DVec3::INFINITY, DVec3::NEG_INFINITY];
                let [min, max] =
                    blocker.vertices.iter().fold(around, |[min, max], &p| [min.min(p), max.max(p)]);
                // Without faces, a flattened solid would count as all of space.
                if min.is_finite() && max.is_finite() && !blocker.faces.is_empty() {
                    let (min, max) = (min - blocker.slack, max + blocker.slack);
                    self.list.push(Solid {
                        id,
                        #[cfg(feature = "papers")]
                        mesh: solid.clone(),
                        blocker,
                        min,
                        max,
                    });
                }
            }
        }
        true
    }
}

/// Returns the indices of the objects that may occlude: the candidates that are flagged as occluders (see
/// [`VisibleSet::for_each_occluder`]), have a mesh, and are [always drawn](Scene::is_always_drawn).
pub(crate) fn occluding(scene: &Scene, visible: &VisibleSet) -> Bits {
    let mut bits = Bits::new(scene.index_limit());
    visible.for_each_occluder(scene, |id| {
        if scene.occluder(id).is_some() && scene.is_always_drawn(id) {
            bits.insert(id.index());
        }
    });
    bits
}

/// Moves a cursor to the present state of a scene. Returns whether an object that is or was an occluder has
/// changed since the cursor's former state. `known` are the indices of the occluders at that state.
pub(crate) fn occluders_changed(cursor: &mut SceneCursor, scene: &Scene, known: &Bits) -> bool {
    match cursor.follow(scene) {
        Changes::Everything => true,
        Changes::Objects(ids) => {
            ids.iter().any(|&id| known.contains(id.index()) || scene.occluder(id).is_some())
        }
    }
}

/// Returns the parts of a mesh, or the mesh itself if it is not divided into parts.
pub(crate) fn pieces(mesh: &OccluderMesh) -> &[OccluderMesh] {
    if mesh.parts().is_empty() { core::slice::from_ref(mesh) } else { mesh.parts() }
}

/// Closes the hole of an open mesh. Returns the convex solid, and the triangles that close the hole (caps),
/// without slivers. `None` if the mesh has more than [`OPEN`] triangles or not exactly one hole, if the
/// closed mesh is not convex, or if a sliver is not in the plane of a cap.
pub(crate) fn close(mesh: &OccluderMesh) -> Option<(OccluderMesh, Vec<Triangle>)> {
    if mesh.triangles().len() > OPEN {
        return None;
    }
    let rim: Vec<[u32; 2]> =
        mesh.edges().iter().filter(|edge| edge.right.is_none()).map(|edge| edge.vertices).collect();
    let mut hole = alloc::vec![rim.first()?[0]];
    for _ in 1..rim.len() {
        let at = *hole.last()?;
        let to = rim.iter().find(|[from, _]| *from == at)?[1];
        // As many edges as vertices, none of them twice, are one loop.
        if hole.contains(&to) {
            return None;
        }
        hole.push(to);
    }
    let corner = |&[a, b, c]: &[u32; 3]| [a, b, c].map(|i| mesh.positions()[i as usize]);
    let mut triangles: Vec<Triangle> = mesh.triangles().iter().map(corner).collect();
    // The closing triangles run along the hole's rim in the opposite direction.
    let fan: Vec<Triangle> = (1..hole.len() - 1).map(|i| corner(&[hole[0], hole[i + 1], hole[i]])).collect();
    triangles.extend(&fan);
    let closed = OccluderMesh::from_triangles(&triangles).ok()?;
    let caps = caps(&fan, &closed)?;
    closed.is_convex().then_some((closed, caps))
}

/// Returns the triangles of `fan` that are not slivers (triangles of nearly no area). `None` if a sliver is
/// not in the plane of a returned triangle.
///
/// Slivers can be left out since the blocker is used only for viewpoints strictly behind the planes of all
/// caps. A line of sight from there does not enter the solid through a cap. A sliver is off the plane of some
/// cap by at most the depth of the solid's dents. A line that enters through the sliver stays as close to
/// that plane inside the solid, since the solid does not reach beyond the plane. So the line misses the solid
/// without its dents, and only the solid without its dents counts as blocking.
fn caps(fan: &[Triangle], solid: &OccluderMesh) -> Option<Vec<Triangle>> {
    let normal = |t: &Triangle| {
        let [a, b, c] = t.map(|p| p.as_dvec3());
        (b - a).cross(c - a)
    };
    let is_wide = |t: &&Triangle| {
        let [a, b, c] = t.map(|p| p.as_dvec3());
        normal(t).length() > 1e-4 * (b - a).length_squared().max((c - a).length_squared())
    };
    let size = solid.bounds().min.abs().max(solid.bounds().max.abs()).max_element();
    let slack = dents(solid) * f64::from(size);
    let (wide, slivers): (Vec<&Triangle>, Vec<&Triangle>) = fan.iter().partition(is_wide);
    let is_in_plane = |t: &Triangle, plane: &Triangle| {
        let (normal, anchor) = (normal(plane), plane[0].as_dvec3());
        t.iter().all(|p| normal.dot(p.as_dvec3() - anchor).abs() <= slack * normal.length())
    };
    let is_covered = |t: &&Triangle| wide.iter().any(|plane| is_in_plane(t, plane));
    slivers.iter().all(is_covered).then(|| wide.into_iter().copied().collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::vec;
    use visibility_core::glam::Vec3;

    /// Returns the walls and the roof of a house without a bottom. One wall has a slit at the foot of its
    /// corner, `width` wide and `height` high.
    fn house(width: f32, height: f32) -> Vec<Triangle> {
        let floor = |x: f32, y: f32| Vec3::new(x, y, 0.0);
        let up = |p: Vec3| p + Vec3::Z * 9.0;
        let [a, b, c, d] = [floor(0.0, 0.0), floor(4.0, 0.0), floor(4.0, 4.0), floor(0.0, 4.0)];
        let (p, s) = (floor(4.0 - width, 0.0), Vec3::new(4.0 - width, 0.0, height));
        let wall = |a: Vec3, b: Vec3| [[a, b, up(b)], [a, up(b), up(a)]];
        let front = [[a, p, s], [a, s, up(a)], [s, up(b), up(a)], [s, b, up(b)]];
        let walls = [wall(b, c), wall(c, d), wall(d, a), [[up(a), up(b), up(c)], [up(a), up(c), up(d)]]];
        front.into_iter().chain(walls.into_iter().flatten()).collect()
    }

    #[test]
    fn a_slit_at_the_foot_of_a_house_is_open() {
        let mut closed = 0;
        for (width, height) in [(1.0, 3.0), (1e-3, 3.0), (3e-4, 8.0), (1e-5, 1.0)] {
            let triangles = house(width, height);
            // The order of the triangles decides at which corner the fan starts that closes the hole.
            for first in 0..3 * triangles.len() {
                let mut triangles = triangles.clone();
                triangles.rotate_left(first / 3);
                triangles[0].rotate_left(first % 3);
                let mesh = OccluderMesh::from_triangles(&triangles).unwrap();
                let Some((_, caps)) = close(&mesh) else { continue };
                closed += 1;
                let is_in_slit = |cap: &Triangle| cap.iter().all(|p| p.y == 0.0);
                assert!(caps.iter().any(is_in_slit), "{width} x {height}, from {first}: {caps:?}");
            }
        }
        assert!(closed > 0, "no house with a slit was closed");
    }

    /// Returns a cone without a base, of as many triangles as told.
    fn cone(sides: usize) -> OccluderMesh {
        let at = |i: usize| {
            let (sine, cosine) = (core::f64::consts::TAU * (i % sides) as f64 / sides as f64).sin_cos();
            DVec3::new(cosine, sine, 0.0).as_vec3()
        };
        let triangles: Vec<Triangle> = (0..sides).map(|i| [at(i), at(i + 1), Vec3::Z]).collect();
        OccluderMesh::from_triangles(&triangles).unwrap()
    }

    #[test]
    fn meshes_of_64_triangles_with_one_hole_are_closed() {
        for (sides, expected) in [(5, Some(3)), (64, Some(62)), (65, None)] {
            let caps = close(&cone(sides)).map(|(_, caps)| caps.len());
            assert_eq!(caps, expected, "caps of a cone of {sides} sides");
        }
        let cuboid = OccluderMesh::cuboid(&visibility_core::Aabb::new(Vec3::ZERO, Vec3::ONE)).unwrap();
        assert!(close(&cuboid).is_none(), "a closed mesh");
        let corners = cuboid.positions().to_vec();
        let without = |missing: &[usize]| {
            let kept = OccluderMesh::CUBOID.iter().enumerate().filter(|(i, _)| !missing.contains(i));
            let triangles: Vec<Triangle> = kept.map(|(_, t)| t.map(|i| corners[i as usize])).collect();
            close(&OccluderMesh::from_triangles(&triangles).unwrap()).map(|(_, caps)| caps.len())
        };
        assert_eq!([without(&[3]), without(&[2, 3])], [Some(1), Some(2)], "a hole in one side");
        for first in 0..12 {
            for second in first + 1..12 {
                let caps = without(&[first, second]);
                let is_right = caps.is_none() || caps == Some(2);
                assert!(is_right, "{caps:?} close a cuboid without {first} and {second}");
                let [a, b] = [first, second].map(|i| OccluderMesh::CUBOID[i]);
                let common = a.iter().filter(|corner| b.contains(corner)).count();
                assert!(common == 2 || caps.is_none(), "{caps:?}: two holes, at {first} and {second}");
            }
        }
    }

    /// Solids are found again when an object changes that is an occluder or was one. Their bounds are widened
    /// by their slack. What a transform flattens is no solid.
    #[test]
    fn solids_are_those_of_the_occluders() {
        use visibility_core::glam::Affine3A;
        use visibility_core::{Aabb, Object};
        let (mut scene, mut solids) = (Scene::new(), Solids::new());
        let around = Aabb::new(Vec3::splat(-9.0), Vec3::splat(9.0));
        let add = |scene: &mut Scene, mesh: OccluderMesh, scale: Vec3| {
            let id = scene.insert(Object { occluder: true, ..Object::new(around) });
            let mesh = scene.add_mesh(mesh);
            scene.set_mesh(id, mesh, Affine3A::from_scale(scale)).unwrap();
            id
        };
        let [o, x, y, z] = [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z];
        let sides = [[o, y, x], [o, x, z], [o, z, y], [x, y, z]];
        let mesh = || OccluderMesh::from_triangles(&sides).unwrap();
        let first = add(&mut scene, mesh(), Vec3::new(1.0, 2.0, -3.0));
        add(&mut scene, mesh(), Vec3::new(1.0, 2.0, 0.0));
        let post = scene.insert(around);
        assert!(solids.sync(&scene) && !solids.sync(&scene), "the first time, and nothing new");
        let [Solid { id, ref blocker, min, max, .. }] = solids.list[..] else {
            panic!("{} solids, of one that is flat and one that is not", solids.list.len());
        };
        let slack = blocker.slack;
        assert!(id == first && slack > 1e-6, "the solid of {id} with the slack {slack}");
        let expected = [DVec3::new(0.0, 0.0, -3.0) - slack, DVec3::new(1.0, 2.0, 0.0) + slack];
        assert_eq!([min, max], expected, "bounds of the solid");
        scene.set_bounds(post, Aabb::new(Vec3::ZERO, Vec3::ONE)).unwrap();
        assert!(!solids.sync(&scene), "an object that hides nothing has changed");
        scene.set_occluder(first, false).unwrap();
        assert!(solids.sync(&scene) && solids.list.is_empty(), "the solid's object hides nothing any more");
        assert!(!solids.sync(&scene), "nothing new");
        scene.set_occluder(first, true).unwrap();
        assert!(solids.sync(&scene) && solids.list.len() == 1, "it hides again");
    }

    #[cfg(feature = "papers")]
    #[test]
    fn solids_meet_what_touches_them() {
        let (min, max) = (DVec3::ZERO, DVec3::ONE);
        let mesh = OccluderMesh::cuboid(&visibility_core::Aabb::new(Vec3::ZERO, Vec3::ONE)).unwrap();
        let (id, blocker) = (Scene::new().insert(*mesh.bounds()), Blocker::cuboid(min, max));
        let solid = Solid { id, mesh, blocker, min, max };
        for axis in 0..3 {
            for (low, high, meets) in
                [(1.0, 2.0, true), (-1.0, 0.0, true), (1.0f64.next_up(), 2.0, false), (-1.0, -1e-300, false)]
            {
                let (mut from, mut to) = (DVec3::splat(0.4), DVec3::splat(0.6));
                (from[axis], to[axis]) = (low, high);
                assert_eq!(solid.meets(from, to), meets, "{from} to {to}");
            }
        }
    }

    /// Triangles of what may not be drawn hide nothing.
    #[test]
    fn objects_that_are_always_drawn_hide() {
        use visibility_core::glam::Affine3A;
        use visibility_core::{Aabb, Object};
        for change in visibility_testing::NOT_ALWAYS_DRAWN {
            let mut scene = Scene::new();
            let bounds = Aabb::new(Vec3::ZERO, Vec3::ONE);
            let ids = [(); 3].map(|()| scene.insert(Object { occluder: true, ..Object::new(bounds) }));
            for id in &ids[..2] {
                let mesh = scene.add_mesh(OccluderMesh::cuboid(&bounds).unwrap());
                scene.set_mesh(*id, mesh, Affine3A::IDENTITY).unwrap();
            }
            change(&mut scene, ids[1]);
            let found = occluding(&scene, &VisibleSet::new());
            let found: Vec<usize> = found.iter().collect();
            assert_eq!(found, [ids[0].index()], "one of two with a mesh, and none without");
        }
    }

    #[test]
    fn slivers_are_dropped_in_the_plane_of_a_cap_only() {
        let p = |x: f32, y: f32, z: f32| Vec3::new(x, y, z);
        let solid = OccluderMesh::from_triangles(&[
            [p(0.0, 0.0, 0.0), p(0.0, 4.0, 0.0), p(4.0, 0.0, 0.0)],
            [p(0.0, 0.0, 0.0), p(4.0, 0.0, 0.0), p(0.0, 0.0, 4.0)],
            [p(0.0, 0.0, 0.0), p(0.0, 0.0, 4.0), p(0.0, 4.0, 0.0)],
            [p(4.0, 0.0, 0.0), p(0.0, 4.0, 0.0), p(0.0, 0.0, 4.0)],
        ]);
        let solid = solid.unwrap();
        let bottom = [p(0.0, 0.0, 0.0), p(0.0, 4.0, 0.0), p(4.0, 0.0, 0.0)];
        let sliver = |z: f32| [p(0.0, 0.0, 0.0), p(4.0, 0.0, 0.0), p(4.0, 1e-5, z)];
        assert_eq!(
            caps(&[bottom, sliver(0.0)], &solid),
            Some(vec![bottom]),
            "the sliver in the plane of the cap is dropped"
        );
        assert_eq!(caps(&[sliver(1e-6), bottom], &solid), Some(vec![bottom]), "as deep as the dents may be");
        for turns in 1..3 {
            let mut turned = sliver(0.0);
            turned.rotate_left(turns);
            assert_eq!(caps(&[turned, bottom], &solid), Some(vec![bottom]), "from corner {turns} on");
        }
        assert_eq!(caps(&[bottom, sliver(1e-5)], &solid), None, "a sliver deeper than dents may be");
        assert_eq!(caps(&[sliver(0.0)], &solid), None, "no cap has a plane");
    }
}
