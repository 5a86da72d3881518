// Opens the page in headless Chromium, flies through scenes and models of files, and fails if a number of
// visible objects is not the native one, a visible object is hidden, or the page reports an error.
//
// Usage: node browser.js FILE FOLDER [PART], with the output of `native answers` and a folder for pictures;
// PART is one of the functions below. Ends with status 77 where a browser is missing or does not start.

import assert from "node:assert/strict";
import { mkdir, readFile, writeFile } from "node:fs/promises";
import { Tab, launch } from "./chromium.js";
import { ENCODERS, writeElsewhere, writeMirrored, writePoints, writeWall } from "./models.js";
import { serve } from "./serve.js";

const [answers, pictures, part] = process.argv.slice(2);
/** By scene, pipeline and frame: the number of visible objects. */
const native = new Map(
  (await readFile(answers, "utf8")).split("\n").map((line) => {
    const [scene, pipeline, frame, count] = line.split(" ");
    return [`${scene.split(":")[0]} ${pipeline} ${frame}`, Number(count)];
  }),
);
const FRAMES = [0, 40, 95];
/** Stages of the page by the native name of the pipeline. */
const STAGES = {
  frustum: ["frustum"],
  "z-buffer": ["frustum", "zbuffer"],
  portals: ["frustum", "portals"],
  baked: ["frustum", "baked"],
};
/** The picture alone is 16:9, as the native cameras are; the panel is 320 pixels wide. */
const WIDE = { width: 640 + 320, height: 360 };
const PHONE = { width: 390, height: 844, isMobile: true, hasTouch: true };

await mkdir(pictures, { recursive: true });
const browser = await launch();
if (typeof browser === "string") {
  console.error(browser);
  process.exit(77);
}
const server = await serve();
const save = (tab, name) => tab.picture(`${pictures}/${name}.png`);
const complaints = [];
/** Query of the page for most tests. */
const OFFICE = "scene=office&still&full";

/** Opens the page with a query, does `work` with its tab, keeps the complaints of the page, and closes it. */
async function inTab(query, work, viewport = WIDE, early = null) {
  const tab = await Tab.open(browser, `${server.address}?${query}`, viewport, early);
  await work(tab);
  complaints.push(...tab.complaints);
  await tab.page.close();
}

/** Built-in scenes: answers as native, no wrong pixel. */
async function builtInScenes() {
  for (const [scene, recipe] of [
    ["city", "plpcity"],
    ["office", "office"],
  ]) {
    for (const simd128 of scene === "city" ? [1] : [0, 1]) {
      await inTab(`scene=${scene}&simd128=${simd128}&still&full`, async (tab) => {
        // The module without SIMD is one picture; its answers are compared outside the browser.
        const frames = simd128 ? FRAMES : FRAMES.slice(0, 1);
        const names = Object.keys(STAGES).filter((name) => native.has(`${recipe} ${name} 0`));
        assert.ok(names.length >= 2, `native answers of ${recipe}`);
        for (const name of names) {
          for (const frame of frames) {
            const at = `${scene}, ${name}, frame ${frame}`;
            const state = await tab.judged(
              `page.chooseStages(${JSON.stringify(STAGES[name])}); page.goTo(${frame})`,
            );
            assert.equal(state.visible, native.get(`${recipe} ${name} ${frame}`), at);
            assert.equal(state.check.wrongPixels, 0, `wrong pixels: ${at}`);
            assert.equal(state.check.wrongObjects, 0, `wrong objects: ${at}`);
            assert.ok(
              state.check.shown > 0 && state.check.shown <= state.visible,
              `objects that show: ${at}`,
            );
          }
        }
        if (simd128) {
          await save(tab, scene);
          await tab.act(`page.toggle("ghosts", true)`);
          await save(tab, `${scene}-hidden`);
          await tab.act(`page.toggle("freeze", true); page.toggle("above", true)`);
          await save(tab, `${scene}-above`);
        }
      });
    }
  }
}

/** Models of files, from drop to picture; and files that are none. */
async function files(tab) {
  const path = (name) => `${pictures}/${name}`;
  // Looks at the wall from the front: what is behind it is hidden, the red box is not.
  const front = `page.lookFrom([0, 3, 25], [0, 3, 0])`;
  for (const instanced of [false, true]) {
    const bytes = await writeWall(path("wall.glb"), { instanced });
    const opened = await tab.openFiles(path("wall.glb"));
    assert.deepEqual([opened.message, opened.objects, opened.allTriangles], ["", 38, 38 * 12]);
    const all = await tab.judged(`page.chooseStages(["frustum"]); ${front}`);
    assert.deepEqual([all.visible, all.check.shown, all.check.wrongPixels], [38, 2, 0]);
    const culled = await tab.judged(`page.chooseStages(["frustum", "zbuffer"]); ${front}`);
    assert.deepEqual([culled.visible, culled.check.shown, culled.check.wrongPixels], [2, 2, 0]);
    assert.equal(culled.triangles, 24, "triangles drawn");
    // Sets ahead of the eye hide nothing at first, and what is behind the wall once they are made.
    await tab.act(`page.chooseStages(["frustum", "ahead"])`);
    await tab.until(`page.state.answer === "viewcell"`);
    const ahead = await tab.judged("");
    assert.equal(ahead.check.wrongPixels, 0, "wrong pixels of sets ahead of the eye");
    assert.ok(ahead.visible >= 2 && ahead.visible < 38, `sets ahead of the eye leave ${ahead.visible}`);
    await tab.judged(`page.chooseStages(["frustum", "zbuffer"])`);
    // The judge must see a mistake: the red box is left out.
    const wrong = await tab.page.evaluate(`page.judgeWithout(1)`);
    assert.ok(
      wrong.wrongPixels > 100 && wrong.wrongObjects === 1,
      `a missing object is seen: ${JSON.stringify(wrong)}`,
    );
    // In the middle of the picture is the wall or the red box before it.
    const { picked } = await tab.act(`page.pickAt([0.35, 0.4])`);
    assert.deepEqual([picked.name, picked.why], ["wall", "visible"]);
    await save(tab, instanced ? "wall-instanced" : "wall");
  }
  const report = await tab.page.evaluate(`page.report()`);
  await writeFile(path("report.html"), report);
  assert.equal(report.match(/<img /g).length, 9, "pictures of the report");
  const rows = [...report.matchAll(/<tr><td>([^<]*)<\/td><td>([\d,]+)/g)].map(([, label, count]) => [
    label,
    count,
  ]);
  assert.equal(rows.length, 3);
  assert.deepEqual(rows[0], ["everything", "38"]);
  assert.match(report, />0 of [\d,]+<\/td><td>0<\/td><td>conservative/);
  assert.match(report, /visibility-three/);
}

/** Compressed files: as many triangles as before, and the same objects are hidden. */
async function compressed(tab) {
  const path = `${pictures}/compressed.glb`;
  for (const [compression, encoder] of Object.entries(ENCODERS)) {
    const isThere = await import(encoder).then(
      () => true,
      () => false,
    );
    if (!isThere) {
      console.error(`${encoder} is not there: test of files compressed by ${compression} skipped`);
      continue;
    }
    await writeWall(path, { compression });
    const opened = await tab.openFiles(path);
    assert.deepEqual([opened.message, opened.objects, opened.allTriangles], ["", 38, 38 * 12], compression);
    const front = `page.lookFrom([0, 3, 25], [0, 3, 0])`;
    const all = await tab.judged(`page.chooseStages(["frustum"]); ${front}`);
    assert.deepEqual([all.visible, all.check.shown, all.check.wrongPixels], [38, 2, 0], compression);
    const culled = await tab.judged(`page.chooseStages(["frustum", "zbuffer"]); ${front}`);
    const { visible, check, triangles } = culled;
    assert.deepEqual([visible, check.shown, check.wrongPixels, triangles], [2, 2, 0, 24], compression);
    await save(tab, `wall-${compression}`);
  }
}

/** A model with a picture, whose decoded form is freed, and one without after it: WebGL reports no error. */
async function textures(tab) {
  const path = `${pictures}/textured.glb`;
  for (const picture of [true, false]) {
    await writeWall(path, { picture });
    const { message, objects, check } = await tab.openFiles(path).then(() => tab.judged(""));
    assert.deepEqual([message, objects, check.wrongPixels], ["", 38, 0]);
    const details = await tab.page.$eval("#details", ({ textContent }) => textContent);
    assert.equal(/pictures/.test(details), picture, details);
    const error = await tab.page.evaluate(`document.getElementById("canvas").getContext("webgl2").getError()`);
    assert.equal(error, 0, `WebGL's error after a model ${picture ? "with" : "without"} a picture`);
  }
}

/** Where pictures take long, the page does not wait for those of a check, unless a person asks for it. */
async function slowPictures(tab) {
  await tab.act(`page.toggle("measure", true)`);
  await tab.until("page.state.check !== null");
  // A new load forgets that a person has asked. Its pictures seem to take 2 seconds.
  await tab.page.evaluate(`{
    const status = WebGL2RenderingContext.prototype.getSyncParameter;
    const begun = new WeakMap();
    WebGL2RenderingContext.prototype.getSyncParameter = function (sync, name) {
      if (!begun.has(sync)) begun.set(sync, performance.now());
      return performance.now() - begun.get(sync) < 2000 ? this.UNSIGNALED : status.call(this, sync, name);
    };
  }`);
  await writeWall(`${pictures}/wall.glb`);
  await tab.openFiles(`${pictures}/wall.glb`);
  await tab.until("!page.toggles.measure");
  assert.equal((await tab.act()).check, null, "nothing is compared");
  const asked = await tab.judged("");
  assert.equal(asked.check.wrongPixels, 0, "a check that a person asks for");
}

/** The horizon, and cullers in workers: none hides what is seen, also while the camera moves on. */
async function workers(tab) {
  await writeWall(`${pictures}/wall.glb`);
  const { stages } = await tab.openFiles(`${pictures}/wall.glb`);
  assert.deepEqual(stages, ["frustum", "late"], "a file's occluders are made in a worker");
  const from = (x) => `page.lookFrom([${x}, 3, 25], [${x}, 3, 0])`;
  await tab.act(from(0));
  await tab.until(`page.state.workers.answers[0][1].isUsed && page.state.visible === 2`);
  const right = (state, at) =>
    assert.deepEqual([state.check.wrongPixels, state.check.wrongObjects], [0, 0], at);
  right(await tab.judged(""), "a z-buffer in a worker");
  await save(tab, "worker");
  // The first frame from a new place has an answer for the former at most.
  for (const x of [0.01, 8, -6]) right(await tab.judged(from(x)), `a z-buffer in a worker, from x = ${x}`);
  await tab.act(`page.chooseStages(["frustum", "bake"]); ${from(0)}`);
  await tab.until(`page.state.workers.box && page.state.visible < 38`);
  const baked = await tab.judged("");
  right(baked, "a bake in a worker");
  assert.ok(baked.visible >= 2 && baked.workers.box.hidden > 20, `the bake leaves ${baked.visible}`);
  await tab.act(`page.toggle("above", true)`);
  await save(tab, "baked-above");
  await tab.act(`page.toggle("above", false)`);
  const horizon = await tab.judged(`page.chooseStages(["frustum", "horizon"])`);
  right(horizon, "the horizon");
  assert.equal(horizon.visible, 2, "objects that the horizon leaves");
}

/** What a box around the eye sees: the counts of sweep, rays and proofs add up, and none contradicts another. */
async function boxes(tab) {
  const sees = async (statement, name) => {
    await tab.act(statement);
    await tab.act(`page.toggle("region", true)`);
    await tab.until(`page.state.region || page.state.errors > 0`);
    const { region, objects, visible, errors } = await tab.act();
    assert.equal(errors, 0, `${name}: errors`);
    assert.equal(await tab.page.evaluate("page.toggles.above"), true, `${name}: shown from above`);
    assert.equal(region.wrong, 0, `${name}: seen by a ray, and hidden by the sweep`);
    assert.equal(region.seen + region.hidden + region.open, region.swept, `${name}: ${JSON.stringify(region)}`);
    assert.ok(region.swept <= objects, `${name}: ${JSON.stringify(region)}`);
    await save(tab, name);
    await tab.act(`page.toggle("region", false); page.toggle("above", false)`);
    return { ...region, visible };
  };
  const pressed = await tab.page.evaluate(`page.state.loading = true; page.toggle("region", true);
    page.state.loading = false; document.getElementById("region").getAttribute("aria-pressed")`);
  assert.equal(pressed, "false", "the button of a look that is refused");
  const office = await sees(`page.chooseStages(["frustum", "zbuffer"]); page.goTo(0)`, "office-box");
  assert.ok(office.seen > 10 && office.swept < 600 && office.hidden > 10, `office: ${JSON.stringify(office)}`);
  await writeWall(`${pictures}/wall.glb`);
  await tab.openFiles(`${pictures}/wall.glb`);
  // 36 boxes are behind the wall as seen from near the middle of its front; the wall and the red box are not.
  const front = `page.chooseStages(["frustum"]); page.lookFrom([0, 3, 10], [0, 3, 0])`;
  const wall = await sees(front, "wall-box");
  assert.deepEqual([wall.seen, wall.swept - wall.hidden], [2, 2], `wall: ${JSON.stringify(wall)}`);
  // From behind, nothing hides them all.
  const behind = await sees(`page.lookFrom([0, 3, -30], [0, 3, 0])`, "wall-box-behind");
  assert.ok(behind.seen > 10, `behind: ${JSON.stringify(behind)}`);
}

/** Surfaces of one side whose node, or whose instance, is mirrored: the library has the sides of the picture. */
async function mirrors(tab) {
  const path = `${pictures}/mirrored.glb`;
  const from = (z) => `page.chooseStages(["frustum", "zbuffer"]); page.lookFrom([0, 3, ${z}], [0, 3, 0])`;
  for (const instance of [null, false, true]) {
    for (const node of [false, true]) {
      await writeMirrored(path, { node, instance });
      await tab.openFiles(path);
      // As three.js draws instances: a mirrored one shows its front towards -z.
      for (const z of [25, -25]) {
        const isFront = z > 0 !== Boolean(instance);
        const at = `mirrored node: ${node}, instance: ${instance}, from z = ${z}`;
        const state = await tab.judged(from(z));
        assert.deepEqual([state.check.wrongPixels, state.check.wrongObjects], [0, 0], at);
        assert.equal(state.visible, isFront ? 2 : 3, `objects drawn: ${at}`);
      }
    }
  }
}

/** Cameras that look straight down: one of a file, and that of a person. */
async function straightDown(tab) {
  const path = (name) => `${pictures}/${name}`;
  await writeWall(path("wall.glb"));
  await tab.openFiles(path("wall.glb"));
  const down = await tab.judged(`page.chooseStages(["frustum"]); page.lookFrom([0, 9, -8], [0, 0, -8])`);
  assert.deepEqual([down.check.wrongPixels, down.check.wrongObjects], [0, 0], "straight down");
  assert.ok(down.check.shown > 5, `${down.check.shown} objects show`);
  // A person who takes over from there looks a little ahead.
  await tab.page.focus("#canvas");
  await tab.page.keyboard.press("w");
  const { camera } = await tab.act();
  const level = Math.hypot(camera.target[0] - camera.eye[0], camera.target[2] - camera.eye[2]);
  assert.ok(level > 0.01, `the camera looks ${level} aside of straight down`);

  await writeMirrored(path("mirrored.glb"));
  await tab.openFiles(path("mirrored.glb"));
  const own = await tab.judged(`page.chooseStages(["frustum"]); page.goTo(0)`);
  assert.deepEqual([own.check.wrongPixels, own.check.wrongObjects], [0, 0], "the camera of the file");
  assert.deepEqual(
    own.camera.up.map((x) => Math.round(x) + 0),
    [0, 0, -1],
    "its upper edge is towards -z",
  );
}

/** What is drawn whatever the cullers find counts for the size of the model, and is freed with it. */
async function looseObjects(tab) {
  await writePoints(`${pictures}/points.glb`);
  const { objects, camera } = await tab.openFiles(`${pictures}/points.glb`);
  const distance = Math.hypot(...camera.eye);
  assert.equal(objects, 0);
  assert.ok(distance > 50 && distance < 150, `the camera is ${distance} from the middle of 100 m of points`);
  const freed = await tab.page.evaluate(async () => {
    const {
      Bone,
      BoxGeometry,
      BufferAttribute,
      Group,
      Mesh,
      MeshStandardMaterial,
      Skeleton,
      SkinnedMesh,
      Texture,
    } = await import("three");
    const { makeModel } = await import("./items.js");
    const count = [];
    const counted = (name, object) => {
      object.addEventListener("dispose", () => count.push(name));
      return object;
    };
    const make = (name) => {
      const material = counted(`material of ${name}`, new MeshStandardMaterial());
      material.clearcoatMap = material.map = counted(`picture of ${name}`, new Texture());
      return [counted(`geometry of ${name}`, new BoxGeometry()), material];
    };
    const skinned = new SkinnedMesh(...make("bones"));
    for (const name of ["skinIndex", "skinWeight"])
      skinned.geometry.setAttribute(name, new BufferAttribute(new Float32Array(4 * 24), 4));
    skinned.bind(new Skeleton([new Bone()]));
    skinned.skeleton.computeBoneTexture();
    counted("texture of bones", skinned.skeleton.boneTexture);
    const mesh = new Mesh(...make("item"));
    const model = await makeModel(new Group().add(skinned, mesh), () => {});
    model.dispose();
    return [...new Set(count)].sort();
  });
  assert.deepEqual(freed, [
    "geometry of bones",
    "material of bones",
    "picture of bones",
    "picture of item",
    "texture of bones",
  ]);
}

/** Vertices far from their node's origin: boxes hold where the card puts them, and they hide nothing. */
async function farVertices(tab) {
  const found = await tab.page.evaluate(async () => {
    const { BoxGeometry, Group, Mesh, MeshStandardMaterial } = await import("three");
    const { load } = await import("../package/visibility.js");
    const { Culling } = await import("./culling.js");
    const { makeModel } = await import("./items.js");
    const visibility = await load();
    const results = [];
    for (const far of [0, 2 ** 22]) {
      const mesh = new Mesh(new BoxGeometry().translate(0, far, 0), new MeshStandardMaterial());
      mesh.position.y = -far;
      const model = await makeModel(new Group().add(mesh), () => {});
      const culling = Culling.ofModel(visibility, model);
      culling.choose(["frustum", "zbuffer"], { height: 360, pixels: 0, size: 1, near: 0.1 });
      await culling.makeOccluders(() => {});
      results.push({ height: model.bounds[4] - model.bounds[1], made: culling.occluders.made });
      culling.destroy();
    }
    return results;
  });
  const [near, far] = found;
  assert.equal(near.made, 1);
  assert.ok(near.height >= 1 && near.height < 1.001, `the box is ${near.height} high`);
  // Single-precision numbers up to 2^23 are half a metre apart: the card moves both ends by up to a quarter.
  assert.equal(far.made, 0);
  assert.ok(far.height >= 1.5, `the box of far vertices is ${far.height} high`);
}

/** A report is not disturbed by what a person does meanwhile. */
async function reports(tab) {
  await writeWall(`${pictures}/wall.glb`);
  await tab.openFiles(`${pictures}/wall.glb`);
  await tab.act(`page.chooseStages(["frustum", "size", "zbuffer"])`);
  const rows = (report) =>
    [...report.matchAll(/<tr><td>([^<]*)<\/td><td>([\d,]+)<\/td>\s*<td>([\d,]+)/g)].map(([, ...row]) => row);
  const alone = rows(await tab.page.evaluate(`page.report()`));
  await tab.page.evaluate(`window.made = page.report(); 0`);
  await tab.page.evaluate(`page.chooseStages(["frustum"])`);
  await tab.page.setViewport({ ...WIDE, height: 300 });
  await tab.act(`page.chooseScene("city")`);
  const again = await tab.page.evaluate(`page.report()`);
  assert.equal(again, null, "one report at a time");
  const disturbed = rows(await tab.page.evaluate(`window.made`));
  assert.equal(alone.length, 3);
  assert.deepEqual(disturbed, alone);
  const after = await tab.act();
  assert.deepEqual([after.scene, after.objects, after.stages.length], ["wall.glb", 38, 3]);
  const opened = await tab.act(`page.chooseScene("city")`);
  await tab.until(`page.state.scene === "city" && !page.state.loading`);
  assert.equal(opened.message ?? "", "", "scenes can be chosen again");
}

/** Files that are no model: a message, and the former model stays. */
async function refusals(tab) {
  const path = (name) => `${pictures}/${name}`;
  const bytes = await writeWall(path("wall.glb"));
  await writeFile(path("cut.glb"), bytes.subarray(0, 900));
  await writeFile(path("text.glb"), "This is no model.");
  await writeFile(path("other.gltf"), `{"asset":{"version":"1.0"}}`);
  await writeFile(path("empty.glb"), "");
  await writeFile(
    path("lacks.gltf"),
    `{"asset":{"version":"2.0"},"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0}],"buffers":[{"uri":"away.bin","byteLength":36}],` +
      `"bufferViews":[{"buffer":0,"byteLength":36}],"accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"}],` +
      `"meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}]}`,
  );
  for (const [name, message] of [
    ["cut.glb", /cut off/],
    ["text.glb", /no glTF model/],
    ["other.gltf", /cannot be read/],
    ["empty.glb", /is empty/],
    ["lacks.gltf", /away\.bin/],
  ]) {
    const refused = await tab.openFiles(path(name));
    assert.match(refused.message, message);
    assert.deepEqual([refused.objects, refused.errors], [779, 0], `${name}: the former model stays`);
  }
  await save(tab, "refused");
  // No address in a file is fetched, not even from this host.
  await writeElsewhere(path("elsewhere.gltf"), `${server.address}scenes.wasm`);
  const elsewhere = await tab.openFiles(path("elsewhere.gltf"));
  assert.match(elsewhere.message, /scenes\.wasm: drop these/);
  assert.equal(elsewhere.objects, 779, "the former model stays");
  await writeElsewhere(path("percent.gltf"), "100%.bin");
  const percent = await tab.openFiles(path("percent.gltf"));
  assert.match(percent.message, /100%\.bin: drop these/, "a name with a percent sign");
  await writeElsewhere(path("picture.gltf"), null, "https://pictures.example/a.ktx2");
  const { objects, errors } = await tab.openFiles(path("picture.gltf"));
  assert.deepEqual([objects, errors], [1, 0], "a model whose picture is missing");
  // Only that an address is missing may be said there.
  tab.complaints = tab.complaints.filter(
    (text) => !/data:,|lacks|away\.bin|Couldn't load texture/.test(text),
  );
}

/** Files that are dropped on the page: a model, one with its buffer, whose triangle has no area, and none. */
async function drops(tab) {
  const path = (name) => `${pictures}/${name}`;
  await writeWall(path("wall.glb"));
  await writeFile(path("apart.bin"), new Uint8Array(new Float32Array([0, 0, 0, 1, 1, 0, 2, 2, 0]).buffer));
  await writeFile(
    path("apart.gltf"),
    JSON.stringify({
      asset: { version: "2.0" },
      scenes: [{ nodes: [0] }],
      nodes: [{ mesh: 0 }],
      meshes: [{ primitives: [{ attributes: { POSITION: 0 } }] }],
      accessors: [
        { bufferView: 0, componentType: 5126, count: 3, type: "VEC3", min: [0, 0, 0], max: [2, 2, 0] },
      ],
      bufferViews: [{ buffer: 0, byteLength: 36 }],
      buffers: [{ uri: "apart.bin", byteLength: 36 }],
    }),
  );
  const isHintShown = () => tab.page.$eval("#drop", (hint) => !hint.hidden);
  const over = async () => assert.equal(await isHintShown(), true, "a hint while files are over the page");
  const opened = await tab.dropFiles([path("wall.glb")], over);
  assert.deepEqual([opened.message, opened.scene, opened.objects], ["", "wall.glb", 38]);
  assert.equal(await isHintShown(), false, "no hint after the drop");
  // Chromium tells a drag that leaves the page to no test.
  const leave = (type) => tab.page.evaluate(`dispatchEvent(new DragEvent("${type}"))`);
  await leave("dragenter");
  await over();
  await leave("dragleave");
  assert.equal(await isHintShown(), false, "no hint after a drag that leaves");
  // The browser has not gone to the file in place of the page.
  assert.match(tab.page.url(), /^http/);
  const none = await tab.dropFiles([]);
  assert.deepEqual([none.message, none.scene, none.errors], ["", "wall.glb", 0], "a drop without files");
  const alone = await tab.dropFiles([path("apart.gltf")]);
  assert.match(alone.message, /apart\.bin: drop these together/);
  for (const names of [
    ["apart.gltf", "apart.bin"],
    ["apart.bin", "apart.gltf"],
  ]) {
    const both = await tab.dropFiles(names.map(path));
    assert.deepEqual([both.message, both.scene, both.objects], ["", "apart.gltf", 1], names.join());
    const flat = await tab.act(`page.chooseStages(["frustum", "zbuffer", "horizon"])`);
    assert.deepEqual([flat.message, flat.errors, flat.visible], ["", 0, 1], "a mesh that can hide nothing");
    await tab.dropFiles([path("wall.glb")]);
  }
  tab.complaints = tab.complaints.filter((text) => !/data:,|apart\.bin|Couldn't load/.test(text));
}

/** Workers with a module that they are given: a whole one, whose regions the small one does not tell, and none. */
async function givenModules(tab) {
  const answer = (module) =>
    tab.page.evaluate(`(async () => {
      const { LateScene, startWorker } = await import("../package/late.js");
      const { load } = await import("../package/visibility.js");
      const wasm = ${module};
      const worker = startWorker({ frames: true, wasm });
      const scene = new LateScene((await load({ frames: true })).createScene(), [worker]);
      const [lamp] = scene.insertAll({ bounds: [2, 2, 2, 3, 3, 3] });
      const asked = { what: "region", min: [-1, -1, -1], max: [1, 1, 1] };
      const found = await new Promise((resolve) => scene.ask(asked, resolve));
      scene.destroy();
      return [found && [...found.bits], scene.refusals];
    })()`);
  const fetched = `await (await fetch("../package/visibility.wasm")).arrayBuffer()`;
  assert.deepEqual(await answer(`await WebAssembly.compile(${fetched})`), [[1], []], "a compiled module");
  assert.deepEqual(await answer(fetched), [[1], []], "bytes");
  const [none, [refusal]] = await answer(`new Uint8Array(8)`);
  assert.equal(none, null);
  assert.match(refusal, /library is not loaded.*WebAssembly/, "bytes that are no module");
  const [small, [lack]] = await answer("undefined");
  assert.deepEqual([small, /whole module|frames/.test(lack)], [null, true], `by the small module: ${lack}`);
}

/** What a person does before the library is there: keys do no harm, a file is shown in place of the scene. */
async function early() {
  const path = (name) => `${pictures}/${name}`;
  await writeWall(path("wall.glb"));
  await writeFile(path("empty.glb"), "");
  for (const [name, scene] of [
    ["wall.glb", "wall.glb"],
    ["empty.glb", "office"],
  ]) {
    const act = async ({ page }) => {
      for (const key of ["c", "z", "v", "v", "f", "f"]) await page.keyboard.press(key);
      await (await page.$("#file")).uploadFile(path(name));
    };
    const shown = async (tab) => {
      await tab.until(`page.state.objects > 0`);
      const { scene: present, errors, message } = await tab.act();
      assert.deepEqual([present, errors], [scene, 0], `${name}: ${message}`);
    };
    await inTab(OFFICE, shown, WIDE, act);
  }
}

/** Keys, mouse and touch. */
async function input(tab) {
  const { page } = tab;
  const before = await tab.act();
  assert.ok((await tab.act()).key > before.key, "the tour goes on");
  await page.focus("#canvas");
  await page.keyboard.down("w");
  await tab.act();
  await page.keyboard.up("w");
  const flown = await tab.act();
  assert.equal(await page.evaluate("page.toggles.walk"), false, "a key ends the tour");
  assert.notDeepEqual(flown.camera.eye, before.camera.eye, "a key moves the camera");
  await page.mouse.move(300, 180);
  await page.mouse.down();
  await page.mouse.move(400, 180, { steps: 4 });
  await page.mouse.up();
  const turned = await tab.act();
  assert.deepEqual(turned.camera.eye, flown.camera.eye, "looking around does not move");
  assert.notDeepEqual(turned.camera.target, flown.camera.target, "a drag turns the camera");
  await page.mouse.wheel({ deltaY: -300 });
  const wheeled = await tab.act();
  assert.notDeepEqual(wheeled.camera.eye, turned.camera.eye, "the wheel moves the camera");
  for (const [key, name] of Object.entries({ v: "above", x: "ghosts", f: "freeze", m: "measure" })) {
    const was = await page.evaluate(`page.toggles.${name}`);
    await page.keyboard.press(key);
    assert.equal(await page.evaluate(`page.toggles.${name}`), !was, `key ${key}`);
    await page.keyboard.press(key);
  }
  const { stages } = await tab.act();
  await page.keyboard.press("c");
  assert.notDeepEqual((await tab.act()).stages, stages, "a key takes the next culler");
}

/** A phone's screen and fingers. */
async function phone(tab) {
  const rectangle = (selector) =>
    tab.page.$eval(selector, (element) => {
      const { top, bottom, left, right } = element.getBoundingClientRect();
      return { top, bottom, left, right };
    });
  const [picture, panel] = [await rectangle("#canvas"), await rectangle("#panel")];
  assert.ok(panel.top >= picture.bottom - 1, "no panel is over the picture");
  assert.ok(picture.bottom > 400 && panel.bottom <= 845 && panel.right <= 391, "both are on the screen");
  const drag = async (x) => {
    const from = await tab.act();
    const touch = await tab.page.touchscreen.touchStart(x, 300);
    await touch.move(x, 240);
    await tab.act();
    await touch.end();
    return [from.camera, (await tab.act()).camera];
  };
  const [standing, pushed] = await drag(80);
  assert.notDeepEqual(pushed.eye, standing.eye, "a finger on the left half moves the camera");
  const [ahead, aside] = await drag(320);
  assert.deepEqual(aside.eye, ahead.eye, "a finger on the right half does not move the camera");
  assert.notDeepEqual(aside.target, ahead.target, "a finger on the right half turns the camera");
  await save(tab, "phone");
}

try {
  const tests = [
    [files, OFFICE],
    [compressed, OFFICE],
    [textures, OFFICE],
    [slowPictures, OFFICE],
    [workers, OFFICE],
    [boxes, OFFICE],
    [mirrors, OFFICE],
    [straightDown, OFFICE],
    [looseObjects, OFFICE],
    [farVertices, OFFICE],
    [reports, OFFICE],
    [refusals, OFFICE],
    [drops, OFFICE],
    [givenModules, OFFICE],
    [input, "scene=office&full"],
    [phone, OFFICE, PHONE],
  ];
  const isWanted = ({ name }) => !part || name === part;
  if (isWanted(builtInScenes)) await builtInScenes();
  if (isWanted(early)) await early();
  for (const [test, query, viewport] of tests) if (isWanted(test)) await inTab(query, test, viewport);
  assert.deepEqual(complaints, [], "the console has no errors");
  console.log(`the page in ${await browser.version()}: as native; pictures in ${pictures}`);
} finally {
  await browser.close();
  server.close();
}
