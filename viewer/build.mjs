// Bundles src/main.ts into the Python package; `--check` only says whether the committed bundle is current.
import { readFile, writeFile } from "node:fs/promises";
import { fileURLToPath } from "node:url";
import { build } from "esbuild";

const here = (path) => fileURLToPath(new URL(path, import.meta.url));
const target = here("../python/carom/show/viewer/assets/viewer.js");
// Every page carries three.js, so every page carries its licence.
const licence = (await readFile(here("node_modules/three/LICENSE"), "utf8")).trim();

const result = await build({
  entryPoints: [here("src/main.ts")],
  bundle: true,
  minify: true,
  format: "iife",
  target: "es2022",
  charset: "ascii",
  legalComments: "none",
  banner: { js: `/*! Carom's viewer, Apache-2.0. Contains three.js:\n\n${licence}\n*/` },
  write: false,
  logLevel: "warning",
});
const bundle = result.outputFiles[0].text;

if (process.argv.includes("--check")) {
  const committed = await readFile(target, "utf8").catch(() => "");
  if (committed !== bundle) {
    console.error("viewer.js is not what the source makes: run `npm run build` and commit it");
    process.exit(1);
  }
} else {
  await writeFile(target, bundle);
}
console.log(`viewer.js: ${(bundle.length / 1000).toFixed(0)} kB`);
