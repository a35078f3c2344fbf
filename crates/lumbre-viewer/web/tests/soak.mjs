// A viewer for a long time, whose file is edited every second while the camera turns: node tests/soak.mjs MINUTES
import { spawn } from "node:child_process";
import { mkdtempSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";
import { chromium } from "playwright-core";

const root = join(dirname(fileURLToPath(import.meta.url)), "../../../..");
const program = process.env.LUMBRE ?? join(root, "target/release/lumbre");
const executablePath = process.env.CHROMIUM ?? "/usr/bin/chromium";
const minutes = Number(process.argv[2] ?? 60);
const folder = mkdtempSync(join(tmpdir(), "lumbre-soak-"));
const path = join(folder, "scene.pbrt");
const scene = (radius) => `LookAt 1 -7 3  0 0 0.5  0 0 1
Camera "perspective" "float fov" 35
Film "rgb" "integer xresolution" 320 "integer yresolution" 240
Sampler "independent" "integer pixelsamples" 8
WorldBegin
LightSource "infinite" "rgb L" [0.5 0.6 0.7]
Material "diffuse" "rgb reflectance" [0.7 0.2 0.1]
Shape "sphere" "float radius" ${radius}
`;
writeFileSync(path, scene(1.25));
const child = spawn(program, ["view", "--no-open", path], { stdio: ["ignore", "pipe", "inherit"] });
const url = await new Promise((done) => child.stdout.once("data", (bytes) => done(String(bytes).trim())));
const memory = () => Number(/VmRSS:\s+(\d+) kB/.exec(readFileSync(`/proc/${child.pid}/status`, "utf8"))[1]) / 1024;
const browser = await chromium.launch({ executablePath, args: ["--no-sandbox"] });
const page = await browser.newPage();
page.on("pageerror", (error) => console.log(`the page threw: ${error.message}`));
await page.goto(url);
await page.waitForFunction(() => lumbreMeasured.done);
await page.focus("#picture");
// The facts are written anew for each scene that is built, and the alert for each file that is broken.
await page.evaluate(() => {
  globalThis.soak = { reloads: 0, refusals: 0 };
  new MutationObserver(() => (soak.reloads += 1)).observe(document.getElementById("facts"), { childList: true });
  const alert = document.getElementById("alert");
  new MutationObserver(() => (soak.refusals += alert.hidden ? 0 : 1)).observe(alert, { attributeFilter: ["hidden"] });
});
const start = performance.now();
let edits = 0;
async function told() {
  const { reloads, refusals } = await page.evaluate(() => soak);
  return `${edits} edits, ${reloads} reloads, ${refusals} refusals, ${memory().toFixed(1)} MiB`;
}
while (performance.now() - start < minutes * 60_000) {
  edits += 1;
  // Every tenth one is broken.
  writeFileSync(path, edits % 10 === 0 ? scene("") : scene(0.5 + (edits % 20) / 20));
  await page.keyboard.press("ArrowRight", { delay: 60 });
  await page.waitForTimeout(900);
  if (edits % 60 === 1) {
    console.log(`${((performance.now() - start) / 60_000).toFixed(1)} min: ${await told()}`);
  }
}
console.log(`end: ${await told()}, alert hidden: ${await page.isHidden("#alert")}`);
await browser.close();
child.kill("SIGINT");
child.once("exit", () => rmSync(folder, { recursive: true, force: true }));
