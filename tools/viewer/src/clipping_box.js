// A box outside of which no points are drawn.

import { boxCorners, boxes } from './annotations.js'
import { element, onInput } from './elements.js'

const SIZES = ['clipX', 'clipY', 'clipZ']

export class ClippingBox {
  #center = null
  #lines = null

  constructor(view, uniforms) {
    Object.assign(this, { view, uniforms })
    onInput('clip', () => this.#apply())
    for (const id of SIZES) onInput(id, () => this.#apply())
  }

  /** Moves the box and turns it on. Position in m from the origin. */
  moveTo(center) {
    this.#center = center
    element('clip').checked = true
    this.#apply()
  }

  #apply() {
    const isOn = element('clip').checked
    this.uniforms.clips.value = isOn
    if (this.#lines) {
      this.view.scene.remove(this.#lines)
      this.#lines.geometry.dispose()
      this.#lines = null
    }
    if (isOn) {
      this.#center ??= this.view.controls.target.toArray()
      const half = SIZES.map((id) => Math.max(element(id).valueAsNumber || 1, 0.1) / 2)
      const [low, high] = [-1, 1].map((sign) => this.#center.map((value, axis) => value + sign * half[axis]))
      this.uniforms.clipLow.value.set(...low)
      this.uniforms.clipHigh.value.set(...high)
      this.#lines = boxes([boxCorners(low, high)], [[1, 0.8, 0.3]])
      this.view.scene.add(this.#lines)
    }
    this.view.redraw()
  }
}
