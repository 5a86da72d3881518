// Judges a culler by pictures: WebGL draws the number of the object that shows in each pixel, once of all
// objects and once of those that the culler left. Where the two differ, a pixel is wrong. The culling library
// has no part in it.
//
// Opaque objects write their number into red, green and blue. What one sees through adds a few units to alpha
// where nothing opaque is in front of it, so that a missing pane is a wrong pixel too. Objects are drawn from
// the sides from which the picture shows them.

import {
  AddEquation,
  BatchedMesh,
  CustomBlending,
  DepthTexture,
  FloatType,
  GLSL3,
  NearestFilter,
  NoBlending,
  OneFactor,
  ShaderMaterial,
  UnsignedByteType,
  WebGLRenderTarget,
  ZeroFactor,
} from "three";
import { hasItem } from "./items.js";

/** Size in pixels of the pictures that are compared. */
const WIDTH = 480;
const HEIGHT = 270;

const VERTEX = `
  #include <common>
  #include <batching_pars_vertex>
  uniform float firstItem;
  flat out float item;
  void main() {
    #include <batching_vertex>
    item = firstItem + getIndirectIndex(gl_DrawID);
    // In the order of the shaders of three.js, so that it rounds as they do.
    gl_Position = projectionMatrix * (modelViewMatrix * (batchingMatrix * vec4(position, 1.0)));
  }`;

const FRAGMENTS = {
  solid: `
    uint i = uint(item + 0.5) + 1u;
    color = vec4(float(i & 255u), float((i >> 8) & 255u), float(i >> 16), 0.0) / 255.0;`,
  through: `
    uint i = uint(item + 0.5);
    color = vec4(0.0, 0.0, 0.0, float(1u + (i * 2654435761u >> 29)) / 255.0);`,
  count: `color = vec4(1.0 / 255.0);`,
};

export class Judge {
  constructor(renderer) {
    this.renderer = renderer;
    this.target = new WebGLRenderTarget(WIDTH, HEIGHT, {
      type: UnsignedByteType,
      minFilter: NearestFilter,
      magFilter: NearestFilter,
      depthTexture: new DepthTexture(WIDTH, HEIGHT, FloatType),
    });
    this.materials = new Map();
  }

  /** The material that draws what `kind` names, from a side. */
  #material(kind, side) {
    const key = `${kind} ${side}`;
    if (this.materials.has(key)) return this.materials.get(key);
    const adds = kind !== "solid";
    const material = new ShaderMaterial({
      glslVersion: GLSL3,
      side,
      vertexShader: VERTEX,
      fragmentShader: `precision highp int; flat in float item; out vec4 color; void main() { ${FRAGMENTS[kind]} }`,
      uniforms: { firstItem: { value: 0 } },
      depthTest: kind !== "count",
      depthWrite: kind === "solid",
      blending: adds ? CustomBlending : NoBlending,
      transparent: adds,
    });
    if (adds) {
      Object.assign(material, { blendEquation: AddEquation, blendSrc: OneFactor, blendDst: OneFactor });
      Object.assign(material, { blendSrcAlpha: OneFactor, blendDstAlpha: OneFactor });
      if (kind === "through") material.blendSrc = ZeroFactor;
    }
    this.materials.set(key, material);
    return material;
  }

  /** Draws the items that `picture` shows at present, and returns the pixels, 4 bytes each. */
  #pixels(picture, camera, counts) {
    const { renderer } = this;
    const { batches, loose } = picture.model;
    const former = batches.map(({ mesh }) => mesh.material);
    for (const object of loose) object.visible = false;
    const hooks = batches.map(({ mesh }) => mesh.onBeforeRender);
    batches.forEach(({ mesh, first, seeThrough, side }) => {
      mesh.material = this.#material(counts ? "count" : seeThrough ? "through" : "solid", side);
      mesh.onBeforeRender = function (renderer, scene, camera, geometry, material) {
        BatchedMesh.prototype.onBeforeRender.call(this, renderer, scene, camera, geometry, material);
        material.uniforms.firstItem.value = first;
        material.uniformsNeedUpdate = true;
      };
    });
    renderer.setRenderTarget(this.target);
    renderer.setClearColor(0, 0);
    renderer.clear();
    renderer.render(picture.scene, camera);
    const pixels = new Uint8Array(4 * WIDTH * HEIGHT);
    renderer.readRenderTargetPixels(this.target, 0, 0, WIDTH, HEIGHT, pixels);
    renderer.setRenderTarget(null);
    batches.forEach(({ mesh }, i) => {
      mesh.material = former[i];
      mesh.onBeforeRender = hooks[i];
    });
    for (const object of loose) object.visible = true;
    return pixels;
  }

  /**
   * Compares the items whose bits are set with all of a model, for a camera as `Culling.cull` takes it. The
   * picture has the camera's own aspect, whatever the number of pixels. `shown` are objects that show in a
   * pixel; `wrongObjects` are those of them whose bit is not set; `surfaces` and `allSurfaces` are surfaces
   * drawn for each pixel.
   */
  compare(picture, camera, bits) {
    const eye = picture.look(camera);
    picture.show(picture.all);
    const right = this.#pixels(picture, eye, false);
    const allSurfaces = meanAlpha(this.#pixels(picture, eye, true));
    picture.show(bits);
    const drawn = this.#pixels(picture, eye, false);
    const surfaces = meanAlpha(this.#pixels(picture, eye, true));
    const rightWords = new Uint32Array(right.buffer);
    const drawnWords = new Uint32Array(drawn.buffer);
    let wrongPixels = 0;
    const items = new Set();
    for (let i = 0; i < rightWords.length; i++) {
      if (rightWords[i] !== drawnWords[i]) wrongPixels++;
      const number = rightWords[i] & 0xffffff;
      if (number > 0) items.add(number - 1);
    }
    const wrong = [...items].filter((item) => !hasItem(bits, item));
    return {
      pixels: rightWords.length,
      wrongPixels,
      wrongObjects: wrong.length,
      shown: items.size,
      surfaces,
      allSurfaces,
    };
  }

  /**
   * The item that shows in a pixel, by its place from 0 to 1 from left and top, of all or of those of
   * `bits`; or -1.
   */
  pick(picture, eye, [x, y], bits) {
    picture.show(bits ?? picture.all);
    const pixels = this.#pixels(picture, eye, false);
    const column = Math.min(WIDTH - 1, Math.floor(x * WIDTH));
    const row = Math.min(HEIGHT - 1, Math.floor((1 - y) * HEIGHT));
    const at = 4 * (row * WIDTH + column);
    return pixels[at] + 256 * pixels[at + 1] + 65536 * pixels[at + 2] - 1;
  }
}

/** Mean of the alpha bytes of pixels: surfaces a pixel, at most 255. */
function meanAlpha(pixels) {
  let sum = 0;
  for (let i = 3; i < pixels.length; i += 4) sum += pixels[i];
  return sum / (pixels.length / 4);
}
