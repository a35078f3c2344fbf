// Keys that neither move the camera nor pick: see hands.ts for those.
import type { App } from "./app";
import { byId } from "./elements";
import type { Channel } from "./messages";
import { Views, type Standard } from "./views";

/** Channels by the digit that shows them, with Shift. */
const CHANNELS: Channel[] = ["beauty", "albedo", "normal", "depth", "uv", "variance", "ids"];
/** Views by their digit; with Control, the opposite ones. */
const VIEWS: Record<string, Standard> = { 1: "front", 3: "right", 7: "top" };
/** Stops. */
const EXPOSURE_STEP = 0.5;
const ZOOM_STEP = 1.5;

/** Acts on a key, and says whether it means something. */
export function pressKey(app: App, event: KeyboardEvent): boolean {
  const { page, sheet, views, tree, picked } = app;
  const pressed = event.key.toLowerCase();
  // With Shift, the key of a digit has another sign on each keyboard.
  const digit = /^(?:Digit|Numpad)([0-9])$/.exec(event.code)?.[1] ?? pressed;
  const channel = event.shiftKey ? CHANNELS[Number(digit) - 1] : undefined;
  const view = VIEWS[digit];
  const exposure = page.state?.exposure ?? 0;
  if (channel) page.set({ channel });
  else if (view) views.show(event.ctrlKey ? Views.opposite(view) : view);
  else if (event.ctrlKey) return false;
  else if (digit === "9") views.turn();
  else if (pressed === "r") page.reset(page.state?.camera ?? 0);
  else if (pressed === "x") app.explanation.show();
  else if (pressed === "m") app.measure.toggle();
  else if (pressed === "h" && picked) tree.hide(picked.shape);
  else if (pressed === "i" && picked) tree.isolate(picked.shape);
  else if (pressed === "p") page.set({ paused: !page.state?.paused });
  else if (digit === "0") sheet.zoomOut();
  else if (pressed === "+" || pressed === "=") sheet.zoomBy(ZOOM_STEP);
  else if (pressed === "-") sheet.zoomBy(1 / ZOOM_STEP);
  else if (pressed === "[") page.set({ exposure: exposure - EXPOSURE_STEP });
  else if (pressed === "]") page.set({ exposure: exposure + EXPOSURE_STEP });
  else if (pressed === "?") byId<HTMLDialogElement>("help").showModal();
  else return false;
  return true;
}
