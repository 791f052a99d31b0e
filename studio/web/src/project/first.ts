// What the page opens first: what its link holds, the files of the command line, what was open before, or an example.

import type { Desired, File } from "../contract.ts";
import { keptHere, unpacked } from "./autosave.ts";
import { baseName, type History, kindOf } from "./documents.ts";
import { example, FIRST } from "./examples.ts";
import { given, importRobot } from "./files.ts";
import { fromLink } from "./share.ts";
import type { Studio } from "./studio.ts";

type Given = { files: File[]; desired: Desired; edits: string | null };

export async function openFirst(studio: Studio) {
  if (await openLink(studio)) return;
  try {
    const asked = await givenTo(studio);
    const before = asked ? unpacked(asked.edits) : keptHere();
    if (asked && asked.files.length > 0) await openGiven(studio, asked, before);
    else if (before) await restore(studio, before);
    else await studio.openProject(await example(studio, FIRST));
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

/** The files of the command line; null of an engine without files of its own. */
async function givenTo(studio: Studio): Promise<Given | null> {
  return studio.engine.hasFiles ? (await studio.engine.request("documents", { kind: "given" })).value : null;
}

async function openGiven(studio: Studio, { files, desired }: Given, before: History | null) {
  for (const file of files) given.add(file.path);
  const named = (path: string | null) => files.find((file) => file.path === path) ?? null;
  const urdf = named(desired.urdf);
  if (before && follows(before, files)) return await restore(studio, before);
  // What was edited before is one step of undo away.
  if (before) studio.documents.restore({ ...before, saved: [] });
  if (urdf) await importRobot(studio, urdf, named(desired.side));
  else await openProject(studio, files, desired);
  const plan = named(desired.plan);
  if (plan) studio.planFrom(plan.text);
  if (before) studio.say("Files have changed since your last edits here, which were not saved. Undo (Ctrl+Z) brings your edits back.");
}

async function openProject(studio: Studio, files: File[], { motion, robot }: Desired) {
  const documents = files.filter((file) => kindOf(file) !== "plan");
  const path = motion ?? files.find((file) => kindOf(file) === "motion")?.path;
  if (path) {
    await studio.openProject({ files: documents, motion: path });
    await followRobot(studio, path, robot);
    return;
  }
  const { value } = await studio.engine.request("documents", { kind: "begin", files: documents, robot: robot ?? documents[0]?.path ?? "" });
  await studio.openProject({ files: [...documents, value.file], motion: value.file.path });
  studio.say(`No motion was named: ${baseName(value.file.path)} is a first one for the robot, and not saved.`);
}

/** The robot that was named moves, whichever robot the motion file names. */
async function followRobot(studio: Studio, motion: string, robot: string | null) {
  const { readRobot } = studio.documents;
  if (!robot || !readRobot || readRobot === robot) return;
  studio.edit({ edit: "text", table: [], key: "robot", value: relative(motion, robot) });
  studio.say(`${baseName(motion)} names ${baseName(readRobot)}; here it is planned for ${baseName(robot)}, as was asked for. Save it to keep that.`);
}

/** A path as a file beside another names it. */
export function relative(from: string, to: string): string {
  if (to.startsWith("/")) return to;
  const folders = from.split("/").slice(0, -1);
  const parts = to.split("/");
  while (folders.length > 0 && folders[0] === parts[0]) {
    folders.shift();
    parts.shift();
  }
  return [...folders.map(() => ".."), ...parts].join("/");
}

/** Whether what was open before are these files with changes that were not saved. */
function follows(before: History, files: File[]): boolean {
  const saved = new Map(before.saved);
  const original = (path: string) => saved.get(path) ?? before.now.files.find((file) => file.path === path)?.text;
  const documents = files.filter((file) => !["plan", "urdf", "other"].includes(kindOf(file)));
  return documents.every((file) => original(file.path) === file.text);
}

async function restore(studio: Studio, before: History) {
  studio.documents.restore(before);
  await studio.newProject();
  if (studio.documents.anyChanged) studio.say("Restored what was open before, with edits that are not saved.");
}
