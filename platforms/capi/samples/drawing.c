/* What to draw, and how: levels of detail, a stand-in for a block of houses, draw lists with indirect commands, and
   what is seen in a mirror. */
#include "visibility.h"
#include <stdio.h>
#include <stdlib.h>

static void check(vis_status status) {
    if (status != VIS_OK) {
        fprintf(stderr, "error %d: %s\n", status, vis_last_error());
        exit(1);
    }
}

static void expect(const char *what, size_t found, size_t expected) {
    printf("%-28s %5zu\n", what, found);
    if (found != expected) {
        fprintf(stderr, "%s: %zu, not %zu\n", what, found, expected);
        exit(1);
    }
}

enum { STATUES = 40, HOUSES = 4, ALL = STATUES + HOUSES + 1, LEVELS = 3, MESHES = 2 * LEVELS + 2 };

static vis_box box(float x, float y, float z, float to_x, float to_y, float to_z) {
    return (vis_box){{x, y, z}, {to_x, to_y, to_z}};
}

/* Statues every 4 m, of two meshes of three levels each, and a block of houses 200 m away. */
static vis_scene *make_street(uint64_t ids[ALL]) {
    vis_scene *scene = NULL;
    vis_object_desc descs[ALL];
    uint32_t keys[ALL];
    for (int i = 0; i < STATUES; i++) {
        const float x = 4.0f * (float)(i + 1);
        descs[i] = vis_object_default(box(x, -0.5f, 0, x + 1, 0.5f, 2));
        keys[i] = i % 2 == 0 ? LEVELS : 0; /* the first level of the mesh; the others follow */
    }
    for (int i = 0; i < HOUSES; i++) {
        const float y = 10.0f * (float)(i - 2);
        descs[STATUES + i] = vis_object_default(box(200, y, 0, 209, y + 9, 12));
        keys[STATUES + i] = 2 * LEVELS;
    }
    descs[ALL - 1] = vis_object_default(box(200, -20, 0, 209, 19, 12));
    keys[ALL - 1] = 2 * LEVELS + 1;
    check(vis_scene_create(&scene));
    check(vis_scene_insert_batch(scene, descs, ALL, ids));
    check(vis_scene_set_draw_keys(scene, ids, keys, ALL));
    /* Level 0 from 300 pixels on, level 1 from 60 on, level 2 below. */
    const float sizes[LEVELS - 1] = {300, 60};
    check(vis_scene_set_lod_sizes(scene, ids, STATUES, sizes, LEVELS - 1));
    /* From 150 m on, the block is drawn in the place of its houses. */
    check(vis_scene_set_draw_range(scene, ids[ALL - 1], 150, 1e9f));
    for (int i = 0; i < HOUSES; i++) check(vis_scene_set_hlod_parent(scene, ids[STATUES + i], ids[ALL - 1]));
    return scene;
}

static void look(vis_view *view, double x) {
    const vis_pose pose = {{x, 0, 1}, {x + 1, 0, 1}, {0, 0, 1}};
    check(vis_view_set_perspective(view, &pose, 1.0, 1.5, 0.1, 1000.0));
}

static void street(void) {
    uint64_t ids[ALL];
    vis_scene *scene = make_street(ids);
    vis_view *view = NULL;
    vis_visible *visible = NULL;
    vis_pipeline *pipeline = NULL;
    vis_lods *lods = NULL;
    vis_draw_list *list = NULL, *fading = NULL;
    check(vis_view_create(&view));
    check(vis_visible_create(false, &visible));
    check(vis_pipeline_create(&pipeline));
    check(vis_pipeline_add_frustum(pipeline));
    check(vis_pipeline_add_contribution(pipeline, 1080, 2));
    check(vis_lods_create(1080, 0.1, 0.25f, &lods));
    check(vis_draw_list_create(&list));
    check(vis_draw_list_create(&fading));

    /* Each frame: cull, choose levels, group by mesh and level. */
    look(view, 0);
    check(vis_pipeline_cull(pipeline, scene, view, visible, NULL));
    check(vis_lods_select(lods, scene, view, visible, 1.0f / 60));
    check(vis_draw_list_group_levels(list, scene, lods));
    vis_draw_group groups[MESHES];
    size_t count;
    check(vis_draw_list_groups(list, groups, MESHES, &count));
    expect("groups", count, 7);
    const uint32_t expected[7][2] = {{0, 1}, {1, 4}, {2, 15}, {3, 1}, {4, 4}, {5, 15}, {7, 1}};
    for (size_t i = 0; i < count; i++)
        expect("  objects of a key", groups[i].key == expected[i][0] ? groups[i].count : 99, expected[i][1]);

    /* A command for each group; `instances` says which object an instance is. */
    vis_draw_command meshes[MESHES] = {{0}}, commands[MESHES];
    for (uint32_t key = 0; key < MESHES; key++)
        meshes[key] = (vis_draw_command){.index_count = 3 * (key + 1), .first_index = 100 * key};
    check(vis_draw_list_commands(list, meshes, MESHES, commands, MESHES, &count));
    expect("commands", count, 7);
    expect("indices of the last", commands[6].index_count, 24);
    expect("its first instance", commands[6].first_instance, STATUES);
    uint32_t instances[ALL];
    check(vis_draw_list_instances(list, instances, ALL, &count));
    expect("instances", count, STATUES + 1);
    expect("the last is the block", instances[count - 1], ALL - 1);

    /* 6 m on, the first statue is behind, and the third has come so near that it changes its level. */
    look(view, 6);
    check(vis_pipeline_cull(pipeline, scene, view, visible, NULL));
    check(vis_lods_select(lods, scene, view, visible, 0.1f));
    check(vis_draw_list_group_fading(fading, scene, lods));
    check(vis_draw_list_groups(fading, groups, MESHES, &count));
    expect("groups that fade out", count, 1);
    expect("key that fades out", groups[0].key, LEVELS + 1);
    vis_lod lod;
    check(vis_lods_lod(lods, ids[2], &lod));
    expect("level that fades in", lod.level, 0);
    check(vis_lods_lod(lods, ids[0], &lod));
    expect("no level of what is behind", lod.object == VIS_NO_OBJECT, 1);
    vis_lod all[ALL];
    check(vis_lods_selected(lods, all, ALL, &count));
    expect("levels", count, STATUES);

    /* In a smaller window; for a light that stands far behind the camera: it shows what the camera shows. */
    const double eye[3] = {6, 0, 1};
    check(vis_lods_set_picture_height(lods, 540));
    check(vis_pipeline_set_contribution(pipeline, 540, 2, eye));
    check(vis_lods_set_distance_eye(lods, eye));
    look(view, -400);
    check(vis_pipeline_cull(pipeline, scene, view, visible, NULL));
    check(vis_lods_reset(lods));
    check(vis_lods_select(lods, scene, view, visible, 0));
    check(vis_draw_list_group(list, scene, visible));
    check(vis_draw_list_groups(list, groups, MESHES, &count));
    expect("groups by mesh", count, 3);

    vis_draw_list_destroy(fading);
    vis_draw_list_destroy(list);
    vis_lods_destroy(lods);
    vis_pipeline_destroy(pipeline);
    vis_visible_destroy(visible);
    vis_view_destroy(view);
    vis_scene_destroy(scene);
}

/* A hall with a mirror ahead, in which the eye sees the vase behind it. */
static void hall(void) {
    const vis_volume room = {{0, -2, 0}, {8, 2, 3}, 0, 0};
    const double glass[4][3] = {{8, -1, 2}, {8, 1, 2}, {8, 1, 0.5}, {8, -1, 0.5}};
    vis_graph *graph = NULL;
    vis_cells *cells = NULL;
    vis_reflections *reflections = NULL;
    vis_scene *scene = NULL;
    vis_view *view = NULL, *mirrored = NULL;
    vis_visible *visible = NULL, *shown = NULL;
    vis_pipeline *pipeline = NULL;
    uint32_t mirror;
    uint64_t vase;
    check(vis_graph_create(1, NULL, 0, NULL, 0, &graph));
    check(vis_cells_create(graph, &room, 1, NULL, 0, 1e-6, &cells));
    check(vis_cells_add_mirror(cells, 0, &glass[0][0], 4, &mirror));
    check(vis_reflections_create(cells, 8, 2, &reflections));
    check(vis_scene_create(&scene));
    const vis_object_desc desc = vis_object_default(box(0.5f, -0.2f, 0.5f, 0.9f, 0.2f, 1.4f));
    check(vis_scene_insert(scene, &desc, &vase));
    check(vis_view_create(&view));
    check(vis_view_create(&mirrored));
    check(vis_visible_create(false, &visible));
    check(vis_visible_create(false, &shown));
    check(vis_pipeline_create(&pipeline));
    check(vis_pipeline_add_frustum(pipeline));
    check(vis_pipeline_add_reflections(pipeline, reflections));

    look(view, 2);
    size_t count;
    check(vis_pipeline_cull(pipeline, scene, view, visible, NULL));
    check(vis_visible_count(visible, scene, &count));
    expect("seen ahead", count, 0);
    vis_reflection list[8];
    check(vis_reflections_list(reflections, list, 8, &count));
    expect("mirrors", count, 1);
    expect("seen by the eye itself", list[0].mirror == mirror && list[0].parent == VIS_NO_REFLECTION, 1);
    check(vis_reflections_read(reflections, 0, mirrored, shown));
    bool contains;
    check(vis_visible_contains(shown, scene, vase, &contains));
    expect("the vase is in the mirror", contains, 1);
    /* To draw it with: triangles change their winding, and the clip plane keeps x <= 8. */
    double matrix[16], planes[4];
    check(vis_view_matrix(mirrored, NULL, matrix));
    check(vis_view_clip_planes(mirrored, NULL, planes, 4, &count));
    expect("numbers of the clip plane", count, 4);
    expect("it keeps what is before 8 m", planes[0] == -1 && planes[3] > 7.999 && planes[3] < 8.001, 1);
    uint32_t left_out;
    check(vis_reflections_left_out(reflections, &left_out));
    expect("mirrors left out", left_out, 0);
    check(vis_cells_set_mirror(cells, mirror, false));
    check(vis_pipeline_cull(pipeline, scene, view, visible, NULL));
    check(vis_reflections_list(reflections, list, 8, &count));
    expect("once it is covered", count, 0);

    vis_cells_destroy(cells);
    vis_graph_destroy(graph);
    vis_reflections_destroy(reflections);
    vis_pipeline_destroy(pipeline);
    vis_visible_destroy(shown);
    vis_visible_destroy(visible);
    vis_view_destroy(mirrored);
    vis_view_destroy(view);
    vis_scene_destroy(scene);
}

int main(void) {
    street();
    hall();
    return 0;
}
