// Editor of the motion graph: motions with their codes, the SAFE motion, and transitions.

import type { Graph } from "../contract.ts";
import { Cancelled } from "../engine/engine.ts";
import { baseName } from "../project/documents.ts";
import type { Studio } from "../project/studio.ts";
import { h, prose, replace } from "../ui/dom.ts";
import { iconButton, textButton } from "../ui/header.ts";
import { numberField } from "../ui/number.ts";
import { drawGraph } from "./graph.ts";

/** Duration of a new transition, s. */
const TRANSITION_S = 1.2;

export function graphEditor(studio: Studio): HTMLElement {
  const body = h("div", { class: "graph-editor" });
  let drawn = "";
  let asked = "";
  studio.events.on("documents", async () => {
    const library = studio.documents.libraryPath;
    if (!library) {
      drawn = asked = "";
      return replace(body);
    }
    const files = studio.documents.files();
    const key = JSON.stringify([library, files]);
    if (key === asked) return;
    asked = key;
    try {
      const { value } = await studio.engine.request("documents", { kind: "graph", files, library });
      if (key !== asked || JSON.stringify(value) === drawn) return;
      drawn = JSON.stringify(value);
      draw(studio, body, library, value);
    } catch (error) {
      if (key === asked) asked = "";
      if (!(error instanceof Cancelled)) studio.showError(error);
    }
  });
  return body;
}

function draw(studio: Studio, body: HTMLElement, path: string, graph: Graph) {
  // The focused element keeps the focus, if it still exists.
  const focused = body.contains(document.activeElement) ? document.activeElement!.getAttribute("aria-label") : null;
  const index = (name: string) => graph.motions.findIndex((motion) => motion.name === name);
  const nodes = graph.motions.map(({ name, code, periodic }) => ({ name, code: code ?? 0, periodic }));
  replace(
    body,
    graph.faults.length > 0
      ? h("ul", { class: "culprits" }, ...graph.faults.map((fault) => h("li", {}, prose(`${baseName(fault.path)}: ${fault.message}`), fault.help ? h("span", { class: "advice" }, prose(fault.help)) : null)))
      : null,
    drawGraph(nodes, edgesOf(graph, index)),
    h("h3", { text: "Motions" }),
    h("ul", { class: "graph-list" }, ...graph.motions.map((motion, at) => motionRow(studio, path, graph, motion, at))),
    adder(studio, path, graph),
    h("h3", { text: "Transitions" }),
    viaSafe(studio, path, graph),
    h("ul", { class: "graph-list" }, ...graph.transitions.map((one) => transitionRow(studio, path, one))),
    joiner(studio, path, graph),
  );
  if (focused) body.querySelector<HTMLElement>(`[aria-label="${CSS.escape(focused)}"]`)?.focus();
}

/** Transitions of the file, and transitions through SAFE that none of them replaces. */
function edgesOf(graph: Graph, index: (name: string) => number) {
  const edges = graph.transitions.map(({ from, to, duration_s }) => ({ from: index(from), to: index(to), duration_s: duration_s ?? 0 }));
  const safe = index(graph.safe);
  if (graph.via_safe_s === null || safe < 0) return edges;
  const duration_s = graph.via_safe_s;
  const joined = (from: number, to: number) => edges.some((edge) => edge.from === from && edge.to === to);
  const via = graph.motions.flatMap((_, other) => (other === safe ? [] : [{ from: safe, to: other, duration_s }, { from: other, to: safe, duration_s }]));
  return [...edges, ...via.filter(({ from, to }) => !joined(from, to))];
}

function motionRow(studio: Studio, path: string, graph: Graph, motion: Graph["motions"][number], at: number): HTMLElement {
  const code = numberField({
    label: "Code",
    unit: "",
    step: 1,
    digits: 0,
    min: 1,
    max: 255,
    integer: true,
    hint: "The number that selects the motion",
    newGesture: () => studio.newGesture(),
    changed: (value, how) => studio.edit({ edit: "number", table: ["motion", String(at)], key: "code", value }, { path, ...how }),
  });
  code.element.querySelector("input")!.setAttribute("aria-label", `Code of ${motion.name}`);
  code.update(motion.code);
  const safe = h("input", {
    type: "radio",
    name: "safe",
    checked: motion.name === graph.safe,
    "aria-label": `${motion.name} is SAFE`,
    title: "SAFE: the motion to which the robot returns on Disarm or a lost connection",
    onchange: () => studio.edit({ edit: "text", table: [], key: "safe", value: motion.name }, { path }),
  });
  return h(
    "li",
    {},
    h("label", {}, safe, "SAFE"),
    h("strong", { text: motion.name, title: motion.file }),
    code.element,
    iconButton("remove", `Remove ${motion.name} from the library`, () => studio.edit({ edit: "remove_motion", name: motion.name }, { path })),
  );
}

/** Adds motion files of the project that the library does not contain yet. */
function adder(studio: Studio, path: string, graph: Graph): HTMLElement {
  if (graph.others.length === 0) return h("p", { class: "muted", text: "All motions of this project for this robot are in the library. Open more motion files to add them." });
  const choice = h("select", { "aria-label": "Motion to add" }, ...graph.others.map(({ name }, at) => h("option", { value: String(at), text: name })));
  const add = () => {
    const { name, file } = graph.others[Number(choice.value)];
    studio.edit({ edit: "add_motion", name, file }, { path });
  };
  return h("div", { class: "row" }, choice, textButton("Add motion", "plus", add));
}

function seconds(studio: Studio, label: string, value: number | null, changed: (value: number | null, how: { gesture: string | null; drag: boolean }) => void): HTMLElement {
  const field = numberField({ label, unit: "s", step: 0.05, digits: 2, min: 0.05, newGesture: () => studio.newGesture(), changed });
  field.update(value);
  return field.element;
}

function viaSafe(studio: Studio, path: string, graph: Graph): HTMLElement | null {
  if (graph.via_safe_s === null) return null;
  return h(
    "div",
    { class: "fields" },
    seconds(studio, "Between SAFE and each motion", graph.via_safe_s, (value, how) => studio.edit({ edit: "number", table: ["via_safe"], key: "duration_s", value }, { path, ...how })),
  );
}

function transitionRow(studio: Studio, path: string, { from, to, duration_s }: Graph["transitions"][number]): HTMLElement {
  const set = (value: number | null, how = { gesture: null as string | null, drag: false }) => studio.edit({ edit: "transition", from, to, duration_s: value }, { path, ...how });
  return h("li", {}, seconds(studio, `${from} → ${to}`, duration_s, set), iconButton("remove", `Remove the transition from ${from} to ${to}`, () => set(null)));
}

/** Adds a direct transition between two motions. */
function joiner(studio: Studio, path: string, graph: Graph): HTMLElement | null {
  if (graph.motions.length < 2) return null;
  const choice = (label: string, first: number) => h("select", { "aria-label": label }, ...graph.motions.map(({ name }, at) => h("option", { value: name, text: name, selected: at === first })));
  const [from, to] = [choice("Transition from", 0), choice("Transition to", 1)];
  const join = () => studio.edit({ edit: "transition", from: from.value, to: to.value, duration_s: TRANSITION_S }, { path });
  return h("div", { class: "row" }, from, h("span", { text: "→" }), to, textButton("Add transition", "plus", join));
}
