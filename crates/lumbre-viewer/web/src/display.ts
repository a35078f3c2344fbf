// The colours of numbers, their legend, and the histogram.
import { byId, short } from "./elements";
import type { Page } from "./page";
import type { Frame } from "./frame";
import type { ColourMap, ViewerState } from "./messages";

/** Levels of a channel of the display. */
const LEVELS = 256;

/** Whether the channel is shown by the colours of a scale. */
const hasScale = (state: ViewerState) =>
  state.channel === "depth" || state.channel === "variance" || (state.channel === "beauty" && state.false_colour);

/** How many pixels have each level, by channel. */
export function histogram({ data }: ImageData): Uint32Array[] {
  const counts = [0, 1, 2].map(() => new Uint32Array(LEVELS));
  for (let at = 0; at < data.length; at += 4) {
    for (let channel = 0; channel < 3; channel++) {
      const count = counts[channel];
      const level = data[at + channel] ?? 0;
      if (count) count[level] = (count[level] ?? 0) + 1;
    }
  }
  return counts;
}

/** Marks what the display cannot show: white where a channel is at its end, black where all are. */
export function marked(pixels: ImageData): ImageData {
  const copy = new ImageData(new Uint8ClampedArray(pixels.data), pixels.width, pixels.height);
  const { data } = copy;
  for (let at = 0; at < data.length; at += 4) {
    const levels = [data[at] ?? 0, data[at + 1] ?? 0, data[at + 2] ?? 0];
    if (Math.max(...levels) === 255) data.set([255, 0, 60, 255], at);
    else if (Math.max(...levels) === 0) data.set([0, 90, 255, 255], at);
  }
  return copy;
}

export class Display {
  private readonly canvas = byId<HTMLCanvasElement>("histogram");
  private last: Frame | undefined;

  constructor(private readonly page: Page) {
    const range = () => {
      const [low, high] = ["range-low", "range-high"].map((id) => byId<HTMLInputElement>(id).value);
      if (low !== "" && high !== "" && Number(low) < Number(high)) page.set({ range: [Number(low), Number(high)] });
    };
    for (const id of ["range-low", "range-high"]) byId(id).addEventListener("change", range);
    byId("range-found").addEventListener("click", () => page.set({ range: [] }));
    byId("map").addEventListener("change", () => page.set({ map: byId<HTMLSelectElement>("map").value as ColourMap }));
    byId("mark-clipped").addEventListener("change", () => this.redraw());
    byId("histogram-details").addEventListener("toggle", () => this.draw());
  }

  /** The frame as it is shown. */
  shown(frame: Frame): Frame {
    this.last = frame;
    return byId<HTMLInputElement>("mark-clipped").checked ? { ...frame, pixels: marked(frame.pixels) } : frame;
  }

  take(state: ViewerState): void {
    for (const part of document.querySelectorAll<HTMLElement>(".scaled")) part.hidden = !hasScale(state);
    byId<HTMLSelectElement>("map").value = state.map;
    byId("legend").className = `scaled map-${state.map === "automatic" ? (state.channel === "depth" ? "near" : "rainbow") : state.map === "grey" && state.channel === "depth" ? "near" : state.map}`;
  }

  /** Shows the range and the histogram of the last frame. */
  draw(): void {
    const frame = this.last;
    if (!frame) return;
    for (const [id, value] of [["range-low", frame.low], ["range-high", frame.high]] as const) {
      const input = byId<HTMLInputElement>(id);
      if (document.activeElement !== input) input.value = short(value);
    }
    if (byId<HTMLDetailsElement>("histogram-details").open) this.drawHistogram(frame);
  }

  private redraw(): void {
    if (this.last) this.page.sheet.show(this.shown(this.last));
  }

  private drawHistogram(frame: Frame): void {
    const counts = histogram(frame.pixels);
    const drawing = this.canvas.getContext("2d");
    if (!drawing) return;
    const { width, height } = this.canvas;
    drawing.clearRect(0, 0, width, height);
    drawing.globalCompositeOperation = "lighter";
    // The ends are given in words: as bars they would dwarf the rest.
    const most = Math.max(1, ...counts.flatMap((count) => [...count.subarray(1, LEVELS - 1)]));
    counts.forEach((count, channel) => {
      drawing.fillStyle = ["#d03030", "#30a040", "#3060e0"][channel] ?? "#888";
      count.forEach((number, level) => {
        const tall = height * Math.min(1, number / most);
        drawing.fillRect((level * width) / LEVELS, height - tall, width / LEVELS, tall);
      });
    });
    const pixels = frame.width * frame.height;
    let [white, black] = [0, 0];
    const { data } = frame.pixels;
    for (let at = 0; at < data.length; at += 4) {
      const top = Math.max(data[at] ?? 0, data[at + 1] ?? 0, data[at + 2] ?? 0);
      if (top === 255) white += 1;
      if (top === 0) black += 1;
    }
    const share = (count: number) => `${((100 * count) / pixels).toFixed(1)} %`;
    byId("clipped").textContent = `${share(white)} at white, ${share(black)} black`;
  }
}
