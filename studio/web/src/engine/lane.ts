// Requests of one lane, in order, and their answers by number. A `Channel` carries them: a worker or a socket.

import type { RequestBody } from "../contract.ts";
import { Broken, Cancelled, type Done, Faults, LANES, type Lane, type Options, Refused } from "./engine.ts";

export interface Channel {
  send(json: string, binary: Uint8Array | null): void;
  close(): void;
}

export type Events = {
  answer(json: string, binary: Uint8Array | null): void;
  /** The channel has failed. */
  broken(why: string): void;
};

type Waiting = { resolve(done: Done): void; reject(error: Error): void; options: Options };

/** Opens all lanes, with a separate channel for each. */
export function lanes(open: (lane: Lane, events: Events) => Channel): Record<Lane, LaneOfRequests> {
  const lane = (name: Lane) => [name, new LaneOfRequests((events) => open(name, events))];
  return Object.fromEntries(LANES.map(lane));
}

export class LaneOfRequests {
  #channel: Channel | null = null;
  #waiting = new Map<number, Waiting>();
  #seq = 0;

  constructor(private readonly open: (events: Events) => Channel) {}

  request(body: RequestBody, options: Options): Promise<Done> {
    const seq = ++this.#seq;
    return new Promise((resolve, reject) => {
      this.#waiting.set(seq, { resolve, reject, options });
      this.#connected().send(JSON.stringify({ seq, ...body }), options.binary ?? null);
    });
  }

  prepare() {
    this.#connected();
  }

  cancel() {
    if (!this.#channel || this.#waiting.size === 0) return;
    this.#channel.close();
    this.#channel = null;
    this.#fail(() => new Cancelled());
  }

  #connected(): Channel {
    if (this.#channel) return this.#channel;
    const channel = this.open({
      answer: (json, binary) => this.#answer(json, binary),
      broken: (why) => {
        if (this.#channel !== channel) return;
        this.#channel = null;
        channel.close();
        this.#fail(() => new Broken(why));
      },
    });
    this.#channel = channel;
    return channel;
  }

  #fail(error: () => Error) {
    const waiting = [...this.#waiting.values()];
    this.#waiting.clear();
    for (const one of waiting) one.reject(error());
  }

  #answer(json: string, binary: Uint8Array | null) {
    const value = JSON.parse(json);
    // An answer to an unreadable request has no number.
    if (value.kind === "error" && value.seq === 0) return this.#fail(() => new Refused(value.message, value.help ?? ""));
    const one = this.#waiting.get(value.seq);
    if (!one) return; // of a request that was cancelled
    if (value.kind === "progress") return one.options.progress?.(value);
    this.#waiting.delete(value.seq);
    if (value.kind === "faults") one.reject(new Faults(value.faults));
    else if (value.kind === "error") one.reject(new Refused(value.message, value.help ?? ""));
    else one.resolve({ value, binary });
  }
}
