// Flies through a built-in scene, draws what a culler finds visible, and says what that costs.

import { load } from "../package/visibility.js";
import { Flyer, add, orthographic, perspective, unit, cross } from "./camera.js";
import { Renderer } from "./renderer.js";
import { cameras, fillScene, loadRecipes, makeBuilding, makePipeline, pipelineNames } from "./scene.js";

/** Scenes on offer: recipe and sizes. */
const SCENES = {
  city: ["plpcity", 2, 2],
  office: ["office", 2, 16],
  london: ["london", 12, 12],
};
/** Keys of a walk that pass in a second. */
const KEYS_PER_SECOND = 2;
/** Frames over which times are averaged. */
const AVERAGED = 30;
const SKY = [0.53, 0.63, 0.71];
const GROUND = [0.05, 0.06, 0.07];

const element = (id) => document.getElementById(id);
const canvas = element("canvas");
const query = new URLSearchParams(location.search);

const state = {
  scene: query.get("scene") ?? "city",
  culler: query.get("culler") ?? "z-buffer",
  errors: 0,
  frames: 0,
};
const toggles = { walk: true, freeze: false, above: false, measure: query.has("measure") };
/** For tests and for the curious: what the page is doing. */
window.page = { state, toggles, goTo, chooseScene, chooseCuller, toggle };

let visibility, recipes, renderer, flyer;
/** The scene as lists, as cameras, and in the library. */
let lists, keys, scene, pipeline, view, visible;
/** Cells and baked set of the scene, where it has them. */
let building = {};
let key = 0;
/** The camera of the walk; null once a person flies. */
let still = null;
/** Metres from the lower to the upper edge of the view from above. */
let mapHeight = 80;
let times = [];
let last = performance.now();

function chooseScene(name) {
  state.scene = name;
  lists = recipes(...SCENES[name]);
  keys = cameras(lists, 1);
  for (const handle of [scene, ...Object.values(building)]) handle?.destroy();
  const filled = fillScene(visibility, lists);
  ({ scene } = filled);
  building = makeBuilding(visibility, lists, filled);
  renderer.setScene(lists);
  const names = ["everything", ...pipelineNames(lists)];
  element("culler").replaceChildren(...names.map((name) => new Option(name)));
  chooseCuller(names.includes(state.culler) ? state.culler : "z-buffer");
  goTo(0);
  element("scene").value = name;
}

function chooseCuller(name) {
  state.culler = element("culler").value = name;
  pipeline?.destroy();
  pipeline = makePipeline(visibility, name, building);
  toggle("freeze", false);
  times = [];
}

/** Moves the camera to a key of the scene's walks; fractions are between keys. */
function goTo(position) {
  key = position % keys.length;
  const [from, to, part] = [keys[Math.floor(key)], keys[Math.floor(key) + 1], key % 1];
  // From one walk to the next the camera jumps.
  const near = to && Math.hypot(...add(to.eye, from.eye, -1)) < 5;
  const between = (a, b) => (part === 0 || !near ? a : add(a, add(b, a, -1), part));
  still = { ...from, eye: between(from.eye, to?.eye), target: between(from.target, to?.target) };
  flyer.follow(still);
}

function toggle(name, on = !toggles[name]) {
  toggles[name] = on;
  element(name).setAttribute("aria-pressed", on);
  if (name === "freeze") {
    state.frozen = on ? state.camera : null;
    pipeline.freeze(on);
  }
}

/** Returns the camera of this frame, after `seconds`. */
function moved(seconds) {
  if (toggles.walk) goTo(key + seconds * KEYS_PER_SECOND);
  if (!still) flyer.move(seconds, toggles.above ? 0 : flyer.takeWheel());
  const { fovY, near } = keys[Math.floor(key)];
  return { ...(still ?? flyer.camera), fovY, near, aspect: canvas.width / canvas.height };
}

/** Returns the edges of what a camera sees, up to a distance, as line segments. */
function edges({ eye, target, up, fovY, aspect }, distance) {
  const ahead = unit(add(target, eye, -1));
  const right = unit(cross(ahead, up));
  const over = cross(right, ahead);
  const height = Math.tan(fovY / 2);
  const corners = [
    [-1, -1],
    [1, -1],
    [1, 1],
    [-1, 1],
  ].map(([x, y]) => add(eye, add(add(ahead, right, x * height * aspect), over, y * height), distance));
  return corners.flatMap((corner, i) => [...eye, ...corner, ...corner, ...corners[(i + 1) % 4]]);
}

function frame(now) {
  const seconds = Math.min(0.1, (now - last) / 1000);
  last = now;
  const ratio = Math.min(2, devicePixelRatio);
  const size = [Math.round(canvas.clientWidth * ratio), Math.round(canvas.clientHeight * ratio)];
  if (canvas.width !== size[0] || canvas.height !== size[1]) [canvas.width, canvas.height] = size;

  const camera = (state.camera = moved(seconds));
  view.setPerspective(camera);
  const start = performance.now();
  pipeline.cull(scene, view, visible);
  times = [...times.slice(1 - AVERAGED), performance.now() - start];
  visible.sortByIndex(scene);
  const { indices } = visible;

  let matrix = perspective(camera);
  if (toggles.above) {
    // The cut is a little above the eye, so that one looks into rooms.
    const { eye } = state.frozen ?? camera;
    const above = {
      eye: add(camera.eye, [0, 0, 1 + eye[2] - camera.eye[2]]),
      target: [...camera.eye.slice(0, 2), -100],
    };
    const map = { ...above, up: [0, 1, 0], aspect: camera.aspect };
    mapHeight = Math.max(10, Math.min(1000, mapHeight * 0.9 ** flyer.takeWheel()));
    matrix = orthographic(map, mapHeight, 200);
  }
  renderer.begin(toggles.above ? GROUND : SKY);
  if (toggles.above) renderer.draw("faint", matrix, renderer.all);
  state.triangles = renderer.draw("shaded", matrix, indices);
  if (toggles.above || state.frozen) renderer.drawLines(matrix, edges(state.frozen ?? camera, 40));
  const judged = toggles.measure ? renderer.measure(perspective(state.frozen ?? camera), indices) : null;
  Object.assign(state, { visible: indices.length, key, ...judged, frames: state.frames + 1 });
  state.milliseconds = times.reduce((sum, time) => sum + time, 0) / times.length;
  element("numbers").textContent = report(judged);
  requestAnimationFrame(frame);
}

function report(judged) {
  const all = lists.triangleCounts.length;
  const lines = [
    `objects   ${state.visible} of ${all}`,
    `triangles ${state.triangles} of ${lists.triangles.length / 9}`,
    `culling   ${state.milliseconds.toFixed(3)} ms, ${visibility.simd128 ? "simd128" : "plain"}`,
    `promise   ${pipeline.accuracy}`,
  ];
  if (judged) {
    lines.push(`overdraw  ${judged.overdraw.toFixed(2)} surfaces a pixel`);
    lines.push(`wrong     ${judged.wrongPixels} of ${judged.pixels} pixels`);
  }
  return lines.join("\n");
}

function fail(error) {
  state.errors++;
  element("numbers").textContent = error?.message ?? String(error);
}
addEventListener("error", ({ error, message }) => fail(error ?? message));
addEventListener("unhandledrejection", ({ reason }) => fail(reason));

async function start() {
  const simd128 = query.has("simd128") ? query.get("simd128") !== "0" : undefined;
  const response = await fetch("scenes.wasm");
  if (!response.ok)
    throw new Error(`cannot fetch scenes.wasm: status ${response.status}. Run ./build first.`);
  [visibility, recipes] = await Promise.all([load({ simd128 }), loadRecipes(await response.arrayBuffer())]);
  renderer = new Renderer(canvas);
  flyer = new Flyer(canvas, (by) => {
    // From above, the wheel zooms.
    if (by === "wheel" && toggles.above) return;
    still = null;
    toggle("walk", false);
  });
  [view, visible] = [visibility.createView(), visibility.createVisible()];
  element("scene").replaceChildren(...Object.keys(SCENES).map((name) => new Option(name)));
  element("scene").onchange = ({ target }) => chooseScene(target.value);
  element("culler").onchange = ({ target }) => chooseCuller(target.value);
  for (const name of Object.keys(toggles)) element(name).onclick = () => toggle(name);
  addEventListener("keydown", ({ code, repeat, ctrlKey, metaKey, target }) => {
    if (repeat || ctrlKey || metaKey || target instanceof HTMLSelectElement) return;
    const name = { KeyP: "walk", KeyF: "freeze", KeyV: "above", KeyM: "measure" }[code];
    if (name) toggle(name);
    const names = [...element("culler").options].map((option) => option.value);
    if (code === "KeyC") chooseCuller(names[(names.indexOf(state.culler) + 1) % names.length]);
  });
  chooseScene(state.scene in SCENES ? state.scene : "city");
  for (const [name, on] of Object.entries(toggles)) toggle(name, on);
  requestAnimationFrame(frame);
}
start().catch(fail);
