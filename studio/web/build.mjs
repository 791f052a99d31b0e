// Builds the page into ../dist, or into the folder given: node build.mjs [--out FOLDER]. The same sources give the same bytes.
// three.js is a separate file, which a change of the page does not affect. Scripts are classic, because modules do not load from
// file://.
import { build } from "esbuild";
import { cp, mkdir, readFile, readdir, writeFile } from "node:fs/promises";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";

const here = dirname(fileURLToPath(import.meta.url));
const argument = (name) => {
  const at = process.argv.indexOf(name);
  return at < 0 ? undefined : process.argv[at + 1];
};
const out = argument("--out") ?? join(here, "../dist");
const common = {
  absWorkingDir: here,
  bundle: true,
  minify: true,
  format: "iife",
  target: ["chrome110", "firefox110", "safari16"],
  charset: "utf8",
  legalComments: "none",
  write: false,
};

/** Entry with the parts of three.js that the page's sources import. */
async function threeEntry() {
  const names = new Set();
  const addons = new Map();
  for (const entry of await readdir(join(here, "src"), { recursive: true })) {
    if (!entry.endsWith(".ts")) continue;
    const text = await readFile(join(here, "src", entry), "utf8");
    for (const [, list, from] of text.matchAll(/import \{([^}]*)\} from "(three[^"]*)"/g)) {
      const used = list.split(",").map((name) => name.trim()).filter((name) => name && !name.startsWith("type "));
      if (from === "three") used.forEach((name) => names.add(name));
      else addons.set(from, used);
    }
  }
  const lines = [`export { ${[...names].sort().join(", ")} } from "three";`];
  for (const [from, used] of [...addons].sort()) lines.push(`export { ${used.join(", ")} } from "${from}";`);
  return lines.join("\n");
}

const threeFromPage = {
  name: "three from the page",
  setup(build) {
    build.onResolve({ filter: /^three(\/.*)?$/ }, () => ({ path: "three", namespace: "three" }));
    build.onLoad({ filter: /.*/, namespace: "three" }, () => ({ contents: "module.exports = globalThis.rollwalkThree" }));
  },
};

/** Workers, which the page contains as text: `engine-worker-source` is the compiled src/engine/worker.ts. */
const workerSources = {
  name: "sources of workers",
  setup({ onResolve, onLoad }) {
    onResolve({ filter: /^(engine|robot)-worker-source$/ }, ({ path }) => ({ path: path.split("-")[0], namespace: "worker" }));
    onLoad({ filter: /.*/, namespace: "worker" }, async ({ path }) => {
      const worker = await build({ ...common, entryPoints: [`src/${path}/worker.ts`] });
      return { contents: worker.outputFiles[0].text, loader: "text" };
    });
  },
};

const three = await build({
  ...common,
  stdin: { contents: await threeEntry(), resolveDir: here, sourcefile: "three.ts" },
  globalName: "rollwalkThree",
  banner: { js: "/* three.js, MIT licence, copyright 2010-2026 three.js authors: see LICENSES.txt */" },
});
const page = await build({
  ...common,
  entryPoints: ["src/main.ts"],
  plugins: [threeFromPage, workerSources],
});
const css = await build({ ...common, format: undefined, entryPoints: ["src/studio.css"] });

await mkdir(out, { recursive: true });
await writeFile(join(out, "three.js"), three.outputFiles[0].contents);
await writeFile(join(out, "studio.js"), page.outputFiles[0].contents);
await writeFile(join(out, "studio.css"), css.outputFiles[0].contents);
await cp(join(here, "src/index.html"), join(out, "index.html"));
await writeFile(
  join(out, "LICENSES.txt"),
  `The page contains three.js:\n\n${await readFile(join(here, "node_modules/three/LICENSE"), "utf8")}`,
);
for (const [name, result] of [["three.js", three], ["studio.js", page], ["studio.css", css]])
  console.log(`${name} ${result.outputFiles[0].contents.length} bytes`);
