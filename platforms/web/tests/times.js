// Prints what `native times` prints, by the module for the web: microseconds a frame.
// Usage: node times.js [plain|simd128]

import { readFile } from "node:fs/promises";
import { load } from "../package/visibility.js";
import { cameras, fillScene, loadRecipes, makePipeline } from "../page/scene.js";

const visibility = await load({ simd128: process.argv[2] === "simd128" });
const make = await loadRecipes(await readFile(new URL("../page/scenes.wasm", import.meta.url)));
const lists = make("london", 28, 28);
const { scene } = fillScene(visibility, lists);
const views = cameras(lists, 16 / 9).map((camera) => {
  const view = visibility.createView();
  view.setPerspective(camera);
  return view;
});
const visible = visibility.createVisible();
for (const label of ["frustum", "z-buffer"]) {
  const pipeline = makePipeline(visibility, label);
  // The least of many rounds: the engine compiles what runs often anew, and others use the machine, too.
  let least = Infinity;
  for (const begin = performance.now(); performance.now() - begin < 3000;) {
    const start = performance.now();
    for (const view of views) pipeline.cull(scene, view, visible);
    least = Math.min(least, performance.now() - start);
  }
  console.log(`${label} ${((least * 1000) / views.length).toFixed(1)}`);
}
