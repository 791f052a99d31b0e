// A robot on the Run tab, from connecting to leaving, as a person does it. The project at hand has a library.
import assert from "node:assert/strict";
import { WAIT_MS } from "./harness.mjs";

export async function runRobot(studio, place = "simulated") {
  const until = (wanted, argument) => studio.page.waitForFunction(wanted, { timeout: WAIT_MS }, argument);
  await studio.click("#tab-run");
  assert.equal(await studio.state("link.view"), null, "nothing is connected without a click");
  await studio.page.select("#place", place);
  await studio.button("Connect");
  await until(() => globalThis.studio.link.view?.contact);
  if ((await studio.page.$eval(".run .flash", (button) => button.textContent)) === "Build library") await studio.click(".run .flash");
  await until(() => document.querySelector(".run .flash").textContent === "Flash library" && !document.querySelector(".run .flash").disabled);
  await studio.click(".run .flash");
  await until(() => globalThis.studio.link.view.library && globalThis.studio.link.view.motions.length > 1);
  // A click is not enough to arm.
  await studio.click(".run .hold");
  assert.equal(await studio.state("link.view.torque"), false);
  await studio.page.focus(".run .hold");
  await studio.page.keyboard.down(" ");
  await until(() => globalThis.studio.link.view.torque);
  await studio.page.keyboard.up(" ");
  await until(() => globalThis.studio.link.view.state === "ready" && !document.querySelector(".motions button").disabled);
  const { name, code } = await studio.page.evaluate(() => globalThis.studio.link.view.motions.find((one) => one.code && !/stand/.test(one.name)));
  await studio.page.evaluate(() => document.activeElement.blur());
  await studio.press(String(code));
  await until((name) => globalThis.studio.link.view.playing?.name.includes(name), name);
  await studio.press("Escape");
  await until(() => !globalThis.studio.link.view.torque);
  assert.match(await studio.page.$eval(".messages", (list) => list.innerText), /emergency stop/i);
  await studio.button("Disconnect");
  await until(() => !globalThis.studio.link.connected);
}
