// Mouse, fingers and keys.
import type { Camera } from "./camera";
import type { Sheet } from "./sheet";

export interface InputHandlers {
  /** The camera has moved. */
  moved(): void;
  /** What is at this place of the picture? Whether to turn around it from now on. */
  pick(x: number, y: number, turnAround: boolean): void;
  /** The pointer is there, or nowhere. */
  hover(at: [number, number] | null): void;
  /** A key that neither moves nor picks; whether it does something. */
  key(event: KeyboardEvent): boolean;
}

/** How far a pointer goes before it is a drag, in screen pixels. */
const STILL = 4;

export function attach(canvas: HTMLCanvasElement, sheet: Sheet, camera: Camera, handlers: InputHandlers): void {
  const pointers = new Map<number, PointerEvent>();
  let travelled = 0;
  /** Whether there were two fingers since the last time that there was none. */
  let wasPair = false;
  const spread = () => {
    const [a, b] = [...pointers.values()];
    return a && b ? Math.hypot(a.clientX - b.clientX, a.clientY - b.clientY) : 0;
  };

  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    canvas.focus();
    pointers.set(event.pointerId, event);
    if (pointers.size === 1) [travelled, wasPair] = [0, false];
    if (pointers.size > 1) wasPair = true;
  });
  canvas.addEventListener("pointermove", (event) => {
    const before = pointers.get(event.pointerId);
    if (!before) {
      handlers.hover(sheet.at(event.clientX, event.clientY));
      return;
    }
    const wide = spread();
    const [dx, dy] = [event.clientX - before.clientX, event.clientY - before.clientY];
    pointers.set(event.pointerId, event);
    travelled += Math.hypot(dx, dy);
    if (travelled < STILL) return;
    const height = Math.max(1, sheet.height * sheet.scale());
    const pan = (share = 1) => {
      const span = camera.fov === null ? 1 : 2 * Math.tan((camera.fov * Math.PI) / 360);
      camera.move((-dx / height) * span * share, (dy / height) * span * share, 0);
    };
    if (pointers.size >= 2) {
      if (wide > 0) camera.dolly(wide / Math.max(1, spread()));
      // Both fingers say how far they went: the point between them goes the mean of it.
      pan(1 / pointers.size);
    } else if (wasPair) {
      // The finger that is left of a pair turns nothing.
      return;
    } else if (sheet.isZoomed() && event.ctrlKey) {
      sheet.slide(dx, dy);
      return;
    } else if (before.button === 2 || before.button === 1 || (event.buttons & 6) !== 0 || event.shiftKey) {
      pan();
    } else {
      camera.orbit((-dx / height) * Math.PI, (dy / height) * Math.PI);
    }
    handlers.moved();
  });
  const up = (event: PointerEvent) => {
    const was = pointers.delete(event.pointerId);
    if (was && pointers.size === 0 && travelled < STILL && !wasPair && event.type === "pointerup" && event.button === 0) {
      const at = sheet.at(event.clientX, event.clientY);
      if (at) handlers.pick(at[0], at[1], false);
    }
  };
  canvas.addEventListener("pointerup", up);
  canvas.addEventListener("pointercancel", up);
  canvas.addEventListener("pointerleave", () => handlers.hover(null));
  canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  canvas.addEventListener("dblclick", (event) => {
    const at = sheet.at(event.clientX, event.clientY);
    if (at) handlers.pick(at[0], at[1], true);
  });
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    const factor = Math.exp(Math.max(-1, Math.min(1, event.deltaY / 300)));
    if (event.ctrlKey || event.metaKey) {
      const box = (canvas.parentElement?.parentElement ?? canvas).getBoundingClientRect();
      sheet.zoomBy(1 / factor, event.clientX - box.left, event.clientY - box.top);
      return;
    }
    camera.dolly(factor);
    handlers.moved();
  }, { passive: false });

  const held = new Set<string>();
  let last = 0;
  const FLY: Record<string, [number, number, number]> = {
    w: [0, 0, 1], s: [0, 0, -1], a: [-1, 0, 0], d: [1, 0, 0], q: [0, -1, 0], e: [0, 1, 0],
  };
  const TURN: Record<string, [number, number]> = {
    arrowleft: [-1, 0], arrowright: [1, 0], arrowup: [0, 1], arrowdown: [0, -1],
  };
  const fly = (now: number) => {
    if (held.size === 0) return;
    const seconds = Math.min(0.1, (now - last) / 1000);
    last = now;
    const fast = held.has("shift") ? 4 : 1;
    let any = false;
    for (const key of held) {
      const [step, turn] = [FLY[key], TURN[key]];
      const by = seconds * 0.8 * fast;
      if (step) camera.move(step[0] * by, step[1] * by, step[2] * by);
      if (turn) camera.orbit(turn[0] * by, turn[1] * by);
      if (key === "pageup" || key === "pagedown") camera.dolly(Math.exp(key === "pageup" ? -by : by));
      any ||= key !== "shift";
    }
    if (any) handlers.moved();
    requestAnimationFrame(fly);
  };
  canvas.addEventListener("keydown", (event) => {
    if (event.metaKey || event.altKey) return;
    if (event.ctrlKey) {
      if (handlers.key(event)) event.preventDefault();
      return;
    }
    const key = event.key.toLowerCase();
    if (key in FLY || key in TURN || key === "pageup" || key === "pagedown" || key === "shift") {
      event.preventDefault();
      if (held.size === 0) {
        last = performance.now() - 16;
        requestAnimationFrame(fly);
      }
      held.add(key);
    } else if (key === "enter") {
      handlers.pick(sheet.width / 2, sheet.height / 2, false);
    } else if (handlers.key(event)) {
      event.preventDefault();
    }
  });
  canvas.addEventListener("keyup", (event) => held.delete(event.key.toLowerCase()));
  canvas.addEventListener("blur", () => held.clear());
}
