// What the colors show.

import { isBand } from './record.js'

/** Modes by name: number in the shader, label, which field the file must have, and the default range of values. */
export const MODES = {
  rgb: { number: 0, label: 'RGB', needs: 'color' },
  intensity: { number: 1, label: 'intensity', range: ({ intensities }) => intensities },
  class: { number: 2, label: 'class' },
  instance: { number: 3, label: 'instance', needs: 'instance' },
  height: { number: 4, label: 'height, m', range: ({ heights }) => heights },
  time: { number: 5, label: 'time, s', range: ({ times }) => times },
  moving: { number: 6, label: 'moving', needs: 'moving' },
  score: { number: 7, label: 'score', needs: 'score', range: () => [0, 1] },
  band: { number: 8, label: 'one band', needs: 'bands', range: () => [0, 0.6] },
  bands: { number: 9, label: 'three bands', needs: 'bands', range: () => [0, 0.6] },
  material: { number: 10, label: 'material', needs: 'material' },
}

/** The modes that a cloud allows by name: those above, and one for each other field of the file, read as one band is. */
export function modesOf(cloud, scene) {
  const fixed = Object.entries(MODES).filter(([, { needs }]) => !needs || cloud.has[needs])
  const others = cloud.layout.extra.filter(({ name }) => !isBand(name) && !(name in MODES))
  return Object.fromEntries([...fixed, ...others.map(({ name }) => [name, fieldMode(name, scene)]).filter(([, mode]) => mode)])
}

/** A mode for a field: as the table of columns has it, else by a ramp of colors. Null for fields that are not shown. */
function fieldMode(name, scene) {
  const { shown = 'ramp', unit = '' } = scene.columns.find((column) => column.name === name) ?? {}
  if (shown === 'no') return null
  const label = unit === '' ? name : `${name}, ${unit}`
  if (shown === 'ids' || shown === 'names') return { number: 11, label, field: name }
  return { number: MODES.band.number, label, field: name, range: ({ fields }) => fields[name] }
}

/** Names of the classes of the ASPRS, for files without a field `class`. */
const ASPRS = ['never classified', 'unclassified', 'ground', 'low vegetation', 'medium vegetation', 'high vegetation', 'building', 'low point', 'reserved', 'water', 'rail', 'road surface', 'reserved', 'wire guard', 'wire conductor', 'transmission tower', 'wire connector', 'bridge deck', 'high noise']
const ASPRS_COLORS = { 2: [150, 110, 70], 3: [150, 190, 90], 4: [100, 160, 60], 5: [50, 120, 40], 6: [180, 80, 70], 9: [70, 130, 200], 11: [110, 110, 120] }

/** Name and sRGB color of each of 256 classes. */
export function classTable(cloud, scene) {
  return Array.from({ length: 256 }, (_, id) => {
    const own = cloud.has.class ? scene.classes.find((known) => known.id === id) : undefined
    if (own) return own
    const name = cloud.has.class ? `class ${id}` : (cloud.classNames.get(id) ?? ASPRS[id] ?? `class ${id}`)
    // Hues far apart for neighboring numbers.
    const hue = (id * 0.618034) % 1
    const wave = (shift) => Math.round(150 + 90 * Math.cos(2 * Math.PI * (hue + shift)))
    return { id, name, color: ASPRS_COLORS[id] ?? [wave(0), wave(1 / 3), wave(2 / 3)] }
  })
}

/** Name and sRGB color of each of 256 materials. */
export const materialTable = (scene) => Array.from({ length: 256 }, (_, id) =>
  scene.material_table.find((known) => known.id === id) ?? { id, name: `material ${id}`, color: [70, 72, 78] })
