//! Plans as SVG: the outlines of paths, lines, polylines, polygons, rectangles and ellipses are walls.
//!
//! Curves become chords. Coordinates are user units of the file, with y downwards, after the transforms of
//! the elements. Percentages are of the file's `viewBox`. `use`, nested `svg` elements and transforms in
//! style sheets would move walls, so a file with any of these is refused rather than read wrongly. Elements
//! that are not drawn in place (definitions, clip paths, masks, markers, patterns, symbols) or not displayed
//! (`display: none`) make no walls.

use super::plan_file::{PlanFile, Problem, check};
use super::svg_numbers::Numbers;
use super::svg_transform::Matrix;

/// Number of chords that replace a curve.
const CHORDS: usize = 16;

/// Names of elements whose content is not drawn in place.
const UNDRAWN: [&str; 6] = ["defs", "clipPath", "mask", "marker", "pattern", "symbol"];

const MOVED: &str = "only the attribute `transform` may move what is drawn";

/// Names of style properties that move an element.
const MOVING: [&str; 6] = ["transform", "transform-origin", "translate", "rotate", "scale", "offset-path"];

/// Element whose end tag has not been read yet.
#[derive(Clone, Copy)]
struct Open<'a> {
    name: &'a str,
    /// Map from coordinates of the element to coordinates of the file.
    matrix: Matrix,
    is_drawn: bool,
}

/// Reads the outlines of an SVG file as walls.
///
/// # Errors
///
/// Returns the line of an element that has invalid coordinates, moves drawn content in an unsupported way, or
/// has no end; for a file without elements, the last line.
pub fn read(content: &str) -> Result<PlanFile, Problem> {
    let mut plan = PlanFile { y_down: true, ..PlanFile::default() };
    let (mut at, mut elements, mut has_root) = (0, 0, false);
    let mut view_box = None;
    let mut open: Vec<Open<'_>> = Vec::new();
    while let Some(begin) = content[at..].find('<').map(|index| at + index) {
        let problem = |problem: String| {
            let line = 1 + content[..begin].matches('\n').count();
            Problem::new(format!("line {line}"), problem)
        };
        let endless = || problem("what begins here has no end".into());
        // Comments, CDATA and declarations are skipped, since they contain no elements.
        let skip = [("<!--", "-->"), ("<![CDATA[", "]]>")]
            .into_iter()
            .find(|(mark, _)| content[begin..].starts_with(mark));
        if let Some((_, end)) = skip {
            at = begin + content[begin..].find(end).ok_or_else(endless)? + end.len();
            continue;
        }
        let end = element_end(content, begin).ok_or_else(endless)?;
        let text = &content[begin + 1..end];
        at = end + 1;
        if text.starts_with(['!', '?']) {
            continue;
        }
        if let Some(name) = text.strip_prefix('/') {
            if open.pop().is_none_or(|element| element.name != name_of(name)) {
                return Err(problem(format!("`{}` ends without a begin", name_of(name))));
            }
            continue;
        }
        let name = name_of(text);
        if name == "svg" && core::mem::replace(&mut has_root, true) {
            return Err(problem("an `svg` inside another is not supported".into()));
        }
        if name == "svg"
            && let Some(text) = attribute(text, "viewBox")
        {
            let mut numbers = Numbers(text);
            let (_corner, size) = (numbers.pair().map_err(problem)?, numbers.pair().map_err(problem)?);
            view_box = Some(size);
        }
        elements += 1;
        let (outer, is_drawn) = open.last().map_or((Matrix::IDENTITY, true), |o| (o.matrix, o.is_drawn));
        let is_drawn = is_drawn && !UNDRAWN.contains(&name) && !is_hidden(text);
        let matrix = if is_drawn { outer.after(&transform(text).map_err(problem)?) } else { outer };
        if is_drawn {
            let first = plan.walls.len();
            element(text, view_box, &mut plan).map_err(problem)?;
            for wall in &mut plan.walls[first..] {
                *wall = wall.map(|end| matrix.apply(end));
                wall.as_flattened().iter().try_for_each(|&x| check(x)).map_err(problem)?;
            }
        }
        if text.ends_with('/') {
            continue;
        }
        open.push(Open { name, matrix, is_drawn });
        // The content of a `style` element is CSS, in which `<` begins no element.
        if name == "style" {
            let length = content[end..].find("</").ok_or_else(endless)?;
            at = end + length;
            if is_moving(&content[end..at]) {
                return Err(problem(MOVED.into()));
            }
        }
    }
    let last = || format!("line {}", content.lines().count().max(1));
    match open.last() {
        Some(element) => Err(Problem::new(last(), format!("`{}` has no end", element.name))),
        None if elements == 0 => Err(Problem::new(last(), "the file has no element of SVG")),
        None => Ok(plan),
    }
}

/// Returns the offset of the `>` that ends an element, outside of quotes.
fn element_end(content: &str, begin: usize) -> Option<usize> {
    let mut quote = None;
    for (index, c) in content[begin..].char_indices() {
        match (quote, c) {
            (None, '>') => return Some(begin + index),
            (None, '"' | '\'') => quote = Some(c),
            (Some(open), c) if open == c => quote = None,
            _ => {}
        }
    }
    None
}

/// Returns the name of an element without its namespace, given the text between `<` and `>`.
fn name_of(element: &str) -> &str {
    let name = element.split(|c: char| c.is_whitespace() || c == '/').next().unwrap_or("");
    name.rsplit(':').next().unwrap_or(name)
}

/// Returns the transform of an element. An error if a style or an unsupported attribute moves the element.
fn transform(element: &str) -> Result<Matrix, String> {
    if attribute(element, "transform-origin").is_some() || attribute(element, "style").is_some_and(is_moving)
    {
        return Err(MOVED.into());
    }
    Matrix::parse(attribute(element, "transform").unwrap_or(""))
}

/// Returns whether an element is hidden together with its content.
fn is_hidden(element: &str) -> bool {
    let style = attribute(element, "style").unwrap_or("");
    let mut properties = style.split(';').filter_map(|part| part.split_once(':'));
    attribute(element, "display").is_some_and(|display| display.trim() == "none")
        || properties.any(|(name, value)| name.trim() == "display" && value.trim() == "none")
}

/// Returns whether a style has a property that moves the element.
fn is_moving(style: &str) -> bool {
    style
        .split([';', '{', '}'])
        .filter_map(|part| part.split_once(':'))
        .any(|(property, _)| MOVING.iter().any(|moving| property.trim().eq_ignore_ascii_case(moving)))
}

/// Returns the value of an attribute: the text between quotes after `name=`.
fn attribute<'a>(element: &'a str, name: &str) -> Option<&'a str> {
    let mut rest = element;
    loop {
        let equals = rest.find('=')?;
        let key = rest[..equals].trim_end();
        let value = rest[equals + 1..].trim_start();
        let quote = value.chars().next().filter(|c| matches!(c, '"' | '\''))?;
        let (value, after) = value[1..].split_once(quote)?;
        if key.ends_with(name) && key[..key.len() - name.len()].ends_with(char::is_whitespace) {
            return Some(value);
        }
        rest = after;
    }
}

/// Adds the walls of an element. `view_box` is the width and height of the file's `viewBox`.
fn element(element: &str, view_box: Option<[f64; 2]>, plan: &mut PlanFile) -> Result<(), String> {
    let number = |name: &str| {
        let Some(value) = attribute(element, name) else { return Ok(0.0) };
        let of = |percent: &str, size: f64| percent.parse::<f64>().ok().map(|percent| percent * size / 100.0);
        let number = match (value.trim().strip_suffix('%'), view_box, name) {
            (None, ..) => value.trim().parse().ok(),
            (Some(percent), Some([width, _]), "x" | "x1" | "x2" | "cx" | "rx" | "width") => {
                of(percent, width)
            }
            (Some(percent), Some([_, height]), "y" | "y1" | "y2" | "cy" | "ry" | "height") => {
                of(percent, height)
            }
            (Some(_), ..) => None,
        };
        number.ok_or_else(|| format!("`{name}` is no number: `{value}`"))
    };
    let name = name_of(element);
    match name {
        "use" => return Err("`use` is not supported: repeat the outline instead".into()),
        "path" => path(attribute(element, "d").unwrap_or(""), plan)?,
        "line" => plan.walls.push([[number("x1")?, number("y1")?], [number("x2")?, number("y2")?]]),
        "rect" => {
            let [x, y, width, height] = [number("x")?, number("y")?, number("width")?, number("height")?];
            plan.push_chain(&[[x, y], [x + width, y], [x + width, y + height], [x, y + height]], true);
        }
        "circle" | "ellipse" => {
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
        "polyline" | "polygon" => {
            let mut numbers = Numbers(attribute(element, "points").unwrap_or(""));
            let mut points = Vec::new();
            while !numbers.is_at_end() {
                points.push(numbers.pair()?);
            }
            plan.push_chain(&points, name == "polygon");
        }
        _ => {}
    }
    Ok(())
}

/// Adds the walls along the outline that path data describe.
fn path(data: &str, plan: &mut PlanFile) -> Result<(), String> {
    let mut numbers = Numbers(data);
    let (mut at, mut start) = ([0.0; 2], [0.0; 2]);
    // Last control point, which the smooth curve commands S and T reflect.
    let mut control = [0.0; 2];
    let mut command = 'M';
    if !numbers.is_at_end() && !numbers.0.starts_with(['M', 'm']) {
        return Err("a path begins with a move".into());
    }
    while !numbers.is_at_end() {
        match numbers.command() {
            Some(next) => command = next,
            // Coordinates without a command letter repeat the last command; after a move they are lines.
            None if command == 'M' => command = 'L',
            None if command == 'm' => command = 'l',
            None => {}
        }
        let base = if command.is_ascii_lowercase() { at } else { [0.0; 2] };
        let from_base = |[x, y]: [f64; 2]| [base[0] + x, base[1] + y];
        let mirrored = [2.0 * at[0] - control[0], 2.0 * at[1] - control[1]];
        let upper = command.to_ascii_uppercase();
        let mut curve = Vec::new();
        let to = match upper {
            'Z' => start,
            'M' | 'L' => from_base(numbers.pair()?),
            'H' => [base[0] + numbers.number()?, at[1]],
            'V' => [at[0], base[1] + numbers.number()?],
            'C' | 'S' => {
                let first = if upper == 'C' { from_base(numbers.pair()?) } else { mirrored };
                let second = from_base(numbers.pair()?);
                let to = from_base(numbers.pair()?);
                curve = chords(|t| {
                    let s = 1.0 - t;
                    mix([
                        (s * s * s, at),
                        (3.0 * s * s * t, first),
                        (3.0 * s * t * t, second),
                        (t * t * t, to),
                    ])
                });
                control = second;
                to
            }
            'Q' | 'T' => {
                let middle = if upper == 'Q' { from_base(numbers.pair()?) } else { mirrored };
                let to = from_base(numbers.pair()?);
                curve = chords(|t| {
                    let s = 1.0 - t;
                    mix([(s * s, at), (2.0 * s * t, middle), (t * t, to), (0.0, to)])
                });
                control = middle;
                to
            }
            'A' => {
                let (radii, turn) = (numbers.pair()?, numbers.number()?);
                let (large, sweep) = (numbers.flag()?, numbers.flag()?);
                let to = from_base(numbers.pair()?);
                curve = arc(at, to, radii, turn.to_radians(), large, sweep);
                to
            }
            other => return Err(format!("unknown command `{other}`")),
        };
        if !matches!(upper, 'C' | 'S' | 'Q' | 'T') {
            control = to;
        }
        if upper == 'M' {
            start = to;
        } else if upper != 'Z' || at != start {
            let mut chain = vec![at];
            chain.append(&mut curve);
            chain.push(to);
            plan.push_chain(&chain, false);
        }
        at = to;
        if upper == 'Z' && !numbers.is_at_end() && !numbers.0.starts_with(|c: char| c.is_ascii_alphabetic()) {
            return Err("numbers after the end of an outline".into());
        }
    }
    Ok(())
}

fn mix(terms: [(f64, [f64; 2]); 4]) -> [f64; 2] {
    [0, 1].map(|axis| terms.iter().map(|(share, point)| share * point[axis]).sum())
}

/// Returns points on a curve, without its ends. `at` maps a parameter from 0 to 1 to a point.
fn chords(at: impl Fn(f64) -> [f64; 2]) -> Vec<[f64; 2]> {
    (1..CHORDS).map(|i| at(i as f64 / CHORDS as f64)).collect()
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
    chords(|t| {
        let angle = begin + t * (end - begin);
        let (u, v) = ((centre[0] + angle.cos()) * rx * grown, (centre[1] + angle.sin()) * ry * grown);
        [middle[0] + cos * u - sin * v, middle[1] + sin * u + cos * v]
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::floor_plans::drawing::Drawing;

    fn walls(svg: &str) -> Vec<[[f64; 2]; 2]> {
        read(svg).unwrap().walls
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
            r#"<svg><path id="d" d="M1 1 3 1 3 2 1 2Z"/></svg>"#,
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
            walls(r#"<svg viewBox="9 9 40 20"><line x1="50%" y1="1" x2="100%" y2="10%"/></svg>"#),
            [[[20.0, 1.0], [40.0, 2.0]]],
            "percentages of the box of the file"
        );
        let picture = Drawing::new([[0.0, 0.0], [4.0, 2.0]], true).finish();
        assert_eq!(walls(&picture).len(), 4, "the frame of a picture that the program draws: {picture}");
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
            r#"<svg:svg><svg:path d="M0 0L1 1"/></svg:svg>"#,
            r#"<defs/><style>.a{text-transform:none}</style><path style="fill:none" d="M0 0L1 1"/>"#,
            r#"<defs id="d"><path d="M2 2L3 3"/></defs><path d="M0 0L1 1"/>"#,
            r#"<clipPath><rect width="3" height="3"/></clipPath><path d="M0 0L1 1"/>"#,
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
            r#"<svg viewBox="0 0 4 4"><circle r="50%"/></svg>"#,
            r#"<path d="5 5 6 6"/>"#,
            r#"<path d="L5 5 6 6"/>"#,
            r#"<g style="fill:none; Transform : scale(2)"><path d="M0 0L1 1"/></g>"#,
            r#"<style><![CDATA[ .a > .b { scale: 2 } ]]></style><path d="M0 0L1 1"/>"#,
            r#"<svg><svg x="4"><path d="M0 0L1 1"/></svg></svg>"#,
            r##"<path id="a" d="M0 0L1 1"/><use href="#a" x="4"/>"##,
        ] {
            assert!(read(svg).is_err(), "{svg}");
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
        assert_eq!(place("<svg>\n<g>\n</g>\n"), "line 3", "the line of the end that is missing");
    }
}
