// The socket, which comes back by itself.
import { decoded, type Frame, type Told } from "./protocol";

export interface Listener {
  told(message: Told): void;
  framed(frame: Frame): void;
  /** The viewer is there, gone, or does not know this browser. */
  stood(how: "open" | "gone" | "refused"): void;
}

export class Connection {
  private socket: WebSocket | undefined;
  private wait = 500;

  constructor(private readonly listener: Listener) {
    this.connect();
  }

  send(message: object): void {
    if (this.socket?.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify(message));
  }

  private connect(): void {
    const socket = new WebSocket(`ws://${location.host}/socket`);
    socket.binaryType = "arraybuffer";
    this.socket = socket;
    socket.onopen = () => {
      this.wait = 500;
      this.listener.stood("open");
    };
    socket.onmessage = (event: MessageEvent<string | ArrayBuffer>) => {
      if (typeof event.data === "string") {
        this.listener.told(JSON.parse(event.data) as Told);
        return;
      }
      this.listener.framed(decoded(event.data));
      // The next one comes when this one is shown: what comes between is never sent.
      this.send({ type: "shown" });
    };
    socket.onclose = () => void this.lost();
  }

  private async lost(): Promise<void> {
    let how: "gone" | "refused" = "gone";
    try {
      const answer = await fetch("/", { cache: "no-store" });
      if (answer.status === 403) how = "refused";
    } catch {
      // Nobody is there.
    }
    this.listener.stood(how);
    setTimeout(() => this.connect(), this.wait);
    this.wait = Math.min(this.wait * 1.5, 5000);
  }
}
