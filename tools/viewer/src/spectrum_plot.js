// The spectrum of a point beside the reference materials with the smallest spectral angle.

const N_NEAREST = 3
const [WIDTH, HEIGHT, LEFT, BOTTOM] = [300, 160, 30, 20]
const COLORS = ['#8ab4f8', '#81c995', '#fdd663']

/** Reflectance of a material at a wavelength, linear between its samples; null outside. */
function reflectanceAt({ first, step, reflectances }, nm) {
  const place = (nm - first) / step
  const k = Math.min(Math.floor(place), reflectances.length - 2)
  if (place < 0 || place > reflectances.length - 1) return null
  return reflectances[k] + (reflectances[k + 1] - reflectances[k]) * (place - k)
}

/** Spectral angle, degrees (Kruse et al., 1993): 0 if the spectra differ only by a factor. */
function spectralAngle(spectrum, material) {
  let [ab, aa, bb] = [0, 0, 0]
  for (const [nm, a] of spectrum) {
    const b = reflectanceAt(material, nm)
    if (b === null) continue
    ab += a * b
    aa += a * a
    bb += b * b
  }
  if (aa === 0 || bb === 0) return 180
  return Math.acos(Math.min(Math.max(ab / Math.sqrt(aa * bb), -1), 1)) * 180 / Math.PI
}

/** The nearest materials as { material, angle, factor }; the factor brings them to the brightness of the spectrum. */
export function nearestMaterials(spectrum, materials) {
  const matches = materials.map((material) => ({ material, angle: spectralAngle(spectrum, material) }))
  matches.sort((a, b) => a.angle - b.angle)
  return matches.slice(0, N_NEAREST).map((match) => {
    const known = spectrum.filter(([nm]) => reflectanceAt(match.material, nm) !== null)
    const sum = (value) => known.reduce((total, [nm, v]) => total + value(v, reflectanceAt(match.material, nm)), 0)
    return { ...match, factor: sum((a, b) => a * b) / Math.max(sum((a, b) => b * b), 1e-9) }
  })
}

/** An SVG element and a legend, as HTML without foreign text but the escaped names. */
export function spectrumPlot(spectrum, matches, escape) {
  const [low, high] = [spectrum[0][0], spectrum[spectrum.length - 1][0]]
  const top = Math.max(0.1, ...spectrum.map(([, value]) => value)) * 1.1
  const x = (nm) => (LEFT + (WIDTH - LEFT - 4) * (nm - low) / Math.max(high - low, 1)).toFixed(1)
  const y = (value) => ((HEIGHT - BOTTOM) * (1 - Math.max(value, 0) / top)).toFixed(1)
  const line = (points, color, width) => `<polyline points="${points.map(([nm, v]) => `${x(nm)},${y(v)}`).join(' ')}" fill="none" stroke="${color}" stroke-width="${width}"/>`
  const references = matches.map(({ material, factor }, k) => {
    const curve = spectrum.map(([nm]) => [nm, reflectanceAt(material, nm)]).filter(([, v]) => v !== null)
    return line(curve.map(([nm, v]) => [nm, v * factor]), COLORS[k], 1)
  })
  const ticks = [low, Math.round((low + high) / 2), high].map((nm) => `<text x="${x(nm)}" y="${HEIGHT - 6}" text-anchor="middle">${nm}</text>`)
  const marks = [0, top / 2, top / 1.1].map((v) => `<text x="${LEFT - 4}" y="${Number(y(v)) + 4}" text-anchor="end">${v.toFixed(2)}</text>`)
  const dots = spectrum.map(([nm, v]) => `<circle cx="${x(nm)}" cy="${y(v)}" r="1.8"/>`)
  const legend = matches.map(({ material, angle, factor }, k) => `<div><i style="background:${COLORS[k]}"></i>${escape(material.name)}, ${angle.toFixed(1)}°, × ${factor.toFixed(2)}</div>`)
  return `<svg viewBox="-6 -6 ${WIDTH + 12} ${HEIGHT + 8}" class="plot">${ticks.join('')}${marks.join('')}${references.join('')}${line(spectrum, '#fff', 1.2)}${dots.join('')}</svg>
    <div class="legend">${legend.join('')}</div><p>Reflectance by wavelength, nm. Colored: nearest reference materials by spectral angle, scaled by the factor.</p>`
}
