// A scene of the book that is edited and rendered where it stands.
import type { Renderer } from "../src/renderer.js";
import { LumbreError, type Pass, type Problem } from "../src/types.js";
import { fragment } from "../playground/share.js";
import { Engine, button, latest, make, said } from "./engine.js";
import { language, word } from "./words.js";

const TYPED = 350;
/** The most pixels along the longer side, so that a picture is soon there. */
const LONGER = 480;

/** The scene of this path in a part of the page, which `close` takes away. */
export function scene(path: string, engine: Engine, close: () => void): HTMLElement {
  const part = make("section", { className: "live live-scene", "aria-label": path });
  const text = make("textarea", { className: "live-text", spellcheck: false, "aria-label": word("scene"), wrap: "off", rows: 12, "autocapitalize": "off" });
  const wrong = make("pre", { className: "live-wrong", role: "alert", hidden: true });
  const canvas = make("canvas", { width: 4, height: 3, tabIndex: 0, role: "application", "aria-label": word("picture"), className: "live-picture" });
  const mark = make("div", { className: "live-mark", hidden: true });
  const progress = make("p", { className: "live-progress", role: "status", textContent: word("loading") });
  const answer = make("div", { className: "live-answer", hidden: true });
  const link = make("a", { textContent: word("playground"), href: `${engine.playground}index.html` });
  part.append(
    wrong,
    make("div", { className: "live-two" }, text, make("div", {}, make("div", { className: "live-frame" }, canvas, mark), progress)),
    make("p", { className: "live-hint", textContent: word("hint") }),
    answer,
  );
  let problem: Problem | undefined;
  let [size, at] = [[0, 0] as [number, number], [0, 0] as [number, number]];
  const context = canvas.getContext("2d")!;
  const show = (pass: Pass, pixels: Uint8ClampedArray<ArrayBuffer>) => {
    const [x0, y0, x1, y1] = pass.bounds;
    if (canvas.width !== pass.size[0] || canvas.height !== pass.size[1]) [canvas.width, canvas.height] = pass.size;
    context.putImageData(new ImageData(pixels, x1 - x0, y1 - y0), x0, y0);
    part.dataset["state"] = pass.done ? "done" : "rendering";
    if (problem) return;
    progress.textContent = pass.done ? word("done", pass.spp) : pass.spp > 0 ? word("rendering", pass.spp, pass.target) : word("coarse");
  };
  const tell = (error?: unknown) => {
    problem = error instanceof LumbreError ? error.problem : error ? { kind: "crash", message: said(error) } : undefined;
    wrong.hidden = !problem;
    wrong.textContent = problem ? `${problem.message}\n` : "";
    if (problem) text.setAttribute("aria-invalid", "true");
    else text.removeAttribute("aria-invalid");
    if (problem) progress.textContent = word("stopped");
  };
  let renderer: Promise<Renderer> | undefined;
  const open = latest(async () => {
    try {
      renderer ??= engine.renderer(show, tell);
      const [ready, files] = await Promise.all([renderer, engine.held.scene(path, text.value)]);
      part.dataset["state"] = "opening";
      let opened = await ready.open(files, path);
      const scale = LONGER / Math.max(opened.width, opened.height);
      if (scale < 1) {
        const smaller = [opened.width, opened.height].map((side) => Math.max(1, Math.round(side * scale))) as [number, number];
        opened = await ready.open(files, path, { size: smaller });
      }
      size = [opened.width, opened.height];
      tell();
    } catch (error) {
      // The last picture stays, and is not rendered on.
      (await renderer?.catch(() => undefined))?.stop();
      part.dataset["state"] = "wrong";
      tell(error);
    }
    link.href = `${engine.playground}index.html${await fragment({ text: text.value, example: "" })}`;
    // Files beside the scene are not in a link.
    link.hidden = Object.keys(await engine.held.scene(path, text.value)).length > 1;
  });
  const explain = latest(async ([x, y]: [number, number]) => {
    [mark.hidden, mark.style.left, mark.style.top] = [false, `${(100 * (x + 0.5)) / size[0]}%`, `${(100 * (y + 0.5)) / size[1]}%`];
    at = [x, y];
    const title = word("pixel", x, y);
    try {
      const found = await (await renderer!).explain({ pixel: [x, y], format: "html", lang: language(), nearest: true });
      // It runs nothing: names in it may be anyone's.
      answer.replaceChildren(make("iframe", { title, srcdoc: found, sandbox: "" }));
    } catch (error) {
      answer.replaceChildren(make("pre", { textContent: said(error) }));
    }
    answer.hidden = false;
  });
  canvas.addEventListener("click", (event) => {
    const box = canvas.getBoundingClientRect();
    const along = (from: number, length: number, count: number) => Math.max(0, Math.min(count - 1, Math.floor((from / length) * count)));
    if (size[0]) explain([along(event.clientX - box.left, box.width, size[0]), along(event.clientY - box.top, box.height, size[1])]);
  });
  canvas.addEventListener("keydown", (event) => {
    const step = event.shiftKey ? 1 : 8;
    const by = { ArrowLeft: [-step, 0], ArrowRight: [step, 0], ArrowUp: [0, -step], ArrowDown: [0, step], Enter: [0, 0] }[event.key];
    if (!by || !size[0] || event.ctrlKey || event.altKey || event.metaKey) return;
    event.preventDefault();
    const moved = mark.hidden ? size.map((side) => Math.floor(side / 2)) : [at[0] + by[0]!, at[1] + by[1]!];
    explain(moved.map((place, i) => Math.max(0, Math.min(size[i]! - 1, place))) as [number, number]);
  });
  let typing = 0;
  text.addEventListener("input", () => {
    clearTimeout(typing);
    typing = window.setTimeout(() => open(undefined), TYPED);
  });
  let own = "";
  part.append(make("div", { className: "live-bar" },
    button(word("reset"), () => {
      text.value = own;
      open(undefined);
    }),
    button(word("close"), () => {
      void renderer?.then((ready) => ready.close(), () => {});
      close();
    }),
    link));
  void engine.held.read(path).then((found) => {
    text.value = own = found;
    open(undefined);
  }, tell);
  return part;
}
