// Panel of the motion: goal, duration, samples, swing height and gait; targets and height limits below.

import type { Edit } from "../contract.ts";
import type { Playback } from "../project/playback.ts";
import type { Studio } from "../project/studio.ts";
import { h, replace } from "../ui/dom.ts";
import { type NumberField, numberField } from "../ui/number.ts";
import { heightsSection } from "./heights.ts";
import { targetsSection } from "./targets.ts";

type Key = { table: string[]; key: string };

export function motionPanel(studio: Studio, playback: Playback): HTMLElement {
  const fields: (() => void)[] = [];
  const number = (label: string, at: Key, read: () => number | null, options: { unit: string; step: number; digits: number; min?: number; max?: number; empty?: string; integer?: boolean; hint?: string }) => {
    const field: NumberField = numberField({
      label,
      ...options,
      newGesture: () => studio.newGesture(),
      changed: (value, how) => studio.edit({ edit: "number", ...at, value } as Edit, how),
    });
    fields.push(() => field.update(read()));
    return field.element;
  };
  const goal = (key: "forward_m" | "left_m" | "turn_rad"): [Key, () => number | null] => [
    { table: ["goal"], key },
    () => studio.motion?.goal[key] ?? null,
  ];
  const top = (key: "duration_s" | "samples" | "swing_height_m"): [Key, () => number | null] => [
    { table: [], key },
    () => studio.motion?.[key] ?? null,
  ];

  const ends = h("span", { class: "muted" });
  const gait = h("select", { id: "gait", "aria-label": "Gait" });
  const duty = numberField({
    label: "Duty",
    unit: "",
    step: 0.01,
    digits: 2,
    min: 0.3,
    max: 0.95,
    hint: "Fraction of the cycle in which each foot is on the ground",
    newGesture: () => studio.newGesture(),
    changed: (value, how) => gait.value !== "own" && studio.edit({ edit: "gait", gait: gait.value, duty: value }, how),
  });
  gait.addEventListener("change", () => {
    if (gait.value === "own") return;
    const share = dutyOf(studio);
    studio.edit({ edit: "gait", gait: gait.value, duty: gait.value === "stance" ? null : share ?? 0.8 });
  });
  const note = h("p", { class: "note", hidden: true });

  const panel = h(
    "div",
    {},
    h("h3", {}, "Goal", ends),
    h(
      "div",
      { class: "fields" },
      number("Forward", ...goal("forward_m"), { unit: "m", step: 0.01, digits: 3, min: -20, max: 20, empty: "free" }),
      number("Left", ...goal("left_m"), { unit: "m", step: 0.01, digits: 3, min: -20, max: 20, empty: "free" }),
      number("Turn", ...goal("turn_rad"), { unit: "rad", step: 0.01, digits: 3, empty: "free", hint: "Positive to the left" }),
    ),
    h("h3", { text: "Time and feet" }),
    h(
      "div",
      { class: "fields" },
      number("Duration", ...top("duration_s"), { unit: "s", step: 0.05, digits: 3, min: 0.1, max: 60 }),
      number("Samples", ...top("samples"), { unit: "", step: 1, digits: 0, min: 6, max: 400, integer: true, hint: "Number of points of the plan; more points resolve more detail and take longer" }),
      number("Swing height", ...top("swing_height_m"), { unit: "m", step: 0.002, digits: 3, min: 0.001, max: 1 }),
      h("div", { class: "field" }, h("label", { class: "field-label plain", for: "gait", text: "Gait" }), h("span", { class: "field-box" }, gait)),
      duty.element,
    ),
    note,
    targetsSection(studio, playback),
    heightsSection(studio),
  );

  studio.events.on("documents", () => {
    const { motion } = studio;
    if (!motion) return;
    for (const update of fields) update();
    ends.textContent = motion.ends === "periodic" ? "in each cycle; the motion repeats" : "from rest to rest";
    const names = motion.gaits.length > 0 ? motion.gaits : ["stance"];
    const known = gaitOf(studio);
    replace(
      gait,
      ...names.map((name) => h("option", { value: name, text: name === "stance" ? "all stand" : name, selected: name === known })),
      known === null ? h("option", { value: "own", text: "as drawn", selected: true }) : null,
    );
    duty.update(dutyOf(studio));
    duty.element.hidden = known === null || known === "stance";
    note.hidden = !motion.needs_feedback;
    note.textContent = motion.needs_feedback ? `Needs feedback: ${motion.needs_feedback}` : "";
  });
  return panel;
}

/** Gait of the motion file, as the engine and users write it. */
function gaitOf(studio: Studio): string | null {
  const text = studio.documents.text(studio.documents.motionPath) ?? "";
  const gait = /^\s*gait\s*=\s*"(\w+)"/m.exec(text)?.[1];
  if (gait) return gait;
  return studio.motion?.stance.every((row) => row.every((stance) => stance)) ? "stance" : null;
}

function dutyOf(studio: Studio): number | null {
  const text = studio.documents.text(studio.documents.motionPath) ?? "";
  const written = /^\s*duty\s*=\s*([\d.]+)/m.exec(text)?.[1];
  return written ? Number(written) : null;
}
