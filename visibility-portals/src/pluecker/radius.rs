//! Bound on the distance of a line from an origin, by the segment or polygon that the line passes.

/// Returns two lengths for `distances`, which were computed in `f64` from differences of coordinates. The
/// first is an upper bound on all exact distances. The second is a unit of length: the least power of two,
/// from 1 up, that is not below the first. If moments are measured in this unit, the coefficients of a line's
/// direction and of its moment in a linear program have similar sizes. NaN is ignored; an infinite distance
/// makes both results infinite.
pub(super) fn radius_of(distances: impl Iterator<Item = f64>) -> (f64, f64) {
    // With the unit round-off `u` = 2^-53, a difference is rounded by `u` of itself, three squares and two
    // sums by `3u`, a root by `u`; half of the error of the squares counts. That is less than `4u` of the
    // distance; `8u` are added.
    let radius = distances.fold(0.0, f64::max) * (1.0 + 4.0 * f64::EPSILON) + f64::MIN_POSITIVE;
    let mut unit = 1.0;
    while unit < radius {
        unit *= 2.0;
    }
    (radius, unit)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::integer_vectors::Random;

    #[test]
    fn a_radius_is_never_less_than_the_distance() {
        let mut random = Random(2);
        for _ in 0..20_000 {
            // Multiples of 4 are exact in f64 at this size, and so is every distance.
            let p = random.vector(1 << 52).times(4);
            let distance = p.to_f64().length();
            let (radius, unit) = radius_of([1.0, distance].into_iter());
            if distance < (1u64 << 53) as f64 {
                continue;
            }
            let exact = radius as i128;
            assert!(exact * exact >= p.dot(p), "{p:?}: {radius}");
            assert!(
                radius < distance * (1.0 + 1e-14) && unit >= radius && unit < 2.0 * radius,
                "{p:?}: the radius {radius} exceeds {distance} by a rounding, below the unit {unit}"
            );
        }
        assert_eq!(
            radius_of([f64::INFINITY].into_iter()),
            (f64::INFINITY, f64::INFINITY),
            "an infinite point has an infinite radius"
        );
    }
}
