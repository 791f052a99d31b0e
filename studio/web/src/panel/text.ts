// The documents as text, with faults at their lines. After typing, a short delay precedes planning.

import type { Fault } from "../contract.ts";
import { baseName } from "../project/documents.ts";
import type { Studio } from "../project/studio.ts";
import { h, prose, replace } from "../ui/dom.ts";

const WAIT_MS = 400;

export type TextPane = { element: HTMLElement; jump(fault: Fault): void; update(): void };

export function textPane(studio: Studio): TextPane {
  const choice = h("select", { "aria-label": "Document" });
  const area = h("textarea", { class: "text", spellcheck: "false", autocapitalize: "off", wrap: "off", "aria-label": "Text of the document" });
  const gutter = h("div", { class: "gutter", "aria-hidden": "true" });
  const faults = h("ul", { class: "faults" });
  const element = h("div", { class: "text-pane" }, choice, h("div", { class: "editor" }, gutter, area), faults);
  let path = "";
  let gesture: string | null = null;
  let timer = 0;

  const flush = () => {
    if (!timer) return;
    clearTimeout(timer);
    timer = 0;
    gesture ??= studio.newGesture();
    studio.write(path, area.value, gesture);
  };
  area.addEventListener("input", () => {
    drawGutter();
    clearTimeout(timer);
    timer = setTimeout(flush, WAIT_MS) as unknown as number;
  });
  area.addEventListener("blur", () => {
    flush();
    gesture = null;
  });
  area.addEventListener("scroll", () => (gutter.scrollTop = area.scrollTop));
  area.addEventListener("keydown", (event) => {
    // The page's undo restores documents. While typing, the browser's own undo is finer.
    if (event.ctrlKey || event.metaKey) event.stopPropagation();
    if (event.key === "Escape") choice.focus();
  });
  choice.addEventListener("change", () => {
    flush();
    gesture = null;
    show(choice.value);
  });

  const drawGutter = () => {
    const lines = area.value.split("\n").length;
    const marked = new Map(studio.faults.filter((fault) => fault.path === path).map((fault) => [fault.line, fault]));
    replace(
      gutter,
      ...Array.from({ length: lines }, (_, index) => h("div", { class: marked.has(index + 1) ? "fault-line" : "", text: String(index + 1) })),
    );
    gutter.scrollTop = area.scrollTop;
  };
  const show = (next: string) => {
    if (next !== path) area.scrollLeft = area.scrollTop = 0;
    path = next;
    choice.value = next;
    const text = studio.documents.text(next) ?? "";
    if (area.value !== text) area.value = text;
    drawGutter();
  };
  let drawn = "";
  const update = () => {
    const { files } = studio.documents.now;
    const key = JSON.stringify([files.map((file) => [file.path, studio.documents.changed(file.path)]), studio.faults, path]);
    const same = key === drawn && (timer !== 0 || area.value === studio.documents.text(path));
    if (same || element.hidden) return;
    drawn = key;
    const paths = studio.documents.now.files.map((file) => file.path);
    if (!paths.includes(path)) path = studio.documents.motionPath;
    replace(choice, ...paths.map((one) => h("option", { value: one, text: `${baseName(one)}${studio.documents.changed(one) ? " (changed)" : ""}`, selected: one === path })));
    if (!timer && path) show(path);
    const here = studio.faults.filter((fault) => fault.path === path);
    faults.hidden = here.length === 0;
    replace(
      faults,
      ...here.map((fault) =>
        h(
          "li",
          {},
          h("button", { type: "button", class: "link", text: `line ${fault.line}`, onclick: () => jump(fault) }),
          h("span", {}, prose(fault.label ? `${fault.message}: ${fault.label}` : fault.message)),
          fault.help ? h("span", { class: "advice" }, prose(fault.help)) : null,
        ),
      ),
    );
  };
  const jump = (fault: Fault) => {
    flush();
    // A dropped file that was not opened because of its faults has no text here.
    if (studio.documents.text(fault.path) === undefined) return;
    show(fault.path);
    const from = index(area.value, fault.span[0]);
    const to = Math.max(from, index(area.value, fault.span[1]));
    area.focus();
    area.setSelectionRange(from, to);
    const height = Number.parseFloat(getComputedStyle(area).lineHeight);
    area.scrollTop = Math.max(0, (fault.line - 4) * height);
  };
  studio.events.on(["documents", "activity"], update);
  return { element, jump, update };
}

/** Index into the text of a UTF-8 byte offset. */
function index(text: string, bytes: number): number {
  return new TextDecoder().decode(new TextEncoder().encode(text).slice(0, bytes)).length;
}
