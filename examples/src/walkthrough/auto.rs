//! Automatic choice of a culler: tries every culler that suits a world on a few of its views, and advises the
//! fastest with the measured reason.

use super::bake_advice::{self, BakeEstimate};
use super::{World, cullers};
use std::fmt;
use std::time::Instant;
use visibility_core::View;
use visibility_measure::{Advisor, CullerTrial, DrawCost, MeasureError, SceneFacts};

/// Maximum number of views that are probed, spread evenly over the walks.
const VIEWS: usize = 12;

/// Advice on the culler to use, with the measurements behind it.
#[derive(Debug, Clone, PartialEq)]
pub struct Advice {
    /// Culler with its setting, as `--cullers` takes it.
    pub entry: String,
    /// Facts about the scene that the probed views gave, such as its size and visible fraction.
    pub facts: SceneFacts,
    /// Measured times and counts of the advised culler, means per view.
    pub chosen: CullerTrial,
    /// Measured times and counts of frustum culling alone, means per view.
    pub frustum: CullerTrial,
    /// Time in microseconds per view to draw exactly the visible objects, without any time to cull.
    pub least_us: f64,
    /// Number of cullers that were tried.
    pub tried: usize,
    /// Whether the scene brings cells and portals; cells made of its triangles do not count.
    pub cells: bool,
    /// What a bake would give, or why that is not known.
    pub bake: Result<BakeEstimate, String>,
}

/// Tries the given cullers and advises the one with the least time to cull and draw, among those that promise
/// to hide no visible object and kept the promise. The first entry should be `frustum`, with which the advice
/// is compared; cullers that do not suit the scene are skipped.
///
/// # Errors
///
/// Returns [`MeasureError`] when the scene has too many triangles to number.
pub fn advise(world: &World, entries: &[String]) -> Result<Advice, MeasureError> {
    let step = world.views.len().div_ceil(VIEWS).max(1);
    let views: Vec<View> = world.views.iter().step_by(step).cloned().collect();
    let advisor = Advisor::new(&world.scene, &views, DrawCost::default())?;
    let clock = Instant::now();
    let now = || clock.elapsed().as_secs_f64();
    let mut best: Option<(String, CullerTrial)> = None;
    let (mut frustum, mut tried) = (CullerTrial::default(), 0);
    for entry in entries {
        // A culler that does not suit the scene is an error here.
        let Ok(mut made) = cullers::parse(entry, world) else { continue };
        let limit = best.as_ref().map_or(f64::INFINITY, |(_, trial)| trial.total_us);
        tried += 1;
        let Some((_, trial)) = advisor.best([&mut made[0].1], now) else { continue };
        if tried == 1 {
            frustum = trial;
        }
        if trial.total_us < limit {
            best = Some((entry.clone(), trial));
        }
    }
    let (entry, chosen) = best.unwrap_or(("frustum".to_owned(), frustum));
    let (facts, least_us) = (*advisor.facts(), advisor.least_us());
    let bake = bake_advice::estimate(world, &views, &entry);
    let cells = world.source.cells.is_some();
    Ok(Advice { entry, facts, chosen, frustum, least_us, tried, cells, bake })
}

/// Returns a list of cullers with each `auto` replaced by the advised culler, and the advice; `None` as the
/// advice if the list has no `auto`. The cullers tried are the [`quick_entries`](cullers::quick_entries).
///
/// # Errors
///
/// Returns the errors of [`advise`].
pub fn resolve(list: &str, world: &World) -> Result<(String, Option<Advice>), MeasureError> {
    if !list.split(',').any(|entry| entry.trim() == "auto") {
        return Ok((list.to_owned(), None));
    }
    let advice = advise(world, &cullers::quick_entries(world))?;
    let resolved = list.split(',').map(|entry| if entry.trim() == "auto" { &advice.entry } else { entry });
    Ok((resolved.collect::<Vec<_>>().join(","), Some(advice)))
}

impl fmt::Display for Advice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { entry, facts, chosen, frustum, least_us, tried, cells, bake } = self;
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
            "that is {:.2} times the box limit and {:.1} times the ideal: the visible triangles, without any time to cull, {least_us:.0} us",
            chosen.objects / facts.box_limit.max(1.0),
            chosen.total_us / least_us.max(1.0),
        )?;
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
        assert_eq!(resolve("frustum,hzb", &world).unwrap(), ("frustum,hzb".to_owned(), None));
        let (list, advice) = resolve("frustum, auto", &world).unwrap();
        let advice = advice.unwrap();
        assert_eq!(list, format!("frustum,{}", advice.entry));
        assert!(advice.chosen.is_sound() && advice.chosen.total_us <= advice.frustum.total_us);
        assert!(advice.tried > 1 && cullers::parse(&list, &world).is_ok());
        // Sets of cells that would have to be made are not baked in passing; the culler of cells is tried.
        let mut outdoors = World::new(built_in("town:1").unwrap(), (64, 36), Some(1)).unwrap();
        outdoors.makes_cells = true;
        let has = |world, name: &str| cullers::quick_entries(world).iter().any(|entry| entry.contains(name));
        assert!(has(&world, "pvs:objects") && !has(&outdoors, "pvs:objects") && !has(&outdoors, "pvs+"));
        assert!(has(&outdoors, "region-pvs") && has(&outdoors, "portals+hzb"));
    }
}
