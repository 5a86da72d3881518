// The depth pyramid: each number of a level is the farthest depth of four numbers of the level below. Depth is
// 1 at the near plane and 0 at infinity, so the farthest is the least.
//
// Levels lie one after the other. A level has half the width and height of the level below, rounded up, so
// that its number (x, y) stands for the pixels from (x, y) * 2^level up to (x + 1, y + 1) * 2^level.

struct Level {
    // Where this level and the level below it begin.
    start: u32,
    start_below: u32,
    size: vec2<u32>,
    size_below: vec2<u32>,
};

@group(0) @binding(0) var<uniform> level: Level;
@group(0) @binding(1) var<storage, read_write> pyramid: array<f32>;
@group(0) @binding(2) var depth: texture_depth_2d;

@compute @workgroup_size(8, 8)
fn copy(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= level.size) {
        return;
    }
    pyramid[level.start + id.y * level.size.x + id.x] = textureLoad(depth, id.xy, 0);
}

@compute @workgroup_size(8, 8)
fn halve(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= level.size) {
        return;
    }
    let least = id.xy * 2u;
    let most = min(least + 1u, level.size_below - 1u);
    let rows = level.start_below + vec2(least.y, most.y) * level.size_below.x;
    let upper = min(pyramid[rows.x + least.x], pyramid[rows.x + most.x]);
    let lower = min(pyramid[rows.y + least.x], pyramid[rows.y + most.x]);
    pyramid[level.start + id.y * level.size.x + id.x] = min(upper, lower);
}
