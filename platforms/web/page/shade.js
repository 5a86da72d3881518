// Ambient shade: darkens corners and creases, from the depth of the picture alone.
//
// The scene is drawn into a target with depth. Of each pixel, the shader finds the place in view space and
// the slope of the surface, and looks at points around it: the more of the hemisphere they fill, the darker.
// A second pass averages 4 x 4 pixels where depths are alike, puts haze over what is far, and writes the
// canvas.

import {
  Color,
  DepthTexture,
  FloatType,
  GLSL3,
  HalfFloatType,
  Mesh,
  NearestFilter,
  OrthographicCamera,
  PlaneGeometry,
  RedFormat,
  ShaderMaterial,
  UnsignedByteType,
  WebGLRenderTarget,
} from "three";

const SAMPLES = 12;

const FULL = `
  out vec2 at;
  void main() { at = 0.5 + 0.5 * position.xy; gl_Position = vec4(position.xy, 0.0, 1.0); }`;

const PLACE = `
  uniform sampler2D depth;
  uniform mat4 unproject;
  in vec2 at;
  // The place of the pixel that is read: between two pixels, either may be.
  vec3 placeAt(vec2 uv) {
    vec2 size = vec2(textureSize(depth, 0));
    uv = (floor(uv * size) + 0.5) / size;
    vec4 place = unproject * vec4(2.0 * vec3(uv, textureLod(depth, uv, 0.0).r) - 1.0, 1.0);
    return place.xyz / place.w;
  }`;

const OCCLUSION = `
  ${PLACE}
  uniform vec2 pixel;
  uniform float reach;
  uniform float scale;
  out vec4 color;
  void main() {
    vec3 place = placeAt(at);
    float raw = textureLod(depth, at, 0.0).r;
    if (raw >= 1.0) { color = vec4(1.0); return; }
    // The flatter of the two neighbours in each direction: no slope across the edge of an object.
    vec3 r = placeAt(at + vec2(pixel.x, 0.0)) - place, l = place - placeAt(at - vec2(pixel.x, 0.0));
    vec3 u = placeAt(at + vec2(0.0, pixel.y)) - place, d = place - placeAt(at - vec2(0.0, pixel.y));
    vec3 dx = abs(r.z) < abs(l.z) ? r : l;
    vec3 dy = abs(u.z) < abs(d.z) ? u : d;
    vec3 normal = normalize(cross(dx, dy));
    // Interleaved gradient noise turns the pattern of samples from pixel to pixel.
    float noise = fract(52.9829189 * fract(dot(gl_FragCoord.xy, vec2(0.06711056, 0.00583715))));
    float near = reach * min(1.0, -place.z / (8.0 * reach) + 0.15);
    float radius = clamp(scale * near / -place.z, 3.0 * pixel.y, 0.12);
    float sum = 0.0;
    for (int i = 0; i < ${SAMPLES}; i++) {
      float angle = 6.2831853 * (float(i) * 0.618034 + noise);
      float part = sqrt((float(i) + 0.5 + noise) / float(${SAMPLES}));
      vec2 offset = part * radius * vec2(cos(angle) * pixel.x / pixel.y, sin(angle));
      vec3 to = placeAt(at + offset) - place;
      float far = length(to);
      float world = radius * -place.z / scale;
      float over = max(0.0, dot(to, normal) / max(far, 1e-6) - 0.08);
      sum += over * (1.0 - smoothstep(world, 2.5 * world, far));
    }
    color = vec4(clamp(1.0 - 1.7 * sum / float(${SAMPLES}), 0.0, 1.0));
  }`;

const COMPOSITE = `
  ${PLACE}
  uniform sampler2D picture;
  uniform sampler2D occlusion;
  uniform vec2 pixel;
  uniform vec3 sky;
  uniform mat4 toWorld;
  uniform float haze;
  uniform float strength;
  out vec4 color;
  vec3 tone(vec3 x) { return clamp((x * (2.51 * x + 0.03)) / (x * (2.43 * x + 0.59) + 0.14), 0.0, 1.0); }
  void main() {
    vec3 lit = texture(picture, at).rgb;
    float raw = textureLod(depth, at, 0.0).r;
    if (raw < 1.0) {
      float here = placeAt(at).z;
      float sum = 0.0, weights = 0.0;
      for (int y = -2; y < 2; y++) for (int x = -2; x < 2; x++) {
        vec2 uv = at + (vec2(x, y) + 0.5) * pixel;
        float weight = abs(placeAt(uv).z - here) < 0.02 * abs(here) ? 1.0 : 1e-3;
        sum += weight * texture(occlusion, uv).r;
        weights += weight;
      }
      lit *= mix(1.0, sum / weights, strength);
      lit = tone(0.8 * lit);
      lit = mix(lit, sky, haze > 0.0 ? 0.75 * (1.0 - exp(here / haze)) : 0.0);
    } else {
      // Haze at the horizon, deeper blue above, ground below.
      float up = haze > 0.0 ? normalize(mat3(toWorld) * placeAt(at)).y : 0.0;
      lit = mix(sky, sky * vec3(0.55, 0.72, 0.95), smoothstep(0.0, 0.7, up));
      lit = mix(lit, sky * vec3(0.55, 0.52, 0.46), smoothstep(0.0, -0.25, up));
    }
    color = linearToOutputTexel(vec4(lit, 1.0));
  }`;

export class Shade {
  constructor(renderer) {
    this.renderer = renderer;
    this.isOn = true;
    this.camera = new OrthographicCamera(-1, 1, 1, -1, 0, 1);
    this.uniforms = {
      depth: { value: null },
      picture: { value: null },
      occlusion: { value: null },
      unproject: { value: null },
      toWorld: { value: null },
      pixel: { value: [0, 0] },
      reach: { value: 1 },
      scale: { value: 1 },
      sky: { value: new Color() },
      haze: { value: 0 },
      strength: { value: 1 },
    };
    const settings = { glslVersion: GLSL3, depthTest: false, depthWrite: false, vertexShader: FULL };
    const make = (fragmentShader) =>
      new Mesh(
        new PlaneGeometry(2, 2),
        new ShaderMaterial({ ...settings, fragmentShader, uniforms: this.uniforms }),
      );
    this.occlusion = make(OCCLUSION);
    this.composite = make(COMPOSITE);
    for (const mesh of [this.occlusion, this.composite]) mesh.frustumCulled = false;
  }

  resize(width, height) {
    this.target?.dispose();
    this.target?.depthTexture.dispose();
    this.halves?.dispose();
    this.target = new WebGLRenderTarget(width, height, {
      type: HalfFloatType,
      samples: 4,
      depthTexture: new DepthTexture(width, height, FloatType),
    });
    const [w, h] = [Math.ceil(width / 2), Math.ceil(height / 2)];
    this.halves = new WebGLRenderTarget(w, h, {
      format: RedFormat,
      type: UnsignedByteType,
      depthBuffer: false,
      minFilter: NearestFilter,
      magFilter: NearestFilter,
    });
    this.uniforms.pixel.value = [1 / w, 1 / h];
  }

  /** Begins a picture; all that is rendered until `end` is part of it. */
  begin(sky) {
    this.uniforms.sky.value.copy(sky);
    this.renderer.setRenderTarget(this.target);
    this.renderer.setClearColor(sky, 1);
    this.renderer.clear();
  }

  /** Shades the picture and writes it to the canvas. `haze` is 0 for none; `size` is that of the model. */
  end(camera, haze, size) {
    const { renderer, uniforms } = this;
    uniforms.depth.value = this.target.depthTexture;
    uniforms.picture.value = this.target.texture;
    uniforms.occlusion.value = this.halves.texture;
    uniforms.unproject.value = camera.projectionMatrixInverse;
    uniforms.toWorld.value = camera.matrixWorld;
    uniforms.reach.value = size / 60;
    uniforms.scale.value = 0.5 * camera.projectionMatrix.elements[5];
    uniforms.haze.value = haze * size * 4;
    uniforms.strength.value = this.isOn && camera.isPerspectiveCamera ? 1 : 0;
    if (uniforms.strength.value > 0) {
      renderer.setRenderTarget(this.halves);
      renderer.render(this.occlusion, this.camera);
    }
    renderer.setRenderTarget(null);
    renderer.render(this.composite, this.camera);
  }
}
