// Bytes of the cloud by range request.

/** Bytes from `begin` to before `end`. Fails if the server does not answer ranges: a whole cloud must not be loaded by accident. */
export async function fetchRange(url, begin, end) {
  const response = await fetch(url, { headers: { Range: `bytes=${begin}-${end - 1}` } })
  if (response.status === 206) return new Uint8Array(await response.arrayBuffer())
  response.body?.cancel()
  if (response.status === 200) throw new Error(`${url}: the web server does not answer byte ranges (HTTP 206)`)
  throw new Error(`${url}: HTTP status ${response.status}`)
}
