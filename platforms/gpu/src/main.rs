//! Flies through a built-in scene with several cullers, and says what each reports, misses and costs.
//!
//! ```text
//! visibility-gpu [--scene RECIPE] [--frames N] [--size WIDTHxHEIGHT] [--screenshot DIR]
//! ```

use std::error::Error;
use std::path::PathBuf;
use std::time::Instant;
use visibility_core::occlusion::{HardwareQueries, LateAnswers};
use visibility_core::{Culler, FrustumCuller, OcclusionCuller, Pipeline, View, VisibleSet};
use visibility_gpu::{CardQueries, Delay, Gpu, GpuError, TwoPhaseCuller, Viewer};
use visibility_hzb::{Hzb, HzbCuller};

const USAGE: &str = "visibility-gpu [--scene RECIPE] [--frames N] [--size WIDTHxHEIGHT] [--screenshot DIR]";

/// Exit status on a machine without a graphics adapter.
const NO_ADAPTER: i32 = 77;

/// How many times as many frames the walks have as are measured.
const SLOWNESS: usize = 10;

/// What the command line asks for.
struct Arguments {
    scene: String,
    frames: usize,
    size: [u32; 2],
    screenshots: Option<PathBuf>,
}

fn arguments() -> Result<Arguments, Box<dyn Error>> {
    let mut result =
        Arguments { scene: "plpcity:2,2".to_owned(), frames: 60, size: [640, 360], screenshots: None };
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
    // Frames as close to each other as those of a person who walks: a part of the walks, from the middle.
    let mut views = viewer.views(arguments.frames * SLOWNESS)?;
    let first = (views.len() - arguments.frames) / 2;
    let views: Vec<View> = views.drain(first..first + arguments.frames).collect();
    println!("{} objects, {} frames\n", viewer.world.scene.len(), views.len());
    println!(
        "{:<34} {:>9} {:>7} {:>8} {:>8}",
        "per frame, on average", "reported", "missing", "cull ms", "all ms"
    );
    for mut method in methods(&viewer) {
        method.measure(&mut viewer, &views)?;
    }
    match &arguments.screenshots {
        Some(folder) => screenshots(&mut viewer, &views, folder),
        None => Ok(()),
    }
}

/// A way of culling, and where its time goes.
struct Method {
    name: &'static str,
    culling: Culling,
}

enum Culling {
    /// All objects are drawn.
    None,
    /// On the processor alone.
    Pipeline(Pipeline),
    /// On the processor, with answers of the card.
    Queries(Box<OcclusionCuller<HardwareQueries<CardQueries>>>),
    /// On the card, what a pipeline leaves.
    TwoPhase(Pipeline, Box<TwoPhaseCuller>),
}

fn methods(viewer: &Viewer) -> Vec<Method> {
    let Viewer { gpu, world, meshes, painter, target, .. } = viewer;
    let frustum = || Pipeline::new().with(FrustumCuller::new());
    let z_buffer = || frustum().with(HzbCuller::new(Hzb::default()));
    let queries = |late| {
        let card = CardQueries::new(gpu, painter, Delay::Frames(1));
        Culling::Queries(Box::new(OcclusionCuller::new(HardwareQueries::new(card, late)).with_price(0)))
    };
    let two_phase = |pipeline| {
        let culler = TwoPhaseCuller::new(gpu, &world.scene, meshes, painter, target);
        Culling::TwoPhase(pipeline, Box::new(culler))
    };
    [
        ("all objects", Culling::None),
        ("frustum", Culling::Pipeline(frustum())),
        ("z-buffer on the processor", Culling::Pipeline(z_buffer())),
        ("queries, late answers visible", queries(LateAnswers::Visible)),
        ("queries, late answers trusted", queries(LateAnswers::Trusted { frames: 4 })),
        ("two phases on the card", two_phase(frustum())),
        ("z-buffer, then two phases", two_phase(z_buffer())),
    ]
    .into_iter()
    .map(|(name, culling)| Method { name, culling })
    .collect()
}

impl Method {
    /// Culls and draws each view, waits for each picture, and prints the means.
    fn measure(&mut self, viewer: &mut Viewer, views: &[View]) -> Result<(), Box<dyn Error>> {
        let (mut reported, mut missing, mut cull_ms, mut all_ms) = (0, 0, 0.0, 0.0);
        let mut visible = VisibleSet::new();
        for view in views {
            viewer.draw_all(view);
            let shown = viewer.target.visible(&viewer.gpu)?;
            let start = Instant::now();
            let culled = self.frame(viewer, view, &mut visible)?;
            viewer.gpu.wait()?;
            all_ms += start.elapsed().as_secs_f64() * 1e3;
            cull_ms += culled;
            if let Culling::TwoPhase(_, culler) = &self.culling {
                let states = culler.states(&viewer.gpu)?;
                reported += states.iter().filter(|&&(_, drawn)| drawn).count();
                missing += shown.iter().filter(|&&object| !states[object].1).count();
            } else {
                reported += visible.ids().len();
                missing += Viewer::missing(&viewer.world.scene, &shown, &visible);
            }
        }
        let mean = |sum: f64| sum / views.len().max(1) as f64;
        println!(
            "{:<34} {:>9.1} {missing:>7} {:>8.3} {:>8.2}",
            self.name,
            mean(reported as f64),
            mean(cull_ms),
            mean(all_ms)
        );
        Ok(())
    }

    /// Culls and draws one view. Returns the milliseconds of the processor's culling.
    fn frame(
        &mut self,
        viewer: &mut Viewer,
        view: &View,
        visible: &mut VisibleSet,
    ) -> Result<f64, Box<dyn Error>> {
        let start = Instant::now();
        let elapsed = || start.elapsed().as_secs_f64() * 1e3;
        let scene = &viewer.world.scene;
        match &mut self.culling {
            Culling::None => {
                visible.clear(scene);
                visible.fill(scene, view);
                visible.finish(scene);
            }
            Culling::Pipeline(pipeline) | Culling::TwoPhase(pipeline, _) => {
                pipeline.cull(scene, view, visible);
            }
            Culling::Queries(culler) => {
                visible.fill(scene, view);
                FrustumCuller::new().cull(scene, view, visible);
                culler.cull(scene, view, visible);
                visible.finish(scene);
            }
        }
        let cull_ms = elapsed();
        if let Culling::TwoPhase(_, culler) = &mut self.culling {
            viewer.look(view);
            culler.draw(&viewer.gpu, &viewer.target, &viewer.meshes, &viewer.painter, visible)?;
            return Ok(cull_ms);
        }
        viewer.draw(view, visible.ids());
        if let Culling::Queries(culler) = &mut self.culling {
            culler.map_mut().device_mut().submit(&viewer.target);
        }
        Ok(cull_ms)
    }
}

/// Writes pictures of the middle of the walk: from the eye without and with culling, and from above.
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
    viewer.draw(view, visible.ids());
    viewer.save(&folder.join("eye-culled.png"))?;
    viewer.save_from_above(&folder.join("above.png"), view, &in_frustum, &visible)?;
    println!("\neye.png, eye-culled.png and above.png are in {}", folder.display());
    Ok(())
}
