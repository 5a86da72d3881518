//! Program `plan`: computes what can be seen from points of a floor plan, and draws it.

use clap::Parser;
use std::fmt::Write as _;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;
use visibility_2d::cdt::{Opacity, Plan, PlanView, RegionVisibility, Visibility, Wall};
use visibility_examples::floor_plans::drawing::Drawing;
use visibility_examples::floor_plans::forest_walk::{ForestWalk, REACH};
use visibility_examples::floor_plans::{PlanFile, load_layers, questions, slice};
use visibility_examples::output_file::write;
use visibility_examples::{eprintln, exit_code, print};

/// Compute what can be seen from points of a floor plan: visibility polygons and visible walls.
///
/// The plan is an SVG file (outlines are walls), GeoJSON (lines and rings are walls, points are eyes), a map
/// of Tiled or LDtk (outlines of tiles and shapes are walls, points are eyes), or text: a line `SEGMENTS
/// QUERIES`, then SEGMENTS lines `x1 y1 x2 y2`, then QUERIES lines `x y`. With `--slice`, it is a horizontal
/// cut through a scene. With `--trees`, the program walks through a forest instead.
#[derive(Parser)]
#[command(version)]
struct Arguments {
    /// Plan: a file with the extension .svg, .json, .geojson, .tmx, .ldtk or .ldtkl, or text.
    #[arg(required_unless_present = "trees")]
    file: Option<PathBuf>,

    /// Layer of a Tiled or LDtk map whose tiles and shapes are walls. May be given several times. By default
    /// layers with "wall", "collision", "solid" or "block" in their names, or else all.
    #[arg(long, value_name = "NAME", conflicts_with_all = ["trees", "slice"])]
    layer: Vec<String>,

    /// Read a scene (a file or a recipe, as `walkthrough --scene` does) in place of a plan, and cut its
    /// opaque objects but doors at this height. The plan's axes are the two that are not up, x before y
    /// before z.
    #[arg(long, value_name = "METRES", conflicts_with = "trees", allow_hyphen_values = true)]
    slice: Option<f32>,

    /// Point of a path, given at least twice: draw the shortest path from point to point, and the corners of
    /// the visibility graph.
    #[arg(long, value_name = "X,Y", value_parser = parse_point, allow_hyphen_values = true)]
    path: Vec<[f64; 2]>,

    /// Draw what is seen at N places along the path of `--path`, one after another, as an animation, in place
    /// of the corners.
    #[arg(long, value_name = "N", requires = "path", value_parser = visibility_examples::arguments::count())]
    animate: Option<usize>,

    /// Point in a room: find few guards that together see all that can be reached from there, and draw them,
    /// and witnesses of which no guard sees two.
    #[arg(long, value_name = "X,Y", value_parser = parse_point, allow_hyphen_values = true)]
    guards: Option<[f64; 2]>,

    /// Point in a room: draw the places, of all that can be reached from there, which none of the drawn eyes
    /// sees, in a colour for each connected part.
    #[arg(long, value_name = "X,Y", value_parser = parse_point, allow_hyphen_values = true)]
    hide: Option<[f64; 2]>,

    /// Walk through a forest of N trees instead of reading a plan. `--json` then has a line for each step,
    /// with the trees `seen` and the microseconds `us`, and `--svg` shows the steps one after another.
    #[arg(long, value_name = "N", conflicts_with = "file")]
    trees: Option<usize>,

    /// Number of steps of the walk, 5 cm each.
    #[arg(long, default_value_t = 64, value_name = "N", requires = "trees")]
    steps: usize,

    /// Radius of the trees in metres.
    #[arg(long, default_value_t = 1.5, value_name = "METRES", requires = "trees")]
    radius: f64,

    /// Eye to add to those of the file. May be given several times.
    #[arg(long, value_name = "X,Y", value_parser = parse_point, allow_hyphen_values = true)]
    eye: Vec<[f64; 2]>,

    /// File to write one line of JSON to for each eye: `area` of the visibility polygon, numbers of the
    /// segments `seen`, counted from 0, and `us`, the microseconds of the query with location. The polygon
    /// ends at the rectangle of `--margin` around all walls, even for an eye outside the rectangle. `-` is
    /// standard output. By default none.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,

    /// File to draw the visibility polygons and visible walls to. By default none.
    #[arg(long, value_name = "FILE.svg")]
    svg: Option<PathBuf>,

    /// Number of eyes to draw; the first ones are drawn.
    #[arg(long, default_value_t = 6, value_name = "N")]
    draw: usize,

    /// Corner of a region, given once for each corner. The picture shows the triangles that are seen from
    /// anywhere in the region's convex hull; the rest of the picture is its umbra.
    #[arg(long, value_name = "X,Y", value_parser = parse_point, allow_hyphen_values = true)]
    region: Vec<[f64; 2]>,

    /// Distance from the outermost walls to the rectangle in which sight ends. By default a quarter of the
    /// plan's larger extent, at least 1.
    #[arg(long)]
    margin: Option<f64>,

    /// Greatest distance at which an eye sees.
    #[arg(long, default_value_t = f64::INFINITY)]
    range: f64,

    /// Number of walls that a line of sight may cross.
    #[arg(long, default_value_t = 0, value_name = "K")]
    through: u32,
}

fn parse_point(text: &str) -> Result<[f64; 2], String> {
    let (x, y) = text.split_once(',').ok_or("expected X,Y")?;
    let number = |text: &str| text.trim().parse().map_err(|_| format!("`{text}` is no number"));
    Ok([number(x)?, number(y)?])
}

fn main() -> ExitCode {
    exit_code(run(&Arguments::parse()))
}

fn run(arguments: &Arguments) -> Result<(), Box<dyn std::error::Error>> {
    if let Some(trees) = arguments.trees {
        return walk(arguments, trees);
    }
    let path = arguments.file.as_deref().unwrap_or(std::path::Path::new(""));
    let (mut file, opacities) = match arguments.slice {
        Some(height) => slice::load(&path.to_string_lossy(), height)?,
        None => (load_layers(path, &arguments.layer)?, Vec::new()),
    };
    file.eyes.extend(&arguments.eye);
    let opacities = opacities.into_iter().chain(std::iter::repeat(Opacity::Opaque));
    let wall = |(&[a, b], opacity): (&[_; 2], _)| Wall::new(a, b).with_opacity(opacity);
    let walls: Vec<_> = file.walls.iter().zip(opacities).map(wall).collect();
    let start = Instant::now();
    let plan = match arguments.margin {
        Some(margin) => Plan::from_walls(&walls, margin)?,
        None => Plan::new(&walls)?,
    };
    let seconds = start.elapsed().as_secs_f64();
    eprintln!(
        "{} walls, {} pieces, {} triangles, {} bytes, made in {seconds:.3} s",
        walls.len(),
        plan.pieces().len(),
        plan.triangle_count(),
        plan.memory()
    );
    let mut answer = Visibility::new();
    let mut json = String::new();
    let mut times = Vec::new();
    for &eye in &file.eyes {
        let view = PlanView::new(eye).with_range(arguments.range).with_through(arguments.through);
        let us = time(&plan, &view, &mut answer)?;
        times.push(us);
        let mut seen = answer.walls().to_vec();
        seen.sort_unstable();
        let line = serde_json::json!({ "area": answer.area(), "seen": seen, "us": us });
        writeln!(json, "{line}")?;
    }
    times.sort_unstable_by(f64::total_cmp);
    if let Some(median) = times.get(times.len() / 2) {
        eprintln!("{} eyes, {median:.2} us in the median", times.len());
    }
    // The answers to these questions are found while they are drawn.
    let Arguments { svg, region, hide, guards, path, .. } = arguments;
    let is_asked = !region.is_empty() || hide.is_some() || guards.is_some() || !path.is_empty();
    if is_asked || svg.is_some() {
        let picture = draw(arguments, &file, &plan)?;
        if let Some(path) = svg {
            write(path, picture.as_bytes())?;
        }
    }
    Ok(write_json(arguments, &json)?)
}

/// Walks through a forest, and writes which trees are seen.
fn walk(arguments: &Arguments, trees: usize) -> Result<(), Box<dyn std::error::Error>> {
    let start = Instant::now();
    let walk = ForestWalk::new(trees, arguments.radius, arguments.steps)?;
    eprintln!("{} trees, made and walked in {:.2} s", walk.trees.len(), start.elapsed().as_secs_f64());
    let mut json = String::new();
    for step in &walk.steps {
        writeln!(json, "{}", serde_json::json!({ "eye": step.eye, "seen": step.seen, "us": step.us }))?;
    }
    let steps = walk.steps.iter();
    let median = |times: &mut dyn Iterator<Item = f64>| {
        let mut times: Vec<_> = times.collect();
        times.sort_unstable_by(f64::total_cmp);
        times.get(times.len() / 2).copied().unwrap_or_default()
    };
    let mean = |counts: &mut dyn Iterator<Item = usize>| {
        counts.sum::<usize>() as f64 / walk.steps.len().max(1) as f64
    };
    eprintln!(
        "from scratch: {:.1} trees seen a step; {:.1} us, the median",
        mean(&mut steps.clone().map(|step| step.seen.len())),
        median(&mut steps.clone().map(|step| step.us))
    );
    eprintln!(
        "kept from step to step: {:.1} elementary steps, {:.1} classes of {REACH} m ended; {:.1} us, the median",
        mean(&mut steps.clone().map(|step| step.kept_work[0])),
        mean(&mut steps.clone().map(|step| step.kept_work[1])),
        median(&mut steps.clone().map(|step| step.kept_us))
    );
    if let Some(path) = &arguments.svg {
        write(path, walk.draw().as_bytes())?;
    }
    Ok(write_json(arguments, &json)?)
}

/// Writes the answers, at last because a closed output ends the program.
fn write_json(arguments: &Arguments, json: &str) -> Result<(), String> {
    match &arguments.json {
        Some(path) if path.as_os_str() == "-" => print!("{json}"),
        Some(path) => write(path, json.as_bytes())?,
        None => {}
    }
    Ok(())
}

/// Returns the median of five runs in microseconds. A sixth run before these is not counted.
fn time(plan: &Plan, view: &PlanView, answer: &mut Visibility) -> Result<f64, visibility_2d::cdt::PlanError> {
    plan.look(view, answer)?;
    let mut times = [0.0; 5];
    for time in &mut times {
        let start = Instant::now();
        plan.look(view, answer)?;
        *time = start.elapsed().as_secs_f64() * 1e6;
    }
    times.sort_unstable_by(f64::total_cmp);
    Ok(times[2])
}

fn draw(
    arguments: &Arguments,
    file: &PlanFile,
    plan: &Plan,
) -> Result<String, visibility_2d::cdt::PlanError> {
    const COLORS: [&str; 6] = ["#e8b04a", "#5a9bd4", "#74b566", "#c77cc0", "#d9775a", "#6fb7b0"];
    let mut drawing = Drawing::new(plan.bounds(), file.y_down);
    let mut answer = Visibility::new();
    if !arguments.region.is_empty() {
        let mut region = RegionVisibility::new();
        let start = Instant::now();
        plan.look_from_region(&arguments.region, &mut region)?;
        let us = start.elapsed().as_secs_f64() * 1e6;
        eprintln!(
            "the region sees {} walls in {} triangles, {us:.1} us",
            region.walls().len(),
            region.triangles().len()
        );
        for triangle in region.triangles().iter().filter_map(|&triangle| plan.triangle(triangle)) {
            drawing.polygon(&triangle, "fill:#cfe3d4;stroke:#cfe3d4;stroke-width:.5");
        }
        drawing.polygon(&arguments.region, "fill:#4a8f62;stroke:#4a8f62;stroke-width:2");
    }
    let eyes = || file.eyes.iter().take(arguments.draw).zip(COLORS.into_iter().cycle());
    if let Some(start) = arguments.hide {
        let eyes: Vec<_> = eyes().map(|(&eye, _)| eye).collect();
        eprintln!("{}", questions::hide(plan, start, &eyes, &mut drawing)?);
    }
    let mut seen = Vec::new();
    for (&eye, color) in eyes() {
        let view = PlanView::new(eye).with_range(arguments.range).with_through(arguments.through);
        plan.look(&view, &mut answer)?;
        if arguments.hide.is_none() {
            drawing.polygon(answer.polygon(), &format!("fill:{color};fill-opacity:.45"));
        }
        seen.extend(answer.walls().iter().map(|&wall| file.walls[wall as usize]));
    }
    drawing.walls(file);
    drawing.lines(seen, "stroke:#c22;stroke-width:2.5;stroke-linecap:round");
    for (&eye, color) in eyes() {
        drawing.dot(eye, color);
    }
    if let Some(start) = arguments.guards {
        eprintln!("{}", questions::guard(plan, start, &mut drawing)?);
    }
    if let Some(count) = arguments.animate {
        let view = PlanView::new([0.0; 2]).with_range(arguments.range).with_through(arguments.through);
        eprintln!("{}", questions::look_around(plan, &arguments.path, count, &view, &mut drawing)?);
    } else if !arguments.path.is_empty() {
        eprintln!("{}", questions::walk(plan, &arguments.path, &mut drawing)?);
    }
    Ok(drawing.finish())
}
