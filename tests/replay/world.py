"""Open-loop playback on the ground: MuJoCo, servos of the robot file, and measurements.

Every motion starts in the state of its plan: pose, velocity and spin of the wheels. A motion with rests at its ends
first stands on its first frame until the robot has settled, and rests on its last frame afterwards.
"""

from dataclasses import dataclass, field
import math

import mujoco
import numpy as np

import feedforward
import player
import robots
from drives import Drives
from falls import FallWatch
from model import Ground, Model
from motion import quantised_torques

# If a motion is at rest at its ends, the robot settles before it, and comes to rest after it.
SETTLE_S = 1.0
# An end effector with a smaller share of the weight is not in contact.
STANDS = 0.01


@dataclass(frozen=True)
class Push:
    """Force for PUSH_S seconds, as a fraction of the weight, in a direction (forward, left) relative to the robot's heading."""

    part: float
    direction: tuple = (0.0, 1.0)
    # Start: in periods of a periodic motion, or as a fraction of a motion that ends.
    period: float = 2.3
    moment: float = 0.5

    def begin_s(self, motion):
        return (self.period if motion.periodic else self.moment) * motion.duration_s


@dataclass(frozen=True)
class Case:
    """Differences from the robot file and the level floor."""

    name: str = "nominal"
    friction: float | None = None
    mass_factor: float = 1.0
    delay_s: float = 0.0
    slope_rad: float = 0.0
    push: Push | None = None


PUSH_S = 0.1
PERTURBATIONS = (
    Case("friction 0.5", friction=0.5),
    Case("friction 1.2", friction=1.2),
    Case("mass +10 %", mass_factor=1.1),
    Case("mass -10 %", mass_factor=0.9),
    Case("delay 5 ms", delay_s=0.005),
    Case("slope 2 deg", slope_rad=math.radians(2)),
    Case("push 10 %", push=Push(0.1)),
)


@dataclass
class Track:
    """Record of one run, with a row for each step unless stated otherwise."""

    step_s: float
    # Index of the step at which each period begins, and of the end.
    marks: list = field(default_factory=list)
    com_m: list = field(default_factory=list)
    yaw_rad: list = field(default_factory=list)
    base_m: list = field(default_factory=list)
    height_error_m: list = field(default_factory=list)
    tilt_rad: list = field(default_factory=list)
    load_n: list = field(default_factory=list)
    slip_m_s: list = field(default_factory=list)
    planned_stance: list = field(default_factory=list)
    saturated: list = field(default_factory=list)
    joint_error_rad: list = field(default_factory=list)
    depth_m: float = 0.0
    touched: dict = field(default_factory=dict)
    fell_at_s: float | None = None
    missing_force: float = 0.0
    # Motor with the largest ratio of feed-forward to limit, and this ratio.
    hardest_motor: tuple = ("", 0.0)
    # Planned position of the base at every step of a period.
    planned_base_m: np.ndarray | None = None


def run(motion, robot, feed_forward="none", case=Case(), cycles=20, control_hz=player.CONTROL_HZ, frames=None,
        torques=None, ground=Ground()):
    """Plays a motion, or `cycles` periods of a periodic motion. Frames and torques are the plan's unless given."""
    model = Model(robot, motion.gravity_m_s2, ground)
    frames = motion.frames() if frames is None else frames
    needed, missing = feedforward.frames(model, motion)
    # The first and last torques of a library also hold the robot before and after the motion.
    rest = feedforward.at_rest(model, motion) if torques is None else torques[[0, -1]]
    torques = quantised_torques(needed, robot) if torques is None else torques
    periods = cycles if motion.periodic else 1
    points = player.setpoints(robot, frames, torques, motion, periods, feed_forward, control_hz)
    holds = [
        player.hold(robot, frames[index], torque, feed_forward) for index, torque in zip((0, -1), rest)
    ]
    simulation = Simulation(model, motion, case)
    track = simulation.track
    track.planned_base_m = np.array([position for position, _, _ in simulation.plan])
    track.missing_force = missing
    track.hardest_motor = feedforward.hardest(model, needed)
    simulation.start(moving=motion.ends != "at_rest")
    if motion.ends == "at_rest":
        simulation.play(holds[0], SETTLE_S, measured=False)
    per_period = round(motion.duration_s / ground.step_s)
    for period in range(periods):
        track.marks.append(len(track.yaw_rad))
        if not simulation.play(points, motion.duration_s, first=period * motion.duration_s, steps=per_period):
            return track
    if motion.ends == "at_rest":
        simulation.play(holds[1], SETTLE_S, first=None)
    track.marks.append(len(track.yaw_rad))
    simulation.measure_place()
    return track


class Simulation:
    def __init__(self, model, motion, case):
        self.model, self.motion, self.case = model, motion, case
        self.m, self.d = model.m, mujoco.MjData(model.m)
        m = self.m
        self.track = Track(m.opt.timestep)
        self.weight = model.mass_kg * motion.gravity_m_s2
        if case.friction is not None:
            m.geom_friction[model.foot_geoms, 0] = case.friction
        if case.mass_factor != 1.0:
            m.body_mass[:] *= case.mass_factor
            m.body_inertia[:] *= case.mass_factor
            mujoco.mj_setConst(m, self.d)
        # The plane stays level, and gravity is rotated: uphill is along the first heading.
        g, yaw = motion.gravity_m_s2, motion.base(0.0)[1][0]
        down = -math.sin(case.slope_rad) * np.array([math.cos(yaw), math.sin(yaw), 0.0])
        m.opt.gravity[:] = g * (down - [0.0, 0.0, math.cos(case.slope_rad)])
        self.kp = -m.actuator_biasprm[:, 1]
        self.kd = -m.actuator_biasprm[:, 2]
        self.drives = Drives(model, motion.rolling_sign_width_m_s)
        self.falls = FallWatch(may_lie=robots.lies(model.robot))
        self.foot_of_geom = np.full(m.ngeom, -1)
        self.foot_of_geom[model.foot_geoms] = np.arange(len(model.foot_geoms))
        # Planned place of the base, up vector and stance at every step of a period.
        steps = round(motion.duration_s / m.opt.timestep) + 1
        self.plan = [self._planned(k * m.opt.timestep) for k in range(steps)]
        self.steps = 0

    def _planned(self, time_s):
        position, (yaw, pitch, roll) = self.motion.base(time_s)
        up = np.array([
            math.cos(yaw) * math.sin(pitch) * math.cos(roll) + math.sin(yaw) * math.sin(roll),
            math.sin(yaw) * math.sin(pitch) * math.cos(roll) - math.cos(yaw) * math.sin(roll),
            math.cos(pitch) * math.cos(roll),
        ])
        # In the frame of the actual heading, which may differ from the planned heading.
        c, s = math.cos(yaw), math.sin(yaw)
        ahead = np.array([c * up[0] + s * up[1], c * up[1] - s * up[0], up[2]])
        return position, ahead, self.motion.stance(time_s)

    def start(self, moving):
        """The state of the plan at time 0."""
        q, v, _ = self.model.derivatives(self.motion, 0.0)
        self.d.qpos[:] = q
        if moving:
            self.d.qvel[:] = v
        mujoco.mj_forward(self.m, self.d)
        self.load = np.zeros(len(self.model.foot_geoms))

    def play(self, points, duration_s, first=0.0, steps=None, measured=True):
        """Steps through set-points from time `first`, or a hold if it is None. Returns False if the robot fell."""
        step_s = self.m.opt.timestep
        delay = 0.0 if first is None else self.case.delay_s
        last = len(points.position_rad) - 1
        tick = -1
        for k in range(steps or round(duration_s / step_s)):
            now = max((first or 0.0) + k * step_s - delay, 0.0)
            index = min(int(now / points.period_s + 1e-6), last)
            if index != tick:
                tick = index
                self.command(points, tick)
            during = None if not measured else (k if first is not None else len(self.plan) - 1)
            self.push(first, k * step_s)
            self.step(during, points.position_rad[tick])
            if self.track.fell_at_s is not None:
                return False
        return True

    def command(self, points, tick):
        """Sends the set-points of a tick to the drives. Set-points of wheels are speeds."""
        self.d.ctrl[:] = (
            self.kp * points.position_rad[tick]
            + np.where(self.kp > 0, self.kd * points.speed_rad_s[tick], self.kd * points.position_rad[tick])
            + points.torque_nm[tick]
        )

    def push(self, first, time_s):
        push = self.case.push
        if push is None or first is None:
            return
        begin = push.begin_s(self.motion)
        pushed = begin <= first + time_s < begin + PUSH_S
        yaw = self._yaw()
        ahead, left = push.direction
        way = np.array([ahead * math.cos(yaw) - left * math.sin(yaw), ahead * math.sin(yaw) + left * math.cos(yaw), 0.0])
        self.d.xfrc_applied[1, 0:3] = way * push.part * self.weight if pushed else 0.0

    def step(self, during, position_rad):
        m, d = self.m, self.d
        low, high = self.drives.act(d, self.load)
        mujoco.mj_step(m, d)
        self._contacts(during, high, low, position_rad)

    def _contacts(self, during, high, low, position_rad):
        m, d, track = self.m, self.d, self.track
        self.load[:] = 0
        on_trunk_n = 0.0
        slip = np.full(len(self.load), np.nan)
        contact = d.contact
        if d.ncon:
            geoms, rows, places = contact.geom[:, 1], contact.efc_address, contact.pos
            feet = self.foot_of_geom[geoms]
            for i, (j, row) in enumerate(zip(feet, rows)):
                force = d.efc_force[row] if row >= 0 else 0.0
                if j < 0:
                    on_trunk_n += force if geoms[i] in self.model.trunk_geoms else 0.0
                    if force > STANDS * self.weight:
                        name = mujoco.mj_id2name(m, mujoco.mjtObj.mjOBJ_GEOM, geoms[i]).split(":")[1]
                        track.touched[name] = track.touched.get(name, 0) + 1
                    continue
                self.load[j] += force
                track.depth_m = max(track.depth_m, -contact.dist[i])
                if force > STANDS * self.weight:
                    body = self.model.carriers[j]
                    v = d.cvel[body]
                    arm = places[i] - d.subtree_com[m.body_rootid[body]]
                    slip[j] = math.hypot(v[3] + v[1] * arm[2] - v[2] * arm[1], v[4] + v[2] * arm[0] - v[0] * arm[2])
        if during is None:
            return
        planned, up, stance = self.plan[min(during, len(self.plan) - 1)]
        height = planned[2]
        yaw = self._yaw()
        r = d.xmat[1]
        c, s = math.cos(yaw), math.sin(yaw)
        cosine = (c * r[2] + s * r[5]) * up[0] + (c * r[5] - s * r[2]) * up[1] + r[8] * up[2]
        tilt = math.acos(min(max(cosine, -1.0), 1.0))
        if len(track.yaw_rad) in track.marks[-1:]:
            self.measure_place()
        track.yaw_rad.append(yaw)
        track.base_m.append(d.xpos[1].copy())
        track.height_error_m.append(d.xpos[1, 2] - height)
        track.tilt_rad.append(tilt)
        track.load_n.append(self.load.copy())
        track.slip_m_s.append(slip)
        track.planned_stance.append(stance)
        force = d.actuator_force
        track.saturated.append((force >= high - 1e-9) | (force <= low + 1e-9))
        which = robots.driven(self.model.robot)
        driven = d.qpos[self.model.joint_qpos[which]] / self.model.per_rad[which]
        errors = np.abs(driven - position_rad[: len(driven)])
        track.joint_error_rad.append(errors.max(initial=0.0))
        com = d.subtree_com[1][2]
        # The centre of mass is below its plan by as much as the body, whose origin is arbitrary.
        planned_com = com + height - d.xpos[1, 2]
        if self.falls.fell(tilt, com / planned_com, on_trunk_n / self.weight, m.opt.timestep):
            track.fell_at_s = len(track.yaw_rad) * m.opt.timestep

    def _yaw(self):
        r = self.d.xmat[1]
        return math.atan2(r[3], r[0])

    def measure_place(self):
        """Records the robot's centre of mass and heading, at the beginning of each period and at the end."""
        self.track.com_m.append((self.d.subtree_com[1].copy(), self._yaw()))
