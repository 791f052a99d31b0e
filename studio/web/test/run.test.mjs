// Tests of a robot that stands and walks, simulated in the page: with the plan beside it, while the page is busy, and with a
// gamepad.
import assert from "node:assert/strict";
import { after, before, describe, test } from "node:test";
import { launch, serve, Studio } from "./harness.mjs";
import { fakePad } from "./pad.mjs";
import { armRobot, flashRobot, outlivesBusyPage, play, stop } from "./robot.mjs";

const browsers = (process.env.STUDIO_BROWSERS ?? "chromium,firefox").split(",");

for (const name of browsers) describe(`a robot simulated in ${name}`, () => {
  let server, browser, studio;
  const until = (wanted, argument) => studio.until(wanted, argument);
  const leave = async () => {
    await studio.button("Disconnect");
    await until(() => !globalThis.studio.link.connected);
  };
  before(async () => {
    server = await serve();
    browser = await launch(name);
    studio = await Studio.open(browser, `${server.origin}/?quality=low`);
    await studio.example("motions/agilebot_library.toml");
  });
  after(async () => {
    await browser?.close();
    server?.close();
  });

  test("stays armed while the page is busy for half a second, and does not for three", async () => {
    await flashRobot(studio);
    await outlivesBusyPage(studio);
    await leave();
  });

  test("is stopped by Escape while a list of choices is open", async () => {
    await flashRobot(studio);
    await studio.page.evaluate(() => addEventListener("keydown", () => (globalThis.sawKey = true), { capture: true }));
    const list = await studio.box('select[aria-label="Speed of playback"]');
    await studio.page.mouse.click(list.x + 10, list.y + 10);
    await new Promise((done) => setTimeout(done, 300));
    await studio.press("Escape");
    await until(() => globalThis.studio.link.view.state === "stopped by an emergency stop");
    // If the list takes the press of the key, its release stops the robot.
    if (name === "chromium") assert.equal(await studio.page.evaluate(() => globalThis.sawKey), undefined);
    await leave();
  });

  test("is shown beside its plan, with how far joints are from it", async (t) => {
    const words = () => studio.page.$eval(".beside", (note) => note.innerText);
    const says = (text) => until((text) => document.querySelector(".beside").innerText.includes(text), text);
    await studio.edit(() => studio.page.evaluate(() => globalThis.studio.state.chooseMotion("motions/drive_1m.toml")));
    await armRobot(studio);
    await says("The open plan is drive_1m of the robot's library");
    await play(studio);
    await until(() => globalThis.studio.beside.apart && globalThis.studio.link.view.playing?.time_s > 0.5);
    await says("Deviation from the plan");
    assert.ok(await studio.page.evaluate(() => globalThis.studio.beside.row() !== null));
    t.diagnostic(await words());
    if (process.env.STUDIO_PICTURES) await studio.page.screenshot({ path: `${process.env.STUDIO_PICTURES}/beside-${name}.png` });
    const { rad, most_rad, joint } = await studio.state("beside.apart");
    // Servos lag, but a drive deflects the legs by less than 0.1 rad.
    assert.ok(joint !== "" && rad > 0 && rad < 0.1 && most_rad >= rad && most_rad < 0.1, JSON.stringify({ joint, rad, most_rad }));
    // An edited plan is another motion, although its name is the same.
    await studio.click("#tab-motion");
    await studio.edit(() => studio.type("Forward", "0.9"));
    await studio.click("#tab-run");
    await says("The plan is not compared with the robot");
    assert.match(await words(), /drive_1m in the library differs by [\d.]+ rad(\/s)? from the plan/);
    assert.equal(await studio.page.evaluate(() => globalThis.studio.beside.row()), null);
    await studio.edit(() => studio.press("Control", "z"));
    await until(() => globalThis.studio.beside.compared?.clip != null);
    await stop(studio);
  });

  test("obeys a gamepad as long as its deadman is held, and is armed by holding a button", async () => {
    const [B, DEADMAN, START, UP] = [1, 5, 9, 12];
    // No finger is faster than the page's polling.
    const hold = async (...down) => {
      await studio.page.evaluate((down) => globalThis.fakePad.hold(down), down);
      await new Promise((done) => setTimeout(done, 150));
    };
    const said = (text) => until((text) => globalThis.studio.link.view.messages.some((one) => one.text.includes(text)), text);
    await studio.page.evaluate(fakePad);
    await studio.click("#use-gamepad");
    await flashRobot(studio);
    await until(() => /no gamepad yet/.test(globalThis.studio.link.view.gamepad));
    await hold();
    await until(() => /gamepad xbox, hold BTN_TR/.test(document.querySelector(".run .facts").textContent));
    await hold(START);
    await said("hold BTN_TR first");
    await hold(DEADMAN);
    await hold(DEADMAN, START);
    await new Promise((done) => setTimeout(done, 500));
    assert.equal(await studio.state("link.view.torque"), false, "half a second does not arm");
    await until(() => globalThis.studio.link.view.torque);
    await hold(DEADMAN);
    await until(() => globalThis.studio.link.view.state === "ready");
    await hold(DEADMAN, UP);
    await until(() => globalThis.studio.link.view.playing?.name.includes("drive_1m"));
    assert.equal(await studio.state("link.view.playing.rate"), 1, "a finger on the trigger does not slow it down");
    await hold();
    await until(() => globalThis.studio.link.view.state === "paused");
    await hold(DEADMAN);
    await studio.page.evaluate(() => (globalThis.fakePad.pad = null));
    await said("the gamepad is disconnected: the browser reports no gamepad");
    await hold(B);
    await said("EMERGENCY STOP");
    await until(() => !globalThis.studio.link.view.torque);
    await leave();
  });

  test("no error on the console", () => assert.deepEqual(studio.errors, []));
});
