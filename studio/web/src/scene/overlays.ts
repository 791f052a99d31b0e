// Overlays of the robot at a time: forces, friction cones, support polygon.

import {
  ArrowHelper,
  BufferGeometry,
  CircleGeometry,
  ConeGeometry,
  DoubleSide,
  Float32BufferAttribute,
  Group,
  LineBasicMaterial,
  LineLoop,
  Mesh,
  MeshBasicMaterial,
  Vector3,
} from "three";
import type { Scene } from "../contract.ts";
import type { Frames, Row } from "../project/frames.ts";
import { dispose } from "./lines.ts";
import type { Palette } from "./palette.ts";

const GRAVITY_M_S2 = 9.80665;
/** Length of the arrow of a force equal to the robot's weight, and height of a cone, m, for a robot of AgileBot's height. */
const WEIGHT_LENGTH_M = 0.35;
const CONE_HEIGHT_M = 0.1;
const COM_RADIUS_M = 0.008;
/** Share of the robot's weight above which a foot counts as supporting. */
const LEAST_SHARE = 0.002;

export class Overlays {
  readonly group = new Group();
  #arrows: ArrowHelper[] = [];
  #cones: Mesh[] = [];
  #fill: Mesh;
  #outline: LineLoop;
  /** Mark on the ground below the centre of mass. */
  #below: Mesh;
  #weight: number;

  constructor(
    scene: Scene,
    palette: Palette,
    private readonly scale: number,
  ) {
    this.#weight = scene.mass_kg * GRAVITY_M_S2;
    for (const foot of scene.end_effectors) {
      const arrow = new ArrowHelper(new Vector3(0, 0, 1), new Vector3(), 0.1, palette.force);
      // Contact points lie inside wheels, so arrows are drawn over everything.
      for (const part of [arrow.line, arrow.cone]) {
        const material = part.material as LineBasicMaterial;
        material.depthTest = false;
        part.renderOrder = 10;
      }
      this.#arrows.push(arrow);
      const height_m = CONE_HEIGHT_M * scale;
      const radius_m = foot.friction_coefficient * height_m;
      const geometry = new ConeGeometry(radius_m, height_m, 24, 1, true).rotateX(-Math.PI / 2).translate(0, 0, height_m / 2);
      const material = new MeshBasicMaterial({ color: palette.cone, transparent: true, opacity: 0.22, side: DoubleSide, depthWrite: false });
      this.#cones.push(new Mesh(geometry, material));
      this.group.add(arrow, this.#cones.at(-1)!);
    }
    const colour = { color: palette.polygon, transparent: true, depthWrite: false };
    this.#fill = new Mesh(new BufferGeometry(), new MeshBasicMaterial({ ...colour, opacity: 0.12, side: DoubleSide }));
    this.#outline = new LineLoop(new BufferGeometry(), new LineBasicMaterial({ ...colour, opacity: 0.8 }));
    this.#fill.frustumCulled = this.#outline.frustumCulled = false;
    // Visible through the robot, because the robot would hide it from above.
    const dot = new MeshBasicMaterial({ color: palette.polygon, depthTest: false, transparent: true });
    this.#below = new Mesh(new CircleGeometry(COM_RADIUS_M * scale, 20), dot);
    this.#below.renderOrder = 9;
    this.group.add(this.#fill, this.#outline, this.#below);
  }

  update(frames: Frames, row: Row, layers: { forces: boolean; cones: boolean; polygon: boolean }) {
    const standing: [number, number][] = [];
    this.#arrows.forEach((arrow, foot) => {
      const at = frames.position(row, foot);
      const force = new Vector3(...frames.force(row, foot));
      const share = force.length() / this.#weight;
      const contact = frames.contact(row, foot);
      arrow.visible = layers.forces && contact && share > LEAST_SHARE;
      if (arrow.visible) {
        const length = share * WEIGHT_LENGTH_M * this.scale;
        arrow.position.set(...at);
        arrow.setDirection(force.normalize());
        arrow.setLength(length, Math.min(0.03 * this.scale, length * 0.4), 0.016 * this.scale);
      }
      const cone = this.#cones[foot];
      cone.visible = layers.cones && contact;
      cone.position.set(...at);
      if (contact) standing.push([at[0], at[1]]);
    });
    const [x, y] = frames.com(row);
    this.#below.visible = layers.polygon;
    this.#below.position.set(x, y, 0.003);
    const shown = layers.polygon && standing.length >= 2;
    this.#fill.visible = shown && standing.length >= 3;
    this.#outline.visible = shown;
    if (!shown) return;
    const corners = hull(standing);
    const points = corners.flatMap(([x, y]) => [x, y, 0.002]);
    this.#fill.geometry.setAttribute("position", new Float32BufferAttribute(points, 3));
    this.#fill.geometry.setIndex(corners.slice(2).flatMap((_, k) => [0, k + 1, k + 2]));
    this.#outline.geometry.setAttribute("position", new Float32BufferAttribute(points, 3));
  }

  dispose() {
    dispose(this.group);
  }
}

/** Convex hull, counter-clockwise (Andrew's monotone chain). */
export function hull(points: [number, number][]): [number, number][] {
  const sorted = [...points].sort((a, b) => a[0] - b[0] || a[1] - b[1]);
  if (sorted.length < 3) return sorted;
  const half = (list: [number, number][]) => {
    const chain: [number, number][] = [];
    for (const p of list) {
      while (chain.length >= 2 && cross(chain.at(-2)!, chain.at(-1)!, p) <= 0) chain.pop();
      chain.push(p);
    }
    chain.pop();
    return chain;
  };
  return [...half(sorted), ...half(sorted.reverse())];
}

function cross(o: [number, number], a: [number, number], b: [number, number]): number {
  return (a[0] - o[0]) * (b[1] - o[1]) - (a[1] - o[1]) * (b[0] - o[0]);
}
