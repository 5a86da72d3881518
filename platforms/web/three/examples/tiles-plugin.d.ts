import type { Camera, Scene } from "three";
import type { CullingOptions, VisibilityCulling } from "../visibility-three.js";

/** A plugin of `TilesRenderer`: tiles behind others are not drawn. `scene` is the one that `tiles.group` is in. */
export class VisibilityPlugin {
  constructor(options: { scene: Scene; camera: Camera } & CullingOptions);
  readonly name: string;
  readonly culling: VisibilityCulling;
  init(tiles: unknown): void;
  dispose(): void;
}
