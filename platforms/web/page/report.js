// A report to keep: one HTML file with pictures, counts over a walk for several sets of cullers, and the
// lines of code that do the same in an engine.

import { STAGES } from "./culling.js";
import { hasItem } from "./items.js";
import { pause } from "./load.js";
import { snippets } from "./snippets.js";

/** Number of cameras of the walk that are counted. */
const CAMERAS = 24;
/** Number of cameras with pictures. */
const PICTURES = 3;
/** Width and height of the pictures in pixels. */
const [WIDTH, HEIGHT] = [960, 540];
/** Times the walk is culled for its mean time: the clocks of browsers are coarse. */
const PASSES = 5;

const whole = (number) => Math.round(number).toLocaleString("en");
const mean = (list) => list.reduce((sum, number) => sum + number, 0) / (list.length || 1);
const escaped = (text) =>
  String(text).replace(
    /[&<>"]/g,
    (letter) => ({ "&": "&amp;", "<": "&lt;", ">": "&gt;", '"': "&quot;" })[letter],
  );

/** Counts of one set of cullers over cameras. */
async function measure({ culling, picture, judge, say }, stages, cameras, settings, label) {
  culling.choose(stages, settings);
  const rows = [];
  for (const [index, camera] of cameras.entries()) {
    say(`Report: ${label}, camera ${index + 1} of ${cameras.length}`);
    culling.cull(camera);
    const { seen } = culling.bits;
    let triangles = 0;
    picture.model.triangles.forEach((count, item) => {
      if (hasItem(seen, item)) triangles += count;
    });
    const judged = judge.compare(picture, camera, seen);
    rows.push({ objects: culling.count, triangles, ...judged });
    await pause();
  }
  let milliseconds = 0;
  for (let pass = 0; pass < PASSES; pass++) {
    for (const camera of cameras) {
      culling.cull(camera);
      milliseconds += culling.milliseconds / (PASSES * cameras.length);
    }
  }
  const total = (name) => rows.reduce((sum, row) => sum + row[name], 0);
  const average = (name) => mean(rows.map((row) => row[name]));
  return {
    label,
    objects: average("objects"),
    triangles: average("triangles"),
    milliseconds,
    surfaces: average("surfaces"),
    shown: average("shown"),
    wrongPixels: total("wrongPixels"),
    wrongObjects: total("wrongObjects"),
    pixels: total("pixels"),
    promise: culling.pipeline.accuracy,
  };
}

/** Pictures of a camera, as data URLs: what is drawn, what was hidden, and both from above. */
function takePictures({ culling, picture, canvas }, camera) {
  culling.cull(camera);
  const { bits } = culling;
  return [
    ["What is drawn", {}],
    ["What is hidden", { ghosts: true }],
    ["From above", { above: picture.size / 2, ghosts: false }],
  ].map(([title, options]) => {
    picture.draw(camera, bits, options);
    return [title, canvas.toDataURL("image/jpeg", 0.85)];
  });
}

/** Makes the report as text. See `saveReport` for what it takes. */
async function makeReport(tools) {
  const { culling, picture, canvas, walk, near, state, visibility } = tools;
  const aspect = WIDTH / HEIGHT;
  const all = Array.from({ length: Math.min(CAMERAS, walk.length) }, (_, i) => {
    const key = walk[Math.floor((i * walk.length) / Math.min(CAMERAS, walk.length))];
    return { ...key, near, aspect };
  });
  const here = { ...state.camera, aspect };
  // Each camera of the report is culled once: a worker's answer would be for another. What the page has in a worker
  // is measured in the frame.
  const inFrame = culling.chosen.map((name) => (name === "late" ? "zbuffer" : name));
  const chosen = inFrame.filter((name, i) => !STAGES.find((stage) => stage.name === name).inWorker && inFrame.indexOf(name) === i);
  const settings = { height: HEIGHT, pixels: state.pixels, size: picture.size, near };
  const title = (name) => STAGES.find((stage) => stage.name === name)?.title.toLowerCase() ?? name;
  culling.choose(chosen, settings);
  await culling.makeOccluders(tools.say);
  const rows = [
    await measure(tools, [], all, settings, "everything"),
    await measure(tools, ["frustum"], all, settings, title("frustum")),
  ];
  if (chosen.join() !== "frustum" && chosen.length > 0)
    rows.push(await measure(tools, chosen, all, settings, chosen.map(title).join(", ")));

  const former = [canvas.width, canvas.height];
  const pictures = [];
  culling.choose(chosen, settings);
  try {
    picture.resize(WIDTH, HEIGHT);
    const step = Math.floor(all.length / PICTURES);
    for (const camera of [here, ...all.filter((_, i) => step > 0 && i % step === 0).slice(0, PICTURES - 1)])
      pictures.push(takePictures(tools, camera));
  } finally {
    picture.resize(...former);
  }
  const [first, last] = [rows[0], rows.at(-1)];
  const text = (row) => `<tr><td>${escaped(row.label)}</td><td>${whole(row.objects)}</td>
    <td>${whole(row.triangles)}</td><td>${row.surfaces.toFixed(2)}</td><td>${row.milliseconds.toFixed(3)}</td>
    <td>${whole(row.wrongPixels)} of ${whole(row.pixels)}</td><td>${whole(row.wrongObjects)}</td><td>${row.promise}</td></tr>`;
  const figures = pictures
    .flat()
    .map(
      ([caption, url]) =>
        `<figure><img src="${url}" alt="${caption}"><figcaption>${caption}</figcaption></figure>`,
    );
  const code = snippets(chosen, settings).map(
    ([heading, lines]) => `<h3>${escaped(heading)}</h3><pre>${escaped(lines)}</pre>`,
  );
  const saved = first.triangles > 0 ? (100 * (1 - last.triangles / first.triangles)).toFixed(1) : 0;
  return `<!doctype html>
<html lang="en"><meta charset="utf-8"><meta name="viewport" content="width=device-width">
<title>Visibility of ${escaped(state.scene)}</title>
<style>
body{font:16px/1.5 system-ui,sans-serif;max-width:75rem;margin:2rem auto;padding:0 1rem;color:#1d242b}
table{border-collapse:collapse;width:100%}td,th{padding:.35rem .6rem;border-bottom:1px solid #ccd3da;text-align:right}
td:first-child,th:first-child,td:last-child,th:last-child{text-align:left}
.pictures{display:grid;grid-template-columns:repeat(3,1fr);gap:.6rem}figure{margin:0}img{width:100%;border-radius:6px}
figcaption{color:#5b6875;font-size:.85rem}pre{background:#f1f4f7;padding:1rem;border-radius:8px;overflow-x:auto}
@media(max-width:700px){.pictures{grid-template-columns:1fr}table{font-size:.75rem}}
</style>
<h1>Visibility of ${escaped(state.scene)}</h1>
<p>${whole(state.objects)} objects with ${whole(state.allTriangles)} triangles. Over ${all.length} cameras of a walk,
${escaped(last.label)} leaves ${whole(last.objects)} objects on average and saves ${saved} % of the triangles;
${whole(last.wrongPixels)} of ${whole(last.pixels)} pixels are wrong. ${whole(last.shown)} solid objects show on average.</p>
<table><tr><th>Cullers</th><th>objects</th><th>triangles</th><th>surfaces a pixel</th><th>ms to cull</th>
<th>wrong pixels</th><th>wrong objects</th><th>promise</th></tr>${rows.map(text).join("\n")}</table>
<p>Objects, triangles, surfaces and times are means over the cameras; wrong pixels and objects are sums. A pixel is
wrong if WebGL shows another object there than when all are drawn.</p>
<h2>Pictures</h2><div class="pictures">${figures.join("\n")}</div>
<p>Orange: hidden behind others. Blue: out of the view.</p>
<h2>The same in an engine</h2>${code.join("\n")}
<p>${new Date().toISOString().slice(0, 10)}, ${escaped(navigator.userAgent)}, module
${visibility.simd128 ? "simd128" : "plain"}.</p></html>`;
}

/** Makes a report of the page's model and lets the browser save it. Returns its text. */
export async function saveReport(tools) {
  const text = await makeReport(tools);
  const url = URL.createObjectURL(new Blob([text], { type: "text/html" }));
  const name = tools.state.scene.replace(/[^\w-]+/g, "-");
  Object.assign(document.createElement("a"), { href: url, download: `visibility-${name}.html` }).click();
  setTimeout(() => URL.revokeObjectURL(url), 60000);
  return text;
}
