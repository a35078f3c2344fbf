// A scene in the fragment of an address, which browsers send to no server: #VERSION.EXAMPLE.TEXT, the text packed.

/** A scene, and the example whose files it uses. */
export interface Shared {
  text: string;
  example: string;
}

const VERSION = "1";
/** Text that a link may unpack to. */
const LONGEST = 4 << 20;

async function through(bytes: Uint8Array<ArrayBuffer>, stream: CompressionStream | DecompressionStream, most: number): Promise<Uint8Array<ArrayBuffer>> {
  const reader = new Blob([bytes]).stream().pipeThrough(stream).getReader();
  const pieces: Uint8Array[] = [];
  let size = 0;
  for (;;) {
    const { done, value } = await reader.read();
    if (done) break;
    pieces.push(value);
    size += value.length;
    if (size > most) throw new Error("too long");
  }
  const whole = new Uint8Array(size);
  let at = 0;
  for (const piece of pieces) {
    whole.set(piece, at);
    at += piece.length;
  }
  return whole;
}

export const unpacked = (bytes: Uint8Array<ArrayBuffer>, format: CompressionFormat, most: number) => through(bytes, new DecompressionStream(format), most);

export function fromBase64(text: string): Uint8Array<ArrayBuffer> {
  const binary = atob(text.replace(/-/g, "+").replace(/_/g, "/"));
  return Uint8Array.from(binary, (c) => c.charCodeAt(0));
}

function toBase64(bytes: Uint8Array): string {
  let binary = "";
  for (let i = 0; i < bytes.length; i += 0x8000) binary += String.fromCharCode(...bytes.subarray(i, i + 0x8000));
  return btoa(binary).replace(/\+/g, "-").replace(/\//g, "_").replace(/=+$/, "");
}

export async function fragment({ text, example }: Shared): Promise<string> {
  const bytes = new TextEncoder().encode(text);
  const packed = await through(bytes, new CompressionStream("deflate-raw"), Infinity);
  return `#${VERSION}.${encodeURIComponent(example)}.${toBase64(packed)}`;
}

/** The scene of a fragment; `undefined` where it is none of these. */
export async function fromFragment(hash: string): Promise<Shared | undefined> {
  const [version, example, packed] = hash.replace(/^#/, "").split(".");
  if (version !== VERSION || example === undefined || packed === undefined) return undefined;
  const bytes = await unpacked(fromBase64(packed), "deflate-raw", LONGEST);
  return { text: new TextDecoder("utf-8", { fatal: true }).decode(bytes), example: decodeURIComponent(example) };
}
