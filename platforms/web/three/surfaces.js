// What materials and geometries allow: which meshes may be hidden, which hide others, and by which triangles.

import {
  BackSide,
  DoubleSide,
  LessDepth,
  LessEqualDepth,
  Material,
  NoBlending,
  NormalBlending,
  Sphere,
  Vector3,
} from "three";
import { addOccluderMesh, emptyBox } from "./boxes.js";

/** What a mesh is to the culler. From `Front` on it hides others, from the sides that are named. */
export const Surface = Object.freeze({ NeverHidden: 0, Hideable: 1, Front: 2, Back: 3, Double: 4 });

/** Returns the surface of one material. `isReversed`: as cameras with reversed depth draw it. */
function surfaceOfOne(material, isReversed) {
  const isHideable =
    // A shader of the user's own may move vertices, or draw in front of all else.
    !material.isShaderMaterial &&
    !material.isNodeMaterial &&
    material.onBeforeCompile === Material.prototype.onBeforeCompile &&
    material.onBeforeRender === Material.prototype.onBeforeRender &&
    !material.displacementMap &&
    // Lines are a pixel wide, outside of the mesh's box, too.
    !material.wireframe &&
    // Not materials that are drawn in spite of surfaces in front, or count the pixels where they are hidden.
    material.depthTest &&
    (material.depthFunc === LessEqualDepth || material.depthFunc === LessDepth) &&
    !material.stencilWrite &&
    // Not what an offset brings nearer: with reversed depth that is a positive one in some versions of three.js.
    !(
      material.polygonOffset &&
      (isReversed || material.polygonOffsetFactor < 0 || material.polygonOffsetUnits < 0)
    );
  if (!isHideable) return Surface.NeverHidden;
  // Shaders that WebGPURenderer takes in place of a material's own.
  for (const key in material) if (key.endsWith("Node") && material[key]) return Surface.NeverHidden;
  const isOpaque =
    material.visible &&
    material.depthWrite &&
    material.colorWrite &&
    !material.transparent &&
    (material.blending === NormalBlending || material.blending === NoBlending) &&
    !(material.alphaTest > 0) &&
    !material.alphaHash &&
    !material.alphaToCoverage &&
    !material.alphaMap &&
    !(material.transmission > 0) &&
    !material.polygonOffset &&
    !material.clippingPlanes?.length;
  if (!isOpaque) return Surface.Hideable;
  return sideOf(material);
}

/** Returns the side from which a mesh of opaque materials hides others: one that all of them have, if any. */
export function sideOf(materials) {
  const sides = new Set([materials].flat().map((material) => material?.side));
  if (sides.size > 1) sides.delete(DoubleSide);
  const [side] = sides;
  if (sides.size > 1) return Surface.Hideable;
  if (side === DoubleSide) return Surface.Double;
  return side === BackSide ? Surface.Back : Surface.Front;
}

/** Surfaces of materials, each found once a frame. */
export class Surfaces {
  #known = new WeakMap();
  #frame = 0;
  #isReversed = false;

  /** Forgets all: materials may have changed, and this frame's camera may have reversed depth. */
  begin(isReversed = false) {
    this.#frame++;
    this.#isReversed = isReversed;
  }

  /** Returns an object whose `surface` is that of a material, kept current by `refresh`. */
  of(material) {
    let known = this.#known.get(material);
    if (!known) this.#known.set(material, (known = { material, frame: -1, surface: 0 }));
    return known;
  }

  refresh(known) {
    if (known.frame !== this.#frame) {
      known.frame = this.#frame;
      known.surface = surfaceOfOne(known.material, this.#isReversed);
    }
    return known.surface;
  }

  /** Returns the surface of a material in this frame. */
  now(material) {
    return this.refresh(this.of(material));
  }

  /** Returns the surface of a mesh with several materials: what all of them allow. */
  ofAll(materials, geometry) {
    const surfaces = materials.map((material) => (material ? this.now(material) : Surface.Hideable));
    const least = Math.min(...surfaces);
    if (least <= Surface.Hideable || !drawsAll(geometry, materials)) return Math.min(least, Surface.Hideable);
    return sideOf(materials);
  }
}

/** Whether the groups of a geometry draw all of it, one after the other. */
function drawsAll({ groups, index, attributes }, materials) {
  let end = 0;
  for (const { start, count, materialIndex } of groups) {
    if (start !== end || !materials[materialIndex]) return false;
    end += count;
  }
  return end >= (index ?? attributes.position)?.count;
}

/** Returns the version of a buffer attribute's content. */
function version(attribute) {
  return attribute?.isInterleavedBufferAttribute ? attribute.data.version : (attribute?.version ?? -1);
}

/** Whether the content of an attribute can be read: not when it is on the graphics card alone. */
function isReadable(attribute) {
  return attribute?.array?.length > 0 && attribute.itemSize >= 3 && !attribute.isStorageBufferAttribute;
}

/**
 * The box and the triangles of a geometry, or of a part of one. Its occluder meshes are made when they are
 * first needed, and freed with its last user.
 */
export class Shape {
  /** By surface: id of the occluder mesh, null if there is none. */
  #meshes = new Map();
  users = 0;
  frame = -1;

  /**
   * `range` is the part: `start` and `count` of indices, and the `vertexStart` that they are counted from.
   */
  constructor(geometry, box, range) {
    const { position, skinIndex, skinWeight } = geometry.attributes;
    this.geometry = geometry;
    this.range = range;
    this.position = position;
    this.index = geometry.index;
    this.sources = [position, geometry.index, skinIndex, skinWeight];
    this.versions = this.sources.map(version);
    this.drawRange = { ...geometry.drawRange };
    /** Least and greatest corner. Null if the geometry cannot be read. */
    this.box = box ?? (isReadable(position) ? boxOfPoints(position, range) : null);
    /** Greatest coordinate of a vertex by axis, without its sign. */
    this.reach = [0, 1, 2].map((k) =>
      this.box ? Math.max(Math.abs(this.box[k]), Math.abs(this.box[3 + k])) : 0,
    );
    /** A sphere around the vertices of the occluder meshes. Null if there are none. */
    this.sphere = null;
    /** For skinned meshes: boxes of what each bone moves, made when first needed. */
    this.bones = undefined;
  }

  /** Whether the geometry is still as it was. */
  isCurrent() {
    const { geometry, sources, versions, drawRange } = this;
    const { position, skinIndex, skinWeight } = geometry.attributes;
    const isSame = (source, i) => source === sources[i] && version(source) === versions[i];
    return (
      isSame(position, 0) &&
      isSame(geometry.index, 1) &&
      isSame(skinIndex, 2) &&
      isSame(skinWeight, 3) &&
      drawRange.start === geometry.drawRange.start &&
      drawRange.count === geometry.drawRange.count
    );
  }

  /** Number of triangles, if they can be read. */
  get triangleCount() {
    const { range, index, position } = this;
    return Math.floor((range ?? index ?? position)?.count / 3) || 0;
  }

  /** Whether it is known which occluder mesh there is for a surface. */
  isMade(surface) {
    return this.#meshes.has(surface);
  }

  /** Returns the id of the occluder mesh for a surface, or null if there is none. */
  mesh(scene, surface, maxTriangles) {
    let mesh = this.#meshes.get(surface);
    if (mesh === undefined) {
      mesh = this.#makeMesh(scene, surface, maxTriangles);
      this.#meshes.set(surface, mesh);
    }
    return mesh;
  }

  #makeMesh(scene, surface, maxTriangles) {
    const made = trianglesOf(this, maxTriangles);
    if (made === null) return null;
    const { positions, indices } = made;
    if (surface === Surface.Back) {
      for (let i = 0; i < indices.length; i += 3) [indices[i], indices[i + 1]] = [indices[i + 1], indices[i]];
    }
    const mesh = addOccluderMesh(scene, { positions, indices, twoSided: surface === Surface.Double });
    if (mesh !== null) this.sphere ??= sphereOfPoints(positions, this.box);
    return mesh;
  }

  /** Frees the occluder meshes. */
  free(scene) {
    for (const mesh of this.#meshes.values()) if (mesh !== null) scene.removeMesh(mesh);
    this.#meshes.clear();
  }
}

/**
 * Returns the vertices and the triangles of a shape, for occluder meshes and plans: 3 numbers a vertex, 3 indices a
 * triangle. Null if it has none, more than `maxTriangles`, or such as cannot be read, are not finite or may not be
 * drawn: then nothing of it hides.
 */
export function trianglesOf({ position, index, drawRange, range }, maxTriangles) {
  if (drawRange.start !== 0 || drawRange.count !== Infinity || !isReadable(position)) return null;
  if (index && !index.array) return null;
  const { start, count, vertexStart, vertexCount } = range ?? {
    start: 0,
    count: (index ?? position).count,
    vertexStart: 0,
    vertexCount: position.count,
  };
  const triangles = Math.floor(count / 3);
  if (triangles === 0 || triangles > maxTriangles) return null;
  const positions = new Float32Array(3 * vertexCount);
  for (let i = 0; i < vertexCount; i++) {
    positions[3 * i] = position.getX(vertexStart + i);
    positions[3 * i + 1] = position.getY(vertexStart + i);
    positions[3 * i + 2] = position.getZ(vertexStart + i);
  }
  const indices = new Uint32Array(3 * triangles);
  // At the greatest index of its type, WebGL 2 begins a new primitive: no triangle from there on is what it seems.
  const restart = index ? 2 ** (8 * index.array.BYTES_PER_ELEMENT) - 1 : Infinity;
  for (let i = 0; i < indices.length; i++) {
    const vertex = index ? index.getX(start + i) : start + i;
    // No triangle of a damaged geometry hides anything.
    if (!(vertex >= vertexStart && vertex < vertexStart + vertexCount && vertex !== restart)) return null;
    indices[i] = vertex - vertexStart;
  }
  return positions.every(Number.isFinite) ? { positions, indices } : null;
}

function addPoint(box, x, y, z) {
  // `Math.min` keeps NaN, so that what has no place is never hidden.
  box[0] = Math.min(box[0], x);
  box[1] = Math.min(box[1], y);
  box[2] = Math.min(box[2], z);
  box[3] = Math.max(box[3], x);
  box[4] = Math.max(box[4], y);
  box[5] = Math.max(box[5], z);
}

function boxOfPoints(position, { vertexStart = 0, vertexCount = position.count } = {}) {
  const box = emptyBox();
  for (let i = vertexStart; i < vertexStart + vertexCount; i++)
    addPoint(box, position.getX(i), position.getY(i), position.getZ(i));
  return box;
}

/** Returns the least sphere that holds points, of those around the centre of their box. */
function sphereOfPoints(positions, box) {
  const center = new Vector3().fromArray(box).lerp(new Vector3().fromArray(box, 3), 0.5);
  const point = new Vector3();
  let radius = 0;
  for (let i = 0; i < positions.length; i += 3)
    radius = Math.max(radius, center.distanceTo(point.fromArray(positions, i)));
  return new Sphere(center, radius);
}

/**
 * Returns the boxes of the vertices that each bone moves, and the least and the greatest sum of the weights
 * of a vertex. Null if weights are missing or negative, or bones are not whole numbers: then no box is known
 * to hold the mesh.
 */
export function bonesOf({ attributes: { position, skinIndex, skinWeight } }) {
  if (!isReadable(position) || !skinIndex?.array || !skinWeight?.array) return null;
  const boxes = [];
  let [least, greatest] = [Infinity, -Infinity];
  for (let i = 0; i < position.count; i++) {
    let sum = 0;
    for (let k = 0; k < 4; k++) {
      const weight = skinWeight.getComponent(i, k);
      if (!(weight >= 0)) return null;
      if (weight === 0) continue;
      sum += weight;
      const bone = skinIndex.getComponent(i, k);
      if (!(Number.isInteger(bone) && bone >= 0)) return null;
      const box = (boxes[bone] ??= emptyBox());
      addPoint(box, position.getX(i), position.getY(i), position.getZ(i));
    }
    least = Math.min(least, sum);
    greatest = Math.max(greatest, sum);
  }
  return { boxes, least, greatest };
}
