//! Tests of movers on a plan: no pair with a free line of sight is reported hidden, while doors open and
//! close.

use visibility_2d::cdt::{Opacity, Plan, PlanCells, PlanError, Wall};
use visibility_core::glam::{DVec2, DVec3};
use visibility_core::who_sees::{Reach, WhoSees};
use visibility_testing::{Random, judged, told_enough};

/// Side of the square that the walls are in.
const SIDE: f64 = 12.0;

/// Walls with a copy of their opacities, placed and scaled in world space.
struct World {
    walls: Vec<Wall>,
    at: DVec2,
    scale: f64,
}

impl World {
    fn random(rng: &mut Random) -> Self {
        let scale = rng.pick(&[1.0, 1.0, 1e-6, 1e5]);
        let at = DVec2::new(rng.range(-1.0, 1.0), rng.range(-1.0, 1.0)) * scale * rng.pick(&[0.0, 1e3, 1e9]);
        let mut world = Self { walls: Vec::new(), at, scale };
        // Half of the walls are on a grid, so that walls touch and cross each other, and movers touch walls.
        for i in 0..rng.between(1, 40) {
            let mut end = || DVec2::new(rng.range(0.0, SIDE), rng.range(0.0, SIDE));
            let (mut a, mut b) = (end(), end());
            b = a + (b - a) * 0.6;
            if i % 2 == 0 {
                (a, b) = (a.round(), b.round());
            }
            let opacity = rng.pick(&[Opacity::Opaque, Opacity::Opaque, Opacity::Clear, Opacity::OneWay]);
            let wall = Wall::new(world.place(a), world.place(b)).with_opacity(opacity);
            let wall = if rng.one_in(10) { wall.with_heights(0.0, 1.0) } else { wall };
            world.walls.push(wall);
        }
        world
    }

    fn place(&self, point: DVec2) -> DVec2 {
        self.at + point * self.scale
    }

    /// Returns whether all walls let a segment pass between the two points, by more than rounding. With
    /// `of_people`, one-way walls can be passed in both directions.
    fn is_free(&self, from: DVec2, to: DVec2, of_people: bool) -> bool {
        let side = |a: DVec2, b: DVec2, c: DVec2| (b - a).perp_dot(c - a);
        let least = 1e-9 * self.scale * self.scale + 1e-15 * self.at.length() * self.scale;
        self.walls.iter().all(|wall| {
            let [a, b] = wall.ends.map(DVec2::from);
            let (f, t) = (side(a, b, from), side(a, b, to));
            let (l, r) = (side(from, to, a), side(from, to, b));
            let misses = |x: f64, y: f64| x.min(y) > least || x.max(y) < -least;
            let passes = match wall.opacity {
                Opacity::Opaque => wall.heights[0].is_finite(),
                Opacity::Clear => true,
                Opacity::OneWay => of_people || wall.heights[0].is_finite() || (f > least && t < -least),
            };
            passes || misses(f, t) || misses(l, r)
        })
    }

    fn mover(&self, rng: &mut Random) -> Reach {
        let mut low = DVec2::new(rng.range(-2.0, SIDE), rng.range(-2.0, SIDE));
        if rng.one_in(3) {
            low = low.round();
        }
        let size = DVec2::new(rng.range(0.0, 0.6), rng.range(0.0, 0.6)) * f64::from(rng.between(0, 1));
        let corner = |p: DVec2, height: f64| self.place(p).extend(height);
        Reach::new(corner(low, 0.0), corner(low + size, 1.8)).within(0.1, self.scale * rng.range(-1.0, 9.0))
    }

    /// Returns a random point that some point of a mover can reach.
    fn point_of(&self, reach: &Reach, rng: &mut Random) -> DVec2 {
        let (low, high) = (reach.min.truncate(), reach.max.truncate());
        let mut point = low + (high - low) * DVec2::new(rng.unit(), rng.unit()).round();
        let mut left = reach.margin * (1.0 - 1e-9) - 1e-15 * self.at.length();
        for _ in 0..2 {
            let step = DVec2::from_angle(rng.range(0.0, 7.0)) * left.max(0.0) * rng.unit();
            if self.is_free(point, point + step, true) {
                (point, left) = (point + step, left - step.length());
            }
        }
        point
    }
}

/// Returns the number of hidden ordered pairs, and of free segments found, in some worlds.
fn search(seed: u64, worlds: usize) -> [usize; 2] {
    let (mut rng, mut hidden, mut free) = (Random(seed), 0, 0);
    for number in 0..worlds {
        let mut world = World::random(&mut rng);
        let mut level =
            PlanCells::new(Plan::from_walls(&world.walls, 3.0 * world.scale).unwrap(), [0, 1]).unwrap();
        let mut who = WhoSees::new();
        let mut movers: Vec<Reach> = (0..24).map(|_| world.mover(&mut rng)).collect();
        for tick in 0..3 {
            who.look(&mut level, &movers, &movers);
            for (a, b) in (0..24 * 24).map(|pair| (pair / 24, pair % 24)) {
                hidden += usize::from(!who.sees(a, b));
                for _ in 0..6 {
                    let [from, to] = [a, b].map(|mover| world.point_of(&movers[mover], &mut rng));
                    if !world.is_free(from, to, false) {
                        continue;
                    }
                    free += 1;
                    let [by, of] = [movers[a], movers[b]];
                    assert!(
                        who.sees(a, b),
                        "world {number}, tick {tick}: {to} of {of:?} is seen from {from} of {by:?}, but not told"
                    );
                }
            }
            if world.walls.iter().all(|wall| wall.opacity != Opacity::OneWay) {
                let agree = |(a, b)| who.sees(a, b) == who.sees(b, a);
                assert!((0..24 * 24).map(|p| (p / 24, p % 24)).all(agree), "world {number}: one-sided pair");
            }
            for _ in 0..2 {
                let wall = rng.below(world.walls.len());
                world.walls[wall].opacity = rng.pick(&[Opacity::Opaque, Opacity::Clear]);
                level.set_opacity(wall as u32, world.walls[wall].opacity).unwrap();
            }
            let mover = rng.below(24);
            movers[mover] = world.mover(&mut rng);
        }
    }
    [hidden, free]
}

#[test]
fn pairs_with_a_free_line_are_reported() {
    let [hidden, free] = search(0x706c_616e, 60);
    judged(free as u64);
    told_enough(
        hidden > 10_000 && free > 50_000,
        format_args!("{hidden} hidden, {free} free: too few to tell"),
    );
}

#[test]
fn movers_do_not_see_through_a_wall_that_their_reach_sticks_through() {
    // A wall across the square with a closed door.
    let wall = |a: [f64; 2], b: [f64; 2]| Wall::new(a, b);
    let walls = [
        wall([0.0, 5.0], [8.0, 5.0]),
        wall([8.0, 5.0], [9.0, 5.0]),
        wall([9.0, 5.0], [12.0, 5.0]),
        wall([0.0, 0.0], [0.0, 12.0]),
        wall([12.0, 0.0], [12.0, 12.0]),
        wall([0.0, 0.0], [12.0, 0.0]),
        wall([0.0, 12.0], [12.0, 12.0]),
    ];
    let mut level = PlanCells::new(Plan::new(&walls).unwrap(), [0, 2]).unwrap();
    for axes in [[0, 3], [3, 0], [1, 1]] {
        let made = PlanCells::new(Plan::new(&walls).unwrap(), axes);
        assert_eq!(made.err(), Some(PlanError::Axes { axes }), "axes {axes:?}");
    }
    let at = |x: f64, y: f64| {
        Reach::new(DVec3::new(x, 9.0, y), DVec3::new(x + 0.5, 10.0, y + 0.5)).within(0.1, 9.0)
    };
    // Movers before the wall, behind it, with the body through it, and outside of the plan.
    let movers = [at(1.0, 4.0), at(10.0, 5.3), at(3.0, 4.7), at(-90.0, 4.0)];
    let mut who = WhoSees::new();
    let mut seen = |level: &mut PlanCells| {
        who.look(level, &movers, &movers);
        [0, 1, 2, 3].map(|i| who.seen_by(i).collect::<Vec<_>>())
    };
    let closed = [vec![0, 2, 3], vec![1, 2, 3], vec![0, 1, 2, 3], vec![0, 1, 2, 3]];
    assert_eq!(seen(&mut level), closed, "pairs while the door is closed");
    level.set_opacity(1, Opacity::Clear).unwrap();
    assert!(seen(&mut level)[0].contains(&1), "the player behind the open door");
    level.set_opacity(1, Opacity::Opaque).unwrap();
    assert_eq!(seen(&mut level), closed, "pairs after the door has closed");
    assert!(level.set_opacity(7, Opacity::Clear).is_err(), "the opacity of a wall that is not there");
}
