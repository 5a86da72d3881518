//! What objects are placed by: their triangles, or, where the scene has none, all that their bounds contain.

use crate::overlap::triangle_meets_box;
use visibility_core::glam::DVec3;
use visibility_core::{ObjectId, OccluderMesh, Scene};

/// A part of an object, in scene coordinates.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Part {
    Triangle([DVec3; 3]),
    /// Everything in a box, between two corners.
    Solid(DVec3, DVec3),
}

/// The corners of a part.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Corners {
    points: [DVec3; 8],
    count: usize,
}

impl Corners {
    pub(crate) fn as_slice(&self) -> &[DVec3] {
        &self.points[..self.count]
    }
}

impl Part {
    pub(crate) fn corners(&self) -> Corners {
        let mut corners = Corners { points: [DVec3::ZERO; 8], count: 0 };
        match self {
            Self::Triangle(triangle) => {
                corners.points[..3].copy_from_slice(triangle);
                corners.count = 3;
            }
            Self::Solid(min, max) => {
                for (i, point) in corners.points.iter_mut().enumerate() {
                    let far = |axis: usize| if i >> axis & 1 != 0 { max[axis] } else { min[axis] };
                    *point = DVec3::new(far(0), far(1), far(2));
                }
                corners.count = 8;
            }
        }
        corners
    }

    /// One of its corners.
    pub(crate) fn corner(&self) -> DVec3 {
        match self {
            Self::Triangle([a, ..]) | Self::Solid(a, _) => *a,
        }
    }

    /// The same part in coordinates that grow with the old ones.
    pub(crate) fn map(&self, map: impl Fn(DVec3) -> DVec3) -> Self {
        match self {
            Self::Triangle(triangle) => Self::Triangle(triangle.map(map)),
            Self::Solid(min, max) => Self::Solid(map(*min), map(*max)),
        }
    }

    /// Calls `each` with the part itself, or with its surface.
    pub(crate) fn for_each_triangle(&self, mut each: impl FnMut(&[DVec3; 3])) {
        match self {
            Self::Triangle(triangle) => each(triangle),
            Self::Solid(..) => {
                let corners = self.corners().points;
                for triangle in OccluderMesh::CUBOID {
                    each(&triangle.map(|corner| corners[corner as usize]));
                }
            }
        }
    }

    /// Whether a cube lies inside of a solid, clear of its surface by far more than rounding. False for triangles.
    pub(crate) fn has_inside(&self, center: DVec3, half: f64) -> bool {
        match self {
            Self::Triangle(_) => false,
            Self::Solid(min, max) => {
                let reach = DVec3::splat(half * (1.0 + 1e-6)) + center.abs() * 1e-12;
                min.cmplt(center - reach).all() && max.cmpgt(center + reach).all()
            }
        }
    }

    /// Whether it meets a cube. True where rounding could tell otherwise.
    pub(crate) fn meets_box(&self, center: DVec3, half: f64) -> bool {
        match self {
            Self::Triangle(triangle) => triangle_meets_box(triangle, center, DVec3::splat(half)),
            Self::Solid(min, max) => {
                // Faces of the grid are rounded by a few times 2^-53 of its size, no more than 2^11 halves, and of `center`: so that nothing falls
                // between two of its cubes.
                let reach = DVec3::splat(half * (1.0 + 1e-12)) + center.abs() * 1e-12;
                min.cmple(center + reach).all() && max.cmpge(center - reach).all()
            }
        }
    }
}

/// Calls `each` for all that an object is placed by; for nothing if its bounds bound nothing.
pub(crate) fn for_each_part(scene: &Scene, id: ObjectId, each: &mut dyn FnMut(&Part)) {
    let triangles = scene.triangles(id).unwrap_or(&[]);
    let Ok(bounds) = scene.bounds(id) else { return };
    if !bounds.is_finite() {
        return;
    }
    // A triangle that cannot be placed may yet be drawn, somewhere within the bounds.
    if triangles.is_empty() || !triangles.iter().flatten().all(|p| p.is_finite()) {
        return each(&Part::Solid(bounds.min.as_dvec3(), bounds.max.as_dvec3()));
    }
    for triangle in triangles {
        each(&Part::Triangle(triangle.map(|p| p.as_dvec3())));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::{Grid, STEPS};
    use crate::whole::Random;
    use visibility_core::Aabb;
    use visibility_core::glam::Vec3;

    /// Walls as thin as a number in the faces between cells, which are rounded: one of the two cells holds them.
    #[test]
    fn nothing_falls_between_cells() {
        let mut random = Random(21);
        for round in 0..4000 {
            let size = random.direction().abs().as_vec3() * 100.0;
            // Half of them about the origin, where f32 has numbers between those of f64 elsewhere.
            let far = if round % 2 == 0 { Vec3::ZERO } else { random.direction().as_vec3() * 1e4 };
            let grid = Grid::around(&Aabb::new(far - size, far + size));
            let side: u32 = 1 << (random.whole(4) + 4);
            let count = i64::from(STEPS / side);
            let mut place =
                [(); 3].map(|()| (1 + random.whole(count).unsigned_abs() as u32 % (STEPS / side - 1)) * side);
            let axis = round % 3;
            if round % 4 == 0 {
                place[axis] = STEPS / 2;
            }
            let cube = |place: [u32; 3]| {
                let half = f64::from(side) * 0.5 * grid.step;
                (grid.corner(place) + DVec3::splat(half), half)
            };
            let mut below = place;
            below[axis] -= side;
            let ((a, half), (b, _)) = (cube(place), cube(below));
            let face = grid.corner(place)[axis] as f32;
            for x in [face.next_down(), face, face.next_up(), 0.0, face * 0.5] {
                if (f64::from(x) - (a[axis] - half)).abs() > half {
                    continue;
                }
                let at = |u: f64, v: f64| {
                    let mut point = a;
                    (point[axis], point[(axis + 1) % 3]) = (x.into(), point[(axis + 1) % 3] + u * half);
                    point[(axis + 2) % 3] += v * half;
                    point
                };
                let (low, high) = (at(-0.5, -0.5), at(0.5, 0.5));
                for part in [Part::Solid(low, high), Part::Triangle([low, high, at(-0.5, 0.5)])] {
                    assert!(part.meets_box(a, half) || part.meets_box(b, half), "{part:?} {a} {b} {half}");
                }
            }
        }
    }

    /// The same far from the origin, of cells so small beside that way that their own size does not bound how their faces are rounded. There f32
    /// has numbers so near to a face only where that is a round number itself: every 25 steps from the middle of the grid, which is 51/50 as wide
    /// as the scene, if that is of whole numbers.
    #[test]
    fn nothing_falls_between_cells_far_away() {
        let mut random = Random(22);
        let mut between = 0;
        for round in 0..20_000 {
            let (axis, sign) = (round % 3, if round % 2 == 0 { 1 } else { -1 });
            // Half the scene is 1024 times so large; cells have so many steps a side, and the wall is 25 times so many from the middle.
            let size = 1 + random.whole(8).abs();
            let side = 1 << random.whole(2).abs();
            let steps = side * random.whole(20 / side);
            // Just below a power of two, beyond which numbers are coarser: cells on the two sides are rounded differently.
            let wall = (1 << (22 + random.whole(2))) - 1 - random.whole(8).abs();
            let mut middle = random.vector(1 << 20);
            middle[axis] = (wall - 51 * size * steps) * sign;
            let ends = [-1024 * size, 1024 * size].map(|by| middle.map(|x| (x + by) as f32));
            let grid = Grid::around(&Aabb::from_arrays(ends[0], ends[1]));
            let [mut upper, mut lower] = [[STEPS / 2; 3]; 2];
            upper[axis] = (i64::from(STEPS / 2) + 25 * steps * sign) as u32;
            lower[axis] = upper[axis] - side as u32;
            let half = side as f64 * 0.5 * grid.step;
            let [a, b] = [upper, lower].map(|place| grid.corner(place) + DVec3::splat(half));
            let wall_at = [[-0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]].map(|[u, v]| {
                let mut point = a;
                point[axis] = (wall * sign) as f64;
                point[(axis + 1) % 3] += u * half;
                point[(axis + 2) % 3] += v * half;
                point
            });
            for part in [Part::Solid(wall_at[0], wall_at[1]), Part::Triangle(wall_at)] {
                assert!(part.meets_box(a, half) || part.meets_box(b, half), "{part:?} {a} {b} {half}");
            }
            // A margin in halves alone would be too little.
            let (x, reach) = (wall_at[0][axis], half * (1.0 + 1e-12));
            between += u32::from(x < a[axis] - reach && x > b[axis] + reach);
        }
        assert!(between > 100, "{between}");
    }
}
