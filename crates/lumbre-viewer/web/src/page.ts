// The state of the page: the last scene and state of the viewer, the camera, and the way to send messages.
import { Camera } from "./camera";
import type { Connection } from "./connection";
import { byId } from "./elements";
import type { Frame } from "./frame";
import type { Errand, PageMessage, SceneFacts, SetOptions, ViewerState } from "./messages";
import { Sheet } from "./sheet";
import type { StaticConnection } from "./static-connection";

/** Messages whose answer has their number. */
type Asking<M> = M extends { type: "pick" | "values"; request: number } ? Omit<M, "request"> : never;
export type Question = Asking<PageMessage>;

/** Frames whose times are kept. */
const MAX_TIMES = 2000;

/** What the page measures of itself: milliseconds from a change to the first picture of it, and when frames came. */
export const measured = {
  latencies: [] as number[], frames: [] as number[], changes: new Map<number, number>(), spp: 0, done: false, sequence: 0,
  /** When the first frame came, and the first without noise, by the clock of the page. */
  first: 0, firstDenoised: 0,
  /** Frames with noise, since this was last set to 0. */
  noisy: 0,
};
Object.assign(globalThis, { lumbreMeasured: measured });

export class Page {
  readonly sheet = new Sheet(
    byId("stage"), byId("sheet"), byId<HTMLCanvasElement>("picture"), byId<HTMLCanvasElement>("reference"),
    byId<HTMLCanvasElement>("numbers"), document.querySelector("#marks") as SVGElement,
  );
  readonly camera = new Camera();
  scene: SceneFacts | undefined;
  state: ViewerState | undefined;
  connection: Connection | StaticConnection | undefined;
  connected = false;
  /** Whether it only watches. */
  watches = false;
  /** Called when the camera was moved by hand. */
  onCamera: () => void = () => {};
  private requests = 0;
  private isMoving = false;
  // Changes of the camera are counted, so that a frame can say which it shows. Each page starts at its own number.
  private sequence = Math.floor(Math.random() * 0x7fff_0000);
  private mine = -1;

  send(message: PageMessage): void {
    this.connection?.send(message);
  }

  /** An address for an errand, which works once. */
  ticket(errand: Errand): Promise<string> {
    return this.connection?.ticket(errand) ?? Promise.reject(new Error("not connected"));
  }

  /** Sends a question, and returns the number by which its answer is known. */
  ask(question: Question): number {
    this.requests += 1;
    this.send({ ...question, request: this.requests });
    return this.requests;
  }

  set(options: SetOptions): void {
    this.send({ type: "set", ...options });
  }

  /** The camera was moved: it is sent once a frame of the screen. */
  moved(): void {
    if (this.watches) {
      // The camera is another's.
      if (this.state && this.scene) this.camera.take(this.state, this.scene);
      return;
    }
    this.onCamera();
    if (this.isMoving) return;
    this.isMoving = true;
    requestAnimationFrame(() => {
      this.isMoving = false;
      this.sequence = (this.sequence + 1) >>> 0;
      this.mine = this.sequence;
      measured.changes.set(this.sequence, performance.now());
      const { placement, fov, zoom } = this.camera;
      this.send({ type: "camera", sequence: this.sequence, placement, fov, zoom });
    });
  }

  /** One of the file's cameras, as it is. */
  reset(index: number): void {
    this.sequence = (this.sequence + 1) >>> 0;
    this.mine = -1;
    this.onCamera();
    this.send({ type: "reset", sequence: this.sequence, camera: index });
  }

  /** Takes the camera of the state, unless it was moved here: what comes back is older than what the hand does. */
  takeCamera(state: ViewerState, scene: SceneFacts): void {
    const isOwn = state.moved && state.sequence === this.mine;
    if (!isOwn && !this.isMoving) this.camera.take(state, scene);
  }

  show(frame: Frame): void {
    this.sheet.show(frame);
    const now = performance.now();
    measured.frames.push(now);
    if (measured.frames.length > MAX_TIMES) measured.frames.splice(0, MAX_TIMES / 2);
    measured.first ||= now;
    if (frame.isDenoised) measured.firstDenoised ||= now;
    else measured.noisy += 1;
    [measured.spp, measured.done, measured.sequence] = [frame.isFull ? frame.spp : 0, frame.isDone, frame.sequence];
    for (const [change, since] of measured.changes) {
      if (change > frame.sequence) continue;
      // Earlier changes that no frame was made of are shown by this one.
      if (change === frame.sequence) measured.latencies.push(now - since);
      measured.changes.delete(change);
    }
  }
}
