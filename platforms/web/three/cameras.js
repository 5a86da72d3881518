// Cameras of a scene: which culling has each, where the library's origin is for them, and whether their pictures have
// depth.

import { Surface } from "./surfaces.js";

/** By scene: by camera, the culling that has it. */
const cullings = new WeakMap();
/**
 * Distance along an axis of all eyes from the origin of the library's coordinates from which on the origin moves to an
 * eye, in sizes of large occluders. Up to there, single precision places these to 2^-13 of their size: a coordinate is
 * rounded by 2^-24 of it at most, the three together by sqrt(3) times that, and 2^10 sqrt(3) 2^-24 < 2^-13.
 */
const FARTHEST_ORIGIN = 1 << 10;
/** Number of occluders whose sizes are looked at, at most. */
const MOST_SIZES = 64;
/** Share of these that are smaller than large ones. What is small hides little, and to place all anew takes long. */
const SMALLER = 0.9;

/**
 * Gives a camera of a scene to a culling. Returns the one that has had it, which must give it up: both would hide the
 * same meshes, and put back what the other has hidden.
 */
export function takeCamera(scene, camera, culling) {
  if (!cullings.has(scene)) cullings.set(scene, new WeakMap());
  const byCamera = cullings.get(scene);
  const former = byCamera.get(camera);
  byCamera.set(camera, culling);
  return former;
}

/** Takes a camera of a scene from a culling, if that has it. */
export function releaseCamera(scene, camera, culling) {
  const byCamera = cullings.get(scene);
  if (byCamera?.get(camera) === culling) byCamera.delete(camera);
}

/** Returns the size of the boxes of large occluders among entries. Infinite if there are none. */
export function largeSize(entries, scene) {
  const occluders = entries.filter(({ surface, count }) => surface > Surface.Hideable && count > 0);
  const sizes = [];
  for (let i = 0; i < occluders.length; i += Math.ceil(occluders.length / MOST_SIZES)) {
    const { min, max } = scene.bounds(occluders[i].ids[0]);
    const size = Math.max(...min.map((low, k) => max[k] - low));
    if (size > 0) sizes.push(size);
  }
  return sizes.sort((a, b) => a - b)[Math.floor(SMALLER * sizes.length)] ?? Infinity;
}

/**
 * Returns the origin for a frame as `eye` sees it, where the eyes of `cameras` are followed: the present one, the same
 * array, while one of them is near it or nowhere, else the place of `eye`. `size` is that of large occluders.
 */
export function originFor(eye, cameras, origin, size) {
  const isNear = (camera) => {
    const { elements } = camera.eye.matrixWorld;
    return !origin.some((x, k) => Math.abs(elements[12 + k] - x) > FARTHEST_ORIGIN * size);
  };
  if (origin && cameras.some(isNear)) return origin;
  return eye.matrixWorld.elements.slice(12, 15).map((x) => (Number.isFinite(x) ? Math.round(x) : 0));
}

/** Whether a renderer draws into a picture with depth. Without, what is drawn last is seen. */
export function hasDepth(renderer, target) {
  if (target) return target.depthBuffer !== false;
  // WebGPURenderer has the first.
  return renderer.depth !== false && renderer.getContextAttributes?.()?.depth !== false;
}
