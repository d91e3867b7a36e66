// The page of `replica view`: a cloud (points.copc.laz) and what a run has beside it (scene.json).

import { Address } from './address.js'
import { CameraMoves } from './camera_moves.js'
import { ClippingBox } from './clipping_box.js'
import { Cloud } from './cloud.js'
import { Coloring } from './coloring.js'
import { element, grouped, onInput, placeAt } from './elements.js'
import { ImageViewer } from './image_viewer.js'
import { Layers } from './layers.js'
import { LiveCloud } from './live_cloud.js'
import { LivePanel } from './live_panel.js'
import { Measurement } from './measurement.js'
import { Picking } from './picking.js'
import { pointMaterial, pointUniforms } from './point_material.js'
import { PointNodes } from './point_nodes.js'
import { showPoint } from './point_panel.js'
import { View } from './view.js'
import { Workers } from './workers.js'

async function start() {
  const response = await fetch('scene.json')
  if (!response.ok) throw new Error(`scene.json: HTTP status ${response.status}`)
  const scene = await response.json()
  document.title = scene.title
  element('title').textContent = scene.title
  const url = (name) => new URL(name, location.href).href
  if (!scene.is_live) return show(await Cloud.open(url('points.copc.laz')), scene)
  const live = new LivePanel()
  const cloud = await LiveCloud.open(url('live.las'), url('live_parts.jsonl'), live)
  return live.run(cloud, show(cloud, scene))
}

function show(cloud, scene) {
  // The point that was clicked last, m from the origin.
  let marked = null
  let nClicked = 0

  const uniforms = pointUniforms()
  uniforms.heightOrigin.value = cloud.origin[2]
  const view = new View(element('canvas'), cloud.radius, beforeFrame)
  const workers = new Workers({ url: cloud.url, layout: cloud.layout, begin: cloud.begin, isCompressed: !scene.is_live })
  const nodes = new PointNodes(cloud, workers, pointMaterial(uniforms, false), {
    onChange: () => view.redraw(),
    onFirst: (node, arrays) => coloring.learnRanges(node, arrays),
    onBands: (names, values) => coloring.learnField(names, values),
  })
  view.scene.add(nodes.group)
  const coloring = new Coloring(cloud, scene, nodes, uniforms)
  const picking = new Picking(view.renderer, nodes, uniforms)
  const layers = new Layers(view, scene, cloud)
  const images = new ImageViewer(scene.images)
  const measurement = new Measurement(view)
  const clippingBox = new ClippingBox(view, uniforms)
  const cameraMoves = new CameraMoves(view, cloud, scene)
  const address = new Address(view, coloring, cloud, cameraMoves)
  coloring.onChange = () => {
    view.redraw()
    address.write()
  }

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

  /** Shows the fields of the point under a place of the canvas. Returns its position, m from the origin, or null. */
  async function showPointAt(x, y) {
    const found = picking.at(x, y, view.camera)
    view.redraw()
    if (!found) return null
    const { record } = await workers.run('record', { node: found.node.data, index: found.index })
    marked = cloud.local(showPoint(record, cloud.layout, scene, coloring))
    nClicked++
    view.redraw()
    return marked
  }

  async function click(x, y) {
    const image = layers.imageAt(x, y)
    if (image !== null) return images.show(image)
    const position = await showPointAt(x, y)
    if (position && measurement.isOn) measurement.add(position)
    return undefined
  }

  async function center(x, y) {
    const position = await showPointAt(x, y)
    if (position) cameraMoves.center(position)
  }

  const run = (action) => (x, y) => action(x, y).catch((error) => showMessage(error.message))
  view.onClick(run(click))
  element('canvas').addEventListener('dblclick', (event) => run(center)(event.offsetX, event.offsetY))
  onInput('budget', ({ valueAsNumber: millions }) => { if (millions > 0) { nodes.budget = millions * 1e6; view.redraw() } })
  onInput('size', ({ valueAsNumber }) => { uniforms.sizePx.value = valueAsNumber; view.redraw() })
  onInput('eyeDome', ({ valueAsNumber }) => { view.eyeDome.strength = valueAsNumber; view.redraw() })
  element('clipHere').onclick = () => clippingBox.moveTo(marked ?? view.controls.target.toArray())
  element('screenshot').onclick = () => view.save(`${scene.title}.png`)

  // For tests.
  window.__state = {
    cloud, nodes, view, measurement,
    get nClicked() { return nClicked },
    placeOf: (position) => view.placeOf(cloud.local(position)),
    pixels: () => view.pixels(),
  }

  /** Shows what a live cloud has grown by, and follows the vehicle. */
  function grow() {
    view.radius = cloud.radius
    coloring.grow()
    layers.setPath(cloud.path)
    if (element('follow').checked) cameraMoves.follow(cloud.path.at(-1))
    view.redraw()
  }
  if (scene.is_live) grow()
  return { grow, stop: () => nodes.stop() }
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
