// All fields of a point, its object and its spectrum.

import { element, escaped, grouped } from './elements.js'
import { recordFields, spectrumOf } from './record.js'
import { nearestMaterials, spectrumPlot } from './spectrum_plot.js'

/** Shows a record. Returns the position of its point in the coordinates of the file. */
export function showPoint(record, layout, scene, { classes, materials }) {
  const { position, fields } = recordFields(layout, record)
  const text = ([name, value]) => {
    if (value === null) return 'none'
    const table = { class: classes, material: materials }[name]
    if (table) return `${value} ${table[value]?.name ?? ''}`
    if (typeof value !== 'number' || Number.isInteger(value)) return value
    return value.toFixed(name === 'GPS time, s' ? 6 : 3)
  }
  const rows = fields.map((field) => `<tr><td>${escaped(field[0])}</td><td>${escaped(text(field))}</td></tr>`)
  const parts = [`<h2>Point</h2><table>${rows.join('')}</table>`]
  if (scene.coordinates) parts.push(`<p>${escaped(scene.coordinates)}</p>`)
  const instance = fields.find(([name]) => name === 'instance')?.[1]
  const object = instance ? scene.objects.find(({ id }) => id === instance) : undefined
  if (object) parts.push(objectText(object))
  const spectrum = spectrumOf(layout, record)
  if (spectrum.length > 1) parts.push(spectrumPlot(spectrum, nearestMaterials(spectrum, scene.materials), escaped))
  const panel = element('point')
  panel.innerHTML = parts.join('')
  panel.hidden = false
  return position
}

function objectText({ id, class: name, n_points: nPoints, corners }) {
  const length = (a, b) => Math.hypot(...corners[a].map((value, axis) => value - corners[b][axis])).toFixed(2)
  return `<p>Object ${id}: ${escaped(name)}, ${grouped(nPoints)} points, ${length(0, 1)} × ${length(1, 2)} × ${length(0, 4)} m</p>`
}
