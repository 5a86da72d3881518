// Tests of plans and of who sees whom: three.js' own `Raycaster`, which shares no code with them, says what a line meets.

import assert from "node:assert/strict";
import { readFile } from "node:fs/promises";
import test from "node:test";
import * as THREE from "three";
import { load } from "visibility-web";
import { watch } from "../examples/guards.js";
import { CellSight, ScenePlan } from "../plans.js";
import { BOX, randomOf } from "./scenes.js";

const visibility = await load();
const HEIGHT = 1.5;
const SIDES = [THREE.FrontSide, THREE.BackSide, THREE.DoubleSide];

const at = (x, z, y = HEIGHT) => new THREE.Vector3(x, y, z);

/** Whether three.js finds nothing between two points. */
function isClear(hiding, a, b) {
  const way = b.clone().sub(a);
  const raycaster = new THREE.Raycaster(a, way.clone().normalize(), 0, way.length());
  return raycaster.intersectObjects(hiding, false).length === 0;
}

/** A yard with things of all kinds. Those that hide are in `hiding`, others in `clear`. */
function yard(random) {
  const between = (low, high) => low + (high - low) * random();
  const scene = new THREE.Scene();
  const group = new THREE.Group();
  group.position.set(between(-3, 3), between(-1, 1), between(-3, 3));
  group.rotation.y = between(0, 6);
  scene.add(group);
  const material = () => new THREE.MeshBasicMaterial({ side: SIDES[Math.floor(random() * 3)] });
  const put = (object) => {
    object.position.set(between(-20, 20), between(0, 2), between(-20, 20));
    object.scale.set(between(1, 6), between(2, 8), between(0.1, 1) * (random() < 0.3 ? -1 : 1));
    object.rotation.set(between(-0.4, 0.4), between(0, 6), between(-0.4, 0.4));
    return object;
  };
  const hiding = [];
  for (let i = 0; i < 12; i++) {
    const geometry = i % 3 ? BOX : new THREE.TorusKnotGeometry(0.4, 0.12, 24, 6);
    hiding.push(put(new THREE.Mesh(geometry, material())));
    (i % 2 ? group : scene).add(hiding[i]);
  }
  const place = () => {
    const object = put(new THREE.Object3D());
    object.scale.z = Math.abs(object.scale.z);
    object.updateMatrix();
    return object.matrix;
  };
  const instances = new THREE.InstancedMesh(BOX, material(), 5);
  for (let i = 0; i < 5; i++) instances.setMatrixAt(i, place());
  instances.count = 4;
  const batch = new THREE.BatchedMesh(4, 200, 600, material());
  const parts = [BOX, new THREE.ConeGeometry(0.5, 1, 7)].map((geometry) => batch.addGeometry(geometry));
  for (let i = 0; i < 4; i++) batch.setMatrixAt(batch.addInstance(parts[i % 2]), place());
  batch.setVisibleAt(1, false);
  group.add(instances, batch);
  hiding.push(instances, batch);
  const clear = [
    put(new THREE.Mesh(BOX, new THREE.MeshBasicMaterial({ transparent: true, opacity: 0.5 }))),
    put(new THREE.Mesh(BOX, new THREE.MeshBasicMaterial())),
  ];
  clear[1].visible = false;
  scene.add(...clear);
  scene.updateMatrixWorld();
  for (const many of [instances, batch]) many.computeBoundingSphere();
  return { scene, hiding, clear, group };
}

test("sight lines of a plan are those of three.js' raycaster", async () => {
  const random = randomOf(5);
  const counts = [0, 0];
  for (let world = 0; world < 6; world++) {
    const { scene, hiding } = yard(random);
    const plan = await ScenePlan.of(scene, { height: HEIGHT, visibility });
    for (let pair = 0; pair < 150; pair++) {
      const [a, b] = [0, 1].map(() => at(44 * random() - 22, 44 * random() - 22));
      const expected = isClear(hiding, a, b);
      assert.equal(plan.sees(a, b), expected, `world ${world}, pair ${pair}: ${a.toArray()} to ${b.toArray()}`);
      counts[Number(expected)]++;
    }
    plan.dispose();
  }
  assert.ok(counts[0] > 100 && counts[1] > 100, `blocked and clear: ${counts}`);
});

test("an eye sees the points of its polygon and no others", async () => {
  const random = randomOf(9);
  const counts = [0, 0];
  for (let world = 0; world < 4; world++) {
    const { scene, hiding } = yard(random);
    const plan = await ScenePlan.of(scene, { height: HEIGHT, visibility });
    const eye = at(30 * random() - 15, 30 * random() - 15);
    const area = new THREE.Mesh(plan.geometry(eye, { range: 25 }), new THREE.MeshBasicMaterial());
    for (let point = 0; point < 150; point++) {
      const to = at(30 * random() - 15, 30 * random() - 15);
      // From above, as it is drawn.
      const isIn = new THREE.Raycaster(at(to.x, to.z, 9), new THREE.Vector3(0, -1, 0)).intersectObject(area).length > 0;
      const expected = isClear(hiding, eye, to) && eye.distanceTo(to) < 24.5;
      if (eye.distanceTo(to) > 24.5 && eye.distanceTo(to) < 25) continue;
      assert.equal(isIn, expected, `world ${world}, point ${point}: ${eye.toArray()} to ${to.toArray()}`);
      counts[Number(expected)]++;
    }
    plan.dispose();
  }
  assert.ok(counts[0] > 50 && counts[1] > 50, `unseen and seen: ${counts}`);
});

/** Two rooms with a door between them, at x = 0, in the wall along z. */
function rooms() {
  const scene = new THREE.Scene();
  const wall = (x, z, width, depth) => {
    const mesh = new THREE.Mesh(BOX, new THREE.MeshBasicMaterial());
    mesh.position.set(x, 1.5, z);
    mesh.scale.set(width, 3, depth);
    scene.add(mesh);
    return mesh;
  };
  for (const z of [-5, 5]) wall(0, z, 20.4, 0.2);
  for (const x of [-10, 10]) wall(x, 0, 0.2, 10.2);
  for (const z of [-3, 3]) wall(0, z, 0.2, 4);
  return { scene, door: wall(0, 0, 0.1, 2), wall };
}

test("a door opens and closes for lines of sight and for who sees whom", async () => {
  const { scene, door } = rooms();
  const plan = await ScenePlan.of(scene, { height: HEIGHT, visibility });
  const [a, b, aside] = [at(-5, 0), at(5, 0), at(5, 4.5)];
  const answers = () => {
    const who = plan.whoSees([a], [b, aside]);
    return [plan.sees(a, b), plan.sees(a, aside), who.sees(a, b), who.sees(a, aside), who.seenBy(a).length];
  };
  assert.deepEqual(answers(), [false, false, false, false, 0], "closed");
  assert.ok(plan.setOpen(door, true) >= 4, "the door has walls");
  assert.deepEqual(answers(), [true, false, true, false, 1], "open");
  assert.deepEqual(plan.whoSees([a, b]).seenBy(b).includes(a), true, "movers among each other");
  // Within 4 m of its way the one aside comes before the door.
  assert.equal(plan.whoSees([a], [aside], { margin: 4 }).sees(a, aside), true, "with a margin");
  plan.setOpen(door, false);
  assert.deepEqual(answers(), [false, false, false, false, 0], "closed again");
  assert.ok(
    plan.meshesSeen(a).every((mesh) => mesh.position.x <= 0.1),
    "meshes of this room alone",
  );
  plan.setOpen(door, true);
  assert.ok(
    plan.meshesSeen(a).some((mesh) => mesh.position.x === 10),
    "and the wall behind the door",
  );
});

test("who sees whom on a plan hides nobody whom a ray reaches", async () => {
  const random = randomOf(3);
  const { scene } = rooms();
  const door = scene.children.at(-1);
  scene.remove(door);
  const plan = await ScenePlan.of(scene, { height: HEIGHT, visibility });
  const hiding = [...scene.children];
  const movers = Array.from({ length: 40 }, () => at(19 * random() - 9.5, 9.5 * random() - 4.75));
  const inside = movers.filter((mover) => Math.abs(mover.x) > 0.2);
  const who = plan.whoSees(inside);
  const counts = [0, 0, 0];
  for (const a of inside)
    for (const b of inside) {
      if (a === b) continue;
      const isReached = isClear(hiding, a, b);
      assert.ok(who.sees(a, b) || !isReached, `${a.toArray()} sees ${b.toArray()}`);
      counts[who.sees(a, b) ? (isReached ? 0 : 1) : 2]++;
    }
  assert.ok(counts[0] > 200 && counts[2] > 200, `seen, not excluded, excluded: ${counts}`);
});

test("cells see over a low wall where the plan does not, and not through a high one", async () => {
  const { scene, wall } = rooms();
  const middle = wall(0, 0, 0.2, 10);
  const box = new THREE.Box3(new THREE.Vector3(-9.9, 0.2, -4.8), new THREE.Vector3(9.9, 2.7, 4.8));
  const [a, b, here, outside] = [at(-5, 0, 0.5), at(5, 0, 0.5), at(-8, 0, 0.5), at(-50, 0, 0.5)];
  const answers = async () => {
    const cells = await CellSight.of(scene, { cell: 2, box, visibility });
    const look = cells.whoSees([a, outside], [b, here]);
    assert.equal(cells.count, 10 * 2 * 5);
    cells.dispose();
    return [look.sees(a, b), look.sees(a, here), look.sees(outside, b)];
  };
  assert.deepEqual(await answers(), [false, true, true], "a wall up to the ceiling");
  // Half as high: seen over.
  for (const mesh of scene.children.slice(-4)) {
    mesh.scale.y = 1.6;
    mesh.position.y = 0.8;
  }
  assert.deepEqual(await answers(), [true, true, true], "a low wall");
  const plan = await ScenePlan.of(scene, { height: HEIGHT, visibility });
  assert.equal(plan.sees(a, b), false, "on a plan just below the wall's edge");
  middle.visible = false;
  scene.children.at(-2).visible = false;
  assert.equal((await ScenePlan.of(scene, { height: HEIGHT, visibility })).sees(a, b), true, "without the door");
  await assert.rejects(CellSight.of(scene, { cell: 0.01, visibility }), RangeError);
  await assert.rejects(CellSight.of(scene, { cell: NaN, visibility }), TypeError);
  await assert.rejects(CellSight.of(new THREE.Scene(), { visibility }), RangeError, "nothing to divide");
  // By rounding, 0.6 / 0.1 is a little more than 6.
  const row = new THREE.Box3(new THREE.Vector3(-0.9, 1, 1), new THREE.Vector3(-0.3, 1.05, 1.05));
  const cells = await CellSight.of(scene, { cell: 0.1, box: row, visibility });
  assert.equal(cells.count, 7);
  cells.dispose();
});

test("polygons make a plan; bodies count with their boxes", async () => {
  const square = [at(-1, -1), at(1, -1), at(1, 1), at(-1, 1)];
  const plan = await ScenePlan.ofPolygons(
    [
      square,
      [
        [3, -1],
        [4, -1],
        [4, 1],
      ],
    ],
    { height: 2, grid: 0.1, visibility },
  );
  assert.equal(plan.walls.length, 7);
  assert.deepEqual([plan.sees(at(-3, 0), at(2, 0)), plan.sees(at(-3, 2), at(2, 2))], [false, true]);
  assert.ok(plan.polygon(at(-3, 0)).every(({ y }) => y === 2));
  // A body 3 m wide behind the square looks out at its sides.
  const body = new THREE.Mesh(BOX, new THREE.MeshBasicMaterial());
  body.position.set(2, 0, 0);
  body.scale.z = 3;
  const eye = at(-2, 0);
  assert.equal(plan.whoSees([eye], [body]).sees(eye, body), true);
  body.scale.z = 0.5;
  assert.equal(plan.whoSees([eye], [body]).sees(eye, body), false);
  const moved = BOX.clone();
  moved.computeBoundingBox();
  for (let i = 0; i < 8; i++) moved.attributes.position.setZ(i, 5);
  body.geometry = moved;
  assert.equal(plan.whoSees([eye], [body]).sees(eye, body), true, "vertices that have moved");
  for (const wrong of [{ height: NaN }, {}, { height: 1, grid: NaN }, { height: 1, grid: -1 }])
    await assert.rejects(ScenePlan.of(new THREE.Scene(), { ...wrong, visibility }), TypeError, JSON.stringify(wrong));
  assert.throws(() => plan.whoSees([eye], [new THREE.Box3()]), /empty box/);
  const empty = await ScenePlan.of(new THREE.Scene(), { height: 1, visibility });
  assert.equal(empty.sees(at(0, 0), at(5, 5)), true);
});

test("a sprite counts with all directions that it may turn to", async () => {
  const corners = [at(-5, -5), at(5, -5), at(5, 5), at(-5, 5)];
  const room = await ScenePlan.ofPolygons([corners], { height: HEIGHT, visibility });
  const eye = at(0, 0);
  // Outside of the room, 0.8 m from its wall.
  for (const [width, height, center, isSeen] of [
    [1, 1, [0.5, 0.5], false],
    [3, 1, [0.5, 0.5], true],
    [0.82, 0.1, [0, 0.5], true],
    [0.1, 0.82, [0.5, 1], true],
    [0.7, 0.1, [1, 0.5], false],
    [0.08, 0.1, [9, 0.5], false],
    [0.1, 0.1, [9, 0.5], true],
  ]) {
    const sprite = new THREE.Sprite();
    sprite.position.copy(at(0, 5.8));
    sprite.scale.set(width, height, 1);
    sprite.center.set(...center);
    assert.equal(room.whoSees([eye], [sprite]).sees(eye, sprite), isSeen, `${width} x ${height} around ${center}`);
  }
  room.dispose();
});

/** Objects that are in the left of two rooms, and how they come into the right one without a frame between. */
const MOVES = {
  "an object whose parent moves": () => {
    const [group, mesh] = [new THREE.Group(), new THREE.Mesh(BOX)];
    group.add(mesh);
    group.position.set(-5, HEIGHT, 0);
    return { mover: mesh, all: group, move: () => (group.position.x = 5) };
  },
  "a static object whose parent moves": () => {
    const [group, mesh] = [new THREE.Group(), new THREE.Mesh(BOX)];
    group.add(mesh);
    mesh.matrixAutoUpdate = false;
    group.position.set(-5, HEIGHT, 0);
    return { mover: mesh, all: group, move: () => (group.position.x = 5) };
  },
  "a camera that leaves its mesh behind": () => {
    const [camera, mesh] = [new THREE.PerspectiveCamera(), new THREE.Mesh(BOX)];
    camera.add(mesh);
    camera.position.set(-5, HEIGHT, 0);
    const move = () => {
      camera.position.x = 5;
      mesh.position.x = -10;
    };
    return { mover: camera, all: camera, move };
  },
  "a skinned mesh that its bone beside it moves": () => {
    const geometry = BOX.clone();
    const { count } = geometry.attributes.position;
    geometry.setAttribute("skinIndex", new THREE.Uint16BufferAttribute(new Uint16Array(4 * count), 4));
    const weights = Float32Array.from({ length: 4 * count }, (_, i) => (i % 4 === 0 ? 1 : 0));
    geometry.setAttribute("skinWeight", new THREE.Float32BufferAttribute(weights, 4));
    const [group, bone, mesh] = [new THREE.Group(), new THREE.Bone(), new THREE.SkinnedMesh(geometry)];
    group.add(bone, mesh);
    group.position.set(-5, HEIGHT, 0);
    group.updateMatrixWorld();
    mesh.bind(new THREE.Skeleton([bone]));
    return { mover: mesh, all: group, move: () => (bone.position.x = 10) };
  },
  "instances that get other matrices": () => {
    const mesh = new THREE.InstancedMesh(BOX, new THREE.MeshBasicMaterial({ transparent: true }), 1);
    const put = (x) => mesh.setMatrixAt(0, new THREE.Matrix4().makeTranslation(x, 0, 0));
    put(-5);
    mesh.position.y = HEIGHT;
    return { mover: mesh, all: mesh, move: () => put(5) };
  },
};

for (const [name, make] of Object.entries(MOVES))
  test(`${name} is seen where it is now`, async () => {
    const { scene } = rooms();
    const plan = await ScenePlan.of(scene, { height: HEIGHT, visibility });
    const { mover, all, move } = make();
    scene.add(all);
    const guard = at(5, 3);
    assert.equal(plan.whoSees([guard], [mover]).sees(guard, mover), false, "in the other room");
    move();
    assert.equal(plan.whoSees([guard], [mover]).sees(guard, mover), true, "in the guard's room");
    scene.updateMatrixWorld();
    assert.equal(plan.whoSees([guard], [mover]).sees(guard, mover), true, "after a frame");
  });

/** Returns a wall across x = 0, as wide as said. */
function across(width = 8) {
  const mesh = new THREE.Mesh(BOX, new THREE.MeshBasicMaterial());
  mesh.position.y = HEIGHT;
  mesh.scale.set(0.2, 3, width);
  return mesh;
}

/** Walls across x = 0, and whether they stop sight. */
const WALLS = {
  "a plain wall": [() => across(), true],
  "a wall on another layer": [
    () => {
      const wall = across();
      wall.layers.set(1);
      return wall;
    },
    false,
  ],
  "a wall in a clipping group": [() => Object.assign(new THREE.Group(), { isClippingGroup: true }).add(across()), false],
  "a wall that is drawn several times": [() => Object.assign(across(), { count: 3 }), false],
  "a wall with a callback": [() => Object.assign(across(), { onBeforeRender: () => {} }), false],
  "instances that the card has": [
    () => {
      const wall = new THREE.InstancedMesh(BOX, new THREE.MeshBasicMaterial(), 1);
      wall.instanceMatrix = { isStorageInstancedBufferAttribute: true, count: 1 };
      return wall;
    },
    false,
  ],
};

for (const [name, [make, stops]] of Object.entries(WALLS))
  test(`${name} ${stops ? "stops" : "does not stop"} sight`, async () => {
    const scene = new THREE.Scene().add(make());
    const plan = await ScenePlan.of(scene, { height: HEIGHT, visibility });
    assert.equal(plan.sees(at(-5, 0), at(5, 0)), !stops);
    plan.dispose();
    const box = new THREE.Box3(at(-6, -1, 1), at(6, 1, 2));
    const cells = await CellSight.of(scene, { cell: 2, box, visibility });
    const [here, there] = [at(-5, 0), at(5, 0)];
    assert.equal(cells.whoSees([here], [there]).sees(here, there), !stops, "by cells");
    cells.dispose();
  });

test("of an LOD the first level stops sight, whichever is drawn", async () => {
  const lod = new THREE.LOD();
  lod.addLevel(across(1), 0).addLevel(across(8), 50);
  const scene = new THREE.Scene().add(lod);
  const answers = async () => {
    const plan = await ScenePlan.of(scene, { height: HEIGHT, visibility });
    return [plan.sees(at(-5, 0), at(5, 0)), plan.sees(at(-5, 2), at(5, 2))];
  };
  assert.deepEqual(await answers(), [false, true], "before the first frame");
  const camera = new THREE.PerspectiveCamera();
  camera.position.x = 90;
  camera.updateMatrixWorld();
  lod.update(camera);
  assert.deepEqual(await answers(), [false, true], "from afar");
});

test("a plan of a part is of where the part is now, and of the layers that are asked for", async () => {
  const [group, wall] = [new THREE.Group(), across()];
  new THREE.Scene().add(group.add(wall));
  group.updateWorldMatrix(true, true);
  group.position.x = 8;
  const moved = await ScenePlan.of(wall, { height: HEIGHT, visibility });
  assert.deepEqual([moved.sees(at(-5, 0), at(5, 0)), moved.sees(at(5, 0), at(9, 0))], [true, false]);
  wall.layers.set(1);
  const { layers } = wall;
  const of = await ScenePlan.of(wall, { height: HEIGHT, layers, visibility });
  assert.equal(of.sees(at(5, 0), at(9, 0)), false, "a wall on the layer that is asked for");
});

test("the example dims thieves whom no guard may see", async () => {
  const { scene } = rooms();
  const person = (x) => {
    const mesh = new THREE.Mesh(BOX, new THREE.MeshBasicMaterial({ transparent: true }));
    mesh.position.set(x, 1.5, 0);
    scene.add(mesh);
    return mesh;
  };
  const [guard, near, far] = [person(-8), person(-3), person(5)];
  const cloak = new THREE.Mesh(BOX, new THREE.MeshBasicMaterial({ side: THREE.DoubleSide }));
  guard.add(cloak);
  const { update, plan } = await watch(scene, [guard], [near, far], { height: HEIGHT, visibility });
  update();
  assert.deepEqual(
    [near, far].map(({ material }) => material.opacity),
    [1, 0.3],
  );
  assert.ok(plan.walls.every(({ mesh }) => ![guard, cloak, near, far].includes(mesh)));
  guard.position.x = 8;
  guard.updateMatrixWorld();
  update();
  assert.deepEqual(
    [near, far].map(({ material }) => material.opacity),
    [0.3, 1],
  );
});

test("the README's program runs", async () => {
  const readme = await readFile(new URL("../README.md", import.meta.url), "utf8");
  const [, program] = readme.match(/^```js\n(import { ScenePlan }[\s\S]*?)^```$/m);
  const { scene, door } = rooms();
  const [guard, thief] = [at(-5, 0), at(5, 0)];
  const warned = [];
  const given = { THREE, ScenePlan, scene, door, guard, thief, guards: [guard], thieves: [thief] };
  Object.assign(given, { yellow: new THREE.MeshBasicMaterial(), warn: (who) => warned.push(who) });
  const AsyncFunction = (async () => {}).constructor;
  const body = program.replace(/^import .*$/m, "");
  await new AsyncFunction(...Object.keys(given), body)(...Object.values(given));
  assert.deepEqual(warned, [thief], "the door is open");
  assert.ok(scene.children.at(-1).geometry.index.count >= 12, "the floor that the guard sees");
});
