//! Maps that are invalid, huge, tiny or odd give an error or a result, never a panic.

use visibility_core::bake::Bake;
use visibility_core::glam::DVec3;
use visibility_core::{
    cells::{CellGraph, CellId},
    geometry::ConvexPolygon,
};
use visibility_portals::{BakeError, BakerSettings, CellBaker, CellMatrix, prt};

/// Returns a row of rooms along x, 4 units long, with square doors; all coordinates are multiplied by
/// `scale`.
fn row(rooms: u32, scale: f64) -> CellGraph {
    let door = |x: u32| {
        let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
        let polygon = ConvexPolygon::new(corners.map(|[y, z]| DVec3::new(f64::from(x) * 4.0, y, z) * scale));
        (polygon.unwrap(), [CellId(x - 1), CellId(x)])
    };
    CellGraph::new(rooms as usize, (1..rooms).map(door)).unwrap()
}

fn bake(graph: &CellGraph, settings: BakerSettings) -> Result<CellMatrix, BakeError> {
    Ok(Bake::new(CellBaker::new(graph, settings)?).run().matrix)
}

#[test]
fn a_long_straight_corridor_is_seen_from_end_to_end() {
    // A chain of portals as long as the map: the search must not recurse.
    let matrix = bake(&row(250, 1.0), BakerSettings::default()).unwrap();
    assert_eq!(matrix.count(), 250 * 250, "pairs of cells of 250 in a row");
}

#[test]
fn no_cells_and_no_portals_are_maps_too() {
    assert_eq!(
        bake(&CellGraph::default(), BakerSettings::default()).unwrap().cell_count(),
        0,
        "cells of an empty map"
    );
    let lonely = CellGraph::new(65, []).unwrap();
    assert_eq!(
        bake(&lonely, BakerSettings::default()).unwrap().count(),
        65,
        "a cell without portals sees itself"
    );
}

#[test]
fn coordinates_too_large_for_the_clearance_are_refused() {
    for scale in [1e6, 1e30] {
        let graph = row(3, scale);
        let small = BakerSettings::default().with_clearance(1e-6);
        assert!(matches!(bake(&graph, small), Err(BakeError::Clearance { .. })), "{scale}");
        // With a clearance proportional to the scale, the map is accepted.
        let settings = BakerSettings::default().with_clearance(1e-6 * scale);
        assert_eq!(
            bake(&graph, settings).unwrap().count(),
            9,
            "scale {scale}: pairs of cells, with a clearance to scale"
        );
    }
    for clearance in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let settings = BakerSettings::default().with_clearance(clearance);
        assert!(bake(&row(3, 1.0), settings).is_err(), "{clearance}");
    }
    assert!(
        matches!(
            CellBaker::new(&CellGraph::new(70_000, []).unwrap(), BakerSettings::default()),
            Err(BakeError::TooMany { .. })
        ),
        "more cells than a matrix can hold"
    );
}

/// Tests the default clearance far from the origin and at large scales: a micrometre where coordinates allow
/// it, and no error where they do not. A row of rooms hides nothing, and a room around a corner is hidden.
#[test]
fn the_default_clearance_follows_the_coordinates() {
    for exponent in 0..30 {
        let scale = 10f64.powi(exponent);
        assert_eq!(bake(&row(3, scale), BakerSettings::default()).unwrap().count(), 9, "{scale}");
    }
    let door = |at: DVec3, along: DVec3| {
        let (side, up) = (along * 0.5, DVec3::Z);
        ConvexPolygon::new([at - side, at + side, at + side + up, at - side + up]).unwrap()
    };
    for away in [0.0, 8e3, 35e3, 1e6, 1e9] {
        let at = |x: f64, y: f64| DVec3::new(x + away, y - away, away);
        // The path leads into a room from the west, out of it to the south, and around the corner to the west
        // again.
        let portals = [
            (door(at(0.0, 0.0), DVec3::Y), [CellId(0), CellId(1)]),
            (door(at(2.0, -2.0), DVec3::X), [CellId(1), CellId(2)]),
            (door(at(0.0, -6.0), DVec3::Y), [CellId(2), CellId(3)]),
        ];
        let graph = CellGraph::new(4, portals).unwrap();
        let matrix = bake(&graph, BakerSettings::default()).unwrap();
        assert!(matrix.sees(CellId(0), CellId(2)) && !matrix.sees(CellId(0), CellId(3)), "{away}");
    }
    // The least clearance for coordinates of 35 km.
    let far = CellGraph::new(2, [(door(DVec3::X * 35e3, DVec3::Y), [CellId(0), CellId(1)])]).unwrap();
    let with = |clearance| CellBaker::new(&far, BakerSettings::default().with_clearance(clearance));
    let least = 35e3 * 2f64.powi(-33);
    assert!(
        with(least).is_ok() && with(least * 0.999).is_err(),
        "a clearance of {least} m is the least for 35 km"
    );
}

#[test]
fn portals_too_small_to_look_through_are_walls() {
    let tiny = ConvexPolygon::new(
        [[0.0, 0.0], [1e-7, 0.0], [1e-7, 1.0], [0.0, 1.0]].map(|[y, z]| DVec3::new(0.0, y, z)),
    );
    let graph = CellGraph::new(2, [(tiny.unwrap(), [CellId(0), CellId(1)])]).unwrap();
    assert_eq!(
        bake(&graph, BakerSettings::default()).unwrap().count(),
        2,
        "two cells beside a portal too narrow to see through"
    );
}

#[test]
fn cells_that_are_not_convex_and_portals_in_one_place_end() {
    // Every pair of five cells is joined through the same square, in both directions, so that the graph has
    // cycles of coincident portals.
    let square = row(2, 1.0).portals()[0].polygon().clone();
    let pairs = (0..5).flat_map(|a| (0..5).map(move |b| [CellId(a), CellId(b)])).filter(|[a, b]| a != b);
    let graph = CellGraph::new(5, pairs.map(|ends| (square.clone(), ends))).unwrap();
    assert!(graph.validate(1e-9).is_ok(), "portals in one place are a valid graph");
    let matrix = bake(&graph, BakerSettings::default()).unwrap();
    assert!(matrix.is_symmetric() && matrix.count() == 25, "all five cells see each other");
}

#[test]
fn a_room_around_the_corner_is_hidden() {
    // The path goes through a door in the east wall, along a corridor, and back through another door on the
    // same side, as no straight line does.
    let file = "PRT1\n3\n2\n4 0 1 (4 0 0) (4 1 0) (4 1 2) (4 0 2)\n4 2 1 (4 8 0) (4 9 0) (4 9 2) (4 8 2)\n";
    let matrix = bake(&prt::read(file).unwrap().graph, BakerSettings::default()).unwrap();
    assert_eq!(
        matrix.to_bytes(),
        [0b011, 0b111, 0b110],
        "rows of the matrix: cells 0 and 2 do not see each other"
    );
}
