// Culling for three.js: hides what the camera cannot see while a scene is drawn.

import type { Camera, Mesh, Scene } from "three";
import type { Visibility } from "visibility-web";

export interface CullingOptions {
  /** The library of `visibility-web`, if it is loaded already. By default it is loaded. */
  visibility?: Visibility;
  /**
   * Whether a mesh hides what is behind it. `undefined` leaves it to its material: see the README. Asked each
   * frame for each mesh, so keep it quick. `true` is a promise that the mesh is drawn, opaque, where its
   * triangles are. It is of no effect for a mesh that is never hidden, nor for materials of which some are
   * drawn from the front and some from the back.
   */
  occluder?(mesh: Mesh): boolean | undefined;
  /**
   * Whether a mesh may be hidden. `undefined` leaves it to the mesh and its material: see the README. Asked
   * each frame for each mesh. `true` is a promise that the mesh stays within the box of its geometry, and
   * that what is in front hides it: not with `depthTest: false`, `stencilWrite` or a negative
   * `polygonOffset`. Instances of a shader of your own are hidden all or none.
   */
  cullable?(mesh: Mesh): boolean | undefined;
  /** Greatest number of triangles of a mesh that hides others: 16384 by default. */
  maxOccluderTriangles?: number;
  /** Size of the software z-buffer in pixels, 16 to 4096 a side: 512 x 288 by default. */
  zBuffer?: { width?: number; height?: number };
  /**
   * Draws the z-buffer in a worker, so that frames do not wait for it. Its answer is for an earlier camera: it
   * is made for all within `metres` and `degrees` of that, and hides nothing from any other; nor after an
   * occluder has moved, changed or gone, until the next answer. So nothing is hidden by mistake, and less is
   * hidden than without. By default 0.25 m and 8 degrees. `port` is a worker of `visibility-web/late-worker.js`,
   * if your program has started it; without, one is started. `wasm` is the module that it takes, compiled or as bytes,
   * where it cannot fetch that of the package: of a program that loads `visibility` by hand.
   */
  worker?: {
    metres?: number;
    degrees?: number;
    port?: Worker | MessagePort;
    wasm?: WebAssembly.Module | BufferSource;
  };
}

/** What the last culled frame was. Objects are meshes, or instances of meshes. */
export interface CullingStats {
  /** Objects that the culling follows. Those that are never hidden are not among them. */
  objects: number;
  /** Objects of these that the camera may see. */
  visible: number;
  /** Objects that were not drawn for the camera. Without culling, three.js would have drawn some of them. */
  hidden: number;
  /** Objects that were drawn into the software z-buffer. */
  occluders: number;
  /** Milliseconds: following the scene, culling, and hiding. */
  followMs: number;
  cullMs: number;
  applyMs: number;
  /**
   * With `worker`: whether its answer was used in this frame, why not, how old it is, and what it took. `refusal` is
   * the last message of the worker, empty if there was none: a mesh that hides nothing, or why it does not work at all.
   */
  late?: { isUsed: boolean; reason: string; ageMs: number; workerMs: number; refusal: string };
}

/** Culls a scene for its cameras, each time that one of them draws it. */
export class VisibilityCulling {
  /**
   * Follows a scene from now on. Until the library is loaded, nothing is hidden. A camera that another culling
   * has for the scene is taken from it; a culling that has lost its last camera so is disposed of. Throws a
   * `TypeError` if `scene` is not a `THREE.Scene` or a camera is not a `THREE.Camera`.
   */
  constructor(scene: Scene, cameras: Camera | readonly Camera[], options?: CullingOptions);
  readonly scene: Scene;
  /** Resolves once the library is loaded; rejects if it cannot be. */
  readonly ready: Promise<void>;
  /** Whether frames are culled. */
  enabled: boolean;
  readonly stats: CullingStats;
  /**
   * Culls for a camera, too. With `eye`, what `camera` draws is what `eye` sees: to look from above at what
   * is left of the scene. The matrices of `eye` must be up to date.
   */
  addCamera(camera: Camera, eye?: Camera): void;
  removeCamera(camera: Camera): void;
  /** Ends the culling, frees its memory and gives the scene its callbacks back. */
  dispose(): void;
}
