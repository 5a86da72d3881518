//! Walls along the x or y axis with rectangular doors and windows, built as cuboids.
//!
//! A wall is cut into upright strips at the left and right edges of its openings. A strip that crosses an
//! opening keeps the parts below and above the opening.

use super::mesh::Mesh;

/// Rectangular hole in a wall: `from` and `to` are metres along the wall from its start; `sill` and `head`
/// are the lower and upper edges in metres above the wall's foot.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Opening {
    pub(crate) from: f64,
    pub(crate) to: f64,
    pub(crate) sill: f64,
    pub(crate) head: f64,
}

impl Opening {
    pub(crate) const fn new(from: f64, to: f64, sill: f64, head: f64) -> Self {
        Self { from, to, sill, head }
    }
}

/// Wall of some thickness, centred on a line along the x or the y axis. All lengths are metres.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Wall {
    /// One end (x, y) of the wall's centre line. Openings are measured from the end with the smaller
    /// coordinate.
    pub(crate) from: [f64; 2],
    /// Other end (x, y) of the wall's centre line. Only one coordinate may differ from that of `from`.
    pub(crate) to: [f64; 2],
    pub(crate) foot: f64,
    pub(crate) top: f64,
    pub(crate) thickness: f64,
}

/// Minimum length and height of a part of a wall, in metres. Thinner parts come from rounding and are left
/// out.
const THINNEST: f64 = 1e-6;

impl Wall {
    /// Makes the cuboids of the wall with its openings cut out. Openings must not overlap one another;
    /// openings one above the other are permitted.
    pub(crate) fn build(&self, openings: &[Opening]) -> Mesh {
        let mut mesh = Mesh::new();
        let height = self.top - self.foot;
        let cuts = self.cuts(openings);
        for strip in cuts.windows(2) {
            let (start, end) = (strip[0], strip[1]);
            let middle = (start + end) / 2.0;
            let mut covering: Vec<_> =
                openings.iter().filter(|o| o.from <= middle && middle <= o.to).collect();
            covering.sort_by(|a, b| a.sill.total_cmp(&b.sill));
            let mut solid_from = 0.0;
            for opening in covering {
                self.piece(&mut mesh, [start, end], [solid_from, opening.sill]);
                solid_from = opening.head;
            }
            self.piece(&mut mesh, [start, end], [solid_from, height]);
        }
        mesh
    }

    /// Returns the length of the wall's centre line, in metres.
    fn length(&self) -> f64 {
        (self.to[0] - self.from[0]).abs().max((self.to[1] - self.from[1]).abs())
    }

    /// Returns the sorted distances from the wall's start, in metres, at which strips begin and end. Equal
    /// distances appear once.
    fn cuts(&self, openings: &[Opening]) -> Vec<f64> {
        let mut cuts = vec![0.0, self.length()];
        cuts.extend(openings.iter().flat_map(|o| [o.from, o.to]));
        cuts.sort_by(f64::total_cmp);
        cuts.dedup();
        cuts
    }

    /// Adds the cuboid of the wall that spans `along` from the wall's start and `upwards` from its foot, in
    /// metres. Adds no cuboid thinner than [`THINNEST`].
    fn piece(&self, mesh: &mut Mesh, along: [f64; 2], upwards: [f64; 2]) {
        if along[1] - along[0] < THINNEST || upwards[1] - upwards[0] < THINNEST {
            return;
        }
        let half = self.thickness / 2.0;
        let [x, y] = [0, 1].map(|axis| self.from[axis].min(self.to[axis]));
        let (low, high) = (self.foot + upwards[0], self.foot + upwards[1]);
        let runs_along_x = (self.to[0] - self.from[0]).abs() >= (self.to[1] - self.from[1]).abs();
        if runs_along_x {
            mesh.cuboid([x + along[0], y - half, low], [x + along[1], y + half, high]);
        } else {
            mesh.cuboid([x - half, y + along[0], low], [x + half, y + along[1], high]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_door_and_a_window_leave_the_right_pieces() {
        let wall = Wall { from: [0.0, 0.0], to: [0.0, 6.0], foot: 1.0, top: 4.0, thickness: 0.2 };
        assert_eq!(wall.build(&[]).triangles.len(), 12, "triangles of a wall without openings");
        let door = Opening::new(1.0, 2.0, 0.0, 2.1);
        let window = Opening::new(3.0, 4.0, 0.9, 2.1);
        // Cuboids: three full-height strips, the lintel of the door, and the sill and lintel of the window.
        assert_eq!(
            wall.build(&[door, window]).triangles.len(),
            6 * 12,
            "triangles of a wall with door and window"
        );
    }
}
