// Random calls of a scene that a worker follows: the boxes of objects are the same in this thread, in the worker and in
// a scene without a worker, and no late answer hides an object that a line of sight reaches past all that hides others.
// Usage: node --test tests/late-random.js, after `build`. FIRST is the first seed, RUNS the number of runs.

import assert from "node:assert/strict";
import test from "node:test";
import { ALL_LAYERS, Flag, indexOf } from "../package/visibility.js";
import { REFUSED_MESH, box, has, moveBy, randomOf, setting, visibility, watched } from "./late-street.js";

const [FIRST, RUNS] = [Number(process.env.FIRST ?? 1), Number(process.env.RUNS ?? 60)];
const ROUNDS = 60;
/** In the scene without a worker, a mesh out of the bounds of all objects stands for one that is refused. */
const FAR_AWAY = box([1e18, 1e18, 1e18], [1.1e18, 1.1e18, 1.1e18]);
/** A part more: some roundings of single precision. */
const ROUNDED = 1 + 2 ** -22;
/** Lengths in the scene that the oracle takes for rounding, in favour of the library. */
const SLACK = 1e-3;

const numbers = ({ min, max }) => [...min, ...max];
const isFinite = (bounds) => numbers(bounds).every(Number.isFinite);
const areSame = (a, b) => numbers(a).every((x, i) => x === numbers(b)[i]);

/** Returns the box of a transformed box, for a matrix as `setMesh` takes it. */
function transformed({ min, max }, m) {
  const [low, high] = [m.slice(12, 15), m.slice(12, 15)];
  for (let row = 0; row < 3; row++) {
    for (let column = 0; column < 3; column++) {
      const ends = [m[4 * column + row] * min[column], m[4 * column + row] * max[column]];
      low[row] += Math.min(...ends);
      high[row] += Math.max(...ends);
    }
  }
  return box(low, high);
}

/** Whether the line from the eye to a point passes through a box that is a little enlarged. */
function isBehind({ min, max }, eye, point) {
  let [from, to] = [0, 1];
  for (let k = 0; k < 3; k++) {
    const [low, high, d] = [min[k] - SLACK - eye[k], max[k] + SLACK - eye[k], point[k] - eye[k]];
    if (d === 0) {
      if (low > 0 || high < 0) return false;
    } else {
      from = Math.max(from, Math.min(low / d, high / d));
      to = Math.min(to, Math.max(low / d, high / d));
    }
  }
  return from <= to;
}

/** What the documentation of `Scene` says an object has. */
class Thing {
  flags = 0;
  layers = ALL_LAYERS;
  /** In the object's coordinates: its box, if it was given one, and the box of its mesh. */
  local = null;
  mesh = null;
  transform = moveBy(0);
  /** In the scene's coordinates: flat boxes of its triangles, and of the mesh that was made from them. */
  face = null;
  prepared = null;

  constructor(late, plain) {
    Object.assign(this, { late, plain });
  }

  loseTriangles() {
    this.face = this.prepared = null;
  }

  /** Boxes that hold all that hides others, for an object with such bounds. */
  hiding(bounds) {
    const isOccluder = (this.flags & (Flag.Occluder | Flag.NeverCull)) === Flag.Occluder;
    if (!isOccluder || this.layers === 0 || !isFinite(bounds)) return [];
    return [this.mesh && transformed(this.mesh, this.transform), this.prepared].filter(Boolean);
  }
}

const tally = new Map();
function count(what, by = 1) {
  tally.set(what, (tally.get(what) ?? 0) + by);
}

/** The same calls for a scene with a worker, for one without, and for the things above. */
class Both {
  things = [];
  /** The last few that were removed. */
  removed = [];
  /** Meshes: numbers in the one scene, ids in the other, and boxes. */
  meshes = [];

  /**
   * With `rounds`, meshes reach out of boxes by rounding, which enlarges these in the scenes that have meshes. Then the
   * scenes may differ in what an object loses with new bounds, and all but boxes is left unchecked.
   */
  constructor(random, rounds) {
    this.rounds = rounds;
    const { library, boxOf } = watched();
    Object.assign(this, setting({ metres: 0.5, radians: 0.1 }, library), { random, boxOf });
    this.plain = visibility.createScene();
    this.far = this.plain.addBoxMesh(FAR_AWAY);
  }

  destroy() {
    for (const handle of [this.answers, this.scene, this.plain]) handle.destroy();
  }

  below(count) {
    return Math.floor(this.random() * count);
  }

  pick(list) {
    return list[this.below(list.length)];
  }

  // What to call with.

  /**
   * A box in the line of sight: of whole numbers, so that many are alike, or beside these by rounding. Walls are before
   * most other boxes.
   */
  box(isWall = this.below(4) === 0) {
    const [x, y, z] = [isWall ? 3 + this.below(4) : 2 + this.below(12), this.below(5) - 2, this.below(3) - 1];
    const [wide, high] = this.pick(isWall ? [[6, 6], [20, 20]] : [[1, 1], [1, 1], [2, 3], [6, 6]]);
    const made = box([x, y - wide / 2, z - high / 2], [x + 1, y + wide / 2, z + high / 2]);
    if (this.rounds && this.below(4) === 0) made.max[this.below(3)] *= ROUNDED;
    if (this.below(40) === 0) made.max[0] = this.pick([Infinity, NaN]);
    return made;
  }

  /** A box for a thing: another, or that which it has in this thread or in the worker. */
  boxFor({ late, local }) {
    const here = this.scene.contains(late) ? this.scene.bounds(late) : null;
    return this.pick([null, here, this.boxOf(indexOf(late)), local]) ?? this.box();
  }

  transform() {
    const [x, y] = [this.below(9) - 4, this.below(3) - 1];
    const turned = [0, 1, 0, 0, -1, 0, 0, 0, 0, 0, 1, 0, x, y, 0, 1];
    const part = this.rounds ? 0.1 : 0.5;
    return this.pick([undefined, moveBy(0), moveBy(x, y), moveBy(x, 0), moveBy(x + part, 0.25), turned]);
  }

  /** A thing, in a few cases one that was removed. With `hides`, mostly one that hides others. */
  thing(hides = false) {
    if (this.below(30) === 0 && this.removed.length > 0) return this.pick(this.removed);
    const hiding = this.things.filter((thing) => hides && thing.hiding(this.scene.bounds(thing.late)).length > 0);
    return this.pick(hiding.length > 0 && this.below(4) > 0 ? hiding : this.things);
  }

  // Calls.

  /** Makes a call of both scenes, which both accept or both refuse. Returns whether they accept it. */
  call(name, late, plain) {
    const outcomes = [[this.scene, late], [this.plain, plain]].map(([scene, parameters]) => {
      try {
        scene[name](...parameters);
        return "OK";
      } catch ({ code, message }) {
        return code ?? message;
      }
    });
    if (!this.rounds) assert.equal(...outcomes, `${name}: the scene with a worker, and the scene without`);
    count(`${name} ${outcomes[0]}`);
    return outcomes[0] === "OK";
  }

  /** Makes a call for things. What it changes besides their boxes, `then` notes. */
  callFor(name, things, parameters, then = () => {}) {
    const ids = (side) => (Array.isArray(things) ? things.map((thing) => thing[side]) : things[side]);
    const all = Array.isArray(things) ? things : [things];
    const boxOf = ({ late }) => (this.scene.contains(late) ? this.scene.bounds(late) : null);
    const former = all.map(boxOf);
    if (!this.call(name, [ids("late"), ...parameters], [ids("plain"), ...parameters])) return;
    all.forEach((thing, i) => then(thing, i, !areSame(boxOf(thing), former[i])));
  }

  insert() {
    const flags = Array.from({ length: 1 + this.below(3) }, () => this.pick([0, 0, 0, Flag.Occluder]));
    const bounds = flags.map((flag) => this.box(flag !== 0));
    const objects = { bounds: bounds.flatMap(numbers), flags };
    const plain = this.plain.insertAll(objects);
    this.scene.insertAll(objects).forEach((id, i) => {
      assert.equal(indexOf(id), indexOf(plain[i]), "indices");
      this.things.push(Object.assign(new Thing(id, plain[i]), { flags: flags[i] }));
      if (flags[i] === 0) return;
      if (this.below(2) === 0) this.giveMesh(this.things.at(-1), bounds[i]);
      else this.setTriangles(this.things.at(-1));
    });
    this.prepare();
  }

  remove() {
    if (this.things.length < 5) return;
    const thing = this.thing(true);
    if (!this.things.includes(thing)) return;
    this.things.splice(this.things.indexOf(thing), 1);
    this.call("removeAll", [[thing.late]], [[thing.plain]]);
    this.removed = [...this.removed.slice(-3), thing];
  }

  setBounds(name, things, bounds) {
    this.callFor(name, things, [bounds], (thing, _, isMoved) => {
      if (isMoved) Object.assign(thing, { local: null, mesh: null, transform: moveBy(0), face: null, prepared: null });
    });
  }

  setAllBounds() {
    const things = [...new Set(Array.from({ length: 1 + this.below(4) }, () => this.thing()))];
    this.setBounds("setAllBounds", things, things.map((thing) => this.boxFor(thing)).flatMap(numbers));
  }

  setLocalBounds(thing) {
    const local = this.boxFor(thing);
    this.callFor("setLocalBounds", thing, [local], (thing, _, isMoved) => {
      if (thing.local && !areSame(local, thing.local)) thing.mesh = null;
      thing.local = local;
      if (isMoved) thing.loseTriangles();
    });
  }

  setTransforms() {
    const local = this.things.filter((thing) => thing.local);
    const thing = () => (this.below(8) > 0 && local.length > 0 ? this.pick(local) : this.thing());
    const things = [...new Set([thing(), thing()])];
    const matrices = things.map(() => this.transform() ?? moveBy(this.below(20) === 0 ? NaN : 0));
    this.callFor("setTransforms", things, [matrices.flat()], (thing, i) => this.place(thing, matrices[i]));
  }

  place(thing, transform) {
    if (thing.local && transform.some((x, i) => x !== thing.transform[i])) thing.loseTriangles();
    thing.transform = transform;
  }

  setLayers(thing) {
    const layers = this.pick([ALL_LAYERS, ALL_LAYERS, 1, 0]);
    this.callFor("setLayers", thing, [layers], () => (thing.layers = layers));
  }

  setFlags(thing) {
    const { NeverCull, Occluder, OneSided, SeeThrough } = Flag;
    const all = [0, Occluder, Occluder, Occluder | OneSided, Occluder | NeverCull, Occluder | SeeThrough, NeverCull];
    const flags = this.pick(all);
    this.callFor("setFlags", thing, [flags], () => {
      if ((flags & ~thing.flags & OneSided) !== 0) thing.prepared = null;
      thing.flags = flags;
    });
  }

  /** Half of a mesh, a mesh that just fits, or one that reaches out by rounding. */
  giveMesh(thing, own, transform) {
    const bounds = box([...own.min], [...own.max]);
    const how = this.below(6);
    if (how === 0) bounds.max[2] = (bounds.min[2] + bounds.max[2]) / 2;
    if (how === 1 && this.rounds) bounds.max[0] *= ROUNDED;
    const isGood = isFinite(bounds);
    const late = isGood ? this.scene.addBoxMesh(bounds) : this.scene.addMesh(REFUSED_MESH);
    const mesh = { late, plain: isGood ? this.plain.addBoxMesh(bounds) : this.far, bounds: isGood ? bounds : null };
    this.meshes.push(mesh);
    this.setMesh(thing, mesh, transform);
  }

  setMesh(thing, mesh, transform) {
    const isMade = this.call("setMesh", [thing.late, mesh.late, transform], [thing.plain, mesh.plain, transform]);
    if (!isMade) return;
    Object.assign(thing, { mesh: mesh.bounds, prepared: null });
    this.place(thing, transform ?? moveBy(0));
  }

  refuseMesh(thing) {
    this.setMesh(thing, { late: this.scene.addMesh(REFUSED_MESH), plain: this.far, bounds: null }, this.transform());
  }

  removeMesh() {
    const mesh = this.pick(this.meshes);
    if (!mesh?.bounds) return;
    this.call("removeMesh", [mesh.late], [mesh.plain]);
    // From now on it is refused.
    Object.assign(mesh, { plain: this.far, bounds: null });
  }

  /** The face that a box turns to the camera, or half of it, or one beside it, which is refused. */
  setTriangles(thing) {
    const { late, plain } = thing;
    const { min, max } = this.scene.contains(late) ? this.scene.bounds(late) : this.box();
    const x = min[0] - Number(this.below(5) === 0);
    const y = this.below(3) === 0 ? (min[1] + max[1]) / 2 : max[1];
    if (![x, y, ...min, ...max].every(Number.isFinite)) return;
    const [a, b, c, d] = [[x, min[1], min[2]], [x, min[1], max[2]], [x, y, max[2]], [x, y, min[2]]];
    const triangles = [a, b, c, a, c, d].flat();
    const isRefused = x < min[0];
    if (this.rounds) triangles[3] *= ROUNDED;
    if (!this.call("setTriangles", [late, triangles], [plain, isRefused ? [] : triangles])) return;
    thing.prepared = null;
    thing.face = isRefused ? null : box(a, c);
  }

  prepare() {
    this.call("prepareOccluders", [], []);
    for (const thing of this.things)
      if ((thing.flags & Flag.Occluder) !== 0 && !thing.mesh) thing.prepared ??= thing.face;
  }

  step() {
    const thing = this.thing();
    this.pick([
      () => this.insert(),
      () => this.remove(),
      () => this.setBounds("setBounds", thing, this.boxFor(thing)),
      () => this.setAllBounds(),
      () => this.setLocalBounds(thing),
      () => this.setLocalBounds(thing),
      () => this.setTransforms(),
      () => this.setTransforms(),
      () => this.setLayers(this.thing(true)),
      () => this.setFlags(this.thing(true)),
      () => this.setFlags(thing),
      () => this.giveMesh(thing, this.boxFor(thing)),
      () => this.giveMesh(thing, this.boxFor(thing)),
      () => this.giveMesh(thing, this.box(), this.transform()),
      () => this.meshes.length > 0 && this.setMesh(thing, this.pick(this.meshes), this.transform()),
      () => this.refuseMesh(this.thing(true)),
      () => this.removeMesh(),
      () => this.setTriangles(this.thing(true)),
      () => this.setTriangles(thing),
      () => this.prepare(),
      () => this.call(this.pick(["maintain", "rebuild"]), [], []),
    ])();
  }

  // Checks.

  /** Nothing that a frame hides is in a line of sight. */
  look() {
    const [y, turn] = [0.6 * this.random(), 0.12 * this.random()];
    const [eye, ahead] = [[0, y, 0], [Math.cos(turn), Math.sin(turn), 0]];
    const lens = { up: [0, 0, 1], fovY: 1, aspect: 1, near: 0.1 };
    const { bits, inView } = this.frame({ eye, target: eye.map((x, k) => x + ahead[k]), ...lens });
    const half = Math.tan(lens.fovY / 2) - SLACK;
    const boxes = this.things.map(({ late }) => this.scene.bounds(late));
    this.things.forEach((thing, at) => {
      const index = indexOf(thing.late);
      if (!has(inView, index) || has(bits, index)) return;
      count("hidden");
      if (this.rounds) return;
      const { min, max } = boxes[at];
      const what = `object ${index}, from ${min} to ${max}, is hidden`;
      assert.ok(isFinite(boxes[at]) && (thing.flags & Flag.NeverCull) === 0, `${what}, and is never culled`);
      const others = this.things.flatMap((other, i) => (other === thing ? [] : other.hiding(boxes[i])));
      const parts = [0.001, 0.5, 0.999];
      for (const point of parts.flatMap((a) => parts.flatMap((b) => parts.map((c) => [a, b, c])))) {
        const [dx, dy, dz] = point.map((part, k) => (point[k] = min[k] + part * (max[k] - min[k])) - eye[k]);
        const [depth, aside] = [dx * ahead[0] + dy * ahead[1], dy * ahead[0] - dx * ahead[1]];
        if (depth < lens.near || Math.max(Math.abs(aside), Math.abs(dz)) > half * depth) continue;
        assert.ok(others.some((other) => isBehind(other, eye, point)), `${what}, and seen at ${point} from ${eye}`);
        count("points");
      }
    });
    count("used", Number(this.answers.stats.isUsed));
  }

  /** The boxes of things are the same everywhere, but for rounding. */
  compareBoxes() {
    for (const { late, plain } of this.things) {
      const here = numbers(this.scene.bounds(late));
      const others = [["the worker", this.boxOf(indexOf(late))]];
      if (!this.rounds) others.push(["the scene without", this.plain.bounds(plain)]);
      for (const [where, own] of others) {
        const off = Math.max(...numbers(own).map((x, i) => (Object.is(x, here[i]) ? 0 : Math.abs(x - here[i]))));
        assert.ok(off < 1e-4, `object ${indexOf(late)}: box ${here} here, ${numbers(own)} in ${where}`);
        count("boxes");
      }
    }
  }
}

/** Makes a run of random calls and checks. Returns the refusals that end all answers of the worker. */
function run(both) {
  const broken = () => both.scene.refusals.filter((text) => !/^(addMesh|setMesh|setTriangles): /.test(text));
  for (let i = 0; i < 4; i++) both.insert();
  for (let round = 0; round < ROUNDS; round++) {
    for (let calls = both.below(3); calls > 0; calls--) both.step();
    both.look();
    for (let late = both.below(3); late > 0; late--) both.deliver();
    if (both.below(2) > 0) continue;
    // Twice: an answer may be under way.
    for (let i = 0; i < 2; i++) {
      both.settle();
      both.look();
    }
    if (broken().length > 0) break;
    both.compareBoxes();
  }
  return broken();
}

for (const rounds of [false, true]) {
  test(`random calls${rounds ? ", with boxes that are enlarged by rounding" : ""}`, () => {
    tally.clear();
    for (let seed = FIRST; seed < FIRST + RUNS; seed++) {
      const both = new Both(randomOf(seed), rounds);
      try {
        const broken = run(both).join();
        if (broken !== "") count("broken");
        assert.match(broken, rounds ? /^$|^setLocalBounds: the object is elsewhere/ : /^$/);
      } catch (error) {
        error.message = `run ${seed}: ${error.message}`;
        throw error;
      }
      both.destroy();
    }
    const few = { used: 30, hidden: 20, boxes: 100, "setTransforms OK": 2, "setLocalBounds OK": 4 };
    for (const [what, least] of Object.entries(few))
      assert.ok(tally.get(what) > least * RUNS, `${what}: ${tally.get(what)} in ${RUNS} runs`);
  });
}
