//! Growth of a virtual occluder along a line behind a seed, the solid that the line was laid behind.

use super::cell_solids::{CellBox, CellSolids};
use super::chain::{BackLine, Chain, Task, WIDEST};
use super::lines::Point;

/// Distance beyond the end of a chain's reach at which the next chain is tried, as a fraction of the line's
/// distance from the viewcell. After a failure, a quarter of the distance is tried.
const STEP: f64 = 1.0 / 32.0;
const TRIES: u32 = 5;

/// Maximum number of chains by which a segment grows to each side of its middle.
const CHAINS: usize = 256;

/// Segment on the plan that no line of sight from the viewcell reaches, as long as the line of sight rises by
/// at most `slope` metres per metre on the plan and stays above the height `bottom`.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Grown {
    /// Ends of the segment. As seen from the viewcell, the first is counter-clockwise of the second.
    pub(crate) ends: [Point; 2],
    /// Height in metres at which the solids of the chains begin to occlude. Lines of sight that pass lower
    /// are not known to be hidden.
    pub(crate) bottom: f64,
    pub(crate) slope: f64,
    /// Bound in metres on the distance between the hidden segment and the straight one between `ends`.
    pub(crate) error: f64,
}

impl Grown {
    /// Returns the distance between the ends.
    pub(crate) fn width(&self) -> f64 {
        let [a, b] = self.ends;
        visibility_core::geometry::sqrt((b.x - a.x) * (b.x - a.x) + (b.y - a.y) * (b.y - a.y))
    }
}

/// Finds the widest segment around the middle of a line that is hidden from a viewcell. `None` if the middle
/// itself is not hidden.
pub(crate) fn grow(
    chain: &mut Chain,
    solids: &mut CellSolids,
    cell: &CellBox,
    line: BackLine,
    slope: f64,
) -> Option<Grown> {
    let corners = cell.corners();
    if !corners.iter().all(|&corner| line.is_before(corner)) {
        return None;
    }
    solids.restrict(slope, |post| post.low <= cell.min[2] && line.is_before(post.at));
    let task = Task { solids, corners: &corners, line, slope };
    let mut bottom = f64::NEG_INFINITY;
    let mut ends = [0.0; 2];
    for (end, side) in ends.iter_mut().zip([-1.0, 1.0]) {
        chain.clear();
        if !chain.cover(&task, 0.0) || !chain.holds(&task, 0.0) {
            return None;
        }
        *end = grow_to(chain, &task, side, &mut bottom);
    }
    (ends[0] < ends[1]).then(|| Grown {
        ends: ends.map(|position| line.at(position)),
        bottom,
        slope,
        error: line.error,
    })
}

/// Grows a segment from its middle to one side. Each step is a chain that hides all points between two
/// positions. Returns the position of the end.
fn grow_to(chain: &mut Chain, task: &Task, side: f64, bottom: &mut f64) -> f64 {
    let (limit, step) = (side * WIDEST * task.line.distance, side * STEP * task.line.distance);
    let (mut begin, mut position) = (0.0f64, 0.0f64);
    for _ in 0..CHAINS {
        let end = chain.reach(task, position, limit);
        if end != begin {
            *bottom = bottom.max(chain.low());
        }
        (begin, position) = (end, end);
        if end == limit {
            break;
        }
        let mut by = step;
        let is_found = (0..TRIES).any(|_| {
            position = if (limit - end).abs() < by.abs() { limit } else { end + by };
            by *= 0.25;
            chain.cover(task, position) && chain.holds(task, position) && chain.holds(task, end)
        });
        if !is_found {
            break;
        }
    }
    begin
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::horizon::UpAxis;
    use crate::virtual_occluders::solids::PlanSolids;
    use crate::virtual_occluders::umbra::Umbra;
    use alloc::vec::Vec;
    use visibility_core::glam::{Affine3A, DVec3, Vec3};
    use visibility_core::{Aabb, Object, OccluderMesh, Scene};
    use visibility_testing::Random;

    const CELL: CellBox = CellBox { min: [-3.0, -2.0, 1.0], max: [3.0, 2.0, 2.0] };

    /// Grows a segment on the line at `y` metres, behind upright boxes.
    fn grown(boxes: &[Aabb], y: f64, slope: f64) -> Option<Grown> {
        let mut scene = Scene::new();
        for bounds in boxes {
            let id = scene.insert(Object { occluder: true, ..Object::new(*bounds) });
            let mesh = scene.add_mesh(OccluderMesh::cuboid(bounds).unwrap());
            scene.set_mesh(id, mesh, Affine3A::IDENTITY).unwrap();
        }
        let mut all = PlanSolids::new(UpAxis::Z);
        all.sync(&scene);
        let mut solids = CellSolids::new();
        solids.fill(&all, &CELL, |_| true);
        grow(&mut Chain::new(), &mut solids, &CELL, BackLine::new([0.0; 2], [0.0, 1.0], y), slope)
    }

    fn house(x: [f32; 2], y: [f32; 2], z: [f32; 2]) -> Aabb {
        Aabb::from_arrays([x[0], y[0], z[0]], [x[1], y[1], z[1]])
    }

    /// A wall 40 m wide at 10 m hides a segment between the lines that cross before its ends.
    #[test]
    fn a_segment_ends_where_lines_of_sight_pass_a_wall() {
        let wall = house([-20.0, 20.0], [10.0, 11.0], [0.0, 12.0]);
        let segment = grown(&[wall], 20.0, 0.25).unwrap();
        // The line from (3, -2) past (20, 10) is at 34.1667 where y is 20.
        let [left, right] = segment.ends;
        assert!((left.x + 34.1667).abs() < 0.001 && left.x >= -34.166_67, "{left:?}: the left end");
        assert!((right.x - 34.1667).abs() < 0.001 && right.x <= 34.166_67, "{right:?}: the right end");
        assert!((segment.width() - 68.3333).abs() < 0.002, "{}: the width", segment.width());
        assert_eq!(segment.bottom, 0.0, "the lower end of the wall");
        let line = BackLine::new([0.0; 2], [0.0, 1.0], 20.0);
        assert_eq!(segment.error, line.error, "the error of the line");
        assert!(grown(&[wall], 20.0, 0.5).is_none(), "a wall 10 m above the eyes, its ends at 26 m");
        let floating = house([-20.0, 20.0], [10.0, 11.0], [1.5, 12.0]);
        assert!(grown(&[floating], 20.0, 0.25).is_none(), "eyes below the wall");
        let raised = house([-20.0, 20.0], [10.0, 11.0], [0.75, 12.0]);
        assert_eq!(grown(&[raised], 20.0, 0.25).unwrap().bottom, 0.75, "a wall below all eyes");
        assert!(grown(&[wall], 10.5, 0.25).is_some(), "posts in front of the line hide by themselves");
        assert!(grown(&[wall], 9.0, 0.25).is_none(), "a wall behind the line");
        assert!(grown(&[wall], 1.0, 0.25).is_none(), "a line through the viewcell");
        let beside = house([2.0, 20.0], [10.0, 11.0], [0.0, 12.0]);
        assert!(grown(&[beside], 20.0, 0.25).is_none(), "eyes pass beside the wall");
    }

    /// A slot that shows from a viewcell that is nearly a point: the chain beyond it does not reach back.
    #[test]
    fn a_segment_ends_at_a_slot_that_is_narrower_than_a_step() {
        let cell = CellBox { min: [-0.01, -0.01, 1.0], max: [0.01, 0.01, 2.0] };
        let mut all = PlanSolids::new(UpAxis::Z);
        let mut scene = Scene::new();
        for bounds in
            [house([-5.0, 5.0], [10.0, 11.0], [0.0, 30.0]), house([5.0625, 20.0], [9.0, 10.0], [0.0, 30.0])]
        {
            let id = scene.insert(Object { occluder: true, ..Object::new(bounds) });
            let mesh = scene.add_mesh(OccluderMesh::cuboid(&bounds).unwrap());
            scene.set_mesh(id, mesh, Affine3A::IDENTITY).unwrap();
        }
        all.sync(&scene);
        let mut solids = CellSolids::new();
        solids.fill(&all, &cell, |_| true);
        let line = BackLine::new([0.0; 2], [0.0, 1.0], 20.0);
        let segment = grow(&mut Chain::new(), &mut solids, &cell, line, 0.25).unwrap();
        // A line from the viewcell past (5, 10) is at 10 or less where y is 20.
        assert!(segment.ends[1].x < 10.05 && segment.ends[1].x > 9.9, "{segment:?} ends before the slot");
    }

    /// Houses of different lower ends that touch, or overlap as seen from the line: the highest lower end
    /// counts.
    #[test]
    fn the_bottom_is_the_highest_lower_end_of_the_houses() {
        for (left, right) in [(0.25, 0.5), (0.5, 0.25)] {
            let touching = [
                house([-20.0, 0.0], [10.0, 11.0], [left, 12.0]),
                house([0.0, 20.0], [10.0, 11.0], [right, 12.0]),
            ];
            assert_eq!(grown(&touching, 20.0, 0.25).unwrap().bottom, 0.5, "houses that touch");
            let apart = [
                house([-20.0, 8.0], [10.0, 11.0], [left, 12.0]),
                house([-8.0, 20.0], [14.0, 15.0], [right, 15.0]),
            ];
            let bottom = grown(&apart, 20.0, 0.25).unwrap().bottom;
            assert_eq!(bottom, 0.5, "houses behind each other");
        }
    }

    /// Random towns: no line of sight from the viewcell passes a segment that is grown.
    #[test]
    fn no_line_of_sight_passes_a_segment() {
        let mut random = Random(30);
        let (mut segments, mut passed, mut joined) = (0, 0, 0);
        for round in 0..1500 {
            let touching = random.one_in(2);
            let mut x = -30.0;
            let mut boxes = Vec::new();
            while x < 30.0 {
                let width = random.between(2, 9) as f32;
                let y = if touching { 10.0 } else { random.between(6, 16) as f32 };
                let low = if random.one_in(4) { 0.5 } else { 0.0 };
                let high = random.between(6, 12) as f32;
                boxes.push(house([x, x + width], [y, y + random.between(1, 4) as f32], [low, high]));
                x += if touching { width } else { width * 0.5 };
            }
            let slope = [0.0, 0.1, 0.2, 0.3][random.below(4)];
            let y = f64::from(random.between(14, 24));
            let Some(segment) = grown(&boxes, y, slope) else { continue };
            segments += 1;
            joined += usize::from(segment.width() > 20.0);
            let [a, b] = segment.ends;
            assert!(a.x < b.x, "round {round}: the ends of {segment:?}");
            let umbra = Umbra::new(&segment, &CELL);
            for trial in 0..60 {
                // Eyes are corners of the viewcell or points in it, lines rise by the slope at most.
                let part = |random: &mut Random| [0.0, 1.0, random.unit()][random.below(3)];
                let eye = DVec3::from_array(
                    [0, 1, 2].map(|i| CELL.min[i] + (CELL.max[i] - CELL.min[i]) * part(&mut random)),
                );
                let at = a.x + (b.x - a.x) * [1e-6, 1.0 - 1e-6, random.unit()][random.below(3)];
                let (dx, dy) = (at - eye.x, y - eye.y);
                let by = [0.0, slope * 0.999, -0.9 * (eye.z - segment.bottom) / dx.hypot(dy)];
                let end = DVec3::new(at, y, eye.z + by[random.below(3)] * dx.hypot(dy));
                // A line of sight through a box is no line of sight.
                let is_free = boxes.iter().all(|bounds| {
                    let (min, max) = (bounds.min.as_dvec3() - 1e-9, bounds.max.as_dvec3() + 1e-9);
                    !crosses(eye, end, min, max)
                });
                assert!(!is_free, "round {round}.{trial}: {eye} sees {end} past {boxes:?}");
                // Lines that rise by more pass over the houses.
                let over = DVec3::new(at, y, eye.z + 2.0 * dx.hypot(dy));
                passed += usize::from(
                    boxes
                        .iter()
                        .all(|bounds| !crosses(eye, over, bounds.min.as_dvec3(), bounds.max.as_dvec3())),
                );
            }
            assert!(!umbra.hides([a.x, y - 1.0, 0.5], [b.x, y + 1.0, 1.0]), "round {round}: across the line");
        }
        assert!(segments > 200 && passed > 1_000 && joined > 20, "{segments} {passed} {joined}");
    }

    /// Returns whether a segment meets a box.
    fn crosses(from: DVec3, to: DVec3, min: DVec3, max: DVec3) -> bool {
        let (mut enter, mut exit) = (0.0f64, 1.0f64);
        for axis in 0..3 {
            let along = to[axis] - from[axis];
            if along == 0.0 {
                if from[axis] < min[axis] || from[axis] > max[axis] {
                    return false;
                }
                continue;
            }
            let ends = [min[axis], max[axis]].map(|side| (side - from[axis]) / along);
            enter = enter.max(ends[0].min(ends[1]));
            exit = exit.min(ends[0].max(ends[1]));
        }
        enter <= exit
    }

    /// A culler keeps what the houses do not hide, and hides a house behind a row of houses.
    #[test]
    fn culling_by_segments_hides_what_is_behind_a_row_and_low_enough() {
        use crate::virtual_occluders::VirtualOccluderCuller;
        use visibility_core::pvs::Viewcell;
        use visibility_core::{RegionCuller, VisibleSet};
        let mut scene = Scene::new();
        for i in -5..5i8 {
            let x = 6.0 * f32::from(i);
            let bounds = house([x, x + 6.0], [10.0, 16.0], [0.0, 8.0]);
            let id = scene.insert(Object { occluder: true, ..Object::new(bounds) });
            let mesh = scene.add_mesh(OccluderMesh::cuboid(&bounds).unwrap());
            scene.set_mesh(id, mesh, Affine3A::IDENTITY).unwrap();
        }
        let [behind, over, beside, before, nothing] = [
            house([-2.0, 2.0], [20.0, 24.0], [0.0, 3.0]),
            house([-2.0, 2.0], [20.0, 24.0], [0.0, 30.0]),
            house([60.0, 64.0], [20.0, 24.0], [0.0, 9.0]),
            house([-2.0, 2.0], [6.0, 8.0], [0.0, 3.0]),
            Aabb::new(Vec3::new(2.0, 24.0, 3.0), Vec3::new(-2.0, 20.0, 0.0)),
        ]
        .map(|bounds| scene.insert(bounds));
        let cell = Viewcell::from_box(DVec3::new(-8.0, -8.0, 1.0), DVec3::new(8.0, 4.0, 2.0));
        let mut culler = VirtualOccluderCuller::new(UpAxis::Z);
        let mut left = |cell: &Viewcell| {
            let mut visible = VisibleSet::new();
            culler.cull(&scene, cell, &mut visible);
            [behind, over, beside, before, nothing].map(|id| visible.contains(&scene, id))
        };
        let expected = left(&cell);
        assert!(expected[4], "a box that is inverted");
        assert_eq!(
            expected[..4],
            [false, true, true, true],
            "behind, over, beside and before a row of houses"
        );
        let flat = Viewcell::from_box(DVec3::new(-8.0, -8.0, 1.0), DVec3::new(8.0, 4.0, 1.0));
        assert!(!left(&flat)[0], "a viewcell without height");
        let huge = Viewcell::from_box(DVec3::new(-8.0, -8.0, 1.0), DVec3::new(8.0, 1e101, 2.0));
        assert!(left(&huge)[0], "a viewcell beyond all numbers");
        let mut inverted = cell.clone();
        inverted.max.y = -9.0;
        assert!(left(&inverted)[0], "an inverted viewcell");
        let mut none = VirtualOccluderCuller::new(UpAxis::Z).with_max(0);
        let mut visible = VisibleSet::new();
        none.cull(&scene, &cell, &mut visible);
        assert!(visible.contains(&scene, behind) && none.occluders().is_empty(), "no virtual occluder");
    }
}
