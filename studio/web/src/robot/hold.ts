// A button that acts only after it was held for a second, by pointer, Space or Enter: for actions that must not happen by accident.

import { h } from "../ui/dom.ts";

const HOLD_MS = 1000;

export function holdButton(text: string, act: () => void): HTMLButtonElement {
  const bar = h("span", { class: "hold-bar", "aria-hidden": "true" });
  const button = h("button", { type: "button", class: "button hold", title: "Hold for one second" }, bar, h("span", { text }));
  let timer = 0;
  const begin = () => {
    if (timer || button.disabled) return;
    button.classList.add("holding");
    timer = setTimeout(() => {
      end();
      act();
    }, HOLD_MS) as unknown as number;
  };
  const end = () => {
    clearTimeout(timer);
    timer = 0;
    button.classList.remove("holding");
  };
  button.addEventListener("pointerdown", (event) => event.button === 0 && begin());
  for (const name of ["pointerup", "pointerleave", "pointercancel", "blur"]) button.addEventListener(name, end);
  button.addEventListener("keydown", (event) => {
    if (event.key !== " " && event.key !== "Enter") return;
    event.preventDefault();
    event.stopPropagation();
    begin();
  });
  button.addEventListener("keyup", end);
  return button;
}
