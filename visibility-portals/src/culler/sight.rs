//! Where lines of sight come from, and how a view bounds them.

use super::side::{Side, U};
use smallvec::SmallVec;
use visibility_core::glam::DVec3;
use visibility_core::view::{ClipRow, ViewProjection};
use visibility_core::{Eye, View};

/// How the lines of sight of a view run.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) enum Lines {
    /// From the anchor, which is the eye.
    FromAnchor,
    /// Along a unit direction, known up to so much.
    Along(DVec3, f64),
}

/// A view as portals are clipped to it. All is relative to the anchor, a point of the world: the eye, if there is one.
#[derive(Clone, Debug)]
pub(super) struct Sight {
    pub(super) anchor: DVec3,
    pub(super) lines: Lines,
    /// How far the true eye may be from the anchor.
    pub(super) error: f64,
    /// Left, right, bottom and top.
    pub(super) sides: [Side; 4],
    /// Far, if there is one, and again the clip planes: what lines of sight can end at.
    pub(super) ends: SmallVec<[Side; 11]>,
    /// Clip-space x, y and w of points relative to the anchor.
    pub(super) rows: [ClipRow; 3],
}

impl Sight {
    /// `None` for a view so odd that `f64` cannot tell where it is seen from.
    pub(super) fn new(view: &View) -> Option<Self> {
        let projection = ViewProjection::new(view, DVec3::ZERO);
        let anchor = projection.anchor();
        let planes = view.planes(anchor);
        let planes = planes.as_slice();
        let far = usize::from(!view.depth().is_infinite());
        // A plane that could not be had is left out, and which one cannot be told.
        if planes.len() != 5 + far + view.clip_planes().len() || !anchor.is_finite() {
            return None;
        }
        let sides = [0, 1, 2, 3].map(|i| Side::of_view(&planes[i]));
        let (lines, error) = match projection.eye() {
            Eye::Point(_) => (Lines::FromAnchor, projection.eye_error()),
            Eye::Direction(direction) => (Lines::Along(direction, projection.eye_error()), 0.0),
        };
        let turn = if let Lines::Along(_, turn) = lines { turn } else { 0.0 };
        // Also refuses NaN.
        if !(error.is_finite() && turn < 0.01) {
            return None;
        }
        let clips = &planes[5 + far..];
        let ends = planes[5..5 + far].iter().chain(clips).map(Side::of_view).collect();
        let rows = [projection.x(), projection.y(), projection.w()];
        Some(Self { anchor, lines, error, sides, ends, rows })
    }

    /// Which way lines of sight cross a polygon, relative to the anchor and known up to `error`, whose unit normal is `normal` and whose least
    /// extent is at least `width`.
    ///
    /// From an eye, a plane is crossed along its normal if and only if the eye is behind it. Vertices that are off by `error` (which includes
    /// that of the eye) tilt the plane by twice as much over `width`. Evaluating the height of a vertex rounds by `8u` of its distance, and
    /// the normal is not to be trusted beyond `4u` a component.
    pub(super) fn crossing(
        &self,
        vertices: impl Iterator<Item = DVec3>,
        normal: DVec3,
        width: f64,
        error: f64,
    ) -> Crossing {
        let tilt = 2.0 * error / width + 32.0 * U;
        let (least, most) = match self.lines {
            Lines::FromAnchor => {
                vertices.fold((f64::INFINITY, f64::NEG_INFINITY), |(least, most), vertex| {
                    let height = normal.dot(vertex);
                    let margin = error + tilt * vertex.length();
                    (least.min(height - margin), most.max(height + margin))
                })
            }
            Lines::Along(direction, turn) => {
                let height = normal.dot(direction);
                (height - turn - tilt, height + turn + tilt)
            }
        };
        if least > 0.0 {
            Crossing::Along
        } else if most < 0.0 {
            Crossing::Against
        } else {
            Crossing::Unsure
        }
    }

    /// The side through an edge of a polygon that is crossed along (`sign` 1) or against (-1) its normal, counter-clockwise around that.
    pub(super) fn through_edge(&self, a: DVec3, b: DVec3, sign: f64, error: f64) -> Option<Side> {
        match self.lines {
            Lines::FromAnchor => Side::through_edge(a, b, sign, error),
            Lines::Along(direction, turn) => Side::along(direction, turn, a, b, sign, error),
        }
    }
}

/// How lines of sight cross a polygon.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Crossing {
    /// Along its normal.
    Along,
    /// Against its normal.
    Against,
    /// The eye is so near the plane, or the plane so nearly in line with the lines of sight, that rounding cannot tell.
    Unsure,
}

#[cfg(test)]
mod tests {
    use super::*;
    use visibility_core::Depth;
    use visibility_core::glam::DMat4;

    #[test]
    fn the_eye_is_within_its_error_of_the_anchor() {
        let mut state = 3u64;
        let mut whole = |most: i64| {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            ((state >> 20) as i64 % (2 * most + 1) - most) as f64
        };
        let (mut found, mut off) = (0, 0);
        for _ in 0..2000 {
            // Rows and an eye of whole numbers, so that the matrix is exactly that of this eye.
            let eye = DVec3::new(whole(9_000_000), whole(9_000_000), whole(9_000_000));
            let rows = [(); 4].map(|()| DVec3::new(whole(1_000_000), whole(1_000_000), whole(1_000_000)));
            let mut rows = rows.map(|row| row.extend(-row.dot(eye)));
            rows[2].w -= 1e6;
            let matrix = DMat4::from_cols(rows[0], rows[1], rows[2], rows[3]).transpose();
            let Ok(view) = View::from_clip_from_world(matrix, Depth::ZeroToOne) else { continue };
            let Some(sight) = Sight::new(&view).filter(|sight| sight.lines == Lines::FromAnchor) else {
                continue;
            };
            let distance = (sight.anchor - eye).length();
            assert!(distance <= sight.error, "{eye}: {} off, {} known of", distance, sight.error);
            assert!(sight.error < 1.0, "{eye}: {}", sight.error);
            (found, off) = (found + 1, off + u32::from(distance > 0.0));
        }
        assert!(found > 1500 && off > 500, "{off} of {found}");
    }
}
