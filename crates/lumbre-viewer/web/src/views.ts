// Standard views, and views that are kept.
import type { Camera } from "./camera";
import { byId, element } from "./elements";
import type { Placement } from "./messages";
import type { Page } from "./page";
import { add, cross, dot, length, scale, sub, unit, type Vector } from "./vectors";

/** Names of the standard views, as their buttons have them. */
export type Standard = "front" | "back" | "right" | "left" | "top" | "bottom";
const OPPOSITE: Record<Standard, Standard> = { front: "back", back: "front", right: "left", left: "right", top: "bottom", bottom: "top" };
/** How far from straight above one looks, in radians, so that it is plain what is upwards in the picture. */
const TILT = 2e-3;

/** The directions from which a scene is seen from its front and from its right: the front of a model is where the shortest turn takes +z
 * when it takes +y to what is up. */
export function sides(up: Vector): { front: Vector; right: Vector } {
  const y: Vector = [0, 1, 0];
  const z: Vector = [0, 0, 1];
  const n = unit(up);
  const c = dot(y, n);
  // Rodrigues, of the turn from y to n about their vector product; downwards, half a turn about x.
  const axis = cross(y, n);
  const front: Vector = c < -1 + 1e-9 ? [0, 0, -1] : add(add(scale(z, c), cross(axis, z)), scale(axis, dot(axis, z) / (1 + c)));
  return { front: unit(front), right: unit(cross(n, front)) };
}

interface Kept { name: string; placement: Placement; fov: number | null; zoom: number }

export class Views {
  private kept: Kept[] = [];
  private sceneName = "";

  constructor(private readonly page: Page, private readonly camera: Camera) {
    for (const button of document.querySelectorAll<HTMLButtonElement>("button[data-view]")) {
      button.addEventListener("click", () => this.show(button.dataset["view"] as Standard));
    }
    byId("keep-view").addEventListener("click", () => this.keep());
  }

  /** The views that were kept of a scene. */
  open(name: string): void {
    if (name === this.sceneName) return;
    this.sceneName = name;
    this.kept = JSON.parse(sessionStorage.getItem(this.key) ?? "[]") as Kept[];
    this.draw();
  }

  /** All of the scene from one of its sides. */
  show(side: Standard): void {
    const { scene } = this.page;
    if (!scene?.bounds) return;
    const [low, high] = scene.bounds;
    const up = unit(this.camera.upwards);
    const { front, right } = sides(up);
    const above = unit(add(up, scale(front, TILT)));
    const below = unit(add(scale(up, -1), scale(front, TILT)));
    const from: Record<Standard, Vector> = { front, back: scale(front, -1), right, left: scale(right, -1), top: above, bottom: below };
    const target = scale(add(low, high), 0.5);
    const radius = 0.5 * length(sub(high, low)) || 1;
    const half = ((this.camera.fov ?? 45) * Math.PI) / 360;
    const eye = add(target, scale(from[side], (1.05 * radius) / Math.sin(half)));
    // Who asks to see it from below is asked for nothing more.
    if (side === "bottom") this.camera.mayGoBelow = true;
    this.camera.place({ eye, target, up });
    this.page.moved();
  }

  /** From the other side. */
  turn(): void {
    const { eye, target, up } = this.camera.placement;
    this.camera.place({ eye: sub(scale(target, 2), eye), target, up });
    this.page.moved();
  }

  static opposite(side: Standard): Standard {
    return OPPOSITE[side];
  }

  private get key(): string {
    return `lumbre-views:${this.sceneName}`;
  }

  private keep(): void {
    const input = byId<HTMLInputElement>("view-name");
    const { placement, fov, zoom } = this.camera;
    this.kept.push({ name: input.value.trim() || `View ${this.kept.length + 1}`, placement, fov, zoom });
    input.value = "";
    this.store();
  }

  private store(): void {
    sessionStorage.setItem(this.key, JSON.stringify(this.kept));
    this.draw();
  }

  private draw(): void {
    const rows = this.kept.map((view, i) => {
      const row = element("li");
      const show = element("button", view.name, { className: "select" });
      show.addEventListener("click", () => {
        [this.camera.fov, this.camera.zoom] = [view.fov, view.zoom];
        this.camera.place(view.placement);
        this.page.moved();
      });
      const drop = element("button", "Remove");
      drop.setAttribute("aria-label", `Remove ${view.name}`);
      drop.addEventListener("click", () => {
        this.kept.splice(i, 1);
        this.store();
      });
      row.append(show, drop);
      return row;
    });
    byId("kept-views").replaceChildren(...rows);
  }
}
