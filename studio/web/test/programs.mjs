// The programs that tests start: `rollwalk studio` (STUDIO_ROLLWALK) and simulated robots (STUDIO_SIM).
import assert from "node:assert/strict";
import { spawn } from "node:child_process";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";

export const program = process.env.STUDIO_ROLLWALK;
export const simulator = process.env.STUDIO_SIM;
export const root = join(dirname(fileURLToPath(import.meta.url)), "../../..");

/** Waits until a program has said what matches. */
export function said(child, wanted) {
  let text = "";
  return new Promise((resolve, reject) => {
    for (const stream of [child.stdout, child.stderr]) {
      stream.on("data", (data) => {
        text += data;
        const found = wanted.exec(text);
        if (found) resolve(found[0]);
      });
    }
    child.on("exit", () => reject(new assert.AssertionError({ message: `the program ended: ${text}` })));
  });
}

/** A test leg on a stand, whose link is at `bus`. */
export async function startRobot(folder, bus, args = []) {
  const robot = spawn(simulator, ["robots/test_leg.toml", "--on", "stand", "--bus", bus, ...args], { cwd: folder });
  await said(robot, /Ctrl-C/);
  return robot;
}

/** `rollwalk studio`, and where its page is. */
export async function serveStudio(folder, args) {
  const server = spawn(program, ["studio", ...args, "--no-open"], { cwd: folder });
  const address = await said(server, /http:\S+/);
  return { address, kill: () => server.kill() };
}
