// Tests of `visibility-three` with meshes that three.js leaves out by bounding spheres which do not hold
// them: these hide nothing.
// Run by `node --test` where three.js is installed.

import assert from "node:assert/strict";
import test from "node:test";
import * as THREE from "three";
import { load } from "visibility-web";
import { render } from "./renderer.js";
import { BOX, SPHERE, culled, grey, perspective, street } from "./scenes.js";

const at = (x, y, z) => new THREE.Matrix4().makeTranslation(x, y, z);
/** The place of the wall of a street. */
const ACROSS = at(0, 0, -10).scale(new THREE.Vector3(60, 60, 1));
const BEHIND = at(0, 0, 200);

/** Returns the library, and how often it has culled since that was asked last. */
async function counted() {
  const visibility = await load();
  const { createPipeline } = visibility;
  let culls = 0;
  visibility.createPipeline = () => {
    const pipeline = createPipeline.call(visibility);
    const { cull } = pipeline;
    pipeline.cull = (...parameters) => {
      culls++;
      return cull.apply(pipeline, parameters);
    };
    return pipeline;
  };
  return { visibility, takeCulls: () => [culls, (culls = 0)][0] };
}

/** A street without its wall. */
function open() {
  const made = street();
  made.wall.removeFromParent();
  return made;
}

/**
 * Asserts whether an instance of an object is drawn, and that three.js alone draws the lamp behind it; then,
 * for some frames with the culling, whether both are.
 */
async function assertDrawn({ scene, lamp, camera }, object, instance, [isObject, isLamp], name, options) {
  const has = ({ drawn }) => [drawn.has(object, instance), drawn.has(lamp, 0)];
  assert.deepEqual(has(render(scene, camera)), [isObject, true], `${name}: three.js alone`);
  const culling = await culled(scene, camera, options);
  for (let frame = 0; frame < 3; frame++)
    assert.deepEqual(has(render(scene, camera)), [isObject, isLamp], `${name}, frame ${frame}`);
  culling.dispose();
}

test("what has moved out of its bounding sphere hides nothing", async () => {
  const makers = {
    instances() {
      const mesh = new THREE.InstancedMesh(BOX, grey(), 1);
      mesh.setMatrixAt(0, BEHIND);
      const move = () => {
        mesh.setMatrixAt(0, ACROSS);
        mesh.instanceMatrix.needsUpdate = true;
      };
      return { mesh, move };
    },
    batch() {
      const mesh = new THREE.BatchedMesh(2, 24, 36, grey());
      mesh.perObjectFrustumCulled = false;
      const part = mesh.addGeometry(BOX);
      mesh.setMatrixAt(mesh.addInstance(part), BEHIND);
      return { mesh, move: () => mesh.setMatrixAt(mesh.addInstance(part), ACROSS), instance: 1 };
    },
    mesh() {
      const mesh = new THREE.Mesh(BOX.clone().applyMatrix4(BEHIND), grey());
      const move = () => {
        mesh.geometry.attributes.position.copy(BOX.clone().applyMatrix4(ACROSS).attributes.position);
        mesh.geometry.attributes.position.needsUpdate = true;
      };
      return { mesh, move, sphereOf: mesh.geometry };
    },
  };
  for (const [name, make] of Object.entries(makers)) {
    const made = open();
    const { mesh, move, instance = 0, sphereOf = mesh } = make();
    made.scene.add(mesh);
    render(made.scene, made.camera);
    move();
    await assertDrawn(made, mesh, instance, [false, true], name);
    sphereOf.computeBoundingSphere();
    await assertDrawn(made, mesh, instance, [true, false], `${name}, with its sphere renewed`);
    sphereOf.boundingSphere.center.z = 200;
    await assertDrawn(made, mesh, instance, [false, true], `${name}, with a sphere that is put elsewhere`);
    mesh.frustumCulled = false;
    await assertDrawn(made, mesh, instance, [true, true], `${name}, not culled by three.js`);
    const chosen = { cullable: () => true, occluder: () => true };
    await assertDrawn(made, mesh, instance, [true, false], `${name}, not culled, chosen`, chosen);
  }
});

test("what three.js leaves out from a frame on hides nothing until it is drawn again", async () => {
  const { scene, wall, lamp, camera } = street();
  wall.geometry = BOX.clone();
  const behindWall = new THREE.Mesh(new THREE.BoxGeometry(1, 1, 1), grey());
  behindWall.scale.set(60, 60, 1);
  behindWall.position.z = -15;
  scene.add(behindWall);
  const culling = await culled(scene, camera);
  const drawn = () => [wall, behindWall, lamp].map((o) => render(scene, camera).drawn.has(o, 0));
  assert.deepEqual(drawn(), [true, false, false]);
  wall.geometry.boundingSphere.center.z = 99;
  assert.deepEqual(drawn(), [false, true, false], "the next wall hides");
  behindWall.geometry.computeBoundingSphere();
  behindWall.geometry.boundingSphere.center.z = 99;
  assert.deepEqual(drawn(), [false, false, true], "one wall hid the other, and three.js draws neither");
  wall.geometry.computeBoundingSphere();
  assert.deepEqual(drawn(), [true, false, false], "the first wall is drawn again");
  culling.dispose();
});

/** A wall that a parent shears: three.js moves its sphere by the longest column, which is too short. */
function sheared(wall) {
  const parent = new THREE.Group();
  parent.scale.set(30, 100, 1);
  parent.position.z = -10;
  parent.add(wall);
  const camera = perspective({ y: 60, fov: 30 });
  const made = { ...open(), camera };
  made.lamp.position.y = 60;
  made.scene.add(parent);
  return made;
}

test("what is sheared out of its bounding sphere hides nothing", async () => {
  const wall = new THREE.Mesh(new THREE.PlaneGeometry(1, 1), grey());
  wall.rotation.z = Math.PI / 4;
  const made = sheared(wall);
  await assertDrawn(made, wall, 0, [false, true], "a mesh");
  made.camera.position.y = made.lamp.position.y = 40;
  await assertDrawn(made, wall, 0, [true, false], "a mesh, in view of its sphere");

  // The sphere of a batch, and then those of its instances.
  for (const [perObjectFrustumCulled, isAlone] of [
    [false, true],
    [true, false],
  ]) {
    const batch = new THREE.BatchedMesh(2, 24, 36, grey());
    const part = batch.addGeometry(new THREE.PlaneGeometry(1, 1));
    const scaled = at(0, 0, -10).scale(new THREE.Vector3(30, 100, 1));
    const shear = new THREE.Matrix4().makeRotationZ(Math.PI / 4).premultiply(scaled);
    batch.setMatrixAt(batch.addInstance(part), shear);
    const small = at(-2, 60, -8).scale(new THREE.Vector3(0.1, 0.1, 0.1));
    if (!isAlone) batch.setMatrixAt(batch.addInstance(part), small);
    batch.perObjectFrustumCulled = perObjectFrustumCulled;
    const other = open();
    other.camera.fov = 30;
    other.camera.updateProjectionMatrix();
    other.camera.position.y = other.lamp.position.y = 60;
    other.scene.add(batch);
    await assertDrawn(other, batch, 0, [false, true], isAlone ? "a batch" : "an instance of a batch");
    batch.perObjectFrustumCulled = false;
    if (!isAlone) await assertDrawn(other, batch, 0, [true, false], "a batch that is drawn whole");
  }
});

test("a mesh with a test of its own against the view neither hides nor is hidden", async () => {
  for (const which of ["wall", "lamp"]) {
    for (const [name, isDrawn] of [
      ["never drawn", false],
      ["always drawn", true],
    ]) {
      const made = street();
      const { scene, lamp, camera } = made;
      made[which].intersectsFrustum = () => isDrawn;
      const culling = await culled(scene, camera);
      for (let frame = 0; frame < 2; frame++) {
        const { drawn } = render(scene, camera);
        assert.deepEqual(
          [drawn.has(made[which], 0), drawn.has(lamp, 0)],
          which === "wall" ? [isDrawn, true] : [isDrawn, isDrawn],
          `${which}, ${name}, frame ${frame}`,
        );
      }
      culling.dispose();
    }
  }
});

test("meshes beside the view whose boxes are in it cost no second culling", async () => {
  const { visibility, takeCulls } = await counted();
  const scene = new THREE.Scene();
  const camera = new THREE.OrthographicCamera(-5, 5, 5, -5, 0.1, 100);
  const balls = new THREE.InstancedMesh(SPHERE, grey(), 2);
  const ball = new THREE.Mesh(SPHERE, grey());
  ball.scale.setScalar(3);
  scene.add(ball, balls);
  const culling = await culled(scene, camera, { visibility });
  let [beside, whole] = [0, 0];
  for (let step = 0; step < 40; step++) {
    // Across the lower edge of the view, turned, so that the box is wider than the ball.
    ball.position.set(0, -5 - step / 18, -8);
    ball.rotation.set(step, 2 * step, 3 * step);
    const turned = new THREE.Matrix4().makeRotationFromEuler(ball.rotation).scale(new THREE.Vector3(3, 3, 3));
    balls.setMatrixAt(0, turned.clone().setPosition(2.9, ball.position.y, -8));
    balls.setMatrixAt(1, turned.setPosition(3, ball.position.y, -8));
    balls.instanceMatrix.needsUpdate = true;
    balls.computeBoundingSphere();
    for (let frame = 0; frame < 2; frame++) {
      const { drawn } = render(scene, camera);
      assert.equal(takeCulls(), 1, `step ${step}, frame ${frame}`);
      // Three objects are in view by their boxes, and three.js draws neither the ball nor the instances.
      if (culling.stats.visible === 3 && drawn.count() === 0) beside++;
      if (drawn.count() === 2) whole++;
    }
  }
  assert.ok(beside > 1 && whole > 1, `${beside} frames with balls beside the view, ${whole} with them in it`);
  culling.dispose();
});

test("only what is in view and left out costs a second culling", async () => {
  const { visibility, takeCulls } = await counted();
  for (const [name, z, expected] of [
    ["behind the wall", -15, 1],
    ["before the wall", -5, 2],
    ["behind the camera", 5, 1],
  ]) {
    const { scene, lamp, camera } = street();
    lamp.geometry = BOX.clone();
    lamp.geometry.boundingSphere = new THREE.Sphere(new THREE.Vector3(0, 0, 99), 1);
    lamp.position.z = z;
    const culling = await culled(scene, camera, { visibility });
    for (let frame = 0; frame < 2; frame++) {
      render(scene, camera);
      assert.equal(takeCulls(), expected, `${name}, frame ${frame}`);
    }
    culling.dispose();
  }
});
