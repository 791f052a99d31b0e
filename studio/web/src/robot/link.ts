// The page's end of a connection to a robot. A worker holds the connection (worker.ts); the page shows views and passes orders.
// Nothing is sent before `connect`, which the user requests. After the page is closed, heartbeats end, and the robot returns to
// SAFE.

import workerSource from "robot-worker-source";
import type { ConnectionKind, RobotRequest, RobotView } from "../contract.ts";
import { Broken, type Engine } from "../engine/engine.ts";
import { keep, kept } from "../project/settings.ts";
import type { Studio } from "../project/studio.ts";
import { watchGamepad } from "./gamepad.ts";
import { type ToPage, type ToWorker, unpacked, type RobotTransport } from "./messages.ts";
import { relayAddress } from "./places.ts";
import type { Port } from "./port.ts";
import { choosePort, openSerial, type SerialPort } from "./serial.ts";

export type ConnectionSettings = { place: ConnectionKind; baud: number; node: number; gamepad: boolean; /** The text of a key file. */ key: string | null };
export type Library = { bytes: Uint8Array; /** Identity of the library, as robots report it. */ identity: string };
/** Keys of values that the browser keeps until the tab is closed. */
const PLACE = "rollwalk-robot-place";
const CONNECTED = "rollwalk-robot-connected";
type Waiting = { resolve(): void; reject(error: Error): void };

export class RobotLink {
  view: RobotView | null = null;
  /** Reason for the end of the connection, in words. */
  trouble = "";
  connecting = false;
  /** Current or last place of the robot; survives a reload. */
  place = kept(PLACE) as ConnectionKind | null;
  /** Library that the page sent last. */
  library: Library | null = null;
  #worker: Worker | null = null;
  #source = URL.createObjectURL(new Blob([workerSource], { type: "text/javascript" }));
  /** Chosen serial port. */
  #chosen: { port: SerialPort; baud: number } | null = null;
  /** The same port, if the page holds it. */
  #port: Port | null = null;
  /** Stops the reports of the gamepad. */
  #unwatch = () => {};
  #since_ms = 0;
  #asked = 0;
  #waiting = new Map<number, Waiting>();
  #listeners: (() => void)[] = [];

  constructor(private readonly studio: Studio) {}

  get connected(): boolean {
    return this.#worker !== null && !this.connecting;
  }

  /** Time since the connection began, ms. */
  get connected_ms(): number {
    return performance.now() - this.#since_ms;
  }

  /** True if this page was left or reloaded while a robot was connected. */
  static takeLeft(): boolean {
    const left = kept(CONNECTED) !== null;
    keep(CONNECTED, null);
    return left;
  }

  onChange(listener: () => void) {
    this.#listeners.push(listener);
  }

  async connect({ place, baud, node, gamepad, key }: ConnectionSettings) {
    const { documents, engine } = this.studio;
    const file = documents.robotPath;
    if (this.#worker || this.connecting || !file) return;
    this.connecting = true;
    this.trouble = "";
    this.place = place;
    keep(PLACE, place);
    this.#emit();
    try {
      const way = await this.#way(place, baud);
      const secret = key === null ? null : { text: key, nonce: [...crypto.getRandomValues(new Uint32Array(2))] as [number, number] };
      const connect: RobotRequest = { robot: "connect", place, files: documents.files(), file, node, gamepad, key: secret };
      this.#worker = new Worker(this.#source, { name: "robot" });
      this.#worker.onmessage = ({ data }) => this.#onMessage(data);
      this.#worker.onerror = (event) => this.#end(event.message || "the worker could not be started");
      this.#post({ kind: "start", engine: engine.source, way, connect });
      if (gamepad) this.#unwatch = watchGamepad((seen) => this.#post({ kind: "gamepad", seen }));
    } catch (error) {
      const { name, message } = error as Error;
      this.#end(name === "NotFoundError" ? "No port was chosen." : message);
    }
  }

  /** Sends an order or a library; completes when the view contains its immediate effect. */
  ask(wanted: RobotRequest, binary?: Uint8Array): Promise<void> {
    if (!this.#worker) return Promise.reject(new Broken("no robot is connected"));
    const id = ++this.#asked;
    return new Promise((resolve, reject) => {
      this.#waiting.set(id, { resolve, reject });
      this.#post({ kind: "ask", id, wanted, binary });
    });
  }

  /** Sends an order of the user, and shows its errors. */
  send(wanted: RobotRequest, binary?: Uint8Array) {
    this.ask(wanted, binary).catch((error) => this.studio.showError(error));
  }

  /** Names the robot's motions by a library, if the robot uses this library. */
  name(library: Library) {
    this.library = library;
    // A library that does not fit names nothing, as the panel shows.
    this.ask({ robot: "name" }, library.bytes).catch(() => {});
  }

  flash(library: Library) {
    this.library = library;
    this.send({ robot: "flash" }, library.bytes);
  }

  async #way(place: ConnectionKind, baud: number): Promise<RobotTransport> {
    if (place === "simulated") return { kind: "engine" };
    if (place === "relay") return { kind: "relay", address: relayAddress() };
    this.#chosen = { port: await choosePort(), baud };
    return { kind: "serial", info: this.#chosen.port.getInfo(), baud };
  }

  /** Opens the chosen port in the page. Bytes that are sent before are lost, as on any line; important messages are repeated. */
  async #hold() {
    const { port, baud } = this.#chosen!;
    try {
      this.#port = await openSerial(port, baud, {
        bytes: (bytes) => this.#post({ kind: "arrived", bytes }),
        lost: (why) => this.#end(why),
      });
      // The connection may have ended already.
      if (!this.#worker) void this.#port.close();
    } catch (error) {
      this.#end((error as Error).message);
    }
  }

  #post(message: ToWorker) {
    this.#worker?.postMessage(message);
  }

  #onMessage(message: ToPage) {
    if (message.kind === "started") {
      this.connecting = false;
      this.#since_ms = performance.now();
      // A simulated robot ends with its page.
      if (this.place !== "simulated") keep(CONNECTED, "yes");
      this.#emit();
    } else if (message.kind === "view") {
      this.view = message.view;
      this.#emit();
      // Only here, because the answer must prove that the page works, not that it receives messages.
      this.#post({ kind: "seen" });
    } else if (message.kind === "send") this.#port?.send(message.bytes);
    else if (message.kind === "hold") void this.#hold();
    else if (message.kind === "ended") this.#end(message.why);
    else {
      const waiting = this.#waiting.get(message.id);
      this.#waiting.delete(message.id);
      if (message.kind === "done") waiting?.resolve();
      else waiting?.reject(unpacked(message.error));
    }
  }

  #end(why: string) {
    this.trouble = why;
    keep(CONNECTED, null);
    this.view = null;
    this.library = null;
    this.connecting = false;
    this.#unwatch();
    this.#worker?.terminate();
    this.#worker = null;
    void this.#port?.close();
    this.#port = null;
    // Requests that were pending at the end of the connection need no message.
    for (const { resolve } of this.#waiting.values()) resolve();
    this.#waiting.clear();
    this.#emit();
  }

  #emit() {
    for (const listener of this.#listeners) listener();
  }
}

/** True if the engine supports robots; the query sends nothing to a robot. */
export async function talksToRobots(engine: Engine): Promise<boolean> {
  try {
    await engine.request("documents", { kind: "robot", now_us: 0, robot: "leave" });
    return true;
  } catch {
    return false;
  }
}
