// The worker that holds a connection to a robot. It passes received bytes to its engine, and sends the engine's bytes, on every
// arrival and sixty times per second, so that heartbeats continue while the page draws or plans.
//
// Heartbeats require an operator at the page: the page answers every view. If it has not answered for a second, heartbeats end, and
// the robot returns to SAFE.

import type { GamepadSeen, RobotRequest, RobotView } from "../contract.ts";
import { Door } from "../engine/door.ts";
import type { Source } from "../engine/engine.ts";
import { type Channel, type Events, LaneOfRequests } from "../engine/lane.ts";
import { openSocket } from "../engine/socket.ts";
import { packed, type ToPage, type ToWorker, type RobotTransport } from "./messages.ts";
import { openRelay, type Port } from "./port.ts";
import { findPort, openSerial } from "./serial.ts";

const TICK_MS = 16;
/** Maximum silence of the page, ms, during which an operator still counts as present. */
const PAGE_SILENT_MS = 1000;
/** Longest wait for a port to close, ms. */
const CLOSING_MS = 500;

const worker = globalThis as unknown as {
  onmessage: (event: MessageEvent<ToWorker>) => void;
  postMessage(message: ToPage, transfer?: Transferable[]): void;
};

class Connection {
  #port: Port | null = null;
  #engine: LaneOfRequests;
  #arrived: Uint8Array[] = [];
  /** Gamepad states since the last tick: a tap on the emergency stop may be shorter than a tick. */
  #gamepad: GamepadSeen[] = [];
  #view: RobotView | null = null;
  #busy = false;
  /** A view has been posted that the page has not answered. */
  #unseen = false;
  #simulated = false;
  #heard_ms = this.#now_ms();
  #timer = 0;

  constructor(engine: Source) {
    this.#engine = new LaneOfRequests((events) => ("address" in engine ? openSocket(engine.address, events) : openDoor(engine.module, events)));
  }

  /** Time of a simulated robot, which a slow computer slows down; else the clock's time. */
  #now_ms(): number {
    return this.#simulated ? 1000 * (this.#view?.time_s ?? 0) : performance.now();
  }

  async start(way: RobotTransport, connect: RobotRequest) {
    this.#simulated = way.kind === "engine";
    this.#heard_ms = this.#now_ms();
    try {
      this.#port = await this.#open(way);
      await this.#ask(connect);
      worker.postMessage({ kind: "started" });
      this.#timer = setInterval(() => void this.#tick(), TICK_MS) as unknown as number;
    } catch (error) {
      await this.#end((error as Error).message);
    }
  }

  onMessage(message: ToWorker) {
    // Bytes of a port and states of a gamepad arrive even from a page that shows nothing any more.
    if (message.kind === "seen" || message.kind === "ask") this.#heard_ms = this.#now_ms();
    if (message.kind === "seen") this.#unseen = false;
    else if (message.kind === "arrived") this.#take(message.bytes);
    else if (message.kind === "gamepad") {
      this.#gamepad.push(message.seen);
      void this.#tick();
    } else if (message.kind === "ask") void this.#obey(message.id, message.wanted, message.binary);
  }

  async #open(way: RobotTransport): Promise<Port> {
    const heard = { bytes: (bytes: Uint8Array) => this.#take(bytes), lost: (why: string) => void this.#end(why) };
    if (way.kind === "engine") return { send() {}, async close() {} };
    if (way.kind === "relay") return openRelay(way.address, heard);
    const port = await findPort(way.info);
    if (port) return openSerial(port, way.baud, heard);
    worker.postMessage({ kind: "hold" });
    return { send: (bytes) => worker.postMessage({ kind: "send", bytes }, [bytes.buffer as ArrayBuffer]), async close() {} };
  }

  #take(bytes: Uint8Array) {
    this.#arrived.push(bytes);
    void this.#tick();
  }

  async #ask(wanted: RobotRequest, binary?: Uint8Array) {
    const now_us = Math.round(performance.now() * 1000);
    const { value, binary: sent } = await this.#engine.request({ kind: "robot", now_us, ...wanted }, { binary });
    if (sent && sent.length > 0) this.#port?.send(sent);
    this.#view = value.view;
  }

  #show() {
    this.#unseen = true;
    worker.postMessage({ kind: "view", view: this.#view });
  }

  async #obey(id: number, wanted: RobotRequest, binary?: Uint8Array) {
    try {
      await this.#ask(wanted, binary);
      this.#show();
      worker.postMessage({ kind: "done", id });
    } catch (error) {
      worker.postMessage({ kind: "failed", id, error: packed(error) });
    }
  }

  async #tick() {
    if (this.#busy || !this.#timer) return;
    this.#busy = true;
    const arrived = joined(this.#arrived.splice(0));
    const gamepad = this.#gamepad.splice(0);
    const attended = this.#now_ms() - this.#heard_ms < PAGE_SILENT_MS;
    try {
      await this.#ask({ robot: "tick", attended, gamepad }, arrived.length > 0 ? arrived : undefined);
      if (this.#view?.leaving === "now") {
        await this.#ask({ robot: "leave" });
        await this.#end("");
      } else if (!this.#unseen) this.#show();
    } catch (error) {
      await this.#end((error as Error).message);
    }
    this.#busy = false;
  }

  async #end(why: string) {
    clearInterval(this.#timer);
    this.#timer = 0;
    const port = this.#port;
    this.#port = null;
    // Then the page ends this worker. The browser closes a port that hangs.
    await Promise.race([port?.close(), new Promise((done) => setTimeout(done, CLOSING_MS))]);
    worker.postMessage({ kind: "ended", why });
  }
}

/** An engine in this worker. */
function openDoor(module: WebAssembly.Module, events: Events): Channel {
  const door = new Door(module, events.answer);
  return {
    send(json, binary) {
      try {
        door.request(json, binary);
      } catch (error) {
        events.broken(door.panic ?? String(error));
      }
    },
    close() {},
  };
}

function joined(parts: Uint8Array[]): Uint8Array {
  const all = new Uint8Array(parts.reduce((length, part) => length + part.length, 0));
  let at = 0;
  for (const part of parts) {
    all.set(part, at);
    at += part.length;
  }
  return all;
}

let connection: Connection | null = null;
worker.onmessage = ({ data }) => {
  if (data.kind === "start") {
    connection = new Connection(data.engine);
    void connection.start(data.way, data.connect);
  } else connection?.onMessage(data);
};
