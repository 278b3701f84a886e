// Bundles the page into the Python package: node build.mjs [FOLDER].
import { copyFile, mkdir } from "node:fs/promises";
import { build } from "esbuild";

const folder = process.argv[2] ?? "../core/robotd/page/bundle";

await mkdir(folder, { recursive: true });
await build({
  entryPoints: ["src/page.ts", "src/page.css"],
  outdir: folder,
  bundle: true,
  minify: true,
  legalComments: "linked",
  target: "es2022",
  logLevel: "warning",
});
for (const name of ["index.html", "favicon.svg"]) await copyFile(`src/${name}`, `${folder}/${name}`);
