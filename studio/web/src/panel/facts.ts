// A plan in one line: how fast it goes, and how near its motors come to their limits.

import type { Shown } from "../project/studio.ts";
import { QUANTITIES } from "../timeline/quantities.ts";
import { format } from "../ui/dom.ts";

export function factsOf({ frames, planned }: Shown): string {
  const { scene } = planned;
  const { duration_s } = frames.header;
  const [from, to] = [frames.com(frames.row(0)), frames.com(frames.at(duration_s))];
  const facts = [`${format(Math.hypot(to[0] - from[0], to[1] - from[1]) / duration_s, 3)} m/s on average`];
  for (const [id, name] of [["joint_torque", "joint torque"], ["joint_speed", "joint speed"], ["wheel_speed", "wheel speed"]]) {
    const series = QUANTITIES.find((one) => one.id === id)!.series(scene, frames);
    let most = 0;
    for (const one of series) for (const value of one.values) if (one.high) most = Math.max(most, Math.abs(value) / one.high);
    if (series.length > 0) facts.push(`${name} up to ${format(most * 100, 0)} %`);
  }
  return facts.join(" · ");
}
