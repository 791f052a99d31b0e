// The 3D view: combines robot, ground, overlays and handles, and updates them with plan and time.

import type { Scene, Target } from "../contract.ts";
import type { Playback } from "../project/playback.ts";
import { isDark, type Settings } from "../project/settings.ts";
import type { Row } from "../project/frames.ts";
import type { Studio } from "../project/studio.ts";
import { PlanGhost } from "./beside.ts";
import { Cameras } from "./cameras.ts";
import { Ground } from "./ground.ts";
import { type Grip, Handles, type HandleMove } from "./handles.ts";
import { Overlays } from "./overlays.ts";
import { DARK, LIGHT, type Palette } from "./palette.ts";
import { Paths } from "./paths.ts";
import { Robot } from "./robot.ts";
import { Stage } from "./stage.ts";

const GHOSTS = 4;
const AGILEBOT_HEIGHT_M = 0.29;
/**
 * Minimum time between pictures of a connected robot that are drawn in software, ms, because its heartbeats also need the processor.
 */
const LIVE_MS = 100;
/** Limit of invisible changes of poses, m and quaternions. */
const UNSEEN = 1e-4;

export class View {
  readonly stage: Stage;
  readonly cameras: Cameras;
  readonly handles: Handles;
  #ground: Ground;
  #palette: Palette = LIGHT;
  #dark = false;
  #robot: Robot | null = null;
  #ghosts: Robot[] = [];
  #overlays: Overlays | null = null;
  #paths: Paths | null = null;
  #built = "";
  #gesture: string | null = null;
  #from: HandleMove = { forward_m: 0, left_m: 0, up_m: 0 };
  /** Last step of a drag. */
  #last: { grip: Grip; to: HandleMove; upwards: boolean } | null = null;
  /** Poses of a connected robot. */
  #live: Float32Array | null = null;
  #planGhost: PlanGhost;
  /** Earliest time of the next picture of a connected robot, ms. */
  #liveFrom_ms = 0;

  constructor(
    host: HTMLElement,
    private readonly studio: Studio,
    private readonly playback: Playback,
    private readonly settings: Settings,
  ) {
    this.stage = new Stage(host);
    this.#ground = new Ground(!this.stage.low);
    this.stage.scene.add(this.#ground.group);
    this.#planGhost = new PlanGhost(this.stage.scene);
    this.cameras = new Cameras(this.stage);
    this.handles = new Handles(this.stage, {
      begin: (grip) => this.#begin(grip),
      moved: (grip, to, upwards) => this.#moved(grip, to, upwards, true),
      end: () => this.#end(),
    });
    this.stage.scene.add(this.handles.group);
    this.stage.beforeDraw(() => this.#pose());
    studio.events.on("plan", () => this.#planChanged());
    studio.events.on(["documents", "selection"], () => this.#buildHandles());
    studio.events.on("documents", () => this.#showStanding());
    studio.events.on("selection", () => this.#highlight());
    playback.onChange(() => this.stage.invalidate());
    this.restyle();
  }

  /** Called after a change of theme or layers. */
  restyle() {
    this.#dark = isDark(this.settings.theme);
    this.#palette = this.#dark ? DARK : LIGHT;
    this.stage.colour(this.#palette);
    this.#ground.colour(this.#palette);
    this.#built = "";
    this.cameras.follow = this.settings.follow;
    this.#planChanged();
  }

  layersChanged() {
    const { layers } = this.settings;
    this.cameras.follow = this.settings.follow;
    if (this.#paths) [this.#paths.com.visible, this.#paths.feet.visible] = [layers.com_path, layers.foot_paths];
    this.#robot?.showClearance(layers.clearance);
    this.handles.group.visible = layers.targets;
    this.#ground.marks(layers.marks);
    this.#buildGhosts();
    this.stage.invalidate();
  }

  #planChanged() {
    const { shown } = this.studio;
    if (!shown) return this.#showStanding();
    const { planned, frames } = shown;
    this.#buildRobot(planned.scene);
    this.#paths?.dispose();
    this.#paths = new Paths(planned.scene, frames, this.#palette, this.#dark);
    this.stage.scene.add(this.#paths.group);
    this.playback.setFrames(frames.header);
    this.layersChanged();
    this.#buildHandles();
    this.#highlight();
  }

  /** Without a plan, the robot stands. */
  #showStanding() {
    const { scene, shown } = this.studio;
    if (shown || !scene || scene.standing.length === 0) return this.stage.invalidate();
    this.#buildRobot(scene);
    this.#overlays!.group.visible = false;
    this.#robot!.pose(Float32Array.from(scene.standing.flat()), 0);
    this.stage.invalidate();
  }

  /**
   * Shows poses of the robot at the other end of a link in place of the plan, and a row of the plan as a ghost; null shows the plan
   * again.
   */
  showLive(poses: number[][] | null, plan: Row | null) {
    if (!poses && !this.#live) return;
    const live = poses && poses.length > 0 ? Float32Array.from(poses.flat()) : null;
    const same = live && this.#live && !differ(live, this.#live) && !plan && !this.#planGhost.shown;
    if (live && this.#live && (performance.now() < this.#liveFrom_ms || same)) return;
    this.#liveFrom_ms = performance.now() + (this.stage.low ? LIVE_MS : 0);
    this.#live = live;
    const planned = this.#live === null;
    if (this.#overlays) this.#overlays.group.visible = planned && this.studio.shown !== null;
    if (this.#paths) this.#paths.group.visible = planned;
    this.handles.group.visible = planned && this.settings.layers.targets;
    for (const ghost of this.#ghosts) ghost.group.visible = planned;
    const { shown } = this.studio;
    if (live && plan && shown) this.#planGhost.show(shown.planned.scene, this.#palette, plan, shown.frames.header.columns.bodies, live);
    else this.#planGhost.hide();
    this.stage.invalidate();
  }

  #buildRobot(scene: Scene) {
    const built = JSON.stringify([scene.bodies, scene.end_effectors, scene.mass_kg]);
    if (built === this.#built) {
      this.#overlays!.group.visible = true;
      return;
    }
    const another = this.#robot?.group.name !== scene.name;
    this.#built = built;
    this.#robot?.dispose();
    this.#overlays?.dispose();
    for (const ghost of this.#ghosts) ghost.dispose();
    this.#ghosts = [];
    this.#planGhost.dispose();
    this.#robot = new Robot(scene, this.#palette, "solid", !this.stage.low);
    this.#robot.group.name = scene.name;
    this.#robot.showClearance(this.settings.layers.clearance);
    this.#overlays = new Overlays(scene, this.#palette, scaleOf(scene));
    this.stage.scene.add(this.#robot.group, this.#overlays.group);
    if (another) this.#frame(scene);
  }

  /** Shows the whole robot, by its standing pose. */
  #frame(scene: Scene) {
    const { shown } = this.studio;
    const [x, y] = shown ? shown.frames.com(shown.frames.at(this.playback.time_s)) : [0, 0];
    const reach = (pose: number[]) => Math.max(Math.abs(pose[0]), Math.abs(pose[1]), pose[2]);
    const size = scene.standing.length > 0 ? 2 * Math.max(...scene.standing.map(reach)) : 0.5;
    const height = scene.standing[0]?.[2] ?? 0.25;
    this.cameras.frame([x, y, height * 0.6], size);
  }

  #buildGhosts() {
    const { shown } = this.studio;
    const wanted = this.settings.layers.ghosts && shown ? GHOSTS : 0;
    while (this.#ghosts.length > wanted) this.#ghosts.pop()!.dispose();
    if (!shown) return;
    const { frames, planned } = shown;
    while (this.#ghosts.length < wanted) {
      const ghost = new Robot(planned.scene, this.#palette, "ghost", false);
      this.stage.scene.add(ghost.group);
      this.#ghosts.push(ghost);
    }
    this.#ghosts.forEach((ghost, k) => {
      const share = frames.header.period ? (k + 1) / wanted : k / (wanted - 1);
      ghost.pose(frames.at(share * frames.header.duration_s), frames.header.columns.bodies);
    });
  }

  #buildHandles() {
    const { motion, shown, selection } = this.studio;
    if (!motion || this.handles.dragging) return;
    const feet = (this.studio.scene?.end_effectors ?? []).map((foot) => foot.name);
    this.handles.build(motion, shown?.frames ?? null, feet, this.#palette, selection.target, this.studio.scene ? scaleOf(this.studio.scene) : 1);
  }

  #highlight() {
    const { selection, shown } = this.studio;
    if (!shown || !this.#robot) return;
    const bodies = new Set<number>();
    const foot = selection.endEffector === null ? null : shown.planned.scene.end_effectors[selection.endEffector];
    if (foot) {
      bodies.add(foot.body);
      if (foot.wheel_body !== null) bodies.add(foot.wheel_body);
    }
    const joint = selection.joint === null ? null : shown.planned.scene.joints[selection.joint];
    if (joint) bodies.add(joint.body);
    this.#robot.highlight(bodies, this.#palette);
    this.stage.invalidate();
  }

  #pose() {
    const { shown } = this.studio;
    if (this.#live && this.#robot) {
      this.#robot.pose(this.#live, 0);
      this.#place(this.#live[0], this.#live[1], this.#live[2]);
      return;
    }
    if (!shown || !this.#robot || !this.#overlays) return;
    const { frames } = shown;
    const row = frames.at(this.playback.time_s);
    const moved = frames.moved(this.playback.cycle);
    this.handles.carry(moved);
    this.#paths?.carry(moved);
    this.#robot.pose(row, frames.header.columns.bodies);
    this.#overlays.update(frames, row, this.settings.layers);
    this.#place(...frames.com(row));
  }

  #place(x: number, y: number, z: number) {
    this.cameras.at(x, y, z);
    this.stage.lightAt(x, y);
    this.#ground.centre(this.cameras.controls.target.x, this.cameras.controls.target.y);
  }

  #begin(grip: Grip) {
    this.#gesture = this.studio.newGesture();
    this.playback.pause();
    if (grip.kind === "target") this.studio.selection.selectTarget(grip.index);
    const com = this.studio.shown ? this.studio.shown.frames.com(this.studio.shown.frames.row(0)) : [0, 0, 0];
    this.#from = { forward_m: com[0], left_m: com[1], up_m: 0 };
  }

  #moved(grip: Grip, to: HandleMove, upwards: boolean, drag: boolean) {
    this.#last = { grip, to, upwards };
    const gesture = this.#gesture;
    const { motion } = this.studio;
    if (!motion) return;
    if (grip.kind === "target") {
      const target = motion.targets[grip.index];
      if (target) this.studio.edit({ edit: "target", index: grip.index, target: placed(target, to, upwards) }, { gesture, drag });
      return;
    }
    for (const [key, value] of [
      ["forward_m", to.forward_m - this.#from.forward_m],
      ["left_m", to.left_m - this.#from.left_m],
    ] as const) {
      if (motion.goal[key] !== null) this.studio.edit({ edit: "number", table: ["goal"], key, value: round(value) }, { gesture, drag });
    }
  }

  #end() {
    // Repeats the last step with a complete solve. A click without a move changes nothing.
    if (this.#last) this.#moved(this.#last.grip, this.#last.to, this.#last.upwards, false);
    this.#last = null;
    this.#gesture = null;
    this.#buildHandles();
  }
}

function differ(a: Float32Array, b: Float32Array): boolean {
  return a.length !== b.length || a.some((value, index) => Math.abs(value - b[index]) > UNSEEN);
}

/** Height of the standing robot's body relative to AgileBot's, to which arrows and handles are scaled. */
function scaleOf(scene: Scene): number {
  const height_m = scene.standing[0]?.[2] ?? AGILEBOT_HEIGHT_M;
  return Math.max(0.2, Math.min(5, height_m / AGILEBOT_HEIGHT_M));
}

function round(value: number): number {
  return Math.round(value * 1000) / 1000;
}

/**
 * A drag on the ground plane changes the horizontal components of a target that are prescribed; if both are free, both become
 * prescribed. Only an upward drag changes the height, which then is prescribed.
 */
function placed(target: Target, to: HandleMove, upwards: boolean): Target {
  if (upwards) return { ...target, up_m: round(to.up_m) };
  const next = { ...target };
  const both = (target.forward_m ?? null) === null && (target.left_m ?? null) === null;
  if (both || (target.forward_m ?? null) !== null) next.forward_m = round(to.forward_m);
  if (both || (target.left_m ?? null) !== null) next.left_m = round(to.left_m);
  return next;
}
