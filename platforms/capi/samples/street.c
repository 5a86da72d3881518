/* A street with a wall that hides boxes: culled by frustum and z-buffer. Prints and checks the counts. */
#include "visibility.h"
#include <stdio.h>
#include <stdlib.h>

/* Ends the program with the library's message if a call fails. */
static void check(vis_status status) {
    if (status != VIS_OK) {
        fprintf(stderr, "error %d: %s\n", status, vis_last_error());
        exit(1);
    }
}

static void expect(const char *what, size_t found, size_t expected) {
    printf("%-22s %4zu\n", what, found);
    if (found != expected) {
        fprintf(stderr, "%s: %zu, not %zu\n", what, found, expected);
        exit(1);
    }
}

static vis_box box_at(float x, float y, float z) {
    return (vis_box){{x, y, z}, {x + 1.0f, y + 0.5f, z + 0.4f}};
}

enum { NEAR_BOXES = 8, HIDDEN_BOXES = 100, SIDE_BOXES = 5, BEHIND_EYE = 40 };
enum { BOXES = NEAR_BOXES + HIDDEN_BOXES + SIDE_BOXES + BEHIND_EYE };

int main(void) {
    if (vis_abi_version() != VIS_ABI_VERSION) {
        fprintf(stderr, "header and library differ in version\n");
        return 1;
    }
    /* x runs down the street, y to the left, z upwards; metres. */
    vis_object_desc boxes[BOXES];
    size_t n = 0;
    for (int i = 0; i < NEAR_BOXES; i++)
        boxes[n++] = vis_object_default(box_at(10.0f, -4.0f + (float)i, 0.0f));
    for (int i = 0; i < HIDDEN_BOXES; i++)
        boxes[n++] = vis_object_default(box_at(30.0f, -4.5f + (float)(i % 10), 0.5f * (float)(i / 10)));
    for (int i = 0; i < SIDE_BOXES; i++)
        boxes[n++] = vis_object_default(box_at(30.0f, 12.0f + 2.0f * (float)i, 0.0f));
    for (int i = 0; i < BEHIND_EYE; i++)
        boxes[n++] = vis_object_default(box_at(-20.0f, (float)i, 0.0f));

    vis_scene *scene = NULL;
    uint64_t ids[BOXES], wall, mesh;
    check(vis_scene_create(&scene));
    check(vis_scene_insert_batch(scene, boxes, n, ids));

    /* The wall hides what is behind: an occluder with the mesh of a box. */
    vis_object_desc wall_desc = vis_object_default((vis_box){{20.0f, -6.0f, 0.0f}, {20.5f, 6.0f, 8.0f}});
    wall_desc.flags = VIS_OBJECT_OCCLUDER;
    check(vis_scene_insert(scene, &wall_desc, &wall));
    check(vis_scene_add_box_mesh(scene, &wall_desc.bounds, &mesh));
    check(vis_scene_set_mesh(scene, wall, mesh, NULL));
    check(vis_scene_rebuild(scene));

    vis_pipeline *pipeline = NULL;
    check(vis_pipeline_create(&pipeline));
    check(vis_pipeline_add_frustum(pipeline));
    check(vis_pipeline_add_z_buffer(pipeline, 0, 0));
    vis_view *view = NULL;
    check(vis_view_create(&view));
    vis_visible *visible = NULL;
    check(vis_visible_create(true, &visible));

    /* Each frame: the engine's own matrix, here 16:9 and 57 degrees from 1.7 m above the street, with
       reversed depth and no far plane. Columns, one line each. */
    const float fy = 1.8305f, fx = fy * 9.0f / 16.0f, eye = 1.7f, near_plane = 0.1f;
    const float matrix[16] = {
        0.0f, 0.0f,      0.0f,       1.0f, /* x: ahead */
        -fx,  0.0f,      0.0f,       0.0f, /* y: left */
        0.0f, fy,        0.0f,       0.0f, /* z: up */
        0.0f, -fy * eye, near_plane, 0.0f,
    };
    vis_stats sum, frustum;
    check(vis_view_set_matrix(view, matrix, VIS_DEPTH_REVERSED_INFINITE, NULL));
    check(vis_pipeline_cull(pipeline, scene, view, visible, &sum));
    check(vis_pipeline_stage_stats(pipeline, 0, &frustum));

    size_t count, limit, words;
    check(vis_scene_count(scene, &count));
    expect("objects", count, BOXES + 1);
    expect("in the frustum", frustum.visible, 1 + NEAR_BOXES + HIDDEN_BOXES + SIDE_BOXES);
    expect("visible", sum.visible, 1 + NEAR_BOXES + SIDE_BOXES);

    /* What to draw: by ascending index, or as bits. */
    uint32_t draw[BOXES + 1], bits[(BOXES + 1 + 31) / 32];
    check(vis_visible_sort_by_index(visible, scene));
    check(vis_visible_indices(visible, scene, draw, BOXES + 1, &count));
    expect("to draw", count, 1 + NEAR_BOXES + SIDE_BOXES);
    check(vis_scene_index_limit(scene, &limit));
    check(vis_visible_write_bits(visible, scene, bits, (limit + 31) / 32, &words));
    size_t wrong = 0;
    for (size_t i = 0; i < count; i++)
        wrong += (i > 0 && draw[i - 1] >= draw[i]) || !(bits[draw[i] / 32] >> draw[i] % 32 & 1);
    expect("out of order or no bit", wrong, 0);

    /* The wall rises like a gate: bounds and mesh move together, and the boxes behind come into view. */
    const vis_box local = wall_desc.bounds;
    check(vis_scene_set_local_bounds(scene, wall, &local));
    const float up[16] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 50, 1};
    check(vis_scene_set_transforms_batch(scene, &wall, up, 1));
    check(vis_scene_maintain(scene, 100, NULL));
    check(vis_pipeline_cull(pipeline, scene, view, visible, &sum));
    expect("with the gate open", sum.visible, NEAR_BOXES + HIDDEN_BOXES + SIDE_BOXES);
    check(vis_visible_newly_visible(visible, NULL, 0, &count));
    expect("newly visible", count, HIDDEN_BOXES);

    /* Errors are codes with messages. */
    check(vis_scene_remove(scene, ids[0]));
    expect("unknown id", vis_scene_remove(scene, ids[0]) == VIS_ERROR_UNKNOWN_ID, 1);
    printf("message: %s\n", vis_last_error());

    vis_visible_destroy(visible);
    vis_view_destroy(view);
    vis_pipeline_destroy(pipeline);
    vis_scene_destroy(scene);
    return 0;
}
