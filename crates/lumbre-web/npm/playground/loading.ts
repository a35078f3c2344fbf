// The module and other parts of a folder of static pages, on a server or opened as files: a page that is opened from a file may load
// scripts, and nothing else.
import { fromBase64, unpacked } from "./share.js";

/** Bytes that the module may unpack to. */
const MOST = 64 << 20;

/** Why a part cannot be loaded: `script` where the browser did not run it, or what the server answered. */
export class NotLoaded extends Error {
  readonly why: "script" | number;
  constructor(why: "script" | number) {
    super(String(why));
    this.why = why;
  }
}

/** Runs a script. */
export function script(path: string): Promise<void> {
  return new Promise((done, failed) => {
    const element = document.createElement("script");
    element.src = path;
    element.onload = () => (element.remove(), done());
    element.onerror = () => (element.remove(), failed(new NotLoaded("script")));
    document.head.append(element);
  });
}

/** The module of the folder at `base`, which is empty or ends with a slash. */
export async function module(base: string): Promise<WebAssembly.Module> {
  if (location.protocol !== "file:") {
    const answer = await fetch(`${base}lumbre.wasm`);
    if (!answer.ok) throw new NotLoaded(answer.status);
    return WebAssembly.compile(await answer.arrayBuffer());
  }
  let packed = "";
  (window as unknown as { lumbreWasm: (base64: string) => void }).lumbreWasm = (base64) => (packed = base64);
  await script(`${base}lumbre.wasm.js`);
  if (!packed) throw new NotLoaded("script");
  return WebAssembly.compile(await unpacked(fromBase64(packed), "gzip", MOST));
}
