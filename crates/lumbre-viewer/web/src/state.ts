// The state of the viewer, as the controls show it.
import type { App } from "./app";
import { byId, options, short } from "./elements";
import type { SceneFacts, ViewerState } from "./messages";

/** Writes a value into a field, unless somebody is typing there. */
function fill(id: string, text: string): void {
  const input = byId<HTMLInputElement>(id);
  if (document.activeElement !== input) input.value = text;
}

export function showState(app: App, state: ViewerState): void {
  const { page } = app;
  showName(app, state);
  const error = byId("edit-error");
  error.textContent = state.edit_error ?? "";
  error.hidden = !state.edit_error;
  showPicture(state);
  app.editor.take(state.settings);
  app.lights.take(state.settings);
  app.tree.take(state.hidden);
  app.display.take(state);
  app.section.take(state);
  app.views.open(state.name);
  byId<HTMLButtonElement>("save-overlay").disabled = state.settings.length === 0;
  byId<HTMLButtonElement>("drop-edits").disabled = state.settings.length === 0;
  if (!page.scene) return;
  showCamera(app, state, page.scene);
  app.handles.take(state.settings);
  showMoment(state, page.scene);
}

function showName({ page, alert }: App, state: ViewerState): void {
  document.title = state.name ? `${state.name} – Lumbre` : "Lumbre";
  byId("name").textContent = state.name || "Lumbre";
  const title = state.has_scene ? "The file has an error; this is the last good picture." : "The file has an error.";
  if (page.connected) alert(state.error ? title : "", state.error ?? "");
  byId("empty").hidden = state.name !== "";
  byId("sheet").hidden = state.name === "";
}

function showPicture(state: ViewerState): void {
  byId("pause").setAttribute("aria-pressed", String(state.paused));
  byId<HTMLSelectElement>("channel").value = state.channel;
  byId<HTMLSelectElement>("tone-map").value = state.tone_map ?? "none";
  byId<HTMLSelectElement>("scale").value = String(state.scale);
  const exposure = state.exposure ?? 0;
  fill("exposure", String(exposure));
  byId("exposure-value").textContent = exposure.toFixed(1);
  fill("spp", String(state.spp ?? 64));
  fill("noise-target", state.noise ? String(state.noise) : "");
  byId<HTMLInputElement>("false-colour").checked = state.false_colour;
  byId<HTMLInputElement>("denoise").checked = state.denoise ?? false;
}

function showCamera({ page, camera }: App, state: ViewerState, scene: SceneFacts): void {
  options(byId("camera"), scene.cameras.map(({ name }, i) => [String(i), name]), String(state.camera));
  page.takeCamera(state, scene);
  byId("ground-details").hidden = scene.ground === null;
  byId<HTMLInputElement>("below-ground").checked = camera.mayGoBelow;
  byId<HTMLInputElement>("fov").disabled = camera.fov === null;
  fill("fov", camera.fov === null ? "" : short(camera.fov));
}

function showMoment(state: ViewerState, scene: SceneFacts): void {
  const end = Math.max(0, ...scene.animations.map((animation) => animation.end ?? 0));
  for (const part of document.querySelectorAll<HTMLElement>(".animated")) part.hidden = end === 0;
  byId<HTMLInputElement>("animation-time").max = String(end);
  const time = state.time ?? 0;
  fill("animation-time", String(time));
  byId("time-value").textContent = `${time.toFixed(2)} s`;
  for (const part of document.querySelectorAll<HTMLElement>(".varied")) part.hidden = scene.variants.length === 0;
  const variants: [string, string][] = [["", "as in the file"], ...scene.variants.map((name): [string, string] => [name, name])];
  options(byId("variant"), variants, state.variant ?? "");
}
