// Shipped robots, motions and libraries by name. An example opens together with the robot that it names.

import type { File } from "../contract.ts";
import { Refused } from "../engine/engine.ts";
import { kindOf, type Snapshot } from "./documents.ts";
import type { Studio } from "./studio.ts";

export type Example = { path: string; of: "robot" | "motion" | "library" | "design"; name: string; title: string; robot: string | null };

export const FIRST = "motions/walk.toml";

export async function listExamples(studio: Studio): Promise<Example[]> {
  const { value } = await studio.engine.request("documents", { kind: "examples" });
  return value.examples;
}

async function text(studio: Studio, path: string): Promise<File> {
  const { value } = await studio.engine.request("documents", { kind: "example", path });
  return { path, text: value.text };
}

/** A shipped motion with the robot that its text names, or a library with robot and motions. */
export async function example(studio: Studio, path: string): Promise<Snapshot> {
  const first = await text(studio, path);
  const files = [first];
  let motion = first;
  if (kindOf(first) === "library") {
    for (const [, file] of first.text.matchAll(/^\s*file\s*=\s*"([^"]+)"/gm)) files.push(await text(studio, resolve(path, file)));
    motion = files[1] ?? first;
  }
  const robot = /^\s*robot\s*=\s*"([^"]+)"/m.exec(first.text)?.[1];
  if (!robot) throw new Refused(`${path} does not name a robot.`, "");
  files.push(await text(studio, resolve(path, robot)));
  return { files, motion: motion.path };
}

/** A path relative to the folder of another. */
export function resolve(from: string, to: string): string {
  const parts = from.split("/").slice(0, -1);
  for (const part of to.split("/")) {
    if (part === "..") parts.pop();
    else if (part !== ".") parts.push(part);
  }
  return parts.join("/");
}
