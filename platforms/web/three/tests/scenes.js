// Scenes for the tests of `visibility-three`.

import * as THREE from "three";
import { load } from "visibility-web";
import { VisibilityCulling } from "../visibility-three.js";
import { render } from "./renderer.js";

const visibility = await load();

/** A generator of numbers from 0 to 1, the same on every machine. */
export function randomOf(seed) {
  let state = seed;
  return () => {
    state = (Math.imul(state, 1664525) + 1013904223) >>> 0;
    return state / 2 ** 32;
  };
}

export const BOX = new THREE.BoxGeometry(1, 1, 1);
export const SPHERE = new THREE.SphereGeometry(0.5, 8, 6);
export const grey = () => new THREE.MeshBasicMaterial();

export function perspective({ x = 0, y = 0, z = 0, near = 0.1, far = 500, fov = 60 } = {}) {
  const camera = new THREE.PerspectiveCamera(fov, 16 / 9, near, far);
  camera.position.set(x, y, z);
  return camera;
}

export async function culled(scene, cameras, options) {
  const culling = new VisibilityCulling(scene, cameras, { visibility, ...options });
  await culling.ready;
  return culling;
}

/** A wall across the view at z = -10, and a lamp behind it. The camera looks along -z. */
export function street({ wall = new THREE.Mesh(BOX, grey()), lamp = new THREE.Mesh(BOX, grey()) } = {}) {
  const scene = new THREE.Scene();
  wall.position.z = -10;
  wall.scale.set(60, 60, 1);
  lamp.position.z = -20;
  scene.add(wall, lamp);
  return { scene, wall, lamp, camera: perspective() };
}

/** Returns whether the lamp of a street is drawn, in the second frame: by then all stands still. */
export async function isLampDrawn(made, options) {
  const { scene, lamp, camera } = made;
  const culling = await culled(scene, camera, options);
  render(scene, camera);
  const { drawn } = render(scene, camera);
  culling.dispose();
  return drawn.has(lamp, 0);
}

/** Three boxes before the wall, side by side, and one behind it. */
export function fourBoxes(material = grey()) {
  const made = street();
  const boxes = new THREE.InstancedMesh(BOX, material, 4);
  const put = (i, x, z) => boxes.setMatrixAt(i, new THREE.Matrix4().makeTranslation(x, 0, z));
  for (let i = 0; i < 4; i++) put(i, 3 * i - 3, i === 0 ? -20 : -8);
  made.scene.add(boxes);
  return { ...made, boxes, put };
}

/** A tube of bones. */
export function snake(between) {
  const geometry = new THREE.CylinderGeometry(0.4, 0.4, 8, 6, 8);
  const { position } = geometry.attributes;
  const [indices, weights] = [[], []];
  for (let i = 0; i < position.count; i++) {
    const at = Math.min(Math.max((position.getY(i) + 4) / 2, 0), 3.99);
    indices.push(Math.floor(at), Math.floor(at) + 1, 0, 0);
    weights.push(1 - (at % 1), at % 1, 0, 0);
  }
  geometry.setAttribute("skinIndex", new THREE.Uint16BufferAttribute(indices, 4));
  geometry.setAttribute("skinWeight", new THREE.Float32BufferAttribute(weights, 4));
  const bones = [];
  for (let i = 0; i < 5; i++) {
    const bone = new THREE.Bone();
    bone.position.y = i === 0 ? -4 : 2;
    bones[i - 1]?.add(bone);
    bones.push(bone);
  }
  const mesh = new THREE.SkinnedMesh(geometry, grey());
  mesh.add(bones[0]);
  mesh.bind(new THREE.Skeleton(bones));
  mesh.rotation.y = between(0, 6);
  return { mesh, bones };
}
