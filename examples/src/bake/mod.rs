//! Bakes of whole scenes: which viewcells, how far, and where the work is kept. Used by the program `bake`.

pub mod pictures;
pub mod report;
pub mod viewcells;

use crate::region::world;
use crate::walkthrough::World;
use crate::{Hint, open};
use clap::Args;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};
use viewcells::Places;
use visibility_bake::{
    BakeCache, BakedSet, CellSandwich, SandwichBaker, SandwichOutcome, Settings, bake_fingerprint,
};
use visibility_core::bake::{Bake, Progress};
use visibility_core::pvs::Viewcells;

/// What is baked: the same for all shards of a bake.
#[derive(Args, Clone, Debug)]
pub struct Job {
    /// Scene: a built-in scene (plpcity, london, town, forest, office, each with sizes as in london:40,40),
    /// or a file (.vscn, .glb, .gltf).
    #[arg(value_name = "SCENE")]
    pub scene: String,

    /// Where viewcells are.
    #[command(flatten)]
    pub places: Places,

    /// What objects are whose names contain TEXT: `occluder`, `detail` or `door` (hide nothing), `mover`
    /// (hides nothing, and is visible from everywhere) or `never-cull`. May be given several times. Nodes of
    /// glTF files may say it themselves, by the extra `visibility`.
    #[arg(long = "hint", value_name = "HINT=TEXT", value_parser = hint)]
    pub hints: Vec<(Hint, String)>,

    /// Part of the reported triangles that may be neither seen nor proven hidden, as in 5% or 0.05.
    #[arg(long, value_parser = share, default_value = "5%")]
    pub gap: f64,

    /// Distance in metres that a line of sight must keep from all occluders. 0 for a conservative bake.
    #[arg(long, default_value_t = 1e-4)]
    pub clearance: f64,

    /// Number of rays aimed at each object.
    #[arg(long, default_value_t = 200)]
    pub rays: u32,
}

/// Reads a part from text: a number from 0 to 1, or a percentage.
fn share(text: &str) -> Result<f64, String> {
    let (number, unit) = text.strip_suffix('%').map_or((text, 1.0), |number| (number, 0.01));
    match number.trim().parse::<f64>() {
        Ok(number) if (0.0..=1.0).contains(&(number * unit)) => Ok(number * unit),
        _ => Err("a part is a number from 0 to 1, or a percentage up to 100%".to_owned()),
    }
}

fn hint(text: &str) -> Result<(Hint, String), String> {
    let (hint, part) = text.split_once('=').ok_or("a hint is HINT=TEXT, as in mover=Lift")?;
    Ok((hint.parse()?, part.to_owned()))
}

/// The scene of a job with its viewcells.
pub struct Level {
    /// Scene with occluders.
    pub world: World,
    /// All viewcells of the bake.
    pub viewcells: Viewcells,
    settings: Settings,
    /// Results of an earlier bake.
    cache: Arc<BakeCache>,
}

impl Level {
    /// Loads the scene of a job and makes its viewcells.
    ///
    /// # Errors
    ///
    /// Returns a message if the scene cannot be loaded, a hint is for no object, or there are no viewcells or
    /// too many.
    pub fn open(job: &Job) -> Result<Self, String> {
        let mut source = open(&job.scene).map_err(|error| error.to_string())?;
        for (hint, part) in &job.hints {
            let mut named = source.objects.iter_mut().filter(|object| object.name.contains(part)).peekable();
            named.peek().ok_or_else(|| format!("no name of an object contains `{part}`"))?;
            named.for_each(|object| object.take(*hint));
        }
        let world = world(source);
        let viewcells = Viewcells::new(viewcells::make(&job.places, &world)?);
        let settings = Settings { gap: job.gap, clearance: job.clearance, rays: job.rays };
        Ok(Self { world, viewcells, settings, cache: Arc::default() })
    }

    /// Lets the bake take results from a file that an earlier bake has written, if it exists.
    ///
    /// # Errors
    ///
    /// Returns a message if the file cannot be read or is damaged.
    pub fn take_cache(&mut self, path: &Path) -> Result<(), String> {
        let named = |error: &dyn std::fmt::Display| format!("{}: {error}", path.display());
        match std::fs::read(path) {
            Ok(bytes) => {
                self.cache = Arc::new(BakeCache::from_bytes(&bytes).map_err(|error| named(&error))?);
                Ok(())
            }
            Err(error) if error.kind() == ErrorKind::NotFound => Ok(()),
            Err(error) => Err(named(&error)),
        }
    }

    /// Prepares the bake of all viewcells.
    pub fn baker(&self) -> SandwichBaker<'_> {
        let baker = SandwichBaker::new(&self.world.scene, &self.viewcells, self.settings);
        baker.with_clock(clock).with_cache(self.cache.clone())
    }

    /// Returns the fingerprint that all shards of the bake have.
    pub fn fingerprint(&self) -> u64 {
        bake_fingerprint(&self.world.scene, &self.viewcells, &self.settings)
    }

    /// Makes the file that a game loads.
    ///
    /// # Errors
    ///
    /// Returns a message if the sets are too large to be stored.
    pub fn set(&self, cells: &[CellSandwich]) -> Result<BakedSet, String> {
        let rows: Vec<Vec<u32>> = cells.iter().map(CellSandwich::reported).collect();
        BakedSet::new(&self.world.scene, self.viewcells.clone(), &rows).map_err(|error| error.to_string())
    }
}

/// Returns the time passed since the first call.
fn clock() -> Duration {
    static FIRST: OnceLock<Instant> = OnceLock::new();
    FIRST.get_or_init(Instant::now).elapsed()
}

/// Where and how long a bake runs.
#[derive(Clone, Debug)]
pub struct Run {
    /// Number of threads, 0 for as many as the machine has.
    pub threads: usize,
    /// Time after which what is not done stays open: viewcells that are worked on are given up.
    pub limit: Option<Duration>,
    /// Least time between two writes of the work done so far.
    pub save_every: Duration,
    /// File of the work done so far, from which a bake goes on that was interrupted.
    pub state: PathBuf,
}

/// Runs a bake, from the state that an interrupted one has left if there is one. The state file stays until
/// [`forget`] removes it.
///
/// # Errors
///
/// Returns a message if the state file is damaged, of another bake, or cannot be written.
pub fn run<'a>(
    baker: impl Fn() -> SandwichBaker<'a> + Sync,
    run: &Run,
    mut progress: impl FnMut(Progress) + Send,
) -> Result<SandwichOutcome, String> {
    let start = Instant::now();
    let mut bake = match std::fs::read(&run.state) {
        Ok(bytes) => Bake::resume(baker(), &bytes)
            .map_err(|error| format!("{}: {error}; remove the file to begin anew", run.state.display()))?,
        Err(_) => Bake::new(baker()),
    };
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(run.threads)
        .build()
        .map_err(|error| error.to_string())?;
    pool.install(|| {
        progress(bake.progress());
        loop {
            let (begun, asked) = (Instant::now(), AtomicUsize::new(0));
            let is_over = || run.limit.is_some_and(|limit| start.elapsed() >= limit);
            // Before a write threads wait for one another. At most a tenth of the time is lost with a
            // process.
            let every = run.save_every.max(start.elapsed() / 10);
            let is_due = || begun.elapsed() >= every;
            // Between two writes at least one viewcell is begun, however little time there is.
            let is_first = || asked.fetch_add(1, Relaxed) == 0;
            loop {
                match bake.advance_unless(|| !is_first() && is_due(), is_over) {
                    Some(now) => progress(now),
                    None => return Ok(bake.finish()),
                }
                if is_over() || is_due() {
                    break;
                }
            }
            write(&run.state, &bake.save())?;
            if is_over() {
                return Ok(bake.finish());
            }
        }
    })
}

/// Removes the state file of a bake whose result is stored.
pub fn forget(state: &Path) {
    // Without a state file there is nothing to remove.
    let _ = std::fs::remove_file(state);
}

/// Writes a file so that it is there whole or not at all.
///
/// # Errors
///
/// Returns a message with the path.
pub fn write(path: &Path, bytes: &[u8]) -> Result<(), String> {
    let mut part = path.as_os_str().to_owned();
    part.push(".part");
    std::fs::write(&part, bytes)
        .and_then(|()| std::fs::rename(&part, path))
        .map_err(|error| format!("cannot write {}: {error}", path.display()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(clap::Parser)]
    struct Only {
        #[command(flatten)]
        job: Job,
    }

    #[test]
    fn hints_change_what_they_name_or_are_refused() {
        let open = |hint: &str| {
            let Only { job } = clap::Parser::try_parse_from(["", "london:2,2", "--hint", hint]).ok()?;
            Level::open(&job).ok()
        };
        let scene = open("mover=b1").unwrap().world.scene;
        let of = |flag: fn(&visibility_core::Object) -> bool| {
            scene.ids().filter(|&id| flag(&scene.object(id).unwrap())).count()
        };
        let movers = of(|object| object.never_cull);
        assert!(0 < movers && movers < scene.len(), "{movers}");
        assert!(of(|object| object.occluder) <= scene.len() - movers);
        for wrong in ["mover=house", "moover=b1", "mover"] {
            assert!(open(wrong).is_none(), "{wrong}");
        }
    }

    #[test]
    fn parts_are_read_or_refused() {
        assert_eq!((share("5%"), share("0.05"), share("1")), (Ok(0.05), Ok(0.05), Ok(1.0)));
        for wrong in ["", "5", "-1%", "101%", "nan", "x"] {
            assert!(share(wrong).is_err(), "{wrong}");
        }
    }
}
