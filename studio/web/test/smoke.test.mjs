// Short test in both browsers: the page loads, plans, follows an edit, undoes it, and names conflicting constraints.
import assert from "node:assert/strict";
import { after, before, describe, test } from "node:test";
import { launch, serve, Studio } from "./harness.mjs";

const browsers = (process.env.STUDIO_BROWSERS ?? "chromium,firefox").split(",");

for (const name of browsers) {
  describe(`smoke in ${name}`, () => {
    let server, browser, studio;
    before(async () => {
      server = await serve();
      browser = await launch(name);
      studio = await Studio.open(browser, `${server.origin}/?quality=low`);
    });
    after(async () => {
      await browser?.close();
      server?.close();
    });

    test("opens the walk and plans it", async () => {
      assert.equal(await studio.state("state.motion.name"), "walk");
      assert.equal(await studio.converged(), true);
      assert.match(await studio.words(), /Planned/);
      assert.ok((await studio.state("view.stage.draws")) > 0, "nothing was drawn");
    });

    test("follows an edit made with the keyboard alone, and undoes it", async () => {
      const original = await studio.text();
      await studio.edit(() => studio.type("Forward", "0.1"));
      assert.match(await studio.text(), /^forward_m = 0\.1$/m);
      assert.equal(await studio.converged(), true);
      const [x0, x1] = await studio.page.evaluate(() => {
        const { frames } = globalThis.studio.state.shown;
        return [frames.com(frames.at(0))[0], frames.com(frames.at(frames.header.duration_s))[0]];
      });
      assert.ok(Math.abs(x1 - x0 - 0.1) < 0.002, `the plan goes ${x1 - x0} m`);
      await studio.edit(() => studio.press("Control", "z"));
      assert.equal(await studio.text(), original);
      await studio.edit(() => studio.press("Control", "y"));
      assert.match(await studio.text(), /^forward_m = 0\.1$/m);
      await studio.edit(() => studio.press("Control", "z"));
    });

    test("says who is to blame for what cannot be met, and what would do", async () => {
      await studio.example("motions/test_leg_roll.toml");
      assert.equal(await studio.converged(), true);
      await studio.edit(() => studio.type("Forward", "3"));
      assert.equal(await studio.converged(), false);
      const [culprit] = await studio.state("state.shown.planned.solve.culprits");
      assert.equal(culprit.constraint, "displacement goal");
      assert.ok((await studio.words()).includes(culprit.what.replaceAll("`", "")));
      await studio.click(".culprit");
      assert.equal(await studio.state("state.selection.culprit"), 0);
      assert.deepEqual(await studio.state("state.selection.span"), { from_s: culprit.from_s, to_s: culprit.to_s });
      await studio.edit(() => studio.button(culprit.fix.label));
      assert.equal(await studio.state("state.motion.goal.forward_m"), culprit.fix.edit.value);
      // The constraints hold at the samples, as a fix promises.
      assert.equal(await studio.state("state.shown.planned.good"), true);
    });

    test("no console error, and no request leaves the origin", () => {
      assert.deepEqual(studio.errors, []);
      const foreign = studio.requests.filter((url) => !url.startsWith(server.origin) && !/^(blob|data):/.test(url));
      assert.deepEqual(foreign, []);
    });
  });
}
