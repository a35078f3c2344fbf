// What the tests in a browser share: a server of a folder, pages that say what goes wrong, and axe.
import assert from "node:assert/strict";
import { createReadStream, existsSync, readFileSync, statSync } from "node:fs";
import { createServer } from "node:http";
import { dirname, extname, join, normalize } from "node:path";
import { fileURLToPath } from "node:url";
import { chromium } from "playwright-core";

const axe = readFileSync(join(dirname(fileURLToPath(import.meta.url)), "../node_modules/axe-core/axe.min.js"), "utf8");
const TYPES = { ".html": "text/html", ".js": "text/javascript", ".css": "text/css", ".svg": "image/svg+xml", ".png": "image/png", ".wasm": "application/wasm" };
/** Milliseconds that anything may take. */
export const WAIT = 120_000;

/** Serves a folder to a browser; `wrong` takes the errors of pages, and addresses that are not of the folder. */
export async function site(folder) {
  const server = createServer((request, response) => {
    const path = join(folder, normalize(decodeURIComponent(new URL(request.url, "http://localhost").pathname)));
    const file = path.endsWith("/") ? join(path, "index.html") : path;
    if (!file.startsWith(folder) || !existsSync(file) || !statSync(file).isFile()) return response.writeHead(404).end();
    response.writeHead(200, { "content-type": TYPES[extname(file)] ?? "application/octet-stream" });
    createReadStream(file).pipe(response);
  });
  await new Promise((done) => server.listen(0, "127.0.0.1", done));
  const address = `http://127.0.0.1:${server.address().port}/`;
  const browser = await chromium.launch({ executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium", args: ["--no-sandbox"] });
  const wrong = [];
  return {
    address,
    wrong,
    /** `script` is a function with its argument, for the page to run first. */
    async open(url, { script, ...settings } = {}) {
      const context = await browser.newContext({ viewport: { width: 1280, height: 800 }, ...settings });
      const page = await context.newPage();
      if (script) await page.addInitScript(...script);
      page.setDefaultTimeout(WAIT);
      page.on("pageerror", (error) => wrong.push(error.message));
      page.on("request", (request) => {
        if (!/^(blob:|data:|file:)/.test(request.url()) && !request.url().startsWith(address)) wrong.push(request.url());
      });
      await page.goto(url);
      return page;
    },
    async close() {
      await browser.close();
      server.close();
    },
  };
}

/** Fails with what axe finds in the parts of a page that these selectors name. */
export async function finds(page, what, include = ["html"]) {
  await page.evaluate(axe);
  // Frames that run nothing are looked at by themselves.
  const { violations } = await page.evaluate(
    (include) => axe.run({ include }, { iframes: false, runOnly: ["wcag2a", "wcag2aa", "wcag21aa", "best-practice"] }),
    include.map((selector) => [selector]),
  );
  const told = violations.map(({ id, nodes }) => `${id}: ${nodes.map((node) => node.html.slice(0, 300)).join(" ")}`);
  assert.deepEqual(told, [], `axe finds something in ${what}`);
}

/** Runs tests by their names, those alone that contain `only`. */
export async function all(tests, wrong, only) {
  for (const [name, test] of Object.entries(tests)) {
    if (only && !name.includes(only)) continue;
    const start = performance.now();
    await test();
    assert.deepEqual(wrong, [], name);
    console.log(`ok ${name} (${((performance.now() - start) / 1000).toFixed(1)} s)`);
  }
}

/** The word after `--pictures`, and that which is no option. */
export function asked(words) {
  const at = words.indexOf("--pictures");
  return { pictures: at < 0 ? undefined : words[at + 1], only: words.find((word, i) => !word.startsWith("--") && (at < 0 || i !== at + 1)) };
}
