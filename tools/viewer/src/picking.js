// Which point is under the pointer: the points around it are drawn with their numbers as colors.

import { WebGLRenderTarget } from 'three'
import { pointMaterial } from './point_material.js'

/** Side of the square in which a point is searched, px. */
const SIDE = 13

export class Picking {
  #target = new WebGLRenderTarget(SIDE, SIDE)
  #pixels = new Uint8Array(SIDE * SIDE * 4)

  constructor(renderer, nodes, uniforms) {
    Object.assign(this, { renderer, nodes, material: pointMaterial(uniforms, true) })
  }

  /** The node and the index of the nearest point to a place of the canvas, CSS px, or null. */
  at(x, y, camera) {
    const { renderer, nodes } = this
    nodes.number()
    const ratio = renderer.getPixelRatio()
    const canvas = renderer.domElement
    const [left, top] = [x, y].map((value) => Math.round(value * ratio) - (SIDE - 1) / 2)
    camera.setViewOffset(canvas.width, canvas.height, left, top, SIDE, SIDE)
    const shown = nodes.material
    for (const points of nodes.group.children) points.material = this.material
    renderer.setRenderTarget(this.#target)
    renderer.setClearColor(0, 0)
    renderer.clear()
    renderer.render(nodes.group, camera)
    renderer.readRenderTargetPixels(this.#target, 0, 0, SIDE, SIDE, this.#pixels)
    renderer.setRenderTarget(null)
    for (const points of nodes.group.children) points.material = shown
    camera.clearViewOffset()
    const number = this.#nearest()
    return number === 0 ? null : nodes.locate(number - 1)
  }

  #nearest() {
    const middle = (SIDE - 1) / 2
    let [found, least] = [0, Infinity]
    for (let i = 0; i < SIDE * SIDE; i++) {
      const [r, g, b, a] = this.#pixels.subarray(4 * i, 4 * i + 4)
      const number = (r | g << 8 | b << 16 | a << 24) >>> 0
      const distance = (i % SIDE - middle) ** 2 + (Math.floor(i / SIDE) - middle) ** 2
      if (number !== 0 && distance < least) [found, least] = [number, distance]
    }
    return found
  }
}
