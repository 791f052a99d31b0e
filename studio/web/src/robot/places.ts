// Places of a robot that this page and its browser can reach.

import type { ConnectionKind } from "../contract.ts";
import { h } from "../ui/dom.ts";
import { hasSerial } from "./serial.ts";

const meta = (name: string) => document.querySelector<HTMLMetaElement>(`meta[name="${name}"]`)?.content;

/** Name of the bus that the serving program relays. */
const relayedBus = meta("relay");

/** Address at which the program that serves the page relays its bus. */
export function relayAddress(): string {
  const address = new URL("link", location.href);
  address.protocol = location.protocol === "https:" ? "wss:" : "ws:";
  address.hash = "";
  address.search = new URLSearchParams({ token: meta("token") ?? "" }).toString();
  return address.href;
}

/** The default is the previous place, else the bus of the serving program. */
export function placeOptions(before: ConnectionKind | null): HTMLElement[] {
  const all: [ConnectionKind, string, boolean][] = [
    ["simulated", "Simulated in this page", true],
    ["serial", hasSerial ? "Serial port" : "Serial port (needs Chromium, https or localhost)", hasSerial],
    ["slcan", hasSerial ? "CAN adapter (SLCAN)" : "CAN adapter (needs Chromium, https or localhost)", hasSerial],
    ["relay", relayedBus ? `Bus ${relayedBus}` : "Bus of this computer (rollwalk studio --bus)", relayedBus !== undefined],
  ];
  const begins = all.find(([place, , can]) => can && place === before)?.[0] ?? (relayedBus ? "relay" : "simulated");
  return all.map(([value, text, can]) => h("option", { value, text, disabled: !can, selected: value === begins }));
}
