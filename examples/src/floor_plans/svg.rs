//! Plans as SVG: the outlines of paths, lines, polylines, polygons, rectangles and ellipses are walls.
//!
//! Curves become chords. Coordinates are user units of the file, with y downwards, after the transforms of
//! the elements. Percentages are of the file's `viewBox`. `use`, nested `svg` elements and transforms in
//! style sheets would move walls, and `display` and `visibility` in style sheets would hide some, as may
//! style sheets of other files, scripts and animations, so a file with any of these is refused rather than
//! read wrongly. Elements that are not drawn in place (definitions, clip paths, masks, markers, patterns,
//! symbols), not displayed (`display: none`) or not visible (`visibility: hidden` or `collapse`) make no
//! walls.

use super::plan_file::{PlanFile, Problem, check};
use kurbo::{Affine, CubicBez, ParamCurve, Point, QuadBez};
use roxmltree::{Document, Node, ParsingOptions};
use std::fmt::Display;
use std::str::FromStr;
use svgtypes::{Length, LengthUnit, NumberListParser, PathParser, PathSegment, Transform, ViewBox};

/// Number of chords that replace a curve.
const CHORDS: usize = 16;

/// Names of elements whose content is not drawn in place.
const UNDRAWN: [&str; 6] = ["defs", "clipPath", "mask", "marker", "pattern", "symbol"];

const MOVED: &str = "only the attribute `transform` may move what is drawn";

const STYLED: &str = "only an element's own `display` and `visibility` may hide what is drawn";

/// Names of style properties that hide an element.
const HIDING: [&str; 2] = ["display", "visibility"];

/// Values of `display` and of `visibility`, in lower case, that are read. An empty one: the property is not
/// set. Others may be variables, or wrong, in which case an earlier value holds.
const READ: [&[&str]; 2] =
    [&["", "none", "inline", "block", "inherit"], &["", "visible", "hidden", "collapse", "inherit"]];

/// Names of elements that change others: while they run, or by style sheets of other files.
const CHANGING: [&str; 7] =
    ["set", "animate", "animateTransform", "animateMotion", "discard", "script", "link"];

/// Names of style properties that move an element.
const MOVING: [&str; 6] = ["transform", "transform-origin", "translate", "rotate", "scale", "offset-path"];

/// Reads the outlines of an SVG file as walls.
///
/// # Errors
///
/// Returns the line of what is no XML, and that of an element that has invalid coordinates or moves or hides
/// drawn content in an unsupported way.
pub fn read(content: &str) -> Result<PlanFile, Problem> {
    let options = ParsingOptions { allow_dtd: true, ..ParsingOptions::default() };
    let document = Document::parse_with_options(content, options)
        .map_err(|error| Problem::new(format!("line {}", error.pos().row), error.to_string()))?;
    let mut plan = PlanFile { y_down: true, ..PlanFile::default() };
    let view_box = document.root_element().attribute("viewBox");
    // Maps from coordinates of nodes to those of the file, and whether the nodes are visible, by the nodes'
    // numbers. `None` where nothing is drawn.
    let mut maps = vec![Some((Affine::IDENTITY, true))];
    for node in document.descendants().skip(1) {
        let outer = node.parent().and_then(|parent| *maps.get(parent.id().get_usize())?);
        let map = map_of(node, outer).and_then(|map| {
            let Some((to_file, is_visible)) = map else { return Ok(None) };
            let before = plan.walls.len();
            element(node, view_box, to_file, &mut plan)?;
            if !is_visible {
                plan.walls.truncate(before);
            }
            Ok(map)
        });
        let line = || format!("line {}", document.text_pos_at(node.range().start).row);
        maps.push(map.map_err(|problem| Problem::new(line(), problem))?);
    }
    Ok(plan)
}

/// Returns the map from coordinates of a node to those of the file, and whether the node is visible, given
/// those of the node around it. `None` for a node that is not drawn. An error if something other than the
/// attribute `transform` moves what is drawn, or a style sheet may hide it.
fn map_of(node: Node<'_, '_>, outer: Option<(Affine, bool)>) -> Result<Option<(Affine, bool)>, String> {
    let name = node.tag_name().name();
    if CHANGING.contains(&name) || node.pi().is_some_and(|pi| pi.target == "xml-stylesheet") {
        return Err(STYLED.into());
    }
    // The content of a `style` element holds for the whole file.
    if name == "style" {
        let sheet: String = node.children().filter_map(|part| part.text()).collect();
        let sheet = without_comments(&sheet);
        if has_any(&sheet, &MOVING) {
            return Err(MOVED.into());
        }
        if has_any(&sheet, &HIDING) || sheet.to_ascii_lowercase().contains("@import") {
            return Err(STYLED.into());
        }
    }
    let style = without_comments(node.attribute("style").unwrap_or(""));
    // The values of the properties of the element itself: that of its style, else that of the attribute.
    let own = HIDING.map(|name| {
        let own = properties(&style).filter(|(of, _)| of.eq_ignore_ascii_case(name)).map(|(_, value)| value);
        // The last one counts, and `!important` ones before others.
        let last = own.enumerate().max_by_key(|(at, value)| (value.contains('!'), *at));
        let own = last.map(|(_, value)| value).or(node.attribute(name)).unwrap_or("");
        own.split('!').next().unwrap_or("").trim().to_ascii_lowercase()
    });
    if own.iter().zip(READ).any(|(value, read)| !read.contains(&value.as_str())) {
        return Err(STYLED.into());
    }
    let [display, visibility] = own;
    let is_drawn = display != "none" && !UNDRAWN.contains(&name);
    let Some((outer, is_outer_visible)) = outer.filter(|_| is_drawn) else { return Ok(None) };
    if node.has_attribute("transform-origin") || has_any(&style, &MOVING) {
        return Err(MOVED.into());
    }
    // Visible elements within hidden ones are drawn.
    let is_visible = match visibility.as_str() {
        "hidden" | "collapse" => false,
        "visible" => true,
        _ => is_outer_visible,
    };
    let map: Transform = parse("transform", node.attribute("transform").unwrap_or(""))?;
    Ok(Some((outer * Affine::new([map.a, map.b, map.c, map.d, map.e, map.f]), is_visible)))
}

/// Returns whether a style or a style sheet sets one of the properties.
fn has_any(style: &str, names: &[&str]) -> bool {
    properties(style).any(|(name, _)| names.iter().any(|other| name.eq_ignore_ascii_case(other)))
}

/// Returns the names and values of the properties in a style or a style sheet without comments.
fn properties(style: &str) -> impl Iterator<Item = (&str, &str)> {
    let parts = style.split([';', '{', '}']).filter_map(|part| part.split_once(':'));
    parts.map(|(name, value)| (name.trim(), value.trim()))
}

/// Returns a style or a style sheet with a space in the place of each comment.
fn without_comments(style: &str) -> String {
    let mut parts = style.split("/*");
    let first = parts.next().unwrap_or("").to_owned();
    parts.fold(first, |all, part| all + " " + part.split_once("*/").map_or("", |(_, after)| after))
}

/// Reads the value of the attribute `name`.
fn parse<T: FromStr<Err: Display>>(name: &str, value: &str) -> Result<T, String> {
    value.trim().parse().map_err(|error| format!("`{name}` is `{value}`: {error}"))
}

/// Adds the walls of an element through the map to coordinates of the file. `view_box` is the attribute
/// `viewBox` of the file.
fn element(
    node: Node<'_, '_>,
    view_box: Option<&str>,
    map: Affine,
    plan: &mut PlanFile,
) -> Result<(), String> {
    let number = |name: &str| {
        let Some(value) = node.attribute(name) else { return Ok(0.0) };
        let length: Length = parse(name, value)?;
        let view_box = || view_box.and_then(|text| text.parse::<ViewBox>().ok());
        let unit = match (length.unit, name) {
            (LengthUnit::None | LengthUnit::Px, _) => Some(1.0),
            (LengthUnit::Percent, "x" | "x1" | "x2" | "cx" | "rx" | "width") => {
                view_box().map(|view_box| view_box.w / 100.0)
            }
            (LengthUnit::Percent, "y" | "y1" | "y2" | "cy" | "ry" | "height") => {
                view_box().map(|view_box| view_box.h / 100.0)
            }
            _ => None,
        };
        unit.map(|unit| unit * length.number)
            .ok_or_else(|| format!("the unit of `{name}` is unknown: `{value}`"))
    };
    let first = plan.walls.len();
    match node.tag_name().name() {
        "use" => return Err("`use` is not supported: repeat the outline instead".into()),
        "svg" if node.ancestors().skip(1).any(|outer| outer.tag_name().name() == "svg") => {
            return Err("an `svg` inside another is not supported".into());
        }
        "path" => path(node.attribute("d").unwrap_or(""), plan)?,
        "line" => plan.walls.push([[number("x1")?, number("y1")?], [number("x2")?, number("y2")?]]),
        "rect" => {
            let [x, y, width, height] = [number("x")?, number("y")?, number("width")?, number("height")?];
            // SVG does not draw a rectangle without a width or a height.
            if width > 0.0 && height > 0.0 {
                plan.push_chain(&[[x, y], [x + width, y], [x + width, y + height], [x, y + height]], true);
            }
        }
        name @ ("circle" | "ellipse") => {
            let [rx, ry] = if name == "circle" { [number("r")?; 2] } else { [number("rx")?, number("ry")?] };
            let [cx, cy] = [number("cx")?, number("cy")?];
            let corner = |k: usize| {
                let (sin, cos) = (std::f64::consts::PI * k as f64 / CHORDS as f64).sin_cos();
                [cx + rx * cos, cy + ry * sin]
            };
            // SVG does not draw an ellipse with a radius of 0.
            if rx > 0.0 && ry > 0.0 {
                plan.push_chain(&(0..2 * CHORDS).map(corner).collect::<Vec<_>>(), true);
            }
        }
        name @ ("polyline" | "polygon") => {
            let numbers = NumberListParser::from(node.attribute("points").unwrap_or(""));
            let numbers: Vec<f64> = numbers.collect::<Result<_, _>>().map_err(|error| error.to_string())?;
            let (points, []) = numbers.as_chunks() else { return Err("the last point has no y".into()) };
            plan.push_chain(points, name == "polygon");
        }
        _ => {}
    }
    for end in plan.walls[first..].as_flattened_mut() {
        let at = map * Point::new(end[0], end[1]);
        *end = [at.x, at.y];
        end.iter().try_for_each(|&x| check(x))?;
    }
    Ok(())
}

/// Adds the walls along the outline that path data describe.
fn path(data: &str, plan: &mut PlanFile) -> Result<(), String> {
    let (mut at, mut start) = (Point::ZERO, Point::ZERO);
    // First control points of a smooth curve that comes next: of a quadratic and of a cubic one.
    let mut smooth = [at; 2];
    for segment in PathParser::from(data) {
        let segment = segment.map_err(|error| error.to_string())?;
        let base = if segment.is_abs() { Point::ZERO } else { at };
        let point = |x, y| Point::new(base.x + x, base.y + y);
        // Points within the segment, its end, and its last control point by the kind of the curve.
        let (chords, to, controls) = match segment {
            PathSegment::ClosePath { .. } => (Vec::new(), start, [None; 2]),
            PathSegment::MoveTo { x, y, .. } | PathSegment::LineTo { x, y, .. } => {
                (Vec::new(), point(x, y), [None; 2])
            }
            PathSegment::HorizontalLineTo { x, .. } => (Vec::new(), Point::new(base.x + x, at.y), [None; 2]),
            PathSegment::VerticalLineTo { y, .. } => (Vec::new(), Point::new(at.x, base.y + y), [None; 2]),
            PathSegment::Quadratic { x1, y1, x, y, .. } => quadratic(at, point(x1, y1), point(x, y)),
            PathSegment::SmoothQuadratic { x, y, .. } => quadratic(at, smooth[0], point(x, y)),
            PathSegment::CurveTo { x1, y1, x2, y2, x, y, .. } => {
                cubic(at, point(x1, y1), point(x2, y2), point(x, y))
            }
            PathSegment::SmoothCurveTo { x2, y2, x, y, .. } => {
                cubic(at, smooth[1], point(x2, y2), point(x, y))
            }
            PathSegment::EllipticalArc { rx, ry, x_axis_rotation, large_arc, sweep, x, y, .. } => {
                let (to, turn) = (point(x, y), x_axis_rotation.to_radians());
                (arc([at.x, at.y], [to.x, to.y], [rx, ry], turn, large_arc, sweep), to, [None; 2])
            }
        };
        if matches!(segment, PathSegment::MoveTo { .. }) {
            start = to;
        } else if !matches!(segment, PathSegment::ClosePath { .. }) || at != start {
            plan.push_chain(&[&[[at.x, at.y]], &chords[..], &[[to.x, to.y]]].concat(), false);
        }
        smooth = controls.map(|control| control.map_or(to, |control| to + (to - control)));
        at = to;
    }
    Ok(())
}

/// Returns points on a quadratic curve without its ends, its end, and its control point as the first.
fn quadratic(at: Point, control: Point, to: Point) -> (Vec<[f64; 2]>, Point, [Option<Point>; 2]) {
    (points(QuadBez::new(at, control, to)), to, [Some(control), None])
}

/// Returns points on a cubic curve without its ends, its end, and its last control point as the second.
fn cubic(at: Point, first: Point, last: Point, to: Point) -> (Vec<[f64; 2]>, Point, [Option<Point>; 2]) {
    (points(CubicBez::new(at, first, last, to)), to, [None, Some(last)])
}

/// Returns points on a curve, without its ends.
fn points(curve: impl ParamCurve) -> Vec<[f64; 2]> {
    cuts().map(|t| curve.eval(t)).map(|point| [point.x, point.y]).collect()
}

/// Returns the parameters from 0 to 1 at which a curve is cut into chords, without its ends.
fn cuts() -> impl Iterator<Item = f64> {
    (1..CHORDS).map(|i| i as f64 / CHORDS as f64)
}

/// Returns points on an elliptic arc, without its ends. Formulas: SVG 1.1, appendix F.6.5.
fn arc(from: [f64; 2], to: [f64; 2], radii: [f64; 2], turn: f64, large: bool, sweep: bool) -> Vec<[f64; 2]> {
    let [rx, ry] = radii.map(f64::abs);
    if rx == 0.0 || ry == 0.0 || from == to {
        return Vec::new();
    }
    let (sin, cos) = turn.sin_cos();
    let half = [(from[0] - to[0]) / 2.0, (from[1] - to[1]) / 2.0];
    let x = (cos * half[0] + sin * half[1]) / rx;
    let y = (cos * half[1] - sin * half[0]) / ry;
    // In units of the radii, the ends are (x, y) and (-x, -y). They lie on a circle of radius `grown`, which
    // is more than 1 if the radii are too small for the arc.
    let grown = (x * x + y * y).sqrt().max(1.0);
    let (x, y) = (x / grown, y / grown);
    let square = (x * x + y * y).max(f64::MIN_POSITIVE);
    let factor = ((1.0 - square).max(0.0) / square).sqrt() * if large == sweep { -1.0 } else { 1.0 };
    let centre = [factor * y, -factor * x];
    let angle = |x: f64, y: f64| (y - centre[1]).atan2(x - centre[0]);
    let (begin, mut end) = (angle(x, y), angle(-x, -y));
    if sweep && end < begin {
        end += std::f64::consts::TAU;
    } else if !sweep && end > begin {
        end -= std::f64::consts::TAU;
    }
    let middle = [(from[0] + to[0]) / 2.0, (from[1] + to[1]) / 2.0];
    let points = cuts().map(|t| {
        let angle = begin + t * (end - begin);
        let (u, v) = ((centre[0] + angle.cos()) * rx * grown, (centre[1] + angle.sin()) * ry * grown);
        [middle[0] + cos * u - sin * v, middle[1] + sin * u + cos * v]
    });
    points.collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::floor_plans::drawing::Drawing;

    /// Walls of elements within a file.
    fn walls(elements: &str) -> Vec<[[f64; 2]; 2]> {
        read(&format!("<svg viewBox='9 9 40 20' xmlns:svg='s'>{elements}</svg>")).unwrap().walls
    }

    #[test]
    fn outlines_are_walls() {
        let square = [
            [[1.0, 1.0], [3.0, 1.0]],
            [[3.0, 1.0], [3.0, 2.0]],
            [[3.0, 2.0], [1.0, 2.0]],
            [[1.0, 2.0], [1.0, 1.0]],
        ];
        for svg in [
            r#"<path id="d" d="M1 1 3 1 3 2 1 2Z"/>"#,
            r#"<path d='M 1,1 h2v1h-2z'/>"#,
            r#"<path d="m1 1l2 0 0 1-2 0z"/>"#,
            r#"<rect x="1" y="1" width="2" height="1"/>"#,
            r#"<polygon points="1,1 3,1 3,2 1,2"/>"#,
            r#"<!-- <line x1="9"/> --><path d="M1 1L3,1"/><path d="M3 1V2"/><path d="M3 2H1V1"/>"#,
        ] {
            assert_eq!(walls(svg), square, "{svg}");
        }
        assert_eq!(
            walls(r#"<line x1="1" y1="2" x2="-.5e1" y2="4"/>"#),
            [[[1.0, 2.0], [-5.0, 4.0]]],
            "a line with its own attributes"
        );
        assert_eq!(
            walls(r#"<line x1="50%" y1="1px" x2="100%" y2="10%"/>"#),
            [[[20.0, 1.0], [40.0, 2.0]]],
            "percentages of the box of the file"
        );
        let picture = Drawing::new([[0.0, 0.0], [4.0, 2.0]], true).finish();
        assert_eq!(
            read(&picture).unwrap().walls.len(),
            4,
            "the frame of a picture that the program draws: {picture}"
        );
    }

    #[test]
    fn curves_end_where_they_should() {
        for svg in [
            r#"<path d="M0 0C0 1 1 2 2 2S4 2 4 0"/>"#,
            r#"<path d="M0 0q1 2 2 0t2 0"/>"#,
            r#"<path d="M0 0A2 2 0 0 1 4 0"/>"#,
            r#"<path d="M0 0a2 2 0 014 0"/>"#,
        ] {
            let walls = walls(svg);
            assert_eq!(walls.last().unwrap()[1], [4.0, 0.0], "{svg}");
            assert!(
                walls.windows(2).all(|pair| pair[0][1] == pair[1][0]),
                "{svg}: each chord begins where the one before ends"
            );
        }
        for svg in [r#"<circle cx="3" r="2"/>"#, r#"<ellipse cx="3" rx="2" ry="2"/>"#] {
            let walls = walls(svg);
            assert_eq!((walls.len(), walls[0][0]), (2 * CHORDS, [5.0, 0.0]), "{svg}");
            assert!(walls.iter().all(|[a, _]| ((a[0] - 3.0).hypot(a[1]) - 2.0).abs() < 1e-12), "{svg}");
        }
        assert!(walls(r#"<circle cx="3" r="0"/>"#).is_empty(), "a circle of no radius");
        // With positive sweep and y downwards, the half circle passes through negative y.
        let top = walls(r#"<path d="M0 0A2 2 0 0 1 4 0"/>"#)[CHORDS / 2][0];
        assert!((top[0] - 2.0).abs() < 1e-9 && (top[1] + 2.0).abs() < 1e-9, "{top:?}");
    }

    #[test]
    fn a_smooth_curve_continues_one_of_its_kind_alone() {
        for svg in [r#"<path d="M0 0Q1 2 2 0S4 2 4 0"/>"#, r#"<path d="M0 0Q1 2 2 0C2 0 4 2 4 0"/>"#] {
            let middle = walls(svg)[CHORDS + CHORDS / 2][0];
            assert_eq!(middle, [3.0, 0.75], "{svg}");
        }
        assert_eq!(walls(r#"<path d="M0 0Q1 2 2 0T4 0"/>"#)[CHORDS + CHORDS / 2][0], [3.0, -1.0], "mirrored");
    }

    #[test]
    fn transforms_apply_from_the_inner_to_the_outer() {
        let svg = r#"<g transform="translate(10 20)"><g transform="scale(2)">
            <path transform="rotate(90)" d="M1 0L0 3"/></g></g><line x2="1"/>"#;
        let [[a, b], plain] = walls(svg)[..] else { panic!("two walls") };
        let is = |p: [f64; 2], q: [f64; 2]| (p[0] - q[0]).abs() < 1e-12 && (p[1] - q[1]).abs() < 1e-12;
        assert!(is(a, [10.0, 22.0]) && is(b, [4.0, 20.0]), "{a:?} {b:?}");
        assert_eq!(plain, [[0.0, 0.0], [1.0, 0.0]], "a line outside the groups");
    }

    #[test]
    fn what_is_not_drawn_is_no_wall() {
        for svg in [
            r#"<g style="fill:none; display: none"><g><use/></g></g><path d="M0 0L1 1"/>"#,
            r#"<g display="none"><g/><path d="M2 2L3 3"/></g><path d="M0 0L1 1"/>"#,
            r#"<svg:g><svg:path d="M0 0L1 1"/></svg:g>"#,
            r#"<defs/><style>.a{text-transform:none}</style><path style="fill:none" d="M0 0L1 1"/>"#,
            r#"<defs id="d"><path d="M2 2L3 3"/></defs><path d="M0 0L1 1"/>"#,
            r#"<clipPath><rect width="3" height="3"/></clipPath><path d="M0 0L1 1"/>"#,
            r#"<g style="display:none !important"><path d="M2 2L3 3"/></g><path d="M0 0L1 1"/>"#,
            r#"<path style="/* : */Display:NONE/*;*/" d="M2 2L3 3"/><path d="M0 0L1 1"/>"#,
            r#"<g visibility="hidden"><g><path d="M2 2L3 3"/></g></g><path d="M0 0L1 1"/>"#,
            r#"<path style="fill:none;visibility:collapse" d="M2 2L3 3"/><path d="M0 0L1 1"/>"#,
            r#"<g visibility="hidden"><path style="visibility: visible" d="M0 0L1 1"/></g>"#,
            r#"<rect width="0" height="5"/><rect width="5"/><path d="M0 0L1 1"/>"#,
        ] {
            assert_eq!(walls(svg), [[[0.0, 0.0], [1.0, 1.0]]], "{svg}");
        }
    }

    #[test]
    fn what_is_wrong_is_told() {
        for svg in [
            r#"<path d="M1"/>"#,
            r#"<path d="M1 1 X"/>"#,
            r#"<path d="M1 1L2 2z3 3"/>"#,
            r#"<g transform="spin(2)"><path d="M0 0L1 1"/></g>"#,
            r#"<g transform-origin="2 2"><path d="M0 0L1 1"/></g>"#,
            r#"<g><path d="M0 0L1 1"/>"#,
            r#"<path d="M0 0L1 1"/></g>"#,
            r#"<path d="M0 0L1e61 1"/>"#,
            r#"<path d="M0 0A1e300 1e-300 0 0 1 5 5"/>"#,
            r#"<line x1="one"/>"#,
            r#"<line x1="50%"/>"#,
            r#"<g><circle r="50%"/></g>"#,
            r#"<line x1="5mm"/>"#,
            r#"<polyline points="1 2 3"/>"#,
            r#"<path d="5 5 6 6"/>"#,
            r#"<path d="L5 5 6 6"/>"#,
            r#"<g style="fill:none; Transform : scale(2)"><path d="M0 0L1 1"/></g>"#,
            r#"<style><![CDATA[ .a > .b { scale: 2 } ]]></style><path d="M0 0L1 1"/>"#,
            r#"<style>.off{display:none}</style><path class="off" d="M0 0L1 1"/>"#,
            r#"<style>@import "off.css";</style><path class="off" d="M0 0L1 1"/>"#,
            r#"<?xml-stylesheet href="off.css"?><path class="off" d="M0 0L1 1"/>"#,
            r#"<style>.a{fill:none}<!-- --> .off { /* : */ Visibility: hidden }</style><path d="M0 0L1 1"/>"#,
            r#"<style>:root{--x:none}</style><path style="display:var(--x)" d="M0 0L1 1"/>"#,
            r#"<path style="visibility:hidden;visibility:foo" d="M0 0L1 1"/>"#,
            r#"<path style="display:foo" display="none" d="M0 0L1 1"/>"#,
            r#"<path d="M0 0L1 1"><set attributeName="display" to="none"/></path>"#,
            r#"<g><animateTransform type="scale" to="2"/><path d="M0 0L1 1"/></g>"#,
            r##"<path id="w" d="M0 0L9 0"/><discard href="#w" begin="0s"/>"##,
            r#"<link xmlns="http://www.w3.org/1999/xhtml" rel="stylesheet" href="off.css"/><path d="M0 0L1 1"/>"#,
            r#"<svg x="4"><path d="M0 0L1 1"/></svg>"#,
            r##"<path id="a" d="M0 0L1 1"/><use href="#a" x="4"/>"##,
        ] {
            assert!(read(&format!("<svg>{svg}</svg>")).is_err(), "{svg}");
        }
        for svg in ["", "<", "<path d=\"", "<path d=", "<!--", "text", "<p\u{e4}th d='M'>"] {
            assert!(read(svg).is_err(), "{svg}");
        }
        let place = |svg| read(svg).unwrap_err().place;
        assert_eq!(
            place("<svg>\n<g>\n<line\nx1='one'/></g></svg>"),
            "line 3",
            "the line of the number that is none"
        );
        assert_eq!(place("<svg>\n<g>\n</svg>\n"), "line 3", "the line of the end that does not match");
    }
}
