// Walks through the example of 50,000 objects in headless Chromium: by three.js alone, with the culling, and with the
// culling in a worker. Prints a table, and fails if a pixel is wrong, or if a ground that is left out is not noticed.
//
// Usage: node tests/example.js [COUNT [SECONDS [KIND...]]]: objects, seconds of each measurement, and `meshes`,
// `instances` or `batch`, all by default; with `/here` or `/worker` after it the culling there alone. Ends with status 77 where a browser or three.js is missing.

import assert from "node:assert/strict";
import { access } from "node:fs/promises";
import { launch } from "./chromium.js";
import { serve } from "./serve.js";

const [count = "5000", seconds = "1", ...chosen] = process.argv.slice(2);
const kinds = chosen.length > 0 ? chosen : ["meshes", "instances", "batch"];
/** The picture, and the page: the panel is 320 pixels wide, and below the picture on narrow pages. */
const PICTURE = { width: 640, height: 360 };
const VIEWPORT = { ...PICTURE, width: PICTURE.width + 320 };
const PATIENCE = 300000;
const three = "../node_modules/three/build/three.module.js";

const missing = await access(new URL("../three/node_modules/three", import.meta.url)).then(
  () => null,
  () => "three.js is not there",
);
const browser = missing ?? (await launch());
if (typeof browser === "string") {
  console.error(browser);
  process.exit(77);
}
const server = await serve();
const rows = [];
const whole = (number) => number.toLocaleString("en");
try {
  const page = await browser.newPage();
  const complaints = [];
  page.on("pageerror", ({ message }) => complaints.push(message));
  page.on("console", (message) => message.type() === "error" && complaints.push(message.text()));
  await page.setViewport(VIEWPORT);
  await page.goto(
    new URL(`../three/example/?paused&count=${count}&kind=${kinds[0].split("/")[0]}&three=${three}`, server.address)
      .href,
  );
  await page.waitForFunction("window.example?.state.kind", { timeout: PATIENCE });
  for (const [kind, where] of kinds.map((kind) => kind.split("/"))) {
    for (const inWorker of [false, true]) {
      if (where && (where === "worker") !== inWorker) continue;
      const at = `${kind}${inWorker ? ", in a worker" : ""}`;
      if (inWorker || kind !== kinds[0].split("/")[0]) await page.evaluate(`example.choose("${kind}", ${inWorker})`);
      await page.evaluate("example.goTo(4)");
      const measure = (side) =>
        page.evaluate(`document.getElementById("walk").checked = true; example.measure("${side}", ${seconds})`);
      const alone = inWorker ? null : await measure("three");
      const culled = await measure("visibility");
      // A picture that is too wide has no answer for all cameras around.
      assert.notEqual(culled.reason, "no answer for a reach", at);
      await page.evaluate("example.compare()");
      const { wrong, colors, errors, compared: pictures } = await page.evaluate("example.state");
      assert.deepEqual([wrong, errors], [0, 0], `wrong pixels and errors: ${at}`);
      assert.ok(colors > 10, `${colors} colours: ${at}`);
      const spoiled = await page.evaluate(`example.compareWithout("ground")`);
      assert.ok(spoiled > 50, `a missing ground changes ${spoiled} pixels: ${at}`);
      if (alone) {
        assert.ok(culled.hidden > 0 && culled.triangles < alone.triangles, `something is hidden: ${at}`);
        rows.push([kind, "three.js", alone, 0]);
      }
      rows.push([kind, inWorker ? "in a worker" : "culled", culled, wrong, pictures]);
    }
  }
  assert.deepEqual(complaints, [], "the console has no errors");
  console.log(
    `${await browser.version()}, software WebGL, ${PICTURE.width} x ${PICTURE.height}, ${whole(Number(count))} objects`,
  );
  for (const [kind, how, { fps, ms, cullingMs, calls, triangles, hidden, frames, late }, wrong, pictures = 0] of rows) {
    const own =
      how === "three.js"
        ? ""
        : `, culling ${cullingMs.toFixed(1)} ms, ${whole(hidden)} hidden, ${late} of ${frames} frames without an answer, ${wrong} wrong pixels in ${pictures} pictures`;
    console.log(
      `${kind}, ${how}: ${fps.toFixed(2)} fps, ${ms.toFixed(1)} ms CPU, ${whole(calls)} calls, ${whole(triangles)} triangles${own}`,
    );
  }
} finally {
  await browser.close();
  server.close();
}
