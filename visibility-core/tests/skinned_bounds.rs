//! Tests of the bounds of skinned meshes: random poses against every vertex, computed as shaders do.

use visibility_core::glam::{Affine3A, DAffine3, DVec3, Quat, Vec3};
use visibility_core::scene::{SkinError, SkinnedBounds};
use visibility_core::{Aabb, Scene};
use visibility_testing::Random;

/// A mesh whose vertices have `N` bones each.
struct Mesh<const N: usize> {
    positions: Vec<[f32; 3]>,
    joints: Vec<[u16; N]>,
    weights: Vec<[f32; N]>,
}

impl<const N: usize> Mesh<N> {
    /// Makes a random mesh in which the weights of each vertex sum to about `sum`.
    fn new(rng: &mut Random, vertices: usize, bones: usize, sum: f32) -> Self {
        let mut mesh = Self { positions: Vec::new(), joints: Vec::new(), weights: Vec::new() };
        for _ in 0..vertices {
            let mut weights = [(); N].map(|()| if rng.one_in(3) { 0.0 } else { rng.unit() as f32 });
            let total: f32 = weights.iter().sum();
            weights = weights.map(|weight| weight * (sum / (total + 1e-20)));
            mesh.positions.push(rng.vec3(-2.0, 2.0).to_array());
            mesh.joints.push([(); N].map(|()| rng.below(bones) as u16));
            mesh.weights.push(weights);
        }
        mesh
    }

    fn bounds(&self) -> SkinnedBounds {
        SkinnedBounds::new(&self.positions, &self.joints, &self.weights).unwrap()
    }

    /// Returns a vertex in a pose: in f64, in f32 with blended matrices, and in f32 with blended points.
    fn skinned(&self, vertex: usize, pose: &[Affine3A]) -> [DVec3; 3] {
        let position = Vec3::from_array(self.positions[vertex]);
        let (mut exact, mut points, mut columns) = (DVec3::ZERO, Vec3::ZERO, [0.0f32; 12]);
        for (&joint, &weight) in self.joints[vertex].iter().zip(&self.weights[vertex]) {
            let matrix = pose[usize::from(joint)];
            let wide = DAffine3::from_cols_array(&matrix.to_cols_array().map(f64::from));
            exact += f64::from(weight) * wide.transform_point3(position.as_dvec3());
            points += weight * matrix.transform_point3(position);
            for (sum, x) in columns.iter_mut().zip(matrix.to_cols_array()) {
                *sum += weight * x;
            }
        }
        let blended = Affine3A::from_cols_array(&columns).transform_point3(position);
        [exact, blended.as_dvec3(), points.as_dvec3()]
    }
}

fn random_pose(rng: &mut Random, bones: usize) -> Vec<Affine3A> {
    let reach = rng.pick(&[0.0, 1.0, 1000.0]);
    let turn = |rng: &mut Random| {
        let axis = rng.direction().as_vec3();
        Quat::from_axis_angle(axis, rng.range(-3.0, 3.0) as f32)
    };
    let bone = |rng: &mut Random| {
        let scale = rng.vec3(-1.0, 3.0);
        Affine3A::from_scale_rotation_translation(scale, turn(rng), rng.vec3(-reach, reach))
    };
    (0..bones).map(|_| bone(rng)).collect()
}

fn contains(bounds: &Aabb, p: DVec3) -> bool {
    p.cmpge(bounds.min.as_dvec3()).all() && p.cmple(bounds.max.as_dvec3()).all()
}

fn check<const N: usize>(seed: u64) {
    let mut rng = Random(seed);
    for round in 0..300 {
        let sum = rng.pick(&[1.0, 1.0, 0.4, 1.7]);
        let (vertices, bones) = (1 + rng.below(20), 1 + rng.below(8));
        let mesh = Mesh::<N>::new(&mut rng, vertices, bones, sum);
        let skin = mesh.bounds();
        let pose = random_pose(&mut rng, bones);
        let bounds = skin.bounds(&pose);
        let arrays: Vec<_> = pose.iter().map(Affine3A::to_cols_array).collect();
        assert!(
            bounds.is_finite() && bounds == skin.bounds(&arrays),
            "round {round}: {bounds:?} by arrays is the same and finite"
        );
        for vertex in 0..vertices {
            for point in mesh.skinned(vertex, &pose) {
                assert!(contains(&bounds, point), "round {round}, {vertex}: {point} {bounds:?}");
            }
        }
    }
}

#[test]
fn skinned_bounds_contain_every_vertex_in_any_pose() {
    check::<1>(1);
    check::<4>(2);
    check::<8>(3);
}

/// Tests vertices whose many equal terms are all rounded the same way when they are summed in `f32`.
#[test]
fn skinned_bounds_contain_what_f32_computes() {
    let mut rng = Random(4);
    for _ in 0..500 {
        let weights = [[rng.range(0.8, 1.6) as f32 / 64.0; 64]];
        let mesh = Mesh { positions: vec![[0.0; 3]], joints: vec![[0; 64]], weights: weights.to_vec() };
        let pose = [Affine3A::from_translation(rng.vec3(1.0, 2.0))];
        let bounds = mesh.bounds().bounds(&pose);
        for point in mesh.skinned(0, &pose) {
            assert!(contains(&bounds, point), "{point} {bounds:?}");
        }
    }
}

#[test]
fn skinned_bounds_are_tight() {
    let positions = [[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 2.0, 1.0]];
    let skin = SkinnedBounds::new(&positions, &[[0]; 3], &[[1.0]; 3]).unwrap();
    let bounds = skin.bounds(&[Affine3A::from_translation(Vec3::splat(5.0))]);
    let wanted = Aabb::from_arrays([4.0, 5.0, 5.0], [6.0, 7.0, 6.0]);
    let off = [bounds.min - wanted.min, bounds.max - wanted.max];
    assert!(off.iter().all(|v| v.abs().max_element() < 1e-4), "{bounds:?}");
}

#[test]
fn skins_that_cannot_be_are_errors_or_never_culled() {
    let new = |position: f32, weights: [f32; 2]| {
        SkinnedBounds::new(&[[0.0; 3], [position, 0.0, 0.0]], &[[0, 1]; 2], &[[1.0, 0.0], weights])
    };
    assert_eq!(
        new(f32::NAN, [1.0, 0.0]).unwrap_err(),
        SkinError::Position(1),
        "the vertex with a position of NaN"
    );
    for weight in [-0.1, f32::NAN, f32::INFINITY] {
        assert_eq!(
            new(1.0, [1.0, weight]).unwrap_err(),
            SkinError::Weight(1),
            "the vertex with a weight of {weight}"
        );
    }
    assert_eq!(
        SkinnedBounds::new(&[[0.0; 3]], &[[0u16]; 2], &[[1.0]]).unwrap_err(),
        SkinError::Lengths,
        "more joints than positions"
    );
    let skin = new(1.0, [0.5, 0.5]).unwrap();
    let mut pose = [Affine3A::IDENTITY; 2];
    assert!(skin.bounds(&pose).is_finite(), "a pose of the identity");
    assert!(!skin.bounds(&pose[..1]).is_proper(), "a bone is missing");
    pose[1].translation.x = f32::NAN;
    assert!(!skin.bounds(&pose).is_proper(), "a bone at NaN");
    pose[1].translation.x = f32::MAX;
    pose[1].matrix3.x_axis.x = f32::MAX;
    assert!(!skin.bounds(&pose).is_finite(), "a bone so far away that its sum overflows");
    let none = SkinnedBounds::new::<4>(&[], &[], &[]).unwrap();
    assert!(!none.bounds(&pose).is_proper(), "a skin without vertices bounds nothing");
    // No weights: the vertices are at the origin.
    let bounds = SkinnedBounds::new(&[[7.0; 3]], &[[0]], &[[0.0]]).unwrap().bounds(&pose);
    assert!(bounds.contains_point(Vec3::ZERO) && bounds.is_finite(), "vertices without weights: {bounds:?}");
    let mut scene = Scene::new();
    let id = scene.insert(skin.bounds(&[Affine3A::IDENTITY; 2]));
    assert!(scene.set_bounds(id, none.bounds(&pose)).is_ok(), "a box that bounds nothing is accepted");
}

/// Processors that take numbers below the least normal one for zero: a weight times an element of a matrix is
/// lost before a great coordinate multiplies it.
#[test]
fn blended_matrices_that_underflow_stay_within_the_bounds() {
    let position = [1e30, 0.0, 0.0];
    let bounds = SkinnedBounds::new(&[position], &[[0, 1]], &[[0.5, 0.5]]).unwrap();
    let matrix = Affine3A::from_scale(Vec3::splat(2e-38));
    let bounds = bounds.bounds(&[matrix, matrix]);
    assert!(bounds.contains_point(Vec3::ZERO), "half of 2e-38 may count as 0: {bounds:?}");
    assert!(bounds.contains_point(Vec3::X * 2e-8), "the exact place: {bounds:?}");
}
