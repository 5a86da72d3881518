// Tests of parts of the page that need no browser.

import assert from "node:assert/strict";
import test from "node:test";
import { Pace } from "../page/pace.js";
import { AROUND, walksOf } from "../page/walks.js";

/** Four walls around a level square of 10 m, each of a thickness, and the box around them. */
function room(thick) {
  const [low, high] = [0, 10];
  const walls = [
    [low, 0, low, low + thick, 3, high],
    [high - thick, 0, low, high, 3, high],
    [low, 0, low, high, 3, low + thick],
    [low, 0, high - thick, high, 3, high],
  ];
  return [Float64Array.from(walls.flat()), [low, 0, low, high, 3, high]];
}

test("a walk leads through a room, also if its walls have no thickness", () => {
  for (const thick of [0.5, 0]) {
    const walk = walksOf(...room(thick));
    const within = walk.slice(0, -AROUND);
    assert.ok(within.length > 10, `walls of ${thick} m: ${within.length} cameras in the room`);
    for (const { eye } of within)
      assert.ok(eye[0] > 0 && eye[0] < 10 && eye[2] > 0 && eye[2] < 10, `walls of ${thick} m: ${eye}`);
  }
  const [bounds, box] = room(0.5);
  assert.equal(walksOf(bounds.subarray(6), box).length, AROUND, "a room of three walls is open");
});

test("cameras around a model look at it, also if it is one point", () => {
  for (const box of [
    [0, 0, 0, 4, 3, 2],
    [5, 5, 5, 5, 5, 5],
  ]) {
    for (const { eye, target } of walksOf(Float64Array.from(box), box))
      assert.ok(
        Math.hypot(...eye.map((x, i) => x - target[i])) > 0.1,
        `box ${box}: from ${eye} to ${target}`,
      );
  }
});

test("frames that take long are slow, times between them that are no frames are not", () => {
  const count = (interval, frames, pace = new Pace(0)) => {
    let slow = 0;
    for (let i = 0; i < frames; i++) if (pace.isSlow(interval)) slow++;
    return slow;
  };
  assert.deepEqual([count(16, 100), count(44, 100), count(46, 100), count(46, 19)], [0, 0, 5, 0]);
  const pace = new Pace(1000);
  assert.deepEqual([pace.begin(1016), pace.begin(1050), pace.begin(1049)], [16, 34, 0]);
  assert.equal(count(16, 19, pace), 0);
  pace.restart(9000);
  assert.equal(pace.begin(9016), 16, "since the restart");
  assert.equal(count(200, 19, pace), 0, "frames from before the restart do not count");
  assert.equal(count(200, 1, pace), 1);
});
