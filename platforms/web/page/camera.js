// A camera that a person flies by keyboard, mouse and touch. The y axis points up.

import { Matrix4, Vector3 } from "three";

export const add = (a, b, factor = 1) => a.map((number, i) => number + factor * b[i]);
export const unit = (a) => a.map((number) => number / (Math.hypot(...a) || 1));

/** Radians per pixel of a drag. */
const LOOK = 0.004;
/** Greatest angle from the horizon in radians. */
const STEEPEST = 1.5;
/** Pixels by which a pointer may move and still be a click. */
const CLICK = 6;
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

/**
 * Returns the unit vectors `right`, `up` and `ahead` of a camera, as three.js finds them: also for a camera that
 * looks straight along its `up`.
 */
export function basisOf({ eye, target, up }) {
  const at = (place) => new Vector3(...place);
  const { elements: e } = new Matrix4().lookAt(at(eye), at(target), at(up));
  return { right: [e[0], e[1], e[2]], up: [e[4], e[5], e[6]], ahead: [-e[8], -e[9], -e[10]] };
}

/** `eye`, and angles in radians: `yaw` from the x axis against the z axis, `pitch` from the horizon. */
export class Flyer {
  eye = [0, 0, 0];
  yaw = 0;
  pitch = 0;
  /** Metres per second. */
  speed = 6;
  /** Metres per second of the last move, by axis. */
  velocity = [0, 0, 0];
  #keys = new Set();
  #pointers = new Map();
  #wheel = 0;

  /**
   * Listens to keys of the page, and to pointers on a canvas. Calls `taken` when a person takes over, with
   * `"wheel"` if by the wheel, and `clicked` with the place of a click, from 0 to 1 from left and top.
   */
  constructor(canvas, taken, clicked) {
    addEventListener("keydown", ({ code, target, ctrlKey, metaKey, altKey }) => {
      if (ctrlKey || metaKey || altKey || target.closest?.("select, input, dialog, textarea")) return;
      if (!(code in KEYS || code.startsWith("Shift"))) return;
      this.#keys.add(code);
      if (code in KEYS) taken();
    });
    addEventListener("keyup", ({ code }) => this.#keys.delete(code));
    addEventListener("blur", () => this.#keys.clear());
    canvas.addEventListener("pointerdown", (event) => {
      canvas.focus();
      canvas.setPointerCapture(event.pointerId);
      const moves = event.pointerType === "touch" && event.offsetX < canvas.clientWidth / 2;
      const at = [event.clientX, event.clientY];
      this.#pointers.set(event.pointerId, { moves, start: at, at, isClick: true });
    });
    canvas.addEventListener("pointermove", ({ pointerId, clientX, clientY }) => {
      const pointer = this.#pointers.get(pointerId);
      if (!pointer) return;
      if (Math.hypot(clientX - pointer.start[0], clientY - pointer.start[1]) > CLICK && pointer.isClick) {
        pointer.isClick = false;
        taken();
      }
      if (!pointer.moves && !pointer.isClick) this.#look(clientX - pointer.at[0], clientY - pointer.at[1]);
      pointer.at = [clientX, clientY];
    });
    canvas.addEventListener("pointerup", (event) => {
      const { offsetX, offsetY, pointerId } = event;
      if (this.#pointers.get(pointerId)?.isClick)
        clicked([offsetX / canvas.clientWidth, offsetY / canvas.clientHeight]);
      this.#pointers.delete(pointerId);
    });
    canvas.addEventListener("pointercancel", ({ pointerId }) => this.#pointers.delete(pointerId));
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
    this.pitch = Math.max(-STEEPEST, Math.min(STEEPEST, this.pitch - y * LOOK));
  }

  get ahead() {
    const level = Math.cos(this.pitch);
    return [Math.cos(this.yaw) * level, Math.sin(this.pitch), -Math.sin(this.yaw) * level];
  }

  /** Takes place and direction of another camera; not the last degrees to straight up or down. */
  follow({ eye, target }) {
    const [x, y, z] = unit(add(target, eye, -1));
    this.eye = [...eye];
    this.yaw = Math.atan2(-z, x);
    this.pitch = Math.max(-STEEPEST, Math.min(STEEPEST, Math.asin(Math.max(-1, Math.min(1, y)))));
  }

  /** Returns how many notches the wheel has turned since the last call. */
  takeWheel() {
    const wheel = this.#wheel;
    this.#wheel = 0;
    return wheel;
  }

  /** Moves for so many seconds, and so many notches of the wheel ahead. */
  move(seconds, notches) {
    let [right, up, forth] = [0, 0, (this.speed / 3) * notches];
    const fast = [...this.#keys].some((code) => code.startsWith("Shift")) ? 4 : 1;
    for (const code of this.#keys) {
      const [x, y, z] = KEYS[code] ?? [0, 0, 0];
      [right, up, forth] = add([right, up, forth], [x, y, z], this.speed * fast * seconds);
    }
    for (const { moves, start, at, isClick } of this.#pointers.values()) {
      // 60 pixels from where the finger came down are full speed.
      const push = (i) => Math.max(-3, Math.min(3, (at[i] - start[i]) / 60));
      if (moves && !isClick) [right, forth] = add([right, forth], [push(0), -push(1)], this.speed * seconds);
    }
    const sideways = [Math.sin(this.yaw), 0, Math.cos(this.yaw)];
    const before = this.eye;
    this.eye = add(add(add(before, this.ahead, forth), sideways, right), [0, 1, 0], up);
    this.velocity = add(this.eye, before, -1).map((x) => (seconds > 0 ? x / seconds : 0));
  }

  get camera() {
    return { eye: this.eye, target: add(this.eye, this.ahead), up: [0, 1, 0] };
  }
}
