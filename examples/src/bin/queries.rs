//! Program `queries`: moves cameras along walks, culls by the occlusion queries of a simulated graphics card,
//! and prints for each way to use them how many objects are drawn, how many are missing, and how many queries
//! that takes. An item buffer judges.

use clap::Parser;
use comfy_table::{Table, presets};
use std::error::Error;
use std::process::ExitCode;
use visibility_core::occlusion::LateAnswers;
use visibility_examples::arguments::{count, parse_size};
use visibility_examples::queries::{Mode, run, successive_views};
use visibility_examples::walkthrough::World;
use visibility_examples::{exit_code, open, println};
use visibility_measure::ItemBuffer;

/// Cull by late occlusion queries under a moving camera, and count queries and errors.
#[derive(Parser)]
#[command(version)]
struct Arguments {
    /// Built-in scenes, with or without sizes, or scene files.
    #[arg(default_values_t = ["plpcity:2,2".to_owned(), "london:12,12".to_owned()])]
    scenes: Vec<String>,

    /// Number of successive frames of each walk. The first half is not counted.
    #[arg(long, default_value_t = 20, value_parser = count())]
    frames: usize,

    /// Distance in metres that the eye moves in a frame: 0.05 is 3 m/s at 60 frames a second.
    #[arg(long, default_value_t = 0.05)]
    step: f64,

    /// Size of the picture in pixels.
    #[arg(long, value_name = "WxH", value_parser = parse_size::<u32>, default_value = "320x180")]
    size: [u32; 2],
}

fn main() -> ExitCode {
    exit_code(main_with(&Arguments::parse()))
}

fn main_with(arguments: &Arguments) -> Result<(), Box<dyn Error>> {
    let conservative =
        |looks_ahead, max_samples| Mode { late: LateAnswers::Visible, looks_ahead, max_samples, latency: 1 };
    let trusted = |latency, max_samples| Mode {
        late: LateAnswers::Trusted { frames: 4 },
        looks_ahead: 0,
        max_samples,
        latency,
    };
    let modes = [
        ("late answers visible", conservative(0, 0)),
        ("one look ahead", conservative(1, 0)),
        ("two looks ahead", conservative(2, 0)),
        ("two looks ahead, 4 samples", conservative(2, 4)),
        ("two looks ahead, 16 samples", conservative(2, 16)),
        ("trusted, one frame late", trusted(1, 0)),
        ("trusted, two frames late", trusted(2, 0)),
        ("trusted, one frame late, 4 samples", trusted(1, 4)),
    ];
    for name in &arguments.scenes {
        let source = open(name)?;
        let size = (arguments.size[0], arguments.size[1]);
        let walks = successive_views(&source, arguments.frames, arguments.step, size)?;
        let world = World::with_views(source, walks.concat(), Vec::new(), size);
        let mut buffer = ItemBuffer::new(size.0, size.1)?;
        let mut judged = Vec::new();
        for view in &world.views {
            judged.push(buffer.draw(view, world.origin(), world.items())?.clone());
        }
        let mut table = Table::new();
        table.load_style(presets::ASCII_MARKDOWN);
        let head = ["in the frustum", "seen", "drawn", "missing", "wrong pixels", "queries", "boxes"];
        table.set_header([world.source.name.as_str()].into_iter().chain(head));
        for (mode_name, mode) in modes {
            let totals = run(&world, &walks, &judged, mode);
            let mean = |sum: u64| format!("{:.2}", sum as f64 / totals.frames.max(1) as f64);
            let sums = [totals.in_frustum, totals.seen, totals.drawn, totals.missing];
            let more = [totals.wrong_pixels, totals.queries, totals.boxes];
            let cells = sums.into_iter().chain(more).map(mean);
            table.add_row([mode_name.to_owned()].into_iter().chain(cells));
        }
        println!("{table}");
    }
    Ok(())
}
