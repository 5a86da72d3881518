// Culling for three.js: before a scene is drawn, hides the meshes and instances that the camera cannot see,
// by the package `visibility-web`; while it is drawn, puts all back. `visibility-three.d.ts` describes what
// is exported here.
//
// Order within `renderer.render(scene, camera)`, of WebGLRenderer as of WebGPURenderer:
//   1. matrices of the world are brought up to date
//   2. `scene.onBeforeRender`: here the scene is followed, culled, and what is hidden loses its layers
//   3. the renderer collects what it draws, from the first child to the last. A last child is added for that
//      long. The renderer takes it for an LOD and calls its `update`: here the layers are put back. Its
//      children carry what is drawn of an `InstancedMesh` to the graphics card
//   4. shadows are drawn, of all casters; then mirrors and the like, of all objects; then what was collected
//   5. `scene.onAfterRender`

import { LOD, Matrix4 } from "three";
import { Flag, indexOf, load } from "visibility-web";
import { LateAnswers, LateScene, countBits, startWorker } from "visibility-web/late.js";
import { EMPTY, moveBox, place, skinnedBox } from "./boxes.js";
import { hasDepth, originFor, releaseCamera, takeCamera, largeSize } from "./cameras.js";
import {
  ALL,
  Entry,
  HiddenLayers,
  Many,
  NO_IDS,
  NONE,
  hasInstances,
  isApart,
  isCountedElsewhere,
  isUnclipped,
  isUsual,
  layersOf,
  matricesOf,
  partOf,
  placeOccluder,
  shapesOf,
} from "./entries.js";
import { canLeaveOut, countOf, leaveOutInstances, leaveOutOfBatch } from "./instances.js";
import { frustumOf, isLeftOut } from "./spheres.js";
import { Shape, Surface, Surfaces, bonesOf, sideOf } from "./surfaces.js";
import { setView } from "./view.js";

const matrix = new Matrix4();
/** Triangles of new occluder meshes of a frame, with those of the last mesh beyond: some ten milliseconds of work. */
const MOST_NEW_TRIANGLES = 1 << 17;

/** See `visibility-three.d.ts`. */
export class VisibilityCulling {
  enabled = true;
  stats = { objects: 0, visible: 0, hidden: 0, occluders: 0, followMs: 0, cullMs: 0, applyMs: 0 };

  #options;
  #visibility = null;
  /** The library's scene. */
  #followed = null;
  /** By camera: the camera that it is culled for, and view, pipeline and visible set once they are needed. */
  #cameras = new Map();
  #entries = new Map();
  /** Entries in the order in which the last frame met them, most often that of this frame. */
  #order = [];
  #met = 0;
  /** World matrix of each entry as the library has it: 16 numbers, from 16 times its slot on. */
  #worlds = new Float64Array(16 * 1024);
  /** Slots of entries that are gone. */
  #freeSlots = [];
  #isSameOrder = true;
  /** Whether the last frame followed the scene to its end: a callback of the user's may throw. */
  #isFollowed = true;
  #frame = 0;
  /** Point of the world that the library's coordinates are relative to. Another point is another array. */
  #origin = null;
  /** Size of large occluders. */
  #largeSize = Infinity;
  #surfaces = new Surfaces();
  /** By geometry: its shapes, by part. */
  #shapes = new WeakMap();
  /** Shapes that have lost a last user: freed unless the same frame gives them another. */
  #unused = new Set();
  /** Whether planes of the renderer cut what is drawn. */
  #isClipped = false;
  /** Triangles of new occluder meshes that this frame has left. */
  #newTriangles = 0;
  /** Entries to be added to the library, and those that have moved. */
  #added = [];
  #moved = [];
  /** The camera that is drawn, and the meshes and instances that are hidden from it. Null between frames. */
  #active = null;
  #last = new LOD();
  #former;
  #isDisposed = false;

  constructor(scene, cameras, options = {}) {
    if (!scene?.isScene)
      throw new TypeError("`scene` is not a THREE.Scene: only scenes tell when they are drawn");
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
      culling.#begin(renderer, camera, rest[0]);
    };
    scene.onAfterRender = function (renderer, scene, camera, ...rest) {
      if (culling.#active?.camera === camera) culling.#end();
      onAfterRender.call(this, renderer, scene, camera, ...rest);
    };
    this.#former.installed = scene.onBeforeRender;
    this.ready = this.#load();
  }

  async #load() {
    const visibility = this.#options.visibility ?? (await load({ frames: true }));
    if (this.#isDisposed) return;
    this.#visibility = visibility;
    const { worker } = this.#options;
    const scene = visibility.createScene();
    // `worker.port` is for programs that start the worker themselves.
    this.#followed = worker ? new LateScene(scene, [worker.port ?? startWorker({ frames: true, ...worker })]) : scene;
  }

  addCamera(camera, eye = camera) {
    if (!camera?.isCamera || !eye?.isCamera) throw new TypeError("`camera` is not a THREE.Camera");
    if (this.#isDisposed) return;
    const former = takeCamera(this.scene, camera, this);
    if (former !== this) former?.removeCamera(camera);
    if (former?.#cameras.size === 0) former.dispose();
    this.#cameras.set(camera, { ...this.#cameras.get(camera), eye });
  }

  removeCamera(camera) {
    if (this.#active?.camera === camera) this.#end();
    releaseCamera(this.scene, camera, this);
    const { view, pipeline, visible, late } = this.#cameras.get(camera) ?? {};
    for (const handle of [view, pipeline, visible, late]) handle?.destroy();
    this.#cameras.delete(camera);
  }

  dispose() {
    this.#end();
    this.#isDisposed = true;
    const { scene } = this;
    // A callback that somebody has put over this one still calls it: this one does nothing from now on.
    if (scene.onBeforeRender === this.#former.installed) {
      scene.onBeforeRender = this.#former.onBeforeRender;
      scene.onAfterRender = this.#former.onAfterRender;
    }
    for (const camera of [...this.#cameras.keys()]) this.removeCamera(camera);
    this.#followed?.destroy();
    this.#followed = this.#visibility = null;
    for (const { many } of this.#entries.values()) many?.dispose();
    this.#entries.clear();
    this.#order = [];
  }

  // Culling of a frame.

  #begin(renderer, camera, target) {
    // A frame that was not ended: the renderer threw, or this is a mirror's picture within it. If the frame
    // has not collected what it draws, it is not culled any more.
    if (this.#active?.camera === camera || this.#active?.isCollected === false) this.#end();
    else if (this.#active) this.#collected();
    if (this.#active || !this.enabled || !this.#visibility || !this.#cameras.has(camera)) return;
    const { scene } = this;
    if (camera.isArrayCamera || scene.overrideMaterial || renderer.opaque === false || !hasDepth(renderer, target)) return;
    const start = performance.now();
    const tools = this.#tools(camera);
    const { eye } = tools;
    this.#origin = originFor(eye, [...this.#cameras.values()], this.#origin, this.#largeSize);
    // WebGPURenderer has no planes of its own.
    const planes = (renderer.isWebGLRenderer && renderer.clippingPlanes) || [];
    this.#isClipped = planes.length > 0;
    tools.how = setView(tools.view, eye, this.#origin, planes);
    if (tools.how === null) return;
    // In the first frame of a camera, three.js has not yet told the camera that depth is reversed.
    const isReversed = renderer.state?.buffers?.depth?.getReversed?.() === true;
    this.#surfaces.begin(isReversed || camera.reversedDepth === true);
    this.#follow(camera);
    const followed = performance.now();
    const { occluders, visible, isVisible } = this.#cull(tools);
    const culled = performance.now();
    this.#hide(renderer, camera, isVisible);
    Object.assign(this.stats, {
      objects: this.#followed.count,
      visible,
      hidden: this.#active.hiddenCount,
      occluders,
      followMs: followed - start,
      cullMs: culled - followed,
      applyMs: performance.now() - culled,
      late: tools.late && { ...tools.late.stats, refusal: this.#followed.refusals.at(-1) ?? "" },
    });
  }

  /** Returns the view of a camera and what goes with it: that of the camera that it shows, if that is culled for too. */
  #tools(camera) {
    const own = this.#cameras.get(camera);
    const shown = this.#cameras.get(own.eye);
    const tools = shown?.eye === own.eye ? shown : own;
    if (!tools.view) {
      const { worker, zBuffer } = this.#options;
      const { width, height } = zBuffer;
      tools.view = this.#visibility.createView();
      tools.visible = this.#visibility.createVisible();
      tools.pipeline = this.#visibility.createPipeline().addFrustum();
      if (worker) {
        const { metres, degrees = 8 } = worker;
        const stages = [["addZBuffer", ...(width && height ? [width, height] : [])]];
        const options = { metres, radians: (degrees * Math.PI) / 180, stages };
        tools.late = new LateAnswers(this.#visibility, this.#followed, options);
      } else tools.pipeline.addZBuffer(width, height);
    }
    return tools;
  }

  /** Culls for a camera. Returns counts, and whether the object of an index is visible. */
  #cull({ eye, view, how, pipeline, visible, late }) {
    const cull = () => {
      const stats = pipeline.cull(this.#followed.local ?? this.#followed, view, visible);
      const { bits } = visible;
      if (late) {
        late.apply(view, how, bits, eye.layers.mask >>> 0);
        Object.assign(stats, { visible: countBits(bits), occluders: late.stats.occluders });
      }
      return { ...stats, isVisible: (index) => (bits[index >>> 5] >>> (index & 31)) & 1 };
    };
    const culled = cull();
    // What three.js does not draw hides nothing. It is looked for among what is visible: all else is behind
    // that, or beside the view, and hides nothing more. For the second culling that may be other objects.
    if (!this.#excludeUndrawn(eye, culled.isVisible)) return culled;
    this.#excludeUndrawn(eye, () => true);
    return cull();
  }

  /**
   * Lets entries that three.js leaves out hide nothing in this frame. Looks at those for whose indices
   * `isVisible` is true. Returns whether there were any.
   */
  #excludeUndrawn(eye, isVisible) {
    const frustum = frustumOf(eye);
    const mask = eye.layers.mask >>> 0;
    let isAny = false;
    for (const entry of this.#order) {
      const hides = entry.surface > Surface.Hideable && entry.count > 0 && !entry.waits;
      if (!hides || (entry.layers & mask) === 0 || !isLeftOut(entry, eye, frustum, isVisible)) continue;
      this.#stopHiding(entry);
      isAny = true;
    }
    return isAny;
  }

  // Following the scene.

  #follow(camera) {
    this.#frame++;
    this.#met = 0;
    this.#newTriangles = MOST_NEW_TRIANGLES;
    this.#isSameOrder = this.#isFollowed;
    this.#isFollowed = false;
    for (const entry of this.#added) entry.geometry = null;
    this.#added.length = this.#moved.length = 0;
    this.#visit(this.scene, true, 0, camera);
    if (!this.#isSameOrder || this.#met !== this.#order.length) {
      this.#order.length = this.#met;
      for (const entry of this.#entries.values()) {
        if (entry.frame === this.#frame) continue;
        this.#remove(entry);
        this.#freeSlots.push(entry.slot);
        this.#entries.delete(entry.object);
      }
    }
    this.#insert();
    for (const shape of this.#unused) if (shape.users === 0) shape.free(this.#followed);
    this.#unused.clear();
    this.#move();
    this.#followed.maintain();
    this.#isFollowed = true;
  }

  #visit(object, isShown, groupOrder, camera) {
    if (object.visible === false) isShown = false;
    if (object.isMesh) this.#meet(object, isShown, groupOrder);
    else if (object.isGroup) {
      if (isApart(object)) return;
      // Groups that are not on the camera's layers have no order, as in the renderer.
      if (object.layers.test(camera.layers)) groupOrder = object.renderOrder;
    } else if (object.isLOD && isShown && object.autoUpdate && object.layers.test(camera.layers)) {
      // Chooses the level that the renderer will choose: only that level is drawn.
      object.update(camera);
    }
    const { children } = object;
    for (let i = 0; i < children.length; i++) this.#visit(children[i], isShown, groupOrder, camera);
  }

  #meet(object, isShown, groupOrder) {
    let entry = this.#order[this.#met];
    if (entry?.object !== object) {
      this.#isSameOrder = false;
      entry = this.#entries.get(object) ?? this.#create(object);
    }
    // An object that is twice among children is drawn twice, and followed once.
    if (entry.frame === this.#frame) return;
    this.#order[this.#met++] = entry;
    entry.frame = this.#frame;

    const layers = isShown ? object.layers.mask >>> 0 : 0;
    const surface = groupOrder === 0 ? this.#surfaceOf(entry) : Surface.NeverHidden;
    if (surface !== entry.surface || object.geometry !== entry.geometry || this.#isAnew(entry)) {
      this.#remove(entry);
      // The content of a mesh that is not shown may be written without `needsUpdate`: it is read once the mesh
      // is shown.
      entry.surface = layers === 0 ? Surface.NeverHidden : surface;
      entry.geometry = object.geometry;
      if (entry.surface === Surface.NeverHidden || !this.#shape(entry)) return;
      entry.layers = layers;
      this.#added.push(entry);
      return;
    }
    if (entry.count === 0) return;
    if (layers !== entry.layers || entry.many?.layers) this.#setLayers(entry, layers);
    if (entry.origin !== this.#origin || this.#hasMoved(entry) || object.isSkinnedMesh) this.#moved.push(entry);
    else if (entry.waits) this.#setMeshes(entry);
  }

  #create(object) {
    const slot = this.#freeSlots.pop() ?? this.#entries.size;
    if (16 * slot === this.#worlds.length) {
      const worlds = new Float64Array(2 * this.#worlds.length);
      worlds.set(this.#worlds);
      this.#worlds = worlds;
    }
    const entry = new Entry(object, slot);
    this.#entries.set(object, entry);
    return entry;
  }

  /** Whether the matrix of a mesh, or of one of its instances, is not the one that the library has. */
  #hasMoved({ object, slot, matrices, version, many }) {
    const { elements } = object.matrixWorld;
    const worlds = this.#worlds;
    for (let i = 0; i < 16; i++) if (elements[i] !== worlds[16 * slot + i]) return true;
    if (many === null) return false;
    const present = matricesOf(object);
    return present !== matrices || present.version !== version;
  }

  /** Keeps the matrix of a mesh, the origin that it is relative to, and the version of its instances' matrices. */
  #keep(entry) {
    entry.origin = this.#origin;
    this.#worlds.set(entry.object.matrixWorld.elements, 16 * entry.slot);
    if (entry.many === null) return;
    entry.matrices = matricesOf(entry.object);
    entry.version = entry.matrices.version;
  }

  /** Returns the surface of a mesh in this frame, from properties that may change from frame to frame. */
  #surfaceOf(entry) {
    const { object } = entry;
    const { geometry, material } = object;
    if (!isUsual(object)) return Surface.NeverHidden;
    let surface;
    if (Array.isArray(material)) surface = this.#surfaces.ofAll(material, geometry);
    else {
      if (entry.known?.material !== material) entry.known = this.#surfaces.of(material);
      surface = this.#surfaces.refresh(entry.known);
    }
    if (!object.frustumCulled || isCountedElsewhere(object)) surface = Surface.NeverHidden;
    const { cullable, occluder } = this.#options;
    if (cullable) {
      const choice = cullable(object);
      if (choice === false) return Surface.NeverHidden;
      if (choice === true) surface = Math.max(surface, Surface.Hideable);
    }
    if (this.#isClipped && [material].flat().some(isUnclipped)) return Surface.NeverHidden;
    if (object.isSkinnedMesh) return Math.min(surface, Surface.Hideable);
    if (occluder && surface !== Surface.NeverHidden) {
      const choice = occluder(object);
      if (choice === false) surface = Surface.Hideable;
      else if (choice === true && surface === Surface.Hideable) surface = sideOf(material);
    }
    return surface;
  }

  /** Whether an entry has to be made anew: its geometry has changed, or its instances are others. */
  #isAnew({ object, shape, many }) {
    if (shape !== null && shape.frame !== this.#frame) {
      if (!shape.isCurrent()) return true;
      shape.frame = this.#frame;
    }
    if (many === null) return false;
    if (object.isInstancedMesh) return countOf(object) !== many.count;
    const infos = object._instanceInfo;
    // A batch that was disposed of has no matrices any more.
    return (
      !object._matricesTexture ||
      infos.length !== many.count ||
      infos.some((info, i) => partOf(info) !== many.parts[i])
    );
  }

  /** Returns the known shapes of a geometry, by part. None is known if it has changed anywhere. */
  #shapesOf(geometry) {
    let shapes = this.#shapes.get(geometry);
    if (!shapes?.get(NONE).isCurrent()) {
      shapes = new Map([[NONE, new Shape(geometry, EMPTY)]]);
      this.#shapes.set(geometry, shapes);
    }
    return shapes;
  }

  /** Finds the shapes of an entry. False if its geometry cannot be read, so that it is never hidden. */
  #shape(entry) {
    const { object, geometry } = entry;
    if (object.isBatchedMesh) return this.#shapeBatch(entry);
    const shapes = this.#shapesOf(geometry);
    if (!shapes.has(ALL)) shapes.set(ALL, new Shape(geometry));
    const shape = (entry.shape = shapes.get(ALL));
    if (object.isInstancedMesh) {
      entry.many = new Many(countOf(object));
      if (!hasInstances(object)) return false;
    } else if (object.isSkinnedMesh) {
      shape.bones ??= bonesOf(geometry);
      if (!shape.bones) return false;
    }
    return shape.box !== null;
  }

  #shapeBatch(entry) {
    const { object, geometry } = entry;
    const infos = object._instanceInfo;
    if (!hasInstances(object)) return false;
    const many = (entry.many = new Many(infos.length));
    many.parts = infos.map(partOf);
    const shapes = this.#shapesOf(geometry);
    for (const part of many.parts)
      if (!shapes.has(part)) shapes.set(part, new Shape(geometry, null, object.getGeometryRangeAt(part)));
    many.shapes = many.parts.map((part) => shapes.get(part));
    entry.shape = many.shapes[0] ?? null;
    many.layers = new Uint32Array(infos.length);
    return entry.shape?.position?.array?.length > 0;
  }

  #setLayers(entry, layers) {
    const { many, ids } = entry;
    entry.layers = layers;
    for (let i = 0; i < entry.count; i++) {
      const own = layersOf(entry, i);
      if (many?.layers) {
        if (many.layers[i] === own) continue;
        many.layers[i] = own;
      }
      this.#followed.setLayers(ids[i], own);
    }
  }

  #remove(entry) {
    if (entry.count > 0) {
      this.#followed.removeAll(entry.ids);
      for (const shape of shapesOf(entry)) if (--shape.users === 0) this.#unused.add(shape);
    }
    entry.many?.dispose();
    entry.ids = NO_IDS;
    entry.count = 0;
    entry.shape = entry.many = null;
    entry.waits = false;
  }

  /** Adds the entries of `#added` to the library. */
  #insert() {
    const count = this.#added.reduce((sum, { many }) => sum + (many?.count ?? 1), 0);
    if (count === 0) {
      this.#added.length = 0;
      return;
    }
    const boxes = new Float64Array(6 * count);
    const layers = new Uint32Array(count);
    let at = 0;
    for (const entry of this.#added) {
      this.#keep(entry);
      this.#boxes(entry, boxes, 6 * at);
      for (let i = 0; i < (entry.many?.count ?? 1); i++, at++) {
        layers[at] = layersOf(entry, i);
        if (entry.many?.layers) entry.many.layers[i] = layers[at];
      }
    }
    const ids = this.#followed.insertAll({ bounds: boxes, layers });
    at = 0;
    for (const entry of this.#added) {
      entry.count = entry.many?.count ?? 1;
      entry.ids = ids.slice(at, (at += entry.count));
      if (entry.many) entry.many.indices = Uint32Array.from(entry.ids, indexOf);
      else entry.index = indexOf(entry.ids[0]);
      if (entry.count > 0) for (const shape of shapesOf(entry)) shape.users++;
    }
    at = 0;
    for (const entry of this.#added) {
      this.#setMeshes(entry, boxes, 6 * at);
      at += entry.count;
    }
    this.#added.length = 0;
    this.#largeSize = largeSize(this.#order, this.#followed);
    if (2 * count > this.#followed.count) this.#followed.rebuild();
  }

  /**
   * Tells the library of the entries that have moved, or are to be placed relative to another origin. Those that have
   * moved hide nothing until they stand still for a frame.
   */
  #move() {
    if (this.#moved.length === 0) return;
    const count = this.#moved.reduce((sum, entry) => sum + entry.count, 0);
    const [ids, boxes] = [new BigUint64Array(count), new Float64Array(6 * count)];
    let at = 0;
    for (const entry of this.#moved) {
      this.#boxes(entry, boxes, 6 * at);
      ids.set(entry.ids, at);
      at += entry.count;
    }
    this.#followed.setAllBounds(ids, boxes);
    at = 0;
    for (const entry of this.#moved) {
      const hasMoved = this.#hasMoved(entry);
      this.#keep(entry);
      if (entry.surface > Surface.Hideable && !entry.waits) {
        // The entry's occluder meshes are at its former place, also if it has turned within the same box.
        this.#stopHiding(entry);
        if (!hasMoved) this.#setMeshes(entry, boxes, at);
      }
      at += 6 * entry.count;
    }
    this.#moved.length = 0;
  }

  /** Lets an entry hide nothing in this frame. */
  #stopHiding(entry) {
    entry.waits = true;
    for (const id of entry.ids) this.#followed.setFlags(id, 0);
  }

  /** Writes the boxes of an entry. */
  #boxes(entry, out, at) {
    const { object, shape, many } = entry;
    if (object.isSkinnedMesh) {
      skinnedBox(object, shape, out, at, this.#origin);
      return;
    }
    for (let i = 0; i < (many?.count ?? 1); i++, at += 6) {
      const { box } = many?.shapes?.[i] ?? shape;
      if (box === EMPTY) out.set(EMPTY, at);
      else {
        const margin = place(entry, i, matrix);
        moveBox(out, at, box, matrix.elements, this.#origin, margin);
      }
    }
  }

  /** Gives an entry its occluder meshes. `boxes` are its boxes, from `at` on, if they are known. */
  #setMeshes(entry, boxes, at = 0) {
    const { shape, many, surface, ids, count } = entry;
    entry.waits = false;
    if (surface <= Surface.Hideable) return;
    const { maxOccluderTriangles } = this.#options;
    const isToMake = (own) =>
      own.box !== EMPTY && !own.isMade(surface) && own.triangleCount <= maxOccluderTriangles;
    // It has no flags yet.
    entry.waits = this.#newTriangles <= 0 && shapesOf(entry).some(isToMake);
    if (entry.waits) return;
    if (!boxes) this.#boxes(entry, (boxes = new Float64Array(6 * count)), 0);
    for (let i = 0; i < count; i++) {
      const own = many?.shapes?.[i] ?? shape;
      if (own.box === EMPTY || !placeOccluder(entry, i, this.#origin, boxes, at + 6 * i, matrix)) continue;
      if (isToMake(own)) {
        // The entry hides nothing before all of it does.
        if (this.#newTriangles <= 0) return this.#stopHiding(entry);
        this.#newTriangles -= own.triangleCount;
      }
      const mesh = own.mesh(this.#followed, surface, maxOccluderTriangles);
      if (mesh === null) continue;
      this.#followed.setMesh(ids[i], mesh, matrix.elements);
      this.#followed.setFlags(ids[i], Flag.Occluder);
    }
  }

  // Hiding of meshes and instances, and their return.

  #hide(renderer, camera, isVisible) {
    const active = { camera, masked: [], undo: [], hiddenCount: 0, isCollected: false };
    this.#active = active;
    const mask = camera.layers.mask >>> 0;
    for (const entry of this.#order) {
      if (entry.count === 0 || (entry.layers & mask) === 0) continue;
      if (entry.many === null) {
        if (isVisible(entry.index)) continue;
        active.hiddenCount++;
      } else if (this.#leaveOut(entry, renderer, isVisible)) continue;
      // The mesh gets another object of layers. The mask of its own stays: several meshes may share it.
      entry.hidden ??= new HiddenLayers();
      entry.hidden.former = entry.object.layers;
      entry.object.layers = entry.hidden;
      active.masked.push(entry);
    }
    this.scene.children.push(this.#last);
  }

  /** Leaves out the hidden instances of an entry. False if all are hidden. */
  #leaveOut({ object, many }, renderer, isVisible) {
    const { indices, count } = many;
    const active = this.#active;
    const hidden = [];
    let shown = 0;
    for (let i = 0; i < count; i++) {
      if (many.layers?.[i] === 0) continue;
      shown++;
      if (!isVisible(indices[i])) hidden.push(i);
    }
    if (hidden.length === 0 || (hidden.length < shown && !canLeaveOut(object, renderer, this.#surfaces)))
      return true;
    active.hiddenCount += hidden.length;
    if (hidden.length === shown) return false;
    const isCamera = (camera) => active === this.#active && camera === active.camera;
    if (object.isBatchedMesh) active.undo.push(leaveOutOfBatch(object, hidden, isCamera));
    else {
      const order = many.orderOf(renderer);
      order.update(object);
      order.sort((i) => isVisible(indices[i]));
      this.#last.children.push(order.carrier);
      active.undo.push(leaveOutInstances(object, order, isCamera));
    }
    return true;
  }

  /** The renderer has collected what it draws: gives back the layers, and instances amid their drawing. */
  #collected() {
    const active = this.#active;
    active.isCollected = true;
    const { children } = this.scene;
    const at = children.lastIndexOf(this.#last);
    if (at >= 0) children.splice(at, 1);
    for (const { object, hidden } of active.masked.splice(0))
      if (object.layers === hidden) object.layers = hidden.former;
    for (const { restore } of active.undo) restore();
  }

  /** Ends a frame, after the scene is drawn: gives back layers, instances and callbacks. */
  #end() {
    if (!this.#active) return;
    this.#collected();
    for (const { end } of this.#active.undo) end();
    // Each carrier leads to the graphics card of a renderer.
    this.#last.children = [];
    this.#active = null;
  }
}
