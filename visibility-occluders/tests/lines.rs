//! Tests of the occluders of random levels against lines, in whole numbers: a line passes through a polygon
//! of the level if and only if it passes through a triangle that the polygon was made of.

use visibility_core::glam::Vec3;
use visibility_occluders::{LevelOccluders, LevelSettings, LevelTriangle, OccluderPolygon};
use visibility_testing::Random;

type Point = [i128; 3];

fn minus(a: Point, b: Point) -> Point {
    [0, 1, 2].map(|i| a[i] - b[i])
}

fn cross(a: Point, b: Point) -> Point {
    [(1, 2), (2, 0), (0, 1)].map(|(i, j)| a[i] * b[j] - a[j] * b[i])
}

fn dot(a: Point, b: Point) -> i128 {
    (0..3).map(|i| a[i] * b[i]).sum()
}

fn whole(p: Vec3) -> Point {
    p.to_array().map(|x| x as i128)
}

/// A line through two points, with two directions across it.
struct Line {
    from: Point,
    along: Point,
    across: [Point; 2],
}

impl Line {
    fn new(from: Point, to: Point) -> Option<Self> {
        let along = minus(to, from);
        let axis = (0..3).min_by_key(|&i| along[i].abs())?;
        let mut unit = [0; 3];
        unit[axis] = 1;
        let first = cross(along, unit);
        (first != [0; 3]).then(|| Self { from, along, across: [first, cross(along, first)] })
    }

    /// Returns the point's two coordinates across the line, in a view along the line, which is the origin.
    fn image(&self, p: Point) -> [i128; 2] {
        self.across.map(|axis| dot(axis, minus(p, self.from)))
    }

    /// Returns how often closed loops wind round the line. `None` if the line meets an edge.
    fn winding(&self, edges: impl Iterator<Item = [Point; 2]>) -> Option<i32> {
        let mut winding = 0;
        for edge in edges {
            let [[ax, ay], [bx, by]] = edge.map(|p| self.image(p));
            let turn = ax * by - ay * bx;
            let reaches = ax.min(bx) <= 0 && ax.max(bx) >= 0 && ay.min(by) <= 0 && ay.max(by) >= 0;
            if turn == 0 && reaches {
                return None;
            }
            winding += i32::from(ay <= 0 && by > 0 && turn > 0) - i32::from(by <= 0 && ay > 0 && turn < 0);
        }
        Some(winding)
    }
}

/// Returns the triangles of a wall: rectangles between whole multiples of 8 in a plane across an axis or
/// slanted, in rows of random lengths, so that corners end on the sides of neighbours. Some walls are bumpy,
/// with corners that neighbours still share.
fn wall(random: &mut Random, triangles: &mut Vec<LevelTriangle>) {
    let (axis, slant) = (random.below(3), random.between(-1, 1) as f32);
    let place = 8.0 * random.between(-8, 8) as f32;
    let two_sided = random.one_in(2);
    let facing = random.one_in(2);
    let bumps = [0, 0, 1, 3][random.below(4)];
    let at = |u: i32, v: i32| {
        let bump = ((5 * u + 3 * v + u * v * v).rem_euclid(2 * bumps + 1) - bumps) as f32;
        let [u, v] = [8 * u, 8 * v].map(|x| x as f32);
        let mut p = [0.0; 3];
        (p[axis], p[(axis + 1) % 3], p[(axis + 2) % 3]) = (place + slant * u + bump, u, v);
        Vec3::from_array(p)
    };
    for row in -4..4 {
        let mut u = -6;
        while u < 6 {
            let end = u + random.between(1, 4);
            // Some corners are moved a little off the row, which leaves gaps and overlaps.
            let low =
                if random.one_in(8) { at(u, row) + Vec3::from_array([0.0, 1.0, 1.0]) } else { at(u, row) };
            let [b, c, d] = [at(end, row), at(end, row + 1), at(u, row + 1)];
            if !random.one_in(6) {
                let turned = two_sided && random.one_in(3);
                for [p, q, r] in [[low, b, c], [low, c, d]] {
                    let corners = if facing == turned { [p, q, r] } else { [p, r, q] };
                    triangles.push(LevelTriangle { corners, two_sided });
                }
            }
            u = end;
        }
    }
}

/// Returns the winding number of each triangle about a line: 1, -1 or 0. `None` if the line meets an edge.
fn hits(line: &Line, triangles: &[LevelTriangle]) -> Option<Vec<i32>> {
    let of = |t: &LevelTriangle| {
        let [a, b, c] = t.corners.map(whole);
        line.winding([[a, b], [b, c], [c, a]].into_iter())
    };
    triangles.iter().map(of).collect()
}

/// Tests whether all corners of a triangle are in the layer that holds a polygon's faces, its slab.
fn is_in_slab(polygon: &OccluderPolygon, triangle: &LevelTriangle) -> bool {
    triangle.corners.iter().all(|p| {
        let along = polygon.normal.dot(p.as_dvec3());
        polygon.extent[0] <= along && along <= polygon.extent[1]
    })
}

/// Returns the sign that a polygon's winding number, as [`Line::winding`] counts, must have about a line: 1
/// if the line certainly comes from the back of all the polygon's faces, -1 if from their front. 0 for other
/// lines.
fn side(polygon: &OccluderPolygon, line: &Line) -> i32 {
    let along = Vec3::from_array(line.along.map(|x| x as f32)).as_dvec3().normalize();
    let sine = (1.0 - polygon.min_cosine * polygon.min_cosine).max(0.0).sqrt();
    let facing = along.dot(polygon.normal);
    if facing.abs() > sine + 1e-6 { facing.signum() as i32 } else { 0 }
}

/// Compares random lines, half of them aimed near corners, in levels of random walls. Returns the number of
/// lines that hit a triangle, and of those that go through a polygon that is not flat.
fn trial(seed: u64, levels: usize) -> [usize; 2] {
    let mut random = Random(seed);
    let (mut count, mut bent) = (0, 0);
    for number in 0..levels {
        let mut triangles = Vec::new();
        (0..random.between(1, 4)).for_each(|_| wall(&mut random, &mut triangles));
        let bulge = [0.0, 0.03, 0.2][random.below(3)];
        let settings = LevelSettings::default().with_kept_area(1.0).with_bulge(bulge);
        let settings = settings.with_max_cluster_edges(random.below(60));
        let level = LevelOccluders::new(&triangles, settings).unwrap();
        let vertices: Vec<Point> = level.vertices().iter().map(|&p| whole(p)).collect();
        for _ in 0..60 {
            let from = [(); 3].map(|()| random.between(-150, 150).into());
            let mut to = [(); 3].map(|()| random.between(-60, 60).into());
            if random.one_in(2) && !triangles.is_empty() {
                let corner = whole(random.pick(&triangles).corners[0]);
                to = corner.map(|x| x + i128::from(random.between(-3, 3)));
            }
            let Some(line) = Line::new(from, to) else { continue };
            let Some(hits) = hits(&line, &triangles) else { continue };
            let mut covered = 0;
            for polygon in level.polygons() {
                let edges = &level.edges()[polygon.edges[0] as usize..polygon.edges[1] as usize];
                let winding = line.winding(edges.iter().map(|edge| edge.map(|v| vertices[v as usize])));
                let Some(winding) = winding else { continue };
                let of_polygon = triangles.iter().zip(&hits).filter(|(t, _)| is_in_slab(polygon, t));
                // A one-sided polygon may occlude only where a triangle shows its front.
                let like =
                    of_polygon.filter(|(_, hit)| polygon.two_sided || hit.signum() == winding.signum());
                let like: i32 = like.map(|(_, hit)| hit.abs()).sum();
                assert!(winding.abs() <= like, "level {number}: {winding} of {polygon:?}, {like} triangles");
                let side = side(polygon, &line);
                assert!(winding * side >= 0, "level {number}: {winding} of {polygon:?} from side {side}");
                bent += usize::from(winding != 0 && polygon.extent[1] - polygon.extent[0] > 0.1);
                covered += winding.abs();
            }
            // Triangles with the same corners become one polygon, so they are counted once.
            let mut distinct: Vec<[Point; 3]> = Vec::new();
            for (t, _) in triangles.iter().zip(&hits).filter(|(_, hit)| **hit != 0) {
                let mut corners = t.corners.map(whole);
                corners.sort_unstable();
                distinct.push(corners);
            }
            distinct.sort_unstable();
            distinct.dedup();
            let all = distinct.len() as i32;
            // A line may pass through a polygon that is not flat once from the front and once from the back.
            let missed = all - covered;
            let is_right = missed == 0 || bulge > 0.0 && missed > 0 && missed % 2 == 0;
            assert!(is_right, "level {number}: {covered} of {all} triangles along {:?}", line.along);
            count += usize::from(all > 0);
        }
    }
    [count, bent]
}

#[test]
fn lines_go_through_polygons_where_they_go_through_triangles() {
    let [count, bent] = trial(1, 300);
    assert!(count > 5_000, "only {count} lines hit something");
    assert!(bent > 1_000, "only {bent} lines go through a polygon that is not flat");
}

#[test]
#[ignore = "takes a minute"]
fn lines_go_through_polygons_where_they_go_through_triangles_long() {
    let [count, bent] = trial(2, 60_000);
    assert!(count > 1_000_000, "only {count} lines hit something");
    assert!(bent > 200_000, "only {bent} lines go through a polygon that is not flat");
}
