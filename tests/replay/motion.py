"""A plan as a function of time, and the 60 Hz frames that a controller would get.

The curves are those of docs/formats/plan-format.md, "Between the samples"; quantisation is that of docs/formats/motion-library.md.
"""

import json
import math

import numpy as np

from curves import Spline
from errors import Unusable, field_error
import plan_fields
import robots

RATE_HZ = 60
# The fields that are read here have not changed since this version. Fields of later versions are ignored, or looked
# up by name.
OLDEST_VERSION = 3


class Motion:
    """A plan with its curves."""

    def __init__(self, plan):
        self.plan = plan
        self.name = plan["motion"]["name"]
        self.ends = plan["motion"]["ends"]
        self.needs_feedback = plan["motion"].get("needs_feedback")
        self.periodic = self.ends == "periodic"
        self.duration_s = plan["motion"]["duration_s"]
        self.spacing_s = plan["sample_interval_s"]
        self.samples = plan["samples"]
        self.robot = robots.from_plan(plan)
        self.offset_m = np.array(plan["end_placement"]["offset_m"])
        self.yaw_rad = plan["end_placement"]["yaw_rad"]
        self.gravity_m_s2 = plan["formulation"]["gravity_m_s2"]
        self.rolling_sign_width_m_s = plan["formulation"]["rolling_sign_width_m_s"]

        real = lambda of, growth: self._curve(of, 1.0, growth)
        growth = np.zeros(4 + len(self.robot["joints"]))
        growth[1] = self.yaw_rad
        self._pose = real(
            lambda s: [s["base_position_m"][2], *s["base_yaw_pitch_roll_rad"], *s["joint_rad"]], growth
        )
        # Offsets of set-points from joint angles, in retargeted plans.
        count = len(self.robot["joints"])
        self._correction = real(lambda s: s.get("joint_correction_rad") or [0.0] * count, np.zeros(count))
        turn = complex(math.cos(self.yaw_rad), math.sin(self.yaw_rad))
        self._xy = self._curve(
            lambda s: [complex(*s["base_position_m"][:2])], turn, np.array([complex(*self.offset_m)])
        )
        self._motor = self._angles()
        self._forces = np.array([[e["force_n"] for e in s["end_effectors"]] for s in self.samples])
        self._stance = np.array([[e["contact"] for e in s["end_effectors"]] for s in self.samples])
        if self.periodic:
            rotation = yaw_matrix(self.yaw_rad)
            self._forces = np.concatenate([self._forces, self._forces[:1] @ rotation.T])
            self._stance = np.concatenate([self._stance, self._stance[:1]])

    def _curve(self, of, turn, shift):
        values = np.array([of(s) for s in self.samples], dtype=complex)
        before, after = (np.array(of(self.plan[key]), dtype=complex) for key in ("before", "after"))
        return self._through(values, before, after, turn, shift)

    def _through(self, values, before, after, turn, shift):
        h = self.spacing_s
        if self.periodic:
            return Spline.periodic(h, values, turn, shift)
        if self.ends == "at_rest":
            return Spline.clamped(h, values, 0.0, 0.0)
        return Spline.clamped(h, values, (values[0] - before) / h, (after - values[-1]) / h)

    def _angles(self):
        """Angles that the wheels' motors accumulate: planned speeds are means over intervals."""
        h = self.spacing_s
        speeds = np.array([[e["motor_speed_rad_s"] for e in s["end_effectors"]] for s in self.samples])
        before = np.array([e["motor_speed_rad_s"] for e in self.plan["before"]["end_effectors"]])
        angles = np.vstack([np.zeros(len(before)), np.cumsum(speeds * h, axis=0)])
        return self._through(angles[:-1].astype(complex), -before * h + 0j, angles[-1] + 0j, 1.0, angles[-1] + 0j)

    def base(self, time_s):
        """Base position and yaw, pitch, roll at a time of the plan; a periodic motion continues in later periods."""
        time_s, periods = self._within(time_s)
        pose = self._pose.at(time_s)[0].real
        xy = self._xy.at(time_s)[0][0]
        yaw = pose[1]
        turn, offset = complex(math.cos(self.yaw_rad), math.sin(self.yaw_rad)), complex(*self.offset_m)
        for _ in range(periods):
            xy, yaw = turn * xy + offset, yaw + self.yaw_rad
        for _ in range(-periods):
            xy, yaw = turn.conjugate() * (xy - offset), yaw - self.yaw_rad
        return np.array([xy.real, xy.imag, pose[0]]), np.array([yaw, pose[2], pose[3]])

    def joints(self, time_s):
        """Joint angles and speeds."""
        value, slope = self._pose.at(self._within(time_s)[0])
        return value.real[4:], slope.real[4:]

    def setpoints_rad(self, time_s):
        """Set-points of the joints' drives, rad."""
        return self.joints(time_s)[0] + self._correction.at(self._within(time_s)[0])[0].real

    def motors(self, time_s):
        """Angle and speed of every end effector's wheel against its link."""
        time_s, periods = self._within(time_s)
        value, slope = self._motor.at(time_s)
        return value.real + periods * self._motor.values[-1].real, slope.real

    def forces(self, time_s):
        """Ground forces, linear between the samples, in the world frame of the first period."""
        i, u = self._interval(time_s)
        return (1 - u) * self._forces[i] + u * self._forces[i + 1]

    def stance(self, time_s):
        """Flags of stance feet, which are in stance at both neighbouring samples."""
        i, u = self._interval(time_s)
        if u < 1e-9:
            return self._stance[i]
        if u > 1 - 1e-9:
            return self._stance[i + 1]
        return self._stance[i] & self._stance[i + 1]

    def carried_torques(self, time_s):
        """Torques of joints and wheels in the plan file, in channel order, linear between the samples; None if the plan has no torques.
        """
        first = self.samples[0]
        if "joint_torque_nm" not in first:
            return None
        i, u = self._interval(time_s)
        driven = [j for j, foot in enumerate(self.robot["end_effectors"]) if "actuator" in foot["contact"]]

        def of(sample):
            wheels = [sample["end_effectors"][j]["motor_torque_nm"] for j in driven]
            return np.array([sample["joint_torque_nm"][k] for k in robots.driven(self.robot)] + wheels)

        last = len(self.samples) - 1
        following = i + 1 if i < last else (0 if self.periodic else last)
        return (1 - u) * of(self.samples[i]) + u * of(self.samples[following])

    def _interval(self, time_s):
        position = self._within(time_s)[0] / self.spacing_s
        i = min(max(int(position), 0), len(self._forces) - 2)
        return i, min(max(position - i, 0.0), 1.0)

    def _within(self, time_s):
        if not self.periodic:
            return min(max(time_s, 0.0), self.duration_s), 0
        # A time that is a whole number of periods except for rounding is the start of a period.
        periods = math.floor(time_s / self.duration_s + 1e-9)
        return max(time_s - periods * self.duration_s, 0.0), periods

    def planned(self):
        """Planned displacement of the centre of mass along and across the first heading, and turn: of a period, or of
        the motion."""
        yaw = self.samples[0]["base_yaw_pitch_roll_rad"][0]
        start = np.array(self.samples[0]["com_m"])
        if self.periodic:
            end = np.array(self.plan["after"]["com_m"])
            turned = self.yaw_rad
        else:
            end = np.array(self.samples[-1]["com_m"])
            turned = self.samples[-1]["base_yaw_pitch_roll_rad"][0] - yaw
        moved = yaw_matrix(yaw).T @ (end - start)
        return {"forward_m": moved[0], "left_m": moved[1], "turn_rad": turned}

    def frame_rate_hz(self):
        """60 Hz, or the nearest rate at which the duration is a whole number of frames."""
        return max(round(self.duration_s * RATE_HZ), 1) / self.duration_s

    def frames(self):
        """Setpoints of all channels at every frame: rad and rad/s, in quanta of a library."""
        rate = self.frame_rate_hz()
        count = round(self.duration_s * rate) + (0 if self.periodic else 1)
        driven = [j for j, foot in enumerate(self.robot["end_effectors"]) if "actuator" in foot["contact"]]
        rows = []
        for k in range(count):
            joints, motors = self.setpoints_rad(k / rate), self.motors(k / rate)[1]
            rows.append(np.concatenate([joints[robots.driven(self.robot)], motors[driven]]))
        return quantised(np.array(rows), self.robot)


def quantised(frames, robot):
    """Values as in a library: whole quanta within the limits."""
    out = frames.copy()
    for column, (_, actuator, joint, _) in enumerate(robots.channels(robot)):
        exponent = -10
        if joint is not None:
            low, high = joint["position_min_rad"], joint["position_max_rad"]
        else:
            low, high = -actuator["speed_max_rad_s"], actuator["speed_max_rad_s"]
            while exponent < 6 and high > 32000 * 2.0**exponent:
                exponent += 1
        quantum = 2.0**exponent
        quanta = np.trunc(frames[:, column] / quantum + np.copysign(0.5, frames[:, column]))
        out[:, column] = np.clip(quanta, math.ceil(low / quantum), math.floor(high / quantum)) * quantum
    return out


def quantised_torques(torques, robot):
    """Torques as in a library: quanta of the limit divided by 1024 to 2047, within the limits."""
    out = torques.copy()
    for column, (_, actuator, _, _) in enumerate(robots.channels(robot)):
        limit = actuator["torque_max_nm"]
        quantum = 2.0 ** (math.floor(math.log2(limit)) - 10)
        quanta = np.trunc(torques[:, column] / quantum + np.copysign(0.5, torques[:, column]))
        most = math.floor(limit / quantum)
        out[:, column] = np.clip(quanta, -most, most) * quantum
    return out


def yaw_matrix(yaw):
    c, s = math.cos(yaw), math.sin(yaw)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def load(path):
    """The motion of a plan file."""
    try:
        with open(path, encoding="utf-8") as file:
            plan = json.load(file)
    except (OSError, ValueError, RecursionError) as error:
        raise Unusable(f"{path}: {error}") from error
    if not isinstance(plan, dict) or plan.get("format") != "rollwalk-plan":
        raise Unusable(f"{path}: field format is not rollwalk-plan")
    version = plan.get("version")
    if not isinstance(version, int) or version < OLDEST_VERSION:
        raise Unusable(f"{path}: field version is {version!r}; expected {OLDEST_VERSION} or later")
    try:
        plan_fields.check(plan)
        return Motion(plan)
    except (LookupError, TypeError, ValueError, AttributeError) as error:
        raise Unusable(f"{path}: {field_error(error)}") from error

