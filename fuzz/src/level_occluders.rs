//! The file of a level's occluders, or any bytes in its place, with arbitrary changes and a repaired
//! checksum. It must be refused with an error, or be drawn into a z-buffer from several sides.

use crate::{change, mend};
use std::sync::{Arc, OnceLock};
use visibility_core::glam::{DVec3, Vec3};
use visibility_core::{Aabb, OcclusionMap, Pose, View};
use visibility_hzb::Hzb;
use visibility_occluders::{LevelOccluders, LevelSettings, LevelTriangle};
use visibility_testing::Random;

/// Returns the file of a few walls in clusters of a few edges. Some walls have holes.
fn real() -> &'static [u8] {
    static REAL: OnceLock<Vec<u8>> = OnceLock::new();
    REAL.get_or_init(|| {
        let mut random = Random(5);
        let mut triangles = Vec::new();
        for (wall, u, v) in (0..4).flat_map(|w| (0..9).map(move |at| (w, at / 3, at % 3))) {
            let at = |u: i32, v: i32| Vec3::new(wall as f32 * 3.0, u as f32, v as f32);
            let [a, b, c, d] = [at(u, v), at(u + 1, v), at(u + 1, v + 1), at(u, v + 1)];
            triangles.push(LevelTriangle { corners: [a, b, c], two_sided: wall % 2 == 0 });
            if !random.one_in(5) {
                triangles.push(LevelTriangle { corners: [a, c, d], two_sided: wall % 2 == 0 });
            }
        }
        let settings = LevelSettings::default().with_max_cluster_edges(24).with_kept_area(0.9);
        LevelOccluders::new(&triangles, settings).expect("a few walls").to_bytes()
    })
}

/// Runs the target on some bytes. Returns whether the changed file was accepted.
pub fn run(bytes: &[u8]) -> bool {
    let Some((&kind, bytes)) = bytes.split_first() else { return false };
    let mut file = if kind % 8 == 0 { bytes.to_vec() } else { real().to_vec() };
    if kind % 8 != 0 {
        change(&mut file, bytes);
    }
    mend(&mut file);
    let Ok(level) = LevelOccluders::from_bytes(&file, None) else { return false };
    // A level with a NaN in its report differs from itself, but its bytes do not.
    let again = LevelOccluders::from_bytes(&level.to_bytes(), None).map(|level| level.to_bytes());
    assert_eq!(again, Ok(level.to_bytes()), "a level's own bytes");
    let mut hzb = Hzb::new(64, 36).expect("a picture").with_min_polygon_area(0.0);
    hzb = hzb.with_level(Arc::new(level), DVec3::ZERO);
    for eye in [DVec3::new(-2.0, 1.5, 1.5), DVec3::new(1.5, 1.0, 1.0), DVec3::new(30.0, -9.0, 5.0)] {
        let pose = Pose::look_at(eye, DVec3::new(4.0, 1.5, 1.5), DVec3::Z);
        let view = View::perspective(pose, 1.0, 16.0 / 9.0, 0.1, 100.0).expect("a view");
        hzb.begin(&view, DVec3::ZERO);
        hzb.flush();
        hzb.test(&Aabb::from_arrays([10.0, 1.0, 1.0], [11.0, 2.0, 2.0]));
    }
    true
}
