// Vectors, matrices, and a camera that is flown by keyboard, mouse and touch.

export const add = (a, b, factor = 1) => a.map((number, i) => number + factor * b[i]);
export const cross = ([a, b, c], [d, e, f]) => [b * f - c * e, c * d - a * f, a * e - b * d];
export const dot = (a, b) => a.reduce((sum, number, i) => sum + number * b[i], 0);
export const unit = (a) => a.map((number) => number / Math.hypot(...a));

/** Returns the rows of the matrix that turns the world into the camera's axes: right, up, backwards. */
function axes({ eye, target, up }) {
  const back = unit(add(eye, target, -1));
  const right = unit(cross(up, back));
  return [right, cross(back, right), back];
}

/**
 * Multiplies the camera's axes and eye into a column-major matrix with these scales of x and y, and rows z
 * and w.
 */
function project(camera, scaleX, scaleY, zOf, wOf) {
  const rows = axes(camera);
  const [x, y, z] = rows.map((row) => [...row, -dot(row, camera.eye)]);
  const columns = [0, 1, 2, 3].map((i) => [scaleX * x[i], scaleY * y[i], zOf(z[i], i), wOf(z[i], i)]);
  return new Float32Array(columns.flat());
}

/** The clip matrix of a camera in perspective, without far plane, for WebGL. */
export function perspective(camera) {
  const scale = 1 / Math.tan(camera.fovY / 2);
  const w = (z) => -z;
  // Depth of the limit is a little less than w, so that rounding cuts nothing off.
  const depth = (z, i) => -z * (1 - 1e-6) - (i === 3 ? 2 * camera.near : 0);
  return project(camera, scale / camera.aspect, scale, depth, w);
}

/** The clip matrix of a camera with parallel lines of sight, `height` metres high, for WebGL. */
export function orthographic(camera, height, far) {
  const depth = (z, i) => (-2 * z) / far - (i === 3 ? 1 : 0);
  return project(camera, 2 / (height * camera.aspect), 2 / height, depth, (_, i) => (i === 3 ? 1 : 0));
}

/** Radians per pixel of a drag. */
const LOOK = 0.004;
/** Metres per second. */
const SPEED = 6;
const KEYS = {
  KeyW: [0, 0, 1],
  ArrowUp: [0, 0, 1],
  KeyS: [0, 0, -1],
  ArrowDown: [0, 0, -1],
  KeyA: [-1, 0, 0],
  ArrowLeft: [-1, 0, 0],
  KeyD: [1, 0, 0],
  ArrowRight: [1, 0, 0],
  KeyE: [0, 1, 0],
  KeyQ: [0, -1, 0],
};

/** A camera that a person flies: `eye`, and angles in radians from the x axis and from the horizon. */
export class Flyer {
  eye = [0, 0, 0];
  yaw = 0;
  pitch = 0;
  #keys = new Set();
  #pointers = new Map();
  #wheel = 0;

  /**
   * Listens to keys of the page, and to pointers on a canvas. Calls `taken` when a person takes over, with
   * `"wheel"` if by the wheel.
   */
  constructor(canvas, taken) {
    addEventListener("keydown", ({ code, target, ctrlKey, metaKey }) => {
      if (
        ctrlKey ||
        metaKey ||
        target instanceof HTMLSelectElement ||
        !(code in KEYS || code.startsWith("Shift"))
      )
        return;
      this.#keys.add(code);
      if (code in KEYS) taken();
    });
    addEventListener("keyup", ({ code }) => this.#keys.delete(code));
    addEventListener("blur", () => this.#keys.clear());
    canvas.addEventListener("pointerdown", (event) => {
      canvas.focus();
      canvas.setPointerCapture(event.pointerId);
      const moves = event.pointerType === "touch" && event.clientX < canvas.clientWidth / 2;
      const { clientX, clientY } = event;
      this.#pointers.set(event.pointerId, { moves, start: [clientX, clientY], at: [clientX, clientY] });
      taken();
    });
    canvas.addEventListener("pointermove", ({ pointerId, clientX, clientY }) => {
      const pointer = this.#pointers.get(pointerId);
      if (!pointer) return;
      if (!pointer.moves) this.#look(clientX - pointer.at[0], clientY - pointer.at[1]);
      pointer.at = [clientX, clientY];
    });
    for (const end of ["pointerup", "pointercancel"]) {
      canvas.addEventListener(end, ({ pointerId }) => this.#pointers.delete(pointerId));
    }
    canvas.addEventListener(
      "wheel",
      (event) => {
        event.preventDefault();
        this.#wheel -= event.deltaY / 100;
        taken("wheel");
      },
      { passive: false },
    );
  }

  #look(x, y) {
    this.yaw -= x * LOOK;
    this.pitch = Math.max(-1.5, Math.min(1.5, this.pitch - y * LOOK));
  }

  get ahead() {
    const level = Math.cos(this.pitch);
    return [Math.cos(this.yaw) * level, Math.sin(this.yaw) * level, Math.sin(this.pitch)];
  }

  /** Takes place and direction of another camera. */
  follow({ eye, target }) {
    const [x, y, z] = unit(add(target, eye, -1));
    this.eye = [...eye];
    [this.yaw, this.pitch] = [Math.atan2(y, x), Math.asin(z)];
  }

  /** Returns how many notches the wheel has turned since the last call. */
  takeWheel() {
    const wheel = this.#wheel;
    this.#wheel = 0;
    return wheel;
  }

  /** Moves for so many seconds, and so many notches of the wheel ahead. */
  move(seconds, notches) {
    let [right, up, forth] = [0, 0, 2 * notches];
    const fast = [...this.#keys].some((code) => code.startsWith("Shift")) ? 4 : 1;
    for (const code of this.#keys) {
      const [x, y, z] = KEYS[code] ?? [0, 0, 0];
      [right, up, forth] = add([right, up, forth], [x, y, z], SPEED * fast * seconds);
    }
    for (const { moves, start, at } of this.#pointers.values()) {
      // 60 pixels from where the finger came down are full speed.
      const push = (i) => Math.max(-3, Math.min(3, (at[i] - start[i]) / 60));
      if (moves) [right, forth] = add([right, forth], [push(0), -push(1)], SPEED * seconds);
    }
    const sideways = [Math.sin(this.yaw), -Math.cos(this.yaw), 0];
    this.eye = add(add(add(this.eye, this.ahead, forth), sideways, right), [0, 0, 1], up);
  }

  get camera() {
    return { eye: this.eye, target: add(this.eye, this.ahead), up: [0, 0, 1] };
  }
}
