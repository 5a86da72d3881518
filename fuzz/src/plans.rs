//! Arbitrary numbers as walls and eyes of a plan, and as discs and eyes among them. Visibility
//! must be symmetric, and the visible discs updated along a moving eye must equal those computed from
//! scratch.
use visibility_2d::cdt::{Plan, PlanView, RegionVisibility, Visibility, Wall};
use visibility_2d::discs::{Disc, DiscView, DiscZone, Discs, KineticZone};

/// Maximum number of numbers read. More would only take time.
const MOST_NUMBERS: usize = 400;

/// Reads numbers. Some are multiples of 1/8 from -16 to 15.75, so that many coincide; others are eight bytes
/// of arbitrary bits.
fn numbers(mut bytes: &[u8]) -> Vec<f64> {
    let mut numbers = Vec::new();
    while let (Some((&first, rest)), true) = (bytes.split_first(), numbers.len() < MOST_NUMBERS) {
        bytes = rest;
        match (first, bytes.split_first_chunk()) {
            (255, Some((&bits, rest))) => {
                bytes = rest;
                numbers.push(f64::from_le_bytes(bits));
            }
            _ => numbers.push((f64::from(first) - 128.0) / 8.0),
        }
    }
    numbers
}

/// Runs the target on some bytes. Returns whether they made a plan or discs.
pub fn run(bytes: &[u8]) -> bool {
    let Some((&which, bytes)) = bytes.split_first() else { return false };
    let numbers = numbers(bytes);
    let Some((eyes, rest)) = numbers.split_at_checked(8) else { return false };
    let eyes: Vec<[f64; 2]> = eyes.chunks_exact(2).map(|eye| [eye[0], eye[1]]).collect();
    if which % 2 == 0 { walls(&eyes, rest) } else { discs(&eyes, rest) }
}

/// Makes a plan of walls, four numbers each, and looks from the eyes. Returns whether the walls are accepted.
fn walls(eyes: &[[f64; 2]], numbers: &[f64]) -> bool {
    let walls: Vec<Wall> =
        numbers.chunks_exact(4).map(|wall| Wall::new([wall[0], wall[1]], [wall[2], wall[3]])).collect();
    let Ok(plan) = Plan::new(&walls) else { return false };
    let (mut answer, mut region) = (Visibility::new(), RegionVisibility::new());
    // Corners on a wall, and so the area, are rounded in proportion to the length of the wall.
    let reach = numbers.iter().chain(eyes.as_flattened()).fold(1.0, |reach: f64, x| reach.max(x.abs()));
    let least = -1e-12 * reach * reach;
    for &eye in eyes {
        let is_seen = plan.look(&PlanView::new(eye), &mut answer).is_ok();
        assert!(!is_seen || answer.area() >= least, "the visible area from {eye:?} is {}", answer.area());
        for &other in eyes {
            assert_eq!(plan.sees(eye, other).ok(), plan.sees(other, eye).ok(), "{eye:?} {other:?}");
        }
    }
    let _ = plan.look_from_region(&eyes[..3], &mut region);
    true
}

/// Makes discs, three numbers each, and moves an eye along `eyes` among them. Returns whether the discs
/// are accepted.
fn discs(eyes: &[[f64; 2]], numbers: &[f64]) -> bool {
    let discs: Vec<Disc> =
        numbers.chunks_exact(3).map(|disc| Disc { center: [disc[0], disc[1]], radius: disc[2] }).collect();
    let Ok(made) = Discs::new(&discs) else { return false };
    let (mut zone, mut seen, mut kept) = (DiscZone::new(), Vec::new(), KineticZone::new(&made, 1.0));
    for pair in eyes.windows(2) {
        // Small steps between two eyes, so that the culler can reuse its state.
        for step in 0..16 {
            let eye = [0, 1].map(|k| pair[0][k] + (pair[1][k] - pair[0][k]) * f64::from(step) / 64.0);
            zone.look(&made, &DiscView::new(eye), &mut seen);
            seen.sort_unstable();
            let mut moved = kept.move_to(eye).to_vec();
            moved.sort_unstable();
            assert!(seen.iter().all(|disc| moved.binary_search(disc).is_ok()), "{eye:?} {seen:?} {moved:?}");
        }
    }
    true
}
