// Where the fields lie in a LAS record of point format 6, 7 or 8, and how their values are read.

const TYPES = [null, 'u8', 'i8', 'u16', 'i16', 'u32', 'i32', 'u64', 'i64', 'f32', 'f64']
const SIZES = { u8: 1, i8: 1, u16: 2, i16: 2, u32: 4, i32: 4, u64: 8, i64: 8, f32: 4, f64: 8 }
const READERS = {
  u8: (view, at) => view.getUint8(at),
  i8: (view, at) => view.getInt8(at),
  u16: (view, at) => view.getUint16(at, true),
  i16: (view, at) => view.getInt16(at, true),
  u32: (view, at) => view.getUint32(at, true),
  i32: (view, at) => view.getInt32(at, true),
  u64: (view, at) => Number(view.getBigUint64(at, true)),
  i64: (view, at) => Number(view.getBigInt64(at, true)),
  f32: (view, at) => view.getFloat32(at, true),
  f64: (view, at) => view.getFloat64(at, true),
}
const BYTES_OF_FORMAT = { 6: 30, 7: 36, 8: 38 }
const DESCRIPTION_BYTES = 192

/**
 * Fields behind the point format, from the record `LASF_Spec` 4. (The package `copc` reads scales in the wrong byte order.)
 * A field: name, type, offset in the record, scale, shift, and the raw value that stands for no data.
 */
function extraFields(bytes, begin) {
  const fields = []
  let offset = begin
  for (let at = 0; at + DESCRIPTION_BYTES <= bytes.length; at += DESCRIPTION_BYTES) {
    const view = new DataView(bytes.buffer, bytes.byteOffset + at, DESCRIPTION_BYTES)
    const stored = new TextDecoder().decode(bytes.subarray(at + 4, at + 36)).replace(/\0.*$/s, '')
    // Deliveries name the class as Python allows it.
    const name = stored === 'class_id' ? 'class' : stored
    const type = TYPES[view.getUint8(2)]
    const options = view.getUint8(3)
    // Type 0 is bytes without meaning; types above 10 are deprecated arrays, behind which nothing can be found.
    if (type === null) { offset += options; continue }
    if (type === undefined) break
    const isFloat = type.startsWith('f')
    const noData = isFloat ? view.getFloat64(40, true) : Number(view.getBigInt64(40, true))
    fields.push({
      name, type, offset,
      scale: options & 8 ? view.getFloat64(112, true) : 1,
      shift: options & 16 ? view.getFloat64(136, true) : 0,
      noData: options & 1 ? noData : null,
    })
    offset += SIZES[type]
  }
  return fields
}

/** The layout of the records of a file: plain data, which workers receive. */
export function recordLayout(header, extraBytes) {
  const { pointDataRecordFormat: format, pointDataRecordLength: nBytes, scale, offset } = header
  const begin = BYTES_OF_FORMAT[format]
  if (begin === undefined) throw new Error(`point format ${format}: COPC files have format 6, 7 or 8`)
  const extra = extraBytes ? extraFields(extraBytes, begin).filter((field) => field.offset + SIZES[field.type] <= nBytes) : []
  return { format, nBytes, scale, offset, hasColor: format >= 7, extra }
}

/** The extra field of a name, or undefined. */
export const extraField = (layout, name) => layout.extra.find((field) => field.name === name)

/** Raw value of an extra field. */
export const rawValue = (field, view, at) => READERS[field.type](view, at + field.offset)

/** Value with its unit, or null for no data, which is NaN in fields without a declared value. */
export function fieldValue(field, view, at) {
  const raw = rawValue(field, view, at)
  return raw === field.noData || Number.isNaN(raw) ? null : raw * field.scale + field.shift
}

/** All fields of one record as [name, value]. */
export function recordFields(layout, record) {
  const view = new DataView(record.buffer, record.byteOffset, record.byteLength)
  const position = [0, 1, 2].map((axis) => view.getInt32(4 * axis, true) * layout.scale[axis] + layout.offset[axis])
  const fields = [
    ['x', position[0]], ['y', position[1]], ['z', position[2]],
    ['intensity', view.getUint16(12, true)],
    ['return', `${view.getUint8(14) & 15} of ${view.getUint8(14) >> 4}`],
    ['classification', view.getUint8(16)],
    ['scan angle, deg', view.getInt16(18, true) * 0.006],
    ['point source', view.getUint16(20, true)],
    ['GPS time, s', view.getFloat64(22, true)],
  ]
  if (layout.hasColor) {
    fields.push(['red green blue', [30, 32, 34].map((at) => view.getUint16(at, true) >> 8).join(' ')])
  }
  const extra = layout.extra.filter((field) => !isBand(field.name))
  return { position, fields: fields.concat(extra.map((field) => [field.name, fieldValue(field, view, 0)])) }
}

/** Whether a field is the reflectance of a band. */
export const isBand = (name) => /^band_\d+nm/.test(name)

/** Spectral bands by wavelength: name, wavelength in nm, field. */
export function bandsOf(layout) {
  const bands = layout.extra.filter(({ name }) => isBand(name))
  const named = bands.map((field) => ({ field, name: field.name, nm: Number(/\d+/.exec(field.name)[0]) }))
  return named.sort((a, b) => a.nm - b.nm)
}

/** Reflectances of a record as [nm, value], without those that were not measured. */
export function spectrumOf(layout, record) {
  const view = new DataView(record.buffer, record.byteOffset, record.byteLength)
  const values = bandsOf(layout).map(({ nm, field }) => [nm, fieldValue(field, view, 0)])
  return values.filter(([, value]) => value !== null)
}
