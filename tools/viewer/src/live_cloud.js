// The points of a run that is not finished: a LAS file that grows by a part for each cloud that the run has written.

import { Las } from 'copc'
import { radiusOf, readRecords } from './cloud.js'
import { fetchRange } from './fetch_range.js'

const HEADER_BYTES = 375

/** A part of the file. Positions are m from the origin of the cloud. Its first points are a thinner cloud of the same place. */
class Part {
  level = 0
  page = null
  children = []
  /** 'absent', 'loading', 'ready' or 'failed'. */
  state = 'absent'
  points = null
  lastUse = 0
  /** Place in the file of the points that are loaded. */
  data = null

  constructor(cloud, { begin, n_points: nPoints, bounds: [low, high] }) {
    this.begin = begin
    this.nInFile = nPoints
    this.center = low.map((value, axis) => (value + high[axis]) / 2 - cloud.origin[axis])
  }

  get nPoints() {
    return this.data?.nPoints ?? this.nInFile
  }
}

export class LiveCloud {
  bands = []
  /** Positions of the vehicle, m from the origin. */
  path = []
  nPoints = 0
  #parts = []
  #nListBytes = 0
  #listUrl

  /** Waits for the first part. `live` tells how long the list of the parts is. */
  static async open(url, listUrl, live) {
    const get = (begin, end) => fetchRange(url, begin, end)
    await live.waitForPoints()
    const header = Las.Header.parse(await get(0, HEADER_BYTES))
    const cloud = new LiveCloud(url, listUrl, await readRecords(get, header, await Las.Vlr.walk(get, header)))
    await cloud.read(live.nListBytes)
    return cloud
  }

  constructor(url, listUrl, { layout, has, classNames }) {
    Object.assign(this, { url, layout, has, classNames })
    this.#listUrl = listUrl
  }

  /** Reads the list of the parts up to a place. Returns whether there were new ones. */
  async read(nListBytes) {
    if (nListBytes <= this.#nListBytes) return false
    const bytes = await fetchRange(this.#listUrl, this.#nListBytes, nListBytes)
    this.#nListBytes = nListBytes
    for (const line of new TextDecoder().decode(bytes).split('\n')) {
      if (line !== '') this.#add(JSON.parse(line))
    }
    return true
  }

  #add(part) {
    const { bounds: [low, high], times_s: [begin, end] } = part
    if (this.#parts.length === 0) {
      /** What is subtracted from coordinates before they become 32 bits wide. */
      this.origin = low.map((value, axis) => Math.floor((value + high[axis]) / 2))
      this.bounds = [low, high]
      ;[this.begin, this.end] = [begin, end]
    }
    this.bounds = [this.bounds[0].map((value, axis) => Math.min(value, low[axis])), this.bounds[1].map((value, axis) => Math.max(value, high[axis]))]
    this.end = Math.max(this.end, end)
    // The origin stays where it is: the farthest corner must be within twice this.
    this.radius = radiusOf(this.bounds)
    this.nPoints += part.n_points
    this.path.push(...part.path.map((position) => this.local(position)))
    this.#parts.push(new Part(this, part))
  }

  local(position) {
    return position.map((value, axis) => value - this.origin[axis])
  }

  world(position) {
    return position.map((value, axis) => value + this.origin[axis])
  }

  /** All parts, the newest first, each with the share of its points that the budget allows. */
  select(camera, focalPx, budget) {
    const share = Math.min(1, budget / this.nPoints)
    for (const part of this.#parts) {
      const nShown = Math.ceil(part.nInFile * share)
      if (part.state === 'absent') part.data = { offset: part.begin, nPoints: nShown, nBytes: nShown * this.layout.nBytes }
      part.nShown = Math.min(nShown, part.data.nPoints)
    }
    return { selected: [...this.#parts].reverse(), pages: [] }
  }
}
