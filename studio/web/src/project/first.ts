// First project of the page: that of its link, the files of the command line, the previous project, or an example.

import type { InitialFiles, Edit, File } from "../contract.ts";
import { openedFrom, storedHistory, unpacked } from "./autosave.ts";
import { baseName, type History, kindOf } from "./documents.ts";
import { example, FIRST } from "./examples.ts";
import { given, importRobot } from "./files.ts";
import { fromLink } from "./share.ts";
import type { Studio } from "./studio.ts";

/** `edits`: stored edits, the tab that stored them, and whether the files have not changed since. */
type GivenFiles = { files: File[]; desired: InitialFiles; edits: { page: string; by: string; is_current: boolean } | null };

export async function openFirst(studio: Studio) {
  if (await openLink(studio)) return;
  try {
    const asked = await requestGivenFiles(studio);
    if (asked) openedFrom(asked.edits?.by ?? "");
    const before = asked ? unpacked(asked.edits?.page ?? null) : storedHistory();
    if (asked && asked.files.length > 0) await openGivenFiles(studio, asked, before);
    else if (before) await restore(studio, before);
    else await studio.openProject(await example(studio, FIRST));
  } catch (error) {
    studio.showError(error);
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
    studio.showError(new Error(`This link could not be opened: ${(error as Error).message}`));
    return false;
  }
}

/** Files of the command line; null if the engine has no files. */
async function requestGivenFiles(studio: Studio): Promise<GivenFiles | null> {
  return studio.engine.hasFiles ? (await studio.engine.request("documents", { kind: "given" })).value : null;
}

async function openGivenFiles(studio: Studio, { files, desired, edits }: GivenFiles, before: History | null) {
  for (const file of files) given.add(file.path);
  const named = (path: string | null) => files.find((file) => file.path === path) ?? null;
  const [urdf, plan] = [named(desired.urdf), named(desired.plan)];
  const hasEdits = before !== null && before.saved.length > 0;
  if (hasEdits && edits!.is_current) await restore(studio, before);
  else {
    // One step of undo restores the previous edits.
    if (hasEdits) studio.documents.restore({ ...before, saved: [] });
    if (urdf) await importRobot(studio, urdf, named(desired.side));
    else await openProject(studio, files.filter((file) => file !== plan), desired);
  }
  if (plan) studio.planFrom(plan.text);
  if (hasEdits && !edits!.is_current) studio.notify("Files have changed on disk since your last unsaved edits here. Undo (Ctrl+Z) restores your edits.");
}

async function openProject(studio: Studio, files: File[], { motion, robot, robot_in_motion }: InitialFiles) {
  const body = robot ?? files.find((file) => kindOf(file) === "robot")?.path;
  if (!motion && body) {
    const { value } = await studio.engine.request("documents", { kind: "begin", files, robot: body });
    await studio.openProject({ files: [...files, value.file], motion: value.file.path });
    studio.notify(`No motion was given: ${baseName(value.file.path)} is a first motion for the robot, not saved yet.`);
    return;
  }
  // A file with faults is opened so that the user can correct it.
  const path = motion ?? files[0].path;
  const text = robot_in_motion === null ? null : await named(studio, files, path, robot_in_motion);
  await studio.openProject({ files, motion: path });
  if (text === null) return;
  await studio.rewrite(path, text);
  studio.notify(`${baseName(path)} names another robot; the studio now plans the motion for ${baseName(robot!)}, as requested. Save the motion to keep this change.`);
}

/** Text of a motion file that names the requested robot. */
async function named(studio: Studio, files: File[], motion: string, robot: string): Promise<string> {
  const edit: Edit = { edit: "text", table: [], key: "robot", value: robot };
  const { value } = await studio.engine.request("documents", { kind: "amend", files, motion, path: motion, edit });
  return value.text;
}

async function restore(studio: Studio, before: History) {
  studio.documents.restore(before);
  await studio.newProject();
  if (studio.documents.anyChanged) studio.notify("Restored the previous project, with unsaved edits.");
}
