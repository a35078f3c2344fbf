// What a user does with a scene: tree, lights, views, measures, sections, numbers, files, and several browsers.
import assert from "node:assert/strict";
import { execFileSync, spawnSync } from "node:child_process";
import { mkdirSync, readFileSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { PNG } from "pngjs";

/** Two balls, and a lamp. */
const RED = `MakeNamedMaterial "red" "string type" "diffuse" "rgb reflectance" [0.7 0.1 0.1] NamedMaterial "red"
AttributeBegin Translate -1.2 0 0 Shape "sphere" "float radius" 1 AttributeEnd
`;
const GREEN = `MakeNamedMaterial "green" "string type" "diffuse" "rgb reflectance" [0.1 0.6 0.1] NamedMaterial "green"
AttributeBegin Translate 1.2 0 0 Shape "sphere" "float radius" 1 AttributeEnd
`;
const pair = (shapes) => `LookAt 0 -8 1  0 0 0  0 0 1
Camera "perspective" "float fov" 35
Film "rgb" "integer xresolution" 96 "integer yresolution" 64
Sampler "independent" "integer pixelsamples" 4
WorldBegin
LightSource "infinite" "rgb L" [0.3 0.3 0.3]
LightSource "point" "point3 from" [0 -5 5] "rgb I" [20 10 5]
${shapes}`;
const PAIR = pair(RED + GREEN);

/** A picture of light from all around, twice as wide as high: brighter to one side. */
function pfm() {
  const [width, height] = [8, 4];
  const pixels = new Float32Array(3 * width * height).map((_, i) => 0.2 + 0.3 * (Math.floor(i / 3) % width));
  return Buffer.concat([Buffer.from(`PF\n${width} ${height}\n-1.0\n`), Buffer.from(pixels.buffer)]);
}

/** A square that stands on the ground, with a texture beside it, in a folder. */
function writeModel(folder) {
  mkdirSync(join(folder, "parts"), { recursive: true });
  const image = new PNG({ width: 4, height: 4 });
  image.data.set(Array.from({ length: 16 }, (_, i) => (i % 2 ? [230, 200, 20, 255] : [20, 40, 200, 255])).flat());
  writeFileSync(join(folder, "parts/paint.png"), PNG.sync.write(image));
  writeFileSync(join(folder, "parts/board.mtl"), "newmtl paint\nKd 1 1 1\nmap_Kd paint.png\n");
  writeFileSync(join(folder, "board.obj"), "mtllib parts/board.mtl\nv -1 0 0\nv 1 0 0\nv 1 2 0\nv -1 2 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nusemtl paint\nf 1/1 2/2 3/3 4/4\n");
  return join(folder, "board.obj");
}

export const habits = ({ view, open, done, pixels, becomes, click, rendered, program, folder, model }) => {
  const write = (name, text) => {
    const path = join(folder, name);
    writeFileSync(path, text);
    return path;
  };
  /** The camera as text. */
  const lookAt = async (page) => {
    await page.click("#copy-pbrt");
    const [eye, target, up] = (await page.inputValue("#copied")).split("\n").find((line) => line.startsWith("LookAt")).slice(7).split("  ")
      .map((part) => part.trim().split(" ").map(Number));
    return { eye, target, up };
  };
  const near = (a, b, within = 1e-6) => assert.ok(a.every((x, i) => Math.abs(x - b[i]) <= within), `${a} and ${b}`);
  /** Waits until something else was shown than what is. */
  const changed = async (page, act) => {
    const before = await pixels(page);
    await act();
    await becomes(page, before, false);
  };
  const press = async (page, key) => {
    await page.focus("#picture");
    await page.keyboard.press(key);
  };
  const rows = (page, list) => page.evaluate((id) => {
    const [names, texts] = ["dt", "dd"].map((kind) => [...document.querySelectorAll(`#${id} ${kind}`)].map((cell) => cell.textContent));
    return Object.fromEntries(names.map((name, i) => [name, texts[i]]));
  }, list);

  return {
    async "a click leads to the shape and its material, which is hidden and shown alone"() {
      const path = write("pair.pbrt", PAIR);
      const viewer = await view(path);
      const page = await open(viewer.url);
      await done(page);
      const both = await pixels(page);
      // The world of pbrt is left-handed: what is at -x is to the right.
      await click(page, 66, 31);
      await page.waitForSelector("#picked table");
      const told = await page.textContent("#picked");
      assert.match(told, /sphere 0.*red \(diffuse\)/s);
      await page.click("#find-picked");
      const row = page.locator('#tree li[data-shape="0"]');
      assert.equal(await row.locator(".select").getAttribute("aria-pressed"), "true");
      assert.equal(await page.locator('#tree [aria-pressed="true"]').count(), 1);
      await page.click("#edit-picked");
      assert.deepEqual(await page.locator("#parameters .marked legend").allTextContents(), ["material red (diffuse)"]);
      // Hidden is what the scene is without it; the file stays as it is.
      await page.click("#hide-picked");
      await becomes(page, rendered(write("green.pbrt", pair(GREEN))), true);
      assert.equal(await row.locator(".hide").textContent(), "Show");
      await click(page, 66, 31);
      await page.waitForFunction(() => /Nothing is there/.test(document.getElementById("picked").textContent));
      await row.locator(".isolate").click();
      await becomes(page, rendered(write("red.pbrt", pair(RED))), true);
      await page.click("#show-all");
      await becomes(page, both, true);
      assert.equal(readFileSync(path, "utf8"), PAIR, "the scene file is as it was");
      // A model on a stage: neither camera nor ground move when a part is hidden.
      await viewer.stop();
      const staged = await view("--size", "96x64", "--spp", "2", write("tree.glb", model()));
      const other = await open(staged.url);
      await done(other);
      const before = await lookAt(other);
      await other.click("#tree-details > summary");
      assert.match(await other.textContent("#tree"), /square \(mesh\)/);
      await changed(other, () => other.click("#tree .hide"));
      assert.deepEqual(await lookAt(other), before);
      await staged.stop();
    },

    async "lights have colour and power, and the options that make them last"() {
      const path = write("lamps.pbrt", PAIR);
      const viewer = await view(path);
      const page = await open(viewer.url);
      await done(page);
      await page.click("#light-details > summary");
      const lamp = page.locator('#lights [data-path="light.1.intensity"]');
      assert.equal(await lamp.locator("input[type=number]").inputValue(), "20");
      assert.equal(await lamp.locator("legend").textContent(), "light 1 (point)");
      await changed(page, async () => {
        await lamp.locator("input[type=number]").fill("50");
        await page.keyboard.press("Tab");
      });
      await changed(page, () => lamp.locator("input[type=color]").evaluate((input) => {
        input.value = "#3060ff";
        input.dispatchEvent(new Event("input"));
      }));
      await page.waitForFunction(() => document.getElementById("light-options").value !== "");
      const options = await page.inputValue("#light-options");
      assert.match(options, /^-D light\.1\.intensity=[\d.]+,[\d.]+,50$/);
      await becomes(page, rendered(path, "-D", options.slice(3)), true);
      await changed(page, () => lamp.locator("button").click());
      assert.equal(await page.isVisible("#light-options"), false);
      await becomes(page, rendered(path), true);
      assert.equal(readFileSync(path, "utf8"), PAIR);
      await viewer.stop();
    },

    async "lamps are dragged in the picture, by the pointer and by keys"() {
      const path = write("handles.pbrt", PAIR.replace("[0 -5 5]", "[0 -2 2]"));
      const viewer = await view(path);
      const page = await open(viewer.url);
      await done(page);
      const handle = page.locator("#handles button");
      assert.equal(await handle.isVisible(), false, "only while the list is open");
      await page.click("#light-details > summary");
      await handle.waitFor();
      const place = async () => {
        const [box, sheet] = [await handle.boundingBox(), await page.locator("#sheet").boundingBox()];
        const middle = (b) => [b.x + b.width / 2, b.y + b.height / 2];
        const [x, y] = middle(box);
        return { x, y, share: [(x - sheet.x) / sheet.width, (y - sheet.y) / sheet.height] };
      };
      // What the camera of the file has there: along (0, 6, 1), by the slope of its field of view.
      const [eye, lamp, forward, up] = [[0, -8, 1], [0, -2, 2], [0, 8, -1], [0, 1, 8]].map((v, i) => (i < 2 ? v : v.map((x) => x / Math.hypot(...v))));
      const way = lamp.map((x, i) => x - eye[i]);
      const dot = (a, b) => a.reduce((sum, x, i) => sum + x * b[i], 0);
      const height = dot(way, up) / dot(way, forward) / Math.tan((17.5 * Math.PI) / 180);
      const start = await place();
      near(start.share, [0.5, 0.5 - 0.5 * height], 2e-3);
      await changed(page, async () => {
        await page.mouse.move(start.x, start.y);
        await page.mouse.down();
        await page.mouse.move(start.x + 30, start.y + 20, { steps: 3 });
        await page.mouse.up();
      });
      const after = await place();
      near([after.x, after.y], [start.x + 30, start.y + 20], 1.5);
      await page.waitForFunction(() => document.getElementById("light-options").value !== "");
      await handle.focus();
      await changed(page, () => page.keyboard.press("PageUp"));
      await page.waitForTimeout(300);
      const options = await page.inputValue("#light-options");
      assert.match(options, /^-D '?light\.1\.from=/);
      await becomes(page, rendered(path, "-D", options.slice(3).replaceAll("'", "")), true);
      assert.equal(readFileSync(path, "utf8"), PAIR.replace("[0 -5 5]", "[0 -2 2]"));
      await viewer.stop();
    },

    async "standard views look from the sides of the scene, and views are kept"() {
      const viewer = await view(write("views.pbrt", PAIR));
      const page = await open(viewer.url);
      await done(page);
      for (const [key, axis, sign] of [["1", 1, -1], ["Control+1", 1, 1], ["3", 0, 1], ["Control+3", 0, -1], ["7", 2, 1], ["Control+7", 2, -1], ["9", 2, 1]]) {
        await press(page, key);
        const { eye, target, up } = await lookAt(page);
        near(target, [0, 0, 0], 1e-9);
        const distance = Math.hypot(...eye);
        assert.ok(distance > 2.2, key);
        assert.ok(Math.abs(eye[axis] - sign * distance) < 1e-3 * distance, `${key}: ${eye}`);
        assert.ok(axis === 2 ? Math.abs(up[2]) < 1e-2 : Math.abs(up[2] - 1) < 1e-9, `${key}: ${up}`);
      }
      await press(page, "3");
      const kept = await lookAt(page);
      await page.fill("#view-name", "from the right");
      await page.click("#keep-view");
      await press(page, "7");
      await page.getByRole("button", { name: "from the right", exact: true }).click();
      const again = await lookAt(page);
      near(again.eye, kept.eye);
      // Every key of a channel, with Shift.
      await press(page, "Shift+Digit4");
      await page.waitForFunction(() => document.getElementById("channel").value === "depth");
      await page.reload();
      await page.getByRole("button", { name: "from the right", exact: true }).waitFor();
      await page.getByRole("button", { name: "Remove from the right" }).click();
      assert.equal(await page.locator("#kept-views li").count(), 0);
      await viewer.stop();
    },

    async "it measures between two clicks"() {
      const viewer = await view(write("measure.pbrt", PAIR));
      const page = await open(viewer.url);
      await done(page);
      await press(page, "m");
      const points = [];
      for (const [x, y] of [[30, 31], [66, 27]]) {
        await page.evaluate(() => document.getElementById("picked").replaceChildren());
        await click(page, x, y);
        await page.waitForSelector("#picked table");
        points.push((await page.textContent("#picked tr:nth-child(3) td")).split(", ").map(Number));
      }
      const told = await rows(page, "measured");
      const by = points[1].map((x, i) => x - points[0][i]);
      near([told["Along x"], told["Along y"], told["Along z"]].map(Number), by, 1e-4);
      near([Number(told.Distance)], [Math.hypot(...by)], 1e-4);
      assert.ok(Math.abs(by[0]) > 1.5, "from ball to ball");
      assert.deepEqual([await page.locator("#marks circle").count(), await page.locator("#marks line").count()], [2, 1]);
      await page.keyboard.press("ArrowLeft", { delay: 60 });
      assert.equal(await page.locator("#marks *").count(), 0, "the camera has moved");
      await viewer.stop();
    },

    async "a section shows what is behind a plane, and nothing in front of it"() {
      const viewer = await view(write("section.pbrt", PAIR));
      const page = await open(viewer.url);
      await done(page);
      const whole = await pixels(page);
      const position = async () => {
        await page.evaluate(() => document.getElementById("picked").replaceChildren());
        await click(page, 66, 31);
        await page.waitForSelector("#picked table");
        return (await page.textContent("#picked tr:nth-child(3) td")).split(", ").map(Number);
      };
      assert.ok((await position())[1] < -0.5);
      await page.click("#section-details > summary");
      await changed(page, () => page.selectOption("#section-axis", "y"));
      const inside = await position();
      assert.ok(inside[1] > 0.3, `the far side of the ball, from inside: ${inside}`);
      near([Math.hypot(inside[0] + 1.2, inside[1], inside[2])], [1], 1e-4);
      await page.selectOption("#section-axis", "none");
      await becomes(page, whole, true);
      await viewer.stop();
    },

    async "numbers have a range and colours, and the histogram marks what is clipped"() {
      const viewer = await view(write("numbers.pbrt", PAIR));
      const page = await open(viewer.url);
      await done(page);
      assert.equal(await page.isVisible("#map"), false);
      await changed(page, () => page.selectOption("#channel", "depth"));
      const far = Number(await page.inputValue("#range-high"));
      assert.ok(far > 6.9 && far < 9.5, String(far));
      const grey = await pixels(page);
      await changed(page, () => page.selectOption("#map", "viridis"));
      await page.fill("#range-low", "7.2");
      await page.keyboard.press("Tab");
      await page.fill("#range-high", "7.3");
      await changed(page, () => page.keyboard.press("Tab"));
      const at = (all, x, y) => all.slice(2 + 4 * (96 * y + x), 5 + 4 * (96 * y + x));
      // The middle of the ball is nearer than the range, its edge farther.
      const shown = await pixels(page);
      assert.deepEqual(at(shown, 30, 31), [68, 1, 84]);
      assert.deepEqual(at(shown, 47, 2), [0, 0, 0], "nothing is there");
      await page.click("#range-found");
      await page.selectOption("#map", "automatic");
      await becomes(page, grey, true);
      await changed(page, () => page.selectOption("#channel", "beauty"));
      await page.click("#histogram-details > summary");
      await page.waitForFunction(() => /^0\.0 % at white, 0\.0 % black$/.test(document.getElementById("clipped").textContent));
      await changed(page, () => page.evaluate(() => {
        const input = document.getElementById("exposure");
        input.value = "8";
        input.dispatchEvent(new Event("input"));
      }));
      await page.waitForFunction(() => /^100\.0 % at white/.test(document.getElementById("clipped").textContent));
      await page.check("#mark-clipped");
      assert.deepEqual(at(await pixels(page), 30, 31), [255, 0, 60]);
      await page.uncheck("#mark-clipped");
      assert.equal(at(await pixels(page), 30, 31)[0], 255);
      await viewer.stop();
    },

    async "a snapshot is what is shown, under the name of the scene"() {
      const viewer = await view(write("my scene.pbrt", PAIR));
      const page = await open(viewer.url);
      await done(page);
      await changed(page, () => page.selectOption("#channel", "normal"));
      const [download] = await Promise.all([page.waitForEvent("download"), page.click("#snapshot")]);
      assert.equal(download.suggestedFilename(), "my scene.png");
      const saved = PNG.sync.read(readFileSync(await download.path()));
      assert.deepEqual([saved.width, saved.height, ...saved.data], await pixels(page));
      await viewer.stop();
    },

    async "files and folders of every format are opened, and a picture is light"() {
      const words = ["--size", "96x64", "--spp", "2"];
      const viewer = await view(...words);
      const page = await open(viewer.url);
      await page.waitForSelector("#empty:not([hidden])");
      const light = write("sky.pfm", pfm());
      await page.setInputFiles("#open", light);
      await page.waitForFunction(() => /drop a scene first/.test(document.getElementById("alert").textContent));
      const board = writeModel(join(folder, "board"));
      await page.setInputFiles("#open-folder", join(folder, "board"));
      await becomes(page, rendered(...words, board), true);
      assert.equal(await page.textContent("#name"), "board.obj");
      assert.equal(await page.isHidden("#alert"), true);
      const more = "#open-more input:not([webkitdirectory])";
      await page.evaluate(() => document.querySelectorAll("details").forEach((details) => (details.open = true)));
      await page.setInputFiles(more, light);
      await becomes(page, rendered(...words, "--env", light, board), true);
      // Other formats, each in the light that is there.
      const stl = write("part.stl", "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 2 0 0\nvertex 0 2 1\nendloop\nendfacet\nendsolid a\n");
      const ply = write("part.ply", "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n2 0 0\n0 2 1\n3 0 1 2\n");
      for (const path of [stl, ply, write("pair-dropped.pbrt", PAIR), write("later.glb", model())]) {
        await page.setInputFiles(more, path);
        await becomes(page, rendered(...words, "--env", light, path), true);
      }
      await page.setInputFiles(more, write("notes.txt", "nothing"));
      await page.waitForFunction(() => /None of the files is a scene/.test(document.getElementById("alert").textContent));
      await viewer.stop();
    },

    async "what is no scene is refused as render refuses it, before there is a server"() {
      const pipe = join(folder, "pipe.pbrt");
      execFileSync("mkfifo", [pipe]);
      for (const path of ["nope.glb", "nope.xyz", ".", write("words.xyz", "words"), write("car.fbx", "x"), pipe]) {
        const ran = ["view", "render"].map((verb) => spawnSync(
          program, [verb, ...(verb === "view" ? ["--no-open"] : []), path], { encoding: "utf8", cwd: folder, timeout: 20_000 },
        ));
        assert.equal(ran[0].status, ran[1].status, path);
        assert.ok(ran[0].status > 0, path);
        assert.equal(ran[0].stderr, ran[1].stderr);
        assert.equal(ran[0].stdout, "", "no server has an address");
      }
    },

    async "the camera stays above the ground until it is asked, and two fingers pan once"() {
      const viewer = await view("--size", "96x64", "--spp", "2", "--ground", "plane", write("ground.glb", model()));
      const page = await open(viewer.url, { hasTouch: true });
      await done(page);
      const box = await page.locator("#picture").boundingBox();
      const [x, y] = [box.x + box.width / 2, box.y + box.height / 2];
      const drag = async (dx, dy, button = "left") => {
        await page.mouse.move(x, y);
        await page.mouse.down({ button });
        await page.mouse.move(x + dx, y + dy, { steps: 6 });
        await page.mouse.up({ button });
      };
      const ground = -1;
      await drag(0, -300);
      const low = await lookAt(page);
      assert.ok(low.eye[1] > ground && low.eye[1] < ground + 0.5, `above the ground: ${low.eye}`);
      await page.check("#below-ground");
      await drag(0, -80);
      assert.ok((await lookAt(page)).eye[1] < ground, "where it was asked to go");
      await page.click("#reset");
      await done(page);
      // Two fingers that go 40 pixels to the right pan as far as the mouse does.
      await drag(40, 0, "right");
      const byMouse = await lookAt(page);
      await page.click("#reset");
      await done(page);
      const touch = await page.context().newCDPSession(page);
      const fingers = (type, at) => touch.send("Input.dispatchTouchEvent", { type, touchPoints: at.map(([tx, ty], id) => ({ x: tx, y: ty, id })) });
      await fingers("touchStart", [[x - 50, y]]);
      await fingers("touchStart", [[x - 50, y], [x + 50, y]]);
      for (let i = 1; i <= 8; i++) await fingers("touchMove", [[x - 50 + 5 * i, y], [x + 50 + 5 * i, y]]);
      await fingers("touchEnd", [[x + 90, y]]);
      // The finger that is left turns nothing, and is no click.
      const both = await lookAt(page);
      await fingers("touchMove", [[x + 20, y + 30]]);
      await fingers("touchEnd", []);
      const byTouch = await lookAt(page);
      assert.deepEqual(byTouch, both);
      const went = (camera) => camera.target[0];
      assert.ok(Math.abs(went(byMouse)) > 0.05);
      near([went(byTouch)], [went(byMouse)], 0.15 * Math.abs(went(byMouse)));
      await viewer.stop();
    },

    async "other browsers look on by addresses of their own, and change nothing"() {
      const viewer = await view("--share=2", write("shared.pbrt", PAIR));
      const [own, first, second, ...more] = viewer.url.split("\n");
      assert.ok(first && second && more.length === 0 && new Set([own, first, second]).size === 3);
      const page = await open(own);
      const watcher = await open(first);
      await done(page);
      await done(watcher);
      assert.deepEqual(await pixels(watcher), await pixels(page));
      for (const id of ["#exposure", "#edit-details", "#camera-details", "#tree-details", "#pause", "#open-more"]) assert.equal(await watcher.isVisible(id), false, id);
      assert.equal(await watcher.isVisible("#watching"), true);
      assert.equal(await page.isVisible("#watching"), false);
      // It asks what is there, sees what the user does, and its hand moves nothing.
      await click(watcher, 30, 31);
      await watcher.waitForSelector("#picked table");
      const before = await pixels(page);
      await watcher.focus("#picture");
      for (const key of ["ArrowLeft", "w", "Shift+Digit4", "]", "p", "7", "r"]) await watcher.keyboard.press(key, { delay: 40 });
      await changed(watcher, () => page.selectOption("#channel", "normal"));
      await page.selectOption("#channel", "beauty");
      await becomes(page, before, true);
      // Each works once, and is not that of another one.
      const late = await open(first);
      await late.waitForFunction(() => /does not know this page/.test(document.getElementById("alert").textContent));
      await done(await open(second));
      await watcher.reload();
      await done(watcher);
      assert.equal(await watcher.isVisible("#watching"), true, "a session keeps what it may do");
      await viewer.stop();
    },
  };
};
