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
// are refused with `VIS_ERROR_BUSY`, except those on `vis_cells`, which wait. Destroying is never checked.
//
// Matrices have 16 numbers, column-major, and multiply column vectors: element [4 * column + row], as in
// OpenGL, glm, cglm. Clip space is that of all graphics interfaces, -w <= x, y <= w; depth see `vis_depth`.
// Axes, handedness and units are yours; where metres are written, any unit of length serves.


#ifndef VISIBILITY_H
#define VISIBILITY_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

// Version of the interface. It grows when a change breaks programs that were compiled before.
#define VIS_ABI_VERSION 1

// The id of no object in any scene.
#define VIS_NO_OBJECT 4294967295

// All layers: what objects and views have unless they are given others.
#define VIS_ALL_LAYERS 4294967295

// Flag of an object that is visible in every view of its layers, whatever the cullers find.
#define VIS_OBJECT_NEVER_CULL 1

// Flag of an object that is opaque and may hide others. Only an object with an occluder mesh hides anything.
#define VIS_OBJECT_OCCLUDER 2

// Flag of an object that what is behind is drawn through: glass, blended and alpha-tested surfaces. It must
// not be an occluder. For the judge (`vis_measure_compare`), which draws triangles.
#define VIS_OBJECT_SEE_THROUGH 4

// Flag of an object whose triangles are drawn from their front alone, as with backface culling. Read by the
// judge and by bakes, and part of the version that a baked set is compared by. Occluder meshes that
// `vis_scene_prepare_occluders` makes hide from the front alone in any case.
#define VIS_OBJECT_ONE_SIDED 8

// Result of a call. Everything but `VIS_OK` is an error. A failed call has changed nothing, unless its
// description says otherwise, and `vis_last_error` tells what was wrong with what.
typedef enum vis_status {
  // The call succeeded.
  VIS_OK = 0,
  // A pointer is null that must not be.
  VIS_ERROR_NULL = 1,
  // An argument cannot be used: a matrix that is not finite, an unknown enumerator, a size out of range, a
  // misaligned pointer.
  VIS_ERROR_ARGUMENT = 2,
  // An object, mesh, cell or portal is not there: the object was removed, or belongs to another scene.
  VIS_ERROR_UNKNOWN_ID = 3,
  // A buffer is too short. The length that it needs has been written.
  VIS_ERROR_TOO_SHORT = 4,
  // The content of a file or buffer is damaged, or of another format.
  VIS_ERROR_FORMAT = 5,
  // Something has to be done first: give the view a camera, cull before asking for results, set local
  // bounds before a transform.
  VIS_ERROR_STATE = 6,
  // Another thread is using the handle in a way that excludes this call. Nothing was done.
  VIS_ERROR_BUSY = 7,
  // A fault inside the library. Handles that the call changed answer every later call with this status;
  // all that is left is to destroy them.
  VIS_ERROR_PANIC = 8,
} vis_status;

// What a pipeline promises of its result.
typedef enum vis_accuracy {
  // Reports what is visible and nothing else.
  VIS_ACCURACY_EXACT = 0,
  // Never hides a visible object.
  VIS_ACCURACY_CONSERVATIVE = 1,
  // Never reports a hidden object.
  VIS_ACCURACY_AGGRESSIVE = 2,
  // May err both ways, within what its stages say.
  VIS_ACCURACY_APPROXIMATE = 3,
} vis_accuracy;

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

// The cells of a building with their doors, shared by the pipelines of all views. Its functions wait for
// each other; they never return `VIS_ERROR_BUSY`.
typedef struct vis_cells vis_cells;

// A graph of convex cells and of the portals between them. It never changes.
typedef struct vis_graph vis_graph;

// A software renderer that finds which objects show in at least one pixel: for tests and tools, not for
// frames.
typedef struct vis_measure vis_measure;

// A pipeline: the cullers of one view, in the order in which they were added, with their memory of earlier
// frames. Two eyes, or two players, have two pipelines over one scene.
typedef struct vis_pipeline vis_pipeline;

// A potentially visible set: for each viewcell the targets, cells or objects, that may be seen from there.
// It never changes.
typedef struct vis_pvs vis_pvs;

// A scene: the objects, their hierarchy and their occluder meshes.
typedef struct vis_scene vis_scene;

// A potentially visible set prepared for a scene. It never changes.
typedef struct vis_scene_pvs vis_scene_pvs;

// A view: a camera and the layers that it shows. Created once, set each frame.
typedef struct vis_view vis_view;

// The objects that a view sees: the result of `vis_pipeline_cull`. It stays what it is when the scene
// changes. Once listed, a render thread can read it while the scene changes.
typedef struct vis_visible vis_visible;

// A portal of a graph: a convex polygon between two cells.
typedef struct vis_portal {
  // Index of the polygon's first vertex among all vertices. The vertices run counter-clockwise as seen
  // from the second cell.
  uint32_t first_vertex;
  // Number of the polygon's vertices.
  uint32_t vertex_count;
  // The two cells that the portal joins.
  uint32_t cells[2];
} vis_portal;

// A convex volume in the world: a cell of a building, or a viewcell of a baked set.
typedef struct vis_volume {
  // Minimum corner of a box around the volume: x, y, z.
  double min[3];
  // Maximum corner of the box.
  double max[3];
  // Index of the first plane that cuts a part off the box, among all planes.
  uint32_t first_plane;
  // Number of planes; 0 if the volume is the box.
  uint32_t plane_count;
} vis_volume;

// How a result differs from what the renderer sees. Pixels are samples: what is falsely hidden is a lower
// bound, what is falsely visible an upper one.
typedef struct vis_comparison {
  // Number of objects with triangles that the result has.
  uint32_t reported_objects;
  // Number of objects that show in a pixel and are missing from the result: always 0 for a conservative
  // pipeline.
  uint32_t false_hidden_objects;
  // Number of objects of the result that show in no pixel.
  uint32_t false_visible_objects;
  // Number of pixels that are wrong if only the result is drawn.
  uint32_t wrong_pixels;
} vis_comparison;

// An axis-aligned box by its minimum and maximum corners.
typedef struct vis_box {
  // Minimum corner: x, y, z.
  float min[3];
  // Maximum corner: x, y, z.
  float max[3];
} vis_box;

// Counters of the work of a frame. They depend neither on the machine nor on time.
typedef struct vis_stats {
  // Number of nodes of the hierarchy whose children were tested.
  uint64_t nodes;
  // Number of nodes whose candidates were all kept without further tests.
  uint64_t accepted_subtrees;
  // Number of tests of one box against one plane, one occlusion map or similar.
  uint64_t tests;
  // Number of occluders drawn.
  uint64_t occluders;
  // Number of objects left.
  uint64_t visible;
} vis_stats;

// Description of an object to insert. Start from `vis_object_default`: all zero describes an object that is
// on no layer and so never seen.
typedef struct vis_object_desc {
  // Bounds relative to the scene's origin. An object whose bounds are inverted, NaN or infinite is never
  // culled.
  struct vis_box bounds;
  // The layers that the object is on, one bit per layer. A view shows objects that share a layer with it.
  uint32_t layers;
  // Cost of drawing the object, in triangles or any other unit.
  uint32_t cost;
  // Any of the flags `VIS_OBJECT_...`, or 0.
  uint32_t flags;
} vis_object_desc;

// Place and directions of a camera, in world coordinates.
typedef struct vis_pose {
  // Position of the eye.
  double eye[3];
  // A point that the camera looks at.
  double target[3];
  // A direction that is upwards in the picture.
  double up[3];
} vis_pose;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

// Returns the `VIS_ABI_VERSION` that the library was built with: programs that load it at run time compare.
uint32_t vis_abi_version(void);

// Makes a graph of `cell_count` cells from arrays: `portals`, and 3 coordinates for each of `vertices`.
enum vis_status vis_graph_create(size_t cell_count,
                                 const struct vis_portal *portals,
                                 size_t portal_count,
                                 const double *vertices,
                                 size_t vertex_count,
                                 struct vis_graph **graph);

// Makes a graph from the text of a portal file of a map compiler, `.prt` in the forms PRT1, PRT2 and
// PRT1-AM, of `length` bytes.
enum vis_status vis_graph_read_prt(const uint8_t *text, size_t length, struct vis_graph **graph);

// Destroys a graph. Does nothing for a null pointer.
void vis_graph_destroy(struct vis_graph *graph);

// Writes the numbers of cells and of portals.
enum vis_status vis_graph_counts(const struct vis_graph *graph, size_t *cells, size_t *portals);

// Computes which cells may be seen from anywhere in which cells, with all portals open. `clearance` is the
// distance that a line of sight keeps from edges of portals to count, in world units; 0 for the default,
// 1e-6 or, if that is more, 2^-33 of the greatest coordinate of a portal. Takes from milliseconds to
// minutes. Conservative.
enum vis_status vis_graph_bake(const struct vis_graph *graph, double clearance, struct vis_pvs **pvs);

// Makes the cells of a building from a graph and from the volumes of its cells, in their order. `planes` has
// 4 numbers a, b, c, d each: what is kept is a x + b y + c z + d >= 0. `tolerance` is the distance by which
// portals and volumes may be misplaced: 1e-6 for metres computed in double precision, the last decimal for
// coordinates read from text. All portals are open. A portal that is wound the wrong way is turned by the
// volumes; a portal whose volumes are not on opposite sides of it is an error. The graph may be destroyed
// afterwards.
enum vis_status vis_cells_create(const struct vis_graph *graph,
                                 const struct vis_volume *cell_volumes,
                                 size_t volume_count,
                                 const double *planes,
                                 size_t plane_count,
                                 double tolerance,
                                 struct vis_cells **cells);

// Destroys cells; pipelines that use them keep them alive. Does nothing for a null pointer.
void vis_cells_destroy(struct vis_cells *cells);

// Limits what is seen from a cell to its row of a baked set, whose targets must be the cells of the graph.
// The set may be destroyed afterwards. Returns `VIS_ERROR_ARGUMENT` for a set that was baked from another
// graph. Of one made by `vis_pvs_create` nobody knows: pipelines with the cells are then
// `VIS_ACCURACY_APPROXIMATE`.
enum vis_status vis_cells_set_pvs(struct vis_cells *cells, const struct vis_pvs *pvs);

// Opens or closes a portal, like a door.
enum vis_status vis_cells_set_open(struct vis_cells *cells, uint32_t portal, bool open);

// Sets in which directions a portal can be seen through while it is open: from its first cell into the
// second (`forward`), from the second into the first (`backward`), or both. To allow neither, close it.
enum vis_status vis_cells_set_passage(struct vis_cells *cells, uint32_t portal, bool forward, bool backward);

// Writes whether one cell may see another through the portals that are open now, from anywhere in it: for
// sound, for the AI of guards.
enum vis_status vis_cells_can_see(const struct vis_cells *cells, uint32_t from, uint32_t to, bool *sees);

// Returns the message of the last call that failed on this thread, in English, UTF-8, ending with a zero
// byte; the empty text if none has failed. Successful calls leave it as it is. The pointer is valid until
// the next call that fails on this thread; never free it.
const char *vis_last_error(void);

// Creates a renderer with an image of `width` by `height` pixels.
enum vis_status vis_measure_create(uint32_t width, uint32_t height, struct vis_measure **measure);

// Destroys a renderer. Does nothing for a null pointer.
void vis_measure_destroy(struct vis_measure *measure);

// Draws all triangles of the scene's objects (`vis_scene_set_triangles`) for a view and compares the result
// of a pipeline for the same view with what shows. Objects without triangles count for nothing.
enum vis_status vis_measure_compare(struct vis_measure *measure,
                                    const struct vis_scene *scene,
                                    const struct vis_view *view,
                                    const struct vis_visible *visible,
                                    struct vis_comparison *comparison);

// Writes the bounds of an object, relative to the scene's origin.
enum vis_status vis_scene_bounds(const struct vis_scene *scene, uint64_t object, struct vis_box *bounds);

// Sets the bounds of an object that has moved or changed its shape. If they differ from the present ones,
// the object loses its occluder mesh, its triangles and its local bounds, which would stay behind: move
// objects that have these by `vis_scene_set_transforms_batch`.
enum vis_status vis_scene_set_bounds(struct vis_scene *scene, uint64_t object, const struct vis_box *bounds);

// Sets the bounds of `count` objects, as `vis_scene_set_bounds` does for one, or of none of them if an id is
// unknown. For what moves each frame.
enum vis_status vis_scene_set_bounds_batch(struct vis_scene *scene,
                                           const uint64_t *ids,
                                           const struct vis_box *bounds,
                                           size_t count);

// Sets the bounds of an object in its own coordinates; `vis_scene_set_transforms_batch` then moves bounds
// and occluder mesh together.
enum vis_status vis_scene_set_local_bounds(struct vis_scene *scene,
                                           uint64_t object,
                                           const struct vis_box *bounds);

// Moves `count` objects that have local bounds, or none of them on an error. `transforms` has 16 numbers per
// object: a matrix from the object's coordinates to the scene's, column-major, with the last row 0 0 0 1.
enum vis_status vis_scene_set_transforms_batch(struct vis_scene *scene,
                                               const uint64_t *ids,
                                               const float *transforms,
                                               size_t count);

// Tightens the hierarchy where objects have moved; call it once per frame. `budget` is about the
// microseconds that the call may take. Writes the number of nodes still waiting to `waiting`, which may be
// null.
enum vis_status vis_scene_maintain(struct vis_scene *scene, size_t budget, size_t *waiting);

// Builds the best hierarchy for the objects as they are: once after loading, not each frame. Ids stay valid.
enum vis_status vis_scene_rebuild(struct vis_scene *scene);

// Stores an occluder mesh in a scene, for any number of objects, and writes its id. `positions` has 3
// numbers per vertex, `indices` 3 per triangle, counter-clockwise from the front. Only front faces hide,
// unless `two_sided`. Each pixel that the mesh covers must be covered by the object as drawn, or visible
// objects are hidden.
enum vis_status vis_scene_add_mesh(struct vis_scene *scene,
                                   const float *positions,
                                   size_t position_count,
                                   const uint32_t *indices,
                                   size_t triangle_count,
                                   bool two_sided,
                                   uint64_t *mesh);

// Stores the occluder mesh of a box in a scene and writes its id: for walls, houses and other solids.
enum vis_status vis_scene_add_box_mesh(struct vis_scene *scene, const struct vis_box *bounds, uint64_t *mesh);

// Removes an occluder mesh from a scene. Its id names no mesh any more. Objects that have the mesh keep it
// until they get another or lose it; its memory is freed with the last of them, at once if there is none.
enum vis_status vis_scene_remove_mesh(struct vis_scene *scene, uint64_t mesh);

// Writes the number of occluder meshes that a scene holds: those that were added and not removed, those that
// an object keeps, and those prepared from the triangles of objects.
enum vis_status vis_scene_mesh_count(const struct vis_scene *scene, size_t *count);

// Gives an object an occluder mesh, which hides others while the object has `VIS_OBJECT_OCCLUDER`.
// `transform` is a matrix of 16 numbers from mesh to scene coordinates, column-major, with the last row
// 0 0 0 1; null for the identity. An object with local bounds is moved there; set bounds before, since a
// change of bounds takes the mesh away. A mesh that reaches out of the bounds hides nothing, and
// `vis_pipeline_lacks` says so.
enum vis_status vis_scene_set_mesh(struct vis_scene *scene,
                                   uint64_t object,
                                   uint64_t mesh,
                                   const float *transform);

// Replaces the triangles of an object, 9 numbers each, in scene coordinates, for
// `vis_scene_prepare_occluders` and `vis_measure_compare`. The object's bounds must contain them, or
// they are an error. They are taken away when the object moves.
enum vis_status vis_scene_set_triangles(struct vis_scene *scene,
                                        uint64_t object,
                                        const float *triangles,
                                        size_t count);

// Makes occluder meshes from the triangles of objects that have `VIS_OBJECT_OCCLUDER` and no mesh, and
// writes the number of objects that got one to `count`. Once after loading.
enum vis_status vis_scene_prepare_occluders(struct vis_scene *scene, size_t *count);

// Creates a pipeline without stages, which reports every object on the view's layers.
enum vis_status vis_pipeline_create(struct vis_pipeline **pipeline);

// Destroys a pipeline. Does nothing for a null pointer.
void vis_pipeline_destroy(struct vis_pipeline *pipeline);

// Appends frustum culling, which should come first: it removes what is outside the view. Conservative.
enum vis_status vis_pipeline_add_frustum(struct vis_pipeline *pipeline);

// Appends the removal of objects that are smaller than `min_pixels` pixels in pictures `picture_height`
// pixels high, out of their draw range, or stood in for by an HLOD parent. If one of the two numbers is
// zero, no object is too small. Approximate.
enum vis_status vis_pipeline_add_contribution(struct vis_pipeline *pipeline,
                                              double picture_height,
                                              double min_pixels);

// Appends occlusion culling by a hierarchical z-buffer in software, which removes what objects with
// `VIS_OBJECT_OCCLUDER` and a mesh hide. `width` and `height` are the buffer's in pixels, 16 to 4096; 0 and
// 0 for the default, 512 x 288. Conservative.
enum vis_status vis_pipeline_add_z_buffer(struct vis_pipeline *pipeline, size_t width, size_t height);

// Appends portal culling, which removes what cannot be seen through the open portals of a building. Several
// pipelines may share the cells, which live as long as any of them, even if destroyed. Conservative.
enum vis_status vis_pipeline_add_portals(struct vis_pipeline *pipeline, const struct vis_cells *cells);

// Appends culling by a baked set, which removes what the set excludes for the viewcells of the eye. Several
// pipelines may share the set, which lives as long as any of them, even if destroyed. Conservative if the
// set is.
enum vis_status vis_pipeline_add_pvs(struct vis_pipeline *pipeline, const struct vis_scene_pvs *pvs);

// Culls: fills `visible` with the objects of the scene that the view may see. Writes the sum of the stages'
// counters to `stats`, which may be null. Once per frame and view; several views of one scene may be culled
// at once on several threads, each with a pipeline and a set of its own.
enum vis_status vis_pipeline_cull(struct vis_pipeline *pipeline,
                                  const struct vis_scene *scene,
                                  const struct vis_view *view,
                                  struct vis_visible *visible,
                                  struct vis_stats *stats);

// Makes all stages forget earlier frames. Never needed for correct results.
enum vis_status vis_pipeline_reset(struct vis_pipeline *pipeline);

// Writes what all stages together promise.
enum vis_status vis_pipeline_accuracy(const struct vis_pipeline *pipeline, enum vis_accuracy *accuracy);

// Writes the counters of one stage in the last frame; stages count from 0 in the order in which they were
// added.
enum vis_status vis_pipeline_stage_stats(const struct vis_pipeline *pipeline,
                                         size_t stage,
                                         struct vis_stats *stats);

// Makes later frames keep culling for the view of the last one (`true`), so that an engine can look from
// elsewhere at what was culled, or for the views passed to them (`false`).
enum vis_status vis_pipeline_freeze(struct vis_pipeline *pipeline, bool frozen);

// Starts or stops recording which stage removes which object, from the next frame on. Frames cost time in
// proportion to the scene meanwhile.
enum vis_status vis_pipeline_set_explaining(struct vis_pipeline *pipeline, bool explaining);

// Writes why an object was, or was not, visible in the last frame, such as "visible" or "removed by
// frustum": a text with a zero byte at its end, and its length with that byte to `count`. With a null `text`
// writes the length alone. "unknown" unless the pipeline was explaining.
enum vis_status vis_pipeline_explain(const struct vis_pipeline *pipeline,
                                     uint64_t object,
                                     char *text,
                                     size_t capacity,
                                     size_t *count);

// Writes what the stages lack to cull a scene, a line each, such as "hzb: occluders without a mesh: 12";
// empty if nothing. Text and length as in `vis_pipeline_explain`.
enum vis_status vis_pipeline_lacks(const struct vis_pipeline *pipeline,
                                   const struct vis_scene *scene,
                                   char *text,
                                   size_t capacity,
                                   size_t *count);

// Loads a set from the `length` bytes that `vis_pvs_write` has stored. They are checked. Files of the
// program `bake` are read by `vis_scene_pvs_read_version`.
enum vis_status vis_pvs_read(const uint8_t *bytes, size_t length, struct vis_pvs **pvs);

// Makes a set of objects from rows, for bakers of your own: viewcell `i` sees the targets from
// `targets[row_ends[i - 1]]` (0 for the first) up to `targets[row_ends[i]]`, exclusive. Each row ascends
// strictly; targets are below `target_count`.
enum vis_status vis_pvs_create(size_t target_count,
                               const size_t *row_ends,
                               size_t viewcell_count,
                               const uint32_t *targets,
                               size_t targets_length,
                               struct vis_pvs **pvs);

// Destroys a set. Does nothing for a null pointer.
void vis_pvs_destroy(struct vis_pvs *pvs);

// Writes the bytes of a set, to be stored as they are, and their number to `count`. With a null `bytes`
// writes the number alone; returns `VIS_ERROR_TOO_SHORT` if `bytes` has room for fewer.
enum vis_status vis_pvs_write(const struct vis_pvs *pvs, uint8_t *bytes, size_t capacity, size_t *count);

// Writes the numbers of viewcells and of targets.
enum vis_status vis_pvs_counts(const struct vis_pvs *pvs, size_t *viewcells, size_t *targets);

// Writes whether a target may be seen from a viewcell; false if the set has no such target or viewcell.
enum vis_status vis_pvs_sees(const struct vis_pvs *pvs, uint32_t viewcell, uint32_t target, bool *sees);

// Writes the row of a viewcell: one bit per target, `target % 32` of word `target / 32`, set for targets
// that may be seen from there, and the number of words to `count`. Null and too short as for
// `vis_pvs_write`. Faster than `vis_pvs_sees` for many targets.
enum vis_status vis_pvs_write_row(const struct vis_pvs *pvs,
                                  uint32_t viewcell,
                                  uint32_t *words,
                                  size_t capacity,
                                  size_t *count);

// Prepares a set for the present state of a scene, for `vis_pipeline_add_pvs`. Viewcell `i` of the set is
// the region `viewcells[i]`; `planes` as in `vis_cells_create`. The arrays `objects` and `targets`, of
// `pair_count`, give objects their targets; an object may have several. Objects without a target, and
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

// Loads the `length` bytes of a file that the program `bake` has written for a scene, for
// `vis_pipeline_add_pvs`. They are checked. The scene must have just the objects of the baked scene,
// inserted in the same order and with the same bounds; returns `VIS_ERROR_ARGUMENT` for another. Objects
// that change later are never hidden. `version` is that of the level, as `bake` prints it: a hash of all
// that the bake rests on, triangles included. Returns `VIS_ERROR_ARGUMENT` if the set is of another version.
enum vis_status vis_scene_pvs_read_version(const struct vis_scene *scene,
                                           const uint8_t *bytes,
                                           size_t length,
                                           uint64_t version,
                                           struct vis_scene_pvs **scene_pvs);

// Loads a file as `vis_scene_pvs_read_version` does, for a level that carries no version. An edit that
// leaves all bounds as they are, such as a new door in a wall, is not noticed, and what it makes visible is
// hidden: pipelines with the set are `VIS_ACCURACY_APPROXIMATE`, and `vis_pipeline_lacks` says why.
enum vis_status vis_scene_pvs_read(const struct vis_scene *scene,
                                   const uint8_t *bytes,
                                   size_t length,
                                   struct vis_scene_pvs **scene_pvs);

// Destroys a prepared set; pipelines that use it keep it alive. Does nothing for a null pointer.
void vis_scene_pvs_destroy(struct vis_scene_pvs *pvs);

// Returns the description of an object on all layers, of cost 1 and without flags.
struct vis_object_desc vis_object_default(struct vis_box bounds);

// Creates an empty scene whose origin is the origin of the world.
enum vis_status vis_scene_create(struct vis_scene **scene);

// Destroys a scene. Does nothing for a null pointer.
void vis_scene_destroy(struct vis_scene *scene);

// Moves the whole scene so that its origin is at a point of the world, `origin`: 3 numbers. Bounds,
// triangles and transforms, which are relative to the origin, stay as they are.
enum vis_status vis_scene_set_origin(struct vis_scene *scene, const double *origin);

// Writes the number of objects.
enum vis_status vis_scene_count(const struct vis_scene *scene, size_t *count);

// Writes an upper bound, exclusive, on the index (`(uint32_t)id`) of every object so far: the length of
// arrays that are indexed by object. `(limit + 31) / 32` words hold a bit for each.
enum vis_status vis_scene_index_limit(const struct vis_scene *scene, size_t *limit);

// Writes whether an id names an object of the scene: false once the object is removed.
enum vis_status vis_scene_contains(const struct vis_scene *scene, uint64_t object, bool *contains);

// Adds an object and writes its id. The lower half of an id, `(uint32_t)id`, is the object's index: small
// and dense, for arrays. A later object may get the index of a removed one, never the id.
enum vis_status vis_scene_insert(struct vis_scene *scene, const struct vis_object_desc *object, uint64_t *id);

// Adds `count` objects, or none of them on an error, and writes their ids to `ids`, an array of `count`.
// Much faster than single calls for a new scene.
enum vis_status vis_scene_insert_batch(struct vis_scene *scene,
                                       const struct vis_object_desc *objects,
                                       size_t count,
                                       uint64_t *ids);

// Removes an object. Its id is unknown from then on.
enum vis_status vis_scene_remove(struct vis_scene *scene, uint64_t object);

// Removes `count` objects, or none of them if an id is unknown or listed twice.
enum vis_status vis_scene_remove_batch(struct vis_scene *scene, const uint64_t *ids, size_t count);

// Sets the layers of an object, one bit per layer. An object with 0 is in no view.
enum vis_status vis_scene_set_layers(struct vis_scene *scene, uint64_t object, uint32_t layers);

// Sets the flags of an object: any of the flags `VIS_OBJECT_...`, or 0, which takes the others. To open a
// door that hides what is behind, take `VIS_OBJECT_OCCLUDER` from the door.
enum vis_status vis_scene_set_flags(struct vis_scene *scene, uint64_t object, uint32_t flags);

// Sets the distances from the eye, in metres, at which an object is drawn, for the stage
// `vis_pipeline_add_contribution`: from `begin` to `end`, which may be infinite. Other stages draw it at
// every distance. Ranges alone leave distances at which neither of two levels of one thing is drawn, where
// their bounds differ: make the far one the parent of the near one by `vis_scene_set_hlod_parent`.
enum vis_status vis_scene_set_draw_range(struct vis_scene *scene, uint64_t object, float begin, float end);

// Makes `parent` stand in for an object beyond the begin of the parent's draw range, for the stage
// `vis_pipeline_add_contribution`; `VIS_NO_OBJECT` for no parent. Both are measured from the bounds of
// the parent, which must contain those of the object.
enum vis_status vis_scene_set_hlod_parent(struct vis_scene *scene, uint64_t object, uint64_t parent);

// Creates a view without a camera, on all layers.
enum vis_status vis_view_create(struct vis_view **view);

// Destroys a view. Does nothing for a null pointer.
void vis_view_destroy(struct vis_view *view);

// Sets the camera of a view by the matrix that the engine draws with: 16 numbers, column-major, from the
// world to clip space. `depth` is the `vis_depth` that the matrix was made for. `origin` has the 3
// coordinates of the point of the world that the matrix is relative to, for engines that draw relative to
// the camera; null for the origin of the world. The view keeps its layers and loses its clip planes.
//
// Two conditions, which every camera meets, are not checked: clip-space w does not decrease away from the
// eye, and the near plane is not behind the eye. Occlusion culling relies on them.
enum vis_status vis_view_set_matrix(struct vis_view *view,
                                    const float *matrix,
                                    uint32_t depth,
                                    const double *origin);

// Like `vis_view_set_matrix`, for a matrix in double precision.
enum vis_status vis_view_set_matrix_f64(struct vis_view *view,
                                        const double *matrix,
                                        uint32_t depth,
                                        const double *origin);

// Sets the camera of a view by its pose and lens, for programs that have no matrix. `fov_y` is the vertical
// field of view in radians, `aspect` width over height, `near_plane` and `far_plane` the distances of the
// planes; `far_plane` may be infinite. The view keeps its layers and loses its clip planes.
enum vis_status vis_view_set_perspective(struct vis_view *view,
                                         const struct vis_pose *pose,
                                         double fov_y,
                                         double aspect,
                                         double near_plane,
                                         double far_plane);

// Sets the camera of a view with parallel lines of sight: shadow cascades, maps, plans. The picture is
// `width` by `height` metres around the viewing axis; `near_plane` and `far_plane` are distances from the
// eye along the axis, and `near_plane` may be negative. The view keeps its layers and loses its clip planes.
enum vis_status vis_view_set_orthographic(struct vis_view *view,
                                          const struct vis_pose *pose,
                                          double width,
                                          double height,
                                          double near_plane,
                                          double far_plane);

// Sets the layers that a view shows, one bit per layer. They outlast changes of the camera.
enum vis_status vis_view_set_layers(struct vis_view *view, uint32_t layers);

// Restricts a view to one side of each of `count` planes: 4 numbers a, b, c, d each, of the points with
// a x + b y + c z + d >= 0, relative to the origin of the matrix, or to the eye of a view that was set by a
// pose. They replace former ones. At most 10.
enum vis_status vis_view_set_clip_planes(struct vis_view *view, const double *planes, size_t count);

// Creates a set for the results of one view. With `with_changes` it also tells what became visible and
// hidden since the frame before, for a few nanoseconds per visible object.
enum vis_status vis_visible_create(bool with_changes, struct vis_visible **visible);

// Destroys a set. Does nothing for a null pointer.
void vis_visible_destroy(struct vis_visible *visible);

// Lists the visible objects, unless `vis_visible_sort_by_index` or a set with changes has: once listed, the
// functions below need no scene, so that a render thread can read the set while the scene changes.
enum vis_status vis_visible_list(struct vis_visible *visible, const struct vis_scene *scene);

// Writes the number of visible objects that are still in the scene. `scene` may be null if the set is
// listed; objects removed since then are counted.
enum vis_status vis_visible_count(const struct vis_visible *visible,
                                  const struct vis_scene *scene,
                                  size_t *count);

// Writes whether an object is visible. False if it has been removed from the scene since.
enum vis_status vis_visible_contains(const struct vis_visible *visible,
                                     const struct vis_scene *scene,
                                     uint64_t object,
                                     bool *contains);

// Sorts the visible objects by ascending index, the order in which arrays that are indexed by object are
// read fastest, and drops those removed from the scene since. Without it, neighbours in space follow each
// other.
enum vis_status vis_visible_sort_by_index(struct vis_visible *visible, const struct vis_scene *scene);

// Writes the ids of the visible objects that are still in the scene, and their number to `count`. With a
// null `ids` writes the number alone; returns `VIS_ERROR_TOO_SHORT` if `ids` has room for fewer. `scene` may
// be null if the set is listed; objects removed since then are written too.
enum vis_status vis_visible_ids(const struct vis_visible *visible,
                                const struct vis_scene *scene,
                                uint64_t *ids,
                                size_t capacity,
                                size_t *count);

// Like `vis_visible_ids`, writes the indices of the visible objects: half the memory, for engines whose data
// is in arrays.
enum vis_status vis_visible_indices(const struct vis_visible *visible,
                                    const struct vis_scene *scene,
                                    uint32_t *indices,
                                    size_t capacity,
                                    size_t *count);

// Writes one bit per object index, `index % 32` of word `index / 32`, set for visible objects that are still
// in the scene, and the number of words to `count`. Null and too short as for `vis_visible_ids`; the number
// of words follows from `vis_scene_index_limit`.
enum vis_status vis_visible_write_bits(const struct vis_visible *visible,
                                       const struct vis_scene *scene,
                                       uint32_t *words,
                                       size_t capacity,
                                       size_t *count);

// Writes the ids of the objects that are visible and were not in the frame before, as `vis_visible_ids`
// does. None unless the set was created with changes.
enum vis_status vis_visible_newly_visible(const struct vis_visible *visible,
                                          uint64_t *ids,
                                          size_t capacity,
                                          size_t *count);

// Writes the ids of the objects that were visible in the frame before and are not, as `vis_visible_ids`
// does; removed objects too. None unless the set was created with changes.
enum vis_status vis_visible_newly_hidden(const struct vis_visible *visible,
                                         uint64_t *ids,
                                         size_t capacity,
                                         size_t *count);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* VISIBILITY_H */
