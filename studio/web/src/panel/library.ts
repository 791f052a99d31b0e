// Builds the motion library in a worker of its own: progress for each motion, then the graph, a table and the file.

import type { Progress } from "../contract.ts";
import { Cancelled } from "../engine/engine.ts";
import { baseName } from "../project/documents.ts";
import { download } from "../project/files.ts";
import type { Studio } from "../project/studio.ts";
import { format, h, replace } from "../ui/dom.ts";
import { textButton } from "../ui/header.ts";
import { drawGraph, type Edge, type Node } from "./graph.ts";

type Built = { name: string; nodes: Node[]; edges: Edge[]; bytes: Uint8Array };

export function libraryPanel(studio: Studio, examples: () => void): HTMLElement {
  const body = h("div", {});
  let building: { progress: Progress | null; parts: string[] } | null = null;
  let built: Built | null = null;

  const build = async () => {
    const library = studio.documents.libraryPath;
    if (!library) return;
    building = { progress: null, parts: [] };
    built = null;
    draw();
    try {
      const progress = (one: Progress) => {
        if (!building) return;
        building.progress = one;
        if (building.parts.at(-1) !== one.what) building.parts.push(one.what);
        draw();
      };
      const { value, binary } = await studio.engine.request("library", { kind: "library", files: studio.documents.files(), library }, { progress });
      if (!binary) throw new Error("the engine answered without the library");
      built = { name: baseName(library).replace(/\.toml$/, ".rwl"), nodes: value.nodes, edges: value.edges, bytes: binary };
    } catch (error) {
      if (!(error instanceof Cancelled)) studio.complain(error);
    }
    // A library is built once in a while: its worker and memory are given back.
    building = null;
    studio.engine.cancel("library");
    draw();
  };

  const draw = () => {
    const library = studio.documents.libraryPath;
    if (!library) {
      replace(body, h("p", { class: "muted", text: "A library holds the motions of a robot and the transitions between them, for the controller. This project has no library file." }), textButton("Open an example", null, examples));
    } else if (building) {
      const { progress, parts } = building;
      replace(
        body,
        h("p", {}, h("strong", { text: `Planning ${progress?.what ?? "…"}` }), progress ? `: iteration ${progress.iteration}` : ""),
        h("progress", { "aria-label": "Library is being built" }),
        textButton("Stop", null, () => studio.engine.cancel("library")),
        h("ul", { class: "parts", "aria-label": "Parts so far" }, ...parts.slice(0, -1).map((part) => h("li", { text: `✓ ${part}` }))),
      );
    } else if (built) {
      const { name, bytes, nodes, edges } = built;
      replace(
        body,
        h("div", { class: "row" }, textButton(`Save ${name}`, "save", () => download(name, bytes)), textButton("Build again", null, () => void build())),
        h("p", { class: "muted", "data-built": bytes.length, text: `${nodes.length} motions, ${edges.length} transitions, ${format(bytes.length / 1000, 1)} kB` }),
        drawGraph(nodes, edges),
        h(
          "table",
          {},
          h("thead", {}, h("tr", {}, ...["code", "motion", "duration, s", "frames"].map((text) => h("th", { scope: "col", text })))),
          h("tbody", {}, ...nodes.map((node) => h("tr", {}, h("td", { text: String(node.code) }), h("th", { scope: "row", text: node.name }), h("td", { text: format(node.duration_s, 2) }), h("td", { text: String(node.frames) })))),
        ),
      );
    } else {
      replace(body, h("p", { class: "muted", text: `${baseName(library)}: plans every motion and transition and puts them into one file for the controller. That takes some seconds; planning here goes on meanwhile.` }), textButton("Build library", null, () => void build()));
    }
  };
  let path: string | undefined;
  studio.events.on("documents", () => {
    if (path !== studio.documents.libraryPath) built = null;
    else if (path !== undefined || building || built) return;
    path = studio.documents.libraryPath;
    draw();
  });
  draw();
  return body;
}
