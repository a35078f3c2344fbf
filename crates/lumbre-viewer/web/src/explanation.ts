// The explanation of a pixel's colour: a page of the viewer in a frame without an origin, which runs its own script alone.
import { byId, element, options } from "./elements";
import type { Errand } from "./messages";

export class Explanation {
  private readonly dialog = byId<HTMLDialogElement>("explanation");
  private readonly button = byId<HTMLButtonElement>("explain");
  private readonly alone = byId<HTMLAnchorElement>("explanation-alone");
  private readonly language = byId<HTMLSelectElement>("language");
  private languages: [string, string][] = [];
  private pixel: [number, number] | undefined;

  constructor(private readonly ticket: (errand: Errand) => Promise<string>) {
    this.button.addEventListener("click", () => this.show());
    this.language.addEventListener("change", () => void this.load());
    // Its address works once: the next one is fetched when it was used.
    this.alone.addEventListener("click", () => setTimeout(() => void this.offerAlone()));
    byId("explanation-close").addEventListener("click", () => this.dialog.close());
    this.dialog.addEventListener("close", () => byId("explanation-text").replaceChildren());
  }

  /** The languages in which there are explanations. */
  offer(languages: [string, string][]): void {
    this.languages = languages;
    const codes = languages.map(([code]) => code);
    const spoken = navigator.languages.map((name) => name.slice(0, 2)).find((code) => codes.includes(code));
    const chosen = codes.includes(this.language.value) ? this.language.value : spoken ?? codes[0] ?? "";
    options(this.language, languages, chosen);
    this.draw();
  }

  /** Chooses the pixel to explain. */
  of(x: number, y: number): void {
    this.pixel = [x, y];
    this.draw();
  }

  /** Shows the explanation of the chosen pixel. */
  show(): void {
    if (this.button.hidden) return;
    void this.load();
    this.dialog.showModal();
  }

  private draw(): void {
    this.button.hidden = !this.pixel || this.languages.length === 0;
    this.button.textContent = `Explain pixel ${this.pixel?.join(", ") ?? ""}`;
  }

  private get errand(): Errand | undefined {
    return this.pixel && { for: "explanation", language: this.language.value, pixel: this.pixel };
  }

  private async offerAlone(): Promise<void> {
    this.alone.removeAttribute("href");
    if (this.errand) this.alone.href = await this.ticket(this.errand);
  }

  private async load(): Promise<void> {
    if (!this.errand) return;
    const title = this.button.textContent ?? "";
    try {
      const address = await this.ticket(this.errand);
      // A new frame: one that goes to another address would be a step in the history of the page.
      const frame = element("iframe", "", { title });
      frame.setAttribute("sandbox", "allow-scripts");
      frame.src = address;
      byId("explanation-text").replaceChildren(frame);
      await this.offerAlone();
    } catch {
      byId("explanation-text").replaceChildren(element("p", "The viewer does not answer."));
    }
  }
}
