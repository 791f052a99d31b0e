// Worker around the engine's WebAssembly, for requests and answers. A trap makes the instance unusable; the page gets a message and
// starts another worker.

import { Door } from "./door.ts";

type Message = { module: WebAssembly.Module } | { json: string; binary: Uint8Array | null };

const worker = globalThis as unknown as {
  onmessage: (event: MessageEvent<Message>) => void;
  postMessage(message: unknown, transfer?: Transferable[]): void;
  door?: Door;
};

worker.onmessage = ({ data }) => {
  try {
    if ("module" in data) {
      worker.door = new Door(data.module, (json, binary) =>
        worker.postMessage({ json, binary }, binary ? [binary.buffer as ArrayBuffer] : []),
      );
    } else {
      worker.door!.request(data.json, data.binary);
    }
  } catch (error) {
    worker.postMessage({ broken: worker.door?.panic ?? String(error) });
  }
};
