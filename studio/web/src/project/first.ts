// What the page opens first: what its link holds, the files of the command line, what was open before, or an example.

import type { File } from "../contract.ts";
import { type Kept, kept, snapshotOf } from "./autosave.ts";
import { kindOf } from "./documents.ts";
import { example, FIRST } from "./examples.ts";
import { given } from "./files.ts";
import { fromLink } from "./share.ts";
import type { Studio } from "./studio.ts";

export async function openFirst(studio: Studio) {
  if (await openLink(studio)) return;
  const before = kept();
  if (studio.engine.hasFiles && (await openGiven(studio, before))) return;
  if (before) return restore(studio, before);
  try {
    await studio.openProject(await example(studio, FIRST));
  } catch (error) {
    studio.complain(error);
  }
}

export async function openLink(studio: Studio): Promise<boolean> {
  try {
    const snapshot = await fromLink(location.hash);
    if (!snapshot) return false;
    history.replaceState(null, "", location.href.split("#")[0]);
    await studio.openProject(snapshot);
    return true;
  } catch (error) {
    studio.complain(new Error(`This link could not be opened: ${(error as Error).message}`));
    return false;
  }
}

async function openGiven(studio: Studio, before: Kept | null): Promise<boolean> {
  let files: File[];
  let motion: string | null;
  try {
    ({ files, motion } = (await studio.engine.request("documents", { kind: "given" })).value);
  } catch {
    return false; // an engine without files of its own
  }
  motion ??= files.find((file) => kindOf(file) === "motion")?.path ?? null;
  if (!motion) return false;
  for (const file of files) given.add(file.path);
  if (before && follows(before, files)) await restore(studio, before);
  else await studio.openProject({ files, motion });
  return true;
}

/** Whether what was open before are these files with changes that were not saved. */
function follows(before: Kept, files: File[]): boolean {
  const saved = new Map(before.saved);
  const original = (path: string) => saved.get(path) ?? before.files.find((file) => file.path === path)?.text;
  return files.length > 0 && files.every((file) => original(file.path) === file.text);
}

async function restore(studio: Studio, before: Kept) {
  studio.documents.restore(snapshotOf(before), before.saved);
  await studio.newProject();
  studio.say("Restored what was open before.");
}
