// Tests of the page in Chromium, with all actions of a user.
import assert from "node:assert/strict";
import { mkdtemp, writeFile } from "node:fs/promises";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, afterEach, before, beforeEach, describe, test } from "node:test";
import { launch, serve, Studio } from "./harness.mjs";
import { runRobot } from "./robot.mjs";

describe("the page", () => {
  let server, browser, studio, context;
  before(async () => {
    server = await serve();
    browser = await launch("chromium");
  });
  after(async () => {
    await browser?.close();
    server?.close();
  });
  // Every test has a separate browser context, and thus separate storage.
  beforeEach(async () => {
    context = await browser.createBrowserContext();
    studio = await Studio.open(context, `${server.origin}/?quality=low`);
  });
  afterEach(async () => {
    const errors = studio?.errors ?? [];
    await context?.close();
    assert.deepEqual(errors, [], "errors on the console");
  });

  const stance = (foot) => studio.state(`state.motion.stance.${foot}`);

  test("the robot is drawn in its colours, and nothing is drawn while nothing changes", async () => {
    const box = await studio.box(".canvas");
    const colours = await studio.page.evaluate(async ({ width, height }) => {
      const { view } = globalThis.studio;
      view.stage.invalidate();
      await new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)));
      const canvas = document.createElement("canvas");
      [canvas.width, canvas.height] = [width, height];
      const pen = canvas.getContext("2d");
      pen.drawImage(view.stage.canvas, 0, 0, width, height);
      const { data } = pen.getImageData(0, 0, width, height);
      const count = new Set();
      for (let i = 0; i < data.length; i += 4) count.add((data[i] >> 4) * 256 + (data[i + 1] >> 4) * 16 + (data[i + 2] >> 4));
      return count.size;
    }, box);
    assert.ok(colours > 20, `${colours} colours`);
    const draws = await studio.state("view.stage.draws");
    await studio.page.evaluate(() => new Promise((done) => setTimeout(done, 500)));
    assert.equal(await studio.state("view.stage.draws"), draws);
  });

  test("plays, stops, steps and scrubs", async () => {
    await studio.press("Space");
    await studio.until(() => globalThis.studio.playback.time_s > 0.2);
    await studio.press("Space");
    assert.equal(await studio.state("playback.playing"), false);
    await studio.press("Home");
    await studio.press("ArrowRight");
    assert.ok(Math.abs((await studio.state("playback.time_s")) - 1 / 60) < 1e-6);
    const ruler = await studio.box(".ruler");
    await studio.page.mouse.click(ruler.x + ruler.width / 2, ruler.y + 9);
    assert.ok(Math.abs((await studio.state("playback.time_s")) - 0.8) < 0.02);
  });

  test("says what each parameter does, and again after a change", async () => {
    const shown = () => studio.page.$$eval(".slope", (all) => all.map((one) => one.textContent));
    const known = (before) => studio.until((before) => {
      const all = [...document.querySelectorAll(".slope")].map((one) => one.textContent);
      return all.every((one) => /^\+.*%\)$/.test(one)) && all.join() !== before ? true : null;
    }, before);
    await studio.click("#tab-robot");
    await studio.click("#slopes");
    await known("");
    const before = await shown();
    assert.ok(before.length > 8, before.join("; "));
    await studio.edit(() => studio.type("hip length", "0.055"));
    await known(before.join());
  });

  test("a plan of a motion that ships opens with it", async () => {
    await studio.example("motions/trot.toml");
    const { text } = await studio.page.evaluate(async () => (await globalThis.studio.state.engine.request("solver", { kind: "plan_json" })).value);
    await studio.example("motions/drive_1m.toml");
    await studio.edit(() =>
      studio.page.evaluate((text) => {
        const dataTransfer = new DataTransfer();
        dataTransfer.items.add(new File([text], "mine.json"));
        document.querySelector(".status").dispatchEvent(new DragEvent("drop", { dataTransfer, bubbles: true, cancelable: true }));
      }, text),
    );
    assert.equal(await studio.state("state.motion.name"), "trot");
    assert.equal(await studio.converged(), true);
  });

  test("undo comes back to the plan that was there", async () => {
    const energy = () => studio.state("state.shown.planned.solve.energy");
    const before = await energy();
    await studio.edit(() => studio.type("Forward", "0.2"));
    await studio.edit(() => studio.press("Control", "z"));
    assert.equal(await energy(), before);
  });

  test("a swing's edge is dragged in the footfall chart", async () => {
    const before = await stance(0);
    const land = await studio.box('.foot-track[data-foot="0"] .edge.land');
    const track = await studio.box('.foot-track[data-foot="0"]');
    const from = { x: land.x + land.width / 2, y: land.y + land.height / 2 };
    await studio.edit(() => studio.drag(from, { x: from.x - track.width / 32, y: from.y }));
    const after = await stance(0);
    assert.equal(after.filter((one) => !one).length, before.filter((one) => !one).length - 1);
    assert.match(await studio.text(), /^front_left\s*=\s*"[#.]{32}"$/m);
    assert.equal(await studio.converged(), true);
    await studio.edit(() => studio.press("Control", "z"));
    assert.deepEqual(await stance(0), before);
  });

  test("a whole swing is moved, and a new one painted", async () => {
    const before = await stance(0);
    const swing = await studio.box('.foot-track[data-foot="0"] .swing');
    const track = await studio.box('.foot-track[data-foot="0"]');
    const cell = track.width / 32;
    const middle = { x: swing.x + swing.width / 2, y: swing.y + swing.height / 2 };
    await studio.edit(() => studio.drag(middle, { x: middle.x + 2 * cell, y: middle.y }));
    const first = before.indexOf(false);
    assert.equal((await stance(0)).indexOf(false), first + 2);
    const at = { x: track.x + 2.5 * cell, y: track.y + track.height / 2 };
    await studio.edit(() => studio.drag(at, { x: at.x + 4 * cell, y: at.y }));
    assert.deepEqual((await stance(0)).slice(1, 8), [true, false, false, false, false, false, true]);
  });

  test("footfalls are edited with the keyboard alone", async () => {
    const before = await stance(1);
    await studio.page.focus('.foot-track[data-foot="1"] .swing[tabindex]');
    await studio.edit(() => studio.press("ArrowLeft"));
    assert.equal((await stance(1)).indexOf(false), before.indexOf(false) - 1);
    await studio.edit(() => studio.press("Alt", "ArrowRight"));
    assert.equal((await stance(1)).indexOf(false), before.indexOf(false));
    const focused = await studio.page.evaluate(() => document.activeElement.getAttribute("aria-label"));
    assert.match(focused, /front right, swing 1/);
    await studio.edit(() => studio.press("Delete"));
    assert.ok((await stance(1)).every(Boolean));
  });

  test("a gait is chosen by name", async () => {
    await studio.edit(() => studio.page.select("#gait", "stance"));
    assert.ok((await stance(0)).every(Boolean));
  });

  test("a target is added and dragged in the scene; the plan follows while dragging", async () => {
    await studio.edit(() => studio.button("Add target"));
    const target = await studio.state("state.motion.targets.0");
    assert.equal(target.of, "body");
    const from = await studio.page.evaluate(() => globalThis.studio.view.handles.screen({ kind: "target", index: 0 }));
    await studio.page.evaluate(() => {
      globalThis.drags = 0;
      globalThis.studio.state.events.on("plan", () => (globalThis.drags += globalThis.studio.state.shown.drag ? 1 : 0));
    });
    await studio.edit(async () => {
      await studio.page.mouse.move(from.x, from.y);
      await studio.page.mouse.down();
      await studio.page.mouse.move(from.x, from.y - 10);
      await studio.until(() => globalThis.drags > 0);
      await studio.page.mouse.move(from.x, from.y - 14);
      await studio.page.mouse.up();
    });
    const moved = await studio.state("state.motion.targets.0");
    assert.ok(Math.hypot(moved.forward_m - target.forward_m, moved.left_m - target.left_m) > 0.005, "the target did not move");
    assert.ok((await studio.text()).includes("[[target]]"));
    assert.equal(await studio.state("state.shown.drag"), false, "the last plan is one in full");
    // One gesture is one step of undo.
    await studio.edit(() => studio.press("Control", "z"));
    assert.deepEqual(await studio.state("state.motion.targets.0"), target);
  });

  test("a new plan is drawn without linking a program", async () => {
    const programs = () => studio.page.evaluate(() => globalThis.studio.view.stage.renderer.info.programs.map((one) => one.id));
    await studio.edit(() => studio.type("Forward", "0.11"));
    const before = await programs();
    await studio.edit(() => studio.type("Forward", "0.1"));
    await studio.page.evaluate(() => globalThis.studio.view.stage.draw());
    assert.deepEqual(await programs(), before);
  });

  test("the goal is dragged by its name like a slider", async () => {
    const label = await studio.box(".panels .field .field-label");
    await studio.edit(() => studio.drag({ x: label.x + 5, y: label.y + 5 }, { x: label.x - 15, y: label.y + 5 }));
    const goal = await studio.state("state.motion.goal.forward_m");
    assert.ok(goal < 0.12 && goal > 0, `goal ${goal}`);
    assert.equal(await studio.converged(), true);
  });

  test("a robot's parameter changes the robot file, and the motion follows", async () => {
    await studio.click("#tab-robot");
    const { name, value, step } = await studio.state("state.scene.parameters.0");
    const robot = await studio.text("robotPath");
    await studio.page.focus(".slider input[type=range]");
    await studio.edit(() => studio.press("ArrowRight"));
    const after = await studio.page.evaluate((name) => globalThis.studio.state.scene.parameters.find((one) => one.name === name).value, name);
    assert.ok(Math.abs(after - value - step) < step * 0.01, `${name}: ${value} to ${after}`);
    assert.notEqual(await studio.text("robotPath"), robot);
    await studio.edit(() => studio.press("Control", "z"));
    assert.equal(await studio.text("robotPath"), robot);
  });

  test("a fault in the text is named with its line, and the plan before stays", async () => {
    await studio.click("#tab-text");
    const original = await studio.text();
    await studio.page.focus(".text");
    await studio.edit(() =>
      studio.page.evaluate(() => {
        const area = document.querySelector(".text");
        area.value = area.value.replace("samples = 32", "samples = -3");
        area.dispatchEvent(new Event("input"));
      }),
    );
    const [fault] = await studio.state("state.faults");
    assert.equal(original.split("\n")[fault.line - 1], "samples = 32");
    assert.match(await studio.words(), /A fault in the file/);
    await studio.click(".status .faults .link");
    const selected = await studio.page.evaluate(() => getSelection().toString() || document.activeElement.value.slice(document.activeElement.selectionStart, document.activeElement.selectionEnd));
    assert.equal(selected, "-3");
    assert.equal(await studio.converged(), true);
  });

  test("the document survives a reload", async () => {
    await studio.edit(() => studio.type("Forward", "0.09"));
    await studio.page.reload();
    await studio.settled();
    assert.match(await studio.text(), /^forward_m = 0\.09$/m);
    assert.ok(await studio.page.$(".file .dot"), "the change is not marked");
  });

  test("a link holds the project", async () => {
    await studio.edit(() => studio.type("Forward", "0.08"));
    const text = await studio.text();
    await studio.page.evaluate(() => (navigator.clipboard.writeText = async (text) => void (globalThis.copied = text)));
    await studio.button("Share");
    await studio.button("Copy linkthe link itself contains the project; nothing is sent");
    await studio.until(() => /link/i.test(globalThis.studio.state.notice));
    const link = await studio.page.evaluate(() => globalThis.copied);
    const other = await browser.createBrowserContext();
    const opened = await Studio.open(other, link);
    assert.equal(await opened.text(), text);
    assert.deepEqual(opened.errors, []);
    assert.ok(link.startsWith(`${server.origin}/#project=`), "the query stays here");
    assert.ok(!opened.requests.slice(1).some((url) => url.includes("project=")), "the project was sent");
    await other.close();
  });

  test("files are opened from the computer", async () => {
    const folder = await mkdtemp(join(tmpdir(), "studio-"));
    const path = join(folder, "mine.toml");
    await writeFile(path, (await studio.text()).replace('name = "walk"', 'name = "mine"'));
    // Chromium's picker of the File System Access API cannot be automated, so a file input is used.
    await studio.page.evaluate(() => delete globalThis.showOpenFilePicker);
    await studio.page.evaluate(() => Object.defineProperty(globalThis, "showOpenFilePicker", { value: undefined }));
    const chooser = studio.page.waitForFileChooser();
    await studio.button("Open");
    await studio.edit(async () => (await chooser).accept([path]));
    assert.equal(await studio.state("state.motion.name"), "mine");
    assert.equal(await studio.state("state.documents.motionPath"), "mine.toml");
    assert.equal(await studio.converged(), true);
  });

  test("an example is opened from the gallery", async () => {
    await studio.example("motions/drive_1m.toml");
    assert.equal(await studio.state("state.motion.name"), "drive_1m");
    assert.equal(await studio.converged(), true);
  });

  test("after a trap the engine starts again, and nothing is lost", async () => {
    // A call with an impossible length makes WebAssembly trap, as after a panic.
    for (const worker of studio.page.workers()) {
      await worker.evaluate(() => {
        if (!globalThis.door) return;
        globalThis.door.request = () => globalThis.door.exports.reserve(-1, -1);
      });
    }
    await studio.edit(() => studio.type("Left", "0.01"));
    assert.match(await studio.words(), /was restarted/);
    assert.match(await studio.text(), /^left_m = 0\.01$/m);
    assert.equal(await studio.converged(), true);
    const traps = studio.errors.filter((error) => /panicked at/.test(error));
    assert.ok(traps.length >= 2, `both workers break: ${studio.errors}`);
    studio.errors = studio.errors.filter((error) => !traps.includes(error));
  });

  test("a long solve is stopped, and the picture stays", async () => {
    await studio.page.evaluate(() => {
      const { state } = globalThis.studio;
      const request = state.engine.request.bind(state.engine);
      // The solve must be running before it is stopped, even on a fast machine.
      state.engine.request = (lane, body, options) => {
        if (lane === "solver" && body.kind === "plan") setTimeout(() => state.cancel(), 0);
        return request(lane, body, options);
      };
      globalThis.restore = () => (state.engine.request = request);
    });
    const shown = await studio.state("state.shown.version");
    await studio.edit(() => studio.type("Samples", "200"));
    assert.equal(await studio.state("state.shown.version"), shown);
    assert.match(await studio.words(), /stopped/i);
    await studio.page.evaluate(() => globalThis.restore());
    await studio.edit(() => studio.press("Control", "z"));
    assert.equal(await studio.converged(), true);
  });

  test("the library is built, with its graph", async () => {
    await studio.example("motions/agilebot_library.toml");
    await studio.click("#tab-library");
    await studio.button("Build library");
    await studio.page.waitForSelector("[data-built]", { timeout: 180_000 });
    const names = await studio.page.$$eval(".graph-name", (list) => list.map((one) => one.textContent));
    assert.deepEqual(names.sort(), ["drive_1m", "stand", "turn_in_place", "walk"]);
    assert.equal(await studio.page.$$eval(".graph-edge", (list) => list.length), 8);
  });

  test("a simulated robot is flashed, armed by holding, plays, and is stopped with Escape", async (t) => {
    if (!(await studio.page.waitForSelector("#tab-run", { visible: true, timeout: 5000 }).catch(() => null))) {
      // The page hides functions that its engine lacks.
      t.skip("this engine does not talk to robots");
      return;
    }
    await studio.example("motions/test_leg_library.toml");
    await runRobot(studio);
  });

  test("the report is a table with tolerances", async () => {
    await studio.click("#tab-report");
    await studio.page.waitForSelector(".report tbody tr");
    const rows = await studio.page.$$eval(".report tbody th", (list) => list.map((one) => one.innerText));
    assert.ok(rows.some((row) => /slip/.test(row)), rows.join("; "));
  });

  test("everything has a name for screen readers", async () => {
    for (const tab of ["motion", "robot", "report", "library", "text"]) {
      await studio.click(`#tab-${tab}`);
      const nameless = await studio.page.evaluate(() =>
        [...document.querySelectorAll("button, input, select, textarea, [role=slider]")]
          .filter((element) => element.checkVisibility())
          .filter((element) => !(element.getAttribute("aria-label") || element.textContent.trim() || element.labels?.length))
          .map((element) => element.outerHTML.slice(0, 120)),
      );
      assert.deepEqual(nameless, []);
    }
  });
});
