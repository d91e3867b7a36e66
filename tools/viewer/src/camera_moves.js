// Views to jump to.

import { element } from './elements.js'

/** Distance from which a street is seen whole, m. */
const STREET_M = 60
/** After a double click the camera is at least so far from the point, m. */
const NEAREST_M = 5

export class CameraMoves {
  #view
  #cloud
  #path
  /** Where the vehicle was that is followed. */
  #followed = null

  constructor(view, cloud, scene) {
    this.#view = view
    this.#cloud = cloud
    this.#path = scene.path
    element('home').onclick = () => this.whole()
    element('top').onclick = () => this.#fromAbove()
  }

  /** The middle of the path; without a path the whole cloud. */
  first() {
    if (this.#path.length === 0) return this.whole()
    const middle = this.#cloud.local(this.#path[Math.floor(this.#path.length / 2)])
    return this.#lookFromSouth(middle, Math.min(this.#view.radius, STREET_M))
  }

  whole() {
    const [low, high] = this.#cloud.bounds.map((corner) => this.#cloud.local(corner))
    this.#lookFromSouth(low.map((value, axis) => (value + high[axis]) / 2), 1.5 * this.#view.radius)
  }

  /** Moves the camera as the vehicle has moved to a position since the last call. */
  follow(position) {
    const { camera, controls } = this.#view
    const from = this.#followed ?? controls.target.toArray()
    const moved = (place) => place.toArray().map((value, axis) => value + position[axis] - from[axis])
    this.#followed = position
    this.#view.look(moved(camera.position), moved(controls.target))
  }

  /** Makes a position the center of rotation, and comes nearer. */
  center(target) {
    const eye = this.#view.camera.position.toArray()
    const offset = eye.map((value, axis) => value - target[axis])
    const distance = Math.hypot(...offset)
    const share = Math.min(1, Math.max(distance / 2, NEAREST_M) / distance)
    this.#view.look(target.map((value, axis) => value + offset[axis] * share), target)
  }

  #fromAbove() {
    const target = this.#view.controls.target.toArray()
    // Not exactly above: the direction of north would be lost.
    this.#view.look([target[0], target[1] - 1e-3, target[2] + this.#view.controls.getDistance()], target)
  }

  #lookFromSouth([x, y, z], distance) {
    this.#view.look([x - 0.35 * distance, y - 0.8 * distance, z + 0.6 * distance], [x, y, z])
  }
}
