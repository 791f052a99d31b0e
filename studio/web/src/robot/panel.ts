// Panel of the robot at the other end of a link: connect, flash, arm by holding, play, stop. The state is shown in words.

import type { RobotView } from "../contract.ts";
import type { LibraryBuild } from "../project/library.ts";
import type { Studio } from "../project/studio.ts";
import { format, h, prose, replace } from "../ui/dom.ts";
import type { PlanComparison } from "./beside.ts";
import { connectFields } from "./connect.ts";
import { holdButton } from "./hold.ts";
import type { RobotLink } from "./link.ts";
import { adviceOf, factsOf, latestOf, motionsOf, stateOf } from "./words.ts";

/** Planned speed in the link's 64ths, which is the maximum. */
const FULL_SPEED = 64;
/** Minimum time between two texts about the plan beside the robot, ms, because faster changes cannot be read. */
const READ_MS = 200;

export function runPanel(studio: Studio, link: RobotLink, library: LibraryBuild, beside: PlanComparison): HTMLElement {
  const fields = connectFields(link.place);
  const connect = button("Connect", async () => link.connect(await fields.wanted()));
  const leave = button("Disconnect", () => link.send({ robot: "wish", intent: "quit" }));
  const trouble = h("p", { class: "note", role: "alert" });
  const flash = button("", () => {
    const { bytes, identity } = library.built ?? {};
    if (bytes) link.flash({ bytes, identity: identity! });
    else void library.build();
  });
  flash.classList.add("flash");
  const flashNote = h("p", { class: "muted" });
  const arm = holdButton("Hold to arm", () => link.send({ robot: "wish", intent: "arm" }));
  const disarm = button("Disarm", () => link.send({ robot: "wish", intent: "disarm" }));
  const clear = button("Clear faults", () => link.send({ robot: "wish", intent: "clear" }));
  const pause = button("Pause", () => link.send({ robot: "wish", intent: "pause_or_resume" }));
  const home = button("Return to SAFE", () => link.send({ robot: "wish", intent: "return" }));
  const speed = h("input", { type: "range", min: 1, max: FULL_SPEED, value: FULL_SPEED, "aria-label": "Speed" });
  speed.addEventListener("input", () => link.send({ robot: "wish", intent: "speed", sixty_fourths: Number(speed.value) }));
  const percent = h("output", {});
  const besideNote = h("p", { class: "muted beside" });
  const motions = h("div", { class: "row motions" });
  const state = h("p", { class: "robot-state" });
  const advice = h("p", { class: "muted" });
  const latest = h("p", { class: "latest" });
  const live = h("p", { class: "visually-hidden", role: "status", "aria-live": "polite" });
  const facts = h("p", { class: "muted facts" });
  const faults = h("ul", { class: "culprits" });
  const messages = h("ul", { class: "messages", "aria-label": "Messages" });
  const steps = h(
    "ol",
    { class: "steps" },
    step("Connect", fields.element, h("div", { class: "row" }, connect, leave), trouble),
    step("Flash the library", flashNote, flash),
    step("Arm", h("p", { class: "muted", text: "After arming, the robot moves slowly to its SAFE pose. Disarm moves the robot to SAFE, then turns torque off; the emergency stop turns torque off at once." }), h("div", { class: "row" }, arm, disarm, clear)),
    step("Play", motions, h("div", { class: "row" }, pause, home), h("label", {}, "Speed ", speed, percent), besideNote),
  );
  let besideFrom_ms = 0;
  let drawnMotions = "";
  let drawnMessages = "";

  const draw = () => {
    const { view, connected } = link;
    const contact = !!view?.contact;
    connect.hidden = connected;
    connect.disabled = link.connecting || !studio.documents.robotPath;
    fields.lock(connected || link.connecting);
    leave.hidden = !connected;
    trouble.hidden = !link.trouble;
    trouble.textContent = link.trouble;
    const transfer = view?.transfer;
    const ready = library.built?.bytes;
    flash.querySelector("span")!.textContent = ready ? "Flash library" : "Build library";
    flash.disabled = library.building !== null || !!transfer || !studio.documents.libraryPath || (!!ready && (!contact || view.torque));
    flashNote.textContent = transfer
      ? `Transferring: ${Math.round((100 * transfer[0]) / Math.max(1, transfer[1]))} %`
      : library.building
        ? `Planning ${library.building.progress?.what ?? "…"}`
        : studio.documents.libraryPath
          ? libraryOf(view, library.built?.identity ?? null)
          : "This project has no library file: open a library, such as agilebot under Examples.";
    arm.disabled = !contact || !view.can_arm || !view.library;
    disarm.disabled = !contact || !view.torque;
    clear.disabled = !contact;
    pause.disabled = home.disabled = !contact || !view.torque;
    pause.querySelector("span")!.textContent = view?.paused ? "Resume" : "Pause";
    speed.disabled = !contact;
    // A control that is dragged keeps its value.
    if (view && document.activeElement !== speed) speed.value = String(view.speed_64ths);
    percent.textContent = `${Math.round((100 * Number(speed.value)) / FULL_SPEED)} %`;
    if (performance.now() >= besideFrom_ms) {
      besideFrom_ms = performance.now() + READ_MS;
      besideNote.replaceChildren(prose(beside.words()));
    }
    mark(steps, [connected, !!view?.library, !!view?.torque, !!view?.playing].map((done) => done && contact));
    state.textContent = view ? stateOf(view, link.place) : "Not connected. Nothing is sent until you connect.";
    if (live.textContent !== state.textContent) live.textContent = state.textContent;
    advice.replaceChildren(prose(view ? adviceOf(view, link.connected_ms) : ""));
    const message = view && latestOf(view);
    latest.dataset.weight = message?.weight ?? "";
    latest.replaceChildren(prose(message?.text ?? (view?.asking ? `Requested: ${view.asking}` : "")));
    facts.textContent = view ? factsOf(view) : "";
    replace(faults, ...(view?.faults ?? []).map((fault) => h("li", { text: fault })));
    drawMotions(view);
    drawMessages(view);
  };
  const drawMotions = (view: RobotView | null) => {
    const list = view ? motionsOf(view).filter((one) => one.code !== null) : [];
    const can = !!view?.contact && view.can_play;
    const key = JSON.stringify([list, can, view?.playing?.name]);
    if (key === drawnMotions) return;
    drawnMotions = key;
    const focused = [...motions.children].indexOf(document.activeElement!);
    replace(
      motions,
      ...list.map((one) => {
        const play = button(one.name, () => link.send({ robot: "wish", intent: "play", code: one.code! }));
        play.prepend(h("kbd", { text: String(one.code) }));
        play.disabled = !can;
        play.setAttribute("aria-pressed", String(view?.playing?.name === one.name));
        return play;
      }),
    );
    if (focused >= 0) (motions.children[focused] as HTMLElement | undefined)?.focus();
  };
  const drawMessages = (view: RobotView | null) => {
    const list = view?.messages ?? [];
    const key = JSON.stringify(list.at(-1)) + list.length;
    if (key === drawnMessages) return;
    drawnMessages = key;
    const warning = list.at(-1)?.weight === "warning";
    messages.setAttribute("aria-live", warning ? "assertive" : "polite");
    replace(messages, ...[...list].reverse().map((one) => h("li", { "data-weight": one.weight }, h("span", { class: "muted", text: `${format(one.at_s, 1)} s` }), h("span", {}, prose(one.text)))));
  };
  /** The library that was built here names the motions of a robot that already has this library. */
  const name = () => {
    const { bytes, identity } = library.built ?? {};
    const { view } = link;
    if (link.connected && bytes && view?.library === identity && link.library?.bytes !== bytes && !view?.transfer) link.name({ bytes, identity: identity! });
  };
  link.onChange(() => (name(), draw()));
  library.onChange(() => (name(), draw()));
  studio.events.on("documents", draw);
  draw();
  return h("div", { class: "run" }, h("div", { class: "run-head" }, state, live, advice, latest, faults), steps, facts, h("h3", { text: "Messages" }), messages);
}

/** Library of the robot, and the next step, in words. */
function libraryOf(view: RobotView | null, built: string | null): string {
  if (!view?.contact) return built ? "The library is built. Connect to flash the library." : "";
  const has = view.library ? `The robot has library ${view.library} in use.` : "The robot has no library.";
  if (built === view.library || (!built && view.motions.length > 0)) return has;
  if (!built) return view.library ? `${has} Build the library here to see the names of its motions; until then, play motions by number.` : has;
  return view.library ? `${has} The library that was built here is different: flash the built library.` : `${has} Flash the built library.`;
}

function step(title: string, ...content: HTMLElement[]): HTMLElement {
  return h("li", {}, h("strong", { text: title }), ...content);
}

function mark(steps: HTMLElement, done: boolean[]) {
  [...steps.children].forEach((one, index) => one.classList.toggle("done", done[index]));
}

function button(text: string, act: () => void): HTMLButtonElement {
  return h("button", { type: "button", class: "button", onclick: act }, h("span", { text }));
}
