// The shipped motions and libraries by robot; one click opens.

import { type Example, example, listExamples } from "../project/examples.ts";
import { baseName } from "../project/documents.ts";
import type { Studio } from "../project/studio.ts";
import { dialog } from "./dialog.ts";
import { h, replace } from "./dom.ts";

export async function openGallery(studio: Studio) {
  const list = h("div", { class: "gallery" }, h("p", { class: "muted", text: "Loading…" }));
  const search = h("input", { type: "search", placeholder: "Search", "aria-label": "Search examples" });
  const box = dialog("Examples", h("div", {}, search, list), true);
  let examples: Example[];
  try {
    examples = await listExamples(studio);
  } catch (error) {
    box.close();
    studio.showError(error);
    return;
  }
  const open = async (one: Example) => {
    box.close();
    try {
      const unsaved = studio.documents.anyChanged;
      await studio.openProject(await example(studio, one.path));
      if (unsaved) studio.notify("Undo (Ctrl+Z) restores the previous project, which has unsaved changes.");
    } catch (error) {
      studio.showError(error);
    }
  };
  const draw = () => {
    const word = search.value.trim().toLowerCase();
    const found = examples.filter((one) => ["motion", "library"].includes(one.of) && `${one.path} ${one.name} ${one.title} ${one.robot ?? ""}`.toLowerCase().includes(word));
    const groups = group(found);
    replace(
      list,
      ...[...groups].sort(([a], [b]) => (a === "agilebot" ? -1 : b === "agilebot" ? 1 : a.localeCompare(b))).map(([robot, motions]) =>
        h(
          "section",
          {},
          h("h3", { text: robot || "Other" }),
          h(
            "div",
            { class: "gallery-grid" },
            ...motions.map((one) =>
              h("button", { type: "button", class: "example", "data-path": one.path, title: one.title, onclick: () => void open(one) }, h("strong", { text: one.name }), h("span", { text: one.title.replaceAll("`", "") }), one.of === "library" ? h("span", { class: "tag", text: "library" }) : null),
            ),
          ),
        ),
      ),
      found.length === 0 ? h("p", { class: "muted", text: "No example matches this search." }) : null,
    );
  };
  search.addEventListener("input", draw);
  draw();
  search.focus();
}

/** Groups examples by their robot. */
function group(list: Example[]): Map<string, Example[]> {
  const groups = new Map<string, Example[]>();
  for (const one of list) {
    const robot = baseName(one.robot ?? "").replace(/\.toml$/, "");
    groups.set(robot, [...(groups.get(robot) ?? []), one]);
  }
  return groups;
}
