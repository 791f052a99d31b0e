// Actions of a user on the Run tab, from connecting to leaving. The present project has a library.
import assert from "node:assert/strict";
import { WAIT_MS } from "./within.mjs";

const waits = (studio) => (wanted, argument) => studio.until(wanted, argument);

/** Connects to a robot and flashes its library. */
export async function flashRobot(studio, place = "simulated") {
  const until = waits(studio);
  await studio.click("#tab-run");
  assert.equal(await studio.state("link.view"), null, "nothing is connected without a click");
  await studio.page.select("#place", place);
  await studio.button("Connect");
  await until(() => globalThis.studio.link.view?.contact);
  if ((await studio.page.$eval(".run .flash", (button) => button.textContent)) === "Build library") await studio.click(".run .flash");
  await until(() => document.querySelector(".run .flash").textContent === "Flash library" && !document.querySelector(".run .flash").disabled);
  await studio.click(".run .flash");
  // A robot that already had the library knows its motions at once, but cannot be armed during the transfer.
  await until(() => {
    const { library, messages, motions } = globalThis.studio.link.view;
    return library && motions.length > 1 && messages.some((one) => /uses the transferred library/.test(one.text));
  });
}

/** Connects to a robot, and arms it. */
export async function armRobot(studio, place) {
  await flashRobot(studio, place);
  await arm(studio);
}

/** Arms a robot; false if it stopped before it was ready. */
export async function arm(studio) {
  const until = waits(studio);
  // A click does not arm.
  await studio.click(".run .hold");
  assert.equal(await studio.state("link.view.torque"), false);
  const hold = async () => {
    await until(() => !document.querySelector(".run .hold").disabled);
    await studio.page.focus(".run .hold");
    await studio.page.keyboard.down(" ");
  };
  const armed = () => globalThis.studio.link.view.torque || globalThis.studio.link.view.state.startsWith("stopped");
  await repeatUntil(studio, hold, armed, { then: () => studio.page.keyboard.up(" ") });
  await until(() => {
    const { state } = globalThis.studio.link.view;
    return state.startsWith("stopped") || (state === "ready" && !document.querySelector(".motions button").disabled);
  });
  return await studio.state("link.view.torque");
}

/** Plays the first motion that is not a stand, by its number; false if the robot stopped before it played. */
export async function play(studio) {
  const until = waits(studio);
  const { name, code } = await studio.page.evaluate(() => globalThis.studio.link.view.motions.find((one) => one.code && !/stand/.test(one.name)));
  await studio.page.evaluate(() => document.activeElement.blur());
  const plays = (name) => {
    const { playing, state } = globalThis.studio.link.view;
    return playing?.name.includes(name) || state.startsWith("stopped");
  };
  await repeatUntil(studio, () => studio.press(String(code)), plays, { argument: name });
  return await studio.state("link.view.torque");
}

/** Stops the robot with Escape, and leaves it. */
export async function stop(studio) {
  await studio.press("Escape");
  await stopped(studio);
}

/** Stops the robot by a click while a dialog is open, and leaves it. */
async function stopBesideDialog(studio) {
  await studio.click('button[aria-label^="Keyboard"]');
  await studio.page.waitForSelector("dialog[open]");
  await studio.click(".estop");
  await waits(studio)(() => !globalThis.studio.link.view.torque);
  assert.notEqual(await studio.page.$("dialog[open]"), null, "the dialog is as it was");
  await studio.click('dialog [aria-label="Close"]');
  await stopped(studio);
}

async function stopped(studio) {
  const until = waits(studio);
  await until(() => !globalThis.studio.link.view.torque);
  assert.match(await studio.page.$eval(".messages", (list) => list.innerText), /emergency stop/i);
  // The status of the plan does not matter then.
  await until(() => /stopped by an emergency stop/.test(document.querySelector(".status-head").textContent));
  assert.doesNotMatch(await studio.words(), /hold/);
  await studio.button("Disconnect");
  await until(() => !globalThis.studio.link.connected);
}

export async function runRobot(studio, place) {
  await flashRobot(studio, place);
  for (let attempt = 1; !((await arm(studio)) && (await play(studio))); attempt++) {
    const said = (await studio.state("link.view.messages")).map((one) => one.text).join("\n");
    assert.ok(attempt < ATTEMPTS && /heartbeat lost/.test(said), said);
    await clearFaults(studio);
  }
  await stopBesideDialog(studio);
  // The library that was built here still names the motions of a robot with this library.
  if (place === "relay") {
    const until = waits(studio);
    await studio.button("Connect");
    await until(() => globalThis.studio.link.view?.motions.length > 1);
    await studio.button("Disconnect");
    await until(() => !globalThis.studio.link.connected);
  }
}

/** Blocks the page for some time. */
function busy(studio, ms) {
  return studio.page.evaluate((ms) => {
    const end = performance.now() + ms;
    while (performance.now() < end);
  }, ms);
}

/** A busy computer may stop all programs of a connection for longer than a robot waits, but not every time. */
const ATTEMPTS = 3;

/**
 * A robot with a library plays on while the page is busy for a moment, and returns to SAFE when the page is busy for longer than its
 * worker waits.
 */
export async function outlivesBusyPage(studio) {
  const until = waits(studio);
  const messages = async () => (await studio.state("link.view.messages")).map((one) => one.text).join("\n");
  const losses = async () => (await messages()).split("heartbeat lost").length;
  for (let attempt = 1, before = await losses(); ; attempt++, before = await losses()) {
    await arm(studio);
    await play(studio);
    await busy(studio, 500);
    const shown = await studio.state("link.view.time_s");
    await until((shown) => globalThis.studio.link.view.time_s > shown + 0.3, shown);
    if ((await losses()) === before) break;
    assert.ok(attempt < ATTEMPTS, await messages());
    await until(() => !globalThis.studio.link.view.torque);
    await clearFaults(studio);
  }
  assert.equal(await studio.state("link.view.torque"), true, await messages());
  await busy(studio, 3000);
  await until(() => !globalThis.studio.link.view.torque);
  assert.match(await messages(), /the page or terminal does not respond/);
  assert.match(await messages(), /heartbeat lost/);
}

/** Clears the stop of the robot. */
export async function clearFaults(studio) {
  await repeatUntil(studio, () => studio.button("Clear faults"), () => globalThis.studio.link.view.state === "disarmed");
}

/** Repeats an order until it is obeyed. On a busy computer, the robot or its answer may be late, and the page shows "try again". */
async function repeatUntil(studio, order, obeyed, { argument, then } = {}) {
  for (let attempt = 1; ; attempt++) {
    await order();
    const last = attempt === ATTEMPTS;
    const late = await studio.until(obeyed, argument, last ? WAIT_MS : 10_000).then(
      () => null,
      (error) => error,
    );
    await then?.();
    if (!late) return;
    assert.ok(!last, `${late.message}\n${JSON.stringify(await studio.state("link.view"), null, 1)}`);
  }
}
