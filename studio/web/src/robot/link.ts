// A connection with a robot: asks the engine what to send, sends it, and hands over what arrives, as soon as it does and sixty times a second.
// Nothing is sent before `connect`, which a person asks for. When the page is gone, heartbeats end, and the robot returns
// to SAFE by itself.

import type { Place, RobotRequest, RobotView } from "../contract.ts";
import { Cancelled, type Engine } from "../engine/engine.ts";
import type { Studio } from "../project/studio.ts";
import { openPort, type Port } from "./port.ts";

const TICK_MS = 16;
/** A timer of its own worker goes on when the page is in the background. */
const TIMER = `setInterval(() => postMessage(0), ${TICK_MS})`;
const NODE = 1;

export class RobotLink {
  view: RobotView | null = null;
  /** What ended the connection, in words. */
  trouble = "";
  connecting = false;
  #port: Port | null = null;
  #timer: Worker | null = null;
  #arrived: Uint8Array[] = [];
  #busy = false;
  #listeners: (() => void)[] = [];
  readonly #engine: Engine;

  constructor(private readonly studio: Studio) {
    this.#engine = studio.engine;
  }

  get connected(): boolean {
    return this.#port !== null;
  }

  onChange(listener: () => void) {
    this.#listeners.push(listener);
  }

  async connect(place: Place, baud: number) {
    const { documents } = this.studio;
    const file = documents.robotPath;
    if (this.connected || this.connecting || !file) return;
    this.connecting = true;
    this.trouble = "";
    this.#tell();
    try {
      const port = await openPort(place, baud, {
        bytes: (bytes) => {
          this.#arrived.push(bytes);
          void this.#tick();
        },
        lost: (why) => this.#end(why),
      });
      this.#port = port;
      await this.ask({ robot: "connect", place, files: documents.files(), file, node: NODE });
      // The port may have been lost since.
      if (!this.connected) return;
      this.#timer = new Worker(URL.createObjectURL(new Blob([TIMER], { type: "text/javascript" })));
      this.#timer.onmessage = () => void this.#tick();
    } catch (error) {
      this.#fail(error as Error);
    } finally {
      this.connecting = false;
      this.#tell();
    }
  }

  /** An order or a library; the answer is the robot as it is then. */
  async ask(wanted: RobotRequest, binary?: Uint8Array) {
    const now_us = Math.round(performance.now() * 1000);
    const { value, binary: sent } = await this.#engine.request("robot", { kind: "robot", now_us, ...wanted }, { binary });
    if (sent && sent.length > 0) this.#port?.send(sent);
    this.view = value.view;
    this.#tell();
  }

  /** An order of a person; what goes wrong with it is said. */
  wish(wanted: RobotRequest, binary?: Uint8Array) {
    this.ask(wanted, binary).catch((error) => this.studio.complain(error));
  }

  async #tick() {
    if (this.#busy || !this.#timer) return;
    this.#busy = true;
    const arrived = joined(this.#arrived.splice(0));
    try {
      await this.ask({ robot: "tick" }, arrived.length > 0 ? arrived : undefined);
      if (this.view?.leaving === "now") {
        await this.ask({ robot: "leave" });
        this.#end("");
      }
    } catch (error) {
      this.#fail(error as Error);
    }
    this.#busy = false;
  }

  #fail(error: Error) {
    // What was under way when the connection ended says nothing new.
    if (error instanceof Cancelled) return;
    this.#end(error.name === "NotFoundError" ? "No port was chosen." : error.message);
  }

  #end(why: string) {
    this.trouble = why;
    this.view = null;
    this.#timer?.terminate();
    this.#timer = null;
    void this.#port?.close();
    this.#port = null;
    this.#arrived = [];
    this.#engine.cancel("robot");
    this.#tell();
  }

  #tell() {
    for (const listener of this.#listeners) listener();
  }
}

/** Whether the engine can talk to robots at all; asking so sends nothing anywhere. */
export async function talksToRobots(engine: Engine): Promise<boolean> {
  try {
    await engine.request("documents", { kind: "robot", now_us: 0, robot: "leave" });
    return true;
  } catch {
    return false;
  }
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
