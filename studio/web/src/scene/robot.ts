// The robot's bodies, posed by a row of frames. Ghosts are equal, with a transparent material.

import {
  BoxGeometry,
  type BufferGeometry,
  CapsuleGeometry,
  CylinderGeometry,
  EdgesGeometry,
  Group,
  LineBasicMaterial,
  LineSegments,
  Mesh,
  MeshLambertMaterial,
  type Object3D,
  SphereGeometry,
} from "three";
import type { Scene, Shape } from "../contract.ts";
import type { Row } from "../project/frames.ts";
import { dispose, lineGeometry } from "./lines.ts";
import type { Palette } from "./palette.ts";

export type Appearance = "solid" | "ghost" | "beside";
/** Opacity of edges and of bodies. A ghost beside a live robot must differ from it at a glance. */
const OPACITY = { solid: [0.55, 1], ghost: [0.16, 0.1], beside: [0.6, 0.3] } as const;

export class Robot {
  readonly group = new Group();
  #bodies: Group[] = [];
  #clearance: Object3D[] = [];
  #materials = new Map<string, MeshLambertMaterial>();
  #edges: LineBasicMaterial;

  constructor(scene: Scene, palette: Palette, look: Appearance, shadows: boolean) {
    this.#edges = new LineBasicMaterial({
      color: palette.edge,
      transparent: true,
      opacity: OPACITY[look][0],
    });
    for (const body of scene.bodies) {
      const group = new Group();
      group.name = body.name;
      const hasParts = body.shapes.some((shape) => shape.role === "part");
      for (const shape of body.shapes) {
        // Links without parts, or with only feet and wheels, are drawn as their clearance shapes.
        const clearance = shape.role === "clearance" && hasParts;
        if (clearance && look !== "solid") continue;
        const object = this.#object(shape, clearance, palette, look, shadows);
        object.position.set(...shape.position_m);
        const [w, x, y, z] = shape.orientation_wxyz;
        object.quaternion.set(x, y, z, w);
        if (clearance) this.#clearance.push(object);
        group.add(object);
      }
      this.#bodies.push(group);
      this.group.add(group);
    }
  }

  pose(row: Row, offset: number) {
    this.#bodies.forEach((body, index) => {
      const at = offset + 7 * index;
      body.position.set(row[at], row[at + 1], row[at + 2]);
      body.quaternion.set(row[at + 4], row[at + 5], row[at + 6], row[at + 3]);
    });
  }

  showClearance(shown: boolean) {
    for (const object of this.#clearance) object.visible = shown;
  }

  /** Highlights bodies of conflicting constraints; the others keep their colours. */
  highlight(bodies: Set<number>, palette: Palette) {
    this.#bodies.forEach((body, index) => {
      const blamed = bodies.has(index);
      body.traverse((object) => {
        if (!(object instanceof Mesh) || object.userData.clearance) return;
        object.material = blamed ? this.#material("blamed", palette.danger, 1) : object.userData.material;
      });
    });
  }

  dispose() {
    dispose(this.group);
  }

  #object(shape: Shape, clearance: boolean, palette: Palette, look: Appearance, shadows: boolean): Object3D {
    const geometry = geometryOf(shape);
    if (clearance) {
      const room = new Mesh(geometry, this.#material("clearance", palette.accent, 0.14));
      room.userData.clearance = true;
      return room;
    }
    const dark = shape.role === "wheel" || shape.role === "foot" || shape.role === "blade";
    const material =
      look !== "solid"
        ? this.#material("ghost", palette.accent, OPACITY[look][1])
        : this.#material(dark ? "wheel" : "part", dark ? palette.wheel : palette.part, 1);
    const mesh = new Mesh(geometry, material);
    mesh.userData.material = material;
    mesh.castShadow = shadows && look === "solid";
    mesh.receiveShadow = mesh.castShadow;
    if (shape.shape === "box") mesh.add(new LineSegments(new EdgesGeometry(geometry, 30), this.#edges));
    if (shape.role === "wheel" && shape.shape === "cylinder") mesh.add(spokes(shape.radius_m, shape.length_m, this.#edges));
    return mesh;
  }

  #material(name: string, color: number, opacity: number): MeshLambertMaterial {
    const known = this.#materials.get(name);
    if (known) return known;
    const transparent = opacity < 1;
    const material = new MeshLambertMaterial({ color, opacity, transparent, depthWrite: !transparent });
    this.#materials.set(name, material);
    return material;
  }
}

function geometryOf(shape: Shape): BufferGeometry {
  switch (shape.shape) {
    case "box":
      return new BoxGeometry(...shape.size_m);
    case "cylinder":
      return new CylinderGeometry(shape.radius_m, shape.radius_m, shape.length_m, 32);
    case "sphere":
      return new SphereGeometry(shape.radius_m, 20, 14);
    case "capsule":
      // A capsule of three.js is along y, ours along z.
      return new CapsuleGeometry(shape.radius_m, shape.length_m, 6, 16).rotateX(Math.PI / 2);
  }
}

/** A rim and three diameters on both sides, so that the rotation of a wheel is visible. */
function spokes(radius_m: number, length_m: number, material: LineBasicMaterial): Object3D {
  const geometry = new CylinderGeometry(radius_m * 1.001, radius_m * 1.001, length_m * 1.02, 6, 1);
  const group = new Group();
  group.add(new LineSegments(new EdgesGeometry(new CylinderGeometry(radius_m * 1.001, radius_m * 1.001, length_m * 1.01, 32), 30), material));
  const points: number[] = [];
  const corners = geometry.getAttribute("position");
  for (let k = 0; k < 6; k++) {
    for (const side of [0, 7]) points.push(corners.getX(k + side), corners.getY(k + side), corners.getZ(k + side), 0, corners.getY(k + side), 0);
  }
  geometry.dispose();
  const lines = new LineSegments(lineGeometry(points), material);
  group.add(lines);
  return group;
}
