// Opens the page in headless Chromium by way of chromedriver, flies through the scenes, and fails if a number
// of visible objects is not the native one, a visible object is hidden, or the page reports an error.
//
// Usage: node browser.js FILE FOLDER, with the output of `native answers` and a folder for pictures.

import assert from "node:assert/strict";
import { spawn } from "node:child_process";
import { mkdir, readFile, writeFile } from "node:fs/promises";
import { serve } from "./serve.js";

const [answers, pictures] = process.argv.slice(2);
/** By scene, pipeline and frame: the number of visible objects. */
const native = new Map(
  (await readFile(answers, "utf8")).split("\n").map((line) => {
    const [scene, pipeline, frame, count] = line.split(" ");
    return [`${scene.split(":")[0]} ${pipeline} ${frame}`, Number(count)];
  }),
);
const FRAMES = [0, 40, 95];

await mkdir(pictures, { recursive: true });
const server = await serve();
const driver = spawn("chromedriver", ["--port=0"], { stdio: ["ignore", "pipe", "inherit"] });
const port = await new Promise((resolve, reject) => {
  let text = "";
  driver.on("exit", () => reject(new Error(`chromedriver ended: ${text}`)));
  driver.stdout.on("data", (data) => {
    const found = (text += data).match(/successfully on port (\d+)/);
    if (found) resolve(found[1]);
  });
});

/** Sends a WebDriver command and returns its value. */
async function command(method, path, body) {
  const options = { method, body: body && JSON.stringify(body) };
  const response = await fetch(`http://localhost:${port}/session${path}`, options);
  const { value } = await response.json();
  if (value?.error) throw new Error(`${path}: ${value.message}`);
  return value;
}

const args = ["--headless=new", "--no-sandbox", "--enable-unsafe-swiftshader", "--use-angle=swiftshader"];
const browser = { "goog:chromeOptions": { args }, "goog:loggingPrefs": { browser: "ALL" } };
let session;
try {
  const made = await command("POST", "", { capabilities: { alwaysMatch: browser } });
  session = `/${made.sessionId}`;
  const run = (script, ...args) => command("POST", `${session}/execute/async`, { script, args });
  /** Runs a statement in the page, waits for the next frame, and returns the page's state. */
  const act = (statement) =>
    run(`
      const done = arguments[0];
      ${statement};
      const from = page.state.frames;
      const look = () => (page.state.frames > from ? done(page.state) : requestAnimationFrame(look));
      look();`);
  const picture = async (name) => {
    const data = await command("GET", `${session}/screenshot`);
    await writeFile(`${pictures}/${name}.png`, Buffer.from(data, "base64"));
  };

  const size = { width: 1280, height: 720, deviceScaleFactor: 1, mobile: false };
  await command("POST", `${session}/goog/cdp/execute`, {
    cmd: "Emulation.setDeviceMetricsOverride",
    params: size,
  });
  for (const [scene, recipe] of [
    ["city", "plpcity"],
    ["office", "office"],
  ]) {
    for (const simd128 of [0, 1]) {
      const url = `${server.address}?scene=${scene}&simd128=${simd128}&measure`;
      await command("POST", `${session}/url`, { url });
      await run(`
        const done = arguments[0];
        const wait = () => (page?.state.frames > 2 || page?.state.errors > 0 ? done() : setTimeout(wait, 50));
        wait();`);
      // The module without SIMD is one picture; its answers are compared outside the browser.
      const frames = simd128 ? FRAMES : FRAMES.slice(0, 1);
      for (const name of ["frustum", "z-buffer", "portals", "baked"].filter((name) =>
        native.has(`${recipe} ${name} 0`),
      )) {
        await act(`page.chooseCuller("${name}"); page.toggle("walk", false)`);
        for (const frame of frames) {
          const { visible, wrongPixels } = await act(`page.goTo(${frame})`);
          assert.equal(
            visible,
            native.get(`${recipe} ${name} ${frame}`),
            `${scene}, ${name}, frame ${frame}`,
          );
          assert.equal(wrongPixels, 0, `wrong pixels: ${scene}, ${name}, frame ${frame}`);
        }
        if (simd128) await picture(`${scene}-${name}`);
      }
      if (simd128) {
        await act(`page.toggle("freeze", true); page.toggle("above", true)`);
        await picture(`${scene}-above`);
      }
    }
  }

  // By keyboard: the camera moves ahead, and the walk ends.
  const before = await act(`for (const name in page.toggles) page.toggle(name, name === "walk")`);
  assert.ok((await act("")).key > before.key, "the walk goes on");
  const keys = [
    { type: "keyDown", value: "w" },
    { type: "pause", duration: 500 },
    { type: "keyUp", value: "w" },
  ];
  await command("POST", `${session}/actions`, { actions: [{ type: "key", id: "keyboard", actions: keys }] });
  const flown = await act("");
  // By mouse, and by a finger on the right half: the camera turns.
  const drag = async (pointerType) => {
    const from = await act("");
    const actions = [
      { type: "pointerMove", x: 900, y: 400 },
      { type: "pointerDown", button: 0 },
      { type: "pointerMove", x: 1000, y: 400, duration: 100 },
      { type: "pointerUp", button: 0 },
    ];
    const pointer = { type: "pointer", id: pointerType, parameters: { pointerType }, actions };
    await command("POST", `${session}/actions`, { actions: [pointer] });
    const { camera } = await act("");
    assert.deepEqual(camera.eye, from.camera.eye, "looking around does not move");
    assert.notDeepEqual(camera.target, from.camera.target, `a drag by ${pointerType} turns the camera`);
  };
  assert.equal(await run("arguments[0](page.toggles.walk)"), false, "a key ends the walk");
  assert.notDeepEqual(flown.camera.eye, before.camera.eye, "a key moves the camera");
  await drag("mouse");
  await drag("touch");

  // On a phone: a finger on the left half moves.
  const phone = { width: 390, height: 844, deviceScaleFactor: 1, mobile: true };
  await command("POST", `${session}/goog/cdp/execute`, {
    cmd: "Emulation.setDeviceMetricsOverride",
    params: phone,
  });
  const standing = await act("");
  const push = [
    { type: "pointerMove", x: 100, y: 700 },
    { type: "pointerDown", button: 0 },
    { type: "pointerMove", x: 100, y: 600, duration: 300 },
    { type: "pointerUp", button: 0 },
  ];
  const finger = { type: "pointer", id: "finger", parameters: { pointerType: "touch" }, actions: push };
  await command("POST", `${session}/actions`, { actions: [finger] });
  const pushed = await act("");
  assert.notDeepEqual(pushed.camera.eye, standing.camera.eye, "a finger on the left half moves the camera");
  await picture("phone");

  const log = await command("POST", `${session}/se/log`, { type: "browser" });
  const complaints = log.filter(({ level, message }) => level === "SEVERE" || /error/i.test(message));
  assert.deepEqual(complaints, [], "the console has no errors");
  assert.equal(await run("arguments[0](page.state.errors)"), 0, "the page met no error");
  const { browserName, browserVersion } = made.capabilities;
  console.log(`the page in ${browserName} ${browserVersion}: as native; pictures in ${pictures}`);
} finally {
  if (session) await command("DELETE", session).catch(() => {});
  driver.kill();
  server.close();
}
