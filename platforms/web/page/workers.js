// Cullers in workers: a z-buffer and portals made from the geometry, whose answers come late, and a bake that runs
// while one looks. What comes late hides nothing by mistake: see `../package/late.js`.

import { LateAnswers, LateScene, countBits, startWorker } from "../package/late.js";

/** Greatest angle of a turn, in radians, for which an answer is good. */
const REACH_RADIANS = 0.15;
/** Parts of the scene's size: how far the eye may move until an answer is of no use, and the side of a baked box. */
const [REACH_PART, BOX_PART] = [1 / 500, 1 / 60];
/** Greatest number of cells that portals are made for. */
const MOST_CELLS = 2000;
/** Greatest number of baked boxes that are kept. */
const MOST_BOXES = 512;
/** Moments in seconds from now at which the eye's places are baked first. */
const AHEAD_SECONDS = [0, 0.3, 0.8, 1.6];
/** Boxes around the eye that are baked when there is nothing else to do. */
const AROUND = [-1, 0, 1].flatMap((x) => [-1, 0, 1].flatMap((y) => [-1, 0, 1].map((z) => [x, y, z])));
/** The worker that answers for frames, and the one that bakes. */
const [FOR_FRAMES, FOR_BOXES] = [0, 1];

/** The boxes of a grid, and what is hidden from all points of each: made by a worker, nearest first. */
class Bake {
  #scene;
  #side;
  #made = new Map();
  #isAsked = false;
  milliseconds = 0;

  constructor(scene, side) {
    this.#scene = scene;
    this.#side = side;
  }

  #cellOf(place) {
    return place.map((x) => Math.floor(x / this.#side));
  }

  /** Returns the box of a cell, with so much around it that the near plane of an eye within is in the box. */
  #boxOf(cell, around) {
    return {
      min: cell.map((i) => i * this.#side - around),
      max: cell.map((i) => (i + 1) * this.#side + around),
    };
  }

  /** Takes out of `bits` what is hidden from the box around the eye, if that is known. */
  apply(eye, around, velocity, bits) {
    const cell = this.#cellOf(eye);
    const made = this.#made.get(cell.join());
    if (made && made.around >= around && this.#scene.holds(made.revision)) {
      for (let word = 0; word < Math.min(bits.length, made.bits.length); word++) {
        // Objects of the page do not change once their occluders are there.
        bits[word] &= ~made.bits[word];
      }
    }
    this.#ask(cell, eye, around, velocity);
    return made;
  }

  #ask(here, eye, around, velocity) {
    if (this.#isAsked) return;
    const coming = AHEAD_SECONDS.map((t) => this.#cellOf(eye.map((x, i) => x + t * velocity[i])));
    const near = AROUND.map((by) => here.map((i, axis) => i + by[axis]));
    const cell = [...coming, ...near].find((cell) => {
      const made = this.#made.get(cell.join());
      return !made || made.around < around || !this.#scene.holds(made.revision) || made.isOld(this.#scene);
    });
    if (!cell) return;
    this.#isAsked = true;
    const box = this.#boxOf(cell, around);
    const then = ({ bits, revision, milliseconds }) => {
      this.#isAsked = false;
      this.milliseconds = milliseconds;
      const isOld = (scene) => scene.revision > revision;
      this.#made.delete(cell.join());
      this.#made.set(cell.join(), { ...box, bits, revision, around, isOld, hidden: countBits(bits) });
      if (this.#made.size > MOST_BOXES) this.#made.delete(this.#made.keys().next().value);
    };
    this.#scene.ask({ what: "hidden", ...box }, then, FOR_BOXES);
  }

  get boxes() {
    return [...this.#made.values()];
  }
}

/** The workers of a model: they have its objects, with the same indices, and get its occluders. */
export class Workers {
  /** The last frame: answers that were used, and their age and times. */
  stats = {};
  #visibility;
  #answers = [];
  #bake = null;

  /**
   * `objects` is what `Scene.insertAll` takes. `canBake` is whether there is a worker that bakes: it has all occluders,
   * too.
   */
  constructor(visibility, objects, canBake) {
    this.#visibility = visibility;
    this.canBake = canBake;
    const workers = canBake ? [startWorker(), startWorker()] : [startWorker()];
    this.scene = new LateScene(visibility.createScene(), workers);
    this.ids = this.scene.insertAll(objects);
    this.scene.rebuild();
  }

  /** Chooses among `late`, `rooms` and `bake`. `size` and `near` are lengths of the scene. */
  choose(names, { size, near }) {
    for (const [, answers] of this.#answers) answers.destroy();
    const stages = { late: [["addZBuffer"]], rooms: [["addPortals", { maxCells: MOST_CELLS }]] };
    const options = { metres: Math.max(size * REACH_PART, 2 * near), radians: REACH_RADIANS };
    const make = (name) => new LateAnswers(this.#visibility, this.scene, { ...options, stages: stages[name] });
    this.#answers = names.filter((name) => stages[name]).map((name) => [name, make(name)]);
    this.#bake = names.includes("bake") ? new Bake(this.scene, size * BOX_PART) : null;
  }

  /**
   * Takes out of `bits` what workers have found to be hidden from a view, set by `lens`. Returns the number of
   * objects that each has left, by name.
   */
  apply(view, lens, velocity, bits) {
    const left = [];
    this.stats = { answers: [], used: [] };
    for (const [name, answers] of this.#answers) {
      answers.apply(view, ["setPerspective", lens], bits);
      left.push([name, countBits(bits)]);
      this.stats.answers.push([name, { ...answers.stats }]);
      this.stats.used.push(answers.stats.number);
    }
    if (this.#bake) {
      // Distance from the eye to the corners of the near plane, and a little for rounding.
      const high = Math.tan(lens.fovY / 2);
      const around = 1.01 * lens.near * Math.hypot(1, high, high * lens.aspect);
      const used = this.#bake.apply(lens.eye, around, velocity, bits);
      left.push(["bake", countBits(bits)]);
      this.stats.used.push(used?.min.join());
      Object.assign(this.stats, { boxes: this.#bake.boxes.length, box: used, bakeMs: this.#bake.milliseconds });
    }
    this.scene.flush();
    return left;
  }

  get boxes() {
    return this.#bake?.boxes ?? [];
  }

  /** Text that changes with the answers that were used. */
  get used() {
    return this.stats.used?.join() ?? "";
  }

  destroy() {
    for (const [, answers] of this.#answers) answers.destroy();
    this.scene.destroy();
  }
}
