// Tests of culling in a worker: whatever comes late, nothing that a ray from the camera meets is hidden.
// Usage: node --test tests/late.js, after `build`.

import assert from "node:assert/strict";
import { readFile } from "node:fs/promises";
import test from "node:test";
import { LateScene } from "../package/late.js";
import { serve } from "../package/late-worker.js";
import { Flag, indexOf, load } from "../package/visibility.js";
import { cameras, fillScene, firstTriangles, loadRecipes } from "../page/scene.js";
import { elsewhere, has, ones, randomOf, setting, street, visibility, wire } from "./late-street.js";

const make = await loadRecipes(await readFile(new URL("../page/scenes.wasm", import.meta.url)));

/** Returns the objects that rays through random places of a camera's picture meet first. */
function seenBy({ triangles, first, bounds }, { eye, target, up, fovY, aspect, near }, rays, random) {
  const add = (a, b, by = 1) => a.map((x, i) => x + by * b[i]);
  const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  const unit = (a) => a.map((x) => x / Math.hypot(...a));
  const ahead = unit(add(target, eye, -1));
  const right = unit(cross(ahead, up));
  const over = cross(right, ahead);
  const high = Math.tan(fovY / 2);
  const seen = new Set();
  for (let ray = 0; ray < rays; ray++) {
    const [x, y] = [high * aspect * (2 * random() - 1), high * (2 * random() - 1)];
    const d = add(add(ahead, right, x), over, y);
    let [nearest, object] = [Infinity, -1];
    for (let o = 0; o + 1 < first.length; o++) {
      if (!mayMeet(bounds, 6 * o, eye, d)) continue;
      for (let t = 9 * first[o]; t < 9 * first[o + 1]; t += 9) {
        // Möller and Trumbore, "Fast, Minimum Storage Ray/Triangle Intersection", 1997.
        const a = [triangles[t], triangles[t + 1], triangles[t + 2]];
        const e1 = [triangles[t + 3] - a[0], triangles[t + 4] - a[1], triangles[t + 5] - a[2]];
        const e2 = [triangles[t + 6] - a[0], triangles[t + 7] - a[1], triangles[t + 8] - a[2]];
        const p = cross(d, e2);
        const determinant = dot(e1, p);
        if (determinant === 0) continue;
        const s = add(eye, a, -1);
        const u = dot(s, p) / determinant;
        if (u < 0 || u > 1) continue;
        const q = cross(s, e1);
        const v = dot(d, q) / determinant;
        if (v < 0 || u + v > 1) continue;
        const at = dot(e2, q) / determinant;
        // `d` is as long as its depth, so that `at` is the depth.
        if (at >= near && at < nearest) [nearest, object] = [at, o];
      }
    }
    if (object >= 0) seen.add(object);
  }
  return seen;
}

/** Whether a ray may meet a box: false only if it surely does not. */
function mayMeet(bounds, at, eye, d) {
  let [from, to] = [0, Infinity];
  for (let k = 0; k < 3; k++) {
    const [low, high] = [bounds[at + k] - 1e-3 - eye[k], bounds[at + 3 + k] + 1e-3 - eye[k]];
    if (d[k] === 0) {
      if (low > 0 || high < 0) return false;
    } else {
      from = Math.max(from, Math.min(low / d[k], high / d[k]));
      to = Math.min(to, Math.max(low / d[k], high / d[k]));
    }
  }
  return from <= to * (1 + 1e-9) + 1e-9;
}

/**
 * Puts lists into a scene that workers follow, as `fillScene` does into one of the library's. With `twoSided` their
 * triangles hide others from both sides.
 */
function fillLate(scene, lists, twoSided) {
  const first = firstTriangles(lists);
  const { bounds, scene: other } = fillScene(visibility, lists);
  other.destroy();
  const ids = scene.insertAll({ bounds, cost: lists.triangleCounts, flags: Flag.Occluder });
  ids.forEach((id, o) => {
    const positions = lists.triangles.subarray(9 * first[o], 9 * first[o + 1]);
    if (!twoSided) return scene.setTriangles(id, positions);
    const indices = Uint32Array.from({ length: positions.length / 3 }, (_, i) => i);
    scene.setMesh(id, scene.addMesh({ positions, indices, twoSided }));
  });
  scene.prepareOccluders();
  return { ids, first, bounds };
}

const PIPELINES = [[["addZBuffer"]], [["addPortals", { maxCells: 400 }]]];
for (const [name, a, b, stages] of [
  ["plpcity", 2, 2, PIPELINES[0]],
  ["office", 2, 8, PIPELINES[0]],
  ["office", 2, 8, PIPELINES[1]],
]) {
  test(`${name} by ${stages[0][0]}: late answers hide nothing that is seen`, () => {
    const lists = make(name, a, b);
    const radians = 0.2;
    const { scene, answers, frame, deliver } = setting({ metres: 0.5, radians, stages });
    const { first, bounds } = fillLate(scene, lists, stages === PIPELINES[1]);
    const random = randomOf(7);
    const walk = cameras(lists, 16 / 9);
    const tally = { frames: 0, used: 0, beyond: 0, hidden: 0, seen: 0 };
    for (let key = 0; key + 1 < walk.length && tally.frames < 60; key += 7) {
      // Small steps, then a jump to another place; answers come some frames late.
      for (let step = 0; step < 15; step++, tally.frames++) {
        const part = step / 60;
        const between = (p, q) => p.map((x, i) => x + part * (q[i] - x));
        const camera = {
          ...walk[key],
          eye: between(walk[key].eye, walk[key + 1].eye),
          target: between(walk[key].target, walk[key + 1].target),
        };
        const { bits, inView } = frame(camera);
        for (let late = random(); late < 0.8; late += 0.4) deliver();
        tally.used += Number(answers.stats.isUsed);
        tally.beyond += Number(answers.stats.reason === "the camera is beyond its reach");
        tally.hidden += ones32(inView) - ones32(bits);
        for (const object of seenBy({ ...lists, first, bounds }, camera, 60, random)) {
          tally.seen++;
          assert.ok(has(bits, object), `${name}: object ${object} is seen in frame ${tally.frames} and hidden`);
        }
      }
    }
    assert.deepEqual(scene.refusals, [], `${name}: calls that the worker refuses`);
    const { used, beyond, hidden, seen } = tally;
    assert.ok(used > 10 && beyond > 2 && hidden > 300 && seen > 300, `${name}: ${JSON.stringify(tally)}`);
  });
}

const ones32 = (bits) => bits.reduce((sum, word) => sum + ones(word), 0);

test("an answer hides once it is there, and within its reach alone", () => {
  const { lamp, isShown, look, settle, answers } = street({ metres: 0.5, radians: 0.2 });
  assert.ok(isShown(lamp), "nothing is hidden before the first answer");
  settle();
  assert.ok(!isShown(lamp), "the answer hides the lamp");
  assert.ok(!isShown(lamp, look([0.4, 0, 0.2], 0.15)), "an eye within its reach");
  for (const camera of [look([0.6, 0, 0]), look([0, 0, 0], 0.25), { ...look(), fovY: 1.1 }]) {
    assert.ok(isShown(lamp, camera), "a view beyond the reach, or of another lens");
    assert.equal(answers.stats.reason, "the camera is beyond its reach");
  }
});

test("an answer is for the view that was asked for, also if the worker has one that is still good there", () => {
  const { lamp, isShown, look, settle } = street({ metres: 0.5, radians: 0.2 });
  isShown(lamp);
  settle();
  // Asks at 0.4, which an answer around 0 would hold for. Around 0 it does not hold at 0.8.
  isShown(lamp, look([0.4, 0, 0]));
  settle();
  // From 4.9 + 0.8 on, the eye is inside of the wall: go back to see both ends of the reach.
  assert.ok(!isShown(lamp, look([0.85, 0, 0])), "within the reach around 0.4");
  assert.ok(isShown(lamp, look([-0.2, 0, 0])), "beyond the reach around 0.4");
});

test("an answer that the worker still has is not taken for one around a later view", () => {
  const { scene, frame, look, settle } = street({ metres: 1.5, radians: 0.1 });
  const box = (min, max) => ({ min, max });
  const post = scene.insert({ bounds: box([5, 48, -9], [6, 52, 9]), flags: Flag.Occluder });
  scene.setMesh(post, scene.addBoxMesh(box([5, 48, -9], [6, 52, 9])));
  const far = scene.insert({ bounds: box([20, 49.7, -1], [21, 50.3, 1]) });
  const isShown = (y) => has(frame(look([0, y, 0])).bits, indexOf(far));
  isShown(50);
  settle();
  assert.ok(!isShown(51.4), "hidden by the answer around y = 50");
  // That frame has asked for an answer around y = 51.4, where the worker's own answer is good, too.
  settle();
  assert.ok(isShown(52.75), "seen past the post, within the reach around y = 51.4");
});

for (const [what, change] of [
  ["is removed", ({ scene, wall }) => scene.remove(wall)],
  ["is moved", ({ scene, wall }) => scene.setBounds(wall, { min: [5, 30, -20], max: [6, 70, 20] })],
  ["hides no more", ({ scene, wall }) => scene.setFlags(wall, 0)],
  ["is on no layer of the view", ({ scene, wall }) => scene.setLayers(wall, 0)],
  ["gets a smaller mesh", ({ scene, wall }) =>
    scene.setMesh(wall, scene.addBoxMesh({ min: [5, 19, 19], max: [6, 20, 20] }))],
]) {
  test(`a wall that ${what} hides nothing, also not by an answer that was asked for before`, () => {
    const made = street();
    const { lamp, isShown, settle, deliver } = made;
    isShown(lamp);
    settle();
    assert.ok(!isShown(lamp), "the wall hides the lamp");
    // A question is under way, whose answer is of the wall as it was.
    deliver();
    change(made);
    assert.ok(isShown(lamp), `at once, after the wall ${what}`);
    deliver();
    assert.ok(isShown(lamp), "by the answer that was under way");
    settle();
    assert.ok(isShown(lamp), "by the answer of the scene as it is");
  });
}

test("a lamp that comes out from behind the wall is shown at once, another that does not stays hidden", () => {
  const { scene, lamp, isShown, settle, look } = street();
  const other = scene.insert({ bounds: { min: [9, 3, -1], max: [10, 4, 1] } });
  isShown(lamp);
  settle();
  assert.deepEqual([isShown(lamp), isShown(other)], [false, false], "both are behind the wall");
  scene.setBounds(lamp, { min: [3, -1, -1], max: [4, 1, 1] });
  assert.deepEqual([isShown(lamp), isShown(other)], [true, false], "the lamp is before the wall");
  // The index of a removed object is given to a new one.
  scene.remove(other);
  const late = scene.insert({ bounds: { min: [3, 1, -1], max: [4, 1.5, 1] } });
  assert.equal(indexOf(late), indexOf(other), "an index comes back");
  assert.ok(isShown(late, look()), "an object that came after the answer");
});

test("boxes: what is hidden from all points of one, and a mesh that is refused", () => {
  const { scene, wall, lamp, settle } = street();
  const answers = [];
  const ask = (min, max) => scene.ask({ what: "hidden", min, max }, (answer) => answers.push(answer));
  ask([-1, -1, -1], [1, 1, 1]);
  ask([7, -1, -1], [8, 1, 1]);
  settle();
  assert.deepEqual(answers.map(({ bits }) => has(bits, indexOf(lamp))), [true, false], "hidden from the boxes");
  assert.ok(!answers.some(({ bits }) => has(bits, indexOf(wall))), "the wall is seen");
  scene.setMesh(wall, scene.addMesh({ positions: [NaN, 0, 0, 1, 0, 0, 0, 1, 0], indices: [0, 1, 2] }));
  ask([-1, -1, -1], [1, 1, 1]);
  settle();
  assert.match(scene.refusals.join(), /addMesh/, "the refusal is told");
  assert.ok(!has(answers[2].bits, indexOf(lamp)), "an object whose new mesh is refused hides nothing by its old one");
});

test("the module for frames answers as the whole one, and says what it lacks", async () => {
  const frames = await load({ frames: true });
  const lists = make("plpcity", 2, 2);
  const answers = [visibility, frames].map((library) => {
    const { scene } = fillScene(library, lists);
    const pipeline = library.createPipeline().addFrustum().addContribution(720, 3).addZBuffer();
    const [view, visible] = [library.createView(), library.createVisible()];
    return cameras(lists, 16 / 9)
      .filter((_, key) => key % 10 === 0)
      .map((camera) => {
        view.setPerspective(camera);
        pipeline.cull(scene, view, visible);
        return visible.bits;
      });
  });
  assert.deepEqual(answers[1], answers[0], "bits of all frames");
  assert.ok(answers[0].length > 5 && ones32(answers[0][0]) > 10, "frames with something in them");
  for (const call of [() => frames.createJudge(64, 64), () => frames.createPipeline().addHorizon({ up: "y" })])
    assert.throws(call, { code: "STATE", message: /whole module/ });
});

test("a worker that could not follow the scene gives no answer", () => {
  const { near, far, deliver } = wire();
  serve(far, elsewhere);
  const scene = new LateScene(visibility.createScene(), [near]);
  const bounds = [5, -20, -20, 6, 20, 20];
  const [wall] = scene.insertAll({ bounds, flags: Flag.Occluder });
  scene.setMesh(wall, scene.addBoxMesh({ min: bounds.slice(0, 3), max: bounds.slice(3) }));
  const lamp = scene.insert({ bounds: { min: [9, -1, -1], max: [10, 1, 1] } });
  const answers = [];
  const ask = () => scene.ask({ what: "hidden", min: [-1, -1, -1], max: [1, 1, 1] }, (answer) => answers.push(answer));
  ask();
  deliver();
  // A call that the worker does not know what to do with.
  far.onmessage({ data: { calls: [["removeAll", [[1n << 40n | 77n]]]], ask: null } });
  ask();
  deliver();
  deliver();
  assert.deepEqual(answers.map(({ bits }) => has(bits, indexOf(lamp))), [true, false], "before, and after");
});
