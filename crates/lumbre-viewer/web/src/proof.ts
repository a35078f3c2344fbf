// Proofs to know a secret without saying it: the keyed hash of one block by BLAKE3 (O'Connor, Aumasson, Neves and Wilcox-O'Hearn, "BLAKE3:
// one function, fast everywhere", 2020). Browsers have hashes of their own only for pages that come encrypted or from this machine.

const IV = [0x6a09e667, 0xbb67ae85, 0x3c6ef372, 0xa54ff53a, 0x510e527f, 0x9b05688c, 0x1f83d9ab, 0x5be0cd19];
const ORDER = [2, 6, 3, 10, 7, 0, 4, 13, 1, 11, 12, 5, 9, 14, 15, 8];
/** The four words that a quarter of a round mixes. */
const QUARTERS = [
  [0, 4, 8, 12], [1, 5, 9, 13], [2, 6, 10, 14], [3, 7, 11, 15],
  [0, 5, 10, 15], [1, 6, 11, 12], [2, 7, 8, 13], [3, 4, 9, 14],
] as const;
/** The first chunk, its last block, of a tree that it is the root of, with a key. */
const FLAGS = 1 | 2 | 8 | 16;
const BLOCK = 64;

/** The hash of up to 64 bytes by a key of 32. */
export function keyedHash(key: Uint8Array, bytes: Uint8Array): Uint8Array {
  if (key.length !== 32 || bytes.length > BLOCK) throw new Error("one block and a key of 32 bytes");
  const words = (of: Uint8Array, count: number): number[] => {
    const view = new DataView(Uint8Array.from({ length: 4 * count }, (_, i) => of[i] ?? 0).buffer);
    return Array.from({ length: count }, (_, i) => view.getUint32(4 * i, true));
  };
  const v = Uint32Array.from([...words(key, 8), ...IV.slice(0, 4), 0, 0, bytes.length, FLAGS]);
  const at = (i: number): number => v[i] ?? 0;
  const turned = (x: number, by: number): number => (x >>> by) | (x << (32 - by));
  let block = words(bytes, 16);
  for (let round = 0; round < 7; round++) {
    QUARTERS.forEach(([a, b, c, d], quarter) => {
      for (const [which, first, second] of [[0, 16, 12], [1, 8, 7]] as const) {
        v[a] = at(a) + at(b) + (block[2 * quarter + which] ?? 0);
        v[d] = turned(at(d) ^ at(a), first);
        v[c] = at(c) + at(d);
        v[b] = turned(at(b) ^ at(c), second);
      }
    });
    block = ORDER.map((from) => block[from] ?? 0);
  }
  const out = new DataView(new ArrayBuffer(32));
  for (let i = 0; i < 8; i++) out.setUint32(4 * i, at(i) ^ at(i + 8), true);
  return new Uint8Array(out.buffer);
}

/** Bytes as hexadecimal digits. */
export const digits = (bytes: Uint8Array): string => Array.from(bytes, (byte) => byte.toString(16).padStart(2, "0")).join("");

/** The bytes of hexadecimal digits. */
export const bytesOf = (text: string): Uint8Array => Uint8Array.from(text.match(/../g) ?? [], (pair) => parseInt(pair, 16));

/** That this side knows the secret, for these random numbers of the viewer and of the page. */
export function proof(secret: string, side: "page" | "viewer", viewers: string, pages: string): string {
  const bytes = [...new TextEncoder().encode(side), ...bytesOf(viewers).slice(0, 24), ...bytesOf(pages).slice(0, 24)];
  return digits(keyedHash(bytesOf(secret), Uint8Array.from(bytes)));
}
