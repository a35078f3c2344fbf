// The camera as it is moved by hand.
import type { Placement, SceneFacts, ViewerState } from "./messages";
import { add, cross, dot, length, scale, sub, turned, unit, type Vector } from "./vectors";

/** How near the camera comes to straight above and below, in radians. */
const POLE = 0.02;
/** How near it comes to the ground, as a share of the distance to what it looks at. */
const MIN_HEIGHT = 0.01;

export class Camera {
  placement: Placement = { eye: [0, 0, 1], target: [0, 0, 0], up: [0, 1, 0] };
  fov: number | null = null;
  zoom = 1;
  mirrored = false;
  /** Whether it may go below the ground. */
  mayGoBelow = false;
  private ground: SceneFacts["ground"] = null;
  /** What stays upwards while the camera turns. */
  private axis: Vector = [0, 1, 0];

  /** That of a state; what stays upwards is found anew. */
  take(state: ViewerState, scene: SceneFacts): void {
    if (!state.placement) return;
    const own = scene.cameras[state.camera];
    this.placement = state.placement;
    this.mirrored = own?.mirrored ?? false;
    this.fov = state.fov ?? own?.fov ?? null;
    this.zoom = state.zoom;
    this.axis = this.upright(scene, state.name.endsWith(".pbrt"));
    this.ground = scene.ground;
    // A camera of the file that is below it stays there.
    if (this.height(this.placement.eye) < 0) this.mayGoBelow = true;
  }

  /** Stands there from now on. */
  place(placement: Placement): void {
    this.placement = placement;
    this.rise(false);
  }

  /** How far a point is above the ground; infinitely far without one. */
  private height(point: Vector): number {
    return this.ground ? dot(sub(point, this.ground.point), this.ground.normal) : Infinity;
  }

  /** Comes out of the ground, the target with the eye or alone. */
  private rise(withTarget: boolean): void {
    if (this.mayGoBelow || !this.ground) return;
    const least = MIN_HEIGHT * this.distance();
    const missing = least - this.height(this.placement.eye);
    if (missing <= 0) return;
    const step = scale(unit(this.ground.normal), missing);
    const { eye, target, up } = this.placement;
    this.placement = { eye: add(eye, step), target: withTarget ? add(target, step) : target, up };
  }

  /** What stays upwards while the camera turns. */
  get upwards(): Vector {
    return this.axis;
  }

  forward(): Vector {
    return unit(sub(this.placement.target, this.placement.eye));
  }

  right(): Vector {
    const right = unit(cross(this.placement.up, this.forward()));
    return this.mirrored ? scale(right, -1) : right;
  }

  upward(): Vector {
    const forward = this.forward();
    return unit(sub(this.placement.up, scale(forward, dot(this.placement.up, forward))));
  }

  distance(): number {
    return length(sub(this.placement.target, this.placement.eye));
  }

  /** An axis that the picture does not lean to the side of; pbrt files do not say which is up. */
  private upright(scene: SceneFacts, unsaid: boolean): Vector {
    const [right, up] = [this.right(), this.upward()];
    const axes: Vector[] = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
    const candidates = [...axes, ...axes.map((axis) => scale(axis, -1)), scene.up];
    let [best, most] = [up, 0];
    for (const axis of candidates) {
      const bonus = axis === scene.up && !unsaid ? 0.5 : 0;
      const standing = dot(axis, up) + bonus;
      if (Math.abs(dot(axis, right)) < 1e-3 && dot(axis, up) > 1e-3 && standing > most) [best, most] = [axis, standing];
    }
    return best;
  }

  /** Turns around the target by angles in radians: to the right, and up. */
  orbit(right: number, up: number): void {
    let { eye, target } = this.placement;
    let offset = sub(eye, target);
    const sideways = Math.sign(dot(cross(this.axis, offset), this.right())) || 1;
    offset = turned(offset, this.axis, right * sideways);
    const polar = Math.acos(Math.max(-1, Math.min(1, dot(unit(offset), this.axis))));
    const wanted = Math.max(POLE, Math.min(Math.PI - POLE, this.lowest(), polar - up));
    const across = cross(this.axis, offset);
    if (length(across) > 0) offset = turned(offset, unit(across), wanted - polar);
    eye = add(target, offset);
    this.placement = { eye, target, up: this.axis };
    this.rise(false);
  }

  /** The largest angle from straight above at which the camera is above the ground, as far from its target as it is. */
  private lowest(): number {
    const { ground } = this;
    if (this.mayGoBelow || !ground || dot(unit(ground.normal), this.axis) < 0.999) return Math.PI;
    const reach = this.distance();
    const drop = (MIN_HEIGHT * reach - this.height(this.placement.target)) / reach;
    return Math.acos(Math.max(-1, Math.min(1, drop)));
  }

  /** Moves eye and target: to the right, up and forward, in shares of the distance between them. */
  move(right: number, up: number, forward: number): void {
    const by = this.distance();
    const step = add(add(scale(this.right(), right * by), scale(this.upward(), up * by)), scale(this.forward(), forward * by));
    const { eye, target } = this.placement;
    this.placement = { eye: add(eye, step), target: add(target, step), up: this.axis };
    this.rise(true);
  }

  /** Comes nearer to the target by a factor, or shows more of it. */
  dolly(factor: number): void {
    const { eye, target } = this.placement;
    this.placement = { eye: add(target, scale(sub(eye, target), factor)), target, up: this.axis };
    this.rise(false);
    this.zoom = Math.max(1e-4, Math.min(1e4, this.zoom / factor));
  }

  /** Turns around this point from now on. */
  lookAt(point: Vector): void {
    const { eye } = this.placement;
    this.placement = { eye, target: point, up: this.axis };
  }

  /** As pbrt writes it. */
  toPbrt(): string {
    const { eye, target } = this.placement;
    const numbers = (v: Vector) => v.map((x) => +x.toPrecision(9)).join(" ");
    const mirror = this.mirrored ? "Scale -1 1 1\n" : "";
    const lens = this.fov === null ? "" : `\nCamera "perspective" "float fov" [${+this.fov.toPrecision(9)}]`;
    return `${mirror}LookAt ${numbers(eye)}  ${numbers(target)}  ${numbers(this.upward())}${lens}`;
  }

  /** As glTF writes it: a node, whose camera looks along -z. */
  toGltf(aspect: number): string {
    const columns: [Vector, number][] = [
      [this.right(), 0], [this.upward(), 0], [scale(this.forward(), -1), 0], [this.placement.eye, 1],
    ];
    const matrix = columns.flatMap(([v, w]) => [...v.map((x) => +x.toPrecision(9)), w]);
    const shorter = ((this.fov ?? 45) * Math.PI) / 180;
    // Theirs is that of the height, ours that of the shorter side.
    const yfov = aspect >= 1 ? shorter : 2 * Math.atan(Math.tan(shorter / 2) / aspect);
    const perspective = { aspectRatio: +aspect.toPrecision(9), yfov: +yfov.toPrecision(9), znear: 0.01 };
    return JSON.stringify({ cameras: [{ type: "perspective", perspective }], nodes: [{ camera: 0, matrix }] });
  }
}
