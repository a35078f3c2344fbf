// The numbers of pixels: of the one below the pointer, and of all that are large enough to read.
import { byId, short } from "./elements";
import type { ViewerMessage } from "./messages";
import type { Page } from "./page";

/** Milliseconds between two questions for the pixel below the pointer. */
const PIXEL_EVERY = 40;
/** Milliseconds without a change of the view before numbers are requested. */
const NUMBERS_AFTER = 60;

export class PixelReader {
  private hovered: [number, number] | null = null;
  private lastAsked = 0;
  private timer = 0;

  constructor(private readonly page: Page) {
    page.sheet.changed = () => this.askNumbers();
  }

  /** The pointer is at this place of the picture, or outside. */
  hover(at: [number, number] | null): void {
    this.hovered = at;
    if (at) this.askPixel();
    else byId("pixel").textContent = "";
  }

  /** There is a new picture. */
  refresh(): void {
    this.askNumbers();
    if (this.hovered) this.askPixel();
  }

  show({ x, y, width, height, values }: Extract<ViewerMessage, { type: "values" }>): void {
    if (width !== 1 || height !== 1) {
      this.page.sheet.writeNumbers(x, y, width, values);
      return;
    }
    const [value] = values;
    if (value) byId("pixel").textContent = `${x}, ${y}: ${value.map((v) => (typeof v === "number" ? short(v) : v)).join("  ")}`;
  }

  private askPixel(): void {
    const now = performance.now();
    if (!this.hovered || now - this.lastAsked < PIXEL_EVERY) return;
    this.lastAsked = now;
    const [x, y] = this.hovered;
    this.page.ask({ type: "values", x: Math.floor(x), y: Math.floor(y), width: 1, height: 1 });
  }

  private askNumbers(): void {
    const rectangle = this.page.sheet.readable();
    if (!rectangle) return;
    clearTimeout(this.timer);
    const [x, y, width, height] = rectangle;
    this.timer = setTimeout(() => this.page.ask({ type: "values", x, y, width, height }), NUMBERS_AFTER);
  }
}
