// Models for tests, written byte by byte: rows of boxes with colours, some of them instances; mirrored
// surfaces of one side; points; and files that are none.

import { writeFile } from "node:fs/promises";

const JSON_CHUNK = 0x4e4f534a;
const BIN_CHUNK = 0x4e4942;

function chunk(content, type, filler) {
  const length = Math.ceil(content.length / 4) * 4;
  const bytes = Buffer.alloc(8 + length, filler);
  bytes.writeUInt32LE(length, 0);
  bytes.writeUInt32LE(type, 4);
  content.copy(bytes, 8);
  return bytes;
}

/** Returns a binary glTF file. */
export function glb(json, binary) {
  const chunks = [chunk(Buffer.from(JSON.stringify(json)), JSON_CHUNK, 32), chunk(binary, BIN_CHUNK, 0)];
  const head = Buffer.alloc(12);
  head.writeUInt32LE(0x46546c67, 0);
  head.writeUInt32LE(2, 4);
  head.writeUInt32LE(12 + chunks[0].length + chunks[1].length, 8);
  return Buffer.concat([head, ...chunks]);
}

/** Corners, and indices counter-clockwise from outside, of the box from -1 to 1. */
export function box() {
  const positions = [];
  const indices = [];
  for (let axis = 0; axis < 3; axis++) {
    for (const side of [-1, 1]) {
      const first = positions.length / 3;
      for (const [a, b] of [
        [-1, -1],
        [1, -1],
        [1, 1],
        [-1, 1],
      ]) {
        const corner = [0, 0, 0];
        corner[axis] = side;
        corner[(axis + 1) % 3] = a;
        corner[(axis + 2) % 3] = b;
        positions.push(...corner);
      }
      const turn = side > 0 ? [0, 1, 2, 0, 2, 3] : [0, 2, 1, 0, 3, 2];
      indices.push(...turn.map((corner) => first + corner));
    }
  }
  return { positions, indices };
}

/** Bytes of a view of memory. */
const bytesOf = ({ buffer, byteOffset, byteLength }) => Buffer.from(buffer, byteOffset, byteLength);

/** Compresses the box by meshopt, with corners of 16 bits: changes to the JSON of `writeWall`, and the buffer. */
async function meshopt(json) {
  const { MeshoptEncoder } = await import("meshoptimizer");
  await MeshoptEncoder.ready;
  const { positions, indices } = box();
  const count = positions.length / 3;
  // Corners are 4 numbers apart: attributes begin at multiples of 4 bytes.
  const corners = new Int16Array(4 * count);
  for (let i = 0; i < count; i++)
    for (let k = 0; k < 3; k++) corners[4 * i + k] = 32767 * positions[3 * i + k];
  const parts = [
    { bytes: MeshoptEncoder.encodeVertexBuffer(bytesOf(corners), count, 8), mode: "ATTRIBUTES", count, byteStride: 8 },
    {
      bytes: MeshoptEncoder.encodeIndexBuffer(bytesOf(Uint32Array.from(indices)), indices.length, 4),
      mode: "TRIANGLES",
      count: indices.length,
      byteStride: 4,
    },
  ];
  const packed = Buffer.concat(parts.map(({ bytes }) => bytesOf(bytes)));
  const views = parts.map(({ bytes, ...part }, i) => ({
    buffer: 1,
    byteOffset: i === 0 ? 0 : 8 * count,
    byteLength: part.count * part.byteStride,
    ...(part.mode === "ATTRIBUTES" && { byteStride: 8 }),
    extensions: {
      EXT_meshopt_compression: {
        ...part,
        buffer: 0,
        byteOffset: i === 0 ? 0 : parts[0].bytes.length,
        byteLength: bytes.length,
      },
    },
  }));
  const [corner, index] = json.accessors;
  const bounds = { min: [-32767, -32767, -32767], max: [32767, 32767, 32767] };
  const byteLength = 8 * count + 4 * indices.length;
  const fallback = { byteLength, extensions: { EXT_meshopt_compression: { fallback: true } } };
  const used = ["EXT_meshopt_compression", "KHR_mesh_quantization"];
  const changes = {
    extensionsUsed: used,
    extensionsRequired: used,
    accessors: [{ ...corner, componentType: 5122, normalized: true, ...bounds }, index],
    bufferViews: views,
    buffers: [{ byteLength: packed.length }, fallback],
  };
  return [changes, packed];
}

/** Compresses the box by Draco: changes to the JSON of `writeWall`, and the buffer. */
async function draco(json) {
  const { default: module } = await import("draco3dgltf");
  const encoders = await module.createEncoderModule();
  const { positions, indices } = box();
  const [builder, mesh, encoder] = [new encoders.MeshBuilder(), new encoders.Mesh(), new encoders.Encoder()];
  builder.AddFacesToMesh(mesh, indices.length / 3, Uint32Array.from(indices));
  const floats = Float32Array.from(positions);
  const id = builder.AddFloatAttributeToMesh(mesh, encoders.POSITION, positions.length / 3, 3, floats);
  const out = new encoders.DracoInt8Array();
  const length = encoder.EncodeMeshToDracoBuffer(mesh, out);
  const packed = Buffer.from(Int8Array.from({ length }, (_, i) => out.GetValue(i)).buffer);
  const extension = { KHR_draco_mesh_compression: { bufferView: 0, attributes: { POSITION: id } } };
  const changes = {
    extensionsUsed: Object.keys(extension),
    extensionsRequired: Object.keys(extension),
    meshes: json.meshes.map(({ primitives: [primitive] }) => ({
      primitives: [{ ...primitive, extensions: extension }],
    })),
    accessors: json.accessors.slice(0, 2).map(({ bufferView, ...accessor }) => accessor),
    bufferViews: [{ buffer: 0, byteLength: packed.length }],
    buffers: [{ byteLength: packed.length }],
  };
  return [changes, packed];
}

/** A picture of one pixel. */
const PIXEL =
  "data:image/png;base64,iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mP8z8BQDwAEhQGAhKmMIQAAAABJRU5ErkJggg==";

/** Ways to compress a wall, by name. Each needs a package of npm that has the name of `ENCODERS`. */
const COMPRESSIONS = { meshopt, draco };
export const ENCODERS = { meshopt: "meshoptimizer", draco: "draco3dgltf" };

/**
 * Writes a model: a wall 20 wide and 10 high at z = 0, `side` times `side` small boxes behind it, and one red
 * box in front. With `instanced` the small boxes are instances of one node. `padding` bytes are added. `compression` is
 * null or `meshopt` or `draco`, for boxes that are not instances. With `picture` the wall has a texture.
 */
export async function writeWall(path, options = {}) {
  const { side = 6, instanced = false, padding = 0, compression = null, picture = false } = options;
  const { positions, indices } = box();
  const places = Array.from({ length: side * side }, (_, i) => [
    (8 * (2 * (i % side) - side + 1)) / side,
    1,
    -3 - 2 * Math.floor(i / side),
  ]);
  const parts = [Float32Array.from(positions), Uint32Array.from(indices), Float32Array.from(places.flat())];
  const views = [];
  let byteLength = 0;
  for (const part of parts) {
    views.push({ buffer: 0, byteOffset: byteLength, byteLength: part.byteLength });
    byteLength += part.byteLength;
  }
  const binary = Buffer.concat([...parts.map(({ buffer }) => Buffer.from(buffer)), Buffer.alloc(padding)]);
  const paint = (color) => ({ pbrMetallicRoughness: { baseColorFactor: [...color, 1], metallicFactor: 0 } });
  const mesh = (material) => ({ primitives: [{ attributes: { POSITION: 0 }, indices: 1, material }] });
  const small = { scale: [0.4, 0.4, 0.4], mesh: 1 };
  const behind = instanced
    ? [
        {
          name: "small",
          mesh: 3,
          extensions: { EXT_mesh_gpu_instancing: { attributes: { TRANSLATION: 2 } } },
        },
      ]
    : places.map((translation, i) => ({ name: `small ${i}`, translation, ...small }));
  const nodes = [
    { name: "wall", mesh: 0, translation: [0, 5, 0], scale: [10, 5, 0.2] },
    { name: "red", mesh: 2, translation: [0, 1, 6] },
    ...behind,
  ];
  const extensions = instanced ? { extensionsUsed: ["EXT_mesh_gpu_instancing"] } : {};
  const json = {
    asset: { version: "2.0" },
    ...extensions,
    scene: 0,
    scenes: [{ nodes: nodes.map((_, i) => i) }],
    nodes,
    meshes: [mesh(0), mesh(1), mesh(2), mesh(1)],
    materials: [paint([0.7, 0.7, 0.65]), paint([0.2, 0.4, 0.8]), paint([0.9, 0.05, 0.05])],
    accessors: [
      {
        bufferView: 0,
        componentType: 5126,
        count: positions.length / 3,
        type: "VEC3",
        min: [-1, -1, -1],
        max: [1, 1, 1],
      },
      { bufferView: 1, componentType: 5125, count: indices.length, type: "SCALAR" },
      { bufferView: 2, componentType: 5126, count: places.length, type: "VEC3" },
    ],
    bufferViews: views,
    buffers: [{ byteLength: binary.length }],
  };
  if (picture) {
    Object.assign(json, { images: [{ uri: PIXEL }], textures: [{ source: 0 }] });
    json.materials[0].pbrMetallicRoughness.baseColorTexture = { index: 0 };
  }
  const [changes, packed] = compression ? await COMPRESSIONS[compression](json) : [{}, binary];
  const bytes = glb({ ...json, ...changes }, packed);
  await writeFile(path, bytes);
  return bytes;
}

/** Writes a model of nodes whose meshes have one list of positions each, and one primitive. */
async function writeNodes(path, meshes, nodes, attributes = []) {
  const parts = [...meshes.map(({ positions }) => positions), ...attributes];
  const views = [];
  let byteLength = 0;
  for (const part of parts) {
    views.push({ buffer: 0, byteOffset: byteLength, byteLength: part.byteLength });
    byteLength += part.byteLength;
  }
  const bound = (positions, pick) => [0, 1, 2].map((k) => pick(...positions.filter((_, i) => i % 3 === k)));
  const json = {
    asset: { version: "2.0" },
    extensionsUsed: ["EXT_mesh_gpu_instancing"],
    scene: 0,
    scenes: [{ nodes: nodes.map((_, i) => i) }],
    nodes,
    cameras: [{ type: "perspective", perspective: { yfov: 1, znear: 0.1 } }],
    meshes: meshes.map(({ mode = 4 }, i) => ({ primitives: [{ attributes: { POSITION: i }, mode }] })),
    accessors: parts.map((part, bufferView) => ({
      bufferView,
      componentType: 5126,
      count: part.length / 3,
      type: "VEC3",
      min: bound(part, Math.min),
      max: bound(part, Math.max),
    })),
    bufferViews: views,
    buffers: [{ byteLength }],
  };
  await writeFile(path, glb(json, Buffer.concat(parts.map(({ buffer }) => Buffer.from(buffer)))));
}

/** Triangles of the box from -1 to 1. */
function boxTriangles() {
  const { positions, indices } = box();
  return Float32Array.from(indices.flatMap((i) => positions.slice(3 * i, 3 * i + 3)));
}

/**
 * Writes a model: a surface 20 wide and 10 high at z = 0 whose front is towards +z, and a small box on each
 * side of it. The node of the surface, or an instance that it has, may be mirrored. A camera, 30 above the
 * origin, looks straight down.
 */
export async function writeMirrored(path, { node = false, instance = null } = {}) {
  const quad = Float32Array.from(
    [
      [-1, -1],
      [1, -1],
      [1, 1],
      [-1, -1],
      [1, 1],
      [-1, 1],
    ].flatMap(([x, y]) => [x, y, 0]),
  );
  const small = { scale: [0.5, 0.5, 0.5], mesh: 1 };
  const surface = { name: "surface", mesh: 0, translation: [0, 5, 0], scale: [node ? -10 : 10, 5, 1] };
  if (instance !== null) surface.extensions = { EXT_mesh_gpu_instancing: { attributes: { SCALE: 2 } } };
  const nodes = [
    surface,
    { name: "before", translation: [2, 3, 6], ...small },
    { name: "behind", translation: [-2, 3, -6], ...small },
    { name: "camera", camera: 0, translation: [0, 30, 0], rotation: [-Math.SQRT1_2, 0, 0, Math.SQRT1_2] },
  ];
  const scales = Float32Array.from([instance ? -1 : 1, 1, 1]);
  await writeNodes(path, [{ positions: quad }, { positions: boxTriangles() }], nodes, [scales]);
}

/** Writes a model of points alone, along 100 of the x axis. */
export function writePoints(path) {
  const positions = Float32Array.from({ length: 303 }, (_, i) => (i % 3 === 0 ? i / 3 : i % 2));
  return writeNodes(path, [{ positions, mode: 0 }], [{ name: "points", mesh: 0 }]);
}

/** Writes a model as text whose buffer, and whose picture in the format KTX2, are at addresses. */
export async function writeElsewhere(path, bufferUri, pictureUri) {
  const bytes = Buffer.from(boxTriangles().buffer);
  const uri = bufferUri ?? `data:application/octet-stream;base64,${bytes.toString("base64")}`;
  const picture = pictureUri && {
    extensionsUsed: ["KHR_texture_basisu"],
    images: [{ uri: pictureUri, mimeType: "image/ktx2" }],
    textures: [{ extensions: { KHR_texture_basisu: { source: 0 } } }],
    materials: [{ pbrMetallicRoughness: { baseColorTexture: { index: 0 } } }],
  };
  const json = {
    asset: { version: "2.0" },
    scenes: [{ nodes: [0] }],
    nodes: [{ mesh: 0 }],
    meshes: [{ primitives: [{ attributes: { POSITION: 0 }, ...(picture && { material: 0 }) }] }],
    accessors: [
      { bufferView: 0, componentType: 5126, count: 36, type: "VEC3", min: [-1, -1, -1], max: [1, 1, 1] },
    ],
    bufferViews: [{ buffer: 0, byteLength: bytes.length }],
    buffers: [{ uri, byteLength: bytes.length }],
    ...picture,
  };
  await writeFile(path, JSON.stringify(json));
}
