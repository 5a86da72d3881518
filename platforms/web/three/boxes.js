// Boxes of meshes and instances in the world, with a margin for the single precision of graphics cards.
//
// A card multiplies vertices by one matrix after the other. It rounds each product relative to its greatest
// coordinate: a vertex far from its mesh's origin is put beside its place, also where the mesh's matrix brings
// it near. The margin is the greatest coordinate on the way, times ROUNDING.

import { Matrix4 } from "three";

/** The box of nothing: the library never hides an object that has it. */
export const EMPTY = new Float64Array([1, 1, 1, -1, -1, -1]);

/** Relative error of a single-precision number, with room for the few roundings of a product of matrices. */
const ROUNDING = 2 ** -21;
/**
 * An occluder is used if single precision places it to this share of its size: a pixel if it fills the
 * picture.
 */
const PLACED_TO = 1 / 1024;

const boneMatrix = new Matrix4();
const bounds = new Float64Array(6);

/** Returns the greatest coordinate, without its sign, that a matrix gives to points of at most `reach`. */
function reachOf(matrix, reach) {
  const { elements: e } = matrix;
  const translation = Math.max(Math.abs(e[12]), Math.abs(e[13]), Math.abs(e[14]));
  return matrix.getMaxScaleOnAxis() * reach + translation;
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
  return ROUNDING * reach * matrixWorld.getMaxScaleOnAxis();
}

/** Whether single precision places what is in a box well enough for an occluder. */
export function isPlacedWell(boxes, at, margin) {
  let [size, reach] = [0, 0];
  for (let k = at; k < at + 3; k++) {
    size = Math.max(size, boxes[3 + k] - boxes[k]);
    reach = Math.max(reach, Math.abs(boxes[k]), Math.abs(boxes[3 + k]));
  }
  return Math.max(reach * 2 ** -24, margin) <= PLACED_TO * size;
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
  const local = new Float64Array([Infinity, Infinity, Infinity, -Infinity, -Infinity, -Infinity]);
  const bound = reachOf(bindMatrix, reach);
  let moved = 0;
  bones.boxes.forEach((box, i) => {
    const bone = skeleton.bones[i];
    if (bone) boneMatrix.multiplyMatrices(bone.matrixWorld, skeleton.boneInverses[i]);
    else boneMatrix.copy(skeleton.boneInverses[i]);
    moved = Math.max(moved, reachOf(boneMatrix, bound));
    boneMatrix.premultiply(bindMatrixInverse).multiply(bindMatrix);
    moveBox(bounds, 0, box, boneMatrix.elements, [0, 0, 0]);
    for (let k = 0; k < 6; k++) {
      // Weights whose sum is not 1 move the vertex towards the mesh's origin, or away from it.
      const ends = [bounds[k] * bones.least, bounds[k] * bones.greatest];
      local[k] = k < 3 ? Math.min(local[k], ...ends) : Math.max(local[k], ...ends);
    }
  });
  const margin = ROUNDING * reachOf(bindMatrixInverse, moved * Math.max(1, bones.greatest));
  moveBox(out, at, local, matrixWorld.elements, origin, margin * matrixWorld.getMaxScaleOnAxis());
}
