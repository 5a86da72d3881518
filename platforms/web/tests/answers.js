// Prints what `native answers` prints, by the module for the web: the same lines if both answer alike.
// Usage: node answers.js [plain|simd128]

import assert from "node:assert/strict";
import { readFile } from "node:fs/promises";
import { indexOf, load } from "../package/visibility.js";
import { cameras, fillScene, loadRecipes, makeBuilding, makePipeline, pipelineNames } from "../page/scene.js";

const JUDGED_EVERY = 20;
/** Intervals of the keys of walks that are frames of online sets; of frames before which an object opens. */
const [ONLINE_EVERY, OPENED_EVERY] = [8, 6];
/** Budget of each step of online sets. */
const STEP_MICROSECONDS = 100000;
/** As in `native.rs`: sizes of levels by index modulo 3, pictures and least size, draw ranges, and keys of draw lists. */
const LOD_SIZES = [[400, 90, 30], [150], []];
const [PICTURE_HEIGHT, LEAST_PIXELS] = [1080, 4];
const [RANGED_EVERY, RANGE] = [5, [1, 60, 20]];
const KEYS = 7;
/** Interval of the cells that have a mirror on their side of least x. */
const MIRRORED_EVERY = 3;
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

/** Prints a frame of reflections for each camera. */
function mirrored(title, scene, view, visible, walk, cells, lists) {
  for (let cell = 0; cell < lists.cells.length / 6; cell += MIRRORED_EVERY) {
    const [x, y, z, , toY, toZ] = lists.cells.subarray(6 * cell, 6 * cell + 6);
    const corners = [y, z, toY, z, toY, toZ, y, toZ];
    cells.addMirror(cell, [0, 2, 4, 6].map((i) => [x, corners[i], corners[i + 1]]));
  }
  const reflections = visibility.createReflections(cells);
  const pipeline = visibility.createPipeline().addFrustum().addReflections(reflections);
  const mirrored = visibility.createView();
  walk.forEach((camera, frame) => {
    view.setPerspective(camera);
    pipeline.cull(scene, view, visible);
    const { list, leftOut } = reflections;
    const [matrices, objects] = [[], []];
    for (let number = 0; number < list.length; number++) {
      reflections.read(number, mirrored, visible);
      matrices.push(...mirrored.matrix());
      objects.push(...visible.indices);
    }
    const numbers = list.flatMap(({ mirror, parent, depth }) => [mirror, parent ?? 0xffffffff, depth]);
    const hashes = [new Uint32Array(numbers), new Float32Array(matrices), new Uint32Array(objects)].map(hash);
    console.log(`${title} mirrors ${frame} ${list.length} ${leftOut} ${hashes.join(" ")}`);
  });
  for (const handle of [pipeline, reflections, mirrored]) handle.destroy();
}

/** Prints a frame of levels of detail and draw lists for each camera. */
function drawn(title, scene, view, visible, walk, ids) {
  for (let i = 0; i < scene.count; i += RANGED_EVERY) scene.setDrawRange(ids[i], ...RANGE);
  LOD_SIZES.forEach((sizes, kind) =>
    scene.setLodSizes(ids.filter((_, i) => i % LOD_SIZES.length === kind), sizes),
  );
  scene.setDrawKeys(ids, Uint32Array.from(ids, (_, i) => (i % KEYS) * 4));
  const pipeline = visibility.createPipeline().addFrustum().addContribution(PICTURE_HEIGHT, LEAST_PIXELS);
  const [lods, list] = [visibility.createLods(PICTURE_HEIGHT), visibility.createDrawList()];
  walk.forEach((camera, frame) => {
    view.setPerspective(camera);
    pipeline.cull(scene, view, visible);
    lods.select(scene, view, visible, Math.fround(0.05));
    const { ids, levels, fades, opacities } = lods.selected;
    list.groupLevels(scene, lods);
    const hashes = [Uint32Array.from(levels), fades, opacities, list.groups, list.instances].map(hash);
    list.groupFading(scene, lods);
    console.log(`${title} drawn ${frame} ${ids.length} ${hashes.join(" ")} ${hash(list.instances)}`);
  });
  for (const handle of [pipeline, lods, list]) handle.destroy();
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
  /** Prints a frame: which and how many objects are visible, and for some frames what the judge finds. */
  const print = (label, frame) => {
    visible.sortByIndex(scene);
    const { indices } = visible;
    let line = `${title} ${label} ${indices.length} ${hash(indices)}`;
    if (frame % JUDGED_EVERY === 0) {
      const { falseHiddenObjects, falseVisibleObjects, wrongPixels } = judge.compare(scene, view, visible);
      assert.equal(falseHiddenObjects, 0, line);
      line += ` ${falseHiddenObjects} ${falseVisibleObjects} ${wrongPixels}`;
    }
    console.log(line);
  };
  const walk = cameras(lists, 16 / 9);
  for (const label of pipelineNames(lists)) {
    const pipeline = makePipeline(visibility, label, building);
    walk.forEach((camera, frame) => {
      view.setPerspective(camera);
      pipeline.cull(scene, view, visible);
      print(`${label} ${frame}`, frame);
    });
    pipeline.destroy();
  }
  const online = visibility.createOnline({ viewcell: [0.8, 0.8, 0.8], wide: [4, 4, 1.2], margin: 0.25 });
  const pipeline = visibility.createPipeline().addFrustum().addOnline(online);
  const keys = walk.filter((_, key) => key % ONLINE_EVERY === 0);
  keys.forEach((camera, frame) => {
    if (frame % OPENED_EVERY === 0) scene.setFlags(filled.ids[(frame * 7) % scene.count], 0);
    const ahead = keys.slice(frame, frame + 2).flatMap(({ eye }) => eye);
    for (let step = 0; step < (frame * 13) % 40; step++) online.step(scene, ahead, STEP_MICROSECONDS);
    view.setPerspective(camera);
    pipeline.cull(scene, view, visible);
    const came = hash(Uint32Array.from(online.came, indexOf));
    print(`online ${frame} ${online.answer} ${came}`, frame);
  });
  if (building.cells) mirrored(title, scene, view, visible, walk, building.cells, lists);
  drawn(title, scene, view, visible, walk, filled.ids);
  const handles = [scene, view, visible, judge, online, pipeline, ...Object.values(building)];
  for (const handle of handles) handle.destroy();
}
