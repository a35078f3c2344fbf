// Makes the package and the playground of what wasm-bindgen has left in generated/: node build.mjs FOLDER
import { build } from "esbuild";
import { execFileSync } from "node:child_process";
import { access, cp, mkdir, readFile, readdir, rm, writeFile } from "node:fs/promises";
import { dirname, join, resolve } from "node:path";
import { fileURLToPath } from "node:url";
import { brotliCompressSync, gzipSync } from "node:zlib";

const here = dirname(fileURLToPath(import.meta.url));
const root = join(here, "../../..");
const out = resolve(process.argv[2] ?? join(here, "out"));
const generated = join(here, "generated");
process.chdir(here);
/** Bytes of the module that a server with brotli sends, at most. */
const MOST = 3_000_000;

// A function, so that a module that stopped can be replaced by a new one.
const code = await readFile(join(generated, "lumbre_web.js"), "utf8");
await writeFile(join(generated, "glue.js"), `export function glue() {\n${code}\nreturn wasm_bindgen;\n}\n`);
const wasm = await readFile(join(generated, "lumbre_web_bg.wasm"));

const shared = {
  absWorkingDir: here,
  bundle: true,
  minify: true,
  target: "es2022",
  legalComments: "none",
  alias: { "lumbre-glue": join(generated, "glue.js") },
  logLevel: "warning",
};
const bundled = async (entry, format, more = {}) => {
  const { outputFiles } = await build({ ...shared, entryPoints: [entry], format, write: false, ...more });
  return outputFiles[0].text;
};

await rm(out, { recursive: true, force: true });
const dist = join(out, "npm/dist");
await mkdir(dist, { recursive: true });
const worker = await bundled("src/worker.ts", "iife");
await writeFile(join(dist, "worker.js"), worker);
await writeFile(join(dist, "index.js"), await bundled("src/index.ts", "esm"));
await writeFile(join(dist, "lumbre.wasm"), wasm);
const types = ["--declaration", "--emitDeclarationOnly", "--stripInternal", "--outDir", dist, "--rootDir", "src"];
const settings = ["--target", "es2022", "--module", "es2022", "--moduleResolution", "bundler", "--lib", "es2023,dom", "--strict"];
execFileSync("npx", ["tsc", "--ignoreConfig", ...settings, ...types, "src/glue.d.ts", "src/index.ts"], { stdio: "inherit" });
const description = JSON.parse(await readFile("package.json", "utf8"));
for (const ours of ["scripts", "devDependencies", "private"]) delete description[ours];
await writeFile(join(out, "npm/package.json"), `${JSON.stringify(description, null, 2)}\n`);
for (const name of ["README.md"]) await cp(name, join(out, "npm", name));
for (const name of ["LICENSE-APACHE", "LICENSE-MIT"]) await cp(join(root, name), join(out, "npm", name));

const playground = join(out, "playground");
await mkdir(join(playground, "examples"), { recursive: true });
const script = await bundled("playground/main.ts", "iife", { define: { WORKER: JSON.stringify(worker) } });
await writeFile(join(playground, "playground.js"), script);
for (const name of ["index.html", "playground.css", "icon.svg"]) await cp(join("playground", name), join(playground, name));
await writeFile(join(playground, "lumbre.wasm"), wasm);
// A page that is opened from a file may load scripts and nothing else.
const packed = gzipSync(wasm, { level: 9 });
await writeFile(join(playground, "lumbre.wasm.js"), `lumbreWasm(${JSON.stringify(packed.toString("base64"))});\n`);
const scenes = join(root, "scenes");
for (const name of (await readdir(scenes)).sort()) {
  const folder = join(scenes, name);
  const files = {};
  for (const entry of await readdir(folder, { recursive: true, withFileTypes: true })) {
    const path = join(entry.parentPath, entry.name);
    // The pictures beside the scenes are of them, and no part of them.
    if (!entry.isFile() || path === join(folder, `${name}.png`)) continue;
    files[path.slice(folder.length + 1)] = (await readFile(path)).toString("base64");
  }
  if (!files[`${name}.pbrt`]) continue;
  const example = `lumbreExample(${JSON.stringify(name)}, ${JSON.stringify(files)});\n`;
  await writeFile(join(playground, "examples", `${name}.js`), example);
}

// The live parts of the book: what pages load beside the playground, of which they use the module.
const live = join(out, "live");
await mkdir(join(live, "files"), { recursive: true });
await writeFile(join(live, "live.js"), await bundled("book/live.ts", "iife", { define: { WORKER: JSON.stringify(worker) } }));
await cp("book/live.css", join(live, "live.css"));
const pages = join(root, "docs");
const texts = {};
const others = [];
for (const entry of await readdir(pages, { recursive: true, withFileTypes: true })) {
  const path = join(entry.parentPath, entry.name);
  const name = path.slice(pages.length + 1);
  if (!entry.isFile()) continue;
  // Pictures that scenes name lie in folders of their own; the others are of the pages.
  const isNamed = /\.(pbrt|pov|csv|ply|obj|mtl|spd|txt)$/.test(name) && !name.startsWith("measurements/");
  const isOther = /(^|\/)(pictures|images|textures)\/.*\.(png|exr|pfm|hdr|jpg|tga|nvdb|bsdf|glb|gltf|bin|ttf|ply)$/.test(name) && !(await isPicture(path));
  if (!isNamed && !isOther) continue;
  const bytes = await readFile(path);
  if (isNamed && bytes.length < 1 << 16 && Buffer.from(bytes.toString("utf8")).equals(bytes)) texts[name] = bytes.toString("utf8");
  else {
    others.push(name);
    await mkdir(dirname(join(live, "files", name)), { recursive: true });
    await writeFile(join(live, "files", `${name}.js`), `lumbreFile(${JSON.stringify(name)}, ${JSON.stringify(bytes.toString("base64"))});\n`);
  }
}
await writeFile(join(live, "files.js"), `lumbreTexts(${JSON.stringify(texts)}, ${JSON.stringify(others)});\n`);

/** Whether a picture is rendered of the scene beside it. */
async function isPicture(path) {
  return access(path.replace(/\.png$/, ".pbrt")).then(() => path.endsWith(".png"), () => false);
}

const kilo = (bytes) => `${Math.round(bytes / 1000)} kB`;
const brotli = brotliCompressSync(wasm).length;
console.log(`lumbre.wasm ${kilo(wasm.length)}, gzip ${kilo(packed.length)}, brotli ${kilo(brotli)}; worker.js ${kilo(Buffer.byteLength(worker))}`);
if (brotli > MOST) throw new Error(`lumbre.wasm takes ${brotli} bytes packed by brotli: more than ${MOST}`);
