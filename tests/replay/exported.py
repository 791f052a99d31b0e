"""Playback of an exported motion (`rollwalk export PLAN.json -o PLAN.xml`) on its own terrain in MuJoCo: in open loop from its
keyframes, or tracked by `rollwalk control`. The motion is at rest at its ends.
"""

from dataclasses import dataclass
import math

import mujoco
import numpy as np

from control import Control
from falls import FallWatch

SETTLE_S = 1.0
# Steps from one look at the contacts to the next, as many as in a tick of the controller.
EVERY = 5
# Shares of the weight above which an end effector touches, and above which its slip counts.
TOUCHES, STANDS = 0.005, 0.01


@dataclass
class Outcome:
    """Planned and achieved displacement of the body (forward m, left m, turn rad), time of a fall, and sliding distance of the
    end effectors, summed."""

    planned: tuple
    played: tuple
    fell_at_s: float | None
    slid_m: float
    # Final height of the body / planned, of a motion that lies.
    height_ratio: float | None = None


def play(path, plan=None, rollwalk=None, lies=False):
    """Plays the motion with a second of rest before and after it. With `rollwalk`, the program tracks `plan`."""
    if rollwalk is None:
        run = _Run(path, lies)
        return run.outcome(run.open_loop)
    with Control(rollwalk, plan, None, "gains", round(1 / (EVERY * 0.001))) as control:
        run = _Run(path, lies)
        return run.outcome(_Loop(run, control).act)


class _Run:
    def __init__(self, path, lies):
        self.m = m = mujoco.MjModel.from_xml_path(str(path))
        self.d, self.lies = mujoco.MjData(m), lies
        self.times_s, self.states = m.key_time[:], m.key_qpos.reshape(m.nkey, m.nq).copy()
        self.controls = m.key_ctrl.reshape(m.nkey, m.nu)
        mujoco.mj_resetDataKeyframe(m, self.d, 0)
        self.d.time = 0.0
        mujoco.mj_forward(m, self.d)
        self.weight_n = m.body_subtreemass[1] * np.linalg.norm(m.opt.gravity)
        # Geoms of end effectors have priority over the ground.
        self.feet = [geom for geom in range(m.ngeom) if m.geom_priority[geom] > 0]
        self.foot_of_geom = {geom: index for index, geom in enumerate(self.feet)}
        self.trunk = self._trunk()
        self.load_n, self.on_trunk, self.slid_m = np.zeros(len(self.feet)), 0.0, 0.0

    def _trunk(self):
        """Bodies whose shapes do not belong to the link of an end effector."""
        m = self.m
        bodies = {m.geom_bodyid[geom] for geom in self.feet}
        own = lambda body: {geom for geom in range(m.ngeom) if m.geom_bodyid[geom] == body and m.geom_conaffinity[geom]}
        wheels = {body for body in bodies if own(body) <= set(self.feet)}
        return set(range(1, m.nbody)) - (bodies | {m.body_parentid[body] for body in wheels}) | {1}

    def open_loop(self, time_s):
        after = min(int(np.searchsorted(self.times_s, time_s, side="right")), len(self.times_s) - 1)
        before = after - 1
        share = min((time_s - self.times_s[before]) / (self.times_s[after] - self.times_s[before]), 1.0)
        self.d.ctrl[:] = (1.0 - share) * self.controls[before] + share * self.controls[after]

    def outcome(self, act):
        m, d, step_s = self.m, self.d, self.m.opt.timestep
        watch, began, duration_s = FallWatch(self.lies), None, self.times_s[-1]
        planned = _way(self.states[0], self.states[-1])
        for k in range(round((duration_s + 2 * SETTLE_S) / step_s)):
            time_s = min(max(k * step_s - SETTLE_S, 0.0), duration_s)
            if began is None and k * step_s >= SETTLE_S:
                began = d.qpos[:7].copy()
            act(time_s)
            mujoco.mj_step(m, d)
            if k % EVERY:
                continue
            self._contacts(EVERY * step_s)
            row = self.states[np.searchsorted(self.times_s, time_s, side="right") - 1]
            lowest = d.xpos[[m.geom_bodyid[geom] for geom in self.feet], 2].min()
            # The body above its lowest wheel or foot link, because the ground has no single height.
            height = 1.0 if self.lies else 1.0 + (d.qpos[2] - row[2]) / max(d.qpos[2] - lowest, 1e-3)
            if watch.fell(_tilt(d.qpos[3:7], row[3:7]), height, self.on_trunk, EVERY * step_s):
                return Outcome(planned, _way(d.qpos if began is None else began, d.qpos), time_s, self.slid_m)
        height_ratio = float(d.qpos[2] / self.states[-1][2]) if self.lies else None
        return Outcome(planned, _way(began, d.qpos), None, self.slid_m, height_ratio)

    def _contacts(self, duration_s):
        """Loads of the end effectors and of the trunk, and sliding distance over a time, from the present contacts."""
        m, d = self.m, self.d
        self.load_n[:], self.on_trunk = 0.0, 0.0
        contact, rows = d.contact, d.contact.efc_address
        touching = np.flatnonzero(rows >= 0)
        if not len(touching):
            return
        geoms, normals, points = contact.geom[touching], contact.frame[touching, :3], contact.pos[touching]
        forces_n = d.efc_force[rows[touching]]
        geoms = np.where(m.geom_bodyid[geoms[:, 0]] > 0, geoms[:, 0], geoms[:, 1])
        for geom, force_n, normal, point in zip(geoms.tolist(), forces_n.tolist(), normals, points):
            body = m.geom_bodyid[geom]
            if geom in self.foot_of_geom:
                self.load_n[self.foot_of_geom[geom]] += force_n
                if force_n > STANDS * self.weight_n:
                    v = d.cvel[body]
                    speed = v[3:] + np.cross(v[:3], point - d.subtree_com[1])
                    self.slid_m += duration_s * float(np.linalg.norm(speed - normal * (speed @ normal)))
            elif body in self.trunk:
                self.on_trunk += force_n * abs(normal[2]) / self.weight_n


class _Loop:
    """Closed loop with `rollwalk control`, at every second step."""

    def __init__(self, run, control):
        self.run, self.control, m = run, control, run.m
        names = control.hello
        joint = lambda name: m.joint(name).id
        self.qpos = [m.jnt_qposadr[joint(name)] for name in names["joints"]]
        self.dofs = [m.jnt_dofadr[joint(name)] for name in names["joints"]]
        self.wheels = [m.jnt_dofadr[joint(name)] for name in names["wheels"]]
        self.actuators = [m.actuator(name).id for name in names["channels"]]
        # A model has no geoms for the points on which a body lies; its shapes touch the ground.
        geoms = {m.geom(geom).name: index for geom, index in run.foot_of_geom.items()}
        self.feet = [geoms.get(name) for name in names["end_effectors"]]
        self.steps = 0
        # The controller sets gains at every tick, as torques of gain 1.
        m.actuator_gainprm[:, 0] = 1.0
        m.actuator_biastype[:] = mujoco.mjtBias.mjBIAS_AFFINE
        m.actuator_ctrllimited[:] = 0

    def act(self, time_s):
        self.steps += 1
        if (self.steps - 1) % EVERY:
            return
        m, d = self.run.m, self.run.d
        spin = np.zeros(3)
        mujoco.mju_rotVecQuat(spin, d.qvel[3:6], d.qpos[3:7])
        setpoints, _ = self.control.tick({
            "time_s": time_s,
            "touches": [self._touches(foot) for foot in self.feet],
            "joint_rad": d.qpos[self.qpos].tolist(),
            "joint_speed_rad_s": d.qvel[self.dofs].tolist(),
            "wheel_speed_rad_s": d.qvel[self.wheels].tolist(),
            "base": {
                "position_m": d.qpos[:3].tolist(),
                "velocity_m_s": d.qvel[:3].tolist(),
                "orientation_wxyz": d.qpos[3:7].tolist(),
                "angular_velocity_rad_s": spin.tolist(),
            },
        })
        kp, kd = setpoints["kp_nm_rad"], setpoints["kd_nm_s_rad"]
        for row, actuator in enumerate(self.actuators):
            m.actuator_biasprm[actuator, :3] = 0.0, -kp[row], -kd[row]
            position, speed, torque = (setpoints[key][row] for key in ("position_rad", "speed_rad_s", "torque_nm"))
            d.ctrl[actuator] = kp[row] * position + kd[row] * speed + torque

    def _touches(self, foot):
        run = self.run
        share = run.on_trunk if foot is None else run.load_n[foot] / run.weight_n
        return bool(share > TOUCHES)


def _tilt(one, other):
    """Angle between the z axes of two orientations, the headings set equal."""
    ups = []
    for orientation in (one, other):
        r = np.zeros(9)
        mujoco.mju_quat2Mat(r, orientation)
        yaw = math.atan2(r[3], r[0])
        c, s = math.cos(yaw), math.sin(yaw)
        ups.append(np.array([c * r[2] + s * r[5], c * r[5] - s * r[2], r[8]]))
    return math.acos(min(max(float(ups[0] @ ups[1]), -1.0), 1.0))


def _way(start, end):
    """Displacement in the heading of the start, and turn."""
    yaws = []
    for state in (start, end):
        r = np.zeros(9)
        mujoco.mju_quat2Mat(r, np.array(state[3:7]))
        yaws.append(math.atan2(r[3], r[0]))
    x, y = end[:2] - start[:2]
    c, s = math.cos(yaws[0]), math.sin(yaws[0])
    return float(c * x + s * y), float(c * y - s * x), math.remainder(yaws[1] - yaws[0], 2 * math.pi)
