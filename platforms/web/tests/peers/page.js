// Scenes of other libraries, each with the culling that its example gives it, and pictures with and without it.

import * as THREE from "three";
import { VisibilityCulling } from "visibility-three";

const PICTURE = { width: 640, height: 360 };
/** Longest time in milliseconds that tiles may take. */
const PATIENCE = 60000;

const renderer = new THREE.WebGLRenderer();
renderer.setSize(PICTURE.width, PICTURE.height);
document.body.append(renderer.domElement);
const pictures = [false, true].map(() => new THREE.WebGLRenderTarget(PICTURE.width, PICTURE.height));
const camera = new THREE.PerspectiveCamera(70, PICTURE.width / PICTURE.height, 0.1, 2000);
const scene = new THREE.Scene();
scene.background = new THREE.Color(0x9db8cc);
const sun = new THREE.DirectionalLight(0xfff2dd, 2.5);
sun.position.set(30, 120, 55);
scene.add(sun, new THREE.HemisphereLight(0xdfeaf5, 0x8a7d6e, 1.5));

let culling, tiles, plugin;

/** Shows a tileset, culled by the plugin of the example. */
async function openTiles(url) {
  const { TilesRenderer } = await import("3d-tiles-renderer");
  const { VisibilityPlugin } = await import("visibility-three/examples/tiles-plugin.js");
  tiles = new TilesRenderer(url);
  // Tilesets have z upwards.
  tiles.group.rotation.x = -Math.PI / 2;
  scene.add(tiles.group);
  tiles.setCamera(camera);
  tiles.setResolution(camera, PICTURE.width, PICTURE.height);
  tiles.registerPlugin((plugin = new VisibilityPlugin({ scene, camera })));
  ({ culling } = plugin);
  await culling.ready;
}

/** Ends the tiles, and the culling with them. */
function closeTiles() {
  tiles.dispose();
  renderer.render(scene, camera);
}

/** Waits until all tiles that the camera needs are there. */
async function settle() {
  const end = performance.now() + PATIENCE;
  let quiet = 0;
  while (quiet < 3) {
    tiles.update();
    await new Promise((resolve) => setTimeout(resolve, 20));
    const { queued, downloading, parsing } = tiles.stats;
    quiet = queued + downloading + parsing === 0 && tiles.loadProgress === 1 ? quiet + 1 : 0;
    if (performance.now() > end) throw new Error(`tiles take too long: ${JSON.stringify(tiles.stats)}`);
  }
}

/** Shows an IFC file, and returns the number of its meshes. */
async function openIfc(text) {
  const { IfcAPI } = await import("web-ifc");
  const { addIfc } = await import("visibility-three/examples/ifc.js");
  const api = new IfcAPI();
  api.SetWasmPath(new URL("node_modules/web-ifc/", location).href, true);
  await api.Init();
  addIfc(api, new TextEncoder().encode(text), scene);
  culling = new VisibilityCulling(scene, camera);
  await culling.ready;
  return meshes().length;
}

function meshes() {
  const found = [];
  scene.traverse((object) => object.isMesh && found.push(object));
  return found;
}

/** Draws the present camera's picture with everything and without what is hidden; counts pixels that differ. */
function draw(spoil = () => {}) {
  const calls = [];
  const pixels = pictures.map((target, i) => {
    culling.enabled = i === 1;
    spoil(i === 1);
    renderer.setRenderTarget(target);
    renderer.render(scene, camera);
    calls.push(renderer.info.render.calls);
    const bytes = new Uint8Array(4 * PICTURE.width * PICTURE.height);
    renderer.readRenderTargetPixels(target, 0, 0, PICTURE.width, PICTURE.height, bytes);
    return new Uint32Array(bytes.buffer);
  });
  renderer.setRenderTarget(null);
  let wrong = 0;
  pixels[0].forEach((pixel, i) => (wrong += Number(pixel !== pixels[1][i])));
  return {
    wrong,
    colors: new Set(pixels[0]).size,
    allCalls: calls[0],
    calls: calls[1],
    stats: { ...culling.stats },
  };
}

/** Compares the two pictures from an eye, in the frame of the tiles that are there. */
function compare(eye, target) {
  camera.position.set(...eye);
  camera.lookAt(...target);
  camera.updateMatrixWorld();
  tiles?.update();
  const { stats } = tiles ?? {};
  const isLoading = Boolean(stats) && stats.queued + stats.downloading + stats.parsing > 0;
  const found = draw();
  renderer.render(scene, camera);
  return { ...found, isLoading };
}

/**
 * Number of pixels that differ if the nearest mesh in front is left out by mistake as well. `name` begins its name, or is
 * "mesh".
 */
function compareWithout(name) {
  const ray = new THREE.Raycaster();
  ray.setFromCamera(new THREE.Vector2(), camera);
  const isNamed = ({ object }) => name === "mesh" || object.name.startsWith(name);
  const { object } = ray.intersectObjects(meshes(), false).find(isNamed);
  const { wrong } = draw((isCulled) => (object.visible = !isCulled));
  object.visible = true;
  return wrong;
}

window.peers = { openTiles, closeTiles, settle, openIfc, compare, compareWithout };
