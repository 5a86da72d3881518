// Which objects can this camera see?
//
// Matrices have 16 numbers, column-major, and multiply column vectors: element [4 * column + row], as in
// WebGL, three.js and gl-matrix. Axes, handedness and units are yours; where metres are written, any unit of
// length serves.
//
// A call that fails throws a `VisibilityError` and has changed nothing. Arrays that are passed are not kept.

export type Triple = readonly [number, number, number] | ArrayLike<number>;
/** A list of numbers: a typed array, or a plain one. */
export type Numbers = ArrayLike<number>;
/**
 * Id of an object. `indexOf(id)` is small and dense, for arrays; a removed object's index comes back, its id
 * never.
 */
export type ObjectId = bigint;
/** Id of an occluder mesh of a scene. */
export type MeshId = bigint;

/** Loads the library: without options, the whole module with SIMD instructions where the browser has them. */
export function load(options?: {
  /**
   * Whether to take the small module, of a third of the size: scenes and their occluders, views, visible sets,
   * pipelines of frustum, size and z-buffer with a reach, levels of detail and draw lists. What else is called throws
   * an error of code `STATE`.
   */
  frames?: boolean;
  /** Whether to take the module with 128-bit SIMD instructions. Both give the same answers. */
  simd128?: boolean;
  /** The module itself, where it cannot be fetched from beside `visibility.js`. It must fit the options. */
  wasm?: URL | BufferSource | WebAssembly.Module;
}): Promise<Visibility>;

/** Whether this browser runs WebAssembly with 128-bit SIMD instructions. */
export function hasSimd128(): boolean;

/** The index of an object. */
export function indexOf(id: ObjectId): number;

/** All layers: what objects and views have unless they are given others. */
export const ALL_LAYERS: number;
/** The id of no object in any scene. */
export const NO_OBJECT: ObjectId;

/** Depth convention of a clip matrix: which clip-space depths z are in view, relative to clip-space w. */
export const Depth: {
  /** z is -w at the near plane and w at the far plane: WebGL. */
  readonly NegativeOneToOne: 0;
  /** z is -w at the near plane; there is no far plane. */
  readonly NegativeOneToOneInfinite: 1;
  /** z is 0 at the near plane and w at the far plane: WebGPU. */
  readonly ZeroToOne: 2;
  /** z is 0 at the near plane; there is no far plane. */
  readonly ZeroToOneInfinite: 3;
  /** z is w at the near plane and 0 at the far plane. */
  readonly Reversed: 4;
  /** z is w at the near plane; there is no far plane. */
  readonly ReversedInfinite: 5;
};
export type Depth = (typeof Depth)[keyof typeof Depth];

/** Flags of objects; combine them with `|`. */
export const Flag: {
  /** Visible in every view of its layers, whatever the cullers find. */
  readonly NeverCull: 1;
  /** Opaque, and may hide others. Only an object with an occluder mesh hides anything. */
  readonly Occluder: 2;
  /** What is behind is drawn through it: glass, blended and alpha-tested surfaces. No occluder. For `Judge`. */
  readonly SeeThrough: 4;
  /** Its triangles are drawn from their front alone, as with backface culling. For `Judge`. */
  readonly OneSided: 8;
};

/** Effect of a wall on lines of sight that cross it. */
export const Opacity: {
  /** Lines of sight end at the wall: a solid wall, a closed door. */
  readonly Opaque: 0;
  /** Lines of sight pass: glass, an open door, or a line that makes the cells of a large room smaller. */
  readonly Clear: 1;
  /** Lines of sight pass from the left of the wall to its right, as seen along it from `from`, and not back. */
  readonly OneWay: 2;
};
export type Opacity = (typeof Opacity)[keyof typeof Opacity];

/** What was wrong: an argument, an unknown id, damaged content, something that has to be done first. */
export type ErrorCode =
  | "NULL"
  | "ARGUMENT"
  | "UNKNOWN_ID"
  | "TOO_SHORT"
  | "FORMAT"
  | "STATE"
  | "BUSY"
  /** A fault inside the library: load it anew. */
  | "PANIC";

export class VisibilityError extends Error {
  readonly code: ErrorCode;
}

export interface Box {
  min: Triple;
  max: Triple;
}

/**
 * A convex volume: a box, without what planes cut off it. Of a plane [a, b, c, d], a x + b y + c z + d >= 0
 * is kept.
 */
export interface Volume extends Box {
  planes?: readonly Numbers[];
}

/** A convex polygon between two cells. Its vertices run counter-clockwise as seen from the second. */
export interface Portal {
  vertices: readonly Triple[];
  cells: readonly [number, number];
}

/** A wall of a floor plan, as high as the level: the plan's x and y of its two ends. */
export interface Wall {
  from: readonly [number, number] | ArrayLike<number>;
  to: readonly [number, number] | ArrayLike<number>;
  /** `Opacity.Opaque` by default. */
  opacity?: Opacity;
}

/**
 * A ray from `origin`, relative to the scene's origin, along `direction`, of any length but zero. Both are rounded to
 * single precision: far from the scene's origin, a ray may miss what the unrounded one hits.
 */
export interface Ray {
  origin: Triple;
  direction: Triple;
  /** Length of the ray: infinite by default. */
  maxDistance?: number;
  /** The ray hits objects on these layers: all by default. */
  layers?: number;
}

export interface RayHit {
  id: ObjectId;
  distance: number;
}

/**
 * A light that casts shadows: the sun, by a direction from lit points `toward` it; a lamp at `position`; or a spot
 * light at `position`, along `direction` away from it, with an angle of `halfAngle` radians between axis and side.
 * Beyond `range`, infinite by default, it casts no shadow.
 */
export type Light =
  | { toward: Triple }
  | { position: Triple; range?: number }
  | { position: Triple; direction: Triple; halfAngle: number; range?: number };

/** Place and directions of a camera. */
export interface Pose {
  eye: Triple;
  /** A point that the camera looks at. */
  target: Triple;
  /** A direction that is upwards in the picture. */
  up: Triple;
}

/** Counters of the work of a frame. They depend neither on the machine nor on time. */
export interface Stats {
  nodes: number;
  acceptedSubtrees: number;
  tests: number;
  occluders: number;
  visible: number;
}

/** The work that one step of `Online` has done. */
export interface OnlineStep {
  /** Whether the step worked on a wide box, not on a viewcell. */
  isWide: boolean;
  /** Whether the step has finished its box, which answers frames from now on. */
  isFinished: boolean;
  stats: Stats;
}

/**
 * The level of detail to draw for a visible object. While `fade` is less than 1, `previous` is drawn too: the weight of
 * `level` is `fade * opacity`, that of `previous` is `(1 - fade) * opacity`.
 */
export interface Lod {
  /** 0 for the finest. */
  level: number;
  /** Level that `level` replaces; equal to `level` while no cross-fade is in progress. */
  previous: number;
  /** Weight of `level` in the cross-fade, from 0 to 1; 1 while none is in progress. */
  fade: number;
  /** Opacity by the draw range: less than 1 only for an object that fades, by the `margin` of `setDrawRange`. */
  opacity: number;
}

/** A mirror that is seen in a frame. */
export interface Reflection {
  /** Number of the mirror, as `Cells.addMirror` returned it. */
  mirror: number;
  /** Number of the reflection in which the mirror is seen; null if the eye sees it itself. */
  parent: number | null;
  /** Number of mirrors along the lines of sight: 1 if the eye sees the mirror itself. */
  depth: number;
}

/** Levels of detail of many objects: of each property a list, in the same order. */
export interface SelectedLods {
  ids: BigUint64Array;
  levels: Uint8Array;
  previous: Uint8Array;
  fades: Float32Array;
  opacities: Float32Array;
}

/** How a result differs from what a software renderer sees. */
export interface Comparison {
  reportedObjects: number;
  /** Objects that show in a pixel and are missing from the result: 0 for a conservative pipeline. */
  falseHiddenObjects: number;
  /** Objects of the result that show in no pixel. */
  falseVisibleObjects: number;
  /** Pixels that are wrong if only the result is drawn. */
  wrongPixels: number;
}

/** Something in the library's memory. It is freed when it is collected, or now by `destroy`. */
interface Handle {
  destroy(): void;
}

export interface Visibility {
  /** Whether this is the module with SIMD instructions. */
  readonly simd128: boolean;
  /** The module's memory. */
  readonly memory: WebAssembly.Memory;
  createScene(): Scene;
  createView(): View;
  /** Creates a pipeline without stages, which reports every object on the view's layers. */
  createPipeline(): Pipeline;
  /** Creates a set for the results of one view; with `changes`, it also tells what appeared and vanished. */
  createVisible(options?: { changes?: boolean }): Visible;
  /**
   * Creates levels of detail for one view, whose pictures are so many pixels high. A level changes only when the size is
   * beyond its limit by the fraction `hysteresis`, 0 to 0.9 and 0.1 by default, and in a cross-fade of `fade` seconds,
   * 0.25 by default, 0 for none.
   */
  createLods(pictureHeight: number, options?: { hysteresis?: number; fade?: number }): Lods;
  /** Creates an empty draw list. */
  createDrawList(): DrawList;
  /**
   * Creates a software renderer of so many pixels that judges results: for tests and tools, not for frames.
   */
  createJudge(width: number, height: number): Judge;
  /** Creates a graph of convex cells and of the portals between them. */
  createGraph(cellCount: number, portals: readonly Portal[]): Graph;
  /** Creates a graph from the text of a portal file of a map compiler: PRT1, PRT2 or PRT1-AM. */
  readPrt(text: string): Graph;
  /**
   * Creates the cells of a building from a graph and the volumes of its cells. `tolerance` is the distance by
   * which portals and volumes may be misplaced, 1e-6 by default. All portals are open. A portal that is wound
   * the wrong way is turned by the volumes; a portal whose volumes are not on opposite sides of it is an error.
   */
  createCells(graph: Graph, volumes: readonly Volume[], options?: { tolerance?: number }): Cells;
  /**
   * Creates cells and portals from the triangles of a scene's occluders: space is divided along large walls, and each
   * gap between triangles is a portal, unless it is narrower than 2^-20 of the greatest coordinate relative to the
   * scene's origin, or 2^-36 of that in the world. There are at most `maxCells`, 16,384 by default. `count` of the
   * result is 0 where all space sees backs of one-sided triangles: such cells hide nothing. They are of the occluders
   * of all layers as they are now: for views that show them all. Takes from milliseconds to minutes.
   */
  createCellsOfScene(scene: Scene, options?: { maxCells?: number }): Cells & { readonly count: number };
  /**
   * Creates reflections of one view in the mirrors of cells: at most `maxCount` in a frame, 8 by default, and at most
   * `maxDepth` mirrors along a line of sight, 2 by default.
   */
  createReflections(cells: Cells, options?: { maxCount?: number; maxDepth?: number }): Reflections;
  /**
   * Creates sets of what can be seen around one eye on the move. `viewcell` and `wide` are the sizes along x, y and
   * z, in metres, of the viewcells and of the wide boxes that these lie in, which are at least as large: 0.6 m and
   * 4 x 4 x 1 m for someone who walks. `margin` is how far a viewcell extends at least around each place that it
   * holds: to the corners of the near plane, and to both eyes of a headset; an eighth of the least size by default,
   * half of it at most.
   */
  createOnline(settings: { viewcell: Triple; wide: Triple; margin?: number }): Online;
  /**
   * Creates a floor plan of walls, which are numbered from 0 in the given order, and may cross and touch. Around them
   * is a rectangle with a margin of a quarter of their extent, at least 1, where what an eye sees ends.
   */
  createPlan(walls: readonly Wall[]): Plan;
  /**
   * Creates the occluders of a level: its opaque triangles that stand still, 9 numbers each, joined into few large
   * polygons that hide only what the triangles hide. `twoSided` is whether they hide from behind, too. Takes seconds for
   * a million triangles.
   */
  createLevel(triangles: Numbers, options?: { twoSided?: boolean }): Level;
  /**
   * Loads the occluders of a level from the `bytes` of another. The library cannot tell whether the bytes are of the
   * level as it is now: occluders of another level hide visible objects. Throws "FORMAT" for bytes of anything else.
   */
  readLevel(bytes: Uint8Array): Level;
  /**
   * Creates sight cells from the walls of a floor plan. `axes` are the axes of the world that are the plan's x and y:
   * `[0, 1]`, the default, if z is up. Movers do not pass opaque walls. Leave out walls that one can look over. Clear
   * walls along a grid of some metres make large rooms hide more.
   */
  createSightCellsOfPlan(walls: readonly Wall[], options?: { axes?: readonly [number, number] }): SightCells;
  /**
   * Creates sight cells from the cells of a building, their volumes as in `createCells`, and what `graph.bake()`
   * returned. Outside the cells all is solid; doors count as open.
   */
  createSightCellsOfPortals(
    graph: Graph,
    volumes: readonly Volume[],
    pvs: Pvs,
    options?: { tolerance?: number },
  ): SightCells;
  /**
   * Creates sight cells for a scene whose occluders stand still, from boxes of the world, 6 numbers each, least
   * corner first. Takes milliseconds to a second a box.
   */
  createSightCellsOfScene(scene: Scene, boxes: Numbers): SightCells;
  /**
   * Creates sight cells for a scene that changes, from boxes of the world, 6 numbers each. Adds an object to the
   * scene for each box, which hides nothing and no view shows. While no box of `online` holds all that a mover may
   * reach, it sees all: the margin of `online` should be half the greatest extent of that, and `step` should get the
   * middles of the movers as places.
   */
  createOnlineSightCells(scene: Scene, online: Online, boxes: Numbers): SightCells;
  /** Creates an answer to who sees whom, without observers and targets. */
  createWhoSees(): WhoSees;
  /** Loads a set from the `bytes` of another. Files of the program `bake` are read by `readScenePvs`. */
  readPvs(bytes: Uint8Array): Pvs;
  /**
   * Creates a set of objects: row `i` has the targets, ascending and below `targetCount`, that viewcell `i`
   * sees.
   */
  createPvs(targetCount: number, rows: readonly Numbers[]): Pvs;
  /**
   * Prepares a set for the present state of a scene. `targets[i]` is a target of object `ids[i]`; an object
   * may have several. Objects without a target, and objects that change later, are never hidden.
   */
  createScenePvs(
    scene: Scene,
    pvs: Pvs,
    viewcells: readonly Volume[],
    ids: ArrayLike<ObjectId>,
    targets: Numbers,
  ): ScenePvs;
  /**
   * Loads a file that the program `bake` has written for a scene. The scene must have just the objects of the
   * baked scene, inserted in the same order and with the same bounds. Objects that change later are never hidden.
   * `version` is that of the level, as `bake` prints it (`BigInt("0x...")`): a set from before an edit is refused.
   * Without it an edit that leaves all bounds is not noticed, and pipelines with the set are approximate.
   */
  readScenePvs(scene: Scene, bytes: Uint8Array, version?: bigint): ScenePvs;
}

/** The objects, their hierarchy and their occluder meshes. */
export interface Scene extends Handle {
  readonly count: number;
  /** Upper bound, exclusive, on the index of every object so far. */
  readonly indexLimit: number;
  /** Moves the whole scene so that its origin is at a point of the world. */
  setOrigin(origin: Triple): void;
  /** Adds an object. One whose box is inverted, NaN or infinite is never culled. */
  insert(object: { bounds: Box; layers?: number; cost?: number; flags?: number }): ObjectId;
  /**
   * Adds objects: 6 numbers of `bounds` each, least corner first, and one number, or one each, of all else.
   */
  insertAll(objects: {
    bounds: Numbers;
    layers?: number | Numbers;
    cost?: number | Numbers;
    flags?: number | Numbers;
  }): BigUint64Array;
  remove(id: ObjectId): void;
  /** Removes objects, or none of them if an id is unknown or listed twice. */
  removeAll(ids: ArrayLike<ObjectId>): void;
  contains(id: ObjectId): boolean;
  bounds(id: ObjectId): { min: number[]; max: number[] };
  /**
   * Sets the box of an object that moved. It loses mesh, triangles and local bounds, which would stay behind.
   */
  setBounds(id: ObjectId, box: Box): void;
  /** Sets the boxes of objects, 6 numbers each: for what moves each frame. */
  setAllBounds(ids: ArrayLike<ObjectId>, bounds: Numbers): void;
  /** Sets the box of an object in its own coordinates; `setTransforms` then moves box and mesh together. */
  setLocalBounds(id: ObjectId, box: Box): void;
  /** Moves objects that have local bounds: 16 numbers each. */
  setTransforms(ids: ArrayLike<ObjectId>, matrices: Numbers): void;
  setLayers(id: ObjectId, layers: number): void;
  setFlags(id: ObjectId, flags: number): void;
  /**
   * Sets the distances at which an object is drawn, for `addContribution`. With a `margin`, 0 by default, the object
   * fades over that length inside of the range, from `begin` on and out up to `end`, by the `opacity` of `Lods`; a range
   * from 0 does not fade in. An object that fades hides nothing.
   */
  setDrawRange(id: ObjectId, begin: number, end?: number, margin?: number): void;
  /**
   * Makes `parent` stand in for an object beyond the begin of the parent's draw range, for `addContribution`.
   */
  setHlodParent(id: ObjectId, parent?: ObjectId): void;
  /**
   * Gives objects the same levels of detail, those of their mesh, for `Lods`: the sizes in pixels that divide the levels,
   * at most 255. With `[200, 50]`, level 0 is for 200 pixels and more, level 1 for 50 and more, level 2 for all below.
   * Without sizes, as for new objects, the level is 0. Each different list of sizes that an object is given is kept as
   * long as the scene.
   */
  setLodSizes(ids: ArrayLike<ObjectId>, sizes: Numbers): void;
  /**
   * Gives each object its key in draw lists: the number of its mesh, of its material, of the first level of its mesh, or
   * several of them in one number; at most 4294967040. New objects have key 0.
   */
  setDrawKeys(ids: ArrayLike<ObjectId>, keys: Numbers): void;
  /**
   * Stores an occluder mesh for any number of objects: 3 numbers a vertex, 3 indices a triangle,
   * counter-clockwise from the front. Each pixel that it covers must be covered by the object as drawn, or
   * visible objects are hidden.
   */
  addMesh(mesh: { positions: Numbers; indices: Numbers; twoSided?: boolean }): MeshId;
  /** Stores a box as an occluder mesh, rounded inwards to single precision. */
  addBoxMesh(box: Box): MeshId;
  /** Removes an occluder mesh. Objects that have it keep it until they get another or lose it. */
  removeMesh(mesh: MeshId): void;
  /** Number of occluder meshes: those not removed, those that objects keep, and those prepared. */
  readonly meshCount: number;
  /**
   * Gives an object an occluder mesh; `transform`, 16 numbers, places it in the scene. A mesh that reaches out of
   * the object's box hides nothing, and `lacks` says so.
   */
  setMesh(id: ObjectId, mesh: MeshId, transform?: Numbers): void;
  /** Gives an object triangles within its box, 9 numbers each, for `prepareOccluders`, `proveFrom` and `Judge`. */
  setTriangles(id: ObjectId, triangles: Numbers): void;
  /**
   * Makes occluder meshes from the triangles of objects with `Flag.Occluder` and no mesh; returns how many.
   */
  prepareOccluders(): number;
  /**
   * Objects whose boxes a ray hits, nearest first: candidates for picking, since no triangle of an object is nearer
   * than its box. `origin` is relative to the scene's origin; `distance` is in units of length, 0 for a box around it.
   */
  rayHits(ray: Ray): RayHit[];
  /** The first of `rayHits`; null if there is none. */
  firstHit(ray: Ray): RayHit | null;
  /** Ids of the objects whose boxes touch a box. */
  inBox(box: Box, options?: { layers?: number }): BigUint64Array;
  /**
   * One bit per index, as in `Visible.bits`, of the objects that can be seen from somewhere in a box of the world: a
   * sweep of the box over the occluders. Conservative for views that draw the layers of all occluders. Takes
   * milliseconds to a second.
   */
  seenFrom(box: Box): Uint32Array;
  /**
   * Decides objects by rays and proofs among the triangles of `setTriangles`: bits of those to which a line of sight
   * from the box was found, and of those that are proven hidden from all of the box, for views that draw the layers of
   * all occluders. Objects with neither bit are not decided, and count as visible. An object that is never culled is
   * never hidden. An object without triangles is its box: no ray sees it, and it hides nothing. With a `clearance` of
   * 0, the default, no visible object is proven hidden; with one in metres also what is seen only through gaps narrower
   * than 12 clearances, or at grazing angles, is. The search ends after `mostSteps` steps; 0, the default, for no end,
   * which may take minutes. A step is a search node of some microseconds, or at most 200 rays. Each call first collects
   * all triangles, about 150 bytes of memory each, which `mostSteps` does not bound.
   */
  proveFrom(box: Box, options?: { clearance?: number; mostSteps?: number }): { seen: Uint32Array; hidden: Uint32Array };
  /**
   * Tightens the hierarchy where objects have moved; once per frame. Returns the number of nodes still
   * waiting.
   */
  maintain(budget?: number): number;
  /** Builds the best hierarchy for the objects as they are: once after loading. */
  rebuild(): void;
}

/** A camera and the layers that it shows. Created once, set each frame. */
export interface View extends Handle {
  /**
   * Sets the matrix that the engine draws with, from the world to clip space. `origin` is the point of the
   * world that the matrix is relative to, for engines that draw relative to the camera.
   */
  setMatrix(matrix: Numbers, depth: Depth, origin?: Triple): void;
  /**
   * Sets a camera without a matrix: vertical field of view in radians, width over height, distances of
   * planes.
   */
  setPerspective(camera: Pose & { fovY: number; aspect: number; near: number; far?: number }): void;
  /** Sets a camera with parallel lines of sight. */
  setOrthographic(camera: Pose & { width: number; height: number; near: number; far: number }): void;
  setLayers(layers: number): void;
  /**
   * The matrix from the world, relative to a point of it or to its origin, to clip space, column-major, in the depth
   * convention of the view. For views that the library makes: those of mirrors.
   */
  matrix(origin?: Triple): Float64Array;
  /** The clip planes, relative to a point of the world or to its origin: see `setClipPlanes`. */
  clipPlanes(origin?: Triple): Float64Array[];
  /**
   * Whether an answer made for the view `of`, with a reach of so many metres and radians, is good for this view:
   * see `Pipeline.setReach`. False for parallel views and views with clip planes.
   */
  isWithinReach(of: View, metres: number, radians: number): boolean;
  /** Restricts the view to one side of each plane, relative to the origin of the matrix. At most 10. */
  setClipPlanes(planes: readonly Numbers[]): void;
}

/** The cullers of one view, in the order in which they were added, with their memory of earlier frames. */
export interface Pipeline extends Handle {
  /** Removes what is outside the view; the first stage. Conservative. */
  addFrustum(): this;
  /**
   * Removes objects smaller than so many pixels, or out of their draw range. Goes before the z-buffer: an
   * object that is not drawn must not hide others. Approximate.
   */
  addContribution(pictureHeight: number, leastPixels: number): this;
  /**
   * Changes what `addContribution` added last, for later frames. Distances of draw ranges and HLOD parents are measured
   * from `distanceEye`, a point of the world, or from the view's own eye without it: a view of a light gets the eye of
   * the camera, so that it shows the objects that the camera shows. Reflections of the pipeline have it anyway.
   */
  setContribution(pictureHeight: number, leastPixels: number, distanceEye?: Triple): void;
  /**
   * Removes what occluders hide, by a z-buffer of this size in pixels, 512 x 288 by default. Conservative.
   */
  addZBuffer(width?: number, height?: number): this;
  /** Removes what is not seen through the open portals of a building. Conservative. */
  addPortals(cells: Cells): this;
  /**
   * As `addPortals`, by the cells of the reflections, and finds what is seen in mirrors. The reflections are those of the
   * last frame of the pipeline, so each pipeline needs reflections of its own: throws `STATE` if another one has these.
   * With `addContribution`, what mirrors show is culled as well, by sizes in the mirror and distances from the eye of
   * the camera.
   */
  addReflections(reflections: Reflections): this;
  /** Removes what a baked set excludes. Conservative if the set is. */
  addPvs(pvs: ScenePvs): this;
  /**
   * Removes what is hidden from the box around the eye and its near plane; nothing while no box is ready.
   * Conservative.
   */
  addOnline(online: Online): this;
  /**
   * Removes what upright solids, walls and hills of the occluders hide, for cities and terrain seen from near
   * the ground. They are found in the first frame, and follow the scene. Conservative.
   */
  addHorizon(options: { up: "y" | "z" }): this;
  /**
   * Removes objects whose shadow from a light cannot fall on any point that the view shows: the first stage of the
   * pipeline that selects objects for the light's shadow map, without a frustum. The view is the camera's, or that of
   * a cascade, on the layers of all casters. Conservative for shadows.
   */
  addCasters(light: Light): this;
  /**
   * As `addZBuffer`, and the occluders of a level hide, too. `origin` is the point of the world that the level's
   * triangles are relative to. Conservative for views that draw the whole level: its triangles have no layers.
   */
  addZBufferOfLevel(level: Level, options?: { width?: number; height?: number; origin?: Triple }): this;
  /**
   * Makes the answers of later frames good for all views whose eye is within so many metres, and whose
   * direction is within so many radians, of the frame's view: frames with such views keep the answer and do no
   * work. 0 and 0 ends that. A stage other than the frustum, portals and the z-buffer has no such answer.
   */
  setReach(metres: number, radians: number): void;
  /**
   * Whether the last frame kept an earlier answer. A third frame of one view and one scene does, if there is an
   * answer for the whole reach.
   */
  readonly isKept: boolean;
  /** Fills `visible` with the objects that the view may see; once per frame and view. */
  cull(scene: Scene, view: View, visible: Visible): Stats;
  /** Counters of one stage in the last frame. */
  stageStats(stage: number): Stats;
  /** What all stages together promise. */
  readonly accuracy: "exact" | "conservative" | "aggressive" | "approximate";
  /** Forgets earlier frames. Never needed for correct results. */
  reset(): void;
  /**
   * Makes later frames keep culling for the view of the last one, so that one can look at what was culled.
   */
  freeze(frozen?: boolean): void;
  /** Starts or stops recording which stage removes which object. */
  setExplaining(explaining: boolean): void;
  /** Says why an object was, or was not, visible in the last frame, such as "removed by frustum". */
  explain(id: ObjectId): string;
  /** Says what the stages lack to cull a scene, a line each, such as "hzb: occluders without a mesh: 12". */
  lacks(scene: Scene): string;
}

/** The objects that a view sees, without those that were removed from the scene since. */
export interface Visible extends Handle {
  readonly count: number;
  /**
   * Indices of the visible objects, in the library's memory: valid until `indices` is read again, and until
   * the memory grows, which leaves an empty array. Read them at once, or copy them with `slice()`.
   */
  readonly indices: Uint32Array;
  readonly ids: BigUint64Array;
  /** One bit per index: bit `index % 32` of word `index / 32`. */
  readonly bits: Uint32Array;
  /** Objects that are visible and were not in the frame before; for sets created with `changes`. */
  readonly newlyVisible: BigUint64Array;
  readonly newlyHidden: BigUint64Array;
  contains(scene: Scene, id: ObjectId): boolean;
  /** Sorts the objects by ascending index. */
  sortByIndex(scene: Scene): void;
}

/** Levels of detail of the visible objects of one view, with those of the frame before. */
export interface Lods extends Handle {
  /** Sets the height in pixels of the pictures of later frames. */
  setPictureHeight(pictureHeight: number): void;
  /**
   * Sets the point of the world from which the distances of draw ranges are measured in later frames; without it the
   * view's own eye. For views of lights and mirrors.
   */
  setDistanceEye(eye?: Triple): void;
  /**
   * Chooses the level of each object of `visible`, the set of this view's frame, by its size in pixels and the sizes of
   * `Scene.setLodSizes`; once per frame. The size is the diameter in pixels of the sphere around the object's box, as if
   * it were at the nearest point of the box in the middle of the picture. Cross-fades advance by `elapsedSeconds`, the
   * time since the frame before. An object that was not visible in the frame before has the level of its size at once.
   */
  select(scene: Scene, view: View, visible: Visible, elapsedSeconds: number): void;
  /** The levels of the visible objects of the last frame, in the order of the visible set. */
  readonly selected: SelectedLods;
  /** The level of one object in the last frame; null if it was not visible. */
  lod(id: ObjectId): Lod | null;
  /** Forgets earlier frames, so that the next one begins without cross-fades: after a cut of the camera. */
  reset(): void;
}

/** Visible objects grouped by the keys of `Scene.setDrawKeys`. Kept from frame to frame. */
export interface DrawList extends Handle {
  /**
   * Replaces the content by the visible objects that are still in the scene, in groups of one key: groups in the order
   * of their keys, the objects of a group in the order of the visible set.
   */
  group(scene: Scene, visible: Visible): void;
  /**
   * Replaces the content by the objects of the last frame of `lods` that are still in the scene. The key of a group is
   * the sum of the objects' key and the level to draw, so the levels of a mesh have keys one after another.
   */
  groupLevels(scene: Scene, lods: Lods): void;
  /**
   * As `groupLevels`, for the objects in a cross-fade alone, by the level that fades out: what is drawn a second time.
   */
  groupFading(scene: Scene, lods: Lods): void;
  /** The groups by ascending key, 3 numbers each: key, position of the first object in `instances`, number of objects. */
  readonly groups: Uint32Array;
  /** The index of each object, group after group: the buffer in which a shader looks up the object of an instance. */
  readonly instances: Uint32Array;
  /**
   * The commands that draw the groups, one each, as WebGPU's `drawIndexedIndirect` reads them: 5 numbers, which are the
   * number of indices, the number of instances, the first index, the base vertex (signed) and the first instance. Those
   * of a key in `meshes` draw its mesh, whose instances are replaced by those of the group. Throws "ARGUMENT" if
   * `meshes` has no command for a key.
   */
  commands(meshes: Numbers): Uint32Array;
}

export interface Judge extends Handle {
  /** Draws all triangles of the scene for the view, and compares the result of a pipeline with what shows. */
  compare(scene: Scene, view: View, visible: Visible): Comparison;
}

export interface Graph extends Handle {
  readonly counts: { cells: number; portals: number };
  /** Computes which cells may be seen from which, with all portals open: from milliseconds to minutes. */
  bake(clearance?: number): Pvs;
}

/** The cells of a building with their doors, shared by the pipelines of all views. */
export interface Cells extends Handle {
  /** Limits what is seen from a cell to its row of a set whose targets are the cells of the graph. */
  setPvs(pvs: Pvs): void;
  /** Opens or closes a portal, like a door. */
  setOpen(portal: number, open: boolean): void;
  /** Sets in which directions an open portal can be seen through. */
  setPassage(portal: number, directions: { forward: boolean; backward: boolean }): void;
  /**
   * Adds a mirror on the boundary of a cell, and returns its number. Its vertices make a convex polygon in a plane,
   * counter-clockwise as seen from within the cell. If the glass itself is drawn, it is an object of the scene.
   */
  addMirror(cell: number, vertices: readonly Triple[]): number;
  /** Sets whether a mirror reflects, as new mirrors do, or is covered and shows nothing. */
  setMirror(mirror: number, uncovered: boolean): void;
  /** Whether one cell may see another through the portals that are open now. */
  canSee(from: number, to: number): boolean;
}

/** Portal culling of one view with reflections in mirrors. */
export interface Reflections extends Handle {
  /**
   * The reflections of the last frame, numbered from 0. Each comes after the one that it is seen in. In the next frame, a
   * number may be that of another mirror: levels of detail need a `Lods` for each chain of mirrors, or `Lods.reset`.
   */
  readonly list: Reflection[];
  /**
   * How many mirrors were seen in the last frame and have no reflection, since there were too many; also counts those with
   * a reflection in which no mirrors are looked for.
   */
  readonly leftOut: number;
  /**
   * Reads a reflection. Sets `view` to the view to draw it with, to the pixels that the mirror covers: `view.matrix()` and
   * `view.clipPlanes()` have its matrix and its clip plane, which cuts away what is behind the mirror. Triangles change
   * their winding. Sets `visible` to the objects to draw in it, without changes; the next frame of a set with `changes`
   * then has all its objects as newly visible.
   */
  read(number: number, view: View, visible: Visible): void;
}

/**
 * A potentially visible set: for each viewcell the targets, cells or objects, that may be seen from there.
 */
export interface Pvs extends Handle {
  readonly counts: { viewcells: number; targets: number };
  /** The set as a file. */
  readonly bytes: Uint8Array;
  sees(viewcell: number, target: number): boolean;
  /** One bit per target: bit `target % 32` of word `target / 32`. */
  row(viewcell: number): Uint32Array;
}

/** A set prepared for a scene. */
export interface ScenePvs extends Handle {}

/**
 * Sets of the objects that are visible from small boxes around one eye, made ahead of it while the scene changes.
 * What moves counts as visible at once; doors and other movers should not be occluders.
 */
export interface Online extends Handle {
  /**
   * Works ahead on the box that is needed soonest; null if all places have viewcells. `places` are points of the
   * world, 3 numbers each: the eye, then where it may be next, such as its place after 0.1, 0.2, 0.4 and 0.8 seconds
   * at its present velocity. `budget` is the work to do in microseconds of a core of 3 GHz, counted and not timed;
   * below 0 it is 0.
   */
  step(scene: Scene, places: Numbers, budget: number): OnlineStep | null;
  /**
   * What answered the last frame of a pipeline with these sets: a viewcell, the wide box around it, which hides less,
   * or none, so that nothing was hidden.
   */
  readonly answer: "none" | "wide" | "viewcell";
  /**
   * Objects that the box of the last frame sees, wherever the view looks, and the box of the frame before did not:
   * the largest for their distance first, for streams. A stream begins with all objects of the scene, and adds those
   * that are inserted, since what was never hidden is not listed.
   */
  readonly came: BigUint64Array;
  /** Objects that the box of the frame before saw and the box of the last frame does not, in the order of `came`. */
  readonly went: BigUint64Array;
  /**
   * One bit per index, as in `Visible.bits`, of the objects that are hidden from all points of a box of the world;
   * none if no finished box holds this one. For observers to whom all layers of occluders are drawn.
   */
  hiddenFrom(scene: Scene, box: Box): Uint32Array;
}

/** The level in which movers see each other. Outside of it a mover sees and is seen by all. */
export interface SightCells extends Handle {
  /** Sets the opacity of a wall of a plan, for example a door. */
  setOpacity(wall: number, opacity: Opacity): void;
  /** The objects that `createOnlineSightCells` has added, in the order of the boxes. */
  readonly objects: BigUint64Array;
}

/** Which observers may see which targets, thousands of each. */
export interface WhoSees extends Handle {
  /**
   * Finds which targets each observer may see, and replaces the former answer; once per tick. A target is left out
   * only if no straight line leads from anywhere the observer may be to anywhere the target may be. Both are 7 numbers
   * each: least and greatest corner of the box around the body in the world, and how far it may move until the answer
   * is used. `scene` is that of online sight cells.
   */
  look(cells: SightCells, observers: Numbers, targets: Numbers, scene?: Scene): void;
  /** Whether an observer may see a target. Both count from 0 in the order given. */
  sees(observer: number, target: number): boolean;
  /** The numbers of the targets that an observer may see, ascending. */
  seenBy(observer: number): Uint32Array;
}

/** Occluders of a level, for `addZBufferOfLevel`. */
export interface Level extends Handle {
  /** The occluders as a file. */
  readonly bytes: Uint8Array;
}

/** A point of a plan: x and y. */
export type Pair = readonly [number, number] | ArrayLike<number>;

/** A floor plan: what an eye sees of the walls around it, and whether two points see each other. */
export interface Plan extends Handle {
  /** Sets the opacity of a wall: a door that opens. Throws "UNKNOWN_ID" for a wall that the plan does not have. */
  setOpacity(wall: number, opacity: Opacity): void;
  /** Whether a line leads from `a` to `b` that no wall stops. Exact. A point on a wall sees both of its sides. */
  sees(a: Pair, b: Pair): boolean;
  /**
   * Where a ray from `eye` through a point ends: at a wall, or at the rectangle around the plan, with `wall` null. Null
   * for two equal points, and for a ray that does not enter the rectangle.
   */
  ray(eye: Pair, through: Pair): { point: [number, number]; wall: number | null } | null;
  /**
   * Corners of what an eye sees, counter-clockwise, 2 numbers each. `range` is the greatest distance: infinite by
   * default; arcs become chords inside of them.
   */
  polygon(eye: Pair, options?: { range?: number }): Float64Array;
  /** Numbers of the walls that an eye sees, ascending. */
  walls(eye: Pair, options?: { range?: number }): Uint32Array;
  /**
   * Numbers of the walls that are seen from somewhere in the convex hull of points, 2 numbers each, ascending. Throws
   * "ARGUMENT" if there is no point, if one is outside the rectangle around the plan, or if lines of sight enter more
   * than 2^24 triangles of the plan.
   */
  wallsFromRegion(points: Numbers): Uint32Array;
}
