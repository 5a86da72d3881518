// Draws some instances of an `InstancedMesh` or `BatchedMesh` for one camera, and leaves the mesh as it was.

import { BatchedMesh, InstancedBufferAttribute, Object3D } from "three";

/** Whether some of a mesh's instances can be left out. If not, it is drawn whole, or hidden whole. */
export function canLeaveOut(mesh, renderer) {
  // WebGPURenderer reads instances elsewhere.
  if (!renderer.isWebGLRenderer) return false;
  if (
    mesh.onBeforeShadow !== (mesh.isBatchedMesh ? BatchedMesh : Object3D).prototype.onBeforeShadow ||
    mesh.onAfterShadow !== Object3D.prototype.onAfterShadow
  )
    return false;
  // Other attributes of instances would have to be put in the order of the matrices, too.
  const { attributes } = mesh.geometry;
  return mesh.isBatchedMesh || !Object.values(attributes).some((a) => a.isInstancedBufferAttribute);
}

/**
 * The instances of an `InstancedMesh`, those visible first: in attributes of their own, so that shadows and
 * other cameras draw all of them, in any order.
 */
export class InstanceOrder {
  constructor(count) {
    this.count = count;
    this.visible = 0;
    /** Instance by place. */
    this.instances = Uint32Array.from({ length: count }, (_, i) => i);
    this.matrices = this.colors = null;
  }

  /** Takes over the content of the mesh's attributes, where it has changed. */
  update(mesh) {
    this.matrices = this.#copy(this.matrices, mesh.instanceMatrix);
    this.colors = mesh.instanceColor && this.#copy(this.colors, mesh.instanceColor);
  }

  #copy(copy, from) {
    const { itemSize, normalized, version } = from;
    if (copy?.from === from && copy.fromVersion === version) return copy;
    const length = this.count * itemSize;
    if (copy?.from !== from)
      copy = new InstancedBufferAttribute(from.array.slice(0, length), itemSize, normalized);
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
    // Those that vanish move behind the end of the visible ones, then those that appear move before it.
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

  /** Exchanges the attributes and the count of the mesh for these, and returns the former. */
  exchange(
    mesh,
    { matrices, colors, count } = { matrices: this.matrices, colors: this.colors, count: this.count },
  ) {
    const former = { matrices: mesh.instanceMatrix, colors: mesh.instanceColor, count: mesh.count };
    mesh.instanceMatrix = matrices;
    mesh.instanceColor = colors;
    mesh.count = count;
    return former;
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
 * Makes an `InstancedMesh` draw the instances that are visible, when `isCamera` holds. Returns how to undo
 * it.
 */
export function leaveOutInstances(mesh, order, isCamera) {
  let former = null;
  const restore = () => {
    if (former) order.exchange(mesh, former);
    former = null;
  };
  // While three.js collects what it draws, it sends the attributes to the graphics card: of all instances.
  // The sphere by which three.js would cull the mesh may be older than its instances.
  const { frustumCulled } = mesh;
  mesh.frustumCulled = false;
  former = order.exchange(mesh);
  mesh.onBeforeRender = (renderer, scene, camera) => {
    if (!isCamera(camera)) return;
    former = order.exchange(mesh);
    mesh.count = order.visible;
  };
  mesh.onBeforeShadow = () => {
    former = order.exchange(mesh);
  };
  mesh.onAfterRender = mesh.onAfterShadow = restore;
  return {
    collected() {
      mesh.frustumCulled = frustumCulled;
      restore();
    },
    drawn() {
      restore();
      for (const name of ["onBeforeRender", "onAfterRender", "onBeforeShadow", "onAfterShadow"])
        delete mesh[name];
    },
  };
}

/** Makes a `BatchedMesh` leave out the instances of a list when `isCamera` holds. Returns how to undo it. */
export function leaveOutOfBatch(mesh, hidden, isCamera) {
  mesh.onBeforeRender = function (renderer, scene, camera, ...rest) {
    // The mesh decides here what it draws, from what is visible: it is made so for that long.
    const isHiding = isCamera(camera);
    if (isHiding) for (const instance of hidden) mesh.setVisibleAt(instance, false);
    try {
      BatchedMesh.prototype.onBeforeRender.call(mesh, renderer, scene, camera, ...rest);
    } finally {
      if (isHiding) for (const instance of hidden) mesh.setVisibleAt(instance, true);
    }
  };
  return {
    collected() {},
    drawn() {
      delete mesh.onBeforeRender;
    },
  };
}
