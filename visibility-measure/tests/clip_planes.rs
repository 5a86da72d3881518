//! Tests that clip planes of a view cut the drawn triangles.

use visibility_core::glam::{DVec3, Vec3};
use visibility_core::{Pose, View, geometry::Plane};
use visibility_measure::ItemBuffer;

/// The item buffer cuts triangles at a view's clip planes, also through the middle of a triangle.
#[test]
fn the_item_buffer_honours_clip_planes() {
    let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
    let view = View::perspective(pose, 1.0, 1.0, 0.1, f64::INFINITY).unwrap();
    let square = |x: f32| {
        let [a, b, c, d] =
            [(-9.0, -9.0), (9.0, -9.0), (9.0, 9.0), (-9.0, 9.0)].map(|(y, z)| Vec3::new(x, y, z));
        [[a, b, c], [a, c, d]]
    };
    let (near, far) = (square(4.0), square(8.0));
    let mut buffer = ItemBuffer::new(64, 64).unwrap();
    let mut pixels = |view: &View| {
        let sampled = buffer.draw(view, DVec3::ZERO, [(0, &near[..]), (1, &far[..])]).unwrap();
        let mut pixels = [0; 2];
        sampled.objects().iter().for_each(|object| pixels[object.key as usize] = object.pixels as usize);
        pixels
    };
    assert_eq!(pixels(&view), [4096, 0], "pixels of both squares");
    // Planes that keep: only what is beyond the near square; the left half (y > 0) of the near square; a
    // quarter of the near square; nothing.
    let beyond = Plane::through(DVec3::X * 6.0, DVec3::X);
    assert_eq!(
        pixels(&view.with_clip_planes(&[beyond]).unwrap()),
        [0, 4096],
        "pixels beyond a plane behind the near square"
    );
    let left = Plane::new(DVec3::Y, 0.0);
    assert_eq!(pixels(&view.with_clip_planes(&[left]).unwrap()), [2048, 0], "pixels of the left half");
    assert_eq!(
        pixels(&view.with_clip_planes(&[left, Plane::new(DVec3::Z, 0.0)]).unwrap()),
        [1024, 0],
        "pixels of a quarter"
    );
    assert_eq!(
        pixels(&view.with_clip_planes(&[beyond, beyond.flipped()]).unwrap()),
        [0, 0],
        "pixels between two planes that leave nothing"
    );
    // A slanted plane, x + y >= 6, leaves the near square where y >= 2 and the far square where y >= -2. The
    // image is 4.37 m wide at the near square's distance and twice that at the far square's. The near square
    // shows in 3 of 64 columns, the far square in 44 others.
    let slanted = Plane::through(DVec3::new(6.0, 0.0, 0.0), DVec3::new(1.0, 1.0, 0.0));
    assert_eq!(
        pixels(&view.with_clip_planes(&[slanted]).unwrap()),
        [3 * 64, 44 * 64],
        "pixels beyond a slanted plane"
    );
}
