/* Sets made ahead of an eye that walks, in a scene that changes; and who sees whom, for a server. */
#include "visibility.h"
#include <math.h>
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
    printf("%-32s %4zu\n", what, found);
    if (found != expected) {
        fprintf(stderr, "%s: %zu, not %zu\n", what, found, expected);
        exit(1);
    }
}

static void expect_refused(vis_status status, vis_status expected, const char *said) {
    printf("refused: %s\n", vis_last_error());
    if (status != expected || strcmp(vis_last_error(), said) != 0) {
        fprintf(stderr, "error %d, not %d: %s\n", status, expected, said);
        exit(1);
    }
}

/* A frame of an engine: works ahead for at most a millisecond, then culls. Writes what answered. */
static vis_answer frame(vis_online *online, vis_scene *scene, vis_pipeline *pipeline, vis_view *view,
                        vis_visible *visible, const double eye[3], const double velocity[3]) {
    static const double ahead[5] = {0.0, 0.1, 0.2, 0.4, 0.8};
    double places[5][3];
    for (int i = 0; i < 5; i++)
        for (int axis = 0; axis < 3; axis++) places[i][axis] = eye[axis] + ahead[i] * velocity[axis];
    check(vis_online_step(online, scene, &places[0][0], 5, 1000, NULL));
    const vis_pose pose = {{eye[0], eye[1], eye[2]}, {eye[0] + 1, eye[1], eye[2]}, {0, 0, 1}};
    check(vis_view_set_perspective(view, &pose, 1.2, 1.5, 0.02, 200.0));
    check(vis_pipeline_cull(pipeline, scene, view, visible, NULL));
    vis_answer answer;
    check(vis_online_answer(online, &answer));
    return answer;
}

static void walk(void) {
    /* A wall 20 m ahead; 20 crates behind it and 5 before it. */
    vis_scene *scene = NULL;
    check(vis_scene_create(&scene));
    vis_object_desc descs[26];
    for (int i = 0; i < 25; i++) {
        const float x = i < 20 ? 30.0f : 10.0f, y = i < 20 ? (float)i - 10.0f : (float)i - 22.0f;
        descs[i] = vis_object_default((vis_box){{x, y, 0}, {x + 0.5f, y + 0.5f, 0.5f}});
    }
    descs[25] = vis_object_default((vis_box){{20, -40, -9}, {20.5f, 40, 20}});
    descs[25].flags = VIS_OBJECT_OCCLUDER;
    uint64_t ids[26], mesh;
    check(vis_scene_insert_batch(scene, descs, 26, ids));
    check(vis_scene_add_box_mesh(scene, &descs[25].bounds, &mesh));
    check(vis_scene_set_mesh(scene, ids[25], mesh, NULL));

    const double viewcell[3] = {0.6, 0.6, 0.6}, wide[3] = {4, 4, 1};
    vis_online *online = NULL;
    vis_pipeline *pipeline = NULL;
    vis_view *view = NULL;
    vis_visible *visible = NULL;
    check(vis_online_create(viewcell, wide, 0, &online));
    check(vis_pipeline_create(&pipeline));
    check(vis_pipeline_add_frustum(pipeline));
    check(vis_pipeline_add_online(pipeline, online));
    check(vis_view_create(&view));
    check(vis_visible_create(false, &visible));

    /* At 1.5 m/s and 60 frames a second: nothing is hidden before the first box is ready. */
    double eye[3] = {0, 0, 1};
    const double velocity[3] = {1.5, 0, 0};
    size_t count, late = 0, wrong = 0;
    for (int i = 0; i < 120; i++, eye[0] += velocity[0] / 60) {
        const vis_answer answer = frame(online, scene, pipeline, view, visible, eye, velocity);
        check(vis_visible_count(visible, scene, &count));
        late += answer == VIS_ANSWER_NONE;
        wrong += count != (answer == VIS_ANSWER_NONE ? 26u : 6u);
    }
    expect("late in less than half", late < 60, 1);
    expect("wrong frames", wrong, 0);
    expect("visible before the wall", count, 6);
    uint64_t came[26], went[26];
    check(vis_online_went(online, went, 26, &count));
    expect("went in the last frame", count, 0);

    /* What is hidden from a box, a bit an object. */
    size_t limit, words;
    check(vis_scene_index_limit(scene, &limit));
    uint32_t bits[1];
    expect("words", (limit + 31) / 32, 1);
    check(vis_online_write_hidden(online, scene, eye, eye, bits, 1, &words));
    expect("hidden are the first 20", bits[0], 0xFFFFF);

    /* A crate moves: it shows at once. The wall goes: all show at once. */
    const vis_box moved = {{31, 0, 0}, {31.5f, 0.5f, 0.5f}};
    check(vis_scene_set_bounds(scene, ids[3], &moved));
    frame(online, scene, pipeline, view, visible, eye, velocity);
    check(vis_visible_count(visible, scene, &count));
    expect("visible once one has moved", count, 7);
    check(vis_online_came(online, came, 26, &count));
    expect("came", count == 1 && came[0] == ids[3], 1);
    check(vis_scene_remove(scene, ids[25]));
    frame(online, scene, pipeline, view, visible, eye, velocity);
    check(vis_visible_count(visible, scene, &count));
    expect("visible without the wall", count, 25);
    check(vis_online_came(online, came, 26, &count));
    expect("came", count, 19);

    const double nowhere[3] = {0, NAN, 0};
    expect_refused(vis_online_step(online, scene, nowhere, 1, 1000, NULL), VIS_ERROR_ARGUMENT,
                   "place 0 is not finite");
    expect_refused(vis_online_step(NULL, scene, eye, 1, 1000, NULL), VIS_ERROR_NULL,
                   "the pointer `online` is null");

    /* In any order: the pipeline keeps the sets. */
    vis_online_destroy(online);
    check(vis_pipeline_cull(pipeline, scene, view, visible, NULL));
    vis_pipeline_destroy(pipeline);
    vis_visible_destroy(visible);
    vis_view_destroy(view);
    vis_scene_destroy(scene);
}

/* A player of 0.6 m who walks at 6 m/s, with an answer that is 100 ms late. */
static vis_reach player(double x, double y) {
    return (vis_reach){{x, y, 0}, {x + 0.6, y + 0.6, 1.8}, 6.0 * 0.1};
}

static void serve(void) {
    /* Two rooms side by side with a door between them. */
    const vis_wall walls[6] = {{{0, 0}, {8, 0}, VIS_OPACITY_OPAQUE}, {{8, 0}, {8, 4}, VIS_OPACITY_OPAQUE},
                               {{8, 4}, {0, 4}, VIS_OPACITY_OPAQUE}, {{0, 4}, {0, 0}, VIS_OPACITY_OPAQUE},
                               {{4, 0}, {4, 3}, VIS_OPACITY_OPAQUE}, {{4, 3}, {4, 4}, VIS_OPACITY_OPAQUE}};
    vis_sight_cells *cells = NULL;
    vis_who_sees *who_sees = NULL;
    check(vis_sight_cells_create_of_plan(walls, 6, 0, 1, &cells));
    check(vis_who_sees_create(&who_sees));
    const vis_reach players[3] = {player(1, 1), player(6, 1), player(2.5, 2)};
    check(vis_who_sees_look(who_sees, cells, NULL, players, 3, players, 3));
    uint32_t seen[3];
    size_t count;
    check(vis_who_sees_seen_by(who_sees, 0, seen, 3, &count));
    expect("player 0 sees", count, 2);
    expect("itself and player 2", seen[0] == 0 && seen[1] == 2, 1);
    bool sees;
    check(vis_who_sees_sees(who_sees, 1, 0, &sees));
    expect("player 1 sees player 0", sees, 0);
    check(vis_sight_cells_set_opacity(cells, 5, VIS_OPACITY_CLEAR));
    check(vis_who_sees_look(who_sees, cells, NULL, players, 3, players, 3));
    check(vis_who_sees_sees(who_sees, 1, 0, &sees));
    expect("through the open door", sees, 1);

    vis_reach lost = player(1, 1);
    lost.max[2] = NAN;
    expect_refused(vis_who_sees_look(who_sees, cells, NULL, players, 3, &lost, 1), VIS_ERROR_ARGUMENT,
                   "target 0 needs a finite box that is not inverted, and a margin that is finite and not "
                   "negative");
    expect_refused(vis_who_sees_sees(who_sees, 3, 0, &sees), VIS_ERROR_UNKNOWN_ID,
                   "the answer has 3 observers, and no observer 3");
    vis_who_sees_destroy(who_sees);
    vis_sight_cells_destroy(cells);
}

int main(void) {
    walk();
    serve();
    return 0;
}
