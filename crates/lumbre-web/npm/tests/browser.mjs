// The playground in a browser: LUMBRE is the program, CHROMIUM the browser, PLAYGROUND the folder of the page. With --pictures FOLDER,
// screenshots are left there.
import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { mkdtempSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { dirname, join, resolve } from "node:path";
import { fileURLToPath, pathToFileURL } from "node:url";
import { PNG } from "pngjs";
import { all, asked, finds, site } from "./site.mjs";

const here = dirname(fileURLToPath(import.meta.url));
const root = join(here, "../../../..");
const program = process.env.LUMBRE ?? join(root, "target/debug/lumbre");
const folder = resolve(process.env.PLAYGROUND ?? join(root, "target/web/playground"));
const { pictures, only } = asked(process.argv.slice(2));
const temporary = mkdtempSync(join(tmpdir(), "lumbre-playground-"));

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

const { address, wrong, open: visit, close } = await site(folder);
async function open(url = address, settings = {}) {
  const page = await visit(url, settings);
  await page.waitForFunction(() => playground.passes > 0 || playground.wrong);
  return page;
}
const finished = (page) => page.waitForFunction(() => playground.done);
const pixels = (page) => page.evaluate(() => {
  const canvas = document.getElementById("picture");
  return [canvas.width, canvas.height, ...canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data];
});
/** Writes a scene into the editor and waits until it was read, or has an error. */
async function edit(page, text) {
  const before = await page.evaluate(() => ({ ...playground }));
  await page.fill("#text", text);
  await page.waitForFunction((before) => playground.opened > before.opened || (playground.wrong && playground.wrong !== before.wrong), before);
}
/** What is explained of a pixel, as JSON. */
async function explained(page, x, y) {
  await page.selectOption("#format", "json");
  await page.fill("#x", String(x));
  await page.fill("#y", String(y));
  await page.evaluate(() => document.getElementById("answer").replaceChildren());
  await page.click("#explain");
  await page.waitForSelector("#answer pre");
  return page.evaluate(() => document.querySelector("#answer pre").textContent);
}
function native(text, ...words) {
  const path = join(temporary, "scene.pbrt");
  writeFileSync(path, text);
  return execFileSync(program, ["explain", path, ...words], { encoding: "utf8", stdio: ["ignore", "pipe", "ignore"] });
}
/** The pixels of the program. */
function picture(text) {
  const [path, out] = [join(temporary, "picture.pbrt"), join(temporary, "picture.png")];
  writeFileSync(path, text);
  execFileSync(program, ["render", path, "-q", "-o", out]);
  const { width, height, data } = PNG.sync.read(readFileSync(out));
  return [width, height, ...data];
}
/** In a page: says that the machine has so many threads, counts workers, and makes one of them of a script that fails. */
function workers({ threads, broken }) {
  Object.defineProperty(navigator, "hardwareConcurrency", { value: threads });
  const Own = Worker;
  window.made = 0;
  window.Worker = function (url) {
    return new Own(++window.made === broken ? "data:text/javascript,throw new Error('broken')" : url);
  };
}
const shot = async (page, name) => pictures && page.screenshot({ path: join(pictures, `${name}.png`) });

const tests = {
  async "it opens with an example and renders it"() {
    const page = await open();
    assert.match(await page.inputValue("#text"), /^# The Cornell box/);
    const [width, height] = await pixels(page);
    assert.deepEqual([width, height], [512, 512]);
    await page.context().close();
  },

  async "a changed radius gives the numbers of the program, byte for byte"() {
    const page = await open();
    await edit(page, SCENE);
    const first = await explained(page, 48, 30);
    assert.equal(first, native(SCENE, "--pixel", "48,30", "--format", "json"));
    const changed = SCENE.replace("1.25", "1.75");
    await edit(page, changed);
    const second = await explained(page, 48, 30);
    assert.equal(second, native(changed, "--pixel", "48,30", "--format", "json"));
    assert.notEqual(second, first);
    assert.match(await page.textContent("#command code"), /^lumbre explain scene.pbrt --pixel 48,30 --format json$/);
    await page.selectOption("#resolution", "0.5");
    await page.waitForFunction(() => playground.width === 48);
    assert.equal(await explained(page, 24, 15), native(changed, "--pixel", "24,15", "--size", "48x32", "--format", "json"));
    assert.match(await page.textContent("#command code"), /--size 48x32/);
    await page.context().close();
  },

  async "several workers make the picture of the program, and the first alone if another fails"() {
    // Five workers, some of which have fewer rows; then a second one that cannot start; then more workers than rows.
    const rows = SCENE.replace('"integer yresolution" 64', '"integer yresolution" 3');
    for (const [threads, broken, text] of [[5, 0, SCENE], [3, 2, SCENE], [8, 0, rows]]) {
      const page = await open(address, { script: [workers, { threads, broken }] });
      await edit(page, text);
      await finished(page);
      assert.deepEqual(await pixels(page), picture(text), `${threads} workers`);
      const made = await page.evaluate(() => made);
      assert.ok(made >= Math.min(threads, 3), `${made} workers were made`);
      await page.context().close();
    }
  },

  async "an error has its place and keeps the last picture"() {
    const page = await open();
    await edit(page, SCENE);
    await finished(page);
    const before = await pixels(page);
    await edit(page, SCENE.replace("1.25", "-1.25"));
    assert.match(await page.textContent("#wrong-text"), /^scene\.pbrt:9:16: parameter "radius" of shape "sphere" is out of range/);
    assert.equal(await page.textContent("#lines .wrong"), "9");
    assert.deepEqual(await pixels(page), before);
    await page.click("#wrong-go");
    assert.equal(await page.evaluate(() => document.activeElement.id), "text");
    const selected = await page.evaluate(() => {
      const { value, selectionStart, selectionEnd } = document.getElementById("text");
      return value.slice(selectionStart, selectionEnd);
    });
    assert.equal(selected, '"float radius"');
    await shot(page, "error");
    await finds(page, "a page with an error");
    await edit(page, SCENE);
    assert.equal(await page.isHidden("#wrong"), true);
    await finished(page);
    assert.deepEqual(await pixels(page), before);
    await page.context().close();
  },

  async "a link brings the scene back"() {
    const page = await open();
    await edit(page, `${SCENE}# ñ 太陽\n`);
    await page.click("#share");
    await page.waitForSelector("#shared:not([hidden])");
    const link = await page.inputValue("#link");
    assert.ok(link.startsWith(`${address}#1.`) && link.length < 900, `${link.length}`);
    const other = await open(link);
    assert.equal(await other.inputValue("#text"), `${SCENE}# ñ 太陽\n`);
    await finished(other);
    await finished(page);
    assert.deepEqual(await pixels(other), await pixels(page));
    const broken = await open(link.slice(0, -9));
    await broken.waitForFunction(() => /link/.test(document.getElementById("wrong-text").textContent) || playground.opened > 0);
    for (const each of [page, other, broken]) await each.context().close();
  },

  async "the camera turns by mouse, keys and touch, and the text with it"() {
    const page = await open(address, { hasTouch: true });
    await edit(page, SCENE);
    await finished(page);
    const camera = async () => (await page.inputValue("#text")).split("\n")[0];
    const seen = [await camera()];
    const again = async (what) => {
      await page.waitForFunction((known) => document.getElementById("text").value.split("\n")[0] !== known, seen.at(-1));
      seen.push(await camera());
      assert.match(seen.at(-1), /^LookAt (-?[\d.]+ +){8}-?[\d.]+$/, what);
    };
    const box = await page.locator("#picture").boundingBox();
    const [x, y] = [box.x + box.width / 2, box.y + box.height / 2];
    await page.mouse.move(x, y);
    await page.mouse.down();
    await page.mouse.move(x + 60, y + 12, { steps: 4 });
    await page.mouse.up();
    await again("drag");
    await page.mouse.move(x, y);
    await page.mouse.wheel(0, 200);
    await again("wheel");
    await page.focus("#picture");
    await page.keyboard.press("ArrowLeft");
    await again("arrow");
    await page.keyboard.press("+");
    await again("plus");
    const touch = await page.context().newCDPSession(page);
    const finger = (type, at) => touch.send("Input.dispatchTouchEvent", { type, touchPoints: at.map(([tx, ty], id) => ({ x: tx, y: ty, id })) });
    await finger("touchStart", [[x, y]]);
    for (let i = 1; i < 6; i++) await finger("touchMove", [[x + 12 * i, y]]);
    await finger("touchEnd", []);
    await again("finger");
    assert.equal(await page.isHidden("#wrong"), true);
    await page.context().close();
  },

  async "a click explains the pixel, and names in it are text"() {
    const page = await open();
    await edit(page, SCENE);
    await finished(page);
    const box = await page.locator("#picture").boundingBox();
    await page.mouse.click(box.x + (48.5 * box.width) / 96, box.y + (30.5 * box.height) / 64);
    const frame = await page.waitForSelector("#answer iframe");
    assert.equal(await frame.getAttribute("sandbox"), "");
    assert.deepEqual([await page.inputValue("#x"), await page.inputValue("#y")], ["48", "30"]);
    const told = await (await frame.contentFrame()).textContent("body");
    assert.match(told, /1\.25/);
    assert.match(told, /<img src=x onerror=evil\(\)>/);
    await finds(page, "a page with an explanation");
    await page.context().close();
  },

  async "files that are dropped are the scene's, and a model is shown"() {
    const page = await open();
    const ply = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n-2 0 -1\n2 0 -1\n0 0 2\n3 0 1 2\n";
    const text = `${SCENE}Shape "plymesh" "string filename" "a.ply"\n`;
    await page.setInputFiles("#files", [
      { name: "mine.pbrt", mimeType: "", buffer: Buffer.from(text) },
      { name: "a.ply", mimeType: "", buffer: Buffer.from(ply) },
    ]);
    await page.waitForFunction(() => playground.width === 96);
    assert.equal(await page.inputValue("#text"), text);
    assert.match(await page.textContent("#held"), /a\.ply/);
    await page.setInputFiles("#files", [{ name: "b.ply", mimeType: "", buffer: Buffer.from(ply) }]);
    await page.waitForFunction(() => playground.width > 96 && playground.passes > 0);
    assert.match(await page.textContent("#held"), /b\.ply/);
    assert.equal(await page.isHidden("#wrong"), true);
    await page.context().close();
  },

  async "every example opens"() {
    const page = await open();
    await page.selectOption("#resolution", "0.25");
    for (const name of await page.$$eval("#example option", (options) => options.map((option) => option.value).filter(Boolean))) {
      const before = await page.evaluate(() => playground.opened);
      await page.selectOption("#example", name);
      await page.waitForFunction((before) => playground.opened > before || playground.wrong, before);
      assert.equal(await page.evaluate(() => playground.wrong), "", name);
    }
    await page.context().close();
  },

  async "it works from a file, and speaks Spanish"() {
    const page = await open(pathToFileURL(join(folder, "index.html")).href, { locale: "es-ES" });
    assert.equal(await page.evaluate(() => document.documentElement.lang), "es");
    await edit(page, SCENE);
    await finished(page);
    assert.match(await page.textContent("#progress"), /^Terminado: 4 muestras por píxel, 96 × 64/);
    await page.selectOption("#format", "text");
    await page.click("#explain");
    await page.waitForSelector("#answer pre");
    assert.equal(await page.textContent("#answer pre"), native(SCENE, "--pixel", "48,32", "--lang", "es"));
    await shot(page, "spanish");
    await page.context().close();
  },

  async "it is usable by keys, wide and narrow, light and dark"() {
    for (const [name, settings] of [
      ["light", { colorScheme: "light" }],
      ["dark", { colorScheme: "dark" }],
      ["narrow", { colorScheme: "light", viewport: { width: 390, height: 844 }, hasTouch: true, isMobile: true }],
      ["narrow-dark", { colorScheme: "dark", viewport: { width: 390, height: 844 } }],
    ]) {
      const page = await open(address, settings);
      await page.selectOption("#resolution", "0.25");
      await page.waitForFunction(() => playground.width === 128 && playground.passes > 3);
      await shot(page, name);
      await finds(page, name);
      assert.equal(await page.evaluate(() => document.documentElement.scrollWidth <= innerWidth), true, `${name} scrolls sideways`);
      // From the beginning of the page, tab comes to every part.
      const reached = new Set();
      await page.evaluate(() => document.body.focus());
      for (let i = 0; i < 16; i++) {
        await page.keyboard.press("Tab");
        reached.add(await page.evaluate(() => document.activeElement.id));
      }
      for (const id of ["example", "resolution", "files", "share", "save", "language", "text", "picture", "x", "y", "format", "explain"]) {
        assert.ok(reached.has(id), `${name}: no way by keys to ${id}`);
      }
      await page.focus("#picture");
      await page.keyboard.press("Enter");
      await page.waitForSelector("#answer iframe");
      if (pictures) {
        await page.locator("#answer").scrollIntoViewIfNeeded();
        await shot(page, `${name}-explained`);
      }
      await page.context().close();
    }
  },
};

try {
  await all(tests, wrong, only);
} finally {
  await close();
  rmSync(temporary, { recursive: true, force: true });
}
