// Which objects can this camera see? The JavaScript interface of the `visibility` crates.
//
// Wraps the functions of `platforms/capi/include/visibility.h`, compiled to WebAssembly. `visibility.d.ts`
// describes what is exported here. Layouts of structures are those of the header on wasm32; `src/lib.rs`
// asserts them.

/** Depth conventions of clip matrices: `vis_depth` of the header. */
export const Depth = Object.freeze({
  NegativeOneToOne: 0,
  NegativeOneToOneInfinite: 1,
  ZeroToOne: 2,
  ZeroToOneInfinite: 3,
  Reversed: 4,
  ReversedInfinite: 5,
});

/** Flags of objects; combine them with `|`. */
export const Flag = Object.freeze({ NeverCull: 1, Occluder: 2, SeeThrough: 4, OneSided: 8 });

/** What a wall does to lines of sight: `vis_opacity` of the header. */
export const Opacity = Object.freeze({ Opaque: 0, Clear: 1, OneWay: 2 });

/** All layers: what objects and views have unless they are given others. */
export const ALL_LAYERS = 0xffffffff;

/** The id of no object in any scene. */
export const NO_OBJECT = 0xffffffffn;

/** Names of `vis_status`, by number. */
const CODES = ["OK", "NULL", "ARGUMENT", "UNKNOWN_ID", "TOO_SHORT", "FORMAT", "STATE", "BUSY", "PANIC"];
/** Names of `vis_accuracy`, by number. */
const ACCURACIES = ["exact", "conservative", "aggressive", "approximate"];
/** Names of `vis_answer`, by number. */
const ANSWERS = ["none", "wide", "viewcell"];
const OBJECT_BYTES = 36;
const BOX_BYTES = 24;
const POSE_BYTES = 72;
const VOLUME_BYTES = 56;
const STATS_BYTES = 40;
const COMPARISON_BYTES = 16;
const WORK_BYTES = 48;
const WALL_BYTES = 40;
const WALL_HIT_BYTES = 24;
const LIGHT_BYTES = 72;
const RAY_HIT_BYTES = 16;
const LOD_BYTES = 24;
const GROUP_BYTES = 12;
const COMMAND_BYTES = 20;
const REFLECTION_BYTES = 12;
/** Numbers of `vis_light_kind`. */
const [DIRECTIONAL, POINT, SPOT] = [0, 1, 2];
/** `VIS_NO_WALL` and `VIS_NO_REFLECTION` of the header. */
const [NO_WALL, NO_REFLECTION] = [0xffffffff, 0xffffffff];
/** Bytes that a list is offered at least. */
const LEAST_ROOM = 1 << 12;
/** Bytes of memory for arguments that are kept from call to call at most. */
const MOST_KEPT = 1 << 24;

/** An error of the library: `code` is what kind, `message` says what is wrong with what. */
export class VisibilityError extends Error {
  constructor(code, message) {
    super(message);
    this.name = "VisibilityError";
    this.code = code;
  }
}

function refuse(message) {
  throw new VisibilityError("ARGUMENT", message);
}

/**
 * The index of an object: small and dense, for arrays. The upper half of an id tells objects of one index
 * apart.
 */
export function indexOf(id) {
  return Number(id & 0xffffffffn);
}

/** Whether this browser runs WebAssembly with 128-bit SIMD instructions. */
export function hasSimd128() {
  // A module of one function that makes a vector and takes bits of it.
  const module = [
    0, 97, 115, 109, 1, 0, 0, 0, 1, 5, 1, 96, 0, 1, 123, 3, 2, 1, 0, 10, 10, 1, 8, 0, 65, 0, 253, 15, 253, 98,
    11,
  ];
  return WebAssembly.validate(new Uint8Array(module));
}

/** Loads the library. See `visibility.d.ts`. */
export async function load({ simd128 = hasSimd128(), frames = false, wasm } = {}) {
  // Bundlers look for `new URL` with a literal.
  const whole = [
    new URL("./visibility.wasm", import.meta.url),
    new URL("./visibility-simd128.wasm", import.meta.url),
  ];
  const small = [
    new URL("./visibility-frames.wasm", import.meta.url),
    new URL("./visibility-frames-simd128.wasm", import.meta.url),
  ];
  const { instance } = await instantiate(wasm ?? (frames ? small : whole)[Number(Boolean(simd128))]);
  return new Visibility(new Wasm(instance.exports), simd128);
}

/** The first 4 bytes of a module. */
const MAGIC = [0, 0x61, 0x73, 0x6d].join();

async function instantiate(source) {
  if (source instanceof WebAssembly.Module) return { instance: await WebAssembly.instantiate(source, {}) };
  if (!(source instanceof URL)) return WebAssembly.instantiate(source, {});
  if (source.protocol === "file:") {
    // For node alone: bundlers leave this import as it is.
    const { readFile } = await import(/* webpackIgnore: true */ /* @vite-ignore */ "node:fs/promises");
    return WebAssembly.instantiate(await readFile(source), {});
  }
  const response = await fetch(source);
  if (!response.ok) throw new Error(`cannot fetch ${source}: status ${response.status}`);
  // Compiled while it comes, where the host says what it is.
  if (response.headers?.get("content-type") === "application/wasm" && WebAssembly.instantiateStreaming)
    return WebAssembly.instantiateStreaming(response, {});
  const bytes = await response.arrayBuffer();
  // Servers of bundlers send a page where there is no such file.
  if (new Uint8Array(bytes).subarray(0, 4).join() !== MAGIC)
    throw new Error(
      `${source} is no WebAssembly module: a bundler has moved visibility.js away from it (Vite before 8: optimizeDeps.exclude)`,
    );
  return WebAssembly.instantiate(bytes, {});
}

/** The module's functions and its memory, with memory for the arguments of a call. */
class Wasm {
  constructor(exports) {
    this.exports = exports;
    /** Memory that the arguments of one call share: pointer, bytes, and how many of them are in use. */
    this.block = 0;
    this.blockBytes = 0;
    this.used = 0;
    /** By name of a function: the length of the list that it last wrote. */
    this.lengths = new Map();
    /** Earlier blocks, too small, that arguments of the present call are in. */
    this.full = [];
    /** What the library failed with inside, if it did: what it was at is half done. */
    this.fault = null;
    this.collected = new FinalizationRegistry((held) => this.release(held));
  }

  /**
   * Runs a call: all that `body` borrows is given back at its end. A call within another gives back all, so it is
   * the last thing that the outer one does.
   */
  call(body) {
    if (this.fault !== null) throw new VisibilityError("PANIC", `an earlier ${this.fault}`);
    try {
      return body(this);
    } catch (error) {
      // An id that is no bigint, a list that is none, or of another type than it should be.
      if (error instanceof TypeError) refuse(`${error.message} (ids are bigint, all else is numbers)`);
      throw error;
    } finally {
      this.used = 0;
      if (this.blockBytes > MOST_KEPT) {
        this.full.push([this.block, this.blockBytes]);
        this.block = this.blockBytes = 0;
      }
      for (const [pointer, bytes] of this.full.splice(0)) this.free(pointer, bytes);
    }
  }

  /** Calls a function of the module. What it throws is a fault inside the library, which no argument causes. */
  run(name, ...parameters) {
    if (!(name in this.exports))
      throw new VisibilityError("STATE", `${name} is in the whole module alone: load it without \`frames\``);
    try {
      return this.exports[name](...parameters);
    } catch (error) {
      // A parameter that cannot be passed: the function has not begun.
      if (error instanceof TypeError) throw error;
      // A trap, or a stack that is full: browsers differ in its error.
      this.fault = `fault inside the library: ${error.message}`;
      throw new VisibilityError("PANIC", this.fault);
    }
  }

  /** Calls a function of the header, and throws if it returns an error. Invalidates views of memory. */
  check(name, ...parameters) {
    if (!parameters.every(isNumber)) refuse("an argument is missing, or is not a number");
    const status = this.run(name, ...parameters);
    if (status === 0) return;
    const start = this.run("vis_last_error") >>> 0;
    const bytes = this.bytes();
    throw new VisibilityError(CODES[status], decode(bytes.subarray(start, bytes.indexOf(0, start))));
  }

  /** Frees what a handle holds: a value of the library's, and maybe a buffer of its own. */
  release({ kind, pointer, buffer, bytes }) {
    if (this.fault !== null) return;
    this.run(`vis_${kind}_destroy`, pointer);
    this.free(buffer, bytes);
  }

  /** Frees memory, unless the library has failed: then it may be in any state. */
  free(pointer, bytes) {
    if (this.fault === null) this.run("vis_free", pointer, bytes);
  }

  /** Allocates memory that stays until it is freed. */
  allocate(bytes) {
    const pointer = this.run("vis_alloc", bytes) >>> 0;
    if (pointer === 0) throw new RangeError(`no memory for ${bytes} bytes`);
    return pointer;
  }

  /** Returns a pointer to so many bytes for the present call, aligned to 8. Invalidates views of memory. */
  borrow(bytes) {
    const rounded = Math.max(8, Math.ceil(bytes / 8) * 8);
    if (this.used + rounded > this.blockBytes) {
      const next = Math.max(4096, 2 * this.blockBytes, rounded);
      const pointer = this.allocate(next);
      if (this.block !== 0) this.full.push([this.block, this.blockBytes]);
      [this.block, this.blockBytes, this.used] = [pointer, next, 0];
    }
    this.used += rounded;
    return this.block + this.used - rounded;
  }

  /** Copies numbers into memory for the present call, and returns the pointer. */
  put(Type, numbers) {
    if (Type === Uint32Array && !(numbers instanceof Uint32Array))
      for (let i = 0; i < numbers.length; i++) whole(numbers[i], "number");
    const pointer = this.borrow(numbers.length * Type.BYTES_PER_ELEMENT);
    new Type(this.exports.memory.buffer, pointer, numbers.length).set(numbers);
    return pointer;
  }

  /** Returns the pointer to what a handle stands for. The library cannot tell a wrong pointer. */
  pointer(handle, kind) {
    if (handle?.held?.kind !== kind || handle.wasm !== this)
      refuse(`a ${kind} of this library is needed here`);
    return handle.held.pointer;
  }

  /** Returns the pointers that a frame is culled or judged with. */
  frame(scene, view, visible) {
    return [this.pointer(scene, "scene"), this.pointer(view, "view"), this.pointer(visible, "visible")];
  }

  bytes() {
    return new Uint8Array(this.exports.memory.buffer);
  }

  data() {
    return new DataView(this.exports.memory.buffer);
  }

  u32(pointer) {
    return this.data().getUint32(pointer, true);
  }

  /** Calls a function that writes a number of 32 bits at its last parameter, and returns the number. */
  number(name, ...parameters) {
    return this.call(() => {
      const place = this.borrow(8);
      this.check(name, ...parameters, place);
      return this.u32(place);
    });
  }

  /** Like `number`, for results that are true or false. */
  truth(name, ...parameters) {
    return this.call(() => {
      const place = this.borrow(8);
      this.check(name, ...parameters, place);
      return this.bytes()[place] !== 0;
    });
  }

  /** Like `number`, for ids. */
  id(name, ...parameters) {
    return this.call(() => {
      const place = this.borrow(8);
      this.check(name, ...parameters, place);
      return this.data().getBigUint64(place, true);
    });
  }

  /**
   * Calls a function that writes elements of so many bytes to a buffer, capacity and count, within a call. Returns
   * pointer and length of the list. Offers room for twice as many as the function last wrote, so that it seldom does
   * its work twice.
   */
  listed(bytes, name, ...parameters) {
    const count = this.borrow(8);
    const usual = Math.min(2 * (this.lengths.get(name) ?? 0), MOST_KEPT / bytes);
    let room = Math.ceil(Math.max(LEAST_ROOM / bytes, usual));
    let buffer = this.borrow(room * bytes);
    try {
      this.check(name, ...parameters, buffer, room, count);
    } catch (error) {
      if (error.code !== "TOO_SHORT") throw error;
      room = this.u32(count);
      buffer = this.borrow(room * bytes);
      this.check(name, ...parameters, buffer, room, count);
    }
    const length = this.u32(count);
    this.lengths.set(name, length);
    return [buffer, length];
  }

  /** Calls a function as `listed` does, and returns a copy of the list. */
  list(Type, name, ...parameters) {
    return this.call(() => {
      const [buffer, length] = this.listed(Type.BYTES_PER_ELEMENT, name, ...parameters);
      return new Type(this.exports.memory.buffer, buffer, length).slice();
    });
  }

  /** Like `list`, for texts. */
  text(name, ...parameters) {
    return decode(this.list(Uint8Array, name, ...parameters).subarray(0, -1));
  }

  /** Puts boxes of 6 numbers each as floats that hold them: the library's boxes are of single precision. */
  boxes(numbers) {
    return this.put(Float32Array, numbers instanceof Float32Array ? numbers : Array.from(numbers, outwards));
  }

  box(box) {
    return this.boxes(corners(box));
  }

  pose({ eye, target, up }) {
    return this.put(Float64Array, [...triple(eye, "eye"), ...triple(target, "target"), ...triple(up, "up")]);
  }

  point(numbers, name) {
    return this.put(Float64Array, triple(numbers, name));
  }

  /** Puts a point, or nothing for none. */
  optionalPoint(numbers, name) {
    return numbers ? this.point(numbers, name) : 0;
  }

  /** Puts elements of `each` numbers: pointer and count. */
  numbers(array, each, name) {
    const count = elements(array, each, name);
    return [this.put(Float64Array, array), count];
  }

  /** Puts walls of a plan: pointer and count. */
  walls(walls) {
    const pointer = this.borrow(walls.length * WALL_BYTES);
    const data = this.data();
    walls.forEach(({ from, to, opacity = Opacity.Opaque }, index) => {
      const at = pointer + index * WALL_BYTES;
      flatten([from, to], 2, "an end of a wall").forEach((x, i) => data.setFloat64(at + 8 * i, x, true));
      data.setUint32(at + 32, whole(opacity, "opacity"), true);
    });
    return [pointer, walls.length];
  }

  /** Puts a point of a plan. */
  pair(numbers, name) {
    if (numbers?.length !== 2) refuse(`\`${name}\` is not a list of 2 numbers`);
    return this.put(Float64Array, numbers);
  }

  /** Puts the corners of a box of the world in double precision: pointers to both. */
  region({ min, max } = {}) {
    return [this.point(min, "min"), this.point(max, "max")];
  }

  /** Puts convex volumes and their planes: pointer and count of both. */
  volumes(volumes) {
    const pointer = this.borrow(volumes.length * VOLUME_BYTES);
    const planes = volumes.flatMap((volume) => volume.planes ?? []);
    const planePointer = this.put(Float64Array, flatten(planes, 4, "a plane"));
    const data = this.data();
    let first = 0;
    volumes.forEach(({ planes = [], ...box }, index) => {
      const at = pointer + index * VOLUME_BYTES;
      corners(box).forEach((number, i) => data.setFloat64(at + 8 * i, number, true));
      data.setUint32(at + 48, first, true);
      data.setUint32(at + 52, planes.length, true);
      first += planes.length;
    });
    return [pointer, volumes.length, planePointer, planes.length];
  }
}

function decode(bytes) {
  return new TextDecoder().decode(bytes);
}

function triple(numbers, name) {
  if (numbers?.length !== 3) refuse(`\`${name}\` is not a list of 3 numbers`);
  return numbers;
}

const single = new Float32Array(1);
const singleBits = new Int32Array(single.buffer);

/** Returns the nearest single-precision number that is not inside of a box, for one of the box's 6 numbers. */
function outwards(number, index) {
  const isUpper = index % 6 >= 3;
  single[0] = number;
  if (isUpper ? single[0] < number : single[0] > number) {
    const isAway = isUpper === single[0] > 0;
    if (single[0] === 0) singleBits[0] = isUpper ? 1 : -0x7fffffff;
    else singleBits[0] += isAway ? 1 : -1;
  }
  return single[0];
}

/**
 * Returns the 6 numbers of the greatest box of single precision inside of a box: what an occluder covers,
 * must be covered by what is drawn. The nearest numbers where no such box exists.
 */
function inside(numbers) {
  const inwards = numbers.map((number, index) => outwards(number, index + 3));
  return inwards.map((number, index) => (inwards[index % 3] > inwards[(index % 3) + 3] ? numbers[index] : number));
}

/** Returns the 6 numbers of a box. */
function corners(box) {
  return [...triple(box?.min, "min"), ...triple(box?.max, "max")];
}

/** Puts lists of `each` numbers one after another. */
function flatten(lists, each, what) {
  return lists.flatMap((list) => (list.length === each ? [...list] : refuse(`${what} has ${each} numbers`)));
}

/** Returns how many elements of `each` numbers a flat array holds. */
function elements(array, each, name) {
  if (!(array?.length % each === 0)) refuse(`the length of \`${name}\` is no multiple of ${each}`);
  return array.length / each;
}

/** Whether a value is a number. The module would take any other for 0 or 1. */
function isNumber(value) {
  return typeof value === "bigint" || (typeof value === "number" && !Number.isNaN(value));
}

/** Returns a whole number of 32 bits. The module would take any other for one. */
function whole(number, name) {
  if (!(Number.isInteger(number) && number >= -0x80000000 && number <= 0xffffffff))
    refuse(`\`${name}\` is not a whole number of 32 bits`);
  return number;
}

/** Returns 1 for true and 0 for false. The module would take any other number for one of them. */
function bit(value, name) {
  if (typeof value !== "boolean") refuse(`\`${name}\` is not true or false`);
  return Number(value);
}

function sameLength(array, count, name) {
  if (array?.length !== count) refuse(`\`${name}\` has ${array?.length ?? "no"} elements, not ${count}`);
  return array;
}

/** Something of the library's that lives in the module's memory. */
class Handle {
  constructor(wasm, kind, pointer) {
    this.wasm = wasm;
    /** What is freed in the end. The pointer is null once it is, which the library refuses. */
    this.held = { kind, pointer, buffer: 0, bytes: 0 };
    wasm.collected.register(this, this.held, this);
  }

  static made(Type, wasm, kind, name, ...parameters) {
    return new Type(wasm, kind, wasm.number(name, ...parameters));
  }

  get pointer() {
    return this.held.pointer;
  }

  /** Frees its memory now instead of when it is collected. */
  destroy() {
    this.wasm.collected.unregister(this);
    this.wasm.release(this.held);
    Object.assign(this.held, { pointer: 0, buffer: 0, bytes: 0 });
  }
}

/** The loaded library: makes everything else. */
class Visibility {
  #wasm;

  constructor(wasm, simd128) {
    this.#wasm = wasm;
    this.simd128 = simd128;
  }

  /** The memory that views of visible objects are in. */
  get memory() {
    return this.#wasm.exports.memory;
  }

  createScene() {
    return Handle.made(Scene, this.#wasm, "scene", "vis_scene_create");
  }

  createView() {
    return Handle.made(View, this.#wasm, "view", "vis_view_create");
  }

  createPipeline() {
    return Handle.made(Pipeline, this.#wasm, "pipeline", "vis_pipeline_create");
  }

  createVisible({ changes = false } = {}) {
    return Handle.made(Visible, this.#wasm, "visible", "vis_visible_create", bit(changes, "changes"));
  }

  createLods(pictureHeight, { hysteresis = 0.1, fade = 0.25 } = {}) {
    return Handle.made(Lods, this.#wasm, "lods", "vis_lods_create", pictureHeight, hysteresis, fade);
  }

  createDrawList() {
    return Handle.made(DrawList, this.#wasm, "draw_list", "vis_draw_list_create");
  }

  createJudge(width, height) {
    return Handle.made(Judge, this.#wasm, "measure", "vis_measure_create", width, height);
  }

  createGraph(cellCount, portals) {
    const wasm = this.#wasm;
    return wasm.call(() => {
      const vertices = portals.flatMap((portal) => portal.vertices);
      const points = wasm.put(Float64Array, flatten(vertices, 3, "a vertex"));
      let first = 0;
      const numbers = portals.flatMap(({ vertices: { length }, cells: [from, to] }) => {
        first += length;
        return [first - length, length, from, to];
      });
      const of = [whole(cellCount, "cellCount"), wasm.put(Uint32Array, numbers), portals.length];
      return Handle.made(Graph, wasm, "graph", "vis_graph_create", ...of, points, vertices.length);
    });
  }

  readPrt(text) {
    const wasm = this.#wasm;
    return wasm.call(() => {
      const bytes = new TextEncoder().encode(text);
      const pointer = wasm.put(Uint8Array, bytes);
      return Handle.made(Graph, wasm, "graph", "vis_graph_read_prt", pointer, bytes.length);
    });
  }

  createCells(graph, volumes, { tolerance = 1e-6 } = {}) {
    const wasm = this.#wasm;
    return wasm.call(() => {
      const of = [wasm.pointer(graph, "graph"), ...wasm.volumes(volumes), tolerance];
      return Handle.made(Cells, wasm, "cells", "vis_cells_create", ...of);
    });
  }

  createCellsOfScene(scene, { maxCells = 0 } = {}) {
    const wasm = this.#wasm;
    return wasm.call(() => {
      const count = wasm.borrow(8);
      const of = [wasm.pointer(scene, "scene"), whole(maxCells, "maxCells")];
      const place = wasm.borrow(8);
      wasm.check("vis_cells_create_of_scene", ...of, place, count);
      const cells = new Cells(wasm, "cells", wasm.u32(place));
      cells.count = wasm.u32(count);
      return cells;
    });
  }

  createReflections(cells, { maxCount = 8, maxDepth = 2 } = {}) {
    const wasm = this.#wasm;
    const of = [wasm.pointer(cells, "cells"), whole(maxCount, "maxCount"), whole(maxDepth, "maxDepth")];
    return Handle.made(Reflections, wasm, "reflections", "vis_reflections_create", ...of);
  }

  createOnline({ viewcell, wide, margin = 0 } = {}) {
    const wasm = this.#wasm;
    return wasm.call(() => {
      const sizes = [wasm.point(viewcell, "viewcell"), wasm.point(wide, "wide")];
      return Handle.made(Online, wasm, "online", "vis_online_create", ...sizes, margin);
    });
  }

  createPlan(walls) {
    const wasm = this.#wasm;
    return wasm.call(() => Handle.made(Plan, wasm, "plan", "vis_plan_create", ...wasm.walls(walls)));
  }

  createLevel(triangles, { twoSided = false } = {}) {
    const wasm = this.#wasm;
    return wasm.call(() => {
      const of = [wasm.put(Float32Array, triangles), elements(triangles, 9, "triangles")];
      return Handle.made(Level, wasm, "level", "vis_level_create", ...of, bit(twoSided, "twoSided"));
    });
  }

  readLevel(bytes) {
    const wasm = this.#wasm;
    return wasm.call(() => {
      const pointer = wasm.put(Uint8Array, bytes);
      return Handle.made(Level, wasm, "level", "vis_level_read", pointer, bytes.length);
    });
  }

  createSightCellsOfPlan(walls, { axes = [0, 1] } = {}) {
    const wasm = this.#wasm;
    return wasm.call(() => {
      const of = [...wasm.walls(walls), whole(axes[0], "axes"), whole(axes[1], "axes")];
      return Handle.made(SightCells, wasm, "sight_cells", "vis_sight_cells_create_of_plan", ...of);
    });
  }

  createSightCellsOfPortals(graph, volumes, pvs, { tolerance = 1e-6 } = {}) {
    const wasm = this.#wasm;
    return wasm.call(() => {
      const of = [wasm.pointer(graph, "graph"), ...wasm.volumes(volumes), tolerance, wasm.pointer(pvs, "pvs")];
      return Handle.made(SightCells, wasm, "sight_cells", "vis_sight_cells_create_of_portals", ...of);
    });
  }

  createSightCellsOfScene(scene, boxes) {
    const wasm = this.#wasm;
    return wasm.call(() => {
      const of = [wasm.pointer(scene, "scene"), ...wasm.numbers(boxes, 6, "boxes")];
      return Handle.made(SightCells, wasm, "sight_cells", "vis_sight_cells_create_of_scene", ...of);
    });
  }

  createOnlineSightCells(scene, online, boxes) {
    const wasm = this.#wasm;
    return wasm.call(() => {
      const of = [wasm.pointer(scene, "scene"), wasm.pointer(online, "online")];
      of.push(...wasm.numbers(boxes, 6, "boxes"));
      return Handle.made(SightCells, wasm, "sight_cells", "vis_sight_cells_create_online", ...of);
    });
  }

  createWhoSees() {
    return Handle.made(WhoSees, this.#wasm, "who_sees", "vis_who_sees_create");
  }

  readPvs(bytes) {
    const wasm = this.#wasm;
    return wasm.call(() => {
      const pointer = wasm.put(Uint8Array, bytes);
      return Handle.made(Pvs, wasm, "pvs", "vis_pvs_read", pointer, bytes.length);
    });
  }

  createPvs(targetCount, rows) {
    const wasm = this.#wasm;
    return wasm.call(() => {
      let end = 0;
      const ends = rows.map((row) => (end += row.length));
      const targets = rows.flatMap((row) => [...row]);
      const of = [whole(targetCount, "targetCount"), wasm.put(Uint32Array, ends), rows.length];
      return Handle.made(Pvs, wasm, "pvs", "vis_pvs_create", ...of, wasm.put(Uint32Array, targets), end);
    });
  }

  createScenePvs(scene, pvs, viewcells, ids, targets) {
    const wasm = this.#wasm;
    return wasm.call(() => {
      const of = [wasm.pointer(scene, "scene"), wasm.pointer(pvs, "pvs"), ...wasm.volumes(viewcells)];
      of.push(wasm.put(BigUint64Array, ids));
      of.push(wasm.put(Uint32Array, sameLength(targets, ids.length, "targets")), ids.length);
      return Handle.made(ScenePvs, wasm, "scene_pvs", "vis_scene_pvs_create", ...of);
    });
  }

  readScenePvs(scene, bytes, version) {
    const wasm = this.#wasm;
    return wasm.call(() => {
      const file = [wasm.pointer(scene, "scene"), wasm.put(Uint8Array, bytes), bytes.length];
      const [suffix, of] = version === undefined ? ["", []] : ["_version", [BigInt.asUintN(64, version)]];
      return Handle.made(ScenePvs, wasm, "scene_pvs", `vis_scene_pvs_read${suffix}`, ...file, ...of);
    });
  }
}

/** Reads an object that a ray hits. */
function rayHit(wasm, at) {
  const data = wasm.data();
  return { id: data.getBigUint64(at, true), distance: data.getFloat32(at + 8, true) };
}

/** Puts a light: `{ toward }` for the sun, `{ position, range }`, or with `direction` and `halfAngle` for a spot. */
function putLight(wasm, { toward, position, direction, range = Infinity, halfAngle = 0 } = {}) {
  const kind = toward ? DIRECTIONAL : direction ? SPOT : POINT;
  const place = kind === DIRECTIONAL ? [0, 0, 0] : triple(position, "position");
  const axis = kind === POINT ? [0, 0, 0] : triple(toward ?? direction, toward ? "toward" : "direction");
  const at = wasm.borrow(LIGHT_BYTES);
  const data = wasm.data();
  data.setUint32(at, kind, true);
  [...place, ...axis, range, halfAngle].forEach((x, i) => data.setFloat64(at + 8 + 8 * i, x, true));
  return at;
}

class Scene extends Handle {
  get count() {
    return this.wasm.number("vis_scene_count", this.pointer);
  }

  get indexLimit() {
    return this.wasm.number("vis_scene_index_limit", this.pointer);
  }

  setOrigin(origin) {
    this.wasm.call((wasm) =>
      wasm.check("vis_scene_set_origin", this.pointer, wasm.put(Float64Array, triple(origin, "origin"))),
    );
  }

  insert({ bounds, ...rest } = {}) {
    return this.insertAll({ bounds: corners(bounds), ...rest })[0];
  }

  insertAll({ bounds, layers = ALL_LAYERS, cost = 1, flags = 0 } = {}) {
    return this.wasm.call((wasm) => {
      const count = elements(bounds, 6, "bounds");
      const objects = wasm.borrow(count * OBJECT_BYTES);
      const ids = wasm.borrow(count * 8);
      const words = count * (OBJECT_BYTES / 4);
      const floats = new Float32Array(wasm.exports.memory.buffer, objects, words);
      const integers = new Uint32Array(wasm.exports.memory.buffer, objects, words);
      const column = (values, name) => {
        const isOne = typeof values === "number";
        if (!isOne) sameLength(values, count, name);
        return (index) => whole(isOne ? values : values[index], name);
      };
      const columns = [column(layers, "layers"), column(cost, "cost"), column(flags, "flags")];
      for (let i = 0; i < count; i++) {
        for (let k = 0; k < 6; k++) floats[9 * i + k] = outwards(bounds[6 * i + k], k);
        for (let k = 0; k < 3; k++) integers[9 * i + 6 + k] = columns[k](i);
      }
      wasm.check("vis_scene_insert_batch", this.pointer, objects, count, ids);
      return new BigUint64Array(wasm.exports.memory.buffer, ids, count).slice();
    });
  }

  remove(id) {
    this.wasm.call((wasm) => wasm.check("vis_scene_remove", this.pointer, id));
  }

  removeAll(ids) {
    this.wasm.call((wasm) =>
      wasm.check("vis_scene_remove_batch", this.pointer, wasm.put(BigUint64Array, ids), ids.length),
    );
  }

  contains(id) {
    return this.wasm.truth("vis_scene_contains", this.pointer, id);
  }

  bounds(id) {
    return this.wasm.call((wasm) => {
      const place = wasm.borrow(BOX_BYTES);
      wasm.check("vis_scene_bounds", this.pointer, id, place);
      const numbers = [...new Float32Array(wasm.exports.memory.buffer, place, 6)];
      return { min: numbers.slice(0, 3), max: numbers.slice(3) };
    });
  }

  setBounds(id, box) {
    this.wasm.call((wasm) => wasm.check("vis_scene_set_bounds", this.pointer, id, wasm.box(box)));
  }

  setAllBounds(ids, bounds) {
    this.wasm.call((wasm) => {
      const [of, boxes] = [wasm.put(BigUint64Array, ids), wasm.boxes(bounds)];
      sameLength(bounds, 6 * ids.length, "bounds");
      wasm.check("vis_scene_set_bounds_batch", this.pointer, of, boxes, ids.length);
    });
  }

  setLocalBounds(id, box) {
    this.wasm.call((wasm) => wasm.check("vis_scene_set_local_bounds", this.pointer, id, wasm.box(box)));
  }

  setTransforms(ids, matrices) {
    this.wasm.call((wasm) => {
      const [of, all] = [wasm.put(BigUint64Array, ids), wasm.put(Float32Array, matrices)];
      sameLength(matrices, 16 * ids.length, "matrices");
      wasm.check("vis_scene_set_transforms_batch", this.pointer, of, all, ids.length);
    });
  }

  setLayers(id, layers) {
    this.wasm.call((wasm) => wasm.check("vis_scene_set_layers", this.pointer, id, whole(layers, "layers")));
  }

  setFlags(id, flags) {
    this.wasm.call((wasm) => wasm.check("vis_scene_set_flags", this.pointer, id, whole(flags, "flags")));
  }

  setDrawRange(id, begin, end = Infinity, margin = 0) {
    const range = [begin, end, margin];
    this.wasm.call((wasm) => wasm.check("vis_scene_set_draw_range_with_margin", this.pointer, id, ...range));
  }

  setHlodParent(id, parent = NO_OBJECT) {
    this.wasm.call((wasm) => wasm.check("vis_scene_set_hlod_parent", this.pointer, id, parent));
  }

  setLodSizes(ids, sizes) {
    this.wasm.call((wasm) => {
      const of = [wasm.put(BigUint64Array, ids), ids.length, wasm.put(Float32Array, sizes), sizes.length];
      wasm.check("vis_scene_set_lod_sizes", this.pointer, ...of);
    });
  }

  setDrawKeys(ids, keys) {
    this.wasm.call((wasm) => {
      if (Array.prototype.some.call(sameLength(keys, ids.length, "keys"), (key) => key < 0))
        refuse("`keys` has a negative number");
      const of = [wasm.put(BigUint64Array, ids), wasm.put(Uint32Array, keys)];
      wasm.check("vis_scene_set_draw_keys", this.pointer, ...of, ids.length);
    });
  }

  addMesh({ positions, indices, twoSided = false } = {}) {
    return this.wasm.call((wasm) => {
      const [vertices, triangles] = [elements(positions, 3, "positions"), elements(indices, 3, "indices")];
      const of = [wasm.put(Float32Array, positions), vertices, wasm.put(Uint32Array, indices), triangles];
      return wasm.id("vis_scene_add_mesh", this.pointer, ...of, bit(twoSided, "twoSided"));
    });
  }

  addBoxMesh(box) {
    return this.wasm.call((wasm) => {
      const bounds = wasm.put(Float32Array, inside(corners(box)));
      return wasm.id("vis_scene_add_box_mesh", this.pointer, bounds);
    });
  }

  removeMesh(mesh) {
    this.wasm.call((wasm) => wasm.check("vis_scene_remove_mesh", this.pointer, mesh));
  }

  get meshCount() {
    return this.wasm.number("vis_scene_mesh_count", this.pointer);
  }

  setMesh(id, mesh, transform) {
    this.wasm.call((wasm) => {
      const matrix = transform ? wasm.put(Float32Array, sameLength(transform, 16, "transform")) : 0;
      wasm.check("vis_scene_set_mesh", this.pointer, id, mesh, matrix);
    });
  }

  setTriangles(id, triangles) {
    this.wasm.call((wasm) => {
      const count = elements(triangles, 9, "triangles");
      wasm.check("vis_scene_set_triangles", this.pointer, id, wasm.put(Float32Array, triangles), count);
    });
  }

  prepareOccluders() {
    return this.wasm.number("vis_scene_prepare_occluders", this.pointer);
  }

  rayHits({ origin, direction, maxDistance = Infinity, layers = ALL_LAYERS } = {}) {
    return this.wasm.call((wasm) => {
      const of = [...this.#ray(origin, direction), maxDistance, whole(layers, "layers")];
      const [hits, length] = wasm.listed(RAY_HIT_BYTES, "vis_scene_ray_hits", this.pointer, ...of);
      return Array.from({ length }, (_, i) => rayHit(wasm, hits + i * RAY_HIT_BYTES));
    });
  }

  firstHit({ origin, direction, maxDistance = Infinity, layers = ALL_LAYERS } = {}) {
    return this.wasm.call((wasm) => {
      const hit = wasm.borrow(RAY_HIT_BYTES);
      const of = [...this.#ray(origin, direction), maxDistance, whole(layers, "layers")];
      wasm.check("vis_scene_first_hit", this.pointer, ...of, hit);
      const found = rayHit(wasm, hit);
      return found.id === NO_OBJECT ? null : found;
    });
  }

  #ray(origin, direction) {
    const put = (numbers, name) => this.wasm.put(Float32Array, triple(numbers, name));
    return [put(origin, "origin"), put(direction, "direction")];
  }

  inBox(box, { layers = ALL_LAYERS } = {}) {
    return this.wasm.call((wasm) =>
      wasm.list(BigUint64Array, "vis_scene_in_box", this.pointer, wasm.box(box), whole(layers, "layers")),
    );
  }

  seenFrom(box) {
    return this.wasm.call((wasm) =>
      wasm.list(Uint32Array, "vis_scene_seen_from", this.pointer, ...wasm.region(box)),
    );
  }

  proveFrom(box, { clearance = 0, mostSteps = 0 } = {}) {
    return this.wasm.call((wasm) => {
      const of = [...wasm.region(box), clearance, whole(mostSteps, "mostSteps")];
      const words = wasm.list(Uint32Array, "vis_scene_prove_from", this.pointer, ...of);
      return { seen: words.slice(0, words.length / 2), hidden: words.slice(words.length / 2) };
    });
  }

  maintain(budget = 256) {
    return this.wasm.number("vis_scene_maintain", this.pointer, budget);
  }

  rebuild() {
    this.wasm.call((wasm) => wasm.check("vis_scene_rebuild", this.pointer));
  }
}

class View extends Handle {
  setMatrix(matrix, depth, origin) {
    this.wasm.call((wasm) => {
      sameLength(matrix, 16, "matrix");
      const [Type, suffix] = matrix instanceof Float32Array ? [Float32Array, ""] : [Float64Array, "_f64"];
      const from = wasm.optionalPoint(origin, "origin");
      const parameters = [wasm.put(Type, matrix), whole(depth, "depth"), from];
      wasm.check(`vis_view_set_matrix${suffix}`, this.pointer, ...parameters);
    });
  }

  setPerspective({ fovY, aspect, near, far = Infinity, ...pose } = {}) {
    this.wasm.call((wasm) =>
      wasm.check("vis_view_set_perspective", this.pointer, wasm.pose(pose), fovY, aspect, near, far),
    );
  }

  setOrthographic({ width, height, near, far, ...pose } = {}) {
    this.wasm.call((wasm) =>
      wasm.check("vis_view_set_orthographic", this.pointer, wasm.pose(pose), width, height, near, far),
    );
  }

  setLayers(layers) {
    this.wasm.call((wasm) => wasm.check("vis_view_set_layers", this.pointer, whole(layers, "layers")));
  }

  matrix(origin) {
    return this.wasm.call((wasm) => {
      const [from, place] = [wasm.optionalPoint(origin, "origin"), wasm.borrow(128)];
      wasm.check("vis_view_matrix", this.pointer, from, place);
      return new Float64Array(wasm.exports.memory.buffer, place, 16).slice();
    });
  }

  clipPlanes(origin) {
    return this.wasm.call((wasm) => {
      const from = wasm.optionalPoint(origin, "origin");
      const numbers = wasm.list(Float64Array, "vis_view_clip_planes", this.pointer, from);
      return Array.from({ length: numbers.length / 4 }, (_, i) => numbers.slice(4 * i, 4 * i + 4));
    });
  }

  isWithinReach(of, metres, radians) {
    const parameters = [this.wasm.pointer(of, "view"), metres, radians];
    return this.wasm.truth("vis_view_is_within_reach", this.pointer, ...parameters);
  }

  setClipPlanes(planes) {
    this.wasm.call((wasm) => {
      const numbers = wasm.put(Float64Array, flatten(planes, 4, "a plane"));
      wasm.check("vis_view_set_clip_planes", this.pointer, numbers, planes.length);
    });
  }
}

class Pipeline extends Handle {
  /** Reflections of its stages, whose sets are read by the scene of the last frame. */
  #reflections = [];

  /** Appends a stage, and returns the pipeline for the next. */
  #add(stage, ...parameters) {
    this.wasm.call((wasm) => wasm.check(`vis_pipeline_add_${stage}`, this.pointer, ...parameters));
    return this;
  }

  addFrustum() {
    return this.#add("frustum");
  }

  addContribution(pictureHeight, leastPixels) {
    return this.#add("contribution", pictureHeight, leastPixels);
  }

  addZBuffer(width = 0, height = 0) {
    return this.#add("z_buffer", width, height);
  }

  addPortals(cells) {
    return this.#add("portals", this.wasm.pointer(cells, "cells"));
  }

  addReflections(reflections) {
    this.#add("reflections", this.wasm.pointer(reflections, "reflections"));
    this.#reflections.push(reflections);
    return this;
  }

  addPvs(scenePvs) {
    return this.#add("pvs", this.wasm.pointer(scenePvs, "scene_pvs"));
  }

  addOnline(online) {
    return this.#add("online", this.wasm.pointer(online, "online"));
  }

  addHorizon({ up } = {}) {
    if (up !== "y" && up !== "z") refuse("`up` is neither \"y\" nor \"z\"");
    return this.#add("horizon", Number(up === "z"));
  }

  addCasters(light) {
    return this.wasm.call((wasm) => this.#add("casters", putLight(wasm, light)));
  }

  addZBufferOfLevel(level, { width = 0, height = 0, origin = [0, 0, 0] } = {}) {
    return this.wasm.call((wasm) => {
      const of = [wasm.pointer(level, "level"), wasm.point(origin, "origin")];
      return this.#add("z_buffer_of_level", width, height, ...of);
    });
  }

  setContribution(pictureHeight, leastPixels, distanceEye) {
    this.wasm.call((wasm) => {
      const eye = wasm.optionalPoint(distanceEye, "distanceEye");
      wasm.check("vis_pipeline_set_contribution", this.pointer, pictureHeight, leastPixels, eye);
    });
  }

  setReach(metres, radians) {
    this.wasm.call((wasm) => wasm.check("vis_pipeline_set_reach", this.pointer, metres, radians));
  }

  get isKept() {
    return this.wasm.truth("vis_pipeline_is_kept", this.pointer);
  }

  cull(scene, view, visible) {
    return this.wasm.call((wasm) => {
      const place = wasm.borrow(STATS_BYTES);
      wasm.check("vis_pipeline_cull", this.pointer, ...wasm.frame(scene, view, visible), place);
      visible.scene = scene;
      for (const reflections of this.#reflections) reflections.scene = scene;
      return stats(wasm, place);
    });
  }

  stageStats(stage) {
    return this.wasm.call((wasm) => {
      const place = wasm.borrow(STATS_BYTES);
      wasm.check("vis_pipeline_stage_stats", this.pointer, whole(stage, "stage"), place);
      return stats(wasm, place);
    });
  }

  get accuracy() {
    return ACCURACIES[this.wasm.number("vis_pipeline_accuracy", this.pointer)];
  }

  reset() {
    this.wasm.call((wasm) => wasm.check("vis_pipeline_reset", this.pointer));
  }

  freeze(frozen = true) {
    this.wasm.call((wasm) => wasm.check("vis_pipeline_freeze", this.pointer, bit(frozen, "frozen")));
  }

  setExplaining(explaining) {
    const flag = bit(explaining, "explaining");
    this.wasm.call((wasm) => wasm.check("vis_pipeline_set_explaining", this.pointer, flag));
  }

  explain(id) {
    return this.wasm.text("vis_pipeline_explain", this.pointer, id);
  }

  lacks(scene) {
    return this.wasm.text("vis_pipeline_lacks", this.pointer, this.wasm.pointer(scene, "scene"));
  }
}

/** Reads a `vis_stats`, whose counts are far below 2^53. */
function stats(wasm, place) {
  const data = wasm.data();
  const [nodes, acceptedSubtrees, tests, occluders, visible] = [0, 8, 16, 24, 32].map((offset) =>
    Number(data.getBigUint64(place + offset, true)),
  );
  return { nodes, acceptedSubtrees, tests, occluders, visible };
}

class Visible extends Handle {
  /** Pointer to the scene of the last frame, by which the set is read: null before, and once it is destroyed. */
  get #culled() {
    return this.scene?.pointer ?? 0;
  }

  get count() {
    return this.wasm.number("vis_visible_count", this.pointer, this.#culled);
  }

  get indices() {
    const count = this.count;
    return this.wasm.call((wasm) => {
      // The indices are read where the library writes them: in a buffer that the set keeps.
      const { held } = this;
      if (held.bytes < 4 * count) {
        wasm.free(held.buffer, held.bytes);
        held.buffer = held.bytes = 0;
        held.buffer = wasm.allocate(8 * count);
        held.bytes = 8 * count;
      }
      if (count === 0) return new Uint32Array(0);
      wasm.check(
        "vis_visible_indices",
        this.pointer,
        this.#culled,
        held.buffer,
        held.bytes / 4,
        wasm.borrow(8),
      );
      return new Uint32Array(wasm.exports.memory.buffer, held.buffer, count);
    });
  }

  get ids() {
    return this.wasm.list(BigUint64Array, "vis_visible_ids", this.pointer, this.#culled);
  }

  get bits() {
    return this.wasm.list(Uint32Array, "vis_visible_write_bits", this.pointer, this.#culled);
  }

  get newlyVisible() {
    return this.wasm.list(BigUint64Array, "vis_visible_newly_visible", this.pointer);
  }

  get newlyHidden() {
    return this.wasm.list(BigUint64Array, "vis_visible_newly_hidden", this.pointer);
  }

  contains(scene, id) {
    return this.wasm.truth("vis_visible_contains", this.pointer, this.wasm.pointer(scene, "scene"), id);
  }

  sortByIndex(scene) {
    this.wasm.call((wasm) =>
      wasm.check("vis_visible_sort_by_index", this.pointer, wasm.pointer(scene, "scene")),
    );
  }
}

class Lods extends Handle {
  setPictureHeight(pictureHeight) {
    this.wasm.call((wasm) => wasm.check("vis_lods_set_picture_height", this.pointer, pictureHeight));
  }

  setDistanceEye(eye) {
    this.wasm.call((wasm) =>
      wasm.check("vis_lods_set_distance_eye", this.pointer, wasm.optionalPoint(eye, "eye")),
    );
  }

  select(scene, view, visible, elapsedSeconds) {
    this.wasm.call((wasm) =>
      wasm.check("vis_lods_select", this.pointer, ...wasm.frame(scene, view, visible), elapsedSeconds),
    );
  }

  get selected() {
    return this.wasm.call((wasm) => {
      const [at, length] = wasm.listed(LOD_BYTES, "vis_lods_selected", this.pointer);
      const { buffer } = wasm.exports.memory;
      const [words, floats] = [Uint32Array, Float32Array].map((Type) => new Type(buffer, at, 6 * length));
      const ids = new BigUint64Array(buffer, at, 3 * length);
      const column = (Type, from, first, each) => {
        const values = new Type(length);
        for (let i = 0; i < length; i++) values[i] = from[each * i + first];
        return values;
      };
      return {
        ids: column(BigUint64Array, ids, 0, 3),
        levels: column(Uint8Array, words, 2, 6),
        previous: column(Uint8Array, words, 3, 6),
        fades: column(Float32Array, floats, 4, 6),
        opacities: column(Float32Array, floats, 5, 6),
      };
    });
  }

  lod(id) {
    return this.wasm.call((wasm) => {
      const at = wasm.borrow(LOD_BYTES);
      wasm.check("vis_lods_lod", this.pointer, id, at);
      const data = wasm.data();
      if (data.getBigUint64(at, true) === NO_OBJECT) return null;
      const [level, previous] = [8, 12].map((offset) => data.getUint32(at + offset, true));
      const [fade, opacity] = [16, 20].map((offset) => data.getFloat32(at + offset, true));
      return { level, previous, fade, opacity };
    });
  }

  reset() {
    this.wasm.call((wasm) => wasm.check("vis_lods_reset", this.pointer));
  }
}

class DrawList extends Handle {
  group(scene, visible) {
    this.#group("group", scene, visible, "visible");
  }

  groupLevels(scene, lods) {
    this.#group("group_levels", scene, lods, "lods");
  }

  groupFading(scene, lods) {
    this.#group("group_fading", scene, lods, "lods");
  }

  #group(name, scene, of, kind) {
    this.wasm.call((wasm) => {
      const from = [wasm.pointer(scene, "scene"), wasm.pointer(of, kind)];
      wasm.check(`vis_draw_list_${name}`, this.pointer, ...from);
    });
  }

  get groups() {
    return this.#words(GROUP_BYTES, "vis_draw_list_groups");
  }

  get instances() {
    return this.wasm.list(Uint32Array, "vis_draw_list_instances", this.pointer);
  }

  commands(meshes) {
    const count = elements(meshes, COMMAND_BYTES / 4, "meshes");
    return this.#words(COMMAND_BYTES, "vis_draw_list_commands", (wasm) => [wasm.put(Uint32Array, meshes), count]);
  }

  /** Returns a copy of a list of structures of so many bytes, all of whose fields are numbers of 32 bits. */
  #words(bytes, name, parameters = () => []) {
    return this.wasm.call((wasm) => {
      const [at, length] = wasm.listed(bytes, name, this.pointer, ...parameters(wasm));
      return new Uint32Array(wasm.exports.memory.buffer, at, (length * bytes) / 4).slice();
    });
  }
}

class Judge extends Handle {
  compare(scene, view, visible) {
    return this.wasm.call((wasm) => {
      const place = wasm.borrow(COMPARISON_BYTES);
      wasm.check("vis_measure_compare", this.pointer, ...wasm.frame(scene, view, visible), place);
      const [reportedObjects, falseHiddenObjects, falseVisibleObjects, wrongPixels] = new Uint32Array(
        wasm.exports.memory.buffer,
        place,
        4,
      );
      return { reportedObjects, falseHiddenObjects, falseVisibleObjects, wrongPixels };
    });
  }
}

class Graph extends Handle {
  get counts() {
    return this.wasm.call((wasm) => {
      const place = wasm.borrow(8);
      wasm.check("vis_graph_counts", this.pointer, place, place + 4);
      return { cells: wasm.u32(place), portals: wasm.u32(place + 4) };
    });
  }

  bake(clearance = 0) {
    return Handle.made(Pvs, this.wasm, "pvs", "vis_graph_bake", this.pointer, clearance);
  }
}

class Cells extends Handle {
  setPvs(pvs) {
    this.wasm.call((wasm) => wasm.check("vis_cells_set_pvs", this.pointer, wasm.pointer(pvs, "pvs")));
  }

  setOpen(portal, open) {
    const parameters = [whole(portal, "portal"), bit(open, "open")];
    this.wasm.call((wasm) => wasm.check("vis_cells_set_open", this.pointer, ...parameters));
  }

  setPassage(portal, { forward, backward } = {}) {
    const parameters = [whole(portal, "portal"), bit(forward, "forward"), bit(backward, "backward")];
    this.wasm.call((wasm) => wasm.check("vis_cells_set_passage", this.pointer, ...parameters));
  }

  addMirror(cell, vertices) {
    return this.wasm.call((wasm) => {
      const points = wasm.put(Float64Array, flatten(vertices, 3, "a vertex"));
      return wasm.number("vis_cells_add_mirror", this.pointer, whole(cell, "cell"), points, vertices.length);
    });
  }

  setMirror(mirror, uncovered) {
    const parameters = [whole(mirror, "mirror"), bit(uncovered, "uncovered")];
    this.wasm.call((wasm) => wasm.check("vis_cells_set_mirror", this.pointer, ...parameters));
  }

  canSee(from, to) {
    return this.wasm.truth("vis_cells_can_see", this.pointer, whole(from, "from"), whole(to, "to"));
  }
}

class Reflections extends Handle {
  get list() {
    return this.wasm.call((wasm) => {
      const [at, length] = wasm.listed(REFLECTION_BYTES, "vis_reflections_list", this.pointer);
      const words = new Uint32Array(wasm.exports.memory.buffer, at, 3 * length);
      return Array.from({ length }, (_, i) => {
        const [mirror, parent, depth] = words.subarray(3 * i, 3 * i + 3);
        return { mirror, parent: parent === NO_REFLECTION ? null : parent, depth };
      });
    });
  }

  get leftOut() {
    return this.wasm.number("vis_reflections_left_out", this.pointer);
  }

  read(number, view, visible) {
    this.wasm.call((wasm) => {
      const to = [wasm.pointer(view, "view"), wasm.pointer(visible, "visible")];
      wasm.check("vis_reflections_read", this.pointer, whole(number, "number"), ...to);
      visible.scene = this.scene;
    });
  }
}

class Pvs extends Handle {
  get counts() {
    return this.wasm.call((wasm) => {
      const place = wasm.borrow(8);
      wasm.check("vis_pvs_counts", this.pointer, place, place + 4);
      return { viewcells: wasm.u32(place), targets: wasm.u32(place + 4) };
    });
  }

  get bytes() {
    return this.wasm.list(Uint8Array, "vis_pvs_write", this.pointer);
  }

  sees(viewcell, target) {
    const parameters = [whole(viewcell, "viewcell"), whole(target, "target")];
    return this.wasm.truth("vis_pvs_sees", this.pointer, ...parameters);
  }

  row(viewcell) {
    return this.wasm.list(Uint32Array, "vis_pvs_write_row", this.pointer, whole(viewcell, "viewcell"));
  }
}

class ScenePvs extends Handle {}

class Online extends Handle {
  step(scene, places, budget) {
    return this.wasm.call((wasm) => {
      const place = wasm.borrow(WORK_BYTES);
      const from = [wasm.pointer(scene, "scene"), ...wasm.numbers(places, 3, "places")];
      wasm.check("vis_online_step", this.pointer, ...from, Math.max(0, whole(budget, "budget")), place);
      const [worked, isWide, isFinished] = wasm.bytes().subarray(place, place + 3);
      if (!worked) return null;
      return { isWide: isWide !== 0, isFinished: isFinished !== 0, stats: stats(wasm, place + 8) };
    });
  }

  get answer() {
    return ANSWERS[this.wasm.number("vis_online_answer", this.pointer)];
  }

  get came() {
    return this.wasm.list(BigUint64Array, "vis_online_came", this.pointer);
  }

  get went() {
    return this.wasm.list(BigUint64Array, "vis_online_went", this.pointer);
  }

  hiddenFrom(scene, { min, max } = {}) {
    return this.wasm.call((wasm) => {
      const from = [wasm.pointer(scene, "scene"), wasm.point(min, "min"), wasm.point(max, "max")];
      return wasm.list(Uint32Array, "vis_online_write_hidden", this.pointer, ...from);
    });
  }
}

class SightCells extends Handle {
  setOpacity(wall, opacity) {
    const parameters = [whole(wall, "wall"), whole(opacity, "opacity")];
    this.wasm.call((wasm) => wasm.check("vis_sight_cells_set_opacity", this.pointer, ...parameters));
  }

  get objects() {
    return this.wasm.list(BigUint64Array, "vis_sight_cells_objects", this.pointer);
  }
}

class WhoSees extends Handle {
  look(cells, observers, targets, scene) {
    this.wasm.call((wasm) => {
      const level = [wasm.pointer(cells, "sight_cells"), scene ? wasm.pointer(scene, "scene") : 0];
      const movers = [...wasm.numbers(observers, 7, "observers"), ...wasm.numbers(targets, 7, "targets")];
      wasm.check("vis_who_sees_look", this.pointer, ...level, ...movers);
    });
  }

  sees(observer, target) {
    const parameters = [whole(observer, "observer"), whole(target, "target")];
    return this.wasm.truth("vis_who_sees_sees", this.pointer, ...parameters);
  }

  seenBy(observer) {
    return this.wasm.list(Uint32Array, "vis_who_sees_seen_by", this.pointer, whole(observer, "observer"));
  }
}

class Level extends Handle {
  get bytes() {
    return this.wasm.list(Uint8Array, "vis_level_write", this.pointer);
  }
}

class Plan extends Handle {
  setOpacity(wall, opacity) {
    const parameters = [whole(wall, "wall"), whole(opacity, "opacity")];
    this.wasm.call((wasm) => wasm.check("vis_plan_set_opacity", this.pointer, ...parameters));
  }

  sees(a, b) {
    return this.wasm.call((wasm) =>
      wasm.truth("vis_plan_sees", this.pointer, wasm.pair(a, "a"), wasm.pair(b, "b")),
    );
  }

  ray(eye, through) {
    return this.wasm.call((wasm) => {
      const hit = wasm.borrow(WALL_HIT_BYTES);
      wasm.check("vis_plan_ray", this.pointer, wasm.pair(eye, "eye"), wasm.pair(through, "through"), hit);
      const data = wasm.data();
      const point = [data.getFloat64(hit, true), data.getFloat64(hit + 8, true)];
      const wall = data.getUint32(hit + 16, true);
      return Number.isNaN(point[0]) ? null : { point, wall: wall === NO_WALL ? null : wall };
    });
  }

  polygon(eye, { range = Infinity } = {}) {
    return this.#around(Float64Array, "vis_plan_visibility_polygon", eye, range);
  }

  walls(eye, { range = Infinity } = {}) {
    return this.#around(Uint32Array, "vis_plan_visible_walls", eye, range);
  }

  #around(Type, name, eye, range) {
    return this.wasm.call((wasm) => wasm.list(Type, name, this.pointer, wasm.pair(eye, "eye"), range));
  }

  wallsFromRegion(points) {
    return this.wasm.call((wasm) => {
      const of = wasm.numbers(points, 2, "points");
      return wasm.list(Uint32Array, "vis_plan_walls_seen_from_region", this.pointer, ...of);
    });
  }
}
