//! Automatic choice of a culler: tries every culler that suits a world on a few of its views, and advises the
//! fastest with the measured reason.
//!
//! A quick choice ends after about ten seconds. It draws as many views as time permits, and skips cullers
//! whose preparation would take longer than the time left, as estimated on a sample of the objects.

use super::bake_advice::{self, BakeEstimate};
use super::{World, cullers};
use crate::SceneSource;
use std::fmt;
use std::time::{Duration, Instant};
use visibility_core::{Pipeline, View, VisibleSet};
use visibility_measure::{Advisor, CullerTrial, DrawCost, MeasureError, SceneFacts};

/// Maximum number of views that are probed, spread evenly over the walks.
const VIEWS: usize = 12;
/// Time in seconds that a quick choice may spend on drawing its views.
const DRAWING: f64 = 1.5;
/// Time in seconds after which a quick choice tries no further culler.
const TRYING: f64 = 6.0;
/// Time that a quick choice may spend on the estimate of a bake.
const BAKING: Duration = Duration::from_millis(2500);
/// Maximum number of triangles in the sample on which preparations are timed.
const SAMPLE: usize = 5_000;
/// Assumed growth of a preparation's time: this power of the number of triangles.
const GROWTH: f64 = 1.5;

/// Advice on the culler to use, with the measurements behind it.
#[derive(Debug, Clone, PartialEq)]
pub struct Advice {
    /// Culler with its setting, in the syntax of `--cullers`.
    pub entry: String,
    /// Facts about the scene measured in the probed views, such as its size and visible fraction.
    pub facts: SceneFacts,
    /// Measured times and counts of the advised culler, means per view.
    pub chosen: CullerTrial,
    /// Measured times and counts of frustum culling alone, means per view.
    pub frustum: CullerTrial,
    /// Time in microseconds per view to draw exactly the visible objects, without any culling.
    pub min_us: f64,
    /// Number of cullers that were tried.
    pub tried: usize,
    /// Cullers that were skipped for lack of time.
    pub untried: Vec<String>,
    /// Whether the scene has cells and portals of its own, not made from its triangles.
    pub cells: bool,
    /// Estimate for a bake, or the reason why there is none.
    pub bake: Result<BakeEstimate, String>,
}

/// Tries the given cullers and advises the one with the least time to cull and draw, among those that promise
/// to hide no visible object and kept the promise. The first entry should be `frustum`, with which the advice
/// is compared, and is always tried; cullers that do not suit the scene are skipped. Unless `thorough`, it
/// ends after about ten seconds, and lists the cullers not tried.
///
/// # Errors
///
/// Returns [`MeasureError`] when the scene has too many triangles to number.
pub fn advise(world: &World, entries: &[String], thorough: bool) -> Result<Advice, MeasureError> {
    let clock = Instant::now();
    advise_in_time(world, entries, thorough, &|| clock.elapsed().as_secs_f64())
}

/// Same as [`advise`], with the clock as an argument: `now` returns the seconds since the beginning.
fn advise_in_time(
    world: &World,
    entries: &[String],
    thorough: bool,
    now: &dyn Fn() -> f64,
) -> Result<Advice, MeasureError> {
    let spread = |count: usize| -> Vec<View> {
        world.views.iter().step_by(world.views.len().div_ceil(count).max(1)).cloned().collect()
    };
    let judge = world.scene_at_rest();
    let mut count = VIEWS;
    if !thorough {
        Advisor::with_judge(&world.scene, &judge, &spread(1), DrawCost::default())?;
        count = ((DRAWING / now().max(1e-6)) as usize).clamp(1, VIEWS);
    }
    let views = spread(count);
    let advisor = Advisor::with_judge(&world.scene, &judge, &views, DrawCost::default())?;
    let sample = (!thorough).then(|| Sample::new(world));
    let mut best: Option<(String, CullerTrial)> = None;
    let (mut frustum, mut tried, mut untried) = (CullerTrial::default(), 0, Vec::new());
    for (index, entry) in entries.iter().enumerate() {
        let is_late = |sample: &Sample| now() + sample.seconds(entry) > TRYING;
        if index > 0 && sample.as_ref().is_some_and(is_late) {
            untried.push(entry.clone());
            continue;
        }
        // Skips cullers that do not suit the scene.
        let Ok(mut made) = cullers::parse(entry, world) else { continue };
        let limit = best.as_ref().map_or(f64::INFINITY, |(_, trial)| trial.total_us);
        if !thorough && is_hopeless(&mut made[0].1, world, &views, limit) {
            tried += 1;
            continue;
        }
        tried += 1;
        let Some((_, trial)) = advisor.best([&mut made[0].1], now) else { continue };
        if index == 0 {
            frustum = trial;
        }
        if trial.total_us < limit {
            best = Some((entry.clone(), trial));
        }
    }
    let (entry, chosen) = best.unwrap_or(("frustum".to_owned(), frustum));
    let (facts, min_us) = (*advisor.facts(), advisor.min_us());
    let bake = bake_advice::estimate(world, &views, &entry, (!thorough).then_some(BAKING));
    let cells = world.source.cells.is_some();
    Ok(Advice { entry, facts, chosen, frustum, min_us, tried, untried, cells, bake })
}

/// Sample of a world's objects, on which the preparation of cullers is timed.
struct Sample {
    world: World,
    /// Estimated ratio of a preparation's time for the whole world to its time for the sample.
    factor: f64,
}

impl Sample {
    /// Samples evenly spaced objects of a world, with about [`SAMPLE`] triangles.
    fn new(world: &World) -> Self {
        let all = world.source.triangle_count();
        let step = all.div_ceil(SAMPLE).max(1);
        let objects: Vec<_> = world.source.objects.iter().step_by(step).cloned().collect();
        let triangles = objects.iter().map(|object| object.triangles.len()).sum::<usize>();
        let source =
            SceneSource { objects, cells: world.source.cells.clone(), ..world.source.without_objects() };
        let mut sample = World::with_views(source, world.views.clone(), Vec::new(), world.size);
        (sample.makes_cells, sample.is_quiet) = (world.makes_cells, true);
        Self { world: sample, factor: (all as f64 / triangles.max(1) as f64).max(1.0).powf(GROWTH) }
    }

    /// Returns an estimate in seconds of an entry's preparation time for the whole world. Data already
    /// prepared for an earlier entry take no time.
    fn seconds(&self, entry: &str) -> f64 {
        let start = Instant::now();
        // Only the time is measured here; an error for an unsuitable culler is ignored.
        let _ = cullers::parse(entry, &self.world);
        start.elapsed().as_secs_f64() * self.factor
    }
}

/// Returns whether a culler takes much longer for the first view than the best culler takes in total, so that
/// trying it on all views would waste time. The first view allocates memory that later views reuse, so its
/// time is too high.
fn is_hopeless(pipeline: &mut Pipeline, world: &World, views: &[View], limit_us: f64) -> bool {
    let Some(view) = views.first() else { return false };
    let start = Instant::now();
    pipeline.cull(&world.scene, view, &mut VisibleSet::new());
    start.elapsed().as_secs_f64() * 1e6 > 10.0 * limit_us + 20_000.0
}

/// Returns a list of cullers with each `auto` replaced by the advised culler, and the advice; `None` as the
/// advice if the list has no `auto`. The cullers tried are the [`quick_entries`](cullers::quick_entries). For
/// `thorough` see [`advise`].
///
/// # Errors
///
/// Returns the errors of [`advise`].
pub fn resolve(list: &str, world: &World, thorough: bool) -> Result<(String, Option<Advice>), MeasureError> {
    if !list.split(',').any(|entry| entry.trim() == "auto") {
        return Ok((list.to_owned(), None));
    }
    let advice = advise(world, &cullers::quick_entries(world), thorough)?;
    let resolved = list.split(',').map(|entry| if entry.trim() == "auto" { &advice.entry } else { entry });
    Ok((resolved.collect::<Vec<_>>().join(","), Some(advice)))
}

impl fmt::Display for Advice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { entry, facts, chosen, frustum, min_us, tried, untried, cells, bake } = self;
        let with = if *cells { "with" } else { "without given" };
        writeln!(f, "{facts}, {with} cells")?;
        writeln!(
            f,
            "advice: {entry}, the best of {tried} tried: {:.0} us a view to cull and {:.0} us to draw {:.0} objects, {:.0} us in all",
            chosen.cull_us,
            chosen.total_us - chosen.cull_us,
            chosen.objects,
            chosen.total_us
        )?;
        writeln!(
            f,
            "that is {:.2} times the box limit and {:.1} times the ideal: the visible triangles, without any time to cull, {min_us:.0} us",
            chosen.objects / facts.box_limit.max(1.0),
            chosen.total_us / min_us.max(1.0),
        )?;
        if !untried.is_empty() {
            let mut names: Vec<&str> = Vec::new();
            for name in untried.iter().filter_map(|entry| entry.split([':', '+']).next()) {
                if !names.contains(&name) {
                    names.push(name);
                }
            }
            let (count, names) = (untried.len(), names.join(", "));
            writeln!(f, "no time for {count} settings of {names}: --thorough tries them")?;
        }
        writeln!(f, "by the frustum alone {:.0} us for {:.0} objects", frustum.total_us, frustum.objects)?;
        match bake {
            Ok(bake) => bake.fmt(f),
            Err(why) => write!(f, "what a bake would give is not known: {why}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::built_in;

    #[test]
    fn auto_becomes_a_culler_that_hides_nothing_visible_and_is_worth_it() {
        let world = World::new(built_in("office:1,2").unwrap(), (64, 36), Some(3)).unwrap();
        assert_eq!(
            resolve("frustum,hzb", &world, false).unwrap(),
            ("frustum,hzb".to_owned(), None),
            "a list without `auto`"
        );
        let (list, advice) = resolve("frustum, auto", &world, false).unwrap();
        let advice = advice.unwrap();
        assert_eq!(list, format!("frustum,{}", advice.entry), "`auto` is replaced");
        assert!(
            advice.chosen.is_sound() && advice.chosen.total_us <= advice.frustum.total_us,
            "the choice is sound: {:?}",
            advice.chosen
        );
        assert!(
            advice.tried > 1 && cullers::parse(&list, &world).is_ok(),
            "{} settings were tried, and the list is read",
            advice.tried
        );
        // A quick choice does not bake sets for made cells, but tries portal culling with made cells.
        let mut outdoors = World::new(built_in("town:1").unwrap(), (64, 36), Some(1)).unwrap();
        outdoors.makes_cells = true;
        let has = |world, name: &str| cullers::quick_entries(world).iter().any(|entry| entry.contains(name));
        assert!(
            has(&world, "pvs:objects") && !has(&outdoors, "pvs:objects") && !has(&outdoors, "pvs+"),
            "sets of cells are entries where the scene brings cells"
        );
        assert!(
            has(&outdoors, "region-pvs") && has(&outdoors, "portals+hzb"),
            "cullers of made cells are entries"
        );
    }

    #[test]
    fn a_quick_choice_tries_no_more_once_its_time_is_over() {
        let world = World::new(built_in("office:1,2").unwrap(), (64, 36), Some(12)).unwrap();
        let entries = cullers::quick_entries(&world);
        // The clock advances by 1/32 s at each reading; each culler reads it some dozens of times.
        let advice = |thorough: bool| {
            let asked = std::cell::Cell::new(0.0);
            let now = || asked.replace(asked.get() + 1.0 / 32.0);
            (advise_in_time(&world, &entries, thorough, &now).unwrap(), asked)
        };
        let (quick, asked) = advice(false);
        assert!(asked.get() > TRYING && quick.tried > 0, "{} s, {} tried", asked.get(), quick.tried);
        assert_eq!(quick.untried.last(), entries.last(), "the last entry is left");
        let late = advise_in_time(&world, &entries, false, &|| 2.0 * TRYING).unwrap();
        assert!(
            late.tried == 1 && late.untried.len() == entries.len() - 1 && late.chosen.objects > 0.0,
            "the frustum is always tried: {late:?}"
        );
        let (all, _) = advice(true);
        assert!(
            all.tried > quick.tried && all.untried.is_empty(),
            "{} tried with time, {} without",
            all.tried,
            quick.tried
        );
    }

    #[test]
    fn what_is_prepared_hides_beside_an_object_that_moves() {
        let mut source = built_in("office:1,3").unwrap();
        source.objects[0].motion = source.objects[0].bounds().map(Box::new);
        let world = World::new(source, (64, 36), Some(6)).unwrap();
        let entries = ["frustum", "occlusion-tree:8"].map(str::to_owned);
        let advice = advise_in_time(&world, &entries, false, &|| 0.0).unwrap();
        assert!(
            advice.chosen.objects < advice.frustum.objects && advice.entry == entries[1],
            "the occlusion tree leaves fewer objects than the frustum: {advice}"
        );
        let bake = advice.bake.as_ref().expect("a baked set");
        assert!(
            bake.trial.objects < advice.frustum.objects,
            "a baked set leaves {} objects, the frustum {}",
            bake.trial.objects,
            advice.frustum.objects
        );
    }

    #[test]
    fn preparations_are_timed_on_few_triangles_and_what_is_left_out_is_said() {
        let world = World::new(built_in("london:6,6").unwrap(), (64, 36), Some(1)).unwrap();
        let (all, sample) = (world.source.triangle_count(), Sample::new(&world));
        let triangles = sample.world.source.triangle_count();
        assert!(all > SAMPLE && (1..=SAMPLE).contains(&triangles), "{triangles} of {all}");
        // The estimate grows faster than the number of triangles.
        assert!(
            sample.factor > all as f64 / triangles as f64,
            "a factor of {} for {all} of {triangles} triangles",
            sample.factor
        );

        let facts = Advisor::new(&world.scene, &world.views, DrawCost::default()).unwrap().facts().to_owned();
        let untried = ["pvs:objects", "occlusion-tree:8", "pvs:walls+hzb"].map(str::to_owned).to_vec();
        let advice = Advice {
            entry: "hzb".to_owned(),
            facts,
            chosen: CullerTrial::default(),
            frustum: CullerTrial::default(),
            min_us: 1.0,
            tried: 2,
            untried,
            cells: false,
            bake: Err("not tried".to_owned()),
        };
        let line = "no time for 3 settings of pvs, occlusion-tree: --thorough tries them\n";
        assert!(advice.to_string().contains(line), "{advice}");
        let silent = Advice { untried: Vec::new(), ..advice };
        assert!(!silent.to_string().contains("no time"), "{silent}");
    }
}
