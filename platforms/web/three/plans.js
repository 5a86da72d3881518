// Plans of a three.js scene, and who sees whom in it, by the package `visibility-web`: a cut of what hides at a height,
// what an eye sees of it, and which movers may see which. `plans.d.ts` describes what is exported here.
//
// The plan's x and y are the world's x and z. A material that is drawn from its front alone is a wall that stops sight
// from its front alone, as in the picture.

import { Box3, BufferAttribute, BufferGeometry, Layers, Matrix4, Vector3 } from "three";
import { Flag, Opacity, load } from "visibility-web";
import { moveBox, place } from "./boxes.js";
import {
  hasInstances,
  hasMatrices,
  isApart,
  isCountedElsewhere,
  isUsual,
  partOf,
  placeOccluder,
} from "./entries.js";
import { countOf } from "./instances.js";
import { Shape, Surface, Surfaces, trianglesOf } from "./surfaces.js";

/** Axes of the world that are the plan's x and y. */
const AXES = [0, 2];
/** Greatest number of triangles of a mesh that hides in `CellSight`, as in `VisibilityCulling`. */
const MOST_TRIANGLES = 1 << 14;
/** Greatest number of cells of `CellSight`: each takes a sweep, and a bit for each other. */
const MOST_CELLS = 1 << 14;
/** Lines along each axis that divide the cells of a plan for `whoSees`: unless told otherwise, and at most. */
const [USUAL_LINES, MOST_LINES] = [16, 64];

const ORIGIN = [0, 0, 0];
/** The layer that cameras draw unless they are told otherwise. */
const USUAL_LAYERS = new Layers();

let library = null;

/** Returns the whole library, loaded once. */
function loaded(visibility) {
  return visibility ?? (library ??= load());
}

/** Returns the surface of a mesh. Only from `Surface.Front` on it hides. */
function surfaceOf(mesh, surfaces, occluder) {
  const { geometry, material } = mesh;
  // Bones move vertices elsewhere.
  const isStill = isUsual(mesh) && mesh.frustumCulled && !mesh.isSkinnedMesh;
  if (!isStill || isCountedElsewhere(mesh) || !hasInstances(mesh)) return Surface.NeverHidden;
  const choice = occluder?.(mesh);
  if (choice === false) return Surface.NeverHidden;
  const surface = Array.isArray(material) ? surfaces.ofAll(material, geometry) : surfaces.now(material);
  return choice === true ? Math.max(surface, Surface.Double) : surface;
}

/** Brings the world matrix of an object up to date, and those of its ancestors. Others still wait for the next frame. */
function updateUpwards(object) {
  if (object.parent) updateUpwards(object.parent);
  const waits = object.matrixWorldNeedsUpdate;
  object.matrixWorldNeedsUpdate = true;
  object.updateWorldMatrix(false, false);
  object.matrixWorldNeedsUpdate = waits;
}

/** Brings the world matrices of an object, of its ancestors, and of all within it up to date. */
function updateWorld(object) {
  if (object.parent) updateUpwards(object.parent);
  object.updateMatrixWorld(true);
}

/** Whether the graphics card alone has the matrices of a mesh's instances. */
function isElsewhere(object) {
  return object.isInstancedMesh && !hasMatrices(object);
}

/** Returns the box around a sprite whichever way it turns. `rectangle` is that of its geometry. */
function spriteBox({ center, matrixWorld }, { min, max }) {
  const scale = new Vector3().setFromMatrixScale(matrixWorld);
  // The sprite turns around its center, which is a point of the square from (0, 0) to (1, 1).
  const reach = (axis) => {
    const middle = center[axis] - 0.5;
    return Math.max(Math.abs(min[axis] - middle), Math.abs(max[axis] - middle)) * scale[axis];
  };
  const radius = Math.hypot(reach("x"), reach("y"));
  const place = new Vector3().setFromMatrixPosition(matrixWorld);
  return new Box3(place.clone(), place).expandByScalar(radius);
}

/** Returns the box around an object and all within it, as they are now: without instances that are elsewhere. */
function boxOf(object) {
  updateWorld(object);
  const box = new Box3();
  const read = new Set();
  object.traverse((part) => {
    // A batch that was disposed of is not drawn.
    if (!part.geometry || isElsewhere(part) || (part.isBatchedMesh && !hasInstances(part))) return;
    for (const bone of part.skeleton?.bones ?? []) if (bone) updateUpwards(bone);
    // `Box3.setFromObject` takes the box of vertices, bones and instances as they were when it was first asked for.
    if (!read.has(part.geometry)) part.geometry.computeBoundingBox();
    read.add(part.geometry);
    const own = part.boundingBox === undefined ? part.geometry : part;
    if (own === part) part.computeBoundingBox();
    if (part.isSprite) box.union(spriteBox(part, own.boundingBox));
    else box.union(own.boundingBox.clone().applyMatrix4(part.matrixWorld));
  });
  return box;
}

/** Yields the meshes of a subtree that cameras with `layers` draw in the usual order. */
function* drawn(object, layers, groupOrder = 0) {
  if (isApart(object)) return;
  if (object.isGroup && object.layers.test(layers)) groupOrder = object.renderOrder;
  if (object.isMesh && groupOrder === 0 && object.layers.test(layers)) yield object;
  // Cameras choose a level each. Before the first frame all are visible, later that of the last camera is.
  const levels = object.isLOD && object.levels.length > 1 ? object.levels.map((level) => level.object) : [];
  for (const child of object.children) {
    const level = levels.indexOf(child);
    if (level === 0 || (level < 0 && child.visible)) yield* drawn(child, layers, groupOrder);
  }
}

/** Yields the meshes of a scene that hide, as `place` takes them: with surface, shapes, and number of instances. */
function* hiding(scene, occluder, layers = USUAL_LAYERS) {
  updateWorld(scene);
  const surfaces = new Surfaces();
  surfaces.begin();
  const shapes = new Map();
  const shapeOf = (geometry, part, range) => {
    if (!shapes.has(geometry)) shapes.set(geometry, new Map());
    const known = shapes.get(geometry);
    if (!known.has(part)) known.set(part, new Shape(geometry, null, range));
    return known.get(part);
  };
  if (!scene.visible) return;
  for (const object of drawn(scene, layers)) {
    const surface = surfaceOf(object, surfaces, occluder);
    if (surface <= Surface.Hideable) continue;
    const { geometry } = object;
    if (object.isBatchedMesh) {
      const parts = object._instanceInfo.map((info) => (info.visible ? partOf(info) : -1));
      const of = (part) => (part < 0 ? null : shapeOf(geometry, part, object.getGeometryRangeAt(part)));
      yield { object, surface, shape: null, many: { shapes: parts.map(of) }, count: parts.length };
    } else if (object.isInstancedMesh) {
      yield { object, surface, shape: shapeOf(geometry, "all"), many: {}, count: countOf(object) };
    } else yield { object, surface, shape: shapeOf(geometry, "all"), many: null, count: 1 };
  }
}

/** Returns the point of an edge at a height: the same from both of its ends. */
function crossing(a, b, height) {
  const isSwapped = a.y > b.y || (a.y === b.y && (a.x > b.x || (a.x === b.x && a.z > b.z)));
  const [low, high] = isSwapped ? [b, a] : [a, b];
  const part = (height - low.y) / (high.y - low.y);
  return [low.x + part * (high.x - low.x), low.z + part * (high.z - low.z)];
}

/** Cuts the triangles of a mesh at a height. Adds walls with the mesh that they are of. */
function cut(mesh, height, walls) {
  const { object, surface, many, count } = mesh;
  const matrix = new Matrix4();
  const isTurned = object.matrixWorld.determinant() < 0 !== (surface === Surface.Back);
  const read = new Map();
  const bounds = new Float64Array(6);
  for (let i = 0; i < count; i++) {
    const shape = many?.shapes ? many.shapes[i] : mesh.shape;
    if (!shape) continue;
    const margin = place(mesh, i, matrix);
    if (shape.box) moveBox(bounds, 0, shape.box, matrix.elements, ORIGIN, margin);
    if (shape.box === null || bounds[4] < height || bounds[1] > height) continue;
    if (!read.has(shape)) read.set(shape, trianglesOf(shape, Infinity));
    const triangles = read.get(shape);
    if (triangles === null || !matrix.elements.every(Number.isFinite)) continue;
    const { positions, indices } = triangles;
    const points = Array.from({ length: positions.length / 3 }, (_, k) =>
      new Vector3().fromArray(positions, 3 * k).applyMatrix4(matrix),
    );
    for (let t = 0; t < indices.length; t += 3) {
      const corners = [0, 1, 2].map((k) => points[indices[t + k]]);
      const isAbove = corners.map(({ y }) => y >= height);
      // Around the triangle there is one edge that leads up through the height, and one that leads down.
      const next = (k) => (k + 1) % 3;
      const up = [0, 1, 2].find((k) => !isAbove[k] && isAbove[next(k)]);
      if (up === undefined) continue;
      const down = [0, 1, 2].find((k) => isAbove[k] && !isAbove[next(k)]);
      const [first, last] = [up, down].map((k) => crossing(corners[k], corners[next(k)], height));
      // Around a front, which is counter-clockwise, the edge that leads up is on the right hand of who looks at it. With
      // the plan's y along z, the front is then on the right of the way from this edge to the other.
      const [from, to] = isTurned ? [last, first] : [first, last];
      const opacity = surface === Surface.Double ? Opacity.Opaque : Opacity.OneWay;
      walls.push({ from, to, opacity, mesh: object, instance: i });
    }
  }
}

/** Returns the x and z of a place: an object, or a point of the world. */
function pair(of) {
  const { x, z } = of.isObject3D ? of.getWorldPosition(new Vector3()) : of;
  return [x, z];
}

/** Returns the 7 numbers of a mover: its box, and how far it may move. */
function reach(of, margin) {
  let box = of;
  if (of.isObject3D) {
    of.traverse((part) => {
      if (isElsewhere(part)) throw new TypeError("a mover's instances are on the graphics card alone");
    });
    // An eye may be outside of the mesh that it has.
    box = boxOf(of).expandByPoint(new Vector3().setFromMatrixPosition(of.matrixWorld));
  } else if (of.isVector3) box = { min: of, max: of };
  else if (box.isEmpty?.()) throw new TypeError("an empty box is no mover");
  const { min, max } = box;
  return [min.x, min.y, min.z, max.x, max.y, max.z, margin];
}

/** Finds who may see whom among movers, in the sight cells of a level. */
function look(visibility, cells, observers, targets, margin) {
  const who = visibility.createWhoSees();
  const movers = (list) => list.flatMap((mover) => reach(mover, margin));
  who.look(cells, movers(observers), movers(targets));
  const seen = new Map();
  observers.forEach((observer, i) => seen.set(observer, new Set([...who.seenBy(i)].map((k) => targets[k]))));
  who.destroy();
  return {
    sees: (observer, target) => seen.get(observer)?.has(target) ?? false,
    seenBy: (observer) => [...(seen.get(observer) ?? [])],
  };
}

/** See `plans.d.ts`. */
export class ScenePlan {
  #visibility;
  #plan;
  #grid;
  #cells = null;

  static async of(scene, { height, occluder, layers, grid, visibility } = {}) {
    if (!Number.isFinite(height)) throw new TypeError("`height` is not a finite number");
    const walls = [];
    for (const mesh of hiding(scene, occluder, layers)) cut(mesh, height, walls);
    return new ScenePlan(await loaded(visibility), walls, height, grid);
  }

  static async ofPolygons(polygons, { height = 0, grid, visibility } = {}) {
    const walls = polygons.flatMap((polygon) =>
      polygon.map((corner, i) => {
        const next = polygon[(i + 1) % polygon.length];
        const ends = [corner, next].map((point) => (Array.isArray(point) ? point : pair(point)));
        return { from: ends[0], to: ends[1], opacity: Opacity.Opaque, mesh: null, instance: 0 };
      }),
    );
    return new ScenePlan(await loaded(visibility), walls, height, grid);
  }

  constructor(visibility, walls, height, grid = 0) {
    if (!(grid >= 0)) throw new TypeError("`grid` is not a length");
    this.#visibility = visibility;
    this.#grid = grid;
    this.#plan = visibility.createPlan(walls);
    this.walls = walls;
    this.height = height;
  }

  sees(a, b) {
    return this.#plan.sees(pair(a), pair(b));
  }

  polygon(eye, options) {
    const corners = this.#plan.polygon(pair(eye), options);
    return Array.from({ length: corners.length / 2 }, (_, i) => {
      return new Vector3(corners[2 * i], this.height, corners[2 * i + 1]);
    });
  }

  geometry(eye, options) {
    const corners = this.polygon(eye, options);
    const [x, z] = pair(eye);
    const positions = [new Vector3(x, this.height, z), ...corners].flatMap((point) => point.toArray());
    // Counter-clockwise with y along z is clockwise as seen from above.
    const fan = corners.flatMap((_, i) => [0, 1 + ((i + 1) % corners.length), 1 + i]);
    const geometry = new BufferGeometry().setIndex(fan);
    return geometry.setAttribute("position", new BufferAttribute(new Float32Array(positions), 3));
  }

  meshesSeen(eye, options) {
    const seen = new Set();
    for (const wall of this.#plan.walls(pair(eye), options)) if (this.walls[wall].mesh) seen.add(this.walls[wall].mesh);
    return [...seen];
  }

  setOpen(object, isOpen) {
    const within = new Set();
    object.traverse((part) => within.add(part));
    let count = 0;
    this.walls.forEach(({ mesh, opacity }, wall) => {
      if (!within.has(mesh)) return;
      count++;
      const now = isOpen ? Opacity.Clear : opacity;
      this.#plan.setOpacity(wall, now);
      this.#cells?.setOpacity(wall, now);
      this.walls[wall].isOpen = isOpen;
    });
    return count;
  }

  whoSees(observers, targets = observers, { margin = 0 } = {}) {
    this.#cells ??= this.#makeCells();
    return look(this.#visibility, this.#cells, observers, targets, margin);
  }

  #makeCells() {
    const now = ({ isOpen, opacity, from, to }) => ({ from, to, opacity: isOpen ? Opacity.Clear : opacity });
    // First the walls, so that they have their numbers. Lines of a grid hide nothing, and make the cells small.
    return this.#visibility.createSightCellsOfPlan([...this.walls.map(now), ...this.#lines()], { axes: AXES });
  }

  #lines() {
    const ends = this.walls.flatMap(({ from, to }) => [from, to]);
    if (ends.length === 0) return [];
    const [low, high] = [Math.min, Math.max].map((pick) =>
      AXES.map((_, k) => ends.reduce((a, end) => pick(a, end[k]), ends[0][k])),
    );
    const sizes = AXES.map((_, k) => high[k] - low[k]);
    const most = Math.max(...sizes);
    const side = Math.max(this.#grid || most / USUAL_LINES, most / MOST_LINES) || 1;
    return AXES.flatMap((_, k) =>
      Array.from({ length: Math.floor(sizes[k] / side) }, (_, i) => {
        const at = low[k] + (i + 0.5) * side;
        const [from, to] = [low, high].map((ends) => (k === 0 ? [at, ends[1]] : [ends[0], at]));
        return { from, to, opacity: Opacity.Clear };
      }),
    );
  }

  dispose() {
    this.#plan.destroy();
    this.#cells?.destroy();
  }
}

/** See `plans.d.ts`. */
export class CellSight {
  #visibility;
  #cells;

  static async of(scene, { cell = 4, box, occluder, layers, visibility } = {}) {
    if (!(cell > 0)) throw new TypeError("`cell` is not a length");
    const around = box ?? boxOf(scene);
    if (around.isEmpty()) throw new RangeError("nothing to divide: the scene has no geometry, or `box` is empty");
    const size = around.getSize(new Vector3());
    const counts = size.toArray().map((side) => Math.max(1, Math.ceil(side / cell)));
    const count = counts[0] * counts[1] * counts[2];
    if (!(count <= MOST_CELLS))
      throw new RangeError(`${count} cells are too many: take a larger \`cell\`, or a \`box\``);
    const library = await loaded(visibility);
    const boxes = [];
    const { min, max } = around;
    // By rounding, the last cell may begin beyond the end of the box.
    const end = (axis, i) =>
      i === counts[axis] ? max.getComponent(axis) : Math.min(min.getComponent(axis) + i * cell, max.getComponent(axis));
    for (let x = 0; x < counts[0]; x++)
      for (let y = 0; y < counts[1]; y++)
        for (let z = 0; z < counts[2]; z++) {
          const at = [x, y, z];
          boxes.push(...at.map((i, axis) => end(axis, i)), ...at.map((i, axis) => end(axis, i + 1)));
        }
    const followed = library.createScene();
    const middle = around.getCenter(new Vector3()).toArray().map(Math.round);
    followed.setOrigin(middle);
    for (const mesh of hiding(scene, occluder, layers)) insert(followed, mesh, middle);
    followed.rebuild();
    const cells = library.createSightCellsOfScene(followed, boxes);
    followed.destroy();
    return new CellSight(library, cells, count);
  }

  constructor(visibility, cells, count) {
    this.#visibility = visibility;
    this.#cells = cells;
    this.count = count;
  }

  whoSees(observers, targets = observers, { margin = 0 } = {}) {
    return look(this.#visibility, this.#cells, observers, targets, margin);
  }

  dispose() {
    this.#cells.destroy();
  }
}

/** Puts a mesh that hides into a scene of the library. */
function insert(scene, mesh, origin) {
  const { surface, many, count } = mesh;
  const matrix = new Matrix4();
  const bounds = new Float64Array(6);
  for (let i = 0; i < count; i++) {
    const shape = many?.shapes ? many.shapes[i] : mesh.shape;
    if (!shape?.box) continue;
    const margin = place(mesh, i, matrix);
    moveBox(bounds, 0, shape.box, matrix.elements, origin, margin);
    if (!placeOccluder(mesh, i, origin, bounds, 0, matrix)) continue;
    const id = shape.mesh(scene, surface, MOST_TRIANGLES);
    if (id === null) continue;
    const min = bounds.slice(0, 3);
    const made = scene.insert({ bounds: { min, max: bounds.slice(3) } });
    scene.setMesh(made, id, matrix.elements);
    scene.setFlags(made, Flag.Occluder);
  }
}
