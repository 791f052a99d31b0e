// List of targets: subject, time, position. Free coordinates are empty.

import type { Target } from "../contract.ts";
import type { Playback } from "../project/playback.ts";
import type { Studio } from "../project/studio.ts";
import { h, replace } from "../ui/dom.ts";
import { iconButton, textButton } from "../ui/header.ts";
import { type NumberField, numberField } from "../ui/number.ts";

type Component = Exclude<keyof Target, "of">;

const COMPONENTS: { key: Component; label: string; unit: string; step: number; bodyOnly?: boolean; rare?: boolean }[] = [
  { key: "at_s", label: "Time", unit: "s", step: 0.05 },
  { key: "forward_m", label: "Forward", unit: "m", step: 0.01 },
  { key: "left_m", label: "Left", unit: "m", step: 0.01 },
  { key: "up_m", label: "Up", unit: "m", step: 0.01 },
  { key: "heading_rad", label: "Heading", unit: "rad", step: 0.01, bodyOnly: true },
  { key: "speed_forward_m_s", label: "Speed fwd.", unit: "m/s", step: 0.01, rare: true },
  { key: "speed_left_m_s", label: "Speed left", unit: "m/s", step: 0.01, rare: true },
  { key: "speed_up_m_s", label: "Speed up", unit: "m/s", step: 0.01, rare: true },
];

export function targetsSection(studio: Studio, playback: Playback): HTMLElement {
  const list = h("ul", { class: "cards" });
  const add = textButton("Add target", "plus", () => addTarget(studio, playback));
  let built = "";
  let updates: (() => void)[] = [];

  const update = () => {
    const targets = studio.motion?.targets ?? [];
    const names = ["com", "body", ...(studio.scene?.end_effectors ?? []).map((foot) => foot.name)];
    const key = JSON.stringify([names, targets.map((target) => [target.of, ...COMPONENTS.map((one) => one.rare && has(target, one.key))])]);
    if (key !== built) {
      built = key;
      updates = [];
      replace(list, ...targets.map((_, index) => card(studio, playback, index, names, updates)));
    }
    for (const one of updates) one();
    [...list.children].forEach((child, index) => child.classList.toggle("selected", index === studio.selection.target));
  };
  studio.events.on(["documents", "selection"], update);
  return h("section", {}, h("h3", { text: "Targets" }), list, add);
}

function addTarget(studio: Studio, playback: Playback) {
  const { motion, shown } = studio;
  if (!motion) return;
  const at_s = Math.round(Math.min(playback.within_s || motion.duration_s / 2, motion.duration_s) * 100) / 100;
  const target: Target = { of: "body", at_s };
  if (shown) {
    const row = shown.frames.at(at_s);
    const { bodies } = shown.frames.header.columns;
    target.forward_m = Math.round(row[bodies] * 1000) / 1000;
    target.left_m = Math.round(row[bodies + 1] * 1000) / 1000;
  } else target.left_m = 0;
  studio.edit({ edit: "target", index: null, target });
  studio.selection.selectTarget(motion.targets.length);
}

function card(studio: Studio, playback: Playback, index: number, names: string[], updates: (() => void)[]): HTMLElement {
  const target = () => studio.motion?.targets[index];
  const set = (change: Partial<Target>, how: { gesture: string | null; drag: boolean } = { gesture: null, drag: false }) => {
    const old = target();
    if (!old) return;
    const next = Object.fromEntries(Object.entries({ ...old, ...change }).filter(([, value]) => value !== null && value !== undefined));
    studio.edit({ edit: "target", index, target: next as Target }, how);
  };
  const of = h(
    "select",
    { "aria-label": `Subject of target ${index + 1}`, onchange: () => set({ of: of.value, ...(of.value !== "body" ? { heading_rad: undefined } : {}) }) },
    ...names.map((name) => h("option", { value: name, text: readable(name) })),
  );
  const fields: HTMLElement[] = [];
  for (const one of COMPONENTS) {
    const now = target();
    if (!now || (one.bodyOnly && now.of !== "body") || (one.rare && !has(now, one.key))) continue;
    const field: NumberField = numberField({
      label: one.label,
      unit: one.unit,
      step: one.step,
      digits: 3,
      min: one.key === "at_s" || one.key === "up_m" ? 0 : -20,
      max: one.key === "at_s" ? studio.motion?.duration_s : 20,
      empty: one.key === "at_s" ? undefined : "free",
      newGesture: () => studio.newGesture(),
      changed: (value, how) => set({ [one.key]: value }, how),
    });
    updates.push(() => field.update(target()?.[one.key] ?? null));
    fields.push(field.element);
  }
  updates.push(() => {
    const now = target();
    if (now && of.value !== now.of) of.value = now.of;
  });
  const select = () => {
    studio.selection.selectTarget(index);
    const now = target();
    if (now) playback.seek(now.at_s);
  };
  return h(
    "li",
    { class: "card" },
    h("div", { class: "card-head" }, of, h("button", { type: "button", class: "link", text: "show", onclick: select }), iconButton("remove", `Remove target ${index + 1}`, () => studio.edit({ edit: "target", index, target: null }))),
    h("div", { class: "fields" }, ...fields),
  );
}

function has(target: Target, key: Component): boolean {
  return target[key] !== null && target[key] !== undefined;
}

export function readable(name: string): string {
  return name === "com" ? "centre of mass" : name.replaceAll("_", " ");
}
