// Parameters of materials and lights.
import { toHex } from "./colour";
import { byId, element, short } from "./elements";
import { asOptions } from "./lights";
import type { ListedParameter } from "./messages";

/** Parameters that are shown at a time. */
const MAX_LISTED = 60;

export class Editor {
  private parameters: ListedParameter[] = [];
  private settings = new Map<string, string>();

  constructor(
    private readonly panel: HTMLElement, private readonly filter: HTMLInputElement,
    private readonly edit: (path: string, value: string | null) => void,
  ) {
    filter.addEventListener("input", () => this.draw());
  }

  list(parameters: ListedParameter[]): void {
    // An edit has the scene built anew, with the same parameters: what is under the hand stays.
    if (JSON.stringify(parameters) === JSON.stringify(this.parameters)) return;
    this.parameters = parameters;
    this.draw();
  }

  take(settings: [string, string][]): void {
    this.settings = new Map(settings);
    for (const row of this.panel.querySelectorAll<HTMLElement>(".parameter")) {
      row.classList.toggle("changed", this.settings.has(row.dataset["path"] ?? ""));
    }
    const text = byId<HTMLTextAreaElement>("edit-options");
    text.value = asOptions(settings);
    text.hidden = settings.length === 0;
  }

  /** Marks the parameters of a material, where they are listed. */
  mark(owner: string | null): void {
    for (const group of this.panel.querySelectorAll<HTMLElement>("fieldset")) {
      group.classList.toggle("marked", group.dataset["owner"] === owner);
    }
  }

  /** Opens the list at the parameters of a material. */
  reveal(owner: string): void {
    byId<HTMLDetailsElement>("edit-details").open = true;
    this.filter.value = owner;
    this.draw();
    this.mark(owner);
    this.panel.querySelector(".marked")?.scrollIntoView({ block: "nearest" });
  }

  private draw(): void {
    const wanted = this.filter.value.toLowerCase();
    const found = this.parameters.filter((p) => `${p.owner} ${p.name}`.toLowerCase().includes(wanted));
    const groups = new Map<string, HTMLElement>();
    for (const parameter of found.slice(0, MAX_LISTED)) {
      let group = groups.get(parameter.owner);
      if (!group) {
        group = element("fieldset");
        group.dataset["owner"] = parameter.owner;
        group.append(element("legend", parameter.owner));
        groups.set(parameter.owner, group);
      }
      group.append(this.row(parameter));
    }
    const rest = found.length - MAX_LISTED;
    const more = rest > 0 ? [element("p", `${rest} more: find them by name.`, { className: "quiet" })] : [];
    const none = found.length === 0 ? [element("p", "No parameter has this name.", { className: "quiet" })] : [];
    this.panel.replaceChildren(...groups.values(), ...more, ...none);
  }

  private row(parameter: ListedParameter): HTMLElement {
    const id = `parameter-${parameter.path}`;
    const row = element("div", "", { className: "parameter" });
    row.dataset["path"] = parameter.path;
    row.classList.toggle("changed", this.settings.has(parameter.path));
    const input = element("input", "", { id });
    const label = element("label", parameter.name, { htmlFor: id });
    const start = () => {
      const set = this.settings.get(parameter.path);
      if (parameter.kind === "colour") {
        input.type = "color";
        input.value = set?.startsWith("#") ? set : toHex(parameter.value ?? [0.5, 0.5, 0.5]);
      } else if (parameter.kind === "number" || parameter.kind === "factor") {
        input.type = "number";
        input.step = "any";
        if (parameter.low !== null) input.min = String(parameter.low);
        if (parameter.high !== null) input.max = String(parameter.high);
        input.value = set ?? (parameter.value ? short(parameter.value[0] ?? 0) : "");
      } else {
        input.type = "text";
        input.value = set ?? (parameter.value ?? []).map(short).join(",");
      }
      if (!parameter.value && !set) input.placeholder = "texture";
    };
    start();
    const event = parameter.kind === "colour" ? "input" : "change";
    input.addEventListener(event, () => input.value !== "" && this.edit(parameter.path, input.value));
    const back = element("button", "↺", { title: `Undo ${parameter.name}` });
    back.setAttribute("aria-label", `Undo ${parameter.name} of ${parameter.owner}`);
    back.addEventListener("click", () => {
      this.settings.delete(parameter.path);
      this.edit(parameter.path, null);
      start();
    });
    row.append(label, input, back);
    return row;
  }

  /** As an overlay file. */
  overlay(): string {
    return [...this.settings].map(([path, value]) => `${path} = ${value}\n`).join("");
  }

  dropAll(): void {
    for (const path of this.settings.keys()) this.edit(path, null);
    this.settings.clear();
    this.draw();
  }
}
