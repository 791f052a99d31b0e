// Frames of a plan: poses, forces and joints at any time, also in later cycles of a periodic motion.

import type { EndEffector, FramesHeader } from "../contract.ts";

export type Row = Float32Array;

export class Frames {
  /** Wheels: body, and rotation relative to its link in one cycle. */
  #wheels: { body: number; turn: Quaternion }[] = [];
  readonly bodies: number;

  constructor(
    readonly header: FramesHeader,
    readonly data: Float32Array,
    endEffectors: EndEffector[],
  ) {
    this.bodies = (header.columns.com - header.columns.bodies) / 7;
    for (const one of endEffectors) {
      if (one.wheel_body === null || !header.period) continue;
      this.#wheels.push({ body: one.wheel_body, turn: this.#turn(one.body, one.wheel_body) });
    }
  }

  row(index: number): Row {
    const { width } = this.header;
    return this.data.subarray(index * width, (index + 1) * width);
  }

  /** Row at a time. Beyond the period of a periodic motion, the next cycles; else the last row. */
  at(time_s: number, out: Row = new Float32Array(this.header.width)): Row {
    const { duration_s, period, count, rate_hz } = this.header;
    const cycle = period ? Math.floor(time_s / duration_s) : 0;
    const within = Math.max(0, time_s - cycle * duration_s);
    const index = Math.min(Math.floor(within * rate_hz + 1e-6), count - 1);
    const start = index / rate_hz;
    if (index + 1 < count) {
      this.#mix(this.row(index), this.row(index + 1), (within - start) * rate_hz, out);
    } else if (period && duration_s - start > 1e-6) {
      const next = this.#moved(this.row(0), 1);
      this.#mix(this.row(index), next, Math.min(1, (within - start) / (duration_s - start)), out);
    } else {
      out.set(this.row(index));
    }
    return cycle === 0 ? out : this.#moved(out, cycle, out);
  }

  contact(row: Row, endEffector: number): boolean {
    return row[this.header.columns.end_effectors + 7 * endEffector] > 0.5;
  }

  position(row: Row, endEffector: number): [number, number, number] {
    const at = this.header.columns.end_effectors + 7 * endEffector + 1;
    return [row[at], row[at + 1], row[at + 2]];
  }

  force(row: Row, endEffector: number): [number, number, number] {
    const at = this.header.columns.end_effectors + 7 * endEffector + 4;
    return [row[at], row[at + 1], row[at + 2]];
  }

  com(row: Row): [number, number, number] {
    const at = this.header.columns.com;
    return [row[at], row[at + 1], row[at + 2]];
  }

  joint(row: Row, joint: number): { angle_rad: number; speed_rad_s: number; torque_nm: number } {
    const at = this.header.columns.joints + 3 * joint;
    return { angle_rad: row[at], speed_rad_s: row[at + 1], torque_nm: row[at + 2] };
  }

  wheel(row: Row, driven: number): { speed_rad_s: number; torque_nm: number } {
    const at = this.header.columns.wheels + 2 * driven;
    return { speed_rad_s: row[at], torque_nm: row[at + 1] };
  }

  #mix(a: Row, b: Row, share: number, out: Row) {
    for (let i = 0; i < out.length; i++) out[i] = a[i] + (b[i] - a[i]) * share;
    for (let body = 0; body < this.bodies; body++) {
      const at = this.header.columns.bodies + 7 * body + 3;
      let dot = 0;
      for (let k = 0; k < 4; k++) dot += a[at + k] * b[at + k];
      const sign = dot < 0 ? -1 : 1;
      let norm = 0;
      for (let k = 0; k < 4; k++) {
        out[at + k] = a[at + k] * (1 - share) + sign * b[at + k] * share;
        norm += out[at + k] ** 2;
      }
      norm = Math.sqrt(norm) || 1;
      for (let k = 0; k < 4; k++) out[at + k] /= norm;
    }
    const feet = (this.header.columns.joints - this.header.columns.end_effectors) / 7;
    for (let foot = 0; foot < feet; foot++) {
      const at = this.header.columns.end_effectors + 7 * foot;
      out[at] = share < 0.5 ? a[at] : b[at];
    }
  }

  /** Displacement over some cycles of a periodic motion: turn about the vertical by `yaw`, rad, and offset by `x` and `y`, m. */
  moved(cycles: number): { x: number; y: number; yaw: number } {
    const { period } = this.header;
    let [x, y, yaw] = [0, 0, 0];
    for (let k = 0; period && k < cycles; k++) {
      x += Math.cos(yaw) * period.offset_m[0] - Math.sin(yaw) * period.offset_m[1];
      y += Math.sin(yaw) * period.offset_m[0] + Math.cos(yaw) * period.offset_m[1];
      yaw += period.yaw_rad;
    }
    return { x, y, yaw };
  }

  /** A row, moved by a number of cycles. */
  #moved(row: Row, cycles: number, out: Row = new Float32Array(row.length)): Row {
    const { period, columns } = this.header;
    if (!period) return row;
    const source = out === row ? row.slice() : row;
    out.set(source);
    const { x, y, yaw } = this.moved(cycles);
    const [c, s] = [Math.cos(yaw), Math.sin(yaw)];
    const turn = (at: number) => {
      out[at] = c * source[at] - s * source[at + 1];
      out[at + 1] = s * source[at] + c * source[at + 1];
    };
    const place = (at: number) => {
      turn(at);
      out[at] += x;
      out[at + 1] += y;
    };
    const half: Quaternion = [Math.cos(yaw / 2), 0, 0, Math.sin(yaw / 2)];
    for (let body = 0; body < this.bodies; body++) {
      const at = columns.bodies + 7 * body;
      place(at);
      write(out, at + 3, multiply(half, read(source, at + 3)));
    }
    for (const wheel of this.#wheels) {
      const at = columns.bodies + 7 * wheel.body + 3;
      let spun = read(source, at);
      for (let k = 0; k < cycles; k++) spun = multiply(spun, wheel.turn);
      write(out, at, multiply(half, spun));
    }
    place(columns.com);
    for (let at = columns.end_effectors; at < columns.joints; at += 7) {
      place(at + 1);
      turn(at + 4);
    }
    return out;
  }

  /** Rotation of a wheel about its own axis over the frames, extrapolated to the end of the period. */
  #turn(link: number, wheel: number): Quaternion {
    const relative = (index: number) => {
      const row = this.row(index);
      const at = this.header.columns.bodies;
      return multiply(conjugate(read(row, at + 7 * link + 3)), read(row, at + 7 * wheel + 3));
    };
    let turn: Quaternion = [1, 0, 0, 0];
    let step: Quaternion = turn;
    for (let index = 1; index < this.header.count; index++) {
      step = multiply(conjugate(relative(index - 1)), relative(index));
      turn = multiply(turn, step);
    }
    const gap = this.header.duration_s * this.header.rate_hz - (this.header.count - 1);
    return multiply(turn, part(step, gap));
  }
}

type Quaternion = [number, number, number, number];

function read(row: Row, at: number): Quaternion {
  return [row[at], row[at + 1], row[at + 2], row[at + 3]];
}

function write(row: Row, at: number, q: Quaternion) {
  for (let k = 0; k < 4; k++) row[at + k] = q[k];
}

function multiply(a: Quaternion, b: Quaternion): Quaternion {
  return [
    a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
    a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
    a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
    a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0],
  ];
}

function conjugate(q: Quaternion): Quaternion {
  return [q[0], -q[1], -q[2], -q[3]];
}

/** A fraction of a small rotation. */
function part(q: Quaternion, share: number): Quaternion {
  const sign = q[0] < 0 ? -1 : 1;
  const sine = Math.hypot(q[1], q[2], q[3]);
  if (sine < 1e-9) return [1, 0, 0, 0];
  const half = Math.atan2(sine, sign * q[0]) * share;
  const scale = (sign * Math.sin(half)) / sine;
  return [Math.cos(half), q[1] * scale, q[2] * scale, q[3] * scale];
}
