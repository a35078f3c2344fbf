// The shapes of the scene by name: selected, hidden, isolated.
import { byId, element } from "./elements";
import type { HiddenShapes, ListedShape, SceneFacts } from "./messages";
import type { Page } from "./page";

/** Shapes that are listed at a time. */
const MAX_LISTED = 200;

/** What people call a shape. The ground has a number that says nothing. */
export function called({ shape, kind, name }: ListedShape): string {
  if (kind === "ground") return kind;
  return name ? `${name} (${kind})` : `${kind} ${shape}`;
}

export class SceneTree {
  private readonly panel = byId("tree");
  private readonly filter = byId<HTMLInputElement>("tree-filter");
  private readonly all = byId<HTMLButtonElement>("show-all");
  private scene: SceneFacts | undefined;
  private hidden: HiddenShapes = { shapes: [], others: false };
  private selected = -1;

  constructor(private readonly page: Page, private readonly onSelect: (thing: ListedShape) => void) {
    this.filter.addEventListener("input", () => this.draw());
    this.all.addEventListener("click", () => this.send([], false));
  }

  list(scene: SceneFacts): void {
    const isSame = JSON.stringify(scene.tree) === JSON.stringify(this.scene?.tree);
    this.scene = scene;
    if (!isSame) this.draw();
  }

  take(hidden: HiddenShapes): void {
    this.hidden = hidden;
    this.all.disabled = hidden.shapes.length === 0;
    for (const row of this.panel.querySelectorAll<HTMLElement>("li")) this.mark(row);
  }

  /** Marks a shape, and brings it into sight where the tree is open. */
  select(shape: number): void {
    this.selected = shape;
    for (const row of this.panel.querySelectorAll<HTMLElement>("li")) this.mark(row);
    const row = this.panel.querySelector<HTMLElement>(`li[data-shape="${shape}"]`);
    if (row && byId<HTMLDetailsElement>("tree-details").open) row.scrollIntoView({ block: "nearest" });
  }

  /** Opens the tree at a shape. */
  reveal(shape: number): void {
    byId<HTMLDetailsElement>("tree-details").open = true;
    if (this.filter.value !== "") {
      this.filter.value = "";
      this.draw();
    }
    this.select(shape);
  }

  isHidden(shape: number): boolean {
    return this.hidden.shapes.includes(shape) !== this.hidden.others;
  }

  hide(shape: number): void {
    const { shapes, others } = this.hidden;
    const rest = shapes.filter((known) => known !== shape);
    this.send(rest.length < shapes.length ? rest : [...rest, shape], others);
  }

  /** Shows this shape alone, or everything again. */
  isolate(shape: number): void {
    const { shapes, others } = this.hidden;
    const isAlone = others && shapes.length === 1 && shapes[0] === shape;
    this.send(isAlone ? [] : [shape], !isAlone);
  }

  private send(shapes: number[], others: boolean): void {
    this.page.send({ type: "hide", shapes, others });
  }

  private draw(): void {
    const wanted = this.filter.value.toLowerCase();
    const { groups = [], left_out = 0 } = this.scene?.tree ?? {};
    const isWanted = (thing: ListedShape, group: string | null) =>
      `${group ?? ""} ${called(thing)} ${thing.material ?? ""}`.toLowerCase().includes(wanted);
    let left = MAX_LISTED;
    let rest = left_out;
    const parts = groups.flatMap(({ name, shapes }): HTMLElement[] => {
      const found = shapes.filter((thing) => isWanted(thing, name));
      const listed = found.slice(0, left);
      left -= listed.length;
      rest += found.length - listed.length;
      if (listed.length === 0) return [];
      const list = element("ul");
      list.append(...listed.map((thing) => this.row(thing)));
      if (name === null) return [list];
      const part = element("details", "", { open: true });
      part.append(element("summary", name || "moving"), list);
      return [part];
    });
    const more = rest > 0 ? [element("p", `${rest} more: find them by name.`, { className: "quiet" })] : [];
    const none = parts.length === 0 ? [element("p", "No shape has this name.", { className: "quiet" })] : [];
    this.panel.replaceChildren(...parts, ...more, ...none);
  }

  private row(thing: ListedShape): HTMLElement {
    const row = element("li");
    row.dataset["shape"] = String(thing.shape);
    const name = called(thing);
    const select = element("button", name, { className: "select" });
    select.append(element("span", thing.material ?? "no material", { className: "quiet" }));
    select.addEventListener("click", () => {
      this.select(thing.shape);
      this.onSelect(thing);
    });
    const hide = element("button", "", { className: "hide" });
    hide.setAttribute("aria-label", `Hide ${name}`);
    hide.addEventListener("click", () => this.hide(thing.shape));
    const isolate = element("button", "Only", { className: "isolate" });
    isolate.setAttribute("aria-label", `Only ${name}`);
    isolate.addEventListener("click", () => this.isolate(thing.shape));
    row.append(select, hide, isolate);
    this.mark(row);
    return row;
  }

  private mark(row: HTMLElement): void {
    const shape = Number(row.dataset["shape"]);
    const isHidden = this.isHidden(shape);
    row.classList.toggle("hidden-shape", isHidden);
    row.querySelector(".select")?.setAttribute("aria-pressed", String(shape === this.selected));
    const hide = row.querySelector<HTMLElement>(".hide");
    if (!hide) return;
    hide.textContent = isHidden ? "Show" : "Hide";
    hide.setAttribute("aria-pressed", String(isHidden));
    const { shapes, others } = this.hidden;
    const isAlone = others && shapes.length === 1 && shapes[0] === shape;
    row.querySelector(".isolate")?.setAttribute("aria-pressed", String(isAlone));
  }
}
