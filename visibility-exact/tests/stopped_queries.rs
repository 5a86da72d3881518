//! A stopped query leaves undecided objects open, and gives the same answers as a full query for the others.

use crate::common::{cuboid, scene};
use std::cell::Cell;
use visibility_core::glam::DVec3;
use visibility_core::pvs::Viewcell;
use visibility_exact::{CellQuery, Effort, ExactSettings, SceneTriangles, Verdict};
use visibility_testing::Random;

/// A town of blocks on a plain.
fn town() -> SceneTriangles {
    let mut random = Random(4);
    let mut objects = Vec::new();
    for x in 0..7 {
        for y in 0..7 {
            let min = DVec3::new(f64::from(x) * 4.0, f64::from(y) * 4.0, 0.0);
            objects.push(cuboid(min, min + DVec3::new(3.0, 3.0, f64::from(random.between(2, 6)))));
        }
    }
    SceneTriangles::new(&scene(&objects))
}

fn settings() -> ExactSettings {
    ExactSettings::new(Effort::Exact(1e-4)).with_rays(300).with_aimed_rays(5)
}

#[test]
fn a_query_that_gives_up_has_no_other_answers() {
    let triangles = town();
    // The viewcell is at the corner where four blocks meet.
    let min = DVec3::new(7.2, 7.2, 0.5);
    let cell = Viewcell::from_box(min, min + DVec3::new(0.6, 0.6, 1.0));
    let asked = Cell::new(0);
    let run = |most: usize| {
        asked.set(0);
        let stop = || asked.replace(asked.get() + 1) >= most;
        let mut query = CellQuery::new(&triangles, &cell, settings()).unwrap().with_stop(&stop);
        query.look(&|_| true);
        query.prove_boxes(&|_| true);
        query.prove_triangles(&|_| true);
        assert_eq!(
            query.is_stopped(),
            asked.get() > most,
            "stopped when asked {} times of {most}",
            asked.get()
        );
        query.verdicts().map(|(_, verdict)| verdict).collect::<Vec<_>>()
    };
    let whole = run(usize::MAX);
    let all = asked.get();
    let mut open = Vec::new();
    for most in [0, 1, all / 4, all / 2, all - 1] {
        let found = run(most);
        assert_eq!(asked.get(), most + 1, "it asks no more once it is to stop");
        let agree = found.iter().zip(&whole).all(|(a, b)| a == b || *a == Verdict::Open);
        assert!(agree, "stopped after {most}: verdicts are those of the whole query, or open");
        open.push(found.iter().filter(|verdict| **verdict == Verdict::Open).count());
    }
    assert!(open.is_sorted_by(|a, b| a >= b) && open[0] > 40 && open[4] < 10, "{open:?}");
}
