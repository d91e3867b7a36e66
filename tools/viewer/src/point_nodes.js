// Nodes on the graphics card: loads what is selected, keeps some of what is not, draws within the budget.

import { BufferAttribute, BufferGeometry, Group, Points } from 'three'

/** Points that stay loaded although they are not shown, as a share of the budget. */
const KEPT_SHARE = 0.3
/** Failed nodes are tried again as often as this. */
const RETRIES = 2

export class PointNodes {
  group = new Group()
  budget = 3e6
  /** Names of the bands that are loaded, up to three. */
  bands = []
  /** Points by class of all nodes that were loaded. */
  classCounts = new Float64Array(256)
  materialCounts = new Float64Array(256)
  nDrawn = 0
  /** Nodes that belong to the picture and are not loaded yet. */
  nMissing = 0
  nLoaded = 0
  nLoading = 0
  /** Points that were decompressed since the start. */
  nDecoded = 0
  error = null
  #ready = new Set()
  /** Nodes to load, in their order. */
  #wanted = []
  #visits = 0
  #isStopped = false

  /**
   * `onChange`: something was loaded. `onFirst`: arrays of the first node, before they leave memory. `onBands`: names and values of
   * bands, before they leave memory.
   */
  constructor(cloud, workers, material, { onChange, onFirst, onBands }) {
    Object.assign(this, { cloud, workers, material, onChange, onFirst, onBands })
  }

  /** Loads nothing more: the file goes away. What is loading may fail. */
  stop() {
    this.#isStopped = true
  }

  /** Shows the nodes for a camera and starts to load those that are absent. */
  update(camera, focalPx) {
    const { selected, pages } = this.cloud.select(camera, focalPx, this.budget)
    this.#visits++
    for (const { points } of this.#ready) points.visible = false
    this.nDrawn = 0
    for (const node of selected) {
      node.lastUse = this.#visits
      if (node.state === 'ready') {
        node.points.visible = true
        const nShown = node.nShown ?? node.nPoints
        node.points.geometry.setDrawRange(0, nShown)
        this.nDrawn += nShown
      }
    }
    for (const node of pages.slice(0, 4)) this.cloud.loadPage(node).then(this.onChange, (error) => this.#fail(error))
    this.#wanted = selected.filter((node) => node.state === 'absent')
    this.nMissing = pages.length + this.#wanted.length + selected.filter((node) => node.state === 'loading').length
    this.#loadWanted()
    this.#dropUnused()
  }

  /** The visible node that has a point, by the number that the picking shader draws, and the index of the point in it. */
  locate(number) {
    for (const node of this.#ready) {
      const index = number - node.points.userData.firstPoint
      if (node.points.visible && index >= 0 && index < node.nPoints) return { node, index }
    }
    return null
  }

  /** Gives the points of visible nodes numbers one after the other. */
  number() {
    let firstPoint = 0
    for (const { points, nPoints } of this.#ready) {
      points.userData.firstPoint = firstPoint
      if (points.visible) firstPoint += nPoints
    }
  }

  /** Loads other bands for all nodes. */
  async setBands(names) {
    if (names.join() === this.bands.join()) return
    this.bands = names
    await Promise.all([...this.#ready].map((node) => this.#loadBands(node)))
  }

  async #loadBands(node) {
    const names = this.bands
    try {
      const { bands } = await this.workers.run('bands', { node: node.data, bands: names })
      // Others may have been chosen meanwhile, or the node dropped.
      if (names !== this.bands || node.state !== 'ready') return
      this.onBands(names, bands)
      node.points.geometry.setAttribute('bands', uploaded(bands, 3))
      this.onChange()
    } catch (error) {
      this.#fail(error)
    }
  }

  /** Keeps the workers busy. Not only with each frame: frames may be slow. */
  #loadWanted() {
    while (!this.#isStopped && this.#wanted.length > 0 && this.workers.nFree > 0) this.#load(this.#wanted.shift())
  }

  async #load(node) {
    node.state = 'loading'
    this.nLoading++
    const bands = this.bands
    try {
      const center = node.center.map((value, axis) => value + this.cloud.origin[axis])
      const arrays = await this.workers.run('load', { node: node.data, center, bands })
      this.onFirst?.(node, arrays)
      if (arrays.bands) this.onBands(bands, arrays.bands)
      this.onFirst = null
      this.#add(node, arrays)
      if (bands !== this.bands) this.#loadBands(node)
    } catch (error) {
      node.failures = (node.failures ?? 0) + 1
      node.state = node.failures > RETRIES ? 'failed' : 'absent'
      this.#fail(error)
    }
    this.nLoading--
    this.#loadWanted()
    this.onChange()
  }

  #add(node, { positions, colors, marks, instances, times, bands, classCounts, materialCounts }) {
    const geometry = new BufferGeometry()
    geometry.setAttribute('position', uploaded(positions, 3))
    geometry.setAttribute('color', uploaded(colors, 4, true))
    geometry.setAttribute('marks', uploaded(marks, 4, true))
    geometry.setAttribute('instance', uploaded(instances, 1))
    geometry.setAttribute('time', uploaded(times, 1))
    if (bands) geometry.setAttribute('bands', uploaded(bands, 3))
    const points = new Points(geometry, this.material)
    points.position.set(...node.center)
    points.frustumCulled = false
    points.visible = false
    points.userData.firstPoint = 0
    // Read by the picking material alone, which all nodes share.
    points.onBeforeRender = (renderer, scene, camera, geometry, material) => {
      if (!material.defines || !('PICKS' in material.defines)) return
      material.uniforms.firstPoint.value = points.userData.firstPoint
      material.uniformsNeedUpdate = true
    }
    node.points = points
    node.state = 'ready'
    this.group.add(points)
    if (!node.wasCounted) {
      classCounts.forEach((n, id) => { this.classCounts[id] += n })
      materialCounts.forEach((n, id) => { this.materialCounts[id] += n })
    }
    node.wasCounted = true
    this.#ready.add(node)
    this.nLoaded += node.nPoints
    this.nDecoded += node.nPoints
  }

  /** Frees the nodes that were not shown for the longest time. */
  #dropUnused() {
    const limit = this.budget * (1 + KEPT_SHARE)
    if (this.nLoaded <= limit) return
    const unused = [...this.#ready].filter((node) => node.lastUse < this.#visits).sort((a, b) => a.lastUse - b.lastUse || b.level - a.level)
    for (const node of unused) {
      if (this.nLoaded <= limit) break
      this.group.remove(node.points)
      node.points.geometry.dispose()
      node.points = null
      node.state = 'absent'
      this.#ready.delete(node)
      this.nLoaded -= node.nPoints
    }
  }

  #fail(error) {
    if (this.#isStopped) return
    this.error = error.message
    console.error(error.message)
    this.onChange()
  }
}

/** An attribute whose array is freed once the graphics card has it. */
function uploaded(array, size, isNormalized = false) {
  const attribute = new BufferAttribute(array, size, isNormalized)
  attribute.onUpload(function free() { this.array = null })
  return attribute
}
