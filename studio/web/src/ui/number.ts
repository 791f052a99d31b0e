// A number with its unit: typed, stepped with arrow keys, or dragged sideways by its label.

import { format, h } from "./dom.ts";

export type NumberOptions = {
  label: string;
  unit: string;
  step: number;
  digits: number;
  min?: number;
  max?: number;
  /** Meaning of an empty field, e.g. "free". Without it the field cannot be empty. */
  empty?: string;
  integer?: boolean;
  hint?: string;
  newGesture(): string;
  changed(value: number | null, how: { gesture: string | null; drag: boolean }): void;
};

export type NumberField = { element: HTMLElement; update(value: number | null | undefined): void };

const PIXELS_PER_STEP = 4;

export function numberField(options: NumberOptions): NumberField {
  let value: number | null = null;
  const input = h("input", {
    type: "text",
    inputmode: "decimal",
    autocomplete: "off",
    spellcheck: "false",
    placeholder: options.empty ?? null,
    "aria-label": `${options.label}${options.unit ? `, ${options.unit}` : ""}`,
    title: options.hint ?? null,
  });
  const label = h("span", { class: "field-label", text: options.label, title: "Drag sideways to change" });
  const element = h(
    "div",
    { class: "field" },
    label,
    h("span", { class: "field-box" }, input, options.unit ? h("span", { class: "unit", text: options.unit }) : null),
  );

  const bounded = (next: number) => {
    const rounded = Number(next.toFixed(options.integer ? 0 : options.digits));
    return Math.min(options.max ?? Infinity, Math.max(options.min ?? -Infinity, rounded));
  };
  const show = () => {
    input.value = value === null ? "" : format(value, options.integer ? 0 : options.digits);
    input.removeAttribute("aria-invalid");
  };
  const set = (next: number | null, gesture: string | null, drag: boolean) => {
    value = next;
    show();
    options.changed(next, { gesture, drag });
  };
  const typed = () => {
    const text = input.value.trim().replace("−", "-").replace(",", ".");
    if (text === "" && options.empty) return value === null ? show() : set(null, null, false);
    const number = Number(text);
    if (text === "" || !Number.isFinite(number)) {
      input.setAttribute("aria-invalid", "true");
      return;
    }
    const next = bounded(number);
    if (value === null || format(next, options.digits) !== format(value, options.digits)) set(next, null, false);
    else show();
  };

  input.addEventListener("change", typed);
  input.addEventListener("focus", () => input.select());
  input.addEventListener("blur", () => input.getAttribute("aria-invalid") && show());
  let keys: string | null = null;
  input.addEventListener("keydown", (event) => {
    if (event.key === "Enter") typed();
    if (event.key === "Escape") show();
    if (event.key !== "ArrowUp" && event.key !== "ArrowDown") return;
    event.preventDefault();
    keys ??= options.newGesture();
    const step = options.step * (event.shiftKey ? 10 : 1) * (event.key === "ArrowUp" ? 1 : -1);
    set(bounded((value ?? 0) + step), keys, true);
  });
  const keysUp = () => {
    if (keys) set(value, keys, false);
    keys = null;
  };
  input.addEventListener("keyup", (event) => ["ArrowUp", "ArrowDown"].includes(event.key) && keysUp());
  input.addEventListener("blur", keysUp);

  let drag: { x: number; from: number; gesture: string; moved: boolean } | null = null;
  label.addEventListener("pointerdown", (event) => {
    if (event.button !== 0) return;
    event.preventDefault();
    label.setPointerCapture(event.pointerId);
    drag = { x: event.clientX, from: value ?? 0, gesture: options.newGesture(), moved: false };
  });
  label.addEventListener("pointermove", (event) => {
    if (!drag) return;
    const steps = Math.round((event.clientX - drag.x) / PIXELS_PER_STEP);
    if (!drag.moved && steps === 0) return;
    drag.moved = true;
    const next = bounded(drag.from + steps * options.step * (event.shiftKey ? 10 : 1));
    if (next !== value) set(next, drag.gesture, true);
  });
  const release = () => {
    if (drag?.moved) set(value, drag.gesture, false);
    else if (drag) input.focus();
    drag = null;
  };
  label.addEventListener("pointerup", release);
  label.addEventListener("pointercancel", release);

  return {
    element,
    update(next) {
      const before = value;
      value = next ?? null;
      // A field keeps its text while the user types; an undo is not typing.
      if (document.activeElement === input && value === before && !keys) return;
      show();
    },
  };
}
