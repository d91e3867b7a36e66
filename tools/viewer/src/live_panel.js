// In which phase a run is, and what can be done about it.

import { element } from './elements.js'

/** Time between two questions, ms. */
const INTERVAL_MS = 700

const TEXTS = {
  waiting: 'No run is active here. Points appear when one starts.',
  running: 'The run is active. Points appear as its submaps are written.',
  moving: 'The run ends: its submaps are moved to their final poses.',
  interrupted: 'The run was interrupted. It can be resumed.',
}
const FRAME = 'The points here are as they were during the run, before the poses were corrected.'

export class LivePanel {
  /** Bytes of the list of the parts. */
  nListBytes = 0
  #run = null
  /** Whether the site of the finished run was asked for: it has no state to ask for. */
  #isEnding = false
  #stop = () => {}

  constructor() {
    element('live').hidden = false
    element('final').onclick = () => this.#showFinal()
  }

  /** Waits until there are points. */
  async waitForPoints() {
    element('status').textContent = 'no points yet'
    while (this.#isEnding || !await this.#ask()) await pause()
  }

  /** Calls `grow` whenever the cloud has grown, `stop` before its points go away. */
  async run(cloud, { grow, stop }) {
    this.#stop = stop
    while (!this.#isEnding) {
      await this.#ask()
      if (await cloud.read(this.nListBytes)) grow()
      await pause()
    }
  }

  /** Asks for the state. Returns whether there are points. */
  async #ask() {
    const response = await fetch('live.json').catch(() => null)
    if (response === null) {
      this.#tell('The viewer does not answer.', false)
      return false
    }
    // Another page has asked for the final cloud.
    if (!response.ok) return reload()
    const { phase, outcome, run, parts_bytes: nListBytes } = await response.json()
    this.#run ??= run
    // Another run has begun in the folder.
    if (run !== this.#run) return reload()
    this.nListBytes = nListBytes
    const isFinished = phase === 'finished'
    const ended = `The run has ended: ${outcome}. ${nListBytes > 0 ? FRAME : ''}`
    this.#tell(isFinished ? ended : TEXTS[phase], isFinished)
    return nListBytes > 0
  }

  #tell(text, hasFinal) {
    element('phase').textContent = text
    element('final').hidden = !hasFinal
  }

  /** Asks for the site of the finished run, and waits for it. */
  async #showFinal() {
    this.#isEnding = true
    this.#stop()
    element('final').disabled = true
    element('final').textContent = 'preparing the final cloud'
    // A question that is under way is answered before.
    await pause()
    await fetch('final.json').catch(() => null)
    for (;;) {
      const scene = await fetch('scene.json').then((response) => response.json()).catch(() => null)
      if (scene && !scene.is_live) return reload()
      await pause()
    }
  }
}

const pause = () => new Promise((resolve) => setTimeout(resolve, INTERVAL_MS))

/** Loads the page anew. Never returns: what follows belongs to the page before. */
function reload() {
  location.replace(location.pathname)
  return new Promise(() => {})
}
