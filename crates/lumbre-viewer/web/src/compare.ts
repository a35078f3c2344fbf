// A picture to compare with: one that was shown before, or a file.
import type { App } from "./app";
import { byId, on } from "./elements";

export function connectComparing({ sheet, alert }: App): void {
  const compare = (is: boolean): void => {
    byId<HTMLInputElement>("split").disabled = !is;
    byId<HTMLButtonElement>("forget").disabled = !is;
    sheet.reference.hidden = !is;
    if (is) sheet.split(Number(byId<HTMLInputElement>("split").value));
  };
  on("keep", "click", () => {
    sheet.keep();
    compare(true);
  });
  on("forget", "click", () => compare(false));
  on("split", "input", ({ value }) => sheet.split(Number(value)));
  on("reference-file", "change", async ({ files }) => {
    const file = files?.[0];
    if (!file) return;
    try {
      sheet.keep(await createImageBitmap(file));
      compare(true);
    } catch {
      alert("This is no picture that a browser can show.", file.name);
    }
  });
}
