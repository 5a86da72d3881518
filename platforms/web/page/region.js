// Objects that can be seen from a box around the eye, found in a worker: a sweep of the box hides some; of the others,
// rays have seen some, proofs hide some, and some are not decided.

import { LateScene, countBits, startWorker } from "../package/late.js";
import { Flag } from "../package/visibility.js";
import { pause } from "./load.js";

/** Greatest number of triangles of a model for which proofs are tried: they take 200 bytes each in the worker. */
const MOST_TRIANGLES = 400_000;
/** Rays and search nodes after which objects stay undecided: some ten seconds of a core. */
const MOST_STEPS = 3_000_000;
const SLICE_MS = 20;

/** The objects of a model with all their triangles, in a worker of their own. */
export class Region {
  #filled = null;
  #scene;
  #ids;
  #give;
  #isGone = false;

  /** Whether a model of so many triangles is small enough. */
  static suits(triangles) {
    return triangles <= MOST_TRIANGLES;
  }

  /** `give` returns the triangles of an item, 9 numbers each, or null if it hides nothing and is but its box. */
  constructor(visibility, objects, give) {
    this.#scene = new LateScene(visibility.createScene(), [startWorker()]);
    this.#ids = this.#scene.insertAll(objects);
    this.#scene.rebuild();
    this.#give = give;
  }

  async #fill(progress) {
    let sliced = performance.now();
    for (let item = 0; item < this.#ids.length && !this.#isGone; item++) {
      const triangles = this.#give(item);
      if (triangles) this.#scene.setTriangles(this.#ids[item], triangles);
      if (performance.now() - sliced < SLICE_MS) continue;
      progress(`Triangles: ${item} of ${this.#ids.length} objects`);
      this.#scene.flush();
      await pause();
      sliced = performance.now();
    }
    this.#scene.prepareOccluders();
  }

  /**
   * Looks from a box, `min` and `max` in the scene's axes. Resolves to bits of items: `swept` are those that the sweep
   * leaves, of which `seen` are met by a ray and `hidden` are proven hidden; and to the number of each.
   */
  async look(box, progress) {
    await (this.#filled ??= this.#fill(progress));
    if (this.#isGone) return null;
    progress("Sweep, rays and proofs from the box");
    const answer = await new Promise((resolve) =>
      this.#scene.ask({ what: "region", ...box, mostSteps: MOST_STEPS }, resolve),
    );
    if (this.#isGone) return null;
    // The page then says why, and shows the view as it was.
    if (!answer) throw new Error(`the worker found nothing: ${this.#scene.refusals.at(-1)}`);
    const { bits: swept, seen, hidden, milliseconds } = answer;
    const among = (bits) => swept.map((word, i) => word & bits[i]);
    const open = swept.map((word, i) => word & ~seen[i] & ~hidden[i]);
    const sets = { swept, seen: among(seen), hidden: among(hidden), open };
    const counts = Object.fromEntries(Object.entries(sets).map(([name, bits]) => [name, countBits(bits)]));
    // A ray that sees what the sweep hides would be a mistake of the library: the page says so.
    counts.wrong = countBits(seen) - counts.seen;
    return { ...box, sets, counts, milliseconds };
  }

  destroy() {
    this.#isGone = true;
    this.#scene.destroy();
  }
}

/** The flags of an item: opaque or not, and drawn from its front alone or from both sides. */
export function flagsOf(isSolid, isTwoSided) {
  return (isSolid ? Flag.Occluder : Flag.SeeThrough) | (isTwoSided ? 0 : Flag.OneSided);
}
