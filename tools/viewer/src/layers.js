// What is drawn beside the points, each with a checkbox: the path, boxes of objects, places of images.

import { Group } from 'three'
import { boxes, cameraPyramids, thickLine } from './annotations.js'
import { element, onInput } from './elements.js'

/** A click this near to the place of an image shows it, px. */
const CLICK_PX = 10
const PATH_COLOR = 0xffd54a
const IMAGE_COLOR = [0.4, 0.9, 1]

export class Layers {
  #view
  #path = new Group()
  #images = null
  #imagePlaces

  constructor(view, scene, cloud) {
    this.#view = view
    this.setPath(scene.path.map((p) => cloud.local(p)))
    if (scene.objects.length > 0) {
      // Brighter than the points of the class, which are inside.
      const colors = new Map(scene.classes.map(({ name, color }) => [name, color.map((value) => 0.5 + value / 510)]))
      const corners = scene.objects.map((object) => object.corners.map((p) => cloud.local(p)))
      this.#add(boxes(corners, scene.objects.map(({ class: name }) => colors.get(name) ?? [1, 1, 1])), 'objects')
    }
    const images = scene.images.map(({ position, ahead }) => ({ position: cloud.local(position), ahead: cloud.local(ahead) }))
    this.#imagePlaces = images.map(({ position }) => position)
    if (images.length > 0) this.#images = this.#add(cameraPyramids(images, IMAGE_COLOR), 'images')
  }

  /** Draws the path through positions, m from the origin of the cloud, in place of the one before. */
  setPath(positions) {
    if (positions.length < 2) return
    const [before] = this.#path.children
    before?.geometry.dispose()
    this.#path.clear()
    this.#path.add(thickLine(positions, PATH_COLOR, 3))
    if (!before) this.#add(this.#path, 'path')
  }

  #add(object, checkbox) {
    const apply = () => {
      object.visible = element(checkbox).checked
      this.#view.redraw()
    }
    element(checkbox).parentElement.hidden = false
    onInput(checkbox, apply)
    apply()
    this.#view.scene.add(object)
    return object
  }

  /** Number of the image whose place is shown nearest to a place of the canvas, or null. */
  imageAt(x, y) {
    if (!this.#images?.visible) return null
    const distances = this.#imagePlaces.map((position) => {
      const place = this.#view.placeOf(position)
      return place ? Math.hypot(place[0] - x, place[1] - y) : Infinity
    })
    const nearest = distances.indexOf(Math.min(...distances))
    return distances[nearest] < CLICK_PX ? nearest : null
  }
}
