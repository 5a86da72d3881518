// Cameras of a scene: which culling has each, where the library's origin is for them, and whether their pictures have
// depth.

/** By scene: by camera, the culling that has it. */
const cullings = new WeakMap();
/**
 * Distance along an axis of all eyes from the origin of the library's coordinates, in units of the scene, from which on
 * the origin moves to an eye. At that distance single precision places occluders of 7 units and more to 1/8,192 of
 * their size, and smaller ones whose place it happens to hold.
 */
const FARTHEST_ORIGIN = 1 << 14;

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

/**
 * Returns the origin for a frame as `eye` sees it, where the eyes of `cameras` are followed: the present one, the same
 * array, while one of them is near it or nowhere, else the place of `eye`.
 */
export function originFor(eye, cameras, origin) {
  const isNear = (camera) => {
    const { elements } = camera.eye.matrixWorld;
    return !origin.some((x, k) => Math.abs(elements[12 + k] - x) > FARTHEST_ORIGIN);
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
