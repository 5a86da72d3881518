//! Tests of see-through and one-sided objects, by rays through all pixel centres.

use crate::common::pixels;
use std::collections::BTreeSet;
use visibility_core::glam::{DVec3, Vec3};
use visibility_core::{Aabb, Object, Pose, Scene, View, view::Window};
use visibility_measure::{Advisor, Comparison, DrawCost, DrawnObject, ItemBuffer, NONE};
use visibility_testing::Random;

/// Object for the rays: triangles, whether it is see-through, and whether it is one-sided.
struct Made {
    triangles: Vec<[Vec3; 3]>,
    see_through: bool,
    one_sided: bool,
}

/// Returns the distance at which a ray meets a triangle's plane, whether it meets the front, and the least
/// barycentric coordinate of the point.
fn meet(start: DVec3, direction: DVec3, t: &[Vec3; 3]) -> (f64, bool, f64) {
    let [a, b, c] = t.map(|p| p.as_dvec3());
    let normal = (b - a).cross(c - a);
    let distance = (a - start).dot(normal) / direction.dot(normal);
    let at = start + direction * distance;
    let weight = |p: DVec3, q: DVec3| (q - p).cross(at - p).dot(normal) / normal.length_squared();
    (distance, direction.dot(normal) < 0.0, weight(a, b).min(weight(b, c)).min(weight(c, a)))
}

#[test]
fn pixels_show_what_rays_meet() {
    let mut random = Random(40);
    let (width, height) = (40u32, 30u32);
    let mut buffer = ItemBuffer::new(width, height).unwrap();
    let (mut shown, mut through, mut backs) = (0, 0, 0);
    for round in 0..150 {
        let is_parallel = round % 3 == 0;
        let eye = random.vec3(-1.0, 1.0).as_dvec3();
        let pose = Pose::look_at(eye, eye + DVec3::X + random.direction() * 0.2, DVec3::Z);
        let (fov, aspect) = (1.2, f64::from(width) / f64::from(height));
        let view = if is_parallel {
            let (right, top) = (aspect * 2.5, 2.5);
            View::orthographic(pose, Window { left: -right, right, bottom: -top, top }, 0.5, 40.0).unwrap()
        } else {
            View::perspective(pose, fov, aspect, 0.5, f64::INFINITY).unwrap()
        };
        let made: Vec<Made> = (0..14)
            .map(|_| Made {
                triangles: (0..1 + random.below(3))
                    .map(|_| {
                        let at = eye.as_vec3() + Vec3::new(random.range(2.0, 12.0) as f32, 0.0, 0.0);
                        [(); 3].map(|()| at + random.vec3(-4.0, 4.0))
                    })
                    .collect(),
                see_through: random.one_in(2),
                one_sided: random.one_in(2),
            })
            .collect();
        let drawn = made.iter().zip(0..).map(|(made, key)| DrawnObject {
            see_through: made.see_through,
            one_sided: made.one_sided,
            ..DrawnObject::from((key, &made.triangles[..]))
        });
        let seen = buffer.draw(&view, DVec3::ZERO, drawn).unwrap();
        let mut counts = vec![0; made.len()];
        let mut triangles = vec![BTreeSet::new(); made.len()];
        let (mut covered, mut doubtful) = (0, false);
        for (column, row) in (0..width).flat_map(|column| (0..height).map(move |row| (column, row))) {
            let x = (f64::from(column) + 0.5) / f64::from(width) * 2.0 - 1.0;
            let y = 1.0 - (f64::from(row) + 0.5) / f64::from(height) * 2.0;
            let (start, direction) = if is_parallel {
                (pose.eye + pose.right * (x * aspect * 2.5) + pose.up * (y * 2.5), pose.forward)
            } else {
                let tan = (fov * 0.5f64).tan();
                (pose.eye, pose.forward + pose.right * (x * tan * aspect) + pose.up * (y * tan))
            };
            let mut hits = Vec::new();
            for (object, of) in made.iter().enumerate() {
                for (index, triangle) in of.triangles.iter().enumerate() {
                    let (distance, is_front, inside) = meet(start, direction, triangle);
                    doubtful |= inside.abs() < 1e-6 || (distance - 0.5).abs() < 1e-6;
                    if inside > 0.0 && distance > 0.5 {
                        backs += usize::from(of.one_sided && !is_front);
                        if is_front || !of.one_sided {
                            hits.push((distance, object, index));
                        }
                    }
                }
            }
            let opaque = hits.iter().filter(|hit| !made[hit.1].see_through);
            let nearest = opaque.map(|hit| hit.0).fold(f64::INFINITY, f64::min);
            let mut here = BTreeSet::new();
            for &(distance, object, index) in &hits {
                if distance <= nearest {
                    here.insert(object);
                    triangles[object].insert(index);
                }
            }
            through += usize::from(here.len() > 1);
            covered += u32::from(!here.is_empty());
            here.into_iter().for_each(|object| counts[object] += 1);
        }
        if doubtful {
            continue;
        }
        for (object, pixels) in seen.objects().iter().zip(&counts) {
            assert_eq!((object.pixels, object.tied_pixels), (*pixels, 0), "{round}: object {}", object.key);
            assert_eq!(object.visible_triangles as usize, triangles[object.key as usize].len(), "{round}");
            shown += usize::from(object.is_visible());
        }
        assert_eq!(seen.covered_pixels(), covered, "{round}");
        assert_eq!(
            seen.visible_objects() as usize,
            counts.iter().filter(|&&pixels| pixels > 0).count(),
            "{round}: objects visible"
        );
    }
    assert!(shown > 500 && through > 5000 && backs > 5000, "{shown} {through} {backs}");
}

/// Returns a rectangle over the pixels from `min` to `max` at a depth.
fn rectangle(min: [f32; 2], max: [f32; 2], depth: f32) -> [[Vec3; 3]; 2] {
    let [a, b, c, d] =
        [[min[0], min[1]], [max[0], min[1]], max, [min[0], max[1]]].map(|[x, y]| Vec3::new(x, y, depth));
    [[a, b, c], [a, c, d]]
}

/// A pane in front of walls that tie with each other shows, whichever of these the image has: hiding it is
/// charged. Only where one of the tied walls is as near as the pane, rounding decides.
#[test]
fn a_pane_before_walls_that_tie_is_charged() {
    let view = pixels(8.0, 8.0);
    let mut buffer = ItemBuffer::new(8, 8).unwrap();
    let wall = |shift: f32, depth| rectangle([-9.0 - shift, -9.0], [17.3, 17.1 + shift], depth);
    // The diagonal of the last wall runs through pixel centres, so its two triangles tie there.
    let walls = [vec![wall(0.0, 0.5), wall(0.2, 0.5)], vec![rectangle([0.0, 0.0], [8.0, 8.0], 0.5)]];
    for walls in &walls {
        for (depth, charged) in [(0.4, true), (0.5, false)] {
            let pane = rectangle([-9.2, -9.0], [17.3, 17.4], depth);
            let opaque = (1..).zip(walls).map(|(key, wall)| DrawnObject::from((key, &wall[..])));
            let pane = DrawnObject { see_through: true, ..DrawnObject::from((9, &pane[..])) };
            let seen = buffer.draw(&view, DVec3::ZERO, opaque.chain([pane])).unwrap();
            let pane = seen.objects().last().unwrap();
            let expected = if charged { (64, 0) } else { (0, 64) };
            assert_eq!((pane.pixels, pane.tied_pixels), expected, "{} walls, pane at {depth}", walls.len());
            let mut comparison = Comparison::default();
            seen.compare(|_, key| key != 9, &mut comparison);
            assert_eq!(comparison.is_exact(), !charged, "{} walls, pane at {depth}", walls.len());
        }
    }
}

/// Pixel centres on an edge of a wall before a pane: the wall may cover them, though the picture shows the
/// wall behind the pane. The wall covers the columns to one of its two sides, and ties at the other.
#[test]
fn a_pane_ties_where_a_nearer_wall_may_cover_it() {
    let mut buffer = ItemBuffer::new(8, 8).unwrap();
    let far = rectangle([-9.0, -9.0], [17.3, 17.1], 0.5);
    let near = rectangle([2.5, -9.0], [4.5, 17.1], 0.3);
    let pane = rectangle([-9.2, -9.0], [17.3, 17.4], 0.4);
    let opaque = [(0, &far[..]), (1, &near[..])].map(DrawnObject::from);
    let pane = DrawnObject { see_through: true, ..DrawnObject::from((2, &pane[..])) };
    let seen = buffer.draw(&pixels(8.0, 8.0), DVec3::ZERO, opaque.into_iter().chain([pane])).unwrap();
    let pane = seen.objects()[2];
    assert_eq!((pane.pixels, pane.tied_pixels), (5 * 8, 8), "columns beside the wall, and on its edge");
}

#[test]
fn what_ties_with_a_pane_is_not_charged() {
    let view = pixels(8.0, 8.0);
    let mut buffer = ItemBuffer::new(8, 8).unwrap();
    let wall = rectangle([-9.0, -9.0], [17.3, 17.1], 0.5);
    let decal = |depth| rectangle([-9.2, -9.0], [17.3, 17.4], depth);
    let draw = |buffer: &mut ItemBuffer, pane: &[[Vec3; 3]]| {
        let glass = DrawnObject { see_through: true, ..DrawnObject::from((1, pane)) };
        let seen = buffer.draw(&view, DVec3::ZERO, [DrawnObject::from((0, &wall[..])), glass]).unwrap();
        let mut hidden = Comparison::default();
        seen.compare(|_, key| key == 0, &mut hidden);
        (seen.objects().to_vec(), hidden)
    };
    // In front of the wall, the decal shows once in each pixel. In the wall's plane, only rounding decides.
    // Behind the wall, it is hidden.
    let (objects, hidden) = draw(&mut buffer, &decal(0.4));
    assert_eq!(
        (objects[1].pixels, objects[1].tied_pixels, objects[0].pixels),
        (64, 0, 64),
        "pixels of a pane before the wall, and of the wall"
    );
    assert_eq!(
        (hidden.false_hidden_keys, hidden.wrong_pixels),
        (vec![1], 64),
        "objects and pixels missing without the pane"
    );
    assert_eq!(
        [buffer.see_through_item(3, 3), buffer.items()[3 * 8 + 3]].map(|item| item / 2),
        [1, 0],
        "objects of the pane and of the wall at a pixel"
    );
    let (objects, hidden) = draw(&mut buffer, &decal(0.5));
    assert_eq!((objects[1].pixels, objects[1].tied_pixels), (0, 64), "pixels of a pane in the wall's plane");
    assert!(
        objects[1].is_visible() && hidden.is_exact() && buffer.see_through_item(3, 3) == NONE,
        "a pane in the wall's plane is visible, and hiding it is no error"
    );
    let (objects, _) = draw(&mut buffer, &decal(0.6));
    assert!(!objects[1].is_visible() && objects[0].pixels == 64, "a pane behind the wall");
    // Two panes of one object, one behind the other, count once per pixel. An edge through pixel centres does
    // not certainly cover them.
    let (objects, _) = draw(&mut buffer, &[decal(0.3), decal(0.4)].concat());
    assert_eq!(
        (objects[1].pixels, objects[1].visible_triangles),
        (64, 4),
        "pixels of two panes of one object"
    );
    let (objects, _) = draw(&mut buffer, &rectangle([2.5, 2.25], [6.25, 6.25], 0.4));
    assert_eq!(
        (objects[1].pixels, objects[1].tied_pixels),
        (12, 4),
        "pixels of a pane whose edges meet centres"
    );
}

#[test]
fn the_advisor_asks_the_scene_how_objects_are_drawn() {
    let mut scene = Scene::new();
    let sides = |x: f32| {
        let [a, b, c, d] =
            [(-2.0, -2.0), (-2.0, 2.0), (2.0, 2.0), (2.0, -2.0)].map(|(y, z)| Vec3::new(x, y, z));
        [[a, b, c], [a, c, d]]
    };
    // Seen from the origin along x, some rectangles show their front, and the reversed ones their back.
    for (x, reversed, see_through) in
        [(3.0, true, false), (4.0, false, true), (5.0, false, false), (6.0, false, false)]
    {
        let triangles = sides(x).map(|[a, b, c]| if reversed { [a, c, b] } else { [a, b, c] });
        let bounds = Aabb::from_points(triangles.into_iter().flatten());
        let id = scene.insert(Object { see_through, one_sided: true, ..Object::new(bounds) });
        scene.set_triangles(id, triangles).unwrap();
    }
    let view = |to: DVec3| {
        let pose = Pose::look_at(DVec3::ZERO, to, DVec3::Z);
        [View::perspective(pose, 0.5, 1.5, 0.1, f64::INFINITY).unwrap()]
    };
    let visible = |scene: &Scene| {
        Advisor::new(scene, &view(DVec3::X), DrawCost::default()).unwrap().facts().visible_objects
    };
    // The eye sees either the first rectangle or all others from behind.
    let fronts = visible(&scene);
    scene.ids().collect::<Vec<_>>().into_iter().for_each(|id| scene.set_one_sided(id, false).unwrap());
    assert_eq!((fronts, visible(&scene)), (2.0, 1.0), "objects visible, one-sided and two-sided");
    // An object on none of the view's layers is not drawn, and covers nothing.
    scene.set_layers(scene.id_at(0).unwrap(), 0).unwrap();
    assert_eq!(visible(&scene), 2.0, "the pane and what is behind it");
}
