// What tests of culling in a worker share: ports without a thread, and a street.

import { LateAnswers, LateScene } from "../package/late.js";
import { serve } from "../package/late-worker.js";
import { Flag, indexOf, load } from "../package/visibility.js";

export const [visibility, elsewhere] = [await load(), await load()];

/** Two ports whose messages wait until they are delivered, as late as a test wants. */
export function wire() {
  const [near, far] = [{}, {}];
  const sent = [];
  near.postMessage = (data, moved) => sent.push([far, structuredClone(data, { transfer: moved })]);
  far.postMessage = (data, moved) => sent.push([near, structuredClone(data, { transfer: moved })]);
  const deliver = () => {
    for (const [port, data] of sent.splice(0)) port.onmessage({ data });
  };
  return { near, far, deliver };
}

/** A scene followed by a worker, and what culls a frame of it. */
export function setting(options, library = elsewhere) {
  const { near, far, deliver } = wire();
  serve(far, library);
  const scene = new LateScene(visibility.createScene(), [near]);
  const answers = new LateAnswers(visibility, scene, options);
  const frustum = visibility.createPipeline().addFrustum();
  const [view, visible] = [visibility.createView(), visibility.createVisible()];
  /** Returns the bits of a frame, and the bits that the frustum leaves. */
  const frame = (camera) => {
    view.setPerspective(camera);
    frustum.cull(scene.local, view, visible);
    const inView = visible.bits;
    return { bits: answers.apply(view, ["setPerspective", camera], inView.slice()), inView };
  };
  /** A question and its answer. */
  const settle = () => (deliver(), deliver());
  return { scene, answers, frame, deliver, settle };
}

export const has = (bits, index) => ((bits[index >>> 5] >>> (index & 31)) & 1) === 1;
export function ones(word) {
  let sum = 0;
  for (let rest = word >>> 0; rest !== 0; rest &= rest - 1) sum++;
  return sum;
}

export function randomOf(seed) {
  let state = seed;
  return () => (state = (Math.imul(state, 1664525) + 1013904223) >>> 0) / 2 ** 32;
}

export const box = (min, max) => ({ min, max });
/** A matrix that moves by x, y and z. */
export const moveBy = (x, y = 0, z = 0) => [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, x, y, z, 1];
export const REFUSED_MESH = { positions: [NaN, 0, 0, 1, 0, 0, 0, 1, 0], indices: [0, 1, 2] };

/** A library whose scene the test can look into: `boxes` are by index, as the worker has them. */
export function watched() {
  let scene;
  const ids = [];
  /** Null, if the worker has not come to its object yet. */
  const boxOf = (index) => (ids[index] !== undefined && scene.contains(ids[index]) ? scene.bounds(ids[index]) : null);
  function createScene() {
    scene = elsewhere.createScene();
    const { insertAll } = scene;
    scene.insertAll = (objects) => {
      const made = insertAll.call(scene, objects);
      for (const id of made) ids[indexOf(id)] = id;
      return made;
    };
    return scene;
  }
  const get = (library, name) => {
    if (name === "createScene") return createScene;
    return typeof library[name] === "function" ? library[name].bind(library) : library[name];
  };
  return { library: new Proxy(elsewhere, { get }), boxOf };
}

/** A wall at x = 5, a lamp behind it, and a camera that looks along x. */
export function street(options, library = elsewhere) {
  const made = setting(options, library);
  const wall = made.scene.insert({ bounds: box([5, -20, -20], [6, 20, 20]), flags: Flag.Occluder });
  const lamp = made.scene.insert({ bounds: box([9, -1, -1], [10, 1, 1]) });
  made.scene.setMesh(wall, made.scene.addBoxMesh(box([5, -20, -20], [6, 20, 20])));
  const look = (eye = [0, 0, 0], turn = 0) => ({
    eye,
    target: [eye[0] + Math.cos(turn), eye[1] + Math.sin(turn), eye[2]],
    up: [0, 0, 1],
    fovY: 1,
    aspect: 1,
    near: 0.1,
  });
  const isShown = (id, camera = look()) => has(made.frame(camera).bits, indexOf(id));
  return { ...made, wall, lamp, look, isShown };
}
