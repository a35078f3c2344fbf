// The package in Node: LUMBRE is the program that its bytes are compared with, PACKAGE the folder of the package.
import assert from "node:assert/strict";
import { execFileSync, spawnSync } from "node:child_process";
import { mkdtempSync, readFileSync, readdirSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { dirname, join, resolve } from "node:path";
import { fileURLToPath, pathToFileURL } from "node:url";
import { PNG } from "pngjs";

const here = dirname(fileURLToPath(import.meta.url));
const root = join(here, "../../../..");
const program = process.env.LUMBRE ?? join(root, "target/debug/lumbre");
const folder = resolve(process.env.PACKAGE ?? join(root, "target/web/npm"));
const { Lumbre, LumbreError } = await import(pathToFileURL(join(folder, "dist/index.js")));
const temporary = mkdtempSync(join(tmpdir(), "lumbre-web-"));

const compiled = await WebAssembly.compile(readFileSync(join(folder, "dist/lumbre.wasm")));
let lumbre = await Lumbre.load(compiled);

const native = (...words) => execFileSync(program, words, { encoding: "utf8", stdio: ["ignore", "pipe", "ignore"], maxBuffer: 1 << 28 });

/** The files of a scene of the repository, and the one to open. */
function scene(name) {
  const place = join(root, "scenes", name);
  const files = {};
  for (const entry of readdirSync(place, { recursive: true, withFileTypes: true })) {
    if (!entry.isFile()) continue;
    const path = join(entry.parentPath, entry.name);
    files[path.slice(place.length + 1)] = new Uint8Array(readFileSync(path));
  }
  const main = Object.keys(files).find((file) => file === `${name}.pbrt`) ?? Object.keys(files).find((file) => file.endsWith(".glb"));
  return { files, main, path: join(place, main) };
}

function rendered(opened) {
  let pass;
  do pass = opened.step(5000);
  while (!pass.done);
  return opened.pixels();
}

const SIZE = [48, 36];
const names = readdirSync(join(root, "scenes")).sort();

const tests = {
  "every scene of the repository has the pixels and the light of the program"() {
    for (const name of names) {
      const { files, main, path } = scene(name);
      const opened = lumbre.open(files, main, { size: SIZE, spp: 2 });
      const found = rendered(opened);
      const out = join(temporary, `${name}.png`);
      native("render", path, "--size", SIZE.join("x"), "--spp", "2", "-o", out, "-q");
      const expected = PNG.sync.read(readFileSync(out));
      assert.deepEqual([expected.width, expected.height], [opened.width, opened.height], name);
      assert.ok(Buffer.from(found).equals(expected.data), `${name}: the pixels differ`);
      const pfm = join(temporary, `${name}.pfm`);
      native("render", path, "--size", SIZE.join("x"), "--spp", "2", "-o", pfm, "-q");
      const rows = readFileSync(pfm).subarray(-12 * SIZE[0] * SIZE[1]);
      const light = Buffer.from(opened.light().buffer);
      for (let y = 0; y < SIZE[1]; y++) {
        const row = (of, at) => of.subarray(12 * SIZE[0] * at, 12 * SIZE[0] * (at + 1));
        assert.ok(row(light, y).equals(row(rows, SIZE[1] - 1 - y)), `${name}: the light of row ${y} differs`);
      }
      opened.close();
    }
  },

  "rows that modules render apart make up the picture"() {
    const { files, main } = scene("glass");
    const open = () => lumbre.open(files, main, { size: SIZE, spp: 2 });
    const whole = open();
    const expected = rendered(whole);
    whole.close();
    const parts = [[0, 10], [10, 36]].map(([from, to]) => {
      const part = open();
      assert.equal(part.isDivisible, true);
      part.limitRows(from, to);
      const pixels = rendered(part);
      assert.deepEqual(part.step(1).bounds, [0, from, SIZE[0], to]);
      part.close();
      return pixels;
    });
    assert.ok(Buffer.concat(parts).equals(Buffer.from(expected)));
    const none = open();
    assert.throws(() => none.limitRows(36, 40), LumbreError);
    none.close();
  },

  "explanations of every scene are those of the program, to the byte"() {
    for (const name of names) {
      const { files, main, path } = scene(name);
      const opened = lumbre.open(files, main, { size: SIZE });
      for (const pixel of [[24, 20], [5, 31]]) {
        for (const [format, lang] of [["json", "en"], ["html", "es"], ["text", "en"]]) {
          const expected = native("explain", path, "--size", SIZE.join("x"), "--pixel", pixel.join(","), "--format", format, "--lang", lang);
          assert.equal(opened.explain({ pixel, format, lang }), expected, `${name} ${pixel} ${format}`);
        }
      }
      opened.close();
    }
  },

  "rays are answered as by the program, to the byte"() {
    const rays = ["ox,oy,oz,dx,dy,dz"];
    for (let i = 0; i < 600; i++) {
      // Directions around a circle, some of them upwards.
      const angle = i * 0.7;
      rays.push([Math.cos(angle) * 6, Math.sin(angle) * 6, (i % 7) - 2, -Math.cos(angle) + 0.1, -Math.sin(angle), (i % 5) * 0.1 - 0.2].join(","));
    }
    const list = join(temporary, "rays.csv");
    writeFileSync(list, `${rays.join("\n")}\n`);
    let hits = 0;
    for (const name of ["csg", "glass", "shapes", "mesh"]) {
      const { files, main, path } = scene(name);
      const opened = lumbre.open(files, main);
      for (const query of ["closest", "any", "all", "count"]) {
        const found = opened.cast(new Uint8Array(readFileSync(list)), query);
        assert.equal(found, native("cast", path, "--rays", list, "--query", query, "-q"), `${name} ${query}`);
        if (query === "any") hits += found.match(/,1$/gm)?.length ?? 0;
      }
      opened.close();
    }
    assert.ok(hits > 300, `${hits} hits`);
  },

  "expressions have the steps of the program, in both languages"() {
    for (const text of ["cross([1, 2, 2], [2, -1, 2])", "T = translate([1, 2, 3]); R = rotate(z, 90); T * R * [1, 0, 0]", "angles(euler(30, 90, 10))", "help"]) {
      for (const lang of ["en", "es"]) {
        assert.equal(lumbre.math(text, { lang }), native("math", text, "--lang", lang));
        assert.equal(lumbre.math(text, { lang, json: true }), native("math", text, "--lang", lang, "--json"));
      }
    }
    const wrong = spawnSync(program, ["math", "sin(1, 2)"], { encoding: "utf8" }).stderr;
    assert.throws(() => lumbre.math("sin(1, 2)"), (error) => error instanceof LumbreError && `error: ${error.message}\n` === wrong);
  },

  "a mistake has its place, and the module goes on"() {
    assert.throws(() => lumbre.open({ "a.pbrt": 'WorldBegin\nShape "sphere" "float radius" -2\n' }, "a.pbrt"), (error) => {
      assert.equal(error.problem.kind, "input");
      assert.deepEqual([error.problem.file, error.problem.line, error.problem.column], ["a.pbrt", 2, 16]);
      return true;
    });
    const { warnings } = lumbre.open({ "a.pbrt": 'WorldBegin\nShape "spere"\n' }, "a.pbrt");
    assert.match(warnings[0], /^warning: a\.pbrt:2:1: unknown shape "spere": it is left out \(did you mean "sphere"\?\)$/);
  },

  async "every malformed file is refused with a message"() {
    const head = 'Film "rgb" "integer xresolution" 4 "integer yresolution" 3\nSampler "sobol" "integer pixelsamples" 1\nLookAt 0 -8 3 0 0 0 0 0 1\nCamera "perspective"\nWorldBegin\nLightSource "infinite"\n';
    const unescaped = (text) => {
      const bytes = [];
      const raw = Buffer.from(text);
      for (let i = 0; i < raw.length; i++) {
        if (raw[i] === 0x5c && raw[i + 1] === 0x5c) bytes.push(raw[i++]);
        else if (raw[i] === 0x5c && raw[i + 1] === 0x78) {
          bytes.push(parseInt(raw.toString("latin1", i + 2, i + 4), 16));
          i += 3;
        } else bytes.push(raw[i]);
      }
      return Uint8Array.from(bytes);
    };
    const catalogue = join(root, "crates/lumbre-cli/tests/malformed");
    let [all, refused, stopped] = [0, 0, 0];
    for (const file of readdirSync(catalogue)) {
      for (const block of readFileSync(join(catalogue, file), "utf8").split("\n=== ").slice(1)) {
        const name = block.slice(0, block.indexOf("\n"));
        let body = block.slice(name.length + 1, block.lastIndexOf("\n--- ") + 1);
        if (body.endsWith("\\\n")) body = body.slice(0, -2);
        const full = body.startsWith("@HEAD\n") ? head + body.slice(6) : body;
        const bytes = body.startsWith("@HEAD\n") ? Uint8Array.from([...Buffer.from(head), ...unescaped(body.slice(6))]) : unescaped(full);
        all++;
        try {
          const isOfRays = /\.(csv|npy)$/.test(name);
          const files = { "good.pbrt": `${head}Shape "sphere"\n`, "a.txt": "text\n", "b.txt": "text\n", [name]: bytes };
          const opened = lumbre.open(files, isOfRays ? "good.pbrt" : name, { size: [4, 3], spp: 1 });
          if (isOfRays) opened.cast(bytes);
          else rendered(opened);
          opened.close();
        } catch (error) {
          assert.ok(error instanceof LumbreError, `${name}: ${error.stack}`);
          assert.ok(error.message.length > 0, name);
          refused++;
          if (error.problem.kind === "crash") {
            // A decoder of others that gave up; a new module takes its place.
            console.log(`  ${name}: ${error.message}`);
            stopped++;
            lumbre = await Lumbre.load(compiled);
          }
        }
      }
    }
    assert.ok(all >= 270 && refused > 200, `${refused} of ${all}`);
    assert.equal(stopped, 0, `${stopped} stopped the module`);
  },

  "damaged scenes stop nothing"() {
    const text = 'LookAt 1 -7 3  0 0 0.5  0 0 1\nCamera "perspective"\nWorldBegin\nLightSource "infinite"\nShape "sphere" "float radius" 1.25\n';
    let refused = 0;
    for (let i = 0; i < text.length; i++) {
      const damaged = Buffer.from(text);
      damaged[i] ^= 0x15;
      for (const bytes of [Buffer.from(text.slice(0, i)), damaged]) {
        try {
          const opened = lumbre.open({ "a.pbrt": new Uint8Array(bytes) }, "a.pbrt", { size: [5, 3], spp: 1 });
          rendered(opened);
          opened.close();
        } catch (error) {
          assert.ok(error instanceof LumbreError && error.problem.kind !== "crash", `${i}: ${error.stack}`);
          refused++;
        }
      }
    }
    assert.ok(refused > 100, `${refused}`);
  },
};

try {
  const only = process.argv[2];
  for (const [name, test] of Object.entries(tests)) {
    if (only && !name.includes(only)) continue;
    const start = performance.now();
    await test();
    console.log(`ok ${name} (${((performance.now() - start) / 1000).toFixed(1)} s)`);
  }
} finally {
  rmSync(temporary, { recursive: true, force: true });
}
