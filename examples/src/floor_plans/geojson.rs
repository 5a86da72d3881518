//! Plans as GeoJSON: lines and the rings of polygons are walls, points are eyes (RFC 7946).

use super::plan_file::{PlanFile, Problem, check};
use crate::json;
use serde_json::Value;

/// Reads a plan from GeoJSON of any type. Coordinates are taken as they are, without a map projection.
///
/// # Errors
///
/// Returns the place of a syntax error or of a key that is given twice, or the key path of an object that has
/// no type, lacks the list that its type requires, or has malformed coordinates.
pub fn read(content: &str) -> Result<PlanFile, Problem> {
    let value = json::parse(content.as_bytes())
        .map_err(|error| Problem::new(format!("line {}", error.line()), error.to_string()))?;
    let mut plan = PlanFile::default();
    object(&value, "", &mut plan)?;
    Ok(plan)
}

fn object(value: &Value, path: &str, plan: &mut PlanFile) -> Result<(), Problem> {
    let (coordinates, path_of) = (&value["coordinates"], format!("{path}.coordinates"));
    match value["type"].as_str() {
        Some(collection @ ("FeatureCollection" | "GeometryCollection")) => {
            let key = if collection == "FeatureCollection" { "features" } else { "geometries" };
            let path = format!("{path}.{key}");
            for (index, item) in list(&value[key], &path)?.iter().enumerate() {
                object(item, &format!("{path}[{index}]"), plan)?;
            }
        }
        // The geometry of a feature may be null.
        Some("Feature") if value["geometry"].is_null() => {}
        Some("Feature") => object(&value["geometry"], &format!("{path}.geometry"), plan)?,
        // A point without coordinates is empty, and adds no eye.
        Some("Point") if coordinates.as_array().is_some_and(Vec::is_empty) => {}
        Some("Point") => plan.eyes.push(position(coordinates, &path_of)?),
        Some("MultiPoint") => plan.eyes.extend(positions(coordinates, &path_of)?),
        Some("LineString") => plan.push_chain(&positions(coordinates, &path_of)?, false),
        Some("MultiLineString") => chains(coordinates, &path_of, false, plan)?,
        Some("Polygon") => chains(coordinates, &path_of, true, plan)?,
        Some("MultiPolygon") => {
            for (index, polygon) in list(coordinates, &path_of)?.iter().enumerate() {
                chains(polygon, &format!("{path_of}[{index}]"), true, plan)?;
            }
        }
        _ => return Err(Problem::new(format!("{path}.type"), "not a type of GeoJSON")),
    }
    Ok(())
}

fn list<'a>(value: &'a Value, path: &str) -> Result<&'a [Value], Problem> {
    value.as_array().map(Vec::as_slice).ok_or_else(|| Problem::new(path, "expected a list"))
}

fn chains(value: &Value, path: &str, closed: bool, plan: &mut PlanFile) -> Result<(), Problem> {
    for (index, chain) in list(value, path)?.iter().enumerate() {
        plan.push_chain(&positions(chain, &format!("{path}[{index}]"))?, closed);
    }
    Ok(())
}

fn positions(value: &Value, path: &str) -> Result<Vec<[f64; 2]>, Problem> {
    let items = list(value, path)?;
    items.iter().enumerate().map(|(index, item)| position(item, &format!("{path}[{index}]"))).collect()
}

fn position(value: &Value, path: &str) -> Result<[f64; 2], Problem> {
    match [&value[0], &value[1]].map(Value::as_f64) {
        [Some(x), Some(y)] => {
            let both = check(x).and_then(|()| check(y));
            both.map(|()| [x, y]).map_err(|problem| Problem::new(path, problem))
        }
        _ => Err(Problem::new(path, "expected a position: a list of two or three numbers")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_and_rings_are_walls_and_points_are_eyes() {
        let plan = read(
            r#"{"type": "FeatureCollection", "features": [
                {"type": "Feature", "geometry": {"type": "LineString", "coordinates": [[0, 0], [1, 0], [1, 2]]}},
                {"type": "Feature", "geometry": {"type": "Polygon",
                    "coordinates": [[[5, 5, 9], [6, 5], [6, 6], [5, 5]], []]}},
                {"type": "Feature", "geometry": null}, {"type": "Point", "coordinates": []},
                {"type": "Feature", "geometry": {"type": "GeometryCollection", "geometries": [
                    {"type": "Point", "coordinates": [3, 4]},
                    {"type": "MultiPolygon", "coordinates": [[[[0, 0], [1, 1], [2, 0]]]]}]}}]}"#,
        )
        .unwrap();
        assert_eq!(plan.walls.len(), 2 + 3 + 3, "walls of the line, the polygon and the ring");
        assert_eq!(plan.walls[7], [[2.0, 0.0], [0.0, 0.0]], "the last wall closes the ring");
        assert_eq!(plan.eyes, [[3.0, 4.0]], "the point is an eye");
    }

    #[test]
    fn what_is_wrong_is_told_with_its_place() {
        let nested = r#"{"type": "FeatureCollection", "features": [{"type": "Feature", "geometry": {}}]}"#;
        for (content, place) in [
            ("{", "line 1"),
            ("[]", ".type"),
            (r#"{"type": "LineString", "coordinates": [[0, 0], [1]]}"#, ".coordinates[1]"),
            (r#"{"type": "MultiPoint", "coordinates": [[0, 1], [1e61, 0]]}"#, ".coordinates[1]"),
            (r#"{"type": "LineString"}"#, ".coordinates"),
            (nested, ".features[0].geometry.type"),
            (r#"{"type": "Polygon", "coordinates": 5}"#, ".coordinates"),
            (r#"{"type": "MultiPolygon", "coordinates": [5]}"#, ".coordinates[0]"),
            (r#"{"type": "MultiLineString"}"#, ".coordinates"),
            (r#"{"type": "FeatureCollection"}"#, ".features"),
            (r#"{"type": "GeometryCollection", "features": []}"#, ".geometries"),
            ("{\"type\": \"Point\",\n\"coordinates\": [],\n\"coordinates\": [0, 1]}", "line 3"),
        ] {
            assert_eq!(read(content).unwrap_err().place, place, "the place of what is wrong in {content}");
        }
    }
}
