// The playground: a scene is edited, seen while it is rendered, explained, and shared by a link.
import { LumbreError, type Pass, type Problem, type SceneFiles } from "../src/types.js";
import { Renderer } from "../src/renderer.js";
import { hasCamera, moved } from "./camera.js";
import { NotLoaded, module, script } from "./loading.js";
import { type Shared, fragment, fromBase64, fromFragment } from "./share.js";
import { type Language, type Word, speak, spoken, word } from "./words.js";

declare const WORKER: string;

const at = <T extends HTMLElement>(id: string) => document.getElementById(id) as T;
const text = at<HTMLTextAreaElement>("text");
const canvas = at<HTMLCanvasElement>("picture");
const progress = at("progress");
const context = canvas.getContext("2d")!;

const SCENE = "scene.pbrt";
const FIRST_EXAMPLE = "cornell";
const EXAMPLES = ["cornell", "glass", "shapes", "csg", "capsule", "still-life", "motion", "mesh", "field"];
/** Milliseconds after the last key until the scene is read. */
const TYPED = 350;

/** Files besides the text, by path. */
let files: SceneFiles = {};
/** The example that they are of; empty where they were opened. */
let example = "";
/** The file that is shown as it is, where it is not the text. */
let shownFile = "";
/** The size of the scene's own picture. */
let own: [number, number] = [0, 0];
/** The full size of the picture that is shown; for tests, too, with what they wait for. */
const state = { width: 0, height: 0, done: false, wrong: "", passes: 0, opened: 0 };
(window as unknown as { playground: typeof state }).playground = state;
let wrong: Problem | undefined;
let renderer: Renderer | undefined;
let started = 0;
let told: () => void = () => {};

function say(name: Word, ...parts: (string | number)[]): void {
  told = () => (progress.textContent = word(name, ...parts));
  told();
}

// --- Scripts of the folder, which a page that is opened from a file may load too.

const given = window as unknown as {
  lumbreExample: (name: string, files: Record<string, string>) => void;
};

async function load(name: string): Promise<SceneFiles> {
  let loaded: SceneFiles | undefined;
  given.lumbreExample = (_, base64) => {
    loaded = Object.fromEntries(Object.entries(base64).map(([path, packed]) => [path, fromBase64(packed)]));
  };
  await script(`examples/${name}.js`).catch(() => {});
  if (!loaded) throw new Error(word("no example"));
  return loaded;
}

// --- The editor.

function number(): void {
  const count = text.value.split("\n").length;
  const lines = at("lines");
  const here = wrong?.file === SCENE ? wrong.line : undefined;
  lines.replaceChildren();
  for (let line = 1; line <= count; line++) {
    if (line === here) {
      const mark = document.createElement("span");
      mark.className = "wrong";
      mark.textContent = String(line);
      lines.append(mark, "\n");
    } else {
      lines.append(`${line}\n`);
    }
  }
  lines.scrollTop = text.scrollTop;
}

/** The place of the problem in the text: the column counts characters, and the text units of UTF-16. */
function place(): number | undefined {
  if (wrong?.file !== SCENE || wrong.line === undefined) return undefined;
  const lines = text.value.split("\n");
  const before = lines.slice(0, wrong.line - 1).reduce((sum, line) => sum + line.length + 1, 0);
  const column = Array.from(lines[wrong.line - 1] ?? "").slice(0, (wrong.column ?? 1) - 1).join("").length;
  return before + column;
}

function tell(problem: Problem | undefined): void {
  wrong = problem;
  state.wrong = problem?.message ?? "";
  at("wrong").hidden = !problem;
  at("wrong-text").textContent = problem?.message ?? "";
  const where = place();
  at("wrong-go").hidden = where === undefined;
  if (where === undefined) text.removeAttribute("aria-invalid");
  else text.setAttribute("aria-invalid", "true");
  number();
}

function list(): void {
  const names = Object.keys(files);
  const held = at("held");
  held.hidden = names.length === 0 && !shownFile;
  held.textContent = shownFile ? word("shown", shownFile) : word("held", names.join(", "));
}

// --- Rendering.

function toProblem(error: unknown): Problem {
  if (error instanceof LumbreError) return error.problem;
  if (error instanceof NotLoaded) {
    return { kind: "files", message: error.why === "script" ? word("no script") : word("no module", error.why) };
  }
  return { kind: "crash", message: error instanceof Error ? error.message : String(error) };
}

let busy = false;
let again = false;
/** How often an explanation was asked for. */
let asked = 0;

/** Opens the scene as it stands; while one is being opened, the last that is asked for waits. */
async function open(): Promise<void> {
  if (busy || !renderer) {
    again = true;
    return;
  }
  busy = true;
  do {
    again = false;
    const name = shownFile || SCENE;
    const all = shownFile ? files : { ...files, [SCENE]: text.value };
    const scale = Number(at<HTMLSelectElement>("resolution").value);
    state.done = false;
    try {
      let opened = await renderer.open(all, name);
      own = [opened.width, opened.height];
      if (scale !== 1) {
        const size = own.map((side) => Math.max(1, Math.round(side * scale))) as [number, number];
        opened = await renderer.open(all, name, { size });
      }
      [state.width, state.height] = [opened.width, opened.height];
      started = performance.now();
      // Passes of the scene before came before this.
      state.done = false;
      state.opened++;
      tell(undefined);
      warn(opened.warnings);
      bound();
      say("coarse");
      at("hint").textContent = word(hasCamera(text.value) && !shownFile ? "hint" : "no camera");
    } catch (error) {
      // The picture before stays, and is not rendered on.
      tell(toProblem(error));
      renderer.stop();
      say("stopped");
    }
  } while (again);
  busy = false;
}

function warn(warnings: string[]): void {
  const element = at<HTMLDetailsElement>("warned");
  element.hidden = warnings.length === 0;
  element.querySelector("summary")!.textContent = word("warnings", warnings.length);
  element.querySelector("pre")!.textContent = warnings.join("\n");
}

function bound(): void {
  for (const [id, size] of [["x", state.width], ["y", state.height]] as const) {
    const input = at<HTMLInputElement>(id);
    input.max = String(size - 1);
    // The middle, until a pixel is chosen that there is.
    if (asked === 0 || Number(input.value) >= size) input.value = String(Math.floor(size / 2));
  }
}

function show(pass: Pass, pixels: Uint8ClampedArray<ArrayBuffer>): void {
  const [width, height] = pass.size;
  const [x0, y0, x1, y1] = pass.bounds;
  if (canvas.width !== width || canvas.height !== height) {
    [canvas.width, canvas.height] = [width, height];
    fit();
  }
  context.putImageData(new ImageData(pixels, x1 - x0, y1 - y0), x0, y0);
  state.passes++;
  state.done = pass.done;
  if (wrong) return;
  const seconds = ((performance.now() - started) / 1000).toFixed(1);
  if (pass.done) say("done", pass.spp, width, height, seconds);
  else if (pass.spp > 0) say("rendering", pass.spp, pass.target);
}

/** Shows each pixel of a small picture as a square of several, so that one can be met. */
function fit(): void {
  const room = at("picture-side").clientWidth;
  const times = Math.floor(Math.min(room / canvas.width, (0.6 * innerHeight) / canvas.height));
  canvas.classList.toggle("large", times > 1);
  canvas.style.width = times > 1 ? `${times * canvas.width}px` : "";
}
window.addEventListener("resize", fit);

// --- Explanations.

async function explain(x: number, y: number): Promise<void> {
  if (!renderer) return;
  at<HTMLInputElement>("x").value = String(x);
  at<HTMLInputElement>("y").value = String(y);
  mark(x, y);
  const format = at<HTMLSelectElement>("format").value as "html" | "text" | "json";
  const id = ++asked;
  const lang = spoken();
  const answer = at("answer");
  let found: string;
  try {
    found = await renderer.explain({ pixel: [x, y], format, lang });
  } catch (error) {
    found = toProblem(error).message;
  }
  if (id !== asked) return;
  answer.replaceChildren();
  if (format === "html" && found.startsWith("<!")) {
    const frame = document.createElement("iframe");
    frame.title = word("explanation");
    // It runs nothing: names in it are those of a scene that may be anyone's.
    frame.setAttribute("sandbox", "");
    frame.srcdoc = found;
    answer.append(frame);
  } else {
    const pre = document.createElement("pre");
    pre.textContent = found;
    answer.append(pre);
  }
  answer.hidden = false;
  const size = state.width === own[0] && state.height === own[1] ? "" : ` --size ${state.width}x${state.height}`;
  const language = lang === "en" ? "" : ` --lang ${lang}`;
  const as = format === "text" ? "" : ` --format ${format}`;
  const command = at("command");
  command.hidden = false;
  command.querySelector("code")!.textContent = `lumbre explain ${shownFile || SCENE} --pixel ${x},${y}${size}${as}${language}`;
}

function mark(x: number, y: number): void {
  const spot = at("mark");
  spot.hidden = false;
  spot.style.left = `${(100 * (x + 0.5)) / state.width}%`;
  spot.style.top = `${(100 * (y + 0.5)) / state.height}%`;
}

function pixel(event: { clientX: number; clientY: number }): [number, number] {
  const box = canvas.getBoundingClientRect();
  const along = (from: number, size: number, count: number) => Math.max(0, Math.min(count - 1, Math.floor((from / size) * count)));
  return [along(event.clientX - box.left, box.width, state.width), along(event.clientY - box.top, box.height, state.height)];
}

// --- The camera.

function turn(around: number, over: number, distance = 1): void {
  if (shownFile) return;
  const changed = moved(text.value, around, over, distance);
  if (changed === undefined) return;
  const { scrollTop, selectionStart, selectionEnd } = text;
  text.value = changed;
  text.scrollTop = scrollTop;
  text.setSelectionRange(selectionStart, selectionEnd);
  void open();
}

const fingers = new Map<number, PointerEvent>();
let dragged = false;
canvas.addEventListener("pointerdown", (event) => {
  canvas.setPointerCapture(event.pointerId);
  fingers.set(event.pointerId, event);
  if (fingers.size === 1) dragged = false;
});
canvas.addEventListener("pointermove", (event) => {
  const before = fingers.get(event.pointerId);
  if (!before) return;
  const [x, y] = [event.clientX - before.clientX, event.clientY - before.clientY];
  if (!dragged && Math.hypot(x, y) < 5) return;
  dragged = true;
  if (fingers.size === 1) {
    turn(-x * 0.01, y * 0.01);
  } else {
    const other = [...fingers.values()].find((finger) => finger.pointerId !== event.pointerId)!;
    const apart = (finger: PointerEvent) => Math.hypot(finger.clientX - other.clientX, finger.clientY - other.clientY);
    turn(0, 0, Math.max(0.5, Math.min(2, apart(before) / Math.max(1, apart(event)))));
  }
  fingers.set(event.pointerId, event);
});
const leave = (event: PointerEvent) => {
  const was = fingers.delete(event.pointerId);
  if (was && !dragged && event.type === "pointerup") void explain(...pixel(event));
};
canvas.addEventListener("pointerup", leave);
canvas.addEventListener("pointercancel", leave);
canvas.addEventListener("wheel", (event) => {
  // Where there is nothing to move, the page scrolls.
  if (shownFile || !hasCamera(text.value)) return;
  event.preventDefault();
  turn(0, 0, Math.exp(Math.max(-200, Math.min(200, event.deltaY)) * 0.001));
}, { passive: false });
canvas.addEventListener("keydown", (event) => {
  const step = event.shiftKey ? 0.02 : 0.1;
  const keys: Record<string, () => void> = {
    ArrowLeft: () => turn(-step, 0),
    ArrowRight: () => turn(step, 0),
    ArrowUp: () => turn(0, step),
    ArrowDown: () => turn(0, -step),
    "+": () => turn(0, 0, 1 - step),
    "-": () => turn(0, 0, 1 + step),
    Enter: () => at<HTMLFormElement>("question").requestSubmit(),
  };
  const act = event.ctrlKey || event.altKey || event.metaKey ? undefined : keys[event.key];
  if (!act) return;
  event.preventDefault();
  act();
});

// --- Files, examples and links.

const IS_SCENE = /\.(pbrt|pov|gltf|glb|obj|ply|stl)$/i;

function take(shared: Shared, others: SceneFiles): void {
  text.value = shared.text;
  text.readOnly = false;
  [example, files, shownFile] = [shared.example, others, ""];
  at<HTMLSelectElement>("example").value = shared.example;
  list();
  number();
  void open();
}

async function choose(name: string): Promise<void> {
  try {
    const { [`${name}.pbrt`]: scene, ...others } = await load(name);
    take({ text: new TextDecoder().decode(scene as Uint8Array), example: name }, others);
  } catch (error) {
    tell(toProblem(error));
  }
}

async function drop(dropped: File[]): Promise<void> {
  const found: SceneFiles = {};
  for (const file of dropped) found[file.webkitRelativePath || file.name] = new Uint8Array(await file.arrayBuffer());
  const scenes = Object.keys(found).filter((name) => IS_SCENE.test(name));
  const pbrt = scenes.find((name) => /\.pbrt$/i.test(name));
  const scene = pbrt ?? scenes.find((name) => /\.(pov|gltf|glb)$/i.test(name)) ?? scenes.find((name) => /\.obj$/i.test(name)) ?? scenes[0];
  if (!scene) {
    // Files for the scene that is there.
    if (Object.keys(found).length === 0) return;
    files = { ...files, ...found };
    list();
    if (wrong) void open();
    else tell({ kind: "usage", message: word("dropped") });
    return;
  }
  if (pbrt) {
    const { [pbrt]: bytes, ...others } = found;
    take({ text: new TextDecoder().decode(bytes as Uint8Array), example: "" }, others);
    return;
  }
  [example, files, shownFile] = ["", found, scene];
  at<HTMLSelectElement>("example").value = "";
  text.value = "";
  text.readOnly = true;
  list();
  number();
  void open();
}

async function share(): Promise<void> {
  const link = new URL(location.href);
  link.hash = await fragment({ text: text.value, example });
  history.replaceState(null, "", link);
  at<HTMLInputElement>("link").value = link.href;
  at("shared").hidden = false;
  const copied = await navigator.clipboard?.writeText(link.href).then(() => true, () => false);
  const alone = !example && Object.keys(files).length > 0;
  at("shared-note").textContent = [copied ? word("copied") : "", alone ? word("without files") : ""].filter(Boolean).join(" ");
  at<HTMLInputElement>("link").select();
}

/** Takes the scene of the address, where it has one; `false` where that is damaged. */
async function fromLink(): Promise<boolean | undefined> {
  if (!location.hash) return undefined;
  try {
    const shared = await fromFragment(location.hash);
    if (!shared) return undefined;
    const known = EXAMPLES.includes(shared.example) ? shared.example : "";
    let others: SceneFiles = {};
    if (known) {
      const all = await load(known);
      delete all[`${known}.pbrt`];
      others = all;
    }
    take({ text: shared.text, example: known }, others);
    return true;
  } catch {
    tell({ kind: "input", message: word("bad link") });
    return false;
  }
}

// --- What the page's parts do.

let typing = 0;
text.addEventListener("input", () => {
  number();
  clearTimeout(typing);
  typing = window.setTimeout(() => void open(), TYPED);
});
text.addEventListener("scroll", () => (at("lines").scrollTop = text.scrollTop));
at("wrong-go").addEventListener("click", () => {
  const where = place();
  if (where === undefined) return;
  const token = /^(?:"[^"\n]*"?|[^\s"[\]]+|.)/.exec(text.value.slice(where))?.[0] ?? "";
  text.focus();
  text.setSelectionRange(where, where + token.length);
  text.scrollTop = Math.max(0, 20 * ((wrong?.line ?? 1) - 6));
});
at("question").addEventListener("submit", (event) => {
  event.preventDefault();
  void explain(Number(at<HTMLInputElement>("x").value), Number(at<HTMLInputElement>("y").value));
});
at("resolution").addEventListener("change", () => void open());
at("share").addEventListener("click", () => void share());
at("save").addEventListener("click", () => {
  canvas.toBlob((blob) => {
    if (!blob) return;
    const link = document.createElement("a");
    link.href = URL.createObjectURL(blob);
    link.download = "picture.png";
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
  });
});
at<HTMLInputElement>("files").addEventListener("change", (event) => {
  const input = event.target as HTMLInputElement;
  void drop([...(input.files ?? [])]).then(() => (input.value = ""));
});
document.addEventListener("dragover", (event) => {
  event.preventDefault();
  document.body.classList.add("over");
});
document.addEventListener("dragleave", () => document.body.classList.remove("over"));
document.addEventListener("drop", (event) => {
  event.preventDefault();
  document.body.classList.remove("over");
  void drop([...(event.dataTransfer?.files ?? [])]);
});
at<HTMLSelectElement>("language").addEventListener("change", (event) => language((event.target as HTMLSelectElement).value as Language));
at<HTMLSelectElement>("example").addEventListener("change", (event) => {
  const name = (event.target as HTMLSelectElement).value;
  if (name) void choose(name);
});
window.addEventListener("hashchange", () => void fromLink());

function language(chosen: Language): void {
  speak(chosen);
  at<HTMLSelectElement>("language").value = chosen;
  at<HTMLSelectElement>("example").options[0]!.textContent = word("own");
  at("hint").textContent = word(hasCamera(text.value) && !shownFile ? "hint" : "no camera");
  list();
  told();
}

async function start(): Promise<void> {
  const examples = at<HTMLSelectElement>("example");
  examples.append(new Option(word("own"), ""), ...EXAMPLES.map((name) => new Option(name, name)));
  language(navigator.language.startsWith("es") ? "es" : "en");
  say("loading");
  const compiled = module("");
  compiled.catch(() => {});
  const taken = await fromLink();
  if (taken === undefined) await choose(FIRST_EXAMPLE);
  try {
    renderer = new Renderer({
      wasm: await compiled,
      worker: () => new Worker(URL.createObjectURL(new Blob([WORKER], { type: "text/javascript" }))),
      onPass: show,
      onProblem: (error) => tell(error.problem),
    });
    if (taken === false) return say("stopped");
    say("reading");
    await open();
  } catch (error) {
    tell(toProblem(error));
    say("stopped");
  }
}

void start();
