// The file: header, fields, and the tree of its nodes.

import { Copc, Las } from 'copc'
import { selectNodes } from './detail.js'
import { fetchRange } from './fetch_range.js'
import { bandsOf, extraField, recordLayout } from './record.js'

/** A node of the octree. Positions are m from the origin of the cloud, so that 32 bits are enough. */
class Node {
  constructor(cloud, [level, ...cell]) {
    const [x, y, z] = cloud.info.cube
    const side = (cloud.info.cube[3] - x) / 2 ** level
    this.level = level
    this.cell = cell
    this.half = side / 2
    this.spacing = cloud.info.spacing / 2 ** level
    this.center = [x, y, z].map((low, axis) => low + (cell[axis] + 0.5) * side - cloud.origin[axis])
    /** Place in the file; null without points. */
    this.data = null
    /** Part of the hierarchy that must be loaded before the children are known. */
    this.page = null
    this.children = []
    /** 'absent', 'loading', 'ready' or 'failed'. */
    this.state = 'absent'
    this.points = null
    this.lastUse = 0
  }

  get nPoints() {
    return this.data?.nPoints ?? 0
  }
}

/** Names of classes from the record `LASF_Spec` 0: a number and 15 characters each. */
function classNames(bytes) {
  const names = new Map()
  for (let at = 0; at + 16 <= bytes.length; at += 16) {
    const name = new TextDecoder().decode(bytes.subarray(at + 1, at + 16)).replace(/\0.*$/s, '')
    if (name !== '') names.set(bytes[at], name)
  }
  return names
}

/** What the records of a file have, and the names of classes that it defines. */
export async function readRecords(get, header, vlrs) {
  const data = async (id) => {
    const vlr = Las.Vlr.find(vlrs, 'LASF_Spec', id)
    return vlr ? Las.Vlr.fetch(get, vlr) : null
  }
  const layout = recordLayout(header, await data(4))
  const names = await data(0)
  const has = (name) => extraField(layout, name) !== undefined
  const fields = { class: has('class'), score: has('score'), moving: has('moving'), instance: has('instance'), material: has('material'), color: layout.hasColor, bands: bandsOf(layout).length > 0 }
  return { layout, has: fields, classNames: names ? classNames(names) : new Map() }
}

/** Half the diagonal of a box, at least 1 m. */
export const radiusOf = ([low, high]) => Math.max(0.5 * Math.hypot(...high.map((value, axis) => value - low[axis])), 1)

export class Cloud {
  #get
  #nodes = new Map()

  static async open(url) {
    const get = (begin, end) => fetchRange(url, begin, end)
    const { header, info, vlrs } = await Copc.create(get)
    const cloud = new Cloud(url, get, header, info, await readRecords(get, header, vlrs))
    cloud.root = cloud.#node([0, 0, 0, 0])
    await cloud.#load(info.rootHierarchyPage)
    return cloud
  }

  constructor(url, get, header, info, { layout, has, classNames }) {
    Object.assign(this, { url, info, layout, has, classNames })
    this.#get = get
    this.nPoints = header.pointCount
    this.bounds = [header.min, header.max]
    /** What is subtracted from coordinates before they become 32 bits wide. */
    this.origin = header.min.map((low, axis) => Math.floor((low + header.max[axis]) / 2))
    this.radius = radiusOf(this.bounds)
    ;[this.begin, this.end] = info.gpsTimeRange
    this.bands = bandsOf(layout)
  }

  /** The nodes to show, and those whose children must be loaded before they are known. */
  select(camera, focalPx, budget) {
    return selectNodes(this, camera, focalPx, budget)
  }

  /** Coordinates of the file as m from the origin. */
  local(position) {
    return position.map((value, axis) => value - this.origin[axis])
  }

  /** m from the origin as coordinates of the file. */
  world(position) {
    return position.map((value, axis) => value + this.origin[axis])
  }

  /** Loads the part of the hierarchy that begins at a node. */
  async loadPage(node) {
    const page = node.page
    node.page = null
    await this.#load(page)
  }

  async #load(page) {
    const { nodes, pages } = await Copc.loadHierarchyPage(this.#get, page)
    const keyed = (entries) => Object.entries(entries).map(([key, value]) => [key.split('-').map(Number), value])
    for (const [key, { pointCount, pointDataOffset, pointDataLength }] of keyed(nodes)) {
      const node = this.#node(key)
      if (pointCount > 0) node.data = { offset: pointDataOffset, nBytes: pointDataLength, nPoints: pointCount }
    }
    for (const [key, page] of keyed(pages)) this.#node(key).page = page
  }

  /** The node of a key, made with its ancestors if it is new: files may leave out ancestors without points. */
  #node(key) {
    const name = key.join('-')
    let node = this.#nodes.get(name)
    if (!node) {
      node = new Node(this, key)
      this.#nodes.set(name, node)
      if (key[0] > 0) this.#node([key[0] - 1, ...key.slice(1).map((cell) => cell >> 1)]).children.push(node)
    }
    return node
  }
}
