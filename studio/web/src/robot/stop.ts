// The emergency stop: always in sight while a robot is connected, and always on Escape.

import { h } from "../ui/dom.ts";
import type { RobotLink } from "./link.ts";

export function emergencyStop(host: HTMLElement, link: RobotLink) {
  const stop = () => link.wish({ robot: "wish", intent: "estop" });
  const button = h("button", { type: "button", class: "estop", title: "Torque off at once (Escape)", hidden: true, onclick: stop }, "E-STOP", h("kbd", { text: "Esc" }));
  host.append(button);
  link.onChange(() => (button.hidden = !link.connected));
  // Before anything else may take the key: dialogs, menus and fields too.
  addEventListener("keydown", (event) => event.key === "Escape" && link.connected && stop(), { capture: true });
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
