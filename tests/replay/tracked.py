"""A plan tracked in MuJoCo: the controller measures the robot at each tick, and its set-points act after a delay."""

from collections import deque

import numpy as np

import feedforward
from control import Control
from model import Ground, Model
from sensed import Sensed
import player
import world

CONTROL_HZ = 500


def run(rollwalk, plan, motion, robot, feedback, case=world.Case(), cycles=5, noise=None):
    """Plays a motion in closed loop, as `world.run` does in open loop. Returns its track, and the number of ticks
    without tracking."""
    ground = Ground()
    model = Model(robot, motion.gravity_m_s2, ground)
    torques, _ = feedforward.frames(model, motion)
    simulation = world.Simulation(model, motion, case)
    simulation.track.planned_base_m = np.array([position for position, _, _ in simulation.plan])
    simulation.start(moving=motion.ends != "at_rest")
    rest = motion.ends == "at_rest"
    with Control(rollwalk, plan, robot, feedback, CONTROL_HZ, case.delay_s) as control:
        loop = _Loop(simulation, control, noise, player.hold(robot, motion.frames()[0], torques[0], "torque"))
        if rest:
            loop.play(0.0, world.SETTLE_S, moves=False, measured=False)
        for period in range(cycles if motion.periodic else 1):
            simulation.track.marks.append(len(simulation.track.yaw_rad))
            if not loop.play(period * motion.duration_s, motion.duration_s):
                return simulation.track, loop.untracked
        if rest:
            loop.play(motion.duration_s, world.SETTLE_S, moves=False)
    simulation.track.marks.append(len(simulation.track.yaw_rad))
    simulation.measure_place()
    return simulation.track, loop.untracked


class _Loop:
    def __init__(self, simulation, control, noise, first):
        self.simulation, self.control = simulation, control
        m = simulation.m
        self.sensed = Sensed(simulation.model, m.opt.gravity, noise)
        self.per_tick = round(1 / (CONTROL_HZ * m.opt.timestep))
        self.delay = round(simulation.case.delay_s / m.opt.timestep)
        # Set-points that do not act yet, by the step at which they begin to act.
        self.on_their_way = deque()
        self.steps = 0
        self.untracked = 0
        simulation.command(first, 0)
        self.position_rad = first.position_rad[0]

    def play(self, first_s, duration_s, moves=True, measured=True):
        """Steps through the motion from a time, or rests at that time. Returns False if the robot fell."""
        simulation, step_s = self.simulation, self.simulation.m.opt.timestep
        for k in range(round(duration_s / step_s)):
            time_s = first_s + (k * step_s if moves else 0.0)
            if self.steps % self.per_tick == 0:
                record = self.sensed.record(simulation.d, simulation.load, time_s, self.per_tick * step_s)
                setpoints, why = self.control.tick(record)
                self.untracked += why is not None
                self.on_their_way.append((self.steps + self.delay, setpoints))
            while self.on_their_way and self.on_their_way[0][0] <= self.steps:
                self._command(self.on_their_way.popleft()[1])
            simulation.push(first_s if moves else None, k * step_s)
            during = k if moves else len(simulation.plan) - 1
            simulation.step(during if measured else None, self.position_rad)
            self.steps += 1
            if simulation.track.fell_at_s is not None:
                return False
        return True

    def _command(self, setpoints):
        m, kp, kd = self.simulation.m, setpoints["kp_nm_rad"], setpoints["kd_nm_s_rad"]
        m.actuator_biasprm[:, 1], m.actuator_biasprm[:, 2] = -kp, -kd
        self.position_rad = setpoints["position_rad"]
        self.simulation.d.ctrl[:] = kp * self.position_rad + kd * setpoints["speed_rad_s"] + setpoints["torque_nm"]
