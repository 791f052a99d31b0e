// The footfall chart: a row for each end effector, filled in stance. Swings are gaps. Users drag their edges or the whole swing,
// paint new swings over a stance, or do the same with the keyboard.

import type { Playback } from "../project/playback.ts";
import type { Studio } from "../project/studio.ts";
import { footColour, shortNames } from "../scene/palette.ts";
import { isDark, type Settings } from "../project/settings.ts";
import { format, h, replace } from "../ui/dom.ts";
import { readable } from "../panel/targets.ts";
import { Axis, shareOf } from "./axis.ts";
import { moved, painted, resized, type Swing, swingsOf, without } from "./footfalls.ts";

type Drag = { foot: number; row: boolean[]; swing: Swing | null; part: "lift" | "land" | "whole" | "new"; from: number; gesture: string; moved: boolean };

export class FootfallChart {
  readonly element = h("div", { class: "footfalls", role: "group", "aria-label": "Footfalls" });
  #drag: Drag | null = null;
  #focus: { foot: number; from: number } | null = null;

  constructor(
    private readonly studio: Studio,
    private readonly playback: Playback,
    private readonly settings: Settings,
  ) {
    studio.events.on(["documents", "selection"], () => this.draw());
  }

  draw() {
    const { motion, scene, selection } = this.studio;
    if (!motion || !scene) return;
    const axis = Axis.of(motion);
    const names = scene.end_effectors.map((foot) => foot.name);
    const short = shortNames(names);
    const dark = isDark(this.settings.theme);
    const focused = this.#focused();
    // Many feet share the height of four.
    this.element.classList.toggle("dense", names.length > 6);
    replace(
      this.element,
      ...motion.stance.map((row, foot) => {
        const track = h("div", { class: "track foot-track", "data-foot": foot, title: "Drag over a stance to paint a swing" });
        track.style.setProperty("--foot", footColour(foot, dark));
        this.#stances(track, row, axis);
        swingsOf(row, axis.periodic).forEach((swing, index) => this.#swing(track, foot, row, swing, index, axis));
        track.addEventListener("pointerdown", (event) => this.#paint(event, foot, track, axis));
        const label = h("button", {
          type: "button",
          class: "foot-label",
          text: short[foot],
          title: `${readable(names[foot])}: add a swing at the time cursor (Enter)`,
          "aria-label": `${readable(names[foot])}: add a swing at the time cursor`,
          onclick: () => this.#add(foot),
        });
        label.style.setProperty("--foot", footColour(foot, dark));
        return h("div", { class: selection.endEffector === foot ? "line blamed" : "line" }, label, track);
      }),
    );
    if (focused) this.#refocus(focused.foot, focused.from);
  }

  #stances(track: HTMLElement, row: boolean[], axis: Axis) {
    for (let i = 0; i < row.length; i++) {
      if (!row[i] || (i > 0 && row[i - 1])) continue;
      let end = i;
      while (end < row.length && row[end]) end++;
      const bar = h("div", { class: "stance" });
      place(bar, axis.edge(i), axis.edge(end));
      track.append(bar);
    }
  }

  #swing(track: HTMLElement, foot: number, row: boolean[], swing: Swing, index: number, axis: Axis) {
    const end = swing.from + swing.length;
    const name = readable(this.studio.scene!.end_effectors[foot].name);
    const [lift, land] = [axis.time_s(swing.from), axis.time_s(end) % (axis.periodic ? axis.duration_s : Infinity)];
    const pieces = end > axis.samples ? [[swing.from, axis.samples], [0, end - axis.samples]] : [[swing.from, end]];
    pieces.forEach(([a, b], piece) => {
      const first = piece === 0;
      const bar = h("div", {
        class: "swing",
        role: first ? "slider" : null,
        tabindex: first ? "0" : null,
        "aria-label": first ? `${name}, swing ${index + 1}` : null,
        "aria-valuemin": first ? 0 : null,
        "aria-valuemax": first ? axis.samples - 1 : null,
        "aria-valuenow": first ? swing.from : null,
        "aria-valuetext": first ? `${format(lift, 2)} to ${format(land, 2)} seconds` : null,
        "aria-keyshortcuts": first ? "ArrowLeft ArrowRight Shift+ArrowRight Alt+ArrowRight Delete" : null,
        title: `${name} swings from ${format(lift, 2)} s to ${format(land, 2)} s. Drag to move, edges to resize, Delete to remove.`,
        "data-from": swing.from,
      });
      place(bar, axis.edge(a), axis.edge(b));
      if (first) bar.append(h("span", { class: "edge lift" }));
      if (piece === pieces.length - 1) bar.append(h("span", { class: "edge land" }));
      bar.addEventListener("pointerdown", (event) => this.#grab(event, foot, row, swing, track, axis));
      bar.addEventListener("keydown", (event) => this.#key(event, foot, swing, axis));
      bar.addEventListener("focus", () => (this.#focus = { foot, from: swing.from }));
      track.append(bar);
    });
  }

  #row(foot: number): boolean[] {
    return this.studio.motion!.stance[foot];
  }

  #set(foot: number, row: boolean[], gesture: string | null, drag: boolean) {
    const stance = this.studio.motion!.stance.map((old, index) => (index === foot ? row : old));
    this.studio.edit({ edit: "footfalls", stance }, { gesture, drag });
  }

  #add(foot: number) {
    const { motion } = this.studio;
    if (!motion) return;
    const axis = Axis.of(motion);
    const at = axis.sampleAt(axis.share(this.playback.within_s));
    const length = Math.max(3, Math.round(motion.samples * 0.2));
    const { row, swing } = painted(this.#row(foot), at, at + length - 1, axis.periodic);
    this.#set(foot, row, null, false);
    this.#refocus(foot, swing.from);
  }

  #paint(event: PointerEvent, foot: number, track: HTMLElement, axis: Axis) {
    if (event.button !== 0) return;
    const from = axis.sampleAt(shareOf(event, track));
    this.#begin(event, { foot, row: this.#row(foot), swing: null, part: "new", from }, track, axis);
  }

  #grab(event: PointerEvent, foot: number, row: boolean[], swing: Swing, track: HTMLElement, axis: Axis) {
    if (event.button !== 0) return;
    event.stopPropagation();
    const edge = (event.target as Element).classList;
    const part = edge.contains("lift") ? "lift" : edge.contains("land") ? "land" : "whole";
    (event.currentTarget as HTMLElement).focus({ preventScroll: true });
    this.#begin(event, { foot, row, swing, part, from: axis.sampleAt(shareOf(event, track)) }, track, axis);
  }

  #begin(event: PointerEvent, what: Omit<Drag, "gesture" | "moved">, track: HTMLElement, axis: Axis) {
    event.preventDefault();
    this.#drag = { ...what, gesture: this.studio.newGesture(), moved: false };
    // Bars are replaced during the drag, so the window listens instead of the bars.
    const { left, width } = track.getBoundingClientRect();
    let last = what.from;
    const move = (next: PointerEvent) => {
      const sample = axis.sampleAt((next.clientX - left) / width);
      if (sample === last) return;
      last = sample;
      this.#step(sample, axis, true);
    };
    const end = (next: PointerEvent) => {
      removeEventListener("pointermove", move);
      removeEventListener("pointerup", end);
      removeEventListener("pointercancel", end);
      const drag = this.#drag!;
      if (drag.moved) this.#step(last, axis, false);
      else if (drag.part === "new") this.playback.seek(axis.time_s(0) + ((next.clientX - left) / width) * axis.duration_s);
      this.#drag = null;
    };
    addEventListener("pointermove", move);
    addEventListener("pointerup", end);
    addEventListener("pointercancel", end);
  }

  #step(sample: number, axis: Axis, dragging: boolean) {
    const drag = this.#drag!;
    drag.moved = true;
    const by = sample - drag.from;
    const { row, swing } =
      drag.part === "new"
        ? painted(drag.row, drag.from, sample, axis.periodic)
        : drag.part === "whole"
          ? moved(drag.row, drag.swing!, by, axis.periodic)
          : resized(drag.row, drag.swing!, drag.part, by, axis.periodic);
    this.#focus = { foot: drag.foot, from: swing.from };
    this.#set(drag.foot, row, drag.gesture, dragging);
  }

  #key(event: KeyboardEvent, foot: number, swing: Swing, axis: Axis) {
    const row = this.#row(foot);
    if (event.key === "Delete" || event.key === "Backspace") {
      event.preventDefault();
      event.stopPropagation();
      this.#set(foot, without(row, swing), null, false);
      this.element.querySelectorAll<HTMLElement>(".foot-label")[foot]?.focus();
      return;
    }
    const by = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    if (!by || event.ctrlKey || event.metaKey) return;
    event.preventDefault();
    event.stopPropagation();
    const next = event.shiftKey
      ? resized(row, swing, "land", by, axis.periodic)
      : event.altKey
        ? resized(row, swing, "lift", by, axis.periodic)
        : moved(row, swing, by, axis.periodic);
    this.#set(foot, next.row, null, false);
    this.#refocus(foot, next.swing.from);
  }

  #focused(): { foot: number; from: number } | null {
    const within = document.activeElement?.classList.contains("swing") && this.element.contains(document.activeElement);
    return within ? this.#focus : null;
  }

  #refocus(foot: number, from: number) {
    const track = this.element.querySelectorAll<HTMLElement>(".foot-track")[foot];
    const bar = track?.querySelector<HTMLElement>(`.swing[data-from="${from}"][tabindex]`);
    bar?.focus({ preventScroll: true });
  }
}

function place(element: HTMLElement, from: number, to: number) {
  element.style.left = `${from * 100}%`;
  element.style.width = `${(to - from) * 100}%`;
}
