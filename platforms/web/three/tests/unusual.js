// Tests of `visibility-three` with what few programs do: mirrored cameras, counts that are no counts, content
// that is gone or not sent yet, callbacks that change the scene, vertices far away.
// Run by `node --test` where three.js is installed.

import assert from "node:assert/strict";
import test from "node:test";
import { setFlagsFromString } from "node:v8";
import { runInNewContext } from "node:vm";
import * as THREE from "three";
import { load } from "visibility-web";
import { place } from "../boxes.js";
import { buffersOf, render } from "./renderer.js";
import { BOX, culled, fourBoxes, grey, isLampDrawn, perspective, randomOf, street } from "./scenes.js";

const isDrawn = (scene, camera, object) => render(scene, camera).drawn.has(object, 0);
const at = (x, y, z) => new THREE.Matrix4().makeTranslation(x, y, z);
const plane = () => new THREE.Mesh(new THREE.PlaneGeometry(1, 1), grey());

test("a picture that is mirrored, or whose depth runs backwards, is not culled", async () => {
  const projected = (change) => (camera) => {
    camera.updateProjectionMatrix();
    change(camera.projectionMatrix.elements);
  };
  /** Sets the matrices themselves: three.js takes scales out of those that it makes. */
  const scale = (camera, x, z) => {
    camera.matrixWorldAutoUpdate = false;
    camera.matrixWorldInverse.copy(camera.matrixWorld.makeScale(x, 1, z));
    return true;
  };
  const flip = (...indices) => projected((p) => indices.forEach((i) => (p[i] *= -1)));
  const cases = [
    ["as it is", () => {}, true],
    ["flipped from left to right", flip(0), false],
    ["flipped upside down", flip(5), false],
    ["turned by half", flip(0, 5), true],
    ["mirrored by its matrix", (camera) => scale(camera, -1, 1), false],
    ["mirrored twice", (camera) => scale(camera, -1, 1) && flip(0)(camera), true],
    ["looking along +z of its own", (camera) => scale(camera, 1, -1) && flip(10, 11)(camera), true],
    ["looking along +z, mirrored", (camera) => scale(camera, -1, -1) && flip(10, 11)(camera), false],
    ["an eye beyond the near plane", projected((p) => ([p[10], p[14]] = [0, 1])), false],
    ["the same, mirrored", (camera) => projected((p) => ([p[0], p[10], p[14]] = [-1, 0, 1]))(camera), false],
    ["no finite matrix", projected((p) => (p[0] = NaN)), false],
  ];
  for (const make of [perspective, () => new THREE.OrthographicCamera(-9, 9, 5, -5, 0.1, 500)]) {
    for (const [name, change, isCulled] of cases) {
      const made = street({ wall: plane() });
      made.camera = make();
      if (made.camera.isOrthographicCamera && /beyond|same/.test(name)) continue;
      change(made.camera);
      const culling = await culled(made.scene, made.camera);
      render(made.scene, made.camera);
      render(made.scene, made.camera);
      assert.equal(culling.stats.hidden, isCulled ? 1 : 0, `${made.camera.type}, ${name}`);
      culling.dispose();
    }
  }
});

test("a target without depth is not culled: there the last that is drawn is seen", async () => {
  const { scene, lamp, camera } = street();
  const culling = await culled(scene, camera);
  const usual = { isWebGLRenderer: true, clippingPlanes: [], getContextAttributes: () => ({ depth: true }) };
  const flat = { ...usual, getContextAttributes: () => ({ depth: false }) };
  const target = new THREE.RenderTarget(8, 8);
  const flatTarget = new THREE.RenderTarget(8, 8, { depthBuffer: false });
  for (const [name, renderer, to, isCulled] of [
    ["a picture with depth", usual, null, true],
    ["a target with depth", usual, target, true],
    ["a target without", usual, flatTarget, false],
    ["a picture without", flat, null, false],
    ["a target with depth of a renderer without", flat, target, true],
    ["a picture of WebGPURenderer without", { depth: false }, null, false],
    ["a picture of WebGPURenderer", { depth: true }, null, true],
    ["a context that is lost", { ...usual, getContextAttributes: () => null }, null, true],
  ]) {
    const { drawn } = render(scene, camera, { renderer, target: to });
    assert.equal(drawn.has(lamp, 0), !isCulled, name);
  }
  culling.dispose();
});

test("with reversed depth an offset either way may bring a mesh before the wall", async () => {
  for (const isReversed of [true, false]) {
    for (const units of [4, -4, 0]) {
      const material = Object.assign(grey(), { polygonOffset: true, polygonOffsetUnits: units });
      const made = street({ lamp: new THREE.Mesh(BOX, material) });
      made.camera._reversedDepth = isReversed;
      made.camera.updateProjectionMatrix();
      const isShown = isReversed || units < 0;
      assert.equal(await isLampDrawn(made), isShown, `reversed ${isReversed}, units ${units}`);
    }
  }
});

test("in the first frame of a camera the renderer tells of reversed depth, before the camera does", async () => {
  for (const isReversed of [true, false]) {
    const material = Object.assign(grey(), { polygonOffset: true, polygonOffsetUnits: 4 });
    const { scene, lamp, camera } = street({ lamp: new THREE.Mesh(BOX, material) });
    const culling = await culled(scene, camera);
    const renderer = { isWebGLRenderer: true, state: { buffers: { depth: { getReversed: () => isReversed } } } };
    const { drawn } = render(scene, camera, { renderer });
    assert.equal(drawn.has(lamp, 0), isReversed, `reversed ${isReversed}`);
    culling.dispose();
  }
});

test("a second culling of a camera takes it from the first, as after a hot reload", async () => {
  const { scene, wall, lamp, camera } = street();
  const other = perspective();
  const before = Object.hasOwn(scene, "onBeforeRender");
  const first = await culled(scene, [camera, other]);
  const isBoth = () => [camera, other].map((each) => isDrawn(scene, each, lamp));
  assert.deepEqual(isBoth(), [false, false], "by the first");
  const second = await culled(scene, camera);
  for (let frame = 0; frame < 3; frame++) {
    assert.deepEqual(isBoth(), [false, false], `frame ${frame}`);
    assert.ok(isDrawn(scene, camera, wall), `frame ${frame}: the wall is drawn`);
    assert.deepEqual([lamp.layers.mask, scene.children.length], [1, 2], `frame ${frame}: all is put back`);
  }
  first.enabled = false;
  assert.deepEqual(isBoth(), [false, true], "each camera by one");
  const third = await culled(scene, [camera, other]);
  assert.deepEqual(isBoth(), [false, false], "by the third");
  assert.equal(scene.onBeforeRender === THREE.Object3D.prototype.onBeforeRender, false);
  second.addCamera(other);
  assert.deepEqual(isBoth(), [false, false], "a culling that was disposed of takes no camera");
  third.dispose();
  for (const culling of [first, second]) culling.dispose();
  assert.deepEqual(isBoth(), [true, true], "by none");
  assert.ok(before || scene.onBeforeRender === THREE.Object3D.prototype.onBeforeRender, "callbacks are as they were");
});

test("a number of instances that is no count is taken as WebGL takes it", async () => {
  for (const [count, shown] of [
    [2.5, 2],
    [3.999, 3],
    [-1, 0],
    [-0.5, 0],
    [NaN, 0],
  ]) {
    const { scene, lamp, boxes, camera } = fourBoxes();
    scene.remove(boxes);
    const before = new THREE.Mesh(BOX, grey());
    before.position.set(0, 2, -5);
    scene.children.unshift(boxes);
    scene.add(before);
    boxes.setMatrixAt(0, at(-5, 0, -8));
    boxes.count = count;
    const culling = await culled(scene, camera);
    for (let frame = 0; frame < 3; frame++) {
      const { drawn } = render(scene, camera);
      assert.deepEqual(
        [drawn.count(boxes), drawn.has(before, 0), drawn.has(lamp, 0)],
        [shown, true, false],
        `count ${count}, frame ${frame}`,
      );
      if (frame === 1) boxes.instanceMatrix.needsUpdate = true;
    }
    assert.ok(Object.is(boxes.count, count), "the count is as it was");
    culling.dispose();
  }
});

test("a callback that changes a batch before it is drawn has its way", async () => {
  for (const [name, change, expected] of [
    ["deletes a hidden instance", (batch) => batch.deleteInstance(1), [true, false, false]],
    ["hides a hidden instance", (batch) => batch.setVisibleAt(1, false), [true, false, false]],
    ["moves a hidden instance", (batch) => batch.setMatrixAt(1, at(2, 0, -5)), [true, true, true]],
    [
      "puts another in its place",
      (batch) => batch.deleteInstance(1).setMatrixAt(batch.addInstance(0), at(2, 0, -5)),
      [true, true, true],
    ],
    ["shows one that was not shown", (batch) => batch.setVisibleAt(2, true), [true, false, true]],
  ]) {
    const { scene, camera } = street();
    const first = new THREE.Mesh(BOX, grey());
    first.position.set(-2, 0, -5);
    const batch = new THREE.BatchedMesh(4, 24, 36, grey());
    const part = batch.addGeometry(BOX);
    for (let i = 0; i < 3; i++) batch.setMatrixAt(batch.addInstance(part), at(3 - i, 0, i === 0 ? -5 : -20));
    if (name.startsWith("shows")) batch.setMatrixAt(2, at(0, 0, -5)).setVisibleAt(2, false);
    batch.perObjectFrustumCulled = false;
    scene.add(first, batch);
    const culling = await culled(scene, camera);
    render(scene, camera);
    first.onBeforeRender = () => change(batch);
    const { drawn } = render(scene, camera);
    assert.deepEqual(
      [0, 1, 2].map((i) => drawn.has(batch, i)),
      expected,
      name,
    );
    first.onBeforeRender = THREE.Object3D.prototype.onBeforeRender;
    const isShown = (i) => batch._instanceInfo[i].active && batch.getVisibleAt(i);
    assert.equal(isShown(1), !/deletes|hides/.test(name), `${name}: as the callback has set it`);
    assert.ok(isShown(0), `${name}: what is in sight`);
    render(scene, camera);
    culling.dispose();
    assert.equal(isShown(1), !/deletes|hides/.test(name), `${name}: in the end`);
  }
});

test("content is read when it is first shown: before, it may be written without a word", async () => {
  for (const name of ["lamp", "wall"]) {
    const made = street();
    const { scene, lamp, camera } = made;
    const mesh = made[name];
    mesh.geometry = BOX.clone();
    const culling = await culled(scene, camera);
    mesh.visible = false;
    render(scene, camera);
    const { position } = mesh.geometry.attributes;
    // The lamp is before the wall; the wall is smaller than the lamp.
    for (let i = 0; i < position.count; i++)
      if (name === "lamp") position.setZ(i, position.getZ(i) + 15);
      else position.setX(i, position.getX(i) / 200);
    mesh.geometry.boundingSphere = null;
    render(scene, camera);
    mesh.visible = true;
    for (let frame = 0; frame < 3; frame++)
      assert.ok(isDrawn(scene, camera, lamp), `${name}, frame ${frame}`);
    mesh.visible = false;
    render(scene, camera);
    assert.equal(culling.stats.objects, 2, `${name}: what was shown is kept`);
    culling.dispose();
  }
});

test("instances whose arrays are gone are drawn whole", async () => {
  const { scene, boxes, lamp, camera } = fourBoxes();
  const free = (attribute) => (attribute.array = null);
  for (let i = 0; i < 4; i++) boxes.setColorAt(i, new THREE.Color(i, 0, 0));
  const culling = await culled(scene, camera);
  assert.equal(render(scene, camera).drawn.count(boxes), 3, "one is behind the wall");
  free(boxes.instanceColor);
  assert.equal(render(scene, camera).drawn.count(boxes), 4, "without colours");
  free(boxes.instanceMatrix);
  for (let frame = 0; frame < 2; frame++) {
    const { drawn } = render(scene, camera);
    assert.deepEqual(
      [drawn.count(boxes), drawn.has(lamp, 0)],
      [4, false],
      `without matrices, frame ${frame}`,
    );
    boxes.position.x = 0.1;
  }
  culling.dispose();
});

test("a mesh of instances with bones is never hidden", async () => {
  const { scene, boxes, camera } = fourBoxes();
  Object.assign(boxes, { isSkinnedMesh: true, skeleton: new THREE.Skeleton([]) });
  const culling = await culled(scene, camera, { cullable: () => true });
  for (let frame = 0; frame < 2; frame++)
    assert.equal(render(scene, camera).drawn.count(boxes), 4, `frame ${frame}`);
  culling.dispose();
});

test("what WebGPURenderer draws by counts of its own neither hides nor is hidden", async () => {
  const changes = {
    "not at all": (mesh) => (mesh.count = 0),
    "several times": (mesh) => (mesh.count = 2),
    "as the graphics card counts": (mesh) => {
      mesh.geometry = BOX.clone();
      mesh.geometry.indirect = new THREE.BufferAttribute(new Uint32Array(5), 1);
    },
  };
  for (const [name, change] of Object.entries(changes)) {
    for (const which of ["wall", "lamp"]) {
      const made = street();
      change(made[which]);
      assert.ok(await isLampDrawn(made), `${which}, drawn ${name}`);
    }
  }
});

test("the order of a group counts where three.js looks at it: on the camera's layers", async () => {
  for (const [orders, isOrdered] of [
    [[2, 0], true],
    [[0, 2], false],
    [[0, 0], false],
  ]) {
    const made = street();
    const groups = orders.map((renderOrder) => Object.assign(new THREE.Group(), { renderOrder }));
    groups[1].layers.set(5);
    made.scene.add(groups[0].add(groups[1].add(made.lamp)));
    assert.equal(await isLampDrawn(made), isOrdered, `${orders}`);
  }
});

/**
 * Returns the greatest height above the horizon, by distance, at which the graphics card puts a vertex for a
 * camera at the origin. The matrices are those that the card has, the last to be multiplied first.
 */
function heightOnCard(geometry, ...matrices) {
  let most = -Infinity;
  const { position } = geometry.attributes;
  for (let i = 0; i < position.count; i++) {
    let point = [position.getX(i), position.getY(i), position.getZ(i), 1];
    for (const { elements } of matrices.toReversed()) {
      const row = (r) =>
        point.reduce((sum, x, c) => Math.fround(sum + Math.fround(Math.fround(elements[r + 4 * c]) * x)), 0);
      point = [row(0), row(1), row(2), 1];
    }
    most = Math.max(most, point[1] / -point[2]);
  }
  return most;
}

test("vertices far from their mesh's origin are where single precision puts them", async () => {
  const FAR = 2 ** 22;
  const geometry = BOX.clone().scale(1, 1, 0.01).translate(0, FAR, 0);
  const indices = new THREE.Uint16BufferAttribute(new Uint16Array(4 * 24), 4);
  const weights = new THREE.Float32BufferAttribute(
    Array.from({ length: 96 }, (_, i) => Number(i % 4 === 0)),
    4,
  );
  geometry.setAttribute("skinIndex", indices);
  geometry.setAttribute("skinWeight", weights);
  /** A lamp of one bone, detached from its mesh if it has a matrix to be bound by. */
  const skinned = ({ near, inverse = at(0, 0, 0), bind, bone, world }) => {
    const lamp = new THREE.SkinnedMesh(near ? BOX.clone().scale(1, 1, 0.01) : geometry, grey());
    for (const name of ["skinIndex", "skinWeight"])
      lamp.geometry.setAttribute(name, geometry.attributes[name]);
    if (bind) lamp.bindMode = THREE.DetachedBindMode;
    lamp.applyMatrix4(world);
    lamp.bind(new THREE.Skeleton([new THREE.Bone()], [inverse]), bind ?? at(0, 0, 0));
    lamp.skeleton.bones[0].applyMatrix4(bone);
    lamp.skeleton.bones[0].updateMatrixWorld();
    lamp.updateMatrixWorld();
    const boneMatrix = bone.clone().multiply(inverse);
    return [lamp, [lamp.matrixWorld, lamp.bindMatrixInverse, boneMatrix, lamp.bindMatrix]];
  };
  /** Lamps 20 m away whose top is at a height, and the matrices that the card multiplies. */
  const lamps = {
    mesh(y) {
      const lamp = new THREE.Mesh(geometry, grey());
      lamp.position.set(0, y - FAR - 0.5, -20);
      lamp.updateMatrixWorld();
      return [lamp, [lamp.matrixWorld]];
    },
    "mesh, scaled"(y) {
      const lamp = new THREE.Mesh(geometry.clone().scale(1 / 64, 1 / 64, 1 / 64), grey());
      lamp.scale.setScalar(64);
      lamp.position.set(0, y - FAR - 0.5, -20);
      lamp.updateMatrixWorld();
      return [lamp, [lamp.matrixWorld]];
    },
    "instance far from its mesh"(y) {
      const lamp = new THREE.InstancedMesh(BOX.clone().scale(1, 1, 0.01), grey(), 1);
      lamp.setMatrixAt(0, at(0, FAR, 0));
      lamp.position.set(0, y - FAR - 0.5, -20);
      lamp.updateMatrixWorld();
      return [lamp, [lamp.matrixWorld, at(0, FAR, 0)]];
    },
    instance(y) {
      const lamp = new THREE.InstancedMesh(geometry, grey(), 1);
      lamp.setMatrixAt(0, at(1, 0, 0));
      lamp.position.set(0, y - FAR - 0.5, -20);
      lamp.updateMatrixWorld();
      return [lamp, [lamp.matrixWorld, at(1, 0, 0)]];
    },
    bones: (y) => skinned({ inverse: at(0, -FAR, 0), bone: at(0, y - 0.5, -20), world: at(0, 0, -20) }),
    "bones, bound far away": (y) =>
      skinned({ near: true, bind: at(0, FAR, 0), bone: at(0, y - 0.5, 0), world: at(0, 0, -20) }),
    "bones far from their mesh": (y) =>
      skinned({ near: true, bind: at(0, 0, 0), bone: at(0, FAR, 0), world: at(0, y - FAR - 0.5, -20) }),
    "bones of a small mesh": (y) =>
      skinned({
        inverse: at(0, -FAR, 0),
        bone: at(0, y - 0.5, -20),
        world: at(0, 0, -20).scale(new THREE.Vector3(1 / 64, 1 / 64, 1 / 64)),
      }),
  };
  for (const [name, make] of Object.entries(lamps)) {
    let seen = 0;
    for (let y = 3.5; y < 3.97; y += 0.02) {
      const [lamp, matrices] = make(y);
      const { scene, wall, camera } = street({ lamp });
      wall.scale.set(60, 3.98, 0.01);
      const top = heightOnCard(lamp.geometry, ...matrices);
      // The wall ends at 0.199 of the distance.
      if (!(top > 0.1992)) continue;
      seen++;
      const culling = await culled(scene, camera, { zBuffer: { width: 2048, height: 1152 } });
      assert.ok(isDrawn(scene, camera, lamp), `${name}: its top is at ${y}, on the card at ${20 * top}`);
      culling.dispose();
    }
    assert.ok(seen > 0, `${name}: ${seen} lamps that the card draws above the wall`);
  }
  // What the card puts beside its place by more than a small share of its size hides nothing.
  for (const [far, isHidden] of [
    [2 ** 22, false],
    [2 ** 13, false],
    [2 ** 9, true],
  ]) {
    const wall = new THREE.Mesh(BOX.clone().translate(0, far, 0), grey());
    const made = street({ wall });
    wall.scale.set(60, 1, 1);
    wall.position.y = -far;
    assert.equal(await isLampDrawn(made), !isHidden, `a wall whose vertices are ${far} away`);
  }
});

test("a large wall near the eye hides what the card draws behind it alone", async () => {
  // Vertices 240 km from the mesh's origin: the card moves the top of the wall by up to 8 mm, 1 m away.
  const FAR = 240000;
  const geometry = BOX.clone()
    .scale(250, 250, 1)
    .translate(0, FAR - 125, 0);
  let seen = 0;
  for (let k = 0; k < 100; k++) {
    // By the eye's height, the card and the library round the wall's place to different heights.
    const [eye, height] = [0.0037 * k, 0.2 + 1e-3 * k];
    const wall = new THREE.Mesh(geometry, grey());
    const made = street({ wall });
    made.camera.position.y = eye;
    made.camera.updateMatrixWorld();
    wall.scale.setScalar(1);
    wall.position.set(0, eye + height - FAR, -1.5);
    wall.updateMatrixWorld();
    const seenByCard = made.camera.matrixWorldInverse.clone().multiply(wall.matrixWorld);
    const top = heightOnCard(geometry, seenByCard);
    if (!(height - top > 4e-3)) continue;
    seen++;
    made.lamp.scale.set(1, 1, 0.01);
    made.lamp.position.set(0, eye + 20 * (top + 5e-4) - 0.5, -20);
    const culling = await culled(made.scene, made.camera, { zBuffer: { width: 2048, height: 1152 } });
    render(made.scene, made.camera);
    const message = `a lamp over a wall at ${top} on the card, and ${height} without rounding`;
    assert.ok(isDrawn(made.scene, made.camera, made.lamp), message);
    culling.dispose();
  }
  assert.ok(seen > 10, `${seen} lamps that the card draws above the wall`);
});

test("the margin holds what single precision makes of turned vertices", () => {
  const random = randomOf(5);
  const between = (a, b) => a + (b - a) * random();
  const turned = () => {
    const [w, x, y, z] = [0, 1, 2, 3].map(() => between(-1, 1));
    return new THREE.Matrix4().makeRotationFromQuaternion(new THREE.Quaternion(x, y, z, w).normalize());
  };
  const product = (round, { elements }, [x, y, z]) =>
    [0, 1, 2].map((r) =>
      [x, y, z, 1].reduce((sum, v, c) => round(sum + round(round(elements[r + 4 * c]) * v)), 0),
    );
  const exact = (x) => x;
  for (const isInstance of [false, true]) {
    let most = 0;
    for (let i = 0; i < 20000; i++) {
      const point = [0, 1, 2].map(() => Math.fround(between(0.9, 1) * (random() < 0.5 ? -1 : 1)));
      const [matrix, own] = [turned(), turned()];
      // Matrices of instances are kept in single precision.
      own.elements = own.elements.map(Math.fround);
      const middle = isInstance ? product(exact, own, point) : point;
      // The vertex is before the camera, which is where the world has its origin.
      matrix.setPosition(...product(exact, matrix, middle).map((x) => between(-0.01, 0.01) - x));
      const right = product(exact, matrix, middle);
      const drawn = product(Math.fround, matrix, isInstance ? product(Math.fround, own, point) : point);
      const error = Math.hypot(...drawn.map((x, k) => x - right[k]));
      const many = isInstance ? {} : null;
      const object = { matrixWorld: matrix, getMatrixAt: (_, out) => out.copy(own) };
      const margin = place({ object, shape: { reach: point.map(Math.abs) }, many }, 0, new THREE.Matrix4());
      most = Math.max(most, error / margin);
    }
    assert.ok(
      most <= 1,
      `${isInstance ? "an instance" : "a mesh"} is ${most} of the margin beside its place`,
    );
    assert.ok(most > 0.08, `the errors reach ${most} of the margin`);
  }
});

test("instances of a shader of the user's own keep their numbers", async () => {
  const own = [new THREE.ShaderMaterial(), Object.assign(grey(), { onBeforeCompile() {} })];
  for (const material of [...own, [grey(), own[1]]]) {
    const { scene, boxes, camera } = fourBoxes(material);
    const culling = await culled(scene, camera, { cullable: () => true });
    assert.equal(render(scene, camera).drawn.count(boxes), 4);
    boxes.position.y = 200;
    assert.equal(render(scene, camera).drawn.count(boxes), 0, "all are beside the view");
    culling.dispose();
  }
  const { scene, boxes, camera } = fourBoxes();
  boxes.geometry = BOX.clone();
  const buffer = new THREE.InstancedInterleavedBuffer(new Float32Array(4), 1);
  boxes.geometry.setAttribute("heat", new THREE.InterleavedBufferAttribute(buffer, 1, 0));
  const culling = await culled(scene, camera);
  assert.equal(render(scene, camera).drawn.count(boxes), 4, "an attribute of instances");
  culling.dispose();
  const bare = fourBoxes([grey(), undefined]);
  const other = await culled(bare.scene, bare.camera);
  assert.equal(render(bare.scene, bare.camera).drawn.count(bare.boxes), 3, "a material that is not there");
  other.dispose();
});

test("clip planes of the renderer leave a shader that does not clip", async () => {
  for (const clipping of [true, false]) {
    const { scene, wall, lamp, camera } = street();
    wall.visible = false;
    lamp.material = new THREE.ShaderMaterial({ clipping });
    const culling = await culled(scene, camera, { cullable: () => true });
    const beyond = new THREE.Plane(new THREE.Vector3(0, 0, 1), 15);
    for (const [clippingPlanes, isCut, isWebGLRenderer] of [
      [[], false, true],
      [[beyond], clipping, true],
      [[beyond], false, false],
    ]) {
      const renderer = { isWebGLRenderer, clippingPlanes };
      const { drawn } = render(scene, camera, { renderer });
      assert.equal(drawn.has(lamp, 0), !isCut, `clipping ${clipping}, ${clippingPlanes.length} planes`);
    }
    culling.dispose();
  }
});

test("buffers of instances are freed with their mesh, their number and the culling", async () => {
  const { scene, boxes, camera } = fourBoxes();
  for (let i = 0; i < 4; i++) boxes.setColorAt(i, new THREE.Color(i, 0, 0));
  const buffers = buffersOf();
  const before = buffers.size;
  const culling = await culled(scene, camera);
  const drawn = () => render(scene, camera).drawn.count(boxes);
  const added = () => buffers.size - before;
  assert.deepEqual([drawn(), added()], [3, 4], "its own matrices and colours, and those in another order");
  boxes.count = 3;
  assert.deepEqual([drawn(), added()], [2, 4], "another number");
  boxes.instanceMatrix = boxes.instanceMatrix.clone();
  assert.deepEqual([drawn(), added()], [2, 5], "other matrices: the former are the user's to free");
  scene.remove(boxes);
  render(scene, camera);
  assert.equal(added(), 3, "removed");
  scene.add(boxes);
  assert.deepEqual([drawn(), added()], [2, 5], "added again");
  culling.dispose();
  assert.equal(added(), 3, "disposed of");
});

test("colours that are replaced and not shown leave the matrices where they are drawn from", async () => {
  for (const change of [
    (boxes) => {
      const others = boxes.instanceColor.array.map((part) => 1 - part);
      boxes.instanceColor = new THREE.InstancedBufferAttribute(others, 3);
    },
    (boxes) => (boxes.instanceColor = null),
  ]) {
    const { scene, wall, boxes, put, camera } = fourBoxes(new THREE.MeshNormalMaterial());
    put(0, 300, -8);
    put(3, 6, -20);
    for (let i = 0; i < 4; i++) boxes.setColorAt(i, new THREE.Color(i, 0, 0));
    const culling = await culled(scene, camera);
    const drawn = () => [0, 1, 2, 3].map((i) => render(scene, camera).drawn.has(boxes, i));
    assert.deepEqual(drawn(), [false, true, true, false], "one beside the view, one behind the wall");
    change(boxes);
    wall.visible = false;
    assert.deepEqual(drawn(), [false, true, true, true], "the one behind the wall has come into view");
    culling.dispose();
  }
});

test("a renderer that is not used any more is collected", async () => {
  setFlagsFromString("--expose-gc");
  const collectGarbage = runInNewContext("gc");
  const { scene, boxes, camera } = fourBoxes();
  const culling = await culled(scene, camera);
  const drawWithOwnRenderer = () => {
    const renderer = { isWebGLRenderer: true, clippingPlanes: [] };
    assert.equal(render(scene, camera, { renderer }).drawn.count(boxes), 3);
    return new WeakRef(renderer);
  };
  const ref = drawWithOwnRenderer();
  // A weak reference holds its target until the present task ends.
  await new Promise((resolve) => setTimeout(resolve));
  collectGarbage();
  assert.equal(ref.deref(), undefined);
  culling.dispose();
});

test("a batch that grows is not read anew, and its occluders are freed with it", async () => {
  const { scene, wall, camera } = street();
  wall.removeFromParent();
  const meshes = { added: 0, removed: 0 };
  const visibility = await load();
  const { createScene } = visibility;
  visibility.createScene = () => {
    const followed = createScene.call(visibility);
    for (const [name, count] of [
      ["addMesh", "added"],
      ["removeMesh", "removed"],
    ]) {
      const usual = followed[name];
      followed[name] = (...parameters) => {
        meshes[count]++;
        return usual.apply(followed, parameters);
      };
    }
    return followed;
  };
  const batch = new THREE.BatchedMesh(8, 100, 100, grey());
  const parts = [batch.addGeometry(BOX), batch.addGeometry(new THREE.PlaneGeometry(1, 1))];
  for (let i = 0; i < 4; i++) batch.setMatrixAt(batch.addInstance(parts[i % 2]), at(i, 0, -5));
  scene.add(batch);
  const culling = await culled(scene, camera, { visibility });
  render(scene, camera);
  assert.deepEqual(meshes, { added: 3, removed: 0 }, "of the lamp and of two parts");
  const { position } = batch.geometry.attributes;
  let reads = 0;
  position.getX = function (i) {
    reads++;
    return THREE.BufferAttribute.prototype.getX.call(this, i);
  };
  batch.setMatrixAt(batch.addInstance(parts[0]), at(0, 2, -5));
  for (let frame = 0; frame < 3; frame++)
    assert.equal(render(scene, camera).drawn.count(batch), 5, `frame ${frame}`);
  assert.equal(reads, 0, "vertices that are read again");
  assert.deepEqual(meshes, { added: 3, removed: 0 }, "grown");
  batch.setGeometryAt(parts[1], new THREE.PlaneGeometry(1, 3));
  render(scene, camera);
  assert.ok(reads > 0, "vertices that have changed");
  assert.deepEqual(meshes, { added: 5, removed: 2 }, "changed");
  scene.remove(batch);
  render(scene, camera);
  assert.deepEqual(meshes, { added: 5, removed: 4 }, "removed");
  culling.dispose();
});
