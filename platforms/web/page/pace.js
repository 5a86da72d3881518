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

/** Milliseconds until a picture is there from which on it is slow. */
export const SLOW_PICTURE_MS = 1000;

/** How long the graphics card takes for pictures of a model, without waiting for it. */
export class DrawTime {
  /** Milliseconds from the begin of the last picture that was followed to its end; null until one is there. */
  milliseconds = null;
  #fence = null;
  #begun = 0;
  #isFirst = true;

  /** Follows a picture whose calls have been made since `begun`, unless another is followed. */
  follow(gl, begun) {
    if (this.#fence) return;
    this.#fence = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
    this.#begun = begun;
    gl.flush();
  }

  /** Looks whether the picture is there. Whether it tells nothing, so that another must be drawn. */
  look(gl, now) {
    if (!this.#fence || gl.getSyncParameter(this.#fence, gl.SYNC_STATUS) !== gl.SIGNALED) return false;
    gl.deleteSync(this.#fence);
    this.#fence = null;
    const milliseconds = now - this.#begun;
    // Buffers, shaders and shadows come with the first picture.
    const isLost = this.#isFirst && milliseconds > SLOW_PICTURE_MS;
    this.#isFirst = false;
    if (!isLost) this.milliseconds = milliseconds;
    return isLost;
  }

  get isSlow() {
    return this.milliseconds > SLOW_PICTURE_MS;
  }
}
