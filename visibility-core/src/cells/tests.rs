use super::*;
use alloc::string::ToString;
use glam::DVec3;

/// Returns a square of side 2 around (x, 0, 0), with normal +x.
fn door(x: f64) -> ConvexPolygon {
    ConvexPolygon::new([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]].map(|[y, z]| DVec3::new(x, y, z)))
        .unwrap()
}

fn row(cells: usize) -> CellGraph {
    let portals = (1..cells as u32).map(|i| (door(f64::from(i) * 4.0), [CellId(i - 1), CellId(i)]));
    CellGraph::new(cells, portals).unwrap()
}

#[test]
fn a_row_of_rooms_knows_its_doors() {
    let graph = row(4);
    assert_eq!(
        (graph.cell_count(), graph.portals().len()),
        (4, 3),
        "cells and portals of a row of four rooms"
    );
    assert_eq!(graph.portals_of(CellId(0)), [PortalId(0)], "the room at the end has one door");
    assert_eq!(
        graph.portals_of(CellId(1)),
        [PortalId(0), PortalId(1)],
        "a room in the middle has a door to each side"
    );
    assert_eq!(graph.portals_of(CellId(4)), [], "an unknown cell has no portals");
    assert_eq!(
        graph.portal(PortalId(2)).unwrap().plane().normal,
        DVec3::X,
        "the normal points from the first cell to the second"
    );
    assert_eq!(graph.validate(1e-9), Ok(()), "rooms of a row are a valid graph");
    assert_eq!(CellGraph::default().cell_count(), 0, "the default graph is empty");
}

#[test]
fn errors_name_what_is_wrong() {
    let one = |ends| CellGraph::new(2, [(door(0.0), ends)]).unwrap_err();
    let unknown = one([CellId(0), CellId(2)]);
    assert_eq!(
        unknown.to_string(),
        "portal 0 leads to cell 2, but there are only 2",
        "the error names the portal and the cell that does not exist"
    );
    assert_eq!(
        one([CellId(1); 2]),
        CellGraphError::SameCell { portal: PortalId(0), cell: CellId(1) },
        "a portal from a cell to itself"
    );
    let empty = CellGraph::new(2, [(ConvexPolygon::default(), [CellId(0), CellId(1)])]).unwrap_err();
    assert_eq!(
        empty,
        CellGraphError::NoPlane { portal: PortalId(0) },
        "a polygon without vertices has no plane"
    );
    assert!(
        matches!(CellGraph::new(usize::MAX, []), Err(CellGraphError::TooMany { .. })),
        "more cells than ids can name"
    );
}

#[test]
fn a_portal_that_points_the_wrong_way_is_named() {
    let ends = |a, b| [CellId(a), CellId(b)];
    let graph = CellGraph::new(3, [(door(0.0), ends(0, 1)), (door(4.0), ends(2, 1))]).unwrap();
    let error = graph.validate(1e-9).unwrap_err();
    assert!(matches!(error, CellGraphError::NotOnBoundary { cell: CellId(1), distance: 4.0, .. }), "{error}");
}

#[test]
fn a_portal_that_is_no_convex_polygon_is_named() {
    let ends = [CellId(0), CellId(1)];
    let square = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]].map(|[y, z]| DVec3::new(0.0, y, z));
    let with = |vertices: [DVec3; 4]| CellGraph::from_vertices(2, [(square, ends), (vertices, ends)]);
    assert_eq!(with(square).unwrap().portals().len(), 2, "two square portals are accepted");
    let mut bent = square;
    bent[2].x = 0.01;
    let error = with(bent).unwrap_err();
    assert!(
        matches!(
            error,
            CellGraphError::Polygon {
                portal: PortalId(1),
                error: crate::geometry::PolygonError::NotPlanar { .. }
            }
        ),
        "{error}"
    );
    let mut dart = square;
    dart[2] = DVec3::new(0.0, -0.5, -0.5);
    let error = with(dart).unwrap_err().to_string();
    assert!(error.starts_with("portal 1: the polygon is not convex"), "{error}");
    let error = with([DVec3::ZERO; 4]).unwrap_err().to_string();
    assert_eq!(error, "portal 1: the polygon has no area", "four equal vertices");
}

#[test]
fn portals_that_are_on_no_boundary_are_named() {
    let body =
        |x: f64| crate::pvs::Viewcell::from_box(DVec3::new(x, -2.0, -2.0), DVec3::new(x + 4.0, 2.0, 2.0));
    let bodies = [body(0.0), body(4.0), body(8.0)];
    let check = |first: f64, second: f64, ends: [u32; 2]| {
        let portals = [(door(first), [CellId(0), CellId(1)]), (door(second), ends.map(CellId))];
        CellGraph::new(3, portals).unwrap().validate_bodies(&bodies, 1e-6)
    };
    assert_eq!(check(4.0, 8.0, [1, 2]), Ok(()), "portals on the faces that the bodies share");
    assert_eq!(
        check(4.0 + 1e-7, 8.0 - 1e-7, [1, 2]),
        Ok(()),
        "portals off by a tenth of the tolerance of 1e-6 m"
    );
    let off = |portal, cell, distance| CellGraphError::NotOnBody {
        portal: PortalId(portal),
        cell: CellId(cell),
        distance,
    };
    // Four misplaced portals: 0.25 m inside the first body, 0.25 m inside the third, in the middle of the
    // second, and between two bodies that do not touch.
    assert_eq!(
        check(3.75, 8.0, [1, 2]),
        Err(off(0, 0, 0.25)),
        "the portal lies within the first body, 0.25 m before its end"
    );
    assert_eq!(
        check(4.0, 8.25, [1, 2]),
        Err(off(1, 1, 0.25)),
        "the portal lies 0.25 m within the third body"
    );
    assert_eq!(
        check(4.0, 6.0, [1, 2]),
        Err(off(1, 1, 2.0)),
        "the portal lies in the middle of the second body, 2 m from its end"
    );
    assert_eq!(check(4.0, 8.0, [0, 2]), Err(off(1, 0, 4.0)), "the bodies of cells 0 and 2 do not touch");
    assert_eq!(
        check(4.0, 8.0, [2, 1]),
        Err(CellGraphError::Normal { portal: PortalId(1), cell: CellId(2) }),
        "the normal points from the second cell to the first"
    );
    let few = CellGraph::new(3, []).unwrap().validate_bodies(&bodies[..2], 1e-6);
    assert_eq!(few, Err(CellGraphError::Bodies { cells: 3, bodies: 2 }), "bodies are missing");
    // The portal lies in a side of the body's bounding box, but a slanted plane of the body cuts that side
    // off.
    let mut slanted = bodies.clone();
    slanted[0].planes.push(crate::geometry::Plane::new(DVec3::new(-2.0, -2.0, 0.0), 8.0));
    let graph = CellGraph::new(3, [(door(4.0), [CellId(0), CellId(1)])]).unwrap();
    let error = graph.validate_bodies(&slanted, 1e-6).unwrap_err();
    assert!(matches!(error, CellGraphError::NotOnBody { cell: CellId(0), .. }), "{error}");
}

#[test]
fn objects_are_found_by_cell() {
    let mut scene = crate::Scene::new();
    let ids: Vec<_> =
        (0..3).map(|i| scene.insert(crate::Aabb::from_arrays([i as f32; 3], [i as f32 + 1.0; 3]))).collect();
    let mut graph = row(3);
    let pairs = [(CellId(2), ids[1]), (CellId(0), ids[2]), (CellId(0), ids[0]), (CellId(0), ids[2])];
    graph.set_objects(pairs).unwrap();
    assert_eq!(
        graph.objects_in(CellId(0)),
        [ids[0], ids[2]],
        "objects are sorted, and one given twice counts once"
    );
    assert_eq!(graph.objects_in(CellId(1)), [], "no object was given for this cell");
    assert_eq!(graph.objects_in(CellId(2)), [ids[1]], "one object was given for this cell");
    let (before, stamp) = (graph.clone(), graph.stamp());
    assert!(graph.set_objects([(CellId(3), ids[0])]).is_err(), "an unknown cell is refused");
    assert_eq!(graph.objects_in(CellId(2)), [ids[1]], "a refused call leaves the objects as they were");
    assert_eq!(graph.stamp(), stamp, "nothing has changed");
    assert_eq!(before.stamp(), stamp, "a clone has the same content");
    graph.set_objects([(CellId(2), ids[0])]).unwrap();
    assert!(
        graph.stamp() != stamp && graph != before,
        "other objects are other content, with a stamp of its own"
    );
    graph.set_objects([(CellId(0), ids[0]), (CellId(2), ids[1]), (CellId(0), ids[2])]).unwrap();
    assert!(graph.stamp() != stamp && graph == before, "equal content may have another stamp");
}

/// Makes a graph of two cells and one portal and lets `turn_portals` wind the portal. Returns the portal's
/// normal afterwards, or the error.
fn turn(polygon: ConvexPolygon, bodies: [&crate::pvs::Viewcell; 2]) -> Result<DVec3, CellGraphError> {
    let mut graph = CellGraph::new(2, [(polygon, [CellId(0), CellId(1)])]).unwrap();
    let (before, stamp) = (graph.clone(), graph.stamp());
    let turned = graph.turn_portals(&bodies.map(Clone::clone), 1e-6).inspect_err(|_| {
        assert!(graph == before && graph.stamp() == stamp, "a failed call changes nothing");
    })?;
    assert_eq!(graph.stamp() != stamp, !turned.is_empty(), "what is made from the graph is made anew");
    let portal = &graph.portals()[0];
    assert_eq!(portal.plane(), portal.polygon().plane().unwrap(), "plane and polygon stay of one mind");
    Ok(portal.plane().normal)
}

#[test]
fn bodies_on_the_two_sides_of_a_portal_turn_it() {
    let body = |min: [f64; 3], max: [f64; 3]| crate::pvs::Viewcell::from_box(min.into(), max.into());
    let reversed =
        |polygon: &ConvexPolygon| ConvexPolygon::new(polygon.vertices().iter().rev().copied()).unwrap();
    let west = body([-4.0, -2.0, -2.0], [0.0, 2.0, 2.0]);
    let east = body([0.0, -2.0, -2.0], [4.0, 2.0, 2.0]);
    // Bodies that alone do not decide: one in front of the portal with a gap, one around the portal, an
    // infinite, an inverted and a NaN body.
    let far_west = body([-4.0, -2.0, -2.0], [-0.5, 2.0, 2.0]);
    let court = body([-9.0; 3], [9.0; 3]);
    let endless = body([f64::NEG_INFINITY; 3], [f64::INFINITY; 3]);
    let inverted = body([1.0; 3], [-1.0; 3]);
    let unknown = body([f64::NAN; 3], [f64::NAN; 3]);
    let error = CellGraphError::NotBetween { portal: PortalId(0), cells: [CellId(0), CellId(1)] };
    let no_sides = Err(error);
    for polygon in [door(0.0), reversed(&door(0.0))] {
        let turned = |first, second| turn(polygon.clone(), [first, second]);
        for second in [&east, &court, &endless, &inverted, &unknown] {
            for first in [&west, &far_west] {
                assert_eq!(turned(first, second), Ok(DVec3::X), "{first:?}, {second:?}");
                assert_eq!(turned(second, first), Ok(DVec3::NEG_X), "{first:?}, {second:?}");
            }
        }
        for (first, second) in [(&west, &west), (&west, &far_west), (&court, &court), (&endless, &unknown)] {
            assert_eq!(turned(first, second), no_sides, "{first:?}, {second:?}");
            assert_eq!(turned(second, first), no_sides, "{first:?}, {second:?}");
        }
    }
    // A body that reaches across the portal's plane by no more than the tolerance still decides the winding.
    let across = |by: f64| body([-4.0, -2.0, -2.0], [by, 2.0, 2.0]);
    assert_eq!(
        turn(door(0.0), [&across(1e-6), &court]),
        Ok(DVec3::X),
        "a body that reaches 1e-6 m across still decides the direction"
    );
    assert_eq!(
        turn(door(0.0), [&across(1e-3), &court]),
        no_sides,
        "a body that reaches 1 mm across leaves no side to decide by"
    );
    let error = error.to_string();
    assert!(error.starts_with("portal 0 is not between cells 0 and 1: "), "{error}");
    let few = CellGraph::new(3, []).unwrap().turn_portals(&[west], 1e-6);
    assert_eq!(few, Err(CellGraphError::Bodies { cells: 3, bodies: 1 }), "bodies are missing");
}

/// Tests that the planes of the bodies decide how a portal is wound where their boxes cannot: portal and
/// bodies are slanted, so the boxes reach across the portal's plane. Also tested far from the origin, where
/// coordinates are rounded to a few millionths of the portal's size.
#[test]
fn planes_of_bodies_decide_where_their_boxes_do_not() {
    let normal = DVec3::new(1.0, 2.0, 0.5);
    for at in [DVec3::ZERO, DVec3::new(3e6, -2e6, 1e6)] {
        let (u, v) = (normal.cross(DVec3::Z).normalize(), normal.cross(DVec3::X).normalize());
        let corners = [at + u + v, at - u + v, at - u - v, at + u - v];
        let body = |sign: f64, moved: f64| {
            let inwards = crate::geometry::Plane::through(at + normal * moved, normal * sign);
            let mut body = crate::pvs::Viewcell::from_box(at - 5.0, at + 5.0);
            body.planes.push(crate::geometry::Plane::new(DVec3::Z, 9.0 - at.z));
            body.planes.push(inwards);
            body
        };
        for corners in [corners, [corners[3], corners[2], corners[1], corners[0]]] {
            let polygon = || ConvexPolygon::new(corners).unwrap();
            let unit = normal.normalize();
            for moved in [0.0, 0.3] {
                let (behind, before) = (body(-1.0, -moved), body(1.0, moved));
                let turned = turn(polygon(), [&behind, &before]).unwrap();
                assert!((turned - unit).length() < 1e-6, "{turned}");
                let turned = turn(polygon(), [&before, &behind]).unwrap();
                assert!((turned + unit).length() < 1e-6, "{turned}");
            }
            assert!(turn(polygon(), [&body(-1.0, 0.1), &body(1.0, -0.1)]).is_err(), "both reach across");
        }
    }
    // This body touches the portal's plane with one corner only, where its slanted plane meets a side of its
    // box.
    let mut wedge = crate::pvs::Viewcell::from_box(DVec3::splat(-4.0), DVec3::splat(4.0));
    wedge.planes.push(crate::geometry::Plane::new(DVec3::new(-1.0, -0.5, 0.0), -2.0));
    let all = crate::pvs::Viewcell::from_box(DVec3::splat(-9.0), DVec3::splat(9.0));
    // In the wedge, x + y / 2 <= -2 and y >= -4, so x is at most 0.
    assert_eq!(
        turn(door(0.0), [&wedge, &all]),
        Ok(DVec3::X),
        "a wedge that touches the plane with its corner lies on one side"
    );
    assert_eq!(
        turn(door(0.0), [&all, &wedge]),
        Ok(DVec3::NEG_X),
        "a wedge that touches the plane with its corner lies on one side"
    );
}

/// Vertices may be beyond another portal's plane by up to the tolerance, and so may portals be off a face.
#[test]
fn portals_are_valid_up_to_the_tolerance() {
    let ends = [[CellId(0), CellId(1)], [CellId(1), CellId(2)]];
    let lean = |by: f64| {
        let corners = [[-by, -1.0, -1.0], [0.0, 1.0, -1.0], [0.0, 1.0, 1.0], [-by, -1.0, 1.0]];
        ConvexPolygon::new(corners.map(DVec3::from_array)).unwrap()
    };
    // The second portal leans out of the plane of the first by a quarter of a metre.
    let graph = CellGraph::new(3, [(door(0.0), ends[0]), (lean(0.25), ends[1])]).unwrap();
    for (tolerance, is_valid) in [(0.3, true), (0.2, false), (0.0, false)] {
        assert_eq!(graph.validate(tolerance).is_ok(), is_valid, "a tolerance of {tolerance}");
    }
    let body =
        |x: f64| crate::pvs::Viewcell::from_box(DVec3::new(x, -2.0, -2.0), DVec3::new(x + 4.0, 2.0, 2.0));
    let graph = CellGraph::new(2, [(door(0.25), ends[0])]).unwrap();
    for (tolerance, is_valid) in [(0.3, true), (0.2, false)] {
        let found = graph.validate_bodies(&[body(-4.0), body(0.0)], tolerance);
        assert_eq!(found.is_ok(), is_valid, "a tolerance of {tolerance}");
    }
}

/// A body that reaches across the plane of a portal by what portal and body may be off does not decide
/// otherwise: twice the tolerance, what the plane tilts by, and rounding.
#[test]
fn bodies_decide_up_to_what_they_may_be_off() {
    let polygon = |half: f64, bend: f64| {
        let corners = [[bend, -half, -half], [-bend, half, -half], [bend, half, half], [-bend, -half, half]];
        ConvexPolygon::new(corners.map(DVec3::from_array)).unwrap()
    };
    let body = |min: [f64; 3], max: [f64; 3]| crate::pvs::Viewcell::from_box(min.into(), max.into());
    let court = body([-300.0; 3], [300.0; 3]);
    let decides = |polygon: &ConvexPolygon, body: &crate::pvs::Viewcell, tolerance: f64| {
        let mut graph = CellGraph::new(2, [(polygon.clone(), [CellId(0), CellId(1)])]).unwrap();
        graph.turn_portals(&[body.clone(), court.clone()], tolerance)
    };
    // A portal of 200 m: at its first vertex, it does not tilt by its error of a tenth of a metre.
    let near = |across: f64| body([-0.5, -100.0, -100.0], [across, -99.9, -99.9]);
    let wide = polygon(100.0, 0.0);
    assert_eq!(decides(&wide, &near(0.19), 0.1), Ok(Vec::new()), "twice the tolerance");
    assert!(decides(&wide, &near(0.25), 0.1).is_err(), "more than twice the tolerance");
    // Vertices that are off their plane by nearly as much as those of a polygon may be.
    let bend = 90.0 * ConvexPolygon::TOLERANCE;
    let found = decides(&polygon(100.0, bend), &near(3.0 * bend), 0.0);
    assert_eq!(found, Ok(Vec::new()), "a body as far across as the vertices");
    // A portal of 2 m tilts by its error over its size.
    let small = polygon(1.0, 0.0);
    let around = |across: f64| body([-4.0, -0.1, -0.1], [across, 0.1, 0.1]);
    assert_eq!(decides(&small, &around(1.8), 0.1), Ok(Vec::new()), "a tilt");
    assert!(decides(&small, &around(4.0), 0.1).is_err(), "more than a tilt");
    // Bodies that are not finite, or inverted, decide nothing.
    let end = f64::INFINITY;
    for body in [
        body([-end, -0.1, -0.1], [-1.0, 0.1, 0.1]),
        body([-4.0, -0.1, -0.1], [-1.0, end, 0.1]),
        body([-1.0, -0.1, -0.1], [-4.0, 0.1, 0.1]),
    ] {
        assert!(decides(&small, &body, 0.1).is_err(), "{body:?}");
    }
    // A flat body on its side of the plane.
    assert_eq!(
        decides(&small, &body([-1.0, -0.1, -0.1], [-1.0, 0.1, 0.1]), 0.1),
        Ok(Vec::new()),
        "a flat body"
    );
}

/// The plane of a portal no wider than the tolerance is hardly known, so that both windings fit: the body
/// that reaches least far across decides, not the one beside it that reaches across both ways.
#[test]
fn the_better_winding_of_a_sliver_is_taken() {
    let corners = [[0.0, 0.0], [0.01, 0.0], [0.01, 0.01], [0.0, 0.01]];
    let sliver = ConvexPolygon::new(corners.map(|[y, z]| DVec3::new(0.0, y, z))).unwrap();
    let body = |min: f64, max: f64| {
        crate::pvs::Viewcell::from_box(DVec3::new(min, -0.1, -0.1), DVec3::new(max, 0.1, 0.1))
    };
    for (first, second, is_turned) in [
        (body(0.0, 4.0), body(-1.0, 2.0), true),
        (body(-4.0, 0.0), body(-2.0, 1.0), false),
        (body(-1.0, 2.0), body(-4.0, 0.0), true),
        (body(-2.0, 1.0), body(0.0, 4.0), false),
    ] {
        let mut graph = CellGraph::new(2, [(sliver.clone(), [CellId(0), CellId(1)])]).unwrap();
        let turned = graph.turn_portals(&[first.clone(), second.clone()], 0.01).unwrap();
        assert_eq!(!turned.is_empty(), is_turned, "{first:?}, {second:?}");
    }
}

#[test]
fn graphs_have_up_to_a_million_cells() {
    let graph = CellGraph::new(CellGraph::LIMIT, []).unwrap();
    assert_eq!(graph.cell_count(), CellGraph::LIMIT, "as many cells as are allowed");
    let count = CellGraph::LIMIT + 1;
    let refused = CellGraph::new(count, []).map(|graph| graph.cell_count());
    assert_eq!(refused, Err(CellGraphError::TooMany { what: "cells", count }), "one cell more");
}

#[test]
fn graphs_are_equal_by_cells_portals_and_objects() {
    let other = |objects: &[(u32, u32)]| {
        let mut graph = row(3);
        let id = |index: u32| ObjectId { index, generation: 0 };
        graph.set_objects(objects.iter().map(|&(cell, index)| (CellId(cell), id(index)))).unwrap();
        graph
    };
    assert_eq!(row(3), row(3), "graphs of the same cells and portals");
    assert_ne!(row(3), row(4), "graphs of other portals");
    assert_ne!(other(&[(0, 1)]), other(&[(0, 2)]), "other objects in a cell");
    assert_ne!(other(&[(0, 1)]), other(&[(1, 1)]), "an object in another cell");
    assert_ne!(CellGraph::new(2, []).unwrap(), CellGraph::new(3, []).unwrap(), "other cells");
}

#[test]
fn no_chain_leaves_an_unknown_cell() {
    assert_eq!(row(3).leak(CellId(3), |_| true), None, "a cell that does not exist");
    let leak = row(3).leak(CellId(2), |cell| cell == CellId(0)).unwrap();
    assert_eq!(leak.portals, [PortalId(1), PortalId(0)], "the way through both doors");
    assert!(row(3).leak(CellId(1), |_| true).unwrap().portals.is_empty(), "a cell that is outside itself");
}
