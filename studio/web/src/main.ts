// Entry point of the page: chooses the engine, builds the parts, and opens the previous project, the project of the link, or an
// example.

import { chooseEngine } from "./engine/choose.ts";
import { start } from "./start.ts";
import { h } from "./ui/dom.ts";

const root = document.getElementById("studio")!;

chooseEngine()
  .then((engine) => start(root, engine))
  .catch((error: unknown) => {
    console.error(error);
    const message = error instanceof Error ? error.message : String(error);
    root.replaceChildren(
      h("div", { class: "stopped", role: "alert" }, h("h1", { text: "The studio did not start" }), h("p", { text: message }), h("p", { class: "muted", text: "Use a browser with WebAssembly and WebGL 2. From disk, open the single-file page." })),
    );
  });
