// A plane in front of which nothing is seen.
import { byId } from "./elements";
import type { Plane, ViewerState } from "./messages";
import type { Page } from "./page";
import { add, dot, scale, sub, type Vector } from "./vectors";

const AXES: Record<string, Vector> = { x: [1, 0, 0], y: [0, 1, 0], z: [0, 0, 1] };

export class Section {
  private readonly axis = byId<HTMLSelectElement>("section-axis");
  private readonly place = byId<HTMLInputElement>("section-place");
  private shown: Plane | null = null;

  constructor(private readonly page: Page) {
    this.axis.addEventListener("change", () => this.send());
    this.place.addEventListener("input", () => this.send());
    this.draw();
  }

  take({ section }: ViewerState): void {
    this.shown = section;
    if (!section && document.activeElement !== this.axis) this.axis.value = "none";
    this.draw();
  }

  /** The camera was moved: what is on its side of the plane is cut away. */
  moved(): void {
    const plane = this.plane();
    if (plane && this.shown && this.axis.value !== "view" && dot(plane.normal, this.shown.normal) < 0) this.send();
  }

  private plane(): Plane | null {
    const { camera, scene } = this.page;
    const share = Number(this.place.value) / 100;
    if (this.axis.value === "view") {
      // To twice as far as what is looked at.
      const point = add(camera.placement.eye, scale(camera.forward(), 2 * share * camera.distance()));
      return { point, normal: scale(camera.forward(), -1) };
    }
    const axis = AXES[this.axis.value];
    if (!axis || !scene?.bounds) return null;
    const [low, high] = scene.bounds;
    const point = add(low, scale(sub(high, low), share));
    const side = dot(sub(camera.placement.eye, point), axis) < 0 ? -1 : 1;
    return { point, normal: scale(axis, side) };
  }

  private send(): void {
    this.shown = this.plane();
    this.page.send({ type: "section", plane: this.shown });
    this.draw();
  }

  private draw(): void {
    this.place.disabled = this.axis.value === "none";
  }
}
