// The progress of the picture, in words and as a bar.
import { byId, large, spoken } from "./elements";
import type { Doing, RenderProgress } from "./messages";

const DOING: Record<Doing, string> = {
  reading: "Reading the scene", building: "Building the scene", rendering: "", done: "",
  waiting: "Waiting for the file to be mended", nothing: "No scene",
};

/** Samples so far and in all; to a noise target, the noise so far and the target. */
function reached({ spp, target, noise, noise_target }: RenderProgress): string[] {
  if (!target) return ["done"];
  if (noise_target) {
    const now = noise === null ? [] : [`noise ${noise.toFixed(4)} of ${noise_target}`];
    return [`${spp ?? 0} samples`, ...now];
  }
  return [`${spp ?? 0} of ${target} samples`, ...(noise !== null && (spp ?? 0) > 1 ? [`noise ${noise.toFixed(4)}`] : [])];
}

export function showProgress(progress: RenderProgress): void {
  const { doing } = progress;
  const share = progress.share ?? (doing === "done" ? 1 : 0);
  let text = DOING[doing];
  if (doing === "rendering" || doing === "done") {
    const parts = reached(progress);
    if (doing === "rendering" && share > 0) parts.push(`${Math.floor(100 * share)} %`);
    if (doing === "rendering" && progress.left !== null) parts.push(`${spoken(progress.left)} left`);
    if (doing === "done" && progress.seconds) parts.push(`done in ${spoken(progress.seconds)}`);
    if (progress.rays_per_second) parts.push(`${large(progress.rays_per_second)} rays/s`);
    if (progress.dropped) parts.push(`${progress.dropped} samples dropped`);
    text = parts.join(" · ");
  }
  byId("progress").textContent = text;
  byId<HTMLProgressElement>("bar").value = progress.target || doing === "done" ? share : 0;
}
