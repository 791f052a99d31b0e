// The page that `rollwalk studio` serves, with the native engine and files of this computer. STUDIO_ROLLWALK is the program.
import assert from "node:assert/strict";
import { cp, mkdtemp, readFile } from "node:fs/promises";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, before, describe, test } from "node:test";
import { launch, Studio, WAIT_MS } from "./harness.mjs";
import { program, root, serveStudio } from "./programs.mjs";

const browsers = (process.env.STUDIO_BROWSERS ?? "chromium,firefox").split(",");

for (const name of browsers) describe(`the page that rollwalk studio serves, in ${name}`, { skip: program ? false : "STUDIO_ROLLWALK names no program" }, () => {
  let folder, served, browser, studio;
  before(async () => {
    folder = await mkdtemp(join(tmpdir(), "studio-"));
    for (const part of ["motions", "robots"]) await cp(join(root, part), join(folder, part), { recursive: true });
    served = await serveStudio(folder, ["motions/test_leg_library.toml"]);
    browser = await launch(name);
    studio = await Studio.open(browser, `${served.address}&quality=low`);
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

  test("no error on the console", () => assert.deepEqual(studio.errors, []));
});
