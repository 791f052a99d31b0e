// Displayed time and its playback. Periodic motions continue into their next cycles; others begin again.

import type { FramesHeader } from "../contract.ts";

export const SPEEDS = [0.1, 0.25, 0.5, 1, 2];

export class Playback {
  time_s = 0;
  playing = false;
  held = false;
  speed = 1;
  loop = true;
  header: FramesHeader | null = null;
  #listeners: (() => void)[] = [];
  #last_ms = 0;

  /** Returns a function that removes the listener. */
  onChange(listener: () => void): () => void {
    this.#listeners.push(listener);
    return () => (this.#listeners = this.#listeners.filter((one) => one !== listener));
  }

  get duration_s(): number {
    return this.header?.duration_s ?? 0;
  }

  /** Time within the motion, for timeline and plots. */
  get within_s(): number {
    const { duration_s } = this;
    if (duration_s <= 0) return 0;
    if (this.time_s <= duration_s) return this.time_s;
    return this.header?.period ? this.time_s % duration_s : duration_s;
  }

  get cycle(): number {
    return this.header?.period && this.duration_s > 0 ? Math.floor(this.time_s / this.duration_s) : 0;
  }

  setFrames(header: FramesHeader | null) {
    this.header = header;
    if (!header || (!header.period && this.time_s > header.duration_s)) this.time_s = 0;
    this.#emit();
  }

  seek(time_s: number) {
    const end = this.header?.period && this.playing ? Infinity : this.duration_s;
    this.time_s = Math.max(0, Math.min(time_s, end));
    this.#emit();
  }

  step(frames: number) {
    this.pause();
    if (this.header) this.seek(this.within_s + frames / this.header.rate_hz);
  }

  /** While a robot is connected, the picture shows the robot, and the plan does not play. */
  hold(held: boolean) {
    if (held === this.held) return;
    this.held = held;
    this.pause();
    this.#emit();
  }

  toggle() {
    if (this.held) return;
    if (this.playing) this.pause();
    else this.play();
  }

  play() {
    if (!this.header || this.playing) return;
    if (!this.header.period && this.time_s >= this.duration_s) this.time_s = 0;
    this.playing = true;
    this.#last_ms = performance.now();
    requestAnimationFrame((now) => this.#tick(now));
    this.#emit();
  }

  pause() {
    if (!this.playing) return;
    this.playing = false;
    this.#emit();
  }

  #tick(now_ms: number) {
    if (!this.playing || !this.header) return;
    // After a pause of the page (another tab), time does not jump.
    const passed_s = Math.min(0.25, Math.max(0, now_ms - this.#last_ms) / 1000) * this.speed;
    this.#last_ms = now_ms;
    this.time_s += passed_s;
    if (!this.loop && this.time_s >= this.duration_s) {
      this.time_s = this.duration_s;
      this.playing = false;
    } else if (!this.header.period && this.time_s >= this.duration_s) {
      this.time_s %= this.duration_s;
    }
    this.#emit();
    if (this.playing) requestAnimationFrame((now) => this.#tick(now));
  }

  #emit() {
    for (const listener of this.#listeners) listener();
  }
}
