// Files and folders that are dropped on the page, in one request.
import { byId } from "./elements";
import type { DroppedFile, Errand } from "./messages";

interface Named { name: string; file: File }

/** Bytes that the viewer takes. */
const MAX_BYTES = 256 * 2 ** 20;

/** All files of an entry: itself, or those in the folder. */
async function filesOf(entry: FileSystemEntry): Promise<Named[]> {
  // A path begins with a slash.
  const name = entry.fullPath.slice(1);
  if (entry.isFile) {
    const file = await new Promise<File>((found, failed) => (entry as FileSystemFileEntry).file(found, failed));
    return [{ name, file }];
  }
  const reader = (entry as FileSystemDirectoryEntry).createReader();
  const all: Named[] = [];
  for (;;) {
    // A hundred at a time, until there are no more.
    const some = await new Promise<FileSystemEntry[]>((found, failed) => reader.readEntries(found, failed));
    if (some.length === 0) return all;
    for (const inner of some) all.push(...(await filesOf(inner)));
  }
}

/** The files that were dropped, folders with all that is in them. */
async function dropped(data: DataTransfer): Promise<Named[]> {
  // Items live as long as the event: they are taken before anything is waited for.
  const entries = [...data.items].map((item) => item.webkitGetAsEntry?.() ?? null);
  const plain = [...data.files].map((file) => ({ name: file.name, file }));
  if (entries.length === 0 || entries.some((entry) => entry === null)) return plain;
  return (await Promise.all(entries.map((entry) => (entry ? filesOf(entry) : [])))).flat();
}

/** One request of many files: see `bundle.rs`. */
export function bundled(files: Named[]): Blob {
  const entries = files.map(({ name, file }): DroppedFile => ({ name, size: file.size }));
  const list = new TextEncoder().encode(JSON.stringify(entries));
  const length = new DataView(new ArrayBuffer(4));
  length.setUint32(0, list.length, true);
  return new Blob(["LUMF", length, list, ...files.map(({ file }) => file)], { type: "application/octet-stream" });
}

export class Drop {
  constructor(
    private readonly ticket: (errand: Errand) => Promise<string>, private readonly alert: (title: string, text: string) => void,
  ) {
    const stage = byId("stage");
    stage.addEventListener("dragover", (event) => {
      event.preventDefault();
      stage.classList.add("over");
    });
    stage.addEventListener("dragleave", () => stage.classList.remove("over"));
    stage.addEventListener("drop", (event) => {
      event.preventDefault();
      stage.classList.remove("over");
      if (event.dataTransfer) void dropped(event.dataTransfer).then((files) => this.send(files));
    });
    for (const input of document.querySelectorAll<HTMLInputElement>("input.opens")) {
      input.addEventListener("change", () => {
        const files = [...(input.files ?? [])].map((file) => ({ name: file.webkitRelativePath || file.name, file }));
        void this.send(files).then(() => (input.value = ""));
      });
    }
  }

  private async send(files: Named[]): Promise<void> {
    if (files.length === 0) return;
    if (files.reduce((sum, { file }) => sum + file.size, 0) > MAX_BYTES) {
      this.alert("The files were not opened.", "They are more than 256 MiB: open them from the command line.");
      return;
    }
    try {
      const headers = { "Content-Type": "application/octet-stream" };
      const answer = await fetch(await this.ticket({ for: "scene" }), { method: "POST", headers, body: bundled(files) });
      if (!answer.ok) this.alert("The files were not opened.", await answer.text());
    } catch {
      this.alert("The files were not opened.", "The viewer does not answer.");
    }
  }
}
