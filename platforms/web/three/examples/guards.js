// Guards and thieves: what each guard sees is drawn on the floor, and thieves that no guard may see are dimmed.
//
//   const guards = await watch(scene, [guard], thieves, { height: 1.6 }); // once; then each frame:
//   guards.update();

import * as THREE from "three";
import { ScenePlan } from "visibility-three/plans.js";

/** `guards` are objects, `thieves` meshes. `options` are those of `ScenePlan.of`, and `range` in metres. */
export async function watch(scene, guards, thieves, { range = 30, ...options } = {}) {
  // People are no walls.
  const people = new Set([...guards, ...thieves]);
  const occluder = (mesh) => (people.has(mesh) ? false : undefined);
  const plan = await ScenePlan.of(scene, { occluder, ...options });
  const material = new THREE.MeshBasicMaterial({
    color: 0xffd166,
    transparent: true,
    opacity: 0.35,
    depthWrite: false,
  });
  const floors = guards.map(() => new THREE.Mesh(new THREE.BufferGeometry(), material));
  scene.add(...floors);
  const update = () => {
    guards.forEach((guard, i) => {
      floors[i].geometry.dispose();
      floors[i].geometry = plan.geometry(guard, { range });
    });
    const look = plan.whoSees(guards, thieves);
    for (const thief of thieves) thief.material.opacity = guards.some((guard) => look.sees(guard, thief)) ? 1 : 0.3;
  };
  return { plan, update };
}
