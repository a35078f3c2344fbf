// The page in a browser: LUMBRE is the program, CHROMIUM the browser. With --pictures, the screenshots of the docs are made anew.
import assert from "node:assert/strict";
import { spawn, execFileSync } from "node:child_process";
import { mkdtempSync, readFileSync, rmSync, writeFileSync, existsSync, mkdirSync } from "node:fs";
import { createServer } from "node:net";
import { tmpdir } from "node:os";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";
import { chromium } from "playwright-core";
import { PNG } from "pngjs";

const here = dirname(fileURLToPath(import.meta.url));
const root = join(here, "../../../..");
const program = process.env.LUMBRE ?? join(root, "target/debug/lumbre");
const executablePath = process.env.CHROMIUM ?? "/usr/bin/chromium";
const axe = readFileSync(join(here, "../node_modules/axe-core/axe.min.js"), "utf8");
const folder = mkdtempSync(join(tmpdir(), "lumbre-page-"));
const WAIT = 60_000;

const SCENE = `LookAt 1 -7 3  0 0 0.5  0 0 1
Camera "perspective" "float fov" 35
Film "rgb" "integer xresolution" 96 "integer yresolution" 64
Sampler "independent" "integer pixelsamples" 4
WorldBegin
LightSource "infinite" "rgb L" [0.5 0.6 0.7]
MakeNamedMaterial "<img src=x onerror=evil()>" "string type" "diffuse" "rgb reflectance" [0.7 0.2 0.1]
NamedMaterial "<img src=x onerror=evil()>"
Shape "sphere" "float radius" 1.25
`;

writeFileSync(join(folder, "scene.pbrt"), SCENE);

const freePort = () => new Promise((done) => {
  const server = createServer().listen(0, "127.0.0.1", () => {
    const { port } = server.address();
    server.close(() => done(port));
  });
});

/** Viewers that run: those of a test that fails are ended, too. */
const running = new Set();

/** A viewer that runs, and the address that opens it. */
async function view(...words) {
  const child = spawn(program, ["view", "--no-open", ...words], {
    stdio: ["ignore", "pipe", "inherit"], env: { ...process.env, XDG_RUNTIME_DIR: folder },
  });
  const url = await new Promise((done, failed) => {
    child.stdout.once("data", (bytes) => done(String(bytes).trim()));
    child.once("exit", (code) => failed(new Error(`the viewer ended with ${code}`)));
  });
  running.add(child);
  const ended = new Promise((done) => child.once("exit", done));
  return { url, stop: () => (child.kill("SIGINT"), ended) };
}

const browser = await chromium.launch({ executablePath, args: ["--no-sandbox"] });
const wrong = [];
async function open(url, settings = {}) {
  const context = await browser.newContext({ viewport: { width: 1280, height: 800 }, ...settings });
  const page = await context.newPage();
  page.setDefaultTimeout(WAIT);
  page.on("pageerror", (error) => wrong.push(error.message));
  page.on("console", (message) => /Content Security Policy/.test(message.text()) && wrong.push(message.text()));
  await page.goto(url);
  return page;
}
const done = (page, sequence) => page.waitForFunction(
  (wanted) => lumbreMeasured.done && (wanted === undefined || lumbreMeasured.sequence === wanted), sequence,
);
const pixels = (page) => page.evaluate(() => {
  const canvas = document.getElementById("picture");
  return [canvas.width, canvas.height, ...canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data];
});
/** Waits until the finished picture is this one, or another one. */
const becomes = (page, picture, same) => page.waitForFunction(([wanted, same]) => {
  const canvas = document.getElementById("picture");
  const now = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data;
  return lumbreMeasured.done && wanted.slice(2).every((value, i) => now[i] === value) === same;
}, [picture, same]);
const moved = (page) => page.evaluate(() => lumbreMeasured.latencies.length);
async function finds(page, what) {
  await page.evaluate(axe);
  const { violations } = await page.evaluate(() => axe.run(document, { runOnly: ["wcag2a", "wcag2aa", "wcag21aa", "best-practice"] }));
  const told = violations.map(({ id, nodes }) => `${id}: ${nodes.map((node) => node.html).join(" ")}`);
  assert.deepEqual(told, [], `axe finds something in ${what}`);
}

const tests = {
  async "it opens once and converges to the pixels that are rendered"() {
    const path = join(folder, "scene.pbrt");
    const viewer = await view(path);
    const page = await open(viewer.url);
    await done(page);
    assert.equal(new URL(page.url()).pathname, "/", "the token is gone from the address");
    const out = join(folder, "rendered.png");
    execFileSync(program, ["render", path, "-o", out, "-q"]);
    const rendered = PNG.sync.read(readFileSync(out));
    assert.deepEqual(await pixels(page), [rendered.width, rendered.height, ...rendered.data]);
    const saved = await page.evaluate(async () => [...new Uint8Array(await (await fetch("picture.png")).arrayBuffer())]);
    assert.ok(PNG.sync.read(Buffer.from(saved)).data.equals(rendered.data), "the picture that is saved is the same");
    const other = await open(viewer.url);
    assert.match(await other.textContent("body"), /open to one browser/);
    await viewer.stop();
  },

  async "it orbits by mouse, keys and touch, and comes back"() {
    const viewer = await view(join(folder, "scene.pbrt"));
    const page = await open(viewer.url, { hasTouch: true });
    await done(page);
    const before = await pixels(page);
    const box = await page.locator("#picture").boundingBox();
    const [x, y] = [box.x + box.width / 2, box.y + box.height / 2];
    let count = 0;
    const again = async (what) => {
      await page.waitForFunction((known) => lumbreMeasured.latencies.length > known, count, { timeout: WAIT });
      count = await moved(page);
      assert.ok(count > 0, what);
    };
    await page.mouse.move(x, y);
    await page.mouse.down();
    await page.mouse.move(x + 90, y + 20, { steps: 4 });
    await page.mouse.up();
    await again("drag");
    await done(page);
    assert.notDeepEqual(await pixels(page), before);
    await page.mouse.wheel(0, 240);
    await again("wheel");
    await page.keyboard.press("ArrowLeft", { delay: 80 });
    await again("arrow");
    await page.keyboard.press("w", { delay: 80 });
    await again("fly");
    const touch = await page.context().newCDPSession(page);
    const finger = (type, at) => touch.send("Input.dispatchTouchEvent", { type, touchPoints: at.map(([tx, ty], id) => ({ x: tx, y: ty, id })) });
    await finger("touchStart", [[x, y]]);
    for (let i = 1; i < 6; i++) await finger("touchMove", [[x + 12 * i, y]]);
    await finger("touchEnd", []);
    await again("finger");
    await page.click("#copy-pbrt");
    assert.match(await page.inputValue("#copied"), /^LookAt /);
    await page.click("#reset");
    await becomes(page, before, true);
    await viewer.stop();
  },

  async "it says what is there, and shows channels, exposure and numbers of pixels"() {
    const viewer = await view(join(folder, "scene.pbrt"));
    const page = await open(viewer.url);
    await done(page);
    const box = await page.locator("#picture").boundingBox();
    const [x, y] = [box.x + box.width / 2, box.y + box.height / 2];
    await page.mouse.click(x, y);
    await page.waitForSelector("#picked table");
    const told = await page.textContent("#picked");
    assert.match(told, /sphere/);
    assert.match(told, /<img src=x onerror=evil\(\)> \(diffuse\)/, "names are text");
    assert.match(told, /All 2 hits/);
    await page.mouse.move(x + 5, y + 5);
    await page.waitForFunction(() => /^\d+, \d+: /.test(document.getElementById("pixel").textContent));
    let shown = await pixels(page);
    const beauty = shown;
    const seen = new Set([JSON.stringify(shown)]);
    for (const channel of ["albedo", "normal", "depth", "uv", "variance", "ids"]) {
      await page.selectOption("#channel", channel);
      await becomes(page, shown, false);
      shown = await pixels(page);
      seen.add(JSON.stringify(shown));
    }
    assert.equal(seen.size, 7, "every channel is another picture");
    await page.selectOption("#channel", "beauty");
    await becomes(page, beauty, true);
    await page.focus("#picture");
    await page.keyboard.press("]");
    await page.waitForFunction(() => document.getElementById("exposure-value").textContent === "0.5");
    await becomes(page, beauty, false);
    for (let i = 0; i < 8; i++) await page.keyboard.press("+");
    await page.waitForFunction(() => document.getElementById("numbers").width > 1);
    await viewer.stop();
  },

  async "it edits, and the edits render the same from their file"() {
    const path = join(folder, "scene.pbrt");
    const viewer = await view(path);
    const page = await open(viewer.url);
    await done(page);
    const before = await pixels(page);
    await page.click("#edit-details > summary");
    await page.fill("#filter", "reflectance");
    await page.evaluate(() => {
      const input = document.querySelector("#parameters input");
      input.value = "#20c040";
      input.dispatchEvent(new Event("input"));
    });
    await page.waitForFunction(() => !document.getElementById("save-overlay").disabled);
    await becomes(page, before, false);
    const edited = await pixels(page);
    const [download] = await Promise.all([page.waitForEvent("download"), page.click("#save-overlay")]);
    const overlay = join(folder, "edits.txt");
    await download.saveAs(overlay);
    const out = join(folder, "edited.png");
    execFileSync(program, ["render", path, "--overlay", overlay, "-o", out, "-q"]);
    const rendered = PNG.sync.read(readFileSync(out));
    assert.deepEqual(edited, [rendered.width, rendered.height, ...rendered.data]);
    assert.equal(readFileSync(path, "utf8"), SCENE, "the scene file is as it was");
    await viewer.stop();
  },

  async "it reads a saved file again, shows an error, and survives a restart"() {
    const path = join(folder, "edited.pbrt");
    writeFileSync(path, SCENE);
    const port = String(await freePort());
    let viewer = await view("--port", port, path);
    const page = await open(viewer.url);
    await done(page);
    const before = await pixels(page);
    writeFileSync(path, SCENE.replace('"float radius" 1.25', '"float radius'));
    await page.waitForFunction(() => !document.getElementById("alert").hidden);
    assert.match(await page.textContent("#alert"), /last good picture.*edited\.pbrt:9:/s);
    assert.deepEqual(await pixels(page), before, "the last good picture stays");
    writeFileSync(path, SCENE.replace("1.25", "0.5"));
    await page.waitForFunction(() => document.getElementById("alert").hidden);
    await becomes(page, before, false);
    await viewer.stop();
    await page.waitForFunction(() => /does not answer/.test(document.getElementById("alert").textContent));
    writeFileSync(path, SCENE);
    viewer = await view("--port", port, path);
    await page.waitForFunction(() => document.getElementById("alert").hidden);
    await becomes(page, before, true);
    await viewer.stop();
  },

  async "it says what to do without a scene, and with a missing one"() {
    const viewer = await view();
    const page = await open(viewer.url);
    await page.waitForSelector("#empty:not([hidden])");
    assert.match(await page.textContent("#empty"), /Drop a \.glb here/);
    const head = Buffer.alloc(12);
    head.write("glTF");
    await page.setInputFiles("#open", { name: "broken.glb", mimeType: "model/gltf-binary", buffer: head });
    await page.waitForFunction(() => !document.getElementById("alert").hidden);
    assert.match(await page.textContent("#alert"), /dropped\.glb/);
    await viewer.stop();
    const missing = await view(join(folder, "missing.pbrt"));
    const other = await open(missing.url);
    await other.waitForFunction(() => !document.getElementById("alert").hidden);
    assert.match(await other.textContent("#alert"), /missing\.pbrt/);
    await missing.stop();
  },

  async "a page at rest opens from a file and shows the same pixels and their values"() {
    const [path, out] = [join(folder, "scene.pbrt"), join(folder, "page")];
    execFileSync(program, ["view", path, "--export", out], { stdio: "ignore" });
    const rendered = join(folder, "at-rest.png");
    execFileSync(program, ["render", path, "-o", rendered, "-q"]);
    const page = await open(`file://${out}/index.html`);
    await done(page);
    const png = PNG.sync.read(readFileSync(rendered));
    assert.deepEqual(await pixels(page), [png.width, png.height, ...png.data]);
    const box = await page.locator("#picture").boundingBox();
    await page.mouse.move(box.x + box.width / 2, box.y + box.height / 2);
    await page.waitForFunction(() => /^48, 32: 0\.\d+  0\.\d+  0\.\d+$/.test(document.getElementById("pixel").textContent));
    await page.selectOption("#channel", "normal");
    await page.waitForFunction(() => document.getElementById("channel").value === "normal");
    await becomes(page, [png.width, png.height, ...png.data], false);
    assert.equal(await page.isVisible("#pause"), false);
    await finds(page, "the page at rest");
  },

  async "axe finds nothing, light and dark, desktop and phone"() {
    for (const colorScheme of ["light", "dark"]) {
      for (const [width, height, form] of [[1280, 800, "desktop"], [390, 844, "phone"]]) {
        const pictures = ["--size", "500x350", "--spp", "6", join(root, "scenes/still-life/still-life.pbrt")];
        const viewer = await view(...(process.argv.includes("--pictures") ? pictures : [join(folder, "scene.pbrt")]));
        const page = await open(viewer.url, { colorScheme, viewport: { width, height } });
        await done(page);
        const box = await page.locator("#picture").boundingBox();
        await page.mouse.click(box.x + box.width * 0.5, box.y + box.height * 0.55);
        await page.waitForSelector("#picked table");
        for (const details of await page.$$("aside > details")) await details.evaluate((node) => (node.open = true));
        await finds(page, `${colorScheme} ${form}`);
        const wide = await page.evaluate(() => document.documentElement.scrollWidth);
        assert.ok(wide <= width, `${form}: nothing is wider than the screen`);
        if (process.argv.includes("--pictures")) {
          for (const details of (await page.$$("aside > details")).slice(3)) await details.evaluate((node) => (node.open = false));
          const folder = join(root, "docs/viewer");
          if (!existsSync(folder)) mkdirSync(folder);
          await page.screenshot({ path: join(folder, `${form}-${colorScheme}.jpg`), type: "jpeg", quality: 78 });
        }
        await page.focus("#picture");
        await page.keyboard.press("?");
        await finds(page, `help, ${colorScheme} ${form}`);
        await page.context().close();
        await viewer.stop();
      }
    }
  },
};

const only = process.argv.slice(2).find((word) => !word.startsWith("--"));
let failed = 0;
for (const [name, test] of Object.entries(tests)) {
  if (only && !name.includes(only)) continue;
  const start = performance.now();
  try {
    await test();
    console.log(`ok: ${name} (${Math.round(performance.now() - start)} ms)`);
  } catch (error) {
    failed += 1;
    console.error(`FAILED: ${name}\n${error.stack}`);
  }
  for (const child of running) child.kill("SIGINT");
  running.clear();
}
await browser.close();
rmSync(folder, { recursive: true, force: true });
if (wrong.length > 0) console.error(`the page threw: ${wrong.join("\n")}`);
process.exit(failed > 0 || wrong.length > 0 ? 1 : 0);
