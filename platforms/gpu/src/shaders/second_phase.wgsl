// Tests the boxes of all candidates against the depth pyramid of the first phase, and draws in the second
// phase those that are visible and not yet drawn.

@group(0) @binding(0) var<uniform> camera: Camera;
// Minimum and maximum corner of each object: 6 numbers, all finite. What is never culled has a box turned inside out.
@group(0) @binding(1) var<storage, read> boxes: array<f32>;
@group(0) @binding(2) var<storage, read> candidates: array<u32>;
@group(0) @binding(3) var<storage, read_write> states: array<u32>;
@group(0) @binding(4) var<storage, read_write> second_commands: array<u32>;
@group(0) @binding(5) var<storage, read> pyramid: array<f32>;

// Bound on the difference between a clip coordinate here and one of the vertices drawn, relative to the sum of the
// magnitudes of its four products. The matrix is the same. Each side rounds a product once and a sum at most three
// times, so 8 * 2^-24 for both; this is twice as much.
const ROUNDING = 0x1p-20;
// Allowance for the card's interpolation of depth over a triangle, relative to the depth. No standard bounds its
// error; Mesa's software rasterizer needs none of it.
const INTERPOLATION = 0x1p-14;
// Greatest number of columns and rows of a level that are looked at, less one.
const MOST = 3u;

// Returns whether no pixel can show anything of a box.
fn is_hidden(low: vec3<f32>, high: vec3<f32>) -> bool {
    if any(low > high) {
        return false;
    }
    let rows = transpose(camera.clip_from_scene);
    let extent = vec4(max(abs(low), abs(high)), 1.0);
    let error = ROUNDING * (extent * mat4x4(abs(rows[0]), abs(rows[1]), abs(rows[2]), abs(rows[3])));
    var least = vec2(1e30);
    var most = vec2(-1e30);
    var nearest = 0.0;
    for (var corner = 0u; corner < 8u; corner++) {
        let greater = (vec3(corner) & vec3(1u, 2u, 4u)) != vec3(0u);
        let position = camera.clip_from_scene * vec4(select(low, high, greater), 1.0);
        let w = position.w - error.w;
        if w <= 0.0 || position.z + error.z >= w {
            return false;
        }
        let below = position.xy - error.xy;
        let above = position.xy + error.xy;
        let w_most = position.w + error.w;
        least = min(least, below / select(vec2(w), vec2(w_most), below > vec2(0.0)));
        most = max(most, above / select(vec2(w_most), vec2(w), above > vec2(0.0)));
        nearest = max(nearest, (position.z + error.z) / w);
    }
    // In pixels, with y downwards. Whole pixels are looked at, whose samples are in their middles: cards move
    // vertices by less than half a pixel.
    let left_top = vec2(least.x * 0.5 + 0.5, 0.5 - most.y * 0.5) * camera.size;
    let right_bottom = vec2(most.x * 0.5 + 0.5, 0.5 - least.y * 0.5) * camera.size;
    if any(right_bottom < vec2(0.0)) || any(left_top >= camera.size) {
        return true;
    }
    var first = vec2<u32>(clamp(left_top, vec2(0.0), camera.size - 1.0));
    var last = vec2<u32>(clamp(right_bottom, vec2(0.0), camera.size - 1.0));
    var size = vec2<u32>(camera.size);
    var start = 0u;
    while any(last - first > vec2(MOST)) {
        start += size.x * size.y;
        size = (size + 1u) / 2u;
        first /= 2u;
        last /= 2u;
    }
    var farthest = 1.0;
    for (var y = first.y; y <= last.y; y++) {
        for (var x = first.x; x <= last.x; x++) {
            farthest = min(farthest, pyramid[start + y * size.x + x]);
        }
    }
    return nearest * (1.0 + INTERPOLATION) < farthest;
}

@compute @workgroup_size(64)
fn test(
    @builtin(global_invocation_id) id: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    // Rows of groups of 64.
    let object = id.x + id.y * groups.x * 64u;
    if object >= arrayLength(&states) || (candidates[object / 32u] >> (object % 32u) & 1u) == 0u {
        return;
    }
    let i = object * 6u;
    let low = vec3(boxes[i], boxes[i + 1u], boxes[i + 2u]);
    let high = vec3(boxes[i + 3u], boxes[i + 4u], boxes[i + 5u]);
    if is_hidden(low, high) {
        return;
    }
    let state = states[object];
    states[object] = state | 1u;
    if (state & 2u) == 0u {
        second_commands[object * 5u + 1u] = 1u;
    }
}
