// Which objects can this camera see? The C interface of the `visibility` crates.
//
// Made from `src` by `VIS_WRITE_HEADER=1 cargo test --test header`: change the sources, not this file.
//
// Results. Functions return a `vis_status` and write results through pointers. After an error,
// `vis_last_error` has the message; the call has changed nothing.
//
// Pointers follow three rules, which the sources cite by number. Null is refused with `VIS_ERROR_NULL`, unless
// a description says that a pointer may be null; a null array of 0 elements is allowed. Nothing that is passed
// is kept: arrays may be freed when the call returns.
// P1. A pointer that a call reads points to a value of its type, or to as many as the description says, which
//     nobody changes or frees during the call. Handles are shared as "Threads" says.
// P2. A pointer that a call writes to points to memory for a value of its type, or for as many as the
//     description says, which nobody else uses during the call.
// P3. What a `..._create` or `..._read` function makes, the `..._destroy` function of its type destroys, once,
//     when no call uses it; null is ignored.
//
// Threads. Any thread may use any handle. Functions that take a handle as `const` may run on any number of
// threads at once; a function that takes a handle without `const` needs it alone. Calls that break this rule
// are refused with `VIS_ERROR_BUSY`, except those on `vis_cells`, `vis_online` and `vis_reflections`, which wait.
// Destroying is never checked.
//
// Matrices have 16 numbers, column-major, and multiply column vectors: element [4 * column + row], as in
// OpenGL, glm, cglm. Clip space is that of all graphics interfaces, -w <= x, y <= w; depth see `vis_depth`.
// Axes, handedness and units are yours; where metres are written, any unit of length serves.


#ifndef VISIBILITY_H
#define VISIBILITY_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

// Version of the interface. It increases when a change breaks programs that were compiled before.
#define VIS_ABI_VERSION 1

// Id that no object in any scene has.
#define VIS_NO_OBJECT 4294967295

// Mask of all layers, the default for objects and views.
#define VIS_ALL_LAYERS 4294967295

// Flag of an object that is visible in every view of its layers, whatever the cullers find.
#define VIS_OBJECT_NEVER_CULL 1

// Flag of an opaque object that may occlude others. Only an object with an occluder mesh occludes.
#define VIS_OBJECT_OCCLUDER 2

// Flag of an object that others are visible through: glass, blended and alpha-tested surfaces. It must not
// be an occluder. Only the judge (`vis_measure_compare`), which draws triangles, uses this flag.
#define VIS_OBJECT_SEE_THROUGH 4

// Flag of an object whose triangles are drawn only from their front, as with backface culling. The judge,
// proofs and bakes use this flag, and the version of a baked set depends on it. Occluder meshes made by
// `vis_scene_prepare_occluders` only occlude from the front, with or without this flag.
#define VIS_OBJECT_ONE_SIDED 8

// Number of no wall: where a ray leaves the plan.
#define VIS_NO_WALL 4294967295

// Number of no reflection: the parent of a reflection in a mirror that the eye sees itself.
#define VIS_NO_REFLECTION 4294967295

// Result of a call. Everything but `VIS_OK` is an error. A failed call has changed nothing, unless its
// description says otherwise, and `vis_last_error` tells what was wrong with what.
typedef enum vis_status {
  // The call succeeded.
  VIS_OK = 0,
  // A pointer is null but must not be.
  VIS_ERROR_NULL = 1,
  // An argument is invalid: a matrix that is not finite, an unknown enumerator, a size out of range, a
  // misaligned pointer.
  VIS_ERROR_ARGUMENT = 2,
  // An object, mesh, cell, portal, wall or mover does not exist: it was removed, or belongs to another
  // scene.
  VIS_ERROR_UNKNOWN_ID = 3,
  // A buffer is too short. The required length was written.
  VIS_ERROR_TOO_SHORT = 4,
  // The content of a file or buffer is damaged, or has another format.
  VIS_ERROR_FORMAT = 5,
  // Another call is needed first: give the view a camera, cull before asking for results, set local bounds
  // before a transform.
  VIS_ERROR_STATE = 6,
  // Another thread is using the handle in a way that excludes this call. Nothing was done.
  VIS_ERROR_BUSY = 7,
  // A fault inside the library. Handles that the call was changing return this status from now on, and can
  // only be destroyed.
  VIS_ERROR_PANIC = 8,
} vis_status;

// Accuracy that a pipeline promises for its result.
typedef enum vis_accuracy {
  // Reports exactly the visible objects.
  VIS_ACCURACY_EXACT = 0,
  // Never hides a visible object.
  VIS_ACCURACY_CONSERVATIVE = 1,
  // Never reports a hidden object.
  VIS_ACCURACY_AGGRESSIVE = 2,
  // May hide visible objects and report hidden ones, within the limits stated by its stages.
  VIS_ACCURACY_APPROXIMATE = 3,
} vis_accuracy;

// What answered a frame of online sets.
typedef enum vis_answer {
  // No box, so that nothing was hidden: none is finished around the eye and its near plane, or the view's
  // layers leave out an occluder of the boxes.
  VIS_ANSWER_NONE = 0,
  // A wide box, which hides less than a viewcell: the viewcell is not ready.
  VIS_ANSWER_WIDE = 1,
  // A viewcell.
  VIS_ANSWER_VIEWCELL = 2,
} vis_answer;

// Depth convention of a clip matrix: which clip-space depths z are in view, relative to clip-space w.
typedef enum vis_depth {
  // z is -w at the near plane and w at the far plane: OpenGL.
  VIS_DEPTH_NEGATIVE_ONE_TO_ONE = 0,
  // z is -w at the near plane; there is no far plane.
  VIS_DEPTH_NEGATIVE_ONE_TO_ONE_INFINITE = 1,
  // z is 0 at the near plane and w at the far plane: Direct3D, Vulkan, Metal, WebGPU.
  VIS_DEPTH_ZERO_TO_ONE = 2,
  // z is 0 at the near plane; there is no far plane.
  VIS_DEPTH_ZERO_TO_ONE_INFINITE = 3,
  // z is w at the near plane and 0 at the far plane.
  VIS_DEPTH_REVERSED = 4,
  // z is w at the near plane; there is no far plane.
  VIS_DEPTH_REVERSED_INFINITE = 5,
} vis_depth;

// Kind of a light that casts shadows.
typedef enum vis_light_kind {
  // Parallel light, such as the sun. `direction` leads from lit points towards the light.
  VIS_LIGHT_DIRECTIONAL = 0,
  // Light in all directions from `position`, as far as `range`.
  VIS_LIGHT_POINT = 1,
  // Light from `position` within a cone around `direction`, which leads away from the light, as far as
  // `range`.
  VIS_LIGHT_SPOT = 2,
} vis_light_kind;

// Effect of a wall on lines of sight that cross it.
typedef enum vis_opacity {
  // Lines of sight end at the wall: a solid wall, a closed door.
  VIS_OPACITY_OPAQUE = 0,
  // Lines of sight pass: glass, an open door, or a line that makes the cells of a large room smaller.
  VIS_OPACITY_CLEAR = 1,
  // Lines of sight pass from the left of the wall to its right, as seen along it from its first end, and
  // end when they come from the right.
  VIS_OPACITY_ONE_WAY = 2,
} vis_opacity;

// The cells of a building with their doors, shared by the pipelines of all views. Its functions wait for one
// another, so they never return `VIS_ERROR_BUSY`.
typedef struct vis_cells vis_cells;

// Visible objects grouped by the keys of `vis_scene_set_draw_keys`. Kept from frame to frame, it allocates
// nothing once it has held the largest frame.
typedef struct vis_draw_list vis_draw_list;

// Graph of convex cells and the portals between them. It never changes.
typedef struct vis_graph vis_graph;

// Occluders of a level: few large polygons, joined from the level's opaque triangles that stand still. The
// polygons hide only what the triangles hide.
typedef struct vis_level vis_level;

// Levels of detail of the visible objects of one view, chosen once per frame, with the levels of the frame
// before.
typedef struct vis_lods vis_lods;

// Software renderer that finds the objects with at least one visible pixel, for tests and tools, not for
// frames.
typedef struct vis_measure vis_measure;

// Sets of the objects that are visible from small boxes around one eye, made ahead of it while the scene
// changes. Its functions wait for one another and for frames that use the sets, so they never return
// `VIS_ERROR_BUSY` because of it.
typedef struct vis_online vis_online;

// Pipeline: the cullers of one view in the order in which they were added, with their state from earlier
// frames. Two eyes, or two players, need two pipelines over one scene.
typedef struct vis_pipeline vis_pipeline;

// Floor plan: walls, and the triangles between them.
typedef struct vis_plan vis_plan;

// Potentially visible set: for each viewcell the targets, cells or objects, that may be visible from there.
// It never changes.
typedef struct vis_pvs vis_pvs;

// Portal culling of one view with reflections in mirrors. Its functions wait for one another and for frames
// of the pipeline, so they never return `VIS_ERROR_BUSY` because of it.
typedef struct vis_reflections vis_reflections;

// Scene: objects, their hierarchy and their occluder meshes.
typedef struct vis_scene vis_scene;

// Potentially visible set prepared for a scene. It never changes.
typedef struct vis_scene_pvs vis_scene_pvs;

// The level in which movers see each other, as cells that cover it.
typedef struct vis_sight_cells vis_sight_cells;

// View: a camera and the layers that it shows. Created once, and set in each frame.
typedef struct vis_view vis_view;

// Set of the objects that a view sees, the result of `vis_pipeline_cull`. Changes of the scene do not change
// the set. Once listed, a render thread can read it while the scene changes.
typedef struct vis_visible vis_visible;

// Observers and targets of one tick, with the answer which of them see which. Keeps what it can for the
// next.
typedef struct vis_who_sees vis_who_sees;

// The objects of a draw list that have one key: a range of its instances.
typedef struct vis_draw_group {
  // Key of the objects; with levels of detail, the sum of key and level.
  uint32_t key;
  // Position of the first object among the instances.
  uint32_t first;
  // Number of objects, at least 1.
  uint32_t count;
} vis_draw_group;

// Arguments of one indexed indirect draw call, laid out as `VkDrawIndexedIndirectCommand`,
// `D3D12_DRAW_INDEXED_ARGUMENTS` and the argument buffers of OpenGL and WebGPU.
typedef struct vis_draw_command {
  // Number of indices of the mesh.
  uint32_t index_count;
  // Number of instances to draw.
  uint32_t instance_count;
  // Position of the mesh's first index in the index buffer.
  uint32_t first_index;
  // Number added to each index of the mesh before the vertex is read.
  int32_t base_vertex;
  // Position of the first object among the instances of the draw list.
  uint32_t first_instance;
} vis_draw_command;

// Level of detail to draw for a visible object. While `fade` is less than 1, `previous` is drawn too: the
// weight of `level` is `fade * opacity`, that of `previous` is `(1 - fade) * opacity`.
typedef struct vis_lod {
  // Id of the object.
  uint64_t object;
  // Level of detail to draw: 0 for the finest.
  uint32_t level;
  // Level that `level` replaces; equal to `level` while no cross-fade is in progress.
  uint32_t previous;
  // Weight of `level` in the cross-fade from `previous`, from 0 to 1; 1 while none is in progress.
  float fade;
  // Opacity of the object by its draw range, from 0 to 1: less than 1 only for an object that fades (see
  // `vis_scene_set_draw_range_with_margin`), and not towards its HLOD parent.
  float opacity;
} vis_lod;

// Axis-aligned box.
typedef struct vis_box {
  // Minimum corner: x, y, z.
  float min[3];
  // Maximum corner: x, y, z.
  float max[3];
} vis_box;

// Counters of a frame's work. They do not depend on the machine or on timing.
typedef struct vis_stats {
  // Number of nodes of the hierarchy whose children were tested.
  uint64_t nodes;
  // Number of nodes accepted as a whole, without tests of their children.
  uint64_t accepted_subtrees;
  // Number of tests of one box against one plane, one occlusion map or similar.
  uint64_t tests;
  // Number of occluders drawn.
  uint64_t occluders;
  // Number of visible objects after the stage.
  uint64_t visible;
} vis_stats;

// Description of an object to insert. Start from `vis_object_default`: a description of zeros would put the
// object on no layer, so that it is never visible.
typedef struct vis_object_desc {
  // Bounds relative to the scene's origin. An object whose bounds are inverted, NaN or infinite is never
  // culled.
  struct vis_box bounds;
  // Layers of the object, one bit per layer. A view shows objects that share a layer with it.
  uint32_t layers;
  // Cost of drawing the object, in triangles or any other unit.
  uint32_t cost;
  // Any of the flags `VIS_OBJECT_...`, or 0.
  uint32_t flags;
} vis_object_desc;

// Position and directions of a camera, in world coordinates.
typedef struct vis_pose {
  // Position of the eye.
  double eye[3];
  // Point that the camera looks at.
  double target[3];
  // Direction that points upwards in the picture.
  double up[3];
} vis_pose;

// Portal of a graph: a convex polygon between two cells.
typedef struct vis_portal {
  // Index of the polygon's first vertex among all vertices. The vertices run counter-clockwise as seen
  // from the second cell.
  uint32_t first_vertex;
  // Number of the polygon's vertices.
  uint32_t vertex_count;
  // The two cells that the portal joins.
  uint32_t cells[2];
} vis_portal;

// Convex volume in world space: a cell of a building, or a viewcell of a baked set.
typedef struct vis_volume {
  // Minimum corner of a box around the volume: x, y, z.
  double min[3];
  // Maximum corner of the box.
  double max[3];
  // Index, among all planes, of the first plane that cuts a part off the box.
  uint32_t first_plane;
  // Number of planes; 0 if the volume is the whole box.
  uint32_t plane_count;
} vis_volume;

// Differences between a result and the renderer's picture. Pixels are samples, so the numbers of falsely
// hidden objects are lower bounds, and those of falsely visible objects upper bounds.
typedef struct vis_comparison {
  // Number of objects in the result that have triangles.
  uint32_t reported_objects;
  // Number of objects with a visible pixel that are missing from the result. Always 0 for a conservative
  // pipeline.
  uint32_t false_hidden_objects;
  // Number of objects in the result without a visible pixel.
  uint32_t false_visible_objects;
  // Number of pixels that are wrong if only the objects in the result are drawn.
  uint32_t wrong_pixels;
} vis_comparison;

// Work that one call of `vis_online_step` has done.
typedef struct vis_online_work {
  // Whether there was any. False if all places have viewcells; all else is then false or 0.
  bool worked;
  // Whether the step worked on a wide box, not on a viewcell.
  bool wide;
  // Whether the step has finished its box, which answers frames from now on.
  bool finished;
  // Counters of the step.
  struct vis_stats stats;
} vis_online_work;

// Wall of a floor plan: a segment that is as high as the level.
typedef struct vis_wall {
  // First end: the plan's x and y.
  double from[2];
  // Second end.
  double to[2];
  // A `vis_opacity`.
  uint32_t opacity;
} vis_wall;

// End of a ray in a plan.
typedef struct vis_wall_hit {
  // Where the ray ends: the plan's x and y. NaN for a ray without a direction, or one that does not enter
  // the rectangle around the plan.
  double point[2];
  // Number of the wall that stops the ray. `VIS_NO_WALL` if none does: the point is on the rectangle
  // around the plan.
  uint32_t wall;
} vis_wall_hit;

// An object whose bounds a ray hits.
typedef struct vis_ray_hit {
  // Id of the object.
  uint64_t object;
  // Distance in metres from the ray's origin to the object's bounds: 0 for bounds around the origin, and
  // never more than the exact distance.
  float distance;
} vis_ray_hit;

// A mirror that is seen in a frame.
typedef struct vis_reflection {
  // Number of the mirror, as `vis_cells_add_mirror` wrote it.
  uint32_t mirror;
  // Number of the reflection in which the mirror is seen; `VIS_NO_REFLECTION` if the eye sees it itself.
  uint32_t parent;
  // Number of mirrors along the lines of sight: 1 if the eye sees the mirror itself.
  uint32_t depth;
} vis_reflection;

// Light that casts shadows, in world space and metres. Fields that its kind does not have are not read.
typedef struct vis_light {
  // A `vis_light_kind`.
  uint32_t kind;
  // Position of a point or spot light.
  double position[3];
  // Direction towards a directional light, or away from a spot light: any finite length but zero.
  double direction[3];
  // Distance beyond which a point or spot light casts no shadow: more than 0, may be infinite.
  double range;
  // Angle in radians between the axis and the side of a spot light's cone: more than 0, at most pi.
  double half_angle;
} vis_light;

// Where a mover may be until the answer is used.
typedef struct vis_reach {
  // Minimum corner, in world space, of the box that holds the mover's body, or its eyes: x, y, z.
  double min[3];
  // Maximum corner of the box.
  double max[3];
  // Greatest distance that a point of the body moves until the answer is used: its greatest speed, times
  // half a round trip on the network and the time until the next answer. Not negative.
  double margin;
} vis_reach;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

// Returns the `VIS_ABI_VERSION` that the library was built with, for comparison by programs that load the
// library at run time.
uint32_t vis_abi_version(void);

// Gives `count` objects their keys in draw lists: the number of the mesh, the material, the first level of
// the mesh, or several of them in one number; at most 4294967040. New objects have key 0. If an id is
// unknown, nothing changes.
enum vis_status vis_scene_set_draw_keys(struct vis_scene *scene,
                                        const uint64_t *ids,
                                        const uint32_t *keys,
                                        size_t count);

// Creates an empty draw list.
enum vis_status vis_draw_list_create(struct vis_draw_list **list);

// Destroys a draw list. Does nothing for a null pointer.
void vis_draw_list_destroy(struct vis_draw_list *list);

// Replaces the content of a draw list with the visible objects that are still in the scene, in groups of
// one key. Groups are in the order of their keys, the objects of a group in the order of the visible set.
// Takes a few nanoseconds per object if keys are small: up to about four times the number of objects.
enum vis_status vis_draw_list_group(struct vis_draw_list *list,
                                    const struct vis_scene *scene,
                                    const struct vis_visible *visible);

// Replaces the content of a draw list with the objects of the last frame of `lods` that are still in the
// scene. The key of a group is the sum of the objects' key and the level to draw, so the levels of a mesh
// have keys one after another: a mesh of 3 levels has keys k to k + 2, and its objects were given k.
enum vis_status vis_draw_list_group_levels(struct vis_draw_list *list,
                                           const struct vis_scene *scene,
                                           const struct vis_lods *lods);

// As `vis_draw_list_group_levels`, for the objects that are in a cross-fade alone, by the level that fades
// out: what is drawn a second time.
enum vis_status vis_draw_list_group_fading(struct vis_draw_list *list,
                                           const struct vis_scene *scene,
                                           const struct vis_lods *lods);

// Writes the groups by ascending key, like `vis_visible_ids`.
enum vis_status vis_draw_list_groups(const struct vis_draw_list *list,
                                     struct vis_draw_group *groups,
                                     size_t capacity,
                                     size_t *count);

// Writes the index of each object, group after group, like `vis_visible_indices`: the buffer in which a
// shader looks up the object of an instance.
enum vis_status vis_draw_list_instances(const struct vis_draw_list *list,
                                        uint32_t *indices,
                                        size_t capacity,
                                        size_t *count);

// Writes the commands that draw the groups, one each, in their order, like `vis_visible_ids`. `meshes[key]`
// is the command that draws the mesh of a key; its `instance_count` and `first_instance` are replaced by
// those of the group. Returns `VIS_ERROR_ARGUMENT` if a group's key is not below `mesh_count`.
enum vis_status vis_draw_list_commands(const struct vis_draw_list *list,
                                       const struct vis_draw_command *meshes,
                                       size_t mesh_count,
                                       struct vis_draw_command *commands,
                                       size_t capacity,
                                       size_t *count);

// Returns the message of the last call that failed on this thread, in English, UTF-8, ending with a zero
// byte; the empty text if none has failed. Successful calls leave it as it is. The pointer is valid until
// the next call that fails on this thread; never free it.
const char *vis_last_error(void);

// Creates levels of detail for one view, whose pictures are `picture_height` pixels high: 0 or more; with 0
// all objects have level 0. `hysteresis` is the fraction of a size by which an object must be beyond it
// before its level changes, 0 to 0.9; 0.1 is usual. `fade_seconds` is the duration of a cross-fade from one
// level to the next; 0 for none, 0.25 is usual. Two views, or two eyes, need two of these.
enum vis_status vis_lods_create(double picture_height,
                                double hysteresis,
                                float fade_seconds,
                                struct vis_lods **lods);

// Destroys levels of detail. Does nothing for a null pointer.
void vis_lods_destroy(struct vis_lods *lods);

// Sets the height in pixels of the pictures of later frames, 0 or more.
enum vis_status vis_lods_set_picture_height(struct vis_lods *lods, double picture_height);

// Sets the point of the world, 3 finite coordinates, from which the distances of draw ranges are measured in
// later frames; null for the view's own eye. For views of lights and mirrors, which show what the camera
// shows. Sizes are always those in the view.
enum vis_status vis_lods_set_distance_eye(struct vis_lods *lods, const double *eye);

// Gives `count` objects the same levels of detail, those of their mesh, for `vis_lods_select`: `sizes` are
// the sizes in pixels that divide the levels, at most 255, positive and finite. With 200 and 50, level 0 is
// for 200 pixels and more, level 1 for 50 and more, level 2 for all below. Without sizes, as for new
// objects, the level is 0. Each different list of sizes that an object is given is kept as long as the
// scene, also once no object has it. If an id is unknown, nothing changes.
enum vis_status vis_scene_set_lod_sizes(struct vis_scene *scene,
                                        const uint64_t *ids,
                                        size_t count,
                                        const float *sizes,
                                        size_t size_count);

// Chooses the level of each object of `visible`, the set of this view's frame, by its size in pixels and the
// sizes of `vis_scene_set_lod_sizes`. The size of an object is the diameter in pixels of the sphere around
// its bounds, as if the whole sphere were at the nearest point of the bounds in the middle of the picture,
// so that turning the camera changes no level. Once per frame; `elapsed_seconds` is the time since the frame
// before, by which cross-fades advance. An object that was not visible in the frame before has the level of
// its size at once.
enum vis_status vis_lods_select(struct vis_lods *lods,
                                const struct vis_scene *scene,
                                const struct vis_view *view,
                                const struct vis_visible *visible,
                                float elapsed_seconds);

// Writes the level of each object that was visible in the last frame, in the order of the visible set, like
// `vis_visible_ids`. None before the first frame.
enum vis_status vis_lods_selected(const struct vis_lods *lods,
                                  struct vis_lod *list,
                                  size_t capacity,
                                  size_t *count);

// Writes the level of one object in the last frame. The id in `lod` is `VIS_NO_OBJECT`, and all else 0, if
// the object was not visible.
enum vis_status vis_lods_lod(const struct vis_lods *lods, uint64_t object, struct vis_lod *lod);

// Forgets earlier frames, so that the next one begins without cross-fades: after a cut of the camera.
enum vis_status vis_lods_reset(struct vis_lods *lods);

// Writes the bounds of an object, relative to the scene's origin.
enum vis_status vis_scene_bounds(const struct vis_scene *scene, uint64_t object, struct vis_box *bounds);

// Sets the bounds of an object that has moved or changed its shape. If the bounds change, the object loses
// its occluder mesh, its triangles and its local bounds, which would no longer match. Move objects that have
// these with `vis_scene_set_transforms_batch`.
enum vis_status vis_scene_set_bounds(struct vis_scene *scene, uint64_t object, const struct vis_box *bounds);

// Sets the bounds of `count` objects, like `vis_scene_set_bounds`. If an id is unknown, no bounds are set.
// For objects that move in each frame.
enum vis_status vis_scene_set_bounds_batch(struct vis_scene *scene,
                                           const uint64_t *ids,
                                           const struct vis_box *bounds,
                                           size_t count);

// Sets the bounds of an object in its own coordinates. `vis_scene_set_transforms_batch` can then move its
// bounds and occluder mesh together.
enum vis_status vis_scene_set_local_bounds(struct vis_scene *scene,
                                           uint64_t object,
                                           const struct vis_box *bounds);

// Moves `count` objects that have local bounds. On an error, moves none. `transforms` has 16 numbers per
// object: a matrix from the object's coordinates to the scene's, column-major, with the last row 0 0 0 1.
enum vis_status vis_scene_set_transforms_batch(struct vis_scene *scene,
                                               const uint64_t *ids,
                                               const float *transforms,
                                               size_t count);

// Tightens the hierarchy where objects have moved. Call this once per frame. `budget` is the approximate
// time limit in microseconds. Writes the number of nodes still waiting to `waiting`, which may be null.
enum vis_status vis_scene_maintain(struct vis_scene *scene, size_t budget, size_t *waiting);

// Builds the best hierarchy for the present objects. Call this once after loading, not in each frame. Ids
// stay valid.
enum vis_status vis_scene_rebuild(struct vis_scene *scene);

// Stores an occluder mesh in a scene, for any number of objects, and writes its id. `positions` has 3
// numbers per vertex, `indices` 3 per triangle, counter-clockwise from the front. Only front faces occlude,
// unless `two_sided`. The drawn object must cover every pixel that the mesh covers; otherwise visible
// objects are hidden.
enum vis_status vis_scene_add_mesh(struct vis_scene *scene,
                                   const float *positions,
                                   size_t position_count,
                                   const uint32_t *indices,
                                   size_t triangle_count,
                                   bool two_sided,
                                   uint64_t *mesh);

// Stores the occluder mesh of a box in a scene and writes its id, for walls, houses and other solids.
enum vis_status vis_scene_add_box_mesh(struct vis_scene *scene, const struct vis_box *bounds, uint64_t *mesh);

// Removes an occluder mesh from a scene. Its id becomes invalid. Objects keep the mesh until they get
// another or lose it. Its memory is freed when no object has it.
enum vis_status vis_scene_remove_mesh(struct vis_scene *scene, uint64_t mesh);

// Writes the number of occluder meshes in a scene: meshes that were added and not removed, removed meshes
// that an object still has, and meshes prepared from the triangles of objects.
enum vis_status vis_scene_mesh_count(const struct vis_scene *scene, size_t *count);

// Gives an object an occluder mesh, which occludes while the object has the flag `VIS_OBJECT_OCCLUDER`.
// `transform` is a matrix of 16 numbers from mesh to scene coordinates, column-major, with the last row 0 0
// 0 1; null for the identity. An object with local bounds is moved by the same transform. Set bounds before
// the mesh, since a change of bounds removes the mesh. A mesh that reaches outside of the bounds hides
// nothing, and `vis_pipeline_lacks` reports it.
enum vis_status vis_scene_set_mesh(struct vis_scene *scene,
                                   uint64_t object,
                                   uint64_t mesh,
                                   const float *transform);

// Replaces the triangles of an object, 9 numbers each, in scene coordinates, for
// `vis_scene_prepare_occluders`, `vis_scene_prove_from` and `vis_measure_compare`. An error if the object's
// bounds do not contain them. The object loses its triangles when it moves.
enum vis_status vis_scene_set_triangles(struct vis_scene *scene,
                                        uint64_t object,
                                        const float *triangles,
                                        size_t count);

// Makes occluder meshes from the triangles of objects that have `VIS_OBJECT_OCCLUDER` and no mesh. Writes
// the number of objects that got one to `count`. Call this once after loading.
enum vis_status vis_scene_prepare_occluders(struct vis_scene *scene, size_t *count);

// Creates a pipeline without stages, which reports every object on the view's layers.
enum vis_status vis_pipeline_create(struct vis_pipeline **pipeline);

// Destroys a pipeline. Does nothing for a null pointer.
void vis_pipeline_destroy(struct vis_pipeline *pipeline);

// Appends frustum culling, which removes objects outside the view and should be the first stage.
// Conservative.
enum vis_status vis_pipeline_add_frustum(struct vis_pipeline *pipeline);

// Appends contribution culling. It removes objects that are smaller than `min_pixels` pixels in a picture
// `picture_height` pixels high, outside of their draw range, or replaced by an HLOD parent. If one of the
// two numbers is zero, no object is too small. Goes before the z-buffer: an object that is not drawn must
// not hide others. Approximate.
enum vis_status vis_pipeline_add_contribution(struct vis_pipeline *pipeline,
                                              double picture_height,
                                              double min_pixels);

// Changes the contribution culling that was added last for later frames: the height of the pictures and the
// least size, as for `vis_pipeline_add_contribution`, and the point of the world, 3 finite coordinates, from
// which the distances of draw ranges and HLOD parents are measured; null for the view's own eye. A view of a
// light gets the eye of the camera, so that it shows the objects that the camera shows; the reflections of
// `vis_pipeline_add_reflections` have it anyway. Returns `VIS_ERROR_STATE` if the pipeline has no
// contribution culling.
enum vis_status vis_pipeline_set_contribution(struct vis_pipeline *pipeline,
                                              double picture_height,
                                              double min_pixels,
                                              const double *distance_eye);

// Appends occlusion culling by a software hierarchical z-buffer. It removes objects hidden behind objects
// that have a mesh and the flag `VIS_OBJECT_OCCLUDER`. `width` and `height` are the size of the buffer in
// pixels, 16 to 4096; 0 and 0 for the default, 512 x 288. Conservative.
enum vis_status vis_pipeline_add_z_buffer(struct vis_pipeline *pipeline, size_t width, size_t height);

// Makes answers of later frames good for a while: they are made for all views whose eye is within `metres`
// and whose direction is within `radians` of the frame's view, and a frame with such a view keeps the answer
// and does no work. 0 and 0, the default: each frame culls for its own view. Frames also do so after a
// change of the scene, after a cut, and if a stage has no answer for a region: the frustum, portals and the
// z-buffer have one.
enum vis_status vis_pipeline_set_reach(struct vis_pipeline *pipeline, double metres, double radians);

// Writes whether the last frame kept the answer of an earlier one. A third frame of one view and one scene
// keeps it if there is an answer for the whole reach.
enum vis_status vis_pipeline_is_kept(const struct vis_pipeline *pipeline, bool *kept);

// Culls: fills `visible` with the objects of the scene that the view may see. Writes the sum of the stages'
// counters to `stats`, which may be null. Call this once per frame and view. Several threads may cull views
// of one scene at once, each with its own pipeline and visible set.
enum vis_status vis_pipeline_cull(struct vis_pipeline *pipeline,
                                  const struct vis_scene *scene,
                                  const struct vis_view *view,
                                  struct vis_visible *visible,
                                  struct vis_stats *stats);

// Makes all stages forget earlier frames. Never needed for correct results.
enum vis_status vis_pipeline_reset(struct vis_pipeline *pipeline);

// Writes the accuracy that all stages together promise.
enum vis_status vis_pipeline_accuracy(const struct vis_pipeline *pipeline, enum vis_accuracy *accuracy);

// Writes the counters of one stage in the last frame; stages count from 0 in the order in which they were
// added.
enum vis_status vis_pipeline_stage_stats(const struct vis_pipeline *pipeline,
                                         size_t stage,
                                         struct vis_stats *stats);

// With `true`, later frames keep culling for the view of the last frame, so that an engine can look at the
// culled scene from elsewhere. With `false`, they cull for the views passed to them.
enum vis_status vis_pipeline_freeze(struct vis_pipeline *pipeline, bool frozen);

// Starts or stops recording, from the next frame on, which stage removes each object. While recording, a
// frame takes time proportional to the size of the scene.
enum vis_status vis_pipeline_set_explaining(struct vis_pipeline *pipeline, bool explaining);

// Writes why an object was visible or not in the last frame, such as "visible" or "removed by frustum".
// Writes a text that ends with a zero byte, and its length including this byte to `count`. With a null
// `text`, writes only the length. The text is "unknown" unless the pipeline was explaining.
enum vis_status vis_pipeline_explain(const struct vis_pipeline *pipeline,
                                     uint64_t object,
                                     char *text,
                                     size_t capacity,
                                     size_t *count);

// Writes what the stages need and the scene lacks, one line each, such as "hzb: occluders without a mesh:
// 12". Empty if nothing is missing. Text and length as in `vis_pipeline_explain`.
enum vis_status vis_pipeline_lacks(const struct vis_pipeline *pipeline,
                                   const struct vis_scene *scene,
                                   char *text,
                                   size_t capacity,
                                   size_t *count);

// Returns the description of an object on all layers, of cost 1 and without flags.
struct vis_object_desc vis_object_default(struct vis_box bounds);

// Creates an empty scene whose origin is the origin of the world.
enum vis_status vis_scene_create(struct vis_scene **scene);

// Destroys a scene. Does nothing for a null pointer.
void vis_scene_destroy(struct vis_scene *scene);

// Moves the whole scene so that its origin is at the point `origin` of the world (3 numbers). Bounds,
// triangles and transforms are relative to the origin and keep their values.
enum vis_status vis_scene_set_origin(struct vis_scene *scene, const double *origin);

// Writes the number of objects.
enum vis_status vis_scene_count(const struct vis_scene *scene, size_t *count);

// Writes an upper bound, exclusive, on the index (`(uint32_t)id`) of every object so far: the length of an
// array indexed by object. `(limit + 31) / 32` words hold one bit per object.
enum vis_status vis_scene_index_limit(const struct vis_scene *scene, size_t *limit);

// Writes whether an id names an object of the scene: false once the object is removed.
enum vis_status vis_scene_contains(const struct vis_scene *scene, uint64_t object, bool *contains);

// Adds an object and writes its id. The lower half of an id, `(uint32_t)id`, is the object's index: small
// and dense, for arrays. A later object may get the index of a removed one, never the id.
enum vis_status vis_scene_insert(struct vis_scene *scene, const struct vis_object_desc *object, uint64_t *id);

// Adds `count` objects and writes their ids to `ids`, an array of `count`. On an error, adds none. Much
// faster than single calls for a new scene.
enum vis_status vis_scene_insert_batch(struct vis_scene *scene,
                                       const struct vis_object_desc *objects,
                                       size_t count,
                                       uint64_t *ids);

// Removes an object. Its id becomes invalid.
enum vis_status vis_scene_remove(struct vis_scene *scene, uint64_t object);

// Removes `count` objects. If an id is unknown or listed twice, removes none.
enum vis_status vis_scene_remove_batch(struct vis_scene *scene, const uint64_t *ids, size_t count);

// Sets the layers of an object, one bit per layer. With 0 the object is in no view.
enum vis_status vis_scene_set_layers(struct vis_scene *scene, uint64_t object, uint32_t layers);

// Sets the flags of an object to any of the flags `VIS_OBJECT_...`, or 0, and clears all others. To open a
// door that occludes, clear `VIS_OBJECT_OCCLUDER` of the door.
enum vis_status vis_scene_set_flags(struct vis_scene *scene, uint64_t object, uint32_t flags);

// Sets the distances from the eye, in metres, at which an object is drawn, for the stage
// `vis_pipeline_add_contribution`: from `begin` to `end`, which may be infinite. Other stages ignore the
// range. If two levels of detail have different bounds, adjoining ranges leave distances at which neither is
// drawn. To avoid this, make the far level the parent of the near one with `vis_scene_set_hlod_parent`.
enum vis_status vis_scene_set_draw_range(struct vis_scene *scene, uint64_t object, float begin, float end);

// Sets the distances at which an object is drawn, as `vis_scene_set_draw_range` does, and the length
// `margin` in metres, finite, inside of the range, over which the object fades in from `begin` on and out up
// to `end`. A range from 0 does not fade in. `vis_lod` has the opacity. An object that fades hides nothing
// at any distance.
enum vis_status vis_scene_set_draw_range_with_margin(struct vis_scene *scene,
                                                     uint64_t object,
                                                     float begin,
                                                     float end,
                                                     float margin);

// Makes `parent` replace an object beyond the begin of the parent's draw range, for the stage
// `vis_pipeline_add_contribution`; `VIS_NO_OBJECT` for no parent. Distances of both are measured from the
// parent's bounds, which must contain the object's bounds.
enum vis_status vis_scene_set_hlod_parent(struct vis_scene *scene, uint64_t object, uint64_t parent);

// Creates a view without a camera, on all layers.
enum vis_status vis_view_create(struct vis_view **view);

// Destroys a view. Does nothing for a null pointer.
void vis_view_destroy(struct vis_view *view);

// Sets the camera of a view from the engine's matrix from world to clip space: 16 numbers, column-major.
// `depth` is the `vis_depth` of the matrix. `origin` is the point of the world that the matrix is relative
// to (3 coordinates), for engines that draw relative to the camera; null for the origin of the world. The
// view keeps its layers and loses its clip planes.
//
// Occlusion culling relies on two conditions that every camera meets and that are not checked: clip-space w
// does not decrease away from the eye, and the near plane is not behind the eye.
enum vis_status vis_view_set_matrix(struct vis_view *view,
                                    const float *matrix,
                                    uint32_t depth,
                                    const double *origin);

// Like `vis_view_set_matrix`, for a matrix in double precision.
enum vis_status vis_view_set_matrix_f64(struct vis_view *view,
                                        const double *matrix,
                                        uint32_t depth,
                                        const double *origin);

// Sets the camera of a view from its pose and lens, for programs without a matrix. `fov_y` is the vertical
// field of view in radians, `aspect` width over height, `near_plane` and `far_plane` the distances of the
// planes; `far_plane` may be infinite. The view keeps its layers and loses its clip planes.
enum vis_status vis_view_set_perspective(struct vis_view *view,
                                         const struct vis_pose *pose,
                                         double fov_y,
                                         double aspect,
                                         double near_plane,
                                         double far_plane);

// Sets the camera of a view with parallel lines of sight, for shadow cascades, maps and plans. The picture
// is `width` by `height` metres around the viewing axis; `near_plane` and `far_plane` are distances from the
// eye along the axis, and `near_plane` may be negative. The view keeps its layers and loses its clip planes.
enum vis_status vis_view_set_orthographic(struct vis_view *view,
                                          const struct vis_pose *pose,
                                          double width,
                                          double height,
                                          double near_plane,
                                          double far_plane);

// Sets the layers that a view shows, one bit per layer. A change of the camera keeps them.
enum vis_status vis_view_set_layers(struct vis_view *view, uint32_t layers);

// Restricts a view to one side of each of `count` planes, at most 10. A plane has 4 numbers a, b, c, d and
// keeps the points with a x + b y + c z + d >= 0, relative to the origin of the matrix, or to the eye of a
// view set from a pose. Replaces earlier planes.
enum vis_status vis_view_set_clip_planes(struct vis_view *view, const double *planes, size_t count);

// Writes the matrix of a view, from the world relative to the point `origin` (3 finite coordinates; null for
// the origin of the world) to clip space, in the depth convention of the view: 16 numbers, column-major. For
// views that the library makes: those of mirrors.
enum vis_status vis_view_matrix(const struct vis_view *view, const double *origin, double *matrix);

// Writes the clip planes of a view, relative to the point `origin` (3 finite coordinates; null for the
// origin of the world): 4 numbers a, b, c, d each, whose side with a x + b y + c z + d >= 0 is seen.
// `capacity` and `count` are in numbers. A null or too short `planes` is handled as in `vis_visible_ids`.
enum vis_status vis_view_clip_planes(const struct vis_view *view,
                                     const double *origin,
                                     double *planes,
                                     size_t capacity,
                                     size_t *count);

// Writes whether an answer that a pipeline has made for the view `of` with a reach (see
// `vis_pipeline_set_reach`) is good for `view`: its eye is within `metres` of that of `of`, it is turned by
// at most `radians`, and lens, near and far plane and layers are the same. With this, an answer that another
// thread or process has made for an older view is used only where it holds. False for parallel views and for
// views with clip planes.
enum vis_status vis_view_is_within_reach(const struct vis_view *view,
                                         const struct vis_view *of,
                                         double metres,
                                         double radians,
                                         bool *within);

// Creates a set for the results of one view. With `with_changes`, it also records which objects became
// visible or hidden since the last frame, for a few nanoseconds per visible object.
enum vis_status vis_visible_create(bool with_changes, struct vis_visible **visible);

// Destroys a set. Does nothing for a null pointer.
void vis_visible_destroy(struct vis_visible *visible);

// Lists the visible objects, unless they are listed already, by `vis_visible_sort_by_index` or in a set with
// changes. The functions below can read a listed set without a scene, so that a render thread can read it
// while the scene changes.
enum vis_status vis_visible_list(struct vis_visible *visible, const struct vis_scene *scene);

// Writes the number of visible objects that are still in the scene. `scene` may be null if the set is
// listed; objects removed after the listing then count too.
enum vis_status vis_visible_count(const struct vis_visible *visible,
                                  const struct vis_scene *scene,
                                  size_t *count);

// Writes whether an object is visible. False if it was removed from the scene.
enum vis_status vis_visible_contains(const struct vis_visible *visible,
                                     const struct vis_scene *scene,
                                     uint64_t object,
                                     bool *contains);

// Sorts the visible objects by ascending index, the fastest order for reading arrays indexed by object.
// Drops objects that were removed from the scene. In an unsorted set, neighbours in space follow each other.
enum vis_status vis_visible_sort_by_index(struct vis_visible *visible, const struct vis_scene *scene);

// Writes the ids of the visible objects that are still in the scene, and their number to `count`. With a
// null `ids`, writes only the number. Returns `VIS_ERROR_TOO_SHORT` if `ids` is too short. `scene` may be
// null if the set is listed; objects removed after the listing are then written too.
enum vis_status vis_visible_ids(const struct vis_visible *visible,
                                const struct vis_scene *scene,
                                uint64_t *ids,
                                size_t capacity,
                                size_t *count);

// Writes the indices of the visible objects, like `vis_visible_ids`. Indices take half the memory of ids,
// for engines with arrays indexed by object.
enum vis_status vis_visible_indices(const struct vis_visible *visible,
                                    const struct vis_scene *scene,
                                    uint32_t *indices,
                                    size_t capacity,
                                    size_t *count);

// Writes one bit per object index: bit `index % 32` of word `index / 32` is set for visible objects that are
// still in the scene. Writes the number of words to `count`, which follows from `vis_scene_index_limit`. A
// null or too short `words` is handled as in `vis_visible_ids`.
enum vis_status vis_visible_write_bits(const struct vis_visible *visible,
                                       const struct vis_scene *scene,
                                       uint32_t *words,
                                       size_t capacity,
                                       size_t *count);

// Writes the ids of objects that are visible and were not in the last frame, like `vis_visible_ids`. None
// unless the set was created with changes.
enum vis_status vis_visible_newly_visible(const struct vis_visible *visible,
                                          uint64_t *ids,
                                          size_t capacity,
                                          size_t *count);

// Writes the ids of objects that were visible in the last frame and are not now, like `vis_visible_ids`.
// Includes removed objects. None unless the set was created with changes.
enum vis_status vis_visible_newly_hidden(const struct vis_visible *visible,
                                         uint64_t *ids,
                                         size_t capacity,
                                         size_t *count);

// Makes a graph of `cell_count` cells from arrays: `portals`, and 3 coordinates for each of `vertices`.
enum vis_status vis_graph_create(size_t cell_count,
                                 const struct vis_portal *portals,
                                 size_t portal_count,
                                 const double *vertices,
                                 size_t vertex_count,
                                 struct vis_graph **graph);

// Makes a graph from the `length` bytes of a map compiler's portal file (`.prt`), in the format PRT1, PRT2
// or PRT1-AM.
enum vis_status vis_graph_read_prt(const uint8_t *text, size_t length, struct vis_graph **graph);

// Destroys a graph. Does nothing for a null pointer.
void vis_graph_destroy(struct vis_graph *graph);

// Writes the number of cells and the number of portals.
enum vis_status vis_graph_counts(const struct vis_graph *graph, size_t *cells, size_t *portals);

// Computes which cells may see one another from anywhere inside, with all portals open. Conservative.
// `clearance` is the least distance in world units between a line of sight and the edges of portals; 0 for
// the default, which is 1e-6 or, if more, 2^-33 of the greatest coordinate of a portal. Takes from
// milliseconds to minutes.
enum vis_status vis_graph_bake(const struct vis_graph *graph, double clearance, struct vis_pvs **pvs);

// Makes the cells of a building from a graph and the volume of each cell. `planes` has 4 numbers a, b, c, d
// each; a volume keeps the side where a x + b y + c z + d >= 0. `tolerance` is the greatest error in the
// positions of portals and volumes: 1e-6 for metres computed in double precision, the last decimal for
// coordinates read from text. All portals are open. A portal with the wrong winding is corrected; a portal
// whose two volumes are not on opposite sides is an error. The graph may be destroyed afterwards.
enum vis_status vis_cells_create(const struct vis_graph *graph,
                                 const struct vis_volume *cell_volumes,
                                 size_t volume_count,
                                 const double *planes,
                                 size_t plane_count,
                                 double tolerance,
                                 struct vis_cells **cells);

// Makes cells and portals from the triangles of a scene's occluders that are always drawn, where they are
// now: space is divided along large walls, and every gap between triangles becomes an open portal, unless it
// is narrower than 2^-20 of the greatest coordinate relative to the scene's origin, or 2^-36 of that in the
// world. An occluder with a draw range, an HLOD parent or HLOD children is not always drawn, nor is one on
// no layer: it is no wall. `max_cells` is the greatest number of cells; 0 for the default, 16,384. Writes
// the number of cells to `cell_count`, which may be null. It is 0 where all space sees the backs of
// one-sided triangles: a culler with such cells hides nothing. What an occluder does after this call counts
// no more, so make cells of what stands still. Occluders of all layers count, so cull with such cells only
// views that show them all. Takes from milliseconds to minutes.
enum vis_status vis_cells_create_of_scene(const struct vis_scene *scene,
                                          size_t max_cells,
                                          struct vis_cells **cells,
                                          size_t *cell_count);

// Destroys cells; pipelines that use them keep them alive. Does nothing for a null pointer.
void vis_cells_destroy(struct vis_cells *cells);

// Restricts what is seen from a cell to its row in a baked set, whose targets must be the cells of the
// graph. The set may be destroyed afterwards. Returns `VIS_ERROR_ARGUMENT` for a set baked from another
// graph. For a set made by `vis_pvs_create` the graph is unknown, so pipelines with the cells become
// `VIS_ACCURACY_APPROXIMATE`.
enum vis_status vis_cells_set_pvs(struct vis_cells *cells, const struct vis_pvs *pvs);

// Opens or closes a portal, for example a door.
enum vis_status vis_cells_set_open(struct vis_cells *cells, uint32_t portal, bool open);

// Sets the directions in which an open portal can be seen through: from its first cell into the second
// (`forward`), from the second into the first (`backward`), or both. To allow neither, close the portal.
enum vis_status vis_cells_set_passage(struct vis_cells *cells, uint32_t portal, bool forward, bool backward);

// Adds a mirror on the boundary of a cell and writes its number, counted from 0. Its `vertex_count`
// vertices, 3 coordinates each, make a convex polygon in a plane, counter-clockwise as seen from within the
// cell. Views with `vis_reflections` then find what is seen in the mirror. If the glass itself is drawn, it
// is an object of the scene.
enum vis_status vis_cells_add_mirror(struct vis_cells *cells,
                                     uint32_t cell,
                                     const double *vertices,
                                     size_t vertex_count,
                                     uint32_t *mirror);

// Sets whether a mirror reflects (`uncovered`), as new mirrors do, or is covered and shows nothing.
enum vis_status vis_cells_set_mirror(struct vis_cells *cells, uint32_t mirror, bool uncovered);

// Writes whether one cell may see another, from anywhere inside, through the portals that are open now.
// Useful for sound and for the AI of guards.
enum vis_status vis_cells_can_see(const struct vis_cells *cells, uint32_t from, uint32_t to, bool *sees);

// Makes the occluders of a level from its opaque triangles that stand still, 9 finite coordinates each,
// counter-clockwise from the front. `two_sided` is whether they hide from behind, too. Takes seconds for a
// million triangles.
enum vis_status vis_level_create(const float *triangles,
                                 size_t triangle_count,
                                 bool two_sided,
                                 struct vis_level **level);

// Loads the occluders of a level from a file that `vis_level_write` or a program of the crates wrote. The
// library cannot tell whether the file is of the level as it is now: occluders of another level hide visible
// objects. Returns `VIS_ERROR_FORMAT` for bytes that are no such file.
enum vis_status vis_level_read(const uint8_t *bytes, size_t length, struct vis_level **level);

// Writes the occluders of a level as a file. A null or too short buffer is handled as in `vis_visible_ids`.
enum vis_status vis_level_write(const struct vis_level *level,
                                uint8_t *bytes,
                                size_t capacity,
                                size_t *count);

// Destroys the occluders of a level; pipelines that use them keep them alive. Does nothing for a null
// pointer.
void vis_level_destroy(struct vis_level *level);

// Creates a renderer with an image of `width` by `height` pixels.
enum vis_status vis_measure_create(uint32_t width, uint32_t height, struct vis_measure **measure);

// Destroys a renderer. Does nothing for a null pointer.
void vis_measure_destroy(struct vis_measure *measure);

// Draws all triangles of the scene's objects (`vis_scene_set_triangles`) for a view, and compares the
// picture with a pipeline's result for the same view. Objects without triangles are not compared.
enum vis_status vis_measure_compare(struct vis_measure *measure,
                                    const struct vis_scene *scene,
                                    const struct vis_view *view,
                                    const struct vis_visible *visible,
                                    struct vis_comparison *comparison);

// Creates sets for one eye. `viewcell` and `wide` are the sizes along x, y and z, in metres, of the
// viewcells and of the wide boxes that these lie in: 3 numbers each, positive and finite, those of `wide` at
// least those of `viewcell`. A viewcell of 0.6 m lasts for a quarter of a second of walking; a wide box
// should be several times as wide, but not higher. `margin` is how far a viewcell extends at least around
// each place that it holds: to the corners of the near plane, and to both eyes of a headset. At most half
// the least size of the viewcell counts; 0 for the default, an eighth of it.
enum vis_status vis_online_create(const double *viewcell,
                                  const double *wide,
                                  double margin,
                                  struct vis_online **online);

// Destroys sets; pipelines and sight cells that use them keep them alive. Does nothing for a null pointer.
void vis_online_destroy(struct vis_online *online);

// Works ahead, in or between frames, on the box that is needed soonest. `places` are points of the world, 3
// coordinates each: the eye, then where it may be next, such as its place after 0.1, 0.2, 0.4 and 0.8
// seconds at its present velocity. All must be finite. `budget` is the work to do in microseconds of a core
// of 3 GHz, counted and not timed; a step does a little work even with 0, and may exceed it by one
// indivisible part. Answers do not depend on budgets. Writes what was done to `work`, which may be null:
// call this until `worked` is false to have viewcells at all places.
enum vis_status vis_online_step(struct vis_online *online,
                                const struct vis_scene *scene,
                                const double *places,
                                size_t place_count,
                                uint32_t budget,
                                struct vis_online_work *work);

// Writes what answered the last frame of a pipeline with these sets. `VIS_ANSWER_NONE` before the first.
enum vis_status vis_online_answer(const struct vis_online *online, enum vis_answer *answer);

// Writes the ids of objects that the box of the last frame sees, wherever the view looks, and the box of the
// frame before did not, like `vis_visible_ids`. The largest for their distance come first, so a stream sends
// as many of the first as fit. It begins with all objects of the scene and adds those that are inserted,
// since what was never hidden is not listed.
enum vis_status vis_online_came(const struct vis_online *online,
                                uint64_t *ids,
                                size_t capacity,
                                size_t *count);

// Writes the ids of objects that the box of the frame before saw and the box of the last frame does not see,
// in the order of `vis_online_came`, so the last can be unloaded first. Removed objects are not listed.
enum vis_status vis_online_went(const struct vis_online *online,
                                uint64_t *ids,
                                size_t capacity,
                                size_t *count);

// Writes which objects are hidden from all points of a box of the world, without a view: bit `index % 32` of
// word `index / 32` is set if the object is hidden. `min` and `max` are the corners of the box, 3 finite
// coordinates each. Nothing is hidden if no finished box holds this one, or if `min` exceeds `max`. A null
// or too short `words` is handled as in `vis_visible_ids`; `vis_scene_index_limit` tells the number of
// words. Only for observers to whom all layers of occluders are drawn.
enum vis_status vis_online_write_hidden(struct vis_online *online,
                                        const struct vis_scene *scene,
                                        const double *min,
                                        const double *max,
                                        uint32_t *words,
                                        size_t capacity,
                                        size_t *count);

// Makes a plan of walls, which are numbered from 0 in the given order. They may cross and touch. Around them
// is a rectangle with a margin of a quarter of their extent, at least 1; what an eye sees ends there.
enum vis_status vis_plan_create(const struct vis_wall *walls, size_t wall_count, struct vis_plan **plan);

// Destroys a plan. Does nothing for a null pointer.
void vis_plan_destroy(struct vis_plan *plan);

// Sets the opacity, a `vis_opacity`, of a wall: a door that opens. Returns `VIS_ERROR_UNKNOWN_ID` for a wall
// that the plan does not have.
enum vis_status vis_plan_set_opacity(struct vis_plan *plan, uint32_t wall, uint32_t opacity_of_wall);

// Writes whether the segment from point `a` to point `b`, 2 coordinates each, meets no wall that stops sight
// from `a` to `b` before its end. Exact for the given numbers. A point on a wall sees both of its sides.
enum vis_status vis_plan_sees(const struct vis_plan *plan, const double *a, const double *b, bool *sees);

// Writes where a ray from `eye` through the point `through`, 2 coordinates each, ends: at the first wall
// that stops sight, or at the rectangle around the plan.
enum vis_status vis_plan_ray(const struct vis_plan *plan,
                             const double *eye,
                             const double *through,
                             struct vis_wall_hit *hit);

// Writes the corners of what an eye sees, counter-clockwise, 2 coordinates each; `capacity` and `count` are
// numbers of coordinates. `eye` is the plan's x and y, `range` the greatest distance, infinite for none;
// arcs become chords inside of them. A null or too short buffer is handled as in `vis_visible_ids`.
enum vis_status vis_plan_visibility_polygon(const struct vis_plan *plan,
                                            const double *eye,
                                            double range,
                                            double *coordinates,
                                            size_t capacity,
                                            size_t *count);

// Writes the numbers of the walls that an eye sees, ascending. Parameters as in
// `vis_plan_visibility_polygon`.
enum vis_status vis_plan_visible_walls(const struct vis_plan *plan,
                                       const double *eye,
                                       double range,
                                       uint32_t *walls,
                                       size_t capacity,
                                       size_t *count);

// Writes the numbers of the walls that can be seen from somewhere in the convex hull of points, 2
// coordinates each, ascending. Sight from within the region, on its side of walls that cross it, is exact.
// Returns `VIS_ERROR_ARGUMENT` if there is no point, if a point is outside the rectangle around the plan, or
// if lines of sight enter more than 2^24 triangles of the plan.
enum vis_status vis_plan_walls_seen_from_region(const struct vis_plan *plan,
                                                const double *points,
                                                size_t point_count,
                                                uint32_t *walls,
                                                size_t capacity,
                                                size_t *count);

// Loads a set from the `length` bytes that `vis_pvs_write` has written. The bytes are checked. For files of
// the program `bake`, use `vis_scene_pvs_read_version`.
enum vis_status vis_pvs_read(const uint8_t *bytes, size_t length, struct vis_pvs **pvs);

// Makes a set of objects from rows, for sets of your own baker. Viewcell `i` sees the targets from
// `targets[row_ends[i - 1]]` (0 for the first) up to `targets[row_ends[i]]`, exclusive. The targets of each
// row are strictly ascending and below `target_count`.
enum vis_status vis_pvs_create(size_t target_count,
                               const size_t *row_ends,
                               size_t viewcell_count,
                               const uint32_t *targets,
                               size_t targets_length,
                               struct vis_pvs **pvs);

// Destroys a set. Does nothing for a null pointer.
void vis_pvs_destroy(struct vis_pvs *pvs);

// Writes the bytes of a set, to be stored unchanged, and their number to `count`. With a null `bytes`,
// writes only the number. Returns `VIS_ERROR_TOO_SHORT` if `bytes` is too short.
enum vis_status vis_pvs_write(const struct vis_pvs *pvs, uint8_t *bytes, size_t capacity, size_t *count);

// Writes the number of viewcells and the number of targets.
enum vis_status vis_pvs_counts(const struct vis_pvs *pvs, size_t *viewcells, size_t *targets);

// Writes whether a target may be visible from a viewcell; false if the set has no such target or viewcell.
enum vis_status vis_pvs_sees(const struct vis_pvs *pvs, uint32_t viewcell, uint32_t target, bool *sees);

// Writes the row of a viewcell as one bit per target: bit `target % 32` of word `target / 32` is set if the
// target may be visible from there. Writes the number of words to `count`. A null or too short `words` is
// handled as in `vis_pvs_write`. Faster than `vis_pvs_sees` for many targets.
enum vis_status vis_pvs_write_row(const struct vis_pvs *pvs,
                                  uint32_t viewcell,
                                  uint32_t *words,
                                  size_t capacity,
                                  size_t *count);

// Prepares a set for the present state of a scene, for `vis_pipeline_add_pvs`. Viewcell `i` of the set is
// the region `viewcells[i]`; `planes` as in `vis_cells_create`. The arrays `objects` and `targets`, both of
// length `pair_count`, assign targets to objects; an object may have several. Objects without a target, and
// objects that change later, are never hidden. The set may be destroyed afterwards.
enum vis_status vis_scene_pvs_create(const struct vis_scene *scene,
                                     const struct vis_pvs *pvs,
                                     const struct vis_volume *viewcells,
                                     size_t viewcell_count,
                                     const double *planes,
                                     size_t plane_count,
                                     const uint64_t *objects,
                                     const uint32_t *targets,
                                     size_t pair_count,
                                     struct vis_scene_pvs **scene_pvs);

// Loads the `length` bytes of a file that the program `bake` has written, for `vis_pipeline_add_pvs`. The
// bytes are checked. The scene must have exactly the objects of the baked scene, inserted in the same order
// with the same bounds. Objects that change later are never hidden. `version` is the level's version as
// printed by `bake`: a hash of everything the bake depends on, triangles included. Returns
// `VIS_ERROR_ARGUMENT` for another scene or version.
enum vis_status vis_scene_pvs_read_version(const struct vis_scene *scene,
                                           const uint8_t *bytes,
                                           size_t length,
                                           uint64_t version,
                                           struct vis_scene_pvs **scene_pvs);

// Loads a file like `vis_scene_pvs_read_version`, for a level without a stored version. An edit that changes
// no bounds, such as a new door in a wall, is not noticed, and objects that it makes visible are hidden. So
// pipelines with the set are `VIS_ACCURACY_APPROXIMATE`, and `vis_pipeline_lacks` reports the reason.
enum vis_status vis_scene_pvs_read(const struct vis_scene *scene,
                                   const uint8_t *bytes,
                                   size_t length,
                                   struct vis_scene_pvs **scene_pvs);

// Destroys a prepared set; pipelines that use it keep it alive. Does nothing for a null pointer.
void vis_scene_pvs_destroy(struct vis_scene_pvs *pvs);

// Writes the objects on `layers` whose bounds a ray hits, nearest first: first candidates for picking by
// triangles, since no triangle of an object is nearer than its bounds. The ray leads from `origin`, relative
// to the scene's origin, along `direction`, 3 coordinates each, up to `max_distance` metres, which may be
// infinite. An object whose bounds are inverted, NaN or infinite is hit at distance 0. A null or too short
// buffer is handled as in `vis_visible_ids`.
enum vis_status vis_scene_ray_hits(const struct vis_scene *scene,
                                   const float *origin,
                                   const float *direction,
                                   float max_distance,
                                   uint32_t layers,
                                   struct vis_ray_hit *hits,
                                   size_t capacity,
                                   size_t *count);

// Writes the first of the objects that `vis_scene_ray_hits` would write. Its id is `VIS_NO_OBJECT`, and its
// distance infinite, if there is none.
enum vis_status vis_scene_first_hit(const struct vis_scene *scene,
                                    const float *origin,
                                    const float *direction,
                                    float max_distance,
                                    uint32_t layers,
                                    struct vis_ray_hit *hit);

// Writes the ids of the objects on `layers` whose bounds touch a box, relative to the scene's origin, like
// `vis_visible_ids`. Exact; an inverted or NaN box touches every object.
enum vis_status vis_scene_in_box(const struct vis_scene *scene,
                                 const struct vis_box *area,
                                 uint32_t layers,
                                 uint64_t *ids,
                                 size_t capacity,
                                 size_t *count);

// Creates reflections of one view in the mirrors of cells, at most `max_count` in a frame and at most
// `max_depth` mirrors along a line of sight: 8 and 2 are usual, with 1 mirrors in mirrors are left out. The
// cells live as long as these reflections, even if destroyed.
enum vis_status vis_reflections_create(const struct vis_cells *cells,
                                       size_t max_count,
                                       uint32_t max_depth,
                                       struct vis_reflections **reflections);

// Destroys reflections; a pipeline that uses them keeps them alive. Does nothing for a null pointer.
void vis_reflections_destroy(struct vis_reflections *reflections);

// Appends portal culling as `vis_pipeline_add_portals` does, which also finds the reflections. They are
// those of the pipeline's last frame, so each pipeline needs reflections of its own: returns
// `VIS_ERROR_STATE` if a pipeline has these. Conservative. If the pipeline has contribution culling, it
// culls what mirrors show as well, by sizes in the mirror and distances from the eye of the camera, so that
// mirrors show the objects that the camera shows.
enum vis_status vis_pipeline_add_reflections(struct vis_pipeline *pipeline,
                                             const struct vis_reflections *reflections);

// Writes the reflections of the last frame, like `vis_visible_ids`. They are numbered from 0 in this order;
// each comes after the one that it is seen in. None before the first frame. In the next frame, a number may
// be that of another mirror: levels of detail of a mirror need a `vis_lods` for each chain of mirrors, from
// `parent` to `parent`, or `vis_lods_reset` before each other chain.
enum vis_status vis_reflections_list(const struct vis_reflections *reflections,
                                     struct vis_reflection *list,
                                     size_t capacity,
                                     size_t *count);

// Writes how many mirrors were seen in the last frame and have no reflection, since there were more than
// `vis_reflections_create` allows, or since the reflected matrix was no view. Also counts each mirror that
// has a reflection in which no mirrors are looked for, since its eye is unknown.
enum vis_status vis_reflections_left_out(const struct vis_reflections *reflections, uint32_t *count);

// Reads one of the reflections of `vis_reflections_list`. Sets `view` to the view to draw it with, to the
// pixels that the mirror covers: `vis_view_matrix` and `vis_view_clip_planes` have its matrix and its clip
// plane, which cuts away what is behind the mirror. The view mirrors space, so triangles change their
// winding. Sets `visible` to the objects to draw in it, as they were at the end of the frame. A set with
// changes has none then, and begins anew: its next frame lists all its objects as newly visible.
// Conservative, but for what contribution culling removes. Returns `VIS_ERROR_UNKNOWN_ID` for a number
// beyond the last.
enum vis_status vis_reflections_read(const struct vis_reflections *reflections,
                                     uint32_t number,
                                     struct vis_view *view,
                                     struct vis_visible *visible);

// Writes which objects can be seen from a box of the world. The box is swept over the occluder meshes of all
// objects that have the flag `VIS_OBJECT_OCCLUDER`. Bit `index % 32` of word `index / 32` is clear if the
// object is hidden from all points of the box, and if there is no object of this index. `min` and `max` are
// the corners of the box, 3 finite coordinates each. Conservative for views that draw the layers of all
// occluders. Takes milliseconds to a second. A null or too short `words` is handled as in `vis_visible_ids`;
// null takes no time.
enum vis_status vis_scene_seen_from(const struct vis_scene *scene,
                                    const double *min,
                                    const double *max,
                                    uint32_t *words,
                                    size_t capacity,
                                    size_t *count);

// Decides for each object whether it can be seen from a box of the world, by rays and proofs among the
// triangles of `vis_scene_set_triangles`. Writes two bits for each index: bit `index % 32` of word `index /
// 32` is set if a line of sight to the object was found; the bit in the second half of the words is set if
// the object is proven hidden from all points of the box. Neither is set for objects that are not decided.
// An object that is never culled is never hidden. An object without triangles is its bounds: no line of
// sight to it is found, and it hides nothing. With a `clearance` of 0, an object is hidden if every segment
// to it touches an occluder; with a clearance in metres, also if it is seen only through gaps narrower than
// 12 clearances, or at grazing angles. Hidden objects are so for views that draw the layers of all
// occluders.
//
// The search ends after `most_steps` steps; 0 for no end, which may take minutes. A step is a search node of
// some microseconds, or at most 200 rays. Each call first collects all triangles of the scene, which
// `most_steps` does not bound: it takes about 150 bytes of memory a triangle until the call ends. A null or
// too short `words` is handled as in `vis_visible_ids`; null takes no time.
enum vis_status vis_scene_prove_from(const struct vis_scene *scene,
                                     const double *min,
                                     const double *max,
                                     double clearance,
                                     uint32_t most_steps,
                                     uint32_t *words,
                                     size_t capacity,
                                     size_t *count);

// Appends portal culling, which removes objects that cannot be seen through the open portals of a building.
// Several pipelines may share the cells, which live as long as a pipeline uses them, even if destroyed.
// Conservative.
enum vis_status vis_pipeline_add_portals(struct vis_pipeline *pipeline, const struct vis_cells *cells);

// Appends culling by a baked set. It removes objects that the set excludes for the viewcells around the eye.
// Several pipelines may share the set, which lives as long as a pipeline uses it, even if destroyed.
// Conservative if the set is.
enum vis_status vis_pipeline_add_pvs(struct vis_pipeline *pipeline, const struct vis_scene_pvs *pvs);

// Appends culling by sets made ahead of an eye on the move. It removes objects that are hidden from the box
// around the eye and its near plane; nothing while no box is ready. The sets live as long as a pipeline uses
// them, even if destroyed. Both eyes of a headset may share them; `vis_online_answer` and the lists of what
// came and went are then those of the last frame of either. Conservative.
enum vis_status vis_pipeline_add_online(struct vis_pipeline *pipeline, const struct vis_online *online);

// Appends culling by a horizon: it removes objects hidden behind upright solids, walls and hills of the
// objects that have a mesh and the flag `VIS_OBJECT_OCCLUDER`. For cities and terrain seen from near the
// ground. `is_z_up` is whether the z axis points up, otherwise the y axis does. The solids of each scene are
// found in the first frame, and follow its changes. Conservative.
enum vis_status vis_pipeline_add_horizon(struct vis_pipeline *pipeline, bool is_z_up);

// Appends culling of shadow casters: it removes objects whose shadow from a light cannot fall on any point
// that the view shows. The first stage of the pipeline that selects objects for the light's shadow map; the
// view is the camera's, or that of one cascade, on the layers of all casters. No frustum stage belongs in
// that pipeline, since casters may be outside the view. Conservative for shadows.
enum vis_status vis_pipeline_add_casters(struct vis_pipeline *pipeline, const struct vis_light *light);

// Appends a z-buffer as `vis_pipeline_add_z_buffer` does, into which the occluders of a level are drawn,
// beside those of the scene's objects. `origin` is the point of the world, 3 finite coordinates, that the
// level's triangles are relative to. The level may be destroyed afterwards. Conservative for views that draw
// the whole level: its triangles have no layers.
enum vis_status vis_pipeline_add_z_buffer_of_level(struct vis_pipeline *pipeline,
                                                   size_t width,
                                                   size_t height,
                                                   const struct vis_level *level,
                                                   const double *origin);

// Makes sight cells from the walls of a floor plan: its triangles are the cells. `x_axis` and `y_axis` are
// the axes of the world, 0 to 2, that are the plan's x and y: 0 and 1 if z is up. Movers do not pass opaque
// walls. Outside the rectangle around the plan a mover sees and is seen by all. Leave out walls that one can
// look over. Clear walls along a grid of some metres make large rooms hide more.
enum vis_status vis_sight_cells_create_of_plan(const struct vis_wall *walls,
                                               size_t wall_count,
                                               uint32_t x_axis,
                                               uint32_t y_axis,
                                               struct vis_sight_cells **cells);

// Makes sight cells from the cells of a building, their volumes and planes as in `vis_cells_create`, and the
// set that `vis_graph_bake` made of their graph. Outside the cells all is solid; doors count as open. Graph
// and set may be destroyed afterwards. Returns `VIS_ERROR_ARGUMENT` for a set of another graph.
enum vis_status vis_sight_cells_create_of_portals(const struct vis_graph *graph,
                                                  const struct vis_volume *cell_volumes,
                                                  size_t volume_count,
                                                  const double *planes,
                                                  size_t plane_count,
                                                  double tolerance,
                                                  const struct vis_pvs *pvs,
                                                  struct vis_sight_cells **cells);

// Makes sight cells for a scene whose occluders stand still, from boxes of the world, 6 numbers each
// (minimum, then maximum corner), finite and not inverted. Finds which boxes are seen from which by a sweep
// of each, in milliseconds to a second a box. A box that a wall cuts sees both sides of the wall. Outside
// the boxes a mover sees and is seen by all.
enum vis_status vis_sight_cells_create_of_scene(const struct vis_scene *scene,
                                                const double *boxes,
                                                size_t box_count,
                                                struct vis_sight_cells **cells);

// Makes sight cells for a scene that changes, from boxes as in `vis_sight_cells_create_of_scene`. Adds an
// object to the scene for each box, which hides nothing and no view shows. While a mover is not in the
// boxes, all see it; while no box of the online sets holds its reach, it sees all. So the margin of the sets
// should be at least half the greatest extent of a reach, and `vis_online_step` should get the middles of
// the reaches as places. The sets live as long as the cells.
enum vis_status vis_sight_cells_create_online(struct vis_scene *scene,
                                              const struct vis_online *online,
                                              const double *boxes,
                                              size_t box_count,
                                              struct vis_sight_cells **cells);

// Destroys sight cells. Does nothing for a null pointer.
void vis_sight_cells_destroy(struct vis_sight_cells *cells);

// Sets the opacity (a `vis_opacity`) of a wall of a plan, for example a door; walls count from 0. Returns
// `VIS_ERROR_UNKNOWN_ID` if the cells have no such wall.
enum vis_status vis_sight_cells_set_opacity(struct vis_sight_cells *cells,
                                            uint32_t wall,
                                            uint32_t wall_opacity);

// Writes the ids of the objects that `vis_sight_cells_create_online` has added, like `vis_visible_ids`, in
// the order of the boxes; none for other sight cells. Remove them after the cells. All movers see one
// another while one is missing, or has other bounds than its box: once the origin of the scene has moved,
// set them anew.
enum vis_status vis_sight_cells_objects(const struct vis_sight_cells *cells,
                                        uint64_t *ids,
                                        size_t capacity,
                                        size_t *count);

// Creates an answer without observers and targets.
enum vis_status vis_who_sees_create(struct vis_who_sees **who_sees);

// Destroys an answer. Does nothing for a null pointer.
void vis_who_sees_destroy(struct vis_who_sees *who_sees);

// Finds which targets each observer may see, once per tick, and replaces the former answer. Conservative: a
// target is left out only if no straight line leads from anywhere the observer may be to anywhere the target
// may be. Targets hide nothing from each other. Observers and targets count from 0 in the order given.
// `scene` is the scene of online sight cells; null for all others. On an error, the former answer stays.
enum vis_status vis_who_sees_look(struct vis_who_sees *who_sees,
                                  struct vis_sight_cells *cells,
                                  const struct vis_scene *scene,
                                  const struct vis_reach *observers,
                                  size_t observer_count,
                                  const struct vis_reach *targets,
                                  size_t target_count);

// Writes whether an observer may see a target. Returns `VIS_ERROR_UNKNOWN_ID` for numbers that the last call
// of `vis_who_sees_look` did not have.
enum vis_status vis_who_sees_sees(const struct vis_who_sees *who_sees,
                                  size_t observer,
                                  size_t target,
                                  bool *sees);

// Writes the numbers of the targets that an observer may see, ascending, like `vis_visible_ids`. Returns
// `VIS_ERROR_UNKNOWN_ID` for an observer that the last call of `vis_who_sees_look` did not have.
enum vis_status vis_who_sees_seen_by(const struct vis_who_sees *who_sees,
                                     size_t observer,
                                     uint32_t *targets,
                                     size_t capacity,
                                     size_t *count);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* VISIBILITY_H */
