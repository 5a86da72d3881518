//! A picture in a room behind two walls with slits that are not in line: seen through wide slits, hidden
//! behind narrow ones. Prints a line of sight, or the size of the proof and whether it holds.
//!
//! `cargo run -p visibility-exact --example slit`

use std::error::Error;
use std::sync::Arc;
use visibility_core::glam::{DVec3, Vec3};
use visibility_core::pvs::Viewcell;
use visibility_core::{Aabb, Object, Scene};
use visibility_exact::{Effort, ExactCuller, ExactSettings, SceneTriangles, Verdict};

fn main() -> Result<(), Box<dyn Error>> {
    let cell = Viewcell::from_box(DVec3::new(0.0, -0.5, 1.0), DVec3::new(1.0, 0.5, 2.0));
    println!("slit, m   picture");
    for width in [1.0, 0.5, 0.41, 0.39, 0.2, 0.1] {
        let mut scene = Scene::new();
        let mut add = |triangles: Vec<[Vec3; 3]>| {
            let bounds = Aabb::from_points(triangles.as_flattened().iter().copied());
            let id = scene.insert(Object { occluder: true, ..Object::new(bounds) });
            scene.set_triangles(id, triangles)?;
            Ok::<_, Box<dyn Error>>(id)
        };
        let picture = add(plate(20.0, -0.5, 0.5))?;
        for (x, slit) in [(5.0, 0.0), (10.0, 0.5)] {
            add([plate(x, -30.0, slit - width / 2.0), plate(x, slit + width / 2.0, 30.0)].concat())?;
        }
        let triangles = Arc::new(SceneTriangles::new(&scene));
        let settings = ExactSettings::new(Effort::Exact(1e-4)).with_kept_proofs();
        let found = ExactCuller::new(triangles.clone(), settings).verdicts(&cell);
        let verdict = found.iter(&triangles).find(|(id, _)| *id == picture).map(|(_, verdict)| verdict);
        match verdict {
            Some(Verdict::Seen(sight)) => {
                println!("{width:7}   seen from {:.3} at {:.3}", sight.from, sight.to)
            }
            Some(Verdict::Hidden) => {
                let proofs = || found.proofs.iter().flat_map(|hidden| &hidden.proofs);
                proofs().try_for_each(|proof| proof.check(&triangles))?;
                println!(
                    "{width:7}   hidden: {} nodes, checked",
                    proofs().map(|proof| proof.len()).sum::<usize>()
                );
            }
            _ => println!("{width:7}   not decided"),
        }
    }
    Ok(())
}

/// Returns both triangles of an upright plate in the plane `x`, from y = `from` to y = `to` and z = -10 to
/// 10.
fn plate(x: f32, from: f32, to: f32) -> Vec<[Vec3; 3]> {
    let [a, b, c, d] =
        [(from, -10.0), (to, -10.0), (to, 10.0), (from, 10.0)].map(|(y, z)| Vec3::new(x, y, z));
    vec![[a, b, c], [a, c, d]]
}
