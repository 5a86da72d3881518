//! Program `occlusion`: culls the boxes of a VISC file behind its occluders, and prints times and errors for
//! each view.

use clap::{Parser, ValueEnum};
use std::error::Error;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;
use visibility_examples::arguments::parse_size;
use visibility_examples::output_file::write;
use visibility_examples::visc::frame::Stage;
use visibility_examples::visc::{picture, scene_file, visibility_file};
use visibility_examples::{exit_code, println};
use visibility_hzb::Coverage;

/// Cull the boxes of a VISC scene behind its occluders with the hierarchical z-buffer, for each of its views.
#[derive(Parser)]
#[command(version)]
struct Arguments {
    /// VISC file with occluders, boxes and views to cull.
    #[arg(value_name = "FILE.visc")]
    file: PathBuf,

    /// Size of the z-buffer in pixels. By default each view's own size.
    #[arg(long, value_name = "WxH", value_parser = parse_size::<usize>)]
    size: Option<[usize; 2]>,

    /// Rule by which a pixel counts as covered.
    #[arg(long, value_enum, default_value = "conservative")]
    coverage: CoverageName,

    /// Number of frames culled for each view; the median time is printed.
    #[arg(long, default_value_t = 200, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    reps: u32,

    /// File to write the answers to: which boxes are visible in each view. By default none.
    #[arg(long, value_name = "FILE.visb")]
    dump: Option<PathBuf>,

    /// VISB file with reference answers to compare with; its views and boxes must match the scene's. By
    /// default answers are not compared.
    #[arg(long, value_name = "FILE.visb")]
    r#ref: Option<PathBuf>,

    /// Folder to write the z-buffer and its pyramid to as pictures, in a subfolder for each view. By default
    /// none.
    #[arg(long, value_name = "DIR")]
    pictures: Option<PathBuf>,

    /// Print a line of JSON for each view instead of a table.
    #[arg(long)]
    json: bool,
}

#[derive(Clone, Copy, ValueEnum)]
enum CoverageName {
    /// Count a pixel as covered if its whole square is covered: conservative.
    Conservative,
    /// Count a pixel as covered if its centre is covered: approximate, may hide visible boxes.
    Sampled,
}

fn main() -> ExitCode {
    exit_code(run(&Arguments::parse()))
}

fn run(arguments: &Arguments) -> Result<(), Box<dyn Error>> {
    let visc = scene_file::load(&arguments.file)?;
    let reference = arguments.r#ref.as_deref().map(visibility_file::load).transpose()?;
    if let Some(reference) = &reference
        && (reference.len() != visc.views.len()
            || reference.iter().any(|view| view.len() != visc.boxes.len()))
    {
        return Err("the reference has other views or boxes than the scene".into());
    }
    let coverage = match arguments.coverage {
        CoverageName::Conservative => Coverage::Conservative,
        CoverageName::Sampled => Coverage::Sampled,
    };
    if !arguments.json {
        println!("view  size       raster us  query us  visible  reference  false hidden  false visible");
    }
    let mut answers = Vec::new();
    for (number, (view, own)) in visc.views.iter().enumerate() {
        let size = arguments.size.unwrap_or(own.map(|side| side as usize));
        let mut stage = Stage::new(&visc, size, coverage)?;
        let times: Vec<_> = (0..arguments.reps).map(|_| stage.run(view)).collect();
        let raster = median(times.iter().map(|t| t.raster));
        let query = median(times.iter().map(|t| t.query));
        let answer = stage.answer();
        let visible = answer.iter().filter(|v| **v).count();
        let judged = reference.as_ref().map(|reference| {
            let pairs = || answer.iter().zip(&reference[number]);
            let expected = reference[number].iter().filter(|v| **v).count();
            (
                expected,
                pairs().filter(|(a, r)| !**a && **r).count(),
                pairs().filter(|(a, r)| **a && !**r).count(),
            )
        });
        let [width, height] = size;
        if arguments.json {
            let mut line = serde_json::json!({
                "file": arguments.file, "view": number, "width": width, "height": height,
                "raster_us": raster, "query_us": query, "visible": visible,
            });
            if let Some((expected, hidden, extra)) = judged {
                line["reference"] = expected.into();
                line["false_hidden"] = hidden.into();
                line["false_visible"] = extra.into();
            }
            println!("{line}");
        } else {
            let judged = judged.map_or_else(String::new, |(a, b, c)| format!("{a:>9}  {b:>12}  {c:>13}"));
            println!(
                "{number:>4}  {:<9}  {raster:>9.1}  {query:>8.1}  {visible:>7}  {judged}",
                format!("{width}x{height}")
            );
        }
        if let Some(folder) = &arguments.pictures {
            let folder = folder.join(format!("view-{number}"));
            picture::save(stage.map(), &folder)?;
        }
        answers.push(answer);
    }
    if let Some(path) = &arguments.dump {
        write(path, &visibility_file::write(&answers))?;
    }
    Ok(())
}

/// Returns the median in microseconds, the upper of the two middle times if their number is even. 0 without
/// times.
fn median(times: impl Iterator<Item = Duration>) -> f64 {
    let mut times: Vec<Duration> = times.collect();
    times.sort_unstable();
    times.get(times.len() / 2).map_or(0.0, |time| time.as_secs_f64() * 1e6)
}
