// Comparison of the robot with the plan that it plays: whether the motion in the robot's library is the open plan, the plan's pose
// at the robot's time, and deviations of joints.

import type { RobotView } from "../contract.ts";
import type { Snapshot } from "../project/documents.ts";
import type { Row } from "../project/frames.ts";
import type { ShownPlan, Studio } from "../project/studio.ts";
import { format } from "../ui/dom.ts";
import type { RobotLink } from "./link.ts";

/** Comparison of the open plan with a library, by the engine. */
type ClipComparison = { name: string; clip: number | null; why: string };

/** Joint with the largest deviation from the plan, and the largest deviation since the motion began. */
export type JointDeviation = { joint: string; rad: number; most_rad: number };

export class PlanComparison {
  compared: ClipComparison | null = null;
  apart: JointDeviation | null = null;
  #of: { shown: ShownPlan; library: Uint8Array; documents: Snapshot } | null = null;

  constructor(
    private readonly studio: Studio,
    private readonly link: RobotLink,
  ) {
    link.onChange(() => this.#update());
    studio.events.on(["plan", "documents"], () => this.#update());
  }

  /** Row of the plan at the robot's time, while the robot plays the plan. */
  row(): Row | null {
    const { playing } = this.link.view ?? {};
    const shown = this.#shown();
    return playing && shown && playing.clip === this.compared?.clip ? shown.frames.at(within(shown, playing.time_s)) : null;
  }

  #shown(): ShownPlan | null {
    const { studio } = this;
    return studio.shown && !studio.stale && !studio.shown.drag ? studio.shown : null;
  }

  #update() {
    const shown = this.#shown();
    const { view } = this.link;
    const library = this.link.library?.identity === view?.library ? this.link.library?.bytes : null;
    if (!shown || !library || !view || view.motions.length === 0) {
      [this.#of, this.compared, this.apart] = [null, null, null];
      return;
    }
    const { now } = this.studio.documents;
    if (this.#of?.shown !== shown || this.#of.library !== library || this.#of.documents !== now) void this.#compare(shown, library);
    this.#measure(shown, view);
  }

  async #compare(shown: ShownPlan, library: Uint8Array) {
    const { documents, engine } = this.studio;
    const of = { shown, library, documents: documents.now };
    [this.#of, this.compared, this.apart] = [of, null, null];
    const body = { kind: "compare", files: documents.files(), motion: documents.motionPath, library: documents.libraryPath ?? "" } as const;
    try {
      const { value } = await engine.request("solver", body, { binary: library });
      // The plan or library may have changed meanwhile.
      if (this.#of === of) this.compared = value;
    } catch {
      // The solver was stopped and has lost its plan. The next plan is compared.
      if (this.#of === of) this.#of = null;
    }
  }

  /** Comparison in words. */
  words(): string {
    const { compared, apart } = this;
    if (!compared) return "";
    if (compared.clip === null) return `The plan is not compared with the robot: ${compared.why}.`;
    if (!apart) return `The open plan is \`${compared.name}\` of the robot's library, and is shown beside the robot while the robot plays this motion.`;
    const angle = (rad: number) => `${format(rad, 3)} rad`;
    const now = `Deviation from the plan: \`${apart.joint}\` is off by ${angle(apart.rad)}, the most of all joints`;
    return `${now}; the maximum since the start of \`${compared.name}\` is ${angle(apart.most_rad)}.`;
  }

  /** Compares each joint with the plan at the time of its measurement, which differs between joints. */
  #measure({ frames, planned }: ShownPlan, view: RobotView) {
    const { playing } = view;
    if (!playing || playing.clip !== this.compared?.clip) {
      this.apart = null;
      return;
    }
    const apart: JointDeviation = { joint: "", rad: 0, most_rad: this.apart?.most_rad ?? 0 };
    for (const channel of view.channels) {
      const joint = planned.scene.joints.findIndex((one) => one.name === channel.name);
      if (joint < 0) continue;
      const time_s = within({ frames }, playing.time_s - playing.rate * channel.age_s);
      const rad = Math.abs(channel.position_rad - frames.joint(frames.at(time_s), joint).angle_rad);
      if (rad > apart.rad) [apart.joint, apart.rad] = [channel.name, rad];
    }
    apart.most_rad = Math.max(apart.most_rad, apart.rad);
    this.apart = apart;
  }
}

/** Time within a motion; for a periodic motion, within its first cycle. */
function within({ frames }: Pick<ShownPlan, "frames">, time_s: number): number {
  const { duration_s, period } = frames.header;
  if (period) return ((time_s % duration_s) + duration_s) % duration_s;
  return Math.max(0, Math.min(time_s, duration_s));
}
