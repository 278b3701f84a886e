// Bundles the page into the Python package: node build.mjs [FOLDER].
import { copyFile, mkdir, readFile, writeFile } from "node:fs/promises";
import { build } from "esbuild";

const folder = process.argv[2] ?? "../robotd_page/bundle";

await mkdir(folder, { recursive: true });
await build({
  entryPoints: ["src/page.ts", "src/page.css"],
  outdir: folder,
  bundle: true,
  minify: true,
  legalComments: "none", // the licences are in a file
  target: "es2022",
  logLevel: "warning",
});
for (const name of ["index.html", "favicon.svg"]) await copyFile(`src/${name}`, `${folder}/${name}`);

// The licences of what the bundle contains; for a package without a file of it there is licenses/.
const { dependencies } = JSON.parse(await readFile("package.json", "utf8"));
const licences = Object.keys(dependencies).map(async (name) => {
  const { version, license } = JSON.parse(await readFile(`node_modules/${name}/package.json`, "utf8"));
  const title = `${name} ${version}, ${license}`;
  const own = readFile(`node_modules/${name}/LICENSE`, "utf8");
  const text = await own.catch(() => readFile(`licenses/${license}.txt`, "utf8"));
  return `${title}\n\n${text}`;
});
await writeFile(`${folder}/LICENSES.txt`, (await Promise.all(licences)).join("\n\n"));
