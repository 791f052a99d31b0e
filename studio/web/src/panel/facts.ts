// Facts of a plan: mean speed, and peak loads of motors relative to their limits.

import type { ShownPlan } from "../project/studio.ts";
import { QUANTITIES } from "../timeline/quantities.ts";
import { format } from "../ui/dom.ts";

/** Peak load of a motor, as a share of its limit. */
export type Peak = { of: string; motor: string; share: number; time_s: number };

export function peaksOf({ frames, planned }: ShownPlan): Peak[] {
  const peaks: Peak[] = [];
  for (const [id, of] of [["joint_torque", "joint torque"], ["joint_speed", "joint speed"], ["wheel_speed", "wheel speed"]]) {
    const peak: Peak = { of, motor: "", share: 0, time_s: 0 };
    for (const { name, values, high } of QUANTITIES.find((one) => one.id === id)!.series(planned.scene, frames)) {
      values.forEach((value, row) => {
        const share = high ? Math.abs(value) / high : 0;
        if (share > peak.share) Object.assign(peak, { motor: name.replaceAll("_", " "), share, time_s: row / frames.header.rate_hz });
      });
    }
    if (peak.motor) peaks.push(peak);
  }
  return peaks;
}

export function factsOf(shown: ShownPlan, peaks: Peak[]): string {
  const { frames } = shown;
  const { duration_s } = frames.header;
  const [from, to] = [frames.com(frames.row(0)), frames.com(frames.at(duration_s))];
  const speed = `${format(Math.hypot(to[0] - from[0], to[1] - from[1]) / duration_s, 3)}\u00a0m/s on average`;
  return [speed, ...peaks.map(({ of, share }) => `${of} up to ${percent(share)}`)].join(" · ");
}

export function percent(share: number): string {
  return `${format(share * 100, 0)}\u00a0%`;
}
