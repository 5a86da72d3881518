// Tests that a scene and its workers stay alike: that calls leave an object with the same box on both sides, and that
// it hides others no more by what it has lost.
// Usage: node --test tests/late-calls.js, after `build`.

import assert from "node:assert/strict";
import test from "node:test";
import { Flag, NO_OBJECT, indexOf } from "../package/visibility.js";
import { REFUSED_MESH, box, moveBy, street, watched } from "./late-street.js";

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

// What an object hides.

const WALL = box([5, -20, -20], [6, 20, 20]);
/** The triangles of the wall's face. */
const FACE = [5, -20, -20, 5, -20, 20, 5, 20, 20, 5, -20, -20, 5, 20, 20, 5, 20, -20];

for (const [what, flags, prepared] of [
  ["is never culled", Flag.Occluder | Flag.NeverCull, false],
  ["is drawn from its front alone", Flag.Occluder | Flag.OneSided, true],
]) {
  test(`a wall that from now on ${what} hides nothing, also not by the last answer`, () => {
    const { scene, wall, lamp, isShown, settle } = street();
    if (prepared) {
      scene.setFlags(wall, 0);
      scene.setBounds(wall, box([5, -20, -20], [6.5, 20, 20]));
      scene.setBounds(wall, WALL);
      scene.setFlags(wall, Flag.Occluder);
      scene.setTriangles(wall, FACE);
      scene.prepareOccluders();
    }
    isShown(lamp);
    settle();
    assert.ok(!isShown(lamp), "the wall hides the lamp");
    scene.setFlags(wall, flags);
    assert.ok(isShown(lamp), "at once");
    settle();
    isShown(lamp);
    settle();
    assert.ok(isShown(lamp), "by the answer of the scene as it is");
  });
}

test("the same flags again leave an answer as good as it was", () => {
  const { scene, wall, lamp, isShown, settle } = street();
  isShown(lamp);
  settle();
  scene.setFlags(wall, Flag.Occluder);
  assert.ok(!isShown(lamp));
});

/** Triangles within the wall that cover little of it. */
const CORNER = [5, 19, 19, 5, 20, 19, 5, 19, 20];
for (const [what, calls] of [
  ["a mesh that is refused", ({ scene, wall }) => {
    scene.setMesh(wall, scene.addMesh(REFUSED_MESH));
    scene.setTriangles(wall, CORNER);
  }],
  ["triangles that are refused", ({ scene, wall }) => {
    scene.setBounds(wall, box([5, -20, -20], [6.5, 20, 20]));
    scene.setTriangles(wall, FACE);
    scene.prepareOccluders();
    scene.setTriangles(wall, [0, 0, 0, 1, 0, 0, 0, 1, 0]);
  }],
]) {
  test(`an object hides nothing by what it had before ${what}`, () => {
    const made = street();
    const { scene, lamp, isShown, settle } = made;
    isShown(lamp);
    settle();
    assert.ok(!isShown(lamp), "the wall hides the lamp");
    calls(made);
    // An answer is under way, of the scene as it was.
    settle();
    isShown(lamp);
    settle();
    assert.ok(isShown(lamp));
    assert.match(scene.refusals.join(), /addMesh|setTriangles/, "the refusal is told");
    // A mesh that is good hides again.
    scene.setMesh(made.wall, scene.addBoxMesh(WALL));
    settle();
    isShown(lamp);
    settle();
    assert.ok(!isShown(lamp), "by a good mesh");
  });
}
