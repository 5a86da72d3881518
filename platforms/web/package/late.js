// Culling in a worker, whose answers come late and never hide by mistake. `late.d.ts` describes it.
//
// The scene of this thread has boxes alone. Each call that changes it is sent to the workers as well, which
// have the same objects with the same indices, since these depend on the order of calls alone. Occluder meshes
// are with the workers only: in this thread, each object that is given one gets a mesh that hides nothing in its
// place, so that local bounds, meshes and transforms move the object as they do in the workers. An answer is for
// a scene after so many calls, and for one view with a reach. It hides an object of the present frame only if
// - the present view is within that reach of the view that it was made for (`View.isWithinReach`),
// - no occluder has moved, changed or gone since, and
// - the object itself has not changed since.

import { ALL_LAYERS, Flag, indexOf } from "./visibility.js";

/**
 * A triangle that hides nothing. It is outside of the bounds of any object but a sky; then it is too small to cover a
 * pixel, as seen by an eye within 1e17 metres of the origin.
 */
const NO_SHAPE = {
  positions: [1e18, 1e18, 1e18, 1e18, 1e18 + 1e12, 1e18, 1e18, 1e18, 1e18 + 1e12],
  indices: [0, 1, 2],
};
/** A matrix that every object with local bounds refuses. */
const NO_TRANSFORM = [NaN, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1];
/** Bounds that are not equal to any others, nor to themselves. */
const NO_BOUNDS = [NaN, NaN, NaN, NaN, NaN, NaN];

/** Returns a list that can be iterated, as an `ArrayLike` need not be. */
function listOf(list) {
  return Array.isArray(list) || ArrayBuffer.isView(list) ? list : Array.from(list);
}

/** Returns a copy of an argument, and adds the memory of typed arrays to `moved`: they go without another. */
function copied(argument, moved) {
  if (ArrayBuffer.isView(argument)) {
    const copy = argument.slice();
    moved.push(copy.buffer);
    return copy;
  }
  if (Array.isArray(argument)) return argument.slice();
  if (typeof argument !== "object" || argument === null) return argument;
  if (argument.length >= 0) return Array.from(argument);
  return Object.fromEntries(Object.entries(argument).map(([name, value]) => [name, copied(value, moved)]));
}

/** Returns the number of bits that are set in words of 32. */
export function countBits(words) {
  let count = 0;
  for (let word of words) {
    word -= (word >>> 1) & 0x55555555;
    word = (word & 0x33333333) + ((word >>> 2) & 0x33333333);
    count += (((word + (word >>> 4)) & 0x0f0f0f0f) * 0x01010101) >>> 24;
  }
  return count;
}

/** Starts a worker of this package. With `frames` it loads the small module, with `wasm` that one. */
export function startWorker({ frames = false, wasm } = {}) {
  // Bundlers look for literals.
  if (wasm) {
    const worker = new Worker(new URL("./late-worker.js", import.meta.url), { type: "module", name: "given" });
    worker.postMessage({ wasm });
    return worker;
  }
  return frames
    ? new Worker(new URL("./late-worker.js", import.meta.url), { type: "module", name: "frames" })
    : new Worker(new URL("./late-worker.js", import.meta.url), { type: "module", name: "whole" });
}

/** Greatest number of messages of workers that are kept: the last ones. */
const MOST_REFUSALS = 64;

/** A scene that workers follow. It has the methods of `Scene`. */
export class LateScene {
  /** The last messages of workers: about meshes that the library has refused, which hide nothing, and what failed. */
  refusals = [];
  #scene;
  #ports;
  #calls = [];
  #moved = [];
  /** Number of calls so far. */
  #revision = 0;
  /** Number of calls after the last that may let something be seen through what an earlier answer had. */
  #opened = 0;
  /** By index of an object: its flags. */
  #flags = [];
  /** By index of an object: number of calls after its last change. */
  #changed = [];
  /** Ids of objects that have been given local bounds. */
  #placed = new Set();
  /** The mesh of this thread that objects have in the place of theirs. */
  #noShape;
  #meshes = 0n;
  #asks = new Map();
  #lastAsk = 0;

  /** `ports` are workers, or other ports to `serve` of `late-worker.js`. */
  constructor(scene, ports) {
    this.#scene = scene;
    this.#ports = ports;
    for (const port of ports) {
      port.onmessage = ({ data }) => this.#receive(data);
      // A worker that does not start gives no answers: nothing is hidden.
      port.onerror = ({ message }) => this.#refuse([`worker: ${message}`]);
    }
    this.#noShape = scene.addMesh(NO_SHAPE);
    // The first mesh of the workers is the same.
    this.addMesh(NO_SHAPE);
  }

  /** The scene of this thread, for pipelines. */
  get local() {
    return this.#scene;
  }

  /** Number of calls so far. */
  get revision() {
    return this.#revision;
  }

  get count() {
    return this.#scene.count;
  }

  get indexLimit() {
    return this.#scene.indexLimit;
  }

  contains(id) {
    return this.#scene.contains(id);
  }

  bounds(id) {
    return this.#scene.bounds(id);
  }

  insert({ bounds: { min, max }, ...rest }) {
    return this.insertAll({ bounds: [...min, ...max], ...rest })[0];
  }

  insertAll(objects) {
    const ids = this.#scene.insertAll(objects);
    this.#toWorkers("insertAll", objects, Uint32Array.from(ids, indexOf));
    const { flags = 0 } = objects;
    ids.forEach((id, i) => (this.#flags[indexOf(id)] = typeof flags === "number" ? flags : flags[i]));
    this.#changes(ids);
    return ids;
  }

  remove(id) {
    this.removeAll([id]);
  }

  removeAll(given) {
    const ids = listOf(given);
    this.#both("removeAll", ids);
    this.#changes(ids, true);
    for (const id of ids) {
      this.#flags[indexOf(id)] = 0;
      this.#placed.delete(id);
    }
  }

  setOrigin(origin) {
    this.#both("setOrigin", origin);
    this.#opened = this.#revision;
  }

  setBounds(id, box) {
    this.#scene.setBounds(id, box);
    this.#boundsToWorkers([id], [...box.min, ...box.max]);
  }

  setAllBounds(given, bounds) {
    const ids = listOf(given);
    this.#scene.setAllBounds(ids, bounds);
    this.#boundsToWorkers(ids, bounds);
  }

  /**
   * Sends bounds that objects have been given here. An object keeps its local bounds if the bounds are those that it
   * has. These may be larger by rounding in the workers, where they hold the object's mesh: so this thread decides, and
   * the workers follow.
   */
  #boundsToWorkers(ids, bounds) {
    if (this.#placed.size > 0 && ids.some((id) => this.#placed.has(id))) {
      // With bounds that differ from those it has, an object loses its local bounds.
      const lost = Array.from(ids).filter((id) => this.#placed.has(id) && !this.#hasLocalBounds(id));
      for (const id of lost) this.#placed.delete(id);
      if (lost.length > 0) this.#toWorkers("setAllBounds", lost, lost.flatMap(() => NO_BOUNDS));
      const places = [...ids.keys()].filter((i) => !this.#placed.has(ids[i]));
      const numbers = new Float64Array(6 * places.length);
      places.forEach((place, i) => {
        for (let k = 0; k < 6; k++) numbers[6 * i + k] = bounds[6 * place + k];
      });
      const sent = places.map((place) => ids[place]);
      if (sent.length > 0) this.#toWorkers("setAllBounds", sent, numbers);
    } else this.#toWorkers("setAllBounds", ids, bounds);
    this.#changes(ids, true);
  }

  #hasLocalBounds(id) {
    if (!this.#placed.has(id)) return false;
    try {
      this.#scene.setTransforms([id], NO_TRANSFORM);
    } catch ({ code }) {
      return code !== "STATE";
    }
    return true;
  }

  setLocalBounds(id, box) {
    this.#scene.setLocalBounds(id, box);
    // The bounds follow from a transform that was set before. Workers with another give no answers from then on.
    this.#toWorkers("setLocalBounds", id, box, this.#scene.bounds(id));
    this.#changes([id], true);
    this.#placed.add(id);
  }

  setTransforms(given, matrices) {
    const ids = listOf(given);
    this.#both("setTransforms", ids, matrices);
    this.#changes(ids, true);
  }

  setLayers(id, layers) {
    this.#both("setLayers", id, layers);
    this.#changes([id], true);
  }

  setFlags(id, flags) {
    this.#both("setFlags", id, flags);
    // An occluder with other flags may hide less: it is never culled, has one side, or is seen through.
    this.#changes([id], flags !== this.#flags[indexOf(id)]);
    this.#flags[indexOf(id)] = flags;
  }

  maintain(budget) {
    // Workers maintain their own hierarchies.
    return this.#scene.maintain(budget);
  }

  rebuild() {
    this.#both("rebuild");
  }

  addMesh(mesh) {
    return this.#addMesh("addMesh", mesh);
  }

  addBoxMesh(box) {
    return this.#addMesh("addBoxMesh", box);
  }

  removeMesh(mesh) {
    this.#toWorkers("removeMesh", mesh);
    this.#opened = this.#revision;
  }

  setMesh(id, mesh, transform) {
    this.#scene.setMesh(id, this.#noShape, transform);
    this.#toWorkers("setMesh", id, mesh, transform);
    this.#changes([id], true);
  }

  setTriangles(id, triangles) {
    // Refuses an object that is not there.
    this.#scene.setTriangles(id, []);
    this.#toWorkers("setTriangles", id, triangles);
    this.#changes([id], true);
  }

  prepareOccluders() {
    this.#toWorkers("prepareOccluders");
  }

  destroy() {
    for (const port of this.#ports) (port.terminate ?? port.close)?.call(port);
    this.#scene.destroy();
  }

  /** Workers give each mesh the number that it has here. */
  #addMesh(name, mesh) {
    const id = this.#meshes++;
    this.#toWorkers(name, mesh, id);
    return id;
  }

  #both(name, ...parameters) {
    // A call that is refused throws here, and is not sent.
    const result = this.#scene[name](...parameters);
    this.#toWorkers(name, ...parameters);
    return result;
  }

  #toWorkers(name, ...parameters) {
    this.#revision++;
    this.#calls.push([name, parameters.map((parameter) => copied(parameter, this.#moved))]);
  }

  /** Notes that objects have changed. With `opens`, those that hide others may do so no more. */
  #changes(ids, opens = false) {
    for (const id of ids) {
      const index = indexOf(id);
      this.#changed[index] = this.#revision;
      if (opens && (this.#flags[index] & Flag.Occluder) !== 0) this.#opened = this.#revision;
    }
  }

  /** Sends what has changed to the workers, and a question to one of them. */
  flush(question = null, to = 0) {
    this.#ports.forEach((port, number) => {
      const ask = number === to ? question : null;
      if (this.#calls.length === 0 && !ask) return;
      // The last worker gets the memory itself, the others a copy.
      const moved = number === this.#ports.length - 1 ? this.#moved : [];
      port.postMessage({ calls: this.#calls, ask }, moved);
    });
    this.#calls = [];
    this.#moved = [];
  }

  /** Asks a worker; `then` gets its answer, with the number of calls that it is for. */
  ask(question, then, to = 0) {
    const number = this.#lastAsk++;
    this.#asks.set(number, { then, revision: this.#revision });
    this.flush({ ...question, number }, to);
  }

  #refuse(refusals) {
    this.refusals.push(...refusals);
    this.refusals.splice(0, this.refusals.length - MOST_REFUSALS);
  }

  #receive({ number, refusals, answer }) {
    this.#refuse(refusals);
    const ask = this.#asks.get(number);
    this.#asks.delete(number);
    ask?.then(answer && { ...answer, revision: ask.revision });
  }

  /** Whether an answer hides anything, of a scene after `revision` calls. */
  holds(revision) {
    return revision >= this.#opened;
  }

  /** Whether an object is as it was after `revision` calls. */
  isSame(index, revision) {
    return (this.#changed[index] ?? 0) <= revision;
  }
}

/** The late answers for the views of one camera. */
export class LateAnswers {
  /** What became of the last frame: how old its answer was, and why there was none. */
  stats = { isUsed: false, reason: "none yet", ageMs: 0, workerMs: 0, occluders: 0 };
  #visibility;
  #scene;
  #reach;
  #stages;
  #isAsked = false;
  #number = 0;
  /** The answer: the view that it is for, bits, and the number of calls of its scene. */
  #answer = null;
  #free = [];

  constructor(visibility, scene, { metres = 0.25, radians = 0.15, stages = [["addZBuffer"]] } = {}) {
    this.#visibility = visibility;
    this.#scene = scene;
    this.#reach = [metres, radians];
    this.#stages = stages;
  }

  /**
   * Takes out of `bits`, of the objects that the frustum leaves, those that a late answer hides from `view`.
   * `camera` is how the view was set: the name of a method of `View`, and its parameters. Asks for the next
   * answer if none is awaited.
   */
  apply(view, camera, bits, layers = ALL_LAYERS) {
    const now = performance.now();
    const { stats } = this;
    const answer = this.#answer;
    const reason = this.#refusal(answer, view);
    const isUsed = reason === "";
    const number = isUsed ? answer.number : -1;
    Object.assign(stats, { isUsed, reason, number, ageMs: answer ? now - answer.asked : 0 });
    if (isUsed) {
      const { bits: seen, revision } = answer;
      // Words beyond the answer are of objects that came later.
      for (let word = 0; word < Math.min(bits.length, seen.length); word++) {
        let hidden = bits[word] & ~seen[word];
        while (hidden !== 0) {
          const bit = 31 - Math.clz32(hidden);
          hidden &= ~(1 << bit);
          if (this.#scene.isSame(32 * word + bit, revision)) bits[word] &= ~(1 << bit);
        }
      }
    }
    if (this.#isAsked) this.#scene.flush();
    else this.#ask(camera, layers, now);
    return bits;
  }

  #refusal(answer, view) {
    if (answer === null) return "none yet";
    if (!answer.isForReach) return "no answer for a reach";
    if (!this.#scene.holds(answer.revision)) return "an occluder has changed";
    return view.isWithinReach(answer.view, ...this.#reach) ? "" : "the camera is beyond its reach";
  }

  #ask([method, ...parameters], layers, asked) {
    const view = this.#free.pop() ?? this.#visibility.createView();
    view[method](...parameters);
    view.setLayers(layers);
    this.#isAsked = true;
    const question = { what: "cull", of: this.#stages, reach: this.#reach, camera: [method, parameters], layers };
    this.#scene.ask(question, (answer) => {
      this.#isAsked = false;
      if (this.#answer) this.#free.push(this.#answer.view);
      this.#answer = { ...answer, view, asked, number: this.#number++ };
      Object.assign(this.stats, { workerMs: answer.milliseconds ?? 0, occluders: answer.occluders ?? 0 });
    });
  }

  destroy() {
    for (const view of [...this.#free, this.#answer?.view]) view?.destroy();
    this.#free = [];
    this.#answer = null;
  }
}
