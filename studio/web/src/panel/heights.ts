// Height limits over a span of time: above, below, or between.

import type { Height } from "../contract.ts";
import type { Studio } from "../project/studio.ts";
import { h, replace } from "../ui/dom.ts";
import { iconButton, textButton } from "../ui/header.ts";
import { numberField } from "../ui/number.ts";
import { readable } from "./targets.ts";

const COMPONENTS = [
  { key: "from_s", label: "From", unit: "s", step: 0.05, empty: "start" },
  { key: "to_s", label: "To", unit: "s", step: 0.05, empty: "end" },
  { key: "above_m", label: "Above", unit: "m", step: 0.005, empty: "any" },
  { key: "below_m", label: "Below", unit: "m", step: 0.005, empty: "any" },
] as const;

export function heightsSection(studio: Studio): HTMLElement {
  const list = h("ul", { class: "cards" });
  const add = textButton("Add height limit", "plus", () => {
    const { motion, shown } = studio;
    if (!motion) return;
    const { bodies } = shown?.frames.header.columns ?? { bodies: 0 };
    const now = shown ? shown.frames.row(0)[bodies + 2] : 0.3;
    const [from_s, to_s] = [motion.duration_s * 0.4, motion.duration_s * 0.6].map((time) => Math.round(time * 100) / 100);
    studio.edit({ edit: "height", index: null, height: { of: "body", from_s, to_s, below_m: Math.round(now * 1000) / 1000 } });
  });
  let built = -1;
  let updates: (() => void)[] = [];
  studio.events.on("documents", () => {
    const heights = studio.motion?.heights ?? [];
    if (built !== heights.length) {
      built = heights.length;
      updates = [];
      replace(list, ...heights.map((_, index) => card(studio, index, updates)));
    }
    for (const one of updates) one();
  });
  return h("section", {}, h("h3", { text: "Height limits" }), list, add);
}

function card(studio: Studio, index: number, updates: (() => void)[]): HTMLElement {
  const height = () => studio.motion?.heights[index];
  const set = (change: Partial<Height>, how = { gesture: null as string | null, drag: false }) => {
    const old = height();
    if (!old) return;
    const next = Object.fromEntries(Object.entries({ ...old, ...change }).filter(([, value]) => value !== null && value !== undefined));
    studio.edit({ edit: "height", index, height: next as Height }, how);
  };
  const of = h(
    "select",
    { "aria-label": `Subject of height limit ${index + 1}`, onchange: () => set({ of: of.value }) },
    ...["body", "com"].map((name) => h("option", { value: name, text: readable(name) })),
  );
  updates.push(() => (of.value = height()?.of ?? "body"));
  const fields = COMPONENTS.map((one) => {
    const field = numberField({
      label: one.label,
      unit: one.unit,
      step: one.step,
      digits: 3,
      min: 0,
      empty: one.empty,
      newGesture: () => studio.newGesture(),
      changed: (value, how) => set({ [one.key]: value }, how),
    });
    updates.push(() => field.update(height()?.[one.key] ?? null));
    return field.element;
  });
  return h(
    "li",
    { class: "card" },
    h("div", { class: "card-head" }, of, h("span", { class: "gap" }), iconButton("remove", `Remove height limit ${index + 1}`, () => studio.edit({ edit: "height", index, height: null }))),
    h("div", { class: "fields" }, ...fields),
  );
}
