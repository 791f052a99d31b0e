// Effect of each parameter of the robot, beside its slider: change of a quantity of the plan with a small step.

import type { QuantitySlopes } from "../contract.ts";
import { Cancelled } from "../engine/engine.ts";
import type { Studio } from "../project/studio.ts";
import { format, h, replace } from "../ui/dom.ts";

const FIRST = "peak_joint_torque";
/** Names of quantities that need an explanation. */
const MEANINGS: Record<string, string> = {
  peak_joint_torque: "smooth maximum (8-norm) of the joint torques",
  joint_torque: "joint torque (r.m.s. of all)",
  peak_joint_speed: "smooth maximum (8-norm) of the joint speeds",
  power: "mechanical power, mean"
};

export type Slopes = {
  /** Controls that request the slopes and select the displayed quantity. */
  element: HTMLElement;
  /** Element that shows the slope of a parameter. */
  of(name: string, unit: string): HTMLElement;
  /** Called when the panel becomes visible. */
  shown(): void;
};

export function slopes(studio: Studio, isHidden: () => boolean): Slopes {
  const places = new Map<string, { element: HTMLElement; unit: string }>();
  const box = h("input", { type: "checkbox", id: "slopes" });
  const select = h("select", { "aria-label": "Quantity of the plan" });
  const note = h("p", { class: "muted", "aria-live": "polite" });
  const choice = h("div", { hidden: true }, select, note);
  const element = h("div", { class: "slopes" }, h("label", { title: "Change of the plan for a small step of each parameter, with the motion planned again" }, box, " Show the effect of each parameter"), choice);
  let found: { version: number; quantities: QuantitySlopes[] } | null = null;
  let asked = -1;
  let failed = false;
  let made = 0;

  const draw = () => {
    choice.hidden = !box.checked;
    if (box.checked && found && found.version !== studio.version) select.disabled = true;
    const current = box.checked && found?.version === studio.version ? found : null;
    const chosen = current?.quantities.find((one) => one.name === select.value);
    for (const [name, { element, unit }] of places) {
      const slope = chosen?.slopes.find((one) => one.name === name);
      element.hidden = !box.checked;
      element.textContent = chosen && slope ? words(chosen, slope, unit) : current || failed ? "not known" : "…";
      const share = chosen && slope ? Math.abs(slope.by_step) / most(chosen) : 0;
      element.style.setProperty("--share", `${format(share * 100, 0)}%`);
    }
  };
  const say = (text: string) => (note.textContent = text);

  const ask = async () => {
    const { kept } = studio;
    if (!box.checked || isHidden() || studio.dragging) return;
    if (!kept || kept.version !== studio.version) {
      if (!studio.planning) {
        failed = true;
        say("Effects are known only for plans that meet their constraints.");
        draw();
      }
      return;
    }
    if (asked === kept.version) return;
    if (asked >= 0) studio.engine.cancel("slopes");
    asked = kept.version;
    failed = false;
    say("Computing the effects…");
    try {
      const files = kept.snapshot.files.map((file) => ({ ...file }));
      const { value } = await studio.engine.request("slopes", { kind: "slopes", files, motion: kept.snapshot.motion }, { binary: kept.solution });
      if (kept.version !== studio.version) return;
      found = { version: kept.version, quantities: value.quantities };
      options(value.quantities);
      draw();
    } catch (error) {
      if (error instanceof Cancelled) return;
      failed = true;
      say((error as Error).message);
    }
  };
  const state = () => {
    const chosen = found?.quantities.find((one) => one.name === select.value);
    if (chosen) say(`${amount(chosen.value, chosen.unit)} now. Below: estimates for a small change of each parameter, with the motion planned again; bars compare the estimates.`);
  };
  const options = (quantities: QuantitySlopes[]) => {
    const before = select.value || FIRST;
    const option = (one: QuantitySlopes) => h("option", { value: one.name, text: MEANINGS[one.name] ?? one.name.replaceAll("_", " "), selected: one.name === before });
    replace(select, ...quantities.map(option));
    select.disabled = false;
    state();
  };
  box.addEventListener("change", () => {
    if (!box.checked && asked >= 0) studio.engine.cancel("slopes");
    asked = -1;
    draw();
    void ask();
  });
  select.addEventListener("change", () => (draw(), state()));
  studio.events.on("kept", () => void ask());
  studio.events.on("activity", () => {
    draw();
    void ask();
  });

  return {
    element,
    of(name, unit) {
      const element = h("small", { class: "slope", id: `slope-${++made}`, hidden: true });
      places.set(name, { element, unit });
      return element;
    },
    shown: () => void ask(),
  };
}

/** Largest change by any parameter. */
function most(of: QuantitySlopes): number {
  return Math.max(1e-12, ...of.slopes.map(({ by_step }) => Math.abs(by_step)));
}

function words(of: QuantitySlopes, { step, by_step }: QuantitySlopes["slopes"][number], unit: string): string {
  const share = of.value > of.little ? ` (${signed((by_step / of.value) * 100, 1)} %)` : "";
  return `+${Number(step.toPrecision(3))} ${unit}: ${signed(by_step, digits(of.value))} ${of.unit}${share}`;
}

function amount(value: number, unit: string): string {
  return `${format(value, digits(value))} ${unit}`.trim();
}

/** Decimals that show four significant digits. */
function digits(value: number): number {
  return value === 0 ? 2 : Math.max(0, Math.min(6, 3 - Math.floor(Math.log10(Math.abs(value)))));
}

function signed(value: number, digits: number): string {
  const text = format(value, digits);
  return value > 0 && Number(text) !== 0 ? `+${text}` : text;
}
