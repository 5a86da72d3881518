//! `try_triangles` decides easy objects, and leaves the others open for a longer search.

use crate::common::{prepared, quad};
use visibility_core::ObjectId;
use visibility_core::glam::DVec3;
use visibility_core::pvs::Viewcell;
use visibility_exact::{CellQuery, Effort, ExactSettings, Verdict};

/// Three plates behind a wall of overlapping plates, one before the other. One plate is seen past the wall,
/// one is hidden by few plates of the wall, and one by a thousand.
#[test]
fn a_quick_look_leaves_open_what_takes_long() {
    let plate = |x: f64, corner: f64, size: f64| {
        let at = |y: f64, z: f64| DVec3::new(x, y, z);
        let (a, b) = (corner, corner + size);
        quad(at(a, a), at(b, a), at(b, b), at(a, b))
    };
    let wall = (0..1600).map(|k| {
        let (row, column) = (f64::from(k / 40) - 20.05, f64::from(k % 40) - 20.05);
        let x = f64::from((k / 40 + k % 40) % 2) * 0.05;
        let at = |y: f64, z: f64| DVec3::new(x, column + y, row + z);
        quad(at(0.0, 0.0), at(1.1, 0.0), at(1.1, 1.1), at(0.0, 1.1))
    });
    let behind = [plate(0.5, 30.0, 1.0), plate(0.5, 0.5, 1.0), plate(0.5, -19.0, 38.0)];
    let triangles = prepared(&behind.into_iter().chain(wall).collect::<Vec<_>>());
    let cell = Viewcell::from_box(DVec3::new(-40.0, -0.1, -0.1), DVec3::new(-39.9, 0.1, 0.1));
    let mut query = CellQuery::new(&triangles, &cell, ExactSettings::new(Effort::Exact(1e-4))).unwrap();
    let is_behind = |id: ObjectId| id.index() < 3;
    let answers = |query: &CellQuery<'_>| -> Vec<Verdict> {
        query.verdicts().map(|(_, verdict)| verdict).take(3).collect()
    };
    query.try_triangles(&is_behind);
    let (quick, found) = (query.steps(), answers(&query));
    assert!(matches!(found[..], [Verdict::Seen(_), Verdict::Hidden, Verdict::Open]), "{found:?}");
    query.prove_triangles(&is_behind);
    assert_eq!(answers(&query), [found[0], Verdict::Hidden, Verdict::Hidden], "verdicts after a full search");
    assert!(query.steps() > 3 * quick, "{quick} of {} steps", query.steps());
}
