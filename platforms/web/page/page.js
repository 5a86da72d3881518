// Flies through a model, draws what the cullers leave, and says what that saves and whether it is right.

import { load } from "../package/visibility.js";
import { BUILT_IN, builtIn } from "./builtin.js";
import { Flyer, add } from "./camera.js";
import { Culling, STAGES } from "./culling.js";
import { makeModel } from "./items.js";
import { Judge } from "./judge.js";
import { ModelError, findModel, loadModel, pause } from "./load.js";
import { DrawTime, Pace } from "./pace.js";
import { Panel } from "./panel.js";
import { Picture } from "./picture.js";
import { saveReport } from "./report.js";
import { loadRecipes } from "./scene.js";
import { AROUND, FOV_Y, walksOf } from "./walks.js";

/** Keys of a walk that pass in a second. */
const KEYS_PER_SECOND = 2;
/** Frames over which times are averaged. */
const AVERAGED = 30;
/** Milliseconds between two checks of the picture, at least. */
const CHECK_MS = 300;
/** Half of a side of the box that `region` looks from, as a part of the model's size. */
const BOX_PART = 1 / 300;

const query = new URLSearchParams(location.search);
const canvas = document.getElementById("canvas");
const state = {
  scene: query.get("scene") ?? "city",
  stages: (query.get("stages") ?? "frustum,zbuffer").split(","),
  pixels: 4,
  errors: 0,
  frames: 0,
  /** Whether a model is being loaded. */
  loading: true,
  /** Whether a report is being made: until it is, model, cullers and size stay. */
  reporting: false,
};
const toggles = {
  walk: !query.has("still"),
  freeze: false,
  above: false,
  ghosts: false,
  measure: true,
  region: false,
};
/** For tests and for the curious: what the page is doing. */
window.page = {
  state,
  toggles,
  goTo,
  chooseScene,
  chooseStages,
  toggle,
  openFiles,
  report,
  pickAt,
  turnUpright,
  lookFrom,
  judgeWithout,
};

const choose = (names) => {
  stagesAreChosen = true;
  chooseStages(names);
};
const panel = new Panel({ chooseScene, chooseStages: choose, toggle, openFiles, report, turnUpright });
let visibility, recipes, picture, judge, flyer, culling, walk;
/** Resolves once the library and the recipes of scenes are there. */
let started;
/** The number of the load that is going on: a later one ends the earlier. Its end is `loaded`. */
let loads = 0;
let loaded = null;
let key = 0;
/** The camera of the walk; null once a person flies. */
let still = null;
/** Metres from the lower to the upper edge of the view from above. */
let mapHeight = 80;
/** Camera and bits that the pipeline is kept at. */
let frozen = null;
/** What is seen from a box around the place of an eye, while `region` is on and once it is found. */
let region = null;
/** Near plane distance in metres. */
let near = 0.1;
/** Whether a person has chosen cullers. */
let stagesAreChosen = false;
let times = [];
let quality = 1;
const pace = new Pace(performance.now());
let drawTime = new DrawTime();
/** Whether a person has asked for checks, and whether they ended because pictures take long. */
let isCheckAsked = false;
let isCheckSlow = false;
let checked = { signature: "", at: 0, cost: 0, result: null };
let drawnSignature = "";

/** Shows a model: `make` returns `model`, `culling`, `walk` and `near`, and `facts` if it is one of files. */
function show(name, make) {
  return (loaded = tryToShow(name, make));
}

async function tryToShow(name, make) {
  if (state.reporting) {
    panel.sceneIs(state.scene, Boolean(state.facts.files));
    return;
  }
  const mine = ++loads;
  const isCurrent = () => mine === loads;
  const start = performance.now();
  state.loading = true;
  drawTime = new DrawTime();
  const progress = (text) => isCurrent() && panel.say(text);
  let made;
  try {
    await started;
    made = await make(progress);
  } catch (error) {
    if (!isCurrent()) return;
    state.loading = false;
    fail(error);
    return;
  }
  if (!isCurrent()) {
    made.culling.destroy();
    made.model.dispose();
    return;
  }
  culling?.destroy();
  culling = made.culling;
  walk = made.walk;
  near = made.near;
  frozen = null;
  picture.setModel(made.model);
  if (isCheckSlow) toggle("measure", true);
  isCheckAsked = false;
  Object.assign(state, { scene: name, objects: made.model.count, facts: made.facts ?? {} });
  state.allTriangles = made.model.triangles.reduce((sum, count) => sum + count, 0);
  mapHeight = picture.size / 2;
  flyer.speed = made.speed ?? Math.max(picture.size / 25, 1e-3);
  for (const box of ["freeze", "above", "ghosts", "region"]) toggle(box, false);
  toggle("walk", !query.has("still"));
  // Occluders of a file are made in a worker: there may be many.
  const inWorker = made.facts && !query.has("stages") && !stagesAreChosen;
  chooseStages(inWorker ? state.stages.map((name) => (name === "zbuffer" ? "late" : name)) : state.stages);
  // A person who opens a file sees it from outside first.
  goTo(made.facts ? walk.length - AROUND : 0);
  state.loadMs = performance.now() - start;
  pace.restart(performance.now());
  state.loading = false;
  panel.say("");
  panel.sceneIs(name, Boolean(state.facts.files));
  await makeOccluders(culling, progress);
}

/** Makes the occluders that the chosen cullers of a model lack. */
async function makeOccluders(of, progress) {
  await of.makeOccluders(progress);
  if (of !== culling) return;
  drawnSignature = "";
  checked.signature = "";
  panel.say("");
}

function chooseScene(name) {
  return show(name, async () => {
    const lists = recipes(...BUILT_IN[name].recipe);
    const made = builtIn(name, lists);
    return { ...made, culling: Culling.ofLists(visibility, lists), speed: 6 };
  });
}

/** Opens files. With `zUp` their z axis points up, against the rule of glTF. */
function openFiles(files, zUp = false) {
  if (files.length === 0) return;
  return show((findModel(files) ?? files[0]).name, async (progress) => {
    const { root, bytes, cameras } = await loadModel(files, picture.renderer, progress);
    if (zUp) root.rotation.x -= Math.PI / 2;
    const model = await makeModel(root, progress);
    await picture.takeTextures(model, progress);
    progress("Building the hierarchy");
    await pause();
    const box = model.box;
    const size = Math.hypot(box[3] - box[0], box[4] - box[1], box[5] - box[2]);
    const tour = walksOf(model.bounds, box);
    const own = cameras.filter(({ isPerspectiveCamera }) => isPerspectiveCamera).map(cameraOf);
    return {
      model,
      culling: Culling.ofModel(visibility, model),
      walk: [...own, ...tour],
      near: Math.max(1e-4 * size, 1e-5),
      facts: { bytes, files, zUp },
    };
  });
}

/** The camera of a file as the page has its own. */
function cameraOf(camera) {
  camera.updateWorldMatrix(true, false);
  const e = camera.matrixWorld.elements;
  const eye = [e[12], e[13], e[14]];
  return { eye, target: add(eye, [-e[8], -e[9], -e[10]]), up: [e[4], e[5], e[6]], fovY: FOV_Y };
}

/** Opens the files of the present model again, with the other axis upwards. */
function turnUpright() {
  const { files, zUp } = state.facts ?? {};
  if (files) openFiles(files, !zUp);
}

function chooseStages(names) {
  if (!culling || state.reporting) return;
  state.stages = names;
  culling.choose(names, {
    height: canvas.height || 720,
    pixels: state.pixels,
    size: picture.size,
    near,
  });
  toggle("freeze", false);
  checked = { ...checked, signature: "", result: null };
  drawnSignature = "";
  times = [];
  panel.stagesAre(culling.offered, culling.chosen);
  const of = culling;
  // The model that is being shown gets its occluders once it is there.
  if (!state.loading) makeOccluders(of, (text) => of === culling && panel.say(text)).catch(fail);
}

/** Moves the camera to a key of the walk; fractions are between keys. */
function goTo(position) {
  key = position % walk.length;
  const [from, to, part] = [walk[Math.floor(key)], walk[Math.floor(key) + 1], key % 1];
  // From one walk to the next the camera jumps.
  const isNear = to && Math.hypot(...add(to.eye, from.eye, -1)) < Math.max(5, picture.size / 5);
  const between = (a, b) => (part === 0 || !isNear ? a : add(a, add(b, a, -1), part));
  still = { ...from, eye: between(from.eye, to?.eye), target: between(from.target, to?.target) };
  flyer.follow(still);
}

function toggle(name, on = !toggles[name]) {
  toggles[name] = on;
  if (name === "freeze") frozen = on && state.camera ? { camera: state.camera, bits: culling.bits } : null;
  if (name === "measure") {
    // Who asks for a check gets it at once.
    Object.assign(checked, { signature: "", at: -Infinity });
    [isCheckAsked, isCheckSlow] = [on, false];
  }
  if (name === "walk" && on && !still && walk) goTo(key);
  if (name === "region") lookFromBox(on);
  drawnSignature = "";
  // A look from a box may have been refused at once.
  panel.toggled(name, toggles[name]);
}

/** Finds what is seen from a box around the eye, and shows it from above; or shows it no more. */
async function lookFromBox(on) {
  region = state.region = null;
  const of = culling;
  if (!on || !of || !state.camera || state.loading) {
    toggles.region = false;
    return;
  }
  const isAsked = () => toggles.region && of === culling;
  try {
    if (!of.canLookFromBox) throw new ModelError("the model has too many triangles for proofs");
    toggle("above", true);
    const half = Math.max(picture.size * BOX_PART, 2 * near);
    const found = await of.lookFromBox(state.camera.eye, half, (text) => isAsked() && panel.say(text));
    if (!isAsked() || !found) return;
    region = found;
    state.region = found.counts;
    panel.say("");
    drawnSignature = "";
  } catch (error) {
    if (!isAsked()) return;
    toggle("region", false);
    fail(error);
  }
}

/** Returns the camera of this frame, after `seconds`. */
function moved(seconds) {
  const before = flyer.eye;
  if (toggles.walk) goTo(key + seconds * KEYS_PER_SECOND);
  if (!still) flyer.move(seconds, toggles.above ? 0 : flyer.takeWheel());
  else if (seconds > 0) flyer.velocity = add(flyer.eye, before, -1).map((x) => x / seconds);
  const { fovY } = walk[Math.floor(key)];
  return { ...(still ?? flyer.camera), fovY, near, aspect: canvas.width / canvas.height };
}

function resize() {
  if (state.reporting) return;
  const ratio = Math.min(2, devicePixelRatio) * quality;
  const size = [canvas.clientWidth, canvas.clientHeight].map((side) => Math.max(1, Math.round(side * ratio)));
  if (canvas.width === size[0] && canvas.height === size[1]) return;
  picture.resize(...size);
  drawnSignature = "";
  if (culling.chosen.includes("size")) chooseStages(state.stages);
}

/** Makes the picture coarser where frames take long, and drops ambient shade in the end. */
function keepPace(interval) {
  // Loads and reports leave little time to the frames among them.
  if (query.has("full") || state.loading || state.reporting || !pace.isSlow(interval)) return;
  if (quality > 0.6) quality *= 0.8;
  else picture.shade.isOn = false;
}

function frame(now) {
  requestAnimationFrame(frame);
  const interval = pace.begin(now);
  const seconds = Math.min(0.1, interval / 1000);
  if (!picture?.model) return;
  resize();
  const camera = (state.camera = moved(seconds));
  if (!frozen) {
    culling.cull(camera, flyer.velocity);
    times = [...times.slice(1 - AVERAGED), culling.milliseconds];
  }
  const culled = frozen?.camera ?? camera;
  if (toggles.above)
    mapHeight = Math.max(
      picture.size / 100,
      Math.min(4 * picture.size, mapHeight * 0.9 ** flyer.takeWheel()),
    );
  // Loads leave little time to what is drawn among them.
  if (!state.loading && drawTime.look(picture.renderer.getContext(), now)) drawnSignature = "";
  const signature = JSON.stringify([
    camera,
    frozen !== null,
    toggles,
    culling.count,
    culling.answersUsed,
    toggles.above && culling.workers?.boxes,
    mapHeight,
    quality,
  ]);
  if (signature !== drawnSignature) {
    keepPace(interval);
    drawnSignature = signature;
    const bits = frozen?.bits ?? culling.bits;
    const boxes = toggles.above ? [...culling.bakedBoxes, ...(region ? [region] : [])] : [];
    const options = { culled, above: toggles.above ? mapHeight : 0, ghosts: toggles.ghosts, boxes, region };
    Object.assign(state, picture.draw(camera, bits, options));
    if (!state.loading) drawTime.follow(picture.renderer.getContext(), now);
    state.seen = bits.seen;
    state.visible = culling.count;
    state.firstPictureMs ??= performance.now();
    if (toggles.measure) check(now, culled, bits.seen);
  } else if (toggles.measure) {
    check(now, culled, state.seen);
  }
  state.answer = culling.online?.answer;
  state.workers = culling.workers;
  if (!toggles.measure) checked.result = null;
  state.check = checked.result;
  Object.assign(state, { key, frames: state.frames + 1 });
  state.milliseconds = times.reduce((sum, time) => sum + time, 0) / (times.length || 1);
  panel.show(state, culling, picture.model, visibility);
}

/**
 * Compares pictures, at most as often as leaves most of the time to other things. Where pictures take long, a check,
 * which waits for four of them, would stop the page: then only if a person asks for it.
 */
function check(now, camera, seen) {
  if (!isCheckAsked && drawTime.isSlow) {
    toggle("measure", false);
    isCheckSlow = true;
    const seconds = (drawTime.milliseconds / 1000).toFixed(1);
    panel.say(`A picture takes ${seconds} s here: Check compares four all the same`, true);
  }
  if (!isCheckAsked && (drawTime.isSlow || drawTime.milliseconds === null)) return;
  const signature = JSON.stringify([camera, culling.answersUsed, culling.count, culling.chosen, state.scene]);
  if (signature === checked.signature || now - checked.at < Math.max(CHECK_MS, 8 * checked.cost)) return;
  const start = performance.now();
  const result = judge.compare(picture, camera, seen);
  checked = { signature, at: now, cost: performance.now() - start, result };
}

/** Says why the object at a place of the picture, from 0 to 1 from left and top, is drawn or not. */
function pickAt(place) {
  if (!picture.model) return;
  const eye = toggles.above ? picture.map : picture.camera;
  const seen = toggles.above || toggles.ghosts ? null : state.seen;
  const item = judge.pick(picture, eye, place, seen);
  drawnSignature = "";
  if (item < 0) return panel.pickedIs(null);
  const why = culling.explain(item, frozen?.camera ?? state.camera);
  state.picked = { item, name: picture.model.names[item], why };
  panel.pickedIs({ ...state.picked, triangles: picture.model.triangles[item] });
}

/** Looks from a point at another, until a person flies on. */
function lookFrom(eye, target) {
  still = { ...walk[0], eye, target, up: [0, 1, 0] };
  flyer.follow(still);
  toggle("walk", false);
}

/** What the judge says if an item of the last frame is left out: for tests that it sees mistakes. */
function judgeWithout(item) {
  const bits = state.seen.slice();
  bits[item >>> 5] &= ~(1 << (item & 31));
  drawnSignature = "";
  return judge.compare(picture, state.camera, bits);
}

/** Makes the report of a walk and saves it as a file. Null while there is no model, or another report. */
async function report() {
  if (!picture?.model || state.loading || state.reporting) return null;
  const walked = toggles.walk;
  toggle("walk", false);
  state.reporting = true;
  try {
    return await saveReport({
      visibility,
      culling,
      picture,
      judge,
      canvas,
      walk,
      near,
      state,
      say: panel.say,
    });
  } finally {
    state.reporting = false;
    pace.restart(performance.now());
    chooseStages(state.stages);
    toggle("walk", walked);
    panel.say("");
  }
}

function fail(error) {
  // A file that is no model is the person's affair; all else is the page's.
  if (!(error instanceof ModelError)) state.errors++;
  state.message = error?.message ?? String(error);
  panel.say(state.message, true);
}
addEventListener("error", ({ error, message }) => fail(error ?? message));
addEventListener("unhandledrejection", ({ reason }) => fail(reason));
canvas.addEventListener("webglcontextlost", () =>
  fail("the graphics card has lost the picture: load the page anew"),
);

// While the page is not shown, no frames are drawn.
document.addEventListener("visibilitychange", () => pace.restart(performance.now()));

addEventListener("keydown", ({ code, target, ctrlKey, metaKey, altKey }) => {
  if (ctrlKey || metaKey || altKey || target.closest?.("select, input, dialog")) return;
  const names = { KeyP: "walk", KeyV: "above", KeyX: "ghosts", KeyF: "freeze", KeyM: "measure", KeyB: "region" };
  if (names[code]) toggle(names[code]);
  if (code === "KeyZ") turnUpright();
  if (code === "KeyC" && culling) {
    // Frustum alone, then with each of the others.
    const sets = ["", ...culling.offered.filter((name) => name !== "frustum")];
    const at = sets.findIndex((name) => state.stages.filter((other) => other !== "frustum").join() === name);
    const next = sets[(at + 1) % sets.length];
    chooseStages(["frustum", next].filter(Boolean));
  }
});

async function start() {
  const simd128 = query.has("simd128") ? query.get("simd128") !== "0" : undefined;
  picture = new Picture(canvas);
  judge = new Judge(picture.renderer);
  const taken = (how) => {
    // From above the wheel zooms, and the walk goes on.
    if (how === "wheel" && toggles.above) return;
    still = null;
    if (toggles.walk) toggle("walk", false);
  };
  flyer = new Flyer(canvas, taken, pickAt);
  panel.offer(Object.entries(BUILT_IN), STAGES);
  const bytes = fetch("scenes.wasm").then((response) => response.arrayBuffer());
  started = Promise.all([load({ simd128 }), bytes.then(loadRecipes)]);
  [visibility, recipes] = await started;
  // A person may have chosen a model meanwhile.
  await loaded;
  if (!culling) await chooseScene(state.scene in BUILT_IN ? state.scene : "city");
}
requestAnimationFrame(frame);
start().catch(fail);
