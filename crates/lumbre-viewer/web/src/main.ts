// The page: what comes from the viewer is shown, what is wished goes to it.
import { Connection, type Access, type Errand, type Listener } from "./connection";
import { Display } from "./display";
import { Drop } from "./drop";
import { Editor } from "./edit";
import { byId, element, options, save, saveBlob, short } from "./elements";
import { Explanation } from "./explanation";
import { showFacts, showHits } from "./facts";
import { attach } from "./hands";
import { LightList } from "./lights";
import { Measure } from "./measure";
import { Page } from "./page";
import { showProgress } from "./progress";
import type { Frame, Message, State, Thing } from "./protocol";
import { Section } from "./section";
import { StaticConnection, hideWhatNeedsAViewer, type Data } from "./static-connection";
import { SceneTree } from "./tree";
import { Views, type Standard } from "./views";

const page = new Page();
const { sheet, camera } = page;
const listener: Listener = { onMessage, onFrame, onOpen, onStatus };
const data = (globalThis as { lumbreAtRest?: Data }).lumbreAtRest;
page.connection = data ? new StaticConnection(listener, data) : new Connection(listener);
let turnAround = 0;
/** What was clicked last. */
let picked: Thing | undefined;
let hovered: [number, number] | null = null;
let asked = 0;

// ---- what comes
function onFrame(frame: Frame): void {
  page.show(display.shown(frame));
  display.draw();
  if (frame.isFull) askNumbers();
  if (hovered && frame.isFull) askPixel();
}

function onMessage(message: Message): void {
  switch (message.type) {
    case "scene":
      page.scene = message.scene;
      showFacts(byId("facts"), byId("warnings"), message.scene);
      editor.list(message.scene.parameters);
      lights.list(message.scene.parameters);
      tree.list(message.scene);
      explanation.offer(message.scene.languages);
      if (page.state) showState(page.state);
      break;
    case "state":
      page.state = message;
      showState(message);
      break;
    case "progress":
      showProgress(message);
      break;
    case "picked":
      showHits(byId("picked"), message.ray.hits);
      select(message.ray.hits[0]);
      measure.take(message.x, message.y, message.ray.hits[0]);
      explanation.of(Math.floor(message.x), Math.floor(message.y));
      if (message.request === turnAround && message.ray.hits[0]?.point) {
        camera.lookAt(message.ray.hits[0].point);
        page.moved();
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

/** A shape was clicked, in the picture or in the tree: it is marked everywhere. */
function select(thing: Thing | undefined): void {
  picked = thing;
  tree.select(thing?.shape ?? -1);
  editor.mark(thing?.owner ?? null);
  const isShape = thing !== undefined && thing.kind !== "ground";
  byId("picked-buttons").hidden = !isShape || data !== undefined || page.watches;
  byId("edit-picked").hidden = !thing?.owner;
  byId("light-picked").hidden = !thing?.shines;
}

function alertOf(title: string, text: string): void {
  byId("alert-title").textContent = title;
  byId("alert-text").textContent = text;
  byId("alert").hidden = title === "";
}

function onOpen(access: Access): void {
  page.connected = true;
  page.watches = access === "watch";
  byId("watching").hidden = !page.watches;
  if (page.watches) hideWhatNeedsAViewer(true);
  alertOf("", "");
}

function onStatus(how: "gone" | "refused" | "foreign"): void {
  page.connected = false;
  if (how === "gone") alertOf("The viewer does not answer.", "It has ended, or the tunnel to it has. This page goes on when it is back.");
  if (how === "refused") alertOf("The viewer does not know this page.", "Open the address that lumbre view printed. It works once, in one tab: to have another one, start the viewer again.");
  if (how === "foreign") alertOf("Another program answers in place of the viewer.", "It cannot prove to be the viewer, and was told nothing.");
  byId("progress").textContent = "Not connected";
}

function showState(now: State): void {
  document.title = now.name ? `${now.name} – Lumbre` : "Lumbre";
  byId("name").textContent = now.name || "Lumbre";
  if (page.connected) alertOf(now.error ? (now.has_scene ? "The file has an error; this is the last good picture." : "The file has an error.") : "", now.error ?? "");
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
  value("noise-target", now.noise ? String(now.noise) : "");
  byId<HTMLInputElement>("false-colour").checked = now.false_colour;
  byId<HTMLInputElement>("denoise").checked = now.denoise ?? false;
  editor.take(now.settings);
  lights.take(now.settings);
  tree.take(now.hidden);
  display.take(now);
  section.take(now);
  views.open(now.name);
  byId<HTMLButtonElement>("save-overlay").disabled = now.settings.length === 0;
  byId<HTMLButtonElement>("drop-edits").disabled = now.settings.length === 0;
  const { scene } = page;
  if (!scene) return;
  options(byId("camera"), scene.cameras.map(({ name }, i) => [String(i), name]), String(now.camera));
  page.takeCamera(now, scene);
  byId("ground-details").hidden = scene.ground === null;
  byId<HTMLInputElement>("below-ground").checked = camera.mayGoBelow;
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
  page.ask({ type: "values", x: Math.floor(x), y: Math.floor(y), width: 1, height: 1 });
}

let numbersWait = 0;
function askNumbers(): void {
  const rectangle = sheet.readable();
  if (!rectangle) return;
  clearTimeout(numbersWait);
  const [x, y, width, height] = rectangle;
  numbersWait = setTimeout(() => page.ask({ type: "values", x, y, width, height }), 60);
}
sheet.changed = askNumbers;

// ---- what the hand does
const CHANNELS = ["beauty", "albedo", "normal", "depth", "uv", "variance", "ids"];
const VIEWS: Record<string, Standard> = { 1: "front", 3: "right", 7: "top" };

function key(event: KeyboardEvent): boolean {
  const pressed = event.key.toLowerCase();
  // With Shift, the key of a digit has another sign on each keyboard.
  const digit = /^(?:Digit|Numpad)([0-9])$/.exec(event.code)?.[1] ?? pressed;
  const channel = event.shiftKey ? CHANNELS[Number(digit) - 1] : undefined;
  const view = VIEWS[digit];
  if (channel) page.set({ channel });
  else if (view) views.show(event.ctrlKey ? Views.opposite(view) : view);
  else if (event.ctrlKey) return false;
  else if (digit === "9") views.turn();
  else if (pressed === "r") page.reset(page.state?.camera ?? 0);
  else if (pressed === "x") explanation.show();
  else if (pressed === "m") measure.toggle();
  else if (pressed === "h" && picked) tree.hide(picked.shape);
  else if (pressed === "i" && picked) tree.isolate(picked.shape);
  else if (pressed === "p") page.set({ paused: !page.state?.paused });
  else if (digit === "0") sheet.zoomOut();
  else if (pressed === "+" || pressed === "=") sheet.zoomBy(1.5);
  else if (pressed === "-") sheet.zoomBy(1 / 1.5);
  else if (pressed === "[") page.set({ exposure: (page.state?.exposure ?? 0) - 0.5 });
  else if (pressed === "]") page.set({ exposure: (page.state?.exposure ?? 0) + 0.5 });
  else if (pressed === "?") byId<HTMLDialogElement>("help").showModal();
  else return false;
  return true;
}

attach(sheet.picture, sheet, camera, {
  moved: () => page.moved(),
  key,
  pick(x, y, turns) {
    const request = page.ask({ type: "pick", x, y });
    if (turns) turnAround = request;
  },
  hover(at) {
    hovered = at;
    if (at) askPixel();
    else byId("pixel").textContent = "";
  },
});

/** An address for an errand, which works once. */
const ticket = (errand: Errand): Promise<string> => page.connection?.ticket(errand) ?? Promise.reject(new Error("not connected"));
const explanation = new Explanation(ticket);
const edit = (path: string, value: string | null) => page.send({ type: "edit", path, value });
const editor = new Editor(byId("parameters"), byId("filter"), edit);
const lights = new LightList(edit);
const tree = new SceneTree(page, select);
const views = new Views(page, camera);
const measure = new Measure(sheet);
const section = new Section(page);
const display = new Display(page);
page.onCamera = () => {
  measure.moved();
  section.moved();
};

function on(id: string, event: string, act: (input: HTMLInputElement) => void): void {
  const input = byId<HTMLInputElement>(id);
  input.addEventListener(event, () => act(input));
}
on("pause", "click", () => page.set({ paused: !page.state?.paused }));
on("reset", "click", () => page.reset(page.state?.camera ?? 0));
on("help-open", "click", () => byId<HTMLDialogElement>("help").showModal());
on("help-close", "click", () => byId<HTMLDialogElement>("help").close());
on("channel", "change", ({ value }) => page.set({ channel: value }));
on("exposure", "input", ({ value }) => page.set({ exposure: Number(value) }));
on("tone-map", "change", ({ value }) => page.set({ tone_map: value }));
on("false-colour", "change", ({ checked }) => page.set({ false_colour: checked }));
on("denoise", "change", ({ checked }) => page.set({ denoise: checked }));
on("scale", "change", ({ value }) => page.set({ scale: Number(value) }));
on("edit-picked", "click", () => picked?.owner && editor.reveal(picked.owner));
on("light-picked", "click", () => lights.reveal(picked?.owner ?? null));
on("find-picked", "click", () => picked && tree.reveal(picked.shape));
on("hide-picked", "click", () => picked && tree.hide(picked.shape));
on("isolate-picked", "click", () => picked && tree.isolate(picked.shape));
on("below-ground", "change", ({ checked }) => {
  camera.mayGoBelow = checked;
});
on("noise-target", "change", (input) => input.checkValidity() && page.set({ noise: Number(input.value) }));
on("spp", "change", (input) => input.checkValidity() && page.set({ spp: Number(input.value) }));
on("camera", "change", ({ value }) => page.reset(Number(value)));
on("fov", "change", (input) => {
  if (!input.checkValidity()) return;
  camera.fov = Number(input.value);
  page.moved();
});
const moment = (wishes: object) =>
  page.send({ type: "moment", time: page.state?.time ?? null, variant: page.state?.variant ?? null, ...wishes });
on("animation-time", "input", ({ value }) => moment({ time: Number(value) }));
on("variant", "change", ({ value }) => moment({ variant: value || null }));
on("save-overlay", "click", () => save(`${page.state?.name ?? "scene"}.overlay.txt`, editor.overlay()));
on("drop-edits", "click", () => editor.dropAll());

/** The name of the scene without its ending, for files. */
const stem = () => (page.state?.name || "picture").replace(/\.(pbrt|pov|gltf|glb|obj|ply|stl)(\.gz)?$/i, "");
on("snapshot", "click", async () => {
  const picture = await sheet.snapshot();
  if (picture) saveBlob(`${stem()}.png`, picture);
});

/** Takes the picture as a file, which the browser saves. */
async function savePicture(format: "png" | "exr"): Promise<void> {
  try {
    const link = element("a", "", { href: await ticket({ for: "picture", format }), download: `${stem()}.${format}` });
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
else new Drop(ticket, alertOf);
