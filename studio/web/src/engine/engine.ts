// Interface of the engine, independent of its connection: lanes of requests that do not wait for each other, so that an edit never
// waits for a solve.

import type { Fault, Progress, RequestBody } from "../contract.ts";

/** `documents` answers at once, `solver` holds plans, `library` builds, `slopes` differentiates. */
export const LANES = ["documents", "solver", "library", "slopes"] as const;
export type Lane = (typeof LANES)[number];

/** Source of a worker's own engine: its code, or the address of a program. */
export type Source = { module: WebAssembly.Module } | { address: string };

export type Done = { value: any; binary: Uint8Array | null };

/** The documents have faults, and the request had no effect. */
export class Faults extends Error {
  constructor(readonly faults: Fault[]) {
    super(faults[0]?.message ?? "the documents have faults");
  }
}

/** A request that the engine cannot serve, with help. */
export class Refused extends Error {
  constructor(
    message: string,
    readonly help: string,
  ) {
    super(message);
  }
}

/** The engine failed (a trap, a lost connection) and was started again. */
export class Broken extends Error {}

/** The page cancelled the request. */
export class Cancelled extends Error {
  constructor() {
    super("cancelled");
  }
}

export interface Engine {
  /** Location of the engine, in words. */
  readonly place: string;
  readonly source: Source;
  /** True if the program behind it has files from its command line. */
  readonly hasFiles: boolean;
  request(lane: Lane, body: RequestBody, options?: Options): Promise<Done>;
  /** Starts the lane before its first request. */
  prepare(lane: Lane): void;
  /** Ends the lane's work; its requests fail with `Cancelled`. */
  cancel(lane: Lane): void;
}

export type Options = { binary?: Uint8Array; progress?: (progress: Progress) => void };
