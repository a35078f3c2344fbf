// The socket, which comes back by itself. Page and viewer prove to each other that they know a secret, which is never sent: who takes the
// port when the viewer has ended learns nothing.
import { digits, proof } from "./proof";
import { decoded, type Frame, type Message } from "./protocol";

export interface Listener {
  onMessage(message: Message): void;
  onFrame(frame: Frame): void;
  /** The viewer lets this page in. */
  onOpen(access: Access): void;
  /** The viewer is gone, does not know this page, or is another program. */
  onStatus(how: "gone" | "refused" | "foreign"): void;
}

/** What a page asks an address for, which works once. */
export type Errand =
  | { for: "picture"; format: "png" | "exr" }
  | { for: "explanation"; language: string; pixel: [number, number] }
  | { for: "scene" };

/** What is said before a page is let in. */
type Greeting =
  | { type: "challenge"; nonce: string }
  | { type: "welcome"; proof: string; session: string | null; access: Access };

/** What this page may do: all, or look on. */
export type Access = "edit" | "watch";

/** The code with which a page is sent away. */
const UNKNOWN = 4403;
/** Its name in the storage of this origin: this host and this port. */
const SECRET = "lumbre-session";

/** The secret that this page has: that of the session, or the token of the address, which stands in no history. */
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
  private readonly waiting = new Map<number, (address: string) => void>();

  constructor(private readonly listener: Listener) {
    // The page has to be there before it is told anything.
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

  send(message: object): void {
    if (this.isIn && this.socket?.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify(message));
  }

  /** An address for an errand, which works once. */
  ticket(errand: Errand): Promise<string> {
    if (!this.isIn) return Promise.reject(new Error("not connected"));
    const request = ++this.requests;
    return new Promise((found) => {
      this.waiting.set(request, found);
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
    const greet = (message: Greeting): boolean => {
      if (message.type === "challenge" && !challenge && /^[0-9a-f]{64}$/.test(message.nonce)) {
        challenge = message.nonce;
        socket.send(JSON.stringify({ type: "hello", nonce, proof: proof(known, "page", challenge, nonce) }));
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
          isViewer = typeof event.data === "string" && greet(JSON.parse(event.data) as Greeting);
        } catch {
          // What makes no sense comes from another program.
        }
        // Which need not answer that it is closed.
        if (isViewer) return;
        lost("foreign");
        socket.close();
        return;
      }
      if (typeof event.data === "string") {
        const message = JSON.parse(event.data) as Message;
        if (message.type === "ticket") {
          this.waiting.get(message.request)?.(message.address);
          this.waiting.delete(message.request);
        } else {
          this.listener.onMessage(message);
        }
        return;
      }
      this.listener.onFrame(decoded(event.data));
      // The next one comes when this one is shown: what comes between is never sent.
      this.send({ type: "shown" });
    };
  }
}
