// Status of the plan in words: planned, being planned, or conflicting constraints with feasible values.

import type { Culprit, Fault } from "../contract.ts";
import { baseName } from "../project/documents.ts";
import type { ShownPlan, Studio } from "../project/studio.ts";
import type { RobotLink } from "../robot/link.ts";
import { stateOf as robotStateOf } from "../robot/words.ts";
import { factsOf, peaksOf, percent } from "./facts.ts";
import { format, h, prose, replace } from "../ui/dom.ts";

export type StatusActions = { jump(fault: Fault): void; seek(time_s: number): void };

/** Planning time below which the page shows no "Planning", ms, because the text would flicker. */
const QUIET_MS = 250;

export function buildStatus(host: HTMLElement, studio: Studio, link: RobotLink, actions: StatusActions) {
  const head = h("div", { class: "status-head" });
  const body = h("div", { class: "status-body" });
  // One live region for the whole status, so that a screen reader reads each change once.
  const live = h("p", { class: "visually-hidden", role: "status", "aria-live": "polite" });
  replace(host, head, body, live);
  let since = 0;
  let timer = 0;
  let [drawn, drawnHead] = ["", ""];

  const update = () => {
    const plan = stateOf(studio);
    // Faults of the documents, and work in progress, stay visible.
    const state = plan.kind === "good" ? (robotOf(link) ?? plan) : plan;
    if (state.kind === "planning" || state.kind === "refused") {
      since ||= performance.now();
      const wait = QUIET_MS - (performance.now() - since);
      if (wait > 0) {
        clearTimeout(timer);
        timer = setTimeout(update, wait + 1) as unknown as number;
        return;
      }
    } else since = 0;
    host.dataset.state = state.kind;
    const titled = JSON.stringify([state.kind, state.title]);
    // A button that is replaced between press and release gets no click.
    if (titled !== drawnHead) replace(head, h("span", { class: "status-mark", "aria-hidden": "true", text: MARKS[state.kind] }), h("strong", {}, prose(state.title)), ...(state.kind === "planning" || state.kind === "refused" ? [stopButton(studio)] : []));
    drawnHead = titled;
    const key = JSON.stringify([state.kind, state.words, studio.shown?.version, studio.faults, studio.shown?.planned.solve.culprits, studio.selection.culprit, studio.remarks, studio.remarks?.again?.isDue()]);
    if (key !== drawn) {
      drawn = key;
      replace(body, state.words ? h("p", { class: "lines" }, prose(state.words)) : null, ...detailsOf(studio, state.kind, actions), remarksOf(studio));
    }
    const said = state.kind === "planning" ? "Planning" : state.kind === "refused" ? state.title : `${state.title}. ${state.words}`;
    if (live.textContent !== said) live.textContent = said;
  };
  studio.events.on(["activity", "plan", "documents", "selection"], update);
  let robot = "";
  link.onChange(() => {
    const now = JSON.stringify(robotOf(link));
    if (now !== robot) update();
    robot = now;
  });
  update();
}

/** A connected robot that has stopped. Its state is shown instead of that of the plan until the stop is cleared. */
function robotOf({ view, place }: RobotLink): { kind: Kind; title: string; words: string } | null {
  if (!view || !(view.state?.startsWith("stopped") || view.faults.length > 0)) return null;
  return { kind: "problem", title: robotStateOf(view, place), words: [...view.faults, view.advice].filter(Boolean).join("\n") };
}

type Kind = "empty" | "planning" | "refused" | "good" | "bad" | "faults" | "problem";

const MARKS: Record<Kind, string> = { empty: "○", planning: "◔", refused: "✕", good: "✓", bad: "✕", faults: "✕", problem: "!" };

function stateOf(studio: Studio): { kind: Kind; title: string; words: string } {
  const { faults, problem, progress, shown } = studio;
  if (faults.length > 0) {
    const title = faults.length === 1 ? "A fault in the file" : `${faults.length} faults in the files`;
    return { kind: "faults", title, words: "The picture shows the last documents without faults." };
  }
  if (problem) return { kind: "problem", title: problem.message, words: problem.help };
  if (studio.planning && !(studio.dragging && shown)) {
    if (progress?.refused) {
      const words = `${progress.refused.words} The solver tries other starts and feasible values; Stop keeps the previous plan.`;
      return { kind: "refused", title: "Not met yet", words };
    }
    const detail = progress ? `Iteration ${progress.iteration} of this start: ${progress.worst_constraint} is at ${format(progress.worst_level, 2)} times its tolerance.` : "";
    return { kind: "planning", title: progress?.what && progress.what !== "plan" ? `Planning ${progress.what}` : "Planning", words: detail };
  }
  if (!shown) return { kind: "empty", title: "No motion is open", words: "" };
  const { solve, converged } = shown.planned;
  const isOver = converged && peaksOf(shown).some(({ share }) => share > OVER);
  const judged = isOver ? "Constraints hold within their tolerances. Between the samples the plan exceeds the limit of a motor." : solve.words;
  const words = [judged, studio.notice].filter(Boolean).join(" ");
  // A step of a drag has few iterations, so it cannot converge. It counts as good if its constraints hold.
  if (shown.drag || studio.dragging) return { kind: met(shown) ? "good" : "planning", title: met(shown) ? "Follows" : "Following", words };
  return { kind: converged ? "good" : "bad", title: converged ? "Planned" : TITLES[solve.status] ?? "Not planned", words };
}

/** Share of the tolerances up to which the optimiser accepts a plan. */
const ACCEPTED_LEVEL = 0.2;

function met(shown: ShownPlan): boolean {
  return shown.planned.solve.worst_level <= ACCEPTED_LEVEL;
}

/** Share of a limit above which the status says that a plan exceeds a motor. */
const OVER = 1.005;

const TITLES: Record<string, string> = {
  infeasible: "Cannot be met",
  fails_as_played: "Fails as played",
  stalled: "The optimiser is stuck",
  iteration_limit: "Iteration limit reached",
  interrupted: "Interrupted",
};

function stopButton(studio: Studio): HTMLElement {
  return h("button", { type: "button", class: "button small", text: "Stop", onclick: () => studio.cancel() });
}

function detailsOf(studio: Studio, kind: Kind, actions: StatusActions): (HTMLElement | null)[] {
  if (kind === "faults") return [h("ul", { class: "faults" }, ...studio.faults.map((fault) => faultOf(studio, fault, actions)))];
  const again = h("button", { type: "button", class: "button small", text: "Plan from scratch", title: "Plan without the previous plan as a start", onclick: () => studio.planAgain() });
  if (kind === "good") {
    const peaks = peaksOf(studio.shown!);
    // Between samples, a plan may exceed a limit by the tolerance of its check, but the motor cannot.
    const over = peaks.filter(({ share }) => share > OVER).map(({ of, motor, share, time_s }) => {
      const text = `Needs ${percent(share)} of the ${of} of ${motor} at ${format(time_s, 2)} s`;
      return h("li", {}, h("button", { type: "button", class: "culprit", title: "Move the time cursor there", text, onclick: () => actions.seek(time_s) }), h("span", { class: "advice", text: "The plan exceeds the limit between its samples by less than the tolerance, but the motor delivers at most 100 %. Use more samples, a longer duration or a shorter distance." }));
    });
    return [h("p", { class: "facts", text: factsOf(studio.shown!, peaks) }), over.length > 0 ? h("ul", { class: "culprits mild" }, ...over) : null, again];
  }
  if (kind !== "bad" && kind !== "refused") return [];
  const { culprits } = kind === "bad" ? studio.shown!.planned.solve : studio.progress!.refused!;
  const blamed = culprits.map((culprit, index) => culpritOf(studio, culprit, index, actions));
  return [...(blamed.length > 0 ? [h("h3", { text: "Conflicting constraints" }), h("ul", { class: "culprits" }, ...blamed)] : []), kind === "bad" ? again : null];
}

function remarksOf({ remarks }: Studio): HTMLElement | null {
  if (!remarks) return null;
  const { of, each, again } = remarks;
  const list = each.length > 0 ? h("details", { class: "remarks" }, h("summary", { text: `${each.length} ${of}` }), h("ul", {}, ...each.map((one) => h("li", {}, prose(one))))) : null;
  if (!again?.isDue()) return list;
  const button = h("button", { type: "button", class: "button small", text: again.text, onclick: () => void again.act() });
  return h("div", {}, list, button);
}

function faultOf(studio: Studio, fault: Fault, actions: StatusActions): HTMLElement {
  const place = `${baseName(fault.path)}, line ${fault.line}`;
  const open = studio.documents.text(fault.path) !== undefined;
  return h(
    "li",
    {},
    open ? h("button", { type: "button", class: "link", onclick: () => actions.jump(fault), text: place }) : h("span", { text: place }),
    h("span", {}, prose(fault.label ? `${fault.message}: ${fault.label}` : fault.message)),
    fault.help ? h("span", { class: "advice" }, prose(fault.help)) : null,
  );
}

function culpritOf(studio: Studio, culprit: Culprit, index: number, actions: StatusActions): HTMLElement {
  const { fix } = culprit;
  const pressed = studio.selection.culprit === index;
  const show = () => {
    if (pressed) return studio.selection.clear();
    const span = culprit.from_s !== null ? { from_s: culprit.from_s, to_s: culprit.to_s ?? culprit.from_s } : null;
    studio.selection.blame(index, culprit.end_effector, culprit.joint, span);
    if (span) actions.seek((span.from_s + span.to_s) / 2);
  };
  return h(
    "li",
    { class: pressed ? "shown" : "" },
    h("button", { type: "button", class: "culprit lines", "aria-pressed": String(pressed), title: "Show this constraint in scene and timeline", onclick: show }, prose(culprit.what)),
    culprit.advice ? h("span", { class: "advice" }, prose(culprit.advice)) : null,
    fix
      ? h("button", { type: "button", class: "button small", text: fix.label, onclick: () => studio.edit(fix.edit, { path: fix.path }) })
      : null,
  );
}
