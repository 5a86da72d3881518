//! Time per frame of the visibility check, by bevy and by this crate in one run: all systems of the set
//! `CheckVisibility`, with 100,000 rotated boxes of which none, a tenth or all move.
//!
//! ```sh
//! cargo bench --bench check
//! ```
//!
//! `cargo bench --bench check -- 10000` sets the number of entities; with `occluders`, one entity in 50 is an
//! occluding wall.

#[path = "../tests/common/mod.rs"]
mod common;

use bevy_app::{App, PostUpdate};
use bevy_camera::prelude::*;
use bevy_camera::primitives::Aabb;
use bevy_camera::visibility::VisibilitySystems;
use bevy_ecs::prelude::*;
use bevy_ecs::schedule::SingleThreadedExecutor;
use bevy_math::{Quat, Vec3, Vec3A};
use bevy_mesh::Mesh3d;
use bevy_transform::prelude::*;
use common::*;
use std::time::{Duration, Instant};
use visibility_bevy::Occluder;
use visibility_testing::Random;

const CAMERA: Number = Number(u32::MAX);
const WARM_UP: usize = 10;
const FRAMES: usize = 60;

#[derive(Resource)]
struct Clock {
    begin: Instant,
    check: Duration,
}

fn world(with_plugin: bool, count: u32, with_walls: bool) -> App {
    let mut app = app(with_plugin);
    app.insert_resource(Clock { begin: Instant::now(), check: Duration::ZERO });
    let start = |mut clock: ResMut<Clock>| clock.begin = Instant::now();
    let stop = |mut clock: ResMut<Clock>| clock.check = clock.begin.elapsed();
    app.add_systems(
        PostUpdate,
        (
            start
                .before(VisibilitySystems::CheckVisibility)
                .after(VisibilitySystems::VisibilityPropagate)
                .after(VisibilitySystems::CalculateBounds)
                .after(VisibilitySystems::UpdateFrusta),
            stop.after(VisibilitySystems::CheckVisibility)
                .before(VisibilitySystems::MarkNewlyHiddenEntitiesInvisible),
        ),
    );
    app.edit_schedule(PostUpdate, |schedule| {
        schedule.set_executor(SingleThreadedExecutor::new());
    });
    let mut random = Random(1);
    for number in 0..count {
        let transform = Transform {
            translation: random.vec3(-500.0, 500.0) * Vec3::new(1.0, 0.05, 1.0),
            rotation: Quat::from_rotation_y(random.range(0.0, 6.0) as f32),
            scale: Vec3::ONE,
        };
        let aabb = Aabb { center: Vec3A::ZERO, half_extents: random.vec3(0.2, 2.0).into() };
        if with_walls && number.is_multiple_of(50) {
            let wall = Aabb { center: Vec3A::ZERO, half_extents: Vec3A::new(12.0, 10.0, 0.5) };
            app.world_mut().spawn((drawn(number, transform), wall, Occluder::Box));
        } else {
            app.world_mut().spawn((drawn(number, transform), aabb));
        }
    }
    app.world_mut().spawn((CAMERA, Camera3d::default(), Transform::from_xyz(0.0, 5.0, 0.0)));
    app
}

/// Runs a frame in which every `one_in`th entity has moved and the camera has turned. Returns the time of the
/// visibility check.
fn frame(app: &mut App, number: usize, one_in: Option<usize>) -> Duration {
    let mut moving = app.world_mut().query_filtered::<&mut Transform, With<Mesh3d>>();
    let way = if number.is_multiple_of(2) { 0.1 } else { -0.1 };
    if let Some(one_in) = one_in {
        for mut transform in moving.iter_mut(app.world_mut()).step_by(one_in) {
            transform.translation.x += way;
        }
    }
    let mut cameras = app.world_mut().query_filtered::<&mut Transform, With<Camera>>();
    for mut transform in cameras.iter_mut(app.world_mut()) {
        transform.rotate_y(0.02);
    }
    app.update();
    app.world().resource::<Clock>().check
}

fn main() {
    let numbers: Vec<u32> = std::env::args().filter_map(|argument| argument.parse().ok()).collect();
    let with_walls = std::env::args().any(|argument| argument == "occluders");
    let counts = if numbers.is_empty() { vec![100_000] } else { numbers };
    println!(" entities  moving   bevy us   ours us  ratio     bevy     ours visible");
    for count in counts {
        let mut apps = [false, true].map(|with_plugin| world(with_plugin, count, with_walls));
        for (name, one_in) in [("0 %", None), ("10 %", Some(10)), ("100 %", Some(1))] {
            let mut times = [Vec::new(), Vec::new()];
            for number in 0..WARM_UP + FRAMES {
                // The apps alternate frame by frame, so that other load on the machine affects both alike.
                for (app, times) in apps.iter_mut().zip(&mut times) {
                    let time = frame(app, number, one_in);
                    if number >= WARM_UP {
                        times.push(time);
                    }
                }
            }
            let [bevy, ours] = times.map(|mut times| {
                times.sort();
                times[FRAMES / 2].as_secs_f64() * 1e6
            });
            let [seen, visible] = [0, 1].map(|i| seen_by(&mut apps[i], CAMERA).len());
            let ratio = bevy / ours;
            println!("{count:>9} {name:>7} {bevy:>9.0} {ours:>9.0} {ratio:>6.2} {seen:>8} {visible:>8}");
        }
    }
}
