import type { Mesh, Object3D, Scene } from "three";
import type { PlanOptions, ScenePlan, SightOptions } from "../plans.js";

/**
 * Draws on the floor what guards see, and dims thieves that no guard may see: at each `update`, once a frame. `range` is
 * how far guards see, in metres: 30 by default. Materials of thieves must be `transparent`, and their own.
 */
export function watch(
  scene: Scene,
  guards: readonly Object3D[],
  thieves: readonly Mesh[],
  options?: PlanOptions & SightOptions & { range?: number },
): Promise<{ plan: ScenePlan; update(): void }>;
