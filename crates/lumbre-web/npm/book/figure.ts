// A live figure: the sketch of an explanation whose ray, points, radii and other numbers are dragged or typed. Each state is explained
// anew by the program, so what is drawn and written is what it computes.
import { Engine, button, latest, make, said } from "./engine.js";
import { shell } from "./shell.js";
import { language, word } from "./words.js";

type Vector = [number, number, number];

/** Whether a command explains a ray of its own. */
export const isFigured = (command: string): boolean => /lumbre explain .*--ray[ =]/.test(command) && !/^\s*for\s/.test(command);

/** Whether a figure of it is large enough to see: rays from far away are for their numbers. */
export const isNear = (command: string): boolean => (/--ray[ =](\S+)/.exec(command)?.[1] ?? "").split(",").every((x) => Math.abs(Number(x)) < 1000);

/** The marks of the sketch that are parameters of shapes, by the names that pbrt has for them. */
const PARAMETERS: Record<string, string[]> = {
  C: ["center"],
  P: ["point"],
  "P₀": ["p0"],
  "P₁": ["p1"],
  r: ["radius"],
  R: ["majorradius", "radius"],
};

const NUMBER = /[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?/g;
/** Lines of a scene whose numbers are of shapes and where they stand. */
const MOVES = /\b(?:Shape|Translate|Scale|Rotate|Transform|ConcatTransform)\b|^\s*"(?:point3?|vector3?|normal3?|float)\b/;
const OTHERS = /^\s*(?:#|Camera|Film|Sampler|Integrator|LookAt|LightSource|Include|Texture)/;
/** Whether the book's theme is one of the dark ones, which a reader chooses apart from the system. */
const isDark = (): boolean => ["navy", "coal", "ayu"].some((theme) => document.documentElement.classList.contains(theme));
/** Lines longer than this are tables, and not edited here. */
const LONGEST = 400;

/** A number of the scene: the field that holds it, and the parameter that it belongs to. */
interface Field {
  input: HTMLInputElement;
  parameter: string;
}

/** The figure of the ray that a command explains. */
export class FigureOf {
  readonly element: HTMLElement;
  #engine: Engine;
  #command: string;
  #ray: HTMLInputElement[] = [];
  /** The scene as texts between numbers. */
  #pieces: (string | Field)[] = [];
  #path = "";
  #options: Record<string, unknown> = {};
  #root: ShadowRoot;
  #fields = make("div", { className: "live-fields" });
  #wrong = make("p", { className: "live-wrong", role: "status" });
  #same = make("code", { className: "live-same" });
  #update: () => void;

  constructor(command: string, engine: Engine, close: () => void) {
    this.#command = command;
    this.#engine = engine;
    const host = make("div", { className: "live-sketch" });
    this.#root = host.attachShadow({ mode: "open" });
    this.element = make("section", { className: "live live-figure", "aria-label": word("live") },
      make("p", { className: "live-hint", textContent: word("drag") }), this.#fields, this.#wrong, host, make("p", { className: "live-hint" }, this.#same),
      make("div", { className: "live-bar" },
        button(word("reset"), () => this.start()),
        button(word("close"), () => {
          this.element.remove();
          close();
        })));
    const run = latest(() => this.#draw());
    this.#update = () => run(undefined);
    this.#root.addEventListener("pointerdown", (event) => this.#grab(event as PointerEvent));
  }

  /** Begins with what the command has. */
  start(): void {
    void (async () => {
      try {
        let found: { path: string; options: Record<string, unknown> } | undefined;
        const no = () => Promise.resolve("");
        await this.#engine.held.ready();
        await shell(this.#command, { math: no, cast: no, explain: async (path, options) => ((found = { path, options }), "") }, this.#engine.held);
        if (!found) throw new Error(word("nothing"));
        const { only: _, format: _f, sample: _s, ...options } = found.options;
        this.#options = { ...options, nearest: true, only: ["surfaces"], format: "html", lang: language() };
        this.#path = found.path;
        this.#lay(found.options["ray"] as number[], await this.#engine.held.read(found.path));
        this.#update();
      } catch (error) {
        this.#wrong.textContent = said(error);
      }
    })();
  }

  #number(value: string, label: string): HTMLInputElement {
    const input = make("input", { type: "text", inputMode: "decimal", className: "live-number", value, size: Math.max(4, value.length), "aria-label": label, autocomplete: "off" });
    const step = () => 10 ** (Math.floor(Math.log10(Math.max(Math.abs(Number(input.value)) || 0, 0.5))) - 1);
    const set = (x: number, unit: number) => {
      input.value = String(Number((Math.round(x / unit) * unit).toPrecision(10)));
      input.size = Math.max(4, input.value.length);
      this.#update();
    };
    input.addEventListener("input", () => this.#update());
    input.addEventListener("keydown", (event) => {
      const way = { ArrowUp: 1, ArrowDown: -1 }[event.key];
      if (!way || !Number.isFinite(Number(input.value))) return;
      event.preventDefault();
      const unit = step() * (event.shiftKey ? 0.1 : 1);
      set(Number(input.value) + way * unit, unit);
    });
    let from: { x: number; value: number; unit: number } | undefined;
    input.addEventListener("pointerdown", (event) => {
      if (Number.isFinite(Number(input.value))) from = { x: event.clientX, value: Number(input.value), unit: step() / 5 };
      input.setPointerCapture(event.pointerId);
    });
    input.addEventListener("pointermove", (event) => {
      if (!from || Math.abs(event.clientX - from.x) < 4) return;
      event.preventDefault();
      set(from.value + Math.round((event.clientX - from.x) / 2) * from.unit, from.unit);
    });
    for (const end of ["pointerup", "pointercancel"]) input.addEventListener(end, () => (from = undefined));
    return input;
  }

  /** Puts the numbers of the ray and of the scene into fields. */
  #lay(ray: number[], text: string): void {
    this.#fields.replaceChildren();
    this.#ray = ray.map((x, i) => this.#number(String(x), `${word("ray")} ${i < 3 ? "O" : i < 6 ? "D" : "t"} ${"xyz"[i % 3]}`));
    const group = (name: string, inputs: HTMLInputElement[]) => make("span", { className: "live-group" }, `${name} = (`, ...inputs.flatMap((input, i) => (i ? [", ", input] : [input])), ")");
    this.#fields.append(make("div", { className: "live-source" }, group(word("origin"), this.#ray.slice(0, 3)), " ", group(word("direction"), this.#ray.slice(3, 6))));
    this.#pieces = [];
    // A sphere without a radius has that of 1, which is to be seen.
    const whole = text.replace(/Shape "sphere"(?![^\n]*"float radius")/g, 'Shape "sphere" "float radius" 1');
    for (const line of whole.split(/(?<=\n)/)) {
      const code = line.replace(/#.*/, (comment) => " ".repeat(comment.length));
      const isOurs = MOVES.test(code) && !OTHERS.test(code) && line.length < LONGEST;
      if (!isOurs) {
        this.#pieces.push(line);
        continue;
      }
      const shown = make("div", { className: "live-source" });
      // Numbers in quotes are parts of names.
      const bare = code.replace(/"[^"]*"/g, (quoted) => " ".repeat(quoted.length));
      let done = 0;
      let count = 0;
      for (const found of bare.matchAll(NUMBER)) {
        const before = line.slice(done, found.index);
        const parameter = /"\w+ (\w+)"\s*\[?[^"]*$/.exec(line.slice(0, found.index))?.[1] ?? /(\w+)[^"\w]*[-\d.\s]*$/.exec(code.slice(0, found.index))?.[1] ?? "";
        const input = this.#number(found[0], word("number", parameter, ++count));
        this.#pieces.push(before, { input, parameter });
        shown.append(before, input);
        done = found.index + found[0].length;
      }
      this.#pieces.push(line.slice(done));
      shown.append(line.slice(done));
      if (count) this.#fields.append(shown);
    }
  }

  async #draw(): Promise<void> {
    const text = this.#pieces.map((piece) => (typeof piece === "string" ? piece : piece.input.value)).join("");
    const ray = this.#ray.map((input) => (input.value.trim() === "" ? NaN : Number(input.value)));
    const options = { ...this.#options, ray };
    try {
      if (!ray.every(Number.isFinite)) throw new Error(`${word("ray")}: ${this.#ray.map((input) => input.value).join(",")}`);
      const page = await this.#engine.explain(this.#path, options, text);
      this.#wrong.textContent = "";
      this.#show(page);
      this.#same.textContent = `lumbre explain ${this.#path} --ray ${ray.join(",")} --nearest --only surfaces --format html${language() === "es" ? " --lang es" : ""}`;
      (this.element as HTMLElement & { explained?: unknown }).explained = { page, text, ray };
      this.element.dataset["frames"] = String(Number(this.element.dataset["frames"] ?? 0) + 1);
    } catch (error) {
      // The last figure stays.
      this.#wrong.textContent = said(error);
    }
    // No faster than what is seen.
    await new Promise((go) => requestAnimationFrame(go));
  }

  #show(page: string): void {
    const found = new DOMParser().parseFromString(page, "text/html");
    const at = this.#root.querySelector<HTMLInputElement>(".slider input")?.value;
    const focused = this.#root.activeElement?.closest("[data-mark]")?.getAttribute("data-mark");
    const style = make("style", { textContent: `${(found.querySelector("style")?.textContent ?? "").replace(/:root/g, ":host").replace("color-scheme: light dark;", `color-scheme: ${isDark() ? "dark" : "light"};`).replace(/\bbody\b/g, ".body").replace(/\bhtml\b/g, ".none")}
:host { display: block; } .body { margin: 0; max-width: none; padding: 0 0 1rem; background: transparent; font-size: 15px; } h1, #steps { display: none !important; }
.figured > details > figure { position: static !important; } .sketch [data-mark="O"], .sketch [data-mark="D"], .sketch .mark { cursor: grab; } .sketch .moving { pointer-events: none; } .sketch { touch-action: none; }` });
    const body = make("div", { className: "body" });
    const main = found.querySelector("main");
    const steps = found.getElementById("steps");
    // The page that it stands in has a main part already.
    if (main) body.append(...[...main.childNodes].map((node) => document.adoptNode(node)));
    if (steps) body.append(document.adoptNode(steps));
    this.#root.replaceChildren(style, body);
    const code = found.querySelector("script")?.textContent ?? "";
    // The script of the explanation, which adds the slider, in the figure in place of a page.
    const inside = { querySelectorAll: (sought: string) => this.#root.querySelectorAll(sought), getElementById: (id: string) => this.#root.getElementById(id) };
    new Function("document", "addEventListener", code)(inside, () => {});
    const slider = this.#root.querySelector<HTMLInputElement>(".slider input");
    if (slider && at !== undefined) {
      slider.value = at;
      slider.dispatchEvent(new Event("input"));
    }
    if (focused) this.#root.querySelector<HTMLElement>(`[data-mark="${CSS.escape(focused)}"]`)?.focus();
  }

  /** Takes hold of a mark of a sketch. */
  #grab(event: PointerEvent): void {
    const path = event.composedPath().filter((one): one is Element => one instanceof Element);
    const svg = path.find((one) => one.matches("svg.sketch")) as SVGSVGElement | undefined;
    const mark = path.find((one) => one.matches("[data-mark]"));
    const key = mark?.getAttribute("data-mark") ?? "";
    const view = svg?.dataset["view"]?.split(" ").map(Number);
    if (!svg || !mark || view?.length !== 8 || !view.every(Number.isFinite)) return;
    const box = svg.getBoundingClientRect();
    const unit = svg.viewBox.baseVal.width / box.width;
    const [zx, zy, ...steps] = view as [number, number, ...number[]];
    const [across, down] = [0, 1].map((i) => [0, 2, 4].map((axis) => steps[axis + i]!)) as [Vector, Vector];
    const size = across.reduce((sum, x) => sum + x * x, 0);
    const fine = 10 ** Math.floor(Math.log10(1 / Math.sqrt(size)));
    /** What a move in the drawing is in the space, across the view. */
    const moved = (x: number, y: number) => [0, 1, 2].map((axis) => (x * across[axis]! + y * down[axis]!) / size) as Vector;
    const round = (x: number) => String(Number((Math.round(x / fine) * fine).toPrecision(10)));
    const isWorld = svg === svg.closest("figure")?.querySelector("svg.sketch");
    const put = (inputs: HTMLInputElement[], from: number[], by: Vector, factor = 1) => inputs.forEach((input, i) => (input.value = round(from[i]! + factor * by[i]!)));
    const ray = this.#ray.map((input) => Number(input.value));
    const [ox, oy] = [(event.clientX - box.left) * unit, (event.clientY - box.top) * unit];
    const flat = (p: number[]) => [zx + p.reduce((sum, x, i) => sum + x * across[i]!, 0), zy + p.reduce((sum, x, i) => sum + x * down[i]!, 0)] as const;
    let act: ((x: number, y: number) => void) | undefined;
    if (key === "O" && isWorld) act = (x, y) => put(this.#ray.slice(0, 3), ray.slice(0, 3), moved(x, y));
    else if (key === "D" && isWorld) {
      const start = flat(ray.slice(0, 3));
      const tip = flat([0, 1, 2].map((i) => ray[i]! + ray[i + 3]!));
      const step = [tip[0] - start[0], tip[1] - start[1]] as const;
      const t = ((ox - start[0]) * step[0] + (oy - start[1]) * step[1]) / (step[0] ** 2 + step[1] ** 2 || 1);
      if (Math.abs(t) > 1e-3) act = (x, y) => put(this.#ray.slice(3, 6), ray.slice(3, 6), moved(x, y), 1 / t);
    } else {
      const fields = this.#fieldsOf(PARAMETERS[key] ?? []);
      const values = fields.map((input) => Number(input.value));
      if (fields.length === 3) act = (x, y) => put(fields, values, moved(x, y));
      else if (fields.length === 1) {
        // A radius follows the distance from where it is drawn from.
        const points = mark.querySelector("polyline")?.getAttribute("points") ?? "";
        const line = mark.querySelector("line");
        const [cx, cy] = line ? [Number(line.getAttribute("x1")), Number(line.getAttribute("y1"))] : points.split(/[\s,]+/).slice(0, 2).map(Number) as [number, number];
        const first = Math.hypot(ox - cx, oy - cy);
        if (first > 1) act = (x, y) => (fields[0]!.value = round(Math.max(fine, (values[0]! * Math.hypot(ox + x - cx, oy + y - cy)) / first)));
      }
    }
    if (!act) return;
    event.preventDefault();
    const follow = (to: PointerEvent) => {
      act!((to.clientX - event.clientX) * unit, (to.clientY - event.clientY) * unit);
      this.#update();
    };
    const end = () => {
      window.removeEventListener("pointermove", follow);
      window.removeEventListener("pointerup", end);
      window.removeEventListener("pointercancel", end);
    };
    window.addEventListener("pointermove", follow);
    window.addEventListener("pointerup", end);
    window.addEventListener("pointercancel", end);
  }

  /** The fields of a parameter that stands in the scene once. */
  #fieldsOf(names: string[]): HTMLInputElement[] {
    for (const name of names) {
      const found = this.#pieces.flatMap((piece) => (typeof piece !== "string" && piece.parameter === name ? [piece.input] : []));
      if (found.length === 1 || found.length === 3) return found;
    }
    return [];
  }
}
