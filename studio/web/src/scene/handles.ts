// Draggable objects of the scene: targets and the goal. They move on the ground plane, and with Shift upwards. Their values can
// also be typed in the panel.

import { ConeGeometry, Group, Line, LineBasicMaterial, Mesh, MeshBasicMaterial, Object3D, Plane, Raycaster, RingGeometry, SphereGeometry, Vector2, Vector3 } from "three";
import type { MotionView, Target } from "../contract.ts";
import type { Frames } from "../project/frames.ts";
import { dispose, lineGeometry, shared } from "./lines.ts";
import type { Palette } from "./palette.ts";
import type { Stage } from "./stage.ts";

export type Grip = { kind: "target"; index: number } | { kind: "goal" };
export type HandleMove = { forward_m: number; left_m: number; up_m: number };

/** `reach_m`: distance from the marker's position within which it can be grasped. */
type Handle = { grip: Grip; object: Group; at: Vector3; vertical: boolean; reach_m: number };

export class Handles {
  readonly group = new Group();
  #handles: Handle[] = [];
  #drag: { handle: Handle; plane: Plane; offset: Vector3; shift: boolean } | null = null;
  #ray = new Raycaster();

  constructor(
    private readonly stage: Stage,
    private readonly told: {
      begin(grip: Grip): void;
      moved(grip: Grip, to: HandleMove, upwards: boolean): void;
      end(): void;
    },
  ) {
    const { canvas } = stage;
    // Captured before the orbit controls get the event.
    canvas.addEventListener("pointerdown", (event) => this.#down(event), { capture: true });
    canvas.addEventListener("pointermove", (event) => this.#move(event), { capture: true });
    canvas.addEventListener("pointerup", (event) => this.#up(event), { capture: true });
    canvas.addEventListener("pointercancel", (event) => this.#up(event), { capture: true });
  }

  get dragging(): boolean {
    return this.#drag !== null;
  }

  build(motion: MotionView, frames: Frames | null, feet: string[], palette: Palette, selected: number | null, scale: number) {
    for (const one of this.#handles) dispose(one.object);
    this.#handles = [];
    motion.targets.forEach((target, index) => {
      const at = placeOf(target, motion, frames, feet);
      this.#add({ kind: "target", index }, at, marker(at, palette.accent, index === selected, scale), true, 0);
    });
    const start = frames ? frames.com(frames.row(0)) : [0, 0, 0];
    const { forward_m, left_m, turn_rad } = motion.goal;
    if (forward_m !== null || left_m !== null) {
      const at = new Vector3(start[0] + (forward_m ?? 0), start[1] + (left_m ?? 0), 0);
      this.#add({ kind: "goal" }, at, flag(palette, turn_rad ?? 0, scale), false, FLAG_M * scale);
    }
    this.stage.invalidate();
  }

  /** Position of a handle on the page, for tests, labels and the pointer. */
  screen(grip: Grip): { x: number; y: number } | null {
    const handle = this.#handles.find(({ grip: one }) => one.kind === grip.kind && (one.kind === "goal" || one.index === (grip as { index: number }).index));
    if (!handle) return null;
    const box = this.stage.canvas.getBoundingClientRect();
    this.stage.camera.updateMatrixWorld();
    return this.#project(this.#world(handle), box);
  }

  /** Moves all handles to a later cycle of the motion. */
  carry({ x, y, yaw }: { x: number; y: number; yaw: number }) {
    if (this.dragging) return;
    this.group.position.set(x, y, 0);
    this.group.rotation.z = yaw;
    this.group.updateMatrixWorld();
  }

  #world({ at }: Handle): Vector3 {
    return this.group.localToWorld(at.clone());
  }

  #project(at: Vector3, box = this.stage.canvas.getBoundingClientRect()): { x: number; y: number } {
    const point = at.clone().project(this.stage.camera);
    return { x: box.left + ((point.x + 1) / 2) * box.width, y: box.top + ((1 - point.y) / 2) * box.height };
  }

  /** Size in pixels of a length across the view at that point. */
  #pixels(handle: Handle): number {
    const at = this.#world(handle);
    const across = new Vector3().setFromMatrixColumn(this.stage.camera.matrixWorld, 0).multiplyScalar(handle.reach_m);
    const [a, b] = [this.#project(at), this.#project(at.clone().add(across))];
    return Math.hypot(b.x - a.x, b.y - a.y);
  }

  #add(grip: Grip, at: Vector3, object: Group, vertical: boolean, reach_m: number) {
    object.position.copy(at);
    this.group.add(object);
    this.#handles.push({ grip, object, at, vertical, reach_m });
  }

  #aim(event: PointerEvent) {
    const box = this.stage.canvas.getBoundingClientRect();
    const at = new Vector2(((event.clientX - box.left) / box.width) * 2 - 1, 1 - ((event.clientY - box.top) / box.height) * 2);
    this.#ray.setFromCamera(at, this.stage.camera);
  }

  #hit(event: PointerEvent): Handle | null {
    if (!this.group.visible) return null;
    // The handle that is nearest on the screen, within reach of a finger or a pointer, or under it.
    const reach = event.pointerType === "touch" ? 28 : 14;
    let best: Handle | null = null;
    let least = 1;
    for (const handle of this.#handles) {
      const at = this.screen(handle.grip)!;
      const distance = Math.hypot(at.x - event.clientX, at.y - event.clientY) / Math.max(reach, this.#pixels(handle));
      if (distance < least) [best, least] = [handle, distance];
    }
    return best;
  }

  #down(event: PointerEvent) {
    if (event.button !== 0) return;
    const handle = this.#hit(event);
    if (!handle) return;
    event.stopImmediatePropagation();
    event.preventDefault();
    this.stage.canvas.setPointerCapture(event.pointerId);
    this.#drag = { handle, plane: new Plane(), offset: new Vector3(), shift: event.shiftKey };
    this.#plane(event, event.shiftKey && handle.vertical);
    this.told.begin(handle.grip);
  }

  #plane(event: PointerEvent, upwards: boolean) {
    const drag = this.#drag!;
    drag.shift = upwards;
    const normal = upwards ? this.stage.camera.getWorldDirection(new Vector3()).setZ(0).normalize() : new Vector3(0, 0, 1);
    const at = this.#world(drag.handle);
    drag.plane.setFromNormalAndCoplanarPoint(normal, at);
    this.#aim(event);
    const hit = this.#ray.ray.intersectPlane(drag.plane, new Vector3());
    drag.offset.copy(hit ? at.sub(hit) : new Vector3());
  }

  #move(event: PointerEvent) {
    const drag = this.#drag;
    if (!drag) {
      this.stage.canvas.style.cursor = this.#hit(event) ? "grab" : "";
      return;
    }
    event.stopImmediatePropagation();
    this.stage.canvas.style.cursor = "grabbing";
    const upwards = event.shiftKey && drag.handle.vertical;
    if (upwards !== drag.shift) this.#plane(event, upwards);
    this.#aim(event);
    const hit = this.#ray.ray.intersectPlane(drag.plane, new Vector3());
    if (!hit) return;
    this.group.worldToLocal(hit.add(drag.offset));
    if (hit.length() > 20) return;
    const { at, object } = drag.handle;
    if (upwards) at.z = Math.max(0, hit.z);
    else at.set(hit.x, hit.y, at.z);
    object.position.copy(at);
    this.stage.invalidate();
    this.told.moved(drag.handle.grip, { forward_m: at.x, left_m: at.y, up_m: at.z }, upwards);
  }

  #up(event: PointerEvent) {
    const drag = this.#drag;
    if (!drag) return;
    event.stopImmediatePropagation();
    this.#drag = null;
    this.stage.canvas.style.cursor = "";
    this.told.end();
  }
}

/** Position at which a target is drawn; its free coordinates come from the plan. */
function placeOf(target: Target, motion: MotionView, frames: Frames | null, feet: string[]): Vector3 {
  let at = new Vector3();
  if (frames) {
    const time = motion.duration_s > 0 ? (target.at_s / motion.duration_s) * frames.header.duration_s : 0;
    const row = frames.at(Math.min(time, frames.header.duration_s));
    const foot = feet.indexOf(target.of);
    const { bodies } = frames.header.columns;
    if (foot >= 0) at.set(...frames.position(row, foot));
    else if (target.of === "com") at.set(...frames.com(row));
    else at.set(row[bodies], row[bodies + 1], row[bodies + 2]);
  }
  return new Vector3(target.forward_m ?? at.x, target.left_m ?? at.y, target.up_m ?? at.z);
}

/** Sizes of markers suit a robot of AgileBot's height; `scale` adapts them to others. */
function marker(at: Vector3, color: number, selected: boolean, scale: number): Group {
  const group = new Group();
  const over = { color, depthTest: false, transparent: true };
  const ball = new Mesh(new SphereGeometry(selected ? 0.018 : 0.012, 20, 14), shared(MeshBasicMaterial, over));
  const stem = new Line(lineGeometry([0, 0, 0, 0, 0, -at.z]), shared(LineBasicMaterial, { ...over, opacity: 0.7 }));
  const foot = new Mesh(new RingGeometry(0.014, 0.019, 24), shared(MeshBasicMaterial, { ...over, opacity: 0.7 }));
  foot.position.z = -at.z + 0.003;
  ball.scale.setScalar(scale);
  foot.scale.setScalar(scale);
  group.add(stem, foot, ball);
  group.traverse((object: Object3D) => (object.renderOrder = 11));
  return group;
}

/** Distance from the middle of the goal's ring to the tip of its nose, before scaling, m. */
const FLAG_M = 0.076;

/** The goal: a ring on the ground with a nose that shows the heading at the end. */
function flag(palette: Palette, turn_rad: number, scale: number): Group {
  const group = new Group();
  const over = { color: palette.accent, transparent: true, depthWrite: false };
  const ring = new Mesh(new RingGeometry(0.028, 0.036, 36), shared(MeshBasicMaterial, over));
  ring.position.z = 0.004;
  const nose = new Mesh(new ConeGeometry(0.014, 0.035, 3), shared(MeshBasicMaterial, over));
  nose.rotation.z = -Math.PI / 2;
  nose.scale.z = 0.05;
  nose.position.set(0.058, 0, 0.004);
  group.add(ring, nose);
  group.rotation.z = turn_rad;
  group.scale.setScalar(scale);
  group.traverse((object: Object3D) => (object.renderOrder = 3));
  return group;
}
