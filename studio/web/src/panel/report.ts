// Report of the plan: residuals relative to their tolerances, as played and at the samples.

import { Cancelled } from "../engine/engine.ts";
import type { Playback } from "../project/playback.ts";
import type { Studio } from "../project/studio.ts";
import { format, h, prose, replace } from "../ui/dom.ts";

type Row = { name: string; grid: "samples" | "60_hz" | "500_hz"; unit: string; worst: number; level: number | null; place: { time_s: number; subject: string | null } | null };
type Report = { rows: Row[]; words: string };

const GRIDS: [Row["grid"], string][] = [
  ["500_hz", "As played, at 500 Hz"],
  ["60_hz", "As played, at 60 Hz"],
  ["samples", "At the samples"],
];

export function reportPanel(studio: Studio, playback: Playback): { element: HTMLElement; shown(): void } {
  const element = h("div", {});
  let of = -1;

  const draw = async () => {
    const { shown } = studio;
    if (!shown || shown.drag || element.hidden || of === shown.version) return;
    const version = (of = shown.version);
    try {
      const { value } = await studio.engine.request("solver", { kind: "report" });
      if (version === of) fill(value);
    } catch (error) {
      of = -1;
      if (!(error instanceof Cancelled)) replace(element, h("p", { class: "muted", text: (error as Error).message }));
    }
  };
  const line = (row: Row) => {
    const share = row.level ? Math.abs(row.worst) / row.level : null;
    const { place } = row;
    return h(
      "tr",
      { class: share !== null && share > 1 ? "beyond" : "" },
      h(
        "th",
        { scope: "row" },
        place ? h("button", { type: "button", class: "link", title: "Move the time cursor there", text: row.name, onclick: () => playback.seek(place.time_s) }) : row.name,
        place?.subject ? h("small", { text: place.subject.replaceAll("_", " ") }) : null,
      ),
      h("td", { text: `${compact(row.worst)} ${row.unit}` }),
      h("td", { text: row.level === null ? "–" : compact(row.level) }),
      h("td", { text: share === null ? "" : `${format(share * 100, 0)} %${share > 1 ? " ✕" : ""}` }),
    );
  };
  const fill = (report: Report) => {
    const tables = GRIDS.map(([grid, title], index) => {
      const rows = report.rows.filter((row) => row.grid === grid);
      const heads = ["residual", "worst", "tolerance", "used"].map((text) => h("th", { scope: "col", text }));
      return h(
        "details",
        { open: index === 0 },
        h("summary", { text: `${title} (${rows.length})` }),
        h("table", { class: "report" }, h("thead", {}, h("tr", {}, ...heads)), h("tbody", {}, ...rows.map(line))),
      );
    });
    replace(element, h("p", { class: "lines" }, prose(report.words)), ...tables);
  };
  studio.events.on("plan", () => void draw());
  return { element, shown: () => void draw() };
}

function compact(value: number): string {
  if (Math.abs(value) < 1e-9) return "0";
  return Math.abs(value) >= 0.001 && Math.abs(value) < 10_000 ? String(Number(value.toPrecision(3))).replace("-", "−") : value.toExponential(1).replace("-", "−");
}
