// A pool of workers.

/** Tasks that a worker has at a time: one is decompressed while the other is loaded. */
const TASKS_PER_WORKER = 2

export class Workers {
  #workers
  #waiting = new Map()
  #nextId = 0

  /** `cloud`: what every worker must know: url, layout, begin. */
  constructor(cloud) {
    // One core draws.
    const n = Math.min(Math.max((navigator.hardwareConcurrency || 2) - 1, 1), 6)
    this.#workers = Array.from({ length: n }, () => ({ worker: new Worker('worker.js'), nTasks: 0 }))
    for (const entry of this.#workers) {
      entry.worker.onmessage = ({ data }) => this.#finish(entry, data)
      entry.worker.onerror = (event) => console.error(`worker: ${event.message}`)
      this.#post(entry, 'open', cloud)
    }
  }

  /** How many more tasks would start at once. */
  get nFree() {
    return this.#workers.reduce((sum, { nTasks }) => sum + Math.max(TASKS_PER_WORKER - nTasks, 0), 0)
  }

  /** Runs a task in the worker with the fewest. */
  run(kind, task) {
    const entry = this.#workers.reduce((best, other) => (other.nTasks < best.nTasks ? other : best))
    return this.#post(entry, kind, task)
  }

  #post(entry, kind, task) {
    const id = this.#nextId++
    entry.nTasks++
    entry.worker.postMessage({ id, kind, task })
    return new Promise((resolve, reject) => this.#waiting.set(id, { resolve, reject }))
  }

  #finish(entry, { id, result, error }) {
    const { resolve, reject } = this.#waiting.get(id)
    this.#waiting.delete(id)
    entry.nTasks--
    if (error === undefined) resolve(result)
    else reject(new Error(error))
  }
}
