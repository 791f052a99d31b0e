// The emergency stop: always visible while a robot is connected, and always on Escape.

import { h } from "../ui/dom.ts";
import type { RobotLink } from "./link.ts";
import { motionsOf } from "./words.ts";

/** Time after which a stop without acknowledgement is reported, ms. */
const UNANSWERED_MS = 500;

export function emergencyStop(host: HTMLElement, link: RobotLink) {
  const word = h("span", {});
  const brief = h("small", {});
  const alarm = h("div", { class: "estop-alarm", role: "alert", hidden: true });
  const button = h("button", { type: "button", class: "estop", title: "Turn torque off at once (Escape): the robot goes limp", hidden: true, onclick: () => stop() }, word, h("kbd", { text: "Esc" }), brief);
  /** True while an order to stop is on its way to the connection, or was not accepted. */
  let asking = false;
  /** Start of the stop that is not acknowledged yet, ms; 0 without one. */
  let since_ms = 0;
  /** True if the connection ended before a stop was acknowledged. */
  let lost = false;
  const stop = () => {
    asking = true;
    draw();
    link.ask({ robot: "wish", intent: "estop" }).then(
      () => ((asking = false), draw()),
      // The stop stays pending, and the alarm appears.
      () => {},
    );
  };
  const draw = () => {
    const { view, connected } = link;
    if (!connected) asking = false;
    const pending = connected && (asking || !!view?.stopping);
    lost = !connected && link.place !== "simulated" && (lost || since_ms > 0);
    if (!pending) since_ms = 0;
    else if (since_ms === 0) {
      since_ms = performance.now();
      // Views may have stopped.
      setTimeout(draw, UNANSWERED_MS + 1);
    }
    button.hidden = !connected;
    button.classList.toggle("pending", pending);
    word.textContent = pending ? "Stopping…" : "E-STOP";
    brief.textContent = view?.contact ? [view.state, view.playing?.name].filter(Boolean).join(": ") : "does not answer";
    const unanswered = lost || (pending && performance.now() - since_ms > UNANSWERED_MS);
    if (alarm.hidden === unanswered) {
      alarm.hidden = !unanswered;
      alarm.textContent = unanswered ? "The stop is not acknowledged. Use the robot's own emergency stop." : "";
    }
  };
  host.append(button, alarm);
  link.onChange(draw);
  // Captured before dialogs, menus and fields can take the key.
  let pressed = false;
  addEventListener(
    "keydown",
    (event) => {
      if (event.key !== "Escape" || !link.connected) return;
      pressed = true;
      stop();
    },
    { capture: true },
  );
  // An open list of choices takes the press of the key; only its release arrives.
  addEventListener(
    "keyup",
    (event) => {
      if (event.key !== "Escape") return;
      if (!pressed && link.connected && event.target instanceof HTMLSelectElement) stop();
      pressed = false;
    },
    { capture: true },
  );
  // The release of a key may go to another window.
  addEventListener("blur", () => (pressed = false));
  addEventListener("beforeunload", (event) => link.view?.torque && event.preventDefault());
}

/** Number keys play the motions of the library by their code, while torque is on. */
export function playByNumber(link: RobotLink) {
  addEventListener(
    "keydown",
    (event) => {
      const typing = (event.target as HTMLElement).matches("input, textarea, select");
      if (typing || event.ctrlKey || event.metaKey || event.altKey || !link.view?.torque || !/^[1-9]$/.test(event.key)) return;
      const code = Number(event.key);
      if (!motionsOf(link.view).some((one) => one.code === code)) return;
      event.stopPropagation();
      link.send({ robot: "wish", intent: "play", code });
    },
    { capture: true },
  );
}
