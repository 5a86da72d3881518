// The examples for other libraries of three.js, with those libraries, in headless Chromium: 3D tiles that come and go,
// and the rooms of an IFC file. Fails if little is hidden, a pixel is wrong, or something that is left out is not
// noticed.
//
// Usage: node tests/peers.js [FOLDER], a folder for pictures. Ends with status 77 where a browser, three.js, or a
// library in `tests/peers/node_modules` is missing.

import assert from "node:assert/strict";
import { access } from "node:fs/promises";
import { launch } from "./chromium.js";
import { writeRooms } from "./peers/rooms.js";
import { makeTiles } from "./peers/tiles.js";
import { serve } from "./serve.js";

const [pictures] = process.argv.slice(2);
const NEEDED = [
  "../three/node_modules/three",
  "peers/node_modules/3d-tiles-renderer",
  "peers/node_modules/web-ifc",
];
const PATIENCE = 120000;

async function missing() {
  for (const folder of NEEDED) {
    const isThere = await access(new URL(folder, import.meta.url)).then(
      () => true,
      () => false,
    );
    if (!isThere) return `${folder.split("/").at(-1)} is not there`;
  }
  return null;
}

const browser = (await missing()) ?? (await launch());
if (typeof browser === "string") {
  console.error(browser);
  process.exit(77);
}
/** A town at the origin, and one on the globe, where single precision has steps of half a metre. */
const TOWNS = { tiles: makeTiles("/tiles", [0, 0, 0]), globe: makeTiles("/globe", [4e6, 6e5, 4.9e6]) };
const server = await serve(0, new Map(Object.values(TOWNS).flatMap(({ files }) => [...files])));

/**
 * Opens the page of one library, runs `work` with functions that evaluate in it and save its picture, and expects no
 * complaint.
 */
async function open(name, work) {
  const page = await browser.newPage();
  const complaints = [];
  page.on("pageerror", ({ message }) => complaints.push(message));
  // Reading pixels waits for the picture, of which the driver warns.
  const isComplaint = (message) => /error|warn/.test(message.type()) && !/ReadPixels/.test(message.text());
  page.on("console", (message) => isComplaint(message) && complaints.push(message.text()));
  page.on("requestfailed", (request) => complaints.push(`failed: ${request.url()}`));
  await page.setViewport({ width: 640, height: 360 });
  await page.goto(new URL(`../tests/peers/?${name}`, server.address).href);
  await page.waitForFunction("window.peers", { timeout: PATIENCE });
  const save = (view) => pictures && page.screenshot({ path: `${pictures}/${name}-${view}.png` });
  await work((call) => page.evaluate(`peers.${call}`), save);
  assert.deepEqual(complaints, [], `${name}: the console has no complaints`);
  await page.close();
}

const triple = (place) => `[${place}]`;

/** Compares the pictures from an eye, of all and of what is left, in at least so many colours. */
async function compare(call, [eye, target], colors = 4) {
  const found = await call(`compare(${triple(eye)}, ${triple(target)})`);
  assert.equal(found.wrong, 0, `wrong pixels from ${eye}: ${JSON.stringify(found)}`);
  assert.ok(found.colors >= colors, `colours from ${eye}: ${JSON.stringify(found)}`);
  return found;
}

/** A walk through a town of tiles: frames while tiles come and go, and pictures once they are there. */
async function walkThroughTiles(tiles, call, save) {
  await call(`openTiles("${tiles.root}")`);
  const sums = { hidden: 0, objects: 0, drawn: 0, loading: 0 };
  for (const [at, view] of tiles.walk.entries()) {
    // Frames in which tiles of the former place go and others come.
    for (let frame = 0; frame < 6; frame++) {
      const { isLoading } = await compare(call, view, 1);
      sums.loading += Number(isLoading);
    }
    await call("settle()");
    const { stats, calls } = await compare(call, view);
    sums.hidden += stats.hidden;
    sums.objects += stats.objects;
    sums.drawn += calls;
    await save(at);
  }
  assert.ok(sums.loading > 0, "no picture was compared while tiles came");
  assert.ok(sums.hidden > sums.objects / 2, `tiles hidden: ${JSON.stringify(sums)}`);
  const spoiled = await call(`compareWithout("house")`);
  assert.ok(spoiled > 50, `a missing house changes ${spoiled} pixels`);
  const { hidden, objects, drawn } = sums;
  console.log(
    `3d-tiles-renderer, ${tiles.root}: ${hidden} of ${objects} meshes hidden, ${drawn} draw calls in ${tiles.walk.length} views`,
  );
  await call("closeTiles()");
}

/** The rooms of an IFC file: what is behind walls is hidden, and what is behind glass is not. */
async function walkThroughRooms(call, save) {
  const rooms = writeRooms();
  const meshes = await call(`openIfc(${JSON.stringify(rooms.text)})`);
  assert.equal(meshes, rooms.parts, "meshes");
  const lines = [];
  for (const [at, { name, eye, target, shows }] of rooms.views.entries()) {
    const { stats, calls } = await compare(call, [eye, target]);
    assert.ok(stats.hidden >= rooms.parts - shows, `${name}: ${stats.hidden} of ${stats.objects} are hidden`);
    await save(at);
    lines.push(`${name}: ${stats.hidden} of ${stats.objects} hidden, ${calls} draw calls`);
  }
  const spoiled = await call(`compareWithout("mesh")`);
  assert.ok(spoiled > 50, `a missing mesh changes ${spoiled} pixels`);
  console.log(`web-ifc: ${lines.join("; ")}`);
}

try {
  for (const [name, tiles] of Object.entries(TOWNS))
    await open(name, (call, save) => walkThroughTiles(tiles, call, save));
  await open("ifc", walkThroughRooms);
} finally {
  await browser.close();
  server.close();
}
