// Records as arrays for the graphics card: 32 bytes a point.

import { extraField, fieldValue, rawValue } from './record.js'

/** Value of a band that was not measured. */
export const NO_BAND = -1

/**
 * Arrays of `n` records:
 * - positions: m from `center`
 * - colors: red, green, blue, class
 * - marks: intensity, score, moving, all of full scale 65535; material
 * - instances, times (s after `begin`)
 * - classCounts, materialCounts: points by class and by material
 */
export function attributesOf(layout, records, { center, begin }) {
  const { nBytes, scale, offset } = layout
  const n = records.length / nBytes
  const view = new DataView(records.buffer, records.byteOffset, records.byteLength)
  const [classField, scoreField, movingField, instanceField, materialField] = ['class', 'score', 'moving', 'instance', 'material'].map((name) => extraField(layout, name))
  const positions = new Float32Array(3 * n)
  const colors = new Uint8Array(4 * n)
  const marks = new Uint16Array(4 * n)
  const instances = new Uint32Array(n)
  const times = new Float32Array(n)
  const classCounts = new Uint32Array(256)
  const materialCounts = new Uint32Array(256)
  for (let i = 0, at = 0; i < n; i++, at += nBytes) {
    for (let axis = 0; axis < 3; axis++) {
      positions[3 * i + axis] = view.getInt32(at + 4 * axis, true) * scale[axis] + offset[axis] - center[axis]
      if (layout.hasColor) colors[4 * i + axis] = view.getUint16(at + 30 + 2 * axis, true) >> 8
    }
    const id = classField ? rawValue(classField, view, at) : view.getUint8(at + 16)
    colors[4 * i + 3] = id
    classCounts[id]++
    marks[4 * i] = view.getUint16(at + 12, true)
    if (scoreField) marks[4 * i + 1] = Math.min(Math.max(fieldValue(scoreField, view, at), 0), 1) * 65535
    if (movingField && rawValue(movingField, view, at) !== 0) marks[4 * i + 2] = 65535
    if (materialField) {
      marks[4 * i + 3] = rawValue(materialField, view, at)
      materialCounts[marks[4 * i + 3]]++
    }
    if (instanceField) instances[i] = rawValue(instanceField, view, at)
    times[i] = view.getFloat64(at + 22, true) - begin
  }
  return { positions, colors, marks, instances, times, classCounts, materialCounts }
}

/** Reflectances of up to three bands (names), three numbers a point. */
export function bandsOfRecords(layout, records, names) {
  const n = records.length / layout.nBytes
  const view = new DataView(records.buffer, records.byteOffset, records.byteLength)
  const values = new Float32Array(3 * n).fill(NO_BAND)
  names.forEach((name, channel) => {
    const field = extraField(layout, name)
    if (!field) return
    for (let i = 0, at = 0; i < n; i++, at += layout.nBytes) {
      values[3 * i + channel] = fieldValue(field, view, at) ?? NO_BAND
    }
  })
  return values
}
