// State of a gamepad, sixty times per second. Browsers report gamepads only to pages. The engine interprets the buttons. A page in
// the background sees no gamepad, and a busy page reports nothing; both act like a release of the deadman.

import type { GamepadSeen } from "../contract.ts";

const LOOK_MS = 16;

/** Reports until the returned function is called. */
export function watchGamepad(saw: (seen: GamepadSeen) => void): () => void {
  /** The gamepad in use, as long as it is connected. */
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
