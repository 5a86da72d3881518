//! Meshes of any form, mesh by mesh.
//!
//! # The rule
//! Triangles that surely face the eye are drawn; for two-sided meshes those that surely face away as well, as a second mesh. An edge is inner if
//! exactly two drawn triangles share it, in opposite directions; every other edge of a drawn triangle is a contour, and so is the cut where the near
//! plane crosses one. A pixel is covered if the contour winds round its centre and comes nowhere within rounding of the closed pixel. Its
//! depth is the farthest that any drawn triangle of the mesh has in its quarter of the tile. Then it merges with other meshes, nearest wins.
//!
//! # Why it is sound
//! Let no contour meet a pixel, and one point of the pixel be in a drawn triangle. Walk from that point to any other of the pixel: where the
//! walk leaves a drawn triangle it crosses an edge, or the near plane's cut, which is no contour, so that another drawn triangle begins there.
//! So all of the pixel is covered, and by triangles that meet it, whose depth counts. The contour winds round a centre that it does not come near
//! as often as drawn triangles cover it ([`Canvas`]); rounding leaves the centre within a fraction of a pixel of one of them, and then a
//! point of that triangle is in the pixel.
//!
//! # The error bound
//! Corners beyond the near plane's limit have `x`, `y` and `w` off by at most `e`, so a pixel coordinate `q = x / w` by `(e_x + |q| e_w) / w`,
//! two roundings aside. The greatest such bound over the mesh, doubled, is the *slack*, and 32 units of the greatest coordinate are part of it. A
//! point of a segment is off by no more than its ends, so contours are widened by the slack, and by `2^-20` of a pixel.
//! Meshes whose slack exceeds a quarter of a pixel are left out.
//!
//! Twice the area of a triangle on the screen is a product of differences, each off by the slack at most: so, roundings included, by twice
//! the slack times the sum of their magnitudes. Beyond that, its sign is that of the determinant of the corners, since each `w` is positive.

use crate::canvas::{Canvas, Cells, Corner, lower};
use crate::lens::{Lens, Placed};
use crate::shape::{Coverage, up};
use crate::solid::{Parts, cross, cut, dot, less, point};
use crate::tiles::Tiles;
use alloc::vec::Vec;
use visibility_core::glam::Vec3;

/// Memory for the set-up of one mesh.
#[derive(Clone, Debug, Default)]
pub(crate) struct Setup {
    /// By vertex: `x`, `y`, `w`, `n` and the distance beyond the near plane.
    corners: Vec<[f64; 5]>,
    /// By vertex, of use for those beyond the near plane's limit.
    screen: Vec<Corner>,
    /// For each triangle whether it is drawn: 1 or -1 by the way round.
    facing: Vec<i8>,
}

/// Added to widths, in pixels.
const TINY: f64 = 1.0 / 1048576.0;

/// Triangles that stand alone are left out if they are smaller than this, measured by the sum of two sides in columns and rows.
const ALONE: f64 = 64.0;
/// But not of fewer than so many.
const MANY: usize = 32;

/// Areas on the screen that differ by less than this share of their sum are equal.
const CANCELS: f64 = 1e-6;

/// Vertices that are worked on together.
const LANES: usize = 8;

/// What the corners of a mesh have in common.
struct Reach {
    /// How far rounding can move a pixel coordinate, at most.
    error: f64,
    /// Nearness that no corner exceeds.
    greatest: f64,
    /// The least distance beyond the near plane.
    nearest: f64,
}

impl Reach {
    /// Of nothing.
    const NONE: Self = Self { error: 0.0, greatest: f64::NEG_INFINITY, nearest: f64::INFINITY };
}

/// Draws a mesh; returns a nearness that nothing of it exceeds.
#[inline(always)]
#[expect(clippy::too_many_arguments)]
pub(crate) fn draw(
    mesh: &Parts,
    placed: &Placed,
    lens: &Lens,
    facing: f64,
    coverage: Coverage,
    setup: &mut Setup,
    cells: &mut Cells,
    tiles: &mut Tiles,
) -> f32 {
    let beyond = placed.beyond();
    let mut reach = Reach::NONE;
    project(mesh.positions, placed, beyond, setup, &mut reach);
    let Setup { corners, screen, facing: drawn } = setup;
    let whole = reach.nearest > beyond;
    if !whole {
        reach_cuts(mesh, corners, placed, beyond, &mut reach);
    }
    if !(reach.error <= 0.125) {
        return f32::NEG_INFINITY;
    }
    let slack = 2.0 * reach.error + TINY;
    let sides = choose(mesh, corners, screen, whole.then_some(slack), placed, facing, beyond, drawn);
    if sides == 0 {
        return f32::NEG_INFINITY;
    }
    let errors = [placed.determinant_error(), placed.cross_error(lens.size)];
    let marked = coverage == Coverage::Conservative;
    // Fronts and backs are meshes of their own: no edge between them is inner, and neither makes the other farther.
    for side in [1, -1] {
        if sides & side_bit(side) == 0 {
            continue;
        }
        let mut canvas = Canvas::new(cells, tiles.columns, lens.size, slack);
        for (t, &facing) in mesh.triangles.iter().zip(drawn.iter()) {
            if facing != side {
                continue;
            }
            let plane = || plane(t.map(|i| &corners[i as usize]), placed, lens, &errors);
            if whole {
                canvas.deepen(&t.map(|i| screen[i as usize]), plane);
                continue;
            }
            let part = beyond_near(t.map(|i| &corners[i as usize]), beyond);
            let mut points = [Corner::default(); 4];
            for (out, corner) in points.iter_mut().zip(&part.corners[..part.count]) {
                *out = on_screen(corner, placed, &mut reach);
            }
            canvas.deepen(&points[..part.count], plane);
            if let Some([a, b]) = part.edge {
                let [a, b] = [a, b].map(|corner| on_screen(&corner, placed, &mut reach));
                canvas.contour(&a, &b, side, marked);
            }
        }
        for edge in mesh.edges {
            let left = i8::from(drawn[edge.left as usize] == side);
            let right = edge.right.map_or(0, |t| i8::from(drawn[t as usize] == side));
            // Inner if two drawn triangles run through it, and then in opposite directions.
            if left == right {
                continue;
            }
            let [i, j] = edge.vertices.map(|i| i as usize);
            let (mut a, mut b) = (screen[i], screen[j]);
            if !whole {
                let (p, q) = (&corners[i], &corners[j]);
                match (p[4] > beyond, q[4] > beyond) {
                    (true, true) => {}
                    (true, false) => b = on_screen(&cut(p, q, beyond), placed, &mut reach),
                    (false, true) => a = on_screen(&cut(p, q, beyond), placed, &mut reach),
                    (false, false) => continue,
                }
            }
            canvas.contour(&a, &b, (left - right) * side, marked);
        }
        canvas.merge(tiles);
    }
    up(reach.greatest)
}

/// The bit that stands for a side: fronts are 1, backs -1.
#[inline(always)]
fn side_bit(side: i8) -> u8 {
    if side > 0 { 1 } else { 2 }
}

/// Fills in the corners and where they are on the screen.
#[inline(always)]
fn project(positions: &[Vec3], placed: &Placed, beyond: f64, setup: &mut Setup, reach: &mut Reach) {
    let Setup { corners, screen, .. } = setup;
    // Memory is only ever added, and what is left from before is written over.
    if corners.len() < positions.len() {
        corners.resize(positions.len(), [0.0; 5]);
        screen.resize(positions.len(), Corner::default());
    }
    let (mut corners, mut screen) = (&mut corners[..positions.len()], &mut screen[..positions.len()]);
    let mut rest = positions;
    while !rest.is_empty() {
        let count = rest.len().min(LANES);
        let mut p = [[0.0; LANES]; 3];
        for i in 0..LANES {
            // The last ones are repeated.
            let position = &rest[if i < count { i } else { count - 1 }];
            (p[0][i], p[1][i], p[2][i]) =
                (f64::from(position.x), f64::from(position.y), f64::from(position.z));
        }
        rest = &rest[count..];
        let mut values = [[0.0; LANES]; 5];
        for row in 0..5 {
            let [a, b, c] = [placed.linear[0][row], placed.linear[1][row], placed.linear[2][row]];
            for i in 0..LANES {
                values[row][i] = p[0][i] * a + p[1][i] * b + p[2][i] * c + placed.constant[row];
            }
        }
        let [x, y, w, n, near] = &values;
        let (mut sx, mut sy, mut far) = ([0.0; LANES], [0.0; LANES], [0.0f32; LANES]);
        let (mut error, mut most, mut nearest) = ([0.0; LANES], [0.0; LANES], [0.0; LANES]);
        for i in 0..LANES {
            let known = near[i] > beyond;
            let (corner, off, high) = seen_at([x[i], y[i], w[i], n[i]], placed);
            (sx[i], sy[i], far[i]) = (corner.x, corner.y, corner.far);
            error[i] = if known { off } else { 0.0 };
            most[i] = if known { high } else { f64::NEG_INFINITY };
            nearest[i] = near[i];
        }
        for i in 0..LANES {
            reach.error = greater(error[i], reach.error);
            reach.greatest = greater(most[i], reach.greatest);
            reach.nearest = if nearest[i] >= reach.nearest { reach.nearest } else { nearest[i] };
        }
        let (these, others) = corners.split_at_mut(count);
        for (i, corner) in these.iter_mut().enumerate() {
            *corner = [x[i], y[i], w[i], n[i], near[i]];
        }
        corners = others;
        let (these, others) = screen.split_at_mut(count);
        for (i, corner) in these.iter_mut().enumerate() {
            *corner = Corner { x: sx[i], y: sy[i], far: far[i] };
        }
        screen = others;
    }
}

#[inline(always)]
fn greater(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}

/// Where a corner is on the screen, by how much it may be off there, and a nearness that it does not exceed.
#[inline(always)]
fn seen_at([x, y, w, n]: [f64; 4], placed: &Placed) -> (Corner, f64, f64) {
    let [ex, ey, ew, en, _] = placed.error;
    // A corner at or behind the eye makes the error infinite.
    let over = 1.0 / if w > 8.0 * ew { w } else { 0.0 };
    let size = greater(x.abs(), y.abs()) * over;
    let error = (ex + ey + size * ew) * over + 8.0 * f64::EPSILON * size;
    // In the eye itself it is NaN.
    let error = if error < f64::INFINITY { error } else { f64::INFINITY };
    let nearness = n * over;
    let margin = 2.0 * (en + nearness.abs() * ew) * over + 4.0 * f64::EPSILON * nearness.abs();
    (Corner { x: x * over, y: y * over, far: lower(nearness - margin) }, error, nearness + margin)
}

/// As [`seen_at`], taken into the reach of a mesh.
#[inline(always)]
fn on_screen(&[x, y, w, n, _]: &[f64; 5], placed: &Placed, reach: &mut Reach) -> Corner {
    let (corner, error, most) = seen_at([x, y, w, n], placed);
    reach.error = greater(error, reach.error);
    reach.greatest = greater(most, reach.greatest);
    corner
}

/// Decides which triangles are drawn: those that surely face the eye, and are not wholly before the near plane. With `slack`, all corners
/// are beyond that plane and may be off by so much on the screen. Returns the bits of the sides that are.
#[inline(always)]
#[expect(clippy::too_many_arguments)]
fn choose(
    mesh: &Parts,
    corners: &[[f64; 5]],
    screen: &[Corner],
    slack: Option<f64>,
    placed: &Placed,
    facing: f64,
    beyond: f64,
    drawn: &mut Vec<i8>,
) -> u8 {
    drawn.clear();
    let (mut fronts, mut backs) = (false, false);
    let back = if mesh.two_sided { -1 } else { 0 };
    if let Some(slack) = slack {
        // Where most edges join nothing, as in foliage, triangles stand alone, and small ones would hide next to nothing. An edge that joins two
        // triangles is a side of both.
        let open = (2 * mesh.edges.len()).saturating_sub(3 * mesh.triangles.len());
        let smallest = if open >= mesh.triangles.len().max(MANY) { ALONE } else { 0.0 };
        let (mut sum, mut magnitude) = (0.0, 0.0);
        for t in mesh.triangles {
            let [a, b, c] = t.map(|i| &screen[i as usize]);
            let (bx, by, cx, cy) = (b.x - a.x, b.y - a.y, c.x - a.x, c.y - a.y);
            let area = (bx * cy - by * cx) * facing;
            let size = bx.abs() + by.abs() + cx.abs() + cy.abs();
            let certain = if size < smallest { f64::INFINITY } else { 2.0 * slack * (size + slack) };
            let turn = if area < -certain { back } else { 0 };
            let turn = if area > certain { 1 } else { turn };
            (fronts, backs) = (fronts | (turn > 0), backs | (turn < 0));
            (sum, magnitude) = (sum + area, magnitude + area.abs());
            drawn.push(turn);
        }
        // From outside, as much of a closed mesh shows its back as its front, and behind it: fronts are all that counts.
        let outside = open == 0 && sum.abs() <= CANCELS * magnitude;
        return u8::from(fronts) | if backs && !outside { 2 } else { 0 };
    }
    let certain = placed.determinant_error();
    for t in mesh.triangles {
        let [a, b, c] = t.map(|i| &corners[i as usize]);
        let height = dot(cross(point(&less(b, a)), point(&less(c, a))), point(a)) * facing;
        let seen = a[4] > beyond || b[4] > beyond || c[4] > beyond;
        let turn = if height < -certain { back } else { 0 };
        let turn = if !seen { 0 } else { if height > certain { 1 } else { turn } };
        (fronts, backs) = (fronts | (turn > 0), backs | (turn < 0));
        drawn.push(turn);
    }
    u8::from(fronts) | if backs { 2 } else { 0 }
}

/// Takes what the near plane's limit makes of edges into the reach of a mesh.
#[inline(always)]
fn reach_cuts(mesh: &Parts, corners: &[[f64; 5]], placed: &Placed, beyond: f64, reach: &mut Reach) {
    for edge in mesh.edges {
        let [a, b] = edge.vertices.map(|i| &corners[i as usize]);
        if (a[4] > beyond) != (b[4] > beyond) {
            on_screen(&cut(a, b, beyond), placed, reach);
        }
    }
}

/// The nearness of a triangle as a function of pixel coordinates, moved away by its error.
///
/// By Cramer's rule; see [`lower`](crate::cuboid::lower) for the error.
#[inline(always)]
fn plane(
    [a, b, c]: [&[f64; 5]; 3],
    placed: &Placed,
    lens: &Lens,
    &[certain, products]: &[f64; 2],
) -> [f64; 3] {
    let (second, third) = (less(b, a), less(c, a));
    let normal = cross(point(&second), point(&third));
    let height = dot(normal, point(a));
    // Facing was decided on the screen; where the determinant is less sure, nothing is known of the plane.
    let mut plane = [f64::NAN; 3];
    if !(height.abs() > certain) {
        return plane;
    }
    let over = 1.0 / height;
    if lens.perspective {
        for i in 0..3 {
            plane[i] = normal[i] * over;
        }
    } else {
        let (p, q) = (cross(point(&third), point(a)), cross(point(a), point(&second)));
        for i in 0..3 {
            plane[i] = (a[3] * normal[i] + second[3] * p[i] + third[3] * q[i]) * over;
        }
    }
    crate::cuboid::lower(plane, over, placed, lens, certain, products)
}

/// Corners of a triangle after cutting.
struct Cut {
    corners: [[f64; 5]; 4],
    count: usize,
    /// The cut, from where the triangle's sides run out to where they come back.
    edge: Option<[[f64; 5]; 2]>,
}

/// What is left of a triangle beyond the limit.
fn beyond_near(t: [&[f64; 5]; 3], beyond: f64) -> Cut {
    let mut out = Cut { corners: [[0.0; 5]; 4], count: 0, edge: None };
    let mut push = |p: [f64; 5]| {
        if out.count < 4 {
            out.corners[out.count] = p;
            out.count += 1;
        }
    };
    let (mut leaves, mut enters) = (None, None);
    for i in 0..3 {
        let (a, b) = (t[i], t[(i + 1) % 3]);
        if a[4] > beyond {
            push(*a);
        }
        if (a[4] > beyond) != (b[4] > beyond) {
            let p = cut(a, b, beyond);
            push(p);
            *(if a[4] > beyond { &mut leaves } else { &mut enters }) = Some(p);
        }
    }
    out.edge = leaves.zip(enters).map(|(a, b)| [a, b]);
    out
}
