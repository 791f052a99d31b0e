// Tests of `rollwalk studio` with each kind of file, and of the restored project after a reload and a new start. STUDIO_ROLLWALK is
// the program.
import assert from "node:assert/strict";
import { cp, mkdtemp, readFile, writeFile } from "node:fs/promises";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, before, describe, test } from "node:test";
import { launch, Studio } from "./harness.mjs";
import { Program, program, root, serveStudio } from "./programs.mjs";

const browsers = (process.env.STUDIO_BROWSERS ?? "chromium,firefox").split(",");

for (const name of browsers) describe(`what rollwalk studio opens, in ${name}`, { skip: program ? false : "STUDIO_ROLLWALK names no program" }, () => {
  let folder, browser;
  before(async () => {
    folder = await mkdtemp(join(tmpdir(), "studio-"));
    for (const part of ["motions", "robots", "designs"]) await cp(join(root, "shipped", part), join(folder, part), { recursive: true });
    browser = await launch(name);
  });
  after(() => browser?.close());

  /** Serves files, and calls `look` with the page. */
  const opened = async (files, look) => {
    const served = await serveStudio(folder, files);
    const studio = await Studio.open(browser, `${served.address}&quality=low`);
    try {
      await look(studio);
      assert.deepEqual(studio.errors, []);
    } finally {
      await studio.page.close();
      await served.end();
    }
  };

  test("a robot file is shown, with a first motion of its own", () =>
    opened(["robots/pup.toml"], async (studio) => {
      assert.equal(await studio.state("state.scene.name"), "pup");
      assert.equal(await studio.state("state.documents.robotPath"), "robots/pup.toml");
      assert.equal(await studio.converged(), true);
      assert.match(await studio.words(), /No motion was given/);
    }));

  test("a robot file that is named beside a motion is the robot that moves", async () => {
    const other = (await readFile(join(folder, "robots/agilebot.toml"), "utf8")).replace('name = "agilebot"', 'name = "agilebot_2"');
    await writeFile(join(folder, "robots/agilebot_2.toml"), other);
    await opened(["robots/agilebot_2.toml", "motions/walk.toml"], async (studio) => {
      await studio.until(() => globalThis.studio.state.scene.name === "agilebot_2");
      await studio.settled();
      assert.match(await studio.text(), /^robot = "..\/robots\/agilebot_2.toml"/m);
      assert.equal(await studio.converged(), true);
    });
  });

  test("a design is shown with its robot, whichever its motion names", async () => {
    const design = await readFile(join(folder, "designs/agilebot_fast_trot.toml"), "utf8");
    await writeFile(join(folder, "designs/other.toml"), design.replace("agilebot.toml", "agilebot_2.toml"));
    await opened(["designs/other.toml"], async (studio) => {
      await studio.until(() => globalThis.studio.state.scene.name === "agilebot_2");
      assert.equal(await studio.state("state.motion.name"), "trot");
    });
  });

  test("a URDF becomes a robot with a motion", async () => {
    await cp(join(root, "robot/tests/urdf/rover.urdf"), join(folder, "rover.urdf"));
    await opened(["rover.urdf"], async (studio) => {
      assert.equal(await studio.state("state.documents.robotPath"), "rover.toml");
      assert.equal(await studio.converged(), true);
      assert.match(await studio.page.$eval(".remarks", (element) => element.textContent), /of the import of rover.urdf/);
    });
    // Nothing was edited, so the present file counts.
    const urdf = await readFile(join(folder, "rover.urdf"), "utf8");
    await writeFile(join(folder, "rover.urdf"), urdf.replace(/<robot name="[^"]*"/, '<robot name="rover_2"'));
    await opened(["rover.urdf"], async (studio) => {
      assert.equal(await studio.state("state.scene.name"), "rover_2");
      assert.doesNotMatch(await studio.words(), /Restored|your edits/);
    });
  });

  test("a robot file with faults is open to be mended", async () => {
    const pup = await readFile(join(folder, "robots/pup.toml"), "utf8");
    await writeFile(join(folder, "robots/faulty.toml"), pup.replace("friction_coefficient = 0.8", "friction_coefficient = 80"));
    await opened(["robots/faulty.toml"], async (studio) => {
      assert.match(await studio.words(), /friction_coefficient/);
      await studio.page.evaluate((pup) => globalThis.studio.state.write("robots/faulty.toml", pup, null), pup);
      await studio.settled();
      assert.equal(await studio.converged(), true);
    });
  });

  test("a library with a plan in it can be built", async () => {
    const library = (await readFile(join(folder, "motions/test_leg_library.toml"), "utf8")).replace(/file = "test_leg_roll.toml"/, 'plan = "roll.json"');
    const plan = new Program(program, ["plan", "motions/test_leg_roll.toml", "--no-simulation", "-o", "motions/roll.json"], folder);
    await plan.ended();
    await writeFile(join(folder, "motions/planned_library.toml"), library);
    assert.match(library, /roll.json/);
    await opened(["motions/planned_library.toml"], async (studio) => {
      await studio.click("#tab-library");
      await studio.button("Build library");
      await studio.until(() => Number(document.querySelector("[data-built]")?.dataset.built) > 100);
    });
  });

  test("a plan of a shipped motion is shown with that motion", async () => {
    const plan = new Program(program, ["plan", "motions/walk.toml", "--no-simulation", "-o", "walk.json"], folder);
    await plan.ended();
    await opened(["walk.json"], async (studio) => {
      assert.equal(await studio.state("state.motion.name"), "walk");
      assert.equal(await studio.converged(), true);
    });
  });

  test("a tab does not overwrite the edits that another tab has stored since", async () => {
    const served = await serveStudio(folder, ["motions/pace.toml"]);
    const address = `${served.address}&quality=low`;
    const first = await Studio.open(browser, address);
    await first.edit(() => first.type("Forward", "0.11"));
    const second = await Studio.open(browser, address);
    try {
      assert.match(await second.text(), /^forward_m = 0\.11$/m);
      await second.edit(() => second.type("Forward", "0.12"));
      await first.page.bringToFront();
      await first.edit(() => first.type("Forward", "0.13"));
      await first.until(() => document.body.textContent.includes("another tab has unsaved edits of these files"));
      await second.page.bringToFront();
      await second.page.reload();
      await second.settled();
      assert.match(await second.text(), /^forward_m = 0\.12$/m);
    } finally {
      for (const studio of [first, second]) await studio.page.close();
      await served.end();
    }
  });

  test("what was edited and not saved is there after a reload and a new start, with its undo, and leaving asks", async () => {
    const original = await readFile(join(folder, "motions/walk.toml"), "utf8");
    const isEdited = async (studio) => {
      assert.match(await studio.text(), /^forward_m = 0\.11$/m);
      assert.equal(await studio.state("state.documents.anyChanged"), true);
      assert.match(await studio.words(), /Restored/);
    };
    await opened(["motions/walk.toml"], async (studio) => {
      await studio.edit(() => studio.type("Forward", "0.11"));
      await studio.page.reload();
      assert.deepEqual(studio.questions, ["beforeunload"]);
      await studio.settled();
      await isEdited(studio);
    });
    await opened(["motions/walk.toml"], async (studio) => {
      await isEdited(studio);
      await studio.edit(() => studio.press("Control", "z"));
      assert.equal(await studio.text(), original);
      await studio.edit(() => studio.press("Control", "y"));
    });
    // For another file, nothing is restored.
    await opened(["motions/trot.toml"], async (studio) => {
      assert.equal(await studio.state("state.documents.anyChanged"), false);
      await studio.page.reload();
      assert.deepEqual(studio.questions, []);
    });
    // A file that has changed meanwhile is shown; one step of undo restores the edits.
    await writeFile(join(folder, "motions/walk.toml"), `${original}\n# by an editor\n`);
    await opened(["motions/walk.toml"], async (studio) => {
      assert.match(await studio.text(), /# by an editor/);
      assert.match(await studio.words(), /Undo \(Ctrl\+Z\) restores your edits/);
      await studio.edit(() => studio.press("Control", "z"));
      assert.match(await studio.text(), /^forward_m = 0\.11$/m);
    });
    await writeFile(join(folder, "motions/walk.toml"), original);
  });
});
