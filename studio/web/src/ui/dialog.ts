// Dialogs with the browser's <dialog>. Its modal form would block the emergency stop. Instead, everything else is inert while a
// dialog is open, so that the focus stays inside.

import { h } from "./dom.ts";
import { picture } from "./icons.ts";

/** Elements that stay operable while a dialog is open. */
const KEPT = ".estop, .estop-alarm";

export function dialog(title: string, content: HTMLElement, wide = false): HTMLDialogElement {
  const close = h("button", { type: "button", class: "icon-button", "aria-label": "Close" }, picture("remove"));
  const element = h(
    "dialog",
    { class: wide ? "dialog wide" : "dialog", "aria-label": title },
    h("div", { class: "dialog-head" }, h("h2", { text: title }), close),
    content,
  );
  const backdrop = h("div", { class: "backdrop", onclick: () => element.close() });
  const before = document.activeElement as HTMLElement | null;
  const inert = outside(document.body).filter((one) => !one.inert);
  const escape = (event: KeyboardEvent) => event.key === "Escape" && element.close();
  close.addEventListener("click", () => element.close());
  element.addEventListener("close", () => {
    for (const one of inert) one.inert = false;
    removeEventListener("keydown", escape);
    backdrop.remove();
    element.remove();
    before?.focus();
  });
  for (const one of inert) one.inert = true;
  addEventListener("keydown", escape);
  document.body.append(backdrop, element);
  element.show();
  return element;
}

/** Outermost elements below `parent` that contain no operable element. */
function outside(parent: Element): HTMLElement[] {
  const apart = ([...parent.children] as HTMLElement[]).filter((child) => !child.matches(KEPT));
  return apart.flatMap((child) => (child.querySelector(KEPT) ? outside(child) : [child]));
}
