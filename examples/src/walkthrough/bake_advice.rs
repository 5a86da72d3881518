//! What a bake of a scene would give, found by baking viewcells of a few views for a few seconds.

use super::{World, cullers};
use crate::Hint;
use crate::arguments::{quoted, scene_arguments};
use crate::bake::viewcells::{Places, Solids, make};
use crate::reading::Reading;
use crate::region::open_doors;
use std::fmt;
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::available_parallelism;
use std::time::{Duration, Instant};
use visibility_bake::{BakedSet, CellSandwich, SandwichBaker, SandwichSettings, level_version};
use visibility_core::bake::Bake;
use visibility_core::glam::DVec3;
use visibility_core::pvs::{PvsCuller, ViewcellId, Viewcells};
use visibility_core::{FrustumCuller, Pipeline, Scene, View, view::Eye};
use visibility_measure::{Advisor, CullerTrial, DrawCost};

/// Most triangles of a scene that is tried. Preparing the bake of so many takes about a second, which no
/// limit of time cuts short.
const MOST_TRIANGLES: usize = 1_000_000;
/// Most time in which the viewcells along the walks are made.
const PLACE_TIME: Duration = Duration::from_secs(2);
/// Most time in which viewcells of the views are baked.
const BAKE_TIME: Duration = Duration::from_secs(5);

/// When [`PLACE_TIME`] is over, for a function that takes no argument.
static PLACE_END: Mutex<Option<Instant>> = Mutex::new(None);

fn is_too_late_to_place() -> bool {
    PLACE_END.lock().unwrap_or_else(PoisonError::into_inner).is_some_and(|end| Instant::now() >= end)
}

/// What a bake by the program `bake` with its default settings would give, by viewcells of some views. All
/// counts and times are means over the views with an eye in a viewcell that was baked.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BakeEstimate {
    /// Measured times and counts of culling by the baked sets after the frustum.
    pub trial: CullerTrial,
    /// Measured times and counts of the culler that is advised in place of a bake.
    pub advised: CullerTrial,
    /// Number of objects in the frustum that a line of sight from the viewcell is known to reach, at least
    /// those that the view shows. No bake of these viewcells leaves fewer.
    pub least_objects: f64,
    /// Number of viewcells along the walks, which the program would bake.
    pub viewcells: usize,
    /// Number of viewcells that were baked here.
    pub baked: usize,
    /// Time in seconds in which these viewcells were baked, on all threads of the machine.
    pub seconds: f64,
    /// Whether the bake here was finished. If not, what is open counts as visible, and a bake with more time
    /// hides more.
    pub complete: bool,
}

impl BakeEstimate {
    /// Returns the time in seconds of a bake that leaves about as much: all viewcells along the walks take as
    /// long as those that were baked.
    pub fn whole_seconds(&self) -> f64 {
        self.seconds * self.viewcells as f64 / self.baked.max(1) as f64
    }

    /// Returns the command that bakes the scene, as programs are told it, into the file `file`. A bake that
    /// was not finished here ends after [`whole_seconds`](Self::whole_seconds).
    pub fn command(
        &self,
        scene: &str,
        reading: &Reading,
        cameras: Option<&Path>,
        hints: &[(Hint, String)],
        file: &str,
    ) -> String {
        let scene = scene_arguments(scene, reading, cameras, hints);
        let mut command = format!("cargo run --release --bin bake -- {scene} -o {}", quoted(file));
        if !self.complete {
            command += &format!(" --time {}", self.whole_seconds().ceil());
        }
        command
    }

    /// Returns whether culling and drawing takes less time by the bake than by the culler that is advised,
    /// and the bake hid no visible object.
    pub fn is_worth_it(&self) -> bool {
        self.trial.is_sound() && self.trial.total_us < self.advised.total_us
    }
}

impl fmt::Display for BakeEstimate {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { trial, advised, least_objects, viewcells, baked, seconds, complete } = self;
        writeln!(
            f,
            "a bake of about {:.0} s {}: {:.0} objects a view in {:.1} us, {:.0} us in all, where what is advised takes {:.0} us for {:.0} objects",
            self.whole_seconds().ceil(),
            if self.is_worth_it() { "does better" } else { "does no better" },
            trial.objects,
            trial.cull_us,
            trial.total_us,
            advised.total_us,
            advised.objects,
        )?;
        writeln!(
            f,
            "by {baked} of the {viewcells} viewcells along the walks, baked in {seconds:.1} s{}, {least_objects:.0} at least",
            if *complete {
                "; a closer bake leaves fewer"
            } else {
                ", not finished; with more time a bake leaves fewer"
            },
        )?;
        // A line of sight keeps six times the clearance from what is on either side.
        let gap = 12e3 * SandwichSettings::default().clearance();
        write!(
            f,
            "it may hide what is seen only through gaps narrower than {gap:.1} mm: --clearance 0 does not"
        )
    }
}

/// Bakes viewcells with the eyes of some views, in a few seconds or within `limit`, and culls these views by
/// them, and by the culler `advised`, an entry of [`cullers`].
///
/// # Errors
///
/// Returns a message, for a person, why there is no estimate.
pub fn estimate(
    world: &World,
    views: &[View],
    advised: &str,
    limit: Option<Duration>,
) -> Result<BakeEstimate, String> {
    let [place_time, bake_time] =
        limit.map_or([PLACE_TIME, BAKE_TIME], |limit| [limit / 4, limit.saturating_sub(limit / 4)]);
    if world.source.triangle_count() > MOST_TRIANGLES {
        return Err(format!("not tried with more than {MOST_TRIANGLES} triangles"));
    }
    let mut scene = world.scene.clone();
    open_doors(&world.source, &mut scene);
    *PLACE_END.lock().unwrap_or_else(PoisonError::into_inner) = Instant::now().checked_add(place_time);
    let (bounds, solids) = (world.source.bounds(), Solids::Scene(&scene));
    let places =
        make(&Places::default(), &Reading::default(), &world.source, bounds, &solids, is_too_late_to_place);
    let places = Viewcells::new(places.map_err(|error| error.to_string())?);
    let place = |view: &View| match view.eye(DVec3::ZERO) {
        Eye::Point(eye) => places.locate(eye),
        Eye::Direction(_) => None,
    };
    let found = bake(&scene, &places, views.iter().filter_map(place).collect(), bake_time);
    let views: Vec<View> =
        views.iter().filter(|&view| place(view).is_some_and(|at| found.ids.contains(&at))).copied().collect();
    if views.is_empty() {
        return Err("no camera is in a viewcell".to_owned());
    }

    let advisor =
        Advisor::new(&world.scene, &views, DrawCost::default()).map_err(|error| error.to_string())?;
    let version = level_version(&scene);
    let clock = Instant::now();
    let trial = |pipeline: &mut Pipeline| {
        let trial = advisor.trial(pipeline, f64::INFINITY, || clock.elapsed().as_secs_f64());
        trial.ok_or_else(|| "the trial was given up".to_owned())
    };
    let by_rows = |rows: &[Vec<u32>]| {
        let cells = Viewcells::new(found.ids.iter().map(|id| places.cells()[id.index()].clone()));
        let set = BakedSet::new(&scene, cells, rows).map_err(|error| error.to_string())?;
        let set = set.for_level(&world.scene, Some(version)).map_err(|error| error.to_string())?;
        trial(&mut Pipeline::new().with(FrustumCuller::new()).with(PvsCuller::new(Arc::new(set))))
    };
    let rows: Vec<_> = found.cells.iter().map(|cell| cell.reported().into_owned()).collect();
    let seen: Vec<_> = found.cells.iter().map(|cell| cell.seen.clone()).collect();
    let mut advised = cullers::parse(advised, world).map_err(|error| error.to_string())?;
    Ok(BakeEstimate {
        trial: by_rows(&rows)?,
        advised: trial(&mut advised[0].1)?,
        least_objects: by_rows(&seen)?.objects.max(advisor.facts().visible_objects),
        viewcells: places.cells().len(),
        baked: found.ids.len(),
        seconds: found.seconds,
        complete: found.complete,
    })
}

/// Viewcells that were baked.
struct Found {
    /// Numbers of the viewcells among all places.
    ids: Vec<ViewcellId>,
    /// Baked sets, one for each of `ids`.
    cells: Vec<CellSandwich>,
    /// Time in seconds that the bake has taken.
    seconds: f64,
    /// Whether the bake was finished.
    complete: bool,
}

/// Bakes the viewcells `wanted` among the places for at most `limit`: as many as there are threads at
/// once, from all over the walks. Those that are not finished by then are left out, unless they are the
/// first.
fn bake(scene: &Scene, places: &Viewcells, mut wanted: Vec<ViewcellId>, limit: Duration) -> Found {
    wanted.sort_unstable();
    wanted.dedup();
    let mut order: Vec<usize> = (0..wanted.len()).collect();
    // The second is from the middle, the next from the quarters.
    order.sort_by_key(|&index| index.reverse_bits());
    let start = Instant::now();
    let is_over = || start.elapsed() >= limit;
    let mut found = Found { ids: Vec::new(), cells: Vec::new(), seconds: 0.0, complete: true };
    for batch in order.chunks(available_parallelism().map_or(1, usize::from)) {
        let ids: Vec<ViewcellId> = batch.iter().map(|&index| wanted[index]).collect();
        let cells = Viewcells::new(ids.iter().map(|id| places.cells()[id.index()].clone()));
        let mut bake = Bake::new(SandwichBaker::new(scene, &cells, SandwichSettings::default()));
        while !is_over() && bake.advance_unless(|| false, is_over).is_some() {}
        let outcome = bake.finish();
        if outcome.complete || found.ids.is_empty() {
            found.ids.extend(ids);
            found.cells.extend(outcome.cells);
            (found.seconds, found.complete) = (start.elapsed().as_secs_f64(), outcome.complete);
        }
        if is_over() {
            break;
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::built_in;
    use visibility_core::glam::Vec3;

    #[test]
    fn a_bake_of_rooms_leaves_fewer_objects_than_the_frustum() {
        let world = World::new(built_in("office:1,3").unwrap(), (64, 36), Some(6)).unwrap();
        let by_frustum = estimate(&world, &world.views, "frustum", None).unwrap();
        assert!(
            by_frustum.trial.objects < by_frustum.advised.objects && by_frustum.trial.is_sound(),
            "the bake leaves {} objects, the advised culler {}",
            by_frustum.trial.objects,
            by_frustum.advised.objects
        );
        assert!(
            by_frustum.least_objects <= by_frustum.trial.objects && by_frustum.least_objects > 0.0,
            "at least {} objects of {} are seen",
            by_frustum.least_objects,
            by_frustum.trial.objects
        );
        assert!(
            (1..=by_frustum.viewcells).contains(&by_frustum.baked),
            "{} of {} viewcells were baked",
            by_frustum.baked,
            by_frustum.viewcells
        );
        assert!(
            by_frustum.to_string().contains("narrower than 1.2 mm: --clearance 0"),
            "the estimate names the clearance: {by_frustum}"
        );
        // What a set saves, if anything, is time in all.
        let costs = |total_us, false_hidden| CullerTrial { total_us, false_hidden, ..by_frustum.trial };
        let is_worth_it = |trial, advised| BakeEstimate { trial, advised, ..by_frustum }.is_worth_it();
        assert!(is_worth_it(costs(9.0, 0), costs(10.0, 0)), "a set that saves time");
        assert!(
            !is_worth_it(costs(10.0, 0), costs(10.0, 0)) && !is_worth_it(costs(9.0, 1), costs(10.0, 0)),
            "a set that saves none, and one that errs"
        );
    }

    #[test]
    fn commands_are_quoted_and_end_where_the_estimate_did() {
        let complete = BakeEstimate {
            trial: CullerTrial::default(),
            advised: CullerTrial::default(),
            least_objects: 1.0,
            viewcells: 57,
            baked: 2,
            seconds: 5.0,
            complete: true,
        };
        let command = complete.command("office:1,3", &Reading::default(), None, &[], "office.pvs");
        assert_eq!(
            command, "cargo run --release --bin bake -- office:1,3 -o office.pvs",
            "the command of a complete estimate"
        );
        let hints = [(Hint::NeverCull, "a lift".to_owned()), (Hint::Door, "Door".to_owned())];
        let open = BakeEstimate { complete: false, ..complete };
        let reading = Reading { unit: Some(0.001), up: Some(Vec3::Z), two_sided: true };
        let command = open.command("my 'house'.glb", &reading, Some(Path::new("a.json")), &hints, "x.pvs");
        let words = concat!(
            r"-- 'my '\''house'\''.glb' --unit 0.001 --up z --two-sided --cameras a.json",
            " --hint 'never-cull=a lift' --hint door=Door -o x.pvs --time 143"
        );
        assert!(command.ends_with(words), "{command}");
    }

    #[test]
    fn without_viewcells_there_is_a_reason() {
        let mut world = World::new(built_in("town:1").unwrap(), (64, 36), Some(1)).unwrap();
        world.source.walks.clear();
        assert!(
            estimate(&world, &world.views, "frustum", None).unwrap_err().contains("viewcells"),
            "the reason names viewcells"
        );
        assert!(estimate(&world, &[], "frustum", None).is_err(), "no views");
    }
}
