// Messages between the page and the worker that holds a connection to a robot.

import type { Fault, GamepadSeen, RobotRequest, RobotView } from "../contract.ts";
import { Broken, Cancelled, Faults, Refused, type Source } from "../engine/engine.ts";
import type { SerialInfo } from "./serial.ts";

/** Connection of the worker to the robot: in its engine, behind a relay, or at a serial port. */
export type RobotTransport = { kind: "engine" } | { kind: "relay"; address: string } | { kind: "serial"; info: SerialInfo; baud: number };

export type ToWorker =
  | { kind: "start"; engine: Source; way: RobotTransport; connect: RobotRequest }
  | { kind: "ask"; id: number; wanted: RobotRequest; binary?: Uint8Array }
  /** The page has drawn a view. The worker sends heartbeats only while such messages arrive. */
  | { kind: "seen" }
  | { kind: "gamepad"; seen: GamepadSeen }
  /** Bytes that have arrived at the page's port. */
  | { kind: "arrived"; bytes: Uint8Array };

export type ToPage =
  | { kind: "started" }
  | { kind: "view"; view: RobotView | null }
  | { kind: "done"; id: number }
  | { kind: "failed"; id: number; error: Packed }
  /** The worker finds no such serial port, or several, so the page must hold the port. */
  | { kind: "hold" }
  /** Bytes for the page's port. */
  | { kind: "send"; bytes: Uint8Array }
  /** The connection has ended; the reason in words, unless the user ended it. */
  | { kind: "ended"; why: string };

/** An error between threads, which do not preserve classes. */
export type Packed = { name: "faults" | "refused" | "broken" | "other"; message: string; help: string; faults: Fault[] };

export function packed(error: unknown): Packed {
  const message = error instanceof Error ? error.message : String(error);
  if (error instanceof Faults) return { name: "faults", message, help: "", faults: error.faults };
  if (error instanceof Refused) return { name: "refused", message, help: error.help, faults: [] };
  if (error instanceof Broken || error instanceof Cancelled) return { name: "broken", message, help: "", faults: [] };
  return { name: "other", message, help: "", faults: [] };
}

export function unpacked({ name, message, help, faults }: Packed): Error {
  if (name === "faults") return new Faults(faults);
  if (name === "refused") return new Refused(message, help);
  return name === "broken" ? new Broken(message) : new Error(message);
}
