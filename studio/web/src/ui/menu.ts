// A button with a menu below it: arrow keys, Escape, closes on a click elsewhere.

import { h } from "./dom.ts";

export type Item =
  | { text: string; hint?: string; shortcut?: string; checked?: boolean; disabled?: boolean; act(): void }
  | "line"
  | { heading: string };

export function menu(button: HTMLButtonElement, items: () => Item[], side: "left" | "right" = "left"): HTMLElement {
  const list = h("div", { class: `menu ${side}`, role: "menu", hidden: true });
  const holder = h("div", { class: "menu-holder" }, button, list);
  button.setAttribute("aria-haspopup", "menu");
  button.setAttribute("aria-expanded", "false");

  const close = (refocus: boolean) => {
    if (list.hidden) return;
    list.hidden = true;
    button.setAttribute("aria-expanded", "false");
    if (refocus) button.focus();
  };
  const fill = () => {
    list.replaceChildren(
      ...items().map((item) => {
        if (item === "line") return h("hr");
        if ("heading" in item) return h("div", { class: "menu-heading", text: item.heading });
        const check = item.checked !== undefined;
        return h(
          "button",
          {
            type: "button",
            role: check ? "menuitemcheckbox" : "menuitem",
            "aria-checked": check ? String(item.checked) : null,
            disabled: item.disabled ?? false,
            tabindex: "-1",
            onclick: () => {
              item.act();
              if (check) refill();
              else close(true);
            },
          },
          check ? h("span", { class: "check", "aria-hidden": "true", text: item.checked ? "✓" : "" }) : null,
          h("span", { class: "menu-text" }, item.text, item.hint ? h("small", { text: item.hint }) : null),
          item.shortcut ? h("kbd", { text: item.shortcut }) : null,
        );
      }),
    );
  };
  const buttons = () => [...list.querySelectorAll<HTMLButtonElement>("button:not(:disabled)")];
  const refill = () => {
    const at = buttons().indexOf(document.activeElement as HTMLButtonElement);
    fill();
    buttons()[at]?.focus();
  };
  button.addEventListener("click", () => {
    if (!list.hidden) return close(true);
    fill();
    list.hidden = false;
    button.setAttribute("aria-expanded", "true");
    buttons()[0]?.focus();
  });
  holder.addEventListener("keydown", (event) => {
    if (list.hidden) return;
    const all = buttons();
    const at = all.indexOf(document.activeElement as HTMLButtonElement);
    const to = { ArrowDown: at + 1, ArrowUp: at - 1, Home: 0, End: all.length - 1 }[event.key];
    if (to !== undefined) {
      event.preventDefault();
      all[(to + all.length) % all.length]?.focus();
    } else if (event.key === "Escape") {
      close(true);
    } else if (event.key === "Tab") {
      close(false);
      return;
    } else if (event.key !== "Enter" && event.key !== " ") return;
    event.stopPropagation();
  });
  document.addEventListener("pointerdown", (event) => !holder.contains(event.target as Node) && close(false));
  return holder;
}
