// How soon a page shows a change, and how many frames a second while the camera turns: node tests/measure.mjs SCENE…
import { spawn } from "node:child_process";
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

for (const scene of process.argv.slice(2)) {
  const child = spawn(program, ["view", "--no-open", "--size", "1280x720", scene], { stdio: ["ignore", "pipe", "inherit"] });
  const url = await new Promise((done) => child.stdout.once("data", (bytes) => done(String(bytes).trim())));
  const page = await browser.newPage({ viewport: { width: 1600, height: 900 } });
  page.setDefaultTimeout(300_000);
  await page.goto(url);
  await page.waitForFunction(() => lumbreMeasured.spp > 0);
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
  console.log(`${scene}: first pixels after ${ms(single)}; while turning ${((1000 * frames) / (to - from)).toFixed(1)} frames/s, ${ms(dragged)}`);
  await page.close();
  child.kill("SIGINT");
  await new Promise((done) => child.once("exit", done));
}
await browser.close();
