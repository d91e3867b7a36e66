// The page of `replica view`: a cloud (points.copc.laz) and what a run has beside it (scene.json).

import { hashFromState, stateFromHash } from './address.js'
import { boxes, cameraPyramids, thickLine } from './annotations.js'
import { ClippingBox } from './clipping_box.js'
import { Cloud } from './cloud.js'
import { Coloring } from './coloring.js'
import { element, grouped, onInput, placeAt } from './elements.js'
import { ImageViewer } from './image_viewer.js'
import { Measurement } from './measurement.js'
import { Picking } from './picking.js'
import { pointMaterial, pointUniforms } from './point_material.js'
import { PointNodes } from './point_nodes.js'
import { showPoint } from './point_panel.js'
import { View } from './view.js'
import { Workers } from './workers.js'

/** Distance from which a street is seen whole, m. */
const STREET_M = 60

async function start() {
  const response = await fetch('scene.json')
  if (!response.ok) throw new Error(`scene.json: HTTP status ${response.status}`)
  const scene = await response.json()
  document.title = scene.title
  element('title').textContent = scene.title
  const cloud = await Cloud.open(new URL('points.copc.laz', location.href).href)
  const { origin } = cloud
  const local = (position) => position.map((value, axis) => value - origin[axis])
  const world = (position) => position.map((value, axis) => value + origin[axis])

  let picks = 0
  // The point that was clicked last, m from the origin.
  let marked = null
  // The hash that was written last, and the timer of the next.
  let written = ''
  let timer

  const uniforms = pointUniforms()
  uniforms.heightOrigin.value = origin[2]
  const [low, high] = cloud.bounds.map(local)
  const radius = Math.max(0.5 * Math.hypot(...high.map((value, axis) => value - low[axis])), 1)
  const view = new View(element('canvas'), radius, beforeFrame)
  const workers = new Workers({ url: cloud.url, layout: cloud.layout, begin: cloud.begin })
  const nodes = new PointNodes(cloud, workers, pointMaterial(uniforms, false), {
    onChange: () => view.redraw(),
    onFirst: (node, arrays) => coloring.learnRanges(node, arrays),
  })
  view.scene.add(nodes.group)
  const coloring = new Coloring(cloud, scene, nodes, uniforms, onChange)
  const picking = new Picking(view.renderer, nodes, uniforms)
  const measurement = new Measurement(view)
  const clippingBox = new ClippingBox(view, uniforms)
  const images = new ImageViewer(scene.images)
  const layers = addLayers()

  function beforeFrame() {
    uniforms.focalPx.value = view.focalPx
    nodes.update(view.camera, view.focalPx)
    measurement.placeLabels()
    placeAt(element('marker'), marked && view.placeOf(marked))
    coloring.showLegend()
    const parts = [`${grouped(nodes.nDrawn)} of ${grouped(cloud.nPoints)} points`, `${view.frameMs.toFixed(0)} ms a frame`]
    if (nodes.nMissing > 0) parts.push(`loading ${nodes.nMissing} pieces`)
    element('status').textContent = parts.join(', ')
    if (nodes.error) showMessage(nodes.error)
  }

  function onChange() {
    view.redraw()
    rememberView()
  }

  function addLayers() {
    const layer = (object, choice, checkbox) => {
      element(choice).hidden = object === null
      if (!object) return null
      view.scene.add(object)
      const apply = () => { object.visible = element(checkbox).checked; view.redraw() }
      onInput(checkbox, apply)
      apply()
      return object
    }
    // Brighter than the points of the class, which are inside.
    const colors = new Map(scene.classes.map(({ name, color }) => [name, color.map((value) => 0.5 + value / 510)]))
    const path = scene.path.length > 1 ? thickLine(scene.path.map(local), 0xffd54a, 3) : null
    const corners = scene.objects.map((object) => object.corners.map(local))
    const objects = corners.length > 0 ? boxes(corners, scene.objects.map(({ class: name }) => colors.get(name) ?? [1, 1, 1])) : null
    const placed = scene.images.map(({ position, ahead }) => ({ position: local(position), ahead: local(ahead) }))
    const cameras = placed.length > 0 ? cameraPyramids(placed, [0.4, 0.9, 1]) : null
    return {
      path: layer(path, 'pathChoice', 'showPath'), objects: layer(objects, 'objectChoice', 'showObjects'),
      images: layer(cameras, 'imageChoice', 'showImages'), imagePlaces: placed.map(({ position }) => position),
    }
  }

  /** Looks at a position from south of it and above. */
  function lookFromSouth(target, distance) {
    view.look([target[0] - 0.35 * distance, target[1] - 0.8 * distance, target[2] + 0.6 * distance], target)
  }

  function wholeCloud() {
    lookFromSouth(low.map((value, axis) => (value + high[axis]) / 2), 1.5 * radius)
  }

  function firstView() {
    if (scene.path.length === 0) wholeCloud()
    else lookFromSouth(local(scene.path[Math.floor(scene.path.length / 2)]), Math.min(radius, STREET_M))
  }

  function fromAbove() {
    const { x, y, z } = view.controls.target
    const distance = view.controls.getDistance()
    view.look([x, y - 1e-3, z + distance], [x, y, z])
  }

  /** The point under a place of the canvas: its fields and its position. */
  async function pointAt(x, y) {
    const found = picking.at(x, y, view.camera)
    view.redraw()
    if (!found) return null
    const { record } = await workers.run('record', { node: found.node.data, index: found.index })
    return { record, layout: cloud.layout }
  }

  async function click(x, y) {
    const image = layers.images?.visible ? nearestImage(x, y) : -1
    if (image >= 0) return images.show(image)
    const found = await pointAt(x, y)
    if (!found) return undefined
    const position = showPoint(found, { scene, classes: coloring.classes })
    picks++
    if (measurement.isOn) measurement.add(local(position))
    else marked = local(position)
    view.redraw()
    return undefined
  }

  function nearestImage(x, y) {
    const distances = layers.imagePlaces.map((position) => {
      const place = view.placeOf(position)
      return place ? Math.hypot(place[0] - x, place[1] - y) : Infinity
    })
    const nearest = distances.indexOf(Math.min(...distances))
    return distances[nearest] < 10 ? nearest : -1
  }

  async function center(x, y) {
    const found = await pointAt(x, y)
    if (!found) return
    const target = local(showPoint(found, { scene, classes: coloring.classes }))
    const eye = view.camera.position.toArray()
    const distance = Math.hypot(...eye.map((value, axis) => value - target[axis]))
    const share = Math.min(1, Math.max(distance / 2, 5) / distance)
    view.look(target.map((value, axis) => value + (eye[axis] - value) * share), target)
  }

  const run = (action) => (...values) => Promise.resolve(action(...values)).catch((error) => showMessage(error.message))
  view.onClick(run(click))
  element('canvas').addEventListener('dblclick', (event) => run(center)(event.offsetX, event.offsetY))
  onInput('budget', ({ valueAsNumber: millions }) => { if (millions > 0) { nodes.budget = millions * 1e6; view.redraw() } })
  onInput('size', ({ valueAsNumber }) => { uniforms.sizePx.value = valueAsNumber; view.redraw() })
  onInput('eyeDome', ({ valueAsNumber }) => { view.eyeDome.strength = valueAsNumber; view.redraw() })
  element('home').onclick = wholeCloud
  element('top').onclick = fromAbove
  element('clipHere').onclick = () => clippingBox.moveTo(marked ?? view.controls.target.toArray())
  element('screenshot').onclick = () => {
    view.draw()
    view.renderer.domElement.toBlob((blob) => {
      const link = document.createElement('a')
      link.href = URL.createObjectURL(blob)
      link.download = `${scene.title}.png`
      link.click()
      setTimeout(() => URL.revokeObjectURL(link.href), 1000)
    })
  }

  function rememberView() {
    clearTimeout(timer)
    timer = setTimeout(() => {
      const positions = { eye: world(view.camera.position.toArray()), target: world(view.controls.target.toArray()) }
      written = hashFromState({ ...positions, ...coloring.state() })
      history.replaceState(null, '', written)
    }, 300)
  }
  function restoreView() {
    if (location.hash === written && written !== '') return
    const state = stateFromHash(location.hash)
    coloring.restore(state)
    if (state.eye && state.target) view.look(local(state.eye), local(state.target))
    else firstView()
  }
  window.addEventListener('hashchange', restoreView)
  view.controls.addEventListener('change', rememberView)
  restoreView()

  // For tests.
  window.__state = {
    cloud, nodes, coloring, view, measurement, scene,
    get picks() { return picks },
    placeOf: (position) => view.placeOf(local(position)),
    /** Colors of a square around the middle of the canvas, as four bytes a pixel. */
    pixels() {
      view.draw()
      const gl = view.renderer.getContext()
      const [width, height] = [gl.drawingBufferWidth, gl.drawingBufferHeight]
      const bytes = new Uint8Array(width * height * 4)
      gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, bytes)
      return bytes
    },
  }
}

function showMessage(text) {
  const message = element('message')
  message.textContent = text
  message.hidden = false
}

start().catch((error) => {
  showMessage(error.message)
  console.error(error)
})
