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

/** The address is written when nothing has changed for this long, ms. */
const DELAY_MS = 300

/** Keeps the address up to date with the view, and the view with an address that the user enters. */
export class Address {
  #written = ''
  #timer

  constructor(view, coloring, cloud, cameraMoves) {
    Object.assign(this, { view, coloring, cloud, cameraMoves })
    window.addEventListener('hashchange', () => this.#read())
    view.controls.addEventListener('change', () => this.write())
    this.#read()
  }

  /** Writes the view into the address, a little later. */
  write() {
    clearTimeout(this.#timer)
    this.#timer = setTimeout(() => {
      const [eye, target] = [this.view.camera.position, this.view.controls.target].map((p) => this.cloud.world(p.toArray()))
      this.#written = hashFromState({ eye, target, ...this.coloring.state() })
      history.replaceState(null, '', this.#written)
    }, DELAY_MS)
  }

  #read() {
    if (location.hash === this.#written && this.#written !== '') return
    const state = stateFromHash(location.hash)
    this.coloring.restore(state)
    if (state.eye && state.target) this.view.look(this.cloud.local(state.eye), this.cloud.local(state.target))
    else this.cameraMoves.first()
  }
}
