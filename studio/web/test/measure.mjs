// Prints durations on this machine: node test/measure.mjs. It asserts nothing, because a loaded machine is slower, but not wrong.
import { readFile } from "node:fs/promises";
import { join } from "node:path";
import { gzipSync } from "node:zlib";
import { DIST, launch, serve, Studio, WASM } from "./harness.mjs";

const quantile = (list, share) => [...list].sort((a, b) => a - b)[Math.min(list.length - 1, Math.floor(share * list.length))];
let size = 0;
for (const file of [WASM, ...["index.html", "studio.css", "studio.js", "three.js"].map((name) => join(DIST, name))]) size += gzipSync(await readFile(file), { level: 9 }).length;
console.log(`page and engine, gzip: ${(size / 1000).toFixed(0)} kB`);

/** Motions of wheels, of legs, of both and of blades. */
const MOTIONS = ["walk", "drive_1m", "trot", "swizzlebot_forward", "anymal_drive", "skate"];
const server = await serve();
const browser = await launch("chromium");
for (const run of ["cold", "warm"]) {
  const started = performance.now();
  const studio = await Studio.open(browser, `${server.origin}/?quality=low`);
  console.log(`${run}: opened to first plan ${(performance.now() - started).toFixed(0)} ms`);
  if (run === "cold") await studio.page.close();
  else for (const motion of MOTIONS) await drags(studio, motion);
}

async function drags(studio, motion) {
  await studio.example(`motions/${motion}.toml`);
  const { waits, solves, draws } = await studio.page.evaluate(async () => {
    const { state, view } = globalThis.studio;
    const goal_m = state.motion.goal.forward_m;
    const waits = [];
    const solves = [];
    const request = state.engine.request.bind(state.engine);
    state.engine.request = async (lane, body, options) => {
      const from = performance.now();
      const done = await request(lane, body, options);
      if (body.kind === "plan") solves.push(performance.now() - from);
      return done;
    };
    const gesture = state.newGesture();
    const asked = new Map();
    state.events.on("plan", () => {
      const from = asked.get(state.shown.version);
      if (from) waits.push(performance.now() - from);
      asked.delete(state.shown.version);
    });
    const before = view.stage.draws;
    for (let k = 0; k < 40; k++) {
      state.edit({ edit: "number", table: ["goal"], key: "forward_m", value: goal_m * (1 - 0.005 * k) }, { gesture, drag: true });
      asked.set(state.version, performance.now());
      await new Promise((done) => setTimeout(done, 25));
    }
    await new Promise((done) => setTimeout(done, 500));
    state.engine.request = request;
    return { waits, solves, draws: view.stage.draws - before };
  });
  const show = (list) => `p50 ${quantile(list, 0.5).toFixed(0)} ms, p95 ${quantile(list, 0.95).toFixed(0)} ms`;
  console.log(`${motion}: drag of the goal, 40 edits 25 ms apart, ${waits.length} planned: edit to plan ${show(waits)}; solve ${show(solves)}; ${draws} frames drawn`);
}
await browser.close();
server.close();
