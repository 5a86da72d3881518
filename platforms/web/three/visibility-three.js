// Culling for three.js: before a scene is drawn, hides the meshes and instances that the camera cannot see, by
// the package `visibility-web`; while it is drawn, puts all back. `visibility-three.d.ts` describes what is
// exported here.
//
// Order within `renderer.render(scene, camera)`, of WebGLRenderer as of WebGPURenderer:
//   1. matrices of the world are brought up to date
//   2. `scene.onBeforeRender`: here the scene is followed, culled, and what is hidden loses its layers
//   3. the renderer collects what it draws, from the first child to the last. A last child is added for that
//      long. The renderer takes it for an LOD and calls its `update`: here the layers are put back
//   4. shadows are drawn, of all casters; then mirrors and the like, of all objects; then what was collected
//   5. `scene.onAfterRender`

import { BatchedMesh, LOD, Matrix4, Object3D, WebGPUCoordinateSystem } from "three";
import { Depth, Flag, VisibilityError, indexOf, load } from "visibility-web";
import { InstanceOrder, canLeaveOut, leaveOutInstances, leaveOutOfBatch } from "./instances.js";
import { Shape, Surface, Surfaces, bonesOf, chosenSurface, moveBox } from "./surfaces.js";

/** Greatest number of clip planes of a view. */
const MOST_CLIP_PLANES = 10;
/** An occluder is used if single precision places it to this share of its size: a pixel if it fills the picture. */
const PLACED_TO = 1 / 1024;
/** Relative error of a single-precision number, with room for the few roundings of a product of matrices. */
const ROUNDING = 2 ** -21;

const matrix = new Matrix4();
const boneMatrix = new Matrix4();
const bounds = new Float64Array(6);

/** A mesh of the scene, and its objects in the library: one, or one for each instance. */
class Entry {
  constructor(object) {
    this.object = object;
    this.frame = -1;
    this.surface = Surface.NeverHidden;
    /** What the entry was made for; when one of these changes, it is made anew. */
    this.geometry = null;
    this.material = null;
    this.known = null;
    this.instanceCount = 0;
    /** Shapes: one for all, or for a `BatchedMesh` one for each instance. */
    this.shapes = [];
    /** For a `BatchedMesh`: the part of the geometry that each instance has, -1 for none. */
    this.parts = null;
    /** Ids in the library, and their indices. Empty if the mesh is never hidden. */
    this.ids = [];
    this.indices = new Uint32Array(0);
    /** Layers that the library has: 0 where the mesh, or what it is part of, is not shown. */
    this.layers = 0;
    this.instanceLayers = null;
    this.world = new Float64Array(16);
    this.version = -1;
    /** Whether occluders wait for the mesh to stand still. */
    this.waits = false;
    /** For an `InstancedMesh` that was drawn in part: its instances, those visible first. */
    this.order = null;
    /** What it was when it was hidden. */
    this.mask = 0;
  }

  get isMany() {
    return this.object.isInstancedMesh === true || this.object.isBatchedMesh === true;
  }
}

/** See `visibility-three.d.ts`. */
export class VisibilityCulling {
  enabled = true;
  stats = { objects: 0, visible: 0, hidden: 0, occluders: 0, followMs: 0, cullMs: 0, applyMs: 0 };

  #options;
  #visibility = null;
  /** The library's scene. */
  #followed = null;
  /** By camera: view, pipeline and visible set. */
  #cameras = new Map();
  #entries = new Map();
  /** Entries in the order in which the last frame met them, most often that of this frame. */
  #order = [];
  #met = 0;
  #isSameOrder = true;
  #frame = 0;
  /** Point of the world that the library's coordinates are relative to. */
  #origin = null;
  #surfaces = new Surfaces();
  #shapes = new WeakMap();
  /** Entries to be added to the library, and those that have moved. */
  #added = [];
  #moved = [];
  /** What is hidden while the renderer collects, and what undoes it. */
  #active = null;
  #last = new LOD();
  #former;
  #isDisposed = false;

  constructor(scene, cameras, options = {}) {
    if (!scene?.isScene) throw new TypeError("`scene` is not a THREE.Scene: only scenes tell when they are drawn");
    this.scene = scene;
    this.#options = { maxOccluderTriangles: 1 << 14, zBuffer: {}, ...options };
    for (const camera of [cameras].flat()) this.addCamera(camera);
    this.#last.layers.enableAll();
    this.#last.update = () => this.#collected();
    const { onBeforeRender, onAfterRender } = scene;
    this.#former = { onBeforeRender, onAfterRender };
    const culling = this;
    scene.onBeforeRender = function (renderer, scene, camera, ...rest) {
      onBeforeRender.call(this, renderer, scene, camera, ...rest);
      culling.#begin(renderer, camera);
    };
    scene.onAfterRender = function (renderer, scene, camera, ...rest) {
      if (culling.#active?.camera === camera) culling.#end();
      onAfterRender.call(this, renderer, scene, camera, ...rest);
    };
    this.#former.installed = scene.onBeforeRender;
    this.ready = this.#load();
  }

  async #load() {
    const visibility = this.#options.visibility ?? (await load());
    if (this.#isDisposed) return;
    this.#visibility = visibility;
    this.#followed = visibility.createScene();
  }

  addCamera(camera) {
    if (!camera?.isCamera) throw new TypeError("`camera` is not a THREE.Camera");
    if (!this.#cameras.has(camera)) this.#cameras.set(camera, null);
  }

  removeCamera(camera) {
    const tools = this.#cameras.get(camera);
    if (tools) for (const handle of [tools.view, tools.pipeline, tools.visible]) handle.destroy();
    this.#cameras.delete(camera);
  }

  dispose() {
    this.#end();
    this.#isDisposed = true;
    const { scene } = this;
    // Another's callback that was put over this one calls it still: it does nothing from now on.
    if (scene.onBeforeRender === this.#former.installed) {
      scene.onBeforeRender = this.#former.onBeforeRender;
      scene.onAfterRender = this.#former.onAfterRender;
    }
    for (const camera of [...this.#cameras.keys()]) this.removeCamera(camera);
    this.#followed?.destroy();
    this.#followed = this.#visibility = null;
    this.#entries.clear();
    this.#order = [];
  }

  // A frame.

  #begin(renderer, camera) {
    // A frame that was not ended: the renderer threw. Otherwise this is a mirror's picture within a frame.
    if (this.#active?.camera === camera) this.#end();
    if (this.#active || !this.enabled || !this.#visibility || !this.#cameras.has(camera)) return;
    const { scene } = this;
    if (camera.isArrayCamera || scene.overrideMaterial) return;
    const start = performance.now();
    const tools = this.#tools(camera);
    this.#origin ??= camera.matrixWorld.elements.slice(12, 15).map((x) => (Number.isFinite(x) ? Math.round(x) : 0));
    if (!this.#look(tools.view, camera, renderer.clippingPlanes ?? [])) return;
    this.#follow(camera);
    const followed = performance.now();
    const { occluders, visible } = tools.pipeline.cull(this.#followed, tools.view, tools.visible);
    const culled = performance.now();
    this.#hide(renderer, camera, tools.visible.bits);
    Object.assign(this.stats, {
      objects: this.#followed.count,
      visible,
      hidden: this.#active.hiddenCount,
      occluders,
      followMs: followed - start,
      cullMs: culled - followed,
      applyMs: performance.now() - culled,
    });
  }

  #tools(camera) {
    let tools = this.#cameras.get(camera);
    if (!tools) {
      const { width, height } = this.#options.zBuffer;
      const pipeline = this.#visibility.createPipeline().addFrustum().addZBuffer(width, height);
      tools = { view: this.#visibility.createView(), visible: this.#visibility.createVisible(), pipeline };
      this.#cameras.set(camera, tools);
    }
    return tools;
  }

  /** Sets a view to a camera of three.js. False if the camera has no view, such as one whose matrix is NaN. */
  #look(view, camera, clippingPlanes) {
    if (clippingPlanes.length > MOST_CLIP_PLANES) return false;
    const [x, y, z] = this.#origin;
    matrix.multiplyMatrices(camera.projectionMatrix, camera.matrixWorldInverse);
    const clip = Float64Array.from(matrix.elements);
    for (let row = 0; row < 4; row++) clip[12 + row] += clip[row] * x + clip[4 + row] * y + clip[8 + row] * z;
    const isZeroToOne = camera.coordinateSystem === WebGPUCoordinateSystem;
    const depth = isZeroToOne ? Depth.ZeroToOne : Depth.NegativeOneToOne;
    try {
      view.setMatrix(clip, camera.reversedDepth ? Depth.Reversed : depth);
      const planes = clippingPlanes.map(({ normal: n, constant }) => [n.x, n.y, n.z, constant + n.x * x + n.y * y + n.z * z]);
      view.setClipPlanes(planes);
    } catch (error) {
      if (error instanceof VisibilityError && error.code === "ARGUMENT") return false;
      throw error;
    }
    view.setLayers(camera.layers.mask >>> 0);
    return true;
  }

  // Following the scene.

  #follow(camera) {
    this.#frame++;
    this.#surfaces.begin();
    this.#met = 0;
    this.#isSameOrder = true;
    this.#visit(this.scene, true, 0, camera);
    if (!this.#isSameOrder || this.#met !== this.#order.length) {
      this.#order.length = this.#met;
      for (const entry of this.#entries.values()) {
        if (entry.frame === this.#frame) continue;
        this.#remove(entry);
        this.#entries.delete(entry.object);
      }
    }
    this.#insert();
    this.#move();
    this.#followed.maintain();
  }

  #visit(object, isShown, groupOrder, camera) {
    if (object.visible === false) isShown = false;
    if (object.isMesh) this.#meet(object, isShown, groupOrder);
    else if (object.isGroup) {
      // What is in a bundle is recorded, with what is visible then; a clipping group cuts holes into occluders.
      if (object.isBundleGroup || object.isClippingGroup) return;
      groupOrder = object.renderOrder;
    } else if (object.isLOD && isShown && object.autoUpdate && object.layers.test(camera.layers)) {
      // As the renderer will do: only then it is known which level is drawn.
      object.update(camera);
    }
    const { children } = object;
    for (let i = 0; i < children.length; i++) this.#visit(children[i], isShown, groupOrder, camera);
  }

  #meet(object, isShown, groupOrder) {
    let entry = this.#order[this.#met];
    if (entry?.object !== object) {
      this.#isSameOrder = false;
      entry = this.#entries.get(object);
      if (!entry) this.#entries.set(object, (entry = new Entry(object)));
    }
    // An object that is twice among children is drawn twice, and followed once.
    if (entry.frame === this.#frame) return;
    this.#order[this.#met++] = entry;
    entry.frame = this.#frame;

    const surface = groupOrder === 0 ? this.#surfaceOf(entry) : Surface.NeverHidden;
    if (surface !== entry.surface || object.geometry !== entry.geometry || this.#isAnew(entry)) {
      this.#remove(entry);
      entry.surface = surface;
      entry.geometry = object.geometry;
      if (surface === Surface.NeverHidden || !this.#shape(entry)) return;
      entry.layers = isShown ? object.layers.mask >>> 0 : 0;
      this.#added.push(entry);
      return;
    }
    if (entry.ids.length === 0) return;
    const layers = isShown ? object.layers.mask >>> 0 : 0;
    if (layers !== entry.layers || object.isBatchedMesh) this.#setLayers(entry, layers);
    if (hasMoved(entry) || object.isSkinnedMesh) this.#moved.push(entry);
    else if (entry.waits) this.#setMeshes(entry);
  }

  /** Returns what a mesh is now, from what may change from frame to frame. */
  #surfaceOf(entry) {
    const { object } = entry;
    const { geometry, material } = object;
    const usual = object.isBatchedMesh ? BatchedMesh.prototype : Object3D.prototype;
    if (
      geometry?.isBufferGeometry !== true ||
      !material ||
      object.onBeforeRender !== usual.onBeforeRender ||
      object.onAfterRender !== usual.onAfterRender ||
      object.renderOrder !== 0 ||
      geometry.morphAttributes.position !== undefined ||
      object.morphTexture ||
      object.instanceMatrix?.isStorageInstancedBufferAttribute
    )
      return Surface.NeverHidden;
    let surface;
    if (Array.isArray(material)) surface = this.#surfaces.ofAll(material, geometry);
    else {
      if (entry.known?.material !== material) entry.known = this.#surfaces.of(material);
      surface = this.#surfaces.refresh(entry.known);
    }
    if (!object.frustumCulled) surface = Surface.NeverHidden;
    const { cullable, occluder } = this.#options;
    if (cullable) {
      const choice = cullable(object);
      if (choice === false) return Surface.NeverHidden;
      if (choice === true) surface = Math.max(surface, Surface.Hideable);
    }
    if (object.isSkinnedMesh) return Math.min(surface, Surface.Hideable);
    if (occluder && surface !== Surface.NeverHidden) {
      const choice = occluder(object);
      if (choice === false) surface = Surface.Hideable;
      else if (choice === true && surface === Surface.Hideable) surface = chosenSurface(material);
    }
    return surface;
  }

  /** Whether an entry has to be made anew: its geometry has changed, or its instances are others. */
  #isAnew(entry) {
    const { object } = entry;
    const [shape] = entry.shapes;
    if (shape && shape.frame !== this.#frame) {
      if (!shape.isCurrent()) return true;
      shape.frame = this.#frame;
    }
    if (object.isInstancedMesh) return shape !== undefined && object.count !== entry.instanceCount;
    if (!entry.parts) return false;
    const infos = object._instanceInfo;
    return infos.length !== entry.parts.length || infos.some((info, i) => partOf(info) !== entry.parts[i]);
  }

  /** Finds the shapes of an entry. False if its geometry cannot be read, so that it is never hidden. */
  #shape(entry) {
    const { object, geometry } = entry;
    if (object.isBatchedMesh) return this.#shapeBatch(entry);
    let shape = this.#shapes.get(geometry);
    if (!shape?.isCurrent()) this.#shapes.set(geometry, (shape = new Shape(geometry)));
    entry.instanceCount = object.isInstancedMesh ? object.count : 1;
    entry.shapes = Array(1).fill(shape);
    if (object.isSkinnedMesh) {
      shape.bones ??= bonesOf(geometry);
      if (!shape.bones || shape.bones.boxes.length > object.skeleton.bones.length) return false;
    } else if (object.isInstancedMesh && !(object.instanceMatrix.array?.length >= 16 * object.count)) return false;
    return shape.box !== null && entry.instanceCount > 0;
  }

  #shapeBatch(entry) {
    const { object, geometry } = entry;
    const infos = object._instanceInfo;
    // Fields that three.js does not document: without them the batch is drawn as it is.
    if (!Array.isArray(infos) || !(object._matricesTexture?.version >= 0)) return false;
    entry.instanceCount = infos.length;
    entry.parts = infos.map(partOf);
    const byPart = new Map();
    entry.shapes = entry.parts.map((part) => {
      if (!byPart.has(part)) byPart.set(part, part < 0 ? new Shape(geometry, EMPTY) : shapeOfPart(object, part));
      return byPart.get(part);
    });
    return entry.instanceCount > 0;
  }

  #setLayers(entry, layers) {
    if (layers === entry.layers && !entry.instanceLayers) return;
    entry.layers = layers;
    entry.ids.forEach((id, i) => {
      const own = layersOf(entry, i);
      if (entry.instanceLayers) {
        if (entry.instanceLayers[i] === own) return;
        entry.instanceLayers[i] = own;
      }
      this.#followed.setLayers(id, own);
    });
  }

  #remove(entry) {
    if (entry.ids.length > 0) {
      this.#followed.removeAll(entry.ids);
      for (const shape of entry.shapes) if (--shape.users === 0) shape.free(this.#followed);
    }
    entry.ids = [];
    entry.shapes = [];
    entry.order = entry.instanceLayers = entry.parts = null;
    entry.waits = false;
  }

  /** Adds the entries that wait for it to the library. */
  #insert() {
    if (this.#added.length === 0) return;
    const count = this.#added.reduce((sum, entry) => sum + entry.instanceCount, 0);
    const boxes = new Float64Array(6 * count);
    const [layers, flags] = [new Uint32Array(count), new Uint32Array(count)];
    let at = 0;
    for (const entry of this.#added) {
      keep(entry);
      this.#boxes(entry, boxes, 6 * at);
      entry.instanceLayers = entry.object.isBatchedMesh ? new Uint32Array(entry.instanceCount) : null;
      for (let i = 0; i < entry.instanceCount; i++, at++) {
        layers[at] = layersOf(entry, i);
        if (entry.instanceLayers) entry.instanceLayers[i] = layers[at];
        flags[at] = entry.surface > Surface.Hideable ? Flag.Occluder : 0;
      }
    }
    const ids = this.#followed.insertAll({ bounds: boxes, layers, flags });
    at = 0;
    for (const entry of this.#added) {
      entry.ids = ids.slice(at, at + entry.instanceCount);
      entry.indices = Uint32Array.from(entry.ids, indexOf);
      for (const shape of entry.shapes) shape.users++;
      this.#setMeshes(entry, boxes, 6 * at);
      at += entry.instanceCount;
    }
    this.#added.length = 0;
    if (2 * count > this.#followed.count) this.#followed.rebuild();
  }

  /** Tells the library of the entries that have moved. They hide nothing until they stand still for a frame. */
  #move() {
    if (this.#moved.length === 0) return;
    const count = this.#moved.reduce((sum, entry) => sum + entry.instanceCount, 0);
    const [ids, boxes] = [new BigUint64Array(count), new Float64Array(6 * count)];
    let at = 0;
    for (const entry of this.#moved) {
      if (hasMoved(entry)) keep(entry);
      this.#boxes(entry, boxes, 6 * at);
      ids.set(entry.ids, at);
      entry.waits = entry.surface > Surface.Hideable;
      at += entry.instanceCount;
    }
    this.#followed.setAllBounds(ids, boxes);
    this.#moved.length = 0;
  }

  /** Writes the boxes of an entry. */
  #boxes(entry, out, at) {
    const { object, shapes, instanceCount } = entry;
    if (object.isSkinnedMesh) skinnedBox(entry, out, at, this.#origin);
    else if (!entry.isMany) moveBox(out, at, shapes[0].box, object.matrixWorld.elements, this.#origin);
    else {
      // The graphics card multiplies matrices of the mesh and the instance in single precision.
      const rounding = ROUNDING * object.matrixWorld.getMaxScaleOnAxis();
      for (let i = 0; i < instanceCount; i++) {
        const box = (shapes[i] ?? shapes[0]).box;
        if (!placeInstance(entry, i)) {
          out.set(EMPTY, at + 6 * i);
          continue;
        }
        const e = matrix.elements;
        const margin = rounding * Math.max(Math.abs(e[12]), Math.abs(e[13]), Math.abs(e[14]));
        moveBox(out, at + 6 * i, box, matrix.premultiply(object.matrixWorld).elements, this.#origin, margin);
      }
    }
  }

  /** Gives an entry its occluder meshes. `boxes` are its boxes, from `at` on, if they are known. */
  #setMeshes(entry, boxes, at = 0) {
    entry.waits = false;
    if (entry.surface <= Surface.Hideable) return;
    if (!boxes) this.#boxes(entry, (boxes = new Float64Array(6 * entry.instanceCount)), 0);
    for (let i = 0; i < entry.instanceCount; i++) {
      const shape = entry.shapes[i] ?? entry.shapes[0];
      if (shape.box === EMPTY || !isPlacedWell(boxes.subarray(at + 6 * i, at + 6 * i + 6))) continue;
      if (entry.isMany) {
        placeInstance(entry, i);
        // The graphics card takes the front for the back if an instance is mirrored.
        if (entry.surface !== Surface.Double && !(matrix.determinant() > 0)) continue;
        matrix.premultiply(entry.object.matrixWorld);
      } else matrix.copy(entry.object.matrixWorld);
      const mesh = shape.mesh(this.#followed, entry.surface, this.#options.maxOccluderTriangles);
      if (mesh === null) continue;
      const transform = Float32Array.from(matrix.elements);
      for (let k = 0; k < 3; k++) transform[12 + k] = matrix.elements[12 + k] - this.#origin[k];
      this.#followed.setMesh(entry.ids[i], mesh, transform);
    }
  }

  // Hiding, and putting back.

  #hide(renderer, camera, bits) {
    const active = { camera, masked: [], undo: [], hiddenCount: 0 };
    this.#active = active;
    const isVisible = (index) => (bits[index >>> 5] >>> (index & 31)) & 1;
    for (const entry of this.#order) {
      const { object, indices, ids } = entry;
      if (ids.length === 0 || entry.layers === 0 || !object.layers.test(camera.layers)) continue;
      if (!entry.isMany) {
        if (isVisible(indices[0])) continue;
        active.hiddenCount++;
      } else if (this.#leaveOut(entry, renderer, isVisible)) continue;
      entry.mask = object.layers.mask;
      object.layers.mask = 0;
      active.masked.push(entry);
    }
    this.scene.children.push(this.#last);
  }

  /** Leaves out the hidden instances of an entry. False if all are hidden. */
  #leaveOut(entry, renderer, isVisible) {
    const { object, indices, instanceCount } = entry;
    const active = this.#active;
    const hidden = [];
    for (let i = 0; i < instanceCount; i++) {
      if (isShownInstance(entry, i) && !isVisible(indices[i])) hidden.push(i);
    }
    active.hiddenCount += hidden.length;
    if (hidden.length === instanceCount) return false;
    if (hidden.length === 0) return true;
    if (!canLeaveOut(object, renderer)) {
      active.hiddenCount -= hidden.length;
      return true;
    }
    const isCamera = (camera) => camera === active.camera;
    if (object.isBatchedMesh) active.undo.push(leaveOutOfBatch(object, hidden, isCamera));
    else {
      entry.order ??= new InstanceOrder(object.count);
      entry.order.update(object);
      entry.order.sort((i) => isVisible(indices[i]));
      active.undo.push(leaveOutInstances(object, entry.order, isCamera));
    }
    return true;
  }

  /** The renderer has collected what it draws: gives back the layers. */
  #collected() {
    const { children } = this.scene;
    const at = children.lastIndexOf(this.#last);
    if (at >= 0) children.splice(at, 1);
    for (const entry of this.#active.masked.splice(0)) entry.object.layers.mask = entry.mask;
    for (const { collected } of this.#active.undo) collected();
  }

  /** The scene is drawn: all is as it was. */
  #end() {
    if (!this.#active) return;
    this.#collected();
    for (const { drawn } of this.#active.undo) drawn();
    this.#active = null;
  }
}

/** The box of nothing: the library never hides an object that has it. */
const EMPTY = new Float64Array([1, 1, 1, -1, -1, -1]);

/** Returns the shape of a part of a `BatchedMesh`. */
function shapeOfPart(batch, part) {
  const range = batch.getGeometryRangeAt(part);
  const whole = new Shape(batch.geometry, EMPTY);
  const { position } = whole;
  const box = new Float64Array([Infinity, Infinity, Infinity, -Infinity, -Infinity, -Infinity]);
  for (let i = 0; i < range.vertexCount; i++) {
    const vertex = range.vertexStart + i;
    const point = [position.getX(vertex), position.getY(vertex), position.getZ(vertex)];
    for (let k = 0; k < 3; k++) {
      box[k] = Math.min(box[k], point[k]);
      box[3 + k] = Math.max(box[3 + k], point[k]);
    }
  }
  return new Shape(batch.geometry, box, range);
}

/** Whether an instance is one that is drawn when its mesh is. */
function isShownInstance(entry, i) {
  if (!entry.object.isBatchedMesh) return true;
  const info = entry.object._instanceInfo[i];
  return info.active && info.visible;
}

/** Returns the part of its geometry that an instance of a `BatchedMesh` has, -1 for none. */
function partOf({ active, geometryIndex }) {
  return active ? geometryIndex : -1;
}

function layersOf(entry, i) {
  return isShownInstance(entry, i) ? entry.layers : 0;
}

/** Sets `matrix` to that of an instance in its mesh. False if there is no such instance. */
function placeInstance({ object, parts }, i) {
  if (parts && parts[i] < 0) return false;
  object.getMatrixAt(i, matrix);
  return true;
}

/** Returns the version of the matrices of instances. */
function versionOf({ instanceMatrix, _matricesTexture }) {
  return (instanceMatrix ?? _matricesTexture)?.version ?? 0;
}

/** Whether a mesh, or one of its instances, is elsewhere than it was. */
function hasMoved({ object, world, version }) {
  const { elements } = object.matrixWorld;
  for (let i = 0; i < 16; i++) if (elements[i] !== world[i]) return true;
  return version !== versionOf(object);
}

/** Keeps where an entry is. */
function keep(entry) {
  entry.world.set(entry.object.matrixWorld.elements);
  entry.version = versionOf(entry.object);
}

/** Writes a box that holds a skinned mesh: a vertex is within the hull of where its bones would put it. */
function skinnedBox({ object, shapes: [{ bones }] }, out, at, origin) {
  const { skeleton, bindMatrix, bindMatrixInverse, matrixWorld } = object;
  const local = new Float64Array([Infinity, Infinity, Infinity, -Infinity, -Infinity, -Infinity]);
  let reach = 0;
  bones.boxes.forEach((box, i) => {
    const bone = skeleton.bones[i];
    boneMatrix.copy(bindMatrixInverse);
    if (bone) boneMatrix.multiply(bone.matrixWorld);
    boneMatrix.multiply(skeleton.boneInverses[i]).multiply(bindMatrix);
    moveBox(bounds, 0, box, boneMatrix.elements, [0, 0, 0]);
    for (let k = 0; k < 6; k++) {
      // Weights whose sum is not 1 move the vertex towards the mesh's origin, or away from it.
      const ends = [bounds[k] * bones.least, bounds[k] * bones.greatest];
      local[k] = k < 3 ? Math.min(local[k], ...ends) : Math.max(local[k], ...ends);
    }
    if (bone) for (let k = 12; k < 15; k++) reach = Math.max(reach, Math.abs(bone.matrixWorld.elements[k]));
  });
  // The graphics card has the matrices of bones in single precision.
  const size = Math.max(...local.map(Math.abs), reach);
  moveBox(out, at, local, matrixWorld.elements, origin, ROUNDING * size * matrixWorld.getMaxScaleOnAxis());
}

/** Whether single precision places what is in a box well enough for an occluder. */
function isPlacedWell(box) {
  let [size, reach] = [0, 0];
  for (let k = 0; k < 3; k++) {
    size = Math.max(size, box[3 + k] - box[k]);
    reach = Math.max(reach, Math.abs(box[k]), Math.abs(box[3 + k]));
  }
  return reach * 2 ** -24 <= PLACED_TO * size;
}
