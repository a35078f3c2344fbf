// The connection of an exported page, which holds what a viewer would send.
import type { Listener } from "./connection";
import { byId } from "./elements";
import type { Channel, ListedHit, PageMessage, PixelValue, StaticPage, ViewerState } from "./messages";

function bytes(base64: string): Uint8Array<ArrayBuffer> {
  return Uint8Array.from(atob(base64), (letter) => letter.charCodeAt(0));
}

async function unpacked(base64: string): Promise<DataView> {
  const stream = new Blob([bytes(base64)]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new DataView(await new Response(stream).arrayBuffer());
}

/** The number of half precision with these bits. */
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

  constructor(private readonly listener: Listener, private readonly data: StaticPage) {
    // The parts of the page are made first.
    setTimeout(() => void this.start());
  }

  private async start(): Promise<void> {
    this.listener.onOpen("edit");
    this.listener.onMessage({ type: "scene", scene: this.data.scene });
    const unknown = { share: null, noise_target: null, left: null, dropped: null };
    this.listener.onMessage({ type: "progress", doing: "done", ...unknown, ...this.data.progress });
    await this.show("beauty");
    this.picks = await unpacked(this.data.picks.values);
  }

  private state(channel: Channel): ViewerState {
    return {
      name: this.data.name, has_scene: true, error: null, edit_error: null, camera: this.data.camera, sequence: 0, moved: false,
      placement: this.data.placement, fov: null, zoom: 1, size: null, channel, scale: 1, spp: this.data.progress.spp,
      noise: null, denoise: null, paused: false, exposure: 0, tone_map: null, false_colour: false,
      map: "automatic", range: null, hidden: { shapes: [], others: false }, section: null, time: null, variant: null, settings: [],
    };
  }

  private async show(name: Channel): Promise<void> {
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
    const spp = this.data.progress.spp;
    this.listener.onFrame({ width, height, fullWidth: width, fullHeight: height, spp, sequence: 0, isFull: true, isDone: true, isDenoised: false, low: 0, high: 0, pixels });
  }

  private pick(x: number, y: number, request: number): void {
    if (!this.picks || !this.shown) return;
    const at = 8 * (y * this.shown.width + x);
    const shape = this.data.picks.shapes[this.picks.getUint32(at, true) - 1];
    const hits: ListedHit[] = shape ? [{ ...shape, distance: this.picks.getFloat32(at + 4, true), surface: null }] : [];
    this.listener.onMessage({ type: "picked", request, x, y, ray: { origin: null, direction: null, hits } });
  }

  /** No viewer gives an address. */
  ticket(): Promise<string> {
    return Promise.reject(new Error("at rest"));
  }

  send(message: PageMessage): void {
    if (message.type === "set" && message.channel) void this.show(message.channel);
    if (message.type === "pick") this.pick(Math.floor(message.x), Math.floor(message.y), message.request);
    if (message.type === "values") this.read(message);
  }

  private read({ x, y, width, height, request }: Extract<PageMessage, { type: "values" }>): void {
    if (!this.shown) return;
    const whole = this.shown.width;
    const [columns, rows] = [Math.min(width, whole - x), Math.min(height, this.shown.height - y)];
    const values: [PixelValue, PixelValue, PixelValue][] = [];
    for (let row = y; row < y + rows; row++) {
      for (let column = x; column < x + columns; column++) {
        const pixel = row * whole + column;
        const value = (c: number): PixelValue =>
          this.values ? half(this.values.getUint16(2 * (3 * pixel + c), true)) : +((this.shown?.data[4 * pixel + c] ?? 0) / 255).toFixed(3);
        values.push([value(0), value(1), value(2)]);
      }
    }
    this.listener.onMessage({ type: "values", request, x, y, width: columns, height: rows, values });
  }
}

/** Controls that change something. */
const CHANGES = [
  "pause", "reset", "exposure", "tone-map", "false-colour", "map", "range-low", "range-high", "range-found", "denoise", "spp", "noise-target",
  "scale", "edit-details", "camera-details", "tree-details", "light-details", "section-details", "open-more",
];
/** Other controls that need a viewer. */
const ASKS = ["save-details", "help-open", "measure-details"];

/** Hides the controls that need a viewer, or for a page that only watches, those that change something. */
export function hideWhatNeedsAViewer(watches = false): void {
  for (const id of watches ? [...CHANGES, "channel"] : [...CHANGES, ...ASKS]) {
    byId(id).classList.add("gone");
    for (const label of document.querySelectorAll<HTMLElement>(`label[for="${id}"]`)) label.classList.add("gone");
  }
  if (watches) return;
  for (const option of document.querySelectorAll("option[value=ids], option[value=variance]")) option.remove();
}
