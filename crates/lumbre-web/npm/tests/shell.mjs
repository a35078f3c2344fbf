// The examples of the book, as its pages run them: each prints what stands in the page, to the byte. PACKAGE is the folder of the package.
import assert from "node:assert/strict";
import { build } from "esbuild";
import { mkdtempSync, readFileSync, readdirSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { dirname, join, resolve } from "node:path";
import { fileURLToPath, pathToFileURL } from "node:url";

const here = dirname(fileURLToPath(import.meta.url));
const root = join(here, "../../../..");
const docs = join(root, "docs");
const folder = resolve(process.env.PACKAGE ?? join(root, "target/web/npm"));
const { Lumbre } = await import(pathToFileURL(join(folder, "dist/index.js")));
const lumbre = await Lumbre.load(readFileSync(join(folder, "dist/lumbre.wasm")));
const temporary = mkdtempSync(join(tmpdir(), "lumbre-shell-"));
const { outputFiles } = await build({ entryPoints: [join(here, "../book/shell.ts")], bundle: true, format: "esm", write: false });
writeFileSync(join(temporary, "shell.mjs"), outputFiles[0].text);
const { Failed, Unknown, commandsOf, isKnown, shell, shownAs } = await import(pathToFileURL(join(temporary, "shell.mjs")));

const held = new Map();
const files = {
  async read(path) {
    const text = held.get(path);
    if (text !== undefined) return text;
    try {
      return readFileSync(join(docs, path), "utf8");
    } catch {
      throw new Failed(path);
    }
  },
  write: (path, text) => void held.set(path, text),
};
/** A scene with what it names. */
function scene(path) {
  const all = {};
  const add = (name) => {
    if (name in all) return;
    let bytes;
    try {
      bytes = held.has(name) ? Buffer.from(held.get(name)) : readFileSync(join(docs, name));
    } catch {
      return;
    }
    all[name] = new Uint8Array(bytes);
    if (!/\.(pbrt|pov)$/.test(name)) return;
    for (const [, named] of bytes.toString().matchAll(/"([^"\n]*\.[^"\n]*)"/g)) add(join(dirname(name), named));
  };
  add(path);
  return all;
}
const warned = (opened, text) => opened.warnings.filter((line) => !line.includes("no light")).map((line) => `${line}\n`).join("") + text;
const program = {
  math: async (text, lang, json) => lumbre.math(text, { lang, json }),
  async explain(path, { size, ...wanted }) {
    const opened = lumbre.open(scene(path), path, size ? { size } : {});
    const text = warned(opened, opened.explain(wanted));
    opened.close();
    return text;
  },
  async cast(path, list, query) {
    const opened = lumbre.open(scene(path), path);
    const text = warned(opened, opened.cast(list, query));
    opened.close();
    return text;
  },
};

const tests = {
  async "every example of math and explain can be run, and prints what stands in the book"() {
    const counts = { run: 0, other: 0 };
    const wrong = [];
    const unknown = [];
    for (const entry of readdirSync(docs, { recursive: true, withFileTypes: true })) {
      if (!entry.isFile() || !entry.name.endsWith(".md")) continue;
      const page = join(entry.parentPath, entry.name);
      for (const [, indent, info, body] of readFileSync(page, "utf8").matchAll(/^( *)```(console\S*)\n([\s\S]*?)\n\1```$/gm)) {
        const block = body.split("\n").map((line) => line.slice(indent.length)).join("\n");
        const all = commandsOf(block);
        for (const { command, output } of all) {
          if (!isKnown(command)) {
            counts.other++;
            if (/lumbre (math|explain)/.test(command)) unknown.push(`${page}: ${command}`);
            continue;
          }
          counts.run++;
          let found;
          try {
            found = shownAs(output, await shell(command, program, files));
          } catch (error) {
            if (error instanceof Unknown) unknown.push(`${page}: ${command}: ${error.message}`);
            found = `error: ${error.message}\n`;
          }
          if (found.trimEnd() !== output.trimEnd()) wrong.push(`${page} (${info}): ${command}\n--- found\n${found}--- expected\n${output}`);
        }
      }
    }
    console.log(`  ${counts.run} commands; ${counts.other} of other programs`);
    assert.deepEqual(unknown, []);
    assert.equal(wrong.length, 0, `${wrong.length} differ:\n${wrong.slice(0, 4).join("\n")}`);
    assert.ok(counts.run > 380, `${counts.run}`);
  },

  async "quotes, pipes, files and loops are those of a shell"() {
    const echo = { math: async (text) => `${text}\n` };
    const found = (line) => shell(line, echo, files);
    assert.equal(await found(`lumbre math 'a  "b"'`), 'a  "b"\n');
    assert.equal(await found(`lumbre math "it's \\"a\\"" # fails`), `it's "a"\n`);
    assert.equal(await found("printf 'a1\\nb2\\na3\\n' | grep a | sed s/a/x/ | tail -1"), "x3\n");
    assert.equal(await found("printf 'one two\\n' | grep -o 't.*'"), "two\n");
    assert.equal(await found("printf '1\\n2\\n3\\n' | head -2 | grep -v 1"), "2\n");
    assert.equal(await found("for n in 1 20; do lumbre math $n; echo x$n; done"), "1\nx1\n20\nx20\n");
    assert.equal(await found("echo kept > b.txt; cat b.txt"), "kept\n");
    for (const line of ["rm a", "lumbre render a", "echo $HOME", "echo `a`", "lumbre math 1 && echo", "sed -n p", "lumbre math 'a"]) {
      await assert.rejects(found(line), Unknown, line);
      if (!line.includes("$") && !line.includes("sed")) assert.equal(isKnown(line), false, line);
    }
    await assert.rejects(found("cat none"), Failed);
  },
};

try {
  for (const [name, test] of Object.entries(tests)) {
    await test();
    console.log(`ok ${name}`);
  }
} finally {
  rmSync(temporary, { recursive: true, force: true });
}
