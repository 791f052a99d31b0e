// The keyboard and the mouse, on one page.

import { dialog } from "./dialog.ts";
import { h } from "./dom.ts";

const SECTIONS: [string, [string, string][]][] = [
  [
    "Playback",
    [
      ["Space", "play, pause"],
      ["← →", "one frame back, forward (Shift: ten frames)"],
      ["Home, End", "to the start, to the end"],
    ],
  ],
  [
    "View",
    [
      ["1 2 3 4", "free, front, side, top camera"],
      ["F", "let the camera follow the robot"],
      ["Drag, wheel", "turn, zoom; right button or two fingers: move"],
      ["← → ↑ ↓, + −", "turn, zoom, when the view has the focus"],
    ],
  ],
  [
    "Edit",
    [
      ["Ctrl+Z, Ctrl+Y", "undo, redo"],
      ["Ctrl+S, Ctrl+O", "save the motion, open files"],
      ["Drag a target", "along the ground; with Shift, up and down"],
      ["Drag a number's name", "change the number; Shift: ten times as fast"],
      ["↑ ↓ in a number", "one step; Shift: ten steps"],
    ],
  ],
  [
    "Robot, while connected",
    [
      ["Esc", "emergency stop, from anywhere in the page"],
      ["1 … 9", "play the motion of this number"],
      ["Hold Space", "on “Hold to arm”: arm"],
    ],
  ],
  [
    "Footfalls",
    [
      ["Drag over a bar", "paint a swing"],
      ["Drag a gap, its edges", "move the swing, change lift-off or landing"],
      ["Tab, ← →", "choose a swing, move the swing"],
      ["Shift+← →, Alt+← →", "change landing, change lift-off"],
      ["Delete", "remove the swing"],
    ],
  ],
];

/** `place`: location of the planning. */
export function openHelp(place: string) {
  const sections = SECTIONS.map(([title, rows]) =>
    h("section", {}, h("h3", { text: title }), h("dl", {}, ...rows.flatMap(([keys, what]) => [h("dt", { text: keys }), h("dd", { text: what })]))),
  );
  const where = h("p", { class: "muted", text: `Planning runs ${place}. Your files stay on this computer.` });
  dialog("Keyboard and mouse", h("div", {}, h("div", { class: "help" }, ...sections), where), true);
}
