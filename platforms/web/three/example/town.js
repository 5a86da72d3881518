// The town of the example: streets of houses, and what stands in them.

import * as THREE from "three";

/** Metres from one house to the next, and number of things that stand around each. */
const PITCH = 26;
const AROUND = 24;

/** Shapes on offer: geometry, colours, and whether it is a house. */
function kinds() {
  const house = new THREE.BoxGeometry(1, 1, 1).translate(0, 0.5, 0);
  return [
    { geometry: house, color: 0xb9a58c },
    { geometry: new THREE.IcosahedronGeometry(0.5, 2).translate(0, 0.9, 0), color: 0x4f7a3c },
    { geometry: new THREE.CylinderGeometry(0.06, 0.09, 1, 10).translate(0, 0.5, 0), color: 0x50545a },
    { geometry: new THREE.BoxGeometry(1, 0.35, 0.45).translate(0, 0.25, 0), color: 0xa33b2f },
    { geometry: new THREE.TorusKnotGeometry(0.3, 0.1, 48, 8).translate(0, 0.5, 0), color: 0xd9a441 },
    { geometry: new THREE.ConeGeometry(0.4, 1, 12).translate(0, 0.5, 0), color: 0x2f6f8f },
  ];
}

/**
 * Puts `count` objects into a scene: as meshes, as instances of a mesh each kind, or as instances of a batch.
 */
export function fillTown(scene, count, as) {
  let state = 7;
  const random = () => (state = (Math.imul(state, 1664525) + 1013904223) >>> 0) / 2 ** 32;
  const between = (a, b) => a + (b - a) * random();
  const all = kinds();
  const places = all.map(() => []);
  // An odd number, so that the walk is in streets.
  const row = Math.ceil(Math.sqrt(count / (AROUND + 1))) | 1;
  const middle = ((row - 1) * PITCH) / 2;
  for (let i = 0, at = 0; at < count; i++) {
    const x = (i % row) * PITCH - middle;
    const z = Math.floor(i / row) * PITCH - middle;
    const place = (kind, dx, dz, size, turn) => {
      if (at++ >= count) return;
      const rotation = new THREE.Quaternion().setFromAxisAngle(new THREE.Vector3(0, 1, 0), turn);
      places[kind].push(new THREE.Matrix4().compose(new THREE.Vector3(x + dx, 0, z + dz), rotation, size));
    };
    place(
      0,
      0,
      0,
      new THREE.Vector3(between(17, 20), between(8, 20) + 25 * random() ** 6, between(17, 20)),
      0,
    );
    // No two of them meet: where surfaces do, the picture depends on the order in which they are drawn.
    for (let k = 0; k < AROUND; k++) {
      const along = -11.5 + 1.9 * (k >> 1);
      const [dx, dz] = k % 2 ? [along, 11.4] : [11.4, along];
      const size = between(0.6, 1.7);
      place(
        1 + Math.floor(random() * 5),
        dx,
        dz,
        new THREE.Vector3(size, size * between(0.8, 1.6), size),
        between(0, 6),
      );
    }
  }
  const material = (color) => new THREE.MeshStandardMaterial({ color, roughness: 0.9 });
  const add = (object) => {
    object.castShadow = object.receiveShadow = true;
    scene.add(object);
    return object;
  };
  if (as === "batch") {
    const triangles = all.reduce(
      (sum, { geometry }) => sum + (geometry.index ?? geometry.attributes.position).count,
      0,
    );
    const batch = add(new THREE.BatchedMesh(count, triangles, triangles, material(0xffffff)));
    all.forEach(({ geometry, color }, kind) => {
      if (!geometry.index) geometry.setIndex([...Array(geometry.attributes.position.count).keys()]);
      const part = batch.addGeometry(geometry);
      for (const matrix of places[kind]) {
        const instance = batch.addInstance(part);
        batch.setMatrixAt(instance, matrix);
        batch.setColorAt(instance, new THREE.Color(color));
      }
    });
  }
  all.forEach(({ geometry, color }, kind) => {
    if (as === "instances") {
      const mesh = add(new THREE.InstancedMesh(geometry, material(color), places[kind].length));
      places[kind].forEach((matrix, i) => mesh.setMatrixAt(i, matrix));
    } else if (as === "meshes") {
      const shared = material(color);
      for (const matrix of places[kind]) {
        const mesh = add(new THREE.Mesh(geometry, shared));
        matrix.decompose(mesh.position, mesh.quaternion, mesh.scale);
      }
    }
  });
  const size = row * PITCH;
  const ground = add(
    new THREE.Mesh(new THREE.PlaneGeometry(size, size).rotateX(-Math.PI / 2), material(0x77746c)),
  );
  ground.name = "ground";
  ground.position.y = -0.01;
}

/** Moves a camera along the walk: down a street, around a corner, up over the roofs and back. */
export function pathThrough(seconds, camera) {
  const at = (seconds / 60) % 1;
  const [from, to] = [-5.5 * PITCH, 6.5 * PITCH];
  const height = 1.7 + 40 * Math.max(0, Math.sin(2 * Math.PI * at) - 0.6);
  const turn = (4 * at) % 1;
  const corners = [
    [from, from],
    [to, from],
    [to, to],
    [from, to],
    [from, from],
  ];
  const [[x0, z0], [x1, z1]] = corners.slice(Math.floor(4 * at));
  camera.position.set(x0 + (x1 - x0) * turn, height, z0 + (z1 - z0) * turn);
  camera.rotation.set(0, 0.5 * Math.sin(seconds / 2) - Math.atan2(x1 - x0, -(z1 - z0)), 0);
}
