// The plan's pose as a ghost on a live robot, with coinciding bodies, so that only joints differ. The position of a real robot's
// body in the world is unknown, and a simulated robot drifts.

import { type Object3D, Quaternion, Vector3 } from "three";
import type { Scene } from "../contract.ts";
import type { Row } from "../project/frames.ts";
import type { Palette } from "./palette.ts";
import { Robot } from "./robot.ts";

export class PlanGhost {
  #robot: Robot | null = null;
  #of: Scene | null = null;

  constructor(private readonly parent: Object3D) {}

  get shown(): boolean {
    return this.#robot !== null && this.#robot.group.visible;
  }

  /** Poses the ghost by a row, whose bodies begin at `offset`, on the live robot's body. */
  show(scene: Scene, palette: Palette, row: Row, offset: number, live: Float32Array) {
    if (this.#of !== scene) {
      this.dispose();
      this.#of = scene;
      this.#robot = new Robot(scene, palette, "beside", false);
      this.parent.add(this.#robot.group);
    }
    const { group } = this.#robot!;
    this.#robot!.pose(row, offset);
    group.visible = true;
    const planned = turn(row, offset).invert();
    group.quaternion.copy(turn(live, 0).multiply(planned));
    const moved = new Vector3(row[offset], row[offset + 1], row[offset + 2]).applyQuaternion(group.quaternion);
    group.position.set(live[0], live[1], live[2]).sub(moved);
  }

  hide() {
    if (this.#robot) this.#robot.group.visible = false;
  }

  dispose() {
    this.#robot?.dispose();
    [this.#robot, this.#of] = [null, null];
  }
}

/** Orientation of the body that begins at an index of a row. */
function turn(row: Row, at: number): Quaternion {
  return new Quaternion(row[at + 4], row[at + 5], row[at + 6], row[at + 3]);
}
