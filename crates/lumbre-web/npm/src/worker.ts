// Lumbre on a thread of its own: it renders in short steps, and listens between them.
import { Lumbre, type Scene } from "./core.js";
import type { FromWorker, ToWorker } from "./protocol.js";
import { LumbreError, type Problem, type SceneFiles, type Wanted } from "./types.js";

/** Milliseconds of the first step, and of the longest. */
const FIRST = 40;
const LONGEST = 300;

const say = (message: FromWorker, moved: Transferable[] = []) =>
  (self as unknown as { postMessage(message: FromWorker, moved: Transferable[]): void }).postMessage(message, moved);

let lumbre: Promise<Lumbre> | undefined;
let scene: Scene | undefined;
/** The scene whose picture is rendered, by the message that opened it. */
let rendered = 0;
/** The scene that was asked last without being rendered, and what it was opened from. */
let asked: { files: SceneFiles; name: string; wanted: string; scene: Scene } | undefined;

const isSameFile = (a: Uint8Array | string | undefined, b: Uint8Array | string): boolean =>
  typeof a === "object" && typeof b === "object" ? a.length === b.length && a.every((byte, i) => byte === b[i]) : a === b;

const areSame = (a: SceneFiles, b: SceneFiles): boolean =>
  Object.keys(a).length === Object.keys(b).length && Object.entries(b).every(([name, file]) => isSameFile(a[name], file));

/** A scene that is only asked: opened again where it is another. */
function only(ready: Lumbre, files: SceneFiles, name: string, size: Wanted): Scene {
  const wanted = JSON.stringify(size);
  if (asked?.name !== name || asked.wanted !== wanted || !areSame(asked.files, files)) {
    const scene = ready.open(files, name, size);
    asked?.scene.close();
    asked = { files, name, wanted, scene };
  }
  return asked.scene;
}

/** What reading warned of; that there is no light is said of pictures alone. */
const warned = (scene: Scene): string =>
  scene.warnings.filter((line) => !line.endsWith(": the scene has no light, its picture is black")).map((line) => `${line}\n`).join("");

function problem(error: unknown): Problem {
  return error instanceof LumbreError ? error.problem : { kind: "crash", message: String(error) };
}

/** Lets messages come in. Timers of pages wait for milliseconds after a while; messages do not. */
const { port1, port2 } = new MessageChannel();
function pause(): Promise<void> {
  return new Promise((go) => {
    port1.onmessage = () => go();
    port2.postMessage(0);
  });
}

async function render(id: number, of: Scene) {
  rendered = id;
  let time = FIRST;
  try {
    while (rendered === id && scene === of) {
      const pass = of.step(time);
      const pixels = of.pixels().buffer as ArrayBuffer;
      say({ type: "pass", id, pass, pixels }, [pixels]);
      if (pass.done) return;
      time = Math.min(1.5 * time, LONGEST);
      await pause();
    }
  } catch (error) {
    say({ type: "problem", id, problem: problem(error) });
  }
}

self.onmessage = async ({ data }: MessageEvent<ToWorker>) => {
  if (data.type === "load") {
    lumbre = Lumbre.load(data.wasm);
    // Told to whoever asks for something.
    lumbre.catch(() => {});
    return;
  }
  if (data.type === "stop") {
    rendered = 0;
    return;
  }
  const { id } = data;
  try {
    if (!lumbre) throw new LumbreError({ kind: "usage", message: "nothing is loaded" });
    const ready = await lumbre;
    switch (data.type) {
      case "open": {
        const opened = ready.open(data.files, data.name, data.wanted);
        scene?.close();
        scene = opened;
        const { width, height, warnings } = opened;
        say({ type: "opened", id, width, height, warnings });
        void render(id, opened);
        return;
      }
      case "look": {
        const looked = only(ready, data.files, data.name, data.wanted);
        return say({ type: "answer", id, text: warned(looked) + looked.explain(data.explain) });
      }
      case "aim": {
        const aimed = only(ready, data.files, data.name, {});
        return say({ type: "answer", id, text: warned(aimed) + aimed.cast(data.list, data.query) });
      }
      case "math":
        return say({ type: "answer", id, text: ready.math(data.text, data) });
      default: {
        if (!scene) throw new LumbreError({ kind: "usage", message: "no scene is open" });
        const text = data.type === "cast" ? scene.cast(data.list, data.query) : scene.explain(data.wanted);
        return say({ type: "answer", id, text });
      }
    }
  } catch (error) {
    say({ type: "problem", id, problem: problem(error) });
  }
};
