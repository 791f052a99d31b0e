// The tracks under one time cursor: ruler, footfalls, marks, plot.

import type { Playback } from "../project/playback.ts";
import { type Settings, save } from "../project/settings.ts";
import type { Studio } from "../project/studio.ts";
import { format, h, replace } from "../ui/dom.ts";
import { shareOf, ticks } from "./axis.ts";
import { FootfallChart } from "./chart.ts";
import { marksLine } from "./marks.ts";
import { Plot } from "./plot.ts";

export function buildTimeline(host: HTMLElement, studio: Studio, playback: Playback, settings: Settings): { restyle(): void } {
  const ruler = h("div", {
    class: "track ruler",
    role: "slider",
    tabindex: "0",
    "aria-label": "Time",
    "aria-valuemin": 0,
  });
  const cursor = h("div", { class: "cursor", "aria-hidden": "true" });
  const span = h("div", { class: "blame-span", "aria-hidden": "true", hidden: true });
  const over = h("div", { class: "over" }, span, cursor);
  const chart = new FootfallChart(studio, playback, settings);
  const plot = new Plot(studio, playback, settings);
  plot.element.style.setProperty("--plot-height", `${settings.plotHeight}px`);
  const stack = h("div", { class: "stack" }, h("div", { class: "line" }, h("span", { class: "line-label", text: "s" }), ruler), chart.element, marksLine(studio, playback), plot.element, over);
  replace(host, stack);
  host.before(grip(plot.element, settings));

  scrub(ruler, playback);
  scrub(plot.track, playback);
  ruler.addEventListener("keydown", (event) => {
    const by = { ArrowLeft: -1, ArrowRight: 1, PageUp: 10, PageDown: -10 }[event.key];
    if (!by) return;
    event.preventDefault();
    event.stopPropagation();
    playback.step(by);
  });

  const duration = () => studio.shown?.frames.header.duration_s ?? studio.motion?.duration_s ?? 0;
  const drawRuler = () => {
    const end = duration();
    ruler.setAttribute("aria-valuemax", String(end));
    const marks = ticks(0, end, 10);
    const digits = marks.length > 1 && marks[1] < 0.1 ? 2 : marks.length > 1 && marks[1] < 1 ? 1 : 0;
    replace(
      ruler,
      ...marks.map((mark) => {
        const label = h("span", { class: mark > 0.97 * end ? "tick end" : "tick", text: format(mark, digits) });
        label.style.left = `${(mark / end) * 100}%`;
        return label;
      }),
    );
  };
  const move = () => {
    const end = duration();
    cursor.style.left = `${end > 0 ? (playback.within_s / end) * 100 : 0}%`;
    ruler.setAttribute("aria-valuenow", playback.within_s.toFixed(3));
    ruler.setAttribute("aria-valuetext", `${format(playback.within_s, 2)} of ${format(end, 2)} seconds`);
  };
  studio.events.on("plan", () => {
    drawRuler();
    move();
  });
  studio.events.on(["selection", "plan"], () => {
    const blamed = studio.selection.span;
    // Targets that act all the time have no position on the timeline.
    span.hidden = !blamed || duration() <= 0 || blamed.to_s - blamed.from_s > 0.95 * duration();
    if (!blamed) return;
    span.style.left = `${(blamed.from_s / duration()) * 100}%`;
    span.style.width = `max(3px, ${((blamed.to_s - blamed.from_s) / duration()) * 100}%)`;
  });
  playback.onChange(move);
  return {
    restyle() {
      chart.draw();
      plot.draw();
    },
  };
}

/** A press or a drag on a track moves the time cursor. */
function scrub(track: HTMLElement, playback: Playback) {
  let held = false;
  const seek = (event: PointerEvent) => playback.seek(Math.max(0, Math.min(1, shareOf(event, track))) * playback.duration_s);
  track.addEventListener("pointerdown", (event) => {
    if (event.button !== 0) return;
    held = true;
    playback.pause();
    track.setPointerCapture(event.pointerId);
    seek(event);
  });
  track.addEventListener("pointermove", (event) => held && seek(event));
  for (const end of ["pointerup", "pointercancel"] as const) track.addEventListener(end, () => (held = false));
}

/** The edge between scene and timeline: drag or arrow keys change the height of the plot. */
function grip(plot: HTMLElement, settings: Settings): HTMLElement {
  const set = (height: number) => {
    settings.plotHeight = Math.round(Math.max(60, Math.min(500, height)));
    plot.style.setProperty("--plot-height", `${settings.plotHeight}px`);
    edge.setAttribute("aria-valuenow", String(settings.plotHeight));
    save(settings);
  };
  const edge = h("div", {
    class: "grip",
    role: "separator",
    tabindex: "0",
    "aria-orientation": "horizontal",
    "aria-label": "Height of the plot",
    "aria-valuemin": 60,
    "aria-valuemax": 500,
    "aria-valuenow": settings.plotHeight,
    title: "Drag to change the height of the plot",
  });
  let from: { y: number; height: number } | null = null;
  edge.addEventListener("pointerdown", (event) => {
    event.preventDefault();
    edge.setPointerCapture(event.pointerId);
    from = { y: event.clientY, height: settings.plotHeight };
  });
  edge.addEventListener("pointermove", (event) => from && set(from.height + from.y - event.clientY));
  edge.addEventListener("pointerup", () => (from = null));
  edge.addEventListener("pointercancel", () => (from = null));
  edge.addEventListener("keydown", (event) => {
    const by = { ArrowUp: 20, ArrowDown: -20 }[event.key];
    if (!by) return;
    event.preventDefault();
    set(settings.plotHeight + by);
  });
  return edge;
}
