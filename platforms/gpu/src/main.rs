//! Flies through a built-in scene with several cullers, and prints for each the objects reported, the visible
//! objects missed, and the time.
//!
//! ```text
//! visibility-gpu [--scene RECIPE] [--frames N] [--size WIDTHxHEIGHT] [--screenshot DIR] [--window]
//! ```

use std::error::Error;
use std::path::PathBuf;
use std::time::Instant;
use visibility_core::{FrustumCuller, Pipeline, View, VisibleSet};
use visibility_gpu::{Culling, Gpu, GpuError, Method, Viewer};
use visibility_hzb::{Hzb, HzbCuller};

const USAGE: &str =
    "visibility-gpu [--scene RECIPE] [--frames N] [--size WIDTHxHEIGHT] [--screenshot DIR] [--window]";

/// Exit status on a machine without a graphics adapter.
const NO_ADAPTER: i32 = 77;

/// Ratio of the number of frames in the walks to the number of measured frames.
const SLOWNESS: usize = 10;

/// Values of the command line.
struct Arguments {
    scene: String,
    frames: usize,
    size: [u32; 2],
    screenshots: Option<PathBuf>,
    window: bool,
}

fn arguments() -> Result<Arguments, Box<dyn Error>> {
    let mut result = Arguments {
        scene: "plpcity:2,2".to_owned(),
        frames: 60,
        size: [640, 360],
        screenshots: None,
        window: false,
    };
    let mut words = std::env::args().skip(1);
    while let Some(word) = words.next() {
        let mut value = || words.next().ok_or_else(|| format!("{word} needs a value\n{USAGE}"));
        match word.as_str() {
            "--scene" => result.scene = value()?,
            "--frames" => result.frames = value()?.parse()?,
            "--size" => {
                let size = value()?;
                let (width, height) = size.split_once('x').ok_or("a size is like 640x360")?;
                result.size = [width.parse()?, height.parse()?];
            }
            "--screenshot" => result.screenshots = Some(value()?.into()),
            "--window" => result.window = true,
            "--help" => {
                println!("{USAGE}");
                std::process::exit(0);
            }
            _ => return Err(format!("`{word}` is not understood\n{USAGE}").into()),
        }
    }
    Ok(result)
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments = arguments()?;
    if arguments.window {
        return window(&arguments);
    }
    let gpu = match Gpu::open() {
        Err(GpuError::NoAdapter(cause)) => {
            eprintln!("no graphics adapter: {cause}");
            std::process::exit(NO_ADAPTER);
        }
        opened => opened?,
    };
    let [width, height] = arguments.size;
    println!("{}, {width} x {height} pixels, {}", gpu.description(), arguments.scene);
    let mut viewer = Viewer::new(gpu, &arguments.scene, arguments.size)?;
    // A part of the walks around their middle, with frames as close to each other as for a walking person.
    let mut views = viewer.views(arguments.frames * SLOWNESS)?;
    let first = (views.len() - arguments.frames) / 2;
    let views: Vec<View> = views.drain(first..first + arguments.frames).collect();
    println!("{} objects, {} frames\n", viewer.world.scene.len(), views.len());
    println!(
        "{:<34} {:>9} {:>7} {:>8} {:>8}",
        "per frame, on average", "reported", "missing", "cull ms", "all ms"
    );
    for mut method in Method::all(&viewer) {
        measure(&mut method, &mut viewer, &views)?;
    }
    match &arguments.screenshots {
        Some(folder) => screenshots(&mut viewer, &views, folder),
        None => Ok(()),
    }
}

#[cfg(feature = "window")]
fn window(arguments: &Arguments) -> Result<(), Box<dyn Error>> {
    visibility_gpu::fly(&arguments.scene, arguments.size)
}

#[cfg(not(feature = "window"))]
fn window(_: &Arguments) -> Result<(), Box<dyn Error>> {
    Err("built without a window: cargo run --features window -- --window".into())
}

/// Culls and draws each view, waits for each picture, and prints mean values.
fn measure(method: &mut Method, viewer: &mut Viewer, views: &[View]) -> Result<(), Box<dyn Error>> {
    let (mut reported, mut missing, mut cull_ms, mut all_ms) = (0, 0, 0.0, 0.0);
    let mut visible = VisibleSet::new();
    for view in views {
        viewer.draw_all(view);
        let shown = viewer.target.visible(&viewer.gpu)?;
        let start = Instant::now();
        let culled = method.frame(viewer, view, &mut visible)?;
        viewer.gpu.wait()?;
        all_ms += start.elapsed().as_secs_f64() * 1e3;
        cull_ms += culled;
        if let Culling::TwoPhase(_, culler) = &method.culling {
            let states = culler.states(&viewer.gpu)?;
            reported += states.iter().filter(|&&(_, drawn)| drawn).count();
            missing += shown.iter().filter(|&&object| !states[object].1).count();
        } else {
            reported += visible.count(&viewer.world.scene);
            missing += Viewer::missing(&viewer.world.scene, &shown, &visible);
        }
    }
    let mean = |sum: f64| sum / views.len().max(1) as f64;
    println!(
        "{:<34} {:>9.1} {missing:>7} {:>8.3} {:>8.2}",
        method.name,
        mean(reported as f64),
        mean(cull_ms),
        mean(all_ms)
    );
    Ok(())
}

/// Writes pictures from the middle of the walk: from the eye with and without culling, and from above.
fn screenshots(viewer: &mut Viewer, views: &[View], folder: &std::path::Path) -> Result<(), Box<dyn Error>> {
    std::fs::create_dir_all(folder)?;
    let Some(view) = views.get(views.len() / 2) else { return Ok(()) };
    let mut in_frustum = VisibleSet::new();
    let mut visible = VisibleSet::new();
    let mut frustum = Pipeline::new().with(FrustumCuller::new());
    frustum.cull(&viewer.world.scene, view, &mut in_frustum);
    frustum = frustum.with(HzbCuller::new(Hzb::default()));
    frustum.cull(&viewer.world.scene, view, &mut visible);
    viewer.draw_all(view);
    viewer.save(&folder.join("eye.png"))?;
    viewer.draw(view, visible.ids(&viewer.world.scene));
    viewer.save(&folder.join("eye-culled.png"))?;
    viewer.save_from_above(&folder.join("above.png"), view, &in_frustum, &visible)?;
    println!("\neye.png, eye-culled.png and above.png are in {}", folder.display());
    Ok(())
}
