//! Program `server`: simulates the server of a shooter that sends each player only what the player can see.

use clap::Parser;
use std::path::Path;
use std::process::ExitCode;
use std::time::{Duration, Instant};
use visibility_core::who_sees::{Reach, WhoSees};
use visibility_examples::arguments::count;
use visibility_examples::server::level::Level;
use visibility_examples::server::{Walker, nine_rays_reach};
use visibility_examples::{Cameras, Reading, exit_code, open_as, println};
use visibility_testing::Random;

/// Simulate the server of a shooter that sends each player only what the player can see.
#[derive(Parser)]
#[command(version)]
struct Arguments {
    /// Level: a plan (.svg, .json, .geojson, .txt, .tmx, .ldtk) in a format of the program `plan`, with a
    /// point to start at, or a scene: a built-in one, with or without sizes, or a file (.vscn, .glb, .gltf).
    #[arg(default_value = "office")]
    level: String,

    /// How to read a scene file.
    #[command(flatten)]
    reading: Reading,

    /// Source of a scene's walks, along which players walk.
    #[command(flatten)]
    cameras: Cameras,

    /// Number of players.
    #[arg(long, default_value_t = 64, value_parser = count())]
    players: usize,

    /// Number of spectators, who see others and cannot be seen.
    #[arg(long, default_value_t = 8)]
    spectators: usize,

    /// Number of other things in the level. Every tenth moves.
    #[arg(long, default_value_t = 5000)]
    things: usize,

    /// Number of ticks, at 30 per second.
    #[arg(long, default_value_t = 90, value_parser = count())]
    ticks: usize,

    /// Seconds from the server's update until a player draws it.
    #[arg(long, value_name = "SECONDS", default_value_t = 0.1, value_parser = between(0.0, 10.0))]
    latency: f64,

    /// Greatest speed of players and things, in metres per second.
    #[arg(long, value_name = "SPEED", default_value_t = 6.0, value_parser = between(0.0, 1000.0))]
    speed: f64,

    /// Size of box-shaped cells in metres. In a scene they replace the cells between portals. On a plan they
    /// limit the size of triangles; by default 4 m.
    #[arg(long, value_name = "METRES", value_parser = between(0.25, 1000.0))]
    boxes: Option<f64>,

    /// Number of players for whom the program prints, once a second, what the server sends them.
    #[arg(long, default_value_t = 3)]
    shown: usize,

    /// Number of pairs of a player and a target judged by samples in every tenth tick.
    #[arg(long, default_value_t = 1000)]
    judged: usize,

    /// Number of sampled segments for each judged pair.
    #[arg(long, default_value_t = 200)]
    segments: usize,
}

/// Ticks per second.
const RATE: f64 = 30.0;
/// Returns a parser of a number from `least` to `greatest`.
fn between(least: f64, greatest: f64) -> impl Fn(&str) -> Result<f64, String> + Clone {
    move |text| match text.parse::<f64>() {
        Ok(number) if (least..=greatest).contains(&number) => Ok(number),
        _ => Err(format!("`{text}` is no number from {least} to {greatest}")),
    }
}

/// Size in bytes of one update of a target: number, position, direction, speed.
const BYTES: usize = 24;

/// Counts of judged pairs of a player and a target.
#[derive(Default)]
struct Judged {
    pairs: usize,
    hidden: usize,
    /// Number of pairs with an unobstructed segment.
    seen: usize,
    /// Number of pairs with an unobstructed segment that were reported hidden.
    missing: usize,
    /// Number of pairs that nine rays call hidden; the number of these with an unobstructed segment; the time
    /// of all rays.
    ray_hidden: usize,
    ray_missing: usize,
    ray_time: Duration,
}

fn main() -> ExitCode {
    exit_code(run(&Arguments::parse()))
}

fn run(arguments: &Arguments) -> Result<(), Box<dyn std::error::Error>> {
    let is_plan = ["svg", "json", "geojson", "txt", "tmx", "ldtk", "ldtkl"]
        .iter()
        .any(|end| Path::new(&arguments.level).extension().is_some_and(|e| e.eq_ignore_ascii_case(end)));
    let start = Instant::now();
    let mut level = match is_plan {
        true => Level::of_plan(Path::new(&arguments.level), arguments.boxes.unwrap_or(4.0))?,
        false => {
            let mut source = open_as(&arguments.level, &arguments.reading)?;
            arguments.cameras.give_whole(&mut source, &arguments.reading)?;
            source.print_notes();
            Level::of_scene(source, arguments.boxes)?
        }
    };
    println!(
        "{}: {} cells in {:.1} s",
        arguments.level,
        level.cells.cell_count(),
        start.elapsed().as_secs_f64()
    );
    let mut random = Random(42);
    let mut walker = |_| Walker::new(&level, &mut random);
    let mut players: Vec<Walker> = (0..arguments.players + arguments.spectators).map(&mut walker).collect();
    let mut things: Vec<Walker> = (0..arguments.things).map(&mut walker).collect();
    let mut who = WhoSees::new();
    let mut judged = Judged::default();
    let (mut times, mut sent) = (Vec::new(), 0);
    for tick in 0..arguments.ticks {
        let step = arguments.speed / RATE;
        players.iter_mut().for_each(|player| player.walk(&level, step, &mut random));
        things.iter_mut().step_by(10).for_each(|thing| thing.walk(&level, step, &mut random));
        let start = Instant::now();
        let person = |walker: &Walker| level.person(walker.eye()).within(arguments.latency, arguments.speed);
        let eyes = |walker: &Walker| Level::eyes(walker.eye()).within(arguments.latency, arguments.speed);
        let observers: Vec<Reach> = players.iter().map(eyes).collect();
        let mut targets: Vec<Reach> = players[..arguments.players].iter().map(person).collect();
        targets.extend(things.iter().enumerate().map(|(i, thing)| match i % 10 {
            0 => person(thing),
            _ => level.person(thing.eye()),
        }));
        who.look(&mut *level.cells, &observers, &targets);
        times.push(start.elapsed());
        sent += (0..observers.len()).map(|observer| who.seen_by(observer).count()).sum::<usize>();
        if tick % 30 == 0 {
            for player in 0..arguments.shown.min(arguments.players) {
                let (seen, things): (Vec<usize>, Vec<usize>) = who
                    .seen_by(player)
                    .filter(|&other| other != player)
                    .partition(|&t| t < arguments.players);
                println!(
                    "tick {tick}: player {player} is told of players {seen:?} and of {} things",
                    things.len()
                );
            }
        }
        if tick % 10 == 0 {
            for _ in 0..arguments.judged {
                let (a, b) = (random.below(observers.len()), random.below(targets.len()));
                if a == b {
                    continue;
                }
                let is_seen = (0..arguments.segments).any(|_| {
                    let from = level.point_of(&observers[a], &mut random);
                    let to = level.point_of(&targets[b], &mut random);
                    level.is_free(from, to)
                });
                judged.pairs += 1;
                judged.seen += usize::from(is_seen);
                judged.hidden += usize::from(!who.sees(a, b));
                judged.missing += usize::from(is_seen && !who.sees(a, b));
                let start = Instant::now();
                let is_reached = nine_rays_reach(&level, players[a].eye(), &targets[b]);
                judged.ray_time += start.elapsed();
                judged.ray_hidden += usize::from(!is_reached);
                judged.ray_missing += usize::from(is_seen && !is_reached);
            }
        }
    }
    times.sort_unstable();
    let pairs = (arguments.players + arguments.spectators) * (arguments.players + arguments.things);
    let share = |part: usize, of: usize| 100.0 * part as f64 / of.max(1) as f64;
    let all = pairs * arguments.ticks;
    println!(
        "{} observers x {} targets: {:.2} ms a tick, at most {:.2}; {:.1} % of pairs are sent, {:.2} in \
         place of {:.2} MB a tick",
        arguments.players + arguments.spectators,
        arguments.players + arguments.things,
        times[times.len() / 2].as_secs_f64() * 1e3,
        times[times.len() - 1].as_secs_f64() * 1e3,
        share(sent, all),
        (sent * BYTES) as f64 / arguments.ticks as f64 / 1e6,
        (pairs * BYTES) as f64 / 1e6,
    );
    println!(
        "judged {} pairs: hidden {:.1} %, seen by {} segments {:.1} %, missing {}; nine rays hide {:.1} %, \
         missing {} ({:.1} % of what is seen), {:.0} ms a tick",
        judged.pairs,
        share(judged.hidden, judged.pairs),
        arguments.segments,
        share(judged.seen, judged.pairs),
        judged.missing,
        share(judged.ray_hidden, judged.pairs),
        judged.ray_missing,
        share(judged.ray_missing, judged.seen),
        judged.ray_time.as_secs_f64() * 1e3 / judged.pairs.max(1) as f64 * pairs as f64,
    );
    Ok(())
}
