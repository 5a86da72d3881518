// Walks through a model that comes without cameras: past what a person could walk past, at the height of the
// eyes.
//
// Boxes of objects are marked in a grid of one level. Cells that are free and have something on all four
// sides are rooms, streets and yards; the walks lead through the largest of them, then once around the model.

/** Cells along the longer side of the model. */
const GRID = 96;
/** Heights in metres above the lowest point that are tried, and shares of the model's height. */
const HEIGHTS = { metres: [1.7, 3, 4.5], shares: [0.2, 0.35, 0.5] };
/** A box that covers this share of the model on both level axes is ground or a shell, and blocks nothing. */
const SHELL = 0.6;
/** Number of places that are walked through, and the least number of cells of one. */
const MOST_PLACES = 4;
const LEAST_CELLS = 6;
/** Most keys of the walk through one place. */
const KEYS = 24;
/** Keys of the way around the model, which are the last. */
export const AROUND = 24;
/** Vertical field of view in radians of cameras that come without one. */
export const FOV_Y = 1.05;

/** Cells of a level that are blocked. */
function level(bounds, box, step, [columns, rows], y, clearance) {
  const [x0, , z0, x1, , z1] = box;
  const blocked = new Uint8Array(columns * rows);
  for (let at = 0; at < bounds.length; at += 6) {
    const [ax, ay, az, bx, by, bz] = bounds.subarray(at, at + 6);
    if (!(ay <= y + clearance && by >= y - clearance)) continue;
    if (bx - ax > SHELL * (x1 - x0) && bz - az > SHELL * (z1 - z0)) continue;
    // A place on the far side of the model is in the last cells.
    const cell = (distance, count) => Math.min(count - 1, Math.max(0, Math.floor(distance / step)));
    const [from, to] = [cell(ax - x0, columns), cell(bx - x0, columns)];
    for (let row = cell(az - z0, rows); row <= cell(bz - z0, rows); row++)
      blocked.fill(1, row * columns + from, row * columns + to + 1);
  }
  return blocked;
}

/** Whether each free cell has a blocked one in all four directions. */
function enclosed(blocked, columns, rows) {
  const sides = new Uint8Array(blocked.length);
  const sweep = (start, stride, count) => {
    for (const [first, direction] of [
      [start, stride],
      [start + (count - 1) * stride, -stride],
    ]) {
      let met = false;
      for (let i = 0, at = first; i < count; i++, at += direction) {
        if (blocked[at]) met = true;
        else if (met) sides[at]++;
      }
    }
  };
  for (let row = 0; row < rows; row++) sweep(row * columns, 1, columns);
  for (let column = 0; column < columns; column++) sweep(column, columns, rows);
  return sides.map((count) => (count === 4 ? 1 : 0));
}

/**
 * Cells in the order in which a flood from one reaches them, within `open`, and where each was reached from.
 */
function flood(open, columns, rows, start, reached) {
  const cells = [start];
  const from = new Map([[start, -1]]);
  reached[start] = 1;
  for (let i = 0; i < cells.length; i++) {
    const cell = cells[i];
    const column = cell % columns;
    for (const [next, isInside] of [
      [cell - 1, column > 0],
      [cell + 1, column < columns - 1],
      [cell - columns, cell >= columns],
      [cell + columns, cell < columns * (rows - 1)],
    ]) {
      if (!isInside || !open[next] || from.has(next)) continue;
      from.set(next, cell);
      reached[next] = 1;
      cells.push(next);
    }
  }
  return { cells, from };
}

/**
 * The longest way through a place: from the cell that is farthest from any to the one farthest from that.
 */
function longestWay(open, columns, rows, place) {
  const scratch = new Uint8Array(open.length);
  const end = flood(open, columns, rows, place[0], scratch).cells.at(-1);
  const { cells, from } = flood(open, columns, rows, end, scratch);
  const way = [];
  for (let cell = cells.at(-1); cell >= 0; cell = from.get(cell)) way.push(cell);
  return way;
}

/** Cameras through a model: `bounds` are 6 numbers for each object, `box` is around all. */
export function walksOf(bounds, box) {
  const [x0, y0, z0, x1, y1, z1] = box;
  const step = Math.max(x1 - x0, z1 - z0, 1e-6) / GRID;
  const [columns, rows] = [x1 - x0, z1 - z0].map((length) => Math.max(1, Math.ceil(length / step)));
  const height = y1 - y0;
  let best = { cells: 0, places: [] };
  const tried = [
    ...HEIGHTS.metres.filter((y) => y < 0.8 * height),
    ...HEIGHTS.shares.map((part) => part * height),
  ];
  for (const above of tried) {
    const blocked = level(bounds, box, step, [columns, rows], y0 + above, Math.min(0.3, 0.05 * height));
    const open = enclosed(blocked, columns, rows);
    const reached = new Uint8Array(open.length);
    const places = [];
    for (let cell = 0; cell < open.length; cell++)
      if (open[cell] && !reached[cell]) places.push(flood(open, columns, rows, cell, reached).cells);
    places.sort((a, b) => b.length - a.length);
    const large = places.slice(0, MOST_PLACES).filter(({ length }) => length >= LEAST_CELLS);
    const cells = large.reduce((sum, { length }) => sum + length, 0);
    if (cells > best.cells)
      best = { cells, y: y0 + above, places: large.map((place) => longestWay(open, columns, rows, place)) };
  }
  const keys = best.places.flatMap((way) => {
    const places = way.map((cell) => [
      x0 + ((cell % columns) + 0.5) * step,
      best.y,
      z0 + (Math.floor(cell / columns) + 0.5) * step,
    ]);
    return along(smooth(places));
  });
  return [...keys, ...around(box)];
}

/** Places of a way, each the mean of its neighbours. */
function smooth(places) {
  const reach = 2;
  return places.map((_, i) => {
    const near = places.slice(Math.max(0, i - reach), i + reach + 1);
    return [0, 1, 2].map((k) => near.reduce((sum, place) => sum + place[k], 0) / near.length);
  });
}

const camera = (eye, target) => ({ eye, target, up: [0, 1, 0], fovY: FOV_Y });

/** Cameras along a way, each looking at where the way leads, and back from its end. */
function along(places) {
  const count = Math.min(KEYS, places.length);
  const last = places.length - 1;
  return Array.from({ length: count }, (_, key) => {
    const at = Math.round((key * last) / Math.max(1, count - 1));
    const ahead = places[Math.min(last, at + 6)];
    const target = at + 2 > last ? places[at].map((x, i) => x + (x - places[Math.max(0, at - 6)][i])) : ahead;
    const isSame = Math.hypot(...target.map((x, i) => x - places[at][i])) < 1e-9;
    return camera(places[at], isSame ? [places[at][0] + 1, places[at][1], places[at][2]] : target);
  });
}

/** Cameras once around a model, looking at its middle. */
function around([x0, y0, z0, x1, y1, z1]) {
  const middle = [(x0 + x1) / 2, (y0 + y1) / 2, (z0 + z1) / 2];
  const reach = 0.75 * (Math.hypot(x1 - x0, y1 - y0, z1 - z0) || 1);
  return Array.from({ length: AROUND }, (_, key) => {
    const angle = 0.9 + (2 * Math.PI * key) / AROUND;
    const eye = [
      middle[0] + reach * Math.cos(angle),
      middle[1] + 0.45 * reach,
      middle[2] + reach * Math.sin(angle),
    ];
    return camera(eye, middle);
  });
}
