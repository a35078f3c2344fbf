// Colours of displays and of light.

const toSrgb = (c: number) => (c <= 0.0031308 ? 12.92 * c : 1.055 * c ** (1 / 2.4) - 0.055);
const toLinear = (c: number) => (c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4);

/** A linear colour as `#rrggbb`. */
export const toHex = (linear: number[]): string =>
  "#" + linear.map((c) => Math.round(255 * Math.max(0, Math.min(1, toSrgb(c)))).toString(16).padStart(2, "0")).join("");

/** The linear colour of `#rrggbb`. */
export const fromHex = (hex: string): number[] => [1, 3, 5].map((at) => toLinear(parseInt(hex.slice(at, at + 2), 16) / 255));
