// Paths of the centre of mass and of the feet over the whole motion, and footholds.

import { CircleGeometry, Group, Line, LineBasicMaterial, LineDashedMaterial, Mesh, MeshBasicMaterial } from "three";
import type { Scene } from "../contract.ts";
import type { Frames } from "../project/frames.ts";
import { dispose, lineGeometry, shared } from "./lines.ts";
import { footColour, type Palette } from "./palette.ts";

export class Paths {
  readonly group = new Group();
  readonly com = new Group();
  readonly feet = new Group();

  constructor(scene: Scene, frames: Frames, palette: Palette, dark: boolean) {
    this.group.add(this.com, this.feet);
    const rows = Array.from({ length: frames.header.count }, (_, index) => frames.row(index));
    if (frames.header.period) rows.push(frames.at(frames.header.duration_s));

    const path = rows.flatMap((row) => frames.com(row));
    const shadow = rows.flatMap((row) => [...frames.com(row).slice(0, 2), 0.003]);
    // The path is inside the robot, so it is drawn over everything.
    const line = new Line(lineGeometry(path), shared(LineBasicMaterial, { color: palette.com, depthTest: false, transparent: true }));
    line.renderOrder = 9;
    this.com.add(line);
    const dashes = shared(LineDashedMaterial, { color: palette.com, dashSize: 0.012, gapSize: 0.01, transparent: true, opacity: 0.6 });
    const projected = new Line(lineGeometry(shadow), dashes);
    projected.computeLineDistances();
    this.com.add(projected);

    scene.end_effectors.forEach((_, foot) => {
      const color = footColour(foot, dark);
      const points = rows.flatMap((row) => lifted(frames.position(row, foot)));
      this.feet.add(new Line(lineGeometry(points), shared(LineBasicMaterial, { color })));
      this.#footprints(frames, foot, color);
    });
  }

  /** Moves the paths to a later cycle of the motion. */
  carry({ x, y, yaw }: { x: number; y: number; yaw: number }) {
    this.group.position.set(x, y, 0);
    this.group.rotation.z = yaw;
  }

  dispose() {
    dispose(this.group);
  }

  /** Discs at the positions where a foot lands. */
  #footprints(frames: Frames, foot: number, color: string) {
    for (let index = 1; index < frames.header.count; index++) {
      const row = frames.row(index);
      if (!frames.contact(row, foot) || frames.contact(frames.row(index - 1), foot)) continue;
      const mark = new Mesh(new CircleGeometry(0.011, 20), shared(MeshBasicMaterial, { color, transparent: true, opacity: 0.75, depthWrite: false }));
      mark.position.set(...lifted(frames.position(row, foot)));
      this.feet.add(mark);
    }
  }
}

/** A little above the ground, so that lines do not sink into it. */
function lifted([x, y, z]: [number, number, number]): [number, number, number] {
  return [x, y, Math.max(z, 0) + 0.004];
}
