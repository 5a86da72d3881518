//! Estimate of the benefit of a bake, from baking the viewcells of a few views for a few seconds.

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

/// Maximum number of triangles of a scene for which a bake is tried. Its preparation takes about a second for
/// so many, and no time limit can interrupt it.
const MOST_TRIANGLES: usize = 1_000_000;
/// Maximum time to make the viewcells along the walks.
const PLACE_TIME: Duration = Duration::from_secs(2);
/// Maximum time to bake viewcells of the views.
const BAKE_TIME: Duration = Duration::from_secs(5);

/// End of [`PLACE_TIME`]: a global, because the function that tests it takes no argument.
static PLACE_END: Mutex<Option<Instant>> = Mutex::new(None);

fn is_too_late_to_place() -> bool {
    PLACE_END.lock().unwrap_or_else(PoisonError::into_inner).is_some_and(|end| Instant::now() >= end)
}

/// Estimate for a bake with the default settings of the program `bake`, from some baked viewcells. All counts
/// and times are means over the views whose eyes are in a baked viewcell.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BakeEstimate {
    /// Measured times and counts of culling by the baked sets after frustum culling.
    pub trial: CullerTrial,
    /// Measured times and counts of the best culler without a bake.
    pub advised: CullerTrial,
    /// Number of objects in the frustum that certainly can be seen from the viewcell. No bake of these
    /// viewcells leaves fewer.
    pub least_objects: f64,
    /// Number of viewcells along the walks, all of which the program `bake` would bake.
    pub viewcells: usize,
    /// Number of viewcells baked for the estimate.
    pub baked: usize,
    /// Time in seconds for baking these viewcells, on all threads of the machine.
    pub seconds: f64,
    /// Whether these viewcells were baked to the end. If not, undecided objects count as visible, and a
    /// longer bake hides more.
    pub complete: bool,
}

impl BakeEstimate {
    /// Returns the estimated time in seconds to bake all viewcells along the walks, at the rate of those
    /// baked here.
    pub fn whole_seconds(&self) -> f64 {
        self.seconds * self.viewcells as f64 / self.baked.max(1) as f64
    }

    /// Returns the command line that bakes the scene into the file `file`. If the bake here was cut off, the
    /// command has a time limit of [`whole_seconds`](Self::whole_seconds).
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

    /// Returns whether culling and drawing takes less time with the bake than with the advised culler, and
    /// the bake hid no visible object.
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
        // A line of sight keeps six times the clearance on both sides, so gaps below twelve times the
        // clearance are missed. In millimetres.
        let gap = 12e3 * SandwichSettings::default().clearance();
        write!(
            f,
            "it may hide what is seen only through gaps narrower than {gap:.1} mm: --clearance 0 does not"
        )
    }
}

/// Bakes viewcells around the eyes of some views, in a few seconds or within `limit`. Culls these views with
/// the baked sets, and with the culler `advised`, an entry of [`cullers`].
///
/// # Errors
///
/// Returns a message for a person with the reason why there is no estimate.
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

    let advisor = Advisor::with_judge(&world.scene, &world.scene_at_rest(), &views, DrawCost::default())
        .map_err(|error| error.to_string())?;
    let version = level_version(&scene);
    let clock = Instant::now();
    let trial = |pipeline: &mut Pipeline| {
        let trial = advisor.trial(pipeline, f64::INFINITY, || clock.elapsed().as_secs_f64());
        trial.ok_or_else(|| "the trial was given up".to_owned())
    };
    let by_rows = |rows: &[Vec<u32>]| {
        let cells = Viewcells::new(found.ids.iter().map(|id| places.cells()[id.index()].clone()));
        let set = BakedSet::from_rows(&scene, cells, rows).map_err(|error| error.to_string())?;
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

/// Baked viewcells.
struct Found {
    /// Indices of the viewcells among all viewcells along the walks.
    ids: Vec<ViewcellId>,
    /// Baked sets, one for each of `ids`.
    cells: Vec<CellSandwich>,
    /// Time in seconds of the bake.
    seconds: f64,
    /// Whether the bake was finished.
    complete: bool,
}

/// Bakes the viewcells `wanted` of `places` for at most `limit`, in batches of one per thread, spread over
/// the walks. A batch that is not finished in time is dropped, unless it is the first.
fn bake(scene: &Scene, places: &Viewcells, mut wanted: Vec<ViewcellId>, limit: Duration) -> Found {
    wanted.sort_unstable();
    wanted.dedup();
    let mut order: Vec<usize> = (0..wanted.len()).collect();
    // Bit-reversed indices spread the batches: first the start, then the middle, then the quarters.
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
        // The advice depends on the total time and on visible objects hidden.
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
        let reading = Reading { unit: Some(0.001), up: Some(Vec3::Z), two_sided: true, pieces: None };
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
