// The picture of a camera, with the points over it.

import { element } from './elements.js'

export class ImageViewer {
  #shown = 0

  constructor(images) {
    this.images = images
    element('imageClose').onclick = () => { element('image').hidden = true }
    element('imageBefore').onclick = () => this.#step(-1)
    element('imageAfter').onclick = () => this.#step(1)
  }

  show(number) {
    this.#shown = number
    const { file, camera } = this.images[number]
    const figure = element('image')
    const picture = figure.querySelector('img')
    const caption = figure.querySelector('figcaption')
    caption.textContent = `${camera}: loading`
    picture.onload = () => { caption.textContent = `${camera}: points of one revolution by distance, red near, blue far` }
    picture.onerror = () => { caption.textContent = `${camera}: no points in the image, or the image cannot be read` }
    picture.src = file
    figure.hidden = false
  }

  /** The image before or after of the same camera. */
  #step(sign) {
    const { camera } = this.images[this.#shown]
    for (let k = this.#shown + sign; this.images[k]; k += sign) {
      if (this.images[k].camera === camera) return this.show(k)
    }
    return undefined
  }
}
