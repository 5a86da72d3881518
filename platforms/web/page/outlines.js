// Outlines of the boxes of hidden objects: one instanced draw call for all of them.

import {
  Color,
  Float32BufferAttribute,
  GLSL3,
  InstancedBufferAttribute,
  InstancedBufferGeometry,
  LineSegments,
  ShaderMaterial,
} from "three";
import { hasItem } from "./items.js";

/** The 12 edges of the unit cube, as pairs of corners. */
const EDGES = [0, 1, 2].flatMap((axis) =>
  [0, 1, 2, 3].flatMap((others) => {
    const at = (along) => {
      const corner = [others & 1, others >> 1];
      corner.splice(axis, 0, along);
      return corner;
    };
    return [at(0), at(1)];
  }),
);

export class Outlines {
  constructor(colors) {
    this.geometry = new InstancedBufferGeometry();
    this.geometry.setAttribute("position", new Float32BufferAttribute(EDGES.flat(), 3));
    this.material = new ShaderMaterial({
      glslVersion: GLSL3,
      transparent: true,
      depthTest: false,
      depthWrite: false,
      uniforms: {
        hidden: { value: new Color(colors.hidden) },
        outside: { value: new Color(colors.outside) },
      },
      vertexShader: `
        in vec3 least;
        in vec3 greatest;
        in float isOutside;
        flat out float outsideness;
        void main() {
          outsideness = isOutside;
          gl_Position = projectionMatrix * viewMatrix * vec4(mix(least, greatest, position), 1.0);
        }`,
      fragmentShader: `
        uniform vec3 hidden;
        uniform vec3 outside;
        flat in float outsideness;
        out vec4 color;
        void main() {
          color = linearToOutputTexel(vec4(mix(hidden, outside, outsideness), mix(0.4, 0.25, outsideness)));
        }`,
    });
    this.lines = new LineSegments(this.geometry, this.material);
    this.lines.frustumCulled = this.lines.visible = false;
  }

  /** Takes the boxes of all items, 6 numbers each. */
  setBoxes(boxes) {
    this.boxes = boxes;
    const count = boxes.length / 6;
    this.geometry.dispose();
    for (const [name, size] of [
      ["least", 3],
      ["greatest", 3],
      ["isOutside", 1],
    ])
      this.geometry.setAttribute(name, new InstancedBufferAttribute(new Float32Array(size * count), size));
  }

  /** Shows the boxes of two sets of items, each a bit for each item, or null for none. */
  show(hidden, outside) {
    const { least, greatest, isOutside } = this.geometry.attributes;
    let shown = 0;
    for (const [set, value] of [
      [hidden, 0],
      [outside, 1],
    ]) {
      if (!set) continue;
      for (let item = 0; item < this.boxes.length / 6; item++) {
        if (!hasItem(set, item)) continue;
        for (let k = 0; k < 3; k++) {
          least.array[3 * shown + k] = this.boxes[6 * item + k];
          greatest.array[3 * shown + k] = this.boxes[6 * item + 3 + k];
        }
        isOutside.array[shown++] = value;
      }
    }
    this.lines.visible = shown > 0;
    this.geometry.instanceCount = shown;
    for (const attribute of [least, greatest, isOutside]) attribute.needsUpdate = true;
  }
}
