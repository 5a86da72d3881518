// Draws occluders: depth alone.

@group(0) @binding(0) var<uniform> camera: Camera;

@vertex
fn vertex(@location(0) place: vec3<f32>) -> @builtin(position) vec4<f32> {
    return camera.clip_from_scene * vec4(place, 1.0);
}
