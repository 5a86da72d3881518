// Meshes of a scene and their objects in the library, and what three.js says of them: parts, layers, instances.

import { BatchedMesh, Layers, Mesh, Object3D } from "three";
import { isPlacedWell, isSideSure, place } from "./boxes.js";
import { InstanceOrder, countOf } from "./instances.js";
import { Surface } from "./surfaces.js";

export const NO_IDS = new BigUint64Array(0);

/** The layers of what is hidden: no camera shows them. What is written goes to its own layers. */
export class HiddenLayers extends Layers {
  former = null;
  get mask() {
    return this.former.mask;
  }
  set mask(mask) {
    if (this.former) this.former.mask = mask;
  }
  test() {
    return false;
  }
}

/** A mesh of the scene, and its objects in the library: one, or one for each instance. */
export class Entry {
  constructor(object, slot) {
    // First what each frame looks at, so that it is in one piece of memory.
    this.object = object;
    this.frame = -1;
    /** What the entry was made for; when one of these changes, it is made anew. */
    this.geometry = null;
    this.surface = Surface.NeverHidden;
    this.known = null;
    /** The shape of all instances; of a `BatchedMesh` that of the first. */
    this.shape = null;
    /** Layers that the library has: 0 where the mesh, or what it is part of, is not shown. */
    this.layers = 0;
    /** The origin that the library has it relative to. */
    this.origin = null;
    /** Place of its matrix among those of all entries. */
    this.slot = slot;
    /** What holds the matrices of its instances, and the version that the library has. */
    this.matrices = null;
    this.version = -1;
    /** Number of its objects in the library: 0 if the mesh is never hidden. */
    this.count = 0;
    /** Whether it stands still, but is no occluder yet. */
    this.waits = false;
    /** Index of its object in the library, or of the first of several. */
    this.index = 0;
    /** Its layers while it is hidden. */
    this.hidden = null;
    this.ids = NO_IDS;
    /** Instances of an `InstancedMesh` or a `BatchedMesh`: a `Many`. Null for other meshes. */
    this.many = null;
  }
}

/** The instances of a mesh: their places in the library, and the order in which renderers draw them. */
export class Many {
  /** By renderer that has drawn an `InstancedMesh` in part: its instances, those visible first. */
  #orders = new WeakMap();
  /** Weak references to the same orders: these do not keep a renderer that is not used any more. */
  #known = new Set();

  constructor(count) {
    this.count = count;
    /** For a `BatchedMesh`: part of its geometry, shape and layers of each instance. */
    this.parts = this.shapes = this.layers = null;
    /** Indices of the instances in the library. */
    this.indices = null;
  }

  /** Returns the order of the instances for a renderer. */
  orderOf(renderer) {
    let order = this.#orders.get(renderer);
    if (!order) {
      for (const known of this.#known) if (!known.deref()) this.#known.delete(known);
      this.#orders.set(renderer, (order = new InstanceOrder(this.count)));
      this.#known.add(new WeakRef(order));
    }
    return order;
  }

  /** Frees the buffers that graphics cards have of the orders. */
  dispose() {
    for (const known of this.#known) known.deref()?.carrier.dispose();
  }
}

/** Parts of a geometry that are no parts of a `BatchedMesh`: nothing of it, and all. */
export const [NONE, ALL] = [-1, -2];

/** Returns the part of its geometry that an instance of a `BatchedMesh` has. */
export function partOf({ active, geometryIndex }) {
  return active ? geometryIndex : NONE;
}

/** Returns the layers of an instance: none if the user has hidden it. */
export function layersOf({ object, layers, many }, i) {
  return many?.parts && !(many.parts[i] >= 0 && object._instanceInfo[i].visible) ? 0 : layers;
}

/** Returns the shapes of an entry, each once for each instance that has it. */
export function shapesOf({ shape, many }) {
  return many?.shapes ?? [shape];
}

/**
 * Writes the matrix of an occluder of an entry, relative to the scene's origin, to `matrix`. Returns whether it may
 * hide: it is placed well in its box, which is in `boxes` from `at` on, and hides from the side that is drawn.
 */
export function placeOccluder(entry, i, origin, boxes, at, matrix) {
  const margin = place(entry, i, matrix);
  const { elements } = matrix;
  for (let k = 0; k < 3; k++) elements[12 + k] -= origin[k];
  if (!isPlacedWell(boxes, at, matrix, margin)) return false;
  if (entry.surface === Surface.Double) return true;
  // The graphics card takes the front for the back if an instance is mirrored, beside its mesh.
  const isMirrored =
    entry.many !== null && !(matrix.determinant() * entry.object.matrixWorld.determinant() > 0);
  return !isMirrored && isSideSure(matrix);
}

/** Returns what holds the matrices of instances. */
export function matricesOf({ instanceMatrix, _matricesTexture }) {
  return instanceMatrix ?? _matricesTexture;
}

/** Whether matrices of instances can be read: not when they are on the graphics card alone. */
export function hasMatrices({ instanceMatrix }) {
  return instanceMatrix?.array && !instanceMatrix.isStorageInstancedBufferAttribute;
}

/** Whether there are matrices of all instances of a mesh: a batch that was disposed of has none. */
export function hasInstances(object) {
  // Fields that three.js does not document.
  if (object.isBatchedMesh) return Array.isArray(object._instanceInfo) && object._matricesTexture?.version >= 0;
  return !object.isInstancedMesh || object.instanceMatrix.array.length >= 16 * countOf(object);
}

/**
 * Whether three.js draws a mesh in the usual order, and by matrices and a geometry that can be read: what does not can
 * neither be hidden nor hide others. Whether its material allows that is another matter.
 */
export function isUsual(object) {
  const { geometry, material } = object;
  const usual = object.isBatchedMesh ? BatchedMesh.prototype : Object3D.prototype;
  return (
    geometry?.isBufferGeometry === true &&
    Boolean(material) &&
    object.onBeforeRender === usual.onBeforeRender &&
    object.onAfterRender === usual.onAfterRender &&
    object.intersectsFrustum === Mesh.prototype.intersectsFrustum &&
    object.renderOrder === 0 &&
    geometry.morphAttributes.position === undefined &&
    !object.morphTexture &&
    // Not instances whose matrices are on the graphics card alone, and not instances that have bones.
    !(object.isInstancedMesh && !hasMatrices(object)) &&
    !(object.isSkinnedMesh && matricesOf(object))
  );
}

/** Whether the renderer goes past an object with all that is in it as far as culling is concerned. */
export function isApart({ isBundleGroup, isClippingGroup }) {
  // A bundle records draw calls of the meshes that are visible at that time; a clipping group cuts holes into
  // occluders.
  return isBundleGroup || isClippingGroup;
}

/** Whether a mesh is drawn at several places, or not at all, by a count that is not looked at here. */
export function isCountedElsewhere({ geometry, isInstancedMesh, count = 1 }) {
  return geometry.isInstancedBufferGeometry || geometry.indirect || (!isInstancedMesh && count !== 1);
}

/** Whether a shader draws what planes of the renderer cut. */
export function isUnclipped(material) {
  return material?.isShaderMaterial && !material.clipping;
}
