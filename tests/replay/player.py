"""Set-points of the controller: frames at 60 Hz, cubic Hermite between them, the limiter, at the control rate.

See docs/playback-and-safety.md, "From a frame to a setpoint". Playback is open loop, so all setpoints of a run are
known before it begins.
"""

from dataclasses import dataclass

import numpy as np

import robots
from motion import RATE_HZ

# Default of the firmware.
CONTROL_HZ = 120
GRAVITY_M_S2 = 9.80665
# Values of the firmware's limiter: maximum offsets that replace a torque, of a joint's target, rad, and of a wheel's
# speed, rad/s; minimum time in which a torque changes by its limit, s.
OFFSET_RAD, OFFSET_RAD_S = 0.15, 1.0
FULL_TORQUE_S = 0.025


@dataclass
class Setpoints:
    """Set-points of a run: a row for each control tick, a column for each channel."""

    period_s: float
    position_rad: np.ndarray
    speed_rad_s: np.ndarray
    torque_nm: np.ndarray


def setpoints(robot, frames, torques, motion, periods, feed_forward, control_hz=CONTROL_HZ):
    """Set-points of a motion that is played `periods` times, or once. Its torques are sent as torque, as offset of the target, or not.

    The holds before and after a motion that ends are not included: see `hold` and `world.run`.
    """
    per_frame = control_hz // RATE_HZ
    count = len(frames)
    ticks = count * per_frame * periods if motion.periodic else (count - 1) * per_frame + 1
    k = np.arange(ticks)
    index, u = k // per_frame, (k % per_frame / per_frame)[:, None]
    at = lambda i: frames[i % count] if motion.periodic else frames[np.clip(i, 0, count - 1)]
    before, start, end, after = (at(index + j) for j in (-1, 0, 1, 2))
    # Slopes at frames are central differences, m0 and m1 in units of a frame.
    m0, m1, rise = 0.5 * (end - before), 0.5 * (after - start), end - start
    c2, c3 = 3 * rise - 2 * m0 - m1, m0 + m1 - 2 * rise
    value = start + u * (m0 + u * (c2 + u * c3))
    rate = motion.frame_rate_hz()
    slope = (m0 + u * (2 * c2 + u * 3 * c3)) * rate

    at = lambda i: torques[i % count] if motion.periodic else torques[np.clip(i, 0, count - 1)]
    torque = (1 - u) * at(index) + u * at(index + 1)
    channels = robots.channels(robot)
    wheel = np.array([joint is None for _, _, joint, _ in channels])
    period_s = 1 / (rate * per_frame)
    most = np.array([a["torque_max_nm"] for _, a, _, _ in channels])
    torque = _limited_torque(torque, most, most * period_s / FULL_TORQUE_S)
    if feed_forward == "offset":
        value = value + _offset(channels, wheel, torque)
    if feed_forward != "torque":
        torque = np.zeros_like(torque)
    value, slope = _limited(robot, channels, value, slope, period_s)
    slope[:, wheel] = 0
    return Setpoints(period_s, value, slope, torque)


def _offset(channels, wheel, torque):
    """Offset of the target for drives without a torque field. The spring, or for a wheel the damper, then produces
    the torque."""
    gain = np.array([a["kd_nm_s_rad"] if w else a["kp_nm_rad"] for (_, a, _, _), w in zip(channels, wheel)])
    most = np.where(wheel, OFFSET_RAD_S, OFFSET_RAD)
    return np.clip(np.divide(torque, gain, out=np.zeros_like(torque), where=gain > 0), -most, most)


def _limited_torque(torque, most, step):
    """Limiter of torques: limit, and change per tick. The initial torques are in force at the start."""
    torque = np.clip(torque, -most, most)
    for k in range(1, len(torque)):
        torque[k] = np.clip(torque[k], torque[k - 1] - step, torque[k - 1] + step)
    return torque


def _limited(robot, channels, value, slope, period_s):
    """Limiter: range, then change per tick. The speed of a clamped value is its change."""
    low, high, step = (np.empty(len(channels)) for _ in range(3))
    most_speed = np.array([actuator["speed_max_rad_s"] for _, actuator, _, _ in channels])
    for c, (_, actuator, joint, foot) in enumerate(channels):
        if joint is not None:
            low[c], high[c] = joint["position_min_rad"], joint["position_max_rad"]
            step[c] = actuator["speed_max_rad_s"] * period_s
        else:
            wheel = robot["end_effectors"][foot]
            low[c], high[c] = -actuator["speed_max_rad_s"], actuator["speed_max_rad_s"]
            grip = wheel["friction_coefficient"] * GRAVITY_M_S2 / wheel["radius_m"]
            step[c] = min(grip, actuator["torque_max_nm"] / actuator["armature_kg_m2"]) * period_s
    out, speeds = np.empty_like(value), np.empty_like(slope)
    last = np.clip(value[0], low, high)
    for k in range(len(value)):
        now = np.clip(np.clip(value[k], low, high), last - step, last + step)
        clamped = np.where(now != value[k], (now - last) / period_s, slope[k])
        speeds[k] = np.clip(clamped, -most_speed, most_speed)
        out[k] = last = now
    return out, speeds


def hold(robot, frame, torque, feed_forward):
    """Set-points of a robot that holds one frame, with the holding torques; its wheels stand still."""
    channels = robots.channels(robot)
    wheel = np.array([joint is None for _, _, joint, _ in channels])
    value = np.where(wheel, 0.0, frame)
    if feed_forward == "offset":
        value = value + _offset(channels, wheel, torque)
    if feed_forward != "torque":
        torque = np.zeros_like(torque)
    return Setpoints(1.0, value[None], np.zeros_like(value)[None], torque[None])
