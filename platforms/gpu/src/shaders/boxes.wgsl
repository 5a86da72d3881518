// Draws the boxes of occlusion queries, half a pixel larger than they are: a box that covers no sample, but
// touches the pixel, passes.

@group(0) @binding(0) var<uniform> camera: Camera;

// The triangles of a cuboid. Bits 0 to 2 of a corner: whether it has the greater x, y and z.
const CORNERS = array<u32, 36>(
    0, 2, 1, 1, 2, 3, 4, 5, 6, 5, 7, 6,
    0, 1, 4, 1, 5, 4, 2, 6, 3, 3, 6, 7,
    0, 4, 2, 2, 4, 6, 1, 3, 5, 3, 7, 5,
);

@vertex
fn vertex(
    @builtin(vertex_index) index: u32,
    @location(0) low: vec3<f32>,
    @location(1) high: vec3<f32>,
) -> @builtin(position) vec4<f32> {
    var corners = CORNERS;
    let greater = (vec3(corners[index]) & vec3(1u, 2u, 4u)) != vec3(0u);
    let place = select(low, high, greater);
    // Both the displacement and w are linear on a face, so every point of it moves outwards by half a pixel.
    let w = (camera.clip_from_scene * vec4(place, 1.0)).w;
    let outward = select(vec3(-1.0), vec3(1.0), greater);
    var position = camera.clip_from_scene * vec4(place + outward * (camera.half_pixel * w), 1.0);
    // What the displacement brings before the near plane is not to be clipped.
    position.z = min(position.z, position.w);
    return position;
}
