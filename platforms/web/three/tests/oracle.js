// What a camera sees of a scene, by rays: each object, and each instance, that a ray from the camera meets.

import { Raycaster, Vector2, Vector3 } from "three";

/**
 * Returns [object, instance] of all that `columns` times `rows` rays of a camera meet before an opaque
 * surface.
 */
export function seenBy(scene, camera, columns, rows, random) {
  const objects = [];
  const gather = (object) => {
    if (!object.visible) return;
    if (object.isLOD) object.update(camera);
    if (object.isMesh && object.layers.test(camera.layers)) {
      if (object.isSkinnedMesh || object.isInstancedMesh || object.isBatchedMesh)
        object.computeBoundingSphere();
      if (object.isSkinnedMesh) object.computeBoundingBox();
      objects.push(object);
    }
    object.children.forEach(gather);
  };
  gather(scene);
  const raycaster = new Raycaster();
  raycaster.layers = camera.layers;
  const forward = camera.getWorldDirection(new Vector3());
  const seen = new Map();
  for (let row = 0; row < rows; row++) {
    for (let column = 0; column < columns; column++) {
      const [x, y] = [column, row].map((i, axis) => (2 * (i + random())) / [columns, rows][axis] - 1);
      raycaster.setFromCamera(new Vector2(x, y), camera);
      // Rays of `setFromCamera` begin at the eye, or on the near plane; the picture between near and far.
      const { origin, direction } = raycaster.ray;
      const along = direction.dot(forward);
      const eye = camera.getWorldPosition(new Vector3());
      const depth = origin.clone().sub(eye).dot(forward);
      raycaster.near = Math.max(0, (camera.near - depth) / along);
      raycaster.far = (camera.far - depth) / along;
      for (const { object, instanceId, batchId } of raycaster.intersectObjects(objects, false)) {
        const instance = instanceId ?? batchId ?? 0;
        seen.set(`${object.id} ${instance}`, [object, instance]);
        const { material } = object;
        if (!material.transparent && !material.alphaTest && !material.transmission && material.depthWrite)
          break;
      }
    }
  }
  return [...seen.values()];
}
