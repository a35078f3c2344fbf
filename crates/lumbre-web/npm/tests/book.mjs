// The book in a browser: LUMBRE is the program, CHROMIUM the browser, BOOK the folder of the built book with its live parts. With
// --pictures FOLDER, screenshots are left there.
import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { cpSync, mkdtempSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { dirname, join, resolve } from "node:path";
import { fileURLToPath, pathToFileURL } from "node:url";
import { all, asked, finds, site } from "./site.mjs";

const root = join(dirname(fileURLToPath(import.meta.url)), "../../../..");
const program = process.env.LUMBRE ?? join(root, "target/debug/lumbre");
const folder = resolve(process.env.BOOK ?? join(root, "target/book/html"));
const { pictures, only } = asked(process.argv.slice(2));
const temporary = mkdtempSync(join(tmpdir(), "lumbre-book-"));
const { address, wrong, open, close } = await site(folder);
const shot = async (page, name) => pictures && page.screenshot({ path: join(pictures, `book-${name}.png`) });
const SPHERE = "mathematics/pictures/sphere.pbrt";
for (const part of ["mathematics/pictures"]) cpSync(join(root, "docs", part), join(temporary, part), { recursive: true });
/** What the program prints where the book's files are. */
const native = (...words) => execFileSync(program, words, { cwd: temporary, encoding: "utf8", stdio: ["ignore", "pipe", "ignore"], maxBuffer: 1 << 26 });
/** The part below the block whose text has this. */
const tried = async (page, text) => {
  const block = page.locator("main pre", { hasText: text }).first();
  await block.scrollIntoViewIfNeeded();
  await block.locator("xpath=following-sibling::div[1]").getByRole("button", { name: /Try it|Pruébelo/ }).click();
  return page.locator(".live-example");
};
const figure = async (page) => {
  await page.locator(".live-start").first().click();
  await page.waitForSelector(".live-figure[data-frames]");
  return page.locator(".live-figure");
};
const explained = (page) => page.evaluate(() => document.querySelector(".live-figure").explained);
/** Waits until a figure is of another ray or scene. */
const changed = (page, before) => page.waitForFunction((before) => JSON.stringify(document.querySelector(".live-figure").explained) !== before, JSON.stringify(before));
const field = (page, name) => page.locator(".live-figure").getByLabel(name, { exact: true }).first();

const tests = {
  async "what is built shows without JavaScript"() {
    const page = await open(`${address}mathematics/sphere.html`, { javaScriptEnabled: false });
    const text = await page.textContent("main");
    assert.match(text, /t₁ = c\/q = 8\.36\/7\.6 ≈ 1\.0999999999999999/);
    assert.equal(await page.locator(".live, .live-bar").count(), 0);
    await page.context().close();
  },

  async "an example is edited and run where it stands, with the bytes of the program"() {
    const page = await open(`${address}mathematics/sphere.html`);
    const part = await tried(page, "--ray -3,0.6,1,2,0,0 --nearest");
    const command = part.locator("textarea").first();
    await command.fill(`lumbre explain ${SPHERE} --ray -3,0.25,1,2,0,0 --nearest --only Roots,crossings`);
    await page.waitForFunction(() => /0\.25/.test(document.querySelector(".live-example pre").textContent) || !/8\.36/.test(document.querySelector(".live-example pre").textContent));
    const found = await part.locator("pre").first().textContent();
    assert.equal(found, native("explain", SPHERE, "--ray", "-3,0.25,1,2,0,0", "--nearest", "--only", "Roots,crossings"));
    // What is not known is said, and what was printed stays.
    await command.fill("rm -r /");
    await page.waitForFunction(() => /rm/.test(document.querySelector(".live-example .live-wrong").textContent));
    assert.equal(await part.locator("pre").first().textContent(), found);
    await shot(page, "example");
    await finds(page, "an example", [".live"]);
    await part.getByRole("button", { name: "As it was" }).click();
    await page.waitForFunction(() => /8\.36/.test(document.querySelector(".live-example pre").textContent));
    await part.getByRole("button", { name: "Close" }).click();
    assert.equal(await page.locator("main pre", { hasText: "--ray -3,0.6,1,2,0,0 --nearest" }).first().isVisible(), true);
    await page.context().close();
  },

  async "expressions of the mathematics answer in the language of the page"() {
    const page = await open(`${address}es/mathematics/matrices.html`);
    const part = await tried(page, "lumbre math");
    await part.locator("textarea").first().fill("lumbre math --lang es 'det([[2, 1], [1, 3]])'");
    const expected = native("math", "--lang", "es", "det([[2, 1], [1, 3]])").trim().split("\n").at(-1);
    await page.waitForFunction((expected) => document.querySelector(".live-example pre").textContent.includes(expected), expected);
    await page.context().close();
  },

  async "a changed radius gives the numbers of the program, byte for byte"() {
    const page = await open(`${address}mathematics/sphere.html`);
    await figure(page);
    const before = await explained(page);
    const ask = (ray) => native("explain", SPHERE, "--ray", ray.join(","), "--nearest", "--only", "surfaces", "--format", "html");
    writeFileSync(join(temporary, SPHERE), before.text);
    assert.equal(before.page, ask(before.ray));
    await field(page, "radius, number 1").fill("1.25");
    await changed(page, before);
    await page.waitForFunction(() => document.querySelector(".live-figure").explained.text.includes('"float radius" 1.25'));
    const after = await explained(page);
    writeFileSync(join(temporary, SPHERE), after.text);
    assert.equal(after.page, ask(after.ray));
    assert.notEqual(after.page, before.page);
    assert.match(await page.evaluate(() => document.querySelector(".live-sketch").shadowRoot.querySelector(".body").textContent), /1\.25/);
    // An error keeps the last figure.
    await field(page, "radius, number 1").fill("-1");
    await page.waitForFunction(() => /radius/.test(document.querySelector(".live-figure .live-wrong").textContent));
    assert.deepEqual(await explained(page), after);
    await shot(page, "figure");
    await page.context().close();
  },

  async "the ray, a centre and a radius are dragged, and the derivation lights up"() {
    const page = await open(`${address}mathematics/sphere.html`);
    const part = await figure(page);
    const drag = async (key, x, y) => {
      const before = await explained(page);
      const mark = part.locator(`.sketch [data-mark="${key}"] circle, .sketch [data-mark="${key}"] polyline`).first();
      await mark.scrollIntoViewIfNeeded();
      const box = await mark.boundingBox();
      const [from, to] = [box.x + box.width / 2, box.y + box.height / 2];
      await page.mouse.move(from, to);
      await page.mouse.down();
      await page.mouse.move(from + x, to + y, { steps: 6 });
      await page.mouse.up();
      await changed(page, before);
      return { before, after: await explained(page) };
    };
    const moved = await drag("O", 0, 12);
    assert.notDeepEqual(moved.after.ray.slice(0, 3), moved.before.ray.slice(0, 3));
    assert.deepEqual(moved.after.ray.slice(3), moved.before.ray.slice(3));
    const turned = await drag("D", 0, -10);
    assert.deepEqual(turned.after.ray.slice(0, 3), turned.before.ray.slice(0, 3));
    assert.notDeepEqual(turned.after.ray.slice(3), turned.before.ray.slice(3));
    const center = (text) => /"point3 center" \[([^\]]*)\]/.exec(text)[1];
    const shifted = await drag("C", 14, 0);
    assert.notEqual(center(shifted.after.text), center(shifted.before.text));
    // Pointing at a symbol of the derivation lights its mark up in the sketch.
    const symbol = part.locator('math [data-mark="C"], span[data-mark="C"]').first();
    await symbol.scrollIntoViewIfNeeded();
    const colour = () => part.locator('.sketch [data-mark="C"]').first().evaluate((mark) => getComputedStyle(mark).color);
    await page.mouse.move(2, 2);
    const plain = await colour();
    await symbol.hover();
    assert.notEqual(await colour(), plain);
    await page.context().close();
  },

  async "a figure follows at the rate of the screen"() {
    const page = await open(`${address}mathematics/sphere.html`);
    await figure(page);
    const rate = await page.evaluate(async () => {
      const part = document.querySelector(".live-figure");
      const input = part.querySelector("input");
      const frames = () => Number(part.dataset.frames);
      const [from, start] = [frames(), performance.now()];
      for (let i = 0; i < 90; i++) {
        input.value = String(-3 + 0.01 * i);
        input.dispatchEvent(new Event("input", { bubbles: true }));
        await new Promise((go) => requestAnimationFrame(go));
      }
      return { drawn: frames() - from, seconds: (performance.now() - start) / 1000 };
    });
    console.log(`  ${rate.drawn} figures in ${rate.seconds.toFixed(2)} s: ${(rate.drawn / rate.seconds).toFixed(0)} a second`);
    assert.ok(rate.drawn > 5, `${rate.drawn}`);
    await page.context().close();
  },

  async "a scene is edited and rendered where it stands, and explains its pixels"() {
    const page = await open(`${address}first-picture.html`);
    await page.getByRole("button", { name: "Edit and render" }).first().click();
    const part = page.locator(".live-scene").first();
    const text = part.locator("textarea");
    await page.waitForFunction(() => document.querySelector(".live-scene").dataset.state === "done" || document.querySelector(".live-scene").dataset.state === "rendering");
    const scene = await text.inputValue();
    await text.fill(scene.replace(/"integer pixelsamples" (\[ *)?\d+/, '"integer pixelsamples" $14'));
    await page.waitForFunction(() => document.querySelector(".live-scene").dataset.state === "opening");
    await page.waitForFunction(() => document.querySelector(".live-scene").dataset.state === "done");
    const pixels = () => part.locator("canvas").evaluate((canvas) => canvas.toDataURL());
    const before = await pixels();
    await text.fill(scene.replace("Shape", "Shape [").replace("WorldBegin", "WorldBegn"));
    await page.waitForFunction(() => !document.querySelector(".live-scene .live-wrong").hidden);
    assert.equal(await pixels(), before);
    await shot(page, "scene");
    await finds(page, "a scene with an error", [".live"]);
    await part.getByRole("button", { name: "As it was" }).click();
    await page.waitForFunction(() => document.querySelector(".live-scene .live-wrong").hidden);
    const canvas = part.locator("canvas");
    await canvas.focus();
    await page.keyboard.press("Enter");
    const frame = await (await part.locator("iframe").elementHandle()).contentFrame();
    await frame.waitForSelector("main");
    assert.equal(await part.locator("iframe").getAttribute("sandbox"), "");
    await page.context().close();
  },

  async "it works from a file, narrow, by touch, light and dark"() {
    for (const [name, url, settings] of [
      ["file", pathToFileURL(join(folder, "mathematics/sphere.html")).href, { colorScheme: "dark" }],
      ["narrow", `${address}mathematics/sphere.html`, { viewport: { width: 390, height: 844 }, hasTouch: true, isMobile: true }],
      ["spanish", `${address}es/mathematics/sphere.html`, { viewport: { width: 390, height: 844 } }],
    ]) {
      const page = await open(url, settings);
      const part = await figure(page);
      await part.scrollIntoViewIfNeeded();
      await shot(page, name);
      await finds(page, name, [".live", ".live-bar"]);
      assert.equal(await page.evaluate(() => document.documentElement.scrollWidth <= innerWidth), true, `${name} scrolls sideways`);
      assert.match(await part.locator(".live-hint").first().textContent(), name === "spanish" ? /^Arrastre/ : /^Drag/);
      // By keys alone: a number goes up and down.
      const before = await explained(page);
      await part.locator("input").first().focus();
      await page.keyboard.press("ArrowUp");
      await changed(page, before);
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
