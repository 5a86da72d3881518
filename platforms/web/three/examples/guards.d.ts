import type { Mesh, Object3D, Scene } from "three";
import type { PlanOptions, ScenePlan, SightOptions } from "../plans.js";

/**
 * Draws what guards see, at the plan's height, and dims thieves that no guard may see: at each `update`, once a frame. `range` is
 * how far guards see, in metres: 30 by default. Materials of thieves must be `transparent`, and their own.
 */
export function watch(
  scene: Scene,
  guards: readonly Object3D[],
  thieves: readonly Mesh[],
  options: PlanOptions & SightOptions & { height: number; range?: number },
): Promise<{ plan: ScenePlan; update(): void }>;
