// The page that `rollwalk studio` serves, with the native engine, and a robot on a bus of this computer. STUDIO_ROLLWALK and
// STUDIO_SIM are the programs.
import assert from "node:assert/strict";
import { cp, mkdtemp, readFile, writeFile } from "node:fs/promises";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, before, describe, test } from "node:test";
import { launch, Studio, WAIT_MS } from "./harness.mjs";
import { program, root, serveStudio, simulator, startRobot } from "./programs.mjs";
import { armRobot, outlivesBusyPage, play, runRobot } from "./robot.mjs";

const browsers = (process.env.STUDIO_BROWSERS ?? "chromium,firefox").split(",");

for (const name of browsers) describe(`the page that rollwalk studio serves, in ${name}`, { skip: program && simulator ? false : "STUDIO_ROLLWALK and STUDIO_SIM name no programs" }, () => {
  let folder, robot, served, browser, studio;
  before(async () => {
    folder = await mkdtemp(join(tmpdir(), "studio-"));
    for (const part of ["motions", "robots"]) await cp(join(root, part), join(folder, part), { recursive: true });
    robot = await startRobot(folder, "sim:robot.sock");
    served = await serveStudio(folder, ["motions/test_leg_library.toml", "--bus", "sim:robot.sock"]);
    browser = await launch(name);
    // Robots wait 0.25 s for a heartbeat: drawing in software leaves the programs too little of the processors.
    studio = await Studio.open(browser, `${served.address}&quality=low`);
  });
  after(async () => {
    await browser?.close();
    served?.kill();
    robot?.kill();
  });

  test("opens the files of the command line, and saves them in place", async () => {
    const path = await studio.state("state.documents.motionPath");
    assert.equal(await studio.converged(), true);
    await studio.edit(() => studio.type("Duration", "1.2"));
    await studio.press("Control", "s");
    await studio.page.waitForFunction(() => /Saved/.test(globalThis.studio.state.notice), { timeout: WAIT_MS });
    assert.match(await readFile(join(folder, path), "utf8"), /^duration_s = 1\.2/m);
  });

  test("follows an edit and undoes it", async () => {
    const original = await studio.text();
    await studio.edit(() => studio.type("Duration", "1.4"));
    assert.match(await studio.text(), /^duration_s = 1\.4/m);
    assert.equal(await studio.converged(), true);
    await studio.edit(() => studio.press("Control", "z"));
    assert.equal(await studio.text(), original);
  });

  test("a simulated robot is flashed, armed by holding, plays, and is stopped with Escape", () => runRobot(studio));

  test("a robot on a bus of this computer is flashed, armed, plays, and is stopped", () => runRobot(studio, "relay"));

  // In Firefox bytes of a worker's WebSocket pass through the page's own thread: there the first would disarm it.
  test("it stays armed while the page is busy for half a second, and does not for three", { skip: name === "firefox" }, async () => {
    await studio.button("Connect");
    await studio.page.waitForFunction(() => globalThis.studio.link.view?.contact, { timeout: WAIT_MS });
    await studio.button("Clear faults");
    await studio.page.waitForFunction(() => globalThis.studio.link.view.state === "disarmed", { timeout: WAIT_MS });
    await studio.button("Disconnect");
    await studio.page.waitForFunction(() => !globalThis.studio.link.connected, { timeout: WAIT_MS });
    await armRobot(studio, "relay");
    await play(studio);
    await outlivesBusyPage(studio);
    await studio.button("Disconnect");
    await studio.page.waitForFunction(() => !globalThis.studio.link.connected, { timeout: WAIT_MS });
  });

  test("a controller that insists on a link key obeys a page that has it", async () => {
    const key = join(folder, "robot.key");
    await writeFile(key, `rollwalk-link-key-1 ${"5a".repeat(32)}\n`);
    const keyed = await startRobot(folder, "sim:keyed.sock", ["--link-key", key]);
    const served = await serveStudio(folder, ["motions/test_leg_library.toml", "--bus", "sim:keyed.sock"]);
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
    await studio.page.waitForFunction(() => globalThis.studio.link.view?.contact, { timeout: WAIT_MS });
    const other = await Studio.open(browser, studio.page.url());
    await other.click("#tab-run");
    await other.page.select("#place", "relay");
    await other.button("Connect");
    await other.page.waitForFunction(() => /another page has sim:robot.sock/.test(document.querySelector(".steps .note").textContent), { timeout: WAIT_MS });
    assert.equal(await other.state("link.connected"), false);
    await other.page.close();
    assert.equal(await studio.state("link.connected"), true);
  });

  test("no error on the console", () => assert.deepEqual(studio.errors, []));
});
