// The emergency stop: always in sight while a robot is connected, and always on Escape.

import { h } from "../ui/dom.ts";
import type { RobotLink } from "./link.ts";

/** A stop that is not acknowledged for so long is said to be so. */
const UNANSWERED_MS = 500;

export function emergencyStop(host: HTMLElement, link: RobotLink) {
  const word = h("span", {});
  const brief = h("small", {});
  const alarm = h("div", { class: "estop-alarm", role: "alert", hidden: true });
  const button = h("button", { type: "button", class: "estop", title: "Torque off at once (Escape): the robot goes limp", hidden: true, onclick: () => stop() }, word, h("kbd", { text: "Esc" }), brief);
  let asking = false;
  let since_ms = 0;
  const stop = () => {
    if (!asking && !link.view?.stopping) since_ms = performance.now();
    asking = true;
    draw();
    const asked = () => ((asking = false), draw());
    link.ask({ robot: "wish", intent: "estop" }).then(asked, asked);
  };
  const draw = () => {
    const { view, connected } = link;
    const pending = connected && (asking || !!view?.stopping);
    button.hidden = !connected;
    button.classList.toggle("pending", pending);
    word.textContent = pending ? "Stopping…" : "E-STOP";
    brief.textContent = view?.contact ? [view.state, view.playing?.name].filter(Boolean).join(": ") : "does not answer";
    const unanswered = pending && performance.now() - since_ms > UNANSWERED_MS;
    if (alarm.hidden === unanswered) {
      alarm.hidden = !unanswered;
      alarm.textContent = unanswered ? "The stop is not acknowledged. Use the robot's own emergency stop." : "";
    }
  };
  host.append(button, alarm);
  link.onChange(draw);
  // Before anything else may take the key: dialogs, menus and fields too. An open list of choices takes it when it is
  // pressed, and only its release arrives.
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
  addEventListener(
    "keyup",
    (event) => {
      if (event.key !== "Escape") return;
      if (!pressed && link.connected) stop();
      pressed = false;
    },
    { capture: true },
  );
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
      if (!link.view.motions.some((one) => one.code === code)) return;
      event.stopPropagation();
      link.wish({ robot: "wish", intent: "play", code });
    },
    { capture: true },
  );
}
