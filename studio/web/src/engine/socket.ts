// Engine in the program that serves the page, over one WebSocket for each lane on the loopback interface. A text message is a
// request or an answer. One binary message follows a text message with `"binary": true`.

import type { RequestBody } from "../contract.ts";
import type { Done, Engine, Lane, Options, Source } from "./engine.ts";
import { type Channel, type Events, type LaneOfRequests, lanes } from "./lane.ts";

export class SocketEngine implements Engine {
  readonly place = "in the program rollwalk on this computer";
  readonly hasFiles = true;
  readonly source: Source;
  #lanes: Record<Lane, LaneOfRequests>;

  constructor(address: string) {
    this.source = { address };
    this.#lanes = lanes((_, events) => openSocket(address, events));
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
}

/** A channel to the program at an address. */
export function openSocket(address: string, events: Events): Channel {
  const socket = new WebSocket(address);
  socket.binaryType = "arraybuffer";
  let waiting: (string | Uint8Array)[] | null = [];
  let header: string | null = null;
  const send = (message: string | Uint8Array) => (waiting ? waiting.push(message) : socket.send(message as Uint8Array<ArrayBuffer>));
  socket.onopen = () => {
    const messages = waiting ?? [];
    waiting = null;
    for (const message of messages) send(message);
  };
  socket.onmessage = ({ data }) => {
    if (typeof data !== "string") {
      if (header) events.answer(header, new Uint8Array(data));
      header = null;
    } else if (JSON.parse(data).binary === true) header = data;
    else events.answer(data, null);
  };
  socket.onclose = () => events.broken("the connection to rollwalk was lost; check that `rollwalk studio` still runs");
  return {
    send: (json, binary) => {
      send(binary ? JSON.stringify({ ...JSON.parse(json), binary: true }) : json);
      if (binary) send(binary);
    },
    close: () => {
      socket.onclose = null;
      socket.close();
    },
  };
}
