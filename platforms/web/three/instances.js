// Draws some instances of an `InstancedMesh` or `BatchedMesh` for one camera, and leaves the mesh as it was.

import {
  BatchedMesh,
  BufferGeometry,
  InstancedBufferAttribute,
  InstancedMesh,
  Material,
  Sphere,
} from "three";
import { Surface } from "./surfaces.js";

/** Returns how many instances of an `InstancedMesh` are drawn: WebGL takes the whole part, of NaN 0. */
export function countOf({ count }) {
  return Math.max(0, Math.trunc(count) || 0);
}

/**
 * Whether some of a mesh's instances can be left out. If not, it is drawn whole, or hidden whole. `surfaces`
 * are the `Surfaces` of this frame.
 */
export function canLeaveOut(mesh, renderer, surfaces) {
  // WebGPURenderer reads instances elsewhere.
  if (!renderer.isWebGLRenderer) return false;
  if (mesh.isBatchedMesh) return true;
  // Other attributes of instances would have to be put in the order of the matrices, too.
  const { attributes } = mesh.geometry;
  return (
    (!mesh.instanceColor || mesh.instanceColor.array) &&
    // A shader of the user's own may count instances.
    [mesh.material].flat().every((material) => !material || surfaces.now(material) !== Surface.NeverHidden) &&
    !Object.values(attributes).some(
      (a) => a.isInstancedBufferAttribute || a.data?.isInstancedInterleavedBuffer,
    )
  );
}

/** What a carrier is made of: three.js reads its attributes, and draws nothing. */
const NOTHING = new BufferGeometry();
NOTHING.boundingSphere = new Sphere();
const INVISIBLE = new Material();
INVISIBLE.visible = false;

/** Of a place that has no instance yet. */
const NO_INSTANCE = 2 ** 32 - 1;

/**
 * The visible instances of an `InstancedMesh`, in their order, since it decides what is seen where surfaces meet: in
 * attributes of their own, so that shadows and other cameras draw all of them.
 * Of one renderer: changes are marked in the attributes until it has sent them to its graphics card.
 */
export class InstanceOrder {
  constructor(count) {
    this.count = count;
    this.visible = 0;
    /** Instance by place. */
    this.instances = new Uint32Array(count).fill(NO_INSTANCE);
    this.matrices = this.colors = null;
    /** The renderer sends these attributes to the graphics card when it meets this among what it may draw. */
    this.carrier = new InstancedMesh(NOTHING, INVISIBLE, 0);
    this.carrier.boundingSphere = NOTHING.boundingSphere;
    this.carrier.frustumCulled = false;
    this.carrier.layers.enableAll();
  }

  /** Takes over the content of the mesh's attributes, where it has changed. */
  update({ instanceMatrix, instanceColor }) {
    if (this.matrices?.from !== instanceMatrix || this.colors?.from !== (instanceColor ?? undefined)) {
      // Frees the buffers of both attributes on the graphics card. The renderer binds buffers anew only where an
      // attribute that the shader reads is another, and a shader may read no colours: both become others.
      this.carrier.dispose();
      this.matrices = this.colors = null;
    }
    this.matrices = this.#copy(this.matrices, instanceMatrix);
    this.colors = instanceColor && this.#copy(this.colors, instanceColor);
    this.carrier.instanceMatrix = this.matrices;
    this.carrier.instanceColor = this.colors;
  }

  #copy(copy, from) {
    const { array, itemSize, normalized, version } = from;
    if (copy?.fromVersion === version) return copy;
    const content = array.slice(0, this.count * itemSize);
    copy ??= new InstancedBufferAttribute(new array.constructor(content.length), itemSize, normalized);
    Object.assign(copy, { from, fromVersion: version, content, usage: from.usage });
    this.instances.fill(NO_INSTANCE);
    return copy;
  }

  /** Takes the instances for which `isVisible` is true. */
  sort(isVisible) {
    let [place, begin, end] = [0, this.count, 0];
    for (let instance = 0; instance < this.count; instance++) {
      if (!isVisible(instance)) continue;
      if (this.instances[place] !== instance) {
        this.instances[place] = instance;
        put(this.matrices, place, instance);
        if (this.colors) put(this.colors, place, instance);
        begin = Math.min(begin, place);
        end = place + 1;
      }
      place++;
    }
    this.visible = place;
    if (begin >= end) return;
    mark(this.matrices, begin, end);
    if (this.colors) mark(this.colors, begin, end);
  }

  /** Gives the mesh these attributes, of the instances that are visible. Returns how to undo it. */
  exchange(mesh) {
    const { instanceMatrix, instanceColor, count } = mesh;
    mesh.instanceMatrix = this.matrices;
    mesh.instanceColor = this.colors;
    mesh.count = this.visible;
    return () => Object.assign(mesh, { instanceMatrix, instanceColor, count });
  }
}

/** Writes an instance's element to a place of an attribute. */
function put({ array, content, itemSize }, place, instance) {
  for (let i = 0; i < itemSize; i++) array[place * itemSize + i] = content[instance * itemSize + i];
}

/** Marks elements of an attribute for the graphics card, beside those that it has not been sent yet. */
function mark(attribute, begin, end) {
  const { itemSize, updateRanges } = attribute;
  const starts = updateRanges.map(({ start }) => start);
  const ends = updateRanges.map(({ start, count }) => start + count);
  const start = Math.min(begin * itemSize, ...starts);
  attribute.clearUpdateRanges();
  attribute.addUpdateRange(start, Math.max(end * itemSize, ...ends) - start);
  attribute.needsUpdate = true;
}

/**
 * Makes an `InstancedMesh` draw the instances that are visible, when `isCamera` holds. Returns how to put it
 * back amid its drawing, and how to end.
 */
export function leaveOutInstances(mesh, order, isCamera) {
  let undo = null;
  const restore = () => {
    undo?.();
    undo = null;
  };
  const end = putCallbacks(mesh, {
    onBeforeRender(renderer, scene, camera) {
      if (isCamera(camera)) undo = order.exchange(mesh);
    },
    onAfterRender: restore,
  });
  return { restore, end };
}

/** Makes a `BatchedMesh` leave out the instances of a list when `isCamera` holds. Returns how to end. */
export function leaveOutOfBatch(mesh, hidden, isCamera) {
  const texture = mesh._matricesTexture;
  const { version } = texture;
  const end = putCallbacks(mesh, {
    onBeforeRender(renderer, scene, camera, ...rest) {
      // Callbacks of other meshes may have changed the batch since it was culled: what has moved may be
      // visible; what they hide or delete stays so.
      const isCulled = isCamera(camera) && mesh._matricesTexture === texture && texture.version === version;
      const isShown = (info) => info?.active && info.visible;
      const left = isCulled ? hidden.filter((i) => isShown(mesh._instanceInfo[i])) : [];
      try {
        // The mesh decides here what it draws, from what is visible: it is made so for that long.
        for (const instance of left) mesh.setVisibleAt(instance, false);
        BatchedMesh.prototype.onBeforeRender.call(mesh, renderer, scene, camera, ...rest);
      } finally {
        for (const instance of left) mesh.setVisibleAt(instance, true);
      }
    },
  });
  return { restore() {}, end };
}

/** Gives a mesh callbacks. Returns how to take them away; those that another has put there since stay. */
function putCallbacks(mesh, callbacks) {
  Object.assign(mesh, callbacks);
  return () => {
    for (const name in callbacks) if (mesh[name] === callbacks[name]) delete mesh[name];
  };
}
