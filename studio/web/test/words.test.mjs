// Texts about a robot.
import assert from "node:assert/strict";
import { test } from "node:test";
import { load } from "./load.mjs";

const { factsOf } = await load("src/robot/words.ts");

const view = (channels) => ({ channels, round_trip_ms: 1.25, lost: [0, 20], gamepad: null });
const channel = (torque_nm, temperature_c, voltage_v) => ({ torque_nm, temperature_c, voltage_v });

test("facts name the strongest torque, the warmest actuator and the lowest supply", () => {
  const none = factsOf(view([channel(0.5, null, null), channel(-1.5, null, null)]));
  assert.match(none, /largest torque 1\.50 N·m$/);
  const readings = factsOf(view([channel(0, 35, 11.94), channel(0, 41.4, null), channel(0, null, 12)]));
  assert.match(readings, /warmest actuator 41 °C · lowest supply 11\.9 V$/);
});
