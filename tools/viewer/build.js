// Builds dist/ from src/ and packages. `--check` builds into memory instead and fails if dist/ differs.
import { build } from 'esbuild'
import { mkdirSync, readFileSync, writeFileSync } from 'node:fs'
import { fileURLToPath } from 'node:url'

const here = (path) => fileURLToPath(new URL(path, import.meta.url))
const PACKAGES = ['three', 'copc', 'laz-perf']

const result = await build({
  entryPoints: { viewer: here('src/main.js'), worker: here('src/worker.js') },
  outdir: here('dist'),
  bundle: true,
  minify: true,
  format: 'iife',
  target: 'es2022',
  legalComments: 'none',
  write: false,
  logLevel: 'warning',
  alias: {
    // `copc` imports these for what is not used here: it reads through our own fetch, and workers decompress.
    'cross-fetch': here('src/absent.js'),
    'laz-perf': here('src/absent.js'),
  },
})

const license = (name) => {
  const { version, license } = JSON.parse(readFileSync(here(`node_modules/${name}/package.json`)))
  const files = ['LICENSE', 'license', 'LICENSE.md']
  const text = files.map((file) => { try { return readFileSync(here(`node_modules/${name}/${file}`), 'utf8') } catch { return null } })
  // The package of laz-perf has no copy of its license, Apache-2.0.
  return `${name} ${version}, ${license}\n\n${text.find(Boolean) ?? readFileSync(here('../../LICENSE-APACHE'), 'utf8')}`
}

const files = new Map(result.outputFiles.map((file) => [file.path.split('/').pop(), Buffer.from(file.contents)]))
files.set('laz-perf.wasm', readFileSync(here('node_modules/laz-perf/lib/worker/laz-perf.wasm')))
files.set('licenses.txt', Buffer.from(PACKAGES.map(license).join('\n\n')))

let differs = false
mkdirSync(here('dist'), { recursive: true })
for (const [name, content] of files) {
  if (process.argv.includes('--check')) {
    let found
    try { found = readFileSync(here(`dist/${name}`)) } catch { found = Buffer.alloc(0) }
    if (!found.equals(content)) {
      console.error(`dist/${name} is not what src/ builds to: run \`npm run build\``)
      differs = true
    }
  } else {
    writeFileSync(here(`dist/${name}`), content)
    console.log(`dist/${name}: ${content.length} bytes`)
  }
}
process.exit(differs ? 1 : 0)
