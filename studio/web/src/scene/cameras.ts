// Cameras: orbit and fixed directions, still or following the robot.

import { Vector3 } from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";
import type { Stage } from "./stage.ts";

export type Direction = "free" | "front" | "side" | "top";

const FROM: Record<Direction, [number, number, number]> = {
  free: [0.75, -1, 0.5],
  front: [1, 0, 0.12],
  side: [0, -1, 0.12],
  top: [0, -0.001, 1],
};

export class Cameras {
  readonly controls: OrbitControls;
  direction: Direction = "free";
  follow = true;
  #last = new Vector3();
  #distance_m = 1.6;

  constructor(private readonly stage: Stage) {
    this.controls = new OrbitControls(stage.camera, stage.canvas);
    this.controls.enableDamping = false;
    this.controls.minDistance = 0.15;
    this.controls.maxDistance = 40;
    this.controls.addEventListener("change", () => stage.invalidate());
  }

  /** Shows the whole robot. */
  frame(centre: [number, number, number], size_m: number) {
    this.#distance_m = Math.max(0.2, size_m * 2.2);
    this.#last.set(...centre);
    this.look(this.direction);
  }

  look(direction: Direction) {
    this.direction = direction;
    const away = new Vector3(...FROM[direction]).setLength(this.#distance_m);
    this.controls.target.copy(this.#last);
    this.stage.camera.position.copy(this.#last).add(away);
    this.controls.update();
    this.stage.invalidate();
  }

  /** Sets the robot's position. A following camera moves with the robot in the plane. */
  at(x: number, y: number, z: number) {
    if (this.follow) {
      const move = new Vector3(x - this.#last.x, y - this.#last.y, 0);
      if (move.lengthSq() > 0) {
        this.controls.target.add(move);
        this.stage.camera.position.add(move);
        this.stage.camera.updateMatrixWorld();
      }
    }
    this.#last.set(x, y, this.follow ? this.#last.z : z);
  }

  orbit(turn_rad: number, tilt_rad: number) {
    const offset = this.stage.camera.position.clone().sub(this.controls.target);
    offset.applyAxisAngle(new Vector3(0, 0, 1), turn_rad);
    const side = new Vector3(-offset.y, offset.x, 0).normalize();
    const tilted = offset.clone().applyAxisAngle(side, -tilt_rad);
    if (Math.abs(tilted.z) / tilted.length() < 0.995) offset.copy(tilted);
    this.stage.camera.position.copy(this.controls.target).add(offset);
    this.controls.update();
  }

  zoom(factor: number) {
    const offset = this.stage.camera.position.clone().sub(this.controls.target).multiplyScalar(factor);
    this.stage.camera.position.copy(this.controls.target).add(offset);
    this.controls.update();
  }
}
