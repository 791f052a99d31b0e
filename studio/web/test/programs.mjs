// The programs that tests start: `rollwalk studio` (STUDIO_ROLLWALK) and simulated robots (STUDIO_SIM).
import assert from "node:assert/strict";
import { spawn } from "node:child_process";
import { dirname, join } from "node:path";
import { createInterface } from "node:readline";
import { fileURLToPath } from "node:url";

export const program = process.env.STUDIO_ROLLWALK;
export const simulator = process.env.STUDIO_SIM;
export const root = join(dirname(fileURLToPath(import.meta.url)), "../../..");

/** Waits until a line of a program matches: data may end within a line, in the middle of an address. */
export function said(child, wanted) {
  let text = "";
  return new Promise((resolve, reject) => {
    for (const stream of [child.stdout, child.stderr]) {
      createInterface({ input: stream }).on("line", (line) => {
        text += `${line}\n`;
        const found = wanted.exec(line);
        if (found) resolve(found[0]);
      });
    }
    // After its streams have closed: all lines have come.
    child.on("close", () => reject(new assert.AssertionError({ message: `the program ended: ${text}` })));
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
