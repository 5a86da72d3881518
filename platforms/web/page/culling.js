// A model in the library: its objects and occluders, the cullers that a person has chosen, and the objects
// that they leave for a camera.

import { BackSide, DoubleSide } from "three";
import { Flag } from "../package/visibility.js";
import { fillScene, makeBuilding } from "./scene.js";
import { isPlacedWell } from "../three/boxes.js";
import { add, basisOf } from "./camera.js";
import { marginOfItem, turnTriangles } from "./items.js";
import { pause } from "./load.js";

/**
 * A mesh with more triangles hides nothing: to draw it into the z-buffer would take longer than it saves.
 */
const MOST_OCCLUDER_TRIANGLES = 1 << 14;
/** Microseconds of work that sets ahead of the eye get each frame. */
const AHEAD_MICROSECONDS = 3000;
/** Moments in seconds from now at which the eye's places are asked for. */
const AHEAD_SECONDS = [0, 0.1, 0.2, 0.4, 0.8];
const SLICE_MS = 20;

/** Cullers on offer, in the order of the pipeline: name, and title in the panel. */
export const STAGES = [
  { name: "frustum", title: "Outside the view" },
  { name: "size", title: "Smaller than a few pixels" },
  { name: "zbuffer", title: "Behind others: z-buffer" },
  { name: "ahead", title: "Behind others: sets ahead of the eye" },
  { name: "portals", title: "Not through doors: portals" },
  { name: "baked", title: "Not from this cell: baked set" },
];

/** The model of a file in the library's scene; occluders come later. */
export class Culling {
  /** Whether the axis that points up is z, as in the built-in scenes; y otherwise. */
  isZUp = false;
  /** Cells and baked set, where the scene has them. */
  building = {};
  /** Number of occluders, and of objects that may be. */
  occluders = { made: 0, all: 0, milliseconds: 0, isDone: false };
  milliseconds = 0;
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
    culling.occluders = { made: count, all: count, milliseconds: performance.now() - start, isDone: true };
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
    culling.ids = culling.scene.insertAll({ bounds: model.bounds, cost: model.triangles, flags });
    culling.scene.rebuild();
    culling.model = model;
    return culling;
  }

  /**
   * Gives objects the meshes by which they hide others, in slices between frames. Until all are there less is
   * hidden, and nothing by mistake.
   */
  async makeOccluders(progress) {
    const { model, scene, ids } = this;
    if (!model || this.occluders.isDone) return;
    // By shape: for matrices that mirror, and for others.
    const meshes = [new Map(), new Map()];
    const isSolid = model.batches.flatMap(({ count, seeThrough }) => Array(count).fill(!seeThrough));
    this.occluders.all = isSolid.filter(Boolean).length;
    let sliced = performance.now();
    for (let item = 0; item < model.count; item++) {
      const shape = model.shapes[item];
      const matrix = model.matrices[item];
      if (isSolid[item] && isPlacedWell(model.bounds, 6 * item, marginOfItem(shape.reach, matrix))) {
        const isMirrored = matrix.determinant() < 0;
        const known = meshes[Number(isMirrored)];
        if (!known.has(shape)) known.set(shape, this.#meshOf(shape, isMirrored));
        const mesh = known.get(shape);
        if (mesh !== null) {
          scene.setMesh(ids[item], mesh, matrix.elements);
          scene.setFlags(ids[item], Flag.Occluder);
          this.occluders.made++;
        }
      }
      const now = performance.now();
      if (now - sliced < SLICE_MS) continue;
      this.occluders.milliseconds += now - sliced;
      progress(`Occluders: ${item} of ${model.count} objects`);
      await pause();
      if (this.#destroyed) return;
      sliced = performance.now();
    }
    this.occluders.milliseconds += performance.now() - sliced;
    this.occluders.isDone = true;
    // Positions for occluders are in the library now.
    model.shapes = [];
    model.matrices = [];
  }

  /**
   * Makes the occluder mesh of a shape, or returns null. The library keeps fronts as fronts under a mirroring
   * matrix, the graphics card takes them for backs.
   */
  #meshOf({ geometry, side }, isMirrored) {
    const { index, attributes } = geometry;
    const triangles = index.count / 3;
    const positions = attributes.position.array;
    if (triangles === 0 || triangles > MOST_OCCLUDER_TRIANGLES || !positions.every(Number.isFinite))
      return null;
    let indices = index.array;
    if ((side === BackSide) !== isMirrored) {
      indices = indices.slice();
      turnTriangles(indices);
    }
    return this.scene.addMesh({ positions, indices, twoSided: side === DoubleSide });
  }

  /** Names of the stages that this scene has what they need for. */
  get offered() {
    return STAGES.filter(({ name }) => {
      if (name === "portals") return this.building.cells;
      if (name === "baked") return this.building.baked;
      return true;
    }).map(({ name }) => name);
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
    for (const name of this.chosen) stages[name]();
  }

  /** A place or direction of the picture in the scene's own axes. */
  #axes([x, y, z]) {
    return this.isZUp ? [x, -z, y] : [x, y, z];
  }

  /**
   * Culls for a camera: `eye`, `target`, `up`, `fovY`, `aspect`, `near`. `velocity` is in metres per second.
   */
  cull(camera, velocity = [0, 0, 0]) {
    const { eye, fovY, aspect, near } = camera;
    const { ahead, up } = basisOf(camera);
    const pose = { eye: this.#axes(eye), target: this.#axes(add(eye, ahead)), up: this.#axes(up) };
    this.view.setPerspective({ ...pose, fovY, aspect, near });
    if (this.online) {
      const places = AHEAD_SECONDS.flatMap((t) => this.#axes(eye.map((x, i) => x + t * velocity[i])));
      this.online.step(this.scene, places, AHEAD_MICROSECONDS);
    }
    const start = performance.now();
    this.pipeline.cull(this.scene, this.view, this.visible);
    this.milliseconds = performance.now() - start;
    this.frustum.cull(this.scene, this.view, this.inView);
  }

  /** Bits of the objects of the last frame: those to draw, and those within the view. */
  get bits() {
    return { seen: this.visible.bits, inView: this.inView.bits };
  }

  /** What each stage has left over in the last frame, as [name, number of objects]. */
  get left() {
    return this.chosen.map((name, stage) => [name, this.pipeline.stageStats(stage).visible]);
  }

  /** Why an item was drawn, or was not, in the next frame. */
  explain(item, camera) {
    this.pipeline.setExplaining(true);
    this.cull(camera);
    const why = this.pipeline.explain(this.ids[item]);
    this.pipeline.setExplaining(false);
    return why;
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
    for (const handle of [...handles, this.scene]) handle?.destroy();
  }
}
