// Plans the documents after each change: one request at a time, of newer requests only the last. During a drag, a solve has a few
// iterations; on release, a complete solve follows.

import type { Planned, Progress, Start } from "../contract.ts";
import { Broken, Cancelled, type Engine, Faults, Refused } from "../engine/engine.ts";
import type { Snapshot } from "./documents.ts";

export const FRAMES_HZ = 60;
const DRAG_ITERATIONS = 2;
/** Time of a complete solve, ms, after which a newer edit interrupts it. */
const PATIENCE_MS = 500;

/** `plan` is the text of a plan file to start from. */
export type PlanRequest = { snapshot: Snapshot; version: number; drag: boolean; from: Start; plan?: Uint8Array };

export type Outcome = {
  planned(request: PlanRequest, planned: Planned, frames: Float32Array): void;
  /** Last good plan with its multipliers, as bytes. */
  kept(request: PlanRequest, solution: Uint8Array): void;
  failed(request: PlanRequest, error: Error): void;
  /** The engine failed, was started again, and gets the request again. */
  restarted(error: Broken): void;
  progress(progress: Progress | null): void;
  activity(): void;
};

export class Planner {
  #request: PlanRequest | null = null;
  #running: { request: PlanRequest; since: number } | null = null;
  #good: Uint8Array | null = null;
  #fresh = false;
  #restarts = 0;

  constructor(
    private readonly engine: Engine,
    private readonly outcome: Outcome,
  ) {}

  get busy(): boolean {
    return this.#running !== null;
  }

  ask(request: PlanRequest) {
    // A step of a drag must not replace a complete solve, nor a warm start a cold start.
    const from = this.#request?.from === "scratch" ? "scratch" : request.from;
    this.#request = { ...request, from };
    const running = this.#running;
    if (!running) void this.#run();
    else if (!running.request.drag) {
      const left = PATIENCE_MS - (performance.now() - running.since);
      setTimeout(() => this.#running === running && this.#request && this.engine.cancel("solver"), Math.max(0, left));
    }
  }

  /** Ends the running solve. The shown plan remains. */
  cancel() {
    this.#request = null;
    this.engine.cancel("solver");
  }

  /** Another project was opened, so its first plan starts from scratch. */
  forget() {
    this.#good = null;
  }

  async #run() {
    while (this.#request) {
      const request = this.#request;
      this.#request = null;
      this.#running = { request, since: performance.now() };
      this.outcome.activity();
      try {
        await this.#plan(request);
        this.#restarts = 0;
      } catch (error) {
        this.#recover(request, error as Error);
      }
      this.#running = null;
      this.outcome.progress(null);
    }
    this.outcome.activity();
  }

  async #plan(request: PlanRequest) {
    const resumed = this.#fresh ? this.#good : null;
    if (resumed && request.from === "good") await this.engine.request("solver", { kind: "resume" }, { binary: resumed });
    this.#fresh = false;
    const { value, binary } = await this.engine.request(
      "solver",
      {
        kind: "plan",
        files: request.snapshot.files.map((file) => ({ ...file })),
        motion: request.snapshot.motion,
        from: request.from,
        iterations: request.drag ? DRAG_ITERATIONS : null,
        frames_hz: FRAMES_HZ,
      },
      { progress: (progress) => this.outcome.progress(progress), binary: request.plan },
    );
    if (!binary) throw new Refused("The engine sent no frames.", "");
    const frames = new Float32Array(binary.buffer, binary.byteOffset, binary.byteLength / 4);
    this.outcome.planned(request, value, frames);
    if (value.good && !request.drag) this.#keep(request);
  }

  /** Keeps the good solution here too, in case its worker must be ended. */
  #keep(request: PlanRequest) {
    const keep = ({ binary }: { binary: Uint8Array | null }) => {
      this.#good = binary;
      if (binary) this.outcome.kept(request, binary);
    };
    // Without it, the next worker starts from scratch, which takes longer, but is not an error.
    this.engine.request("solver", { kind: "solution" }).then(keep, () => {});
  }

  #recover(request: PlanRequest, error: Error) {
    if (error instanceof Cancelled) {
      this.#fresh = true;
      if (!this.#request) this.outcome.failed(request, error);
      return;
    }
    if (error instanceof Broken) {
      this.#fresh = true;
      // A solution that also makes a new engine fail must not be sent again.
      if (++this.#restarts === 2) this.#good = null;
      if (this.#restarts <= 2) {
        this.#request ??= { ...request, from: this.#good ? request.from : "scratch" };
        this.outcome.restarted(error);
        return;
      }
    }
    if (!(error instanceof Faults || error instanceof Refused || error instanceof Broken)) console.error(error);
    this.outcome.failed(request, error);
  }
}
