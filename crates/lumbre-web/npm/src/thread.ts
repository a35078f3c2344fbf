// One worker, from the page's side: questions by number, and what it says unasked.
import type { FromWorker, ToWorker } from "./protocol.js";
import { LumbreError } from "./types.js";

/** A question without its number, or a command. */
export type Message = ToWorker extends infer M ? (M extends { id: number } ? Omit<M, "id"> : never) : never;

/** A worker with the questions that it has not answered. */
export class Thread {
  #worker: Worker;
  #id = 0;
  #waiting = new Map<number, { done: (answer: never) => void; failed: (error: LumbreError) => void }>();
  /** Takes passes. */
  onPass: (data: FromWorker & { type: "pass" }) => void = () => {};
  /** Takes what goes wrong without having been asked. */
  onProblem: (error: LumbreError) => void = () => {};
  /** The worker stopped and is of no use any more. */
  onCrash: (error: LumbreError) => void = () => {};

  constructor(worker: Worker, wasm: ArrayBuffer | WebAssembly.Module) {
    this.#worker = worker;
    this.tell({ type: "load", wasm });
    worker.onmessage = ({ data }: MessageEvent<FromWorker>) => this.#take(data);
    worker.onerror = (event) => {
      event.preventDefault();
      this.#crash(event.message || "the worker cannot be started");
    };
  }

  /** Sends what has no answer. */
  tell(message: ToWorker): void {
    this.#worker.postMessage(message);
  }

  /** Sends a question, and returns its number with the answer to come. */
  ask<T>(message: Message): { id: number; answer: Promise<T> } {
    const id = ++this.#id;
    const answer = new Promise<T>((done, failed) => {
      this.#waiting.set(id, { done: done as (answer: never) => void, failed });
      this.tell({ ...message, id } as ToWorker);
    });
    return { id, answer };
  }

  /** Ends the worker. What it was asked fails, for this reason. */
  end(why: string): void {
    this.#worker.terminate();
    for (const { failed } of this.#waiting.values()) failed(new LumbreError({ kind: "crash", message: why }));
    this.#waiting.clear();
  }

  #take(data: FromWorker) {
    if (data.type === "pass") return this.onPass(data);
    const waiting = this.#waiting.get(data.id);
    this.#waiting.delete(data.id);
    if (data.type !== "problem") {
      waiting?.done((data.type === "opened" ? data : data.text) as never);
      return;
    }
    const error = new LumbreError(data.problem);
    if (waiting) waiting.failed(error);
    else this.onProblem(error);
    if (error.problem.kind === "crash") this.#crash(error.message);
  }

  #crash(why: string) {
    this.end(why);
    this.onCrash(new LumbreError({ kind: "crash", message: why }));
  }
}
