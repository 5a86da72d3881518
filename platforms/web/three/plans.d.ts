// Plans of a three.js scene, and who sees whom in it. World axes as in three.js, y up; plans are cuts across y.
//
// What hides is as in `VisibilityCulling`: opaque meshes, instances and batches, from the sides that are drawn. These do
// not: skinned and morphing meshes, those with a `renderOrder`, with `frustumCulled` false or with callbacks of their own,
// and what is in a `ClippingGroup` or `BundleGroup`. Of an `LOD` the first level hides, whichever is drawn. A plan is of the
// scene as it was when it was made: make another when walls have moved.

import type { Box3, BufferGeometry, Layers, Mesh, Object3D, Scene, Vector3 } from "three";
import type { Opacity, Visibility } from "visibility-web";

/** A place on a plan: an object, by its position in the world, or a point of the world. Its y does not count. */
export type Place = Object3D | { readonly x: number; readonly z: number };

/**
 * Something that looks or is looked at: an object, by the box around its position and all meshes within it as they are
 * now, a point, or a box that is not empty. The box of a skinned mesh takes all its vertices, that of instances all their
 * matrices, at each call: for crowds give boxes. A sprite counts with all ways that it may turn to; without
 * `sizeAttenuation`, as if it were as large in the world.
 */
export type Mover = Object3D | Vector3 | Box3;

export interface SightOptions {
  /** The whole library of `visibility-web`, if it is loaded already: not with `frames`. By default it is loaded, once. */
  visibility?: Visibility;
  /** Whether a mesh hides. `undefined` leaves it to its material; `true` makes it hide from both sides. */
  occluder?(mesh: Mesh): boolean | undefined;
  /** Meshes hide that a camera with these layers draws: by default layer 0 alone, as of a new camera. */
  layers?: Layers;
}

export interface PlanOptions {
  /**
   * Side of the cells that `whoSees` divides rooms into: a 16th of the plan's greater side by default, a 64th at least.
   * Smaller cells leave out more, and take longer: not much smaller than the boxes and margins of the movers.
   */
  grid?: number;
}

/** Who may see whom, of the movers of one call. */
export interface SightLook<Observer, Target> {
  /**
   * Whether an observer may see a target. False only if no straight line leads from anywhere the observer may be to
   * anywhere the target may be.
   */
  sees(observer: Observer, target: Target): boolean;
  /** The targets that an observer may see, in the order given. */
  seenBy(observer: Observer): Target[];
}

/** A piece of a cut: the x and z of its ends, what it does to sight, and the mesh and instance that it is of. */
export interface PlanWall {
  readonly from: readonly [number, number];
  readonly to: readonly [number, number];
  readonly opacity: Opacity;
  /** Null in a plan of polygons. */
  readonly mesh: Mesh | null;
  readonly instance: number;
}

/**
 * A scene, cut at a height: true of eyes and of what they look at there. It knows nothing of what one can look over or
 * under: cut at the eyes' height, or take `CellSight`.
 */
export class ScenePlan {
  /**
   * Cuts what hides in a scene at `height`, which walls must reach beyond: the eyes' height, not that of the ground that
   * walls stand on. Rejects with a `TypeError` if `height` is no finite number, or `grid` no length.
   */
  static of(scene: Scene | Object3D, options: PlanOptions & SightOptions & { height: number }): Promise<ScenePlan>;
  /** Makes a plan of closed polygons: corners as `[x, z]`, or as points of the world. `height` is 0 by default. */
  static ofPolygons(
    polygons: readonly (readonly (Place | readonly [number, number])[])[],
    options?: PlanOptions & Pick<SightOptions, "visibility"> & { height?: number },
  ): Promise<ScenePlan>;
  readonly height: number;
  readonly walls: readonly PlanWall[];
  /** Whether a straight line from `a` to `b` meets no wall. A wall of one side stops sight from its front alone. */
  sees(a: Place, b: Place): boolean;
  /** Corners of what an eye sees, at the plan's height. `range` is the greatest distance: infinite by default. */
  polygon(eye: Place, options?: { range?: number }): Vector3[];
  /** The area of `polygon` as triangles that face upwards, to be drawn: at the plan's height. */
  geometry(eye: Place, options?: { range?: number }): BufferGeometry;
  /** Meshes of which an eye sees some wall. */
  meshesSeen(eye: Place, options?: { range?: number }): Mesh[];
  /** Lets sight through all walls of an object, as of a door that opens, or stops it again. Returns how many there are. */
  setOpen(object: Object3D, isOpen: boolean): number;
  /**
   * Finds who may see whom: thousands of each in a call. `margin` is how far each may move until the answer is used, and
   * movers do not pass walls. Targets are the observers by default. Beyond the walls, and a quarter of their extent
   * around, a mover sees and is seen by all.
   */
  whoSees<Observer extends Mover, Target extends Mover = Observer>(
    observers: readonly Observer[],
    targets?: readonly Target[],
    options?: { margin?: number },
  ): SightLook<Observer, Target>;
  /** Frees its memory now instead of when it is collected. */
  dispose(): void;
}

/**
 * A scene in three dimensions, in cells: who may see whom, also over walls and through windows. Two movers may see each
 * other if a line leads from anywhere in the cells of one to anywhere in those of the other; outside of the cells a
 * mover sees and is seen by all. What hides are meshes one by one: a wall of many small pieces has seams, through which
 * its neighbours count as seen.
 */
export class CellSight {
  /**
   * Finds which cells see which: a sweep of milliseconds to a second for each. `cell` is their side, 4 by default; they
   * fill `box`, by default that around the scene: choose the part that movers are in. Rejects with a `RangeError` for
   * more than 16,384 cells, and where there is nothing to divide: no geometry, or an empty `box`.
   */
  static of(scene: Scene | Object3D, options?: SightOptions & { cell?: number; box?: Box3 }): Promise<CellSight>;
  /** Number of cells. */
  readonly count: number;
  /**
   * Finds who may see whom, thousands of each in a call. `margin` is how far each may move until the answer is used, in any
   * direction and through walls, too. Targets are the observers by default.
   */
  whoSees<Observer extends Mover, Target extends Mover = Observer>(
    observers: readonly Observer[],
    targets?: readonly Target[],
    options?: { margin?: number },
  ): SightLook<Observer, Target>;
  dispose(): void;
}
