//! Tests of objects and heights on a plan, against simple lines of sight and exact integers.

use visibility_2d::cdt::{Opacity, Plan, PlanError, PlanObjects, PlanView, Visibility, Wall};
use visibility_testing::Random;

type Point = [f64; 2];

fn random_walls(random: &mut Random, count: usize) -> Vec<Wall> {
    (0..count)
        .map(|_| {
            let a = [0, 1].map(|_| f64::from(random.between(0, 64)));
            let b = a.map(|x| x + f64::from(random.between(-12, 12)));
            Wall::new(a, b).with_opacity(random.pick(&[Opacity::Opaque, Opacity::Opaque, Opacity::OneWay]))
        })
        .collect()
}

/// Makes the outline of a point, a segment, a box or a triangle.
fn outline(random: &mut Random) -> Vec<Point> {
    let [x, y] = [0, 1].map(|_| random.fine_range(0.0, 64.0));
    let [w, h] = [0, 1].map(|_| random.fine_range(0.1, 5.0));
    match random.below(4) {
        0 => vec![[x, y]],
        1 => vec![[x, y], [x + w, y + h]],
        2 => vec![[x, y], [x + w, y], [x, y + h], [x + w, y + h]],
        _ => vec![[x, y], [x + w, y + 0.3], [x + 0.2, y + h]],
    }
}

#[test]
fn objects_seen_are_those_with_a_line_of_sight() {
    let (mut answer, mut all, mut seen_points) = (Visibility::new(), 0, [0, 0]);
    let mut extra = 0;
    for seed in 0..200 {
        let mut random = Random(seed);
        let count = random.below(40);
        let plan = Plan::from_walls(&random_walls(&mut random, count), 100.0).unwrap();
        let mut objects = PlanObjects::new(&plan);
        let mut outlines: Vec<_> = (0..20).map(|_| outline(&mut random)).collect();
        for outline in &outlines {
            objects.insert(&plan, outline).unwrap();
        }
        // Some objects move, and some are removed.
        for (object, outlined) in (0u32..).zip(&mut outlines) {
            match random.below(4) {
                0 => {
                    *outlined = outline(&mut random);
                    objects.set(&plan, object, outlined).unwrap();
                }
                1 => {
                    outlined.clear();
                    objects.remove(object);
                }
                _ => {}
            }
        }
        for _ in 0..10 {
            let eye = [0, 1].map(|_| random.fine_range(0.0, 64.0));
            let range = random.pick(&[f64::INFINITY, 15.0]);
            plan.look_at(&PlanView::new(eye).with_range(range), &objects, &mut answer).unwrap();
            for (object, outline) in (0u32..).zip(&outlines) {
                let seen = answer.objects().contains(&object);
                let near = |p: Point| (p[0] - eye[0]).hypot(p[1] - eye[1]) < range;
                // Samples points of the outline, and tests whether the eye sees them by separate lines of
                // sight.
                let mut by_line = false;
                for _ in 0..if outline.len() == 1 { 1 } else { 12 } {
                    let shares: Vec<_> = outline.iter().map(|_| random.unit() + 1e-9).collect();
                    let sum: f64 = shares.iter().sum();
                    let p = [0, 1].map(|k| outline.iter().zip(&shares).map(|(c, s)| s / sum * c[k]).sum());
                    by_line |= !outline.is_empty() && near(p) && plan.sees(eye, p).unwrap();
                }
                assert!(seen || !by_line, "seed {seed}: object {object} {outline:?} from {eye:?}");
                if outline.len() == 1 {
                    assert_eq!(seen, by_line, "seed {seed}: point {outline:?} from {eye:?}");
                    seen_points[usize::from(seen)] += 1;
                }
                assert!(!seen || !outline.is_empty(), "seed {seed}: object {object} was removed and is seen");
                all += usize::from(seen);
                extra += usize::from(seen && !by_line);
            }
        }
    }
    assert!(seen_points[0] > 1000 && seen_points[1] > 1000, "{seen_points:?}");
    // Only few objects are seen beyond those that samples find.
    assert!(extra * 5 < all, "{extra} of {all} objects seen without a sample");
}

/// An object in the shadow of a wall that only touches the line of sight past the wall's end is not listed
/// where a pane of glass keeps it out of the triangles along the line. A point of the line is, and the object
/// once it reaches beyond the line.
#[test]
fn objects_that_only_touch_a_line_of_sight_are_left_out() {
    let glass = Wall::new([1.0, 0.0], [4.0, 0.0]).with_opacity(Opacity::Clear);
    let plan = Plan::new(&[Wall::new([1.0, 0.0], [1.0, 1.0]), glass]).unwrap();
    let mut objects = PlanObjects::new(&plan);
    for low in [0.0, -1e-9] {
        objects.insert(&plan, &[[2.0, low], [3.0, low], [3.0, 1.0], [2.0, 1.0]]).unwrap();
    }
    objects.insert(&plan, &[[2.0, 0.0]]).unwrap();
    let mut answer = Visibility::new();
    plan.look_at(&PlanView::new([0.0, 0.0]), &objects, &mut answer).unwrap();
    let mut seen = answer.objects().to_vec();
    seen.sort_unstable();
    assert_eq!(seen, [1, 2], "all but the object that touches the line");
    assert_eq!(plan.sees([0.0, 0.0], [2.0, 0.0]), Ok(true), "a point of that object");
}

#[test]
fn objects_of_another_plan_are_refused() {
    let walls = [Wall::new([0.0, 0.0], [1.0, 0.0])];
    let (mut plan, other) = (Plan::new(&walls).unwrap(), Plan::new(&walls).unwrap());
    let mut objects = PlanObjects::new(&plan);
    let object = objects.insert(&plan, &[[0.5, 0.5]]).unwrap();
    let mut answer = Visibility::new();
    let view = PlanView::new([0.5, 1.0]);
    assert_eq!(
        other.look_at(&view, &objects, &mut answer),
        Err(PlanError::Objects),
        "objects of another plan"
    );
    assert_eq!(
        objects.insert(&other, &[[0.5, 0.5]]),
        Err(PlanError::Objects),
        "an insertion with another plan"
    );
    assert_eq!(
        objects.set(&plan, 7, &[[0.5, 0.5]]),
        Err(PlanError::Objects),
        "an object that does not exist"
    );
    assert_eq!(
        objects.set(&plan, object, &[[0.5, 1e9]]),
        Err(PlanError::Region),
        "an object outside of the plan"
    );
    assert_eq!(objects.set(&plan, object, &[]), Err(PlanError::Region), "an object without corners");
    objects.remove(7);
    // Opening a door keeps the triangles, and a refused outline leaves the object unchanged.
    plan.set_opacity(0, Opacity::Clear).unwrap();
    plan.look_at(&view, &objects, &mut answer).unwrap();
    assert_eq!(answer.objects(), [object], "the object is where it was");
    plan.look(&view, &mut answer).unwrap();
    assert!(answer.objects().is_empty(), "a look without objects lists none");
}

/// An eye that moves in small steps, jumps, and changes its plan must see the same as with a new
/// `Visibility`.
#[test]
fn the_place_of_the_last_eye_changes_nothing() {
    let mut random = Random(4);
    let plans: Vec<_> =
        (0..4).map(|k| Plan::new(&random_walls(&mut random, 4 << (2 * k))).unwrap()).collect();
    let mut warm = Visibility::new();
    let (mut eye, mut plan) = ([30.0, 30.0], 0);
    for _ in 0..3000 {
        match random.below(12) {
            0 => eye = [0, 1].map(|_| random.fine_range(-9.0, 80.0)),
            1 => plan = random.below(4),
            2 => eye = random.pick(plans[plan].walls()).ends[0],
            _ => eye = eye.map(|x| x + random.fine_range(-1.0, 1.0)),
        }
        let mut fresh = Visibility::new();
        let view = PlanView::new(eye);
        plans[plan].look(&view, &mut warm).unwrap();
        plans[plan].look(&view, &mut fresh).unwrap();
        assert_eq!((warm.area(), warm.walls().len()), (fresh.area(), fresh.walls().len()), "{eye:?}");
    }
}

/// Returns whether a segment with heights is stopped. A segment at the height of a wall's lower or upper end
/// where it crosses the wall is not. `None` if it touches the wall's ends or begins or ends on the wall.
fn stopped([a, b]: [[i64; 3]; 2], walls: &[([[i64; 2]; 2], [i64; 2])]) -> Option<bool> {
    let side =
        |a: [i64; 2], b: [i64; 2], p: [i64; 2]| (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]);
    let [p, q] = [a, b].map(|p| [p[0], p[1]]);
    let mut any = false;
    for &([c, d], [low, high]) in walls {
        let (of_c, of_d) = (side(p, q, c), side(p, q, d));
        let (of_p, of_q) = (side(c, d, p), side(c, d, q));
        if [of_c, of_d, of_p, of_q].contains(&0) {
            return None;
        }
        if (of_c > 0) != (of_d > 0) && (of_p > 0) != (of_q > 0) {
            // Height a + of_p / (of_p - of_q) (b - a), multiplied by the positive denominator.
            let whole = (of_p - of_q).abs();
            let height = a[2] * whole + of_p.abs() * (b[2] - a[2]);
            any |= low * whole < height && height < high * whole;
        }
    }
    Some(any)
}

#[test]
fn heights_decide_as_whole_numbers_do() {
    let [mut over, mut blocked] = [0; 2];
    let mut answer = Visibility::new();
    for seed in 0..300 {
        let mut random = Random(seed);
        let walls: Vec<_> = (0..random.between(1, 12))
            .map(|_| {
                let ends = [0; 2].map(|_| [0; 2].map(|_| i64::from(random.between(0, 60))));
                let low = i64::from(random.between(0, 6));
                (ends, [low, low + i64::from(random.between(0, 9))])
            })
            .collect();
        let plan = Plan::from_walls(
            &walls
                .iter()
                .map(|&(ends, [low, high])| {
                    let [a, b] = ends.map(|end| end.map(|x| x as f64));
                    Wall::new(a, b).with_heights(low as f64, high as f64)
                })
                .collect::<Vec<_>>(),
            100.0,
        )
        .unwrap();
        for _ in 0..40 {
            let ends = [0; 2].map(|_| {
                [
                    i64::from(random.between(0, 60)),
                    i64::from(random.between(0, 60)),
                    i64::from(random.between(0, 12)),
                ]
            });
            let [(p, of_p), (q, of_q)] = ends.map(|[x, y, z]| ([x as f64, y as f64], z as f64));
            let Some(stopped) = stopped(ends, &walls) else { continue };
            for (from, to) in [((p, of_p), (q, of_q)), ((q, of_q), (p, of_p))] {
                assert_eq!(
                    plan.sees_at(from, to).unwrap(),
                    !stopped,
                    "seed {seed}: {from:?} {to:?} {walls:?}"
                );
            }
            blocked += usize::from(stopped);
            over += usize::from(!stopped && !plan.sees(p, q).unwrap());
            // A target that a view with heights does not see is reached by no line of sight at these heights.
            if !stopped {
                let mut objects = PlanObjects::new(&plan);
                objects.insert(&plan, &[q]).unwrap();
                plan.look_at(&PlanView::new(p).with_heights(of_p, of_q), &objects, &mut answer).unwrap();
                assert_eq!(answer.objects(), [0], "seed {seed}: {p:?} {q:?}");
            }
        }
    }
    assert!(over > 500 && blocked > 500, "{over} over walls, {blocked} blocked");
    let plan = Plan::new(&[Wall::new([0.0, -1.0], [0.0, 1.0]).with_heights(0.0, 1.0)]).unwrap();
    assert_eq!(
        plan.sees_at(([1.0, 0.0], f64::NAN), ([0.0, 5.0], 1.0)),
        Err(PlanError::Heights),
        "a height of NaN"
    );
    for heights in [[f64::NAN, 0.5], [0.5, f64::NAN], [f64::INFINITY, 0.5], [0.5, -1e61]] {
        let view = PlanView::new([-1.0, 0.0]).with_heights(heights[0], heights[1]);
        assert_eq!(plan.look(&view, &mut answer), Err(PlanError::Heights), "a view with heights {heights:?}");
        assert!(answer.polygon().is_empty(), "the polygon of a view with heights {heights:?}");
    }
    // Walls that reach from below the lower height to above the upper one hide.
    plan.look(&PlanView::new([-1.0, 0.0]).with_heights(0.5, 0.9), &mut answer).unwrap();
    let hidden = answer.area();
    plan.look(&PlanView::new([-1.0, 0.0]).with_heights(0.5, 1.1), &mut answer).unwrap();
    assert!(hidden < answer.area(), "looking up over the wall shows more than {hidden}");
    // A line of sight exactly along the wall's top passes; a millionth below, it is stopped.
    assert!(plan.sees_at(([-1.0, 0.0], 1.0), ([1.0, 0.0], 1.0)).unwrap(), "a line along the wall's top");
    assert!(plan.sees_at(([-0.1, 0.0], 1.1), ([0.2, 0.0], 0.8)).unwrap(), "touches the top, up to rounding");
    let kerb = Plan::new(&[Wall::new([0.0, -1.0], [0.0, 1.0]).with_heights(-1.0, 0.0)]).unwrap();
    assert!(
        kerb.sees_at(([-1.0, 0.0], 0.0), ([1.0, 0.0], 5e-324)).unwrap(),
        "half of the least number above"
    );
    // A wall 10^-16 long, seen nearly edge on: the areas that tell where the line crosses it cancel.
    let (p, q) =
        ([-5.692135374532318e-17, -6.394053597493141e-17], [7.077458765595382e-18, 7.95020632919903e-18]);
    let splinter = Plan::new(&[Wall::new(p, q).with_heights(-1.0, 1.0)]).unwrap();
    let (a, b) = ([1.0595511051688549, 1.1902082627979291], [-1.0595511051688549, -1.1902082627979291]);
    assert!(splinter.sees_at((a, 0.0), (b, 10.0)).unwrap(), "passes four metres above the wall");
    assert!(
        !plan.sees_at(([-1.0, 0.0], 1.0), ([1.0, 0.0], 1.0 - 1e-6)).unwrap(),
        "a line that ends below the wall's top"
    );
}
