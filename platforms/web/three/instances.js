// Draws some instances of an `InstancedMesh` or `BatchedMesh` for one camera, and leaves the mesh as it was.

import {
  BatchedMesh,
  BufferGeometry,
  InstancedBufferAttribute,
  InstancedMesh,
  Material,
  NoBlending,
  NormalBlending,
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
    [mesh.material].flat().every((material) => isUnordered(material, surfaces)) &&
    !Object.values(attributes).some(
      (a) => a.isInstancedBufferAttribute || a.data?.isInstancedInterleavedBuffer,
    )
  );
}

/** Whether a picture is the same in whichever order the instances of a material are drawn. */
function isUnordered(material, surfaces) {
  if (!material) return true;
  const { transparent, depthWrite, blending } = material;
  const isBlended = transparent || !depthWrite || (blending !== NormalBlending && blending !== NoBlending);
  // Blended instances keep the order that the user has chosen. A shader of the user's own may count
  // instances.
  return !isBlended && surfaces.now(material) !== Surface.NeverHidden;
}

/** What a carrier is made of: three.js reads its attributes, and draws nothing. */
const NOTHING = new BufferGeometry();
NOTHING.boundingSphere = new Sphere();
const INVISIBLE = new Material();
INVISIBLE.visible = false;

/**
 * The instances of an `InstancedMesh`, those visible first: in attributes of their own, so that shadows and
 * other cameras draw all of them, in any order.
 * Of one renderer: changes are marked in the attributes until it has sent them to its graphics card.
 */
export class InstanceOrder {
  constructor(count) {
    this.count = count;
    this.visible = 0;
    /** Instance by place. */
    this.instances = Uint32Array.from({ length: count }, (_, i) => i);
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
    const { itemSize, normalized, version } = from;
    if (copy?.fromVersion === version) return copy;
    const length = this.count * itemSize;
    copy ??= new InstancedBufferAttribute(from.array.slice(0, length), itemSize, normalized);
    Object.assign(copy, { from, fromVersion: version, usage: from.usage });
    this.instances.forEach((instance, place) => {
      const at = instance * itemSize;
      for (let i = 0; i < itemSize; i++) copy.array[place * itemSize + i] = from.array[at + i];
    });
    copy.clearUpdateRanges();
    copy.addUpdateRange(0, length);
    copy.needsUpdate = true;
    return copy;
  }

  /** Puts the instances for which `isVisible` is true first, moving as few as possible. */
  sort(isVisible) {
    // Instances that vanish move behind the visible ones; then instances that appear move before the end.
    for (let place = 0; place < this.visible;) {
      if (isVisible(this.instances[place])) place++;
      else this.#swap(place, --this.visible);
    }
    for (let place = this.visible; place < this.count; place++) {
      if (isVisible(this.instances[place])) this.#swap(place, this.visible++);
    }
  }

  #swap(a, b) {
    if (a === b) return;
    const { instances } = this;
    [instances[a], instances[b]] = [instances[b], instances[a]];
    swap(this.matrices, a, b);
    if (this.colors) swap(this.colors, a, b);
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

/** Exchanges two elements of an attribute, and marks them for the graphics card. */
function swap(attribute, a, b) {
  const { array, itemSize } = attribute;
  for (let i = 0; i < itemSize; i++) {
    const number = array[a * itemSize + i];
    array[a * itemSize + i] = array[b * itemSize + i];
    array[b * itemSize + i] = number;
  }
  // Many small ranges are slower than one large one.
  if (attribute.updateRanges.length < MOST_RANGES) {
    attribute.addUpdateRange(a * itemSize, itemSize);
    attribute.addUpdateRange(b * itemSize, itemSize);
  } else {
    attribute.clearUpdateRanges();
    attribute.addUpdateRange(0, array.length);
  }
  attribute.needsUpdate = true;
}

const MOST_RANGES = 512;

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
