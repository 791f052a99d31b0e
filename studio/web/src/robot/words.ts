// Texts about a robot, from its views.

import type { ConnectionKind, RobotView } from "../contract.ts";
import { format } from "../ui/dom.ts";

/** Time without an answer, ms, after which the robot is reported as silent, with possible causes. */
const SILENT_MS = 5_000;
/** Time for which messages are also shown beside the state, s. */
const LATEST_S = 6;

export function stateOf(view: RobotView, place: ConnectionKind | null): string {
  const which = place === "simulated" ? "The simulated robot" : "The robot";
  if (!view.contact) return `${which} does not answer${view.state === null ? " yet" : ""}.`;
  const playing = view.playing ? `: ${view.playing.name}` : "";
  const torque = view.state?.includes("torque") ? "" : `; torque is ${view.torque ? "on" : "off"}`;
  const fallen = view.simulated?.fallen ? " The robot has fallen." : "";
  return `${which} is ${view.state ?? "silent"}${playing}${torque}.${fallen}`;
}

/** Motions that can be requested. If the names of the library are unknown, those of the number keys; the robot may have fewer. */
export function motionsOf({ motions, library }: RobotView): { name: string; code: number | null }[] {
  if (motions.length > 0 || library === null) return motions;
  return Array.from({ length: 9 }, (_, index) => ({ name: `motion ${index + 1}`, code: index + 1 }));
}

/** Advice on the next step, or the reason that prevents it. */
export function adviceOf(view: RobotView, connected_ms: number): string {
  const reason = view.mismatch ?? view.complaint;
  if (reason) return reason;
  if (view.contact || view.state !== null || connected_ms < SILENT_MS) return view.advice;
  return "Check the robot's power, its bus and its controller number (under More). The page keeps trying.";
}

/** Newest message, while it is new. */
export function latestOf(view: RobotView): RobotView["messages"][number] | null {
  const latest = view.messages.at(-1);
  return latest && view.time_s - latest.at_s < LATEST_S ? latest : null;
}

export function factsOf(view: RobotView): string {
  const trip = view.round_trip_ms === null ? "" : `round trip ${format(view.round_trip_ms, 1)} ms · `;
  const strongest = view.channels.reduce((most, one) => Math.max(most, Math.abs(one.torque_nm)), 0);
  const known = (values: (number | null)[]) => values.filter((value) => value !== null);
  const temperatures = known(view.channels.map((one) => one.temperature_c));
  const voltages = known(view.channels.map((one) => one.voltage_v));
  const warmest = temperatures.length === 0 ? "" : ` · warmest actuator ${format(Math.max(...temperatures), 0)} °C`;
  const lowest = voltages.length === 0 ? "" : ` · lowest supply ${format(Math.min(...voltages), 1)} V`;
  const gamepad = view.gamepad === null ? "" : `${view.gamepad} · `;
  return `${gamepad}${trip}lost ${view.lost[0]} of ${view.lost[1]} messages · largest torque ${format(strongest, 2)} N·m${warmest}${lowest}`;
}
