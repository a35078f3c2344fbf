// Buttons and fields: what they send to the viewer.
import type { App } from "./app";
import { byId, on } from "./elements";
import type { Channel } from "./messages";

export function connectControls(app: App): void {
  const { page } = app;
  on("pause", "click", () => page.set({ paused: !page.state?.paused }));
  on("reset", "click", () => page.reset(page.state?.camera ?? 0));
  on("help-open", "click", () => byId<HTMLDialogElement>("help").showModal());
  on("help-close", "click", () => byId<HTMLDialogElement>("help").close());
  on("channel", "change", ({ value }) => page.set({ channel: value as Channel }));
  on("exposure", "input", ({ value }) => page.set({ exposure: Number(value) }));
  on("tone-map", "change", ({ value }) => page.set({ tone_map: value }));
  on("false-colour", "change", ({ checked }) => page.set({ false_colour: checked }));
  on("denoise", "change", ({ checked }) => page.set({ denoise: checked }));
  on("scale", "change", ({ value }) => page.set({ scale: Number(value) }));
  on("noise-target", "change", (input) => input.checkValidity() && page.set({ noise: Number(input.value) }));
  on("spp", "change", (input) => input.checkValidity() && page.set({ spp: Number(input.value) }));
  connectPicked(app);
  connectCamera(app);
  connectMoment(app);
}

/** The buttons of the shape that was clicked. */
function connectPicked(app: App): void {
  const { editor, lights, tree } = app;
  on("edit-picked", "click", () => app.picked?.owner && editor.reveal(app.picked.owner));
  on("light-picked", "click", () => lights.reveal(app.picked?.owner ?? null));
  on("find-picked", "click", () => app.picked && tree.reveal(app.picked.shape));
  on("hide-picked", "click", () => app.picked && tree.hide(app.picked.shape));
  on("isolate-picked", "click", () => app.picked && tree.isolate(app.picked.shape));
}

function connectCamera({ page, camera }: App): void {
  on("below-ground", "change", ({ checked }) => {
    camera.mayGoBelow = checked;
  });
  on("camera", "change", ({ value }) => page.reset(Number(value)));
  on("fov", "change", (input) => {
    if (!input.checkValidity()) return;
    camera.fov = Number(input.value);
    page.moved();
  });
}

function connectMoment({ page }: App): void {
  const send = (changed: { time?: number; variant?: string | null }) =>
    page.send({ type: "moment", time: page.state?.time ?? null, variant: page.state?.variant ?? null, ...changed });
  on("animation-time", "input", ({ value }) => send({ time: Number(value) }));
  on("variant", "change", ({ value }) => send({ variant: value || null }));
}
