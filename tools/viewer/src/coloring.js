// The choice of colors: mode, range, bands, hidden classes.

import { NO_BAND } from './attributes.js'
import { classTable, materialTable, modesOf } from './color_modes.js'
import { element, escaped, grouped, onInput } from './elements.js'

/** Bands of natural colors that one camera can have, nm: few points are seen by two. */
const DEFAULT_NM = [610, 540, 480]

export class Coloring {
  mode = 'rgb'
  range = null
  hidden = new Set()
  /** Chosen bands by name: red, green, blue. */
  bands = []
  /** Called after each change. */
  onChange = () => {}
  #ranges = { fields: {} }
  #legend = ''

  constructor(cloud, scene, nodes, uniforms) {
    Object.assign(this, { cloud, scene, nodes, uniforms, classes: classTable(cloud, scene), materials: materialTable(scene) })
    const materials = uniforms.materials.value
    this.materials.forEach(({ color }, id) => materials.image.data.set([...color, 255], 4 * id))
    materials.needsUpdate = true
    this.#learnTimes()
    this.#ranges.heights = [cloud.bounds[0][2], cloud.bounds[1][2]]
    this.#ranges.intensities = [0, 65535]
    this.#listModes()
    this.mode = this.#defaultMode()
    const nearest = (nm) => [...cloud.bands].sort((a, b) => Math.abs(a.nm - nm) - Math.abs(b.nm - nm))[0]?.name
    this.bands = cloud.bands.length > 0 ? DEFAULT_NM.map(nearest) : []
    const options = cloud.bands.map(({ name, nm }) => `<option value="${escaped(name)}">${nm} nm</option>`).join('')
    for (const k of [0, 1, 2]) {
      element(`band${k}`).innerHTML = options
      onInput(`band${k}`, ({ value }) => { this.bands[k] = value; this.apply() })
    }
    onInput('mode', ({ value }) => { this.mode = value; this.range = null; this.apply() })
    for (const id of ['rangeLow', 'rangeHigh']) onInput(id, () => this.#readRange())
    element('allClasses').onclick = () => this.hide([])
    element('noClasses').onclick = () => this.hide(presentOf(nodes.classCounts))
    element('classes').addEventListener('input', ({ target }) => {
      if (target.checked) this.hidden.delete(Number(target.value))
      else this.hidden.add(Number(target.value))
      this.apply()
    })
    this.apply()
  }

  /** Ranges in which most values of the first node lie: it has points of the whole cloud. */
  learnRanges(node, { positions, colors, marks }) {
    // Point formats with colors are also used without.
    if (this.cloud.has.color && [0, 1, 2].every((channel) => every(colors, 4, channel).every((value) => value === 0))) {
      this.cloud.has.color = false
      this.#listModes()
      if (this.mode === 'rgb') this.mode = this.#defaultMode()
    }
    const z = node.center[2] + this.cloud.origin[2]
    this.#ranges.heights = middleOf(every(positions, 3, 2)).map((value) => value + z)
    this.#ranges.intensities = middleOf(every(marks, 4, 0))
    this.apply()
  }

  /** Range in which most values of a field lie in the first node that was loaded with it. */
  learnField(names, values) {
    const [name] = names
    if (name in this.#ranges.fields || this.modes[name]?.field !== name) return
    const known = every(values, 3, 0).filter((value) => value !== NO_BAND)
    if (known.length === 0) return
    this.#ranges.fields[name] = middleOf(known)
    this.apply()
  }

  /** Covers the times of a cloud that has grown. */
  grow() {
    this.#learnTimes()
    if (this.mode === 'time') this.apply()
  }

  #learnTimes() {
    this.#ranges.times = [0, Math.max(this.cloud.end - this.cloud.begin, 0)]
  }

  hide(classes) {
    this.hidden = new Set(classes)
    this.apply()
  }

  /** Mode, hidden classes, bands and range, for the address. */
  state() {
    return { mode: this.mode, hidden: [...this.hidden].sort((a, b) => a - b), bands: this.#usedBands(), range: this.range }
  }

  restore({ mode, hidden, bands, range }) {
    if (mode in this.modes) this.mode = mode
    this.hidden = new Set(hidden ?? [])
    bands?.forEach((name, k) => { if (k < 3 && this.cloud.bands.some((band) => band.name === name)) this.bands[k] = name })
    this.range = range ?? null
    this.apply()
  }

  /** Makes shader and panel show the choice. */
  apply() {
    const { uniforms, mode } = this
    const { number, range: rangeOf, field } = this.modes[mode]
    element('mode').value = mode
    uniforms.mode.value = number
    const range = this.range ?? rangeOf?.(this.#ranges) ?? [0, 1]
    uniforms.range.value.set(...range)
    element('rangeChoice').hidden = rangeOf === undefined
    element('materials').hidden = mode !== 'material'
    if (document.activeElement?.parentElement?.id !== 'rangeChoice') {
      element('rangeLow').value = Number(range[0].toPrecision(6))
      element('rangeHigh').value = Number(range[1].toPrecision(6))
    }
    const used = this.#usedBands()
    element('bandChoice').hidden = used.length === 0
    for (const k of [0, 1, 2]) {
      element(`band${k}`).hidden = k >= used.length
      if (used[k]) element(`band${k}`).value = used[k]
    }
    // Bands stay loaded while other colors are shown.
    const loaded = field ? [field] : used
    if (loaded.length > 0) this.nodes.setBands(loaded)
    const data = uniforms.classes.value.image.data
    this.classes.forEach(({ color }, id) => data.set([...color, this.hidden.has(id) ? 0 : 255], 4 * id))
    uniforms.classes.value.needsUpdate = true
    this.#legend = ''
    this.onChange()
  }

  /** Lists the classes and materials of the points that were loaded so far. */
  showLegend() {
    const { classCounts, materialCounts } = this.nodes
    const legend = `${classCounts.join()};${materialCounts.join()}`
    if (legend === this.#legend) return
    this.#legend = legend
    const hides = (id) => `<input type="checkbox" value="${id}"${this.hidden.has(id) ? '' : ' checked'}>`
    element('classes').innerHTML = presentOf(classCounts).map((id) => legendRow(this.classes[id], classCounts[id], hides(id))).join('')
    element('materials').innerHTML = presentOf(materialCounts).map((id) => legendRow(this.materials[id], materialCounts[id])).join('')
  }

  #listModes() {
    this.modes = modesOf(this.cloud, this.scene)
    const option = ([name, { label }]) => `<option value="${escaped(name)}">${escaped(label)}</option>`
    element('mode').innerHTML = Object.entries(this.modes).map(option).join('')
  }

  #defaultMode() {
    if (this.cloud.has.color) return 'rgb'
    return this.cloud.has.class ? 'class' : 'height'
  }

  #usedBands() {
    return { band: this.bands.slice(0, 1), bands: this.bands }[this.mode] ?? []
  }

  #readRange() {
    const range = ['rangeLow', 'rangeHigh'].map((id) => element(id).valueAsNumber)
    if (!range.every(Number.isFinite)) return
    this.range = range
    this.apply()
  }
}

/** Numbers that occur. */
const presentOf = (counts) => [...counts.keys()].filter((id) => counts[id] > 0)

const legendRow = ({ name, color }, count, input = '') =>
  `<label>${input}<i style="background:rgb(${color.join()})"></i>${escaped(name)}<span title="points loaded so far">${grouped(count)}</span></label>`

/** Every `step`th value from `first` on. */
function every(values, step, first) {
  return Float64Array.from({ length: Math.floor(values.length / step) }, (_, i) => values[step * i + first])
}

/** The values below which 2 % and 98 % lie. */
function middleOf(values) {
  values.sort()
  return [0.02, 0.98].map((share) => values[Math.floor(share * (values.length - 1))] ?? 0)
}
