// Level of detail: which nodes are shown within a budget of points.

import { Box3, Frustum, Matrix4, Vector3 } from 'three'

/** Nodes whose points would be nearer to each other than this on the screen are not worth their points, px. */
const FINEST_PX = 1.2

const box = new Box3()
const eye = new Vector3()

/**
 * The nodes to show, those with the widest spacing on the screen first. Nodes with unknown children are returned in `pages`, in order.
 */
export function selectNodes(cloud, camera, focalPx, budget) {
  const frustum = new Frustum().setFromProjectionMatrix(new Matrix4().multiplyMatrices(camera.projectionMatrix, camera.matrixWorldInverse))
  camera.getWorldPosition(eye)
  const boxOf = ({ center: [x, y, z], half }) => {
    box.min.set(x - half, y - half, z - half)
    box.max.set(x + half, y + half, z + half)
    return box
  }
  const waiting = new Heap()
  const add = (node) => {
    const bounds = boxOf(node)
    if (!frustum.intersectsBox(bounds)) return
    // Inside a node the distance is 0; its points are on average a part of its side away.
    const distance = Math.max(bounds.distanceToPoint(eye), 0.1 * node.half)
    waiting.push(node, node.spacing * focalPx / distance)
  }
  const [selected, pages] = [[], []]
  let nPoints = 0
  add(cloud.root)
  while (waiting.length > 0) {
    const { node, priority } = waiting.pop()
    if (priority < FINEST_PX || nPoints + node.nPoints > budget) break
    nPoints += node.nPoints
    if (node.data) selected.push(node)
    if (node.page) pages.push(node)
    node.children.forEach(add)
  }
  return { selected, pages }
}

/** A binary heap, the largest priority first. */
class Heap {
  #entries = []

  get length() {
    return this.#entries.length
  }

  push(node, priority) {
    const entries = this.#entries
    let i = entries.push({ node, priority }) - 1
    while (i > 0) {
      const parent = (i - 1) >> 1
      if (entries[parent].priority >= entries[i].priority) break
      ;[entries[parent], entries[i]] = [entries[i], entries[parent]]
      i = parent
    }
  }

  pop() {
    const entries = this.#entries
    const top = entries[0]
    const last = entries.pop()
    if (entries.length > 0) {
      entries[0] = last
      for (let i = 0; ;) {
        let largest = i
        for (const child of [2 * i + 1, 2 * i + 2]) {
          if (child < entries.length && entries[child].priority > entries[largest].priority) largest = child
        }
        if (largest === i) break
        ;[entries[largest], entries[i]] = [entries[i], entries[largest]]
        i = largest
      }
    }
    return top
  }
}
