// Camera, controls and the loop that draws when something has changed.

import { ColorManagement, LinearSRGBColorSpace, PerspectiveCamera, Scene, Vector3, WebGLRenderer } from 'three'
import { OrbitControls } from 'three/examples/jsm/controls/OrbitControls.js'
import { EyeDome } from './eye_dome.js'

// Colors are sRGB from the file to the screen.
ColorManagement.enabled = false

const BACKGROUND = 0x14171c
/** Movement of the pointer between press and release of a click, px. */
const CLICK_PX = 4

export class View {
  scene = new Scene()
  eyeDome = new EyeDome()
  /** Time from frame to frame while something moves, ms, smoothed. */
  frameMs = 0
  #isDirty = true
  /** When the frame before was drawn; null if nothing has changed since. */
  #lastFrame = null

  /** `beforeFrame` is called before each frame that is drawn. */
  constructor(canvas, radius, beforeFrame) {
    this.renderer = new WebGLRenderer({ canvas, antialias: false, powerPreference: 'high-performance' })
    this.renderer.outputColorSpace = LinearSRGBColorSpace
    this.renderer.sortObjects = false
    this.camera = new PerspectiveCamera(60, 1, 0.1, 1000)
    this.camera.up.set(0, 0, 1)
    this.radius = radius
    this.controls = new OrbitControls(this.camera, canvas)
    this.controls.zoomToCursor = true
    this.controls.maxPolarAngle = Math.PI
    this.controls.addEventListener('change', () => this.redraw())
    this.beforeFrame = beforeFrame
    new ResizeObserver(() => this.#resize()).observe(canvas)
    this.#resize()
    requestAnimationFrame((now) => this.#loop(now))
  }

  /** Pixels of an object of 1 m at a distance of 1 m. */
  get focalPx() {
    return this.renderer.domElement.height / (2 * Math.tan(this.camera.fov * Math.PI / 360))
  }

  redraw() {
    this.#isDirty = true
  }

  /** Calls `action` with the place of a click in CSS px of the canvas, its distance from the last press being small. */
  onClick(action) {
    const canvas = this.renderer.domElement
    let pressed = null
    canvas.addEventListener('pointerdown', (event) => { pressed = event.button === 0 ? [event.clientX, event.clientY] : null })
    canvas.addEventListener('pointerup', (event) => {
      if (!pressed || Math.hypot(event.clientX - pressed[0], event.clientY - pressed[1]) > CLICK_PX) return
      const { left, top } = canvas.getBoundingClientRect()
      action(event.clientX - left, event.clientY - top)
    })
  }

  /** Looks from `eye` at `target`, m from the origin of the cloud. */
  look(eye, target) {
    this.camera.position.set(...eye)
    this.controls.target.set(...target)
    this.controls.update()
    this.redraw()
  }

  /** Place on the canvas of a position, CSS px; null behind the camera. */
  placeOf([x, y, z]) {
    const p = new Vector3(x, y, z).project(this.camera)
    if (p.z > 1) return null
    const { clientWidth, clientHeight } = this.renderer.domElement
    return [(p.x + 1) / 2 * clientWidth, (1 - p.y) / 2 * clientHeight]
  }

  /** Draws now. */
  draw() {
    const { camera, controls, renderer } = this
    // The nearest and the farthest that can be seen: the depth buffer has little to spare.
    const distance = camera.position.length()
    camera.far = distance + 2 * this.radius
    camera.near = Math.max(0.05, Math.min(1, controls.getDistance() / 20), camera.far / 1e6)
    camera.updateProjectionMatrix()
    camera.updateMatrixWorld()
    this.beforeFrame()
    renderer.setClearColor(BACKGROUND, 1)
    this.eyeDome.render(renderer, this.scene, camera)
  }

  /** The colors of the whole canvas, four bytes a pixel, the lowest row first. */
  pixels() {
    this.draw()
    const gl = this.renderer.getContext()
    const [width, height] = [gl.drawingBufferWidth, gl.drawingBufferHeight]
    const bytes = new Uint8Array(width * height * 4)
    gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, bytes)
    return bytes
  }

  /** Offers the picture as a file. */
  save(name) {
    this.draw()
    this.renderer.domElement.toBlob((blob) => {
      const link = document.createElement('a')
      link.href = URL.createObjectURL(blob)
      link.download = name
      link.click()
      URL.revokeObjectURL(link.href)
    })
  }

  #loop(now) {
    if (this.#isDirty) {
      this.#isDirty = false
      // The graphics card works behind: only the next frame shows how long this one took.
      if (this.#lastFrame !== null) this.frameMs += (this.frameMs === 0 ? 1 : 0.2) * (now - this.#lastFrame - this.frameMs)
      this.#lastFrame = now
      this.draw()
    } else {
      this.#lastFrame = null
    }
    requestAnimationFrame((next) => this.#loop(next))
  }

  #resize() {
    const { clientWidth, clientHeight } = this.renderer.domElement
    this.renderer.setPixelRatio(Math.min(window.devicePixelRatio, 2))
    this.renderer.setSize(clientWidth, clientHeight, false)
    this.camera.aspect = clientWidth / Math.max(clientHeight, 1)
    this.redraw()
  }
}
