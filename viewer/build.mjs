// Bundles the programs of the pages into the Python package; `--check` only says whether the committed bundles are current.
import { readFile, writeFile } from "node:fs/promises";
import { fileURLToPath } from "node:url";
import { build } from "esbuild";

const here = (path) => fileURLToPath(new URL(path, import.meta.url));
// Every page carries three.js, so every page carries its licence.
const licence = (await readFile(here("node_modules/three/LICENSE"), "utf8")).trim();
const programs = [
  ["main", "show/viewer/assets/viewer.js", `Carom's viewer, Apache-2.0. Contains three.js:\n\n${licence}\n`],
  ["play", "play/assets/play.js", "The page of carom play, Apache-2.0. "],
];

for (const [source, file, notice] of programs) {
  const target = here(`../python/carom/${file}`);
  const result = await build({
    entryPoints: [here(`src/${source}.ts`)],
    bundle: true,
    minify: true,
    format: "iife",
    target: "es2022",
    charset: "ascii",
    legalComments: "none",
    banner: { js: `/*! ${notice}*/` },
    write: false,
    logLevel: "warning",
  });
  const bundle = result.outputFiles[0].text;
  if (process.argv.includes("--check")) {
    const committed = await readFile(target, "utf8").catch(() => "");
    if (committed !== bundle) {
      console.error(`${file} is not what the source makes: run \`npm run build\` and commit it`);
      process.exit(1);
    }
  } else {
    await writeFile(target, bundle);
  }
  console.log(`${file}: ${(bundle.length / 1000).toFixed(0)} kB`);
}
