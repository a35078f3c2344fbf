// The page in a browser: LUMBRE is the program, CHROMIUM the browser. With --pictures, the screenshots of the docs are made anew.
import assert from "node:assert/strict";
import { spawn, spawnSync, execFileSync } from "node:child_process";
import { mkdtempSync, readFileSync, rmSync, writeFileSync, existsSync, mkdirSync } from "node:fs";
import { createServer } from "node:net";
import { tmpdir } from "node:os";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";
import { chromium } from "playwright-core";
import { PNG } from "pngjs";
import { attacks } from "./attacks.mjs";
import { habits } from "./habits.mjs";

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

/** A binary glTF: a square that goes to the right within two seconds, of another colour at night, and a camera. */
function model() {
  const bytes = Buffer.concat([
    Buffer.from(new Float32Array([-1, -1, 0, 1, -1, 0, 1, 1, 0, -1, 1, 0]).buffer),
    Buffer.from(new Uint16Array([0, 1, 2, 0, 2, 3]).buffer),
    Buffer.from(new Float32Array([0, 2]).buffer),
    Buffer.from(new Float32Array([0, 0, 0, 1.5, 0, 0]).buffer),
  ]);
  const views = [[0, 48], [48, 12], [60, 8], [68, 24]];
  const mappings = [0, 1].map((index) => ({ material: index, variants: [index] }));
  const colour = (...rgb) => ({ pbrMetallicRoughness: { baseColorFactor: [...rgb, 1], metallicFactor: 0 } });
  const text = Buffer.from(JSON.stringify({
    asset: { version: "2.0" },
    extensionsUsed: ["KHR_materials_variants"],
    extensions: { KHR_materials_variants: { variants: [{ name: "day" }, { name: "night" }] } },
    scene: 0,
    scenes: [{ nodes: [0, 1] }],
    nodes: [{ mesh: 0, name: "square" }, { camera: 0, translation: [0, 0, 7] }],
    cameras: [{ type: "perspective", perspective: { yfov: 0.8, znear: 0.1 } }],
    meshes: [{ primitives: [{ attributes: { POSITION: 0 }, indices: 1, material: 0, extensions: { KHR_materials_variants: { mappings } } }] }],
    materials: [colour(0.8, 0.3, 0.1), colour(0.1, 0.2, 0.7)],
    animations: [{ channels: [{ sampler: 0, target: { node: 0, path: "translation" } }], samplers: [{ input: 2, output: 3 }] }],
    buffers: [{ byteLength: bytes.length }],
    bufferViews: views.map(([byteOffset, byteLength]) => ({ buffer: 0, byteOffset, byteLength })),
    accessors: [
      { bufferView: 0, componentType: 5126, count: 4, type: "VEC3", min: [-1, -1, 0], max: [1, 1, 0] },
      { bufferView: 1, componentType: 5123, count: 6, type: "SCALAR" },
      { bufferView: 2, componentType: 5126, count: 2, type: "SCALAR", min: [0], max: [2] },
      { bufferView: 3, componentType: 5126, count: 2, type: "VEC3" },
    ],
  }));
  const chunk = (type, content, fill) => {
    const padded = Buffer.concat([content, Buffer.alloc(-content.length & 3, fill)]);
    const head = Buffer.alloc(8);
    head.writeUInt32LE(padded.length, 0);
    head.write(type, 4, "latin1");
    return Buffer.concat([head, padded]);
  };
  const chunks = [chunk("JSON", text, " "), chunk("BIN\0", bytes, 0)];
  const head = Buffer.alloc(12);
  head.write("glTF", 0);
  head.writeUInt32LE(2, 4);
  head.writeUInt32LE(12 + chunks[0].length + chunks[1].length, 8);
  return Buffer.concat([head, ...chunks]);
}

/** How far the ray through a point of the scene's film goes to the ball. */
function toTheBall(x, y) {
  const [eye, target, up, radius] = [[1, -7, 3], [0, 0, 0.5], [0, 0, 1], 1.25];
  const cross = (a, b) => [0, 1, 2].map((i) => a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3]);
  const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  const unit = (a) => a.map((c) => c / Math.hypot(...a));
  const forward = unit(target.map((c, i) => c - eye[i]));
  const right = unit(cross(up, forward));
  const upward = cross(forward, right);
  const [across, above] = [x - 48, 32 - y].map((pixels) => (pixels / 32) * Math.tan((17.5 * Math.PI) / 180));
  const direction = unit(forward.map((c, i) => c + across * right[i] + above * upward[i]));
  const middle = -dot(eye, direction);
  return middle - Math.sqrt(middle ** 2 - dot(eye, eye) + radius ** 2);
}

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

/** The picture that is rendered of these words, as the pixels of a page. */
function rendered(...words) {
  const out = join(folder, "wanted.png");
  execFileSync(program, ["render", ...words, "-o", out, "-q"]);
  const png = PNG.sync.read(readFileSync(out));
  return [png.width, png.height, ...png.data];
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
/** Clicks into the middle of a pixel of a picture of 96 by 64. */
async function click(page, x, y) {
  const box = await page.locator("#picture").boundingBox();
  await page.mouse.click(box.x + ((x + 0.5) * box.width) / 96, box.y + ((y + 0.5) * box.height) / 64);
}
const moved = (page) => page.evaluate(() => lumbreMeasured.latencies.length);
async function finds(page, what, rules = {}) {
  await page.evaluate(axe);
  // Frames that run nothing are looked at by themselves.
  const { violations } = await page.evaluate(
    (rules) => axe.run(document, { iframes: false, rules, runOnly: ["wcag2a", "wcag2aa", "wcag21aa", "best-practice"] }), rules,
  );
  const told = violations.map(({ id, nodes }) => `${id}: ${nodes.map((node) => node.html).join(" ")}`);
  assert.deepEqual(told, [], `axe finds something in ${what}`);
}

const tests = {
  ...attacks({ view, open, done, pixels, freePort, folder }),
  ...habits({ view, open, done, pixels, becomes, click, rendered, program, folder, model }),

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
    await page.click("#save-details > summary");
    const [download] = await Promise.all([page.waitForEvent("download"), page.click("#save-png")]);
    assert.equal(download.suggestedFilename(), "scene.png");
    const saved = PNG.sync.read(readFileSync(await download.path()));
    assert.ok(saved.data.equals(rendered.data), "the picture that is saved is the same");
    // The same tab comes back; another one does not come in, by the address that was used or without.
    assert.equal(page.url(), `${new URL(viewer.url).origin}/`);
    await page.reload();
    await done(page);
    for (const address of [viewer.url, new URL(viewer.url).origin]) {
      const other = await open(address);
      await other.waitForFunction(() => /does not know this page/.test(document.getElementById("alert").textContent));
      assert.equal(await other.isVisible("#picked table"), false);
    }
    await viewer.stop();
  },

  async "a model is without noise from the first picture on, and ends as it is rendered"() {
    const path = join(folder, "clean.glb");
    writeFileSync(path, model());
    const words = ["--size", "320x240", "--spp", "8", path];
    const viewer = await view(...words);
    const page = await open(viewer.url);
    await done(page);
    const { noisy, firstDenoised, first } = await page.evaluate(() => lumbreMeasured);
    assert.equal(noisy, 0, "every frame is denoised, coarse ones too");
    assert.ok(first > 0 && firstDenoised === first);
    assert.deepEqual(await pixels(page), rendered(...words));
    const clean = await pixels(page);
    await page.click("#denoise");
    await becomes(page, clean, false);
    assert.ok(await page.evaluate(() => lumbreMeasured.noisy) > 1);
    assert.deepEqual(await pixels(page), rendered("--denoise", "none", ...words));
    await page.click("#denoise");
    await becomes(page, clean, true);
    await viewer.stop();
  },

  async "it renders to a noise target as render does, and tells how far it is within a pass"() {
    const path = join(folder, "noise.pbrt");
    writeFileSync(path, SCENE.replace("[0.5 0.6 0.7]", "[0.5 0.6 0.7] LightSource \"point\" \"point3 from\" [3 -4 2] \"rgb I\" [9 9 9]"));
    const viewer = await view("--noise", "0.05", path);
    const page = await open(viewer.url);
    await done(page);
    const wanted = rendered("--noise", "0.05", path);
    assert.deepEqual(await pixels(page), wanted);
    assert.equal(await page.inputValue("#noise-target"), "0.05");
    assert.match(await page.textContent("#progress"), /noise 0\.0\d+ of 0\.05/);
    // The page has its own target.
    await page.fill("#noise-target", "0.1");
    await page.keyboard.press("Tab");
    await becomes(page, rendered("--noise", "0.1", path), true);
    await page.fill("#noise-target", "0");
    await page.keyboard.press("Tab");
    // A long pass tells how far it is: many shares of one number of samples.
    await page.fill("#spp", "100000");
    await page.evaluate(() => {
      globalThis.bars = new Set();
      new MutationObserver(() => bars.add(document.getElementById("bar").value)).observe(document.getElementById("progress"), { childList: true, characterData: true, subtree: true });
    });
    await page.keyboard.press("Tab");
    await page.waitForFunction(() => bars.size > 12);
    const bars = await page.evaluate(() => [...globalThis.bars]);
    assert.ok(bars.every((value) => value >= 0 && value < 1), String(bars));
    assert.match(await page.textContent("#progress"), /\d+ % · .* left/);
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

  async "it explains a pixel in the words of the program, of the picture as it is"() {
    const path = join(folder, "scene.pbrt");
    const viewer = await view(path);
    const page = await open(viewer.url);
    await done(page);
    assert.equal(await page.isVisible("#explain"), false, "nothing was asked yet");
    const [x, y] = [40, 33];
    await click(page, x, y);
    await page.waitForSelector("#explain:visible");
    assert.equal(await page.textContent("#explain"), `Explain pixel ${x}, ${y}`);
    const explain = (...words) => execFileSync(program, ["explain", path, "--pixel", `${x},${y}`, "-q", ...words], { encoding: "utf8" });
    /** What is shown in the frame after this. */
    const served = async (act) => {
      const isExplanation = (answer) => answer.url().includes("/ticket/") && answer.request().resourceType() === "document";
      const [answer] = await Promise.all([page.waitForResponse(isExplanation), act()]);
      return answer.text();
    };
    const pressX = async () => {
      await page.focus("#picture");
      await page.keyboard.press("x");
    };
    assert.equal(await served(pressX), explain("--format", "html"));
    const told = page.frameLocator("#explanation iframe").locator("main");
    await told.waitFor();
    // The numbers that are seen are those that the program gives to other programs, and names are text.
    const report = JSON.parse(explain("--format", "json"));
    const sections = new Map(report.sections.map((section) => [section.key, section]));
    const shape = sections.get("surfaces").sections[0];
    assert.equal(shape.title, "shape 0, sphere");
    const seen = await told.innerText();
    assert.ok(seen.includes(shape.title), seen.slice(0, 3000));
    const radiance = sections.get("light").sections.find(({ key }) => key === "radiance").quantities[0];
    assert.ok(radiance.value.length === 3 && radiance.value.every((number) => number > 0), JSON.stringify(radiance));
    const flat = seen.replaceAll(/[\s\u2061-\u2064]/g, "");
    assert.ok(flat.includes(`(${radiance.value.join(",")})`), `${radiance.value} in ${flat.slice(-2000)}`);
    assert.ok(seen.includes("<img src=x onerror=evil()> (diffuse)"));
    assert.equal(await told.locator("img").count(), 0);
    // Its own script runs, and nothing else can.
    const frame = page.frames().find((it) => it.parentFrame());
    await told.locator(".slider").first().waitFor();
    assert.equal(await frame.evaluate(() => origin), "null");
    const ran = await frame.evaluate(() => {
      document.body.append(Object.assign(document.createElement("script"), { textContent: "window.evil = true" }));
      return "evil" in window;
    });
    assert.equal(ran, false);
    assert.match(wrong.pop(), /Content Security Policy/);

    assert.equal(await served(() => page.selectOption("#language", "es")), explain("--format", "html", "--lang", "es"));
    await page.frameLocator("#explanation iframe").locator("html[lang=es]").waitFor();
    await page.waitForSelector("#explanation-alone[href]");
    const used = await page.locator("#explanation iframe").evaluate((frame) => frame.src);
    assert.equal((await page.request.get(used)).status(), 403, "an address works once");
    const [alone] = await Promise.all([page.context().waitForEvent("page"), page.click("#explanation-alone")]);
    await alone.waitForLoadState();
    assert.equal(await alone.getAttribute("html", "lang"), "es");
    await alone.close();
    await page.click("#explanation-close");
    await page.waitForSelector("#explanation iframe", { state: "detached" });

    // Of an edited scene, what the edited one's render does; of another camera, something else.
    await page.click("#edit-details > summary");
    await page.fill("#filter", "reflectance");
    const before = await pixels(page);
    await page.evaluate(() => {
      const input = document.querySelector("#parameters input");
      input.value = "#20c040";
      input.dispatchEvent(new Event("input"));
    });
    await becomes(page, before, false);
    const overlay = join(folder, "explained.txt");
    writeFileSync(overlay, "material.<img src=x onerror=evil()>.reflectance = #20c040\n");
    assert.equal(await served(() => page.click("#explain")), explain("--format", "html", "--lang", "es", "--overlay", overlay));
    await page.click("#explanation-close");
    await page.focus("#picture");
    await page.keyboard.press("ArrowLeft", { delay: 80 });
    await page.waitForFunction(() => lumbreMeasured.latencies.length > 0);
    assert.notEqual(await served(pressX), explain("--format", "html", "--lang", "es", "--overlay", overlay));
    await viewer.stop();
  },

  async "the page of an explanation has a slider, marks and steps, and is whole without its script"() {
    const scene = join(folder, "shapes.pbrt");
    writeFileSync(scene, `${SCENE}AttributeBegin Translate 3 0 0 Scale 1 2 1 Shape "sphere" AttributeEnd
      Translate 6 0 0 Shape "torus" "float majorradius" 1 "float minorradius" 0.25\n`);
    for (const [language, ray, width] of [["en", "-5,0.2,0.1,1,0,0", 1280], ["es", "-5,0.2,0.1,1,0,0", 390], ["es", "-5,0.2,9,1,0,0", 390]]) {
      const out = join(folder, "explained.html");
      execFileSync(program, ["explain", scene, "--ray", ray, "-q", "--format", "html", "--lang", language, "-o", out]);
      const page = await open(`file://${out}`, { viewport: { width, height: 800 } });
      const wide = await page.evaluate(() => [...document.querySelectorAll("body *")]
        .filter((it) => !it.closest("svg") && it.getBoundingClientRect().right > innerWidth + 0.5).map((it) => it.outerHTML.slice(0, 200)));
      assert.deepEqual(wide, [], `${language} ${width}: nothing is wider than the screen`);
      const scrolls = await page.evaluate(() => [...document.querySelectorAll("*")]
        .filter((it) => it.scrollWidth > it.clientWidth && /auto|scroll/.test(getComputedStyle(it).overflowX)).length);
      assert.equal(scrolls, 0, "nothing scrolls sideways");
      await finds(page, `the page of an explanation, ${language} ${width}`);

      // The slider moves a point in all pictures.
      const figure = page.locator("figure").last();
      const place = () => figure.locator(".plot .moving circle").getAttribute("cx").then(Number);
      const before = await place();
      await figure.locator("input[type=range]").press("ArrowRight");
      assert.ok(await place() > before);
      for (const button of await figure.locator(".slider button").all()) {
        await button.click();
        const mark = await button.getAttribute("data-mark");
        const root = Number(await figure.locator(`.plot .mark[data-mark="${mark}"] circle`).getAttribute("cx"));
        assert.ok(Math.abs(await place() - root) < 0.02, mark);
        const [x, y] = await Promise.all(["cx", "cy"].map((name) => figure.locator(".sketch .moving").first().getAttribute(name).then(Number)));
        const [left, top] = await Promise.all(["cx", "cy"].map((name) => figure.locator(`.sketch .mark[data-mark="${mark}"] circle`).first().getAttribute(name).then(Number)));
        assert.ok(Math.hypot(x - left, y - top) < 0.02, `${mark}: ${x}, ${y} at ${left}, ${top}`);
        const f = /F\(t\) = (\S+)$/.exec(await figure.locator("output").textContent())[1];
        assert.ok(Math.abs(Number(f)) < 1e-9, `F is 0 at ${mark}: ${f}`);
      }

      // What is pointed at lights up on both sides.
      const first = page.locator("section.figured").first();
      const colour = (where) => first.locator(where).first().evaluate((it) => getComputedStyle(it).color);
      const [mark, symbol] = ['.sketch .mark[data-mark="C"]', 'span[data-mark="C"]'];
      const plain = [await colour(mark), await colour(symbol)];
      const focus = (it) => it.focus();
      const hover = (it) => it.hover();
      for (const [act, places] of [[focus, [symbol, mark]], [hover, [symbol, `${mark} text`]]]) {
        for (const where of places) {
          const target = first.locator(where).first();
          // Clear of what stands at the edges of the window.
          await target.evaluate((it) => it.scrollIntoView({ block: "end" }));
          await act(target);
          const lit = [await colour(mark), await colour(symbol)];
          assert.ok(lit[0] !== plain[0] && lit[1] !== plain[1] && lit[0] === lit[1], `${where}: ${plain} and ${lit}`);
          await page.evaluate(() => document.activeElement.blur());
          await page.mouse.move(1, 1);
        }
      }

      // One section after the other, by buttons and by keys.
      const count = await page.locator("main section").count();
      await page.click("#begin");
      const current = () => page.evaluate(() => [...document.querySelectorAll("main section")].findIndex((it) => it.matches(".current")));
      assert.equal(await current(), 0);
      await page.click("#next");
      await page.keyboard.press("ArrowRight");
      await page.keyboard.press("ArrowLeft");
      assert.equal(await current(), 1);
      const isOpen = await page.evaluate(() => [...document.querySelectorAll("main section")].map((it) => it.firstElementChild.open === it.contains(document.querySelector(".current"))));
      assert.deepEqual(isOpen, Array(count).fill(true));
      await page.click("#all");
      assert.equal(await page.locator("main details[open]").count(), count);
      await page.context().close();

      // Without the script there is nothing that does nothing, and all is seen.
      const still = await open(`file://${out}`, { javaScriptEnabled: false, viewport: { width, height: 800 } });
      assert.equal(await still.locator("#steps, .slider").locator("visible=true").count(), 0);
      assert.equal(await still.locator("main details[open]").count(), count);
      assert.ok(await still.locator(".plot .curve").first().isVisible());
      await still.context().close();
    }
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
    assert.match(await page.textContent("#empty"), /Drop a file or a folder here/);
    const head = Buffer.alloc(12);
    head.write("glTF");
    await page.setInputFiles("#open", { name: "broken.glb", mimeType: "model/gltf-binary", buffer: head });
    await page.waitForFunction(() => !document.getElementById("alert").hidden);
    assert.match(await page.textContent("#alert"), /broken\.glb/);
    await viewer.stop();
    const missing = spawnSync(program, ["view", "--no-open", join(folder, "missing.pbrt")], { encoding: "utf8" });
    assert.equal(missing.status, 4);
    assert.match(missing.stderr, /missing\.pbrt: cannot open/);
  },

  async "the time of an animation and the variants of a model make the pictures that are rendered"() {
    const path = join(folder, "model.glb");
    writeFileSync(path, model());
    const words = ["--size", "96x64", "--spp", "4", "--ground", "plane", path];
    const rendered = (...more) => {
      const out = join(folder, "moment.png");
      execFileSync(program, ["render", ...words, "-o", out, "-q", ...more]);
      const png = PNG.sync.read(readFileSync(out));
      return [png.width, png.height, ...png.data];
    };
    const viewer = await view(...words);
    const page = await open(viewer.url);
    await done(page);
    const pictures = [rendered(), rendered("--frame", "1"), rendered("--frame", "1", "--variant", "night")];
    assert.equal(new Set(pictures.map(String)).size, 3, "they are different pictures");
    await becomes(page, pictures[0], true);
    for (const [x, y, shape] of [[48, 32, "square (mesh)"], [48, 60, "ground"]]) {
      await click(page, x, y);
      await page.waitForFunction((wanted) => document.querySelector("#picked td")?.textContent === wanted, shape);
    }
    assert.equal(await page.getAttribute("#animation-time", "max"), "2");
    await page.evaluate(() => {
      const input = document.getElementById("animation-time");
      input.value = "1";
      input.dispatchEvent(new Event("input"));
    });
    await becomes(page, pictures[1], true);
    assert.equal(await page.textContent("#time-value"), "1.00 s");
    assert.deepEqual(await page.locator("#variant option").allTextContents(), ["as in the file", "day", "night"]);
    await page.selectOption("#variant", "night");
    await becomes(page, pictures[2], true);
    await page.selectOption("#variant", "");
    await becomes(page, pictures[1], true);
    await viewer.stop();
  },

  async "a model that is dropped on the page is opened, on an empty page and in place of another"() {
    const path = join(folder, "dropped-later.glb");
    writeFileSync(path, model());
    const out = join(folder, "dropped.png");
    const words = ["--size", "96x64", "--spp", "4"];
    execFileSync(program, ["render", path, ...words, "-o", out, "-q"]);
    const png = PNG.sync.read(readFileSync(out));
    for (const before of [[], [join(folder, "scene.pbrt")]]) {
      const viewer = await view(...words, ...before);
      const page = await open(viewer.url);
      if (before.length > 0) await done(page);
      else await page.waitForSelector("#empty:not([hidden])");
      await page.evaluate((bytes) => {
        const dropped = new DataTransfer();
        dropped.items.add(new File([new Uint8Array(bytes)], "chair.glb", { type: "model/gltf-binary" }));
        const stage = document.getElementById("stage");
        for (const type of ["dragover", "drop"]) {
          stage.dispatchEvent(new DragEvent(type, { dataTransfer: dropped, bubbles: true, cancelable: true }));
        }
      }, [...model()]);
      await page.waitForFunction(() => document.getElementById("empty").hidden && document.getElementById("name").textContent === "chair.glb");
      await becomes(page, [png.width, png.height, ...png.data], true);
      assert.equal(await page.isHidden("#alert"), true);
      await viewer.stop();
    }
  },

  async "a page at rest opens from a file and shows the same pixels, their values and what is there"() {
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
    // What is there: the ball, as far away as a ray through the middle of the pixel finds it, and nothing beside it.
    for (const [x, y] of [[40, 33], [50, 28]]) {
      await click(page, x, y);
      await page.waitForFunction((distance) => {
        const rows = new Map([...document.querySelectorAll("#picked tr")].map((row) => [...row.children].map((cell) => cell.textContent)));
        return rows.size === 3 && rows.get("Shape") === "sphere 0" && rows.get("Material") === "<img src=x onerror=evil()> (diffuse)"
          && Math.abs(Number(rows.get("Distance")) / distance - 1) < 1e-5;
      }, toTheBall(x + 0.5, y + 0.5));
    }
    await click(page, 2, 3);
    await page.waitForFunction(() => document.getElementById("picked").textContent === "Nothing is there.");
    assert.equal(await page.isVisible("#explain"), false);
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
        await page.keyboard.press("Escape");
        await page.focus("#picture");
        await page.keyboard.press("x");
        await page.frameLocator("#explanation iframe").locator("main").waitFor();
        await finds(page, `explanation, ${colorScheme} ${form}`);
        await page.waitForSelector("#explanation-alone[href]");
        await page.goto(await page.locator("#explanation-alone").evaluate((link) => link.href));
        // Browsers let the keyboard into what scrolls.
        await finds(page, `explanation alone, ${colorScheme} ${form}`, { "scrollable-region-focusable": { enabled: false } });
        assert.ok(await page.evaluate(() => document.documentElement.scrollWidth) <= width, `${form}: the explanation is no wider than the screen`);
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
