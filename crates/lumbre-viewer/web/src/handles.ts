// Lights as places in the picture that can be dragged, while the list of lights is open.
import { byId, element, short } from "./elements";
import type { ListedParameter } from "./messages";
import type { Page } from "./page";
import { add, dot, scale, sub, type Vector } from "./vectors";

/** How far a key moves a light, as a share of its distance from the camera. */
const STEP = 0.02;
const KEYS: Record<string, Vector> = {
  ArrowLeft: [-1, 0, 0], ArrowRight: [1, 0, 0], ArrowUp: [0, 1, 0], ArrowDown: [0, -1, 0], PageUp: [0, 0, 1], PageDown: [0, 0, -1],
};

/** A light: where it stands, and what moves it. */
interface Handle { path: string; owner: string; start: Vector; at: Vector; button: HTMLButtonElement }

export class LightHandles {
  private readonly layer = byId("handles");
  private readonly list = byId<HTMLDetailsElement>("light-details");
  private handles: Handle[] = [];
  /** The handle under the pointer, and where that was last. */
  private held: { handle: Handle; x: number; y: number } | null = null;
  private isWaiting = false;

  constructor(private readonly page: Page, private readonly edit: (path: string, value: string) => void) {
    this.list.addEventListener("toggle", () => this.draw());
  }

  /** The lights of a scene. */
  show(parameters: ListedParameter[]): void {
    const places = parameters.filter(({ path, kind }) => kind === "point" && path.startsWith("light."));
    const known = (handle: Handle | undefined, { path, owner }: ListedParameter) => handle?.path === path && handle.owner === owner;
    const isSame = places.length === this.handles.length && places.every((place, i) => known(this.handles[i], place));
    if (!isSame) {
      this.handles = places.map((place) => this.handle(place));
      this.layer.replaceChildren(...this.handles.map(({ button }) => button));
    }
    for (const [i, { value }] of places.entries()) {
      const handle = this.handles[i];
      if (handle && value) handle.start = vector(value);
    }
    this.draw();
  }

  /** The edits that hold: a light that is not edited stands where the file says. */
  take(settings: [string, string][]): void {
    const edits = new Map(settings);
    for (const handle of this.handles) {
      const set = edits.get(handle.path);
      if (handle !== this.held?.handle) handle.at = set === undefined ? handle.start : vector(set.split(",").map(Number));
    }
    this.draw();
  }

  /** Puts the handles where the camera sees the lights. */
  draw(): void {
    const { camera, scene, state, watches } = this.page;
    this.layer.hidden = !this.list.open || !scene || camera.fov === null || watches;
    if (this.layer.hidden) return;
    const window = scene?.cameras[state?.camera ?? 0]?.window ?? null;
    for (const { at, button } of this.handles) {
      const seen = this.seen(at, window);
      button.hidden = seen === null;
      if (seen) [button.style.left, button.style.top] = [`${100 * seen[0]}%`, `${100 * seen[1]}%`];
    }
  }

  /** The place in the picture of a point, in shares of its width and height; null behind the camera and outside. */
  private seen(point: Vector, window: [number, number, number, number] | null): [number, number] | null {
    const { camera, sheet } = this.page;
    const way = sub(point, camera.placement.eye);
    const depth = dot(way, camera.forward());
    if (depth <= 0) return null;
    const slope = this.slope();
    const [x, y] = [dot(way, camera.right()) / depth / slope, dot(way, camera.upward()) / depth / slope];
    const shorter = Math.min(sheet.width, sheet.height);
    const [half, high] = [sheet.width / shorter, sheet.height / shorter];
    const [left, right, bottom, top] = window ?? [-half, half, -high, high];
    const place: [number, number] = [(x - left) / (right - left), (top - y) / (top - bottom)];
    return place.every((share) => share >= 0 && share <= 1) ? place : null;
  }

  /** Half the field of view, as a slope. */
  private slope(): number {
    return Math.tan(((this.page.camera.fov ?? 45) * Math.PI) / 360);
  }

  private handle({ path, owner, value }: ListedParameter): Handle {
    const button = element("button", "", { className: "handle", title: `${owner}: drag it; with Shift, nearer and farther` });
    button.setAttribute("aria-label", `Move ${owner}: arrow keys, Page Up and Page Down`);
    const at = vector(value ?? [0, 0, 0]);
    const handle: Handle = { path, owner, start: at, at, button };
    button.addEventListener("pointerdown", (event) => {
      button.setPointerCapture(event.pointerId);
      this.held = { handle, x: event.clientX, y: event.clientY };
    });
    button.addEventListener("pointermove", (event) => {
      if (this.held?.handle !== handle) return;
      const { sheet } = this.page;
      // Across the picture at the depth of the light, as far as the pointer goes.
      const pixel = (2 * this.slope()) / (Math.min(sheet.width, sheet.height) * sheet.scale());
      const [x, y] = [(event.clientX - this.held.x) * pixel, (this.held.y - event.clientY) * pixel];
      this.held = { handle, x: event.clientX, y: event.clientY };
      this.move(handle, event.shiftKey ? [0, 0, y] : [x, y, 0]);
    });
    for (const end of ["pointerup", "pointercancel"] as const) {
      button.addEventListener(end, () => {
        this.held = null;
      });
    }
    button.addEventListener("keydown", (event) => {
      const along = KEYS[event.key];
      if (!along) return;
      event.preventDefault();
      this.move(handle, scale(along, STEP));
    });
    return handle;
  }

  /** Moves a light to the right, up and away from the camera, in shares of its depth. */
  private move(handle: Handle, [right, up, away]: Vector): void {
    const { camera } = this.page;
    const depth = dot(sub(handle.at, camera.placement.eye), camera.forward());
    const across = add(scale(camera.right(), right * depth), scale(camera.upward(), up * depth));
    handle.at = add(handle.at, add(across, scale(camera.forward(), away * depth)));
    this.draw();
    if (this.isWaiting) return;
    this.isWaiting = true;
    requestAnimationFrame(() => {
      this.isWaiting = false;
      this.edit(handle.path, handle.at.map(short).join(","));
    });
  }
}

function vector([x, y, z]: number[]): Vector {
  return [x ?? 0, y ?? 0, z ?? 0];
}
