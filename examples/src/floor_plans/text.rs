//! Plans as text: a line `SEGMENTS QUERIES`, then SEGMENTS lines `x1 y1 x2 y2`, then QUERIES lines `x y`.

use super::plan_file::{PlanFile, Problem, check};

/// Reads a plan from text. Empty lines, and comments from a `#` to the end of a line, are ignored.
///
/// # Errors
///
/// Returns the number, counted from 1, of a line that is missing, has something other than the expected
/// numbers, is left over, or has a coordinate that is not finite or above 1e60 in magnitude.
pub fn read(content: &str) -> Result<PlanFile, Problem> {
    let mut lines = content
        .lines()
        .zip(1..)
        .map(|(line, number)| (line.split('#').next().unwrap_or("").trim(), number))
        .filter(|(line, _)| !line.is_empty());
    let [segments, queries] = row::<2, usize>(lines.next(), "SEGMENTS QUERIES")?;
    let mut plan = PlanFile::default();
    for _ in 0..segments {
        let [a, b, c, d] = coordinates::<4>(lines.next(), "x1 y1 x2 y2")?;
        plan.walls.push([[a, b], [c, d]]);
    }
    for _ in 0..queries {
        plan.eyes.push(coordinates::<2>(lines.next(), "x y")?);
    }
    match lines.next() {
        Some((_, number)) => Err(Problem::new(format!("line {number}"), "more lines than announced")),
        None => Ok(plan),
    }
}

fn coordinates<const N: usize>(line: Option<(&str, i32)>, form: &str) -> Result<[f64; N], Problem> {
    let row = row::<N, f64>(line, form)?;
    let place = || line.map_or_else(String::new, |(_, number)| format!("line {number}"));
    row.iter().try_for_each(|&x| check(x)).map_err(|problem| Problem::new(place(), problem))?;
    Ok(row)
}

fn row<const N: usize, T: std::str::FromStr + Copy + Default>(
    line: Option<(&str, i32)>,
    form: &str,
) -> Result<[T; N], Problem> {
    let (line, number) = line.ok_or_else(|| Problem::new("end of file", format!("expected `{form}`")))?;
    let wrong = || Problem::new(format!("line {number}"), format!("expected `{form}`, found `{line}`"));
    let mut numbers = [T::default(); N];
    let mut fields = line.split_whitespace();
    for number in &mut numbers {
        *number = fields.next().and_then(|field| field.parse().ok()).ok_or_else(wrong)?;
    }
    if fields.next().is_some() { Err(wrong()) } else { Ok(numbers) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_walls_and_eyes() {
        let plan = read("2 1\n0 0 1 0\n\n1 0 1e1 -2.5 # a wall\n.5 .5\n").unwrap();
        assert_eq!(
            plan.walls,
            [[[0.0, 0.0], [1.0, 0.0]], [[1.0, 0.0], [10.0, -2.5]]],
            "walls of rows of four numbers"
        );
        assert_eq!(plan.eyes, [[0.5, 0.5]], "the eye of a row of two numbers");
    }

    #[test]
    fn what_is_wrong_is_told_with_its_line() {
        for (content, place) in [
            ("", "end of file"),
            ("1 0\n", "end of file"),
            ("1 0\n0 0 1\n", "line 2"),
            ("1 0\n0 0 1 x\n", "line 2"),
            ("1 0\n0 0 1 1 1\n", "line 2"),
            ("0 0\n1 1\n", "line 2"),
            ("-1 0\n", "line 1"),
            ("1 1\n0 0 1 nan\n1 1\n", "line 2"),
            ("1 1\n0 0 1 1\ninf 1\n", "line 3"),
            ("1 1\n0 0 1 1e61\n1 1\n", "line 2"),
            ("18446744073709551615 0\n0 0 1 1\n", "end of file"),
        ] {
            assert_eq!(read(content).unwrap_err().place, place, "{content:?}");
        }
    }
}
