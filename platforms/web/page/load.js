// Reads the files that a person drops or chooses: one `.glb`, or a `.gltf` with its buffers and pictures.
// Returns the scene graph of three.js. Decoders of Draco, meshopt and KTX2 are fetched from this host when a
// file needs them.

import { LoadingManager } from "three";
import { DRACOLoader } from "three/addons/loaders/DRACOLoader.js";
import { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";
import { KTX2Loader } from "three/addons/loaders/KTX2Loader.js";
import { MeshoptDecoder } from "three/addons/libs/meshopt_decoder.module.js";

/** Greatest size of a file in bytes: an `ArrayBuffer` of Chromium holds little more. */
const MOST_BYTES = 2 ** 31 - 2 ** 20;
/** First 4 bytes of a binary glTF file, as a little-endian number. */
const GLB_MAGIC = 0x46546c67;

/** A file that cannot be shown, with a message for the person who chose it. */
export class ModelError extends Error {}

export const megabytes = (bytes) => `${(bytes / 1e6).toFixed(bytes < 1e7 ? 1 : 0)} MB`;

/** Lets the browser draw and answer, and resolves afterwards. */
export const pause = () => new Promise((resolve) => setTimeout(resolve));

/** Reads a file piece by piece, and calls `progress` with the bytes read so far. */
async function readFile(file, progress) {
  const bytes = new Uint8Array(file.size);
  let at = 0;
  const reader = file.stream().getReader();
  for (;;) {
    const { done, value } = await reader.read();
    if (done) break;
    if (at + value.length > bytes.length) throw new ModelError(`${file.name} has changed while it was read`);
    bytes.set(value, at);
    at += value.length;
    progress(at);
  }
  if (at !== bytes.length) throw new ModelError(`${file.name} has changed while it was read`);
  return bytes.buffer;
}

/** Returns what is wrong with the head of a file, or null if it may be a model. */
function complaint(name, buffer) {
  const view = new DataView(buffer);
  if (buffer.byteLength === 0) return `${name} is empty`;
  if (buffer.byteLength >= 12 && view.getUint32(0, true) === GLB_MAGIC) {
    const version = view.getUint32(4, true);
    if (version !== 2) return `${name} is binary glTF of version ${version}; the page reads version 2`;
    const length = view.getUint32(8, true);
    if (length > buffer.byteLength)
      return `${name} is cut off: ${megabytes(buffer.byteLength)} of ${megabytes(length)} are there`;
    return null;
  }
  // glTF as text begins with a brace, after a byte-order mark or white space.
  const head = new TextDecoder().decode(buffer.slice(0, 64)).trimStart();
  return head.startsWith("{") ? null : `${name} is no glTF model: drop a .glb, or a .gltf with its files`;
}

/** Returns the name that a part of an address stands for: the part itself, if it is not well encoded. */
function decoded(part) {
  try {
    return decodeURIComponent(part);
  } catch {
    return part;
  }
}

/** Chooses the model among dropped files, null if none is one. The others are what it refers to. */
export function findModel(files) {
  const byEnding = (ending) => files.find(({ name }) => name.toLowerCase().endsWith(ending));
  return byEnding(".glb") ?? byEnding(".gltf") ?? (files.length === 1 ? files[0] : null);
}

/** Returns by extension whether the JSON of a model uses it. Cheaper than to parse the JSON. */
function mentioned(buffer, extensions) {
  const view = new DataView(buffer);
  const isBinary = view.byteLength >= 20 && view.getUint32(0, true) === GLB_MAGIC;
  const length = isBinary ? Math.min(view.getUint32(12, true), buffer.byteLength - 20) : buffer.byteLength;
  const text = new TextDecoder().decode(new Uint8Array(buffer, isBinary ? 20 : 0, length));
  return extensions.map((extension) => text.includes(extension));
}

/**
 * Loads a model. `progress` gets a line of text for the person who waits. Returns the scene graph, the
 * cameras of the file and its size. Throws a `ModelError` if the files are no model, are damaged or
 * lack a part.
 */
export async function loadModel(files, renderer, progress) {
  const file = findModel([...files]);
  if (!file) throw new ModelError("none of these files is a .glb or a .gltf");
  if (file.size > MOST_BYTES)
    throw new ModelError(
      `${file.name} has ${megabytes(file.size)}; a browser reads ${megabytes(MOST_BYTES)} at most`,
    );
  let told = 0;
  const buffer = await readFile(file, (at) => {
    const now = performance.now();
    if (now - told < 100) return;
    told = now;
    progress(`Reading ${file.name}: ${megabytes(at)} of ${megabytes(file.size)}`);
  });
  const wrong = complaint(file.name, buffer);
  if (wrong) throw new ModelError(wrong);
  progress(`Parsing ${file.name}: ${megabytes(file.size)}`);
  await pause();

  const basis = new URL("vendor/three/examples/jsm/libs/basis/", import.meta.url).href;
  const manager = new LoadingManager();
  const urls = new Map([...files].map((part) => [part.name, part]));
  const made = [];
  const missing = [];
  manager.setURLModifier((url) => {
    if (/^(blob|data):/.test(url) || url.startsWith(basis)) return url;
    const name = decoded(url.split("/").pop());
    if (!urls.has(name)) {
      missing.push(name);
      // A file that was not dropped is not fetched. The address "data:," holds no data, so that its loader
      // fails at once.
      return "data:,";
    }
    made.push(URL.createObjectURL(urls.get(name)));
    return made.at(-1);
  });
  const loader = new GLTFLoader(manager).setMeshoptDecoder(MeshoptDecoder);
  const [hasDraco, hasBasis] = mentioned(buffer, ["KHR_draco_mesh_compression", "KHR_texture_basisu"]);
  const draco = hasDraco ? new DRACOLoader() : null;
  if (draco) loader.setDRACOLoader(draco);
  const ktx2 = hasBasis ? new KTX2Loader(manager).setTranscoderPath(basis).detectSupport(renderer) : null;
  if (ktx2) loader.setKTX2Loader(ktx2);
  try {
    const { scene, scenes, cameras } = await loader.parseAsync(buffer, "");
    const root = scene ?? scenes[0];
    if (!root) throw new ModelError(`${file.name} has no scene`);
    root.updateMatrixWorld(true);
    return { root, cameras, bytes: file.size };
  } catch (error) {
    if (error instanceof ModelError) throw error;
    if (missing.length > 0)
      throw new ModelError(
        `${file.name} refers to ${[...new Set(missing)].join(", ")}: drop these together with it`,
      );
    throw new ModelError(`${file.name} cannot be read: ${error?.message ?? error}`);
  } finally {
    for (const url of made) URL.revokeObjectURL(url);
    draco?.dispose();
    ktx2?.dispose();
  }
}
