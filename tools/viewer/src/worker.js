// Loads and decompresses nodes.

import createLazPerf from '../node_modules/laz-perf/lib/worker/laz-perf.js'
import { attributesOf, bandsOfRecords } from './attributes.js'
import { fetchRange } from './fetch_range.js'

const lazPerf = createLazPerf({ locateFile: (file) => new URL(file, self.location.href).href })
let cloud

/** The records of a node. */
async function recordsOf({ offset, nBytes, nPoints }) {
  if (!cloud.isCompressed) return fetchRange(cloud.url, offset, offset + nBytes)
  const [compressed, laz] = await Promise.all([fetchRange(cloud.url, offset, offset + nBytes), lazPerf])
  const { format, nBytes: recordBytes } = cloud.layout
  const decoder = new laz.ChunkDecoder()
  const [input, output] = [laz._malloc(nBytes), laz._malloc(nPoints * recordBytes)]
  try {
    laz.HEAPU8.set(compressed, input)
    decoder.open(format, recordBytes, input)
    for (let i = 0; i < nPoints; i++) decoder.getPoint(output + i * recordBytes)
    return laz.HEAPU8.slice(output, output + nPoints * recordBytes)
  } finally {
    laz._free(input)
    laz._free(output)
    decoder.delete()
  }
}

const tasks = {
  open(task) {
    cloud = task
  },
  /** Arrays of a node, with the bands that are shown. */
  async load({ node, center, bands }) {
    const records = await recordsOf(node)
    const arrays = attributesOf(cloud.layout, records, { center, begin: cloud.begin })
    if (bands.length > 0) arrays.bands = bandsOfRecords(cloud.layout, records, bands)
    return arrays
  },
  async bands({ node, bands }) {
    return { bands: bandsOfRecords(cloud.layout, await recordsOf(node), bands) }
  },
  /** One record, as it is in the file. */
  async record({ node, index }) {
    const records = await recordsOf(node)
    return { record: records.slice(index * cloud.layout.nBytes, (index + 1) * cloud.layout.nBytes) }
  },
}

self.onmessage = async ({ data: { id, kind, task } }) => {
  try {
    const result = await tasks[kind](task) ?? {}
    self.postMessage({ id, result }, Object.values(result).map((array) => array.buffer))
  } catch (error) {
    self.postMessage({ id, error: String(error.message ?? error) })
  }
}
