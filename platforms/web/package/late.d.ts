// Culling in a worker. Its answers come late, and hide nothing by mistake.

import type { Numbers, ObjectId, Scene, View, Visibility } from "./visibility.js";

/** The number of bits that are set in words of 32, such as `Visible.bits`. */
export function countBits(words: Iterable<number>): number;

/**
 * Starts a worker of this package, which loads the library: with `frames` the small module, without portals; with `wasm`
 * that module, a compiled one or its bytes, where the package's own cannot be fetched.
 */
export function startWorker(options?: { frames?: boolean; wasm?: WebAssembly.Module | BufferSource }): Worker;

/**
 * A scene that workers follow, with the methods of `Scene` that change it. It takes a new scene without objects, which
 * is then changed by these methods alone. Boxes are in `local`, for pipelines of this thread; occluder meshes are with
 * the workers alone, and so is what it takes to make them. `lacks(local)` of a pipeline therefore says "hzb: occluders
 * with a mesh outside their bounds", of all of them. `rebuild` and `maintain` are as in `Scene`. A mesh that the
 * library refuses is told in `refusals`. An object that is given it hides nothing, and is placed as by any other mesh.
 */
export interface LateScene
  extends Pick<
    Scene,
    | "count"
    | "indexLimit"
    | "contains"
    | "bounds"
    | "insert"
    | "insertAll"
    | "remove"
    | "removeAll"
    | "setOrigin"
    | "setBounds"
    | "setAllBounds"
    | "setLocalBounds"
    | "setTransforms"
    | "setLayers"
    | "setFlags"
    | "maintain"
    | "rebuild"
    | "addMesh"
    | "addBoxMesh"
    | "removeMesh"
    | "setMesh"
    | "destroy"
  > {
  readonly local: Scene;
  /** The last 64 messages. */
  readonly refusals: string[];
  /** Number of calls so far. Answers tell for which number they are. */
  readonly revision: number;
  /**
   * As in `Scene`, in the workers: triangles are in coordinates of the scene. If the library refuses them, the object
   * has none.
   */
  setTriangles(id: ObjectId, triangles: Numbers): void;
  prepareOccluders(): void;
  /**
   * Asks worker `to` which objects are hidden from all points of a box. `then` gets a bit for each object, set if
   * it is hidden, and `revision`: the answer is good while `holds(revision)`, for objects with `isSame(index,
   * revision)`, and for cameras that see the layers of all occluders.
   */
  ask(
    question: { what: "hidden"; min: Numbers; max: Numbers },
    then: (answer: { bits: Uint32Array; revision: number; milliseconds: number }) => void,
    to?: number,
  ): void;
  /**
   * Asks worker `to` what is seen from a box: `bits` as of `Scene.seenFrom`, `seen` and `hidden` as of
   * `Scene.proveFrom`, for the scene after `revision` calls. The answer is good while `holds(revision)`, for objects with
   * `isSame(index, revision)`, and for cameras that see the layers of all occluders. `then` gets null if the worker
   * cannot tell: it has failed, or was started with `frames`. `refusals` then says why.
   */
  ask(
    question: { what: "region"; min: Numbers; max: Numbers; clearance?: number; mostSteps?: number },
    then: (
      answer: {
        bits: Uint32Array;
        seen: Uint32Array;
        hidden: Uint32Array;
        revision: number;
        milliseconds: number;
      } | null,
    ) => void,
    to?: number,
  ): void;
  /** Whether all that hid others after `revision` calls still does. */
  holds(revision: number): boolean;
  /** Whether the object of an index is as it was after `revision` calls. */
  isSame(index: number, revision: number): boolean;
}
export const LateScene: { new (scene: Scene, ports: readonly (Worker | MessagePort)[]): LateScene };

/** A stage of the worker's pipeline, after the frustum: a method of `Pipeline` and its parameters. */
export type LateStage =
  | readonly ["addZBuffer", number?, number?]
  /** Cells and portals are made from the triangles of all occluders, anew after each change. */
  | readonly ["addPortals", { maxCells?: number }?];

export interface LateOptions {
  /** Distance of the eye, and angle in radians, up to which an answer is good: 0.25 and 0.15 by default. */
  metres?: number;
  radians?: number;
  /** The z-buffer by default. */
  stages?: readonly LateStage[];
}

/** The late answers for the views of one camera. */
export class LateAnswers {
  constructor(visibility: Visibility, scene: LateScene, options?: LateOptions);
  /** The last frame: whether an answer was used and which, if not why, its age, and what the worker took for it. */
  readonly stats: { isUsed: boolean; number: number; reason: string; ageMs: number; workerMs: number; occluders: number };
  /**
   * Takes out of `bits`, a bit for each object that the frustum leaves, what the last answer hides from `view`.
   * Nothing, if the view is beyond the answer's reach or an occluder has changed since. `how` is how the view was
   * set. Asks for the next answer, if none is awaited.
   */
  apply(
    view: View,
    how: readonly ["setMatrix" | "setPerspective", ...unknown[]],
    bits: Uint32Array,
    layers?: number,
  ): Uint32Array;
  destroy(): void;
}
