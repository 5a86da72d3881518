// Tests of `visibility-three`: nothing that a ray from the camera meets is hidden, and all is put back.
// Run by `node --test` where three.js is installed.

import assert from "node:assert/strict";
import test from "node:test";
import * as THREE from "three";
import { load } from "visibility-web";
import { VisibilityCulling } from "../visibility-three.js";
import { seenBy } from "./oracle.js";
import { render } from "./renderer.js";
import {
  BOX,
  SPHERE,
  culled,
  fourBoxes,
  grey,
  isLampDrawn,
  perspective,
  randomOf,
  snake,
  street,
} from "./scenes.js";

test("what is behind a wall, and what is beside the view, is not drawn; then all is as it was", async () => {
  const { scene, wall, lamp, camera } = street();
  const beside = new THREE.Mesh(BOX, grey());
  beside.position.set(0, 0, 50);
  lamp.layers.enable(3);
  lamp.add(beside);
  const before = [lamp.layers.mask, beside.layers.mask, scene.children.length];
  const culling = await culled(scene, camera);
  const { drawn } = render(scene, camera);
  assert.deepEqual(
    [wall, lamp, beside].map((o) => drawn.has(o, 0)),
    [true, false, false],
  );
  assert.deepEqual([lamp.layers.mask, beside.layers.mask, scene.children.length], before);
  assert.deepEqual([culling.stats.objects, culling.stats.visible, culling.stats.hidden], [3, 1, 2]);
  culling.enabled = false;
  assert.ok(render(scene, camera).drawn.has(lamp, 0), "a culling that is not enabled hides nothing");
  culling.enabled = true;
  culling.dispose();
  assert.ok(render(scene, camera).drawn.has(lamp, 0), "a culling that is disposed of hides nothing");
  assert.equal(
    Object.hasOwn(scene, "onBeforeRender") &&
      scene.onBeforeRender !== THREE.Object3D.prototype.onBeforeRender,
    false,
  );
});

test("callbacks of the scene's own are called, before and after", async () => {
  const { scene, lamp, camera } = street();
  const calls = [];
  scene.onBeforeRender = () => calls.push("before");
  scene.onAfterRender = () => calls.push("after");
  const culling = await culled(scene, camera);
  assert.equal(render(scene, camera).drawn.has(lamp, 0), false);
  culling.dispose();
  render(scene, camera);
  assert.deepEqual(calls, ["before", "after", "before", "after"]);
});

test("what is not opaque, not whole or not sure hides nothing", async () => {
  assert.equal(await isLampDrawn(street()), false, "the wall of the test hides the lamp");
  const materials = {
    transparent: { transparent: true },
    alphaTest: { alphaTest: 0.5 },
    alphaHash: { alphaHash: true },
    alphaToCoverage: { alphaToCoverage: true },
    alphaMap: { alphaMap: new THREE.Texture() },
    additive: { blending: THREE.AdditiveBlending },
    "no depth": { depthWrite: false },
    "no colour": { colorWrite: false },
    wireframe: { wireframe: true },
    invisible: { visible: false },
    clipped: { clippingPlanes: [new THREE.Plane()] },
    stencil: { stencilWrite: true },
    "in front of all": { depthTest: false },
    "drawn where farther": { depthFunc: THREE.GreaterDepth },
    offset: { polygonOffset: true, polygonOffsetFactor: 1 },
    shader: { onBeforeCompile() {} },
    "shader of WebGPURenderer": { opacityNode: {} },
  };
  for (const [name, changes] of Object.entries(materials)) {
    const material = Object.assign(grey(), changes);
    assert.ok(await isLampDrawn(street({ wall: new THREE.Mesh(BOX, material) })), name);
  }
  const glass = new THREE.MeshPhysicalMaterial({ transmission: 1 });
  assert.ok(await isLampDrawn(street({ wall: new THREE.Mesh(BOX, glass) })), "transmission");
  assert.ok(
    await isLampDrawn(street({ wall: new THREE.Mesh(BOX, new THREE.ShaderMaterial()) })),
    "own shader",
  );
  const changed = {
    "not visible": (wall) => (wall.visible = false),
    "parent not visible": (wall) => {
      const parent = new THREE.Group();
      parent.visible = false;
      wall.parent.add(parent);
      parent.add(wall);
    },
    "on another layer": (wall) => wall.layers.set(3),
    "not culled": (wall) => (wall.frustumCulled = false),
    "with a callback": (wall) => (wall.onBeforeRender = () => {}),
    "ordered by hand": (wall) => (wall.renderOrder = -1),
    removed: (wall) => wall.removeFromParent(),
    "without a place": (wall) => (wall.position.x = NaN),
    "too large": (wall) => (wall.scale.z = 1e39),
    "without vertices": (wall) => (wall.geometry = new THREE.BufferGeometry()),
    "without vertices, of several materials": (wall) => {
      wall.geometry = new THREE.BufferGeometry();
      wall.material = [grey()];
    },
    "of other instances": (wall) => (wall.geometry = new THREE.InstancedBufferGeometry().copy(BOX)),
  };
  for (const [name, change] of Object.entries(changed)) {
    for (const isLater of [false, true]) {
      const { scene, wall, lamp, camera } = street();
      const culling = await culled(scene, camera);
      if (isLater) assert.equal(render(scene, camera).drawn.has(lamp, 0), false, `${name}: hidden at first`);
      change(wall);
      assert.ok(render(scene, camera).drawn.has(lamp, 0), `${name}, ${isLater ? "later" : "from the start"}`);
      culling.dispose();
    }
  }
});

test("what may be drawn elsewhere, or in front, is not hidden", async () => {
  const changes = {
    "not culled by three.js": (lamp) => (lamp.frustumCulled = false),
    "a callback": (lamp) => (lamp.onBeforeRender = () => {}),
    "order of its own": (lamp) => (lamp.renderOrder = 1),
    "depth test": (lamp) => (lamp.material.depthTest = false),
    "depth function": (lamp) => (lamp.material.depthFunc = THREE.AlwaysDepth),
    offset: (lamp) => Object.assign(lamp.material, { polygonOffset: true, polygonOffsetFactor: -4 }),
    displacement: (lamp) =>
      (lamp.material = new THREE.MeshStandardMaterial({ displacementMap: new THREE.Texture() })),
    shader: (lamp) => (lamp.material = new THREE.ShaderMaterial()),
    "changed shader": (lamp) => (lamp.material.onBeforeCompile = () => {}),
    "shader of WebGPURenderer": (lamp) => (lamp.material.positionNode = {}),
    "other instances": (lamp) => (lamp.geometry = new THREE.InstancedBufferGeometry().copy(BOX)),
    "morph targets": (lamp) => {
      lamp.geometry = BOX.clone();
      lamp.geometry.morphAttributes.position = [BOX.attributes.position.clone()];
      lamp.updateMorphTargets();
    },
    "no place": (lamp) => (lamp.position.x = NaN),
    "no numbers": (lamp) => {
      lamp.geometry = BOX.clone();
      lamp.geometry.attributes.position.array[0] = NaN;
      lamp.geometry.boundingSphere = new THREE.Sphere(new THREE.Vector3(), 1);
    },
    "content on the graphics card alone": (lamp) => {
      lamp.geometry = BOX.clone();
      lamp.geometry.boundingSphere = new THREE.Sphere(new THREE.Vector3(), 1);
      lamp.geometry.attributes.position.array = null;
    },
    "a group with an order": (lamp) => {
      const group = new THREE.Group();
      group.renderOrder = 2;
      lamp.parent.add(group);
      group.add(lamp);
    },
    "a bundle": (lamp) => {
      const group = new THREE.Group();
      group.isBundleGroup = true;
      lamp.parent.add(group);
      group.add(lamp);
    },
  };
  for (const [name, change] of Object.entries(changes)) {
    const { scene, lamp, camera } = street();
    const culling = await culled(scene, camera);
    assert.equal(render(scene, camera).drawn.has(lamp, 0), false, `${name}: hidden at first`);
    change(lamp);
    // three.js itself does not draw what has no place.
    if (name === "no place") assert.equal(culling.stats.hidden, 1);
    assert.ok(render(scene, camera).drawn.has(lamp, 0) || name === "no place", name);
    if (name === "no place") assert.equal(culling.stats.hidden, 0, name);
    culling.dispose();
  }
  for (const lamp of [new THREE.Sprite(), new THREE.LineSegments(BOX), new THREE.Points(BOX)]) {
    assert.ok(await isLampDrawn(street({ lamp })), lamp.type);
  }
  const { scene, lamp, camera } = street();
  scene.overrideMaterial = grey();
  assert.ok(await isLampDrawn({ scene, lamp, camera }), "another material for all");
  scene.overrideMaterial = null;
  const culling = await culled(scene, camera);
  const renderer = { isWebGLRenderer: false, clippingPlanes: [] };
  assert.equal(render(scene, camera, { renderer }).drawn.has(lamp, 0), false);
  renderer.opaque = false;
  assert.ok(render(scene, camera, { renderer }).drawn.has(lamp, 0), "the wall is not drawn");
  culling.dispose();
});

test("what turns within its box hides nothing until it stands still, then from its new pose", async () => {
  const triangle = new THREE.BufferGeometry();
  triangle.setAttribute("position", new THREE.Float32BufferAttribute([-1, -1, 0, 1, -1, 0, -1, 1, 0], 3));
  const wall = new THREE.Mesh(triangle, new THREE.MeshBasicMaterial({ side: THREE.DoubleSide }));
  const { scene, lamp, camera } = street({ wall });
  lamp.position.set(-15, -10, -20);
  const culling = await culled(scene, camera);
  const isDrawn = () => render(scene, camera).drawn.has(lamp, 0);
  assert.equal(isDrawn(), false, "behind the triangle");
  for (let turn = 0; turn < 4; turn++) {
    wall.scale.multiply({ x: -1, y: -1, z: 1 });
    assert.ok(isDrawn(), `turn ${turn}`);
  }
  assert.equal(isDrawn(), false, "it stands still");
  culling.dispose();

  const plane = new THREE.InstancedMesh(new THREE.PlaneGeometry(60, 60), grey(), 1);
  plane.setMatrixAt(0, new THREE.Matrix4().makeTranslation(0, 0, -10));
  wall.removeFromParent();
  scene.add(plane);
  const other = await culled(scene, camera);
  assert.equal(isDrawn(), false, "behind the plane");
  plane.setMatrixAt(0, new THREE.Matrix4().makeScale(-1, 1, 1).setPosition(0, 0, -10));
  plane.instanceMatrix.needsUpdate = true;
  for (let frame = 0; frame < 3; frame++) assert.ok(isDrawn(), `its back is not drawn, frame ${frame}`);
  other.dispose();
});

test("sides: the front hides, the back does not, both do; mirrored ones too", async () => {
  const plane = () => new THREE.PlaneGeometry(1, 1);
  for (const [side, turned, isHidden] of [
    [THREE.FrontSide, 0, true],
    [THREE.FrontSide, Math.PI, false],
    [THREE.BackSide, 0, false],
    [THREE.BackSide, Math.PI, true],
    [THREE.DoubleSide, 0, true],
    [THREE.DoubleSide, Math.PI, true],
  ]) {
    for (const mirror of [1, -1]) {
      const wall = new THREE.Mesh(plane(), new THREE.MeshBasicMaterial({ side }));
      const made = street({ wall });
      wall.rotation.y = turned;
      wall.scale.x *= mirror;
      assert.equal(await isLampDrawn(made), !isHidden, `side ${side}, turned ${turned}, mirror ${mirror}`);
    }
  }
});

test("shadows are cast by all, and mirrors within a frame show all", async () => {
  const { scene, lamp, camera } = street();
  const mirror = perspective({ z: -40 });
  mirror.rotation.y = Math.PI;
  const boxes = new THREE.InstancedMesh(BOX, grey(), 40);
  const batch = new THREE.BatchedMesh(40, 100, 100, grey());
  const part = batch.addGeometry(BOX);
  for (let i = 0; i < 40; i++) {
    const place = new THREE.Matrix4().makeTranslation(i - 20, 0, i % 2 ? -15 : -5);
    boxes.setMatrixAt(i, place);
    boxes.setColorAt(i, new THREE.Color(i / 40, 0, 0));
    batch.setMatrixAt(
      batch.addInstance(part),
      place.clone().premultiply(new THREE.Matrix4().makeTranslation(0, 2, 0)),
    );
  }
  scene.add(boxes, batch);
  for (const object of [lamp, boxes, batch]) object.castShadow = true;
  const lights = new THREE.OrthographicCamera(-50, 50, 50, -50, -50, 50);
  for (const cameras of [camera, [camera, mirror]]) {
    const culling = await culled(scene, cameras);
    for (let frame = 0; frame < 3; frame++) {
      camera.position.x = 6 * frame;
      const { drawn, casters, within } = render(scene, camera, {
        shadows: lights,
        within: () => render(scene, mirror).drawn,
      });
      assert.equal(drawn.has(lamp, 0), false, "the lamp is behind the wall");
      for (const [name, object] of Object.entries({ boxes, batch })) {
        for (let i = 0; i < 40; i++) {
          const isBehind = i % 2 === 1;
          if (isBehind)
            assert.equal(drawn.has(object, i), false, `${name}: instance ${i} is behind the wall`);
          assert.ok(casters.has(object, i), `${name}: instance ${i} casts its shadow`);
          assert.ok(within.has(object, i), `${name}: instance ${i} is in the mirror`);
        }
        assert.ok(drawn.count(object) > 4, `${name}: those before the wall are drawn`);
      }
      assert.ok(casters.has(lamp, 0), "the lamp casts its shadow");
      assert.ok(within.has(lamp, 0), "the lamp is in the mirror");
    }
    culling.dispose();
  }
  assert.equal(boxes.count, 40);
  assert.equal(Object.hasOwn(boxes, "onBeforeRender") || Object.hasOwn(batch, "onBeforeRender"), false);
});

test("a render that threw leaves nothing hidden", async () => {
  const { scene, lamp, camera } = street();
  const broken = new THREE.LineSegments(BOX);
  broken.onBeforeRender = () => {
    throw new Error("broken");
  };
  scene.add(broken);
  const culling = await culled(scene, camera);
  assert.throws(() => render(scene, camera), /broken/);
  assert.equal(lamp.layers.mask, 1);
  const other = perspective();
  culling.addCamera(other);
  culling.removeCamera(camera);
  broken.visible = false;
  assert.equal(render(scene, other).drawn.has(lamp, 0), false, "another camera's frame is culled");
  culling.addCamera(camera);
  broken.removeFromParent();
  assert.equal(render(scene, camera).drawn.has(lamp, 0), false, "the next frame culls again");
  culling.dispose();
});

test("pictures before a frame is collected, and after one that threw there, show all", async () => {
  const { scene, lamp, camera } = street();
  const boxes = new THREE.InstancedMesh(BOX, grey(), 2);
  for (const i of [0, 1]) boxes.setMatrixAt(i, new THREE.Matrix4().makeTranslation(3, 0, i ? -20 : -5));
  const other = perspective({ z: -40 });
  other.rotation.y = Math.PI;
  scene.add(boxes);
  const culling = await culled(scene, camera);
  const { onBeforeRender } = scene;
  let within;
  scene.onBeforeRender = function (renderer, scene, drawing) {
    onBeforeRender.apply(this, arguments);
    if (drawing === camera) within();
  };
  for (const action of [
    () => assert.ok(render(scene, other).drawn.has(lamp, 0), "the lamp is in the mirror"),
    () => assert.fail("broken"),
  ]) {
    within = () => {};
    const { drawn } = render(scene, camera);
    assert.deepEqual([drawn.has(lamp, 0), drawn.has(boxes, 0), drawn.has(boxes, 1)], [false, true, false]);
    within = action;
    boxes.setMatrixAt(0, new THREE.Matrix4().makeTranslation(2, 0, -5));
    boxes.instanceMatrix.needsUpdate = true;
    if (action.toString().includes("broken")) assert.throws(() => render(scene, camera), /broken/);
    else assert.ok(render(scene, camera).drawn.has(boxes, 0), "what is in sight");
    const { drawn: mirrored } = render(scene, other);
    assert.deepEqual(
      [lamp, boxes].map((o) => mirrored.has(o, 0)),
      [true, true],
    );
    assert.deepEqual([boxes.count, scene.children.length], [2, 3]);
  }
  // Layers that change in between stay changed, those of others as they are.
  within = () => lamp.layers.enable(1);
  render(scene, camera);
  assert.deepEqual([lamp.layers.mask, boxes.layers.mask], [3, 1]);
  const layers = new THREE.Layers();
  within = () => (lamp.layers = layers);
  render(scene, camera);
  assert.equal(lamp.layers, layers);
  culling.dispose();
});

test("a frame that threw amid the drawing of instances leaves all of them", async () => {
  const { scene, camera } = street();
  const boxes = new THREE.InstancedMesh(BOX, grey(), 2);
  for (const i of [0, 1]) boxes.setMatrixAt(i, new THREE.Matrix4().makeTranslation(3, 0, i ? -20 : -5));
  scene.add(boxes);
  const culling = await culled(scene, camera);
  boxes.layers.enable(1);
  const material = boxes.material;
  const other = perspective({ z: -40 });
  other.rotation.y = Math.PI;
  render(scene, camera, {
    within() {
      boxes.onBeforeRender({}, scene, camera, boxes.geometry, material, null);
      assert.equal(boxes.count, 1);
      const { drawn } = render(scene, other);
      assert.deepEqual([drawn.has(boxes, 0), drawn.has(boxes, 1)], [true, true]);
    },
  });
  assert.equal(boxes.count, 2);
  culling.dispose();
});

test("a callback of the user's that throws leaves no occluder behind", async () => {
  const { scene, wall, lamp, camera } = street();
  const late = new THREE.Mesh(BOX, grey());
  late.position.set(5, 0, -5);
  let isBroken = false;
  const cullable = (mesh) => assert.ok(mesh !== late || !isBroken, "broken") ?? undefined;
  for (const isFirst of [true, false]) {
    scene.add(wall, lamp, late);
    const culling = await culled(scene, camera, { cullable });
    if (!isFirst) render(scene, camera);
    isBroken = true;
    if (!isFirst) scene.children.splice(0, 1, new THREE.Mesh(BOX, grey()));
    assert.throws(() => render(scene, camera), /broken/);
    isBroken = false;
    wall.material = new THREE.MeshBasicMaterial({ side: THREE.DoubleSide });
    if (isFirst) render(scene, camera);
    scene.remove(wall);
    assert.ok(render(scene, camera).drawn.has(lamp, 0), "without the wall");
    assert.equal(culling.stats.objects, isFirst ? 2 : 3);
    culling.dispose();
  }
});

test("levels of detail: the one that is drawn hides, and is shown", async () => {
  const scene = new THREE.Scene();
  const lod = new THREE.LOD();
  const [near, far] = [new THREE.Mesh(BOX, grey()), new THREE.Mesh(BOX, grey())];
  near.scale.set(60, 60, 1);
  lod.addLevel(near, 0).addLevel(far, 50);
  lod.position.z = -10;
  const lamp = new THREE.Mesh(BOX, grey());
  lamp.position.set(8, 0, -20);
  scene.add(lod, lamp);
  const camera = perspective();
  const culling = await culled(scene, camera);
  for (const [z, isNear] of [
    [0, true],
    [100, false],
    [0, true],
    [100, false],
  ]) {
    camera.position.z = z;
    const { drawn } = render(scene, camera);
    assert.deepEqual(
      [drawn.has(near, 0), drawn.has(far, 0), drawn.has(lamp, 0)],
      [isNear, !isNear, !isNear],
      `z ${z}`,
    );
  }
  culling.dispose();
});

test("skinned meshes are where any of their bones is", async () => {
  for (const change of [
    ({ bones }) => (bones[4].position.y += 5),
    ({ bones }) => bones[2].scale.setScalar(3),
    ({ mesh }) => (mesh.geometry.attributes.skinWeight.setW(0, -1).needsUpdate = true),
    ({ mesh }) => (mesh.geometry.attributes.skinWeight.setW(0, 40).needsUpdate = true),
    ({ mesh }) => (mesh.geometry.attributes.skinIndex.setX(0, 99).needsUpdate = true),
    ({ mesh }) => {
      const { skinIndex } = mesh.geometry.attributes;
      mesh.geometry.setAttribute("skinIndex", skinIndex.clone().setX(0, 99));
    },
    ({ mesh }) => {
      const { skinWeight } = mesh.geometry.attributes;
      mesh.geometry.setAttribute("skinWeight", skinWeight.clone().setW(0, 40));
    },
    ({ mesh, bones }) => mesh.bind(new THREE.Skeleton(bones.slice(0, 2)), mesh.bindMatrix),
  ]) {
    const made = snake(() => 0);
    const { scene, wall, lamp, camera } = street({ lamp: made.mesh });
    wall.scale.y = 6;
    // three.js itself cannot find the sphere of a mesh whose bones are not there.
    lamp.computeBoundingSphere();
    const culling = await culled(scene, camera);
    assert.equal(render(scene, camera).drawn.has(lamp, 0), false, "behind the wall");
    change(made);
    assert.ok(render(scene, camera).drawn.has(lamp, 0), `${change}`);
    culling.dispose();
  }
});

test("instances that move, come, go or change their part are followed", async () => {
  const behind = new THREE.Matrix4().makeTranslation(0, 0, -20);
  const before = new THREE.Matrix4().makeTranslation(0, 0, -5);
  const colored = (mesh) => {
    for (let i = 0; i < mesh.count; i++) mesh.setColorAt(i, new THREE.Color(0, i, 0));
    return mesh;
  };
  const make = {
    mesh() {
      const mesh = new THREE.InstancedMesh(BOX, grey(), 8);
      for (let i = 0; i < 8; i++) mesh.setMatrixAt(i, behind.clone().setPosition(i - 4, 0, -20));
      return mesh;
    },
    colored: () => colored(make.mesh()),
    batch() {
      const mesh = new THREE.BatchedMesh(9, 100, 200, grey());
      const part = mesh.addGeometry(BOX);
      mesh.addGeometry(new THREE.BoxGeometry(1, 90, 1));
      for (let i = 0; i < 8; i++)
        mesh.setMatrixAt(mesh.addInstance(part), behind.clone().setPosition(i - 4, 0, -20));
      mesh.deleteInstance(2);
      return mesh;
    },
  };
  const move = (mesh, instance = 4, to = before) => {
    mesh.setMatrixAt(instance, to);
    if (mesh.instanceMatrix) mesh.instanceMatrix.needsUpdate = true;
  };
  /** Gives a mesh other matrices of the same version. */
  const replace = (mesh) => {
    if (mesh.isBatchedMesh) {
      const { version } = mesh._matricesTexture;
      mesh.setInstanceCount(20);
      while (mesh._matricesTexture.version < version) mesh.setMatrixAt(4, before);
      assert.equal(mesh._matricesTexture.version, version);
    } else {
      const { version } = mesh.instanceMatrix;
      mesh.instanceMatrix = mesh.instanceMatrix.clone();
      mesh.setMatrixAt(4, before);
      mesh.instanceMatrix.version = version;
    }
  };
  const changes = [
    ["moved", move, 4, ["mesh", "colored", "batch"]],
    ["moved with its mesh", (mesh) => mesh.position.set(0, 0, 15), 4, ["mesh", "colored", "batch"]],
    ["counted", (mesh) => move(mesh, 6) ?? (mesh.count = 8), 6, ["mesh"]],
    ["given other matrices", replace, 4, ["mesh", "batch"]],
    ["added", (mesh) => mesh.setMatrixAt(mesh.addInstance(0), before), 2, ["batch"]],
    ["another part", (mesh) => mesh.setGeometryIdAt(3, 1), 3, ["batch"]],
  ];
  for (const [what, change, instance, names] of changes) {
    for (const name of names) {
      const { scene, wall, camera } = street();
      wall.scale.y = 6;
      const mesh = make[name]();
      if (what === "counted") mesh.count = 5;
      scene.add(mesh);
      const culling = await culled(scene, camera);
      assert.equal(
        render(scene, camera).drawn.has(mesh, instance),
        false,
        `${name}, ${what}: behind the wall`,
      );
      change(mesh);
      for (let frame = 0; frame < 3; frame++) {
        const { drawn } = render(scene, camera);
        assert.ok(drawn.has(mesh, instance), `${name}, ${what}: in sight, frame ${frame}`);
        if (what === "moved") assert.equal(drawn.count(mesh), 1, `${name}: only what is in sight`);
      }
      if (what === "moved") {
        move(mesh, 4, before.clone().setPosition(1, 0, -5));
        assert.ok(render(scene, camera).drawn.has(mesh, 4), `${name}: moved while in sight`);
        move(mesh, 4, behind);
        move(mesh, 5);
        if (mesh.instanceColor) {
          mesh.setColorAt(5, new THREE.Color(1, 0, 0));
          mesh.instanceColor.needsUpdate = true;
        }
        const { drawn } = render(scene, camera);
        assert.deepEqual(
          [drawn.has(mesh, 4), drawn.has(mesh, 5)],
          [false, true],
          `${name}: another is in sight`,
        );
      }
      culling.dispose();
    }
  }
  // A user hides an instance: it hides nothing any more.
  const { scene, wall, lamp, camera } = street();
  wall.visible = false;
  const walls = new THREE.BatchedMesh(2, 24, 36, grey());
  walls.setMatrixAt(
    walls.addInstance(walls.addGeometry(BOX)),
    new THREE.Matrix4().makeScale(60, 60, 1).setPosition(0, 0, -10),
  );
  scene.add(walls);
  const culling = await culled(scene, camera);
  assert.equal(render(scene, camera).drawn.has(lamp, 0), false, "behind a wall of the batch");
  walls.setVisibleAt(0, false);
  assert.ok(render(scene, camera).drawn.has(lamp, 0), "the wall of the batch is not drawn");
  walls.dispose();
  walls.visible = false;
  render(scene, camera);
  culling.dispose();
});

test("an instance that is mirrored hides from its drawn side alone, its mesh mirrored or not", async () => {
  for (const [mesh, instance] of [
    [1, 1],
    [1, -1],
    [-1, 1],
    [-1, -1],
  ]) {
    const wall = new THREE.InstancedMesh(new THREE.PlaneGeometry(1, 1), grey(), 1);
    wall.setMatrixAt(0, new THREE.Matrix4().makeScale(60 * instance, 60, 1).setPosition(0, 0, -10));
    wall.scale.x = mesh;
    const { scene, lamp, camera } = street();
    scene.children[0].visible = false;
    scene.add(wall);
    assert.equal(
      await isLampDrawn({ scene, lamp, camera }),
      instance < 0,
      `mesh ${mesh}, instance ${instance}`,
    );
  }
});

test("layers that two meshes share are not taken from both", async () => {
  const { scene, wall, lamp, camera } = street();
  wall.layers = lamp.layers;
  const culling = await culled(scene, camera);
  assert.deepEqual(
    [wall, lamp].map((o) => render(scene, camera).drawn.has(o, 0)),
    [true, false],
  );
  assert.equal(wall.layers, lamp.layers);
  culling.dispose();
});

test("a mesh of instances that three.js culls casts its shadow", async () => {
  const { scene, camera } = street();
  const boxes = new THREE.InstancedMesh(BOX, grey(), 2);
  for (let i = 0; i < 2; i++) boxes.setMatrixAt(i, new THREE.Matrix4().makeTranslation(0, 0, 50));
  boxes.castShadow = true;
  scene.add(boxes);
  const culling = await culled(scene, camera);
  const lights = new THREE.OrthographicCamera(-50, 50, 50, -50, -50, 50);
  render(scene, camera);
  boxes.computeBoundingSphere();
  boxes.setMatrixAt(1, new THREE.Matrix4().makeTranslation(0, 0, -5));
  boxes.instanceMatrix.needsUpdate = true;
  const { drawn, casters } = render(scene, camera, { shadows: lights });
  assert.equal(drawn.has(boxes, 1), false, "its sphere is out of date: three.js does not draw it");
  assert.deepEqual([casters.has(boxes, 0), casters.has(boxes, 1)], [true, true]);
  culling.dispose();
});

test("each renderer has the instances that it draws on its own graphics card", async () => {
  const { scene, wall, boxes } = fourBoxes();
  wall.visible = false;
  const cameras = [perspective({ fov: 30 }), perspective({ fov: 30 })];
  const renderers = cameras.map(() => ({ isWebGLRenderer: true, clippingPlanes: [] }));
  const culling = await culled(scene, cameras);
  for (let frame = 0; frame < 12; frame++) {
    cameras.forEach((camera, i) => {
      camera.rotation.y = Math.sin(5 * frame + 2 * i);
      const { drawn } = render(scene, camera, { renderer: renderers[i] });
      const place = new THREE.Vector3();
      for (let k = 0; k < 4; k++) {
        place.setFromMatrixPosition(new THREE.Matrix4().fromArray(boxes.instanceMatrix.array, 16 * k));
        if (Math.abs(place.project(camera).x) < 1)
          assert.ok(drawn.has(boxes, k), `frame ${frame}, renderer ${i}, instance ${k}`);
      }
    });
  }
  culling.dispose();
});

test("instances are drawn in their order, which shows where surfaces meet", async () => {
  for (const material of [
    grey(),
    new THREE.MeshBasicMaterial({ transparent: true }),
    [grey(), new THREE.MeshBasicMaterial({ transparent: true })],
    new THREE.MeshBasicMaterial({ depthWrite: false }),
    new THREE.MeshBasicMaterial({ blending: THREE.CustomBlending }),
  ]) {
    const { scene, boxes, camera } = fourBoxes(material);
    const culling = await culled(scene, camera);
    const met = new Set();
    for (const turn of [0, 0.6, -0.6, 0, -0.4, 0.4, 0]) {
      camera.rotation.y = turn;
      const order = render(scene, camera).drawn.order(boxes);
      met.add(order.join());
      assert.deepEqual(order, order.toSorted(), `turned by ${turn}`);
      if (turn === 0) assert.deepEqual(order, [1, 2, 3], "the first is behind the wall");
    }
    assert.ok(met.size > 2, `orders: ${[...met].join("; ")}`);
    culling.dispose();
  }
});

test("instances just beyond the far plane are drawn: a graphics card keeps them by rounding", async () => {
  for (const reversed of [false, true]) {
    const { scene, wall, lamp, boxes, put, camera } = fourBoxes();
    wall.visible = lamp.visible = false;
    camera._reversedDepth = reversed;
    Object.assign(camera, { near: 0.2, far: 2000 });
    camera.updateProjectionMatrix();
    put(0, 0, -2000.55);
    put(1, 0, -2020);
    const culling = await culled(scene, camera);
    const { drawn } = render(scene, camera);
    assert.deepEqual(drawn.order(boxes), [0, 2, 3], `reversed: ${reversed}`);
    culling.dispose();
  }
});

test("ranges that are marked while instances are left out reach the graphics card", async () => {
  const { scene, boxes, put, camera } = fourBoxes();
  render(scene, camera);
  const culling = await culled(scene, camera);
  const mark = (i, x, z) => {
    put(i, x, z);
    boxes.instanceMatrix.clearUpdateRanges();
    boxes.instanceMatrix.addUpdateRange(16 * i, 16);
    boxes.instanceMatrix.needsUpdate = true;
    return render(scene, camera).drawn;
  };
  render(scene, camera);
  mark(1, 1, -7);
  mark(2, 2, -7);
  const drawn = mark(0, 0, -7);
  assert.deepEqual(
    [0, 1, 2, 3].map((i) => drawn.has(boxes, i)),
    [true, true, true, true],
  );
  culling.dispose();
});

test("what a callback sets within a frame stays", async () => {
  const { scene, boxes, camera } = fourBoxes();
  const culling = await culled(scene, camera);
  render(scene, camera);
  const own = () => {};
  render(scene, camera, {
    within() {
      boxes.frustumCulled = false;
      boxes.onAfterRender = own;
    },
  });
  assert.deepEqual([boxes.frustumCulled, boxes.onAfterRender, boxes.count], [false, own, 4]);
  assert.equal(Object.hasOwn(boxes, "onBeforeRender"), false);
  culling.dispose();
});

test("geometries that change are read again", async () => {
  const { scene, wall, lamp, camera } = street();
  lamp.geometry = BOX.clone();
  wall.geometry = BOX.clone();
  const culling = await culled(scene, camera);
  const isDrawn = () => render(scene, camera).drawn.has(lamp, 0);
  assert.equal(isDrawn(), false);
  lamp.geometry.translate(0, 0, 15);
  assert.ok(isDrawn(), "its vertices are before the wall");
  lamp.geometry.translate(0, 0, -15);
  assert.equal(isDrawn(), false);
  wall.geometry.setDrawRange(0, 6);
  assert.ok(isDrawn(), "a part of the wall is drawn");
  wall.geometry.setDrawRange(0, Infinity);
  assert.equal(isDrawn(), false);
  wall.geometry.setIndex([0, 1, 2]);
  assert.ok(isDrawn(), "one triangle of the wall's side is left");
  wall.geometry = new THREE.PlaneGeometry(1, 1);
  assert.equal(isDrawn(), false, "another geometry");
  culling.dispose();
});

test("occluders and what may be hidden can be chosen", async () => {
  const glass = () => new THREE.Mesh(BOX, new THREE.MeshBasicMaterial({ transparent: true }));
  assert.equal(
    await isLampDrawn(street({ wall: glass() }), { occluder: (mesh) => mesh.scale.x > 9 || undefined }),
    false,
  );
  assert.equal(await isLampDrawn(street(), { occluder: () => false }), true);
  assert.equal(await isLampDrawn(street(), { cullable: (mesh) => mesh.scale.x > 9 }), true);
  assert.equal(await isLampDrawn(street(), { maxOccluderTriangles: 11 }), true, "the wall has 12 triangles");
  const made = street();
  made.lamp.material = new THREE.ShaderMaterial();
  assert.equal(await isLampDrawn(made, { cullable: () => true }), false);
});

test("several materials hide if all of them do, and draw all of the mesh", async () => {
  const opaque = Array.from({ length: 6 }, grey);
  const wall = (materials, geometry = BOX) => street({ wall: new THREE.Mesh(geometry, materials) });
  assert.equal(await isLampDrawn(wall(opaque)), false);
  assert.equal(
    await isLampDrawn(wall(opaque.with(4, new THREE.MeshBasicMaterial({ transparent: true })))),
    true,
  );
  assert.equal(await isLampDrawn(wall(opaque.slice(0, 4))), true, "the front has no material");
  const holes = BOX.clone();
  holes.groups.splice(4, 1);
  assert.equal(await isLampDrawn(wall(opaque, holes)), true, "the front is no group");
  for (const materialIndex of [-1, undefined]) {
    const bare = BOX.clone();
    bare.groups = [{ start: 0, count: 36, materialIndex }];
    assert.equal(await isLampDrawn(wall(opaque, bare)), true, `a group of material ${materialIndex}`);
  }
  const inside = new THREE.MeshBasicMaterial({ side: THREE.BackSide, transparent: true });
  const sides = { occluder: (mesh) => Array.isArray(mesh.material) || undefined };
  assert.equal(await isLampDrawn(wall([inside, ...opaque.slice(1)]), sides), true, "sides that differ");
});

test("clip planes of the renderer cut occluders", async () => {
  const { scene, wall, lamp, camera } = street();
  const culling = await culled(scene, camera);
  const cut = (...clippingPlanes) =>
    render(scene, camera, { renderer: { isWebGLRenderer: true, clippingPlanes } }).drawn;
  // The wall is cut away, all of it and in half; then the plane leaves it whole.
  assert.deepEqual(
    [wall, lamp].map((o) => cut(new THREE.Plane(new THREE.Vector3(0, 0, -1), -15)).has(o, 0)),
    [false, true],
  );
  assert.ok(cut(new THREE.Plane(new THREE.Vector3(1, 0, 0), 0.1)).has(lamp, 0));
  assert.equal(cut(new THREE.Plane(new THREE.Vector3(0, 0, -1), 5)).has(lamp, 0), false);
  assert.ok(cut(...Array(11).fill(new THREE.Plane(new THREE.Vector3(0, 0, -1), 5))).has(lamp, 0), "too many");
  culling.dispose();
});

test("many new occluders are made over several frames, in which nothing that a ray meets is hidden", async () => {
  const { scene, lamp, camera } = street();
  // Before the wall, 20 spheres of 15,872 triangles: 9 of them are made in a frame, the wall is the first.
  for (let i = 0; i < 20; i++) {
    const sphere = new THREE.Mesh(new THREE.SphereGeometry(0.5, 128, 63), grey());
    sphere.position.set(i - 10, 2 * (i % 3) - 2, -7);
    const hidden = new THREE.Mesh(BOX, grey());
    hidden.position.set(i - 10, 2 * (i % 3) - 2, -8);
    hidden.scale.setScalar(0.2);
    scene.add(sphere, hidden);
  }
  const visibility = await load({ frames: true });
  const counts = [];
  const followed = visibility.createScene();
  visibility.createScene = () => followed;
  const { addMesh, setFlags } = Object.getPrototypeOf(followed);
  let cleared = 0;
  followed.setFlags = function (id, flags) {
    if (flags === 0) cleared++;
    return setFlags.call(this, id, flags);
  };
  followed.addMesh = function (mesh) {
    counts[counts.length - 1] += mesh.indices.length / 3;
    return addMesh.call(this, mesh);
  };
  const culling = await culled(scene, camera, { visibility });
  const random = randomOf(2);
  for (let frame = 0; frame < 4; frame++) {
    counts.push(0);
    const { drawn } = render(scene, camera);
    for (const [object, instance] of seenBy(scene, camera, 16, 9, random))
      assert.ok(drawn.has(object, instance), `frame ${frame} draws what a ray meets`);
    assert.ok(!drawn.has(lamp, 0), `frame ${frame}: the wall is an occluder from the first frame on`);
  }
  const sphere = 15872;
  assert.deepEqual(counts, [12 + 9 * sphere, 9 * sphere, 2 * sphere, 0], "triangles of new occluders");
  assert.equal(cleared, 0, "flags that are taken from meshes that wait and have none");
  culling.dispose();
});

test("cameras: each is culled for itself, strange ones not at all", async () => {
  const { scene, lamp, camera } = street();
  const other = perspective({ z: -40 });
  other.rotation.y = Math.PI;
  const culling = await culled(scene, [camera]);
  assert.equal(render(scene, camera).drawn.has(lamp, 0), false);
  assert.ok(render(scene, other).drawn.has(lamp, 0), "a camera that is not followed");
  culling.addCamera(other);
  assert.ok(render(scene, other).drawn.has(lamp, 0), "before the wall, for this camera");
  assert.equal(render(scene, camera).drawn.has(lamp, 0), false);
  culling.removeCamera(camera);
  assert.ok(render(scene, camera).drawn.has(lamp, 0), "no more followed");
  culling.addCamera(camera);
  camera.projectionMatrix.elements[0] = NaN;
  render(scene, camera);
  assert.equal(culling.stats.hidden, 1, "the frame was not culled: counters are of the last one that was");
  const array = new THREE.ArrayCamera([other]);
  culling.addCamera(array);
  scene.onBeforeRender({ isWebGLRenderer: true }, scene, array);
  assert.equal(lamp.layers.mask, 1, "several eyes at once");
  assert.throws(() => culling.addCamera(lamp), TypeError);
  assert.throws(() => new VisibilityCulling(lamp, camera), TypeError);
  culling.dispose();
});

test("far from the origin, as tiles of the globe are", async () => {
  for (const distance of [6.4e6, -6.4e6]) {
    const { scene, wall, lamp, camera } = street();
    const globe = new THREE.Group();
    globe.add(...scene.children);
    globe.position.set(distance, distance, distance);
    scene.add(globe);
    camera.position.setScalar(distance);
    const culling = await culled(scene, camera);
    assert.equal(render(scene, camera).drawn.has(lamp, 0), false);
    // By less than single precision tells apart there, the lamp looks over the wall, and then does not.
    lamp.scale.setScalar(0.02);
    wall.scale.set(60, 4, 0.01);
    for (const [y, isSeen] of [
      [3.8, false],
      [4.03, true],
    ]) {
      lamp.position.set(0, y, -20);
      render(scene, camera);
      assert.equal(render(scene, camera).drawn.has(lamp, 0), isSeen, `${distance}: y ${y}`);
    }
    culling.dispose();
  }
});

test("the near and the far plane are where the camera's convention has them", async () => {
  for (const [name, change] of Object.entries({
    "depth of WebGL": () => {},
    "depth of WebGPU": (camera) => (camera.coordinateSystem = THREE.WebGPUCoordinateSystem),
    "reversed depth": (camera) => (camera._reversedDepth = true),
  })) {
    const scene = new THREE.Scene();
    const boxes = [4, 10, 100].map((distance, i) => {
      const box = new THREE.Mesh(BOX, grey());
      box.position.set(((i - 1) * distance) / 4, 0, -distance);
      return box;
    });
    scene.add(...boxes);
    const camera = perspective({ near: 8, far: 60 });
    change(camera);
    camera.updateProjectionMatrix();
    const culling = await culled(scene, camera);
    const { drawn } = render(scene, camera);
    assert.deepEqual(
      boxes.map((box) => drawn.has(box, 0)),
      [false, true, false],
      name,
    );
    assert.equal(culling.stats.hidden, 2, name);
    culling.dispose();
  }
});

/** A town of all that three.js draws as meshes. */
function town(random) {
  const scene = new THREE.Scene();
  const between = (a, b) => a + (b - a) * random();
  const materials = [
    grey(),
    grey(),
    new THREE.MeshBasicMaterial({ side: THREE.DoubleSide }),
    new THREE.MeshBasicMaterial({ side: THREE.BackSide }),
    new THREE.MeshBasicMaterial({ transparent: true, opacity: 0.5 }),
    new THREE.MeshBasicMaterial({ alphaTest: 0.5 }),
  ];
  const plane = new THREE.PlaneGeometry(1, 1);
  const quantized = new THREE.BoxGeometry(1, 1, 1).toNonIndexed();
  quantized.setAttribute(
    "position",
    new THREE.BufferAttribute(
      Int8Array.from(quantized.attributes.position.array, (x) => 254 * x * 0.5),
      3,
      true,
    ),
  );
  const geometries = [BOX, BOX, BOX, SPHERE, plane, quantized];
  const pick = (list) => list[Math.floor(random() * list.length)];
  const groups = [scene];
  const place = (object, size = between(0.5, 6)) => {
    object.position.set(between(-40, 40), between(-2, 6), between(-40, 40));
    object.rotation.set(between(0, 6), between(0, 6), between(0, 6));
    object.scale.set(size, size * between(0.3, 4), size * between(0.3, 2));
    return object;
  };
  for (let i = 0; i < 6; i++) {
    const group = new THREE.Group();
    group.position.set(between(-10, 10), 0, between(-10, 10));
    group.rotation.y = between(0, 6);
    group.scale.set(between(0.5, 1.5), between(0.5, 1.5), between(0.5, 1.5));
    pick(groups).add(group);
    groups.push(group);
  }
  const moving = [];
  for (let i = 0; i < 160; i++) {
    const mesh = place(new THREE.Mesh(pick(geometries), pick(materials)));
    if (random() < 0.1) mesh.layers.set(1);
    if (random() < 0.1) moving.push(mesh);
    pick(groups).add(mesh);
  }
  // Walls, upright: what hides most.
  for (let i = 0; i < 12; i++) {
    const wall = place(new THREE.Mesh(BOX, grey()));
    wall.rotation.set(0, between(0, 6), 0);
    wall.scale.set(between(10, 30), 14, 0.4);
    scene.add(wall);
  }
  const matrix = () => {
    const object = place(new THREE.Object3D(), between(0.3, 2));
    object.updateMatrix();
    return object.matrix;
  };
  const boxes = new THREE.InstancedMesh(BOX, materials[0], 60);
  for (let i = 0; i < 60; i++) boxes.setMatrixAt(i, matrix());
  const batch = new THREE.BatchedMesh(60, 1000, 2000, materials[0]);
  const parts = [batch.addGeometry(BOX), batch.addGeometry(SPHERE)];
  for (let i = 0; i < 60; i++) batch.setMatrixAt(batch.addInstance(pick(parts)), matrix());
  batch.perObjectFrustumCulled = random() < 0.5;
  batch.sortObjects = random() < 0.5;
  batch.setVisibleAt(7, false);
  batch.deleteInstance(9);
  pick(groups).add(boxes);
  pick(groups).add(batch);
  const snakes = Array.from({ length: 8 }, () => snake(between));
  for (const { mesh } of snakes) pick(groups).add(place(mesh, 1.5));
  const step = () => {
    for (const mesh of moving) mesh.position.add(new THREE.Vector3(between(-3, 3), 0, between(-3, 3)));
    if (random() < 0.5) {
      boxes.setMatrixAt(Math.floor(random() * 60), matrix());
      boxes.instanceMatrix.needsUpdate = true;
    }
    if (random() < 0.5) batch.setMatrixAt(20 + Math.floor(random() * 40), matrix());
    batch.setVisibleAt(30, random() < 0.5);
    for (const { bones } of snakes)
      for (const bone of bones) bone.rotation.set(between(-1, 1), 0, between(-1, 1));
    const removed = pick(scene.children);
    if (removed.isMesh && !removed.isInstancedMesh && !removed.isBatchedMesh) removed.removeFromParent();
    scene.add(place(new THREE.Mesh(pick(geometries), pick(materials))));
    pick(groups.slice(1)).visible = random() < 0.7;
  };
  return { scene, step };
}

const CAMERAS = {
  perspective: () => perspective({ fov: 75 }),
  "far near plane": () => perspective({ near: 8, far: 60 }),
  orthographic: () => new THREE.OrthographicCamera(-30, 30, 17, -17, 0.1, 200),
  "reversed depth": () => {
    const camera = perspective({ fov: 75 });
    camera._reversedDepth = true;
    camera.updateProjectionMatrix();
    return camera;
  },
  "depth from 0 to 1": () => {
    const camera = perspective({ fov: 75 });
    camera.coordinateSystem = THREE.WebGPUCoordinateSystem;
    camera.updateProjectionMatrix();
    return camera;
  },
  "layers, in a scaled parent": () => {
    const camera = perspective({ fov: 75 });
    camera.layers.enable(1);
    const parent = new THREE.Group();
    parent.scale.set(2, 2, 2);
    parent.add(camera);
    return camera;
  },
};

/**
 * Flies a camera of each kind through a town. Returns what rays meet and is not drawn, and how much is
 * hidden.
 */
async function judge(seed, frames, options) {
  const faults = [];
  let [hidden, all, seenCount] = [0, 0, 0];
  for (const [name, make] of Object.entries(CAMERAS)) {
    const random = randomOf(seed++);
    const { scene, step } = town(random);
    const camera = make();
    if (camera.parent) scene.add(camera.parent);
    const culling = await culled(scene, camera, options);
    for (let frame = 0; frame < frames; frame++) {
      camera.position
        .set(random() * 60 - 30, random() * 4, random() * 60 - 30)
        .divideScalar(camera.parent ? 2 : 1);
      camera.rotation.set(0, random() * 6, 0);
      if (frame > 0) step();
      for (let still = 0; still < 2; still++) {
        // The spheres of three.js are out of date where things move: of what it culls itself nothing is said.
        scene.updateMatrixWorld();
        scene.traverse((object) => object.boundingSphere !== undefined && object.computeBoundingSphere());
        const { drawn } = render(scene, camera);
        hidden += culling.stats.hidden;
        all += culling.stats.objects;
        for (const [object, instance] of seenBy(scene, camera, 24, 14, random)) {
          seenCount++;
          if (!drawn.has(object, instance))
            faults.push(`${name}, frame ${frame}: ${object.type} ${instance}`);
        }
      }
    }
    culling.dispose();
  }
  return { faults, hidden: hidden / all, seenCount };
}

test("nothing that a ray meets is hidden", async () => {
  const { faults, hidden, seenCount } = await judge(1, 3);
  assert.deepEqual(faults, []);
  assert.ok(seenCount > 500, `${seenCount} objects are met by rays`);
  assert.ok(hidden > 0.6, `${(100 * hidden).toFixed()}% of the objects are hidden`);
});

test("the rays find what a wrong occluder hides", async () => {
  const { faults } = await judge(1, 1, { occluder: () => true });
  assert.ok(faults.length > 0, "with glass as an occluder, rays through it meet what is hidden");
});
