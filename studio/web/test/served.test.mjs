// The page that `rollwalk studio` serves, with the native engine and files of this computer. STUDIO_ROLLWALK is the program.
import assert from "node:assert/strict";
import { cp, mkdtemp, readFile } from "node:fs/promises";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, before, describe, test } from "node:test";
import { launch, Studio } from "./harness.mjs";
import { program, root, serveStudio } from "./programs.mjs";
import { WAIT_MS } from "./within.mjs";

const browsers = (process.env.STUDIO_BROWSERS ?? "chromium,firefox").split(",");

for (const name of browsers) describe(`the page that rollwalk studio serves, in ${name}`, { skip: program ? false : "STUDIO_ROLLWALK names no program" }, () => {
  let folder, served, browser, studio;
  before(async () => {
    folder = await mkdtemp(join(tmpdir(), "studio-"));
    for (const part of ["motions", "robots"]) await cp(join(root, "shipped", part), join(folder, part), { recursive: true });
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
    await studio.until(() => /Saved/.test(globalThis.studio.state.notice));
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

  test("a library that is begun changes no plan, and the plan is the library's", async () => {
    await studio.example("motions/walk.toml");
    // Any order of edits leads to the same plan.
    const frames = () => studio.page.evaluate(() => Array.from(globalThis.studio.state.shown.frames.data));
    await studio.edit(() => studio.type("Forward", "0.11"));
    await studio.edit(() => studio.type("Forward", "0.12"));
    const before = await frames();
    const shown = await studio.state("state.shown.of");
    await studio.click("#tab-library");
    await studio.edit(() => studio.button("New library"));
    assert.equal(await studio.state("state.shown.of"), shown);
    assert.deepEqual(await frames(), before);
    await studio.button("Build library");
    await studio.until(() => Number(document.querySelector("[data-built]")?.dataset.built) > 100, undefined, 4 * WAIT_MS);
    const compared = await studio.page.evaluate(async () => {
      const { state } = globalThis.studio;
      const { documents, engine } = state;
      const library = documents.libraryPath;
      const built = await engine.request("library", { kind: "library", files: documents.files(), library });
      const body = { kind: "compare", files: documents.files(), motion: documents.motionPath, library };
      return (await engine.request("solver", body, { binary: built.binary })).value;
    });
    assert.equal(compared.why, "");
    await studio.click("#tab-motion");
  });

  test("what is said of a plan does not move the field that is being edited", async () => {
    await studio.example("motions/test_leg_roll.toml");
    const at = async () => (await studio.field("Forward")).evaluate((input) => input.getBoundingClientRect().y);
    const before = await at();
    await studio.edit(() => studio.type("Forward", "3"));
    assert.equal(await studio.converged(), false);
    assert.equal(await at(), before);
    await studio.edit(() => studio.press("Control", "z"));
    assert.equal(await at(), before);
  });

  test("what is in the way is said at once, while numbers that work are sought, and that can be stopped", async () => {
    await studio.example("motions/walk.toml");
    await studio.type("Forward", "1.2");
    await studio.until(() => document.querySelector(".status").dataset.state === "refused");
    assert.match(await studio.words(), /Not met yet[^]*displacement goal/);
    await studio.button("Stop");
    await studio.settled();
    assert.match(await studio.words(), /Planning was stopped/);
    await studio.edit(() => studio.press("Control", "z"));
    assert.equal(await studio.converged(), true);
  });

  test("paths and goal go on into the next cycles with the robot", async () => {
    await studio.example("motions/walk.toml");
    const goalAt = async (cycle) => {
      await studio.page.evaluate((cycle) => {
        const { playback, state } = globalThis.studio;
        playback.playing = true;
        playback.seek((cycle + 0.1) * state.shown.frames.header.duration_s);
        playback.pause();
      }, cycle);
      await studio.until((cycle) => globalThis.studio.playback.cycle === cycle, cycle);
      await studio.page.evaluate(() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done))));
      return await studio.state("view.handles.group.position.x");
    };
    if (!(await studio.state("view"))) return;
    assert.equal(await goalAt(0), 0);
    const offset_m = await studio.state("state.shown.frames.header.period.offset_m.0");
    assert.ok(Math.abs((await goalAt(3)) - 3 * offset_m) < 1e-9);
    assert.ok(offset_m > 0.1);
  });

  test("a plan that asks for more than a motor has is not said to hold all constraints", async () => {
    await studio.page.evaluate(() => {
      const { state } = globalThis.studio;
      const { planned } = state.shown;
      const limit = planned.scene.joints[0].speed_max_rad_s;
      planned.scene.joints[0].speed_max_rad_s = limit / 100;
      state.events.emit("plan", "activity");
    });
    assert.match(await studio.words(), /exceeds the limit of a motor/);
    assert.doesNotMatch(await studio.words(), /All constraints hold/);
    await studio.edit(() => studio.page.evaluate(() => globalThis.studio.state.planAgain()));
    assert.match(await studio.words(), /All constraints hold/);
  });

  test("a URDF becomes a robot with a motion, and says what was assumed", async () => {
    const drop = (name, text) =>
      studio.page.evaluate(
        (name, text) => {
          const dataTransfer = new DataTransfer();
          dataTransfer.items.add(new File([text], name));
          document.querySelector(".status").dispatchEvent(new DragEvent("drop", { dataTransfer, bubbles: true, cancelable: true }));
        },
        name,
        text,
      );
    const rover = await readFile(join(root, "robot/tests/urdf/rover.urdf"), "utf8");
    await studio.edit(() => drop("rover.urdf", rover));
    assert.equal(await studio.state("state.documents.robotPath"), "rover.toml");
    assert.equal(await studio.converged(), true);
    assert.match(await studio.page.$eval(".remarks", (element) => element.textContent), /assumptions? of the import of rover.urdf/);
    // An edit of the side file is applied on request, and the motion stays.
    const friction = () => studio.state("state.scene.end_effectors.0.friction_coefficient");
    const [was, motion] = [await friction(), await studio.text()];
    await studio.page.evaluate(() => {
      const { state } = globalThis.studio;
      const side = state.documents.now.files.find(({ path }) => path.endsWith(".side.toml"));
      state.write(side.path, side.text.replaceAll(/friction_coefficient = [\d.]+/g, "friction_coefficient = 0.55"), null);
    });
    await studio.settled();
    assert.equal(await friction(), was);
    await studio.edit(() => studio.button("Import rover.toml again with the changed rover.side.toml"));
    assert.equal(await friction(), 0.55);
    assert.equal(await studio.text(), motion);
    await drop("bad.urdf", "<robot name='r'>\n<link/>\n</robot>");
    await studio.until(() => /bad\.urdf, line 2/.test(document.querySelector(".status-body").textContent));
    assert.equal(await studio.state("state.documents.robotPath"), "rover.toml", "what was open stays");
  });

  test("a library of one's own begins with the motion at hand, and its graph is edited", async () => {
    await studio.example("motions/walk.toml");
    await studio.click("#tab-library");
    await studio.edit(() => studio.button("New library"));
    const rows = () => studio.page.$$eval(".graph-list strong", (names) => names.map((name) => name.textContent));
    await studio.until(() => document.querySelectorAll(".graph-list strong").length === 2);
    assert.deepEqual(await rows(), ["stand", "walk"]);
    await studio.edit(() => studio.button("Add transition"));
    await studio.page.waitForSelector('[aria-label="Remove the transition from stand to walk"]');
    assert.match(await studio.text("libraryPath"), /\[\[transition\]\]\nfrom = "stand"\nto = "walk"\nduration_s = 1.2/);
    await studio.edit(() => studio.click('[aria-label="Remove the transition from stand to walk"]'));
    assert.doesNotMatch(await studio.text("libraryPath"), /\[\[transition/);
    await studio.button("Build library");
    await studio.until(() => Number(document.querySelector("[data-built]")?.dataset.built) > 100, undefined, 4 * WAIT_MS);
    await studio.edit(() => studio.press("Control", "z"));
  });

  test("no error on the console", () => assert.deepEqual(studio.errors, []));
});
