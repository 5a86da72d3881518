// Draws objects: the picture, and for each pixel 1 + the index of the object that it shows.

@group(0) @binding(0) var<uniform> camera: Camera;
// A colour for each object: red in the lowest byte.
@group(0) @binding(1) var<storage, read> colors: array<u32>;

struct Vertex {
    // The same in all passes: a pixel of one pass has the depth that it has in another.
    @builtin(position) @invariant position: vec4<f32>,
    @location(0) @interpolate(flat) object: u32,
    @location(1) place: vec3<f32>,
};

@vertex
fn vertex(@location(0) place: vec3<f32>, @location(1) object: u32) -> Vertex {
    return Vertex(camera.clip_from_scene * vec4(place, 1.0), object, place);
}

struct Pixel {
    @location(0) item: u32,
    @location(1) color: vec4<f32>,
};

@fragment
fn fragment(at: Vertex) -> Pixel {
    let normal = normalize(cross(dpdx(at.place), dpdy(at.place)));
    let light = 0.45 + 0.55 * abs(dot(normal, normalize(vec3(0.35, 0.5, 0.8))));
    let color = unpack4x8unorm(colors[at.object]);
    return Pixel(at.object + 1u, vec4(color.rgb * light, 1.0));
}
