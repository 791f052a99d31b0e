// What the page sees of a gamepad, sixty times a second: browsers tell it to pages alone. What buttons mean is known to the engine.
// A page that is not in front sees none, and one that is busy tells nothing: either is as if the deadman was let go.

import type { GamepadSeen } from "../contract.ts";

const LOOK_MS = 16;

/** Looks until the function that it returns is called. */
export function watchGamepad(saw: (seen: GamepadSeen) => void): () => void {
  /** The one that is used as long as it is there. */
  let index = -1;
  const look = (): GamepadSeen => {
    if (document.hidden) return { gone: "this page is in the background" };
    const all = [...(navigator.getGamepads?.() ?? [])].filter((pad) => pad?.connected) as Gamepad[];
    const standard = all.filter((pad) => pad.mapping === "standard");
    const pad = standard.find((one) => one.index === index) ?? standard[0];
    if (!pad) return { gone: all.length > 0 ? `${all[0].id} is not a standard gamepad for this browser` : "the browser reports no gamepad" };
    index = pad.index;
    return { id: pad.id, buttons: pad.buttons.map((one) => one.value), axes: [...pad.axes] };
  };
  const timer = setInterval(() => saw(look()), LOOK_MS);
  return () => clearInterval(timer);
}
