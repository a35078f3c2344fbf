// The files of the book's scenes and examples, by their paths from the folder of the pages: texts in one script, others in one each.
import type { SceneFiles } from "../src/types.js";
import { script } from "../playground/loading.js";
import { fromBase64 } from "../playground/share.js";
import { type Files, Failed } from "./shell.js";
import { word } from "./words.js";

const given = window as unknown as {
  lumbreTexts: (texts: Record<string, string>, others: string[]) => void;
  lumbreFile: (path: string, base64: string) => void;
};

/** What of the book is held here. */
export class Held implements Files {
  #base: string;
  #texts = new Map<string, string>();
  #others = new Set<string>();
  #bytes = new Map<string, Uint8Array>();
  #ready: Promise<void> | undefined;

  /** `base` is the folder of the live parts, with a slash at its end. */
  constructor(base: string) {
    this.#base = base;
  }

  /** Reads the texts. */
  ready(): Promise<void> {
    return (this.#ready ??= (async () => {
      given.lumbreTexts = (texts, others) => {
        this.#texts = new Map(Object.entries(texts));
        this.#others = new Set(others);
      };
      await script(`${this.#base}files.js`);
    })());
  }

  /** A text that is there, which was given or written. */
  text(path: string): string | undefined {
    return this.#texts.get(path);
  }

  /** The path of a scene with exactly this text. */
  pathOf(text: string): string | undefined {
    const wanted = text.trimEnd();
    for (const [path, found] of this.#texts) if (found.trimEnd() === wanted && /\.(pbrt|pov)$/.test(path)) return path;
    return undefined;
  }

  async read(path: string): Promise<string> {
    await this.ready();
    const text = this.#texts.get(path);
    if (text === undefined) throw new Failed(word("no file", path));
    return text;
  }

  write(path: string, text: string): void {
    this.#texts.set(path, text);
  }

  async #other(path: string): Promise<Uint8Array> {
    let bytes = this.#bytes.get(path);
    if (!bytes) {
      given.lumbreFile = (_, base64) => (bytes = fromBase64(base64));
      await script(`${this.#base}files/${path}.js`);
      if (!bytes) throw new Failed(word("no file", path));
      this.#bytes.set(path, bytes);
    }
    return bytes;
  }

  /** A scene with all that it names in quotes, and what those name: what it may read. `text` is in place of its own. */
  async scene(path: string, text?: string): Promise<SceneFiles> {
    await this.ready();
    const all: SceneFiles = {};
    const add = async (name: string): Promise<void> => {
      if (name in all) return;
      const found = name === path && text !== undefined ? text : this.#texts.get(name);
      if (found === undefined) {
        if (this.#others.has(name)) all[name] = await this.#other(name);
        return;
      }
      all[name] = found;
      const folder = name.slice(0, name.lastIndexOf("/") + 1);
      for (const [, named] of found.matchAll(/"([^"\n]*\.[^"\n]*)"/g)) await add(normal(folder + named!));
    };
    await add(path);
    return all;
  }
}

function normal(path: string): string {
  const kept: string[] = [];
  for (const part of path.split("/")) {
    if (part === "..") kept.pop();
    else if (part !== "." && part !== "") kept.push(part);
  }
  return kept.join("/");
}
