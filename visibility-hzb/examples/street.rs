//! A walk down a street of a generated town. Each step prints the number of objects in the frustum, the
//! number of objects that houses do not hide, and the culling time. At the end, the z-buffer is printed as
//! text.
//!
//! `cargo run --release -p visibility-hzb --example street`

use std::error::Error;
use std::time::Instant;
use visibility_core::glam::{Affine3A, DVec3, Vec3};
use visibility_core::{Aabb, Culler, FrustumCuller, Object, OccluderMesh, Pose, Scene, View, VisibleSet};
use visibility_core::{OcclusionMap, scene::SceneError};
use visibility_hzb::{Hzb, HzbCuller};

/// The town has `2 * BLOCKS` rows and columns of houses.
const BLOCKS: i32 = 40;

/// Returns the bounds, in metres, of the house at a row and column of the town: 20 m wide, with streets of 10
/// m between houses.
fn house(row: i32, column: i32) -> Aabb {
    let corner = Vec3::new(row as f32, column as f32, 0.0) * 30.0;
    let height = 8.0 + (row * 7 + column * 13).rem_euclid(9) as f32 * 3.0;
    Aabb::new(corner + Vec3::new(5.0, 5.0, 0.0), corner + Vec3::new(25.0, 25.0, height))
}

/// Builds the town's scene: houses as occluders, and twelve small objects around each house.
///
/// # Errors
/// The error type stands for meshes and transforms that the library rejects. These houses cause no error.
fn town() -> Result<Scene, Box<dyn Error>> {
    let mut scene = Scene::new();
    for (row, column) in (-BLOCKS..BLOCKS).flat_map(|row| (-BLOCKS..BLOCKS).map(move |column| (row, column)))
    {
        let bounds = house(row, column);
        let id = scene.insert(Object { occluder: true, ..Object::new(bounds) });
        let mesh = scene.add_mesh(OccluderMesh::cuboid(&bounds)?);
        scene.set_mesh(id, mesh, Affine3A::IDENTITY)?;
        for i in 0..12 {
            let angle = i as f32 * std::f32::consts::TAU / 12.0;
            let middle = bounds.center() + 14.0 * Vec3::new(angle.cos(), angle.sin(), 0.0);
            scene.insert(Aabb::new(middle.with_z(0.0) - 0.5, middle.with_z(0.0) + 0.5));
        }
    }
    scene.rebuild();
    Ok(scene)
}

/// Draws all occluders of the scene into a z-buffer and returns the buffer as text of 100 x 28 characters.
/// Nearer pixels have darker characters; uncovered pixels are blank. Never returns an error.
fn picture(scene: &Scene, view: &View) -> Result<String, SceneError> {
    let mut hzb = Hzb::default();
    hzb.begin(view, DVec3::ZERO);
    for id in scene.ids() {
        if let Some((mesh, ref transform)) = scene.occluder(id) {
            hzb.add(mesh, transform);
        }
    }
    hzb.flush();
    let shade = |column: usize, row: usize| {
        // The depth key is one over the distance in metres; negative infinity where no house covers the
        // pixel.
        match hzb.depth_key(column * hzb.width() / 100, row * hzb.height() / 28) {
            key if key > 1.0 / 20.0 => '#',
            key if key > 1.0 / 60.0 => '+',
            key if key > 1.0 / 200.0 => ':',
            key if key > 0.0 => '.',
            _ => ' ',
        }
    };
    let line = |row: usize| (0..100).map(|column| shade(column, row)).chain(['\n']).collect::<String>();
    Ok((0..28).map(line).collect())
}

fn main() -> Result<(), Box<dyn Error>> {
    let scene = town()?;
    let (mut frustum, mut occlusion) = (FrustumCuller::new(), HzbCuller::new(Hzb::default()));
    let mut visible = VisibleSet::new();
    println!("{} objects", scene.ids().count());
    for step in 0..10 {
        let eye = DVec3::new(30.0 * f64::from(step), 1.0, 1.7);
        let pose = Pose::look_at(eye, eye + DVec3::new(1.0, 0.3, 0.05), DVec3::Z);
        let view = View::perspective(pose, 1.0, 16.0 / 9.0, 0.1, f64::INFINITY)?;
        visible.fill(&scene, &view);
        frustum.cull(&scene, &view, &mut visible);
        let in_view = visible.count(&scene);
        let start = Instant::now();
        occlusion.cull(&scene, &view, &mut visible);
        let time = start.elapsed();
        println!("{in_view:6} in view, {:4} of them not hidden, found in {time:.0?}", visible.count(&scene));
        if step == 9 {
            print!("{}", picture(&scene, &view)?);
        }
    }
    Ok(())
}
