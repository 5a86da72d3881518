// A town as 3D tiles, written byte by byte: blocks of houses, each coarse from afar and with its things from near by,
// half of them as `.b3dm` and half as `.glb`.

import { box, glb } from "../models.js";

/** Blocks a side, metres from one to the next, and metres of a house. */
const [SIDE, PITCH, HOUSE] = [9, 24, 17];
/** Height of the tallest house in metres. */
const TALLEST = 20;
/** Things that stand around a house. */
const AROUND = 12;

/** Returns a content: boxes with `name`, `place`, half sides `half` and `color`, in the axes of glTF. */
function contentOf(boxes) {
  const { positions, indices } = box();
  const parts = [Float32Array.from(positions), Uint16Array.from(indices)].map(({ buffer }) =>
    Buffer.from(buffer),
  );
  const paint = ({ color }) => ({
    pbrMetallicRoughness: { baseColorFactor: [...color, 1], metallicFactor: 0 },
  });
  const [vertices, triangles] = parts.map(({ length }) => length);
  return glb(
    {
      asset: { version: "2.0" },
      scene: 0,
      scenes: [{ nodes: boxes.map((_, i) => i) }],
      nodes: boxes.map(({ name, place, half }, mesh) => ({ name, translation: place, scale: half, mesh })),
      meshes: boxes.map((_, material) => ({
        primitives: [{ attributes: { POSITION: 0 }, indices: 1, material }],
      })),
      materials: boxes.map(paint),
      accessors: [
        {
          bufferView: 0,
          componentType: 5126,
          count: positions.length / 3,
          type: "VEC3",
          min: [-1, -1, -1],
          max: [1, 1, 1],
        },
        { bufferView: 1, componentType: 5123, count: indices.length, type: "SCALAR" },
      ],
      bufferViews: [
        { buffer: 0, byteOffset: 0, byteLength: vertices },
        { buffer: 0, byteOffset: vertices, byteLength: triangles },
      ],
      buffers: [{ byteLength: vertices + triangles }],
    },
    Buffer.concat(parts),
  );
}

/** Returns a content as a batched model without a batch table. */
function b3dm(content) {
  const table = Buffer.from(JSON.stringify({ BATCH_LENGTH: 0 }).padEnd(20));
  const head = Buffer.alloc(28);
  head.write("b3dm", 0, "ascii");
  const length = head.length + table.length + content.length;
  [1, length, table.length].forEach((number, i) => head.writeUInt32LE(number, 4 + 4 * i));
  return Buffer.concat([head, table, content]);
}

/**
 * Makes a town in a folder of the server, with its middle at `origin`, in the axes of tiles. Returns its files by their
 * paths, the path of its root, and pairs of eye and target, in the axes of three.js, of a walk through its streets.
 */
export function makeTiles(folder, origin) {
  let state = 7;
  const random = () => (state = (Math.imul(state, 1664525) + 1013904223) >>> 0) / 2 ** 32;
  const between = (a, b) => a + (b - a) * random();
  const files = new Map();
  const middle = ((SIDE - 1) * PITCH) / 2;
  const blocks = [];
  for (let i = 0; i < SIDE * SIDE; i++) {
    const [x, z] = [(i % SIDE) * PITCH - middle, Math.floor(i / SIDE) * PITCH - middle];
    const height = between(8, TALLEST);
    const house = { name: `house ${i}`, place: [0, height / 2, 0], half: [HOUSE / 2, height / 2, HOUSE / 2] };
    const ground = {
      name: `ground ${i}`,
      place: [0, -0.5, 0],
      half: [PITCH / 2, 0.5, PITCH / 2],
      color: [0.4, 0.4, 0.37],
    };
    house.color = [random(), 0.5, random()];
    const things = Array.from({ length: AROUND }, (_, k) => {
      const half = [between(0.2, 0.7), between(0.3, 1), between(0.2, 0.7)];
      const along = between(-11, 11);
      const beside = HOUSE / 2 + 1.2;
      const place = [k % 2 ? along : beside, half[1], k % 2 ? beside : along];
      return { name: `thing ${i} ${k}`, place, half, color: [random(), random(), random()] };
    });
    const pack = i % 2 ? b3dm : (content) => content;
    const ending = i % 2 ? "b3dm" : "glb";
    files.set(`${folder}/${i}.${ending}`, pack(contentOf([ground, house])));
    files.set(`${folder}/${i}-near.${ending}`, pack(contentOf([ground, house, ...things])));
    // Volumes have z upwards.
    const volume = [0, 0, TALLEST / 2, PITCH / 2, 0, 0, 0, PITCH / 2, 0, 0, 0, TALLEST / 2 + 1];
    const boundingVolume = { box: volume };
    blocks.push({
      transform: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, x, -z, 0, 1],
      boundingVolume,
      geometricError: 4,
      refine: "REPLACE",
      content: { uri: `${i}.${ending}` },
      children: [{ boundingVolume, geometricError: 0, content: { uri: `${i}-near.${ending}` } }],
    });
  }
  const half = (SIDE * PITCH) / 2;
  const root = {
    boundingVolume: { box: [0, 0, TALLEST / 2, half, 0, 0, 0, half, 0, 0, 0, TALLEST / 2 + 1] },
    transform: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, ...origin, 1],
    geometricError: 400,
    refine: "ADD",
    children: blocks,
  };
  const tileset = { asset: { version: "1.0" }, geometricError: 1000, root };
  files.set(`${folder}/tileset.json`, Buffer.from(JSON.stringify(tileset)));
  // Streets are between the blocks.
  const street = PITCH / 2;
  const walk = [
    [
      [street, 1.7, 90],
      [street, 1.7, 0],
    ],
    [
      [street, 1.7, 40],
      [street, 1.7, 0],
    ],
    [
      [street, 1.7, 12],
      [0, 1.7, 12],
    ],
    [
      [-2, 1.7, 12],
      [-40, 4, 12],
    ],
    [
      [-36, 1.7, 12],
      [-36, 3, -60],
    ],
    [
      [-36, 30, 12],
      [20, 0, -60],
    ],
  ];
  const [x, y, z] = origin;
  const moved = walk.map((view) => view.map(([right, up, back]) => [right + x, up + z, back - y]));
  return { files, root: `${folder}/tileset.json`, walk: moved };
}
