// What the plan is worth: the report's residuals against their tolerances, at the samples and as played.

import { Cancelled } from "../engine/engine.ts";
import type { Playback } from "../project/playback.ts";
import type { Studio } from "../project/studio.ts";
import { format, h, replace } from "../ui/dom.ts";

type Row = { name: string; unit: string; worst: number; tolerance: number | null; at_s: number | null; subject: string | null };
type Report = { rows: Row[]; judgement: string; holds: boolean };

export function reportPanel(studio: Studio, playback: Playback): { element: HTMLElement; shown(): void } {
  const element = h("div", {});
  let of = -1;

  const draw = async () => {
    const { shown } = studio;
    if (!shown || shown.drag || element.hidden || of === shown.version) return;
    of = shown.version;
    const version = of;
    try {
      const { value } = await studio.engine.request("solver", { kind: "report" });
      if (version === of) fill(value.report ?? value);
    } catch (error) {
      of = -1;
      if (!(error instanceof Cancelled)) replace(element, h("p", { class: "muted", text: (error as Error).message }));
    }
  };
  const fill = (report: Report) => {
    const line = (row: Row) => {
      const share = row.tolerance ? Math.abs(row.worst) / row.tolerance : null;
      return h(
        "tr",
        { class: share !== null && share > 1 ? "over" : "" },
        h(
          "th",
          { scope: "row" },
          row.at_s === null ? row.name : h("button", { type: "button", class: "link", title: "Move the time cursor there", text: row.name, onclick: () => playback.seek(row.at_s!) }),
          row.subject ? h("small", { text: row.subject.replaceAll("_", " ") }) : null,
        ),
        h("td", { text: `${compact(row.worst)} ${row.unit}` }),
        h("td", { text: row.tolerance === null ? "–" : `${compact(row.tolerance)} ${row.unit}` }),
        h("td", { text: share === null ? "" : `${format(share * 100, 0)} %${share > 1 ? " ✕" : ""}` }),
      );
    };
    replace(
      element,
      h("p", { text: report.judgement }),
      h(
        "table",
        { class: "report" },
        h("thead", {}, h("tr", {}, ...["as played", "worst", "tolerance", "used"].map((text) => h("th", { scope: "col", text })))),
        h("tbody", {}, ...report.rows.map(line)),
      ),
    );
  };
  studio.events.on("plan", () => void draw());
  return { element, shown: () => void draw() };
}

function compact(value: number): string {
  if (value === 0) return "0";
  return Math.abs(value) >= 0.001 && Math.abs(value) < 10_000 ? String(Number(value.toPrecision(3))).replace("-", "−") : value.toExponential(1).replace("-", "−");
}
