// The view in the hash of the address, so that a link shows the same again.

const DIGITS = 3

/** State as a hash: positions are coordinates of the file. */
export function hashFromState({ eye, target, mode, hidden, bands, range }) {
  const numbers = (values) => values.map((value) => Number(value.toFixed(DIGITS))).join(',')
  const parts = [`eye=${numbers(eye)}`, `target=${numbers(target)}`, `mode=${mode}`]
  if (hidden.length > 0) parts.push(`hidden=${hidden.join(',')}`)
  if (bands.length > 0) parts.push(`bands=${bands.join(',')}`)
  if (range) parts.push(`range=${numbers(range)}`)
  return `#${parts.join('&')}`
}

/** The parts of a hash that are valid; others are absent. */
export function stateFromHash(hash) {
  const parts = new Map(hash.replace(/^#/, '').split('&').map((part) => part.split('=')))
  const numbers = (name, n) => {
    const text = parts.get(name)
    const values = text ? text.split(',').map(Number) : []
    return values.length > 0 && values.every(Number.isFinite) && (n === undefined || values.length === n) ? values : undefined
  }
  return {
    eye: numbers('eye', 3), target: numbers('target', 3), mode: parts.get('mode'), hidden: numbers('hidden'),
    bands: parts.get('bands')?.split(','), range: numbers('range', 2),
  }
}
