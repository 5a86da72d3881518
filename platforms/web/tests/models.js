// Models for tests, written byte by byte: rows of boxes with colours, some of them instances, and files that
// are none.

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
function glb(json, binary) {
  const chunks = [chunk(Buffer.from(JSON.stringify(json)), JSON_CHUNK, 32), chunk(binary, BIN_CHUNK, 0)];
  const head = Buffer.alloc(12);
  head.writeUInt32LE(0x46546c67, 0);
  head.writeUInt32LE(2, 4);
  head.writeUInt32LE(12 + chunks[0].length + chunks[1].length, 8);
  return Buffer.concat([head, ...chunks]);
}

/** Corners, and indices counter-clockwise from outside, of the box from -1 to 1. */
function box() {
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

/**
 * Writes a model: a wall 20 wide and 10 high at z = 0, `side` times `side` small boxes behind it, and one red
 * box in front. With `instanced` the small boxes are instances of one node. `padding` bytes are added.
 */
export async function writeWall(path, { side = 6, instanced = false, padding = 0 } = {}) {
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
  const bytes = glb(json, binary);
  await writeFile(path, bytes);
  return bytes;
}
