"""Measurements of the robot in MuJoCo for a controller: its state, or an IMU, encoders and contact switches with noise.

The plane of the world is level; on a slope, the direction of gravity is tilted instead. All values are rotated to axes whose z is up.
"""

from dataclasses import dataclass
import math

import mujoco
import numpy as np

import robots

# Share of the weight above which an end effector counts as touching.
TOUCHES = 0.005


@dataclass(frozen=True)
class Noise:
    """Standard deviations of white noise in each sample, and a bias, in axes of the body, as in `rollwalk simulate
    --estimate`."""

    gyro_rad_s: float = 0.02
    gyro_bias_rad_s: tuple = (0.005, -0.005, 0.005)
    accelerometer_m_s2: float = 0.1
    speed_rad_s: float = 0.05


class Sensed:
    """The records of one run."""

    def __init__(self, model, gravity_m_s2, noise, seed=1):
        """`gravity_m_s2` is the vector in the model."""
        self.model, self.noise, self.random = model, noise, np.random.default_rng(seed)
        self.gravity = gravity_m_s2.copy()
        self.least_n = TOUCHES * model.mass_kg * np.linalg.norm(gravity_m_s2)
        spin = [j for j, foot in enumerate(model.robot["end_effectors"]) if robots.is_wheel(foot)]
        self.wheel_dofs = [model.wheel_dofs[j] for j in spin]
        # Shortest turn of the direction against gravity to z.
        self.turn = _shortest(-gravity_m_s2 / np.linalg.norm(gravity_m_s2), np.array([0.0, 0.0, 1.0]))
        self.last = None

    def placement(self):
        """Pose of the plan in axes whose z is up."""
        return {"position_m": [0.0, 0.0, 0.0], "orientation_wxyz": self.turn.tolist()}

    def record(self, d, load, time_s, tick_s):
        """A line for the controller. `load` is the load of each end effector, N."""
        speed = d.qvel[self.model.joint_dofs] / self.model.per_rad, d.qvel[self.wheel_dofs]
        record = {"time_s": time_s, "touches": (load > self.least_n).tolist(), "joint_rad": (d.qpos[self.model.joint_qpos] / self.model.per_rad).tolist()}
        is_first = self.last is None
        if is_first:
            record["world_from_plan"] = self.placement()
        if self.noise is None or is_first:
            # A robot that estimates its state knows its initial pose.
            record["base"] = self._base(d)
        if self.noise is not None:
            record["imu"] = self._imu(d, tick_s)
            speed = [s + self.noise.speed_rad_s * self.random.standard_normal(len(s)) for s in speed]
        record["joint_speed_rad_s"], record["wheel_speed_rad_s"] = (s.tolist() for s in speed)
        self.last = d.qvel[0:3].copy(), d.qpos[3:7].copy()
        return record

    def _base(self, d):
        turned, orientation, out = np.zeros(3), np.zeros(4), []
        mujoco.mju_mulQuat(orientation, self.turn, d.qpos[3:7])
        # MuJoCo gives the spin of a free joint in axes of the body.
        for vector, by in ((d.qpos[0:3], self.turn), (d.qvel[0:3], self.turn), (d.qvel[3:6], orientation)):
            mujoco.mju_rotVecQuat(turned, vector, by)
            out.append(turned.tolist())
        keys = ("position_m", "velocity_m_s", "angular_velocity_rad_s")
        return dict(zip(keys, out), orientation_wxyz=orientation.tolist())

    def _imu(self, d, tick_s):
        noise, normal = self.noise, lambda: self.random.standard_normal(3)
        imu = {"gyro_rad_s": (d.qvel[3:6] + noise.gyro_bias_rad_s + noise.gyro_rad_s * normal()).tolist()}
        if self.last is not None:
            velocity, orientation = self.last
            # Midway between the samples, like the mean of the force.
            middle, force = orientation + d.qpos[3:7] * math.copysign(1.0, orientation @ d.qpos[3:7]), np.zeros(3)
            mujoco.mju_normalize4(middle)
            middle[1:] *= -1
            mujoco.mju_rotVecQuat(force, (d.qvel[0:3] - velocity) / tick_s - self.gravity, middle)
            imu["accelerometer_m_s2"] = (force + noise.accelerometer_m_s2 * normal()).tolist()
        return imu


def _shortest(one, other):
    """Quaternion that rotates a unit vector to another, which must not be opposite."""
    turn = np.array([1.0 + one @ other, *np.cross(one, other)])
    return turn / np.linalg.norm(turn)
