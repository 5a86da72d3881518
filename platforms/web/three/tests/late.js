// Tests of `visibility-three` with its z-buffer in a worker: what a ray from the camera meets is drawn, however
// late the worker's answers come. Run by `node --test` where three.js is installed.

import assert from "node:assert/strict";
import test from "node:test";
import * as THREE from "three";
import { load } from "visibility-web";
import { serve, serveLoaded } from "visibility-web/late-worker.js";
import { seenBy } from "./oracle.js";
import { render } from "./renderer.js";
import { BOX, culled, grey, perspective, randomOf, street } from "./scenes.js";

const elsewhere = await load({ frames: true });

/** A port to a worker whose messages wait until they are delivered. */
function lateWorker() {
  const [near, far] = [{}, {}];
  const sent = [];
  near.postMessage = (data, moved) => sent.push([far, structuredClone(data, { transfer: moved })]);
  far.postMessage = (data, moved) => sent.push([near, structuredClone(data, { transfer: moved })]);
  serve(far, elsewhere);
  near.close = () => sent.splice(0);
  const deliver = () => {
    for (const [port, data] of sent.splice(0)) port.onmessage({ data });
  };
  return { port: near, deliver };
}

test("a lamp behind a wall is left out once the answer is there, and drawn at once when the wall moves", async () => {
  const { scene, wall, lamp, camera } = street();
  const { port, deliver } = lateWorker();
  const culling = await culled(scene, camera, { worker: { port } });
  const isDrawn = () => render(scene, camera).drawn.has(lamp, 0);
  const settle = () => (deliver(), deliver());
  assert.ok(isDrawn(), "before the first answer");
  settle();
  assert.ok(!isDrawn(), "by the first answer");
  assert.deepEqual([culling.stats.late.isUsed, culling.stats.hidden], [true, 1]);
  camera.position.x = 1;
  assert.ok(isDrawn(), "beyond the reach");
  camera.position.x = 0.2;
  assert.ok(!isDrawn(), "within the reach around x = 0");
  settle();
  wall.position.x = 100;
  assert.ok(isDrawn(), "in the frame in which the wall has moved");
  settle();
  assert.ok(isDrawn(), "and after it");
  culling.dispose();
});

test("a lamp that comes out from behind the wall is drawn at once, and so is one that is new", async () => {
  // Glass hides nothing, so that the answer holds for all else.
  const glass = new THREE.MeshBasicMaterial({ transparent: true });
  const { scene, lamp, camera } = street({ lamp: new THREE.Mesh(BOX, glass) });
  const { port, deliver } = lateWorker();
  const culling = await culled(scene, camera, { worker: { port } });
  const settle = () => (deliver(), deliver());
  render(scene, camera);
  settle();
  assert.ok(!render(scene, camera).drawn.has(lamp, 0), "behind the wall");
  lamp.position.z = -5;
  assert.ok(render(scene, camera).drawn.has(lamp, 0), "before the wall");
  const other = new THREE.Mesh(BOX, glass);
  other.position.set(2, 0, -5);
  scene.remove(lamp);
  scene.add(other);
  assert.ok(render(scene, camera).drawn.has(other, 0), "a new lamp, which has the index of the former");
  culling.dispose();
});

test("a flight to a far place shows what is there at once, and hides there by its own answers", async () => {
  const { scene, camera } = street();
  // The eye of the other street is as far from its wall: relative to the eye, both cameras are the same.
  const far = street();
  const place = new THREE.Group().add(...far.scene.children);
  place.position.x = 1 << 20;
  scene.add(place);
  // In the first street this is beside the view, so that no answer for it has it.
  const near = new THREE.Mesh(BOX, grey());
  near.position.z = -5;
  place.add(near);
  const { port, deliver } = lateWorker();
  const culling = await culled(scene, camera, { worker: { port } });
  const settle = () => (deliver(), deliver());
  render(scene, camera);
  settle();
  render(scene, camera);
  assert.ok(culling.stats.late.isUsed, "in the first street");
  camera.position.x = place.position.x;
  const { drawn } = render(scene, camera);
  assert.ok(drawn.has(near, 0) && drawn.has(far.lamp, 0), "as nothing is known there");
  settle();
  render(scene, camera);
  settle();
  const after = render(scene, camera).drawn;
  assert.deepEqual([after.has(near, 0), after.has(far.lamp, 0)], [true, false], "by an answer for there");
  culling.dispose();
});

test("a worker without a library hides nothing, answers, and its reason is in the counters", async () => {
  const { scene, lamp, camera } = street();
  const [near, far] = [{}, {}];
  const sent = [];
  near.postMessage = (data) => sent.push([far, data]);
  far.postMessage = (data) => sent.push([near, structuredClone(data)]);
  near.close = () => {};
  const held = [];
  far.onmessage = null;
  const started = serveLoaded(far, Promise.reject(new Error("no module here")));
  const culling = await culled(scene, camera, { worker: { port: near } });
  for (let frame = 0; frame < 200; frame++) {
    assert.ok(render(scene, camera).drawn.has(lamp, 0), `frame ${frame}`);
    await started;
    for (const [port, data] of sent.splice(0)) (held.push(data), port.onmessage({ data }));
  }
  assert.ok(held.filter(({ answer }) => answer).length > 50, "answers");
  const { isUsed, refusal } = culling.stats.late;
  assert.equal(isUsed, false);
  assert.match(refusal, /no module here/);
  culling.dispose();
});

test("a walk among houses, instances and movers: nothing that is met by a ray is left out", async () => {
  const random = randomOf(11);
  const between = (a, b) => a + (b - a) * random();
  const scene = new THREE.Scene();
  const things = new THREE.InstancedMesh(BOX, grey(), 150);
  const place = (x, z, size) =>
    new THREE.Matrix4().compose(new THREE.Vector3(x, 0, z), new THREE.Quaternion(), new THREE.Vector3(...size));
  for (let i = 0; i < 150; i++) things.setMatrixAt(i, place(between(-40, 40), between(-80, -2), [0.8, 0.8, 0.8]));
  scene.add(things);
  const houses = [];
  for (let x = -36; x <= 36; x += 9) {
    for (let z = -75; z <= -5; z += 10) {
      const house = new THREE.Mesh(BOX, grey());
      house.position.set(x, 2, z);
      house.scale.set(7, 9, 6);
      houses.push(house);
      scene.add(house);
    }
  }
  const camera = perspective({ fov: 75 });
  const { port, deliver } = lateWorker();
  const culling = await culled(scene, camera, { worker: { port, metres: 0.4, degrees: 10 } });
  const tally = { used: 0, hidden: 0, seen: 0 };
  for (let frame = 0; frame < 60; frame++) {
    camera.position.set(4.5 + 0.3 * Math.sin(frame), 0.5, -0.08 * frame);
    camera.rotation.y = 0.3 * Math.sin(frame / 9);
    if (frame % 7 === 3) houses[Math.floor(random() * houses.length)].position.x += 3;
    if (frame % 7 === 5) {
      things.setMatrixAt(Math.floor(random() * 150), place(between(-40, 40), between(-80, -2), [0.8, 0.8, 0.8]));
      things.instanceMatrix.needsUpdate = true;
      things.computeBoundingSphere();
    }
    const { drawn } = render(scene, camera);
    tally.used += Number(culling.stats.late.isUsed);
    tally.hidden += culling.stats.late.isUsed ? culling.stats.hidden : 0;
    for (const [object, instance] of seenBy(scene, camera, 16, 9, random)) {
      tally.seen++;
      assert.ok(drawn.has(object, instance), `frame ${frame}: object ${object.id}, instance ${instance} is met`);
    }
    for (let late = random(); late < 0.9; late += 0.4) deliver();
  }
  assert.ok(tally.used > 20 && tally.hidden > 1000 && tally.seen > 250, `the walk: ${JSON.stringify(tally)}`);
  culling.dispose();
});
