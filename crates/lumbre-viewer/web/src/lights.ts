// The lights with their colour and power. Edits are kept by the viewer, as those of all parameters.
import { fromHex, toHex } from "./colour";
import { byId, element, short } from "./elements";
import type { ListedParameter } from "./messages";

/** A colour as its brightest channel, and the colour that is left. */
export function parted(light: number[]): { power: number; colour: number[] } {
  const power = Math.max(0, ...light);
  return { power, colour: power > 0 ? light.map((c) => c / power) : [1, 1, 1] };
}

/** Settings as options of the program, for a shell. */
export function asOptions(settings: [string, string][]): string {
  const quoted = (text: string) => (/^[\w.,=+-]+$/.test(text) ? text : `'${text.replaceAll("'", "'\\''")}'`);
  return settings.map(([path, value]) => `-D ${quoted(`${path}=${value}`)}`).join(" \\\n");
}

/** The numbers of a setting of a light; a single one is grey. */
function numbers(text: string): number[] {
  const all = text.split(",").map(Number);
  return all.length === 1 ? [all[0] ?? 0, all[0] ?? 0, all[0] ?? 0] : all;
}

export class LightList {
  private readonly panel = byId("lights");
  private lights: ListedParameter[] = [];
  private settings = new Map<string, string>();

  constructor(private readonly edit: (path: string, value: string | null) => void) {}

  list(parameters: ListedParameter[]): void {
    const lights = parameters.filter(({ path, kind }) => kind === "light" || path === "light.area.scale");
    if (JSON.stringify(lights) === JSON.stringify(this.lights)) return;
    this.lights = lights;
    const none = element("p", "The scene has no light that can be set: the stage brings it.", { className: "quiet" });
    this.panel.replaceChildren(...(lights.length > 0 ? lights.map((light) => this.row(light)) : [none]));
  }

  take(settings: [string, string][]): void {
    this.settings = new Map(settings);
    const own = settings.filter(([path]) => path.startsWith("light.") || this.lights.some((light) => light.path === path));
    const text = byId<HTMLTextAreaElement>("light-options");
    text.value = asOptions(own);
    text.hidden = own.length === 0;
    for (const row of this.panel.querySelectorAll<HTMLElement>("[data-path]")) {
      row.classList.toggle("changed", this.settings.has(row.dataset["path"] ?? ""));
    }
  }

  /** Opens the list, and marks what makes shapes of this material shine. */
  reveal(owner: string | null): void {
    byId<HTMLDetailsElement>("light-details").open = true;
    const rows = [...this.panel.querySelectorAll<HTMLElement>("[data-path]")];
    const found = rows.find((row) => row.dataset["owner"] === owner) ?? rows.find((row) => row.dataset["path"] === "light.area.scale");
    for (const row of rows) row.classList.toggle("marked", row === found);
    found?.scrollIntoView({ block: "nearest" });
  }

  private value(light: ListedParameter): number[] {
    const set = this.settings.get(light.path);
    return set === undefined ? light.value ?? [1, 1, 1] : numbers(set);
  }

  private row(light: ListedParameter): HTMLElement {
    const row = element("fieldset");
    [row.dataset["path"], row.dataset["owner"]] = [light.path, light.owner];
    row.append(element("legend", light.kind === "light" && light.path.startsWith("material.") ? `${light.owner}: ${light.name}` : light.owner));
    const fields = element("div", "", { className: "parameter" });
    const power = element("input", "", { type: "number", min: "0", step: "any", id: `power-${light.path}` });
    const colour = element("input", "", { type: "color" });
    colour.setAttribute("aria-label", `Colour of ${light.owner}`);
    const start = () => {
      const now = parted(this.value(light));
      power.value = short(light.kind === "factor" ? this.value(light)[0] ?? 1 : now.power);
      colour.value = toHex(now.colour);
    };
    const send = () => {
      const factor = Number(power.value);
      if (power.value === "" || !(factor >= 0)) return;
      const all = fromHex(colour.value).map((c) => short(c * factor));
      this.edit(light.path, light.kind === "factor" ? short(factor) : all.join(","));
    };
    start();
    power.addEventListener("change", send);
    colour.addEventListener("input", send);
    const back = element("button", "↺", { title: `Undo ${light.owner}` });
    back.setAttribute("aria-label", `Undo ${light.owner}`);
    back.addEventListener("click", () => {
      this.settings.delete(light.path);
      this.edit(light.path, null);
      start();
    });
    fields.append(element("label", light.kind === "factor" ? "Power, as a factor" : "Power", { htmlFor: power.id }), power, back);
    row.append(fields);
    if (light.kind !== "factor") row.append(colour);
    return row;
  }
}
