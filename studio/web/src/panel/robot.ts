// Panel of the robot: parameters as sliders, which the motion follows, and tables of joints and end effectors.

import type { Studio } from "../project/studio.ts";
import { format, h, replace } from "../ui/dom.ts";
import { numberField } from "../ui/number.ts";
import { type Slopes, slopes } from "./slopes.ts";

export function robotPanel(studio: Studio): { element: HTMLElement; shown(): void } {
  const element = h("div", {});
  const effects = slopes(studio, () => !!element.hidden);
  const summary = h("p", { class: "muted" });
  const sliders = h("div", { class: "sliders" });
  const tables = h("div", {});
  let built = "";
  let shown = "";
  let updates: (() => void)[] = [];
  studio.events.on("documents", () => {
    const { scene } = studio;
    if (!scene) return;
    summary.textContent = `${scene.name}: ${scene.joints.length} joints, ${scene.end_effectors.length} end effectors, ${format(scene.mass_kg, 2)} kg`;
    // Ranges are those of the opened robot, because they must not change during a drag.
    const key = JSON.stringify([scene.name, scene.parameters.map((one) => one.name), scene.joints.length]);
    if (key !== built) {
      built = key;
      updates = [];
      replace(sliders, ...scene.parameters.map((one) => slider(studio, one.name, updates, effects)));
    }
    const facts = JSON.stringify([scene.joints, scene.end_effectors]);
    if (facts !== shown) {
      shown = facts;
      const open = [...tables.querySelectorAll("details")].map((one) => one.open);
      replace(tables, jointTable(studio), feetTable(studio));
      tables.querySelectorAll("details").forEach((one, index) => (one.open = open[index] ?? false));
    }
    for (const one of updates) one();
  });
  replace(element, summary, h("h3", { text: "Parameters" }), effects.element, sliders, tables);
  return { element, shown: effects.shown };
}

function slider(studio: Studio, name: string, updates: (() => void)[], effects: Slopes): HTMLElement {
  const parameter = () => studio.scene?.parameters.find((one) => one.name === name);
  const { label, unit, min, max, step } = parameter()!;
  const path = () => studio.documents.robotPath;
  const digits = Math.max(0, Math.min(5, Math.ceil(-Math.log10(step))));
  const change = (value: number, how: { gesture: string | null; drag: boolean }) => {
    predict(studio, name, value);
    studio.edit({ edit: "parameter", name, value }, { path: path(), ...how });
  };
  const range = h("input", { type: "range", min, max, step, "aria-label": `${label}, ${unit}` });
  let gesture: string | null = null;
  range.addEventListener("input", () => {
    gesture ??= studio.newGesture();
    change(Number(range.value), { gesture, drag: true });
  });
  range.addEventListener("change", () => {
    change(Number(range.value), { gesture, drag: false });
    gesture = null;
  });
  const number = numberField({
    label,
    unit,
    step,
    digits,
    min,
    max,
    newGesture: () => studio.newGesture(),
    changed: (value, how) => value !== null && change(value, how),
  });
  updates.push(() => {
    const now = parameter();
    if (!now) return;
    number.update(now.value);
    range.min = String(Math.min(min, now.value));
    range.max = String(Math.max(max, now.value));
    if (!gesture) range.value = String(now.value);
    range.setAttribute("aria-valuetext", `${format(now.value, digits)} ${unit}`);
  });
  const effect = effects.of(name, unit);
  range.setAttribute("aria-describedby", effect.id);
  return h("div", { class: "slider" }, number.element, range, effect);
}

/** A parameter belongs to the robot file; its value in the scene changes at once. */
function predict(studio: Studio, name: string, value: number) {
  if (!studio.scene) return;
  const parameters = studio.scene.parameters.map((one) => (one.name === name ? { ...one, value } : one));
  studio.scene = { ...studio.scene, parameters };
}

function jointTable(studio: Studio): HTMLElement {
  const rows = studio.scene!.joints.map((joint) =>
    row(joint.name, `${format(joint.position_min_rad, 2)} … ${format(joint.position_max_rad, 2)}`, format(joint.speed_max_rad_s, 2), format(joint.torque_max_nm, 2)),
  );
  return table("Joints", ["joint", "angle, rad", "speed, rad/s", "torque, N·m"], rows);
}

function feetTable(studio: Studio): HTMLElement {
  const rows = studio.scene!.end_effectors.map((foot) =>
    row(foot.name, foot.contact.replaceAll("_", " "), format(foot.radius_m, 3), format(foot.friction_coefficient, 2)),
  );
  return table("End effectors", ["end effector", "kind", "radius, m", "friction"], rows);
}

function table(title: string, heads: string[], rows: HTMLElement[]): HTMLElement {
  return h(
    "details",
    {},
    h("summary", { text: title }),
    h("table", {}, h("thead", {}, h("tr", {}, ...heads.map((text) => h("th", { scope: "col", text })))), h("tbody", {}, ...rows)),
  );
}

function row(name: string, ...cells: string[]): HTMLElement {
  return h("tr", {}, h("th", { scope: "row", text: name }), ...cells.map((text) => h("td", { text })));
}
