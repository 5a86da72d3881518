// How long frames take, to tell whether pictures should be coarser.

/** Frames over which times are averaged. */
const FRAMES = 20;
/** Milliseconds of a frame from which on the picture gets coarser. */
const SLOW_MS = 45;

export class Pace {
  #last;
  #intervals = [];

  /** `now` is the present time in milliseconds. */
  constructor(now) {
    this.#last = now;
  }

  /** Begins a frame. Returns the milliseconds since the last one: 0 if `now` is before that. */
  begin(now) {
    const interval = Math.max(0, now - this.#last);
    this.#last = now;
    return interval;
  }

  /** Counts a frame that is drawn. Whether the last of them took so long that pictures should be coarser. */
  isSlow(interval) {
    this.#intervals = [...this.#intervals.slice(1 - FRAMES), interval];
    if (this.#intervals.length < FRAMES) return false;
    const isSlow = this.#intervals.reduce((sum, time) => sum + time, 0) >= FRAMES * SLOW_MS;
    if (isSlow) this.#intervals = [];
    return isSlow;
  }

  /** Forgets what was no drawing: a model was loaded, a report made, or the page not shown. */
  restart(now) {
    this.#last = now;
    this.#intervals = [];
  }
}
