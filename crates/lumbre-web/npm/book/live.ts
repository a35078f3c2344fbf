// The live parts of the book: examples, scenes and figures are edited and run where they stand. Without this script the pages are whole.
import { Engine, button } from "./engine.js";
import { example } from "./example.js";
import { FigureOf, isFigured, isNear } from "./figure.js";
import { scene } from "./scene.js";
import { commandsOf } from "./shell.js";
import { word } from "./words.js";

const own = document.currentScript as HTMLScriptElement;
const root = own.src.replace(/live\/live\.js(?:[?#].*)?$/, "");

/** The path of a page's picture or file, from the folder of the book. */
function pathOf(url: string): string | undefined {
  const path = decodeURI(new URL(url, location.href).href);
  const base = decodeURI(root);
  return path.startsWith(base) ? path.slice(base.length) : undefined;
}

function offer(after: Element, path: string, engine: Engine): void {
  const bar = document.createElement("div");
  bar.className = "live-bar";
  const start = button(word("render"), () => {
    const part = scene(path, engine, () => {
      part.remove();
      bar.hidden = false;
      start.focus();
    });
    bar.hidden = true;
    bar.after(part);
    part.querySelector("textarea")?.focus();
  });
  bar.append(start);
  after.after(bar);
}

async function begin(): Promise<void> {
  const content = document.querySelector("main");
  if (!content) return;
  const engine = new Engine(root);
  const blocks = [...content.querySelectorAll<HTMLPreElement>("pre")].filter((block) => block.querySelector("code") && !block.closest(".live"));
  let figured = "";
  for (const block of blocks) {
    if (!block.querySelector("code.language-console")) continue;
    example(block, engine);
    if (!figured) figured = commandsOf(block.textContent ?? "").find(({ command }) => isFigured(command) && isNear(command))?.command ?? "";
  }
  // The first figure of a chapter becomes that of its first ray.
  const drawn = content.querySelector('img[src*="figures/"]')?.closest("p");
  if (figured && drawn) {
    const bar = document.createElement("div");
    bar.className = "live-bar";
    const live = button(word("live"), () => {
      const figure = new FigureOf(figured, engine, () => {
        bar.hidden = false;
        live.focus();
      });
      bar.hidden = true;
      bar.after(figure.element);
      figure.start();
    }, "live-start");
    bar.append(live);
    drawn.after(bar);
  }
  const pictures = [...content.querySelectorAll<HTMLImageElement>("img")].filter((image) => !image.closest(".img-wrapper") && /\.png$/.test(image.src));
  const scenes = blocks.filter((block) => !block.querySelector("code.language-console") && /\b(?:WorldBegin|Shape|Include)\b/.test(block.textContent ?? ""));
  if (pictures.length + scenes.length === 0) return;
  await engine.held.ready();
  const offered = new Set<string>();
  for (const block of scenes) {
    const path = engine.held.pathOf(block.textContent ?? "");
    if (path === undefined || offered.has(path)) continue;
    offered.add(path);
    offer(block, path, engine);
  }
  for (const picture of pictures) {
    const path = pathOf(picture.src)?.replace(/\.png$/, ".pbrt");
    const place = picture.closest("p, td, figure");
    if (path === undefined || offered.has(path) || engine.held.text(path) === undefined || !place || place.matches("td")) continue;
    offered.add(path);
    offer(place, path, engine);
  }
}

if (document.readyState === "loading") document.addEventListener("DOMContentLoaded", () => void begin());
else void begin();
