// Targets and height limits on the timeline: a diamond at its time, a bar over its span; both can be dragged.

import type { Height, Target } from "../contract.ts";
import { readable } from "../panel/targets.ts";
import type { Playback } from "../project/playback.ts";
import type { Studio } from "../project/studio.ts";
import { format, h, replace } from "../ui/dom.ts";
import { Axis } from "./axis.ts";

export function marksLine(studio: Studio, playback: Playback): HTMLElement {
  const track = h("div", { class: "track marks-track" });
  const element = h("div", { class: "line marks-line", hidden: true }, h("span", { class: "line-label", text: "Targets" }), track);

  const draw = () => {
    const { motion } = studio;
    if (!motion) return;
    const axis = Axis.of(motion);
    element.hidden = motion.targets.length + motion.heights.length === 0;
    const focused = [...track.children].indexOf(document.activeElement!);
    replace(track, ...motion.heights.map((height, index) => heightBar(height, index, axis)), ...motion.targets.map((target, index) => diamond(target, index, axis)));
    if (focused >= 0) (track.children[focused] as HTMLElement | undefined)?.focus();
  };

  const drag = (event: PointerEvent, step: (time_s: number, how: { gesture: string; drag: boolean }) => void) => {
    if (event.button !== 0) return;
    event.preventDefault();
    const { left, width } = track.getBoundingClientRect();
    const gesture = studio.newGesture();
    const duration_s = studio.motion!.duration_s;
    const time = (next: PointerEvent) => Math.round(Math.max(0, Math.min(1, (next.clientX - left) / width)) * duration_s * 100) / 100;
    let last = time(event);
    let moved = false;
    const move = (next: PointerEvent) => {
      if (time(next) === last) return;
      moved = true;
      last = time(next);
      step(last, { gesture, drag: true });
    };
    const end = () => {
      removeEventListener("pointermove", move);
      removeEventListener("pointerup", end);
      removeEventListener("pointercancel", end);
      if (moved) step(last, { gesture, drag: false });
    };
    addEventListener("pointermove", move);
    addEventListener("pointerup", end);
    addEventListener("pointercancel", end);
  };

  const diamond = (target: Target, index: number, axis: Axis): HTMLElement => {
    const words = `Target ${index + 1}, ${readable(target.of)}`;
    const set = (at_s: number, how = { gesture: null as string | null, drag: false }) =>
      studio.edit({ edit: "target", index, target: { ...studio.motion!.targets[index], at_s } }, how);
    const mark = h("div", {
      class: studio.selection.target === index ? "diamond selected" : "diamond",
      role: "slider",
      tabindex: "0",
      "aria-label": `${words}: time`,
      "aria-valuemin": 0,
      "aria-valuemax": axis.duration_s,
      "aria-valuenow": target.at_s,
      "aria-valuetext": `${format(target.at_s, 2)} seconds`,
      title: `${words} at ${format(target.at_s, 2)} s. Drag to change its time.`,
      onpointerdown: (event: PointerEvent) => {
        studio.selection.selectTarget(index);
        playback.seek(target.at_s);
        drag(event, (at_s, how) => {
          set(at_s, how);
          playback.seek(at_s);
        });
      },
      onkeydown: (event: KeyboardEvent) => {
        const by = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
        if (event.key === "Delete") studio.edit({ edit: "target", index, target: null });
        else if (by) set(Math.round(Math.max(0, Math.min(axis.duration_s, target.at_s + (by * axis.duration_s) / axis.samples)) * 1000) / 1000);
        else return;
        event.preventDefault();
        event.stopPropagation();
      },
    });
    mark.style.left = `${axis.share(target.at_s) * 100}%`;
    return mark;
  };

  const heightBar = (height: Height, index: number, axis: Axis): HTMLElement => {
    const [from, to] = [height.from_s ?? 0, height.to_s ?? axis.duration_s];
    const limits = [
      height.above_m !== null && height.above_m !== undefined ? `above ${format(height.above_m, 3)} m` : "",
      height.below_m !== null && height.below_m !== undefined ? `below ${format(height.below_m, 3)} m` : "",
    ];
    const words = `${readable(height.of)} ${limits.filter(Boolean).join(" and ")}`;
    const bar = h(
      "div",
      {
        class: "height-bar",
        title: `${words}, ${format(from, 2)} to ${format(to, 2)} s. Drag to move.`,
        onpointerdown: (event: PointerEvent) => {
          const { left, width } = track.getBoundingClientRect();
          const grabbed = ((event.clientX - left) / width) * axis.duration_s;
          drag(event, (time_s, how) => {
            const by = Math.max(-from, Math.min(axis.duration_s - to, time_s - grabbed));
            const moved = { ...studio.motion!.heights[index], from_s: Math.round((from + by) * 100) / 100, to_s: Math.round((to + by) * 100) / 100 };
            studio.edit({ edit: "height", index, height: moved }, how);
          });
        },
      },
      h("span", { text: words }),
    );
    bar.style.left = `${axis.share(from) * 100}%`;
    bar.style.width = `${(axis.share(to) - axis.share(from)) * 100}%`;
    return bar;
  };

  studio.events.on(["documents", "selection"], draw);
  return element;
}
