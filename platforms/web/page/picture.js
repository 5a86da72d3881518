// Draws a model: what is seen in its own colours with light, shadows and ambient shade; what is hidden as a
// glow; from above with a cut at the eye's height; and the edges of the camera's view.

import {
  AdditiveBlending,
  AmbientLight,
  BufferGeometry,
  Color,
  DirectionalLight,
  DoubleSide,
  HemisphereLight,
  LineBasicMaterial,
  LineSegments,
  MeshBasicMaterial,
  MeshLambertMaterial,
  OrthographicCamera,
  PCFShadowMap,
  PerspectiveCamera,
  Scene,
  Vector3,
  WebGLRenderer,
} from "three";
import { basisOf } from "./camera.js";
import { hasItem } from "./items.js";
import { pause } from "./load.js";
import { Outlines } from "./outlines.js";
import { Shade } from "./shade.js";

const COLORS = { seen: "#ffd166", hidden: "#ff7a45", outside: "#5b7fa6", baked: "#8fd694" };
/** Colours, from above, of what a box sees: hidden by the sweep, proven hidden, not decided, seen by a ray. */
const OF_BOX = { swept: "#8f4a2a", proven: "#b5489f", open: "#c9c04a", ray: "#3fa796" };
/** How far the map's middle is ahead of the eye, as a part of half its height. */
const AHEAD_PART = 0.4;
const SKY = new Color("#b9cfe0");
const GROUND = new Color("#12161b");

export class Picture {
  constructor(canvas) {
    this.renderer = new WebGLRenderer({ canvas, antialias: false, powerPreference: "high-performance" });
    this.renderer.shadowMap.enabled = true;
    this.renderer.shadowMap.type = PCFShadowMap;
    this.renderer.autoClear = false;
    this.renderer.info.autoReset = false;
    this.shade = new Shade(this.renderer);
    this.scene = new Scene();
    this.sky = new HemisphereLight("#dfeaf5", "#7d7468", 1.3);
    this.sun = new DirectionalLight("#fff1dc", 2.3);
    this.sun.castShadow = true;
    this.sun.shadow.mapSize.set(2048, 2048);
    this.sun.shadow.autoUpdate = false;
    this.scene.add(this.sky, this.sun, this.sun.target, new AmbientLight("#ffffff", 0.15));
    this.camera = new PerspectiveCamera();
    this.map = new OrthographicCamera();
    this.materials = {
      glow: new MeshBasicMaterial({
        color: COLORS.hidden,
        transparent: true,
        opacity: 0.035,
        depthTest: false,
        depthWrite: false,
        blending: AdditiveBlending,
        side: DoubleSide,
      }),
      hidden: new MeshLambertMaterial({ color: "#c25a30", side: DoubleSide }),
      outside: new MeshLambertMaterial({ color: "#455970", side: DoubleSide }),
      ...Object.fromEntries(
        Object.entries(OF_BOX).map(([name, color]) => {
          const light = { emissive: color, emissiveIntensity: 0.3 };
          return [name, new MeshLambertMaterial({ color, side: DoubleSide, ...light })];
        }),
      ),
    };
    this.outlines = new Outlines(COLORS);
    this.lines = new LineSegments(
      new BufferGeometry(),
      new LineBasicMaterial({ color: COLORS.seen, depthTest: false }),
    );
    this.lines.frustumCulled = this.lines.visible = false;
    this.boxes = new LineSegments(
      new BufferGeometry(),
      new LineBasicMaterial({ color: COLORS.baked, depthTest: false, transparent: true, opacity: 0.7 }),
    );
    this.boxes.frustumCulled = this.boxes.visible = false;
    this.overlay = new Scene();
    this.overlay.add(this.lines, this.boxes, this.outlines.lines);
    this.shown = new Uint32Array(0);
  }

  /**
   * Gives the textures of a model to the graphics card one by one, so that the page goes on meanwhile. `progress` gets a
   * line of text. What is decoded is freed then, unless a mesh that is no item may need it.
   */
  async takeTextures({ textures, loose }, progress) {
    let count = 0;
    for (const texture of textures) {
      progress(`Pictures: ${++count} of ${textures.size}`);
      await pause();
      this.renderer.initTexture(texture);
    }
    if (loose.length > 0) return;
    for (const { image, source } of textures) {
      if (!image?.close) continue;
      image.close();
      // The material that three.js draws shadows with may ask for a former map once more.
      source.data = new ImageData(1, 1);
    }
  }

  /** Takes a model, and lets go of the former one. */
  setModel(model) {
    if (this.model) {
      this.scene.remove(...this.model.batches.map(({ mesh }) => mesh), ...this.model.loose);
      this.model.dispose();
    }
    this.model = model;
    for (const { mesh } of model.batches) this.scene.add(mesh);
    for (const object of model.loose) this.scene.attach(object);
    // All items of a new batch are shown.
    this.shown = new Uint32Array(Math.ceil(model.count / 32)).fill(0xffffffff);
    const [x0, y0, z0, x1, y1, z1] = model.box;
    this.size = Math.hypot(x1 - x0, y1 - y0, z1 - z0);
    this.middle = [(x0 + x1) / 2, (y0 + y1) / 2, (z0 + z1) / 2];
    this.#light();
    this.outlines.setBoxes(model.bounds);
  }

  #light() {
    const middle = new Vector3(...this.middle);
    const reach = this.size / 2 || 1;
    this.sun.target.position.copy(middle);
    this.sun.position.copy(middle).addScaledVector(new Vector3(0.45, 0.8, 0.35).normalize(), 2 * reach);
    const { camera } = this.sun.shadow;
    Object.assign(camera, {
      left: -reach,
      right: reach,
      bottom: -reach,
      top: reach,
      near: reach / 2,
      far: 3.5 * reach,
    });
    camera.updateProjectionMatrix();
    this.sun.shadow.normalBias = reach / 600;
    this.sun.shadow.bias = -2e-4;
    this.sun.shadow.needsUpdate = true;
    this.sun.updateMatrixWorld();
  }

  /** Shows the items whose bits are set, and no others. Touches those alone that change. */
  show(bits) {
    for (const { mesh, first, count } of this.model.batches) {
      const end = first + count;
      for (let word = first >>> 5; word <= (end - 1) >>> 5; word++) {
        const changed = (this.shown[word] ^ (bits[word] ?? 0)) >>> 0;
        if (changed === 0) continue;
        for (let item = Math.max(first, 32 * word); item < Math.min(end, 32 * word + 32); item++) {
          if ((changed >>> (item & 31)) & 1) mesh.setVisibleAt(item - first, hasItem(bits, item));
        }
      }
    }
    this.shown.fill(0);
    this.shown.set(bits.length > this.shown.length ? bits.subarray(0, this.shown.length) : bits);
  }

  /** The set of all items. */
  get all() {
    return new Uint32Array(this.shown.length).fill(0xffffffff);
  }

  /** Items that are not seen in this frame, `hidden` within the view and `outside` of it. Made when read. */
  sets({ seen, inView }) {
    const { length } = this.shown;
    const at = (bits, word) => bits[word] ?? 0;
    const make = (value) => Uint32Array.from({ length }, (_, word) => value(word));
    return {
      get hidden() {
        return make((word) => at(inView, word) & ~at(seen, word));
      },
      get outside() {
        return make((word) => ~at(inView, word) & ~at(seen, word));
      },
    };
  }

  /** What is not drawn from the eye, by what a box around it sees: pairs of items and material. */
  #setsOfBox({ seen }, { sets }) {
    const { materials } = this;
    const { length } = this.shown;
    const notDrawn = (make) => Uint32Array.from({ length }, (_, word) => make(word) & ~(seen[word] ?? 0));
    return [
      [notDrawn((word) => ~sets.swept[word]), materials.swept],
      [notDrawn((word) => sets.hidden[word]), materials.proven],
      [notDrawn((word) => sets.open[word]), materials.open],
      [notDrawn((word) => sets.seen[word]), materials.ray],
    ];
  }

  /** Sets the camera of three.js to one as `Culling.cull` takes it. */
  look({ eye, target, up, fovY, aspect, near }) {
    const { camera } = this;
    camera.position.set(...eye);
    camera.up.set(...up);
    camera.lookAt(...target);
    const far = Math.max(4 * this.size, 1000 * near);
    Object.assign(camera, { fov: (fovY * 180) / Math.PI, aspect, near, far });
    camera.updateProjectionMatrix();
    camera.updateMatrixWorld();
    return camera;
  }

  #lookDown(camera, height) {
    const { map } = this;
    const half = height / 2;
    // The eye is below the middle of what it looks at: what is behind it has less room.
    const { ahead } = basisOf(camera);
    const y = camera.eye[1];
    const [x, z] = [0, 2].map((k) => camera.eye[k] + half * AHEAD_PART * ahead[k]);
    // A cut a little above the eye, so that one looks into rooms; above all roofs, if the eye is.
    map.position.set(x, y + this.size / 400, z);
    map.up.set(0, 0, -1);
    map.lookAt(x, y - 1, z);
    const aspect = camera.aspect;
    Object.assign(map, { left: -half * aspect, right: half * aspect, top: half, bottom: -half });
    Object.assign(map, { near: 0, far: 2 * this.size + y });
    map.updateProjectionMatrix();
    map.updateMatrixWorld();
    return map;
  }

  /** Edges of what a camera sees, as far as `distance`. */
  #showView(camera, distance) {
    const { eye, fovY, aspect } = camera;
    const from = new Vector3(...eye);
    const [right, over, ahead] = Object.values(basisOf(camera)).map((axis) => new Vector3(...axis));
    const height = Math.tan(fovY / 2);
    const corners = [
      [-1, -1],
      [1, -1],
      [1, 1],
      [-1, 1],
    ].map(([x, y]) =>
      from
        .clone()
        .addScaledVector(ahead, distance)
        .addScaledVector(right, distance * height * aspect * x)
        .addScaledVector(over, distance * height * y),
    );
    const points = corners.flatMap((corner, i) => [from, corner, corner, corners[(i + 1) % 4]]);
    this.lines.geometry.dispose();
    this.lines.geometry = new BufferGeometry().setFromPoints(points);
  }

  /** Outlines of baked boxes as they are seen from above, at the height of the eye. */
  #showBoxes(boxes, y) {
    const points = boxes.flatMap(({ min, max }) => {
      const corners = [
        [min[0], min[2]],
        [max[0], min[2]],
        [max[0], max[2]],
        [min[0], max[2]],
      ].map(([x, z]) => new Vector3(x, y, z));
      return corners.flatMap((corner, i) => [corner, corners[(i + 1) % 4]]);
    });
    this.boxes.geometry.dispose();
    this.boxes.geometry = new BufferGeometry().setFromPoints(points);
  }

  /**
   * Draws a frame. `camera` is where one looks from, `culled` the camera that `bits` are of. `above` is the
   * height in metres of the view from above, or 0. `ghosts` shows hidden items through those in front. `boxes` are
   * those that a bake has done, for the view from above, and `region` what is seen from a box, as of `Region.look`.
   */
  draw(camera, bits, { culled = camera, above = 0, ghosts = false, boxes = [], region = null } = {}) {
    const { renderer, scene, materials } = this;
    const sets = this.sets(bits);
    const eye = above ? this.#lookDown(camera, above) : this.look(camera);
    if (this.sun.shadow.needsUpdate) {
      // Once, of all items.
      this.show(this.all);
      renderer.render(scene, eye);
    }
    this.shade.begin(above ? GROUND : SKY);
    if (above) {
      for (const [set, material] of region ? this.#setsOfBox(bits, region) : [
        [sets.outside, materials.outside],
        [sets.hidden, materials.hidden],
      ]) {
        this.show(set);
        this.#draw(eye, material);
      }
    }
    this.show(bits.seen);
    renderer.info.reset();
    this.#draw(eye, null);
    const { triangles, calls } = renderer.info.render;
    this.lines.visible = Boolean(above) || culled !== camera;
    if (this.lines.visible) this.#showView(culled, above ? above / 3 : this.size / 4);
    this.boxes.visible = above > 0 && boxes.length > 0;
    if (this.boxes.visible) this.#showBoxes(boxes, culled.eye[1]);
    this.shade.end(eye, above ? 0 : 1, this.size);
    if (ghosts && !above) {
      this.show(sets.hidden);
      this.#draw(eye, materials.glow);
    }
    this.outlines.show(
      ghosts ? sets.hidden : null,
      ghosts && (above || culled !== camera) ? sets.outside : null,
    );
    renderer.render(this.overlay, eye);
    return { triangles, calls };
  }

  #draw(eye, material) {
    this.scene.overrideMaterial = material;
    for (const object of this.model.loose) object.visible = !material;
    this.renderer.render(this.scene, eye);
    this.scene.overrideMaterial = null;
  }

  /** Sets the size of the canvas, in its own pixels. */
  resize(width, height) {
    this.renderer.setSize(width, height, false);
    this.shade.resize(width, height);
  }
}
