// The worker of `late.js`: follows the calls of a scene, culls for views with a reach, and finds what is hidden
// from boxes.

import { ALL_LAYERS, indexOf, load } from "./visibility.js";

/** Culls of one view until the answer is kept: for the view itself, for its reach, and to see that it is. */
const MOST_CULLS = 3;

/** The number of the mesh that hides nothing: objects have it in the place of one that is refused. */
const NO_SHAPE = 0n;
/** Part of a coordinate that a box may be less than another by rounding. */
const ROUNDING = 1e-6;

/** Whether a box holds another, but for rounding. Improper boxes hold all: their objects are never culled. */
function holds({ min, max }, other) {
  const isBeyond = (x, y) => x - y > ROUNDING * (Math.abs(x) + Math.abs(y));
  return !min.some((x, i) => isBeyond(x, other.min[i]) || isBeyond(other.max[i], max[i]));
}

/**
 * The answer to a question by which nothing is hidden. By a clear bit a region is hidden: it has no answer rather than
 * one without bits.
 */
const NO_ANSWER = ({ what }) => (what === "region" ? null : { isForReach: false, bits: new Uint32Array(0) });

/** Serves a port with a library. */
export function serve(port, visibility) {
  const scene = visibility.createScene();
  /** By number of the main thread: the mesh, unless the library has refused it. */
  const meshes = new Map();
  const pipelines = new Map();
  const visible = visibility.createVisible();
  const view = visibility.createView();
  let revision = 0;
  let refusals = [];
  /** By index: the id that an object has here. */
  const ids = [];
  /** Whether this scene is not that of the main thread: then no answer holds. */
  let isBroken = false;

  /** Returns the id of the object that has another in the main thread. */
  const here = (id) => ids[indexOf(id)];

  const own = {
    insertAll(objects, indices) {
      const made = scene.insertAll(objects);
      made.forEach((id, i) => {
        const index = indexOf(id);
        if (index !== indices[i]) throw new Error(`object ${indices[i]} is object ${index} here`);
        ids[index] = id;
      });
    },
    removeAll: (all) => scene.removeAll(all.map(here)),
    setOrigin: (origin) => scene.setOrigin(origin),
    setAllBounds: (all, bounds) => scene.setAllBounds(all.map(here), bounds),
    setLocalBounds(id, box, bounds) {
      scene.setLocalBounds(here(id), box);
      if (!holds(scene.bounds(here(id)), bounds)) throw new Error("the object is elsewhere here");
    },
    setTransforms: (all, matrices) => scene.setTransforms(all.map(here), matrices),
    setLayers: (id, layers) => scene.setLayers(here(id), layers),
    setFlags: (id, flags) => scene.setFlags(here(id), flags),
    rebuild: () => scene.rebuild(),
    addMesh: (mesh, number) => meshes.set(number, scene.addMesh(mesh)),
    addBoxMesh: (box, number) => meshes.set(number, scene.addBoxMesh(box)),
    removeMesh(number) {
      const mesh = meshes.get(number);
      meshes.delete(number);
      if (mesh !== undefined) scene.removeMesh(mesh);
    },
    setMesh(id, number, transform) {
      if (!meshes.has(number)) refusals.push(`setMesh: mesh ${number} was refused or removed`);
      scene.setMesh(here(id), meshes.get(number) ?? meshes.get(NO_SHAPE), transform);
    },
    setTriangles(id, triangles) {
      try {
        scene.setTriangles(here(id), triangles);
      } catch (error) {
        // The former triangles hide nothing more.
        scene.setTriangles(here(id), []);
        throw error;
      }
    },
    prepareOccluders: () => scene.prepareOccluders(),
  };
  /** What may be refused here alone: shapes, which the main thread does not have. */
  const MAY_FAIL = ["addMesh", "addBoxMesh", "setTriangles"];

  function apply([name, parameters]) {
    revision++;
    try {
      own[name](...parameters);
    } catch (error) {
      refusals.push(`${name}: ${error.message}`);
      isBroken ||= !MAY_FAIL.includes(name);
    }
  }

  /** Returns the pipeline of stages: names of methods with their parameters. */
  function pipelineOf(stages) {
    const key = JSON.stringify(stages);
    let made = pipelines.get(key);
    // Cells are of occluders as they were.
    if (made?.cells && made.revision !== revision) {
      for (const handle of [made.pipeline, made.cells]) handle.destroy();
      made = null;
    }
    if (!made) {
      made = { pipeline: visibility.createPipeline().addFrustum(), cells: null, revision };
      for (const [name, ...parameters] of stages) {
        if (name === "addPortals") {
          made.cells = visibility.createCellsOfScene(scene, ...parameters);
          made.pipeline.addPortals(made.cells);
        } else made.pipeline[name](...parameters);
      }
      pipelines.set(key, made);
    }
    return made;
  }

  const answers = {
    cull(ask) {
      const { of, reach, camera: [method, parameters], layers } = ask;
      // Cells are of the occluders of all layers.
      if (layers !== ALL_LAYERS && of.some(([name]) => name === "addPortals")) return NO_ANSWER(ask);
      view[method](...parameters);
      view.setLayers(layers);
      const { pipeline, cells } = pipelineOf(of);
      pipeline.setReach(...reach);
      // Without this, an answer that is kept could be for a reach around an earlier view.
      pipeline.reset();
      let stats;
      for (let i = 0; i < MOST_CULLS; i++) {
        const culled = pipeline.cull(scene, view, visible);
        if (pipeline.isKept) break;
        stats = culled;
      }
      return { isForReach: pipeline.isKept, bits: visible.bits, occluders: stats?.occluders ?? 0, cells: cells?.count };
    },
    /** Finds what is hidden from all points of a box, by sets made ahead for its middle. */
    hidden({ min, max }) {
      const size = min.map((low, i) => max[i] - low);
      const middle = min.map((low, i) => (low + max[i]) / 2);
      const most = Math.max(...size);
      // A viewcell reaches the margin beyond its place, here half of the box and a little more.
      const margin = most * 0.5625;
      const cell = 2 * most;
      const online = visibility.createOnline({
        viewcell: [cell, cell, cell],
        wide: [2 * cell, 2 * cell, 2 * cell],
        margin,
      });
      while (online.step(scene, middle, 1e6) !== null);
      const bits = online.hiddenFrom(scene, { min, max });
      online.destroy();
      return { bits };
    },
    /** Finds what is seen from a box by a sweep, and then decides what is left by rays and proofs. */
    region({ min, max, clearance, mostSteps }) {
      const bits = scene.seenFrom({ min, max });
      return { bits, ...scene.proveFrom({ min, max }, { clearance, mostSteps }) };
    },
  };

  port.onmessage = ({ data: { calls = [], ask } }) => {
    for (const call of calls) apply(call);
    if (calls.length > 0) scene.maintain();
    if (!ask) return;
    const start = performance.now();
    let answer;
    try {
      answer = isBroken ? NO_ANSWER(ask) : answers[ask.what](ask);
    } catch (error) {
      refusals.push(error.message);
      answer = NO_ANSWER(ask);
    }
    if (answer) answer.milliseconds = performance.now() - start;
    port.postMessage({ number: ask.number, refusals, answer }, answer ? [answer.bits.buffer] : []);
    refusals = [];
  };
}

/**
 * Serves a port once a library is loaded: `loading` is the promise of it. If it cannot be loaded, each question is
 * answered by what hides nothing, with the reason among the refusals, and calls are dropped.
 */
export async function serveLoaded(port, loading) {
  // What comes before the library is there.
  const early = [];
  port.onmessage = (message) => early.push(message);
  try {
    serve(port, await loading);
  } catch (error) {
    const refusals = [`worker: the library is not loaded: ${error.message}`];
    port.onmessage = ({ data: { ask } }) => {
      if (ask) port.postMessage({ number: ask.number, refusals, answer: NO_ANSWER(ask) });
    };
  }
  for (const message of early.splice(0)) port.onmessage(message);
}

/** Resolves to the library whose module is in the first message to a port. */
function loadGiven(port) {
  return new Promise((resolve) => {
    port.addEventListener("message", ({ data: { wasm } }) => resolve(load({ wasm })), { once: true });
  });
}

if (typeof DedicatedWorkerGlobalScope !== "undefined" && self instanceof DedicatedWorkerGlobalScope)
  serveLoaded(self, self.name === "given" ? loadGiven(self) : load({ frames: self.name === "frames" }));
