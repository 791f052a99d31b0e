// Quantities for plots: each as series over the frames of a plan, with limits, if any.

import type { Scene } from "../contract.ts";
import type { Frames, Row } from "../project/frames.ts";

export type Series = {
  name: string;
  values: Float32Array;
  /** Limits in the same unit; null without a limit. */
  low: number | null;
  high: number | null;
  /** End effector or joint of the series, for colours and highlights. */
  endEffector: number | null;
  joint: number | null;
};

export type Quantity = { id: string; title: string; unit: string; digits: number; series(scene: Scene, frames: Frames): Series[] };

const GRAVITY_M_S2 = 9.80665;

function joints(title: string, id: string, unit: string, value: (frames: Frames, row: Row, joint: number) => number, limits: (joint: Scene["joints"][number]) => [number, number]): Quantity {
  return {
    id,
    title,
    unit,
    digits: 2,
    series: (scene, frames) =>
      scene.joints.map((joint, index) => {
        const [low, high] = limits(joint);
        return { name: joint.name, values: over(frames, (row) => value(frames, row, index)), low, high, endEffector: null, joint: index };
      }),
  };
}

function feet(title: string, id: string, unit: string, digits: number, value: (frames: Frames, row: Row, foot: number, scene: Scene) => number, limits: (foot: Scene["end_effectors"][number]) => [number | null, number | null]): Quantity {
  return {
    id,
    title,
    unit,
    digits,
    series: (scene, frames) =>
      scene.end_effectors.map((foot, index) => {
        const [low, high] = limits(foot);
        return { name: foot.name, values: over(frames, (row) => value(frames, row, index, scene)), low, high, endEffector: index, joint: null };
      }),
  };
}

function wheels(title: string, id: string, unit: string, value: (frames: Frames, row: Row, driven: number) => number, limit: (foot: Scene["end_effectors"][number]) => number | null): Quantity {
  return {
    id,
    title,
    unit,
    digits: 2,
    series: (scene, frames) =>
      scene.end_effectors
        .map((foot, index) => ({ foot, index }))
        .filter(({ foot }) => foot.driven)
        .map(({ foot, index }, driven) => {
          const most = limit(foot);
          return { name: foot.name, values: over(frames, (row) => value(frames, row, driven)), low: most === null ? null : -most, high: most, endEffector: index, joint: null };
        }),
  };
}

export const QUANTITIES: Quantity[] = [
  joints("Joint torque", "joint_torque", "N·m", (frames, row, joint) => frames.joint(row, joint).torque_nm, (joint) => [-joint.torque_max_nm, joint.torque_max_nm]),
  joints("Joint speed", "joint_speed", "rad/s", (frames, row, joint) => frames.joint(row, joint).speed_rad_s, (joint) => [-joint.speed_max_rad_s, joint.speed_max_rad_s]),
  joints("Joint angle", "joint_angle", "rad", (frames, row, joint) => frames.joint(row, joint).angle_rad, (joint) => [joint.position_min_rad, joint.position_max_rad]),
  wheels("Wheel speed", "wheel_speed", "rad/s", (frames, row, wheel) => frames.wheel(row, wheel).speed_rad_s, (foot) => foot.motor_speed_max_rad_s),
  wheels("Wheel torque", "wheel_torque", "N·m", (frames, row, wheel) => frames.wheel(row, wheel).torque_nm, (foot) => foot.motor_torque_max_nm),
  feet("Vertical force", "force", "N", 1, (frames, row, foot) => frames.force(row, foot)[2], () => [0, null]),
  feet(
    "Ratio of horizontal to vertical force, against friction",
    "friction",
    "",
    2,
    (frames, row, foot, scene) => {
      const [x, y, z] = frames.force(row, foot);
      // The ratio of a foot with almost no load is meaningless.
      return z > 0.005 * scene.mass_kg * GRAVITY_M_S2 ? Math.hypot(x, y) / z : 0;
    },
    (foot) => [null, foot.friction_coefficient],
  ),
  feet("Height of feet", "foot_height", "m", 3, (frames, row, foot) => frames.position(row, foot)[2], () => [0, null]),
  {
    id: "com",
    title: "Centre of mass",
    unit: "m",
    digits: 3,
    series: (_, frames) =>
      ["x", "y", "z"].map((name, k) => ({ name, values: over(frames, (row) => frames.com(row)[k]), low: null, high: null, endEffector: k, joint: null })),
  },
];

function over(frames: Frames, value: (row: Row) => number): Float32Array {
  const values = new Float32Array(frames.header.count);
  for (let index = 0; index < values.length; index++) values[index] = value(frames.row(index));
  return values;
}
