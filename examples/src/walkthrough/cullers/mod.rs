//! Cullers by name, as programs take them on the command line. Each family of cullers has a file here with a
//! table of its entries. Data that a culler needs from the scene are made when the culler is first asked for.

mod bsp;
mod contribution;
mod hom;
mod horizon;
mod hzb;
mod known;
pub mod plp;
pub mod portals;
mod pvs;
mod view_cdt;

pub use known::Known;

use super::World;
use visibility_core::{FrustumCuller, Pipeline};

/// Returns the entries of all cullers except `frustum`, with which every pipeline begins.
pub fn known() -> impl Iterator<Item = &'static Known> {
    [
        contribution::KNOWN,
        horizon::KNOWN,
        view_cdt::KNOWN,
        hom::KNOWN,
        hzb::KNOWN,
        bsp::KNOWN,
        portals::KNOWN,
        pvs::KNOWN,
        plp::KNOWN,
    ]
    .into_iter()
    .flatten()
}

/// Returns the names and descriptions of all cullers, one per line, for help texts and messages.
pub fn listing() -> String {
    let lines = known().map(|known| format!("\n  {}: {}", known.name, known.what));
    lines.fold("\n  frustum: boxes outside the view volume are hidden".to_owned(), |all, line| all + &line)
}

/// Pipelines of two and three stages that are worth comparing. A pipeline with a stage that does not suit the
/// scene is left out for that scene.
const PIPELINES: &[&str] =
    &["portals+hzb", "pvs+portals", "pvs+portals+hzb", "hzb+naylor", "plp:10%+hzb", "horizon+hzb"];

/// Returns all entries that are worth comparing: `frustum`, each culler at each of its settings, then the
/// pipelines.
pub fn entries() -> Vec<String> {
    let mut entries = vec!["frustum".to_owned()];
    for culler in known() {
        if culler.dials.is_empty() {
            entries.push(culler.name.to_owned());
        }
        entries.extend(culler.dials.iter().map(|dial| format!("{}:{dial}", culler.name)));
    }
    entries.extend(PIPELINES.iter().map(|&pipeline| pipeline.to_owned()));
    entries
}

/// Returns the [`entries`] that need no long preparation for a world. If the scene has no cells of its own,
/// leaves out cullers that would have to bake sets of made cells, which may take minutes.
pub fn quick_entries(world: &World) -> Vec<String> {
    let mut entries = entries();
    if world.source.cells.is_none() {
        entries.retain(|entry| !entry.split('+').any(|stage| stage == "pvs" || stage.starts_with("pvs:")));
    }
    entries
}

/// Makes pipelines from a list of entries separated by commas, such as `frustum,a,a+b:10%`. The entry `a+b`
/// runs `b` after `a`, and `b:10%` gives `b` the setting `10%`. Every pipeline begins with the frustum. Each
/// entry is returned with its pipeline; spaces around entries and cullers are removed.
///
/// # Errors
///
/// Returns the first [`CullerError`] of any entry.
pub fn parse(list: &str, world: &World) -> Result<Vec<(String, Pipeline)>, CullerError> {
    list.split(',')
        .map(|entry| {
            let entry = entry.split('+').map(str::trim).collect::<Vec<_>>().join("+");
            let pipeline = pipeline(&entry, world)?;
            Ok((entry, pipeline))
        })
        .collect()
}

/// Makes the pipeline of one entry such as `a+b:10%`, without spaces around cullers. It begins with the
/// frustum culler. Returns an error for the first stage that is unknown or does not suit the world.
fn pipeline(entry: &str, world: &World) -> Result<Pipeline, CullerError> {
    let mut pipeline = Pipeline::new().with(FrustumCuller::new().with_simd(world.simd));
    for stage in entry.split('+').filter(|&stage| stage != "frustum") {
        let (name, dial) = stage.split_once(':').map_or((stage, None), |(name, dial)| (name, Some(dial)));
        let known = known()
            .find(|known| known.name == name)
            .ok_or_else(|| CullerError::Unknown { name: name.to_owned() })?;
        let culler = (known.make)(dial, world)
            .map_err(|why| CullerError::Unsuited { culler: stage.to_owned(), why })?;
        pipeline.push(culler);
    }
    Ok(pipeline)
}

/// Reason why a culler cannot be made.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum CullerError {
    /// Name that is not among the [`known`] cullers.
    Unknown {
        /// Name of the culler as it was asked for.
        name: String,
    },
    /// Culler that does not suit its setting or the scene.
    Unsuited {
        /// Culler with its setting, as it was asked for.
        culler: String,
        /// Explanation, for a person, of what does not suit.
        why: String,
    },
}

impl std::fmt::Display for CullerError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Unknown { name } => {
                write!(f, "there is no culler `{name}`; known are:{}", listing())
            }
            Self::Unsuited { culler, why } => write!(f, "`{culler}`: {why}"),
        }
    }
}

impl std::error::Error for CullerError {}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::built_in;

    #[test]
    fn lists_are_split_and_unknown_names_refused() {
        let world = World::new(built_in("town:1").unwrap(), (64, 36), Some(1)).unwrap();
        let names: Vec<_> =
            parse("frustum, hzb + frustum", &world).unwrap().into_iter().map(|(name, _)| name).collect();
        assert_eq!(names, ["frustum", "hzb+frustum"], "names of cullers without spaces");
        let refused = |list| parse(list, &world).err();
        let missing = refused("frustum, baked:no such.set").map(|error| error.to_string());
        assert!(
            missing.is_some_and(|text| text.contains("`baked:no such.set`")),
            "a file's name keeps its space"
        );
        assert_eq!(
            refused("frustum,fog"),
            Some(CullerError::Unknown { name: "fog".into() }),
            "an unknown culler"
        );
        assert!(refused("").is_some(), "an empty list");
        assert!(
            matches!(refused("hzb:soon"), Some(CullerError::Unsuited { .. })),
            "a setting that does not fit"
        );
    }

    #[test]
    fn measured_cullers_are_known() {
        let rows = include_str!("../../../../docs/tradeoff.csv").lines().skip(1);
        let entries = rows.filter_map(|row| row.split(',').nth(1));
        let names = entries.flat_map(|entry| entry.split('+')).filter_map(|stage| stage.split(':').next());
        for name in names.filter(|&name| name != "frustum") {
            assert!(
                known().any(|known| known.name == name),
                "docs/tradeoff.csv has `{name}`, which no culler is called"
            );
        }
    }
}
