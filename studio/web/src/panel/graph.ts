// The motion graph: motions on a circle with their codes, transitions as arrows.

import { h, s } from "../ui/dom.ts";

export type Node = { name: string; code: number; duration_s: number; frames: number | null; periodic: boolean };
/** Transition between nodes, by index. */
export type Edge = { from: number; to: number; duration_s: number };

const [WIDTH, HEIGHT, RADIUS] = [320, 260, 15];

export function drawGraph(nodes: Pick<Node, "name" | "code" | "periodic">[], edges: Edge[]): HTMLElement {
  const places = nodes.map((_, index): [number, number] => {
    const angle = (index / nodes.length) * 2 * Math.PI - Math.PI / 2;
    return [WIDTH / 2 + Math.cos(angle) * 95, HEIGHT / 2 + Math.sin(angle) * 88];
  });
  const name = (index: number) => nodes[index]?.name ?? "";
  const words = edges.map((edge) => `${name(edge.from)} to ${name(edge.to)}`).join(", ");
  const svg = s(
    "svg",
    { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, class: "graph", role: "img", "aria-label": `Motion graph: ${words}` },
    s("defs", {}, s("marker", { id: "arrow", viewBox: "0 0 8 8", refX: 7, refY: 4, markerWidth: 7, markerHeight: 7, orient: "auto-start-reverse" }, s("path", { d: "M0 0L8 4L0 8z" }))),
  );
  for (const edge of edges) {
    const [from, to] = [places[edge.from], places[edge.to]];
    if (!from || !to) continue;
    svg.append(s("path", { class: "graph-edge", d: bow(from, to), "marker-end": "url(#arrow)" }, s("title", { text: `${name(edge.from)} → ${name(edge.to)}, ${edge.duration_s.toFixed(2)} s` })));
  }
  nodes.forEach((node, index) => {
    const [x, y] = places[index];
    const above = y < HEIGHT / 2 - 40;
    svg.append(
      s(
        "g",
        {},
        s("circle", { class: "graph-node", cx: x, cy: y, r: RADIUS }),
        node.periodic ? s("circle", { class: "graph-node", cx: x, cy: y, r: RADIUS - 3 }) : null,
        s("text", { class: "graph-code", x, y: y + 4, text: String(node.code) }),
        s("text", { class: "graph-name", x, y: above ? y - RADIUS - 6 : y + RADIUS + 14, text: node.name }),
      ),
    );
  });
  return h("figure", {}, svg as unknown as HTMLElement, h("figcaption", { class: "muted", text: "Double rings repeat; numbers are the codes that select motions." }));
}

/** An arc from circle to circle, so that both directions are visible. */
function bow([x1, y1]: [number, number], [x2, y2]: [number, number]): string {
  const [dx, dy] = [x2 - x1, y2 - y1];
  const length = Math.hypot(dx, dy) || 1;
  const [ux, uy] = [dx / length, dy / length];
  const [cx, cy] = [(x1 + x2) / 2 - uy * length * 0.1, (y1 + y2) / 2 + ux * length * 0.1];
  const cut = (x: number, y: number, by: number) => {
    const [tx, ty] = [cx - x, cy - y];
    const t = Math.hypot(tx, ty) || 1;
    return [x + (tx / t) * by, y + (ty / t) * by].map((value) => value.toFixed(1)).join(" ");
  };
  return `M${cut(x1, y1, RADIUS + 1)} Q${cx.toFixed(1)} ${cy.toFixed(1)} ${cut(x2, y2, RADIUS + 3)}`;
}
