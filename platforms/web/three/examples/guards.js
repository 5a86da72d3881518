// Guards and thieves: what each guard sees is drawn at the plan's height, and thieves that no guard may see are dimmed.
//
//   const guards = await watch(scene, [guard], thieves, { height: 1.6 }); // once; then each frame:
//   guards.update();

import * as THREE from "three";
import { ScenePlan } from "visibility-three/plans.js";

/** `guards` are objects, `thieves` meshes. `options` are those of `ScenePlan.of`, and `range` in metres. */
export async function watch(scene, guards, thieves, { range = 30, ...options }) {
  // People are no walls, nor is what they wear.
  const people = new Set();
  for (const person of [...guards, ...thieves]) person.traverse((part) => people.add(part));
  const occluder = (mesh) => (people.has(mesh) ? false : options.occluder?.(mesh));
  const plan = await ScenePlan.of(scene, { ...options, occluder });
  const material = new THREE.MeshBasicMaterial({
    color: 0xffd166,
    transparent: true,
    opacity: 0.35,
    depthWrite: false,
  });
  const areas = guards.map(() => new THREE.Mesh(new THREE.BufferGeometry(), material));
  scene.add(...areas);
  const update = () => {
    guards.forEach((guard, i) => {
      areas[i].geometry.dispose();
      areas[i].geometry = plan.geometry(guard, { range });
    });
    const look = plan.whoSees(guards, thieves);
    for (const thief of thieves) thief.material.opacity = guards.some((guard) => look.sees(guard, thief)) ? 1 : 0.3;
  };
  return { plan, update };
}
