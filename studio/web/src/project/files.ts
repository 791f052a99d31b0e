// Files of this computer: opened by picker or drop, saved in place if the browser supports it (File System Access), else as a
// download.

import type { File as Text } from "../contract.ts";
import { baseName, kindOf } from "./documents.ts";
import { example, listExamples } from "./examples.ts";
import type { Studio } from "./studio.ts";

type Handle = FileSystemFileHandle;
const OPENED = [{ description: "Rollwalk files, URDF", accept: { "text/plain": [".toml"], "application/json": [".json"], "application/xml": [".urdf", ".xml"] } }];
const SAVED = [{ description: "Rollwalk files", accept: { "text/plain": [".toml"], "application/json": [".json"] } }];
const MOST_BYTES = 5_000_000;

/** Handles of opened files, by path, to save them in place. */
const handles = new Map<string, Handle>();

/** Files of the command line, which the program that serves the page saves. */
export const given = new Set<string>();

type Picker = {
  showOpenFilePicker?(options: object): Promise<Handle[]>;
  showSaveFilePicker?(options: object): Promise<Handle>;
};
const picker = window as unknown as Picker;

export async function pickFiles(studio: Studio) {
  if (picker.showOpenFilePicker) {
    let picked: Handle[];
    try {
      picked = await picker.showOpenFilePicker({ multiple: true, types: OPENED });
    } catch {
      return; // the person closed the picker
    }
    const files = await Promise.all(picked.map((handle) => handle.getFile()));
    picked.forEach((handle) => handles.set(handle.name, handle));
    await openFiles(studio, files);
    return;
  }
  const input = document.createElement("input");
  input.type = "file";
  input.multiple = true;
  input.accept = ".toml,.json,.urdf,.xml";
  input.onchange = () => void openFiles(studio, [...(input.files ?? [])]);
  input.click();
}

/** Opens the picked or dropped files. Missing files are taken from the present project. */
export async function openFiles(studio: Studio, picked: File[]) {
  try {
    const files = await Promise.all(
      picked.map(async (file) => {
        if (file.size > MOST_BYTES) throw new Error(`${file.name} has ${(file.size / 1e6).toFixed(1)} MB; open files of less than ${MOST_BYTES / 1e6} MB`);
        return { path: file.name, text: await file.text() };
      }),
    );
    const urdf = files.find((file) => kindOf(file) === "urdf");
    if (urdf) return await importRobot(studio, urdf, files.find((file) => file !== urdf) ?? null);
    const plan = files.find((file) => kindOf(file) === "plan");
    const motion = files.find((file) => kindOf(file) === "motion");
    const others = studio.documents.files().filter((old) => !files.some((file) => baseName(file.path) === baseName(old.path)));
    const replaces = (kind: string) => files.some((file) => kindOf(file) === kind);
    if (motion) {
      // A motion with its robot is a project. A motion alone keeps the present robot, if it names this robot.
      const kept = replaces("robot") ? [] : others.filter((file) => motion.text.includes(baseName(file.path)));
      await studio.openProject({ files: [...files, ...kept], motion: motion.path });
    } else if (replaces("robot") || replaces("library")) {
      const robot = studio.documents.robotPath;
      const kept = others.filter((file) => !(replaces("robot") && file.path === robot));
      const renamed = files.map((file) => (kindOf(file) === "robot" && robot ? { ...file, path: robot } : file));
      await studio.openProject({ files: [...renamed, ...kept], motion: studio.documents.motionPath });
    } else if (!plan) {
      throw new Error(`${picked.map((file) => file.name).join(", ")}: not a robot, motion, plan or library file of Rollwalk, and not a URDF file`);
    }
    // A plan is a start for the present motion, or for the motion that was opened with it. In a library, a plan is a motion.
    if (plan && !replaces("library")) {
      if (files.length === 1) await openShipped(studio, plan);
      studio.planFrom(plan.text);
    }
  } catch (error) {
    studio.showError(error);
  }
}

/** A plan contains no robot or motion file. Files of a shipped motion are opened with the plan, unless they are open. */
async function openShipped(studio: Studio, plan: Text) {
  const { robot, motion } = JSON.parse(plan.text);
  if (studio.motion?.name === motion?.name && studio.scene?.name === robot?.name) return;
  const all = await listExamples(studio);
  const found = all.find((one) => one.of === "motion" && one.name === motion?.name && one.robot && baseName(one.robot) === `${robot?.name}.toml`);
  if (found) await studio.openProject(await example(studio, found.path));
}

/** Makes a project of a URDF, with its side file or the side file that the import proposes. */
export async function importRobot(studio: Studio, urdf: Text, side: Text | null) {
  const { value } = await studio.engine.request("documents", { kind: "import", urdf, side });
  await studio.openProject({ files: value.files, motion: value.motion });
  remarkImport(studio, urdf, value);
}

/** Shows the assumptions of an import, whose files are motion, robot and side file. Offers the import again when the side file has changed; the motion stays unchanged. */
function remarkImport(studio: Studio, urdf: Text, imported: { files: Text[]; warnings: string[] }) {
  const [, robot, side] = imported.files;
  const now = () => studio.documents.text(side.path);
  const act = async () => {
    try {
      const { value } = await studio.engine.request("documents", { kind: "import", urdf, side: { path: side.path, text: now() ?? side.text } });
      studio.write(robot.path, value.files[1].text, null);
      remarkImport(studio, urdf, value);
      studio.notify(`Imported ${baseName(robot.path)} again. Undo (Ctrl+Z) restores the previous file.`);
    } catch (error) {
      studio.showError(error);
    }
  };
  const { length } = imported.warnings;
  studio.remark({
    of: `${length === 1 ? "assumption" : "assumptions"} of the import of ${urdf.path}`,
    each: imported.warnings,
    again: { text: `Import ${baseName(robot.path)} again with the changed ${baseName(side.path)}`, isDue: () => now() !== undefined && now() !== side.text, act },
  });
}

/** Saves a document to its file, if the browser supports it, else as a download. */
export async function saveDocument(studio: Studio, path: string, elsewhere = false) {
  const text = studio.documents.text(path) ?? "";
  const name = baseName(path);
  try {
    if (!elsewhere && given.has(path)) {
      await studio.engine.request("documents", { kind: "save", path, text });
      return saved(studio, path);
    }
    let handle = elsewhere ? undefined : handles.get(path);
    if (!handle && picker.showSaveFilePicker) {
      studio.notify(`Choose where to save ${name}, in the browser's window.`);
      handle = await picker.showSaveFilePicker({ suggestedName: name, types: SAVED });
      handles.set(path, handle);
    }
    if (handle) {
      const stream = await handle.createWritable();
      await stream.write(text);
      await stream.close();
    } else {
      download(name, text);
    }
  } catch (error) {
    if ((error as Error).name !== "AbortError") studio.showError(error);
    studio.notify("");
    return;
  }
  saved(studio, path);
}

function saved(studio: Studio, path: string) {
  studio.documents.markSaved(path);
  studio.events.emit("documents");
  studio.notify(`Saved ${baseName(path)}.`);
}

export function download(name: string, content: string | Uint8Array) {
  const blob = new Blob([content as BlobPart], { type: "application/octet-stream" });
  const url = URL.createObjectURL(blob);
  const link = document.createElement("a");
  link.href = url;
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(url), 10_000);
}

/** Lets users drop files anywhere on the page. */
export function acceptDrops(studio: Studio, target: HTMLElement) {
  const over = (event: DragEvent) => {
    if (!event.dataTransfer?.types.includes("Files")) return;
    event.preventDefault();
    target.classList.add("dropping");
  };
  target.addEventListener("dragenter", over);
  target.addEventListener("dragover", over);
  target.addEventListener("dragleave", (event) => event.relatedTarget || target.classList.remove("dropping"));
  target.addEventListener("drop", (event) => {
    target.classList.remove("dropping");
    if (!event.dataTransfer?.files.length) return;
    event.preventDefault();
    void openFiles(studio, [...event.dataTransfer.files]);
  });
}
