// Boxes of meshes and instances in the world, with a margin for the single precision of graphics cards.
//
// A card multiplies vertices by one matrix after the other in single precision: a vertex far from its mesh's
// origin is put beside its place, also where the mesh's matrix brings it near.
//
// How far, with u = 2^-24, the relative error of one rounding. What a product rounds is at most `r` along each
// axis: the sum of |a| |v| over the numbers a of that row of the matrix and the coordinates v, and the
// translation.
//   - A row has 4 terms. Each has a rounded number of the matrix and a rounded multiplication, and at most 3
//     additions round the sum: 5 u r.
//   - The last matrix leads to the camera, which may turn all axes into each other. Let c be the lengths of its
//     columns, those of the mesh's matrix. As vectors, what it makes of coordinates of at most r is at most
//     R = c . r long. Its translation is the place as the camera sees it, less A v: at most R and the distance
//     from the eye. The error is 10 u R, and 5 u of the distance, which is far below a pixel.
//   - An instance has a matrix before that. Its error 5 u r becomes 5 u R, and the last matrix adds 10 u R.
// So the margin is 16 u R. A mesh that is turned, with all coordinates at c, has 10 u of 3 c at most in any
// direction, of which one coordinate of the camera gets 10 sqrt(3) u c = 17 u c.

import { Matrix4 } from "three";

/** The box of nothing: the library never hides an object that has it. */
export const EMPTY = new Float64Array([1, 1, 1, -1, -1, -1]);

/** Returns a box that holds no point: the least corner is at infinity, the greatest at minus infinity. */
export function emptyBox() {
  return new Float64Array([Infinity, Infinity, Infinity, -Infinity, -Infinity, -Infinity]);
}

/** Greatest error of two products, relative to R of the second: 16 u. See above. */
const ROUNDING = 2 ** -20;
/** The same of the products of bones: 30 u, rounded up. See `skinnedBox`. */
const SKIN_ROUNDING = 2 ** -19;
/**
 * An occluder is used if the card and the library together put it beside its place by at most this share of its
 * size: a pixel of a picture 1000 pixels high if the eye is as near as 1/8 of its size. Turned vertices of the
 * tests err by an eighth of the card's margin at most.
 */
const PLACED_TO = 2 ** -13;
/**
 * An occluder with one side is used if the determinant of its matrix is at least this share of the product of
 * the columns' lengths. Below, three.js may find another sign in double precision than the library in single
 * precision: rounding the numbers of a column moves the share by 3 times 2^-24 at most, that of all three
 * columns by 6e-7.
 */
const LEAST_DETERMINANT = 1e-5;

/**
 * Adds an occluder mesh to a scene of the library. Returns its id, or null if the library refuses it, so that it hides
 * nothing: no triangle has an area, or vertices are beyond what is kept.
 */
export function addOccluderMesh(scene, mesh) {
  try {
    return scene.addMesh(mesh);
  } catch (error) {
    if (error?.code === "ARGUMENT") return null;
    throw error;
  }
}

const boneMatrix = new Matrix4();
const bounds = new Float64Array(6);

/**
 * Returns the greatest coordinates by axis, without their signs, that a matrix makes of points whose
 * coordinates are at most `reach`.
 */
export function reachOf({ elements: e }, [x, y, z]) {
  const row = (i) =>
    Math.abs(e[i]) * x + Math.abs(e[4 + i]) * y + Math.abs(e[8 + i]) * z + Math.abs(e[12 + i]);
  return [row(0), row(1), row(2)];
}

/**
 * Returns how far the card may put points beside their place: `reach` are the greatest coordinates, by axis,
 * that the mesh's matrix multiplies.
 */
export function marginOf({ elements: e }, [x, y, z], rounding = ROUNDING) {
  const length = (i) => Math.sqrt(e[i] * e[i] + e[i + 1] * e[i + 1] + e[i + 2] * e[i + 2]);
  return rounding * (length(0) * x + length(4) * y + length(8) * z);
}

/**
 * Writes the matrix in the world of an instance of an entry, or of its one mesh, to `matrix`. Returns how far
 * the card may put its vertices beside their place.
 */
export function place({ object, shape, many }, i, matrix) {
  const { matrixWorld } = object;
  let { reach } = many?.shapes?.[i] ?? shape;
  if (many === null) matrix.copy(matrixWorld);
  else {
    object.getMatrixAt(i, matrix);
    reach = reachOf(matrix, reach);
    matrix.premultiply(matrixWorld);
  }
  return marginOf(matrixWorld, reach);
}

/**
 * Whether single precision places an occluder in a box well enough. `matrix` is relative to the scene's origin: the
 * library rounds its translation to the nearest. `margin` is that of the card. False if a number of the matrix is not
 * finite in single precision.
 */
export function isPlacedWell(boxes, at, { elements: e }, margin) {
  if (!e.every((x) => Number.isFinite(Math.fround(x)))) return false;
  const size = Math.max(boxes[at + 3] - boxes[at], boxes[at + 4] - boxes[at + 1], boxes[at + 5] - boxes[at + 2]);
  const error = Math.hypot(...[12, 13, 14].map((i) => Math.fround(e[i]) - e[i]));
  return margin + error <= PLACED_TO * size;
}

/** Whether single and double precision surely find the same sign of a matrix's determinant. */
export function isSideSure(matrix) {
  const { elements: e } = matrix;
  const length = (i) => Math.hypot(e[i], e[i + 1], e[i + 2]);
  return Math.abs(matrix.determinant()) > LEAST_DETERMINANT * length(0) * length(4) * length(8);
}

/**
 * Writes the box around a box that a matrix of 16 numbers moves, relative to an origin. `margin` is added on
 * all sides. A matrix that is not affine gives a box of NaN.
 */
export function moveBox(out, at, box, e, origin, margin = 0) {
  const isAffine = e[3] === 0 && e[7] === 0 && e[11] === 0 && e[15] === 1;
  for (let i = 0; i < 3; i++) {
    let lower = isAffine ? e[12 + i] - origin[i] - margin : NaN;
    let upper = lower + 2 * margin;
    for (let j = 0; j < 3; j++) {
      const a = e[i + 4 * j] * box[j];
      const b = e[i + 4 * j] * box[3 + j];
      lower += Math.min(a, b);
      upper += Math.max(a, b);
    }
    out[at + i] = lower;
    out[at + 3 + i] = upper;
  }
}

/** Writes a box that holds a skinned mesh: a vertex is within the hull of where its bones would put it. */
export function skinnedBox(mesh, { bones, reach }, out, at, origin) {
  const { skeleton, bindMatrix, bindMatrixInverse, matrixWorld } = mesh;
  // Nobody knows where bones are that are not there.
  if (!(bones.boxes.length <= Math.min(skeleton?.bones.length, skeleton?.boneInverses.length))) {
    out.fill(NaN, at, at + 6);
    return;
  }
  const local = emptyBox();
  const bound = reachOf(bindMatrix, reach);
  let moved = [0, 0, 0];
  bones.boxes.forEach((box, i) => {
    const bone = skeleton.bones[i];
    if (bone) boneMatrix.multiplyMatrices(bone.matrixWorld, skeleton.boneInverses[i]);
    else boneMatrix.copy(skeleton.boneInverses[i]);
    const reachOfBone = reachOf(boneMatrix, bound);
    moved = moved.map((x, k) => Math.max(x, reachOfBone[k]));
    boneMatrix.premultiply(bindMatrixInverse).multiply(bindMatrix);
    moveBox(bounds, 0, box, boneMatrix.elements, [0, 0, 0]);
    for (let k = 0; k < 6; k++) {
      // Weights whose sum is not 1 move the vertex towards the mesh's origin, or away from it.
      const ends = [bounds[k] * bones.least, bounds[k] * bones.greatest];
      local[k] = k < 3 ? Math.min(local[k], ...ends) : Math.max(local[k], ...ends);
    }
  });
  // 5 u for each of the three products before the last, 5 u for weights and their sum, 10 u for the last.
  const weight = Math.max(1, bones.greatest);
  const last = reachOf(
    bindMatrixInverse,
    moved.map((x) => x * weight),
  );
  moveBox(out, at, local, matrixWorld.elements, origin, marginOf(matrixWorld, last, SKIN_ROUNDING));
}
