// Shaders of the points: color by mode, hidden classes, clipping box; numbers of points for picking.

import { DataTexture, GLSL3, NearestFilter, RGBAFormat, ShaderMaterial, Vector2, Vector3 } from 'three'

const VERTEX = `
precision highp float;
precision highp int;
uniform int mode;
uniform vec2 range;
uniform sampler2D classes, materials;
uniform float sizePx, sizeM, focalPx, heightOrigin;
uniform bool clips;
uniform vec3 clipLow, clipHigh;
uniform uint firstPoint;
in vec4 color;
in vec4 marks;
in uint instance;
in float time;
in vec3 bands;
flat out vec4 shown;

vec3 turbo(float x) {
  const vec4 r = vec4(0.13572138, 4.61539260, -42.66032258, 132.13108234);
  const vec4 g = vec4(0.09140261, 2.19418839, 4.84296658, -14.18503333);
  const vec4 b = vec4(0.10667330, 12.64194608, -60.58204836, 110.36276771);
  x = clamp(x, 0.0, 1.0);
  vec4 low = vec4(1.0, x, x * x, x * x * x);
  vec2 high = low.zw * low.z;
  return clamp(vec3(
    dot(low, r) + dot(high, vec2(-152.94239396, 59.28637943)),
    dot(low, g) + dot(high, vec2(4.27729857, 2.82956604)),
    dot(low, b) + dot(high, vec2(-89.90310912, 27.34824973))), 0.0, 1.0);
}

vec3 hashed(uint number) {
  uint h = number * 2654435761u;
  vec3 hue = vec3(h >> 8 & 1023u, h >> 8 & 1023u, h >> 8 & 1023u) / 1023.0 + vec3(0.0, 0.333, 0.667);
  return (0.55 + 0.4 * cos(6.2831853 * hue)) * (0.75 + 0.25 * float(h >> 28) / 15.0);
}

float scaled(float value) { return (value - range.x) / max(range.y - range.x, 1e-9); }

const vec3 NONE = vec3(0.25, 0.26, 0.28);

vec3 colorOf(vec4 classColor, float height) {
  // No camera saw it.
  if (mode == 0) return color.rgb == vec3(0.0) ? NONE : color.rgb;
  if (mode == 1) return vec3(clamp(scaled(marks.x * 65535.0), 0.0, 1.0));
  if (mode == 2) return classColor.rgb;
  if (mode == 3) return instance == 0u ? NONE : hashed(instance);
  if (mode == 4) return turbo(scaled(height));
  if (mode == 5) return turbo(scaled(time));
  if (mode == 6) return marks.z > 0.5 ? vec3(1.0, 0.35, 0.1) : NONE;
  if (mode == 7) return turbo(scaled(marks.y));
  if (mode == 10) return texelFetch(materials, ivec2(int(marks.w * 65535.0 + 0.5), 0), 0).rgb;
  if (mode == 11) return bands.x <= 0.0 ? NONE : hashed(uint(bands.x));
  if (mode == 8) return bands.x == -1.0 ? NONE : turbo(scaled(bands.x));
  return any(equal(bands, vec3(-1.0))) ? NONE : clamp(vec3(scaled(bands.x), scaled(bands.y), scaled(bands.z)), 0.0, 1.0);
}

void main() {
  vec4 world = modelMatrix * vec4(position, 1.0);
  vec4 seen = viewMatrix * world;
  gl_Position = projectionMatrix * seen;
  gl_PointSize = clamp(max(sizePx, sizeM * focalPx / max(-seen.z, 0.01)), 1.0, 40.0);
  vec4 classColor = texelFetch(classes, ivec2(int(color.a * 255.0 + 0.5), 0), 0);
  bool isOutside = clips && (any(lessThan(world.xyz, clipLow)) || any(greaterThan(world.xyz, clipHigh)));
  // Behind the far plane: no fragment.
  if (classColor.a < 0.5 || isOutside) gl_Position = vec4(0.0, 0.0, 2.0, 1.0);
#ifdef PICKS
  uint number = firstPoint + uint(gl_VertexID) + 1u;
  shown = vec4(number & 255u, number >> 8 & 255u, number >> 16 & 255u, number >> 24) / 255.0;
#else
  shown = vec4(colorOf(classColor, world.z + heightOrigin), 1.0);
#endif
}`

const FRAGMENT = `
precision highp float;
uniform bool isRound;
flat in vec4 shown;
out vec4 fragment;
void main() {
  vec2 off = gl_PointCoord - 0.5;
  if (isRound && dot(off, off) > 0.25) discard;
  fragment = shown;
}`

/** A color for each of 256 numbers. */
function colorTable() {
  const table = new DataTexture(new Uint8Array(256 * 4).fill(255), 256, 1, RGBAFormat)
  table.minFilter = table.magFilter = NearestFilter
  table.needsUpdate = true
  return table
}

/** One set of values for the pictures and for picking. */
export function pointUniforms() {
  return {
    mode: { value: 0 }, range: { value: new Vector2(0, 1) }, classes: { value: colorTable() }, materials: { value: colorTable() },
    sizePx: { value: 2 }, sizeM: { value: 0.02 }, focalPx: { value: 1000 }, heightOrigin: { value: 0 }, isRound: { value: true },
    clips: { value: false }, clipLow: { value: new Vector3() }, clipHigh: { value: new Vector3() },
    firstPoint: { value: 0 },
  }
}

/** `picks`: draws the number of each point + 1 as color, `firstPoint` first. */
export const pointMaterial = (uniforms, picks) => new ShaderMaterial({
  glslVersion: GLSL3, vertexShader: VERTEX, fragmentShader: FRAGMENT, uniforms, defines: picks ? { PICKS: '' } : {},
})
