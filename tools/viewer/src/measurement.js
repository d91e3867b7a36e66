// Distances between clicked points.

import { Group } from 'three'
import { thickLine } from './annotations.js'
import { element, placeAt } from './elements.js'

const COLOR = 0xff5a5a

export class Measurement {
  isOn = false
  /** Clicked positions, m from the origin. */
  positions = []
  #group = new Group()

  constructor(view) {
    this.view = view
    view.scene.add(this.#group)
    element('measure').onclick = () => {
      this.isOn = !this.isOn
      element('measure').setAttribute('aria-pressed', this.isOn)
      element('measured').textContent = this.isOn ? 'click points' : ''
      if (!this.isOn) this.clear()
    }
    element('clearMeasure').onclick = () => this.clear()
  }

  add(position) {
    this.positions.push(position)
    this.#show()
  }

  clear() {
    this.positions = []
    this.#show()
  }

  /** Lengths of the lines, m. */
  lengths() {
    return this.positions.slice(1).map((position, k) => Math.hypot(...difference(position, this.positions[k])))
  }

  #show() {
    for (const line of this.#group.children) line.geometry.dispose()
    this.#group.clear()
    if (this.positions.length > 1) this.#group.add(thickLine(this.positions, COLOR, 3))
    const lengths = this.lengths()
    if (lengths.length > 0) {
      const [x, y, z] = difference(this.positions.at(-1), this.positions.at(-2))
      const total = lengths.length > 1 ? `, all ${metres(lengths.reduce((a, b) => a + b))}` : ''
      element('measured').textContent = `last ${metres(lengths.at(-1))}: horizontal ${metres(Math.hypot(x, y))}, vertical ${metres(z)}${total}`
    } else {
      element('measured').textContent = this.isOn ? 'click points' : ''
    }
    element('labels').innerHTML = lengths.map((length) => `<div>${metres(length)}</div>`).join('')
    this.view.redraw()
  }

  /** Moves the labels to the middles of their lines on the screen. */
  placeLabels() {
    ;[...element('labels').children].forEach((label, k) => {
      const middle = this.positions[k].map((value, axis) => (value + this.positions[k + 1][axis]) / 2)
      placeAt(label, this.view.placeOf(middle))
    })
  }
}

const difference = (a, b) => a.map((value, axis) => value - b[axis])
const metres = (length) => `${length.toFixed(3)} m`
