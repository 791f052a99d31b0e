#!/usr/bin/env python3
"""Tests of `rollwalk control` in MuJoCo.

    python3 tests/replay/test_tracked.py ROLLWALK PLAN.json

ROLLWALK is the program, PLAN.json the plan of `motions/anymal_turn.toml`, of which open loop achieves less than half.
"""

import sys
import unittest
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent))

import jobs  # noqa: E402
import measure  # noqa: E402
import mujoco  # noqa: E402
import tracked  # noqa: E402
import tracking  # noqa: E402
import world  # noqa: E402
from control import Control  # noqa: E402
from model import Model  # noqa: E402
from sensed import Noise, Sensed  # noqa: E402


class Tracked(unittest.TestCase):
    def setUp(self):
        self.motion, self.robot, _, _ = jobs.load(PLAN, "torque", jobs.Inputs(None, tracking.ROBOTS))
        self.model = Model(self.robot, self.motion.gravity_m_s2)

    def test_both_sides_mean_the_same_state(self):
        d = mujoco.MjData(self.model.m)
        d.qpos[:], d.qvel[:], _ = self.model.derivatives(self.motion, 0.0)
        ours = Sensed(self.model, self.model.m.opt.gravity, None).record(d, np.zeros(len(self.model.foot_geoms)), 0.0, 0.002)
        with Control(ROLLWALK, PLAN, self.robot, "tasks", 500) as control:
            start = control.hello["start"]
        for key in ("joint_rad", "joint_speed_rad_s", "wheel_speed_rad_s"):
            np.testing.assert_allclose(ours[key], start[key], atol=1e-5)
        for key, value in start["base"].items():
            np.testing.assert_allclose(ours["base"][key], value, atol=1e-5)

    def test_a_slope_is_level_to_no_one(self):
        """Record of a body at rest on a slope. It has the tilt of the slope, and its accelerometer measures gravity
        in the body's axes."""
        simulation = world.Simulation(self.model, self.motion, world.Case(slope_rad=0.1))
        simulation.start(moving=False)
        sensed = Sensed(self.model, self.model.m.opt.gravity, Noise(0.0, (0.0, 0.0, 0.0), 0.0, 0.0))
        for _ in range(2):
            record = sensed.record(simulation.d, simulation.load, 0.0, 0.002)
        # The robot faces uphill, with the plan's heading x.
        g = self.motion.gravity_m_s2
        np.testing.assert_allclose(record["imu"]["accelerometer_m_s2"], [g * np.sin(0.1), 0.0, g * np.cos(0.1)], atol=1e-2)
        # Nose up is a rotation about -y.
        np.testing.assert_allclose(sensed.placement()["orientation_wxyz"], [np.cos(0.05), 0.0, -np.sin(0.05), 0.0], atol=1e-9)

    def test_a_turn_comes_where_its_plan_does(self):
        for noise in (None, Noise()):
            with self.subTest(noise=noise):
                track, untracked = tracked.run(ROLLWALK, PLAN, self.motion, self.robot, "gains", cycles=2, noise=noise)
                result = measure.summary(self.motion, track, 2)
                self.assertIsNone(result["fell_at_s"])
                self.assertEqual(untracked, 0)
                self.assertTrue(0.98 < result["ratio"]["turn_rad"] < 1.02, result["ratio"])


if __name__ == "__main__":
    PLAN, ROLLWALK = sys.argv.pop(), sys.argv.pop()
    unittest.main()
