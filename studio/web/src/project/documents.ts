// The documents of a project and their history. The texts are the only state: undo restores previous texts.

import type { File } from "../contract.ts";

export type Snapshot = { readonly files: readonly File[]; readonly motion: string };
/** Documents with the steps of undo and redo, and the saved texts of changed files, null if never saved. */
export type History = { now: Snapshot; past: Snapshot[]; future: Snapshot[]; saved: [string, string | null][] };

export class Documents {
  #now: Snapshot = { files: [], motion: "" };
  #past: Snapshot[] = [];
  #future: Snapshot[] = [];
  #gesture: string | null = null;
  #saved = new Map<string, string>();
  /** Path at which the engine found the robot that the motion file names. */
  readRobot = "";

  get now(): Snapshot {
    return this.#now;
  }

  get motionPath(): string {
    return this.#now.motion;
  }

  files(): File[] {
    return this.#now.files.map((file) => ({ ...file }));
  }

  text(path: string): string | undefined {
    return this.#now.files.find((file) => file.path === path)?.text;
  }

  /** Robot file with which the motion was read, else the first robot file. */
  get robotPath(): string | undefined {
    const robots = this.#now.files.filter((file) => kindOf(file) === "robot");
    return (robots.find((file) => file.path === this.readRobot) ?? robots[0])?.path;
  }

  get motionPaths(): string[] {
    return this.#now.files.filter((file) => kindOf(file) === "motion").map((file) => file.path);
  }

  /** Selects another motion of the project. */
  choose(motion: string) {
    this.#remember();
    this.#gesture = null;
    this.#now = { ...this.#now, motion };
  }

  get libraryPath(): string | undefined {
    return this.#now.files.find((file) => kindOf(file) === "library")?.path;
  }

  /** Opens another project. Undo restores the previous project. */
  open(snapshot: Snapshot, remember = true) {
    if (remember && this.#now.files.length > 0) this.#remember();
    this.#now = snapshot;
    this.#gesture = null;
    for (const file of snapshot.files) this.#saved.set(file.path, file.text);
  }

  /** Adds documents to the project, in one step of undo. */
  add(files: readonly File[]) {
    this.#remember();
    this.#gesture = null;
    const added = files.map((file) => file.path);
    this.#now = { ...this.#now, files: [...this.#now.files.filter(({ path }) => !added.includes(path)), ...files] };
  }

  /** Replaces the text of a document. Changes of one gesture are one step of undo. */
  write(path: string, text: string, gesture: string | null) {
    if (this.text(path) === text) return;
    if (gesture === null || gesture !== this.#gesture) this.#remember();
    this.#gesture = gesture;
    const files = this.#now.files.map((file) => (file.path === path ? { path, text } : file));
    this.#now = { ...this.#now, files };
  }

  /** Adds a file that the documents name and that the engine supplied. This is not a step of undo. */
  adopt(file: File) {
    if (this.text(file.path) !== undefined) return;
    this.#now = { ...this.#now, files: [...this.#now.files, file] };
    this.#saved.set(file.path, file.text);
  }

  endGesture() {
    this.#gesture = null;
  }

  get canUndo(): boolean {
    return this.#past.length > 0;
  }

  get canRedo(): boolean {
    return this.#future.length > 0;
  }

  undo(): boolean {
    return this.#step(this.#past, this.#future);
  }

  redo(): boolean {
    return this.#step(this.#future, this.#past);
  }

  changed(path: string): boolean {
    return this.#saved.get(path) !== this.text(path);
  }

  get anyChanged(): boolean {
    return this.#now.files.some((file) => this.changed(file.path));
  }

  markSaved(path: string) {
    this.#saved.set(path, this.text(path) ?? "");
  }

  /** Restores the documents of a previous session. Changes are still marked, and can be undone. */
  restore({ now, past, future, saved }: History) {
    [this.#now, this.#past, this.#future] = [now, past, future];
    this.#saved = new Map(now.files.map((file) => [file.path, file.text]));
    for (const [path, text] of saved) {
      if (text === null) this.#saved.delete(path);
      else this.#saved.set(path, text);
    }
  }

  get history(): History {
    const changed = this.#now.files.filter((file) => this.changed(file.path));
    const saved = changed.map((file): [string, string | null] => [file.path, this.#saved.get(file.path) ?? null]);
    return { now: this.#now, past: this.#past, future: this.#future, saved };
  }

  #remember() {
    this.#past.push(this.#now);
    this.#future = [];
  }

  #step(from: Snapshot[], to: Snapshot[]): boolean {
    const snapshot = from.pop();
    if (!snapshot) return false;
    to.push(this.#now);
    this.#now = snapshot;
    this.#gesture = null;
    return true;
  }
}

export type Kind = "robot" | "motion" | "library" | "design" | "plan" | "urdf" | "other";

/** Guesses the kind of a file from its beginning, tables and keys. The engine decides. */
export function kindOf(file: File): Kind {
  if (/^\s*\{/.test(file.text)) return file.text.includes('"rollwalk-plan"') ? "plan" : "other";
  if (/^\s*</.test(file.text)) return /<(robot|mujoco)[\s>]/.test(file.text) ? "urdf" : "other";
  if (/^\s*\[\[link\]\]/m.test(file.text)) return "robot";
  if (/^\s*\[\[motion\]\]/m.test(file.text)) return "library";
  if (/^\s*duration_s\s*=/m.test(file.text) && /^\s*robot\s*=/m.test(file.text)) return "motion";
  return "other";
}

export function baseName(path: string): string {
  return path.slice(path.lastIndexOf("/") + 1);
}
