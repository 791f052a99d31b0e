// Engine in this page: WebAssembly, compiled once, in a worker for each lane. An interrupt of a solve ends its worker; the next
// request starts another.

import workerSource from "engine-worker-source";
import type { RequestBody } from "../contract.ts";
import { Broken, type Done, type Engine, type Lane, type Options, type Source } from "./engine.ts";
import { type Channel, type Events, type LaneOfRequests, lanes } from "./lane.ts";

export class WasmEngine implements Engine {
  readonly place = "in this page";
  readonly hasFiles = false;
  readonly source: Source;
  #lanes: Record<Lane, LaneOfRequests>;
  #worker: string;

  constructor(private readonly module: WebAssembly.Module) {
    this.source = { module };
    this.#worker = URL.createObjectURL(new Blob([workerSource], { type: "text/javascript" }));
    this.#lanes = lanes((name, events) => this.#open(name, events));
  }

  request(lane: Lane, body: RequestBody, options: Options = {}): Promise<Done> {
    return this.#lanes[lane].request(body, options);
  }

  prepare(lane: Lane) {
    this.#lanes[lane].prepare();
  }

  cancel(lane: Lane) {
    this.#lanes[lane].cancel();
  }

  #open(name: string, events: Events): Channel {
    const worker = new Worker(this.#worker, { name });
    worker.onmessage = ({ data }) => {
      if (data.broken !== undefined) events.broken(data.broken);
      else events.answer(data.json, data.binary);
    };
    worker.onerror = (event) => {
      event.preventDefault();
      events.broken(event.message || "the worker could not be started");
    };
    worker.postMessage({ module: this.module });
    return {
      send: (json, binary) => worker.postMessage({ json, binary }),
      close: () => worker.terminate(),
    };
  }
}

/** Compiles the engine from the page itself if the page is a single file, else from the file beside it. */
export async function compile(): Promise<WebAssembly.Module> {
  const inlined = document.getElementById("studio-wasm")?.textContent;
  if (inlined) return WebAssembly.compile(bytesOf(inlined.trim()));
  const response = await fetch("studio.wasm");
  if (!response.ok) throw new Broken(`studio.wasm could not be loaded: ${response.status} ${response.statusText}`);
  // `compileStreaming` would fail with static hosts that do not know the type of .wasm.
  return WebAssembly.compile(await response.arrayBuffer());
}

function bytesOf(base64: string): Uint8Array<ArrayBuffer> {
  const text = atob(base64);
  const bytes = new Uint8Array(text.length);
  for (let i = 0; i < text.length; i++) bytes[i] = text.charCodeAt(i);
  return bytes;
}
