// Builds the page to dist/, which is part of the repository; with --check, says whether it is up to date instead.
import { build } from "esbuild";
import { readFile, writeFile } from "node:fs/promises";

const script = await build({
  entryPoints: ["src/main.ts"],
  bundle: true,
  // A classic script: pages that are opened from a file load no modules.
  format: "iife",
  target: "es2022",
  legalComments: "none",
  write: false,
});
const files = { "viewer.js": script.outputFiles[0].text };
for (const name of ["index.html", "viewer.css", "icon.svg"]) {
  files[name] = await readFile(`src/${name}`, "utf8");
}
let stale = [];
for (const [name, text] of Object.entries(files)) {
  const path = `dist/${name}`;
  if (process.argv.includes("--check")) {
    const built = await readFile(path, "utf8").catch(() => "");
    if (built !== text) stale.push(path);
  } else {
    await writeFile(path, text);
  }
}
if (stale.length > 0) {
  console.error(`not up to date: ${stale.join(", ")} (npm run build)`);
  process.exit(1);
}
