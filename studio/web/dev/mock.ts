// A mock engine: answers every plan with the plan file that stands beside the page, posed by forward kinematics.
import type { EndEffector, Joint, RequestBody, Scene, Shape } from "../src/contract.ts";
import type { Done, Engine, Lane } from "../src/engine/engine.ts";
import { foresee } from "../src/project/foresee.ts";

type Q = number[];
const mul = (a: Q, b: Q): Q => [
  a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
  a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
  a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
  a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0],
];
const rot = (q: Q, v: number[]): number[] => mul(mul(q, [0, ...v]), [q[0], -q[1], -q[2], -q[3]]).slice(1);
const add = (a: number[], b: number[]) => a.map((x, i) => x + b[i]);

export class MockEngine implements Engine {
  readonly place = "mock";
  readonly hasFiles = false;
  motion: any;
  scene!: Scene;
  constructor(readonly plan: any) {
    const robot = plan.robot;
    const bodies = robot.links.map((link: any) => ({
      name: link.name,
      shapes: (link.shapes ?? [{ kind: "box", center_in_link_m: link.com_in_link_m, size_m: [0.04, 0.05, 0.05] }]).map((shape: any): Shape => {
        if (shape.kind === "box") return { shape: "box", size_m: shape.size_m, position_m: shape.center_in_link_m, orientation_wxyz: [1, 0, 0, 0], role: "part" };
        const d = add(shape.to_in_link_m, shape.from_in_link_m.map((x: number) => -x));
        const length = Math.hypot(...d);
        const [x, y, z] = d.map((v: number) => v / length);
        const q = [1 + z, -y, x, 0];
        const n = Math.hypot(...q) || 1;
        return { shape: "capsule", radius_m: shape.radius_m, length_m: length, position_m: add(shape.to_in_link_m, shape.from_in_link_m).map((v) => v / 2) as any, orientation_wxyz: (n < 1e-6 ? [0, 1, 0, 0] : q.map((v) => v / n)) as any, role: "part" };
      }),
    }));
    const end_effectors: EndEffector[] = robot.end_effectors.map((foot: any, k: number) => {
      bodies.push({ name: `${foot.name} wheel`, shapes: [{ shape: "cylinder", radius_m: foot.radius_m, length_m: 0.02, position_m: [0, 0, 0], orientation_wxyz: [1, 0, 0, 0], role: "wheel" }] });
      return { name: foot.name, contact: foot.contact.kind, radius_m: foot.radius_m, body: foot.link, wheel_body: robot.links.length + k, driven: true, friction_coefficient: foot.friction_coefficient, motor_speed_max_rad_s: foot.contact.actuator.speed_max_rad_s, motor_torque_max_nm: foot.contact.actuator.torque_max_nm };
    });
    const joints: Joint[] = robot.joints.map((joint: any) => ({ name: joint.name, body: joint.child, position_min_rad: joint.position_min_rad, position_max_rad: joint.position_max_rad, speed_max_rad_s: joint.actuator.speed_max_rad_s, torque_max_nm: joint.actuator.torque_max_nm }));
    this.scene = { name: robot.name, bodies, joints, end_effectors, standing: [], mass_kg: robot.links.reduce((sum: number, link: any) => sum + link.mass_kg, 0), parameters: [
      { name: "a", label: "Thigh length", unit: "m", value: 0.12, min: 0.06, max: 0.24, step: 0.001 },
      { name: "b", label: "Wheel radius", unit: "m", value: 0.05, min: 0.03, max: 0.09, step: 0.001 },
    ] };
    const m = plan.motion;
    const n = end_effectors.length;
    this.motion = { ...m, samples: plan.samples.length, stance: Array.from({ length: n }, (_, k) => m.stance.map((row: boolean[]) => row[k])), targets: [], heights: [], gaits: ["walk", "trot", "pace", "bound", "pronk", "stance"], needs_feedback: null };
  }
  static async load() {
    return new MockEngine(await (await fetch("plan.json")).json());
  }
  prepare() {}
  cancel() {}
  async request(_lane: Lane, body: RequestBody): Promise<Done> {
    const value = (v: any, binary: Uint8Array | null = null) => ({ value: { kind: "done", ...v }, binary });
    switch (body.kind) {
      case "examples": return value({ examples: [{ path: "motions/walk.toml", name: "walk", title: "AgileBot walks: one foot after the other, never less than three on the ground.", of: "motion", robot: "../robots/agilebot.toml" }] });
      case "example": return value({ text: body.path.includes("robots") ? "[[link]]" : 'robot = "../robots/agilebot.toml"\nduration_s = 1.6\n' });
      case "open": return value({ read: ["motions/walk.toml", "robots/agilebot.toml"], scene: this.scene, motion: this.motion });
      case "amend": {
        const next = foresee(body.edit, this.motion, this.scene);
        this.motion = next.motion;
        this.scene = next.scene;
        return value({ text: (body as any).files.find((file: any) => file.path === body.path).text + "#" });
      }
      case "plan": return this.planned(value);
      case "solution": return value({}, new Uint8Array(4));
      default: return value({ text: "", rows: [], judgement: "holds" });
    }
  }
  planned(value: any): Done {
    const { plan, scene } = this;
    const nb = scene.bodies.length, ne = scene.end_effectors.length, nj = scene.joints.length;
    const width = 7 * nb + 3 + 7 * ne + 3 * nj + 2 * ne;
    const columns = { bodies: 0, com: 7 * nb, end_effectors: 7 * nb + 3, joints: 7 * nb + 3 + 7 * ne, wheels: 7 * nb + 3 + 7 * ne + 3 * nj };
    const rate_hz = plan.samples.length / plan.motion.duration_s;
    const data = new Float32Array(width * plan.samples.length);
    const spin = scene.end_effectors.map(() => 0);
    plan.samples.forEach((sample: any, k: number) => {
      const row = data.subarray(k * width, (k + 1) * width);
      const pos: number[][] = [], ori: Q[] = [];
      pos[0] = sample.base_position_m; ori[0] = sample.base_orientation_wxyz;
      plan.robot.joints.forEach((joint: any, j: number) => {
        const a = sample.joint_rad[j] / 2;
        const turn = [Math.cos(a), ...joint.axis_in_joint.map((v: number) => v * Math.sin(a))];
        pos[joint.child] = add(pos[joint.parent], rot(ori[joint.parent], joint.parent_from_joint.position_m));
        ori[joint.child] = mul(mul(ori[joint.parent], joint.parent_from_joint.orientation_wxyz), turn);
        const speed = k ? (sample.joint_rad[j] - plan.samples[k - 1].joint_rad[j]) * rate_hz : 0;
        row.set([sample.joint_rad[j], speed, sample.joint_torque_nm[j]], columns.joints + 3 * j);
      });
      plan.robot.end_effectors.forEach((foot: any, e: number) => {
        const at = sample.end_effectors[e];
        const body = scene.end_effectors[e].wheel_body!;
        spin[e] += at.motor_speed_rad_s / rate_hz;
        pos[body] = add(pos[foot.link], rot(ori[foot.link], foot.center_in_link_m));
        ori[body] = mul(ori[foot.link], [Math.cos(spin[e] / 2), 0, Math.sin(spin[e] / 2), 0]);
        row.set([at.contact ? 1 : 0, ...at.position_m, ...at.force_n], columns.end_effectors + 7 * e);
        row.set([at.motor_speed_rad_s, at.motor_torque_nm], columns.wheels + 2 * e);
      });
      pos.forEach((p, b) => row.set([...p, ...ori[b]], 7 * b));
      row.set(sample.com_m, columns.com);
    });
    const bad = location.search.includes("bad");
    return value({
      scene, motion: this.motion, converged: !bad, good: !bad,
      solve: { status: bad ? "infeasible" : "converged", words: bad ? "The request contradicts itself." : "All constraints hold, at the samples and as played. The centre of mass moves 0.120 m forward in each cycle.", iterations: 8, energy: 1, worst_level: 0.02, worst_constraint: "slip", culprits: bad ? [
        { constraint: "joint speed", what: "joint speed of the front left knee exceeds 4.16 rad/s by 2.3 rad/s, 0.45 to 0.80 s", from_s: 0.45, to_s: 0.8, end_effector: 0, joint: 2, advice: "Give it more time, or a shorter way.", fix: { label: "Set duration_s to 2.1 s", path: "motions/walk.toml", edit: { edit: "number", table: [], key: "duration_s", value: 2.1 } } },
      ] : [] },
      frames: { count: plan.samples.length, rate_hz, duration_s: plan.motion.duration_s, period: plan.motion.ends === "periodic" ? plan.end_placement : null, width, columns },
    }, new Uint8Array(data.buffer));
  }
}
