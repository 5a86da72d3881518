// Meshes and instances that three.js leaves out, although they are in view: by bounding spheres that do not
// hold them.
//
// three.js draws a mesh if its bounding sphere meets the frustum. The sphere may be an old one: where
// instances move, or vertices are written, only the program renews it. And three.js scales its radius by the
// longest column of the mesh's matrix, which is too little for a matrix that shears. A mesh that is left out so
// hides nothing.
//
// An object that three.js leaves out is either truly beside the view, or its sphere does not hold it. A
// second sphere tells these apart: it holds the vertices as they are now, and its radius is scaled by enough.

import { Frustum, Matrix4, Sphere, WebGLCoordinateSystem } from "three";
import { place } from "./boxes.js";

const matrix = new Matrix4();
const localFrustum = new Frustum();
const sphere = new Sphere();

/** Sets a frustum to that of a camera, as three.js does. With `world` it is in coordinates of that matrix. */
function setFrustum(frustum, camera, world) {
  matrix.multiplyMatrices(camera.projectionMatrix, camera.matrixWorldInverse);
  if (world) matrix.multiply(world);
  const { coordinateSystem = WebGLCoordinateSystem, reversedDepth } = camera;
  return frustum.setFromProjectionMatrix(matrix, coordinateSystem, reversedDepth);
}

/** Returns the frustum of a camera, in the world. */
export function frustumOf(camera) {
  return setFrustum(new Frustum(), camera, null);
}

/**
 * Whether three.js leaves out an entry, or an instance of it, that may be in a camera's frustum. `frustum` is
 * that of the camera. Objects for whose index `isVisible` is false are passed over.
 */
export function isLeftOut(entry, camera, frustum, isVisible) {
  const { object, shape, many, count, index } = entry;
  if (many === null && !isVisible(index)) return false;
  const isDrawn = !object.frustumCulled || isMet(object, frustum);
  // Batches look at each of their instances, in the coordinates of the batch.
  const isByInstance = object.isBatchedMesh && object.perObjectFrustumCulled;
  if (isDrawn && !isByInstance) return false;
  if (isDrawn) setFrustum(localFrustum, camera, object.matrixWorld);
  for (let i = 0; i < count; i++) {
    if (many !== null && !isVisible(many.indices[i])) continue;
    const own = (many?.shapes?.[i] ?? shape).sphere;
    // Shapes without a sphere have no triangles that hide.
    if (own === null || (isDrawn && isInstanceDrawn(object, i))) continue;
    place(entry, i, matrix);
    sphere.center.copy(own.center).applyMatrix4(matrix);
    sphere.radius = own.radius * stretchOf(matrix);
    if (frustum.intersectsSphere(sphere)) return true;
  }
  return false;
}

/** What three.js asks of a mesh: as of r187 the mesh itself, before that the frustum. */
function isMet(object, frustum) {
  return object.intersectsFrustum?.(frustum) ?? frustum.intersectsObject(object);
}

/** Whether a `BatchedMesh` draws an instance, by its sphere. */
function isInstanceDrawn(object, i) {
  object.getBoundingSphereAt(object.getGeometryIdAt(i), sphere);
  return localFrustum.intersectsSphere(sphere.applyMatrix4(object.getMatrixAt(i, matrix)));
}

/**
 * Returns how many times longer a matrix makes a vector at most: exactly that if its columns are at right
 * angles, else more. The square of it is the greatest eigenvalue of the matrix of all products of two columns.
 * That is at most the greatest sum of a row of them, without their signs (Gershgorin's circles).
 */
function stretchOf({ elements: e }) {
  const product = (i, j) => Math.abs(e[i] * e[j] + e[i + 1] * e[j + 1] + e[i + 2] * e[j + 2]);
  const [xy, yz, zx] = [product(0, 4), product(4, 8), product(8, 0)];
  return Math.sqrt(Math.max(product(0, 0) + xy + zx, product(4, 4) + xy + yz, product(8, 8) + yz + zx));
}
