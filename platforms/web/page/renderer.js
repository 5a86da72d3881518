// Draws objects with WebGL2, and counts what is drawn: surfaces per pixel, and pixels that are wrong.

import { firstTriangles } from "./scene.js";

const VERTEX = `#version 300 es
  uniform mat4 matrix;
  layout(location = 0) in vec3 place;
  layout(location = 1) in uint object;
  out vec3 at;
  flat out uint id;
  void main() { at = place; id = object; gl_Position = matrix * vec4(place, 1.0); }`;

/** Fragment shaders by what they show. */
const FRAGMENT = {
  // Objects in colours by their number, lit by the slope of the surface.
  shaded: `
    vec3 normal = normalize(cross(dFdx(at), dFdy(at)));
    float light = 0.55 + 0.45 * abs(dot(normal, normalize(vec3(0.35, 0.25, 0.9))));
    vec3 hue = fract(float(id) * vec3(0.6180, 0.3247, 0.7549));
    color = vec4(mix(vec3(0.82), 0.45 + 0.5 * hue, 0.6) * light, 1.0);`,
  // Objects that were culled, seen from above.
  faint: `color = vec4(0.16, 0.18, 0.21, 1.0);`,
  lines: `color = vec4(1.0, 0.75, 0.2, 1.0);`,
  // The number of the object, plus 1: what shows in a pixel. Depth is the reciprocal of the distance, which
  // floating point tells apart where the usual depth would be equal.
  ids: `gl_FragDepth = 0.05 * gl_FragCoord.w;
    uint i = id + 1u; color = vec4(float(i & 255u), float((i >> 8) & 255u), float(i >> 16), 255.0) / 255.0;`,
  // One more surface.
  count: `color = vec4(1.0 / 255.0);`,
};

/** Size in pixels of the pictures that are counted. */
const WIDTH = 256;
const HEIGHT = 144;

export class Renderer {
  constructor(canvas) {
    const gl = canvas.getContext("webgl2", { antialias: true, preserveDrawingBuffer: true });
    if (!gl) throw new Error("this browser has no WebGL2");
    this.gl = gl;
    this.programs = Object.fromEntries(
      Object.entries(FRAGMENT).map(([name, body]) => [name, program(gl, body)]),
    );
    this.lines = gl.createBuffer();
    this.target = gl.createFramebuffer();
    const [color, depth] = [gl.RGBA8, gl.DEPTH_COMPONENT32F].map((format) => {
      const buffer = gl.createRenderbuffer();
      gl.bindRenderbuffer(gl.RENDERBUFFER, buffer);
      gl.renderbufferStorage(gl.RENDERBUFFER, format, WIDTH, HEIGHT);
      return buffer;
    });
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.target);
    gl.framebufferRenderbuffer(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.RENDERBUFFER, color);
    gl.framebufferRenderbuffer(gl.FRAMEBUFFER, gl.DEPTH_ATTACHMENT, gl.RENDERBUFFER, depth);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
  }

  /** Takes the triangles of a scene. */
  setScene(lists) {
    const { gl } = this;
    for (const old of [this.places, this.owners]) gl.deleteBuffer(old ?? null);
    this.first = firstTriangles(lists);
    this.all = lists.triangleCounts.map((_, object) => object);
    const owners = new Uint32Array(lists.triangles.length / 3);
    for (const object of this.all) owners.fill(object, 3 * this.first[object], 3 * this.first[object + 1]);
    [this.places, this.owners] = [lists.triangles, owners].map((data) => {
      const buffer = gl.createBuffer();
      gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
      gl.bufferData(gl.ARRAY_BUFFER, data, gl.STATIC_DRAW);
      return buffer;
    });
  }

  /** Begins a picture on the canvas. */
  begin([red, green, blue]) {
    const { gl } = this;
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.viewport(0, 0, gl.canvas.width, gl.canvas.height);
    gl.enable(gl.DEPTH_TEST);
    gl.depthFunc(gl.LEQUAL);
    gl.clearColor(red, green, blue, 1);
    gl.clearDepth(1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
  }

  /**
   * Draws objects by their indices, which ascend, in a way that `FRAGMENT` names. Returns the number of
   * triangles.
   */
  draw(look, matrix, objects) {
    const { gl } = this;
    gl.useProgram(this.programs[look].program);
    gl.uniformMatrix4fv(this.programs[look].matrix, false, matrix);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.places);
    gl.enableVertexAttribArray(0);
    gl.vertexAttribPointer(0, 3, gl.FLOAT, false, 0, 0);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.owners);
    gl.enableVertexAttribArray(1);
    gl.vertexAttribIPointer(1, 1, gl.UNSIGNED_INT, 0, 0);
    let triangles = 0;
    for (let i = 0; i < objects.length;) {
      // Neighbours in the buffer are one call.
      const from = objects[i];
      let to = from + 1;
      for (i++; objects[i] === to; i++) to++;
      const [start, end] = [this.first[from], this.first[to]];
      gl.drawArrays(gl.TRIANGLES, 3 * start, 3 * (end - start));
      triangles += end - start;
    }
    return triangles;
  }

  /** Draws line segments over all else: a flat array of points, two for each. */
  drawLines(matrix, points) {
    const { gl } = this;
    gl.disable(gl.DEPTH_TEST);
    gl.useProgram(this.programs.lines.program);
    gl.uniformMatrix4fv(this.programs.lines.matrix, false, matrix);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.lines);
    gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(points), gl.STREAM_DRAW);
    gl.enableVertexAttribArray(0);
    gl.vertexAttribPointer(0, 3, gl.FLOAT, false, 0, 0);
    gl.disableVertexAttribArray(1);
    gl.vertexAttribI4ui(1, 0, 0, 0, 0);
    gl.drawArrays(gl.LINES, 0, points.length / 3);
    gl.enable(gl.DEPTH_TEST);
  }

  /** Draws a picture aside and returns its pixels, 4 bytes each. */
  #pixels(look, matrix, objects) {
    const { gl } = this;
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.target);
    gl.viewport(0, 0, WIDTH, HEIGHT);
    gl.enable(gl.DEPTH_TEST);
    gl.depthFunc(gl.GREATER);
    gl.clearColor(0, 0, 0, 0);
    gl.clearDepth(0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    if (look === "count") {
      gl.disable(gl.DEPTH_TEST);
      gl.enable(gl.BLEND);
      gl.blendFunc(gl.ONE, gl.ONE);
    }
    this.draw(look, matrix, objects);
    gl.disable(gl.BLEND);
    const pixels = new Uint8Array(WIDTH * HEIGHT * 4);
    gl.readPixels(0, 0, WIDTH, HEIGHT, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    return pixels;
  }

  /**
   * Returns the mean number of surfaces in a pixel, and how many of all pixels show another object than they
   * should.
   */
  measure(matrix, objects) {
    const counts = this.#pixels("count", matrix, objects);
    const surfaces = counts.reduce((sum, count, i) => (i % 4 === 0 ? sum + count : sum), 0);
    const right = new Uint32Array(this.#pixels("ids", matrix, this.all).buffer);
    const shown = new Uint32Array(this.#pixels("ids", matrix, objects).buffer);
    const wrongPixels = right.reduce((sum, id, i) => sum + (id !== shown[i] ? 1 : 0), 0);
    return { overdraw: surfaces / right.length, wrongPixels, pixels: right.length };
  }
}

/** Compiles a program of the vertex shader and a fragment shader. */
function program(gl, body) {
  const made = gl.createProgram();
  const fragment = `#version 300 es
    precision highp float;
    in vec3 at;
    flat in uint id;
    out vec4 color;
    void main() { ${body} }`;
  for (const [kind, source] of [
    [gl.VERTEX_SHADER, VERTEX],
    [gl.FRAGMENT_SHADER, fragment],
  ]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
    gl.attachShader(made, shader);
  }
  gl.linkProgram(made);
  if (!gl.getProgramParameter(made, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(made));
  return { program: made, matrix: gl.getUniformLocation(made, "matrix") };
}
