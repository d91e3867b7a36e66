// Lines over the cloud: the path, boxes of objects, places of images, measured lines, the clipping box.

import { BufferGeometry, Float32BufferAttribute, LineBasicMaterial, LineSegments } from 'three'
import { Line2 } from 'three/examples/jsm/lines/Line2.js'
import { LineGeometry } from 'three/examples/jsm/lines/LineGeometry.js'
import { LineMaterial } from 'three/examples/jsm/lines/LineMaterial.js'

/** Edges of a box between its corners: four below, then the four above them. */
const BOX_EDGES = [0, 1, 1, 2, 2, 3, 3, 0, 4, 5, 5, 6, 6, 7, 7, 4, 0, 4, 1, 5, 2, 6, 3, 7]
/** Length of the drawn camera, m. */
const CAMERA_M = 0.6

/** A line of some pixels through positions, m from the origin. */
export function thickLine(positions, color, widthPx) {
  const geometry = new LineGeometry()
  geometry.setPositions(positions.flat())
  const line = new Line2(geometry, new LineMaterial({ color, linewidth: widthPx }))
  line.frustumCulled = false
  return line
}

/** Thin lines between pairs of positions, each with the color of its pair. */
export function segments(positions, colors) {
  const geometry = new BufferGeometry()
  geometry.setAttribute('position', new Float32BufferAttribute(positions.flat(), 3))
  geometry.setAttribute('color', new Float32BufferAttribute(colors.flat(), 3))
  const lines = new LineSegments(geometry, new LineBasicMaterial({ vertexColors: true }))
  lines.frustumCulled = false
  return lines
}

/** Boxes with eight corners each. */
export function boxes(corners, colors) {
  const positions = corners.flatMap((box) => BOX_EDGES.map((k) => box[k]))
  return segments(positions, colors.flatMap((color) => BOX_EDGES.map(() => color)))
}

/** The corners of an upright box. */
export const boxCorners = (low, high) => [low[2], high[2]].flatMap((z) => [[low[0], low[1], z], [high[0], low[1], z], [high[0], high[1], z], [low[0], high[1], z]])

/** A small pyramid for each image: its tip is the camera. */
export function cameraPyramids(images, color) {
  const positions = images.flatMap(({ position, ahead }) => {
    const forward = ahead.map((value, axis) => value - position[axis])
    const right = normalized([forward[1], -forward[0], 0])
    const up = cross(right, forward)
    const corner = (u, v) => position.map((value, axis) => value + CAMERA_M * (forward[axis] + 0.5 * u * right[axis] + 0.35 * v * up[axis]))
    const corners = [corner(-1, -1), corner(1, -1), corner(1, 1), corner(-1, 1)]
    return corners.flatMap((p, k) => [position, p, p, corners[(k + 1) % 4]])
  })
  return segments(positions, positions.map(() => color))
}

const cross = ([a, b, c], [x, y, z]) => [b * z - c * y, c * x - a * z, a * y - b * x]

function normalized(vector) {
  const length = Math.hypot(...vector)
  return length > 1e-6 ? vector.map((value) => value / length) : [1, 0, 0]
}
