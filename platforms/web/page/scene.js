// The built-in scenes, from the recipes in `scenes.wasm`, and how they get into the library.

/** Names of the scenes, in the order in which the module numbers them. */
export const SCENES = ["plpcity", "office", "london"];

/**
 * Loads the recipes from the bytes of `scenes.wasm`. Returns a function that makes a scene as lists of
 * numbers.
 */
export async function loadRecipes(bytes) {
  const { instance } = await WebAssembly.instantiate(bytes, {});
  const { memory, scenes_make, scenes_numbers, scenes_length } = instance.exports;
  /** Returns a copy of a list, since the next scene takes its place. */
  const list = (Type, number) =>
    new Type(memory.buffer, scenes_numbers(number), scenes_length(number)).slice();
  return (name, a, b) => {
    if (!scenes_make(SCENES.indexOf(name), a, b)) throw new Error(`there is no scene ${name}:${a},${b}`);
    return {
      triangleCounts: list(Uint32Array, 0),
      triangles: list(Float32Array, 1),
      keyCounts: list(Uint32Array, 2),
      keys: list(Float64Array, 3),
      lenses: list(Float64Array, 4),
      cells: list(Float64Array, 5),
      portalCells: list(Uint32Array, 6),
      portalVertexCounts: list(Uint32Array, 7),
      portalVertices: list(Float64Array, 8),
      tolerance: list(Float64Array, 9),
    };
  };
}

/** Returns the cameras at the keys of all walks, for `View.setPerspective`. */
export function cameras(lists, aspect) {
  const [near, ...fields] = lists.lenses;
  const fovs = fields.flatMap((fovY, walk) => Array(lists.keyCounts[walk]).fill(fovY));
  return fovs.map((fovY, key) => {
    const at = (first) => [...lists.keys.subarray(6 * key + first, 6 * key + first + 3)];
    return { eye: at(0), target: at(3), up: [0, 0, 1], fovY, aspect, near };
  });
}

/** Returns the first triangle of each object, and the number of all triangles at the end. */
export function firstTriangles({ triangleCounts }) {
  const first = new Uint32Array(triangleCounts.length + 1);
  triangleCounts.forEach((count, object) => (first[object + 1] = first[object] + count));
  return first;
}

/** Makes the library's scene of lists. Object `i` gets index `i`. */
export function fillScene(visibility, lists) {
  const first = firstTriangles(lists);
  const bounds = new Float32Array(6 * lists.triangleCounts.length);
  for (let object = 0; object < lists.triangleCounts.length; object++) {
    const box = bounds
      .subarray(6 * object, 6 * object + 6)
      .fill(Infinity, 0, 3)
      .fill(-Infinity, 3);
    for (let i = 9 * first[object]; i < 9 * first[object + 1]; i++) {
      box[i % 3] = Math.min(box[i % 3], lists.triangles[i]);
      box[3 + (i % 3)] = Math.max(box[3 + (i % 3)], lists.triangles[i]);
    }
  }
  const scene = visibility.createScene();
  const ids = scene.insertAll({ bounds, cost: lists.triangleCounts, flags: 2 });
  ids.forEach((id, object) =>
    scene.setTriangles(id, lists.triangles.subarray(9 * first[object], 9 * first[object + 1])),
  );
  scene.prepareOccluders();
  return { scene, ids, bounds };
}

/**
 * Makes the cells of a scene and a baked set of what is seen from each cell; nothing of both for a scene without
 * cells. `scene`, `ids` and `bounds` are those that `fillScene` returned.
 */
export function makeBuilding(visibility, lists, { scene, ids, bounds }) {
  if (lists.cells.length === 0) return {};
  const triple = (numbers, index) => [...numbers.subarray(3 * index, 3 * index + 3)];
  let vertex = 0;
  const portals = [...lists.portalVertexCounts].map((count, portal) => ({
    vertices: Array.from({ length: count }, () => triple(lists.portalVertices, vertex++)),
    cells: [lists.portalCells[2 * portal], lists.portalCells[2 * portal + 1]],
  }));
  const volumes = Array.from({ length: lists.cells.length / 6 }, (_, cell) => ({
    min: triple(lists.cells, 2 * cell),
    max: triple(lists.cells, 2 * cell + 1),
  }));
  const graph = visibility.createGraph(volumes.length, portals);
  const [tolerance] = lists.tolerance;
  const cells = visibility.createCells(graph, volumes, { tolerance });
  // An object is seen from where one of the cells is that it touches.
  const pairs = volumes.flatMap(({ min, max }, cell) => {
    const [low, high] = [min.map((number) => number - tolerance), max.map((number) => number + tolerance)];
    const touches = (_, object) =>
      low.every((number, i) => number <= bounds[6 * object + 3 + i] && bounds[6 * object + i] <= high[i]);
    return [...ids].filter(touches).map((id) => [id, cell]);
  });
  const pvs = graph.bake();
  const [objects, targets] = [0, 1].map((part) => pairs.map((pair) => pair[part]));
  const baked = visibility.createScenePvs(scene, pvs, volumes, objects, targets);
  for (const handle of [graph, pvs]) handle.destroy();
  return { cells, baked };
}

/** Makes a pipeline by the name of its last stage. */
export function makePipeline(visibility, name, { cells, baked } = {}) {
  const pipeline = visibility.createPipeline();
  if (name === "everything") return pipeline;
  pipeline.addFrustum();
  if (name === "z-buffer") pipeline.addZBuffer();
  if (name === "portals") pipeline.addPortals(cells);
  if (name === "baked") pipeline.addPvs(baked);
  return pipeline;
}

/** Names of the pipelines that suit a scene. */
export function pipelineNames(lists) {
  return ["frustum", "z-buffer", ...(lists.cells.length > 0 ? ["portals", "baked"] : [])];
}
