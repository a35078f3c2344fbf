// The connection to the viewer; it reconnects by itself. Page and viewer prove to each other that they know a secret,
// which is never sent: a program that takes the port after the viewer has ended learns nothing.
import { decoded, type Frame } from "./frame";
import type { Access, Errand, PageGreeting, PageMessage, ViewerGreeting, ViewerMessage } from "./messages";
import { digits, proof } from "./proof";

export interface Listener {
  onMessage(message: ViewerMessage): void;
  onFrame(frame: Frame): void;
  /** The viewer lets this page in. */
  onOpen(access: Access): void;
  /** The viewer is gone, does not know this page, or is another program. */
  onStatus(how: "gone" | "refused" | "foreign"): void;
}

/** The close code for a page that the viewer does not know. */
const UNKNOWN = 4403;
/** The name of the secret in the storage of this origin, which is this host and this port. */
const SECRET = "lumbre-session";

/** The secret that this page has: that of the session, or the token of the address, which is removed from the history. */
function secret(): string | null {
  const token = /^#([0-9a-f]{64})$/.exec(location.hash)?.[1];
  if (token) {
    history.replaceState(null, "", location.pathname);
    sessionStorage.setItem(SECRET, token);
  }
  return sessionStorage.getItem(SECRET);
}

export class Connection {
  private socket: WebSocket | undefined;
  private wait = 500;
  private again = 0;
  private isIn = false;
  private requests = 0;
  private readonly waiting = new Map<number, (address: string | null) => void>();

  constructor(private readonly listener: Listener) {
    // The parts of the page are made first.
    setTimeout(() => this.connect());
    // The address was opened again in this tab, by another token.
    addEventListener("hashchange", () => {
      if (!secret()) return;
      clearTimeout(this.again);
      const before = this.socket;
      this.connect();
      before?.close();
    });
  }

  send(message: PageMessage): void {
    if (this.isIn && this.socket?.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify(message));
  }

  /** An address for an errand, which works once. */
  ticket(errand: Errand): Promise<string> {
    if (!this.isIn) return Promise.reject(new Error("not connected"));
    const request = ++this.requests;
    return new Promise((found, failed) => {
      this.waiting.set(request, (address) => (address === null ? failed(new Error("no address")) : found(address)));
      this.send({ type: "ticket", request, errand });
    });
  }

  private connect(): void {
    this.isIn = false;
    const known = secret();
    if (!known) {
      this.listener.onStatus("refused");
      return;
    }
    const socket = new WebSocket(`ws://${location.host}/socket`);
    socket.binaryType = "arraybuffer";
    this.socket = socket;
    const nonce = digits(crypto.getRandomValues(new Uint8Array(32)));
    let challenge = "";
    const greet = (message: ViewerGreeting): boolean => {
      if (message.type === "challenge" && !challenge && /^[0-9a-f]{64}$/.test(message.nonce)) {
        challenge = message.nonce;
        const hello: PageGreeting = { type: "hello", nonce, proof: proof(known, "page", challenge, nonce) };
        socket.send(JSON.stringify(hello));
        return true;
      }
      if (message.type !== "welcome" || !challenge || message.proof !== proof(known, "viewer", challenge, nonce)) return false;
      if (message.session) sessionStorage.setItem(SECRET, message.session);
      [this.isIn, this.wait] = [true, 500];
      this.listener.onOpen(message.access);
      return true;
    };
    const lost = (how: "gone" | "refused" | "foreign"): void => {
      if (this.socket !== socket) return;
      [this.socket, this.isIn] = [undefined, false];
      this.waiting.clear();
      this.listener.onStatus(how);
      this.again = setTimeout(() => this.connect(), this.wait);
      this.wait = Math.min(this.wait * 1.5, 5000);
    };
    socket.onclose = ({ code }) => lost(code === UNKNOWN ? "refused" : "gone");
    socket.onmessage = (event: MessageEvent<string | ArrayBuffer>) => {
      if (this.socket !== socket) return;
      if (!this.isIn) {
        let isViewer = false;
        try {
          isViewer = typeof event.data === "string" && greet(JSON.parse(event.data) as ViewerGreeting);
        } catch {
          // Another program, which sends something else.
        }
        if (isViewer) return;
        // Another program need not answer the close: the page reports it at once.
        lost("foreign");
        socket.close();
        return;
      }
      if (typeof event.data === "string") {
        const message = JSON.parse(event.data) as ViewerMessage;
        if (message.type === "ticket") {
          this.waiting.get(message.request)?.(message.address);
          this.waiting.delete(message.request);
        } else {
          this.listener.onMessage(message);
        }
        return;
      }
      this.listener.onFrame(decoded(event.data));
      // The viewer sends the next frame after this; it skips those in between.
      this.send({ type: "shown" });
    };
  }
}
