// Panel of the library: build with progress for each motion, then the graph, a table and the file.

import { baseName } from "../project/documents.ts";
import { download } from "../project/files.ts";
import type { LibraryBuild } from "../project/library.ts";
import type { Studio } from "../project/studio.ts";
import { format, h, prose, replace } from "../ui/dom.ts";
import { textButton } from "../ui/header.ts";
import { graphEditor } from "./graphedit.ts";

export function libraryPanel(studio: Studio, library: LibraryBuild, examples: () => void): HTMLElement {
  const body = h("div", {});
  const begin = async () => {
    try {
      const { motionPath } = studio.documents;
      const { value } = await studio.engine.request("documents", { kind: "new_library", files: studio.documents.files(), motion: motionPath });
      studio.add(value.files);
    } catch (error) {
      studio.showError(error);
    }
  };
  const draw = () => {
    const path = studio.documents.libraryPath;
    const { building, built } = library;
    if (!path) {
      replace(body, h("p", { class: "muted", text: "A library contains the motions of a robot and the transitions between the motions, for the controller. This project has no library file." }), h("div", { class: "row" }, textButton("New library", "plus", () => void begin()), textButton("Open an example", null, examples)));
    } else if (building) {
      const { progress, parts } = building;
      replace(
        body,
        h("p", {}, h("strong", { text: `Planning ${progress?.what ?? "…"}` }), progress ? `: iteration ${progress.iteration}` : ""),
        h("progress", { "aria-label": "Library is being built" }),
        textButton("Stop", null, () => library.stop()),
        h("ul", { class: "parts", "aria-label": "Parts so far" }, ...parts.slice(0, -1).map((part) => h("li", { text: `✓ ${part}` }))),
      );
    } else if (built) {
      const { name, bytes, nodes, edges, failures } = built;
      const saved = bytes ? textButton(`Save ${name}`, "save", () => download(name, bytes)) : null;
      const size = bytes ? `, ${format(bytes.length / 1000, 1)} kB` : "";
      replace(
        body,
        h("div", { class: "row" }, saved, textButton("Build again", null, () => void library.build())),
        failures.length > 0 ? h("ul", { class: "culprits" }, ...failures.map((failure) => h("li", {}, prose(failure)))) : null,
        h("p", { class: "muted", "data-built": bytes?.length ?? 0, text: `${nodes.length} motions, ${edges.length} transitions${size}` }),
        h(
          "table",
          { class: "names" },
          h("thead", {}, h("tr", {}, ...["code", "motion", "duration, s", "frames"].map((text) => h("th", { scope: "col", text })))),
          h("tbody", {}, ...nodes.map((node) => h("tr", {}, h("td", { text: String(node.code) }), h("th", { scope: "row", text: node.name }), h("td", { text: format(node.duration_s, 2) }), h("td", { text: node.frames === null ? "–" : String(node.frames) })))),
        ),
      );
    } else {
      replace(body, h("p", { class: "muted", text: `${baseName(path)}: the build plans every motion and transition and packs them into one file for the controller. The build takes some seconds; you can continue planning meanwhile.` }), textButton("Build library", null, () => void library.build()));
    }
  };
  let path: string | undefined;
  studio.events.on("documents", () => {
    if (path === studio.documents.libraryPath) return;
    path = studio.documents.libraryPath;
    draw();
  });
  library.onChange(draw);
  draw();
  return h("div", {}, body, graphEditor(studio));
}
