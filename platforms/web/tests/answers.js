// Prints what `native answers` prints, by the module for the web: the same lines if both answer alike.
// Usage: node answers.js [plain|simd128]

import assert from "node:assert/strict";
import { readFile } from "node:fs/promises";
import { load } from "../package/visibility.js";
import { cameras, fillScene, loadRecipes, makeBuilding, makePipeline, pipelineNames } from "../page/scene.js";

const JUDGED_EVERY = 20;
const visibility = await load({ simd128: process.argv[2] === "simd128" });
const make = await loadRecipes(await readFile(new URL("../page/scenes.wasm", import.meta.url)));

/** FNV-1a of numbers of 32 bits. */
function hash(numbers) {
  let hash = 0x811c9dc5;
  for (const byte of new Uint8Array(numbers.buffer, numbers.byteOffset, numbers.byteLength)) {
    hash = Math.imul(hash ^ byte, 0x01000193);
  }
  return (hash >>> 0).toString(16).padStart(8, "0");
}

for (const [name, a, b] of [
  ["plpcity", 2, 2],
  ["office", 2, 16],
  ["london", 12, 12],
]) {
  const lists = make(name, a, b);
  const title = `${name}:${a},${b}`;
  console.log(`${title} ${lists.triangleCounts.length} objects, triangles ${hash(lists.triangles)}`);
  const filled = fillScene(visibility, lists);
  const { scene } = filled;
  const building = makeBuilding(visibility, lists, filled);
  const [view, visible, judge] = [
    visibility.createView(),
    visibility.createVisible(),
    visibility.createJudge(256, 144),
  ];
  for (const label of pipelineNames(lists)) {
    const pipeline = makePipeline(visibility, label, building);
    cameras(lists, 16 / 9).forEach((camera, frame) => {
      view.setPerspective(camera);
      pipeline.cull(scene, view, visible);
      visible.sortByIndex(scene);
      const { indices } = visible;
      let line = `${title} ${label} ${frame} ${indices.length} ${hash(indices)}`;
      if (frame % JUDGED_EVERY === 0) {
        const { falseHiddenObjects, falseVisibleObjects, wrongPixels } = judge.compare(scene, view, visible);
        assert.equal(falseHiddenObjects, 0, line);
        line += ` ${falseHiddenObjects} ${falseVisibleObjects} ${wrongPixels}`;
      }
      console.log(line);
    });
    pipeline.destroy();
  }
  for (const handle of [scene, view, visible, judge, ...Object.values(building)]) handle.destroy();
}
