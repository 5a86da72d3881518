//! Transforms of SVG elements, from the attribute `transform` (SVG 1.1, section 7.6).

use super::svg_numbers::Numbers;

/// Affine map of the plane: (x, y) becomes (a x + c y + e, b x + d y + f).
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct Matrix([f64; 6]);

impl Matrix {
    pub(super) const IDENTITY: Self = Self([1.0, 0.0, 0.0, 1.0, 0.0, 0.0]);

    pub(super) fn apply(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let [a, b, c, d, e, f] = self.0;
        [a * x + c * y + e, b * x + d * y + f]
    }

    /// Returns the map that applies `first`, then this one.
    pub(super) fn after(&self, first: &Self) -> Self {
        let [a, b, c, d, e, f] = first.0;
        let [a1, b1, c1, d1, _, _] = self.0;
        let [e, f] = self.apply([e, f]);
        Self([a1 * a + c1 * b, b1 * a + d1 * b, a1 * c + c1 * d, b1 * c + d1 * d, e, f])
    }

    /// Reads a list of transforms and multiplies them, so that the last one applies first.
    pub(super) fn parse(list: &str) -> Result<Self, String> {
        let mut all = Self::IDENTITY;
        let mut rest = list.trim_matches(is_separator);
        while !rest.is_empty() {
            let wrong = || format!("unknown transform `{rest}`");
            let (name, after) = rest.split_once('(').ok_or_else(wrong)?;
            let (arguments, after) = after.split_once(')').ok_or_else(wrong)?;
            let mut numbers = Numbers(arguments);
            let mut values = Vec::new();
            while !numbers.is_at_end() {
                values.push(numbers.number()?);
            }
            let one = match (name.trim(), &values[..]) {
                ("matrix", &[a, b, c, d, e, f]) => Self([a, b, c, d, e, f]),
                ("translate", &[x]) => Self([1.0, 0.0, 0.0, 1.0, x, 0.0]),
                ("translate", &[x, y]) => Self([1.0, 0.0, 0.0, 1.0, x, y]),
                ("scale", &[x]) => Self([x, 0.0, 0.0, x, 0.0, 0.0]),
                ("scale", &[x, y]) => Self([x, 0.0, 0.0, y, 0.0, 0.0]),
                ("rotate", &[angle]) => Self::rotation(angle),
                ("rotate", &[angle, x, y]) => {
                    let [to, from] = [1.0, -1.0].map(|s| Self([1.0, 0.0, 0.0, 1.0, s * x, s * y]));
                    to.after(&Self::rotation(angle)).after(&from)
                }
                ("skewX", &[angle]) => Self([1.0, 0.0, angle.to_radians().tan(), 1.0, 0.0, 0.0]),
                ("skewY", &[angle]) => Self([1.0, angle.to_radians().tan(), 0.0, 1.0, 0.0, 0.0]),
                _ => return Err(wrong()),
            };
            all = all.after(&one);
            rest = after.trim_start_matches(is_separator);
        }
        Ok(all)
    }

    fn rotation(degrees: f64) -> Self {
        let (sin, cos) = degrees.to_radians().sin_cos();
        Self([cos, sin, -sin, cos, 0.0, 0.0])
    }
}

fn is_separator(c: char) -> bool {
    c.is_whitespace() || c == ','
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_apply_from_the_last_to_the_first() {
        for (list, to) in [
            ("", [1.0, 2.0]),
            ("translate(3)", [4.0, 2.0]),
            (" translate(3 , -1) scale(2) ", [5.0, 3.0]),
            ("scale(2,3),translate(1 1)", [4.0, 9.0]),
            ("rotate(90)", [-2.0, 1.0]),
            ("rotate(90 1 1)", [0.0, 1.0]),
            ("skewX(45)", [3.0, 2.0]),
            ("skewY(45)", [1.0, 3.0]),
            ("matrix(1 2 3 4 5 6)", [12.0, 16.0]),
            ("matrix(1 2 3 4 5 6) translate(-1-2)", [5.0, 6.0]),
        ] {
            let [x, y] = Matrix::parse(list).unwrap().apply([1.0, 2.0]);
            assert!((x - to[0]).abs() < 1e-12 && (y - to[1]).abs() < 1e-12, "{list}: {x}, {y}");
        }
        for list in ["spin(3)", "rotate(1 2)", "scale", "scale(2", "matrix(1 2 3)", "scale(a)", "rotate()"] {
            assert!(Matrix::parse(list).is_err(), "{list}");
        }
    }
}
