// Keys of the whole page. Fields and sliders keep their own keys.

import type { Commands } from "../commands.ts";
import type { Playback } from "../project/playback.ts";
import type { View } from "../scene/view.ts";

export function bindKeys(commands: Commands, playback: Playback, view: View | null, tools: { follow(): void; look(index: number): void } | null) {
  document.addEventListener("keydown", (event) => {
    if (document.querySelector("dialog[open]")) return;
    const target = event.target as HTMLElement;
    const typing = target.matches("input:not([type=range]), textarea, select");
    if (event.ctrlKey || event.metaKey) {
      const act = { z: event.shiftKey ? commands.redo : commands.undo, y: commands.redo, s: commands.save, o: commands.open }[event.key.toLowerCase()];
      if (!act) return;
      event.preventDefault();
      // A typed number takes effect before the document is saved or changed.
      if (typing) target.dispatchEvent(new Event("change", { bubbles: true }));
      act();
      return;
    }
    if (typing || event.altKey) return;
    const step = event.shiftKey ? 10 : 1;
        const onButton = target.matches("button, summary, [role=slider], [role=tab], [role=separator], input");
    if (view && target === view.stage.canvas && move(view, event.key)) return event.preventDefault();
    switch (event.key) {
      case " ":
        if (onButton && target.matches("button, summary")) return;
        playback.toggle();
        break;
      case "ArrowLeft":
      case "ArrowRight":
        if (target.matches("input, [role=tab]")) return;
        playback.step(event.key === "ArrowLeft" ? -step : step);
        break;
      case "Home":
        playback.seek(0);
        break;
      case "End":
        playback.seek(playback.duration_s);
        break;
      case "1":
      case "2":
      case "3":
      case "4":
        tools?.look(Number(event.key) - 1);
        break;
      case "f":
        tools?.follow();
        break;
      case "?":
        commands.help();
        break;
      default:
        return;
    }
    event.preventDefault();
  });
}

function move(view: View, key: string): boolean {
  const { cameras } = view;
  const turn = { ArrowLeft: [0.12, 0], ArrowRight: [-0.12, 0], ArrowUp: [0, 0.1], ArrowDown: [0, -0.1] }[key];
  if (turn) cameras.orbit(turn[0], turn[1]);
  else if (key === "+" || key === "=") cameras.zoom(0.9);
  else if (key === "-") cameras.zoom(1.1);
  else return false;
  return true;
}
