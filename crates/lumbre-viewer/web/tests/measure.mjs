// How soon a page shows a picture and one without noise, from the start of the program; how soon it shows a change, and how many frames a second while the camera turns: node tests/measure.mjs SCENE…
// The word "million" stands for a ball with waves, of a million triangles.
import { spawn } from "node:child_process";
import { mkdtempSync, rmSync, writeFileSync } from "node:fs";
import { loadavg, tmpdir } from "node:os";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";
import { chromium } from "playwright-core";

const root = join(dirname(fileURLToPath(import.meta.url)), "../../../..");
const program = process.env.LUMBRE ?? join(root, "target/release/lumbre");
const executablePath = process.env.CHROMIUM ?? "/usr/bin/chromium";
const SECONDS = 8;
const browser = await chromium.launch({ executablePath, args: ["--no-sandbox"] });
const sorted = (numbers) => [...numbers].sort((a, b) => a - b);
const share = (numbers, part) => sorted(numbers)[Math.min(numbers.length - 1, Math.floor(part * numbers.length))] ?? NaN;

/** Writes the ball: rings of squares, each of two triangles. */
function million(path) {
  const [rings, round] = [500, 1000];
  const head = `ply\nformat binary_little_endian 1.0\nelement vertex ${(rings + 1) * round}\nproperty float x\nproperty float y\nproperty float z\n`
    + `element face ${2 * rings * round}\nproperty list uchar uint vertex_indices\nend_header\n`;
  const vertices = new Float32Array(3 * (rings + 1) * round);
  const faces = Buffer.alloc(13 * 2 * rings * round);
  let face = 0;
  for (let i = 0; i <= rings; i++) {
    for (let j = 0; j < round; j++) {
      const [theta, phi] = [(Math.PI * i) / rings, (2 * Math.PI * j) / round];
      const radius = 1 + 0.05 * Math.sin(theta) * Math.sin(20 * theta) * Math.sin(24 * phi);
      vertices.set([radius * Math.sin(theta) * Math.cos(phi), radius * Math.cos(theta), radius * Math.sin(theta) * Math.sin(phi)], 3 * (i * round + j));
      if (i === rings) continue;
      const [a, b] = [i * round + j, i * round + ((j + 1) % round)];
      for (const corners of [[a, b, a + round], [b, b + round, a + round]]) {
        faces[face] = 3;
        corners.forEach((corner, k) => faces.writeUInt32LE(corner, face + 1 + 4 * k));
        face += 13;
      }
    }
  }
  writeFileSync(path, Buffer.concat([Buffer.from(head), Buffer.from(vertices.buffer), faces]));
}

const folder = mkdtempSync(join(tmpdir(), "lumbre-measure-"));
const scenes = process.argv.slice(2).map((word) => (word === "million" ? join(folder, "million.ply") : word));
if (process.argv.includes("million")) million(join(folder, "million.ply"));
for (const scene of scenes) {
  const started = Date.now();
  const child = spawn(program, ["view", "--no-open", "--size", "1280x720", scene], { stdio: ["ignore", "pipe", "inherit"] });
  const url = await new Promise((done) => child.stdout.once("data", (bytes) => done(String(bytes).trim())));
  const page = await browser.newPage({ viewport: { width: 1600, height: 900 } });
  page.setDefaultTimeout(300_000);
  await page.goto(url);
  await page.waitForFunction(() => lumbreMeasured.spp > 0);
  const [first, denoised] = await page.evaluate(() => [lumbreMeasured.first, lumbreMeasured.firstDenoised].map((at) => at && at + performance.timeOrigin));
  const since = (at) => (at ? `${(at - started).toFixed(0)} ms` : "never");
  const box = await page.locator("#picture").boundingBox();
  const [x, y] = [box.x + box.width / 2, box.y + box.height / 2];
  // One change at a time, while the picture is being refined.
  await page.mouse.move(x, y);
  for (let i = 0; i < 12; i++) {
    await page.waitForTimeout(400);
    await page.focus("#picture");
    await page.mouse.wheel(0, i % 2 ? 60 : -60);
  }
  await page.waitForTimeout(600);
  const single = await page.evaluate(() => lumbreMeasured.latencies.splice(0));
  await page.mouse.move(x, y);
  await page.mouse.down();
  const from = await page.evaluate(() => performance.now());
  for (const start = performance.now(); performance.now() - start < 1000 * SECONDS; ) {
    const turn = (performance.now() - start) / 1000;
    await page.mouse.move(x + 200 * Math.sin(turn), y + 40 * Math.cos(turn));
    await page.waitForTimeout(8);
  }
  const [dragged, frames, to] = await page.evaluate((since) => [
    lumbreMeasured.latencies, lumbreMeasured.frames.filter((at) => at > since).length, performance.now(),
  ], from);
  await page.mouse.up();
  const ms = (numbers) => `${share(numbers, 0.5).toFixed(0)} ms (95 %: ${share(numbers, 0.95).toFixed(0)} ms, of ${numbers.length})`;
  console.log(`${scene}: first picture after ${since(first)}, first without noise after ${since(denoised)}`);
  console.log(`${scene}, with a load of ${loadavg()[0].toFixed(1)}: first pixels after ${ms(single)}; while turning ${((1000 * frames) / (to - from)).toFixed(1)} frames/s, ${ms(dragged)}`);
  await page.close();
  child.kill("SIGINT");
  await new Promise((done) => child.once("exit", done));
}
await browser.close();
rmSync(folder, { recursive: true });
