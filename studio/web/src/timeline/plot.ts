// A plot under the timeline: one quantity with all its series or one of them, and limits. A click moves the time cursor.

import type { Playback } from "../project/playback.ts";
import { isDark, type Settings, save } from "../project/settings.ts";
import type { Studio } from "../project/studio.ts";
import { footColour } from "../scene/palette.ts";
import { format, h, replace, s } from "../ui/dom.ts";
import { readable } from "../panel/targets.ts";
import { ticks } from "./axis.ts";
import { QUANTITIES, type Quantity, type Series } from "./quantities.ts";

const [WIDTH, HEIGHT] = [1000, 100];

export class Plot {
  readonly element: HTMLElement;
  readonly track = h("div", { class: "track plot-track" });
  #quantity: Quantity;
  #series: Series[] = [];
  #only: string | null = null;
  #choice = h("select", { "aria-label": "Plotted quantity" });
  #subject = h("select", { "aria-label": "Which" });
  #values = h("div", { class: "plot-values" });
  #scale = h("div", { class: "plot-scale", "aria-hidden": "true" });

  constructor(
    private readonly studio: Studio,
    private readonly playback: Playback,
    private readonly settings: Settings,
  ) {
    this.#quantity = QUANTITIES.find((one) => one.id === settings.quantity) ?? QUANTITIES[0];
    replace(this.#choice, ...QUANTITIES.map((one) => h("option", { value: one.id, text: one.title, selected: one === this.#quantity })));
    this.#choice.addEventListener("change", () => {
      this.#quantity = QUANTITIES.find((one) => one.id === this.#choice.value)!;
      settings.quantity = this.#quantity.id;
      save(settings);
      this.#only = null;
      this.compute();
    });
    this.#subject.addEventListener("change", () => {
      this.#only = this.#subject.value || null;
      this.draw();
    });
    this.element = h(
      "div",
      { class: "plot" },
      h("div", { class: "plot-head" }, this.#choice, this.#subject, this.#values),
      h("div", { class: "line plot-line" }, this.#scale, this.track),
    );
    studio.events.on("plan", () => this.compute());
    studio.events.on("selection", () => this.#select());
    playback.onChange(() => this.#now());
  }

  compute() {
    const { shown } = this.studio;
    if (!shown) return;
    this.#series = this.#quantity.series(shown.planned.scene, shown.frames);
    const share = this.#shares(this.#series) ? ", as a fraction of the limit" : this.#quantity.unit ? `, ${this.#quantity.unit}` : "";
    const all = this.#series.length === 0 ? "none on this robot" : `all ${this.#series.length}${share}`;
    if (!this.#series.some((one) => one.name === this.#only)) this.#only = null;
    replace(this.#subject, h("option", { value: "", text: all }), ...this.#series.map((one) => h("option", { value: one.name, text: readable(one.name), selected: one.name === this.#only })));
    this.draw();
  }

  draw() {
    const { shown } = this.studio;
    if (!shown) return;
    const { header } = shown.frames;
    const list = this.#only ? this.#series.filter((one) => one.name === this.#only) : this.#series;
    const share = this.#shares(list);
    const [low, high] = this.#range(list, share);
    const y = (value: number) => HEIGHT - ((value - low) / (high - low)) * HEIGHT;
    const x = (index: number) => (Math.min(index / header.rate_hz / header.duration_s, 1) * WIDTH).toFixed(2);
    const svg = s("svg", { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, preserveAspectRatio: "none", role: "img", "aria-label": this.#summary(list) });
    const marks = ticks(low, high, 4);
    for (const mark of marks) svg.append(s("line", { class: "plot-grid", x1: 0, x2: WIDTH, y1: y(mark), y2: y(mark) }));
    for (const limit of this.#limits(list, share)) {
      if (limit < low || limit > high) continue;
      svg.append(s("line", { class: "plot-limit", x1: 0, x2: WIDTH, y1: y(limit), y2: y(limit) }));
    }
    const dark = isDark(this.settings.theme);
    list.forEach((one, index) => {
      const scaled = share ? scaleOf(one) : 1;
      let path = "";
      for (let k = 0; k < one.values.length; k++) path += `${k ? "L" : "M"}${x(k)} ${y(one.values[k] / scaled).toFixed(2)}`;
      const colour = footColour(one.endEffector ?? this.#limbOf(one, index), dark);
      const line = s("path", { class: "plot-series", d: path, "data-name": one.name }, s("title", { text: readable(one.name) }));
      line.style.stroke = colour;
      svg.append(line);
    });
    replace(this.track, svg);
    replace(
      this.#scale,
      ...marks.map((mark) => {
        const label = h("span", { text: share ? `${format(mark * 100, 0)} %` : format(mark, decimals(marks)) });
        label.style.top = `${y(mark)}%`;
        return label;
      }),
    );
    this.#select();
    this.#now();
  }

  /** Several series with different limits, each symmetric about 0, are drawn relative to their limits. */
  #shares(list: Series[]): boolean {
    if (list.length < 2) return false;
    const limits = new Set(list.map((one) => `${one.low} ${one.high}`));
    return limits.size > 1 && list.every((one) => one.high !== null && one.low === -one.high);
  }

  #limits(list: Series[], share: boolean): number[] {
    if (share) return [-1, 1];
    const low = new Set(list.map((one) => one.low));
    const high = new Set(list.map((one) => one.high));
    return [low, high].flatMap((set) => (set.size === 1 ? [...set].filter((limit) => limit !== null) : []));
  }

  #range(list: Series[], share: boolean): [number, number] {
    let [low, high] = [Infinity, -Infinity];
    for (const one of list) {
      const scale = share ? scaleOf(one) : 1;
      for (const value of one.values) {
        low = Math.min(low, value / scale);
        high = Math.max(high, value / scale);
      }
    }
    if (low > high) return [0, 1];
    // Limits are shown if values come near, because distant limits would flatten the curves.
    for (const limit of this.#limits(list, share)) {
      const span = Math.max(high - low, Math.abs(limit) * 0.25, 1e-6);
      if (share || (limit >= low - span && limit <= high + span)) [low, high] = [Math.min(low, limit), Math.max(high, limit)];
    }
    const room = Math.max((high - low) * 0.06, 1e-4);
    return [low - room, high + room];
  }

  #summary(list: Series[]): string {
    const parts = list.map((one) => {
      let worst = 0;
      for (const value of one.values) if (Math.abs(value) > Math.abs(worst)) worst = value;
      return `${readable(one.name)} up to ${format(worst, this.#quantity.digits)} ${this.#quantity.unit}`;
    });
    return `${this.#quantity.title}: ${parts.join(", ")}`;
  }

  /** Joints have the colour of their limb's end effector, so that a leg has one colour everywhere. */
  #limbOf(one: Series, index: number): number {
    const feet = this.studio.shown!.planned.scene.end_effectors;
    const limb = feet.findIndex((foot) => one.name.startsWith(`${foot.name}_`));
    return limb >= 0 ? limb : index;
  }

  #select() {
    const { joint, endEffector } = this.studio.selection;
    const names = new Set(this.#series.filter((one) => (joint !== null && one.joint === joint) || (endEffector !== null && one.endEffector === endEffector)).map((one) => one.name));
    for (const path of this.track.querySelectorAll<SVGElement>(".plot-series")) {
      path.classList.toggle("faded", names.size > 0 && !names.has(path.dataset.name!));
    }
  }

  /** Values at the time cursor: the value of a single series; of several, the value nearest to its limit. */
  #now() {
    const { shown } = this.studio;
    if (!shown || this.#series.length === 0) return replace(this.#values);
    const index = Math.min(shown.frames.header.count - 1, Math.round(this.playback.within_s * shown.frames.header.rate_hz));
    const list = this.#only ? this.#series.filter((one) => one.name === this.#only) : this.#series;
    const load = (one: Series) => Math.abs(one.values[index]) / scaleOf(one);
    const one = list.reduce((best, next) => (load(next) > load(best) ? next : best), list[0]);
    const value = `${format(one.values[index], this.#quantity.digits)} ${this.#quantity.unit}`.trim();
    const limit = one.high !== null && one.high > 0 ? ` of ${format(one.high, this.#quantity.digits)} ${this.#quantity.unit}`.trimEnd() : "";
    this.#values.textContent = this.#only ? `${value}${limit}` : `largest now: ${readable(one.name)}, ${value}${limit}`;
  }
}

function scaleOf(one: Series): number {
  return Math.max(Math.abs(one.high ?? 0), Math.abs(one.low ?? 0)) || 1;
}

function decimals(marks: number[]): number {
  const step = marks.length > 1 ? Math.abs(marks[1] - marks[0]) : 1;
  return Math.max(0, Math.min(4, Math.ceil(-Math.log10(step) - 1e-9)));
}
