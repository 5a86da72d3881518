// Tests of where triangles hide, and from which side: flat ones, those far from the first camera, matrices that flatten,
// and indices at which the graphics card begins anew. Run by `node --test` where three.js is installed.

import assert from "node:assert/strict";
import test from "node:test";
import * as THREE from "three";
import { load } from "visibility-web";
import { CellSight } from "../plans.js";
import { render } from "./renderer.js";
import { BOX, culled, grey, isLampDrawn, perspective, street } from "./scenes.js";

const isDrawn = (scene, camera, object) => render(scene, camera).drawn.has(object, 0);

/** Geometries whose triangles all are without area. */
const FLAT = {
  "a plane without height": () => new THREE.PlaneGeometry(10, 0),
  "a cylinder without radius": () => new THREE.CylinderGeometry(0, 0, 5, 8),
  "one point": () => new THREE.BoxGeometry(0, 0, 0),
  slivers: () => new THREE.PlaneGeometry(10, 1e-38),
};

test("triangles without area hide nothing, and stop no frame", async () => {
  const visibility = await load();
  for (const [name, make] of Object.entries(FLAT)) {
    const made = street();
    const flat = new THREE.Mesh(make(), grey());
    flat.position.z = -5;
    made.scene.add(flat);
    assert.equal(await isLampDrawn(made), false, `${name}: the wall behind it hides the lamp`);
    const cells = await CellSight.of(made.scene, { cell: 40, visibility });
    const eye = new THREE.Vector3(0, 0, -5);
    assert.equal(cells.whoSees([eye]).sees(eye, eye), true, name);
    cells.dispose();
    const bare = street({ wall: new THREE.Mesh(make(), grey()) });
    assert.ok(await isLampDrawn(bare), `${name}: hides nothing`);
  }
});

test("a gap far from the first camera stays open, and walls there hide", async () => {
  const { scene, wall, lamp, camera } = street();
  // The first that is placed anew is too small for its place.
  wall.scale.setScalar(1e-6);
  wall.position.y = -200;
  // The gap is from 1,600,000.065 to 1,600,000.125, where single precision has steps of 0.125.
  for (const [x, half] of [
    [1599950.065, 50],
    [1600050.185, 50.06],
  ]) {
    const side = new THREE.Mesh(BOX, grey());
    side.position.set(x, 0, -10);
    side.scale.set(2 * half, 60, 0.1);
    scene.add(side);
  }
  lamp.position.set(1600000.095, 0, -20);
  lamp.scale.set(0.02, 1, 0.02);
  const hidden = new THREE.Mesh(BOX, grey());
  hidden.position.set(1600005, 0, -20);
  scene.add(hidden);
  const culling = await culled(scene, camera, { zBuffer: { width: 4096, height: 256 } });
  render(scene, camera);
  camera.position.x = 1600000.095;
  for (let frame = 0; frame < 3; frame++) {
    const { drawn } = render(scene, camera);
    assert.ok(drawn.has(lamp, 0), `frame ${frame}: through the gap`);
    assert.ok(!drawn.has(hidden, 0), `frame ${frame}: behind the wall`);
  }
  culling.dispose();
});

test("what single precision puts beside its place by much of its size hides nothing", async () => {
  // There single precision has steps of 2^-10, and the wall is placed to 2^-13 of 2 metres.
  for (const [x, isHidden] of [
    [8192, true],
    [8192 + 2 ** -13, true],
    [8192 + 2 ** -11, false],
    [-8192 - 2 ** -11, false],
  ]) {
    const { scene, wall, lamp, camera } = street();
    const culling = await culled(scene, camera);
    render(scene, camera);
    wall.position.set(x, 0, -4);
    wall.scale.set(2, 2, 0.1);
    lamp.position.set(x, 0, -9);
    lamp.scale.setScalar(0.1);
    camera.position.x = x;
    render(scene, camera);
    assert.equal(isDrawn(scene, camera, lamp), !isHidden, `at ${x}`);
    culling.dispose();
  }
});

test("two cameras far from each other do not move the origin to and fro", async () => {
  const { scene, wall, lamp, camera } = street();
  const far = perspective({ x: 1e6 });
  const visibility = await load();
  const { createScene } = visibility;
  let placed = 0;
  visibility.createScene = () => {
    const followed = createScene.call(visibility);
    const { setAllBounds } = followed;
    followed.setAllBounds = (ids, bounds) => {
      placed += ids.length;
      setAllBounds.call(followed, ids, bounds);
    };
    return followed;
  };
  const culling = await culled(scene, [camera, far], { visibility });
  for (let frame = 0; frame < 4; frame++) {
    const { drawn } = render(scene, camera);
    render(scene, far);
    assert.ok(drawn.has(wall, 0) && !drawn.has(lamp, 0), `frame ${frame}`);
  }
  assert.equal(placed, 0, "objects that are placed anew");
  culling.removeCamera(camera);
  render(scene, far);
  assert.equal(placed, 2, "once no camera is near");
  culling.dispose();
});

test("a matrix that flattens a mesh lets it hide only from the side that three.js draws", async () => {
  let certain = 0;
  for (const flat of [0, 1e-8, 1e-3, 1]) {
    for (const isMany of [false, true]) {
      for (const height of [1, -1]) {
        const [parent, group] = [new THREE.Group(), new THREE.Group()];
        parent.rotation.set(0.2, 0.3, 0);
        group.scale.set(1, flat, 1);
        const geometry = new THREE.PlaneGeometry(40, 40);
        const wall = isMany ? new THREE.InstancedMesh(geometry, grey(), 1) : new THREE.Mesh(geometry, grey());
        if (isMany) wall.setMatrixAt(0, new THREE.Matrix4());
        wall.rotation.set(0.4, 0.5, 0);
        wall.frustumCulled = true;
        const scene = new THREE.Scene().add(parent.add(group.add(wall)));
        scene.updateMatrixWorld();
        // Corners of a triangle in the world, counter-clockwise from where their normal leads.
        const corners = [0, 2, 1].map((i) =>
          new THREE.Vector3().fromBufferAttribute(geometry.attributes.position, i).applyMatrix4(wall.matrixWorld),
        );
        const triangle = new THREE.Triangle(...corners);
        const normal = triangle.getNormal(new THREE.Vector3());
        const camera = perspective();
        camera.position.copy(normal).multiplyScalar(5 * height);
        camera.up.set(0.1, 0.2, 0.3);
        camera.lookAt(0, 0, 0);
        const lamp = new THREE.Mesh(BOX, grey());
        lamp.position.copy(normal).multiplyScalar(-5 * height);
        lamp.scale.setScalar(0.1);
        scene.add(lamp);
        // In the plane, the first triangle is at the corners 0, 2, 1. three.js turns the front by the sign.
        const isFront = height > 0 === !(wall.matrixWorld.determinant() < 0);
        const isFound = await isLampDrawn({ scene, lamp, camera });
        const message = `scale ${flat}, instances ${isMany}, height ${height}`;
        if (!isFront) assert.ok(isFound, `${message}: three.js does not draw this side`);
        if (flat >= 1e-3) {
          assert.equal(isFound, !isFront, message);
          certain++;
        }
      }
    }
  }
  assert.equal(certain, 8, "walls that certainly have a side");
});

test("a triangle of the greatest index of its type is not drawn, and hides nothing", async () => {
  for (const [Type, last, isHidden] of [
    [Uint8Array, 255, false],
    [Uint8Array, 254, true],
    [Uint16Array, 65535, false],
    [Uint16Array, 65534, true],
    [Uint32Array, 65535, true],
  ]) {
    const geometry = new THREE.BufferGeometry();
    const positions = new Float32Array(3 * (last + 1));
    positions.set([-9, -9, 0, 9, -9, 0]);
    positions.set([0, 9, 0], 3 * last);
    geometry.setAttribute("position", new THREE.BufferAttribute(positions, 3));
    geometry.setIndex(new THREE.BufferAttribute(Type.of(0, 1, last), 1));
    const made = street({ wall: new THREE.Mesh(geometry, grey()) });
    made.lamp.scale.setScalar(0.1);
    assert.equal(await isLampDrawn(made), !isHidden, `${Type.name}, index ${last}`);
  }
});
