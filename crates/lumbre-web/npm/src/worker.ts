// Lumbre on a thread of its own: it renders in short steps, and listens between them.
import { Lumbre, type Scene } from "./core.js";
import type { FromWorker, ToWorker } from "./protocol.js";
import { LumbreError, type Problem } from "./types.js";

/** Milliseconds of the first step, and of the longest. */
const FIRST = 40;
const LONGEST = 300;

const say = (message: FromWorker, moved: Transferable[] = []) =>
  (self as unknown as { postMessage(message: FromWorker, moved: Transferable[]): void }).postMessage(message, moved);

let lumbre: Promise<Lumbre> | undefined;
let scene: Scene | undefined;
/** The scene whose picture is rendered, by the message that opened it. */
let rendered = 0;

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
