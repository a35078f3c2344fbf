// Elements of the page. Names of scenes are set as text, never as markup.

export function byId<T extends HTMLElement>(id: string): T {
  const found = document.getElementById(id);
  if (!found) throw new Error(`the page has no ${id}`);
  return found as T;
}

export function element<K extends keyof HTMLElementTagNameMap>(
  name: K, text = "", properties: Partial<HTMLElementTagNameMap[K]> = {},
): HTMLElementTagNameMap[K] {
  const made = Object.assign(document.createElement(name), properties);
  if (text) made.textContent = text;
  return made;
}

/** A number with six digits. */
export function short(value: number): string {
  return Number.isFinite(value) ? String(+value.toPrecision(6)) : String(value);
}

/** A large number, with its prefix. */
export function large(value: number): string {
  const units: [number, string][] = [[1e9, " G"], [1e6, " M"], [1e3, " k"]];
  for (const [unit, name] of units) if (value >= unit) return `${(value / unit).toFixed(2)}${name}`;
  return `${Math.round(value)}`;
}

/** A duration in words. */
export function spoken(seconds: number): string {
  if (seconds < 1) return `${Math.round(seconds * 1000)} ms`;
  if (seconds < 90) return `${seconds.toFixed(seconds < 10 ? 1 : 0)} s`;
  return `${Math.floor(seconds / 60)} min ${Math.round(seconds % 60)} s`;
}

export function options(select: HTMLSelectElement, entries: [string, string][], chosen: string): void {
  const same = select.options.length === entries.length
    && entries.every(([value, text], i) => select.options[i]?.value === value && select.options[i]?.textContent === text);
  if (!same) select.replaceChildren(...entries.map(([value, text]) => element("option", text, { value })));
  select.value = chosen;
}

/** Hands bytes to the user as a file. */
export function saveBlob(name: string, blob: Blob): void {
  const url = URL.createObjectURL(blob);
  element("a", "", { href: url, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(url), 10_000);
}

/** Hands a text to the user as a file. */
export const save = (name: string, text: string): void => saveBlob(name, new Blob([text], { type: "text/plain" }));

/** Calls `act` at an event of an element. */
export function on(id: string, event: string, act: (input: HTMLInputElement) => void): void {
  const input = byId<HTMLInputElement>(id);
  input.addEventListener(event, () => act(input));
}
