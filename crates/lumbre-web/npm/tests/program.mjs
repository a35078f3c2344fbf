// The package as a program for `cargo xtask bytes --with "wasm32=node crates/lumbre-web/npm/tests/program.mjs"`: render to a .pfm, cast,
// explain and math, with the options that the table of hashes uses. What the package does not have ends with status 69.
import { readFileSync, readdirSync, writeFileSync } from "node:fs";
import { dirname, join, resolve } from "node:path";
import { fileURLToPath, pathToFileURL } from "node:url";

const UNAVAILABLE = 69;
const root = join(dirname(fileURLToPath(import.meta.url)), "../../../..");
const folder = resolve(process.env.PACKAGE ?? join(root, "target/web/npm"));
const { Lumbre, LumbreError } = await import(pathToFileURL(join(folder, "dist/index.js")));

const [command, ...words] = process.argv.slice(2);
const FLAGS = ["quiet", "json"];
const options = {};
const named = [];
for (let i = 0; i < words.length; i++) {
  if (words[i] === "-o") options.output = words[++i];
  else if (!words[i].startsWith("--")) named.push(words[i]);
  else if (FLAGS.includes(words[i].slice(2))) options[words[i].slice(2)] = true;
  else options[words[i].slice(2)] = words[++i];
}

/** Ends where an option is none of these: what it asks for would be left out in silence. */
function only(...known) {
  const other = Object.keys(options).find((name) => !known.includes(name));
  if (other) leave(`--${other}`);
}
function leave(what) {
  console.error(`the package has no ${what}`);
  process.exit(UNAVAILABLE);
}

/** The scene with all that lies in its folder, by the names that the program has for them. */
function open(lumbre, path, wanted) {
  const place = dirname(path);
  const files = {};
  for (const entry of readdirSync(place, { recursive: true, withFileTypes: true })) {
    const file = join(entry.parentPath, entry.name);
    if (entry.isFile()) files[file] = new Uint8Array(readFileSync(file));
  }
  return lumbre.open(files, path, wanted);
}

function pfm({ width, height }, light) {
  const head = Buffer.from(`PF\n${width} ${height}\n-1.0\n`);
  const rows = [];
  for (let y = height - 1; y >= 0; y--) rows.push(Buffer.from(light.slice(3 * width * y, 3 * width * (y + 1)).buffer));
  return Buffer.concat([head, ...rows]);
}

function run(lumbre) {
  switch (command) {
    case "render": {
      only("size", "spp", "integrator", "denoise", "quiet", "output");
      if (!options.output.endsWith(".pfm")) leave(options.output);
      const { size, spp, integrator } = options;
      const scene = open(lumbre, named[0], { size: size.split("x").map(Number), spp: Number(spp), integrator });
      if (options.denoise && !scene.isDivisible) leave(`--denoise ${options.denoise}`);
      while (!scene.step(60_000).done);
      writeFileSync(options.output, pfm(scene, scene.light()));
      return;
    }
    case "cast": {
      only("rays", "points", "query", "quiet");
      const list = readFileSync(options.rays ?? options.points);
      process.stdout.write(open(lumbre, named[0]).cast(new Uint8Array(list), options.query));
      return;
    }
    case "explain": {
      only("pixel", "depth", "format");
      const pixel = options.pixel.split(",").map(Number);
      process.stdout.write(open(lumbre, named[0]).explain({ pixel, depth: Number(options.depth), format: options.format }));
      return;
    }
    case "math": {
      only("json");
      process.stdout.write(lumbre.math(named[0], { json: options.json === true }));
      return;
    }
    default:
      leave(command);
  }
}

const lumbre = await Lumbre.load(readFileSync(join(folder, "dist/lumbre.wasm")));
try {
  run(lumbre);
} catch (error) {
  if (!(error instanceof LumbreError)) throw error;
  console.error(`error: ${error.message}`);
  process.exitCode = 1;
}
