//! Arbitrary bytes as a scene with a viewcell, for one of all methods for viewcells. No method
//! may panic, and a conservative method must hide nothing that an exact ray from the viewcell sees.
use crate::Bytes;
use crate::oracle;
use visibility_core::geometry::Plane;
use visibility_core::glam::DVec3;
use visibility_core::pvs::Viewcell;
use visibility_examples::region::methods::{self, METHODS};
use visibility_examples::region::{trial, world};
use visibility_testing::Random;

/// Reads the coordinates of a point. `None` at the end of the bytes.
fn point(bytes: &mut Bytes<'_>) -> Option<DVec3> {
    bytes.numbers().map(|numbers| DVec3::from_array(numbers.map(f64::from)))
}

/// Reads a viewcell: mostly a box with sides below 8 m, otherwise any two corners, with up to three planes.
fn viewcell(bytes: &mut Bytes<'_>) -> Option<Viewcell> {
    let (kind, min, other) = (bytes.byte()?, point(bytes)?, point(bytes)?);
    let max = if kind >= 16 { min + other.abs() } else { other };
    let mut cell = Viewcell::from_box(min, max);
    for _ in 0..kind % 4 {
        cell.planes.push(Plane::through(point(bytes)?, point(bytes)?));
    }
    Some(cell)
}

/// Runs the target on some bytes. Returns whether a method has found what the viewcell sees.
pub fn run(bytes: &[u8]) -> bool {
    let mut bytes = Bytes::new(bytes);
    let (Some(method), Some(cell)) = (bytes.byte(), viewcell(&mut bytes)) else { return false };
    let world = world(bytes.scene());
    let name = METHODS[usize::from(method) % METHODS.len()].name;
    let Ok(mut made) = methods::parse(name, &world) else { return false };
    let trial = trial::run(name, made[0].1.as_mut(), &world.scene, &cell);
    if !trial.accuracy.never_hides() {
        return true;
    }
    for index in
        (0..world.source.objects.len()).filter(|&i| trial.reported.binary_search(&(i as u32)).is_err())
    {
        let sight = oracle::sight_from_cell(&world, &cell, index, &mut Random(1), &mut 0);
        assert_eq!(sight, None, "{name} hides object {index} from {cell:?}");
    }
    true
}
