// State of the page, and its changes. Views listen to `events` and read the state; they do not change it themselves.

import type { Edit, Fault, File, MotionView, Planned, Progress, Scene } from "../contract.ts";
import { Broken, Cancelled, type Engine, Faults, Refused } from "../engine/engine.ts";
import { Documents, type Snapshot } from "./documents.ts";
import { Events } from "./events.ts";
import { predict } from "./foresee.ts";
import { Frames } from "./frames.ts";
import { Planner, type PlanRequest } from "./planner.ts";
import { Selection } from "./selection.ts";

export type Name = "documents" | "plan" | "kept" | "activity" | "selection";
/** `of`: texts from which the plan was made. */
export type ShownPlan = { planned: Planned; frames: Frames; version: number; drag: boolean; of: string };
export type Problem = { message: string; help: string };
/** Last good plan with its multipliers, and its documents. */
export type StoredPlan = { snapshot: Snapshot; version: number; solution: Uint8Array };
/** Points that the user should check, and an action after the file has changed. */
export type Remarks = { of: string; each: string[]; again?: { text: string; isDue(): boolean; act(): Promise<void> } };
type Amendment = { edit: Edit; path: string; gesture: string | null; drag: boolean; again?: boolean };

export class Studio {
  readonly events = new Events<Name>();
  readonly documents = new Documents();
  readonly selection = new Selection(() => this.events.emit("selection"));
  /** Increases with every change of the documents. */
  version = 0;
  /** Version whose complete solve has ended, with any outcome. */
  settled = 0;
  scene: Scene | null = null;
  motion: MotionView | null = null;
  shown: ShownPlan | null = null;
  kept: StoredPlan | null = null;
  faults: Fault[] = [];
  problem: Problem | null = null;
  /** A success that is shown once: "saved walk.toml". */
  notice = "";
  /** Points that the user should check about the import of the project. */
  remarks: Remarks | null = null;
  progress: Progress | null = null;
  /** True while the user drags; each plan is then an intermediate step. */
  dragging = false;

  #planner: Planner;
  #amendments: Amendment[] = [];
  #amending = false;
  #gestures = 0;
  /** Increases when the documents change otherwise than by amendments. Amendments that were running are then void. */
  #epoch = 0;

  constructor(readonly engine: Engine) {
    this.#planner = new Planner(engine, {
      planned: (request, planned, frames) => this.#planned(request, planned, frames),
      kept: ({ snapshot, version }, solution) => {
        this.kept = { snapshot, version, solution };
        this.events.emit("kept");
      },
      failed: (request, error) => this.#failed(request, error),
      restarted: (error) => this.#restarted(error),
      progress: (progress) => {
        // Conflicting constraints stay visible while feasible values are sought.
        this.progress = progress && { ...progress, refused: progress.refused ?? this.progress?.refused };
        this.events.emit("activity");
      },
      activity: () => this.events.emit("activity"),
    });
  }

  get planning(): boolean {
    return this.#planner.busy || this.#amendments.length > 0 || this.#amending;
  }

  /** True if the picture shows documents before the last edit. */
  get stale(): boolean {
    return this.shown !== null && this.shown.version < this.version;
  }

  async openProject(snapshot: Snapshot, remember = true) {
    this.documents.open(snapshot, remember);
    await this.newProject();
  }

  /** Called after another project was opened. */
  async newProject() {
    this.selection.clear();
    this.remarks = null;
    this.#planner.forget();
    this.kept = null;
    await this.#documentsChanged("scratch");
  }

  chooseMotion(path: string) {
    this.documents.choose(path);
    void this.newProject();
  }

  newGesture(): string {
    return `gesture ${++this.#gestures}`;
  }

  /** Changes a document. The change is shown at once, and planned when the engine has the text. */
  edit(edit: Edit, { path = this.documents.motionPath, gesture = null as string | null, drag = false } = {}) {
    if (this.motion && this.scene && path === this.documents.motionPath) {
      const next = predict(edit, this.motion, this.scene);
      this.motion = next.motion;
      this.scene = next.scene;
    }
    this.version++;
    this.notice = "";
    this.dragging = drag;
    const amendment = { edit, path, gesture, drag };
    // A newer step of a drag replaces a step that still waits.
    const waiting = gesture ? this.#amendments.findIndex((one) => one.gesture === gesture && slot(one) === slot(amendment)) : -1;
    if (waiting >= 0) this.#amendments[waiting] = amendment;
    else this.#amendments.push(amendment);
    this.events.emit("documents", "activity");
    void this.#amend();
  }

  /** Replaces the text of a document as typed. */
  write(path: string, text: string, gesture: string | null) {
    this.documents.write(path, text, gesture);
    void this.#documentsChanged("good");
  }

  /** Replaces the text of a document; completes after the engine has read it. */
  async rewrite(path: string, text: string) {
    this.documents.write(path, text, null);
    await this.#documentsChanged("scratch");
  }

  /** Adds documents, which are not saved yet. */
  add(files: readonly File[]) {
    this.documents.add(files);
    void this.#documentsChanged("good");
  }

  undo() {
    if (this.documents.undo()) void this.#documentsChanged("good");
  }

  redo() {
    if (this.documents.redo()) void this.#documentsChanged("good");
  }

  planAgain() {
    void this.#documentsChanged("scratch");
  }

  /** Plans the present motion from a plan file. */
  planFrom(plan: string) {
    const { version } = this;
    this.problem = null;
    this.#planner.ask({ snapshot: this.documents.now, version, drag: false, from: "plan", plan: new TextEncoder().encode(plan) });
  }

  cancel() {
    this.#planner.cancel();
  }

  notify(notice: string) {
    this.notice = notice;
    this.events.emit("activity");
  }

  remark(remarks: Remarks) {
    this.remarks = remarks.each.length > 0 || remarks.again ? remarks : null;
    this.events.emit("activity");
  }

  showError(error: unknown) {
    if (error instanceof Cancelled) return;
    if (error instanceof Faults) this.faults = error.faults;
    else if (error instanceof Broken) this.problem = { message: `The engine stopped repeatedly: ${error.message}`, help: "Your documents are kept. Undo the last change, or save your documents and report this error." };
    else this.problem = { message: error instanceof Error ? error.message : String(error), help: error instanceof Refused ? error.help : "" };
    this.events.emit("activity");
  }

  async #amend() {
    if (this.#amending) return;
    this.#amending = true;
    while (this.#amendments.length > 0) {
      const amendment = this.#amendments.shift()!;
      const { edit, path, gesture, drag } = amendment;
      try {
        const { files, motion } = this.documents.now;
        const body = { kind: "amend", files: files.map((file) => ({ ...file })), motion, path, edit } as const;
        const epoch = this.#epoch;
        const { value } = await this.engine.request("documents", body);
        if (epoch !== this.#epoch) continue;
        this.documents.write(path, value.text, gesture);
        this.problem = null;
        if (!drag) this.documents.endGesture();
        if (this.#amendments.length === 0) await this.#changed(drag ? "drag" : "good");
      } catch (error) {
        if (error instanceof Broken && !amendment.again) {
          this.#amendments.unshift({ ...amendment, again: true });
          this.#restarted(error);
          continue;
        }
        this.#refuse(error);
        // The document is unchanged. After a drag, it is shown again.
        if (!drag) await this.#changed("good");
      }
    }
    this.#amending = false;
    this.events.emit("documents", "activity");
  }

  #restarted(error: Broken) {
    console.warn(error.message);
    this.notify("The engine stopped and was restarted. Nothing is lost.");
  }

  /** An edit that the engine refuses is a problem of the edit, not a fault of the documents. */
  #refuse(error: unknown) {
    if (!(error instanceof Faults)) return this.showError(error);
    const [{ message, label, help }] = error.faults;
    this.problem = { message: label ? `${message}: ${label}` : message, help };
    this.events.emit("activity");
  }

  async #documentsChanged(from: "scratch" | "good") {
    this.version++;
    this.notice = "";
    this.dragging = false;
    this.#epoch++;
    this.#amendments = [];
    this.problem = null;
    await this.#changed(from);
  }

  async #changed(how: "scratch" | "good" | "drag") {
    const version = this.version;
    const snapshot = this.documents.now;
    const drag = how === "drag";
    const sound = drag || (await this.#read(snapshot, version));
    this.events.emit("documents", "activity");
    if (version !== this.version) return;
    if (!sound) {
      this.settled = version;
      this.events.emit("activity");
      return;
    }
    // Reading may have added a shipped robot to the documents.
    const { now } = this.documents;
    if (how === "good" && this.#isOfShown(now)) return this.#keepShown(version);
    this.#planner.ask({ snapshot: now, version, drag, from: how === "scratch" ? "scratch" : "good" });
  }

  /** True if the shown plan belongs to these documents, because the edit changed another document, such as the library. */
  #isOfShown(snapshot: Snapshot): boolean {
    const { shown } = this;
    return shown !== null && !shown.drag && !this.#planner.busy && shown.planned.good && shown.of === this.#planOf(snapshot);
  }

  #keepShown(version: number) {
    this.shown!.version = this.settled = version;
    if (this.kept) this.kept = { ...this.kept, snapshot: this.documents.now, version };
    this.events.emit("plan", "kept", "activity");
  }

  /** Key of a plan: the texts of motion and robot. */
  #planOf({ files, motion }: Snapshot): string {
    const paths = [motion, this.documents.readRobot];
    return JSON.stringify(paths.map((path) => [path, files.find((file) => file.path === path)?.text]));
  }

  /** Reads the documents. The engine validates them without planning. */
  async #read(snapshot: Snapshot, version: number): Promise<boolean> {
    try {
      const { value } = await this.engine.request("documents", {
        kind: "open",
        files: snapshot.files.map((file) => ({ ...file })),
        motion: snapshot.motion,
      });
      if (version !== this.version) return true;
      this.faults = [];
      this.scene = value.scene;
      this.motion = value.motion;
      await this.#adopt(value.read[1]);
      return true;
    } catch (error) {
      if (version === this.version) this.showError(error);
      return false;
    }
  }

  /** Adds the text of a shipped robot that the user has not opened to the project, so that the user can change the robot. */
  async #adopt(robot: string) {
    this.documents.readRobot = robot;
    if (!robot || this.documents.text(robot) !== undefined) return;
    const { value } = await this.engine.request("documents", { kind: "example", path: robot });
    this.documents.adopt({ path: robot, text: value.text });
  }

  #planned(request: PlanRequest, planned: Planned, frames: Float32Array) {
    this.shown = {
      planned,
      frames: new Frames(planned.frames, frames, planned.scene.end_effectors),
      version: request.version,
      drag: request.drag,
      of: this.#planOf(request.snapshot),
    };
    this.faults = [];
    if (request.version === this.version) {
      this.scene = planned.scene;
      this.motion = planned.motion;
      if (!request.drag) this.settled = request.version;
      this.events.emit("documents");
    }
    this.events.emit("plan", "activity");
  }

  #failed(request: PlanRequest, error: Error) {
    if (error instanceof Cancelled) this.notice = "Planning was stopped. The picture shows the previous plan.";
    else this.showError(error);
    if (!request.drag && request.version === this.version && !(error instanceof Broken)) this.settled = request.version;
    this.events.emit("plan", "activity");
  }
}

/** Key of an amendment's target; amendments with the same key set the same value. */
function slot({ path, edit }: Amendment): string {
  const { edit: kind, key, index, name } = edit as Partial<{ edit: string; key: string; index: number | null; name: string }>;
  return [path, kind, key, index, name].join(" ");
}
