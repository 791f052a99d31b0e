// Programs of tests: `rollwalk studio` (STUDIO_ROLLWALK) and simulated robots (STUDIO_SIM). They do not keep Node alive, and are
// killed when it ends.
import assert from "node:assert/strict";
import { spawn } from "node:child_process";
import { EventEmitter } from "node:events";
import { mkdtempSync } from "node:fs";
import { tmpdir } from "node:os";
import { dirname, join } from "node:path";
import { createInterface } from "node:readline";
import { fileURLToPath } from "node:url";
import { within } from "./within.mjs";

export const program = process.env.STUDIO_ROLLWALK;
export const simulator = process.env.STUDIO_SIM;
export const root = join(dirname(fileURLToPath(import.meta.url)), "../../..");

/** Folder for state that outlasts the programs. */
const state = mkdtempSync(join(tmpdir(), "studio-state-"));
const children = new Set();
process.on("exit", () => children.forEach((child) => child.kill("SIGKILL")));
// The test runner ends a file that takes too long with this signal.
process.on("SIGTERM", () => process.exit(1));

/** A child process that does not outlive the tests. Wait for it with a bound (`within`), which keeps Node alive meanwhile. */
export function child(...args) {
  const child = spawn(...args);
  children.add(child);
  for (const part of [child, ...child.stdio]) part?.unref();
  child.on("close", () => children.delete(child));
  return child;
}

/** A program with all lines that it has printed. */
export class Program extends EventEmitter {
  #lines = [];
  #hasEnded = false;

  constructor(file, args, folder = root, env = {}) {
    super();
    this.name = [file, ...args].join(" ");
    this.child = child(file, args, { cwd: folder, env: { ...process.env, XDG_STATE_HOME: state, ...env } });
    for (const stream of [this.child.stdout, this.child.stderr]) {
      // Data may end within a line, even within an address.
      createInterface({ input: stream }).on("line", (line) => {
        this.#lines.push(line);
        this.emit("change");
      });
    }
    this.child.on("error", (error) => this.#lines.push(String(error)));
    // After its streams have closed, all lines have arrived.
    this.child.on("close", () => {
      this.#hasEnded = true;
      this.emit("change");
    });
  }

  /** Waits for a matching line. Earlier lines count, because several may arrive at once. */
  said(wanted) {
    const text = () => `${this.name}\n${this.#lines.join("\n")}`;
    const found = new Promise((resolve, reject) => {
      const look = () => {
        const found = this.#lines.map((line) => wanted.exec(line)).find((found) => found);
        if (found) resolve(found[0]);
        else if (this.#hasEnded) reject(new assert.AssertionError({ message: `the program ended without ${wanted}: ${text()}` }));
        else this.once("change", look);
      };
      look();
    });
    return within(() => `a line ${wanted} of ${text()}`, found);
  }

  kill() {
    this.child.kill();
  }

  async ended() {
    if (!this.#hasEnded) await within(() => `the end of ${this.name}`, new Promise((resolve) => this.child.once("close", resolve)));
  }
}

/** A test leg on a stand, whose link is at `bus`. */
export async function startRobot(folder, bus, args = []) {
  const robot = new Program(simulator, ["robots/test_leg.toml", "--on", "stand", "--bus", bus, ...args], folder);
  await robot.said(/Ctrl-C/);
  return robot;
}

/** `rollwalk studio`, and the address of its page. */
export async function serveStudio(folder, args, env) {
  const server = new Program(program, ["studio", ...args, "--no-open"], folder, env);
  const address = await server.said(/http:\S+/);
  const end = async () => {
    server.kill();
    await server.ended();
  };
  return { address, kill: () => server.kill(), end };
}
