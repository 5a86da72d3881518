// A walk through 50,000 objects, drawn by three.js with its own culling and with `visibility-three`, side by
// side: in turns, so that both have the same camera, and in two pictures whose pixels are compared. Frames a second are
// measured of one side alone.

import * as THREE from "three";
import { VisibilityCulling } from "visibility-three";
import { fillTown, pathThrough } from "./town.js";

/** Frames over which times are averaged, and between two comparisons of pictures. */
const AVERAGED = 20;
const COMPARED_EVERY = 20;
const PICTURE = { width: 640, height: 360 };
/** Size at which a pixel that differs is looked at again, and number of its pixels that differ if it is wrong. */
const LENS = { width: 64, height: 64, least: 32 };
/** With more pixels that differ than that, all are wrong: that is no matter of rounding. */
const MOST_LOOKED_AT = 50;
/** Seconds of the walk, which is 21 m a second fast, that pass in a second: while it is measured, at a person's pace. */
const [PACE, MEASURED_PACE] = [1, 1.5 / 21];
/** Frames that a measurement waits for the worker's first answer. */
const MOST_AWAITED = 8;
/** Distance and angle from its camera up to which an answer of the worker is used. */
const WORKER = { metres: 1, degrees: 12 };

const element = (id) => document.getElementById(id);
const query = new URLSearchParams(location.search);
/** `?count=5000` is for computers without a graphics card. */
const COUNT = Number(query.get("count") ?? 50_000);
const fail = (error) => {
  state.errors++;
  element("error").textContent = error?.message ?? String(error);
};
/** For tests: what the page shows. `wrong` is the number of pixels that differ, in all comparisons so far. */
const state = { errors: 0, frames: 0, compared: 0, wrong: 0, three: {}, visibility: {} };
window.example = {
  state,
  goTo: (at) => ((time = at), (element("walk").checked = false)),
  choose,
  measure,
  compare,
  compareWithout,
};
addEventListener("error", ({ error }) => fail(error));
addEventListener("unhandledrejection", ({ reason }) => fail(reason));

const renderer = new THREE.WebGLRenderer({ canvas: element("canvas"), antialias: true });
renderer.shadowMap.enabled = true;
const camera = new THREE.PerspectiveCamera(65, 1, 0.2, 2000);
const map = new THREE.PerspectiveCamera(50, 1, 10, 4000);
/** Looks at one pixel of the camera. */
const lens = new THREE.PerspectiveCamera();
const targetOf = ({ width, height }) => new THREE.WebGLRenderTarget(width, height, { samples: 4 });
const target = targetOf(PICTURE);
const lensTarget = targetOf(LENS);

let scene,
  culling,
  time = 4,
  last = performance.now();

/** Chooses how the objects are made, and whether the z-buffer is drawn in a worker. */
function choose(kind, inWorker) {
  element("kind").value = kind;
  element("culling").value = inWorker ? "worker" : "on";
  return build(kind, inWorker);
}

async function build(kind, inWorker = element("culling").value === "worker") {
  culling?.dispose();
  culling = null;
  scene = new THREE.Scene();
  scene.background = new THREE.Color(0x9db8cc);
  scene.fog = new THREE.Fog(0x9db8cc, 100, 900);
  const sun = new THREE.DirectionalLight(0xfff2dd, 2.5);
  sun.position.set(60, 120, 40);
  sun.castShadow = true;
  Object.assign(sun.shadow.camera, { left: -60, right: 60, top: 60, bottom: -60, far: 300 });
  sun.shadow.mapSize.set(1024, 1024);
  scene.add(sun, sun.target, new THREE.HemisphereLight(0xdfeaf5, 0x8a7d6e, 2.4));
  fillTown(scene, COUNT, kind);
  // This line is all that a program needs.
  const made = new VisibilityCulling(scene, camera, inWorker ? { worker: WORKER } : {});
  // The map and the lens show what that camera sees.
  for (const shown of [map, lens]) made.addCamera(shown, camera);
  await made.ready;
  for (const side of ["three", "visibility"]) state[side] = { times: [], cullingTimes: [], fps: null };
  Object.assign(state, { frames: 0, compared: 0, wrong: 0, kind, inWorker });
  culling = made;
}

/** Adds a time to a list, and returns the average of the last ones. */
function average(times, time) {
  times.push(time);
  if (times.length > AVERAGED) times.shift();
  return times.reduce((a, b) => a + b) / times.length;
}

/** Draws the scene for a side of the comparison, and counts. */
function draw(side) {
  culling.enabled = side === "visibility";
  const start = performance.now();
  renderer.render(scene, camera);
  const counts = state[side];
  const { followMs, cullMs, applyMs } = culling.stats;
  counts.ms = average(counts.times, performance.now() - start);
  if (culling.enabled) counts.cullingMs = average(counts.cullingTimes, followMs + cullMs + applyMs);
  counts.calls = renderer.info.render.calls;
  counts.triangles = renderer.info.render.triangles;
}

/** What is measured at present: one side alone, with the times of its frames. */
let measured = null;

/** Walks on and draws one side alone for so many seconds: `fps`, with each picture waited for, and CPU ms. */
function measure(side, seconds) {
  return new Promise((resolve) => (measured = { side, seconds, resolve, begun: null, times: [], late: 0 }));
}

function drawMeasured() {
  const { side, seconds, times } = measured;
  culling.enabled = side === "visibility";
  const start = performance.now();
  renderer.render(scene, camera);
  times.push(performance.now() - start);
  // Reading a pixel waits for the picture.
  const gl = renderer.getContext();
  gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));
  // Shaders and buffers come with the first frame, the worker's first answer some frames later.
  const isWaiting = culling.enabled && culling.stats.late?.isUsed === false && times.length < MOST_AWAITED;
  if (measured.begun === null && isWaiting) return;
  if (measured.begun === null) {
    [measured.begun, measured.times] = [performance.now(), []];
    return;
  }
  if (culling.stats.late && !culling.stats.late.isUsed) measured.late++;
  const elapsed = (performance.now() - measured.begun) / 1000;
  if (elapsed < seconds) return;
  const { calls, triangles } = renderer.info.render;
  const { hidden, followMs, cullMs, applyMs, late: { reason = "" } = {} } = culling.stats;
  const ms = times.slice().sort((a, b) => a - b)[times.length >> 1];
  const fps = times.length / elapsed;
  state[side].fps = fps;
  const { late, resolve } = measured;
  measured = null;
  const cullingMs = followMs + cullMs + applyMs;
  resolve({ fps, ms, calls, triangles, hidden, frames: times.length, late, reason, cullingMs });
}

/** Number of pixels that differ if an object is left out by mistake as well: for tests that mistakes are seen. */
function compareWithout(name) {
  const before = { wrong: state.wrong, compared: state.compared };
  const object = scene.getObjectByName(name);
  compare((isCulled) => (object.visible = !isCulled));
  object.visible = true;
  const found = state.wrong - before.wrong;
  Object.assign(state, before);
  return found;
}

/** Places of pixels that differ between the picture with everything and that without what is hidden. */
function differences(camera, target, spoil) {
  const { width, height } = target;
  const [all, left] = [false, true].map((isCulled) => {
    culling.enabled = isCulled;
    spoil(isCulled);
    renderer.setRenderTarget(target);
    renderer.render(scene, camera);
    const bytes = new Uint8Array(4 * width * height);
    renderer.readRenderTargetPixels(target, 0, 0, width, height, bytes);
    return new Uint32Array(bytes.buffer);
  });
  renderer.setRenderTarget(null);
  state.colors = new Set(all).size;
  return [...all.keys()].filter((i) => all[i] !== left[i]);
}

/**
 * Counts pixels in which something is missing. They may differ for another reason: cards round the depth of a triangle
 * that is seen edge on so much that a dot of it shines through a wall. That is gone if the pixel is magnified.
 */
function compare(spoil = () => {}) {
  const { width, height } = PICTURE;
  const pixels = differences(camera, target, spoil);
  const { colors } = state;
  const isMissing = (pixel) => {
    lens.copy(camera);
    lens.setViewOffset(width, height, pixel % width, height - 1 - Math.floor(pixel / width), 1, 1);
    return differences(lens, lensTarget, spoil).length >= LENS.least;
  };
  state.wrong += pixels.length > MOST_LOOKED_AT ? pixels.length : pixels.filter(isMissing).length;
  state.compared++;
  state.colors = colors;
}

/** Draws from above what the camera's picture is made of. */
function drawMap() {
  culling.enabled = true;
  map.position.set(camera.position.x, 260, camera.position.z + 60);
  map.lookAt(camera.position.x, 0, camera.position.z);
  renderer.render(scene, map);
}

const number = (count) => count.toLocaleString("en");

function show() {
  const rows = [
    ["frames a second", ({ fps }) => (fps ? fps.toFixed(1) : "–")],
    ["CPU ms a frame", ({ ms }) => ms.toFixed(1)],
    ["draw calls", ({ calls }) => number(calls)],
    ["triangles", ({ triangles }) => number(triangles)],
  ];
  const lines = rows.map(
    ([name, value]) => `<tr><th>${name}</th><td>${value(state.three)}</td><td>${value(state.visibility)}</td></tr>`,
  );
  const { stats } = culling;
  lines.push(`<tr><th>hidden of ${number(stats.objects)}</th><td></td><td>${number(stats.hidden)}</td></tr>`);
  lines.push(`<tr><th>culling itself, ms</th><td></td><td>${state.visibility.cullingMs.toFixed(1)}</td></tr>`);
  if (stats.late) {
    const { isUsed, reason, ageMs } = stats.late;
    lines.push(
      `<tr><th>answer of the worker</th><td></td><td>${isUsed ? `${ageMs.toFixed(0)} ms old` : reason}</td></tr>`,
    );
  }
  lines.push(`<tr><th>wrong pixels in ${state.compared} pictures</th><td></td><td>${state.wrong}</td></tr>`);
  element("table").innerHTML = lines.join("");
}

function frame(now) {
  requestAnimationFrame(frame);
  // `?paused` draws what is measured alone.
  if (!culling || (query.has("paused") && !measured)) return;
  if (element("walk").checked) time += ((measured ? MEASURED_PACE : PACE) * Math.min(now - last, 100)) / 1000;
  last = now;
  const { clientWidth, clientHeight } = renderer.domElement;
  if (renderer.domElement.width !== clientWidth || renderer.domElement.height !== clientHeight)
    renderer.setSize(clientWidth, clientHeight, false);
  camera.aspect = map.aspect = clientWidth / clientHeight;
  camera.updateProjectionMatrix();
  map.updateProjectionMatrix();
  pathThrough(time, camera);
  const sun = scene.children.find((child) => child.isDirectionalLight);
  sun.target.position.copy(camera.position);
  sun.position.copy(camera.position).add(new THREE.Vector3(60, 120, 40));
  if (measured) return drawMeasured();
  // The side that is looked at is drawn last. The other is drawn now and then, for its counters.
  const chosen = element("culling").value === "off" ? "three" : "visibility";
  if (state.frames % COMPARED_EVERY === 0) compare();
  if (state.frames % 2 === 0) draw(chosen === "three" ? "visibility" : "three");
  draw(chosen);
  if (element("above").checked) drawMap();
  state.frames++;
  show();
}

element("count").textContent = number(COUNT);
element("kind").value = query.get("kind") ?? "meshes";
element("culling").value = query.has("worker") ? "worker" : "on";
const rebuild = () => build(element("kind").value).catch(fail);
element("kind").onchange = rebuild;
element("culling").onchange = () => {
  if (state.inWorker !== (element("culling").value === "worker")) rebuild();
};
element("measure").onclick = async () => {
  element("measure").disabled = true;
  for (const side of ["three", "visibility"]) await measure(side, 4);
  element("measure").disabled = false;
};
await build(element("kind").value);
requestAnimationFrame(frame);
