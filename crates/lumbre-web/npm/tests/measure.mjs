// How fast the package is beside the program, on one thread, in time of the processor: node tests/measure.mjs [RUNS]. LUMBRE is the
// program, PACKAGE the folder of the package. Runs alternate, and the least time of each counts.
import { spawnSync } from "node:child_process";
import { mkdtempSync, readFileSync, readdirSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { dirname, join, resolve } from "node:path";
import { fileURLToPath, pathToFileURL } from "node:url";

const root = join(dirname(fileURLToPath(import.meta.url)), "../../../..");
const program = process.env.LUMBRE ?? join(root, "target/release/lumbre");
const folder = resolve(process.env.PACKAGE ?? join(root, "target/web/npm"));
const { Lumbre } = await import(pathToFileURL(join(folder, "dist/index.js")));
const runs = Number(process.argv[2] ?? 3);
const [width, height, spp] = [192, 144, 8];
const temporary = mkdtempSync(join(tmpdir(), "lumbre-measure-"));

const cpu = () => {
  const { user, system } = process.cpuUsage();
  return (user + system) / 1e6;
};
const bytes = readFileSync(join(folder, "dist/lumbre.wasm"));
let start = performance.now();
const module = await WebAssembly.compile(bytes);
console.log(`compiled in ${(performance.now() - start).toFixed(0)} ms`);
start = performance.now();
const lumbre = await Lumbre.load(module);
console.log(`started in ${(performance.now() - start).toFixed(0)} ms`);

/** Seconds of the processor between a picture of many samples and one of a single sample, which leaves reading and building out. */
function native(path, simd) {
  const once = (count) => {
    const words = ["render", path, "--size", `${width}x${height}`, "--spp", String(count), "--threads", "1", "-q", "-o", join(temporary, "a.exr")];
    const times = spawnSync("/usr/bin/time", ["-f", "%U %S", program, ...words], { encoding: "utf8", env: { ...process.env, LUMBRE_SIMD: simd } });
    const [user, system] = times.stderr.trim().split("\n").at(-1).split(" ").map(Number);
    return user + system;
  };
  return once(1 + spp) - once(1);
}

function wasm(files, name) {
  const once = (count) => {
    const before = cpu();
    const scene = lumbre.open(files, name, { size: [width, height], spp: count });
    const opened = cpu();
    scene.step(1);
    const first = cpu();
    while (!scene.step(1e6).done);
    const done = cpu();
    scene.close();
    return { render: done - opened, first: first - before };
  };
  const [more, one] = [once(1 + spp), once(1)];
  return { seconds: more.render - one.render, first: Math.min(more.first, one.first) };
}

const paths = width * height * spp;
const million = (seconds) => (paths / seconds / 1e6).toFixed(3);
console.log("| scene | first pixels, s | wasm, million paths a second | native, scalar | native, best |\n|---|---|---|---|---|");
for (const name of readdirSync(join(root, "scenes")).sort()) {
  const place = join(root, "scenes", name);
  const files = {};
  for (const entry of readdirSync(place, { recursive: true, withFileTypes: true })) {
    const path = join(entry.parentPath, entry.name);
    if (entry.isFile()) files[path.slice(place.length + 1)] = new Uint8Array(readFileSync(path));
  }
  const main = `${name}.pbrt`;
  if (!files[main]) continue;
  let [a, b, c, first] = [Infinity, Infinity, Infinity, Infinity];
  for (let i = 0; i < runs; i++) {
    const found = wasm(files, main);
    [a, first] = [Math.min(a, found.seconds), Math.min(first, found.first)];
    b = Math.min(b, native(join(place, main), "scalar"));
    c = Math.min(c, native(join(place, main), ""));
  }
  console.log(`| ${name} | ${first.toFixed(2)} | ${million(a)} | ${million(b)} | ${million(c)} |`);
}
rmSync(temporary, { recursive: true, force: true });
