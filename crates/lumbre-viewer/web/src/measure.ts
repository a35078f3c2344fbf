// The distance between two points of surfaces.
import { byId, element, short } from "./elements";
import type { ListedHit } from "./messages";
import type { Sheet } from "./sheet";
import { length, sub, type Vector } from "./vectors";

interface Point { at: [number, number]; point: Vector }

export class Measure {
  private readonly button = byId<HTMLButtonElement>("measure");
  private points: Point[] = [];
  isOn = false;

  constructor(private readonly sheet: Sheet) {
    this.button.addEventListener("click", () => this.toggle());
  }

  toggle(): void {
    this.isOn = !this.isOn;
    this.points = [];
    this.button.setAttribute("aria-pressed", String(this.isOn));
    if (this.isOn) byId<HTMLDetailsElement>("measure-details").open = true;
    this.draw();
  }

  /** Another point; a third one begins anew. */
  take(x: number, y: number, hit: ListedHit | undefined): void {
    if (!this.isOn || !hit?.surface) return;
    if (this.points.length >= 2) this.points = [];
    this.points.push({ at: [x, y], point: hit.surface.point });
    this.draw();
  }

  /** The picture shows the points elsewhere now. */
  moved(): void {
    this.sheet.mark([]);
  }

  private draw(): void {
    this.sheet.mark(this.points.map(({ at }) => at));
    const [a, b] = this.points;
    const rows: [string, string][] = [];
    if (a && b) {
      const by = sub(b.point, a.point);
      rows.push(["Distance", short(length(by))]);
      rows.push(...by.map((value, i): [string, string] => [`Along ${"xyz"[i]}`, short(value)]));
    } else if (this.isOn) {
      rows.push(["", a ? "Click on the second point." : "Click on the first point."]);
    }
    byId("measured").replaceChildren(...rows.flatMap(([name, text]) => [element("dt", name), element("dd", text)]));
  }
}
