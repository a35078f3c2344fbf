// The page: what comes from the viewer is shown, what is wished goes to it.
import { Camera } from "./camera";
import { AtRest, hideWhatNeedsAViewer, type Data } from "./at-rest";
import { Connection, type Listener } from "./connection";
import { Editor } from "./edit";
import { byId, element, large, options, save, short, spoken } from "./elements";
import { Explanation } from "./explanation";
import { showFacts, showHits } from "./facts";
import { attach } from "./hands";
import type { Frame, Progress, Scene, State, Told } from "./protocol";
import { Sheet } from "./sheet";

const stage = byId("stage");
const sheet = new Sheet(
  stage, byId("sheet"), byId<HTMLCanvasElement>("picture"), byId<HTMLCanvasElement>("reference"),
  byId<HTMLCanvasElement>("numbers"),
);
const camera = new Camera();
let scene: Scene | undefined;
let state: State | undefined;
let request = 0;
let turnAround = 0;
let hovered: [number, number] | null = null;
let asked = 0;
// What the camera is at is counted, so that one knows which frame shows it. Others count from elsewhere.
let sequence = Math.floor(Math.random() * 0x7fff_0000);
let mine = -1;

/** What the page measures of itself: milliseconds from a change to the first picture of it, and when frames came. */
const measured = { latencies: [] as number[], frames: [] as number[], changes: new Map<number, number>(), spp: 0, done: false, sequence: 0 };
Object.assign(globalThis, { lumbreMeasured: measured });

const listener: Listener = { told: (message) => told(message), framed: (frame) => framed(frame), stood: (how) => stood(how) };
const data = (globalThis as { lumbreAtRest?: Data }).lumbreAtRest;
const connection = data ? new AtRest(listener, data) : new Connection(listener);

// ---- the camera goes out once a picture of the screen
let isMoving = false;
function moved(): void {
  if (isMoving) return;
  isMoving = true;
  requestAnimationFrame(() => {
    isMoving = false;
    sequence = (sequence + 1) >>> 0;
    mine = sequence;
    measured.changes.set(sequence, performance.now());
    connection.send({ type: "camera", sequence, placement: camera.placement, fov: camera.fov, zoom: camera.zoom });
  });
}

function reset(index: number): void {
  sequence = (sequence + 1) >>> 0;
  mine = -1;
  connection.send({ type: "reset", sequence, camera: index });
}

const set = (wishes: object) => connection.send({ type: "set", ...wishes });

// ---- what comes
function framed(frame: Frame): void {
  sheet.show(frame);
  const now = performance.now();
  measured.frames.push(now);
  if (measured.frames.length > 2000) measured.frames.splice(0, 1000);
  [measured.spp, measured.done, measured.sequence] = [frame.isFull ? frame.spp : 0, frame.isDone, frame.sequence];
  for (const [change, since] of measured.changes) {
    if (change > frame.sequence) continue;
    // Earlier changes that no frame was made of are shown by this one.
    if (change === frame.sequence) measured.latencies.push(now - since);
    measured.changes.delete(change);
  }
  if (frame.isFull) askNumbers();
  if (hovered && frame.isFull) askPixel();
}

function told(message: Told): void {
  switch (message.type) {
    case "scene":
      scene = message.scene;
      showFacts(byId("facts"), byId("warnings"), scene);
      editor.list(scene.parameters);
      explanation.offer(scene.languages);
      if (state) showState(state);
      break;
    case "state":
      state = message;
      showState(message);
      break;
    case "progress":
      showProgress(message);
      break;
    case "picked":
      showHits(byId("picked"), message.ray.hits);
      explanation.of(Math.floor(message.x), Math.floor(message.y));
      if (message.request === turnAround && message.ray.hits[0]?.point) {
        camera.lookAt(message.ray.hits[0].point);
        moved();
      }
      break;
    case "values":
      if (message.width === 1 && message.height === 1) {
        const [value] = message.values;
        if (value) byId("pixel").textContent = `${message.x}, ${message.y}: ${value.map((v) => (typeof v === "number" ? short(v) : v)).join("  ")}`;
      } else {
        sheet.writeNumbers(message.x, message.y, message.width, message.values);
      }
      break;
    case "wrong":
      byId("edit-error").textContent = message.what;
      byId("edit-error").hidden = false;
      break;
  }
}

function alertOf(title: string, text: string): void {
  byId("alert-title").textContent = title;
  byId("alert-text").textContent = text;
  byId("alert").hidden = title === "";
}

let connected = false;
function stood(how: "open" | "gone" | "refused" | "foreign"): void {
  connected = how === "open";
  if (how === "open") alertOf("", "");
  if (how === "gone") alertOf("The viewer does not answer.", "It has ended, or the tunnel to it has. This page goes on when it is back.");
  if (how === "refused") alertOf("The viewer does not know this page.", "Open the address that lumbre view printed. It works once, in one tab: to have another one, start the viewer again.");
  if (how === "foreign") alertOf("Another program answers in place of the viewer.", "It cannot prove to be the viewer, and was told nothing.");
  if (!connected) byId("progress").textContent = "Not connected";
}

function showProgress(progress: Progress): void {
  const { doing, spp = 0, target = 0 } = progress;
  const words: Record<Progress["doing"], string> = {
    reading: "Reading the scene", building: "Building the scene", rendering: "", done: "", waiting: "Waiting for the file to be mended", nothing: "No scene",
  };
  let text = words[doing];
  if (doing === "rendering" || doing === "done") {
    const parts = [target > 0 ? `${spp} of ${target} samples` : "done"];
    if (progress.noise != null && spp > 1) parts.push(`noise ${progress.noise.toFixed(4)}`);
    if (progress.rays_per_second) parts.push(`${large(progress.rays_per_second)} rays/s`);
    if (doing === "rendering" && progress.left) parts.push(`${spoken(progress.left)} left`);
    if (doing === "done" && progress.seconds) parts.push(`done in ${spoken(progress.seconds)}`);
    if (progress.dropped) parts.push(`${progress.dropped} samples dropped`);
    text = parts.join(" · ");
  }
  byId("progress").textContent = text;
  byId<HTMLProgressElement>("bar").value = target > 0 ? spp / target : doing === "done" ? 1 : 0;
}

function showState(now: State): void {
  document.title = now.name ? `${now.name} – Lumbre` : "Lumbre";
  byId("name").textContent = now.name || "Lumbre";
  if (connected) alertOf(now.error ? (now.has_scene ? "The file has an error; this is the last good picture." : "The file has an error.") : "", now.error ?? "");
  byId("empty").hidden = now.name !== "";
  byId("sheet").hidden = now.name === "";
  const error = byId("edit-error");
  error.textContent = now.edit_error ?? "";
  error.hidden = !now.edit_error;
  const pause = byId<HTMLButtonElement>("pause");
  pause.setAttribute("aria-pressed", String(now.paused));
  byId<HTMLSelectElement>("channel").value = now.channel;
  byId<HTMLSelectElement>("tone-map").value = now.tone_map ?? "none";
  byId<HTMLSelectElement>("scale").value = String(now.scale);
  const active = document.activeElement;
  const value = (id: string, text: string) => {
    const input = byId<HTMLInputElement>(id);
    if (active !== input) input.value = text;
  };
  value("exposure", String(now.exposure ?? 0));
  byId("exposure-value").textContent = (now.exposure ?? 0).toFixed(1);
  value("spp", String(now.spp ?? 64));
  byId<HTMLInputElement>("false-colour").checked = now.false_colour;
  byId<HTMLInputElement>("denoise").checked = now.denoise ?? false;
  editor.take(now.settings);
  byId<HTMLButtonElement>("save-overlay").disabled = now.settings.length === 0;
  byId<HTMLButtonElement>("drop-edits").disabled = now.settings.length === 0;
  if (!scene) return;
  options(byId("camera"), scene.cameras.map(({ name }, i) => [String(i), name]), String(now.camera));
  const isOld = now.moved && now.sequence === mine;
  // What was said from here and comes back is older than what the hand does.
  if (!isOld && !isMoving) camera.take(now, scene);
  const fov = byId<HTMLInputElement>("fov");
  fov.disabled = camera.fov === null;
  value("fov", camera.fov === null ? "" : short(camera.fov));
  const end = Math.max(0, ...scene.animations.map((animation) => animation.end ?? 0));
  for (const part of document.querySelectorAll<HTMLElement>(".animated")) part.hidden = end === 0;
  byId<HTMLInputElement>("animation-time").max = String(end);
  value("animation-time", String(now.time ?? 0));
  byId("time-value").textContent = `${(now.time ?? 0).toFixed(2)} s`;
  for (const part of document.querySelectorAll<HTMLElement>(".varied")) part.hidden = scene.variants.length === 0;
  const variants: [string, string][] = [["", "as in the file"], ...scene.variants.map((name): [string, string] => [name, name])];
  options(byId("variant"), variants, now.variant ?? "");
}

// ---- pixels
function askPixel(): void {
  const now = performance.now();
  if (!hovered || now - asked < 40) return;
  asked = now;
  const [x, y] = hovered;
  connection.send({ type: "values", x: Math.floor(x), y: Math.floor(y), width: 1, height: 1, request: ++request });
}

let numbersWait = 0;
function askNumbers(): void {
  const rectangle = sheet.readable();
  if (!rectangle) return;
  clearTimeout(numbersWait);
  const [x, y, width, height] = rectangle;
  numbersWait = setTimeout(() => connection.send({ type: "values", x, y, width, height, request: ++request }), 60);
}
sheet.changed = askNumbers;

// ---- what the hand does
function key(pressed: string): boolean {
  const channels = ["beauty", "albedo", "normal", "depth", "uv", "variance", "ids"];
  const channel = channels[Number(pressed) - 1];
  if (channel) set({ channel });
  else if (pressed === "r") reset(state?.camera ?? 0);
  else if (pressed === "x") explanation.show();
  else if (pressed === "p") set({ paused: !state?.paused });
  else if (pressed === "0") sheet.zoomOut();
  else if (pressed === "+" || pressed === "=") sheet.zoomBy(1.5);
  else if (pressed === "-") sheet.zoomBy(1 / 1.5);
  else if (pressed === "[") set({ exposure: (state?.exposure ?? 0) - 0.5 });
  else if (pressed === "]") set({ exposure: (state?.exposure ?? 0) + 0.5 });
  else if (pressed === "?") byId<HTMLDialogElement>("help").showModal();
  else return false;
  return true;
}

attach(sheet.picture, sheet, camera, {
  moved,
  key,
  pick(x, y, turns) {
    request += 1;
    if (turns) turnAround = request;
    connection.send({ type: "pick", x, y, request });
  },
  hover(at) {
    hovered = at;
    if (at) askPixel();
    else byId("pixel").textContent = "";
  },
});

const explanation = new Explanation((errand) => connection.ticket(errand));
const editor = new Editor(byId("parameters"), byId("filter"), (path, value) => connection.send({ type: "edit", path, value }));

function on(id: string, event: string, act: (input: HTMLInputElement) => void): void {
  const input = byId<HTMLInputElement>(id);
  input.addEventListener(event, () => act(input));
}
on("pause", "click", () => set({ paused: !state?.paused }));
on("reset", "click", () => reset(state?.camera ?? 0));
on("help-open", "click", () => byId<HTMLDialogElement>("help").showModal());
on("help-close", "click", () => byId<HTMLDialogElement>("help").close());
on("channel", "change", ({ value }) => set({ channel: value }));
on("exposure", "input", ({ value }) => set({ exposure: Number(value) }));
on("tone-map", "change", ({ value }) => set({ tone_map: value }));
on("false-colour", "change", ({ checked }) => set({ false_colour: checked }));
on("denoise", "change", ({ checked }) => set({ denoise: checked }));
on("scale", "change", ({ value }) => set({ scale: Number(value) }));
on("spp", "change", (input) => input.checkValidity() && set({ spp: Number(input.value) }));
on("camera", "change", ({ value }) => reset(Number(value)));
on("fov", "change", (input) => {
  if (!input.checkValidity()) return;
  camera.fov = Number(input.value);
  moved();
});
const moment = (wishes: object) =>
  connection.send({ type: "moment", time: state?.time ?? null, variant: state?.variant ?? null, ...wishes });
on("animation-time", "input", ({ value }) => moment({ time: Number(value) }));
on("variant", "change", ({ value }) => moment({ variant: value || null }));
on("save-overlay", "click", () => save(`${state?.name ?? "scene"}.overlay.txt`, editor.overlay()));
on("drop-edits", "click", () => editor.dropAll());

/** Takes the picture as a file, which the browser saves. */
async function savePicture(format: "png" | "exr"): Promise<void> {
  try {
    const link = element("a", "", { href: await connection.ticket({ for: "picture", format }), download: `picture.${format}` });
    link.click();
  } catch {
    alertOf("The picture was not saved.", "The viewer does not answer.");
  }
}
on("save-png", "click", () => void savePicture("png"));
on("save-exr", "click", () => void savePicture("exr"));

function copy(text: string): void {
  const shown = byId<HTMLTextAreaElement>("copied");
  [shown.hidden, shown.value] = [false, text];
  shown.select();
  // Without leave, the text is there to be copied by hand.
  navigator.clipboard?.writeText(text).catch(() => {});
}
on("copy-pbrt", "click", () => copy(camera.toPbrt()));
on("copy-gltf", "click", () => copy(camera.toGltf(sheet.width / sheet.height)));

// ---- comparing
function compare(is: boolean): void {
  byId<HTMLInputElement>("split").disabled = !is;
  byId<HTMLButtonElement>("forget").disabled = !is;
  sheet.reference.hidden = !is;
  if (is) sheet.split(Number(byId<HTMLInputElement>("split").value));
}
on("keep", "click", () => {
  sheet.keep();
  compare(true);
});
on("forget", "click", () => compare(false));
on("split", "input", ({ value }) => sheet.split(Number(value)));
on("reference-file", "change", async ({ files }) => {
  const file = files?.[0];
  if (!file) return;
  try {
    sheet.keep(await createImageBitmap(file));
    compare(true);
  } catch {
    alertOf("This is no picture that a browser can show.", file.name);
  }
});

if (data) hideWhatNeedsAViewer();

// ---- a model that is dropped
async function drop(file: File | undefined): Promise<void> {
  if (!file) return;
  try {
    const headers = { "Content-Type": "application/octet-stream" };
    const answer = await fetch(await connection.ticket({ for: "scene" }), { method: "POST", headers, body: file });
    if (!answer.ok) alertOf("The file was not opened.", await answer.text());
  } catch {
    alertOf("The file was not opened.", "The viewer does not answer.");
  }
}
on("open", "change", ({ files }) => void drop(files?.[0]));
stage.addEventListener("dragover", (event) => {
  event.preventDefault();
  stage.classList.add("over");
});
stage.addEventListener("dragleave", () => stage.classList.remove("over"));
stage.addEventListener("drop", (event) => {
  event.preventDefault();
  if (data) return;
  stage.classList.remove("over");
  void drop(event.dataTransfer?.files[0]);
});

