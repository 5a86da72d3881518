// The built-in scenes as models: colours for their triangles, and the walks through them.

import { Color, DoubleSide, MeshStandardMaterial } from "three";
import { modelOfTriangles } from "./items.js";
import { cameras } from "./scene.js";

/** Scenes on offer: recipe and sizes, what a person reads, and colours. */
export const BUILT_IN = {
  city: {
    recipe: ["plpcity", 2, 2],
    title: "City of streets and blocks",
    walls: ["#c9b79c", "#b98f74", "#d8d0c0", "#a9a39a", "#c7a58a", "#9db0b5"],
    roofs: ["#8d8478", "#9a6a55", "#7f8a8c"],
  },
  office: {
    recipe: ["office", 2, 16],
    title: "Office building, 2 floors",
    walls: ["#ebe6dc", "#dfe7ea", "#e8dfd0", "#cfdcd3", "#d9c9b8"],
    roofs: ["#b08c66", "#a6846a"],
  },
  london: {
    recipe: ["london", 12, 12],
    title: "Streets of London",
    walls: ["#b5714f", "#c98f6b", "#a05f46", "#d9cdb8", "#bfae95", "#93705c"],
    roofs: ["#5c5f66", "#6b5a54", "#747a80"],
  },
};

/** A point or direction of a scene whose z axis points up, in the axes of glTF. */
const yUp = ([x, y, z]) => [x, z, -y];

/**
 * Returns the model of a scene's lists, the cameras at the keys of its walks, and the distance `near` of the
 * near plane in metres.
 */
export function builtIn(name, lists) {
  const { walls, roofs } = BUILT_IN[name];
  const palettes = [walls, roofs].map((names) => names.map((hex) => new Color(hex)));
  const triangles = new Float32Array(lists.triangles.length);
  for (let i = 0; i < triangles.length; i += 3)
    [triangles[i], triangles[i + 1], triangles[i + 2]] = yUp(lists.triangles.subarray(i, i + 3));
  const colors = new Float32Array(triangles.length);
  let at = 0;
  lists.triangleCounts.forEach((count, item) => {
    const hue = (item * 2654435761) >>> 0;
    for (const end = at + 9 * count; at < end; at += 9) {
      const [ax, ay, az, bx, by, bz, cx, cy, cz] = triangles.subarray(at, at + 9);
      const normal = [
        (by - ay) * (cz - az) - (bz - az) * (cy - ay),
        (bz - az) * (cx - ax) - (bx - ax) * (cz - az),
        (bx - ax) * (cy - ay) - (by - ay) * (cx - ax),
      ];
      const palette = palettes[normal[1] > 0.5 * Math.hypot(...normal) ? 1 : 0];
      const { r, g, b } = palette[(hue >>> 8) % palette.length];
      for (let i = 0; i < 9; i += 3) colors.set([r, g, b], at + i);
    }
  });
  const material = new MeshStandardMaterial({ vertexColors: true, roughness: 0.9, side: DoubleSide });
  const counts = lists.triangleCounts;
  const keys = cameras(lists, 1);
  const walk = keys.map(({ eye, target, fovY }) => ({
    eye: yUp(eye),
    target: yUp(target),
    up: [0, 1, 0],
    fovY,
  }));
  return { model: modelOfTriangles({ counts, triangles, colors, material }), walk, near: keys[0].near };
}
