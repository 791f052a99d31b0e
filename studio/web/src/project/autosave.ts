// The documents in this browser's storage, so that a reload or a crash loses nothing.

import type { Snapshot } from "./documents.ts";
import type { Studio } from "./studio.ts";

const KEY = "rollwalk-studio-project";
const WAIT_MS = 250;

export type Kept = { files: { path: string; text: string }[]; motion: string; saved: [string, string | null][] };

export function keepSaved(studio: Studio) {
  let timer = 0;
  let failed = false;
  const write = () => {
    timer = 0;
    const { files, motion } = studio.documents.now;
    const kept: Kept = { files: files.map((file) => ({ ...file })), motion, saved: studio.documents.saved };
    try {
      localStorage.setItem(KEY, JSON.stringify(kept));
      failed = false;
    } catch {
      failed = true;
      // Storage may be full or forbidden: then there is no autosave, and leaving asks first.
    }
  };
  studio.events.on("documents", () => {
    if (studio.documents.now.files.length > 0) timer ||= setTimeout(write, WAIT_MS) as unknown as number;
  });
  addEventListener("beforeunload", (event) => failed && studio.documents.anyChanged && event.preventDefault());
  addEventListener("pagehide", () => timer && (clearTimeout(timer), write()));
}

export function kept(): Kept | null {
  try {
    const value = JSON.parse(localStorage.getItem(KEY) ?? "null") as Kept | null;
    const sound = value && Array.isArray(value.files) && value.files.every((file) => typeof file.path === "string" && typeof file.text === "string");
    return sound && value.files.some((file) => file.path === value.motion) ? value : null;
  } catch {
    return null;
  }
}

export function snapshotOf(value: Kept): Snapshot {
  return { files: value.files, motion: value.motion };
}
