// What `WebGLRenderer.render` does with a scene, without pictures: its order of calls, and which instances of
// which meshes it would draw, as three.js r180 and r187 do.

import { Frustum, Matrix4, WebGLCoordinateSystem } from "three";

const RENDERER = { isWebGLRenderer: true, clippingPlanes: [] };

/**
 * Draws a scene. Returns what is drawn for the camera, for shadows, and in `within`, called amid the drawing.
 */
export function render(scene, camera, { shadows, within, renderer = RENDERER, target = null } = {}) {
  if (scene.matrixWorldAutoUpdate) scene.updateMatrixWorld();
  if (camera.parent === null && camera.matrixWorldAutoUpdate) camera.updateMatrixWorld();
  scene.onBeforeRender(renderer, scene, camera, target);
  const frustum = frustumOf(camera);
  const list = [];
  const uploaded = new Map();
  collect(scene, camera, frustum, list, uploaded, renderer);

  const casters = new Drawn(renderer);
  if (shadows) castShadows(scene, camera, shadows, casters, uploaded, renderer);

  const drawn = new Drawn(renderer);
  for (const object of list) {
    if (!object.layers.test(camera.layers)) continue;
    object.onBeforeRender(renderer, scene, camera, object.geometry, object.material, null);
    drawn.add(object);
    object.onAfterRender(renderer, scene, camera, object.geometry, object.material, null);
  }
  const seenWithin = within?.();
  scene.onAfterRender(renderer, scene, camera);
  return { drawn, casters, within: seenWithin };
}

function frustumOf(camera) {
  const matrix = new Matrix4().multiplyMatrices(camera.projectionMatrix, camera.matrixWorldInverse);
  const { coordinateSystem = WebGLCoordinateSystem, reversedDepth } = camera;
  return new Frustum().setFromProjectionMatrix(matrix, coordinateSystem, reversedDepth);
}

/** What three.js asks: r187 the object, r180 the frustum. */
function intersects(object, frustum) {
  return object.intersectsFrustum?.(frustum) ?? frustum.intersectsObject(object);
}

/** `projectObject` of three.js. */
function collect(object, camera, frustum, list, uploaded, renderer) {
  if (object.visible === false) return;
  if (object.layers.test(camera.layers)) {
    if (object.isLOD) {
      if (object.autoUpdate) object.update(camera);
    } else if (object.isMesh || object.isLine || object.isPoints || object.isSprite) {
      if (!object.frustumCulled || object.isSprite || intersects(object, frustum)) {
        upload(object, uploaded, renderer);
        if (object.material.visible !== false) list.push(object);
      }
    }
  }
  const { children } = object;
  for (let i = 0, l = children.length; i < l; i++)
    collect(children[i], camera, frustum, list, uploaded, renderer);
}

/** `renderObject` of WebGLShadowMap. */
function castShadows(object, camera, shadowCamera, casters, uploaded, renderer) {
  if (object.visible === false) return;
  if (object.layers.test(camera.layers) && object.isMesh && object.castShadow) {
    // An object is sent to the graphics card once a frame.
    if (!uploaded.has(object)) upload(object, uploaded, renderer);
    object.onBeforeShadow(renderer, object, camera, shadowCamera, object.geometry, object.material, null);
    casters.add(object);
    object.onAfterShadow(renderer, object, camera, shadowCamera, object.geometry, object.material, null);
  }
  for (const child of object.children) castShadows(child, camera, shadowCamera, casters, uploaded, renderer);
}

/** Buffers of a graphics card: by attribute, its content when it was sent; and the meshes that have any. */
class Buffers extends Map {
  meshes = new Set();
  #bound = new Map();

  /**
   * `WebGLBindingStates` for instances: returns the content of matrices and colours. A mesh keeps the buffers
   * that it was drawn with, also those that have been freed since, until an attribute that its shader reads is
   * another.
   */
  bind({ id, instanceMatrix, instanceColor, material }) {
    const readsColor = instanceColor && !material.isMeshNormalMaterial;
    const attributes = readsColor ? [instanceMatrix, instanceColor] : [instanceMatrix];
    let bound = this.#bound.get(id);
    if (
      attributes.length !== bound?.attributes.length ||
      attributes.some((a, i) => a !== bound.attributes[i])
    ) {
      bound = { attributes, buffers: attributes.map((attribute) => this.get(attribute)) };
      this.#bound.set(id, bound);
    }
    const [matrices, colors = this.get(instanceColor)] = bound.buffers;
    return [matrices?.content, colors?.content];
  }

  free({ id, instanceMatrix, instanceColor }) {
    this.#bound.delete(id);
    this.delete(instanceMatrix);
    this.delete(instanceColor);
  }
}

const cards = new WeakMap();

/** Returns what the graphics card of a renderer has, by default of that of all tests. */
export function buffersOf(renderer = RENDERER) {
  if (!cards.has(renderer)) cards.set(renderer, new Buffers());
  return cards.get(renderer);
}

/** `WebGLAttributes.update`: whole if it is new, else the ranges that were marked. */
function upload(object, uploaded, renderer) {
  uploaded.set(object, true);
  if (!object.isInstancedMesh) return;
  const buffers = buffersOf(renderer);
  if (!buffers.meshes.has(object)) {
    buffers.meshes.add(object);
    object.addEventListener("dispose", function free() {
      object.removeEventListener("dispose", free);
      buffers.meshes.delete(object);
      buffers.free(object);
    });
  }
  for (const attribute of [object.instanceMatrix, object.instanceColor]) {
    if (!attribute) continue;
    const buffer = buffers.get(attribute);
    if (!buffer) buffers.set(attribute, { content: attribute.array.slice(), version: attribute.version });
    else if (buffer.version < attribute.version) {
      const ranges = attribute.updateRanges;
      if (ranges.length === 0) buffer.content.set(attribute.array);
      for (const { start, count } of ranges) {
        buffer.content.set(attribute.array.subarray(start, start + count), start);
      }
      attribute.clearUpdateRanges();
      buffer.version = attribute.version;
    }
  }
}

/** Meshes that are drawn, and which of their instances. */
export class Drawn {
  #instances = new Map();
  #buffers;

  constructor(renderer) {
    this.#buffers = buffersOf(renderer);
  }

  add(object) {
    if (object.isInstancedMesh) {
      const [content = [], colors] = this.#buffers.bind(object);
      const keys = new Set();
      // WebGL takes the whole part of a number, and draws nothing of one below 0.
      const count = Math.trunc(object.count);
      for (let i = 0; i < count; i++) keys.add(keyOf(content, i));
      this.#instances.set(object, keys);
      if (colors)
        for (let i = 0; i < count; i++)
          keys.add(`${keyOf(content, i)}:${[...colors.slice(3 * i, 3 * i + 3)]}`);
    } else if (object.isBatchedMesh) {
      const data = object._indirectTexture.image.data;
      this.#instances.set(object, new Set(data.slice(0, object._multiDrawCount)));
    } else this.#instances.set(object, null);
  }

  has(object, instance) {
    if (!this.#instances.has(object)) return false;
    const instances = this.#instances.get(object);
    if (object.isInstancedMesh) {
      const key = keyOf(object.instanceMatrix.array, instance);
      const color = object.instanceColor?.array.slice(3 * instance, 3 * instance + 3);
      return instances.has(color ? `${key}:${[...color]}` : key);
    }
    return instances === null || instances.has(instance);
  }

  /** Instances of an `InstancedMesh` without colours that are drawn, in the order in which they are. */
  order(object) {
    const keys = Array.from({ length: object.count }, (_, i) => keyOf(object.instanceMatrix.array, i));
    return [...(this.#instances.get(object) ?? [])].map((key) => keys.indexOf(key));
  }

  /** Number of meshes, or of instances of one. */
  count(object) {
    if (!object) return this.#instances.size;
    if (!this.#instances.has(object)) return 0;
    const instances = this.#instances.get(object);
    if (instances === null) return 1;
    return object.isInstancedMesh && object.instanceColor ? instances.size / 2 : instances.size;
  }
}

function keyOf(matrices, instance) {
  return matrices.slice(16 * instance, 16 * instance + 16).join();
}
