// Positions of samples and times on the tracks, as shares of their width.

import type { MotionView } from "../contract.ts";

export class Axis {
  constructor(
    readonly samples: number,
    readonly periodic: boolean,
    readonly duration_s: number,
  ) {}

  static of(motion: MotionView): Axis {
    return new Axis(motion.samples, motion.ends === "periodic", motion.duration_s);
  }

  /** Left edge of a sample's cell. Samples of motions at rest are in the middle of their cells. */
  edge(sample: number): number {
    if (this.periodic) return sample / this.samples;
    return Math.max(0, Math.min(1, (sample - 0.5) / (this.samples - 1)));
  }

  sampleAt(share: number): number {
    const sample = this.periodic ? Math.floor(share * this.samples) : Math.round(share * (this.samples - 1));
    return Math.max(0, Math.min(this.samples - 1, sample));
  }

  time_s(sample: number): number {
    return (sample * this.duration_s) / (this.periodic ? this.samples : this.samples - 1);
  }

  share(time_s: number): number {
    return this.duration_s > 0 ? Math.max(0, Math.min(1, time_s / this.duration_s)) : 0;
  }
}

/** Position of a pointer in an element's width, 0 to 1. */
export function shareOf(event: PointerEvent | MouseEvent, element: Element): number {
  const box = element.getBoundingClientRect();
  return box.width > 0 ? (event.clientX - box.left) / box.width : 0;
}

/** Round steps of a scale: 1, 2 or 5 times a power of ten. */
export function ticks(from: number, to: number, about: number): number[] {
  const span = to - from;
  if (!(span > 0)) return [from];
  const power = 10 ** Math.floor(Math.log10(span / about));
  const step = [1, 2, 5, 10].map((k) => k * power).find((one) => span / one <= about)!;
  const list: number[] = [];
  for (let k = Math.ceil(from / step - 1e-9); k * step <= to + 1e-9 * span; k++) list.push(k * step);
  return list;
}
