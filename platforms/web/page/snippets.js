// The lines of code that do in an engine what the page does, for the report.

const STAGE_LINES = {
  frustum: ".addFrustum()",
  size: (height, pixels) => `.addContribution(${height}, ${pixels})`,
  zbuffer: ".addZBuffer()",
  horizon: `.addHorizon({ up: "y" })`,
  ahead: ".addOnline(online)",
  portals: ".addPortals(cells)",
  baked: ".addPvs(baked)",
};

function chain(stages, height, pixels) {
  return stages
    .map((name) => STAGE_LINES[name] ?? "")
    .map((line) => (typeof line === "function" ? line(height, pixels) : line))
    .join("");
}

/** Returns [title, code] for each engine. `stages` are the names of the chosen cullers. */
export function snippets(stages, { height, pixels }) {
  const three = `import { VisibilityCulling } from "visibility-three";

// Once: culls by frustum and z-buffer, and finds the occluders by itself.
const culling = new VisibilityCulling(scene, camera);
await culling.ready;

// Each frame, as ever:
renderer.render(scene, camera);`;
  const online = stages.includes("ahead")
    ? `const online = visibility.createOnline({ viewcell: [0.6, 0.6, 0.6], wide: [4, 4, 4], margin: 0.2 });
// Each frame, before cull: online.step(level, places, 3000);
`
    : "";
  const js = `import { Depth, Flag, load } from "visibility-web";

// Once: boxes of all objects, and the meshes of those that hide others.
const visibility = await load();
const level = visibility.createScene();
const ids = level.insertAll({ bounds, flags: Flag.Occluder });
ids.forEach((id, i) => level.setMesh(id, level.addMesh(meshes[i])));
const view = visibility.createView();
const visible = visibility.createVisible();
${online}const pipeline = visibility.createPipeline()${chain(stages, height, pixels)};

// Each frame:
view.setMatrix(viewProjection, Depth.NegativeOneToOne);
pipeline.cull(level, view, visible);
for (const index of visible.indices) draw(index);`;
  return [
    ["three.js: frustum and z-buffer", three],
    ["Any engine in JavaScript: the cullers chosen here", js],
  ];
}
