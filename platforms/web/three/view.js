// The library's view of a camera of three.js: its matrices, its depth convention, and the renderer's clip planes.

import { Matrix3, Matrix4, WebGPUCoordinateSystem } from "three";
import { Depth, VisibilityError } from "visibility-web";

/** Greatest number of clip planes of a view. */
const MOST_CLIP_PLANES = 10;

/**
 * Share by which near and far plane are moved apart. Graphics cards clip by depths in single precision, each rounded
 * four times by 2^-24 of it.
 */
const DEPTH_MARGIN = 2 ** -21;

const matrix = new Matrix4();

/**
 * Sets a view to a camera of three.js, and returns how: the name of the method of `View`, and its parameters.
 * Null if the camera has no view, such as one whose matrix is NaN, or one of which it is not known which
 * surfaces it draws.
 */
export function setView(view, camera, origin, clippingPlanes) {
  if (clippingPlanes.length > MOST_CLIP_PLANES || !drawsNearestFronts(camera)) return null;
  const [x, y, z] = origin;
  matrix.multiplyMatrices(camera.projectionMatrix, camera.matrixWorldInverse);
  const clip = Float64Array.from(matrix.elements);
  for (let row = 0; row < 4; row++) clip[12 + row] += clip[row] * x + clip[4 + row] * y + clip[8 + row] * z;
  const isZeroToOne = camera.coordinateSystem === WebGPUCoordinateSystem;
  const unreversed = isZeroToOne ? Depth.ZeroToOne : Depth.NegativeOneToOne;
  const depth = camera.reversedDepth ? Depth.Reversed : unreversed;
  // Depths move towards their middle: that of -w and w, or of 0 and w.
  const middle = depth === Depth.NegativeOneToOne ? 0 : 1;
  for (let i = 2; i < 16; i += 4) clip[i] += DEPTH_MARGIN * (middle * clip[i + 1] - 2 * clip[i]);
  const how = ["setMatrix", clip, depth];
  try {
    view.setMatrix(...how.slice(1));
    const planes = clippingPlanes.map(({ normal: n, constant }) => [
      n.x,
      n.y,
      n.z,
      constant + n.x * x + n.y * y + n.z * z,
    ]);
    view.setClipPlanes(planes);
  } catch (error) {
    if (error instanceof VisibilityError && error.code === "ARGUMENT") return null;
    throw error;
  }
  view.setLayers(camera.layers.mask >>> 0);
  return how;
}

/**
 * Whether a camera draws the fronts of meshes, and the nearest of them: by these, occluders hide. A mirrored
 * camera draws the backs, since three.js looks at the matrix of the mesh alone. Where the eye is beyond the near
 * plane, depth shrinks with the distance.
 */
function drawsNearestFronts({ projectionMatrix, matrixWorldInverse, reversedDepth }) {
  const e = projectionMatrix.elements;
  // Determinant of the rows of x, y and w: below 0 for a perspective that is not mirrored, 0 for a parallel
  // projection.
  const picture = new Matrix3().set(e[0], e[4], e[8], e[1], e[5], e[9], e[3], e[7], e[11]).determinant();
  const depth = projectionMatrix.determinant() * (reversedDepth ? -1 : 1);
  const side = matrixWorldInverse.determinant();
  return picture * side <= 0 && depth * side < 0;
}
