// Turns a scene graph of three.js into items: what is hidden or drawn as one. The items of materials that
// look alike are instances of one `BatchedMesh`, so that thousands of them are a few draw calls.
//
// Item `i` of a model is object `i` of the library's scene. The items of a batch follow each other.

import {
  BatchedMesh,
  Box3,
  BufferAttribute,
  BufferGeometry,
  Color,
  Matrix4,
  MeshStandardMaterial,
  Sphere,
  Vector3,
  Vector4,
} from "three";
import { marginOf, reachOf } from "../three/boxes.js";
import { ModelError, pause } from "./load.js";

/** Greatest number of vertices of a batch: 32 to 64 MB of positions and normals. */
const MOST_VERTICES = 1 << 21;
/** Greatest number of items of a batch: their matrices are one texture. */
const MOST_ITEMS = 1 << 16;
/** Milliseconds of work between two pauses for the browser. */
const SLICE_MS = 30;
const ATTRIBUTES = { position: 3, normal: 3, uv: 2, uv1: 2, color: 4 };
const MAPS = [
  "map",
  "normalMap",
  "roughnessMap",
  "metalnessMap",
  "aoMap",
  "emissiveMap",
  "alphaMap",
  "bumpMap",
  "lightMap",
];
const white = new Color(1, 1, 1);
const IDENTITY = new Matrix4();

/** Whether a set of items, a bit each, has an item. A set has no items beyond its end. */
export function hasItem(bits, item) {
  return ((bits[item >>> 5] >>> (item & 31)) & 1) === 1;
}

/** Makes triangles run the other way round: exchanges the first two of each three indices. */
export function turnTriangles(indices) {
  for (let i = 0; i < indices.length; i += 3) [indices[i], indices[i + 1]] = [indices[i + 1], indices[i]];
}

/** Attribute of a geometry as 32-bit floats, whatever the file has: quantized, normalized or interleaved. */
function asFloats(attribute, itemSize, fill) {
  const { count } = attribute;
  const isPlain = attribute.array instanceof Float32Array && !attribute.isInterleavedBufferAttribute;
  // A batch copies what it gets: it may be the array of the file.
  if (isPlain && attribute.itemSize === itemSize && attribute.array.length === count * itemSize) return attribute;
  const array = new Float32Array(count * itemSize).fill(fill);
  const read = Math.min(itemSize, attribute.itemSize);
  for (let k = 0; k < read; k++)
    for (let i = 0; i < count; i++) array[i * itemSize + k] = attribute.getComponent(i, k);
  return new BufferAttribute(array, itemSize);
}

/**
 * Returns a geometry with the attributes that its batch has, and an index. With `isMirrored` its triangles run
 * the other way round: a mirroring matrix turns them back. The graphics card goes by the way in which they run
 * in the picture.
 */
function prepared(source, names, isMirrored) {
  const geometry = new BufferGeometry();
  const { position } = source.attributes;
  for (const name of names) {
    const attribute = source.attributes[name];
    if (attribute)
      geometry.setAttribute(name, asFloats(attribute, ATTRIBUTES[name], name === "color" ? 1 : 0));
  }
  const count = Math.floor((source.index ?? position).count / 3) * 3;
  const index = new Uint32Array(count);
  const given = source.index?.array;
  for (let i = 0; i < count; i++) {
    const vertex = given ? given[i] : i;
    // A damaged index draws the first vertex: nothing is read out of bounds.
    index[i] = vertex < position.count ? vertex : 0;
  }
  if (isMirrored) turnTriangles(index);
  geometry.setIndex(new BufferAttribute(index, 1));
  if (!geometry.attributes.normal) geometry.computeVertexNormals();
  return geometry;
}

/**
 * Adds the geometry of a shape to a batch. From then on the shape has no copy of it: `positions` are those of the
 * batch, and `indices` makes a list of its own.
 */
function addShape(mesh, shape) {
  const id = mesh.addGeometry(shape.geometry);
  const { vertexStart, vertexCount, indexStart, indexCount } = mesh.getGeometryRangeAt(id);
  const { attributes, index } = mesh.geometry;
  const inBatch = index.array.subarray(indexStart, indexStart + indexCount);
  const indices = () => {
    const list = new Uint32Array(inBatch);
    for (let i = 0; i < list.length; i++) list[i] -= vertexStart;
    return list;
  };
  const positions = attributes.position.array.subarray(3 * vertexStart, 3 * (vertexStart + vertexCount));
  Object.assign(shape, { id, geometry: null, positions, triangles: indexCount / 3, indices });
}

/** Text that is the same for materials that one batch can draw. Each item has its own colour. */
function materialKey(material) {
  if (material.type === "MeshPhysicalMaterial" && material.transmission === 0 && !material.iridescence)
    return `physical ${material.uuid}`;
  const round = (number) => Math.round(10 * (number ?? 0)) / 10;
  return [
    material.type,
    material.side,
    material.transparent,
    material.alphaTest,
    material.transparent || material.transmission > 0 ? round(material.opacity) : 1,
    material.vertexColors,
    material.flatShading,
    round(material.roughness),
    round(material.metalness),
    material.emissive?.getHex(),
    material.emissiveIntensity,
    material.transmission > 0,
    ...MAPS.map((map) => material[map]?.uuid ?? 0),
  ].join(" ");
}

/** The material of a batch. The colour of each item is added to it. */
function batchMaterial(material) {
  let made = material.clone();
  if (material.transmission > 0) {
    // Glass is drawn as a thin veil: true transmission draws the scene twice.
    made = new MeshStandardMaterial({ roughness: 0.1, metalness: 0, side: material.side });
    Object.assign(made, { transparent: true, opacity: 0.3, depthWrite: false });
  }
  made.color?.copy(white);
  // There is nothing for metal to mirror: it would be black.
  if (made.metalness > 0) made.metalness = Math.min(made.metalness, 0.2);
  return made;
}

const isSeeThrough = (material) =>
  material.transparent || material.alphaTest > 0 || material.alphaHash || !material.depthWrite;

/** Whether three.js moves the vertices of a mesh in ways that a box of its geometry does not hold. */
const isDeformed = (mesh) =>
  mesh.isSkinnedMesh ||
  (mesh.morphTargetInfluences?.length > 0 && Object.keys(mesh.geometry.morphAttributes).length > 0);

/** Finds meshes with their parts and instances: what becomes an item. */
function collect(root) {
  const parts = [];
  const loose = [];
  root.traverseVisible((object) => {
    if (object.isLine || object.isPoints || object.isSprite || (object.isMesh && isDeformed(object))) {
      loose.push(object);
      return;
    }
    const position = object.isMesh && object.geometry.attributes.position;
    if (!position?.count) return;
    const materials = [object.material].flat();
    const count = object.isInstancedMesh ? object.count : 1;
    const groups = Array.isArray(object.material) ? object.geometry.groups : [null];
    for (const group of groups) {
      const material = materials[group?.materialIndex ?? 0];
      if (material) parts.push({ object, material, count, group });
    }
  });
  return { parts, loose };
}

/** Greatest coordinates by axis, without their signs. Those that are NaN do not count. */
function reachOfPoints(positions) {
  const reach = [0, 0, 0];
  for (let i = 0; i < positions.length; i++) {
    const x = Math.abs(positions[i]);
    if (x > reach[i % 3]) reach[i % 3] = x;
  }
  return reach;
}

/** Distance in metres by which the graphics card may put vertices beside their place: see `boxes.js`. */
export function marginOfItem(reach, matrix) {
  return marginOf(IDENTITY, reachOf(matrix, reach));
}

/** Writes the box of transformed vertices, enlarged for rounding, to 6 numbers at `at`. */
function writeBounds(bounds, at, positions, reach, matrix) {
  const e = matrix.elements;
  const box = [Infinity, Infinity, Infinity, -Infinity, -Infinity, -Infinity];
  for (let i = 0; i < positions.length; i += 3) {
    const [x, y, z] = [positions[i], positions[i + 1], positions[i + 2]];
    for (let k = 0; k < 3; k++) {
      const moved = e[k] * x + e[4 + k] * y + e[8 + k] * z + e[12 + k];
      if (moved < box[k]) box[k] = moved;
      if (moved > box[3 + k]) box[3 + k] = moved;
    }
  }
  const margin = marginOfItem(reach, matrix);
  for (let k = 0; k < 6; k++) bounds[at + k] = box[k] + (k < 3 ? -margin : margin);
}

const texturesOf = (material) => Object.values(material).filter((value) => value?.isTexture);

/** Frees a material and its textures on the graphics card. */
function disposeMaterial(material) {
  for (const texture of texturesOf(material)) texture.dispose();
  material.dispose();
}

/** A model as items. See the head of this file. */
class Model {
  /** Batches: `mesh`, index `first` of its first item, `count` of items, `seeThrough`, `side`. */
  batches = [];
  /** What is drawn whatever a culler finds: skinned and morphed meshes, lines, points. */
  loose = [];
  names = [];
  /** Box of `loose` in the pose in which the file has them. */
  looseBox = new Box3();
  /** By item: 6 numbers of its box, number of triangles, and shape and matrix of what it hides with: see `addShape`. */
  bounds = new Float64Array(0);
  triangles = new Uint32Array(0);
  shapes = [];
  matrices = [];
  /** Bytes of geometry for the graphics card, and of pictures. */
  bytes = { geometry: 0, textures: 0 };

  get count() {
    return this.triangles.length;
  }

  /** Least and greatest corner of all that is drawn. */
  get box() {
    const box = [...this.looseBox.min, ...this.looseBox.max];
    this.bounds.forEach((number, i) => {
      const k = i % 6;
      if (Number.isFinite(number)) box[k] = k < 3 ? Math.min(box[k], number) : Math.max(box[k], number);
    });
    return box.every(Number.isFinite) ? box : [-1, -1, -1, 1, 1, 1];
  }

  /** Textures of the batches. */
  get textures() {
    return new Set(this.batches.flatMap(({ mesh }) => texturesOf(mesh.material)));
  }

  dispose() {
    for (const { mesh } of this.batches) {
      disposeMaterial(mesh.material);
      mesh.dispose();
    }
    for (const { geometry, material, skeleton } of this.loose) {
      geometry?.dispose();
      for (const one of [material].flat()) if (one) disposeMaterial(one);
      skeleton?.dispose();
    }
  }
}

/**
 * Makes items of a scene graph. `progress` gets a line of text. Throws a `ModelError` if there are no
 * triangles.
 */
export async function makeModel(root, progress) {
  // Around the origin, where single precision is finest, and on the ground.
  const box = new Box3().setFromObject(root);
  const middle = box.getCenter(new Vector3()).setY(box.min.y);
  if (middle.toArray().every(Number.isFinite)) root.position.sub(middle);
  root.updateMatrixWorld(true);
  const { parts, loose } = collect(root);
  const kinds = new Map();
  for (const part of parts) {
    const { attributes } = part.object.geometry;
    const names = Object.keys(ATTRIBUTES).filter((name) => name === "normal" || attributes[name]);
    const key = `${materialKey(part.material)} ${names}`;
    let kind = kinds.get(key);
    if (!kind) kinds.set(key, (kind = { material: part.material, names, parts: [] }));
    kind.parts.push(part);
  }
  const total = parts.reduce((sum, { count }) => sum + count, 0);
  if (total === 0 && loose.length === 0) throw new ModelError("the model has no triangles");
  const model = new Model();
  model.loose = loose;
  for (const object of loose) model.looseBox.expandByObject(object);
  model.bounds = new Float64Array(6 * total);
  model.triangles = new Uint32Array(total);
  const made = { model, item: 0, sliced: performance.now(), progress, total };
  for (const kind of kinds.values()) {
    let chunk = [];
    let [vertices, items] = [0, 0];
    for (const part of kind.parts) {
      const { count } = part.object.geometry.attributes.position;
      if (chunk.length > 0 && (vertices + count > MOST_VERTICES || items + part.count > MOST_ITEMS)) {
        await addBatch(made, kind, chunk);
        [chunk, vertices, items] = [[], 0, 0];
      }
      chunk.push(part);
      vertices += count;
      items += part.count;
    }
    if (chunk.length > 0) await addBatch(made, kind, chunk);
  }
  for (const { image } of model.textures)
    model.bytes.textures += ((image?.width ?? 0) * (image?.height ?? 0) * 16) / 3;
  return model;
}

/** Adds the items of parts with materials that look alike. */
async function addBatch(made, { material, names }, parts) {
  const { model } = made;
  // Prepared once for all parts of the same geometry: instances share it.
  const geometries = new Map();
  const entries = [];
  let [vertices, indices, items] = [0, 0, 0];
  for (const part of parts) {
    const { object, group } = part;
    const isMirrored = object.matrixWorld.determinant() < 0;
    const key = `${object.geometry.uuid} ${isMirrored} ${group?.start ?? ""}`;
    let shape = geometries.get(key);
    if (!shape) {
      const source = group ? groupOf(object.geometry, group) : object.geometry;
      const geometry = prepared(source, names, isMirrored);
      const reach = reachOfPoints(geometry.attributes.position.array);
      shape = { geometry, reach, id: -1, side: material.side };
      geometries.set(key, shape);
      vertices += geometry.attributes.position.count;
      indices += geometry.index.count;
    }
    entries.push({ part, shape });
    items += part.count;
    await slice(made);
  }
  const mesh = new BatchedMesh(items, Math.max(3, vertices), Math.max(3, indices), batchMaterial(material));
  mesh.perObjectFrustumCulled = false;
  mesh.frustumCulled = false;
  mesh.sortObjects = mesh.material.transparent;
  mesh.castShadow = mesh.receiveShadow = !mesh.material.transparent;
  const batch = {
    mesh,
    first: made.item,
    count: items,
    side: material.side,
    seeThrough: isSeeThrough(mesh.material),
  };
  const color = new Vector4();
  for (const { part, shape } of entries) {
    const { object } = part;
    if (shape.id < 0) addShape(mesh, shape);
    for (let instance = 0; instance < part.count; instance++) {
      const matrix = new Matrix4();
      if (object.isInstancedMesh) object.getMatrixAt(instance, matrix);
      matrix.premultiply(object.matrixWorld);
      const id = mesh.addInstance(shape.id);
      mesh.setMatrixAt(id, matrix);
      const { r, g, b } = part.material.color ?? white;
      mesh.setColorAt(id, color.set(r, g, b, 1));
      const item = made.item++;
      writeBounds(model.bounds, 6 * item, shape.positions, shape.reach, matrix);
      model.triangles[item] = shape.triangles;
      model.names.push(object.name || object.parent?.name || `object ${item}`);
      model.shapes.push(shape);
      model.matrices.push(matrix);
    }
    await slice(made);
  }
  mesh.boundingSphere = sphereOf(model.bounds.subarray(6 * batch.first, 6 * made.item));
  model.bytes.geometry += vertices * 4 * names.reduce((sum, name) => sum + ATTRIBUTES[name], 0) + 4 * indices;
  model.batches.push(batch);
}

/** A sphere around boxes, 6 numbers each. three.js would read all vertices for the sphere of a batch. */
function sphereOf(bounds) {
  const box = new Box3();
  for (let at = 0; at < bounds.length; at += 6)
    for (const corner of [at, at + 3]) box.expandByPoint(new Vector3().fromArray(bounds, corner));
  return box.getBoundingSphere(new Sphere());
}

/** The part of a geometry that one of its groups draws. */
function groupOf({ attributes, index }, { start, count }) {
  const part = new BufferGeometry();
  for (const name in attributes) part.setAttribute(name, attributes[name]);
  const end = Math.min(start + count, (index ?? attributes.position).count);
  const list = new Uint32Array(Math.max(0, end - start));
  for (let i = 0; i < list.length; i++) list[i] = index ? index.getX(start + i) : start + i;
  part.setIndex(new BufferAttribute(list, 1));
  return part;
}

async function slice(made) {
  if (performance.now() - made.sliced < SLICE_MS) return;
  made.progress(`Sorting objects: ${made.item} of ${made.total}`);
  await pause();
  made.sliced = performance.now();
}

/**
 * Makes a model of one material from triangles: 9 numbers each, `counts` per item, with colours of its
 * vertices.
 */
export function modelOfTriangles({ counts, triangles, colors, material }) {
  const model = new Model();
  const vertices = triangles.length / 3;
  const mesh = new BatchedMesh(counts.length, vertices, 3, material);
  mesh.perObjectFrustumCulled = mesh.frustumCulled = mesh.sortObjects = false;
  mesh.castShadow = mesh.receiveShadow = true;
  model.bounds = new Float64Array(6 * counts.length);
  model.triangles = Uint32Array.from(counts);
  let at = 0;
  for (let item = 0; item < counts.length; item++) {
    const end = at + 9 * counts[item];
    const geometry = new BufferGeometry();
    const positions = triangles.subarray(at, end);
    geometry.setAttribute("position", new BufferAttribute(positions, 3));
    geometry.setAttribute("color", new BufferAttribute(colors.subarray(at, end), 3));
    geometry.computeVertexNormals();
    mesh.setMatrixAt(mesh.addInstance(mesh.addGeometry(geometry)), IDENTITY);
    writeBounds(model.bounds, 6 * item, positions, reachOfPoints(positions), IDENTITY);
    model.names.push(`object ${item}`);
    at = end;
  }
  model.bytes.geometry = vertices * 36;
  model.batches.push({ mesh, first: 0, count: counts.length, side: material.side, seeThrough: false });
  return model;
}
