// Lumbre on a thread of its own: it renders in short steps, and listens between them.
import { Lumbre, type Scene } from "./core.js";
import type { FromWorker, Share, ToWorker } from "./protocol.js";
import { LumbreError, type Problem, type SceneFiles, type Wanted } from "./types.js";

/** Milliseconds of the first step, and of the longest. */
const FIRST = 40;
const LONGEST = 300;

const say = (message: FromWorker, moved: Transferable[] = []) =>
  (self as unknown as { postMessage(message: FromWorker, moved: Transferable[]): void }).postMessage(message, moved);

let lumbre: Promise<Lumbre> | undefined;
let scene: Scene | undefined;
/** How many pictures were begun or stopped: only the last is rendered. */
let turn = 0;
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

/** The rows of a share: bands of the same height, none of them empty. */
function rows({ bounds: [, from, , to] }: Scene, { index, of }: Share): [number, number] {
  const shares = Math.min(of, to - from);
  const at = (i: number) => from + Math.floor(((to - from) * i) / shares);
  return [at(index), at(index + 1)];
}

/** Renders a picture, or a share of it. The first worker shows all of it, coarse, before it turns to its share. */
async function render(id: number, of: Scene, share: Share) {
  const mine = ++turn;
  const isShared = share.of > 1 && of.isDivisible;
  let time = FIRST;
  try {
    if (isShared && share.index > 0) of.limitRows(...rows(of, share));
    for (let i = 0; turn === mine; i++) {
      if (isShared && share.index === 0 && i === 1) of.limitRows(...rows(of, share));
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
    turn++;
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
        const { width, height, bounds, warnings, isDivisible } = opened;
        say({ type: "opened", id, width, height, bounds, warnings, isDivisible });
        void render(id, opened, data.share);
        return;
      }
      case "alone": {
        scene?.limitRows(scene.bounds[1], scene.bounds[3]);
        if (scene) void render(id, scene, { index: 0, of: 1 });
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
