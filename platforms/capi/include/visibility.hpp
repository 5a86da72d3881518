// C++17 over visibility.h: handles that destroy themselves, errors as exceptions, lists as vectors.
//
//     auto scene = vis::make<vis::Scene>(vis_scene_create);
//     vis::check(vis_scene_rebuild(scene.get()));
//     std::vector<uint32_t> draw = vis::list<uint32_t>(vis_visible_indices, visible.get(), scene.get());
#ifndef VISIBILITY_HPP
#define VISIBILITY_HPP

#include "visibility.h"
#include <memory>
#include <stdexcept>
#include <vector>

namespace vis {

// A call that failed: its code, and in `what()` its message.
struct Error : std::runtime_error {
    vis_status status;
    explicit Error(vis_status code) : std::runtime_error(vis_last_error()), status(code) {}
};

// Throws an `Error` unless a call succeeded.
inline void check(vis_status status) {
    if (status != VIS_OK) throw Error(status);
}

template <class T, void (*destroy)(T *)> struct Destroy {
    void operator()(T *handle) const noexcept { destroy(handle); }
};
template <class T, void (*destroy)(T *)> using Handle = std::unique_ptr<T, Destroy<T, destroy>>;

using Scene = Handle<vis_scene, vis_scene_destroy>;
using View = Handle<vis_view, vis_view_destroy>;
using Pipeline = Handle<vis_pipeline, vis_pipeline_destroy>;
using Visible = Handle<vis_visible, vis_visible_destroy>;
using Lods = Handle<vis_lods, vis_lods_destroy>;
using DrawList = Handle<vis_draw_list, vis_draw_list_destroy>;
using Graph = Handle<vis_graph, vis_graph_destroy>;
using Cells = Handle<vis_cells, vis_cells_destroy>;
using Reflections = Handle<vis_reflections, vis_reflections_destroy>;
using Pvs = Handle<vis_pvs, vis_pvs_destroy>;
using ScenePvs = Handle<vis_scene_pvs, vis_scene_pvs_destroy>;
using Online = Handle<vis_online, vis_online_destroy>;
using SightCells = Handle<vis_sight_cells, vis_sight_cells_destroy>;
using WhoSees = Handle<vis_who_sees, vis_who_sees_destroy>;
using Plan = Handle<vis_plan, vis_plan_destroy>;
using Level = Handle<vis_level, vis_level_destroy>;
using Measure = Handle<vis_measure, vis_measure_destroy>;

// Makes a handle by its `vis_..._create` or `vis_..._read` function and what that takes before the handle.
template <class H, class F, class... A> H make(F create, A... arguments) {
    typename H::pointer handle = nullptr;
    check(create(arguments..., &handle));
    return H(handle);
}

// Returns the list that a function writes, such as `vis_visible_ids`: asks for the length, then for the list.
template <class T, class F, class... A> std::vector<T> list(F write, A... arguments) {
    size_t count = 0;
    check(write(arguments..., nullptr, 0, &count));
    std::vector<T> items(count);
    if (count > 0) check(write(arguments..., items.data(), items.size(), &count));
    return items;
}

} // namespace vis

#endif
