// The code of wasm-bindgen, as build.mjs wraps it: each call gives a module of its own.
declare module "lumbre-glue" {
  export interface Files { add(name: string, bytes: Uint8Array): void }
  export interface Scene {
    readonly width: number;
    readonly height: number;
    readonly bounds: Uint32Array;
    readonly warnings: string[];
    readonly isDivisible: boolean;
    limitRows(from: number, to: number): void;
    step(milliseconds: number): string;
    pixels(): Uint8Array;
    light(): Float32Array;
    cast(list: Uint8Array, query: string): string;
    explain(wanted: string): string;
    free(): void;
  }
  export interface Glue {
    (options: { module_or_path: WebAssembly.Module }): Promise<unknown>;
    Files: new () => Files;
    Scene: new (files: Files, name: string, wanted: string) => Scene;
    calculate(text: string, lang: string, json: boolean): string;
    lastPanic(): string;
  }
  export function glue(): Glue;
}
