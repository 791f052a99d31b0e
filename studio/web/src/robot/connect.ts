// Inputs before a connection, which stay valid during it: place of the robot, and gamepad.

import type { ConnectionKind } from "../contract.ts";
import { h } from "../ui/dom.ts";
import type { ConnectionSettings } from "./link.ts";
import { placeOptions } from "./places.ts";

const BAUDS = [115_200, 230_400, 460_800, 921_600, 1_000_000, 2_000_000];
/** Controllers have the numbers 0 to 14. */
const LAST_NODE = 14;

/** `before`: the last chosen place, if any. */
export function connectFields(before: ConnectionKind | null): { element: HTMLElement; wanted(): Promise<ConnectionSettings>; lock(locked: boolean): void } {
  const place = h("select", { id: "place", "aria-label": "Connection to the robot" }, ...placeOptions(before));
  const bauds = BAUDS.map((one) => h("option", { value: one, text: `${one.toLocaleString("en")} baud` }));
  const baud = h("select", { "aria-label": "Baud rate", hidden: true }, ...bauds);
  const choose = () => (baud.hidden = !["serial", "slcan"].includes(place.value));
  place.addEventListener("change", choose);
  choose();
  const gamepad = h("input", { type: "checkbox", id: "use-gamepad" });
  const node = h("input", { type: "number", min: 0, max: LAST_NODE, value: 1, "aria-label": "Number of the controller" });
  const key = h("input", { type: "file", "aria-label": "Link key, for a controller that requires a link key" });
  const more = h(
    "details",
    { class: "more" },
    h("summary", { text: "More" }),
    h("label", { class: "row" }, "Controller number", node),
    h("label", { class: "row" }, "Link key", key),
  );
  return {
    element: h(
      "div",
      { class: "connect" },
      h("div", { class: "row" }, place, baud),
      h("label", {}, gamepad, " Use a gamepad: the robot moves only while you hold the deadman switch"),
      more,
    ),
    async wanted() {
      return {
        place: place.value as ConnectionKind,
        baud: Number(baud.value),
        node: node.valueAsNumber,
        gamepad: gamepad.checked,
        key: (await key.files?.[0]?.text()) ?? null,
      };
    },
    lock(locked: boolean) {
      for (const field of [place, baud, gamepad, node, key]) field.disabled = locked;
    },
  };
}
