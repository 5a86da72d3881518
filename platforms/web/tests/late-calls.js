// Tests that a scene and its workers stay alike: that calls leave an object with the same box on both sides, and that
// it hides others no more by what it has lost.
// Usage: node --test tests/late-calls.js, after `build`.

import assert from "node:assert/strict";
import test from "node:test";
import { LateAnswers, LateScene } from "../package/late.js";
import { Flag, NO_OBJECT, indexOf, load } from "../package/visibility.js";
import { serve, serveLoaded } from "../package/late-worker.js";
import { Workers } from "../page/workers.js";
import { REFUSED_MESH, box, elsewhere, has, moveBy, street, visibility, watched, wire } from "./late-street.js";

const cube = (low, high) => box([low, -1, -1], [high, 1, 1]);
// The box of an object, here and in the worker.

/** In each, the lamp behind the wall comes out from behind it, by calls that end with a mesh. */
for (const [what, calls] of [
  ["by a mesh without a transform", ({ scene, lamp }) => {
    scene.setLocalBounds(lamp, cube(9, 10));
    scene.setTransforms([lamp], moveBy(-6));
    scene.setMesh(lamp, scene.addBoxMesh(cube(9, 10)));
    // From before the wall to behind it.
    return [9, 10];
  }],
  ["by a mesh that is refused", ({ scene, lamp }) => {
    scene.setLocalBounds(lamp, cube(9, 10));
    scene.setMesh(lamp, scene.addMesh(REFUSED_MESH), moveBy(-6));
    return [3, 4];
  }],
  ["by a mesh that was removed", ({ scene, lamp }) => {
    const mesh = scene.addBoxMesh(cube(9, 10));
    scene.removeMesh(mesh);
    scene.setLocalBounds(lamp, cube(9, 10));
    scene.setMesh(lamp, mesh, moveBy(-6));
    return [3, 4];
  }],
  ["by a mesh given before its local bounds", ({ scene, lamp }) => {
    scene.setBounds(lamp, cube(3, 4));
    scene.setMesh(lamp, scene.addBoxMesh(cube(0, 1)), moveBy(3));
    scene.setLocalBounds(lamp, cube(0, 1));
    return [3, 4];
  }],
  ["by a mesh, after bounds that are those it had", ({ scene, lamp }) => {
    scene.setLocalBounds(lamp, cube(9, 10));
    scene.setAllBounds([lamp], [9, -1, -1, 10, 1, 1]);
    scene.setMesh(lamp, scene.addBoxMesh(cube(9, 10)), moveBy(-6));
    return [3, 4];
  }],
  ["not by a mesh, after other bounds", ({ scene, lamp }) => {
    scene.setLocalBounds(lamp, cube(9, 10));
    scene.setAllBounds([lamp, lamp], [3, -1, -1, 4, 1, 1, 9, -1, -1, 10, 1, 1]);
    scene.setMesh(lamp, scene.addBoxMesh(cube(9, 10)), moveBy(-6));
    return [9, 10];
  }],
  // The mesh reaches out of the box by rounding, which enlarges the box in the worker alone.
  ["by a mesh, after the bounds it had here", ({ scene, lamp }) => {
    scene.setLocalBounds(lamp, cube(9, 10));
    scene.setMesh(lamp, scene.addBoxMesh(cube(9, 10.000001)));
    scene.setBounds(lamp, scene.bounds(lamp));
    scene.setMesh(lamp, scene.addBoxMesh(cube(9, 10)), moveBy(-6));
    return [3, 4];
  }],
  ["not by a mesh, after the bounds it had there", ({ scene, lamp, boxOf, settle, isShown }) => {
    scene.setLocalBounds(lamp, cube(9, 10));
    scene.setTriangles(lamp, [9, 0, 0, 10.000001, 0, 0, 9, 1, 0]);
    isShown(lamp);
    settle();
    assert.notDeepEqual(boxOf(indexOf(lamp)), scene.bounds(lamp), "the worker's box is larger");
    scene.setBounds(lamp, boxOf(indexOf(lamp)));
    scene.setMesh(lamp, scene.addBoxMesh(cube(9, 10)), moveBy(-6));
    return [9, 10];
  }],
]) {
  test(`an object is moved ${what}, here and in the worker`, () => {
    const { library, boxOf } = watched();
    const made = { ...street({}, library), boxOf };
    const { scene, lamp, isShown, settle } = made;
    const [low, high] = calls(made);
    isShown(lamp);
    settle();
    for (const [where, own] of [["here", scene.bounds(lamp)], ["in the worker", boxOf(indexOf(lamp))]]) {
      const off = Math.max(Math.abs(own.min[0] - low), Math.abs(own.max[0] - high));
      assert.ok(off < 2e-5, `${where}: from ${own.min[0]} to ${own.max[0]}, not from ${low} to ${high}`);
    }
    assert.equal(isShown(lamp), low < 5, "it is shown before the wall, and hidden behind it");
  });
}

test("a worker that has moved an object elsewhere gives no answers", () => {
  const { library, boxOf } = watched();
  const { scene, lamp, isShown, settle } = street({}, library);
  const lampBox = () => boxOf(indexOf(lamp));
  // Its mesh reaches out of the lamp by rounding.
  scene.setBounds(lamp, cube(3, 4));
  scene.setMesh(lamp, scene.addBoxMesh(cube(0, 1.0000005)), moveBy(3));
  isShown(lamp);
  settle();
  assert.notDeepEqual(lampBox(), scene.bounds(lamp), "the worker's box is larger");
  // The same box as in the worker, where it changes nothing: the mesh stays, and what moves it.
  scene.setBounds(lamp, lampBox());
  scene.setLocalBounds(lamp, cube(0, 1));
  assert.deepEqual([scene.bounds(lamp).min[0], lampBox().min[0]], [0, 3], "the boxes, before that call is there");
  isShown(lamp);
  settle();
  assert.ok(isShown(lamp));
  assert.match(scene.refusals.join(), /setLocalBounds/, "the worker says so");
});

test("calls for an object that was removed are refused, and do nothing to another with its index", () => {
  const { scene, lamp, isShown, settle } = street();
  const former = scene.insert({ bounds: cube(6.5, 7) });
  const mesh = scene.addBoxMesh(box([7, -3, -3], [8, 3, 3]));
  scene.remove(former);
  // A pane of glass has the index of the removed object.
  const pane = scene.insert({ bounds: box([3, -3, -3], [8, 3, 3]), flags: Flag.Occluder });
  assert.equal(indexOf(pane), indexOf(former));
  for (const call of [
    () => scene.setMesh(former, mesh),
    () => scene.setTriangles(former, [7, -3, -3, 7, 3, -3, 7, 0, 3]),
    () => scene.setMesh(NO_OBJECT, mesh),
    () => scene.setLocalBounds(former, cube(0, 1)),
  ])
    assert.throws(call, { code: "UNKNOWN_ID" });
  assert.throws(() => scene.setMesh(pane, mesh, moveBy(NaN)), { code: "ARGUMENT" });
  assert.equal(isShown(lamp), true);
  settle();
  assert.deepEqual([isShown(lamp), scene.refusals.length], [false, 0]);
});

test("a scene that is moved as a whole hides nothing by earlier answers, and hides where it is by later ones", () => {
  const { scene, lamp, isShown, settle, look } = street();
  isShown(lamp);
  settle();
  assert.ok(!isShown(lamp), "behind the wall");
  // The wall is behind the eye, the lamp before it.
  scene.setOrigin([-6.5, 0, 0]);
  assert.ok(isShown(lamp), "at once");
  settle();
  isShown(lamp);
  settle();
  assert.ok(isShown(lamp), "by an answer of the scene as it is");
  const there = look([-6.5, 0, 0]);
  isShown(lamp, there);
  settle();
  isShown(lamp, there);
  settle();
  assert.ok(!isShown(lamp, there), "from where the wall is before it");
});

// What an object hides.

const WALL = box([5, -20, -20], [6, 20, 20]);
/** The triangles of the wall's face. */
const FACE = [5, -20, -20, 5, -20, 20, 5, 20, 20, 5, -20, -20, 5, 20, 20, 5, 20, -20];

/** Triangles within the wall that cover little of it. */
const CORNER = [5, 19, 19, 5, 20, 19, 5, 19, 20];

/** Gives the wall of a street a mesh that is made from its triangles, in the place of the mesh that it has. */
function prepare({ scene, wall }) {
  scene.setBounds(wall, box([5, -20, -20], [6.5, 20, 20]));
  scene.setTriangles(wall, FACE);
  scene.prepareOccluders();
}

for (const [what, change, isPrepared] of [
  ["is never culled", ({ scene, wall }) => scene.setFlags(wall, Flag.Occluder | Flag.NeverCull), false],
  ["is drawn from its front alone", ({ scene, wall }) => scene.setFlags(wall, Flag.Occluder | Flag.OneSided), true],
  ["has other triangles", ({ scene, wall }) => scene.setTriangles(wall, CORNER), true],
  ["has triangles that are refused", ({ scene, wall }) => scene.setTriangles(wall, [0, 0, 0, 1, 0, 0, 0, 1, 0]), true],
]) {
  test(`a wall that from now on ${what} hides nothing, also not by the last answer`, () => {
    const made = street();
    const { lamp, isShown, settle } = made;
    if (isPrepared) prepare(made);
    isShown(lamp);
    settle();
    assert.ok(!isShown(lamp), "the wall hides the lamp");
    change(made);
    assert.ok(isShown(lamp), "at once");
    settle();
    isShown(lamp);
    settle();
    assert.ok(isShown(lamp), "by the answer of the scene as it is");
  });
}

test("a worker that cannot tell what a region sees says so", async () => {
  const answers = [];
  const region = { what: "region", min: [-1, -1, -1], max: [1, 1, 1] };
  for (const library of [elsewhere, await load({ frames: true })]) {
    const { scene, settle } = street(undefined, library);
    scene.ask(region, (answer) => answers.push(answer));
    settle();
    if (library !== elsewhere) assert.match(scene.refusals.join(), /frames/, "the refusal is told");
  }
  assert.deepEqual([...answers[0].bits, answers[0].hidden.length], [1, 1], "the lamp is behind the wall");
  assert.equal(answers[1], null, "the small module");
});

test("bounds of many go in one message, also beside one with local bounds, and from any list", () => {
  const { near, far, deliver } = wire();
  serve(far, elsewhere);
  const calls = [];
  const { postMessage } = near;
  near.postMessage = (data, moved) => (calls.push(...data.calls), postMessage(data, moved));
  const scene = new LateScene(visibility.createScene(), [near]);
  const count = 100;
  const unit = (i) => [i, 0, 0, i + 1, 1, 1];
  const listed = (by = 0) => Array.from({ length: count }, (_, i) => unit(i + by)).flat();
  const ids = scene.insertAll({ bounds: listed() });
  for (const i of [0, 1]) scene.setLocalBounds(ids[i], box([0, 0, 0], [1, 1, 1]));
  scene.flush();
  calls.length = 0;
  // The first object stays in the bounds that it has, and keeps its local bounds.
  const { min, max } = scene.bounds(ids[0]);
  const bounds = [...min, ...max, ...listed(3).slice(6)];
  scene.setAllBounds({ length: count, ...ids }, { length: 6 * count, ...bounds });
  let answer;
  scene.ask({ what: "region", min: [-1, -1, -1], max: [0, 0, 0] }, (given) => (answer = given));
  assert.deepEqual(
    calls.map(([name, [all]]) => [name, all.length]),
    [
      ["setAllBounds", 1],
      ["setAllBounds", count - 1],
    ],
  );
  (deliver(), deliver());
  assert.deepEqual([scene.refusals, answer?.bits.length], [[], 4]);
});

test("the same flags again leave an answer as good as it was", () => {
  const { scene, wall, lamp, isShown, settle } = street();
  isShown(lamp);
  settle();
  scene.setFlags(wall, Flag.Occluder);
  assert.ok(!isShown(lamp));
});

test("an object hides nothing by what it had before a mesh that is refused, until it gets another", () => {
  const { scene, wall, lamp, isShown, settle } = street();
  isShown(lamp);
  settle();
  assert.ok(!isShown(lamp), "the wall hides the lamp");
  scene.setMesh(wall, scene.addMesh(REFUSED_MESH));
  scene.setTriangles(wall, CORNER);
  // An answer is under way, of the scene as it was.
  settle();
  isShown(lamp);
  settle();
  assert.ok(isShown(lamp));
  assert.match(scene.refusals.join(), /addMesh/, "the refusal is told");
  scene.setMesh(wall, scene.addBoxMesh(WALL));
  settle();
  isShown(lamp);
  settle();
  assert.ok(!isShown(lamp), "by a good mesh");
});

test("a worker whose library cannot be loaded answers what came before as well, and its messages are bounded", async () => {
  const { near, far, deliver } = wire();
  let fail;
  const served = serveLoaded(far, new Promise((_, reject) => (fail = reject)));
  const scene = new LateScene(visibility.createScene(), [near]);
  const answers = [];
  const ask = (what) => scene.ask({ what, ...cube(-1, 1) }, (answer) => answers.push(answer));
  ask("hidden");
  ask("region");
  deliver();
  fail(new Error("no module"));
  await served;
  deliver();
  assert.deepEqual(
    answers.map((answer) => answer?.bits.length),
    [0, undefined],
    "no object is hidden, and no region is told",
  );
  for (let i = 0; i < 100; i++) ask("hidden");
  deliver();
  deliver();
  assert.deepEqual([answers.length, scene.refusals.length], [102, 64]);
  assert.match(scene.refusals[63], /no module/);
  // Its answers took no time that it could tell.
  const late = new LateAnswers(visibility, scene);
  const camera = { eye: [0, 0, 0], target: [1, 0, 0], up: [0, 0, 1], fovY: 1, aspect: 1, near: 0.1, far: 100 };
  const view = visibility.createView();
  view.setPerspective(camera);
  for (let frame = 0; frame < 2; frame++) {
    assert.deepEqual([...late.apply(view, ["setPerspective", camera], Uint32Array.of(5))], [5], `frame ${frame}`);
    deliver();
    deliver();
  }
  assert.deepEqual([late.stats.workerMs, late.stats.reason], [0, "no answer for a reach"]);
});

test("the page bakes boxes anew for occluders that have come since", () => {
  const delivers = [];
  globalThis.Worker = class {
    constructor() {
      const { near, far, deliver } = wire();
      serve(far, elsewhere);
      delivers.push(deliver);
      return near;
    }
  };
  const bounds = [WALL, cube(9, 10)].flatMap(({ min, max }) => [...min, ...max]);
  const workers = new Workers(visibility, { bounds, flags: [Flag.Occluder, 0] }, true);
  delete globalThis.Worker;
  workers.choose(["bake"], { size: 60, near: 0.01 });
  const [wall, lamp] = workers.ids;
  const view = visibility.createView();
  const lens = { eye: [0, 0, 0], target: [1, 0, 0], up: [0, 0, 1], fovY: 1, aspect: 1, near: 0.01 };
  view.setPerspective(lens);
  const isShown = () => {
    const bits = Uint32Array.of(3);
    workers.apply(view, lens, [0, 0, 0], bits);
    for (const deliver of delivers) (deliver(), deliver());
    return has(bits, indexOf(lamp));
  };
  workers.scene.setTriangles(wall, FACE);
  for (let frame = 0; frame < 3; frame++) assert.ok(isShown(), "without an occluder");
  assert.ok(workers.boxes.length > 1, "boxes that are baked without an occluder");
  workers.scene.prepareOccluders();
  // Asks for the eye's box, and has it.
  isShown();
  assert.ok(!isShown(), "by the eye's box, which is baked anew");
});
