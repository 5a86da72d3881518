/* Three rooms: portals from a .prt file, a baked set, doors, and the judge. */
#include "visibility.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

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

/* Room 0 opens by a door at x = 4 into room 1. Room 2, beside room 0, opens into room 1 too, by a door in the
   same plane: no straight line leads from room 0 into room 2. */
static const char PRT[] = "PRT1\n3\n2\n"
                          "4 0 1 (4 0 0) (4 1 0) (4 1 2) (4 0 2)\n"
                          "4 1 2 (4 7 0) (4 6 0) (4 6 2) (4 7 2)\n";

int main(void) {
    vis_graph *graph = NULL;
    check(vis_graph_read_prt((const uint8_t *)PRT, strlen(PRT), &graph));
    size_t cell_count, portal_count;
    check(vis_graph_counts(graph, &cell_count, &portal_count));
    expect("cells", cell_count, 3);

    /* Baked once, stored with the level, loaded when the level is. */
    vis_pvs *baked = NULL, *pvs = NULL;
    check(vis_graph_bake(graph, 0.0, &baked));
    size_t length;
    check(vis_pvs_write(baked, NULL, 0, &length));
    uint8_t *bytes = malloc(length);
    if (!bytes)
        return 1;
    check(vis_pvs_write(baked, bytes, length, &length));
    check(vis_pvs_read(bytes, length, &pvs));
    free(bytes);
    bool sees;
    check(vis_pvs_sees(pvs, 0, 1, &sees));
    expect("room 0 sees room 1", sees, 1);
    check(vis_pvs_sees(pvs, 0, 2, &sees));
    expect("room 0 sees room 2", sees, 0);

    const vis_volume rooms[3] = {
        {{0, 0, 0}, {4, 4, 3}, 0, 0}, {{4, 0, 0}, {8, 8, 3}, 0, 0}, {{0, 5, 0}, {4, 8, 3}, 0, 0}};
    vis_cells *cells = NULL;
    check(vis_cells_create(graph, rooms, 3, NULL, 0, 1e-6, &cells));
    check(vis_cells_set_pvs(cells, pvs));

    /* A table behind the first door, and a lamp in room 2; both in the frustum. */
    vis_scene *scene = NULL;
    uint64_t table, lamp;
    check(vis_scene_create(&scene));
    const vis_object_desc descs[2] = {vis_object_default((vis_box){{6, 0.2f, 0}, {7, 0.8f, 1}}),
                                      vis_object_default((vis_box){{1, 6, 0}, {2, 7, 1}})};
    check(vis_scene_insert(scene, &descs[0], &table));
    check(vis_scene_insert(scene, &descs[1], &lamp));

    vis_pipeline *pipeline = NULL;
    check(vis_pipeline_create(&pipeline));
    check(vis_pipeline_add_frustum(pipeline));
    check(vis_pipeline_add_portals(pipeline, cells));

    vis_view *view = NULL;
    vis_visible *visible = NULL;
    check(vis_view_create(&view));
    check(vis_visible_create(false, &visible));
    const vis_pose pose = {{1.0, 0.5, 1.5}, {4.0, 4.0, 1.0}, {0.0, 0.0, 1.0}};
    check(vis_view_set_perspective(view, &pose, 1.5, 1.5, 0.1, 100.0));

    size_t count;
    uint64_t ids[2];
    check(vis_pipeline_cull(pipeline, scene, view, visible, NULL));
    vis_stats frustum;
    check(vis_pipeline_stage_stats(pipeline, 0, &frustum));
    expect("in the frustum", frustum.visible, 2);
    check(vis_visible_ids(visible, scene, ids, 2, &count));
    expect("through the open door", count, 1);
    expect("the table", ids[0] == table, 1);
    check(vis_cells_set_open(cells, 0, false));
    check(vis_pipeline_cull(pipeline, scene, view, visible, NULL));
    check(vis_visible_count(visible, scene, &count));
    expect("through the shut door", count, 0);

    /* The same by the baked set alone: objects have the rooms as targets. */
    const uint64_t objects[2] = {table, lamp};
    const uint32_t targets[2] = {1, 2};
    vis_scene_pvs *scene_pvs = NULL;
    check(vis_scene_pvs_create(scene, pvs, rooms, 3, NULL, 0, objects, targets, 2, &scene_pvs));
    vis_pipeline *by_pvs = NULL;
    check(vis_pipeline_create(&by_pvs));
    check(vis_pipeline_add_pvs(by_pvs, scene_pvs));
    check(vis_pipeline_cull(by_pvs, scene, view, visible, NULL));
    check(vis_visible_count(visible, scene, &count));
    expect("by the baked set", count, 1);

    /* What can throw a shadow of the sun, which stands at +y and +z, into the view. */
    const vis_light sun = {.kind = VIS_LIGHT_DIRECTIONAL, .direction = {0.0, 1.0, 1.0}};
    vis_pipeline *casters = NULL;
    check(vis_pipeline_create(&casters));
    check(vis_pipeline_add_casters(casters, &sun));
    check(vis_pipeline_cull(casters, scene, view, visible, NULL));
    check(vis_visible_count(visible, scene, &count));
    expect("casters", count, 2);
    vis_pipeline_destroy(casters);
    check(vis_pipeline_cull(by_pvs, scene, view, visible, NULL));

    /* The judge draws triangles, finds that the table shows, and that the result has it. */
    const float front[9] = {6, 0.2f, 0, 6, 0.8f, 0, 6, 0.5f, 1};
    check(vis_scene_set_triangles(scene, table, front, 1));
    vis_measure *measure = NULL;
    vis_comparison comparison;
    check(vis_measure_create(320, 180, &measure));
    check(vis_measure_compare(measure, scene, view, visible, &comparison));
    expect("falsely hidden", comparison.false_hidden_objects, 0);
    expect("reported", comparison.reported_objects, 1);

    /* In any order: what a pipeline uses lives as long as the pipeline. */
    vis_cells_destroy(cells);
    vis_scene_pvs_destroy(scene_pvs);
    vis_graph_destroy(graph);
    vis_pvs_destroy(pvs);
    vis_pvs_destroy(baked);
    check(vis_pipeline_cull(pipeline, scene, view, visible, NULL));
    vis_measure_destroy(measure);
    vis_pipeline_destroy(by_pvs);
    vis_pipeline_destroy(pipeline);
    vis_visible_destroy(visible);
    vis_view_destroy(view);
    vis_scene_destroy(scene);
    return 0;
}
