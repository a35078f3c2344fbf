// A picture as the viewer sends it: see `frame.rs`. All other messages are in messages.ts.

/** A picture with its size, that of the whole one, and what it shows. */
export interface Frame {
  width: number; height: number; fullWidth: number; fullHeight: number;
  spp: number; sequence: number; isFull: boolean; isDone: boolean; isDenoised: boolean;
  /** The numbers at both ends of the colours of its scale; 0 where there is none. */
  low: number; high: number; pixels: ImageData;
}

const HEADER = 40;
const MAGIC = 0x324d554c;

/** The frame of a packet. */
export function decoded(packet: ArrayBuffer): Frame {
  const numbers = new Uint32Array(packet, 0, HEADER / 4);
  const [magic = 0, width = 0, height = 0, fullWidth = 0, fullHeight = 0, spp = 0, sequence = 0, flags = 0] = numbers;
  if (magic !== MAGIC || packet.byteLength !== HEADER + 4 * width * height) throw new Error("no frame");
  const pixels = new ImageData(new Uint8ClampedArray(packet, HEADER), width, height);
  const [low = 0, high = 0] = new Float32Array(packet, 32, 2);
  const [isFull, isDone, isDenoised] = [1, 2, 4].map((bit) => (flags & bit) !== 0) as [boolean, boolean, boolean];
  return { width, height, fullWidth, fullHeight, spp, sequence, isFull, isDone, isDenoised, low, high, pixels };
}
