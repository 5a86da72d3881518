//! Plans as projects of the LDtk editor (`.ldtk`, and `.ldtkl` for a level saved on its own): the outlines of
//! `IntGrid` cells with a value other than 0 are walls. Coordinates are pixels of the world, with y
//! downwards.
//!
//! If a project has levels at several depths, the levels at the depth of the first level are read. Only the
//! few fields that matter are read, which all versions since 1.0 have. Format: "LDtk JSON format", ldtk.io.

use super::plan_file::{PlanFile, Problem};
use super::tiles::{self, Cells, push_outlines};
use serde::Deserialize;

/// Project, or a world of a project with several.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct World {
    levels: Vec<Level>,
    #[serde(default)]
    worlds: Vec<World>,
    world_layout: Option<String>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Level {
    identifier: String,
    #[serde(default)]
    world_x: f64,
    #[serde(default)]
    world_y: f64,
    #[serde(default)]
    world_depth: i64,
    px_wid: f64,
    px_hei: f64,
    layer_instances: Option<Vec<Layer>>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Layer {
    #[serde(rename = "__identifier")]
    identifier: String,
    #[serde(rename = "__type")]
    kind: String,
    #[serde(rename = "__cWid")]
    columns: u64,
    #[serde(rename = "__cHei")]
    rows: u64,
    #[serde(rename = "__gridSize")]
    grid_size: f64,
    #[serde(rename = "__pxTotalOffsetX", default)]
    offset_x: f64,
    #[serde(rename = "__pxTotalOffsetY", default)]
    offset_y: f64,
    #[serde(default)]
    int_grid_csv: Vec<i64>,
}

/// Reads the `IntGrid` layers that are chosen by `wanted`, see `tiles::chosen`, of all levels of a project.
///
/// # Errors
///
/// Returns the line of what is no JSON or lacks a field, or the name of a level whose layers are in a file of
/// their own, or of a layer that has fewer or more cells than its size says, or no place in 32 bits.
pub fn read(content: &str, wanted: &[String]) -> Result<PlanFile, Problem> {
    let project: World = parse(content)?;
    let worlds = || std::iter::once(&project).chain(&project.worlds);
    let depth = worlds().find_map(|world| world.levels.first()).map(|level| level.world_depth);
    let mut levels = Vec::new();
    for world in worlds() {
        let mut end = [0.0; 2];
        for level in &world.levels {
            // Levels in a row have no places of their own.
            let origin = match world.world_layout.as_deref() {
                Some("LinearHorizontal") => [end[0], 0.0],
                Some("LinearVertical") => [0.0, end[1]],
                _ => [level.world_x, level.world_y],
            };
            end = [end[0] + level.px_wid, end[1] + level.px_hei];
            if Some(level.world_depth) == depth {
                levels.push((level, origin));
            }
        }
    }
    plan_of(&levels, wanted)
}

/// Reads a level that is saved on its own, like [`read`]. The level begins at (0, 0).
///
/// # Errors
///
/// Returns the errors of [`read`].
pub fn read_level(content: &str, wanted: &[String]) -> Result<PlanFile, Problem> {
    plan_of(&[(&parse(content)?, [0.0; 2])], wanted)
}

fn parse<'a, T: Deserialize<'a>>(content: &'a str) -> Result<T, Problem> {
    serde_json::from_str(content)
        .map_err(|error| Problem::new(format!("line {}", error.line()), error.to_string()))
}

fn plan_of(levels: &[(&Level, [f64; 2])], wanted: &[String]) -> Result<PlanFile, Problem> {
    let mut layers = Vec::new();
    for (level, origin) in levels {
        let Some(all) = &level.layer_instances else {
            let problem = "its layers are in a file of their own: give that file, with the extension .ldtkl";
            return Err(Problem::new(&level.identifier, problem));
        };
        layers
            .extend(all.iter().filter(|layer| layer.kind == "IntGrid").map(|layer| (*level, layer, *origin)));
    }
    let names: Vec<&str> = layers.iter().map(|(_, layer, _)| layer.identifier.as_str()).collect();
    let chosen = tiles::chosen(&names, wanted).map_err(|problem| Problem::new("layers", problem))?;
    let mut plan = PlanFile { y_down: true, ..PlanFile::default() };
    for ((level, layer, [x, y]), _) in layers.into_iter().zip(chosen).filter(|(_, is_chosen)| *is_chosen) {
        let found = layer.int_grid_csv.len() as u64;
        if layer.columns.checked_mul(layer.rows) != Some(found) {
            let place = format!("{}.{}", level.identifier, layer.identifier);
            let problem = format!("expected {} by {} cells, found {found}", layer.columns, layer.rows);
            return Err(Problem::new(place, problem));
        }
        let solid = layer.int_grid_csv.iter().zip(0_u64..).filter(|(value, _)| **value != 0);
        let number = |cells: u64| i32::try_from(cells).ok();
        let cell = |index: u64| number(index % layer.columns).zip(number(index / layer.columns));
        let cells: Option<Cells> = solid.map(|(_, index)| cell(index)).collect();
        let cells =
            cells.ok_or_else(|| Problem::new(&layer.identifier, "it has more cells than 32 bits count"))?;
        push_outlines(&cells, [x + layer.offset_x, y + layer.offset_y], [layer.grid_size; 2], &mut plan);
    }
    Ok(plan)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn level(name: &str, x: i32, depth: i32, cells: &str) -> String {
        format!(
            r#"{{"identifier": "{name}", "iid": "x", "worldX": {x}, "worldY": 0, "worldDepth": {depth},
                "pxWid": 24, "pxHei": 16, "layerInstances": [
                {{"__identifier": "Entities", "__type": "Entities", "__cWid": 3, "__cHei": 2, "__gridSize": 8}},
                {{"__identifier": "Collisions", "__type": "IntGrid", "__cWid": 3, "__cHei": 2, "__gridSize": 8,
                  "__pxTotalOffsetX": 1, "__pxTotalOffsetY": 2, "intGridCsv": {cells}}},
                {{"__identifier": "Water", "__type": "IntGrid", "__cWid": 3, "__cHei": 2, "__gridSize": 8,
                  "intGridCsv": [1, 1, 1, 1, 1, 1]}}]}}"#
        )
    }

    fn project(layout: &str, levels: &[String]) -> String {
        format!(r#"{{"jsonVersion": "1.5.3", "worldLayout": {layout}, "levels": [{}]}}"#, levels.join(","))
    }

    const CELLS: &str = "[0, 1, 2, 0, 0, 0]";

    #[test]
    fn cells_with_a_value_have_walls_around_them_where_their_level_is() {
        let levels = [level("A", 0, 1, CELLS), level("B", 96, 1, CELLS), level("C", 0, 2, CELLS)];
        let walls = read(&project("\"GridVania\"", &levels), &[]).unwrap().walls;
        assert_eq!(walls.len(), 8, "walls of two levels at one depth: {walls:?}");
        assert!(walls.contains(&[[9.0, 2.0], [25.0, 2.0]]), "the upper wall of the first level: {walls:?}");
        assert!(walls.contains(&[[105.0, 2.0], [121.0, 2.0]]), "the upper wall of the second: {walls:?}");
        let walls = read(&project("\"LinearHorizontal\"", &levels), &[]).unwrap().walls;
        assert!(walls.contains(&[[33.0, 2.0], [49.0, 2.0]]), "levels in a row: {walls:?}");
        let worlds = format!(
            r#"{{"levels": [], "worldLayout": null, "worlds": [{}]}}"#,
            project("\"Free\"", &levels[..1])
        );
        let plan = read(&worlds, &[]).unwrap();
        let alone = read_level(&level("A", 700, 0, CELLS), &[]).unwrap();
        assert_eq!(plan, alone, "a level of a world, and saved on its own");
        assert_eq!(read(&worlds, &["water".into()]).unwrap().walls.len(), 4, "the water's walls by wish");
    }

    #[test]
    fn what_is_wrong_is_told_with_its_place() {
        let own = r#"{"identifier": "Cave", "pxWid": 1, "pxHei": 1, "layerInstances": null}"#;
        for (content, place, part) in [
            ("{".to_owned(), "line 1", "EOF"),
            ("{}".into(), "line 1", "levels"),
            (project("null", &[own.into()]), "Cave", ".ldtkl"),
            (project("null", &[level("A", 0, 0, "[1]")]), "A.Collisions", "3 by 2 cells, found 1"),
            (project("null", &[level("A", 0, 0, "[0.5]")]), "line 5", "0.5"),
        ] {
            let Problem { place: found, problem } = read(&content, &[]).unwrap_err();
            assert_eq!(found, place, "the place of {content}: {problem}");
            assert!(problem.contains(part), "{content}: {problem}");
        }
        let huge = level("A", 0, 0, "[]").replace("\"__cWid\": 3", "\"__cWid\": 18446744073709551615");
        assert!(read(&project("null", &[huge]), &[]).is_err(), "a size beyond numbers");
    }
}
