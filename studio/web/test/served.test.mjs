// The page that `rollwalk studio` serves, with the native engine. STUDIO_ROLLWALK is the program.
import assert from "node:assert/strict";
import { spawn } from "node:child_process";
import { cp, mkdtemp, readFile } from "node:fs/promises";
import { tmpdir } from "node:os";
import { dirname, join } from "node:path";
import { after, before, describe, test } from "node:test";
import { fileURLToPath } from "node:url";
import { launch, Studio, WAIT_MS } from "./harness.mjs";
import { runRobot } from "./robot.mjs";

const program = process.env.STUDIO_ROLLWALK;
const root = join(dirname(fileURLToPath(import.meta.url)), "../../..");

const browsers = (process.env.STUDIO_BROWSERS ?? "chromium,firefox").split(",");

for (const name of browsers) describe(`the page that rollwalk studio serves, in ${name}`, { skip: program ? false : "STUDIO_ROLLWALK names no program" }, () => {
  let folder, served, browser, studio;
  before(async () => {
    folder = await mkdtemp(join(tmpdir(), "studio-"));
    for (const part of ["motions", "robots"]) await cp(join(root, part), join(folder, part), { recursive: true });
    served = spawn(program, ["studio", "motions/test_leg_library.toml", "--no-open"], { cwd: folder });
    let said = "";
    const address = await new Promise((resolve, reject) => {
      for (const stream of [served.stdout, served.stderr]) {
        stream.on("data", (data) => {
          said += data;
          const found = /http:\S+/.exec(said);
          if (found) resolve(found[0]);
        });
      }
      served.on("exit", () => reject(new Error(`rollwalk studio ended: ${said}`)));
    });
    browser = await launch(name);
    studio = await Studio.open(browser, address);
  });
  after(async () => {
    await browser?.close();
    served?.kill();
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

  test("no error on the console", () => assert.deepEqual(studio.errors, []));
});
