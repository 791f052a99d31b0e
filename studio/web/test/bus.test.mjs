// Robots in real time behind the page that `rollwalk studio` serves: simulated by its engine, and on a bus of this computer.
// STUDIO_ROLLWALK and STUDIO_SIM are the programs.
import assert from "node:assert/strict";
import { mkdtemp, writeFile } from "node:fs/promises";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, before, describe, test } from "node:test";
import { launch, Studio } from "./harness.mjs";
import { program, root, serveStudio, simulator, startRobot } from "./programs.mjs";
import { arm, clearFaults, flashRobot, outlivesBusyPage, runRobot, stop } from "./robot.mjs";

const browsers = (process.env.STUDIO_BROWSERS ?? "chromium,firefox").split(",");

for (const name of browsers) describe(`a robot behind the page that rollwalk studio serves, in ${name}`, { skip: program && simulator ? false : "STUDIO_ROLLWALK and STUDIO_SIM name no programs" }, () => {
  let folder, bus, robot, served, browser, studio;
  before(async () => {
    folder = await mkdtemp(join(tmpdir(), "studio-"));
    bus = `sim:${join(folder, "robot.sock")}`;
    robot = await startRobot(root, bus);
    served = await serveStudio(root, ["motions/test_leg_library.toml", "--bus", bus]);
    browser = await launch(name);
    // Robots wait 0.25 s for a heartbeat. Drawing in software leaves too little processor time to the programs.
    studio = await Studio.open(browser, `${served.address}&quality=low`);
  });
  after(async () => {
    await browser?.close();
    served?.kill();
    robot?.kill();
  });

  test("a simulated robot is flashed, armed by holding, plays, and is stopped with Escape", () => runRobot(studio));

  test("a robot on a bus of this computer is flashed, armed, plays, and is stopped", () => runRobot(studio, "relay"));

  test("a robot that has a library is played by a page that has none, by name or by number", async () => {
    for (const [env, motion] of [[{}, "roll"], [{ XDG_CACHE_HOME: join(folder, "cache") }, "motion 2"]]) {
      const served = await serveStudio(root, ["robots/test_leg.toml", "--bus", bus], env);
      const other = await Studio.open(browser, `${served.address}&quality=low`);
      await other.click("#tab-run");
      await other.page.select("#place", "relay");
      await other.button("Connect");
      await other.until(() => globalThis.studio.link.view?.library && document.querySelector(".motions button"));
      assert.match(await other.page.$eval(".motions", (list) => list.innerText), new RegExp(motion));
      await clearFaults(other);
      for (let attempt = 1; !(await arm(other)) && attempt < 3; attempt++) await clearFaults(other);
      await other.click(`::-p-xpath(//div[contains(@class, "motions")]//button[contains(., "${motion}")])`);
      await other.until(() => globalThis.studio.link.view.playing);
      await stop(other);
      await other.page.close();
      await served.end();
    }
  });

  // In Firefox, bytes of a worker's WebSocket pass through the page's thread, where the first delay would disarm the robot.
  test("it stays armed while the page is busy for half a second, and does not for three", { skip: name === "firefox" }, async () => {
    await studio.button("Connect");
    await studio.until(() => globalThis.studio.link.view?.contact);
    await clearFaults(studio);
    await studio.button("Disconnect");
    await studio.until(() => !globalThis.studio.link.connected);
    await flashRobot(studio, "relay");
    await outlivesBusyPage(studio);
    await studio.button("Disconnect");
    await studio.until(() => !globalThis.studio.link.connected);
  });

  test("a controller that insists on a link key obeys a page that has it", async () => {
    const key = join(folder, "robot.key");
    await writeFile(key, `rollwalk-link-key-1 ${"5a".repeat(32)}\n`);
    const bus = `sim:${join(folder, "keyed.sock")}`;
    const keyed = await startRobot(root, bus, ["--link-key", key]);
    const served = await serveStudio(root, ["motions/test_leg_library.toml", "--bus", bus]);
    try {
      const other = await Studio.open(browser, `${served.address}&quality=low`);
      await other.click("#tab-run");
      await other.click(".more summary");
      await (await other.page.waitForSelector("input[aria-label^='Link key']")).uploadFile(key);
      await runRobot(other, "relay");
      assert.deepEqual(other.errors, []);
      await other.page.close();
    } finally {
      served.kill();
      keyed.kill();
    }
  });

  test("a second page is told that the first has the bus", async () => {
    await studio.button("Connect");
    await studio.until(() => globalThis.studio.link.view?.contact);
    const other = await Studio.open(browser, studio.page.url());
    await other.click("#tab-run");
    await other.page.select("#place", "relay");
    await other.button("Connect");
    await other.until(() => /another page uses sim:.*robot.sock/.test(document.querySelector(".steps .note").textContent));
    assert.equal(await other.state("link.connected"), false);
    await other.page.close();
    assert.equal(await studio.state("link.connected"), true);
  });

  test("no error on the console", () => assert.deepEqual(studio.errors, []));
});
