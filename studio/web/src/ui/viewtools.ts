// Controls over the scene: cameras and layers.

import type { Layer, Settings } from "../project/settings.ts";
import { save } from "../project/settings.ts";
import type { RobotLink } from "../robot/link.ts";
import type { Studio } from "../project/studio.ts";
import type { Direction } from "../scene/cameras.ts";
import type { View } from "../scene/view.ts";
import { h, replace } from "./dom.ts";
import { textButton } from "./header.ts";
import { menu } from "./menu.ts";

const DIRECTIONS: [Direction, string, string][] = [
  ["free", "Free", "1"],
  ["front", "Front", "2"],
  ["side", "Side", "3"],
  ["top", "Top", "4"],
];

const LAYERS: [Layer, string][] = [
  ["forces", "Ground forces"],
  ["cones", "Friction cones"],
  ["polygon", "Support polygon"],
  ["com_path", "Path of the centre of mass"],
  ["foot_paths", "Paths of the feet"],
  ["ghosts", "Ghosts"],
  ["targets", "Targets and goal"],
  ["clearance", "Clearance shapes"],
  ["marks", "Ground marks"],
];

export function buildViewTools(host: HTMLElement, view: View, settings: Settings) {
  const directions = DIRECTIONS.map(([direction, name, key]) =>
    h("button", { type: "button", class: "button", text: name, title: `${name} (${key})`, "data-direction": direction, onclick: () => press(direction) }),
  );
  const press = (chosen: Direction | null) => {
    if (chosen) view.cameras.look(chosen);
    for (const button of directions) button.setAttribute("aria-pressed", String(button.dataset.direction === chosen));
  };
  // After the user rotates the view, none of these is selected.
  view.cameras.controls.addEventListener("start", () => press(null));
  press("free");
  const follow = h("button", {
    type: "button",
    class: "button",
    text: "Follow",
    title: "Let the camera follow the robot (F)",
    "aria-pressed": String(settings.follow),
    onclick: () => {
      settings.follow = !settings.follow;
      follow.setAttribute("aria-pressed", String(settings.follow));
      save(settings);
      view.layersChanged();
    },
  });
  const layers = textButton("Show", "layers");
  const shown = menu(layers, () =>
    LAYERS.map(([layer, text]) => ({
      text,
      checked: settings.layers[layer],
      act() {
        settings.layers[layer] = !settings.layers[layer];
        save(settings);
        view.layersChanged();
      },
    })),
  );
  replace(host, h("div", { class: "segmented", role: "group", "aria-label": "Camera" }, ...directions), follow, shown);
  return { follow: () => follow.click(), look: (index: number) => directions[index]?.click() };
}

/** Shows a note if the picture is not of the documents' plan. */
export function staleNote(host: HTMLElement, studio: Studio, link: RobotLink) {
  const update = () => {
    if (link.view) {
      // The picture shows the robot, not the plan.
      host.hidden = link.view.contact;
      host.classList.add("bad");
      host.textContent = "The robot does not answer: the picture shows an old state";
      return;
    }
    const { shown } = studio;
    const failed = shown !== null && !shown.drag && !studio.dragging && !shown.planned.converged && !studio.stale;
    const behind = studio.stale && !studio.dragging;
    host.hidden = !(behind || failed);
    host.classList.toggle("bad", failed);
    host.textContent = failed ? "This motion does not meet its constraints" : studio.planning ? "Planning: the picture shows the previous plan" : "The picture shows an earlier plan";
  };
  studio.events.on(["activity", "plan", "documents"], update);
  link.onChange(update);
}
