mod shared_scenes;
use glam::{DVec3, Vec3};
use shared_scenes::stored;
use std::collections::HashMap;
use visibility_core::Eye;
use visibility_core::backface::*;
use visibility_examples::load;

fn weld(t: &[[Vec3; 3]]) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let mut map = HashMap::new();
    let mut pos = vec![];
    let idx = t
        .iter()
        .map(|t| {
            t.map(|p| {
                *map.entry(p.to_array().map(f32::to_bits)).or_insert_with(|| {
                    pos.push(p);
                    pos.len() as u32 - 1
                })
            })
        })
        .collect();
    (pos, idx)
}

#[test]
fn share() {
    let scene = load(&stored("car.vscn").unwrap()).unwrap();
    let (lo, hi) = scene.bounds().unwrap();
    let c = ((lo + hi) * 0.5).as_dvec3();
    let r = (hi - lo).as_dvec3().length() * 0.5;
    println!("center {c} r {r}");
    let mut sizes: Vec<usize> = scene.objects.iter().map(|o| o.triangles.len()).collect();
    sizes.sort();
    let total: usize = sizes.iter().sum();
    for lim in [64, 128, 256, 512, 1024, 100000] {
        println!("{lim}: {:.3}", sizes.iter().filter(|&&s| s < lim).sum::<usize>() as f64 / total as f64);
    }
    for whole in [false, true] {
        let soups: Vec<Vec<[Vec3; 3]>> = if whole {
            vec![scene.objects.iter().flat_map(|o| o.triangles.clone()).collect()]
        } else {
            scene.objects.iter().map(|o| o.triangles.clone()).collect()
        };
        let start = std::time::Instant::now();
        let clusters: Vec<(Cluster, usize)> = soups
            .iter()
            .enumerate()
            .flat_map(|(i, s)| {
                let (p, ix) = weld(s);
                cluster_mesh(&p, &ix).unwrap().into_iter().map(move |c| (c, i))
            })
            .collect();
        let open: usize = clusters.iter().filter(|c| c.0.cone.is_open()).map(|c| c.0.triangles.len()).sum();
        println!(
            "whole {whole}: {} clusters, {:?}, open {:.3}",
            clusters.len(),
            start.elapsed(),
            open as f64 / total as f64
        );
        let mut s = 1u64;
        let mut rnd = || {
            s = s.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (s >> 33) as f64 / (1u64 << 31) as f64
        };
        for dist in [0.0, 1.0, 2.0, 4.0, 1000.0] {
            let (mut culled, mut back, mut n) = (0usize, 0usize, 0usize);
            for _ in 0..20 {
                let d = loop {
                    let d = DVec3::new(rnd() - 0.5, rnd() - 0.5, rnd() - 0.5) * 2.0;
                    if d.length() < 1.0 {
                        break d;
                    }
                };
                let e = if dist == 0.0 { c + d * r } else { c + d.normalize() * r * dist };
                let eye = Eye::Point(e);
                for (cl, i) in &clusters {
                    n += cl.triangles.len();
                    if cl.cone.facing(&eye) == Facing::Back {
                        culled += cl.triangles.len();
                    }
                    back += cl
                        .triangles
                        .iter()
                        .filter(|&&t| facing(&soups[*i][t as usize], &eye) == Facing::Back)
                        .count();
                }
            }
            println!(
                "  dist {dist}: culled {:.3}, triangle test {:.3}",
                culled as f64 / n as f64,
                back as f64 / n as f64
            );
        }
    }
}
