// A model in the library: its objects and occluders, the cullers that a person has chosen, and the objects
// that they leave for a camera.

import { BackSide, DoubleSide, Vector3 } from "three";
import { countBits } from "../package/late.js";
import { Flag } from "../package/visibility.js";
import { fillScene, firstTriangles, makeBuilding } from "./scene.js";
import { addOccluderMesh, isPlacedWell, isSideSure } from "../three/boxes.js";
import { add, basisOf } from "./camera.js";
import { hasItem, marginOfItem, turnTriangles } from "./items.js";
import { pause } from "./load.js";
import { Region, flagsOf } from "./region.js";
import { Workers } from "./workers.js";

/**
 * A mesh with more triangles hides nothing: to draw it into the z-buffer would take longer than it saves.
 */
const MOST_OCCLUDER_TRIANGLES = 1 << 14;
/** Greatest error of a coordinate of a vertex that is rounded to single precision, relative to it. */
const VERTEX_ROUNDING = 2 ** -24;
/** Microseconds of work that sets ahead of the eye get each frame. */
const AHEAD_MICROSECONDS = 3000;
/** Moments in seconds from now at which the eye's places are asked for. */
const AHEAD_SECONDS = [0, 0.1, 0.2, 0.4, 0.8];
const SLICE_MS = 20;

/**
 * Whether an item of a model may hide: single precision places it well in its box, and tells the side that is drawn.
 * `more` is how far it is moved by other rounding.
 */
function canHide({ side, reach }, matrix, bounds, item, more = 0) {
  const margin = marginOfItem(reach, matrix) + more;
  return isPlacedWell(bounds, 6 * item, matrix, margin) && (side === DoubleSide || isSideSure(matrix));
}

/**
 * Cullers on offer, in the order of the pipeline: name, and title in the panel. Those that need it draw occluders
 * in this thread; those of workers come last.
 */
export const STAGES = [
  { name: "frustum", title: "Outside the view" },
  { name: "size", title: "Smaller than a few pixels" },
  { name: "zbuffer", title: "Behind others: z-buffer", needsOccluders: true },
  { name: "horizon", title: "Behind houses and hills: horizon", needsOccluders: true },
  { name: "ahead", title: "Behind others: sets ahead of the eye", needsOccluders: true },
  { name: "portals", title: "Not through doors: portals" },
  { name: "baked", title: "Not from this cell: baked set" },
  { name: "late", title: "Behind others: z-buffer in a worker", inWorker: true },
  { name: "rooms", title: "Not through openings: portals, in a worker", inWorker: true },
  { name: "bake", title: "Not from this cell: baked while you look", inWorker: true },
];

/** The model of a file in the library's scene; occluders come later. */
export class Culling {
  /** Whether the axis that points up is z, as in the built-in scenes; y otherwise. */
  isZUp = false;
  /** Cells and baked set, where the scene has them. */
  building = {};
  /** Number of occluders in this thread and in workers, and of objects that may be. */
  #here = { made: 0, all: 0, milliseconds: 0, isDone: false };
  #there = { ...this.#here };
  milliseconds = 0;
  /** Number of objects that are drawn, and of those that workers have taken out. */
  count = 0;
  #leftByWorkers = [];
  #seen = new Uint32Array(0);
  #workers = null;
  /** The worker that looks from boxes, once one is asked for. */
  #region = null;
  /** By place, `here` and `there`: the occluders that are being made. */
  #making = {};
  #destroyed = false;

  constructor(visibility) {
    this.visibility = visibility;
    this.view = visibility.createView();
    this.visible = visibility.createVisible();
    this.inView = visibility.createVisible();
    this.frustum = visibility.createPipeline().addFrustum();
    this.pipeline = null;
  }

  /** Takes a built-in scene from its lists. Its occluders are made at once. */
  static ofLists(visibility, lists) {
    const culling = new Culling(visibility);
    const start = performance.now();
    const filled = fillScene(visibility, lists);
    culling.isZUp = true;
    culling.scene = filled.scene;
    culling.ids = filled.ids;
    culling.building = makeBuilding(visibility, lists, filled);
    const count = lists.triangleCounts.length;
    Object.assign(culling.#here, { made: count, all: count, milliseconds: performance.now() - start, isDone: true });
    culling.lists = lists;
    culling.objects = { bounds: filled.bounds, cost: lists.triangleCounts, flags: Flag.Occluder };
    return culling;
  }

  /**
   * Takes a model of a file. All its objects are there when this returns; `makeOccluders` adds what hides
   * them.
   */
  static ofModel(visibility, model) {
    const culling = new Culling(visibility);
    culling.scene = visibility.createScene();
    const flags = new Float64Array(model.count);
    for (const { first, count, seeThrough } of model.batches)
      flags.fill(seeThrough ? Flag.SeeThrough : 0, first, first + count);
    culling.objects = { bounds: model.bounds, cost: model.triangles, flags };
    culling.ids = culling.scene.insertAll(culling.objects);
    culling.scene.rebuild();
    culling.model = model;
    return culling;
  }

  /** Occluders of the chosen cullers. */
  get occluders() {
    return this.#needs.there ? this.#there : this.#here;
  }

  /** Where the chosen cullers need occluders: in this thread, and in workers. */
  get #needs() {
    const has = (property) => STAGES.some((stage) => stage[property] && this.chosen?.includes(stage.name));
    return { here: has("needsOccluders"), there: has("inWorker") };
  }

  /**
   * Makes the occluders that the chosen cullers need. Until all are there less is hidden, and nothing by
   * mistake. Workers make theirs while one looks on; here they are made in slices between frames.
   */
  async makeOccluders(progress) {
    const { here, there } = this.#needs;
    if (here && !this.#here.isDone && this.model)
      await (this.#making.here ??= this.#giveOccluders(this.scene, this.ids, this.#here, progress));
    if (there && !this.#there.isDone) {
      const { scene, ids } = this.#workers;
      await (this.#making.there ??= this.#giveOccluders(scene, ids, this.#there, progress));
    }
  }

  /** Gives the objects of a scene the meshes by which they hide others, in slices between frames. */
  async #giveOccluders(scene, ids, tally, progress) {
    const { model, lists } = this;
    // By shape: for matrices that mirror, and for others.
    const meshes = [new Map(), new Map()];
    const isSolid = model?.batches.flatMap(({ count, seeThrough }) => Array(count).fill(!seeThrough));
    tally.all = isSolid?.filter(Boolean).length ?? ids.length;
    const first = lists && firstTriangles(lists);
    const give = (item) => {
      if (lists) {
        scene.setTriangles(ids[item], lists.triangles.subarray(9 * first[item], 9 * first[item + 1]));
        return true;
      }
      const shape = model.shapes[item];
      const matrix = model.matrices[item];
      if (!isSolid[item] || !canHide(shape, matrix, model.bounds, item)) return false;
      const isMirrored = matrix.determinant() < 0;
      const known = meshes[Number(isMirrored)];
      if (!known.has(shape)) known.set(shape, this.#meshOf(scene, shape, isMirrored));
      const mesh = known.get(shape);
      if (mesh === null) return false;
      scene.setMesh(ids[item], mesh, matrix.elements);
      scene.setFlags(ids[item], Flag.Occluder);
      return true;
    };
    let sliced = performance.now();
    for (let item = 0; item < ids.length; item++) {
      tally.made += Number(give(item));
      const now = performance.now();
      if (now - sliced < SLICE_MS) continue;
      tally.milliseconds += now - sliced;
      progress(`Occluders: ${item} of ${ids.length} objects`);
      scene.flush?.();
      await pause();
      // The model is gone, or others have taken the place of its workers.
      if (this.#destroyed || (scene !== this.scene && scene !== this.#workers.scene)) return;
      sliced = performance.now();
    }
    if (lists) scene.prepareOccluders();
    tally.milliseconds += performance.now() - sliced;
    tally.isDone = true;
  }

  /**
   * Makes the occluder mesh of a shape, or returns null. The library keeps fronts as fronts under a mirroring
   * matrix, the graphics card takes them for backs.
   */
  #meshOf(scene, shape, isMirrored) {
    const { positions, triangles, side } = shape;
    if (triangles === 0 || triangles > MOST_OCCLUDER_TRIANGLES || !positions.every(Number.isFinite))
      return null;
    const indices = shape.indices();
    if ((side === BackSide) !== isMirrored) turnTriangles(indices);
    return addOccluderMesh(scene, { positions, indices, twoSided: side === DoubleSide });
  }

  /** Names of the stages that this scene has what they need for. */
  get offered() {
    return STAGES.filter(({ name }) => {
      if (name === "portals") return this.building.cells;
      if (name === "baked") return this.building.baked;
      return true;
    }).map(({ name }) => name);
  }

  /** Whether the model is small enough for proofs of what is seen from a box. */
  get canLookFromBox() {
    return Region.suits(this.objects.cost.reduce((sum, count) => sum + count, 0));
  }

  /**
   * Finds in a worker what is seen from all of a box around an eye, whose half sides are `half`. Resolves to what
   * `Region.look` does, with the box in the axes of the picture; null if the model is gone meanwhile.
   */
  async lookFromBox(eye, half, progress) {
    const { lists } = this;
    const give = () => (lists ? this.#trianglesOfLists() : this.#trianglesOfModel());
    this.#region ??= new Region(this.visibility, this.#provable(), give());
    const middle = this.#axes(eye);
    const box = { min: middle.map((x) => x - half), max: middle.map((x) => x + half) };
    const found = await this.#region.look(box, progress);
    return found && { ...found, ...this.#boxOfPicture(found) };
  }

  /** The objects with the flags that proofs need. */
  #provable() {
    const { batches } = this.model ?? {};
    const flags = this.lists
      ? flagsOf(true, true)
      : Float64Array.from(
          batches.flatMap(({ count, seeThrough, side }) => {
            return Array(count).fill(flagsOf(!seeThrough, side === DoubleSide));
          }),
        );
    return { ...this.objects, flags };
  }

  #trianglesOfLists() {
    const { lists } = this;
    const first = firstTriangles(lists);
    return (item) => lists.triangles.subarray(9 * first[item], 9 * first[item + 1]);
  }

  /** Returns a function that places the triangles of an item, with their fronts outside as they are drawn. */
  #trianglesOfModel() {
    const { shapes, matrices, bounds } = this.model;
    const point = new Vector3();
    return (item) => {
      const { positions, side } = shapes[item];
      const matrix = matrices[item];
      // Each vertex is rounded at its place.
      const farthest = Math.max(...bounds.subarray(6 * item, 6 * item + 6).map(Math.abs));
      if (!canHide(shapes[item], matrix, bounds, item, VERTEX_ROUNDING * farthest)) return null;
      const indices = shapes[item].indices();
      if ((side === BackSide) !== matrix.determinant() < 0) turnTriangles(indices);
      const triangles = new Float32Array(3 * indices.length);
      indices.forEach((vertex, i) => {
        point.fromArray(positions, 3 * vertex).applyMatrix4(matrix).toArray(triangles, 3 * i);
      });
      return triangles.every(Number.isFinite) ? triangles : null;
    };
  }

  /** Makes the pipeline of stages by their names. `size` is that of the scene in metres. */
  choose(names, { height, pixels, size, near }) {
    this.pipeline?.destroy();
    this.online?.destroy();
    this.online = null;
    const pipeline = (this.pipeline = this.visibility.createPipeline());
    const stages = {
      frustum: () => pipeline.addFrustum(),
      size: () => pipeline.addContribution(height, pixels),
      zbuffer: () => pipeline.addZBuffer(),
      horizon: () => pipeline.addHorizon({ up: this.isZUp ? "z" : "y" }),
      ahead: () => {
        const wide = size / 40;
        const cell = wide / 6;
        // The viewcell must hold the corners of the near plane, and half of it is the most.
        const margin = Math.min(cell / 2, Math.max(cell / 8, 2 * near));
        this.online = this.visibility.createOnline({
          viewcell: [cell, cell, cell],
          wide: [wide, wide, wide],
          margin,
        });
        pipeline.addOnline(this.online);
      },
      portals: () => pipeline.addPortals(this.building.cells),
      baked: () => pipeline.addPvs(this.building.baked),
    };
    this.chosen = this.offered.filter((name) => names.includes(name));
    for (const name of this.chosen) stages[name]?.();
    const late = STAGES.filter(({ name, inWorker }) => inWorker && this.chosen.includes(name));
    const bakes = this.chosen.includes("bake");
    if (late.length > 0 && (!this.#workers || (bakes && !this.#workers.canBake))) this.#startWorkers(bakes);
    this.#workers?.choose(
      late.map(({ name }) => name),
      { size, near },
    );
  }

  /** Starts workers in the place of those that there are. They get their occluders by `makeOccluders`. */
  #startWorkers(bakes) {
    this.#workers?.destroy();
    this.#workers = new Workers(this.visibility, this.objects, bakes);
    this.#there = { made: 0, all: 0, milliseconds: 0, isDone: false };
    this.#making.there = null;
  }

  /** A place or direction of the picture in the scene's own axes. */
  #axes([x, y, z]) {
    return this.isZUp ? [x, -z, y] : [x, y, z];
  }

  /** A place or direction of the scene in the axes of the picture. */
  #picture([x, y, z]) {
    return this.isZUp ? [x, z, -y] : [x, y, z];
  }

  /**
   * Culls for a camera: `eye`, `target`, `up`, `fovY`, `aspect`, `near`. `velocity` is in metres per second.
   */
  cull(camera, velocity = [0, 0, 0]) {
    const { eye, fovY, aspect, near } = camera;
    const { ahead, up } = basisOf(camera);
    const pose = { eye: this.#axes(eye), target: this.#axes(add(eye, ahead)), up: this.#axes(up) };
    const lens = { ...pose, fovY, aspect, near };
    this.view.setPerspective(lens);
    if (this.online) {
      const places = AHEAD_SECONDS.flatMap((t) => this.#axes(eye.map((x, i) => x + t * velocity[i])));
      this.online.step(this.scene, places, AHEAD_MICROSECONDS);
    }
    const start = performance.now();
    this.pipeline.cull(this.scene, this.view, this.visible);
    const seen = this.visible.bits;
    this.#leftByWorkers = this.#workers?.apply(this.view, lens, this.#axes(velocity), seen) ?? [];
    this.milliseconds = performance.now() - start;
    this.frustum.cull(this.scene, this.view, this.inView);
    this.#seen = seen;
    this.count = countBits(seen);
  }

  /** Text that changes with the answers of workers that hide something. */
  get answersUsed() {
    return this.#needs.there ? this.#workers.used : "";
  }

  /** What is hidden by workers in this frame: their answers, and boxes that are done. Null without workers. */
  get workers() {
    return this.#needs.there ? this.#workers.stats : null;
  }

  /** Boxes of the bake, in the axes of the picture. */
  get bakedBoxes() {
    const boxes = this.#needs.there ? this.#workers.boxes : [];
    return boxes.map((box) => this.#boxOfPicture(box));
  }

  /** A box of the scene in the axes of the picture. */
  #boxOfPicture({ min, max }) {
    const [a, b] = [this.#picture(min), this.#picture(max)];
    return { min: a.map((x, i) => Math.min(x, b[i])), max: a.map((x, i) => Math.max(x, b[i])) };
  }

  /** Bits of the objects of the last frame: those to draw, and those within the view. */
  get bits() {
    return { seen: this.#seen, inView: this.inView.bits };
  }

  /** What each stage has left over in the last frame, as [name, number of objects]. */
  get left() {
    const here = this.chosen.filter((name) => !STAGES.find((stage) => stage.name === name).inWorker);
    return [...here.map((name, stage) => [name, this.pipeline.stageStats(stage).visible]), ...this.#leftByWorkers];
  }

  /** Why an item was drawn, or was not, in the next frame. */
  explain(item, camera) {
    this.pipeline.setExplaining(true);
    this.cull(camera);
    const why = this.pipeline.explain(this.ids[item]);
    this.pipeline.setExplaining(false);
    return why === "visible" && !hasItem(this.#seen, item) ? "removed by a worker's answer" : why;
  }

  destroy() {
    this.#destroyed = true;
    const { cells, baked } = this.building;
    const handles = [
      this.pipeline,
      this.frustum,
      this.online,
      cells,
      baked,
      this.visible,
      this.inView,
      this.view,
    ];
    for (const handle of [...handles, this.scene, this.#workers, this.#region]) handle?.destroy();
  }
}
