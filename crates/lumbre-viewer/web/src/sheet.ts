// The picture on the page: frames of any resolution, zoom into the pixels, and a reference beside it.
import type { Frame } from "./frame";
import type { PixelValue } from "./messages";

const MAX_ZOOM = 256;
/** From here on the numbers of pixels are written on them, in screen pixels a pixel. */
export const NUMBERS_FROM = 32;

function context(canvas: HTMLCanvasElement): CanvasRenderingContext2D {
  const found = canvas.getContext("2d", { willReadFrequently: false });
  if (!found) throw new Error("this browser has no canvas");
  return found;
}

export class Sheet {
  width = 16;
  height = 9;
  /** Screen pixels a pixel; 0 fits the picture. */
  private zoom = 0;
  private left = 0;
  private top = 0;
  /** Where the reference begins, in percent of the width. */
  private part = 50;
  private readonly small = document.createElement("canvas");
  changed: () => void = () => {};

  constructor(
    private readonly stage: HTMLElement, private readonly sheet: HTMLElement, readonly picture: HTMLCanvasElement,
    readonly reference: HTMLCanvasElement, private readonly numbers: HTMLCanvasElement, private readonly marks: SVGElement,
  ) {
    new ResizeObserver(() => this.place()).observe(stage);
  }

  show(frame: Frame): void {
    const { fullWidth, fullHeight } = frame;
    if (frame.isFull && (this.width !== frame.width || this.height !== frame.height)) this.size(frame.width, frame.height);
    if (!frame.isFull && Math.abs(this.width / this.height - frame.width / frame.height) > 0.05) this.size(fullWidth, fullHeight);
    const drawing = context(this.picture);
    if (frame.width === this.width && frame.height === this.height) {
      drawing.putImageData(frame.pixels, 0, 0);
    } else {
      if (this.small.width !== frame.width || this.small.height !== frame.height) {
        [this.small.width, this.small.height] = [frame.width, frame.height];
      }
      context(this.small).putImageData(frame.pixels, 0, 0);
      drawing.imageSmoothingQuality = "low";
      drawing.clearRect(0, 0, this.width, this.height);
      drawing.drawImage(this.small, 0, 0, this.width, this.height);
    }
  }

  private size(width: number, height: number): void {
    [this.width, this.height] = [width, height];
    [this.picture.width, this.picture.height] = [width, height];
    this.place();
  }

  private fit(): number {
    return Math.min(this.stage.clientWidth / this.width, this.stage.clientHeight / this.height);
  }

  /** Screen pixels a pixel. */
  scale(): number {
    return this.zoom || this.fit();
  }

  private place(): void {
    const scale = this.scale();
    const [width, height] = [this.width * scale, this.height * scale];
    const within = (at: number, size: number, room: number) =>
      size <= room ? (room - size) / 2 : Math.min(0, Math.max(room - size, at));
    this.left = within(this.left, width, this.stage.clientWidth);
    this.top = within(this.top, height, this.stage.clientHeight);
    const style = this.sheet.style;
    [style.left, style.top, style.width, style.height] = [`${this.left}px`, `${this.top}px`, `${width}px`, `${height}px`];
    this.sheet.classList.toggle("pixels", scale > 2);
    this.clearNumbers();
    this.changed();
  }

  /** Zooms about a place of the screen. */
  zoomBy(factor: number, x = this.stage.clientWidth / 2, y = this.stage.clientHeight / 2): void {
    const before = this.scale();
    const after = Math.min(MAX_ZOOM, before * factor);
    this.zoom = after <= this.fit() ? 0 : after;
    const ratio = this.scale() / before;
    this.left = x - (x - this.left) * ratio;
    this.top = y - (y - this.top) * ratio;
    this.place();
  }

  zoomOut(): void {
    this.zoom = 0;
    this.place();
  }

  slide(x: number, y: number): void {
    this.left += x;
    this.top += y;
    this.place();
  }

  isZoomed(): boolean {
    return this.zoom > 0;
  }

  /** The place in the picture, in pixels, of one on the screen; null outside. */
  at(clientX: number, clientY: number): [number, number] | null {
    const box = this.stage.getBoundingClientRect();
    const [x, y] = [(clientX - box.left - this.left) / this.scale(), (clientY - box.top - this.top) / this.scale()];
    return x >= 0 && y >= 0 && x < this.width && y < this.height ? [x, y] : null;
  }

  /** The pixels whose numbers can be read: x, y, width, height. */
  readable(): [number, number, number, number] | null {
    const scale = this.scale();
    if (scale < NUMBERS_FROM) return null;
    const x = Math.max(0, Math.floor(-this.left / scale));
    const y = Math.max(0, Math.floor(-this.top / scale));
    const width = Math.min(64, this.width - x, Math.ceil(this.stage.clientWidth / scale) + 1);
    const height = Math.min(64, this.height - y, Math.ceil(this.stage.clientHeight / scale) + 1);
    return [x, y, width, height];
  }

  private clearNumbers(): void {
    if (this.numbers.width > 1) [this.numbers.width, this.numbers.height] = [1, 1];
  }

  writeNumbers(x0: number, y0: number, width: number, values: [PixelValue, PixelValue, PixelValue][]): void {
    const scale = this.scale();
    if (scale < NUMBERS_FROM) return;
    // Drawn for the screen, in a canvas that covers only what is seen.
    const canvas = this.numbers;
    const rows = Math.ceil(values.length / Math.max(1, width));
    [canvas.width, canvas.height] = [Math.round(width * scale), Math.round(rows * scale)];
    const style = canvas.style;
    [style.left, style.top] = [`${x0 * scale}px`, `${y0 * scale}px`];
    [style.width, style.height] = [`${canvas.width}px`, `${canvas.height}px`];
    const drawing = context(canvas);
    drawing.font = `${Math.max(8, Math.min(13, scale / 5))}px ui-monospace, monospace`;
    drawing.textAlign = "center";
    drawing.textBaseline = "middle";
    const colours = ["#ff9a9a", "#9dffa6", "#a9c8ff"];
    values.forEach((value, i) => {
      const [x, y] = [((i % width) + 0.5) * scale, (Math.floor(i / width) + 0.5) * scale];
      value.forEach((number, channel) => {
        const text = typeof number === "number" ? +number.toPrecision(3) + "" : number;
        const at = y + (channel - 1) * scale * 0.25;
        drawing.lineWidth = 3;
        drawing.strokeStyle = "#000";
        drawing.strokeText(text, x, at, scale - 2);
        drawing.fillStyle = colours[channel] ?? "#fff";
        drawing.fillText(text, x, at, scale - 2);
      });
    });
  }

  /** Marks places of the picture, and the line between two of them; none takes the marks away. */
  mark(places: [number, number][]): void {
    const svg = (name: string, attributes: Record<string, number>) => {
      const made = document.createElementNS("http://www.w3.org/2000/svg", name);
      for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, String(value));
      return made;
    };
    this.marks.setAttribute("viewBox", `0 0 ${this.width} ${this.height}`);
    const radius = 5 / this.scale();
    const dots = places.map(([cx, cy]) => svg("circle", { cx, cy, r: radius }));
    const [a, b] = places;
    const line = a && b ? [svg("line", { x1: a[0], y1: a[1], x2: b[0], y2: b[1] })] : [];
    this.marks.replaceChildren(...line, ...dots);
  }

  /** What is shown, the reference too where it covers the picture, as a PNG. */
  async snapshot(): Promise<Blob | null> {
    const canvas = document.createElement("canvas");
    [canvas.width, canvas.height] = [this.width, this.height];
    const drawing = context(canvas);
    drawing.drawImage(this.picture, 0, 0);
    if (!this.reference.hidden) {
      const from = Math.round((this.width * this.part) / 100);
      const wide = this.width - from;
      if (wide > 0) drawing.drawImage(this.reference, from, 0, wide, this.height, from, 0, wide, this.height);
    }
    return new Promise((found) => canvas.toBlob(found, "image/png"));
  }

  /** Keeps a picture to compare with; without one, what is shown. */
  keep(source: CanvasImageSource = this.picture): void {
    [this.reference.width, this.reference.height] = [this.width, this.height];
    context(this.reference).drawImage(source, 0, 0, this.width, this.height);
    this.reference.hidden = false;
  }

  split(percent: number): void {
    this.part = percent;
    this.reference.style.clipPath = `inset(0 0 0 ${percent}%)`;
  }
}
