// Storage of the documents and their history, so that a reload, a crash or a new start loses nothing: in the browser's storage, or
// by the program that serves the page.

import type { File } from "../contract.ts";
import type { History, Snapshot } from "./documents.ts";
import type { Studio } from "./studio.ts";

const KEY = "rollwalk-studio-project-2";
/** Tab whose documents are in the browser's storage. */
const KEY_BY = `${KEY}-by`;
const DRAG_MS = 250;
/** Maximum numbers of undo steps and characters, because a browser's storage has 5 MB. */
const MOST_STEPS = 50;
const MOST_CHARACTERS = 2_000_000;

/** This tab, and the tab whose documents it has opened. A tab replaces only their documents, not those of a third tab. */
const tabs = { by: `${Date.now().toString(36)}-${Math.random().toString(36).slice(2)}`, from: "" };

/** Records the tab whose documents were opened. */
export function openedFrom(by: string) {
  tabs.from = by;
}

/** Each text once, and documents as indices of texts. */
type PackedSnapshot = { files: [string, number][]; motion: string };
type Packed = { texts: string[]; now: PackedSnapshot; past: PackedSnapshot[]; future: PackedSnapshot[]; saved: [string, number | null][] };

/** Stores the documents after each change, and periodically during a drag. */
export function keepSaved(studio: Studio) {
  let timer = 0;
  let due = false;
  let busy = false;
  let failed = false;
  const write = async () => {
    clearTimeout(timer);
    timer = 0;
    due = true;
    if (busy) return;
    busy = true;
    while (due) {
      due = false;
      try {
        await store(studio, packed(studio.documents.history));
        failed = false;
      } catch (error) {
        // Storage may be full or forbidden, which is reported once. The browser asks before it leaves the page in any case.
        if (!failed) studio.notify(`Unsaved changes will be lost when the page is closed: ${(error as Error).message}`);
        failed = true;
      }
    }
    busy = false;
  };
  studio.events.on("documents", () => {
    if (studio.documents.now.files.length === 0) return;
    if (studio.dragging) timer ||= setTimeout(write, DRAG_MS) as unknown as number;
    else void write();
  });
  addEventListener("beforeunload", (event) => studio.documents.anyChanged && event.preventDefault());
  addEventListener("pagehide", () => (timer || due) && void store(studio, packed(studio.documents.history)).catch(() => {}));
}

async function store(studio: Studio, text: string) {
  if (studio.engine.hasFiles) {
    await studio.engine.request("documents", { kind: "keep", text, ...tabs });
    return;
  }
  const before = localStorage.getItem(KEY_BY) ?? "";
  if (before !== "" && before !== tabs.by && before !== tabs.from) {
    throw new Error("another tab has unsaved edits; download your files here, or close the other tab and reload this one");
  }
  localStorage.setItem(KEY, text);
  localStorage.setItem(KEY_BY, tabs.by);
}

/** History that this browser has stored. */
export function storedHistory(): History | null {
  try {
    openedFrom(localStorage.getItem(KEY_BY) ?? "");
    return unpacked(localStorage.getItem(KEY));
  } catch {
    return null;
  }
}

function packed({ now, past, future, saved }: History): string {
  const texts = new Map<string, number>();
  const index = (text: string) => {
    if (!texts.has(text)) texts.set(text, texts.size);
    return texts.get(text)!;
  };
  const one = ({ files, motion }: Snapshot): PackedSnapshot => ({ files: files.map(({ path, text }) => [path, index(text)]), motion });
  const body: Packed = { texts: [], now: one(now), past: [], future: [], saved: saved.map(([path, text]) => [path, text === null ? null : index(text)]) };
  const isRoom = () => [...texts.keys()].reduce((sum, text) => sum + text.length, 0) <= MOST_CHARACTERS;
  // The steps nearest to the present documents come first.
  for (const step of past.slice(-MOST_STEPS).reverse()) if (isRoom()) body.past.unshift(one(step));
  for (const step of future.slice(-MOST_STEPS).reverse()) if (isRoom()) body.future.unshift(one(step));
  return JSON.stringify({ ...body, texts: [...texts.keys()] });
}

/** History in a text; null if the text contains none. */
export function unpacked(text: string | null): History | null {
  try {
    const { texts, now, past, future, saved } = JSON.parse(text ?? "null") as Packed;
    const at = (index: number) => {
      if (typeof texts[index] !== "string") throw new Error("a text is missing");
      return texts[index];
    };
    const one = ({ files, motion }: PackedSnapshot): Snapshot => ({ files: files.map(([path, index]): File => ({ path: String(path), text: at(index) })), motion: String(motion) });
    const history = { now: one(now), past: past.map(one), future: future.map(one), saved: saved.map(([path, index]): [string, string | null] => [path, index === null ? null : at(index)]) };
    return history.now.files.some((file) => file.path === history.now.motion) ? history : null;
  } catch {
    return null;
  }
}
