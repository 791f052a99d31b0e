// Dialogs on the browser's own <dialog>: focus stays inside, Escape closes.

import { h } from "./dom.ts";
import { picture } from "./icons.ts";

export function dialog(title: string, content: HTMLElement, wide = false): HTMLDialogElement {
  const close = h("button", { type: "button", class: "icon-button", "aria-label": "Close" }, picture("remove"));
  const element = h(
    "dialog",
    { class: wide ? "dialog wide" : "dialog", "aria-label": title },
    h("div", { class: "dialog-head" }, h("h2", { text: title }), close),
    content,
  );
  close.addEventListener("click", () => element.close());
  element.addEventListener("click", (event) => event.target === element && element.close());
  element.addEventListener("close", () => element.remove());
  document.body.append(element);
  element.showModal();
  return element;
}
