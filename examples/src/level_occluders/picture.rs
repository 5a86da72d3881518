//! Picture of a level's occluders from a camera: which surfaces are kept as occluders, which are left out,
//! and which pixels the z-buffer leaves uncovered.

use crate::walkthrough::World;
use crate::walkthrough::canvas::{Canvas, Color};
use crate::walkthrough::eye_picture::{SKY, shade};
use crate::walkthrough::palette::{HIDDEN, INK, PAPER, REPORTED, VISIBLE};
use glam::{DVec2, DVec3, Vec3};
use std::collections::HashMap;
use visibility_core::{OcclusionMap, View};
use visibility_hzb::Hzb;
use visibility_measure::{ItemBuffer, MeasureError};
use visibility_occluders::{LevelOccluders, OccluderPolygon};

/// Height of the legend below the picture, in pixels.
const LEGEND: u32 = 48;

/// Color of kept surfaces in pixels that the z-buffer does not cover.
const BARE: Color = [130, 170, 235];

/// Numbers of pixels of a picture, by the kind of the nearest surface.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Pixels {
    /// Pixels with a kept surface that the z-buffer covers.
    pub covered: usize,
    /// Pixels with a kept surface that the z-buffer does not cover, because an edge is near.
    pub bare: usize,
    /// Pixels with an opaque surface that stands still but was left out as too small.
    pub left_out: usize,
    /// Pixels with a surface that is see-through, moves, or is excluded by a hint.
    pub no_occluder: usize,
    /// Pixels without any surface.
    pub empty: usize,
}

impl std::fmt::Display for Pixels {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { covered, bare, left_out, no_occluder, empty } = *self;
        let all = (covered + bare + left_out + no_occluder + empty).max(1) as f64;
        let [covered, bare, left_out, no_occluder, empty] =
            [covered, bare, left_out, no_occluder, empty].map(|pixels| pixels as f64 * 100.0 / all);
        write!(
            f,
            "{covered:.1} % covered, {bare:.1} % bare near edges, {left_out:.1} % left out, \
             {no_occluder:.1} % no occluder, {empty:.1} % empty"
        )
    }
}

/// Draws a level's occluders as a view of the world sees them, with a legend below. `hzb` draws the level
/// too, at its own resolution, to tell which pixels it covers.
///
/// # Errors
///
/// Returns [`MeasureError`] when the item buffer cannot draw the world.
pub fn draw(
    world: &World,
    view: &View,
    level: &LevelOccluders,
    hzb: &mut Hzb,
    title: &str,
) -> Result<(Canvas, Pixels), MeasureError> {
    let (width, height) = world.size;
    let mut buffer = ItemBuffer::new(width, height)?;
    buffer.draw(view, world.origin(), world.items().filter(|item| !item.see_through))?;
    hzb.begin(view, world.origin());
    hzb.flush();
    let mut kept: HashMap<u32, bool> = HashMap::new();
    let mut canvas = Canvas::new(width, height + LEGEND, SKY);
    let mut pixels = Pixels::default();
    for (row, column) in (0..height).flat_map(|row| (0..width).map(move |column| (row, column))) {
        let item = buffer.items()[row as usize * width as usize + column as usize];
        let Some((object, triangle)) = world.drawn_triangle(buffer.visible(), item) else {
            pixels.empty += 1;
            continue;
        };
        let source = &world.source.objects[object as usize];
        let own = |at: u32, of: u32, size: usize| at as usize * size / of as usize;
        let key = hzb.depth_key(own(column, width, hzb.width()), own(row, height, hzb.height()));
        let (count, color) = if !source.opaque || source.door || source.motion.is_some() {
            (&mut pixels.no_occluder, HIDDEN)
        } else if !*kept.entry(item).or_insert_with(|| is_kept(level, &triangle)) {
            (&mut pixels.left_out, REPORTED)
        } else if key == f32::NEG_INFINITY {
            (&mut pixels.bare, BARE)
        } else {
            (&mut pixels.covered, VISIBLE)
        };
        *count += 1;
        let color = shade(color.map(|level| f32::from(level) / 255.0), &triangle);
        canvas.set(column.into(), row.into(), color);
    }
    canvas.rectangle(0, height.into(), width.into(), LEGEND.into(), PAPER);
    let top = i64::from(height) + 8;
    canvas.text(10, top, title, INK);
    let entries = [
        (VISIBLE, "kept, covered"),
        (BARE, "kept, bare near an edge"),
        (REPORTED, "left out"),
        (HIDDEN, "no occluder"),
    ];
    canvas.legend(10, top + 20, &entries, INK);
    Ok((canvas, pixels))
}

/// Returns whether a triangle of the scene belongs to a polygon of the level: the triangle's middle lies in
/// the polygon's plane and outline. This is enough, since polygons consist of whole triangles.
fn is_kept(level: &LevelOccluders, triangle: &[Vec3; 3]) -> bool {
    let middle = triangle.iter().map(|corner| corner.as_dvec3()).sum::<DVec3>() / 3.0;
    // Tolerance for rounded coordinates, and for polygons that are not quite flat.
    let slack = 1e-5 * middle.abs().max_element().max(1.0);
    level.clusters().iter().any(|cluster| {
        let [min, max] = [cluster.bounds.min, cluster.bounds.max].map(|corner| corner.as_dvec3());
        middle.cmpge(min - slack).all()
            && middle.cmple(max + slack).all()
            && level.polygons()[cluster.polygons[0] as usize..cluster.polygons[1] as usize]
                .iter()
                .any(|polygon| contains(level, polygon, middle, slack))
    })
}

/// Returns whether a point is within `slack` of a polygon's slab, and inside its outline as seen along the
/// coordinate axis nearest to the normal.
fn contains(level: &LevelOccluders, polygon: &OccluderPolygon, point: DVec3, slack: f64) -> bool {
    let along = polygon.normal.dot(point);
    if along < polygon.extent[0] - slack || along > polygon.extent[1] + slack {
        return false;
    }
    let axis = polygon.normal.abs().max_position();
    let flat = |p: DVec3| DVec2::new(p[(axis + 1) % 3], p[(axis + 2) % 3]);
    let point = flat(point);
    let edges = &level.edges()[polygon.edges[0] as usize..polygon.edges[1] as usize];
    let crossings = edges.iter().filter(|edge| {
        let [a, b] = edge.map(|vertex| flat(level.vertices()[vertex as usize].as_dvec3()) - point);
        (a.y > 0.0) != (b.y > 0.0) && a.x + (b.x - a.x) * a.y / (a.y - b.y) > 0.0
    });
    crossings.count() % 2 == 1
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::built_in;
    use crate::level_occluders::make;
    use std::sync::Arc;
    use visibility_occluders::LevelSettings;

    #[test]
    fn pixels_are_kept_left_out_or_neither() {
        let world = World::new(built_in("office:1,2").unwrap(), (96, 54), Some(3)).unwrap();
        let pixels = |share: f64| {
            let level = Arc::new(make(&world, LevelSettings::default().with_kept_area(share)).unwrap());
            let mut hzb = Hzb::new(64, 36).unwrap().with_level(level.clone(), world.origin());
            draw(&world, &world.views[0], &level, &mut hzb, "").unwrap().1
        };
        let [all, half, none] = [1.0, 0.5, 0.0].map(pixels);
        let sum = |p: Pixels| p.covered + p.bare + p.left_out + p.no_occluder + p.empty;
        assert_eq!(
            [all, half, none].map(sum),
            [96 * 54; 3],
            "each pixel is of one kind: {all:?} {half:?} {none:?}"
        );
        assert!(all.left_out == 0 && all.covered > 96 * 54 / 4 && all.bare > 0, "{all:?}");
        assert!(half.left_out > 0 && half.covered > 0 && half.covered < all.covered, "{half:?}");
        assert_eq!([none.covered, none.bare], [0; 2], "{none:?}");
        assert_eq!(
            [half, none].map(|p| p.no_occluder),
            [all.no_occluder; 2],
            "pixels without an occluder are the same"
        );
    }
}
