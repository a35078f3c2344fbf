// A page that was exported: what a viewer would say is in it.
import type { Listener } from "./connection";
import { byId } from "./elements";
import type { Placement, Progress, Scene, State, Thing, Value } from "./protocol";

interface Channel { name: string; png: string; values: string }

/** What was exported. */
export interface Data {
  name: string; scene: Scene; placement: Placement | null; camera: number;
  progress: Omit<Progress, "doing">; channels: Channel[];
  /** What is met in the middle of each pixel: the place of the shape in the list, from 1, or 0 for nothing, and its distance. */
  picks: { shapes: Thing[]; values: string };
}

function bytes(base64: string): Uint8Array<ArrayBuffer> {
  return Uint8Array.from(atob(base64), (letter) => letter.charCodeAt(0));
}

async function unpacked(base64: string): Promise<DataView> {
  const stream = new Blob([bytes(base64)]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new DataView(await new Response(stream).arrayBuffer());
}

/** The number of 16 bits. */
export function half(bits: number): number {
  const sign = bits & 0x8000 ? -1 : 1;
  const [exponent, fraction] = [(bits >> 10) & 31, bits & 1023];
  if (exponent === 31) return fraction ? NaN : sign * Infinity;
  return exponent === 0 ? sign * fraction * 2 ** -24 : sign * (1 + fraction / 1024) * 2 ** (exponent - 15);
}

export class StaticConnection {
  private shown: ImageData | undefined;
  private values: DataView | undefined;
  private picks: DataView | undefined;

  constructor(private readonly listener: Listener, private readonly data: Data) {
    // The page has to be there before it is told anything.
    setTimeout(() => void this.start());
  }

  private async start(): Promise<void> {
    this.listener.onOpen("edit");
    this.listener.onMessage({ type: "scene", scene: this.data.scene });
    this.listener.onMessage({ type: "progress", doing: "done", ...this.data.progress });
    await this.show("beauty");
    this.picks = await unpacked(this.data.picks.values);
  }

  private state(channel: string): State {
    return {
      name: this.data.name, has_scene: true, error: null, edit_error: null, camera: this.data.camera, sequence: 0, moved: false,
      placement: this.data.placement, fov: null, zoom: 1, size: null, channel, scale: 1, spp: this.data.progress.spp ?? null,
      noise: null, denoise: null, paused: false, exposure: 0, tone_map: null, false_colour: false,
      map: "automatic", range: null, hidden: { shapes: [], others: false }, section: null, time: null, variant: null, settings: [],
    };
  }

  private async show(name: string): Promise<void> {
    const channel = this.data.channels.find((known) => known.name === name);
    if (!channel) return;
    this.listener.onMessage({ type: "state", ...this.state(name) });
    const bitmap = await createImageBitmap(new Blob([bytes(channel.png)], { type: "image/png" }));
    const canvas = new OffscreenCanvas(bitmap.width, bitmap.height);
    const drawing = canvas.getContext("2d");
    if (!drawing) return;
    drawing.drawImage(bitmap, 0, 0);
    const { width, height } = bitmap;
    const pixels = drawing.getImageData(0, 0, width, height);
    [this.shown, this.values] = [pixels, undefined];
    if (channel.values) this.values = await unpacked(channel.values);
    const spp = this.data.progress.spp ?? 0;
    this.listener.onFrame({ width, height, fullWidth: width, fullHeight: height, spp, sequence: 0, isFull: true, isDone: true, isDenoised: false, low: 0, high: 0, pixels });
  }

  private pick(x: number, y: number, request: number): void {
    if (!this.picks || !this.shown) return;
    const at = 8 * (y * this.shown.width + x);
    const thing = this.data.picks.shapes[this.picks.getUint32(at, true) - 1];
    const hits = thing ? [{ ...thing, distance: this.picks.getFloat32(at + 4, true) }] : [];
    this.listener.onMessage({ type: "picked", request, x, y, ray: { hits } });
  }

  /** There is nobody to give one. */
  ticket(): Promise<string> {
    return Promise.reject(new Error("at rest"));
  }

  send(message: object): void {
    const { type, channel, x, y, width, height, request } = message as Record<string, number> & { type: string; channel?: string };
    if (type === "set" && channel) void this.show(String(channel));
    if (type === "pick") this.pick(Math.floor(x ?? 0), Math.floor(y ?? 0), request ?? 0);
    if (type !== "values" || !this.shown) return;
    const whole = this.shown.width;
    const [x0, y0] = [x ?? 0, y ?? 0];
    const [columns, rows] = [Math.min(width ?? 0, whole - x0), Math.min(height ?? 0, this.shown.height - y0)];
    const found: [Value, Value, Value][] = [];
    for (let row = y0; row < y0 + rows; row++) {
      for (let column = x0; column < x0 + columns; column++) {
        const pixel = row * whole + column;
        const value = (c: number): Value =>
          this.values ? half(this.values.getUint16(2 * (3 * pixel + c), true)) : +((this.shown?.data[4 * pixel + c] ?? 0) / 255).toFixed(3);
        found.push([value(0), value(1), value(2)]);
      }
    }
    this.listener.onMessage({ type: "values", request: request ?? 0, x: x0, y: y0, width: columns, height: rows, values: found });
  }
}

/** What changes something. */
const CHANGES = [
  "pause", "reset", "exposure", "tone-map", "false-colour", "map", "range-low", "range-high", "range-found", "denoise", "spp", "noise-target",
  "scale", "edit-details", "camera-details", "tree-details", "light-details", "section-details", "open-more",
];
/** What else only a viewer can do. */
const ASKS = ["save-details", "help-open", "measure-details"];

/** What only a viewer can do is not offered; to who looks on, what changes something. */
export function hideWhatNeedsAViewer(watches = false): void {
  for (const id of watches ? [...CHANGES, "channel"] : [...CHANGES, ...ASKS]) {
    byId(id).classList.add("gone");
    for (const label of document.querySelectorAll<HTMLElement>(`label[for="${id}"]`)) label.classList.add("gone");
  }
  if (watches) return;
  for (const option of document.querySelectorAll("option[value=ids], option[value=variance]")) option.remove();
}
