// Interface to the engine's WebAssembly (studio/src/door.rs): two exports, two imports, and memory. Calls may grow the memory,
// which detaches its buffer, so views are created again after each call.

export type AnswerCallback = (json: string, binary: Uint8Array | null) => void;

type Exports = {
  memory: WebAssembly.Memory;
  reserve(json_len: number, binary_len: number): number;
  request(): void;
};

export class Door {
  /** Message of a panic, if any. A trap follows a panic. */
  panic: string | undefined;
  readonly exports: Exports;

  constructor(module: WebAssembly.Module, answered: AnswerCallback) {
    const text = new TextDecoder();
    const page = {
      answer: (json: number, json_len: number, binary: number, binary_len: number) =>
        answered(text.decode(this.#view(json, json_len)), binary_len > 0 ? this.#view(binary, binary_len).slice() : null),
      panicked: (words: number, length: number) => {
        this.panic = text.decode(this.#view(words, length));
      },
    };
    this.exports = new WebAssembly.Instance(module, { page }).exports as unknown as Exports;
  }

  request(json: string, binary: Uint8Array | null) {
    const bytes = new TextEncoder().encode(json);
    const at = this.exports.reserve(bytes.length, binary?.length ?? 0) >>> 0;
    this.#view(at, bytes.length).set(bytes);
    if (binary) this.#view(at + bytes.length, binary.length).set(binary);
    this.exports.request();
  }

  #view(at: number, length: number): Uint8Array<ArrayBuffer> {
    return new Uint8Array(this.exports.memory.buffer as ArrayBuffer, at >>> 0, length);
  }
}
