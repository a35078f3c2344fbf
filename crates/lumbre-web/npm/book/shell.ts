// The commands of the book's examples: enough of a shell to run `lumbre math`, `explain` and `cast` where they stand, with what the
// examples put around them (echo, printf, sed, grep, head, tail, a loop, a pipe and a file). What it does not know it refuses.

/** What runs the commands of the program. */
export interface Program {
  math(text: string, lang: string, json: boolean): Promise<string>;
  explain(scene: string, wanted: Record<string, unknown>): Promise<string>;
  cast(scene: string, list: string, query: string): Promise<string>;
}

/** Files by their paths, of which commands write some; `read` also brings those that are not there yet. */
export interface Files {
  read(path: string): Promise<string>;
  write(path: string, text: string): void;
}

/** A command that this shell does not know, or cannot do. */
export class Unknown extends Error {}

/** What a program says when it fails. */
export class Failed extends Error {}

/** A word; words that were not quoted may be operators. */
interface Word {
  text: string;
  bare: boolean;
}

function words(line: string): Word[] {
  const found: Word[] = [];
  let [text, bare, open] = ["", true, false];
  const end = () => {
    if (open) found.push({ text, bare });
    [text, bare, open] = ["", true, false];
  };
  for (let i = 0; i < line.length; i++) {
    const c = line[i]!;
    if (c === "'" || c === '"') {
      [bare, open] = [false, true];
      for (i++; line[i] !== c; i++) {
        if (i >= line.length) throw new Unknown(`${c} has no end`);
        if (c === '"' && line[i] === "\\" && /["\\$`]/.test(line[i + 1] ?? "")) i++;
        text += line[i];
      }
    } else if (c === "\\") {
      [bare, open] = [false, true];
      text += line[++i] ?? "";
    } else if (/\s/.test(c)) {
      end();
    } else if (/[|;<>]/.test(c)) {
      end();
      found.push({ text: c, bare: true });
    } else if (c === "#" && !open) {
      break;
    } else if (/[&`(]/.test(c)) {
      throw new Unknown(c);
    } else {
      open = true;
      text += c;
    }
  }
  end();
  return found;
}

/** The pattern of grep and sed, of which only what the examples have is known. */
function pattern(text: string, flags = ""): RegExp {
  if (/\\[(){|}]/.test(text)) throw new Unknown(text);
  return new RegExp(text.replace(/\[\]/g, "[\\]").replace(/[+?(){}|]/g, "\\$&"), `u${flags}`);
}

const lines = (text: string): string[] => (text === "" ? [] : text.replace(/\n$/, "").split("\n"));
const joined = (all: string[]): string => all.map((line) => `${line}\n`).join("");

/** The numbers of an option, separated by commas. */
const numbers = (text: string): number[] => text.split(",").map((part) => (part.trim() === "" ? NaN : Number(part)));

/** Options of explain that take a value, and how they are told to the module. */
const VALUES: Record<string, (value: string, wanted: Record<string, unknown>) => void> = {
  "--pixel": (value, wanted) => (wanted["pixel"] = numbers(value)),
  "--ray": (value, wanted) => (wanted["ray"] = numbers(value)),
  "--format": (value, wanted) => (wanted["format"] = value),
  "--lang": (value, wanted) => (wanted["lang"] = value),
  "--depth": (value, wanted) => (wanted["depth"] = Number(value)),
  "--sample": (value, wanted) => (wanted["sample"] = Number(value)),
  "--shape": (value, wanted) => (wanted["shape"] = value),
  "--only": (value, wanted) => (wanted["only"] = value.split(",").map((key) => key.trim())),
  "--size": (value, wanted) => (wanted["size"] = value.split("x").map(Number)),
};
const FLAGS: Record<string, string> = { "--nearest": "nearest", "--all-shapes": "all_shapes" };

/** Runs one command of the program. */
async function lumbre(args: string[], input: string, program: Program, files: Files): Promise<string> {
  const [command, ...rest] = args;
  const wanted: Record<string, unknown> = {};
  const plain: string[] = [];
  const more: Record<string, string> = {};
  const valued = command === "explain" ? Object.keys(VALUES) : command === "math" ? ["--lang"] : ["--rays", "--points", "--query"];
  let json = false;
  for (let i = 0; i < rest.length; i++) {
    const [name, inside] = /^--[^=]*=/.test(rest[i]!) ? [rest[i]!.split("=", 1)[0]!, rest[i]!.slice(rest[i]!.indexOf("=") + 1)] : [rest[i]!, undefined];
    if (valued.includes(name)) {
      const value = inside ?? rest[++i];
      if (value === undefined) throw new Failed(`${name}: a value is missing`);
      if (command === "explain") VALUES[name]!(value, wanted);
      else more[name] = value;
    } else if (command === "explain" && FLAGS[name]) wanted[FLAGS[name]!] = true;
    else if (command === "math" && name === "--json") json = true;
    else if (command === "cast" && (name === "-q" || name === "--quiet")) continue;
    else if (name.startsWith("--")) throw new Unknown(`lumbre ${command} ${name}`);
    else plain.push(rest[i]!);
  }
  if (plain.length !== 1) throw new Unknown(`lumbre ${command} ${plain.join(" ")}`);
  const [subject] = plain as [string];
  if (command === "math") return program.math(subject === "-" ? input : subject, more["--lang"] ?? "en", json);
  if (command === "explain") {
    const scene = subject === "-" ? STDIN : subject;
    if (subject === "-") files.write(STDIN, input);
    return program.explain(scene, wanted);
  }
  if (command !== "cast") throw new Unknown(`lumbre ${command}`);
  const list = more["--rays"] ?? more["--points"];
  if (list === undefined) throw new Unknown("lumbre cast");
  const text = list === "-" ? input : await files.read(list);
  return program.cast(subject, text, more["--query"] ?? "closest");
}

/** The file that a scene from a pipe is held as. */
export const STDIN = "stdin.pbrt";

async function run(args: string[], input: string, program: Program, files: Files): Promise<string> {
  const [name, ...rest] = args as [string, ...string[]];
  const option = rest[0] ?? "";
  switch (name) {
    case "lumbre":
      return lumbre(rest, input, program, files);
    case "echo":
      return `${rest.join(" ")}\n`;
    case "printf":
      if (rest.length !== 1 || /%/.test(option)) throw new Unknown("printf");
      return option.replace(/\\n/g, "\n").replace(/\\t/g, "\t");
    case "cat":
      return (await Promise.all(rest.map((path) => files.read(path)))).join("");
    case "head":
    case "tail": {
      const count = Number(/^-(?:n)?(\d+)$/.exec(option)?.[1] ?? NaN);
      if (rest.length !== 1 || !Number.isInteger(count)) throw new Unknown(name);
      return joined(name === "head" ? lines(input).slice(0, count) : count === 0 ? [] : lines(input).slice(-count));
    }
    case "grep": {
      const [only, without] = [option === "-o", option === "-v"];
      const text = only || without ? rest.slice(1) : rest;
      if (text.length !== 1) throw new Unknown("grep");
      const sought = pattern(text[0]!, "g");
      if (only) return joined(lines(input).flatMap((line) => [...line.matchAll(sought)].map(([found]) => found)));
      return joined(lines(input).filter((line) => (line.search(sought) >= 0) !== without));
    }
    case "sed": {
      const parts = /^s(.)(.*?)\1(.*?)\1(g?)$/.exec(option);
      if (!parts || rest.length > 2) throw new Unknown("sed");
      const text = rest[1] === undefined ? input : await files.read(rest[1]);
      const [sought, by] = [pattern(parts[2]!, parts[4]), parts[3]!];
      return joined(lines(text).map((line) => line.replace(sought, () => by)));
    }
    default:
      throw new Unknown(name);
  }
}

/** Commands that are joined by pipes, and the file that takes what they print. */
async function pipeline(all: Word[], program: Program, files: Files): Promise<string> {
  const to = all.findIndex((word) => word.bare && word.text === ">");
  const commands: string[][] = [[]];
  for (const word of to < 0 ? all : all.slice(0, to)) {
    if (word.bare && word.text === "|") commands.push([]);
    else if (word.bare && /^[<>;]$/.test(word.text)) throw new Unknown(word.text);
    else commands.at(-1)!.push(word.text);
  }
  let text = "";
  for (const command of commands) {
    if (command.length === 0) throw new Unknown("|");
    text = await run(command, text, program, files);
  }
  if (to < 0) return text;
  const path = all[to + 1];
  if (!path || to + 2 !== all.length) throw new Unknown(">");
  files.write(path.text, text);
  return "";
}

function parts(all: Word[]): Word[][] {
  const found: Word[][] = [[]];
  for (const word of all) {
    if (word.bare && word.text === ";") found.push([]);
    else found.at(-1)!.push(word);
  }
  return found.filter((part) => part.length > 0);
}

/** What a line of commands prints. */
export async function shell(line: string, program: Program, files: Files): Promise<string> {
  let said = "";
  const loop = /^\s*for\s+(\w+)\s+in\s+([^;]*);\s*do\s+(.*);\s*done\s*$/.exec(line);
  if (loop) {
    const [, name, values, body] = loop as unknown as [string, string, string, string];
    for (const value of values.trim().split(/\s+/)) {
      said += await shell(body.replaceAll(new RegExp(`\\$${name}\\b`, "g"), value), program, files);
    }
    return said;
  }
  for (const part of parts(words(line))) {
    if (part.some((word) => word.text.includes("$"))) throw new Unknown("$");
    said += await pipeline(part, program, files);
  }
  return said;
}

/** Whether all that a line calls is known here, without running it. */
export function isKnown(line: string): boolean {
  const body = /^\s*for\s.*?;\s*do\s+(.*);\s*done\s*$/.exec(line)?.[1] ?? line;
  try {
    return parts(words(body)).every((part) => {
      const bars = part.flatMap((word, i) => (word.bare && word.text === "|" ? [i] : []));
      return [0, ...bars.map((i) => i + 1)].every((start, i) => {
        const [name, verb] = [part[start]?.text ?? "", part[start + 1]?.text ?? ""];
        const own = part.slice(start, bars[i]);
        if (name === "lumbre") return ["math", "explain", "cast"].includes(verb) && !own.some((word) => word.text === "-o");
        return ["echo", "printf", "sed", "cat", ...(i > 0 ? ["grep", "head", "tail"] : [])].includes(name);
      });
    });
  } catch {
    return false;
  }
}

/** A command of an example with what it printed, and what of that is shown. */
export interface Shown {
  command: string;
  output: string;
}

/** The commands of an example as it stands in the book. */
export function commandsOf(text: string): Shown[] {
  const found: Shown[] = [];
  for (const line of text.replace(/\n+$/, "").split("\n")) {
    if (line.startsWith("$ ")) found.push({ command: line.slice(2), output: "" });
    else if (found.length > 0) found.at(-1)!.output += `${line}\n`;
  }
  for (const [i, shown] of found.entries()) if (i + 1 < found.length) shown.output = shown.output.replace(/\n$/, "");
  return found;
}

/** The results among what `lumbre math` prints, as the book shows them: each begins with `=`, and goes on while its brackets are open. */
function results(text: string): string {
  let open = 0;
  const kept: string[] = [];
  for (const line of lines(text)) {
    if (open > 0 || line.startsWith("= ")) {
      open = Math.max(0, open + line.split("[").length - line.split("]").length);
      kept.push(line);
    }
  }
  return joined(kept);
}

/** What is shown of an output, as it was of the first one: its results alone, or its first lines. */
export function shownAs(before: string, text: string): string {
  const trimmed = joined(lines(text).map((line) => line.trimEnd()));
  const cut = lines(before);
  if (cut.at(-1) === "…" && lines(trimmed).length > cut.length - 1) return joined([...lines(trimmed).slice(0, cut.length - 1), "…"]);
  // An explanation in full has lines that are no results.
  return before !== "" && results(before) === before ? results(trimmed) : trimmed;
}
