// Tests of the page with serial ports: a controller's line, and a CAN adapter with SLCAN. Simulated robots are at the other ends,
// and `rollwalk studio` serves the page. STUDIO_ROLLWALK and STUDIO_SIM are the programs.
import assert from "node:assert/strict";
import { mkdtemp } from "node:fs/promises";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, before, describe, test } from "node:test";
import { launch, Studio } from "./harness.mjs";
import { fakeSerial, serialLine, slcanAdapter } from "./line.mjs";
import { program, root, serveStudio, simulator, startRobot } from "./programs.mjs";
import { flashRobot, runRobot } from "./robot.mjs";

describe("a robot at a serial port", { skip: program && simulator ? false : "STUDIO_ROLLWALK and STUDIO_SIM name no programs" }, () => {
  let served, browser, studio, line, adapter;
  const robots = [];
  /** Far end of the cable. */
  let far;
  // One message to the browser at a time, with all bytes since the last. One message for each read of the line would form a queue,
  // until bytes are late for the robot.
  const from = (end) => {
    let waiting = [];
    let isPassing = false;
    return async (bytes) => {
      waiting.push(...bytes);
      if (isPassing) return;
      isPassing = true;
      while (waiting.length > 0) {
        const passed = waiting;
        waiting = [];
        // The page may be closed already.
        if (far && far === end()) await studio.page.evaluate((bytes) => globalThis.fakeSerial.arrive(bytes), passed).catch(() => {});
      }
      isPassing = false;
    };
  };
  const until = (wanted, argument) => studio.until(wanted, argument);
  const trouble = (words) => until((words) => document.querySelector(".steps .note").textContent.includes(words), words);
  const set = (change) => studio.page.evaluate((change) => void Object.assign(globalThis.fakeSerial, change), change);
  const fake = (name) => studio.page.evaluate((name) => globalThis.fakeSerial[name], name);
  const open = (inWorkers) =>
    // Drawing in software delays the bytes that pass the page's thread, so little is drawn.
    Studio.open(browser, `${served.address}&quality=low`, {
      viewport: { height: 420 },
      async before(page) {
        await page.exposeFunction("serialOut", (bytes) => void far.send(Buffer.from(bytes)));
        await page.evaluateOnNewDocument(fakeSerial, inWorkers);
      },
    });
  before(async () => {
    const folder = await mkdtemp(join(tmpdir(), "studio-"));
    line = await serialLine(from(() => line));
    robots.push(await startRobot(root, `serial:${line.device}`));
    robots.push(await startRobot(root, `sim:${join(folder, "robot.sock")}`));
    adapter = await slcanAdapter(join(folder, "robot.sock"), from(() => adapter));
    served = await serveStudio(root, ["motions/test_leg_library.toml"]);
    browser = await launch("chromium");
    studio = await open(false);
  });
  after(async () => {
    await browser?.close();
    for (const one of [line, adapter]) one?.close();
    for (const one of [served, ...robots]) one?.kill();
  });

  test("on its line is flashed, armed, plays, and is stopped, whatever pieces bytes arrive in", async () => {
    far = line;
    await runRobot(studio, "serial");
    await until(() => !globalThis.fakeSerial.isOpen);
    assert.equal(await fake("baud"), 115_200);
  });

  test("behind an SLCAN adapter is flashed, armed, plays, and is stopped", async () => {
    far = adapter;
    await runRobot(studio, "slcan");
    await until(() => !globalThis.fakeSerial.isOpen);
  });

  test("is gone when its adapter is pulled out, and found again", async () => {
    far = line;
    await studio.page.select("#place", "serial");
    for (const again of [false, true]) {
      await studio.button("Connect");
      await until(() => globalThis.studio.link.view?.contact);
      if (again) break;
      await studio.page.evaluate(() => globalThis.fakeSerial.lose());
      await trouble("the serial port was lost: The device has been lost.");
      assert.equal(await studio.state("link.connected"), false);
      await until(() => !globalThis.fakeSerial.isOpen);
    }
    assert.equal(await studio.page.$eval(".steps .note", (note) => note.textContent), "");
  });

  test("can be left in the middle of a transfer", async () => {
    await studio.button("Clear faults");
    await until(() => globalThis.studio.link.view.state === "disarmed");
    // The robot does not answer any more, so that the transfer stops in the middle.
    far = { send() {} };
    await studio.click(".run .flash");
    await until(() => globalThis.studio.link.view.transfer);
    await studio.button("Disconnect");
    await until(() => !globalThis.studio.link.connected && !globalThis.fakeSerial.isOpen);
  });

  test("is not there where the user chooses no port, or the port cannot be opened", async () => {
    far = line;
    await set({ refusal: "NotFoundError" });
    await studio.button("Connect");
    await trouble("No port was chosen.");
    await set({ refusal: null, failure: "Failed to open serial port." });
    await studio.button("Connect");
    await trouble("Failed to open serial port.");
    assert.equal(await studio.state("link.connected"), false);
    await set({ failure: null });
    await studio.button("Connect");
    await until(() => globalThis.studio.link.view?.contact);
  });

  test("is held by the worker where workers see the port", async () => {
    await studio.page.close();
    studio = await open(true);
    far = line;
    await studio.click("#tab-run");
    // The robot is not armed, because the fake port's bytes still come from the page, and a robot waits at most 0.25 s for them.
    await flashRobot(studio, "serial");
    assert.equal(await fake("isOpen"), true);
    await studio.button("Disconnect");
    await until(() => !globalThis.studio.link.connected && !globalThis.fakeSerial.isOpen);
    assert.equal(await studio.page.evaluate(() => globalThis.fakeSerial.port.readable), null, "the page's own was never opened");
  });

  test("no error on the console", () => assert.deepEqual(studio.errors, []));
});
