// Chooses what the first phase draws: the candidates that were visible in the last frame.

// One bit for each object: whether it is to be tested at all.
@group(0) @binding(0) var<storage, read> candidates: array<u32>;
// For each object, bit 0: visible by the last test; bit 1: drawn in the first phase of this frame.
@group(0) @binding(1) var<storage, read_write> states: array<u32>;
// Draw commands, one of 5 numbers for each object; number 1 is the count of instances.
@group(0) @binding(2) var<storage, read_write> first_commands: array<u32>;
@group(0) @binding(3) var<storage, read_write> second_commands: array<u32>;

@compute @workgroup_size(64)
fn choose(
    @builtin(global_invocation_id) id: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    // Rows of groups of 64.
    let object = id.x + id.y * groups.x * 64u;
    if object >= arrayLength(&states) {
        return;
    }
    let is_candidate = (candidates[object / 32u] >> (object % 32u) & 1u) != 0u;
    let drawn = is_candidate && (states[object] & 1u) != 0u;
    states[object] = select(0u, 2u, drawn);
    first_commands[object * 5u + 1u] = select(0u, 1u, drawn);
    second_commands[object * 5u + 1u] = 0u;
}
