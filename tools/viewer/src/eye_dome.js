// Eye-dome lighting: a pixel becomes darker the farther it lies behind its neighbors (Boucheny, 2009). It shows shapes without normals.

import { DepthTexture, FloatType, GLSL3, Mesh, OrthographicCamera, PlaneGeometry, Scene, ShaderMaterial, Vector2, WebGLRenderTarget } from 'three'

const VERTEX = 'void main() { gl_Position = vec4(position.xy, 0.0, 1.0); }'
const FRAGMENT = `
precision highp float;
uniform sampler2D colors, depths;
uniform float near, far, strength;
uniform ivec2 size;
out vec4 fragment;
float logDepth(ivec2 at) {
  float depth = texelFetch(depths, clamp(at, ivec2(0), size - 1), 0).r;
  return log2(near * far / (far - depth * (far - near)));
}
void main() {
  ivec2 at = ivec2(gl_FragCoord.xy);
  vec4 color = texelFetch(colors, at, 0);
  if (texelFetch(depths, at, 0).r < 1.0 && strength > 0.0) {
    float here = logDepth(at), sum = 0.0;
    for (int k = 0; k < 8; k++) {
      float angle = 0.785398 * float(k);
      ivec2 off = ivec2(round(1.4 * vec2(cos(angle), sin(angle))));
      sum += max(0.0, here - logDepth(at + off));
    }
    color.rgb *= exp(-strength * sum * 7.0);
  }
  fragment = vec4(color.rgb, 1.0);
}`

export class EyeDome {
  strength = 1
  #target = new WebGLRenderTarget(1, 1)
  #uniforms
  #scene = new Scene()
  #camera = new OrthographicCamera()

  constructor() {
    this.#target.depthTexture = new DepthTexture(1, 1, FloatType)
    this.#uniforms = {
      colors: { value: this.#target.texture }, depths: { value: this.#target.depthTexture },
      near: { value: 1 }, far: { value: 2 }, strength: { value: 1 }, size: { value: new Vector2(1, 1) },
    }
    const material = new ShaderMaterial({
      glslVersion: GLSL3, vertexShader: VERTEX, fragmentShader: FRAGMENT, uniforms: this.#uniforms, depthTest: false, depthWrite: false,
    })
    const quad = new Mesh(new PlaneGeometry(2, 2), material)
    quad.frustumCulled = false
    this.#scene.add(quad)
  }

  render(renderer, scene, camera) {
    const size = renderer.getDrawingBufferSize(this.#uniforms.size.value)
    this.#target.setSize(size.x, size.y)
    this.#uniforms.near.value = camera.near
    this.#uniforms.far.value = camera.far
    this.#uniforms.strength.value = this.strength
    renderer.setRenderTarget(this.#target)
    renderer.render(scene, camera)
    renderer.setRenderTarget(null)
    renderer.render(this.#scene, this.#camera)
  }
}
