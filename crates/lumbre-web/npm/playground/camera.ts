// The camera of a scene as its LookAt, which turning it rewrites: so the text, its link and its explanations show what is seen.

type Vector = [number, number, number];

/** Where the camera stands, what it looks at, and what is upwards. */
interface View {
  eye: Vector;
  target: Vector;
  up: Vector;
  /** Where the nine numbers stand in the text. */
  from: number;
  to: number;
}

const NUMBER = "[-+]?(?:\\d+\\.?\\d*|\\.\\d+)(?:[eE][-+]?\\d+)?";
const LOOK_AT = new RegExp(`^([^#"\\n]*?\\bLookAt\\s+)((?:${NUMBER}\\s+){8}${NUMBER})(?=\\s|$)`, "m");

function find(text: string): View | undefined {
  const found = LOOK_AT.exec(text);
  if (!found) return undefined;
  const numbers = found[2]!.split(/\s+/).map(Number);
  const from = found.index + found[1]!.length;
  const vector = (i: number) => numbers.slice(3 * i, 3 * i + 3) as Vector;
  return { eye: vector(0), target: vector(1), up: vector(2), from, to: from + found[2]!.length };
}

export const hasCamera = (text: string): boolean => find(text) !== undefined;

const sum = (a: Vector, b: Vector, factor = 1): Vector => [a[0] + factor * b[0], a[1] + factor * b[1], a[2] + factor * b[2]];
const times = (a: Vector, factor: number): Vector => [a[0] * factor, a[1] * factor, a[2] * factor];
const dot = (a: Vector, b: Vector): number => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a: Vector, b: Vector): Vector => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const unit = (a: Vector): Vector => times(a, 1 / Math.hypot(...a));

/** By Rodrigues' formula. */
function turned(v: Vector, axis: Vector, angle: number): Vector {
  const [c, s] = [Math.cos(angle), Math.sin(angle)];
  return sum(sum(times(v, c), cross(axis, v), s), axis, dot(axis, v) * (1 - c));
}

/** Up and down ends this near to the poles, in radians. */
const POLE = 0.05;

/**
 * The text with its camera turned around what it looks at: by `around` about the vertical and by `over` upwards, in radians, and moved to
 * `distance` times its distance. `undefined` where there is no camera to turn.
 */
export function moved(text: string, around: number, over: number, distance: number): string | undefined {
  const view = find(text);
  if (!view) return undefined;
  const arm = sum(view.eye, view.target, -1);
  const size = Math.hypot(...arm);
  const up = unit(view.up);
  if (!(size > 0) || !up.every(Number.isFinite)) return undefined;
  let out = turned(times(arm, 1 / size), up, around);
  const height = Math.acos(Math.max(-1, Math.min(1, dot(out, up))));
  const side = cross(up, out);
  if (Math.hypot(...side) > 1e-9) {
    const wanted = Math.max(POLE, Math.min(Math.PI - POLE, height - over));
    out = turned(out, unit(side), wanted - height);
  }
  const eye = sum(view.target, out, size * distance);
  const written = (v: Vector) => v.map((x) => String(Number(x.toPrecision(7)))).join(" ");
  const numbers = `${written(eye)}  ${written(view.target)}  ${written(view.up)}`;
  return text.slice(0, view.from) + numbers + text.slice(view.to);
}
