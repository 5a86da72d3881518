// A street with a wall that hides boxes, as in street.c, with the C++17 header.
#include "visibility.hpp"
#include <cstdio>
#include <cstdlib>
#include <limits>
#include <thread>

static void expect(const char *what, size_t found, size_t expected) {
    std::printf("%-22s %4zu\n", what, found);
    if (found != expected) {
        std::fprintf(stderr, "%s: %zu, not %zu\n", what, found, expected);
        std::exit(1);
    }
}

static vis_object_desc box_at(float x, float y, float z) {
    return vis_object_default(vis_box{{x, y, z}, {x + 1.0f, y + 0.5f, z + 0.4f}});
}

int main() try {
    std::vector<vis_object_desc> boxes;
    for (int i = 0; i < 8; i++) boxes.push_back(box_at(10.0f, -4.0f + float(i), 0.0f));
    for (int i = 0; i < 100; i++) boxes.push_back(box_at(30.0f, -4.5f + float(i % 10), 0.5f * float(i / 10)));
    for (int i = 0; i < 5; i++) boxes.push_back(box_at(30.0f, 12.0f + 2.0f * float(i), 0.0f));
    for (int i = 0; i < 40; i++) boxes.push_back(box_at(-20.0f, float(i), 0.0f));
    vis_object_desc wall = vis_object_default(vis_box{{20.0f, -6.0f, 0.0f}, {20.5f, 6.0f, 8.0f}});
    wall.flags = VIS_OBJECT_OCCLUDER;
    boxes.push_back(wall);

    auto scene = vis::make<vis::Scene>(vis_scene_create);
    std::vector<uint64_t> ids(boxes.size());
    uint64_t mesh = 0;
    vis::check(vis_scene_insert_batch(scene.get(), boxes.data(), boxes.size(), ids.data()));
    vis::check(vis_scene_add_box_mesh(scene.get(), &wall.bounds, &mesh));
    vis::check(vis_scene_set_mesh(scene.get(), ids.back(), mesh, nullptr));
    vis::check(vis_scene_rebuild(scene.get()));

    // Two eyes on two threads over one scene: a pipeline, a view and a set each.
    auto cull = [&scene](double y, std::vector<uint32_t> &draw) {
        auto pipeline = vis::make<vis::Pipeline>(vis_pipeline_create);
        vis::check(vis_pipeline_add_frustum(pipeline.get()));
        vis::check(vis_pipeline_add_z_buffer(pipeline.get(), 0, 0));
        auto view = vis::make<vis::View>(vis_view_create);
        const vis_pose pose = {{0.0, y, 1.7}, {1.0, y, 1.7}, {0.0, 0.0, 1.0}};
        const double far = std::numeric_limits<double>::infinity();
        vis::check(vis_view_set_perspective(view.get(), &pose, 1.0, 16.0 / 9.0, 0.1, far));
        auto visible = vis::make<vis::Visible>(vis_visible_create, false);
        vis_stats frustum;
        vis::check(vis_pipeline_cull(pipeline.get(), scene.get(), view.get(), visible.get(), nullptr));
        vis::check(vis_pipeline_stage_stats(pipeline.get(), 0, &frustum));
        expect("in the frustum", frustum.visible, 114);
        vis::check(vis_visible_sort_by_index(visible.get(), scene.get()));
        draw = vis::list<uint32_t>(vis_visible_indices, visible.get(), scene.get());
    };
    std::vector<uint32_t> left, right;
    std::thread other(cull, 0.03, std::ref(left));
    cull(-0.03, right);
    other.join();
    expect("objects", boxes.size(), 154);
    expect("visible, left eye", left.size(), 14);
    expect("visible, right eye", right.size(), 14);
    expect("both see the same", left == right, 1);

    try {
        vis::check(vis_scene_remove(scene.get(), VIS_NO_OBJECT));
        return 1;
    } catch (const vis::Error &error) {
        expect("unknown id", error.status == VIS_ERROR_UNKNOWN_ID, 1);
        std::printf("message: %s\n", error.what());
    }
    return 0;
} catch (const vis::Error &error) {
    std::fprintf(stderr, "error %d: %s\n", error.status, error.what());
    return 1;
}
