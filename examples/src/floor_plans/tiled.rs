//! Plans as maps of the Tiled editor (`.tmx`): the outlines of tiles and the shapes of objects are walls,
//! points are eyes. Coordinates are pixels, with y downwards.
//!
//! Any tile is solid, whatever its picture, so `tiles::chosen` chooses the layers. Whether a layer is shown
//! does not matter, since layers of walls are often hidden. Tile sets and templates are not read. Format:
//! "TMX Map Format", the manual of Tiled.

use super::plan_file::{PlanFile, Problem, check};
use super::tiles::{self, Cells, push_outlines};
use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use kurbo::{Affine, Point};
use roxmltree::{Document, Node};
use std::str::FromStr;

/// Bits of a tile's number that tell how the tile is turned.
const TURNS: u32 = 0xf000_0000;

/// Most tiles of a layer or chunk: compressed layers of more are refused.
const MOST_TILES: usize = 1 << 26;

/// Number of chords of an ellipse, and of the two half circles of a capsule.
const CHORDS: usize = 32;

/// Reads the layers that are chosen by `wanted`, see `tiles::chosen`, as walls.
///
/// # Errors
///
/// Returns the line of what is no XML or no map, of a layer whose tiles are fewer or more than its size says,
/// are compressed in another way than zlib, or lie beyond the numbers of 32 bits, and of an object with
/// coordinates that are no numbers. A map that is not orthogonal is refused, since its cells are no
/// rectangles.
pub fn read(content: &str, wanted: &[String]) -> Result<PlanFile, Problem> {
    let document = Document::parse(content)
        .map_err(|error| Problem::new(format!("line {}", error.pos().row), error.to_string()))?;
    let at = |node: Node<'_, '_>| {
        let line = document.text_pos_at(node.range().start).row;
        move |problem: String| Problem::new(format!("line {line}"), problem)
    };
    let map = document.root_element();
    if map.tag_name().name() != "map" {
        return Err(at(map)("expected the element `map` of a Tiled map".into()));
    }
    if !matches!(map.attribute("orientation"), None | Some("orthogonal")) {
        return Err(at(map)("only orthogonal maps are read".into()));
    }
    let size = [number(map, "tilewidth"), number(map, "tileheight")];
    let [Ok(width), Ok(height)] = size else {
        return Err(at(map)("`tilewidth` and `tileheight` must be numbers".into()));
    };
    let is_layer = |node: &Node<'_, '_>| matches!(node.tag_name().name(), "layer" | "objectgroup");
    let is_inside =
        |node: &Node<'_, '_>| node.parent().is_some_and(|outer| outer.tag_name().name() != "tile");
    let layers: Vec<_> = map.descendants().filter(is_layer).filter(is_inside).collect();
    let names: Vec<&str> = layers.iter().map(|layer| layer.attribute("name").unwrap_or("")).collect();
    let chosen = tiles::chosen(&names, wanted).map_err(at(map))?;
    let mut plan = PlanFile { y_down: true, ..PlanFile::default() };
    for (&layer, is_chosen) in layers.iter().zip(chosen) {
        let origin = offset(layer).map_err(at(layer))?;
        if layer.tag_name().name() == "objectgroup" {
            for shape in children(layer, "object") {
                object(shape, origin, is_chosen, &mut plan).map_err(at(shape))?;
            }
        } else if is_chosen {
            let mut cells = Cells::new();
            for data in children(layer, "data") {
                read_cells(layer, data, &mut cells).map_err(at(data))?;
            }
            push_outlines(&cells, origin, [width, height], &mut plan);
        }
    }
    Ok(plan)
}

fn children<'a, 'b>(node: Node<'a, 'b>, name: &str) -> impl Iterator<Item = Node<'a, 'b>> {
    node.children().filter(move |child| child.tag_name().name() == name)
}

/// Reads an attribute, or its default where it is missing.
fn attribute<T: FromStr>(node: Node<'_, '_>, name: &str, default: T) -> Result<T, String> {
    let Some(text) = node.attribute(name) else { return Ok(default) };
    text.trim().parse().map_err(|_| format!("`{name}` is no number: `{text}`"))
}

/// Reads a coordinate, 0 where it is missing.
fn number(node: Node<'_, '_>, name: &str) -> Result<f64, String> {
    let number = attribute(node, name, 0.0)?;
    check(number).map(|()| number)
}

/// Returns the offset of a layer in pixels, with those of the groups around it.
fn offset(layer: Node<'_, '_>) -> Result<[f64; 2], String> {
    layer.ancestors().try_fold([0.0; 2], |[x, y], node| {
        let [x, y] = [x + number(node, "offsetx")?, y + number(node, "offsety")?];
        check(x).and(check(y)).map(|()| [x, y])
    })
}

/// Adds the cells of a layer's data, which may be divided into chunks.
fn read_cells(layer: Node<'_, '_>, data: Node<'_, '_>, cells: &mut Cells) -> Result<(), String> {
    let mut chunks = children(data, "chunk").peekable();
    if chunks.peek().is_none() {
        return read_chunk(layer, data, data, cells);
    }
    chunks.try_for_each(|chunk| read_chunk(chunk, data, chunk, cells))
}

/// Adds the cells of a chunk or of a whole layer. `sized` has the position and size in tiles, `data` the
/// encoding, and `content` the tiles row by row.
fn read_chunk(
    sized: Node<'_, '_>,
    data: Node<'_, '_>,
    content: Node<'_, '_>,
    cells: &mut Cells,
) -> Result<(), String> {
    let (left, top): (i32, i32) = (attribute(sized, "x", 0)?, attribute(sized, "y", 0)?);
    let (width, height): (usize, usize) = (attribute(sized, "width", 0)?, attribute(sized, "height", 0)?);
    let count = width.saturating_mul(height);
    let text: String = content.children().filter_map(|child| child.text()).collect();
    let tiles: Vec<u32> = match (data.attribute("encoding"), data.attribute("compression").unwrap_or("")) {
        (Some("csv"), _) => {
            let tile = |field: &str| field.trim().parse().map_err(|_| format!("no tile: `{}`", field.trim()));
            text.split(',').map(tile).collect::<Result<_, _>>()?
        }
        (Some("base64"), compression @ ("" | "zlib")) => {
            let compact: String = text.split_whitespace().collect();
            let mut bytes = BASE64_STANDARD.decode(compact).map_err(|error| error.to_string())?;
            if compression == "zlib" {
                let most = count.min(MOST_TILES).saturating_mul(4);
                bytes = miniz_oxide::inflate::decompress_to_vec_zlib_with_limit(&bytes, most)
                    .map_err(|_| format!("the tiles are no zlib stream of at most {most} bytes"))?;
            }
            let (tiles, _) = bytes.as_chunks();
            tiles.iter().map(|&tile| u32::from_le_bytes(tile)).collect()
        }
        (None, _) => {
            children(content, "tile").map(|tile| attribute(tile, "gid", 0)).collect::<Result<_, _>>()?
        }
        (_, compression) => {
            let problem = format!("tiles are compressed by `{compression}`");
            return Err(format!(
                "{problem}: choose CSV or zlib as the tile layer format in the map's properties"
            ));
        }
    };
    if tiles.len() != count {
        return Err(format!("expected {width} by {height} tiles, found {}", tiles.len()));
    }
    for (index, tile) in tiles.into_iter().enumerate().filter(|(_, tile)| tile & !TURNS != 0) {
        // The width is not 0, as there are tiles.
        let place = |first: i32, steps: usize| i32::try_from(steps).ok()?.checked_add(first);
        let cell = place(left, index % width).zip(place(top, index / width));
        cells
            .insert(cell.ok_or_else(|| format!("tile {index} lies beyond the numbers of 32 bits ({tile})"))?);
    }
    Ok(())
}

/// Adds the shape of an object as walls, if its layer is chosen, or a point as an eye. Texts and pictures of
/// tiles are left out.
fn object(object: Node<'_, '_>, origin: [f64; 2], is_wall: bool, plan: &mut PlanFile) -> Result<(), String> {
    let [x, y] = [number(object, "x")?, number(object, "y")?];
    let [width, height] = [number(object, "width")?, number(object, "height")?];
    let place = Affine::translate((origin[0] + x, origin[1] + y))
        * Affine::rotate(number(object, "rotation")?.to_radians());
    let shape = |name: &str| children(object, name).next();
    let (points, is_closed) = if shape("point").is_some() {
        plan.eyes.push(placed(place, [0.0; 2])?);
        return Ok(());
    } else if !is_wall || shape("text").is_some() || object.has_attribute("gid") {
        return Ok(());
    } else if let Some(polygon) = shape("polygon") {
        (listed(polygon)?, true)
    } else if let Some(polyline) = shape("polyline") {
        (listed(polyline)?, false)
    } else if shape("ellipse").is_some() || shape("capsule").is_some() {
        // A capsule is a rectangle with half circles in place of its shorter sides. The chords are within.
        let radii = if shape("capsule").is_some() {
            [0.5 * width.min(height); 2]
        } else {
            [0.5 * width, 0.5 * height]
        };
        let corner = |k: usize| {
            let (sin, cos) = (std::f64::consts::TAU * (k as f64 + 0.5) / CHORDS as f64).sin_cos();
            let along = |side: f64, radius: f64, part: f64| {
                0.5 * side + (0.5 * side - radius).copysign(part) + radius * part
            };
            [along(width, radii[0], cos), along(height, radii[1], sin)]
        };
        ((0..CHORDS).map(corner).collect(), true)
    } else {
        (vec![[0.0, 0.0], [width, 0.0], [width, height], [0.0, height]], true)
    };
    let points: Vec<_> = points.into_iter().map(|point| placed(place, point)).collect::<Result<_, _>>()?;
    plan.push_chain(&points, is_closed);
    Ok(())
}

/// Returns the point of an object in the plan.
fn placed(place: Affine, [x, y]: [f64; 2]) -> Result<[f64; 2], String> {
    let Point { x, y } = place * Point::new(x, y);
    check(x).and(check(y)).map(|()| [x, y])
}

/// Reads the attribute `points`: pairs `x,y` with spaces between them.
fn listed(shape: Node<'_, '_>) -> Result<Vec<[f64; 2]>, String> {
    let text = shape.attribute("points").unwrap_or("");
    let point = |pair: &str| {
        let (x, y) = pair.split_once(',')?;
        Some([x.parse().ok()?, y.parse().ok()?])
    };
    text.split_whitespace().map(|pair| point(pair).ok_or_else(|| format!("no point: `{pair}`"))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Map of a layer with the given data, 4 by 3 tiles of 16 by 8 pixels, and a layer of objects.
    fn map(data: &str, objects: &str) -> String {
        format!(
            r#"<?xml version="1.0" encoding="UTF-8"?>
<map version="1.10" orientation="orthogonal" width="4" height="3" tilewidth="16" tileheight="8">
 <tileset firstgid="1" source="walls.tsx"/>
 <layer id="1" name="Ground" width="4" height="3"><data encoding="csv">1,1,1,1,1,1,1,1,1,1,1,1</data></layer>
 <group offsetx="100"><layer id="2" name="Walls" width="4" height="3" offsety="-8">{data}</layer></group>
 <objectgroup id="3" name="collision shapes">{objects}</objectgroup>
</map>"#
        )
    }

    /// The second and third tile of the middle row are solid; the third is turned. The first of the map is no
    /// tile, turned.
    const CSV: &str = r#"<data encoding="csv">2147483648,0,0,0,
0,7,2684354567,0,
0,0,0,0</data>"#;

    #[test]
    fn all_encodings_have_the_same_walls() {
        let mut bytes = vec![0; 48];
        bytes[20..28].copy_from_slice(&[7, 0, 0, 0, 7, 0, 0, 0xa0]);
        let raw = BASE64_STANDARD.encode(&bytes);
        let zlib = BASE64_STANDARD.encode(miniz_oxide::deflate::compress_to_vec_zlib(&bytes, 6));
        let tile = |gid: u32| format!(r#"<tile gid="{gid}"/>"#);
        let elements: String =
            bytes.as_chunks().0.iter().map(|&tile| u32::from_le_bytes(tile)).map(tile).collect();
        let walls = read(&map(CSV, ""), &[]).unwrap().walls;
        // 16 pixels wide, from x = 100 + 16, y = -8 + 8.
        let expected = [[116.0, 0.0], [148.0, 0.0], [148.0, 8.0], [116.0, 8.0]];
        assert_eq!(walls.len(), 4, "walls of the csv: {walls:?}");
        assert!(walls.iter().flatten().all(|end| expected.contains(end)), "corners of the csv: {walls:?}");
        for (name, data) in [
            ("base64", format!(r#"<data encoding="base64"> {raw} </data>"#)),
            ("zlib", format!(r#"<data encoding="base64" compression="zlib">{zlib}</data>"#)),
            ("elements", format!("<data>{elements}</data>")),
            (
                "chunks",
                r#"<data encoding="csv"><chunk x="1" y="1" width="2" height="1">7,7</chunk><chunk x="-16" y="0"
                   width="1" height="1">0</chunk></data>"#
                    .into(),
            ),
        ] {
            let plan = read(&map(&data, ""), &[]).unwrap();
            assert_eq!((plan.walls, plan.y_down), (walls.clone(), true), "walls of {name}");
        }
        let ground = read(&map(CSV, ""), &["ground".into()]).unwrap().walls;
        assert_eq!(ground.len(), 4, "walls around the ground, which is full");
    }

    #[test]
    fn shapes_of_objects_are_walls_and_points_are_eyes() {
        let objects = r#"<object x="10" y="20" width="4" height="2"/>
            <object x="10" y="20" width="4" height="2" rotation="90"/>
            <object x="1" y="1"><polygon points="0,0 5,0 0,5.5"/></object>
            <object x="1" y="1"><polyline points="0,0 5,0 0,5"/></object>
            <object x="0" y="0" width="4" height="4"><ellipse/></object>
            <object x="3" y="4"><point/></object>
            <object x="50" y="60" width="8" height="2"><capsule/></object>
            <object x="50" y="60" width="2" height="8"><capsule/></object>
            <object x="3" y="4" width="9" height="9"><text>Sign</text></object>
            <object gid="5" x="3" y="4" width="9" height="9"/>"#;
        let plan = read(&map(CSV, objects), &["collision shapes".into()]).unwrap();
        assert_eq!(plan.walls.len(), 4 + 4 + 3 + 2 + 3 * 32, "walls of each shape");
        assert_eq!(plan.walls[0], [[10.0, 20.0], [14.0, 20.0]], "a rectangle's upper side");
        // Turned clockwise on a screen, whose y is down, the side to the right leads down.
        let [from, to] = plan.walls[4];
        assert_eq!((from, to.map(f64::round)), ([10.0, 20.0], [10.0, 24.0]), "the turned rectangle's side");
        assert_eq!(plan.walls[9], [[6.0, 1.0], [1.0, 6.5]], "the polygon's long side");
        assert_eq!(plan.eyes, [[3.0, 4.0]], "the point");
        for (first, long) in [(45, 0), (77, 1)] {
            for [end, _] in &plan.walls[first..first + 32] {
                // Relative to the middle of the nearer half circle, whose radius is 1.
                let [along, across] = [end[long] - [50.0, 60.0][long], end[1 - long] - [60.0, 50.0][long]];
                let distance = (along - along.clamp(1.0, 7.0)).hypot(across - 1.0);
                assert!(
                    (distance - 1.0).abs() < 1e-9,
                    "a capsule's corner {end:?} is {distance} from its axis"
                );
            }
            let lengths = plan.walls[first..first + 32].iter().map(|[a, b]| (a[0] - b[0]).hypot(a[1] - b[1]));
            assert_eq!(lengths.filter(|length| *length > 6.0).count(), 2, "long sides of a capsule");
        }
        let eyes = read(&map(CSV, objects), &["Ground".into()]).unwrap().eyes;
        assert_eq!(eyes, [[3.0, 4.0]], "eyes count on layers that have no walls");
    }

    #[test]
    fn what_is_wrong_is_told_with_its_line() {
        let map_of = |attributes: &str| format!("<map tilewidth=\"1\" tileheight=\"1\" {attributes}/>");
        for (content, place, part) in [
            ("<map".to_owned(), "line 1", ""),
            ("<svg/>".into(), "line 1", "`map`"),
            (map_of("orientation=\"isometric\""), "line 1", "orthogonal"),
            ("<map tilewidth=\"wide\"/>".into(), "line 1", "tilewidth"),
            (map("<data encoding=\"csv\">1,2</data>", ""), "line 5", "4 by 3 tiles, found 2"),
            (map("<data encoding=\"csv\">1,x</data>", ""), "line 5", "no tile: `x`"),
            (map("<data encoding=\"base64\">AA</data>", ""), "line 5", "adding"),
            (map("<data encoding=\"base64\" compression=\"zlib\">AAAA</data>", ""), "line 5", "zlib"),
            (map("<data encoding=\"base64\" compression=\"zstd\">AAAA</data>", ""), "line 5", "zstd"),
            (
                map(
                    "<data encoding=\"csv\"><chunk x=\"2147483647\" width=\"2\" height=\"1\">1,1</chunk></data>",
                    "",
                ),
                "line 5",
                "32 bits",
            ),
            (
                map("<data><chunk width=\"99999999999\" height=\"99999999999\"/></data>", ""),
                "line 5",
                "found 0",
            ),
            (map(CSV, "<object x=\"nan\"/>"), "line 8", "no number"),
            (map(CSV, "<object><polygon points=\"1,2 3\"/></object>"), "line 8", "no point: `3`"),
        ] {
            let Problem { place: found, problem } = read(&content, &[]).unwrap_err();
            assert_eq!(found, place, "the line of {content}: {problem}");
            assert!(problem.contains(part), "{content}: {problem}");
        }
        assert!(
            read(&map(CSV, ""), &["roof".into()]).unwrap_err().problem.contains("Ground, Walls"),
            "names"
        );
    }
}
