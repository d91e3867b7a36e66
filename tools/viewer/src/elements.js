// Elements of the page.

export const element = (id) => document.getElementById(id)

/** Calls `action` with the input whenever its value changes. */
export function onInput(id, action) {
  element(id).addEventListener('input', ({ target }) => action(target))
}

/** Moves an element to a place of the canvas, CSS px; hides it without a place. */
export function placeAt(target, place) {
  target.hidden = !place
  if (place) [target.style.left, target.style.top] = place.map((value) => `${value}px`)
}

const ENTITIES = { '&': '&amp;', '<': '&lt;', '>': '&gt;', '"': '&quot;', "'": '&#39;' }

/** Text of a file as HTML. */
export const escaped = (text) => String(text).replace(/[&<>"']/g, (letter) => ENTITIES[letter])

/** 1234567 as "1 234 567". */
export const grouped = (n) => String(Math.round(n)).replace(/\B(?=(\d{3})+$)/g, ' ')
