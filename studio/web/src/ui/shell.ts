// The frame of the page: header, view, panel with tabs, timeline, and their contents.

import { h } from "./dom.ts";

export type Shell = {
  header: HTMLElement;
  view: HTMLElement;
  viewTools: HTMLElement;
  stale: HTMLElement;
  status: HTMLElement;
  /** Returns the tab, so that it can be hidden. */
  tab(name: string, content: HTMLElement, shown?: () => void): HTMLElement;
  openTab(name: string): void;
  transport: HTMLElement;
  tracks: HTMLElement;
};

export function buildShell(root: HTMLElement): Shell {
  const header = h("header", { class: "header" });
  const viewTools = h("div", { class: "view-tools", role: "toolbar", "aria-label": "View" });
  const stale = h("div", { class: "stale", hidden: true });
  const view = h("main", { class: "view", "aria-label": "Robot in 3D" }, viewTools, stale);
  const status = h("section", { class: "status", "aria-label": "Plan" });
  const tabs = h("div", { class: "tabs", role: "tablist", "aria-label": "Panel" });
  const panels = h("div", { class: "panels" });
  const aside = h("aside", { class: "panel", "aria-label": "Motion and robot" }, status, tabs, panels);
  const transport = h("div", { class: "transport", role: "toolbar", "aria-label": "Playback" });
  const tracks = h("div", { class: "tracks" });
  const timeline = h("section", { class: "timeline", "aria-label": "Timeline" }, transport, tracks);
  root.replaceChildren(header, view, aside, timeline);

  const all: { name: string; button: HTMLButtonElement; content: HTMLElement; shown?: () => void }[] = [];
  const openTab = (name: string) => {
    for (const one of all) {
      const open = one.name === name;
      one.button.setAttribute("aria-selected", String(open));
      one.button.tabIndex = open ? 0 : -1;
      one.content.hidden = !open;
      if (open) one.shown?.();
    }
  };
  tabs.addEventListener("keydown", (event) => {
    const by = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
    if (!by) return;
    event.preventDefault();
    event.stopPropagation();
    const seen = all.filter((one) => !one.button.hidden);
    const at = seen.findIndex((one) => one.button === document.activeElement);
    const next = seen[(at + by + seen.length) % seen.length];
    openTab(next.name);
    next.button.focus();
  });

  return {
    header,
    view,
    viewTools,
    stale,
    status,
    transport,
    tracks,
    openTab,
    tab(name, content, shown) {
      const id = `tab-${name.toLowerCase()}`;
      const button = h("button", { type: "button", role: "tab", id, "aria-controls": `${id}-panel`, text: name, onclick: () => openTab(name) });
      content.id = `${id}-panel`;
      content.setAttribute("role", "tabpanel");
      content.setAttribute("aria-labelledby", id);
      content.classList.add("tab-panel");
      tabs.append(button);
      panels.append(content);
      all.push({ name, button, content, shown });
      openTab(all[0].name);
      return button;
    },
  };
}
